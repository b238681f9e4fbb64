"""Modes whose frequencies stand near 1:1 or 1:3, where a small nonlinearity can move energy between them."""

from __future__ import annotations

import numpy as np

from modal.rig import Floats, Ints

WIDTH = 0.02
"""How far from the exact ratio, relative to the frequency."""
MOST_NAMED = 4
RATIOS = (("1:1", 1.0), ("1:3", 3.0), ("3:1", 1 / 3))


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
