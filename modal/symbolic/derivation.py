"""A printed derivation: from the Lagrangian of a system to its eigen-polynomial and modes, section by section.

The target is `chain:3`, `cart:2`, `cart:3x2` (three chains of two links) or a scene.
Each section is a title and lines of (description, formula); `modal.symbolic.typesetting` prints them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import sympy as sp

from modal.errors import SceneError
from modal.scene import Bob, Cart, Fixed, Pendulum, Rod, Scene, load
from modal.scene.doors import require_type
from modal.symbolic import system as symbolic
from modal.symbolic.carriers import time_derivative
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
    vanishes,
    vector_equations,
    whole_energy,
)
from modal.symbolic.papers import equal
from modal.symbolic.structures import SymbolicStructure, force_of, force_symbol
from modal.symbolic.typesetting import Line, Section

if TYPE_CHECKING:
    from modal.scene.model import Way

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
        Line("coordinates", sp.Matrix([c.q for c in system.coordinates])),
        Line("momenta p = M q'", sp.Matrix([c.q for c in p])),
        Line("H, the energy in q and p, V of all parts as in the Lagrangian", whole_energy()),
        Line("with the mass matrix", equal(sp.Symbol("M"), M)),
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
    unknown = [word for word in chosen if word not in symbolic.SYMBOLIC]
    if unknown:
        raise SceneError([f"symbolic {word}: must be one of {', '.join(symbolic.SYMBOLIC)}" for word in unknown])
    if (template := _template(name, ways)) is None:
        scene = _load_scene(name, kind, ways)
        return symbolic.symbolic_structure(scene, chosen), scene
    support, count, links = template
    sigma = tuple(-1 if way == "up" else 1 for way in ways)
    if support == "chain":
        return symbolic.chain(links, kind, chosen, sigma), scene_of(name, kind, ways)
    return symbolic.cart(links, count, kind, chosen, sigma), scene_of(name, kind, ways)


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
    if links < 1 or count < 1 or links * count > symbolic.MOST_LINKS:
        raise SceneError([f"{name}: from 1 to {symbolic.MOST_LINKS} links in all"])
    if ways and (len(ways) != links or not set(ways) <= {"down", "up"}):
        raise SceneError([f"{name}: the equilibrium must be {links} of down and up, top to bottom"])
    return support, count, links
