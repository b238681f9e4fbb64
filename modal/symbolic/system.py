"""Systems in symbols of scenes and of templates such as `chain:3`: which numbers stay, which become symbols."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.exact import exact, exact_links
from modal.modes.rows import COUNTED
from modal.scene import ModalSupport, Pendulum, Scene, require, title_of
from modal.scene.laws import JointPart
from modal.scene.points import CarrierEnd, End, LinkEnd, hanging_points, joined_points
from modal.scene.supports import Fixed
from modal.scene.validation import Part
from modal.symbolic.carriers import LETTERS, ORIGIN, STILL, Chain, SymbolicCarrier
from modal.symbolic.structures import JoinedSpring, SymbolicStructure

QUANTITIES = ("masses", "lengths", "gravity", "cart", "supports", "springs")
EQUAL = "equal"
"""All quantities as symbols, those that are equal in the file sharing one: as a textbook writes a scene."""
SYMBOLIC = (*QUANTITIES, EQUAL)
MOST_LINKS = 1000
"""Limit: links of a scene in exact numbers, refused beyond."""


def chain(n: int, kind: str = "bob", symbolic: tuple[str, ...] = (), sigma: tuple[int, ...] = ()) -> SymbolicStructure:
    """One chain of n bobs or rods: equal ones m, l unless `symbolic` names masses or lengths."""
    title = f"A single {kind}" if n == 1 else f"A chain of {dict(enumerate(COUNTED)).get(n, n)} {kind}s"
    return _hanging(title, STILL, (_links(n, kind, symbolic, sigma),))


def cart(
    n: int, count: int = 1, kind: str = "bob", symbolic: tuple[str, ...] = (), sigma: tuple[int, ...] = ()
) -> SymbolicStructure:
    """`count` equal chains of n bobs or rods on a cart of mass m_c."""
    hanging = (_links(n, kind, symbolic, sigma),) * count
    of = f"{n} {kind}{'s' if n > 1 else ''}"
    title = f"A chain of {of} on a cart" if count == 1 else f"{count} chains of {of} each on a cart"
    free = SymbolicCarrier("cart", "cart", (), ORIGIN, sp.zeros(1), sp.zeros(1), (False,), symbol("m_c"))
    return _hanging(title, free, hanging)


def _hanging(title: str, support: SymbolicCarrier, chains: tuple[Chain, ...]) -> SymbolicStructure:
    return SymbolicStructure(title, symbol("g"), (support,), chains, (CarrierEnd(0, ORIGIN),) * len(chains))


def _links(n: int, kind: str, symbolic: tuple[str, ...], sigma: tuple[int, ...]) -> Chain:
    has_masses, has_lengths = ("masses" in symbolic and n > 1, "lengths" in symbolic and n > 1)
    mass = tuple(symbol(f"m_{i}") for i in range(1, n + 1)) if has_masses else (symbol("m"),) * n
    length = tuple(symbol(f"l_{i}") for i in range(1, n + 1)) if has_lengths else (symbol("l"),) * n
    none = (sp.S.Zero,) * n
    centre, inertia = zip(*map(pair.proportions, (kind,) * n, mass, length), strict=True)
    return Chain(mass, length, centre, inertia, none, none, none, sigma or (1,) * n)


class Letters:
    """Names the numbers of a scene: each by its place, or with EQUAL by a letter for all that are equal.

    A letter has no number where one value alone has it, which is known when every value has been named once.
    """

    def __init__(self, symbolic: tuple[str, ...]) -> None:
        self.are_shared = EQUAL in symbolic
        self.quantities = QUANTITIES if self.are_shared else symbolic
        self.values: dict[Any, Any] = {}
        self._of_letter: dict[str, list[Any]] = {}

    def __contains__(self, quantity: str) -> bool:
        return quantity in self.quantities

    def __call__(self, letter: str, value: Any, place: str = "") -> Any:
        """The symbol of a number, which without sharing is named by its `place`."""
        if not self.are_shared:
            self.values[symbol(place)] = value
            return symbol(place)
        values = self._of_letter.setdefault(letter, [])
        if value not in values:
            values.append(value)
        name = symbol(letter if len(values) == 1 else f"{letter}_{values.index(value) + 1}")
        self.values[name] = value
        return name


def symbolic_structure(scene: Scene, symbolic: tuple[str, ...] = ()) -> SymbolicStructure:
    """A scene with its decimals as exact fractions, or as symbols for the quantities in `symbolic` (of SYMBOLIC).

    Copies of a pendulum share their symbols; those of several pendula begin with the number of the first copy. With
    "equal" all quantities are symbols, and numbers that are equal in the file share one; places of supports stay. Raise
    SceneError above MOST_LINKS links, and for what no derivation takes.
    """
    require(scene, "a derivation")
    scene = scene.still
    if scene.n_links > MOST_LINKS:
        raise SceneError([f"the scene has {scene.n_links} links: at most {MOST_LINKS} are written in exact numbers"])
    letters = Letters(symbolic)
    if letters.are_shared:
        structure_with(scene, letters)
    return structure_with(scene, letters)


def structure_with(scene: Scene, letters: Letters) -> SymbolicStructure:
    """The structure of a scene at rest, its numbers named by `letters`."""
    gravity = symbol("g") if "gravity" in letters else rational(scene.gravity)
    is_single_cart = [support.kind for support in scene.supports] == ["cart"]
    entries = zip(scene.supports, scene.support_names, strict=True)
    carriers = tuple(_carrier(support, name, () if is_single_cart else (name,), letters) for support, name in entries)
    pivot_ends = _pivot_ends(scene, letters)
    chains, in_space = _chains_of(scene, letters), scene.space == "space"
    spring_entries = tuple(_joining_spring(scene, entry, ends, letters, chains) for entry, ends in joined_points(scene))
    laws = _laws_of(scene) if "law" in scene.features else ()
    values = {name: rational(value) for name, value in letters.values.items()} | {symbol("g"): rational(scene.gravity)}
    return SymbolicStructure(
        title_of(scene), gravity, carriers, chains, pivot_ends, spring_entries, in_space, laws, values
    )


def _pivot_ends(scene: Scene, letters: Letters) -> tuple[CarrierEnd, ...]:
    """Where chains hang: with shared letters the distances of pivots on a fixed support, multiples of d in a row.

    Springs that end at other places keep all places in numbers, so that both ends of one are written alike.
    """
    ends = tuple(map(_exact, hanging_points(scene)))
    on_links = all(isinstance(end, LinkEnd) for _, both in joined_points(scene) for end in both)
    if not (letters.are_shared and scene.spring and on_links and [s.kind for s in scene.supports] == ["fixed"]):
        return ends
    along, down = zip(*(end.where for end in ends), strict=True)
    letter = "b" if any(spring.damping for spring in scene.spring) else "d"
    places = zip(_distances(along, letter, letters), _distances(down, "h", letters), strict=True)
    return tuple(end._replace(where=where) for end, where in zip(ends, places, strict=True))


def _distances(values: Sequence[Any], letter: str, letters: Letters) -> Iterator[Any]:
    """Coordinates as multiples of the smallest of them where they are, or each by a letter."""
    smallest = min((abs(value) for value in values if value), default=sp.S.One)
    is_row = all((value / smallest).is_integer for value in values)
    for value in values:
        unit = smallest if is_row else abs(value)
        yield value / unit * letters(letter, unit) if value else value


def _laws_of(scene: Scene) -> tuple[tuple[tuple[JointPart, ...], ...], ...]:
    """The laws of every joint, chain by chain, but for drives."""
    chains = [
        tuple(tuple(part for part in link.laws if not part.law.is_drive) for link in pendulum.chain)
        for pendulum in scene.hanging
    ]
    return tuple(chains)


def _carrier(support: Any, name: str, index: tuple[str, ...], letters: Letters) -> SymbolicCarrier:
    position = _rationals(support.position)
    if isinstance(support, Fixed):
        return SymbolicCarrier("fixed", name, index, position, sp.zeros(0), sp.zeros(0), ())
    if isinstance(support, ModalSupport):
        M, K, D = (_matrix(rows, len(support.M or ())) for rows in (support.M, support.K, support.D))
        points = tuple(tuple(tuple(map(rational, row)) for row in point) for point in support.points or ())
        return SymbolicCarrier("modal", name, index, position, K, D, (True,) * M.rows, masses=M, points=points)

    def number(letter: str, value: float, *way: str) -> Any:
        is_cart_mass = "cart" in letters and (support.kind, letter) == ("cart", "m")
        if not (is_cart_mass or (value and "supports" in letters)):
            return rational(value)
        index_name = name if index or support.kind != "cart" else "c"
        family = "_".join((letter, "c" if support.kind == "cart" else "s", *way))
        return letters(family, value, "_".join((letter, index_name, *way)))

    def diagonal(letter: str, values: float | Part) -> Any:
        if isinstance(values, Part):
            return sp.diag(*(number(letter, value, way) for way, value in values))
        return sp.diag(number(letter, values))

    is_foreign = support.kind not in LETTERS
    path = support.path if is_foreign else None
    values = {each.name: number(each.name, getattr(support, each.name)) for each in (path.parameters if path else ())}
    stiffness, damping = diagonal("k", support.stiffness), diagonal("d", support.damping)
    return SymbolicCarrier(
        support.kind,
        name,
        index,
        position,
        stiffness,
        damping,
        tuple(k != 0 for k in stiffness.diagonal()),
        number("m", support.mass),
        number("I", getattr(support, "inertia", 0.0)),
        number("L", 0.0 if path else getattr(support, "length", 0.0)),
        _rationals(getattr(support, "centre", (0.0, 0.0))),
        path=path,
        values=values,
    )


def _matrix(rows: Any, size: int) -> Any:
    return sp.zeros(size, size) if rows is None else sp.Matrix([list(map(rational, row)) for row in rows])


def _exact(end: End) -> Any:
    """A point with its decimals as exact fractions."""
    return type(end)(*(_exact_part(part) for part in end))


def _exact_part(part: Any) -> Any:
    return _rationals(part) if isinstance(part, tuple) else rational(part) if isinstance(part, float) else part


def _joining_spring(
    scene: Scene, entry: int, ends: tuple[End, End], letters: Letters, chains: tuple[Chain, ...]
) -> JoinedSpring:
    """A spring of an entry, whose symbols those of copies share."""
    spring = scene.spring[entry]
    numbers = [
        letters(letter, value, f"{letter}_{entry + 1}") if value and "springs" in letters else rational(value)
        for letter, value in (("k", spring.stiffness), ("d", spring.damping))
    ]
    first, second = (_end(end, letters, chains) for end in ends)
    return JoinedSpring((first, second), spring.kind == "torsion", *numbers)


def _end(end: End, letters: Letters, chains: tuple[Chain, ...]) -> End:
    """An end in exact numbers; with shared letters at its link's length, or at a distance from its joint."""
    end = _exact(end)
    if not (letters.are_shared and isinstance(end, LinkEnd) and end.below):
        return end
    length = [value for chain in chains for value in chain.length][end.link]
    return end._replace(below=length if end.below == letters.values[length] else letters("a", end.below))


def _chains_of(scene: Scene, letters: Letters) -> tuple[Chain, ...]:
    """The chains of a scene, a pendulum's copies one after another; names have the numbers that angles have."""
    chains: list[Chain] = []
    has_numbers = any(pendulum.n_links > 1 for pendulum in scene.pendulum)
    for pendulum in scene.pendulum:
        prefix = f"_{len(chains) + 1}" if len(scene.pendulum) > 1 else ""
        tails = [prefix + f"_{i + 1}" * has_numbers for i in range(pendulum.n_links)]
        chains += [_chain_of(pendulum, tails, letters)] * pendulum.count
    return tuple(chains)


def _chain_of(pendulum: Pendulum, tails: Sequence[str], letters: Letters) -> Chain:
    links = pendulum.chain
    mass, length, centre, inertia, _, rotor, sigma = map(list, zip(*exact_links(pendulum), strict=True))
    for i, link in enumerate(links):
        if "masses" in letters:
            mass[i] = letters("m", mass[i], f"m{tails[i]}")
        if "lengths" in letters:
            length[i] = letters("l", length[i], f"l{tails[i]}")
        centre[i], inertia[i] = link.proportions(mass[i], length[i], exact)
    damping, stiffness = ([exact(getattr(link, name)) for link in links] for name in ("damping", "stiffness"))
    if letters.are_shared:
        for letter, values in (("c", centre), ("I", inertia), ("d_j", damping), ("k_j", stiffness)):
            values[:] = [letters(letter, v) if isinstance(v, Fraction) and v else v for v in values]
    columns = (mass, length, centre, inertia, rotor, damping, stiffness, map(int, sigma))
    return Chain(*(tuple(map(sp.sympify, values)) for values in columns))


def rational(value: float) -> Any:
    """The decimal that a float is written as, as an exact fraction."""
    return sp.Rational(exact(value))


def symbol(name: str) -> Any:
    """A positive number by its name."""
    return sp.Symbol(name, positive=True)


def _rationals(values: Sequence[Any]) -> tuple[Any, Any]:
    first, second = map(rational, values)
    return first, second
