"""Branches of configurations in print: where each lasts, the critical values, and all of them as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from typing import Any

import numpy as np
from tabulate import tabulate

from modal.report import csv_rows
from modal.types import Floats
from nonlinear.synchronization.branches import Branch, Branches, Change
from nonlinear.synchronization.patterns import agreement


def branches_text(found: Branches) -> str:
    """One line a branch, counted from 1, then one a critical value."""
    variation = found.variation
    values, unit = variation.values, variation.unit
    where = f"{variation.path} = {values[0]:.6g} to {values[-1]:.6g} {unit}".rstrip()
    head = f"{len(found.branches)} configurations over {where}"
    rows = [_row(number, one) for number, one in enumerate(found.branches, start=1)]
    headers = ("", "pendula", "ω (rad/s)", "largest angle (°)", f"exists {unit}".strip(), f"lasts {unit}".strip())
    parts = [head, tabulate(rows, headers=headers, disable_numparse=True) if rows else "nothing keeps swinging"]
    if found.changes:
        turns = [(f"{change.value:.7g}", str(number + 1), change_words(change)) for change, number in found.changes]
        parts += ["", tabulate(turns, headers=(f"at {unit}".strip(), "", "what happens there"), disable_numparse=True)]
    return "\n".join(parts) + "\n"


def branches_csv(found: Branches) -> str:
    """One row a branch and value: does it last, frequency, largest angle, growth rate, and how pendula agree."""
    head = ("branch", found.variation.column, "lasts", "omega_rad_per_s", "angle_deg", "growth_per_s", "pendula")
    return csv_rows([head, *_rows(found)])


def _rows(found: Branches) -> Iterator[tuple[Any, ...]]:
    for number, one in enumerate(found.branches, start=1):
        numbers = zip(one.values.tolist(), one.lasts, one.omega.tolist(), one.angle.tolist(), one.states, strict=True)
        for value, lasts, omega, angle, state in numbers:
            yield number, value, int(lasts), omega, degrees(angle), state.growth, agreement(state)


def change_words(change: Change) -> str:
    """What happens at a critical value: stops lasting (neighbours beat at 0.063 rad/s)."""
    return change.kind + (f" (neighbours beat at {change.beat:.3g} rad/s)" if change.beat else "")


def _row(number: int, one: Branch) -> tuple[str, ...]:
    lasting = ", ".join(f"{low:.7g} to {high:.7g}" for low, high in one.intervals) or "nowhere"
    exists = f"{one.values[0]:.7g} to {one.values[-1]:.7g}"
    return str(number), one.words, _range(one.omega), _range(np.rad2deg(one.angle)), exists, lasting


def _range(values: Floats) -> str:
    """From the first value to the last."""
    ends = dict.fromkeys(f"{value:#.4g}".rstrip(".") for value in (values[0], values[-1]))
    return " → ".join(ends)
