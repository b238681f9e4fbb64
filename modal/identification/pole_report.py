"""Identified modes as text, CSV and JSON; the CSV is a file of measured modes."""

from __future__ import annotations

from typing import Any

from modal.identification.mode_report import with_error
from modal.identification.poles import Identified, IdentifiedMode
from modal.report import NOTHING, Form, as_csv, as_json, capital, grid, titled
from modal.scene.doors import checked


@checked
def poles_table(identified: Identified, form: Form, title: str = "") -> str:
    """The modes as text, csv or json, the `form`; `title` names the record in text."""
    if form == "csv":
        return as_csv([_row(identified, k, mode) for k, mode in enumerate(identified.modes, 1)])
    if form == "json":
        return as_json(_record(identified))
    rows = [
        [
            str(k),
            with_error(mode.frequency, mode.frequency_std),
            f"{mode.frequency_std:.2g}",
            with_error(mode.damping_ratio, mode.damping_ratio_std),
            f"{mode.damping_ratio_std:.2g}",
            f"{mode.collinearity:.3f}",
            *(f"{value:+.3f}" for value in mode.shape.real.tolist()),
            NOTHING if mode.shape_std is None else f"{mode.shape_std:.2g}",
        ]
        for k, mode in enumerate(identified.modes, 1)
    ]
    headings = ["mode", "f (Hz)", "± (Hz)", "ζ", "± ζ", "collinearity", *identified.names, "± shape"]
    how = {"era": "eigensystem realization", "decrement": "logarithmic decrement"}[identified.method]
    order = f", order {identified.order}" if identified.method == "era" else ""
    notes = "\n".join(capital(note) + "." for note in identified.notes)
    what = "free decays" if identified.excitation == "free" else "responses to random excitation"
    return titled(title, f"poles of {what}", [grid(rows, headings), f"By {how}{order}.", notes], "text")


def _row(identified: Identified, k: int, mode: IdentifiedMode) -> dict[str, Any]:
    shape = dict(zip(identified.names, mode.shape.real.tolist(), strict=True)) if len(identified.names) > 1 else {}
    noise = {"shape_std": mode.shape_std} if shape and identified.method == "era" else {}
    return {
        "mode": k,
        "frequency_hz": mode.frequency,
        "std_hz": mode.frequency_std,
        "damping_ratio": mode.damping_ratio,
        "damping_ratio_std": mode.damping_ratio_std,
        **shape,
        **noise,
    }


def _record(identified: Identified) -> dict[str, Any]:
    modes = [
        {
            "mode": k,
            "frequency_hz": mode.frequency,
            "frequency_std_hz": mode.frequency_std,
            "damping_ratio": mode.damping_ratio,
            "damping_ratio_std": mode.damping_ratio_std,
            "eigenvalue_per_s": [mode.pole.real, mode.pole.imag],
            "shape": [[value.real, value.imag] for value in mode.shape.tolist()],
            "shape_std": mode.shape_std,
            "collinearity": mode.collinearity,
            "frequency_shift_hz": mode.frequency_shift,
        }
        for k, mode in enumerate(identified.modes, 1)
    ]
    return {
        "components": list(identified.names),
        "method": identified.method,
        "excitation": identified.excitation,
        "order": identified.order,
        "modes": modes,
        "stabilization": [
            {
                "order": entry.order,
                "frequency_hz": entry.frequency,
                "damping_ratio": entry.damping_ratio,
                "stable": entry.stable,
            }
            for entry in identified.stabilization
        ],
        "notes": list(identified.notes),
    }
