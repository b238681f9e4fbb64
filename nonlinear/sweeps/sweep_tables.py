"""A sweep in a few lines: how far every number ranges, where its ends are, and what failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from tabulate import tabulate

from modal.report import visible
from nonlinear.sweeps.running import Sweep

MOST_REASONS = 5
NUMBERED = "Modes have their numbers in the table of the scene as it is given."


def sweep_text(sweep: Sweep) -> str:
    """Smallest and largest of every number with their places, then the reasons of points that failed."""
    return "\n".join(_lines(sweep)) + "\n"


def _lines(sweep: Sweep) -> Iterator[str]:
    yield f"{len(sweep.rows)} of {sweep.study.size} points, {len(sweep.failures)} failed"
    rows = [_range(sweep, name) for name in sweep.columns]
    yield tabulate(rows, headers=("number", "smallest", "at", "largest", "at"), disable_numparse=True)
    yield from reasons(sweep)
    if any(one.measure.numbered for one in sweep.study.measures):
        yield NUMBERED


def reasons(sweep: Sweep) -> Iterator[str]:
    """Why points failed, the most frequent reasons first."""
    found = Counter(sweep.failures.values()).most_common()
    for reason, count in found[:MOST_REASONS]:
        yield f"{count} × {visible(reason)}"
    if len(found) > MOST_REASONS:
        yield f"and {len(found) - MOST_REASONS} other reasons"


def _range(sweep: Sweep, name: str) -> tuple[str, ...]:
    values = sweep.values(name).ravel()
    if np.all(np.isnan(values)):
        return name, "nan", "", "nan", ""
    ends = int(np.nanargmin(values)), int(np.nanargmax(values))
    return (name, *(words for end in ends for words in (f"{values[end]:.6g}", _place(sweep, end))))


def _place(sweep: Sweep, index: int) -> str:
    return ", ".join(f"{path} = {value:.6g}" for path, value in sweep.study.point(index).items())
