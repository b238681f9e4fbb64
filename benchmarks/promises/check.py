"""The error that `check` prints next to a measured κ bounds it, for one amplitude, two and four."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from one_percent import scene_of
from promise import Trial, attack

from modal import natural_modes
from modal.errors import ComputationError
from nonlinear.orbits import nonlinear_mode
from nonlinear.verification import check

SETS = ((3.0,), (2.0, 6.0), (1.0, 5.0, 10.0, 30.0))
PERIODS = 20


def exact(seed: int, number: int) -> tuple[float, float]:
    """κ of the mode (from 1) from periodic orbits far smaller than those of the check, and its uncertainty."""
    scene = scene_of(seed)
    branch = nonlinear_mode(scene, number, 4e-3, first=2e-3, longest=2e-3, tolerance=1e-14, locate=False)
    x = branch.amplitude[[0, -1]] ** 2
    y = (branch.omega[[0, -1]] / natural_modes(scene)[number - 1].omega - 1) / x
    value = (x[1] * y[0] - x[0] * y[1]) / (x[1] - x[0])
    return float(value), float(abs(value - y[0])) / 10 + 1e-12 / float(x[0])


def trials(seed: int) -> Iterator[Trial]:
    """A mode of a random scene, at each set of amplitudes."""
    scene = scene_of(seed)
    swinging = [mode.number for mode in natural_modes(scene) if mode.omega > 0]
    number = int(np.random.default_rng(seed).choice(swinging))
    try:
        true, doubt = exact(seed, number)
    except ComputationError:
        return
    for angles in SETS:
        for row in check(scene, [number - 1], angles, periods=PERIODS).rows:
            kappa, error = row.kappa
            if np.isfinite(kappa):
                words = f"mode {number} at {angles} deg: {kappa:.6g}, exact {true:.6g}"
                yield Trial(words, abs(kappa - true), error + doubt)


if __name__ == "__main__":
    attack(str(__doc__), trials, cases=30, quick=2)
