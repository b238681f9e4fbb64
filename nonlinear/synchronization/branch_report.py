"""Branches of configurations as text, CSV and JSON: where each is stable, and its critical values with reasons."""

from __future__ import annotations

from math import degrees
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from modal.loci import span_of, state_columns
from modal.report import ReportColumn, ReportTable, as_csv, as_json, line_width, with_unit
from modal.scene import Scene, describe
from modal.scene.doors import checked
from modal.scene.parameters import Variation
from modal.types import Crew
from nonlinear.synchronization.continuation import Branches, Change, EquilibriumBranch, follow_branches
from nonlinear.synchronization.patterns import agreement
from nonlinear.synchronization.population_report import ends_of, threshold_words
from nonlinear.synchronization.thresholds import follow_populations, has_patterns

LOCATED = (
    "exact: where periodic orbits of the full equations turn or change their stability, by their Floquet multipliers."
)
AVERAGED = "Frequency, angle and where a configuration exists and is stable are those of the averaged equations."


def branches_text(diagram: Branches) -> str:
    """One line per branch, counted from 1, then one per critical value."""
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
            ReportColumn(lambda row: _lasting(row[1]), None, with_unit("stable", unit)),
        ),
        enumerate(diagram.branches, start=1),
    )
    parts = [head, table.written() or "no steady motion", "", fill(AVERAGED, line_width())]
    if diagram.changes:
        table = ReportTable.of(
            (
                ReportColumn(lambda row: row[0][0].value, None, with_unit("averaged", unit), ".5g"),
                ReportColumn(lambda row: row[1].orbit.value if row[1] else None, None, with_unit("exact", unit), ".7g"),
                ReportColumn(lambda row: row[0][1] + 1, None, ""),
                ReportColumn(lambda row: change_words(row[0][0]), None, "event"),
            ),
            zip(diagram.changes, diagram.special_points, strict=True),
        )
        parts += ["", table.written()]
        if any(diagram.special_points):
            parts += ["", fill(LOCATED, line_width())]
    return "\n".join(parts) + "\n"


def _lasting(branch: EquilibriumBranch) -> str:
    return ", ".join(f"{low:.5g} to {high:.5g}" for low, high in branch.intervals) or "nowhere"


def branches_csv(diagram: Branches) -> str:
    """One row per branch and value: frequency, stability, largest angle, growth rate, and the pattern."""
    return as_csv(_branch_rows(diagram))


def branches_json(diagram: Branches) -> str:
    """The same rows, and the critical values, averaged and exact, null where none was found."""
    changes = [
        {
            "branch": number + 1,
            "event": change.kind,
            "averaged": change.value,
            "exact": special and special.orbit.value,
            "beat_rad_per_s": change.beat or None,
        }
        for (change, number), special in zip(diagram.changes, diagram.special_points, strict=True)
    ]
    variation = {"vary": diagram.variation.path, "unit": diagram.variation.unit}
    return as_json({"scene": describe(diagram.scene), **variation, "rows": _branch_rows(diagram), "changes": changes})


def _branch_rows(diagram: Branches) -> list[dict[str, Any]]:
    rows = []
    for number, branch in enumerate(diagram.branches, start=1):
        numbers = branch.values.tolist(), branch.is_stable, branch.omega.tolist(), branch.angle.tolist(), branch.states
        for value, stable, omega, angle, state in zip(*numbers, strict=True):
            columns = state_columns(
                diagram.variation, value, omega, stable=bool(stable), angle_deg=degrees(angle), growth=state.growth
            )
            rows.append({**columns, "branch": number, "pendula": agreement(state)})
    return rows


def change_words(change: Change) -> str:
    """The event at a critical value: loses stability (neighbours beat at 0.063 rad/s)."""
    return change.kind + (f" (neighbours beat at {change.beat:.3g} rad/s)" if change.beat else "")


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
