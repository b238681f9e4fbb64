"""How two frequency loci meet: in a crossing, where the gap closes, or a veering, where the mode shapes interchange.

Two uncoupled modes cross: their order changes and their shapes do not.  Next to a veering

    (ω_b − ω_a)² = gap² + s²(p − p₀)²,

the order is kept, and where the gap has grown by √2 on either side of p₀ each shape is halfway to the other, MAC = ½.
(Leissa, ZAMP 25, 99 (1974); Perkins & Mote, J. Sound Vib. 106, 451 (1986).)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import sqrt
from typing import Literal

import numpy as np

from modal.loci.tracking import LociPoint, follow, overlaps
from modal.report import Displayed
from modal.types import Floats, Ints

TURNED = 0.25
"""The least MAC of one shape before with the other after, where the gap has grown by √2, that makes a veering."""
APART = 0.02
"""The MAC below which two modes are unrelated."""
GOLDEN = (3 - sqrt(5)) / 2
SHARPNESS = 3e-9
"""Fraction of the interval to which a veering is located: the gap is flat there, so rounding hides more."""

Kind = Literal["crossing", "veering"]
Pair = tuple[int, int]
Solve = Callable[[float], LociPoint]


@dataclass(frozen=True, repr=False)
class CloseApproach(Displayed):
    """Two loci meet: their numbers from 0, the value p₀ of the parameter, the frequency midway and the gap (rad/s).

    The gap of a crossing is what rounding leaves of zero.  `exchange` is the MAC of one shape before with the other one
    after.
    """

    kind: Kind
    loci: Pair
    value: float
    omega: float
    gap: float
    exchange: float


def find_close_approaches(
    points: Sequence[LociPoint], tracks: Ints, solve: Solve
) -> tuple[list[CloseApproach], list[LociPoint]]:
    """All meetings of these K tracks, with `loci` counted among them, and the points of the smallest gaps.

    `points` ascend and have all tracks in the same order; `solve` gives the modes at another value.
    """
    omega, group = (np.array([getattr(point, name)[tracks] for point in points]) for name in ("omega", "group"))
    close: list[tuple[CloseApproach, LociPoint]] = []
    for a, b in combinations(range(len(tracks)), 2):
        signed = np.where(group[:, a] == group[:, b], 0.0, omega[:, a] - omega[:, b])
        pair = int(tracks[a]), int(tracks[b])
        for kind, nearest, exchange in (*_crossings(points, signed, pair), *_veerings(points, signed, pair, solve)):
            middle = float(nearest.omega[list(pair)].mean())
            close.append((CloseApproach(kind, (a, b), nearest.value, middle, _gap(nearest, pair), exchange), nearest))
    close.sort(key=lambda entry: entry[0].value)
    return [meeting for meeting, _ in close], [point for meeting, point in close if meeting.kind == "veering"]


Found = Iterator[tuple[Kind, LociPoint, float]]


def _crossings(points: Sequence[LociPoint], signed: Floats, pair: Pair) -> Found:
    """Sign changes of ω_a − ω_b, which is 0 where error bounds cannot separate the two."""
    for i, j in pairwise(np.flatnonzero(signed).tolist()):
        if signed[i] * signed[j] < 0:
            closest = min((points[k] for k in range(i + 1, j)) if j > i + 1 else (points[i], points[j]), key=_by(pair))
            yield "crossing", closest, _exchange(points[i], points[j], pair)


def _veerings(points: Sequence[LociPoint], signed: Floats, pair: Pair, solve: Solve) -> Found:
    """Places where the gap is smallest and shapes interchange, with the smallest gap located exactly."""
    size = np.abs(signed)
    lowest = (size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:]) & (signed[1:-1] * signed[:-2] > 0)
    for i in (np.flatnonzero(lowest & (signed[1:-1] * signed[2:] > 0)) + 1).tolist():
        wide = np.flatnonzero(size >= sqrt(2) * size[i])
        left, right = wide[wide < i], wide[wide > i]
        if left.size and right.size:
            before, after = points[left[-1]], points[right[0]]
            exchange = _exchange(before, after, pair)
            if exchange >= TURNED and not _between(before, points[i], after, pair):
                yield "veering", _nearest(points[i - 1 : i + 2], pair, solve), exchange


def _between(before: LociPoint, here: LociPoint, after: LociPoint, pair: Pair) -> bool:
    """Whether a third mode lies between the two and interacts, unlike one that crosses both."""
    low, high = sorted(here.omega[list(pair)])
    others = np.flatnonzero((here.omega > low) & (here.omega < high))
    return any(_exchange(before, after, (track, int(other))) >= APART for other in others for track in pair)


def _nearest(three: Sequence[LociPoint], pair: Pair, solve: Solve) -> LociPoint:
    """The smallest gap near the middle one of three points, by golden section of the interval between the others."""
    low, best, high = three[0].value, three[1], three[2].value
    least = SHARPNESS * (high - low)
    while high - low > least:
        rises = high - best.value > best.value - low
        trial = best.value + GOLDEN * ((high if rises else low) - best.value)
        if not low < trial < high or trial == best.value:
            break
        other, _ = follow(best, solve(trial))
        if _gap(other, pair) < _gap(best, pair):
            low, high, best = (best.value, high, other) if rises else (low, best.value, other)
        else:
            low, high = (low, trial) if rises else (trial, high)
    return best


def _by(pair: Pair) -> Callable[[LociPoint], float]:
    return lambda point: _gap(point, pair)


def _gap(point: LociPoint, pair: Pair) -> float:
    return float(abs(point.omega[pair[0]] - point.omega[pair[1]]))


def _exchange(before: LociPoint, after: LociPoint, pair: Pair) -> float:
    a, b = pair
    overlap = overlaps(before, after)
    return float(max(overlap[a, b] ** 2, overlap[b, a] ** 2))
