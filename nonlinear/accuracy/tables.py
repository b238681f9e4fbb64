"""Time against accuracy, and the attempts for a requested accuracy, as text, Markdown, CSV or JSON."""

from __future__ import annotations

from math import isfinite
from typing import Any

from modal.report import NOTHING, Form, as_csv, as_json, finite, grid, titled
from modal.scene import describe, title_of
from modal.scene.doors import checked
from nonlinear.accuracy.advice import Advice
from nonlinear.accuracy.attempts import Attempt
from nonlinear.accuracy.references import Reference
from nonlinear.accuracy.work_precision import LAST, WorkPrecision, WorkPrecisionRow

ROWS = (
    "Pareto",
    "method",
    "tolerance",
    "time (ms)",
    "prepared (ms)",
    "derivatives",
    "error (rad)",
    "late (s)",
    "energy",
)
TRIED = ("way", "tolerance", "time (ms)", "derivatives", "error (rad)")


@checked
def tradeoff_table(result: WorkPrecision, form: Form) -> str:
    """Every candidate as text, markdown, csv (one line per candidate) or json, as `form` says."""
    records = [_record(result, row) for row in result.rows]
    if form == "json":
        return as_json(_whole(result, records))
    if form == "csv":
        return as_csv(records)
    cells = [_cells(result, row) for row in result.rows]
    return titled(
        title_of(result.scene),
        "time against accuracy",
        [grid(cells, ROWS, form), "\n".join(_notes(result))],
        form,
    )


def _cells(precision: WorkPrecision, row: WorkPrecisionRow) -> list[str]:
    candidate = row.candidate
    return [
        "*" if row in precision.pareto else "",
        candidate.family,
        NOTHING if candidate.modal else f"{candidate.tolerance:.1e}".replace(".0e", "e"),
        f"{1e3 * row.seconds:.3g}",
        f"{1e3 * row.prepared:.3g}",
        str(row.calls),
        f"{row.error:.1e}" if row.error > precision.reference.floor else f"<{precision.reference.floor:.1e}",
        _signed(row.shift),
        _signed(row.drift),
    ]


def _signed(value: float) -> str:
    return f"{value:.1e}" if isfinite(value) else NOTHING


def _notes(precision: WorkPrecision) -> list[str]:
    reference = precision.reference
    notes = [
        f"reference: {reference.candidate.name}, checked against {reference.check.name}: they differ by "
        f"{reference.difference[-1]:.1e} rad, and a small error grows {reference.growth[-1]:.2g} times, so no error "
        f"below {reference.floor:.1e} rad can be resolved.",
        f"all {reference.horizon:g} s are compared." if reference.whole else _cut_short(reference),
    ]
    notes += [f"{name} was left out: {reason}." for name, reason in precision.skipped]
    notes.append(
        "*: on the Pareto front: no other is both faster and more accurate. time: a run, once prepared; derivatives: "
        "right-hand sides, or series of Taylor methods. error: the largest of any link, modulo whole turns, so never "
        f"above 3.14 rad. late: shift in time in the last {100 * LAST:.0f} %. energy: drift, relative."
    )
    return notes


def _cut_short(reference: Reference) -> str:
    pace = (
        f": until then the e-folding time of a small error is {1 / reference.exponent:.2g} s"
        if reference.exponent
        else ""
    )
    return (
        f"only the first {reference.horizon:.4g} s of {reference.duration:g} s are compared{pace}; "
        "the reference cannot be trusted further."
    )


def _record(precision: WorkPrecision, row: WorkPrecisionRow) -> dict[str, Any]:
    """One candidate, units in the names; None where a value has no meaning."""
    return {
        "kind": row.candidate.kind,
        "method": row.candidate.method or None,
        "compiled": row.candidate.compiled,
        "tolerance": finite(row.candidate.tolerance),
        "seconds": row.seconds,
        "prepared_seconds": row.prepared,
        "derivatives": row.calls,
        "error_rad": row.error,
        "certain": row.error > precision.reference.floor,
        "late_s": finite(row.shift),
        "energy_drift": finite(row.drift),
        "pareto": row in precision.pareto,
    }


def _whole(precision: WorkPrecision, records: list[dict[str, Any]]) -> dict[str, Any]:
    reference = precision.reference
    return {
        "scene": describe(precision.scene),
        "reference": reference.candidate.name,
        "held_against": reference.check.name,
        "difference_rad": float(reference.difference[-1]),
        "floor_rad": reference.floor,
        "duration_s": reference.duration,
        "horizon_s": reference.horizon,
        "growth": float(reference.growth[-1]),
        "rungs": records,
        "skipped": [{"rung": name, "reason": reason} for name, reason in precision.skipped],
    }


@checked
def advice_table(advice: Advice, form: Form) -> str:
    """Every attempt as text, markdown, csv (one line per attempt) or json, as `form` says."""
    records = [_attempt_record(attempt) for attempt in advice.attempts]
    if form == "json":
        return as_json(_advice_whole(advice, records))
    if form == "csv":
        return as_csv(records)
    cells = [_tried_cells(attempt) for attempt in advice.attempts]
    what = f"the cheapest way to {advice.accuracy:g} rad"
    return titled(
        title_of(advice.trajectory.scene), what, [grid(cells, TRIED, form), "\n".join(_advice_notes(advice))], form
    )


def _tried_cells(attempt: Attempt) -> list[str]:
    return [
        attempt.way,
        f"{attempt.tolerance:.1e}" if isfinite(attempt.tolerance) else NOTHING,
        f"{1e3 * attempt.seconds:.3g}",
        str(attempt.calls),
        f"{attempt.error:.1e}" if isfinite(attempt.error) else "unknown",
    ]


def _advice_notes(advice: Advice) -> list[str]:
    last, times, run = advice.attempts[-1], advice.trajectory.times, advice.trajectory.run
    if run.interrupted:
        verdict = f"{run.stopped}: no accuracy is guaranteed."
    elif advice.met:
        verdict = f"{last.way}: no angle is off by more than {last.error:.2g} rad until {times[-1]:.9g} s."
    else:
        verdict = f"{advice.limit}."
    return [
        verdict,
        "error: for modes, from their residual in the equations of motion; for a run, from its difference from "
        "the previous run, whose own error is unknown.",
    ]


def _attempt_record(attempt: Attempt) -> dict[str, Any]:
    """One attempt, units in the names; None where a value has no meaning."""
    return {
        "way": attempt.way,
        "tolerance": finite(attempt.tolerance),
        "seconds": attempt.seconds,
        "derivatives": attempt.calls,
        "error_rad": finite(attempt.error),
    }


def _advice_whole(advice: Advice, records: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "scene": describe(advice.trajectory.scene),
        "accuracy_rad": advice.accuracy,
        "met": advice.met,
        "horizon_s": advice.horizon,
        "stopped": advice.trajectory.run.stopped,
        "duration_s": float(advice.trajectory.times[-1] - advice.trajectory.times[0]),
        "attempts": records,
    }
