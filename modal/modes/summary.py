"""Modes as columns for other libraries, and what they show of themselves."""

from __future__ import annotations

from math import isnan, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal.modes.columns import COLUMNS, columns_of
from modal.modes.eigenvalues import Eigenvalues
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.report import NOTHING, Summary, counted, finite
from modal.scene import name_of
from modal.types import Floats

DIGITS = 6
TOLD = {"period_s", "effective_mass_kg", "linear_to_1_percent_deg", "relative_error_bound"}
"""Columns that a mode shows besides those of its title."""


def record_of(mode: Mode) -> dict[str, Any]:
    """The row of a mode by the keys of the table, but for columns that take more than the row; None for no value."""
    return {column.key: finite(column.value(mode)) for column in COLUMNS if column.of_rows is None}


def table_of(modes: Modes) -> dict[str, NDArray[Any]]:
    """The columns (R,) of the table by their keys; NaN where there is no value."""
    rows = modes.every
    return {column.key: _array([column.value(row) for row in rows]) for column in columns_of(modes, rows)}


def _array(values: list[Any]) -> NDArray[Any]:
    return np.array([nan if value is None else value for value in values])


def summarize(modes: Modes, most: int) -> Summary:
    """How many modes there are, between which frequencies, and the first rows of the table."""
    rows = modes[:most]
    damped = bool(np.any(modes.damping_ratio != 0))
    folded = bool(np.any(modes.multiplicity > 1))
    headings = ["mode", "ω (rad/s)", "f (Hz)", *["ζ"] * damped, *["multiplicity"] * folded, "description"]
    cells = [
        [
            str(row.number),
            _shown(nan if row.is_uncertain else row.omega),
            _shown(row.frequency),
            *[_shown(row.damping_ratio)] * damped,
            *[str(row.multiplicity)] * folded,
            row.family,
        ]
        for row in rows
    ]
    title = f"Modes of {name_of(modes.scene)}: {counted(len(modes), 'mode', 'modes')}{_range(modes)}"
    return Summary(title, (), headings, cells, len(modes), words=frozenset({len(headings) - 1}))


def _range(modes: Eigenvalues) -> str:
    known: Floats = modes.frequency[np.isfinite(modes.frequency)]
    return f" from {known.min():.4g} to {known.max():.4g} Hz" if len(known) else ""


def _shown(value: float | None) -> str:
    return NOTHING if value is None or isnan(value) else f"{value:.{DIGITS}g}"


def summarize_mode(mode: Mode) -> Summary:
    """The number and frequency of a mode and its description; every quantity of its row in a notebook."""
    frequency = "" if mode.frequency is None else f"{_shown(mode.frequency)} Hz, "
    omega = "no digit certain" if mode.is_uncertain else f"{_shown(mode.omega)} rad/s"
    damped = f", ζ = {_shown(mode.damping_ratio)}" if mode.damping_ratio and not mode.is_uncertain else ""
    several = f", multiplicity {mode.multiplicity}" if mode.multiplicity > 1 else ""
    title = f"Mode {mode.number}: {frequency}{omega}{damped}{several}, {mode.family}"
    facts = [(column.heading, column.shown(mode)) for column in COLUMNS if column.shown and column.key in TOLD]
    return Summary(title, facts)
