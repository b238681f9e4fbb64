"""Peaks that are tuned: magnitudes over frequency before and after, one panel for each response."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.curves import draw_curves
from modal.plotting.layout import headline, key, log_ticks
from modal.plotting.style import MARKED, WIDTH, colour, muted, save, sheet, thickness
from modal.scene import title_of

if TYPE_CHECKING:
    from modal.tuning import Curves, Tuned

FIRST = 2.0
DEEP = 60.0
"""Most decibels below the highest of the tuned peaks that a panel shows."""
ABOVE = 6.0
"""Decibels above the highest peak after, where the one before is beyond them by more than HIGH."""
HIGH = 40.0
MOST_PANELS = 5
LONGEST = 30


def draw_tuning(tuned: Tuned, stream: IO[bytes], kind: str = "png") -> None:
    """Write the picture of `tuning_figure` as png, svg or pdf."""
    save(tuning_figure(tuned), stream, kind)


def tuning_figure(tuned: Tuned) -> Figure:
    """|H| of every tuned peak before and after, with the equal peaks marked.

    Raises ComputationError where no peak is tuned, or more than a picture holds.
    """
    every = tuned.curves()
    if not every:
        raise ComputationError("no peak was tuned: there are no curves to draw")
    if len(every) > MOST_PANELS:
        raise ComputationError(f"{len(every)} responses do not fit in a figure: choose at most {MOST_PANELS}")
    figure = sheet(WIDTH, 1.7 + 2.9 * len(every))
    panels = figure.subplots(len(every), 1, squeeze=False)[:, 0]
    for axis, response in zip(panels, every, strict=True):
        _draw(axis, response, tuned)
    panels[-1].set_xlabel("frequency (Hz)")
    handles = [Line2D([], [], color=colour(k), lw=thickness(k, FIRST)) for k in range(2)]
    handles.append(Line2D([], [], color=muted(), ls=MARKED, lw=1.0))
    headline(figure, title_of(tuned.given), "before and after tuning")
    key(figure, handles, ["before", "after", "highest peak after"])
    return figure


def _draw(axis: Axes, response: Curves, tuned: Tuned) -> None:
    with np.errstate(divide="ignore"):
        before, after = (20 * np.log10(np.where(size > 0, size, np.nan)) for size in (response.before, response.after))
    top = float(np.nanmax(after))
    highest = min(float(np.nanmax(before)), top + HIGH)
    low = max(min(float(np.nanmin(before)), float(np.nanmin(after))), top - DEEP)
    curves = [
        (response.frequency_hz, np.clip(decibels, low - ABOVE, highest + 2 * ABOVE)) for decibels in (before, after)
    ]
    draw_curves(axis, curves, first=FIRST, log="x")
    axis.axhline(top, color=muted(), ls=MARKED, lw=1.0, zorder=0)
    words = (
        f"{response.name}\n(dB re 1 {response.unit})"
        if len(response.name) + len(response.unit) > LONGEST
        else f"{response.name} (dB)"
    )
    ends = float(response.frequency_hz[0]), float(response.frequency_hz[-1])
    axis.set(xscale="log", xlim=ends, ylim=(low - 2, max(highest, top) + ABOVE), ylabel=words)
    log_ticks(axis.xaxis, ends[1] / ends[0])
