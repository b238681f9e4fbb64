"""What was tried for a wished accuracy, as text, Markdown, CSV or JSON."""

from __future__ import annotations

from math import isfinite
from typing import Any

from modal.report import NOTHING, as_csv, as_json, finite, grid, titled
from modal.scene import describe
from nonlinear.accuracy.advice import Advice
from nonlinear.accuracy.attempts import Attempt

TRIED = ("way", "tolerance", "time (ms)", "derivatives", "error (rad)")


def advice_table(advice: Advice, form: str) -> str:
    """Every attempt as text, markdown, csv (one line an attempt) or json, the `form`."""
    records = [_record(attempt) for attempt in advice.attempts]
    if form == "json":
        return as_json(_whole(advice, records))
    if form == "csv":
        return as_csv(records)
    cells = [_cells(attempt) for attempt in advice.attempts]
    what = f"the cheapest way to {advice.accuracy:g} rad"
    return titled(advice.trajectory.scene.title, what, [grid(cells, TRIED, form), "\n".join(_notes(advice))], form)


def _cells(attempt: Attempt) -> list[str]:
    return [
        attempt.way,
        f"{attempt.tolerance:.1e}" if isfinite(attempt.tolerance) else NOTHING,
        f"{1e3 * attempt.seconds:.3g}",
        str(attempt.calls),
        f"{attempt.error:.1e}" if isfinite(attempt.error) else "unknown",
    ]


def _notes(advice: Advice) -> list[str]:
    last, times, run = advice.attempts[-1], advice.trajectory.times, advice.trajectory.run
    if run.interrupted:
        verdict = f"{run.stopped}: nothing is promised."
    elif advice.met:
        verdict = f"{last.way}: no angle is off by more than {last.error:.1e} rad until {times[-1]:.9g} s."
    else:
        verdict = f"{advice.limit}."
    return [
        verdict,
        "error: of modes, what they leave of the equations of motion, propagated; of a run, from its difference to "
        "the one before it, whose own error is unknown.",
    ]


def _record(attempt: Attempt) -> dict[str, Any]:
    """One attempt, units in the names; None where a value has no meaning."""
    return {
        "way": attempt.way,
        "tolerance": finite(attempt.tolerance),
        "seconds": attempt.seconds,
        "derivatives": attempt.calls,
        "error_rad": finite(attempt.error),
    }


def _whole(advice: Advice, records: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "scene": describe(advice.trajectory.scene),
        "accuracy_rad": advice.accuracy,
        "met": advice.met,
        "horizon_s": advice.horizon,
        "stopped": advice.trajectory.run.stopped,
        "duration_s": float(advice.trajectory.times[-1] - advice.trajectory.times[0]),
        "attempts": records,
    }
