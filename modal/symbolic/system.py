"""Systems in symbols of scenes and of templates such as `chain:3`: which numbers stay, which become symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.exact import exact, exact_links
from modal.scene import ModalSupport, Pendulum, Scene, require, title_of
from modal.scene.laws import JointPart
from modal.scene.points import CarrierEnd, End, hanging_points, joined_points
from modal.scene.supports import Fixed
from modal.scene.validation import Part
from modal.symbolic.carriers import LETTERS, ORIGIN, STILL, Chain, SymbolicCarrier
from modal.symbolic.structures import JoinedSpring, SymbolicStructure

SYMBOLIC = ("masses", "lengths", "gravity", "cart", "supports", "springs")
MOST_LINKS = 1000
"""Limit: links of a scene in exact numbers, refused beyond."""


def chain(n: int, kind: str = "bob", symbolic: tuple[str, ...] = (), sigma: tuple[int, ...] = ()) -> SymbolicStructure:
    """One chain of n bobs or rods: equal ones m, l unless `symbolic` names masses or lengths."""
    return _hanging(f"{n} {kind}{'s' if n > 1 else ''} in a chain", STILL, (_links(n, kind, symbolic, sigma),))


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
    mass = tuple(symbol(f"m_{i}") for i in range(1, n + 1)) if "masses" in symbolic else (symbol("m"),) * n
    length = tuple(symbol(f"l_{i}") for i in range(1, n + 1)) if "lengths" in symbolic else (symbol("l"),) * n
    none = (sp.S.Zero,) * n
    centre, inertia = zip(*map(pair.proportions, (kind,) * n, mass, length), strict=True)
    return Chain(mass, length, centre, inertia, none, none, none, sigma or (1,) * n)


def symbolic_structure(scene: Scene, symbolic: tuple[str, ...] = ()) -> SymbolicStructure:
    """A scene with its decimals as exact fractions, or as symbols for the quantities in `symbolic` (of SYMBOLIC).

    Copies of a pendulum share their symbols; those of several pendula begin with the number of the first copy.  Raises
    SceneError above MOST_LINKS links, and for what no derivation takes.
    """
    require(scene, "a derivation")
    scene = scene.still
    if scene.n_links > MOST_LINKS:
        raise SceneError([f"the scene has {scene.n_links} links: at most {MOST_LINKS} are written in exact numbers"])
    gravity = symbol("g") if "gravity" in symbolic else rational(scene.gravity)
    is_single_cart = [support.kind for support in scene.supports] == ["cart"]
    entries = zip(scene.supports, scene.support_names, strict=True)
    carriers = tuple(_carrier(support, name, () if is_single_cart else (name,), symbolic) for support, name in entries)
    pivot_ends = tuple(map(_exact, hanging_points(scene)))
    spring_entries = tuple(_joining_spring(scene, entry, ends, symbolic) for entry, ends in joined_points(scene))
    chains, in_space = chains_of(scene, symbolic), scene.space == "space"
    laws = _laws_of(scene) if "law" in scene.features else ()
    return SymbolicStructure(title_of(scene), gravity, carriers, chains, pivot_ends, spring_entries, in_space, laws)


def _laws_of(scene: Scene) -> tuple[tuple[tuple[JointPart, ...], ...], ...]:
    """The laws of every joint, chain by chain, but for drives."""
    chains = [
        tuple(
            tuple(part for part in link.laws if not part.law.is_drive)
            for link in pendulum.links
            for _ in range(link.count)
        )
        for pendulum in scene.pendulum
    ]
    return tuple(laws for laws, pendulum in zip(chains, scene.pendulum, strict=True) for _ in range(pendulum.count))


def _carrier(support: Any, name: str, index: tuple[str, ...], symbolic: tuple[str, ...]) -> SymbolicCarrier:
    position = _rationals(support.position)
    if isinstance(support, Fixed):
        return SymbolicCarrier("fixed", name, index, position, sp.zeros(0), sp.zeros(0), ())
    if isinstance(support, ModalSupport):
        M, K, D = (_matrix(rows, len(support.M or ())) for rows in (support.M, support.K, support.D))
        points = tuple(tuple(tuple(map(rational, row)) for row in point) for point in support.points or ())
        return SymbolicCarrier("modal", name, index, position, K, D, (True,) * M.rows, masses=M, points=points)

    def number(letter: str, value: float, *way: str) -> Any:
        is_cart_mass = "cart" in symbolic and (support.kind, letter) == ("cart", "m")
        index_name = name if index or support.kind != "cart" else "c"
        return (
            symbol("_".join((letter, index_name, *way)))
            if is_cart_mass or (value and "supports" in symbolic)
            else rational(value)
        )

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


def _joining_spring(scene: Scene, entry: int, ends: tuple[End, End], symbolic: tuple[str, ...]) -> JoinedSpring:
    """A spring of an entry, whose symbols those of copies share."""
    spring = scene.spring[entry]
    numbers = [
        symbol(f"{letter}_{entry + 1}") if value and "springs" in symbolic else rational(value)
        for letter, value in (("k", spring.stiffness), ("d", spring.damping))
    ]
    return JoinedSpring((_exact(ends[0]), _exact(ends[1])), spring.kind == "torsion", *numbers)


def chains_of(scene: Scene, symbolic: tuple[str, ...]) -> tuple[Chain, ...]:
    """The chains of a scene, a pendulum's copies one after another."""
    chains: list[Chain] = []
    for pendulum in scene.pendulum:
        prefix = f"{len(chains) + 1}_" if len(scene.pendulum) > 1 else ""
        chains += [_chain_of(pendulum, prefix, symbolic)] * pendulum.count
    return tuple(chains)


def _chain_of(pendulum: Pendulum, prefix: str, symbolic: tuple[str, ...]) -> Chain:
    links = [link for link in pendulum.links for _ in range(link.count)]
    mass, length, centre, inertia, _, rotor, sigma = map(list, zip(*exact_links(pendulum), strict=True))
    for i, link in enumerate(links):
        if "masses" in symbolic:
            mass[i] = symbol(f"m_{prefix}{i + 1}")
        if "lengths" in symbolic:
            length[i] = symbol(f"l_{prefix}{i + 1}")
        centre[i], inertia[i] = link.proportions(mass[i], length[i], exact)
    damping, stiffness = ([exact(getattr(link, name)) for link in links] for name in ("damping", "stiffness"))
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
