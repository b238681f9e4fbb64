"""Frequency loci: natural frequencies of a scene as functions of a parameter, and where loci meet.

Modes are followed by shape.  An interval over which a shape changes too much is halved.  Where
two loci exchange their order, the interval is refined until the gap is below the error bounds, or until the shapes are
found to interchange.

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
from typing import Any, Literal

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.modes import UNCERTAIN, Modes, natural_modes, number_labels, pair_rows
from modal.report import Displayed, Drawable, ReportColumn, ReportTable, TextResult, csv_rows, silent, with_unit
from modal.scene import Scene, left_out, number_words
from modal.scene.doors import checked
from modal.scene.parameters import Variation, find_places, number_at, validate_variations, vary
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
            candidates = points[i + 1 : j] or (points[i], points[j])
            closest = min(candidates, key=lambda point: _gap(point, pair))
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


def _gap(point: LociPoint, pair: Pair) -> float:
    return float(abs(point.omega[pair[0]] - point.omega[pair[1]]))


def _exchange(start: LociPoint, end: LociPoint, pair: Pair) -> float:
    a, b = pair
    overlap = overlaps(start, end)
    return float(max(overlap[a, b] ** 2, overlap[b, a] ** 2))


def state_columns(
    variation: Variation | None,
    value: float,
    omega: float,
    *,
    stable: bool,
    angle_deg: float,
    growth: float | None = None,
) -> dict[str, Any]:
    """The varied number under its place and unit, then frequency, stability (1 or 0), largest angle and growth rate.

    Without a variation there is no such column; nor is there one without a growth rate (1/s).

    >>> from modal.scene.parameters import parse_variations
    >>> (axis,) = parse_variations(["support.mass=1:2:2"])
    >>> list(state_columns(axis, 1.0, 3.0, stable=True, angle_deg=5.0))
    ['support.mass_kg', 'omega_rad_per_s', 'stable', 'largest_angle_deg']
    """
    varied_number = {} if variation is None else {variation.column: value}
    columns = {**varied_number, "omega_rad_per_s": omega, "stable": int(stable), "largest_angle_deg": angle_deg}
    return columns if growth is None else {**columns, "growth_per_s": growth}


MOST_SOLVED = 20_000
"""Limit: values at which modes are solved, besides those given, refused beyond: shapes change too often."""
MOST_HALVINGS = 200
"""Limit: halvings of an interval, as many as lead from 1 to 1e-60; branches that are then ambiguous are refused."""
Report = Callable[[float], object]


@dataclass(frozen=True, eq=False, repr=False)
class Loci(Drawable, TextResult):
    """K loci over P values of a parameter, refined where shapes change fast: `omega` (P, K) in rad/s, `values` (P,).

    `names` (K,) are the numbers of their modes in the table at the value `numbered_at`: the scene's own, or the first
    where that lies elsewhere; loci that share a row there are 2, 2b, 2c, …  `multiplicity` (K,) is the number of modes
    that coincide throughout, `encounters` where loci meet, in the order of the parameter.
    """

    scene: Scene
    variation: Variation
    values: Floats
    omega: Floats
    multiplicity: Ints
    names: tuple[str, ...]
    numbered_at: float
    encounters: tuple[CloseApproach, ...]
    figure = "modal.plotting.loci:loci_figure"
    writer = "modal.loci.following:loci_text"

    def to_dict(self) -> dict[str, Floats]:
        """The parameter and the frequency of every locus in rad/s, (P,) each.

        >>> from modal import load
        >>> from modal.scene.parameters import parse_variations
        >>> axis = parse_variations(["pendulum[0].links[0].length=5:20:5"])[0]
        >>> list(follow_loci(load("crane-two-loads"), axis).to_dict())
        ['pendulum[0].links[0].length_m', 'omega_1_rad_per_s', 'omega_2_rad_per_s', 'omega_3_rad_per_s']
        """
        loci = {f"omega_{name}_rad_per_s": omega for name, omega in zip(self.names, self.omega.T, strict=True)}
        return {self.variation.column: self.values, **loci}


@checked
def follow_loci(scene: Scene, variation: Variation, report: Report = silent) -> Loci:
    """The loci of an undamped scene; `report` is called with the number of the variation's values done.

    >>> from modal import load
    >>> from modal.scene.parameters import parse_variations
    >>> found = follow_loci(load("crane-two-loads"), parse_variations(["pendulum[0].links[0].length=5:20:11"])[0])
    >>> [(e.kind, round(e.value, 3), round(e.gap, 4)) for e in found.encounters]
    [('veering', 10.083, 0.0944)]

    Raise SceneError for a variation of fewer than two values or of a count, ComputationError if modes are damped,
    uncertain, too many, change their number or cannot be followed.
    """
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError([f"{variation.path}: loci need two or more values of a continuous parameter"])
    walk, value = _Walk(scene, variation), _own_value(scene, variation)
    points = walk.all_points(value, report)
    groups = np.array([point.group for point in points])
    _, tracks, counts = np.unique(groups, axis=1, return_index=True, return_counts=True)  # those that always coincide
    order = np.argsort(tracks)
    first, multiplicity = tracks[order], counts[order]
    names = number_labels(next(1 + point.row[first] for point in points if point.value == value).tolist())
    approaches, nearest = find_close_approaches(points, first, walk.at)
    points = sorted((*points, *nearest), key=lambda point: point.value)
    values, omega = np.array([point.value for point in points]), np.array([point.omega[first] for point in points])
    return Loci(scene, variation, values, omega, multiplicity, names, value, tuple(approaches))


def _own_value(scene: Scene, variation: Variation) -> float:
    """The scene's own value, if it lies within the range, else the first one."""
    values = {number_at(scene, place) for place in find_places(scene, variation.path)}
    value = values.pop()
    first, last = variation.values[0], variation.values[-1]
    return value if not values and first <= value <= last else first


class _Walk:
    """From the first value to the last, with as many values in between as shapes require."""

    def __init__(self, scene: Scene, variation: Variation) -> None:
        self.scene, self.variation, self.solved = scene, variation, 0

    def at(self, value: float) -> LociPoint:
        """The modes at a value, in ascending order."""
        self.solved += 1
        if self.solved > MOST_SOLVED + len(self.variation.values):
            raise ComputationError(
                f"{self.variation.path}: mode shapes change too often to be followed: use a smaller range"
            )
        return solve_at(self.scene, self.variation.path, value)

    def all_points(self, own_value: float, report: Report) -> list[LociPoint]:
        """All points, including that at `own`, each in the order of the first."""
        values = sorted({*self.variation.values, own_value})
        points = [self.at(values[0])]
        for count, value in enumerate(values[1:], start=2):
            points += self.points_between(points[-1], self.at(value), MOST_HALVINGS)
            report(count)
        return points

    def points_between(self, start: LociPoint, end: LociPoint, depth: int) -> list[LociPoint]:
        """The points after one up to and including the next."""
        point, sure = follow(start, end)
        pair = _find_swap(start, point) if sure else None
        if sure and pair is None:
            return [point]
        middle = self._middle(start, point, pair if depth % 2 else None)
        if depth == 0 or not start.value < middle < end.value:
            if sure:
                return [point]
            raise ComputationError(
                f"{self.variation.path}: a mode cannot be followed at {start.value:.17g}: its shape changes"
            )
        half = self.points_between(start, self.at(middle), depth - 1)
        return half + self.points_between(half[-1], end, depth - 1)

    def _middle(self, start: LociPoint, end: LociPoint, pair: tuple[int, int] | None) -> float:
        """Where the gap of a pair closes by linear interpolation, or the middle of the interval."""
        a, b = start.value, end.value
        if pair:
            first_gap, last_gap = (point.omega[pair[0]] - point.omega[pair[1]] for point in (start, end))
            return float(a + (b - a) * first_gap / (first_gap - last_gap))
        return sqrt(a) * sqrt(b) if self.variation.log else a + (b - a) / 2


def _find_swap(start: LociPoint, end: LociPoint) -> tuple[int, int] | None:
    """The first pair of modes whose order differs, distinct at both ends."""
    order = np.argsort(start.omega, kind="stable")
    later = end.omega[order]
    highest = np.maximum.accumulate(later)
    for upper in np.flatnonzero(later[1:] < highest[:-1]) + 1:
        for lower in range(upper):
            a, b = int(order[lower]), int(order[upper])
            is_distinct = start.group[a] != start.group[b] and end.group[a] != end.group[b]
            if is_distinct and later[lower] > later[upper]:
                return a, b
    return None


def span_of(variation: Variation, scene: Scene) -> str:
    """The number of a scene that is varied, from its first value to its last."""
    first, last = variation.values[0], variation.values[-1]
    return f"{number_words(scene, variation.path)} = {first:.6g} to {last:.6g} {variation.unit}".rstrip()


def loci_text(loci: Loci) -> str:
    """One line per meeting of two loci; the gap of a crossing is rounding error."""
    count, unit = len(loci.variation.values), loci.variation.unit
    between = f" and {len(loci.values) - count} inserted" if len(loci.values) > count else ""
    at = f"{loci.numbered_at:.6g} {unit}".rstrip()
    span = f"{span_of(loci.variation, loci.scene)}, {count} values{between}"
    columns = (
        ReportColumn("kind", None, "meeting"),
        ReportColumn(lambda meeting: " · ".join(loci.names[number] for number in meeting.loci), None, "loci"),
        ReportColumn("value", None, with_unit("at", unit), ".10g"),
        ReportColumn("omega", None, "ω (rad/s)", ".8g"),
        ReportColumn("gap", None, "gap (rad/s)", ".6g"),
        ReportColumn("exchange", None, "exchange (MAC)", ".2f"),
    )
    table = ReportTable.of(columns, loci.encounters).written() or "No loci meet."
    head = f"{loci.omega.shape[1]} loci for {span}, numbered as in the table at {at}"
    return "\n".join([head, table, *left_out(loci.scene), ""])


def loci_csv(loci: Loci) -> str:
    """One row per value: the parameter, then ω of every locus."""
    columns = loci.to_dict()
    return csv_rows([list(columns), *zip(*(column.tolist() for column in columns.values()), strict=True)])
