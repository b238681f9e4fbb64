"""A derivation on paper: from the Lagrangian of a system to its eigen-polynomial and modes, section by section.

Each section is a title and lines of (what it is, formula); `modal.typeset` prints them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy as sp

from modal.eigen_sections import modes_section, polynomial_section
from modal.errors import SceneError
from modal.lagrangian import lagrangian, vanishes
from modal.papers import equal
from modal.scene import Scene
from modal.sections import Line, Section
from modal.symbolic import System

SECTIONS = ("lagrangian", "equations", "matrices", "polynomial", "modes")
CHECKED_UP_TO = 6
MOST_WRITTEN = 40


def derivation(system: System, show: tuple[str, ...] = SECTIONS, scene: Scene | None = None) -> Iterator[Section]:
    """The sections of SECTIONS that `show` names, in their order.

    `scene` is the one that `system` writes in numbers, if any: its polynomial is then exact and integer.  Raises
    SceneError for more links than equations can be read of.
    """
    if len(system.links) > MOST_WRITTEN and set(show) & {"lagrangian", "equations", "matrices"}:
        shorter = "choose --show polynomial,modes"
        raise SceneError([f"{len(system.links)} links: written out for at most {MOST_WRITTEN}; {shorter}"])
    makers = {
        "lagrangian": lambda: _lagrangian(system),
        "equations": lambda: _equations(system),
        "matrices": lambda: _matrices(system),
        "polynomial": lambda: polynomial_section(system, scene),
        "modes": lambda: modes_section(system, scene),
    }
    return (makers[name]() for name in SECTIONS if name in show)


def _lagrangian(system: System) -> Section:
    found = lagrangian(system)
    lines = [Line("kinetic energy", equal(sp.Symbol("T"), _kinetic(system)))] if not system.spatial else []
    lines += [Line("kinetic energy in θ and φ", equal(sp.Symbol("T"), found.T))] if system.spatial else []
    lines.append(Line("potential energy", equal(sp.Symbol("V"), sp.expand(found.V))))
    if found.R != 0:
        lines.append(Line("dissipation function", equal(sp.Symbol("R"), found.R)))
    lines.append(Line("Lagrangian", equal(sp.Symbol("L"), sp.Symbol("T") - sp.Symbol("V"))))
    if not system.spatial and len(system.links) <= CHECKED_UP_TO:
        _insist(vanishes(found.T - _kinetic(system)))
        lines.append(Line("T is that of the Cartesian velocities of all masses: checked term by term"))
    return Section("Lagrangian", lines)


def _kinetic(system: System) -> Any:
    """½ M x'² + x' Σ b_i cos θ_i θ_i' + ½ Σ A_ij cos(θ_i − θ_j) θ_i' θ_j'."""
    angles, A = system.angles, system.A
    T = sum(A[i, i] * one.v**2 / 2 for i, one in enumerate(angles))
    for i, one in enumerate(angles):
        for j, other in enumerate(angles[:i]):
            T += A[i, j] * sp.cos(other.q - one.q) * one.v * other.v
    if system.cart:
        v = system.coordinates[0].v
        T += system.total_mass * v**2 / 2
        T += v * sum(b * sp.cos(one.q) * one.v for b, one in zip(system.b, angles, strict=True))
    return T


def _equations(system: System) -> Section:
    title = "Equations of motion"
    if system.spatial:
        lines = [Line(f"{u} × F = 0 with", equal(sp.Symbol("F"), F)) for u, F in system.vector_equations()]
        return Section(
            title, [*lines, Line("u_i points along link i and e_z down: no angle, nothing singular at rest")]
        )
    found = system.equations()
    lines = [Line(f"of {c.q}", equal(form, 0)) for c, form in zip(system.coordinates, found, strict=True)]
    if len(system.links) <= CHECKED_UP_TO:
        derived = lagrangian(system).equations
        _insist(all(vanishes(a - b) for a, b in zip(derived, found, strict=True)))
        lines.append(Line("these are Lagrange's equations of the Cartesian L: checked term by term"))
    return Section(title, lines)


def _matrices(system: System) -> Section:
    M, K, D = system.matrices()
    q = sp.Matrix([c.q for c in system.coordinates])
    standing = any(sign < 0 for sign in system.sigma)
    lines = [
        Line("deviations from the rest with " + _ways(system) if standing else "small deviations from the rest", q),
        Line("mass matrix", equal(sp.Symbol("M"), M)),
        Line("stiffness matrix", equal(sp.Symbol("K"), K)),
    ]
    lines += [Line("damping matrix", equal(sp.Symbol("D"), D))] if any(D) else []
    if system.spatial:
        lines.append(Line("along the rail; across it the same without x"))
    return Section("Linearized: M q'' + K q = 0" if not any(D) else "Linearized: M q'' + D q' + K q = 0", lines)


def _ways(system: System) -> str:
    return ", ".join(
        f"{angle.q} {'up' if sign < 0 else 'down'}" for angle, sign in zip(system.angles, system.sigma, strict=True)
    )


def _insist(holds: bool) -> None:
    if not holds:
        raise SceneError(["the Cartesian derivation and the pair disagree: please report this scene"])
