"""Comparisons that say what differed; `test_compare.py` shows that wrong values fail."""

from __future__ import annotations

from functools import cache

import mpmath as mp
import numpy as np
from oracle import Dense, dense

from modal.eigen import ModalSpectrum
from modal.modes import Modes


def flat_omega(modes: Modes) -> list[float]:
    """Every frequency as often as its multiplicity, the zero of a free cart omitted."""
    return [omega for omega, fold in zip(modes.omega, modes.multiplicity, strict=True) for _ in range(fold) if omega]


def with_spectrum(modes: Modes, spectrum: ModalSpectrum) -> Modes:
    """The modes of the same scene with another spectrum."""
    altered = Modes(modes.scene)
    vars(altered)["spectrum"] = spectrum
    return altered


def assert_certified(modes: Modes, tolerance: float) -> Dense:
    """Each ω is the j-th one of the dense many-digit pencil to within a relative tolerance; none is missing."""
    frequencies, exact = flat_omega(modes), dense(modes.scene)
    expected = exact.size - exact.free - sum("singular" in note for note in modes.notes)
    assert len(frequencies) == expected, f"{len(frequencies)} frequencies instead of {expected}"
    count = cache(exact.below)
    for j, omega in enumerate(frequencies):
        low, high = ((mp.mpf(float(omega)) * (1 + sign * mp.mpf(tolerance))) ** 2 for sign in (-1, 1))
        assert count(low) <= j < count(high), f"frequency {j} = {omega!r} is off by more than {tolerance}"
    return exact


def assert_shapes(modes: Modes, exact: Dense, relative: float = 1e-10, floor: float = 1e-13) -> int:
    """Each component of each simple, well separated shape agrees to `relative`, or to `floor` of the largest."""
    checked = 0
    for number, omega in enumerate(modes.omega):
        gap = min((abs(other / omega - 1) for other in np.delete(modes.omega, number)), default=1.0) if omega else 0.0
        if modes.multiplicity[number] > 1 or gap < 1e-4:
            continue
        shape = modes.shape(number)
        mine = [*([shape.cart] if modes.rig.cart else []), *shape.angles]
        _, theirs = exact.shape(mp.mpf(float(omega)) ** 2)
        largest = max(range(len(theirs)), key=lambda i: abs(theirs[i]))
        for a, b in zip(mine, theirs, strict=True):
            error = abs(mp.mpf(float(a)) / mp.mpf(float(mine[largest])) - b / theirs[largest])
            allowed = relative * abs(b / theirs[largest]) + floor
            assert error <= allowed, f"mode {number}: {float(a)!r} beside {float(b)!r}"
        checked += 1
    return checked
