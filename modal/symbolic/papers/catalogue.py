"""The papers' equations one after another, as printed and as they should read, for `modal.symbolic.typesetting`."""

from __future__ import annotations

from collections.abc import Callable

from modal.errors import SceneError
from modal.symbolic import Line, Section
from modal.symbolic.papers import Equation, cart, cart_dae, planar, spatial, spatial_azimuth

LINKS, THREE = 2, 3
"""Spatial equations are written out for two links, those of an inner link for three."""


def paper(number: str) -> tuple[str, list[Section]]:
    """Title and sections of paper 000, 001 or 002; SceneError for any other."""
    if number not in _PAPERS:
        raise SceneError([f"paper:{number}: must be one of {', '.join(f'paper:{known}' for known in _PAPERS)}"])
    title, equations = _PAPERS[number]
    return title, [_section(equation) for equation in equations()]


def _section(equation: Equation) -> Section:
    lines = [Line(label, form) for label, form in equation.forms()]
    if equation.condition:
        lines.append(Line(f"{'holds' if len(lines) == 1 else 'the printed form holds'}: {equation.condition}"))
    if equation.note:
        lines.append(Line(f"note: {equation.note}"))
    return Section(f"({equation.number}) {equation.title}", lines)


def _cart() -> list[Equation]:
    minimal = [*cart.positions(1), *cart.squared_speeds(1), cart.kinetic_energy(1), cart.potential_energy(1)]
    return [*minimal, cart.lagrangian(1), cart.lagrange_equation(1), *cart_dae.equations(1), cart_dae.solution(1)]


def _planar() -> list[Equation]:
    general = [planar.forced_equation(1), planar.momentum(1), *(planar.lagrange_equation(i) for i in (1, 2, 3))]
    energies = [planar.kinetic_energy(), planar.potential_energy(), planar.lagrangian()]
    small = [*planar.accelerations(), *planar.equal_accelerations()]
    polynomials = [planar.eigen_equation(n) for n in range(1, 6)]
    return [*general, *energies, *small, *polynomials, *planar.equal_motion(4), *planar.equal_motion(5)]


def _spatial() -> list[Equation]:
    kinematics = [*spatial.velocity(LINKS), spatial.square_term(1), spatial.cross_term(1, 2)]
    kinematics.append(spatial.squared_speed(LINKS))
    energies = [spatial.kinetic_energy(LINKS), spatial.potential_energy(LINKS), spatial.lagrangian(LINKS)]
    azimuths = [
        make(1, LINKS)
        for make in (
            spatial_azimuth.momentum,
            spatial_azimuth.momentum_rate,
            spatial_azimuth.small_momentum_rate,
            spatial_azimuth.conservation,
        )
    ]
    azimuths += [spatial_azimuth.azimuth_acceleration(1, LINKS)]
    azimuths += [spatial_azimuth.azimuth_acceleration(i, THREE) for i in (2, 3)]
    return [*kinematics, *energies, *azimuths]


_PAPERS: dict[str, tuple[str, Callable[[], list[Equation]]]] = {
    "000": ("Paper 000: double pendula on a cart", _cart),
    "001": ("Paper 001: planar chains", _planar),
    "002": ("Paper 002: spatial chains", _spatial),
}
