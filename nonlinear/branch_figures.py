"""Branches of configurations as a picture: how far pendula swing and how fast, and where each branch lasts."""

from __future__ import annotations

from itertools import pairwise
from typing import IO, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.loci_figures import axis_words, dress, headline, scale
from modal.palette import COLOURS, INK
from modal.pictures import save, sheet
from modal.rig import Floats
from nonlinear.branches import Branch, Branches

MOST_CURVES = len(COLOURS)
RING: dict[str, Any] = {"ls": "", "marker": "o", "mfc": "white", "mec": INK, "ms": 6.0, "mew": 1.2, "zorder": 5}
LASTING, PASSING = "-", (0, (3, 2))


def draw_branches(found: Branches, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf: full lines where a branch lasts, broken ones where it does not.

    Circles are critical values.  Raises ComputationError for no branch and for more than MOST_CURVES.
    """
    save(branches_figure(found), stream, form)


def branches_figure(found: Branches) -> Figure:
    """The same as a figure."""
    if not 1 <= len(found.branches) <= MOST_CURVES:
        raise ComputationError(f"{len(found.branches)} configurations do not fit a picture: from 1 to {MOST_CURVES}")
    figure = sheet(8.4, 7.4)
    upper, lower = figure.subplots(2, 1, sharex=True)
    values = found.variation.values
    for number, one in enumerate(found.branches):
        _curve(upper, one, np.rad2deg(one.angle), number)
        _curve(lower, one, one.omega, number)
    upper.set(ylabel="largest angle (°)", xlim=(values[0], values[-1]))
    upper.set_ylim(0, 1.05 * upper.get_ylim()[1])
    lower.set(xlabel=axis_words(found.variation), ylabel="angular frequency ω (rad/s)")
    scale(lower, "x", found.variation)
    dress(upper)
    dress(lower)
    headline(figure, found.scene, "configurations that keep swinging")
    figure.legend(handles=_handles(found), loc="outside lower center", ncols=2, fontsize=9, frameon=False)
    return figure


def _curve(axis: Axes, one: Branch, y: Floats, number: int) -> None:
    """Piece by piece of one fate, later branches thinner, so that of two that coincide both show."""
    fates = np.array(one.lasts)
    breaks = [0, *(np.flatnonzero(np.diff(fates)) + 1), len(fates)]
    for start, stop in pairwise(breaks):
        piece = slice(max(start - 1, 0), stop)
        style = LASTING if fates[start] else PASSING
        axis.plot(one.values[piece], y[piece], color=COLOURS[number], ls=style, lw=2.6 - 0.3 * number, zorder=3)
    critical = [change.value for change in one.changes]
    axis.plot(critical, np.interp(critical, one.values, y), **RING)


def _handles(found: Branches) -> list[Line2D]:
    lines = [
        Line2D([], [], color=COLOURS[number], lw=2, label=f"{number + 1}: {one.words}")
        for number, one in enumerate(found.branches)
    ]
    fates = [
        Line2D([], [], color=INK, ls=style, lw=1.6, label=label)
        for style, label in ((LASTING, "lasts"), (PASSING, "does not last"))
    ]
    return [*lines, *fates, Line2D([], [], label="critical value", **RING)]
