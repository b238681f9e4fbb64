"""Measures of the modes that swing, Im λ ≠ 0, under their numbers in the table.

All points of a sweep have the numbers of one table, that of the scene as it is given, so that they go on smoothly where
dampers appear and where frequencies become equal: the k-th mode that swings, copies counted out, is the k-th there, and
copies of mode 2 are 2, 2b, 2c, …  A point at which more modes swing, or fewer, has the numbers of its own table.  What
is beyond double precision is NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import islice
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.modes import UNCERTAIN, labelled, natural_modes
from modal.report import counted
from modal.scene import Scene
from nonlinear.sweeps.measure import Measure

Values = NDArray[np.complex128]


@lru_cache(maxsize=2)
def swinging(scene: Scene) -> tuple[Values, tuple[int, ...]]:
    """λ of all modes that swing, as often as their multiplicity, |λ| ascending, and the number of each."""
    modes = natural_modes(scene)
    certain = np.where(modes.error < UNCERTAIN, modes.eigenvalue, np.nan)
    rows = np.repeat(np.arange(len(modes)), np.where(modes.eigenvalue.imag != 0, modes.multiplicity, 0))
    return certain[rows], tuple((rows + 1).tolist())


def numbers_in(scene: Scene, table: Scene) -> tuple[int, ...]:
    """The numbers of the modes that swing in a scene by the table of another, by its own where more or fewer swing."""
    own, given = swinging(scene)[1], swinging(table)[1]
    return given if len(own) == len(given) else own


def frequencies(scene: Scene, count: float, table: Scene) -> dict[str, float]:
    """The lowest natural frequencies |λ|."""
    return {f"omega_{name}_rad_per_s": float(abs(value)) for name, value in _first(scene, count, table)}


def damping(scene: Scene, count: float, table: Scene) -> dict[str, float]:
    """Their damping ratios −Re λ/|λ|."""
    return {f"damping_ratio_{name}": float(-v.real / abs(v) + 0.0) for name, v in _first(scene, count, table)}


def _first(scene: Scene, count: float, table: Scene) -> Iterator[tuple[str, np.complex128]]:
    return islice(zip(labelled(numbers_in(scene, table)), swinging(scene)[0], strict=True), int(count))


def splitting(scene: Scene, number: float, table: Scene) -> dict[str, float]:
    """The distance from one mode to the next."""
    name, gap = _gap(scene, int(number), table)
    return {f"splitting_{name}_rad_per_s": gap}


def beat(scene: Scene, number: float, table: Scene) -> dict[str, float]:
    """The time 2π/Δω from one beat of a mode and the next to the following."""
    name, gap = _gap(scene, int(number), table)
    return {f"beat_{name}_s": 2 * pi / gap if gap else inf}


def _gap(scene: Scene, number: int, table: Scene) -> tuple[int, float]:
    """A mode's number, that of the first that swings for 0, and the gap in Im λ (rad/s) from its last copy upward."""
    values, listed = swinging(scene)[0].imag, numbers_in(scene, table)
    order = np.argsort(values, kind="stable")
    omega, numbers = values[order], [listed[place] for place in order]
    number = number or next(iter(numbers), 0)
    last = max((place for place, own in enumerate(numbers) if own == number), default=-1)
    if last < 0:
        raise ComputationError(f"mode {number} of the table does not swing: {_those(numbers)}")
    if last + 1 == len(numbers):
        raise ComputationError(f"no mode swings after mode {number} of the table: {_those(numbers)}")
    return number, float(omega[last + 1] - omega[last])


def _those(numbers: list[int]) -> str:
    range_of = f", from {min(numbers)} to {max(numbers)}" if numbers else ""
    return counted(len(numbers), "mode swings", "modes swing") + range_of


NEXT = "mode N (left out, the first that swings) and the next"
MODAL = (
    Measure("frequencies", frequencies, 4, "the frequencies of the N slowest modes that swing", numbered=True),
    Measure("damping", damping, 4, "the damping ratios of the N slowest modes that swing", numbered=True),
    Measure("splitting", splitting, 0, f"the gap between the frequencies of {NEXT}", numbered=True),
    Measure("beat", beat, 0, f"the time from one beat of {NEXT} to the next", numbered=True),
)
