"""The sections of a derivation that are written of a structure: energies part by part, equations, M, K and D."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import sympy as sp

from modal.errors import SceneError
from modal.symbolic.hamiltonian import TITLE, momentum, whole_energy
from modal.symbolic.lagrange import time_derivative
from modal.symbolic.lagrangian import vanishes
from modal.symbolic.papers import equal
from modal.symbolic.structures import SymbolicStructure, force_of, force_symbol
from modal.symbolic.typesetting import Line, Section

CHECKED_UP_TO = 6
"""Most links of which T is compared with the rates of all places."""


def lagrangian(system: SymbolicStructure) -> Section:
    """T and V of every carrier, chain and spring; SceneError if T and the rates of places disagree."""
    lines = list(_pivots(system))
    for part in (*system.parts, *system.stored):
        if part.T != 0:
            lines.append(Line(f"kinetic energy of {part.words}", equal(sp.Symbol("T"), part.T)))
        if part.V != 0:
            lines.append(Line(f"potential energy of {part.words}", equal(sp.Symbol("V"), part.V)))
    lines += _lengths(system)
    if system.dissipation != 0:
        lines.append(Line("dissipation function", equal(sp.Symbol("R"), system.dissipation)))
    lines.append(Line("Lagrangian, of the sums of these", equal(sp.Symbol("L"), sp.Symbol("T") - sp.Symbol("V"))))
    if len(system.links) <= CHECKED_UP_TO:
        T = sp.Add(*(part.T for part in system.parts))
        if not vanishes(system.cartesian() - T):
            raise SceneError(["T and the rates of all places disagree: please report this scene"])
        words = "$T$ equals the kinetic energy from the Cartesian velocities of all masses: checked term by term"
        lines.append(Line(words))
    return Section("Lagrangian", lines)


def _pivots(system: SymbolicStructure) -> Iterator[Line]:
    """Places of first joints, one line for those that share one."""
    places: dict[tuple[Any, Any], list[int]] = {}
    for p, place in enumerate(system.pivots):
        places.setdefault(place, []).append(p + 1)
    for place, (first, *more) in places.items():
        which = f"pendulum {first}" if not more else f"pendula {', '.join(map(str, (first, *more)))}"
        yield Line(f"first joint of {which}, along the rail and down", sp.Tuple(*place))


def _lengths(system: SymbolicStructure) -> Iterator[Line]:
    for spring in system.springs:
        if spring.rest is not None:
            yield Line(f"length of spring {spring.number + 1}", equal(spring.ell.q, sp.sqrt(spring.square)))


def equations(system: SymbolicStructure) -> Section:
    """Lagrange's equations; a stretched spring enters by its pull F and its length."""
    pairs = zip(system.coordinates, system.equations(), strict=True)
    lines = [Line(f"of {c.q}", equal(form, 0)) for c, form in pairs]
    return Section("Equations of motion", [*lines, *_lengths(system), *_pulls(system)])


def _pulls(system: SymbolicStructure) -> Iterator[Line]:
    for spring in system.springs:
        if spring.rest is not None:
            yield Line(f"pull of spring {spring.number + 1}", equal(force_symbol(spring), force_of(spring)))


def hamiltonian(system: SymbolicStructure) -> Section:
    """H and Hamilton's equations: M(q) from the kinetic energies, p' from Lagrange's equations in p = M q'."""
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
        lines.append(Line(f"of {rate.q}", equal(rate.v, force)))
    return Section(TITLE, [*lines, *_lengths(system), *_pulls(system)])


def matrices(system: SymbolicStructure) -> Section:
    """M, K and D about the drawn rest."""
    M, K, D = system.matrices()
    damped = any(D)
    lines = [
        Line("small deviations from equilibrium", equal(sp.Symbol("q"), sp.Matrix([c.q for c in system.coordinates])))
    ]
    lines += [
        Line(f"the scene as drawn is an equilibrium where, by {q}", equal(slope, 0))
        for q, slope in system.conditions.items()
    ]
    lines.append(Line("mass matrix", equal(sp.Symbol("M"), M)))
    lines.append(Line("stiffness matrix", equal(sp.Symbol("K"), K)))
    lines += [Line("damping matrix", equal(sp.Symbol("D"), D))] if damped else []
    return Section("Linearized: $M q'' + D q' + K q = 0$" if damped else "Linearized: $M q'' + K q = 0$", lines)


SECTIONS_OF_STRUCTURES: dict[str, Callable[[Any], Section]] = {
    "lagrangian": lagrangian,
    "equations": equations,
    "matrices": matrices,
    "hamiltonian": hamiltonian,
}
"""How each section is written."""
