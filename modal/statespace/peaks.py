"""Peaks of a frequency response: their heights for every output at every mode, and their frequencies.

Frequencies are closest within some half-widths |Re λ| of Im λ, where λ is the eigenvalue of a mode, and a peak among
them is found between ever closer ones.  That of an undamped mode is infinite, at its own frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.modes import mode_losses
from modal.report import as_json, finite
from modal.scene.signal_names import signal_label
from modal.statespace.modal_form import ModalForm
from modal.statespace.response import TOLERANCE_OF_RESPONSE, frequency_response, signal_table
from modal.types import EPS, Floats

MOST_SLOW_MODES = 12
"""Format: modes whose peaks are printed, the slowest, as the heading says."""
MOST_OUTPUTS = 24
"""Limit: outputs whose peaks are printed, refused beyond."""
HALF_WIDTHS_OF_PEAK = 10.0
"""Tolerance: half-widths of a mode within which its peak is looked for."""
POINTS_OF_PEAK = 24
"""Cost: frequencies at once, of which the three around the highest bound the next, closer ones."""


def peaks_table(form: ModalForm, source: int, outputs: Sequence[int], to: str) -> str:
    """The peaks of some outputs for one input at the slowest modes, as "text", "csv" or "json".

    Infinite magnitudes are null in JSON and empty in CSV.
    """
    if len(outputs) > MOST_OUTPUTS:
        raise ComputationError(f"{len(outputs)} outputs: choose at most {MOST_OUTPUTS} with `outputs`")
    driven, records = form.model.inputs[source], list(_records(form, source, outputs))
    notes = [] if records else ["No output has a peak."]
    if any(np.isinf(record["magnitude"]) for record in records):
        notes.append("∞: an undamped mode; give its links or joints damping.")
    if to != "text":
        records = [{key: finite(value) for key, value in record.items()} for record in records]
    if to == "json":
        return as_json({"input": driven.name, "peaks": records})
    slowest = f" of the {MOST_SLOW_MODES} slowest modes" if len(_oscillating(form)) > MOST_SLOW_MODES else ""
    return signal_table(form, f"peaks of the response to {signal_label(driven)}{slowest}", records, to, notes)


def _records(form: ModalForm, source: int, outputs: Sequence[int]) -> Iterator[dict[str, Any]]:
    driven, losses = form.model.inputs[source], np.nan_to_num(mode_losses(form.modes))
    rows = _oscillating(form)[:MOST_SLOW_MODES]
    if not rows:
        return
    poles = form.modes.eigenvalue[rows]
    widths = np.abs(poles.real) + losses[rows] * poles.imag / 2
    aside = np.geomspace(1 / HALF_WIDTHS_OF_PEAK, HALF_WIDTHS_OF_PEAK, POINTS_OF_PEAK)
    aside = np.concatenate((-aside, [0.0], aside))
    close_points = (poles.imag[:, None] + widths[:, None] * aside).ravel()
    between = np.geomspace(poles.imag.min() / 2, poles.imag.max() * 2, POINTS_OF_PEAK)
    omega = np.unique(np.concatenate((between, close_points[close_points > 0])))

    def size(k: int, at: Floats) -> Floats:
        return np.asarray(np.abs(frequency_response(form, at, outputs=[k], inputs=[source])[0, 0]))

    for k in outputs:
        for at, height in _peaks(lambda at, k=k: size(k, at), omega):  # type: ignore[misc]
            yield {
                "output": form.model.outputs[k].name,
                "unit": f"{form.model.outputs[k].unit} per {driven.unit}",
                "frequency_hz": at / (2 * np.pi),
                "magnitude": height,
                "magnitude_db": 20 * np.log10(height),
            }


def _peaks(size: Callable[[Floats], Floats], omega: Floats) -> Iterator[tuple[float, float]]:
    """Where a magnitude is larger than to either side, found between the frequencies next to it, and how large."""
    heights = size(omega)
    for k in np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1:
        low, at, high, height = omega[k - 1], omega[k], omega[k + 1], heights[k]
        drop = height
        while np.isfinite(height) and drop > TOLERANCE_OF_RESPONSE * height and high - low > 4 * EPS * high:
            inner = np.linspace(low, high, POINTS_OF_PEAK)
            values = size(inner)
            best = int(np.clip(values.argmax(), 1, POINTS_OF_PEAK - 2))
            low, at, high = inner[best - 1 : best + 2]
            height = values[best]
            drop = height - values[[best - 1, best + 1]].min()
        yield float(at), float(height)


def _oscillating(form: ModalForm) -> list[int]:
    """The rows of modes that oscillate, of each frequency the first."""
    rates = form.modes.eigenvalue
    return [row for row in range(len(rates)) if rates[row].imag > 0 and (row == 0 or rates[row] != rates[row - 1])]
