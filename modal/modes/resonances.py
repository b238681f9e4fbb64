"""Modes whose frequencies stand near 1:1 or 1:3, where a small nonlinearity can move energy between them.

Near is what stands within WIDTH of the ratio, whatever the amplitude; farther away, what answers a swing at the angle
of 1 % so much that this angle is another (`modal.eigen.amplitude.distortion`, which follows the drift of both
frequencies).
"""

from __future__ import annotations

import numpy as np

from modal.types import Floats, Ints

WIDTH = 0.02
"""How far from the exact ratio, relative to the frequency."""
WIDEST = 0.25
"""Within which another mode's answer is worked out, that of the nearest on either side of the ratio."""
MOST_DISTORTED = 0.03
"""How far from the printed angle of 1 % the true one may lie by that answer before a mode is named for it."""
MOST_NAMED = 4
RATIOS = (("1:1", 1.0), ("1:3", 3.0), ("3:1", 1 / 3))
DRIVEN = (1, 3)
"""The harmonics in which a swing drives other modes."""


def resonances(omega: Floats, number: int, partners: Ints) -> tuple[str, ...]:
    """Resonances of mode `number` with `partners`, in words; both ascending indices from 0 into `omega` (R,)."""
    own, others = omega[number], omega[partners]
    if own == 0:
        return ()
    found: list[str] = []
    for ratio, factor in RATIOS:
        low, high = np.searchsorted(others, own * factor * np.array([1 - WIDTH, 1 + WIDTH]))
        near = [int(k) for k in partners[low : min(high, low + MOST_NAMED + 1)] if k != number][:MOST_NAMED]
        itself = low <= np.searchsorted(partners, number) < high
        found += [f"{ratio} with mode {k + 1}" for k in near]
        more = int(high - low - itself) - len(near)
        found += [f"{ratio} with {more} more"] if more > 0 else []
    return tuple(found)


def answering(omega: Floats, number: int, partners: Ints) -> list[tuple[int, int]]:
    """(harmonic, partner) of what may answer a swing in this mode; indices as in `resonances`."""
    found, others = [], partners[partners != number]
    for harmonic in DRIVEN if omega[number] else ():
        at = int(np.searchsorted(omega[others], harmonic * omega[number]))
        sides = others[max(at - 1, 0) : at + 1].tolist()
        found += [(harmonic, k) for k in sides if abs(omega[k] / omega[number] / harmonic - 1) < WIDEST]
    return found
