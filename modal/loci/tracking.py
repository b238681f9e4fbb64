"""The modes of a scene at one value of a parameter after another, each followed by its shape, and how two loci meet.

Shapes φ at one value and χ at the next are compared by the modal assurance criterion weighted with the mass matrix,

    MAC = (φᵀ M χ)² / ((φᵀ M φ)(χᵀ M χ)),        M the mean of the two mass matrices

[Allemang1982]: 1 for one shape, 0 for different modes.  Where frequencies are equal to
within their error bounds only the space spanned by their shapes is meaningful; followed shapes are projected on it.

Two loci meet in a crossing, where the gap closes, or in a veering, where the mode shapes interchange.  Two uncoupled
modes cross: their order changes and their shapes do not.  Next to a veering

    (ω_b − ω_a)² = gap² + s²(p − p₀)²,

the order is kept, and where the gap has grown by √2 on either side of p₀ each shape is halfway to the other, MAC = ½.
([Leissa1974]; [Perkins1986].)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import sqrt
from typing import Literal

import numpy as np

from modal.errors import ComputationError
from modal.modes import UNCERTAIN, Modes, natural_modes, pair_rows
from modal.report import Displayed
from modal.scene import Scene
from modal.scene.parameters import vary
from modal.types import EPS, Floats, Ints

MOST_MODES = 400
"""Limit: modes that are followed by their shapes, refused beyond."""
SHAPE_MAC_SURE = 0.97
"""Tolerance: MAC from which on a mode is the one before: its shape has turned by less than 10°."""


@dataclass(frozen=True, eq=False)
class LociPoint:
    """All R modes at one value of the parameter, one for each independent shape.

    `omega` (R,) in rad/s; `shapes` (planes, n, R) with φᵀMφ = 1 over the coordinates of `M` (n, n), along the rail and,
    in space, across it; `group` (R,): modes of one number have frequencies that error bounds cannot separate; `row`
    (R,) is the row of each in the table there, from 0.
    """

    value: float
    omega: Floats
    shapes: Floats
    group: Ints
    row: Ints
    M: Floats

    def in_order(self, order: Ints, shapes: Floats) -> LociPoint:
        """The same modes in another order, with shapes that span the same spaces."""
        return replace(self, omega=self.omega[order], group=self.group[order], row=self.row[order], shapes=shapes)


def solve_at(scene: Scene, path: str, value: float) -> LociPoint:
    """The modes of the scene with this value at a path, in ascending order.

    Raise ComputationError for damped or growing modes, uncertain ones and more than MOST_MODES.
    """
    scene_there = vary(scene, {path: value})
    size = scene_there.n_links * (2 if scene_there.space == "space" else 1) + 1
    if size > MOST_MODES:
        raise ComputationError(f"{size} modes are too many to follow by their shapes; the limit is {MOST_MODES}")
    modes = natural_modes(scene_there)
    where = f"at {path} = {value:.6g}"
    if np.any(modes.error >= UNCERTAIN):
        raise ComputationError(f"{where} some modes are beyond double precision")
    if np.any(modes.eigenvalue.real) or modes.rig.has_loops:
        raise ComputationError(
            f"{where} some modes decay or grow: loci need an undamped scene about a stable equilibrium; a sweep of the "
            "measure frequencies takes dampers and feedback"
        )
    fold = modes.multiplicity
    group, row = (np.repeat(values, fold) for values in (_groups(modes), np.arange(len(modes))))
    return LociPoint(value, np.repeat(modes.omega, fold), _shapes(modes), group, row, modes.matrices.M)


def _groups(modes: Modes) -> Ints:
    """A number for every distinct frequency (R,), equal where the next is no further away than the error bounds."""
    error = modes.error * modes.omega
    is_next = np.diff(modes.omega) > error[1:] + error[:-1]
    return np.concatenate(([0], np.cumsum(is_next)))


def _shapes(modes: Modes) -> Floats:
    """Φ (planes, n, R): the part of every shape along the rail and, in space, the part across it."""
    phi, planes = modes.matrix.real, 2 if modes.rig.spatial else 1
    return np.array([phi.shapes * (phi.across == plane) for plane in range(planes)])


def overlaps(start: LociPoint, end: LociPoint) -> Floats:
    """φᵀMχ of unit shapes: (R, R'), rows for the modes of `end`, columns for those of `start`."""
    M = (start.M + end.M) / 2
    end_shapes, start_shapes = (
        shapes / np.sqrt(np.sum(shapes * (M @ shapes), axis=(0, 1))) for shapes in (end.shapes, start.shapes)
    )
    return np.asarray(np.sum(end_shapes.swapaxes(1, 2) @ M @ start_shapes, axis=0))


def follow(start: LociPoint, end: LociPoint) -> tuple[LociPoint, bool]:
    """The modes of `end` in the order of `start`, with signs and bases aligned to it; and whether this is certain.

    Raise ComputationError if the number of modes has changed.
    """
    if start.omega.size != end.omega.size:
        raise ComputationError(f"the number of modes changes between {start.value:.6g} and {end.value:.6g}")
    overlap = overlaps(start, end)
    names, members = np.unique(end.group, return_inverse=True)
    shares = np.zeros((names.size, end.omega.size))
    np.add.at(shares, members, overlap**2)
    best, free = np.argmax(shares, axis=0), np.bincount(members)
    is_complete = np.array_equal(np.bincount(best, minlength=names.size), free)
    sure = bool(np.all(shares.max(axis=0) >= SHAPE_MAC_SURE) and is_complete)
    chosen = best if sure else pair_rows(shares.T, free)
    order, shapes = np.zeros_like(members), np.zeros_like(end.shapes)
    for number in range(names.size):
        rows, tracks = np.flatnonzero(members == number), np.flatnonzero(chosen == number)
        order[tracks] = rows
        shapes[..., tracks] = end.shapes[..., rows] @ _turn(start, end, rows, tracks)
    return end.in_order(order, shapes), sure


def _turn(start: LociPoint, end: LociPoint, rows: Ints, tracks: Ints) -> Floats:
    """The rotation (G, G) of a group's shapes that aligns them with the followed ones, projected on their span."""
    M, basis = (start.M + end.M) / 2, end.shapes[..., rows]
    products = (np.sum(basis.swapaxes(1, 2) @ M @ s, axis=0) for s in (basis, start.shapes[..., tracks]))
    U, _, Vh = np.linalg.svd(np.linalg.solve(*products))
    return np.asarray(U @ Vh)


VEERING_MAC_MIN = 0.25
"""Physics: least MAC of one shape before with the other after, where the gap has grown by √2, that makes a veering."""
SHAPE_MAC_UNRELATED = 0.02
"""Physics: MAC below which two modes are unrelated, so that one crosses the other's veering."""
GOLDEN_SECTION = (3 - sqrt(5)) / 2
"""Physics: the golden section, of which a search of a minimum loses least."""

Kind = Literal["crossing", "veering"]
Pair = tuple[int, int]
Solve = Callable[[float], LociPoint]


@dataclass(frozen=True, repr=False)
class CloseApproach(Displayed):
    """Two loci meet: their numbers from 0, the value p₀ of the parameter, the frequency midway and the gap (rad/s).

    The gap of a crossing is what rounding leaves of zero.  `exchange` is the MAC of one shape before with the other one
    after.
    """

    what = "Meeting of two loci"
    shows = (
        "kind: kind; loci: loci counted from 0; value: at; omega: ω, rad/s; gap: gap, rad/s; exchange: exchange (MAC)"
    )

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
    meetings: list[tuple[CloseApproach, LociPoint]] = []
    for a, b in combinations(range(len(tracks)), 2):
        gap = np.where(group[:, a] == group[:, b], 0.0, omega[:, a] - omega[:, b])
        pair = int(tracks[a]), int(tracks[b])
        for kind, nearest, exchange in (*_crossings(points, gap, pair), *_veerings(points, gap, pair, solve)):
            middle = float(nearest.omega[list(pair)].mean())
            meetings.append(
                (CloseApproach(kind, (a, b), nearest.value, middle, _gap(nearest, pair), exchange), nearest)
            )
    meetings.sort(key=lambda entry: entry[0].value)
    return [meeting for meeting, _ in meetings], [point for meeting, point in meetings if meeting.kind == "veering"]


Found = Iterator[tuple[Kind, LociPoint, float]]


def _crossings(points: Sequence[LociPoint], gap: Floats, pair: Pair) -> Found:
    """Sign changes of ω_a − ω_b, which is 0 where error bounds cannot separate the two."""
    for i, j in pairwise(np.flatnonzero(gap).tolist()):
        if gap[i] * gap[j] < 0:
            closest = min((points[k] for k in range(i + 1, j)) if j > i + 1 else (points[i], points[j]), key=_by(pair))
            yield "crossing", closest, _exchange(points[i], points[j], pair)


def _veerings(points: Sequence[LociPoint], gap: Floats, pair: Pair, solve: Solve) -> Found:
    """Places where the gap is smallest and shapes interchange, with the smallest gap located exactly."""
    size = np.abs(gap)
    lowest = (size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:]) & (gap[1:-1] * gap[:-2] > 0)
    for i in (np.flatnonzero(lowest & (gap[1:-1] * gap[2:] > 0)) + 1).tolist():
        far_points = np.flatnonzero(size >= sqrt(2) * size[i])
        lower, upper = far_points[far_points < i], far_points[far_points > i]
        if lower.size and upper.size:
            start, end = points[lower[-1]], points[upper[0]]
            exchange = _exchange(start, end, pair)
            if exchange >= VEERING_MAC_MIN and not _between(start, points[i], end, pair):
                yield "veering", _nearest(points[i - 1 : i + 2], pair, solve), exchange


def _between(start: LociPoint, middle: LociPoint, end: LociPoint, pair: Pair) -> bool:
    """Whether a third mode lies between the two and interacts, unlike one that crosses both."""
    low, high = sorted(middle.omega[list(pair)])
    others = np.flatnonzero((middle.omega > low) & (middle.omega < high))
    return any(
        _exchange(start, end, (track, int(track_between))) >= SHAPE_MAC_UNRELATED
        for track_between in others
        for track in pair
    )


def _nearest(three: Sequence[LociPoint], pair: Pair, solve: Solve) -> LociPoint:
    """The smallest gap near the middle one of three points, by golden section of the interval between the others."""
    low, best, high = three[0].value, three[1], three[2].value
    resolution = sqrt(EPS) / 4 * (high - low)  # within which a smallest gap is flat to rounding
    while high - low > resolution:
        rises = high - best.value > best.value - low
        trial = best.value + GOLDEN_SECTION * ((high if rises else low) - best.value)
        if not low < trial < high or trial == best.value:
            break
        candidate, _ = follow(best, solve(trial))
        if _gap(candidate, pair) < _gap(best, pair):
            low, high, best = (best.value, high, candidate) if rises else (low, best.value, candidate)
        else:
            low, high = (low, trial) if rises else (trial, high)
    return best


def _by(pair: Pair) -> Callable[[LociPoint], float]:
    return lambda point: _gap(point, pair)


def _gap(point: LociPoint, pair: Pair) -> float:
    return float(abs(point.omega[pair[0]] - point.omega[pair[1]]))


def _exchange(start: LociPoint, end: LociPoint, pair: Pair) -> float:
    a, b = pair
    overlap = overlaps(start, end)
    return float(max(overlap[a, b] ** 2, overlap[b, a] ** 2))
