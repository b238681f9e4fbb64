"""A motion beside the table of modes as text, Markdown, CSV or JSON."""

from __future__ import annotations

from math import degrees
from typing import Any

from modal.report import as_csv, as_json, digits, finite, grid, titled
from modal.scene import describe
from nonlinear.verification.motion import Comparison, ModeInMotion

HEADINGS = ("mode", "ω (rad/s)", "largest (°)", "energy", "lines")


def comparison_table(found: Comparison, form: str) -> str:
    """A comparison as text, markdown, csv (one line for each line of the motion) or json, the `form`."""
    if form == "json":
        return as_json({"scene": describe(found.modes.scene), "coordinates": [_record(found, r) for r in found.rows]})
    if form == "csv":
        return as_csv(
            [{"mode": r.mode.number, "copy": r.copy + 1, **line} for r in found.rows for line in _lines(found, r)]
        )
    note = "lines: frequency (rad/s), amplitude, and how far they are off the nearest frequency of the table."
    parts = [grid([_cells(found, row) for row in found.rows], HEADINGS, form), note]
    return titled(found.modes.scene.title, "the motion in modal coordinates", parts, form)


def _cells(found: Comparison, row: ModeInMotion) -> list[str]:
    mode = row.mode
    label = f"{mode.number}.{row.copy + 1}" if mode.multiplicity > 1 else str(mode.number)
    largest = f"{degrees(row.largest):.3g}" if mode.omega else f"{row.largest:.3g} m"
    omega = digits(mode.omega, mode.relative_error_bound, 9)
    return [label, omega, largest, f"{row.share:.1%}", row.note or "; ".join(_words(found, row))]


def _words(found: Comparison, row: ModeInMotion) -> list[str]:
    words = []
    for line in row.lines:
        number, off = found.nearest(line)
        where = f"mode {number} {off:+.2%}" if abs(off) < 0.2 else "between modes"
        words.append(f"{digits(line.omega, line.relative_error, 6)} ({degrees(line.amplitude):.2g}°, {where})")
    return words


def _lines(found: Comparison, row: ModeInMotion) -> list[dict[str, Any]]:
    return [
        {
            "omega_rad_per_s": line.omega,
            "relative_error": finite(line.relative_error),
            "amplitude_deg": degrees(line.amplitude),
            "phase_rad": line.phase,
            "nearest_mode": found.nearest(line)[0],
            "relative_difference": found.nearest(line)[1],
        }
        for line in row.lines
    ]


def _record(found: Comparison, row: ModeInMotion) -> dict[str, Any]:
    return {
        "mode": row.mode.number,
        "copy": row.copy + 1,
        "omega_rad_per_s": row.mode.omega,
        "largest_rad": row.largest,
        "energy_share": finite(row.share),
        "lines": _lines(found, row),
        "note": row.note,
    }
