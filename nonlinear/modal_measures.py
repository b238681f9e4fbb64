"""Measures of the modes that swing, Im λ ≠ 0, each counted as often as its multiplicity.

So the numbers go on smoothly where frequencies become equal; a cart's translation, free or dragged, and what creeps or
falls are not counted.  What is beyond double precision is NaN.
"""

from __future__ import annotations

from functools import lru_cache
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.mode import UNCERTAIN
from modal.modes import natural_modes
from modal.prose import counted
from modal.scene import Scene
from nonlinear.measure import Measure


@lru_cache(maxsize=1)
def eigenvalues(scene: Scene) -> NDArray[np.complex128]:
    """λ of all modes that swing, as often as their multiplicity, |λ| ascending."""
    modes = natural_modes(scene)
    certain = np.where(modes.error < UNCERTAIN, modes.eigenvalue, np.nan)
    return np.repeat(certain, np.where(modes.eigenvalue.imag != 0, modes.multiplicity, 0))


def frequencies(scene: Scene, count: float) -> dict[str, float]:
    """The lowest natural frequencies |λ|."""
    return {f"omega_{k}_rad_per_s": float(abs(value)) for k, value in _first(scene, count)}


def damping(scene: Scene, count: float) -> dict[str, float]:
    """Their damping ratios −Re λ/|λ|."""
    return {f"damping_ratio_{k}": float(-value.real / abs(value) + 0.0) for k, value in _first(scene, count)}


def _first(scene: Scene, count: float) -> enumerate[np.complex128]:
    return enumerate(eigenvalues(scene)[: int(count)], start=1)


def splitting(scene: Scene, number: float) -> dict[str, float]:
    """ω_{k+1} − ω_k."""
    return {f"splitting_{int(number)}_rad_per_s": _gap(scene, int(number))}


def beat(scene: Scene, number: float) -> dict[str, float]:
    """The time 2π/(ω_{k+1} − ω_k) from one beat of two modes to the next."""
    gap = _gap(scene, int(number))
    return {f"beat_{int(number)}_s": 2 * pi / gap if gap else inf}


def _gap(scene: Scene, number: int) -> float:
    omega = np.abs(eigenvalues(scene))
    if number >= omega.size:
        raise ComputationError(
            f"{counted(omega.size, 'mode swings', 'modes swing')}: there is none after mode {number}"
        )
    return float(omega[number] - omega[number - 1])


MODAL = (
    Measure("frequencies", frequencies, 4, "the N lowest natural frequencies"),
    Measure("damping", damping, 4, "the damping ratios of the N slowest modes"),
    Measure("splitting", splitting, 1, "the gap between frequencies N and N+1"),
    Measure("beat", beat, 1, "the time from one beat of modes N and N+1 to the next"),
)
