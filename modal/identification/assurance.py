"""Measured beside computed modes: MAC matrix, pairs, errors of frequencies and damping ratios.

    MAC_rs = |φ_rᴴψ_s|²/((φ_rᴴφ_r)(ψ_sᴴψ_s))

over the components that were measured, as they stand: angles in rad, the cart in m (Allemang & Brown, Proc. 1st IMAC,
110 (1982); Ewins, Modal Testing, 2nd ed. 2000, §7.4).  Where all measured modes have shapes, pairs are those of the
largest MAC; else those of the nearest frequencies, by the least sum of |ln f/f'|.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.identification.measured import MeasuredMode, MeasuredModes, component_rows, turned
from modal.modes import Mode, Modes
from modal.report import NOTHING, Displayed, Form, as_csv, as_json, finite, grid, titled
from modal.scene import title_of
from modal.scene.doors import checked
from modal.types import Floats

LEAST = 0.5  # MAC of a pair below which shapes are called different


@dataclass(frozen=True, repr=False)
class ModePair(Displayed):
    """A measured mode and the computed one nearest to it; `mac` is None without shapes."""

    measured: MeasuredMode
    computed: Mode
    mac: float | None

    @property
    def frequency(self) -> float:
        """The computed one, in Hz."""
        return self.computed.omega / (2 * pi)

    @property
    def error(self) -> float:
        """Of the computed frequency, relative to the measured one."""
        return self.frequency / self.measured.frequency - 1

    @property
    def deviation(self) -> float:
        """Of the computed frequency, in standard deviations of the measured one."""
        return (self.frequency - self.measured.frequency) / self.measured.std


@dataclass(frozen=True, eq=False, repr=False)
class Assurance(Displayed):
    """MAC (R, S) of measured modes with the oscillating ones computed, `rows`; NaN where there is no shape."""

    modes: Modes
    measured: MeasuredModes
    rows: tuple[Mode, ...]
    mac: Floats
    pairs: tuple[ModePair, ...]

    @property
    def notes(self) -> list[str]:
        """What there is to say of the pairs."""
        notes = []
        for pair in self.pairs:
            if pair.mac is not None and pair.mac < LEAST:
                notes.append(f"mode {pair.measured.number}: no computed shape is like it (MAC {pair.mac:.2f})")
            elif pair.computed.number != pair.measured.number:
                notes.append(
                    f"mode {pair.measured.number} of the file is like mode {pair.computed.number} of the table"
                )
        if np.isfinite(self.mac).any() and len(self.measured.components) < len(self.rows):
            notes.append("fewer components than modes: shapes of different modes may look alike")
        return notes


@checked
def compare_modes(modes: Modes, measured: MeasuredModes) -> Assurance:
    """Measured modes beside those of a scene that oscillate; a repeated frequency has the MAC of its nearest shape.

    Raises ComputationError where nothing oscillates.
    """
    rows = tuple(mode for mode in modes if mode.oscillates and mode.omega > 0)
    if not rows:
        raise ComputationError("no mode of this scene oscillates")
    places = component_rows(modes.scene, measured.components)
    mac = np.full((len(measured.modes), len(rows)), np.nan)
    for r, measured_mode in enumerate(measured.modes):
        if measured_mode.shape is None:
            continue
        there = np.isfinite(measured_mode.shape)
        for s, mode in enumerate(rows):
            members = modes.matrix.row == modes.index_of(mode)
            mac[r, s] = _nearest(
                measured_mode.shape[there], modes.matrix.shapes[:, members & ~modes.matrix.across][places][there]
            )
    return Assurance(modes, measured, rows, mac, tuple(_pairs(measured, rows, mac)))


def _nearest(shape: Floats, basis: Any) -> float:
    """MAC with the nearest combination of the columns of a basis (C, k); 0 where none has these components."""
    if not basis.shape[1]:
        return 0.0
    if basis.shape[1] == 1:
        return _square(shape, turned(basis[:, 0]).real)
    Q, R, *_ = np.linalg.svd(basis, full_matrices=False)
    Q = Q[:, 1e-10 * max(R[0], 1e-300) < R]
    return float(np.linalg.norm(Q.conj().T @ shape) ** 2 / (shape @ shape)) if Q.size else 0.0


def _square(shape: Floats, other: Floats) -> float:
    whole = float((shape @ shape) * (other @ other))
    return float((shape @ other) ** 2) / whole if whole else 0.0


def _pairs(measured: MeasuredModes, rows: tuple[Mode, ...], mac: Floats) -> list[ModePair]:
    shaped = bool(np.isfinite(mac).all())
    cost = np.array(
        [
            [abs(log(measured_mode.frequency / (mode.omega / (2 * pi)))) for mode in rows]
            for measured_mode in measured.modes
        ]
    )
    left, right = scipy.optimize.linear_sum_assignment(-mac if shaped else cost)
    return [
        ModePair(measured.modes[r], rows[s], None if np.isnan(mac[r, s]) else float(mac[r, s]))
        for r, s in zip(left.tolist(), right.tolist(), strict=True)
    ]


@checked
def assurance_table(assurance: Assurance, form: Form) -> str:
    """The pairs and the matrix as text or json, the matrix alone as csv, by `form`."""
    numbers = [f"mode_{mode.number}" for mode in assurance.rows]
    matrix = [
        {"measured": measured_mode.number} | dict(zip(numbers, map(float, values), strict=True))
        for measured_mode, values in zip(assurance.measured.modes, assurance.mac, strict=True)
    ]
    if form == "csv":
        return as_csv(matrix)
    if form == "json":
        return as_json(
            {
                "measured": [measured_mode.number for measured_mode in assurance.measured.modes],
                "computed": [mode.number for mode in assurance.rows],
                "components": assurance.measured.labels,
                "mac": [[finite(float(value)) for value in values] for values in assurance.mac],
                "pairs": [_pair_record(pair) for pair in assurance.pairs],
                "notes": assurance.notes,
            }
        )
    pairs = [
        [
            str(pair.measured.number),
            str(pair.computed.number),
            NOTHING if pair.mac is None else f"{pair.mac:.4f}",
            f"{pair.measured.frequency:.6g}",
            f"{pair.measured.std:.2g}",
            f"{pair.frequency:.6g}",
            f"{100 * pair.error:+.3g}",
            f"{pair.deviation:+.2g}",
            NOTHING if pair.measured.damping_ratio is None else f"{pair.measured.damping_ratio:.4g}",
            f"{pair.computed.damping_ratio:.4g}",
        ]
        for pair in assurance.pairs
    ]
    headings = ["measured", "table", "MAC", "f (Hz)", "±", "computed (Hz)", "error (%)", "error (±)", "ζ", "computed ζ"]
    cells = [
        [str(measured_mode.number), *(NOTHING if np.isnan(value) else f"{value:.3f}" for value in values)]
        for measured_mode, values in zip(assurance.measured.modes, assurance.mac, strict=True)
    ]
    shaped = bool(np.isfinite(assurance.mac).any())
    matrix_text = grid(cells, ["MAC", *(str(mode.number) for mode in assurance.rows)]) if shaped else ""
    parts = [grid(pairs, headings), matrix_text, "\n".join(f"{note[0].upper()}{note[1:]}." for note in assurance.notes)]
    return titled(title_of(assurance.modes.scene), "measured beside computed modes", parts, "text")


def _pair_record(pair: ModePair) -> dict[str, Any]:
    return {
        "measured": pair.measured.number,
        "computed": pair.computed.number,
        "mac": pair.mac,
        "measured_frequency_hz": pair.measured.frequency,
        "std_hz": pair.measured.std,
        "computed_frequency_hz": pair.frequency,
        "relative_error": pair.error,
        "deviation_in_stds": pair.deviation,
        "measured_damping_ratio": pair.measured.damping_ratio,
        "computed_damping_ratio": pair.computed.damping_ratio,
    }
