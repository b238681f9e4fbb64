"""Which intervals of a record a spline cannot join: those in which it leaves the samples around.

A spline through a step, a corner or a hole overshoots without limit.  Where it leaves the range of the four samples
around an interval, there the record is joined without it, the splines on either side are made anew, and so on until
none leaves; fewer than six samples are too few for one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modal.types import Booleans, Floats

LEAST_SAMPLES = 6
"""Samples of a spline of degree 5."""
LEAVING = 0.02
"""What a spline may leave the samples around by, over the range of the record."""
PEAK = 0.45
"""And over the range of these samples: a sine of 2.8 samples a period, of which a spline still is within a percent,
is 0.42 of it above them at its top."""
INNER = np.arange(1, 8) / 8
"""Places within an interval at which a spline is looked at."""
Spline = Callable[[int, int], Callable[[Floats], Floats]]
"""The spline through the samples from one to another, both included."""


def unsplined_intervals(times: Floats, values: Floats, spline: Spline) -> Booleans:
    """The intervals (T - 1,) between samples at `times`, both (T,), that are joined without a spline."""
    before, after = (
        np.maximum(np.arange(-1, len(times) - 2), 0),
        np.minimum(np.arange(2, len(times) + 1), len(times) - 1),
    )
    around = np.array([values[before], values[:-1], values[1:], values[after]])
    low, high = around.min(0), around.max(0)
    room = LEAVING * np.ptp(values) + PEAK * (high - low)
    straight, seen = np.zeros(len(times) - 1, dtype=bool), set[tuple[int, int]]()
    while new := [ends for ends in splined_stretches(straight) if ends not in seen]:
        for first, last in new:
            seen.add((first, last))
            if straight.any() and last - first + 1 < LEAST_SAMPLES:
                straight[first:last] = True
                continue
            inner = times[first:last, None] + np.diff(times)[first:last, None] * INNER
            joined, here = spline(first, last)(inner), slice(first, last)
            outside = (joined < (low - room)[here, None]) | (joined > (high + room)[here, None]) | np.isnan(joined)
            straight[here] = outside.any(axis=1)
    return straight


def splined_stretches(straight: Booleans) -> list[tuple[int, int]]:
    """The first and the last sample of each stretch of intervals that are joined by a spline."""
    edges = np.flatnonzero(np.diff(np.concatenate(([True], straight, [True])).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def unsplined_words(times: Floats, unsplined: Booleans, joined_by: str) -> str:
    """One line of where a record is joined without a spline; "" for nowhere."""
    at = np.flatnonzero(unsplined)
    if not at.size:
        return ""
    where = "all intervals" if unsplined.all() else f"{at.size} of {unsplined.size} intervals"
    ends = f"from {times[at[0]]:.5g} to {times[at[-1] + 1]:.5g} s"
    return f"{joined_by} join the samples of {where}, {ends}, where a spline would leave their range"


def monotone_slopes(times: Floats, values: Floats) -> Floats:
    """Slopes (T,) with which cubics between samples stay within the range of both.

    (Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984), equation (7).)
    """
    h = np.diff(times)
    slope = np.diff(values) / h
    slopes = np.concatenate((slope[:1], np.zeros(len(times) - 2), slope[-1:]))
    alike = np.flatnonzero(slope[:-1] * slope[1:] > 0)
    left, right, share = slope[alike], slope[alike + 1], (h[alike] + 2 * h[alike + 1]) / (3 * (h[alike] + h[alike + 1]))
    slopes[alike + 1] = left * right / (share * right + (1 - share) * left)
    return slopes
