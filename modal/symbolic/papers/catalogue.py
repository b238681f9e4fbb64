"""The papers' equations one after another, as printed and as they should read, for `modal.symbolic.typesetting`."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

from modal.errors import SceneError
from modal.symbolic import Line, Section
from modal.symbolic.papers import Equation, cart, cart_dae, planar, spatial


def paper(number: str, show: tuple[str, ...] = ()) -> tuple[str, list[Section]]:
    """Title and sections of paper 000, 001 or 002, of all its equations or of those that `show` numbers.

    A number is that of the paper (`4`; `12-14` for what continues (12) to (14)), or its section where it numbers none
    (`III.B`). Raise SceneError for any other.
    """
    if number not in _PAPERS:
        raise SceneError(
            [f"paper:{number}: must be one of {', '.join(f'paper:{paper_number}' for paper_number in _PAPERS)}"]
        )
    equations = [(places(equation), equation) for equation in _equations(number)]
    known_places = list(dict.fromkeys(place for within, _ in equations for place in within))
    if unknown := [place for place in show if place not in known_places]:
        raise SceneError([f"show {place}: paper:{number} has {', '.join(known_places)}" for place in unknown])
    sections = [_section(equation) for within, equation in equations if not show or within.keys() & set(show)]
    return _PAPERS[number][0], sections


@cache
def _equations(number: str) -> list[Equation]:
    """A paper's equations, in its order."""
    return _PAPERS[number][1]()


def places(equation: Equation) -> dict[str, None]:
    """Every word for an equation's place in its paper: 12-13, 12 and 13 for the printed (12-13).

    >>> list(places(spatial.azimuth_acceleration(1, 2)))
    ['12-13', '12', '13']
    """
    first_number = equation.number.partition(",")[0].removeprefix("words below ")
    ends = re.fullmatch(r"(\d+)-(\d+)", first_number)
    between = range(int(ends[1]), int(ends[2]) + 1) if ends and equation.printed is not None else ()
    return dict.fromkeys([first_number, *map(str, between)])


def _section(equation: Equation) -> Section:
    lines = [Line(label, form) for label, form in equation.forms()]
    if equation.condition:
        lines.append(Line(f"{'holds' if len(lines) == 1 else 'the printed form holds'}: {equation.condition}"))
    if equation.note:
        lines.append(Line(f"note: {equation.note}"))
    return Section(f"({equation.number}) {equation.title}", lines)


def _cart() -> list[Equation]:
    minimal = [*cart.positions(1), *cart.squared_speeds(1), cart.kinetic_energy(1), cart.potential_energy(1)]
    motion = [cart.lagrangian(1), cart.lagrange_equation(1)]
    return [*minimal, *motion, *cart_dae.equations(1), cart_dae.solution(1), cart_dae.momentum(1)]


def _planar() -> list[Equation]:
    general = [planar.forced_equation(1), planar.momentum(1), *(planar.lagrange_equation(i) for i in (1, 2, 3))]
    energies = [planar.kinetic_energy(), planar.potential_energy(), planar.lagrangian()]
    small = [*planar.accelerations(), *planar.equal_accelerations()]
    polynomials = [planar.eigen_equation(n) for n in range(1, 6)]
    rows = [*planar.equal_motion(4), *planar.equal_motion(5)]
    return [*general, *energies, *small, *polynomials, *rows, planar.nearest_neighbours(1, 3)]


def _spatial() -> list[Equation]:
    """Written out for two links, those of an inner link for three."""
    kinematics = [*spatial.velocity(2), spatial.square_term(1), spatial.cross_term(1, 2)]
    kinematics.append(spatial.squared_speed(2))
    energies = [spatial.kinetic_energy(2), spatial.potential_energy(2), spatial.lagrangian(2)]
    azimuths = [
        make(1, 2)
        for make in (
            spatial.momentum,
            spatial.momentum_rate,
            spatial.small_momentum_rate,
            spatial.conservation,
        )
    ]
    azimuths += [spatial.azimuth_acceleration(1, 2)]
    azimuths += [spatial.azimuth_acceleration(i, 3) for i in (2, 3)]
    return [*kinematics, *energies, *azimuths]


_PAPERS: dict[str, tuple[str, Callable[[], list[Equation]]]] = {
    "000": ("Paper 000: double pendula on a cart", _cart),
    "001": ("Paper 001: planar chains", _planar),
    "002": ("Paper 002: spatial chains", _spatial),
}
