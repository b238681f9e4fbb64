"""A printed derivation: from the Lagrangian of a system to its eigen-polynomial and modes, section by section.

The target is `chain:3`, `cart:2`, `cart:3x2` (three chains of two links) or a scene.
Each section is a title and lines of (description, formula); `modal.symbolic.typesetting` prints them.
Some numbers of a system stay, others become symbols.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.exact import exact, exact_links
from modal.modes.rows import COUNTED
from modal.scene import Bob, Cart, Fixed, ModalSupport, Pendulum, Rod, Scene, load, require, title_of
from modal.scene.doors import require_type
from modal.scene.laws import JointPart
from modal.scene.points import CarrierEnd, End, LinkEnd, hanging_points, joined_points
from modal.scene.validation import Part
from modal.symbolic.carriers import ORIGIN, STILL, Chain, SymbolicCarrier, time_derivative
from modal.symbolic.eigen import modes_section, polynomial_section
from modal.symbolic.hamiltonian import (
    NOT_IN_SPACE,
    TITLE,
    derive_lagrangian,
    equations,
    gather_cosines,
    hamiltonian,
    in_angles,
    in_plane,
    in_vectors,
    momentum,
    momentum_lines,
    vanishes,
    vector_equations,
)
from modal.symbolic.papers import equal
from modal.symbolic.structures import JoinedSpring, SymbolicStructure, force_of, force_symbol
from modal.symbolic.typesetting import Line, Section

if TYPE_CHECKING:
    from modal.scene.model import Way

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
    free = SymbolicCarrier(
        "cart", "cart", (), ORIGIN, sp.zeros(1), sp.zeros(1), (False,), symbol("m_c"), path=Cart.path
    )
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

    letter_of = {"length": "L"} if support.kind == "swing" else {}
    names = [parameter.name for parameter in support.path.parameters]
    values = {name: number(letter_of.get(name, name), getattr(support, name)) for name in names}
    stiffness, damping = diagonal("k", support.stiffness), diagonal("d", support.damping)
    carries, mass = tuple(k != 0 for k in stiffness.diagonal()), number("m", support.mass)
    inertia = number("I", getattr(support, "inertia", 0.0))
    centre = _rationals(getattr(support, "centre", (0.0, 0.0)))
    forces = stiffness, damping, carries
    return SymbolicCarrier(
        support.kind, name, index, position, *forces, mass, inertia, centre, path=support.path, values=values
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


SECTIONS = ("lagrangian", "equations", "matrices", "polynomial", "modes")
ASKED_FOR = ("hamiltonian",)
"""Sections that are written where they are requested by name, after the others."""
MOST_CHECKED = 6
"""Cost: links of which T and the equations are checked against Cartesian ones (benchmarks/symbolic.py)."""
MOST_WRITTEN = 40
"""Limit: links of which equations are written, refused beyond: two pages."""
GRAVITY = 9.81
"""Physics: m/s² of the scenes that chain: and cart: stand for, as in the shipped ones."""
LAGRANGIAN = equal(sp.Symbol("L"), sp.Symbol("T") - sp.Symbol("V"))
_TARGET = re.compile(r"(chain|cart):(?:(\d{1,4})x)?(\d{1,4})")
KINDS = ("bob", "rod")
MEANINGS = {
    "m": "mass",
    "l": "length",
    "L": "length",
    "c": "distance of the centre of mass of a link from its upper joint",
    "I": "moment of inertia",
    "k": "stiffness",
    "a": "distance of the end of a spring from the joint above it",
    "b": "horizontal distance of pivots",
    "d": "horizontal distance of pivots",
    "h": "vertical distance of pivots",
    "g": "acceleration of free fall",
}
OWNERS = {"c": "the cart", "s": "a support", "j": "a joint"}


def derive(
    system: SymbolicStructure, show: tuple[str, ...] = SECTIONS, scene: Scene | None = None
) -> Iterator[Section]:
    """The sections of SECTIONS and ASKED_FOR named in `show`, in their order.

    `scene` is the scene of which `system` is the exact form, if any: its polynomial is then exact and integer. Raise
    SceneError for more links than readable equations allow.
    """
    require_type("system", system, "SymbolicStructure")
    if len(system.links) > MOST_WRITTEN and set(show) & {"lagrangian", "equations", "matrices", "hamiltonian"}:
        shorter = "choose `sections=polynomial,modes`"
        raise SceneError([f"{len(system.links)} links: equations are written for at most {MOST_WRITTEN}; {shorter}"])
    makers: dict[str, Callable[[], Section]] = {
        **{name: partial(write, system) for name, write in WRITERS.items()},
        "polynomial": lambda: polynomial_section(system, scene),
        "modes": lambda: modes_section(system, scene),
    }
    return (makers[name]() for name in (*SECTIONS, *ASKED_FOR) if name in show)


def symbols_section(system: SymbolicStructure) -> Section:
    """What the symbols that equal numbers share stand for, in one line."""
    dampers = {spring.damping for spring in system.springs}
    letters_of: dict[str, list[str]] = {}
    for name in sorted(system.symbols, key=lambda name: (tuple(MEANINGS).index(str(name)[0]), str(name))):
        letter, _, index = str(name).partition("_")
        owner = "a spring" if name in dampers or letter == "k" else "a link" if letter in "mlI" else ""
        owner = OWNERS.get(index[:1], owner)
        meaning = "damping constant" if letter == "d" and owner else MEANINGS[letter]
        word = str(name) if "_" in index else f"${name}$"
        letters_of.setdefault(meaning + f" of {owner}" * bool(owner), []).append(word)
    meanings = (f"{', '.join(letters)}: {meaning}" for meaning, letters in letters_of.items())
    return Section("Symbols", [Line("; ".join(meanings))])


def _lagrangian(system: SymbolicStructure) -> Section:
    """T and V, whole or of every support, chain and spring; SceneError if T and the rates of places disagree."""
    if system.spatial and system.has_joint_forces:
        return Section("Lagrangian", [Line(NOT_IN_SPACE)])
    T, lines = (_of_pair if system.is_of_pair else _of_parts)(system)
    if len(system.links) <= (3 if system.spatial else MOST_CHECKED):
        _require(vanishes(system.cartesian() - T))
        words = "$T$ equals the kinetic energy from the Cartesian velocities of all masses: checked term by term"
        lines.append(Line(words))
    return Section("Lagrangian", lines)


def _of_pair(system: SymbolicStructure) -> tuple[Any, list[Line]]:
    T = in_angles(system) if system.spatial else in_plane(system)
    lines = [Line("kinetic energy in $θ$ and $φ$" if system.spatial else "kinetic energy", equal(sp.Symbol("T"), T))]
    if system.spatial:
        lines.insert(0, Line("kinetic energy with unit vectors u_i", equal(sp.Symbol("T"), in_vectors(system))))
    plain = system.without_laws.potential
    V = gather_cosines(plain) + (system.potential - plain)
    lines.append(Line("potential energy", equal(sp.Symbol("V"), V)))
    return T, [*lines, *_dissipation_lines(system), Line("Lagrangian", LAGRANGIAN)]


def _of_parts(system: SymbolicStructure) -> tuple[Any, list[Line]]:
    lines = list(_pivots(system))
    for number, part in enumerate((*system.parts, *system.spring_energies), start=1):
        if part.T != 0:
            lines.append(Line(f"kinetic energy of {part.words}", equal(sp.Symbol(f"T_{number}"), part.T)))
        if part.V != 0:
            lines.append(Line(f"potential energy of {part.words}", equal(sp.Symbol(f"V_{number}"), part.V)))
    lines += [*_lengths(system), *_dissipation_lines(system)]
    lines.append(Line("Lagrangian, with $T$ and $V$ the sums of the above", LAGRANGIAN))
    return sp.Add(*(part.T for part in system.parts)), lines


def _dissipation_lines(system: SymbolicStructure) -> list[Line]:
    R = system.dissipation
    return [Line("dissipation function", equal(sp.Symbol("R"), R))] if R != 0 else []


def _pivots(system: SymbolicStructure) -> Iterator[Line]:
    """Places of first joints, one line for those that share one."""
    places: dict[tuple[Any, Any], list[int]] = {}
    for p, place in enumerate(system.pivots):
        places.setdefault(place, []).append(p + 1)
    for place, (first, *others) in places.items():
        which = f"pendulum {first}" if not others else f"pendula {', '.join(map(str, (first, *others)))}"
        ways = "horizontally" if all(carrier.kind == "fixed" for carrier in system.carriers) else "along the rail"
        yield Line(f"first joint of {which}, {ways} and downwards", sp.Tuple(*place))


def _lengths(system: SymbolicStructure) -> Iterator[Line]:
    for spring in system.springs:
        if spring.rest is not None:
            yield Line(f"length of spring {spring.number + 1}", equal(spring.ell.q, sp.sqrt(spring.square)))


def _equations(system: SymbolicStructure) -> Section:
    """Lagrange's equations; a stretched spring enters by its pull F and its length."""
    title = "Equations of motion"
    if system.spatial:
        return Section(title, _spatial_equations(system))
    forms = equations(system) if system.is_of_pair else system.equations()
    lines = [Line(f"for {c.q}", equal(form, 0)) for c, form in zip(system.coordinates, forms, strict=True)]
    if system.is_of_pair and len(system.links) <= MOST_CHECKED:
        plain = system.without_laws
        lagrange_forms = derive_lagrangian(plain).equations
        _require(all(vanishes(a - b) for a, b in zip(lagrange_forms, equations(plain), strict=True)))
        lines.append(Line("checked term by term against Lagrange's equations in Cartesian form"))
    return Section(title, [*lines, *_lengths(system), *_pulls(system)])


def _pulls(system: SymbolicStructure) -> Iterator[Line]:
    for spring in system.springs:
        if spring.rest is not None:
            yield Line(f"pull of spring {spring.number + 1}", equal(force_symbol(spring), force_of(spring)))


def _spatial_equations(system: SymbolicStructure) -> list[Line]:
    if system.has_joint_forces:
        return [Line(NOT_IN_SPACE)]
    lines = [
        Line(f"{u} · F = 0 with" if str(u) == "e_x" else f"{u} × F = 0 with", equal(sp.Symbol("F"), F))
        for u, F in vector_equations(system)
    ]
    lines.append(Line("u_i points along link i and e_z down: no angles, no singularity at equilibrium"))
    if len(system.links) <= 2:
        energy = replace(derive_lagrangian(system), T=in_angles(system))
        for c, form in zip(energy.coordinates, energy.equations, strict=True):
            lines.append(Line(f"for comparison in $θ$ and $φ$, for {c.q}", equal(sp.expand(form), 0)))
    return lines


def _matrices(system: SymbolicStructure) -> Section:
    M, K, D = system.matrices()
    q = sp.Matrix([c.q for c in system.coordinates])
    standing = any(sign < 0 for sign in system.sigma)
    words = f"deviations from equilibrium with {_ways(system)}" if standing else "small deviations from equilibrium"
    lines = [Line(words, equal(sp.Symbol("q"), q))]
    lines += [
        Line(f"the scene as drawn is an equilibrium where, by {at}", equal(slope, 0))
        for at, slope in system.conditions.items()
    ]
    lines += [Line("mass matrix", equal(sp.Symbol("M"), M)), Line("stiffness matrix", equal(sp.Symbol("K"), K))]
    lines += [Line("damping matrix", equal(sp.Symbol("D"), D))] if any(D) else []
    if system.spatial:
        lines.append(Line("along the rail; across it the same without $x$"))
    return Section("Linearized: $M q'' + D q' + K q = 0$" if any(D) else "Linearized: $M q'' + K q = 0$", lines)


def _ways(system: SymbolicStructure) -> str:
    return ", ".join(
        f"{angle.q} {'up' if sign < 0 else 'down'}" for angle, sign in zip(system.angles, system.sigma, strict=True)
    )


def _hamiltonian(system: SymbolicStructure) -> Section:
    """H and Hamilton's equations; of supports M(q) from the kinetic energies and p' from Lagrange's in p = M q'."""
    if system.is_of_pair:
        return hamiltonian(system)
    T, v = sp.Add(*(part.T for part in system.parts)), [c.v for c in system.coordinates]
    M, p = sp.hessian(T, v).applyfunc(sp.factor), [momentum(c) for c in system.coordinates]
    lines = [
        *momentum_lines(system, p, M, ", V of all parts as in the Lagrangian"),
        Line("rates of the coordinates, the derivatives of H by the momenta, solve M q' = p"),
        Line("rates of the momenta, minus the derivatives of H by the coordinates, less any dampers, in q'"),
    ]
    for rate, form, lagranges in zip(p, M * sp.Matrix(v), system.equations(), strict=True):
        force = sp.expand(time_derivative(form, system.coordinates) - lagranges)
        lines.append(Line(f"for {rate.q}", equal(rate.v, force)))
    return Section(TITLE, [*lines, *_lengths(system), *_pulls(system)])


WRITERS: dict[str, Callable[[SymbolicStructure], Section]] = {
    "lagrangian": _lagrangian,
    "equations": _equations,
    "matrices": _matrices,
    "hamiltonian": _hamiltonian,
}
"""How each section is written of the system alone."""


def _require(holds: bool) -> None:
    if not holds:
        raise SceneError(["the Cartesian derivation and the pair disagree: please report this scene"])


def target(
    name: str, kind: str = "bob", chosen: tuple[str, ...] = (), ways: tuple[str, ...] = ()
) -> tuple[SymbolicStructure, Scene]:
    """The system specified by `name`, and its scene, that of `scene_of` for chain: and cart:.

    `kind` and `ways` (down or up, top to bottom) apply to chain: and cart: only, as a scene has its own. Raise
    SceneError for anything invalid.
    """
    unknown = [word for word in chosen if word not in SYMBOLIC]
    if unknown:
        raise SceneError([f"symbolic {word}: must be one of {', '.join(SYMBOLIC)}" for word in unknown])
    if (template := _template(name, ways)) is None:
        scene = _load_scene(name, kind, ways)
        return symbolic_structure(scene, chosen), scene
    support, count, links = template
    sigma = tuple(-1 if way == "up" else 1 for way in ways)
    if support == "chain":
        return chain(links, kind, chosen, sigma), scene_of(name, kind, ways)
    return cart(links, count, kind, chosen, sigma), scene_of(name, kind, ways)


def scene_of(name: str, kind: str = "bob", ways: tuple[str, ...] = ()) -> Scene:
    """The same as a scene, that of chain: and cart: with masses of 1 kg and lengths of 1 m, the cart of 1 kg too.

    >>> scene_of("cart:2x3", "rod").n_links
    6
    """
    if (template := _template(name, ways)) is None:
        return _load_scene(name, kind, ways)
    support, count, links = template
    link = (Rod if kind == "rod" else Bob)(mass=1.0, length=1.0, count=links)
    pendulum = Pendulum(links=(link,), count=count, equilibrium=cast("tuple[Way, ...]", ways) or None)
    return Scene(gravity=GRAVITY, support=Cart(mass=1.0) if support == "cart" else Fixed(), pendulum=(pendulum,))


def _load_scene(name: str, kind: str, ways: tuple[str, ...]) -> Scene:
    if ways or kind != KINDS[0]:
        raise SceneError([f"{name}: `links` and `equilibrium` are for chain: and cart: only"])
    if name in TEMPLATES:
        raise SceneError([f"{name}: with how many links? {TEMPLATES[name]}"])
    return load(name)


TEMPLATES = {
    "chain": "chain:3 is a chain of three",
    "cart": "cart:3 is a chain of three on a cart, cart:2x3 two of them",
    "paper": "paper:000, paper:001 and paper:002 are equations of papers",
}
"""Targets without their numbers."""


def _template(name: str, ways: tuple[str, ...]) -> tuple[str, int, int] | None:
    """The support of chain: or cart:, the number of pendula and of links of each; None of the name of a scene."""
    match = _TARGET.fullmatch(str(name))
    if match is None:
        return None
    support, count, links = match[1], int(match[2] or 1), int(match[3])
    if support == "chain" and match[2]:
        raise SceneError([f"{name}: a chain has a single pendulum; write chain:{links}, or cart:{count}x{links}"])
    if links < 1 or count < 1 or links * count > MOST_LINKS:
        raise SceneError([f"{name}: from 1 to {MOST_LINKS} links in all"])
    if ways and (len(ways) != links or not set(ways) <= {"down", "up"}):
        raise SceneError([f"{name}: the equilibrium must be {links} of down and up, top to bottom"])
    return support, count, links
