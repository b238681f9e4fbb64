"""Frequency loci: natural frequencies of a scene as functions of a parameter, and where loci meet.

Modes are followed by shape (`modal.loci.tracking`).  An interval over which a shape changes too much is halved.  Where
two loci exchange their order, the interval is refined until the gap is below the error bounds, or until the shapes are
found to interchange (`modal.loci.tracking`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.loci.tracking import CloseApproach, LociPoint, find_close_approaches, follow, solve_at
from modal.modes import number_labels
from modal.report import Drawable, ReportColumn, ReportTable, TextResult, csv_rows, silent, with_unit
from modal.scene import Scene, left_out, number_words
from modal.scene.doors import checked
from modal.scene.parameters import Variation, find_places, number_at, validate_variations
from modal.types import Floats, Ints


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
    first, multiplicity = _distinct(np.array([point.group for point in points]))
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


def _distinct(groups: Ints) -> tuple[Ints, Ints]:
    """The first track of each set that coincides throughout, by the groups (P, R) of all tracks, and the set's size."""
    _, first, fold = np.unique(groups, axis=1, return_index=True, return_counts=True)
    order = np.argsort(first)
    return first[order], fold[order]


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
