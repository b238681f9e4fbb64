"""Common elements of every figure: title, caption, key, labels, plain logarithmic ticks, mode numbers.

Also the positions of pendula that are drawn side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, NullFormatter

from modal.plotting.style import any_letters, muted
from modal.report import visible
from modal.types import Floats, Ints

SMALL = "small"
"""The size of words inside axes, relative to the style's."""
NUMBER = "–"
"""The unit of dimensionless quantities."""
BREADTH = 0.96
"""Largest width of titles, captions and keys as a fraction of the figure's."""
ROOM, ROW = 0.08, 0.12
"""Heights of a legend and of each of its rows, as fractions of the axis."""
FEW_DECADES = 300.0
CLOSEST = 0.022
"""Fraction of the axis that the number of a mode needs."""


def headline(figure: Figure, title: str, words: str) -> None:
    """The scene's title and a description, over the whole figure; nothing in it is read as mathematics."""
    whole = f"{visible(title)}: {words}" if title else words[:1].upper() + words[1:]
    _fold(figure, figure.suptitle(whole, parse_math=False))


def caption(figure: Figure, words: str) -> None:
    """Notes about a figure, below it."""
    _fold(figure, figure.supxlabel(words, fontsize=SMALL, fontweight="normal", color=muted(), parse_math=False))


def _fold(figure: Figure, text: Text) -> None:
    """Wrap a text to the width allowed for titles."""
    words = text.get_text()
    letters = len(words)
    with any_letters():
        while (excess := text.get_window_extent().width / (BREADTH * figure.bbox.width)) > 1 and letters > 8:
            letters = min(letters - 1, int(1.1 * letters / excess))
            text.set_text(fill(words, letters))


def key(figure: Figure, handles: Sequence[Artist], names: Sequence[str] | None = None, columns: int = 4) -> None:
    """A legend below the figure, in at most `columns` columns and as room permits."""
    labels = names or [str(handle.get_label()) for handle in handles]
    for rows in range(-(-len(labels) // columns), len(labels) + 1):
        count = -(-len(labels) // rows)
        made = figure.legend(handles, labels, loc="outside lower center", ncols=count)
        with any_letters():
            fits = made.get_window_extent().width < BREADTH * figure.bbox.width
        if fits or count == 1:
            return
        made.remove()


def framed(axis: Axes, across: str, up: str, title: str = "") -> None:
    """Axis labels and title of one of several axes."""
    axis.set(xlabel=across, ylabel=up)
    axis.set_title(title, loc="left")


def legend(axis: Axes, columns: int = 6, title: str | None = None) -> None:
    """A legend in room made above the curves of an axis; none for a single curve."""
    entries = len(axis.get_legend_handles_labels()[1])
    if entries < 2:
        return
    columns = min(entries, columns)
    low, high = axis.get_ylim()
    axis.set_ylim(low, high + (high - low) * (ROOM + ROW * -(-entries // columns)))
    axis.legend(
        ncols=columns, title=title, loc="upper right", fontsize=SMALL, frameon=True, edgecolor="none", borderpad=0.2
    )


def log_ticks(line: Axis, ratio: float = 1.0) -> None:
    """Plain numbers on a logarithmic axis whose ends have this ratio, more of them where it is small."""
    line.set_major_locator(LogLocator(subs=(1.0,) if ratio > FEW_DECADES else (1.0, 2.0, 5.0)))
    line.set_major_formatter("{x:g}")
    line.set_minor_formatter(NullFormatter())


def mark_modes(axis: Axes, omega: Sequence[tuple[int, float]], *, numbered: bool = True) -> None:
    """Dotted lines at modes (number, ω ascending); the numbers of neighbours too close to print apart are joined."""
    groups: list[list[tuple[int, float]]] = []
    share = axis.transData + axis.transAxes.inverted()
    places = [float(share.transform((value, axis.get_ylim()[0]))[0]) for _, value in omega]
    for (number, value), place in zip(omega, places, strict=True):
        axis.axvline(value, color=muted(), ls=":", lw=0.9, zorder=0)
        near = groups and place - groups[-1][-1][1] < CLOSEST
        groups = [*groups[:-1], [*groups[-1], (number, place)]] if near else [*groups, [(number, place)]]
    for group in groups if numbered else ():
        words = f"{group[0][0]}" if len(group) == 1 else f"{group[0][0]}–{group[-1][0]}"
        middle = float(np.mean([group[0][1], group[-1][1]]))
        axis.annotate(
            words, (middle, 1.0), (0, 3), "axes fraction", "offset points", ha="center", fontsize=SMALL
        ).set_annotation_clip(False)


def evenly(count: int, most: int) -> Ints:
    """The indices, from 0, of the pendula drawn: all, or `most` of them evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def side_by_side(count: int, depth: float) -> Floats:
    """Positions along the rail (m) of the drawn pivots of pendula of length `depth` (m)."""
    spacing = depth * (0.95 if count <= 4 else 0.5)
    return np.asarray(spacing * (np.arange(count) - (count - 1) / 2), dtype=np.float64)
