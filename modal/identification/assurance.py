"""Measured next to computed modes: MAC matrix, pairs, errors of frequencies and damping ratios.

    MAC_rs = |φ_rᴴψ_s|²/((φ_rᴴφ_r)(ψ_sᴴψ_s))

over the components that were measured, as they stand: angles in rad, the cart in m [Allemang1982], [Ewins2000, §7.4].
Where all measured modes have shapes, pairs are those of the largest MAC; else those of the nearest frequencies, by the
least sum of |ln f/f'|.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import log, pi
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.identification.measured import MeasuredMode, MeasuredModes, component_rows, turned
from modal.modes import Mode, Modes
from modal.report import NOTHING, Displayed, Form, ReportColumn, ReportTable, Result, finite, records_of
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Floats


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
        """The error of the computed frequency, relative to the measured one."""
        return self.frequency / self.measured.frequency - 1

    @property
    def deviation(self) -> float:
        """The deviation of the computed frequency, in standard deviations of the measured one."""
        return (self.frequency - self.measured.frequency) / self.measured.std


PAIR = (
    ReportColumn("measured.number", "measured", "measured"),
    ReportColumn("computed.number", "computed", "table"),
    ReportColumn("mac", "mac", "MAC", ".4f"),
    ReportColumn("measured.frequency", "measured_frequency_hz", "f (Hz)", ".6g"),
    ReportColumn("measured.std", "std_hz", "±", ".2g"),
    ReportColumn("frequency", "computed_frequency_hz", "computed (Hz)", ".6g"),
    ReportColumn("error", "relative_error", "error (%)", lambda error: f"{100 * error:+.3g}"),
    ReportColumn("deviation", "deviation_in_stds", "error (±)", "+.2g"),
    ReportColumn("measured.damping_ratio", "measured_damping_ratio", "ζ", ".4g"),
    ReportColumn("computed.damping_ratio", "computed_damping_ratio", "computed ζ", ".4g"),
)
"""The quantities of a pair."""


@dataclass(frozen=True, eq=False, repr=False)
class Assurance(Result):
    """MAC (R, S) of measured modes with the oscillating ones computed, `rows`; NaN if there is no shape."""

    modes: Modes
    measured: MeasuredModes
    rows: tuple[Mode, ...]
    mac: Floats
    pairs: tuple[ModePair, ...]

    what = "measured and computed modes"

    @property
    def scene(self) -> Scene:
        """The scene of the computed modes."""
        return self.modes.scene

    @property
    def notes(self) -> list[str]:
        """Notes on the pairs."""
        notes = []
        for pair in self.pairs:
            if pair.mac is not None and pair.mac < 0.5:  # less than half of one shape is in the other
                notes.append(f"mode {pair.measured.number}: no computed shape is like it (MAC {pair.mac:.2f})")
            elif pair.computed.number != pair.measured.number:
                notes.append(
                    f"mode {pair.measured.number} of the file is like mode {pair.computed.number} of the table"
                )
        if np.isfinite(self.mac).any() and len(self.measured.components) < len(self.rows):
            notes.append("fewer components than modes: shapes of different modes may look alike")
        return notes

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The pairs, the matrix if there are shapes, and the notes."""
        yield ReportTable.of(PAIR, self.pairs)
        if np.isfinite(self.mac).any():
            yield ReportTable(
                ["MAC", *(str(mode.number) for mode in self.rows)],
                [
                    [str(mode.number), *(NOTHING if np.isnan(value) else f"{value:.3f}" for value in values)]
                    for mode, values in zip(self.measured.modes, self.mac, strict=True)
                ],
            )
        yield "\n".join(f"{note[0].upper()}{note[1:]}." for note in self.notes)

    def records(self) -> list[dict[str, Any]]:
        """The matrix, a measured mode each."""
        names = [f"mode_{mode.number}" for mode in self.rows]
        return [
            {"measured": mode.number} | dict(zip(names, values, strict=True))
            for mode, values in zip(self.measured.modes, self.mac.tolist(), strict=True)
        ]

    def whole(self) -> dict[str, Any]:
        """The matrix, the pairs and the notes."""
        return {
            "measured": [mode.number for mode in self.measured.modes],
            "computed": [mode.number for mode in self.rows],
            "components": self.measured.labels,
            "mac": [list(map(finite, values)) for values in self.mac.tolist()],
            "pairs": records_of(PAIR, self.pairs),
            "notes": self.notes,
        }


@checked
def compare_modes(modes: Modes, measured: MeasuredModes) -> Assurance:
    """Compare measured modes with those of a scene that oscillate; a repeated frequency has its nearest shape's MAC.

    Raise ComputationError if nothing oscillates.
    """
    rows = tuple(mode for mode in modes if mode.oscillates and mode.omega > 0)
    if not rows:
        raise ComputationError("no mode of this scene oscillates")
    places = component_rows(modes.scene, measured.components)
    mac = np.full((len(measured.modes), len(rows)), np.nan)
    for r, measured_mode in enumerate(measured.modes):
        if measured_mode.shape is None:
            continue
        is_measured = np.isfinite(measured_mode.shape)
        for s, mode in enumerate(rows):
            members = (modes.matrix.row == modes.index_of(mode)) & ~modes.matrix.across
            basis = modes.matrix.shapes[:, members][places[is_measured]]
            mac[r, s] = _nearest(measured_mode.shape[is_measured], basis)
    return Assurance(modes, measured, rows, mac, tuple(_pairs(measured, rows, mac)))


def _nearest(shape: Floats, basis: Any) -> float:
    """MAC with the nearest combination of the columns of a basis (C, k); 0 if none has these components."""
    if not basis.shape[1]:
        return 0.0
    if basis.shape[1] == 1:
        phi = turned(basis[:, 0]).real
        sizes = float((shape @ shape) * (phi @ phi))
        return float((shape @ phi) ** 2) / sizes if sizes else 0.0
    Q, R, *_ = np.linalg.svd(basis, full_matrices=False)
    Q = Q[:, 1e-10 * R[0] < R]
    return float(np.linalg.norm(Q.conj().T @ shape) ** 2 / (shape @ shape)) if Q.size else 0.0


def _pairs(measured: MeasuredModes, rows: tuple[Mode, ...], mac: Floats) -> list[ModePair]:
    has_shapes = bool(np.isfinite(mac).all())
    cost = np.array(
        [
            [abs(log(measured_mode.frequency / (mode.omega / (2 * pi)))) for mode in rows]
            for measured_mode in measured.modes
        ]
    )
    measured_rows, computed_rows = scipy.optimize.linear_sum_assignment(-mac if has_shapes else cost)
    return [
        ModePair(measured.modes[r], rows[s], None if np.isnan(mac[r, s]) else float(mac[r, s]))
        for r, s in zip(measured_rows.tolist(), computed_rows.tolist(), strict=True)
    ]


@checked
def assurance_table(assurance: Assurance, form: Form) -> str:
    """The pairs and the matrix as text or json, the matrix alone as csv, by `form`."""
    return assurance.report(form)
