"""What a check and a comparison found, as text, Markdown, CSV or JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, isinf, log10
from typing import Any

from tabulate import tabulate

from modal.modes.table import NOTHING
from modal.report.escaping import csv_rows, json_text, markdown, visible
from modal.scene.model import Scene, described
from nonlinear.verification.measurement import Measurement
from nonlinear.verification.modes import FARTHEST, Check, ModeCheck

FORMATS = {"text": "simple", "markdown": "github"}
MODES = ("mode", "ω (rad/s)", "κ (1/rad²)", "measured", "± rel.", "1 % at (°)", "measured (°)", "family")
RUNS = ("mode", "angle (°)", "ω(a) (rad/s)", "± rel.", "ω(a)/ω − 1", "κa²", "outside")


def check_table(found: Check, form: str) -> str:
    """A check as text, markdown, csv (one line a run) or json, the `form`."""
    if form == "json":
        whole = {
            "scene": described(found.scene),
            "modes": [_mode_record(row) for row in found.rows],
            "skipped": [{"mode": number, "reason": reason} for number, reason in found.skipped],
        }
        return as_json(whole)
    records = [_run_record(row, run) for row in found.rows for run in row.measurements]
    if form == "csv":
        return as_csv(records)
    parts = [
        grid([_mode_cells(row) for row in found.rows], MODES, form),
        grid([_run_cells(row, run) for row in found.rows for run in row.measurements], RUNS, form),
        "\n".join(_notes(found)),
    ]
    return titled(found.scene, "the table of modes against the full motion", parts, form)


def titled(scene: Scene, what: str, parts: Sequence[str], form: str) -> str:
    """The parts that are not empty under one title."""
    title = f"{scene.title or 'Modes'}: {what}"
    head = f"**{markdown(title)}**" if form == "markdown" else visible(title)
    return "\n\n".join([head, *(part for part in parts if part)]) + "\n"


LEFT = {"family", "lines", "pendula", "neighbours"}


def grid(cells: Sequence[Sequence[str]], headings: Sequence[str], form: str) -> str:
    """Cells under headings, words to the left and numbers to the right; nothing where there are no cells."""
    align = ["left" if heading in LEFT else "right" for heading in headings]
    return tabulate(cells, headings, tablefmt=FORMATS[form], colalign=align, disable_numparse=True) if cells else ""


def as_csv(records: Sequence[dict[str, Any]]) -> str:
    """One line a record."""
    return csv_rows([list(records[0]) if records else [], *(record.values() for record in records)])


def as_json(whole: dict[str, Any]) -> str:
    """Readable JSON."""
    return json_text(whole) + "\n"


def digits(value: float, relative_error: float, most: int) -> str:
    """At most so many significant digits, and no more than are certain."""
    if not isfinite(value) or not relative_error < 1:
        return NOTHING
    return f"{value:#.{min(most, max(1, int(-log10(max(relative_error, 1e-17)))))}g}".rstrip(".") if value else "0"


def finite(value: float) -> float | None:
    """None for what has no meaning."""
    return value if isfinite(value) else None


def _angle(degree: float) -> str:
    return f">{FARTHEST:g}" if isinf(degree) or degree > FARTHEST else digits(degree, 0.0, 3)


def _mode_cells(row: ModeCheck) -> list[str]:
    mode, (kappa, error) = row.mode, row.kappa
    certain = error / abs(kappa) if kappa else 1.0
    return [
        f"{mode.number}{'*' if mode.resonances else ''}",
        digits(mode.omega, mode.relative_error_bound, 9),
        digits(mode.kappa, 0.0, 5),
        digits(kappa, certain, 5),
        f"{certain:.0e}" if isfinite(certain) else NOTHING,
        _angle(mode.linear_to_1_percent_deg),
        _angle(row.one_percent_deg),
        mode.family,
    ]


def _run_cells(row: ModeCheck, run: Measurement) -> list[str]:
    angle, expected = f"{degrees(run.amplitude):.4g}", digits(row.predicted(run), 0.0, 4)
    head, outside = [str(row.mode.number), angle], f"{run.outside:.1e}"
    if run.irregular:
        return [*head, "irregular", NOTHING, NOTHING, expected, outside]
    shift = digits(run.shift, run.error / max(abs(run.shift), run.error), 4)
    return [*head, digits(run.omega, run.error, 9), f"{run.error:.0e}", shift, expected, outside]


def _notes(found: Check) -> list[str]:
    notes = [f"mode {number} was left out: {reason}." for number, reason in found.skipped]
    if any(row.mode.resonances for row in found.rows):
        notes.append("* near a 1:1 or 1:3 resonance, with another mode or among its own.")
    if found.scene.has_damping:
        notes.append("dampers: κa² and ω(a) belong to the mean amplitude of a run, less than the angle released.")
    if found.scene.is_driven:
        notes.append("drives: left out, as they are of the table.")
    notes.append("outside: the largest share of the energy that was seen in other modes.")
    return notes


def _run_record(row: ModeCheck, run: Measurement) -> dict[str, Any]:
    """One run with its mode, units in the names; None where a value has no meaning."""
    return {
        "mode": row.mode.number,
        "omega_linear_rad_per_s": row.mode.omega,
        "kappa_per_rad2": finite(row.mode.kappa),
        "amplitude_deg": degrees(run.amplitude),
        "effective_amplitude_deg": degrees(run.effective),
        "irregular": run.irregular,
        "omega_rad_per_s": None if run.irregular else run.omega,
        "relative_error": finite(run.error),
        "shift": None if run.irregular else run.shift,
        "predicted_shift": finite(row.predicted(run)),
        "energy_share_outside": finite(run.outside),
    }


def _mode_record(row: ModeCheck) -> dict[str, Any]:
    kappa, error = row.kappa
    return {
        "mode": row.mode.number,
        "family": row.mode.family,
        "omega_rad_per_s": row.mode.omega,
        "kappa_per_rad2": finite(row.mode.kappa),
        "kappa_measured_per_rad2": finite(kappa),
        "kappa_measured_error_per_rad2": finite(error),
        "linear_to_1_percent_deg": finite(row.mode.linear_to_1_percent_deg),
        "measured_to_1_percent_deg": finite(row.one_percent_deg),
        "resonances": list(row.mode.resonances),
        "runs": [_run_record(row, run) for run in row.measurements],
    }
