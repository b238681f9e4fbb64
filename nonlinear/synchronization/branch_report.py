"""Branches of configurations as text, CSV and JSON: where each is stable, and its critical values with reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, count, groupby, pairwise
from math import degrees
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from modal.loci import span_of, state_columns
from modal.report import NOTHING, ReportColumn, ReportTable, as_csv, as_json, finite, line_width, with_unit
from modal.scene import Scene, describe
from modal.scene.doors import checked
from modal.scene.parameters import Variation
from modal.types import Crew
from nonlinear.orbits import growth
from nonlinear.synchronization.certificates import certificate_refusal
from nonlinear.synchronization.continuation import (
    Branches,
    EquilibriumBranch,
    ExactBranch,
    follow_branches,
    value_of,
)
from nonlinear.synchronization.patterns import agreement
from nonlinear.synchronization.population_report import ends_of, threshold_words
from nonlinear.synchronization.thresholds import follow_populations, has_patterns

AVERAGED = (
    "Frequency, angle, and where a configuration exists are those of the averaged equations. Its exact stability is "
    "that of the periodic orbit of the full equations next to it, by its Floquet multipliers; exact critical values "
    "are those at which these orbits turn or change their stability."
)
VERDICTS = {True: "stable", False: "unstable"}


def branches_text(diagram: Branches) -> str:
    """One line per branch, counted from 1, then one per critical value, and where the two verdicts differ."""
    unit, where = diagram.variation.unit, span_of(diagram.variation, diagram.scene)
    head = f"{len(diagram.branches)} configurations for {where}"
    table = ReportTable.of(
        (
            ReportColumn(lambda row: row[0], None, ""),
            ReportColumn(lambda row: row[1].words, None, "pendula"),
            ReportColumn(lambda row: ends_of(row[1].omega), None, "ω (rad/s)"),
            ReportColumn(lambda row: ends_of(np.rad2deg(row[1].angle)), None, "largest angle (°)"),
            ReportColumn(
                lambda row: f"{row[1].values[0]:.5g} to {row[1].values[-1]:.5g}", None, with_unit("exists", unit)
            ),
            ReportColumn(lambda row: _lasting(row[1].intervals), None, with_unit("stable, averaged", unit)),
            ReportColumn(
                lambda row: _lasting(row[2].intervals) if any(row[1].orbits) else NOTHING,
                None,
                with_unit("stable, exact", unit),
            ),
        ),
        zip(count(1), diagram.branches, diagram.exact, strict=False),
    )
    parts = [head, table.written() or "no steady motion"]
    if changes := _changes(diagram):
        columns = (
            ReportColumn(lambda row: row["averaged"], None, with_unit("averaged", unit), ".5g"),
            ReportColumn(lambda row: row["exact"], None, with_unit("exact", unit), ".7g"),
            ReportColumn(lambda row: row["distance"], None, with_unit("distance", unit), ".2g"),
            ReportColumn(lambda row: row["branch"], None, ""),
            ReportColumn(_event_words, None, "event"),
        )
        parts += [ReportTable.of(columns, changes).written()]
    parts += [fill(f"{AVERAGED} {_difference_words(diagram)}", line_width())]
    parts += ["\n".join(fill(words, line_width()) for words in _verdict_words(diagram))]
    return "\n\n".join(filter(None, parts)) + "\n"


def _lasting(intervals: Sequence[tuple[float, float]]) -> str:
    return ", ".join(f"{low:.5g} to {high:.5g}" for low, high in intervals) or "nowhere"


def _changes(diagram: Branches) -> list[dict[str, Any]]:
    """The critical values, averaged and exact, None where none was found, ascending."""
    rows = []
    for (change, number), special in zip(diagram.changes, diagram.special_points, strict=True):
        exact = value_of(special) if special else None
        distance = None if exact is None else exact - change.value
        row = {"branch": number + 1, "event": change.kind, "averaged": change.value, "exact": exact}
        rows.append({**row, "distance": distance, "beat_rad_per_s": change.beat or None})
    for number, branch in enumerate(diagram.exact, start=1):
        ends = {high for _, high in branch.intervals}
        for value in (value_of(special) for special in branch.points if special not in diagram.special_points):
            event = "loses stability" if value in ends else "becomes stable"
            row = {"branch": number, "event": event, "averaged": None, "exact": value}
            rows.append({**row, "distance": None, "beat_rad_per_s": None})
    return sorted(rows, key=lambda row: row["exact"] if row["averaged"] is None else row["averaged"])


def _event_words(row: dict[str, Any]) -> str:
    """The event at a critical value: loses stability (neighbours beat at 0.063 rad/s)."""
    beat = row["beat_rad_per_s"]
    return str(row["event"]) + (f" (neighbours beat at {beat:.3g} rad/s)" if beat else "")


def _difference_words(diagram: Branches) -> str:
    """By how much orbits differ from averaged motions at most."""
    rows = [row for branch in diagram.branches for row in zip(branch.orbits, branch.angle, branch.omega, strict=True)]
    differences = [(abs(orbit.amplitude / a - 1), abs(orbit.omega / omega - 1)) for orbit, a, omega in rows if orbit]
    if not differences:
        return ""
    angle, omega = (f"{100 * max(parts):.2g} %" for parts in zip(*differences, strict=True))
    return (
        f"The largest angles of these orbits are within {angle} of the averaged ones, their frequencies within {omega}."
    )


def _verdict_words(diagram: Branches) -> Iterator[str]:
    """Sentences on values at which averaged and exact verdicts differ, or no orbit was found."""
    if reason := certificate_refusal(diagram.scene):
        yield f"No exact verdicts: {reason}."
        return
    for number, branch in enumerate(diagram.branches):
        pieces = _verdicts(branch, diagram.exact[number])
        for (averaged, exact), group in groupby(pieces, lambda piece: piece[2:]):
            ends = [end for low, high, *_ in group for end in (low, high)]
            where = (
                f"{number + 1}, {branch.words}, from {ends[0]:.6g} to {ends[-1]:.6g} {diagram.variation.unit}".rstrip()
            )
            if exact is None:
                yield f"{where}: no periodic orbit was found next to it."
            elif exact is not averaged:
                yield f"{where}: {VERDICTS[averaged]} by averaged equations, but its orbit is {VERDICTS[exact]}."


def _verdicts(branch: EquilibriumBranch, exact: ExactBranch) -> Iterator[tuple[float, float, bool, bool | None]]:
    """Pieces of a branch between all its critical values, with the averaged and the exact verdict, None without one."""
    first, last = branch.values[[0, -1]].tolist()
    edges = {first, last, *chain(*branch.intervals), *map(value_of, exact.points)}
    for low, high in pairwise(sorted(edge for edge in edges if first <= edge <= last)):
        middle = (low + high) / 2
        is_stable, has_stable_orbit = (
            any(start <= middle <= end for start, end in intervals) for intervals in (branch.intervals, exact.intervals)
        )
        orbit = branch.orbit(int(np.abs(branch.values - middle).argmin()))
        yield low, high, is_stable, has_stable_orbit if orbit else None


def branches_csv(diagram: Branches) -> str:
    """One row per branch and value: frequency, stability, angle, growth, of the orbit next to it as well; pattern."""
    return as_csv(_branch_rows(diagram))


def branches_json(diagram: Branches) -> str:
    """The same rows, every branch, and the critical values, averaged and exact, null where none was found."""
    branches = [
        {
            "branch": number,
            "pendula": branch.words,
            "stable_averaged": branch.intervals,
            "stable_exact": exact.intervals if any(branch.orbits) else None,
        }
        for number, branch, exact in zip(count(1), diagram.branches, diagram.exact, strict=False)
    ]
    variation = {"vary": diagram.variation.path, "unit": diagram.variation.unit}
    rows = {"rows": _branch_rows(diagram), "branches": branches, "changes": _changes(diagram)}
    return as_json({"scene": describe(diagram.scene), **variation, **rows})


def _branch_rows(diagram: Branches) -> list[dict[str, Any]]:
    rows = []
    for number, branch in enumerate(diagram.branches, start=1):
        numbers = branch.values.tolist(), branch.is_stable, branch.omega.tolist(), branch.angle.tolist()
        for value, stable, omega, angle, state, orbit in zip(*numbers, branch.states, branch.orbits, strict=True):
            columns = state_columns(
                diagram.variation, value, omega, stable=bool(stable), angle_deg=degrees(angle), growth=state.growth
            )
            exact = {
                "exact_omega_rad_per_s": orbit and orbit.omega,
                "exact_stable": orbit and int(orbit.is_stable),
                "exact_largest_angle_deg": orbit and degrees(orbit.amplitude),
                "exact_growth_per_s": orbit and finite(growth(orbit)),
            }
            rows.append({**columns, **exact, "branch": number, "pendula": agreement(state)})
    return rows


class AveragedThreshold(NamedTuple):
    """A critical value of the averaged equations, in words the event there as the number grows, and its reason."""

    value: float
    words: str
    reason: str = ""


DRAINS = {"loses stability": "begins to drain it", "becomes stable": "no longer drains it"}


@checked
def averaged_thresholds(
    scene: Scene, vary: str | Variation, *, crew: Crew | None = None
) -> tuple[AveragedThreshold, ...]:
    """Where averaged equations let a steady motion begin, end or change its stability along a number, ascending.

    Their words name the motion and the event, the reason which mode drains it or how far it is drained.  Raises what
    `follow_branches` and, for populations on a structure, `follow_populations` raise.

    >>> from modal import load
    >>> from nonlinear.synchronization import averaged_thresholds
    >>> for threshold in averaged_thresholds(load("huygens"), "support.mass=20:30:2"):
    ...     print(f"{threshold.value:.3f} kg: {threshold.words}: {threshold.reason}")
    26.673 kg: in phase loses stability: mode 3 (cart still: antiphase) begins to drain it
    """
    if has_patterns(scene):
        thresholds = follow_populations(scene, vary, crew=crew).thresholds
        return tuple(
            AveragedThreshold(each.averaged, f"{each.pattern}: {threshold_words(each)}", each.reason)
            for each in thresholds
            if each.averaged is not None
        )
    diagram = follow_branches(scene, vary)
    return tuple(
        AveragedThreshold(
            change.value,
            f"{diagram.branches[number].words} {change.kind}",
            f"{change.rival} {DRAINS[change.kind]}" if change.rival else "",
        )
        for change, number in diagram.changes
    )
