"""Pictures of maps of rhythms: shares of starts along a parameter, the most frequent rhythm over two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from modal.plotting.layout import headline, key, set_values
from modal.plotting.style import HUES, colour, ink, mixture, paper, rest, secondary_colour, stack
from modal.scene import title_of
from nonlinear.plotting.sweeps import edges, outline

if TYPE_CHECKING:
    from nonlinear.ensembles import RhythmGrid, RhythmMap


def rhythm_figure(rhythms: RhythmMap) -> Figure:
    """The share of each rhythm along the number with its 95 % interval.

    Computed borders are vertical lines, thresholds of averaged equations dashed ones.
    """
    figure, (axis,) = stack(1, 2)
    values, names = np.array(rhythms.variation.values), rhythms.names
    for number, name in enumerate(names):
        shares = 100 * np.array(rhythms.shares(name))
        is_there = np.array([any(r.name == name for r in value.rhythms) for value in rhythms.values])
        ends = rhythms.intervals(name)
        axis.plot(
            values, np.where(is_there, shares, np.nan), "o-", ms=3, color=colour(number % HUES), clip_on=False, zorder=3
        )
        low, high = 100 * np.array(ends).T
        axis.fill_between(values, low, high, where=is_there, color=colour(number % HUES), alpha=0.2, lw=0)
        axis.vlines(values[is_there], low[is_there], high[is_there], color=colour(number % HUES), alpha=0.5, lw=1)
    undecided = 100 * np.array([value.undecided / rhythms.members for value in rhythms.values])
    handles = [Line2D([], [], marker="o", ms=3, color=colour(k % HUES), label=name) for k, name in enumerate(names)]
    if undecided.any():
        axis.plot(values, undecided, color=rest())
        handles.append(Line2D([], [], color=rest(), label="undecided"))
    axis.set(ylabel="starts (%)", ylim=(-3, 103), yticks=range(0, 101, 20))
    set_values(axis, rhythms.scene, rhythms.variation)
    marks = [
        (each.value, border_words([rhythms], each.name, each.kind, each.is_birth), "-")
        for each in rhythms.births
        if each.kind != "undecided"
    ]
    dashed = [(each.value, f"averaged: {each.words}", "--") for each in rhythms.averaged]
    _mark(axis, [*marks, *dashed])
    headline(figure, title_of(rhythms.scene), f"what {rhythms.members} starts at each value end in")
    key(figure, handles, columns=min(3, len(handles)))
    return figure


def border_words(maps: Sequence[RhythmMap], name: str, kind: str, is_birth: bool) -> str:
    """What happens to a rhythm at a border as the number grows: orbits may live on unstable, beats end."""
    if kind == "enclosed":
        return f"{name} {'begins' if is_birth else 'ends'} here (between two computed values)"
    row = next((row for row in maps if row.has_orbit(name)), maps[0])
    return f"{name} {row.change_words(name, kind, is_birth=is_birth)} ({kind})"


def _mark(axis: Axes, marks: Sequence[tuple[float, str, str]]) -> None:
    """Vertical lines with words above the axes, each in a row of its own."""
    low, high = axis.get_xlim()
    for number, (value, words, dashes) in enumerate(sorted(marks, reverse=True)):
        axis.axvline(value, color=ink() if dashes == "-" else secondary_colour(), lw=0.9, ls=dashes)
        side = "right" if value > (low + high) / 2 else "left"
        place, above = (value, 1.0), (0.0, 2.0 + 11.0 * number)
        options: dict[str, Any] = {
            "xytext": above,
            "textcoords": "offset points",
            "fontsize": "small",
            "ha": side,
            "va": "bottom",
        }
        axis.annotate(f"{value:.6g}: {words}", place, xycoords=axis.get_xaxis_transform(), **options)


def grid_figure(grid: RhythmGrid) -> Figure:
    """A cell for each pair of numbers, divided from below by the shares of starts that end in each rhythm.

    The computed borders along each row are joined from row to row, in the colours of their rhythms.
    """
    figure, (axis,) = stack(1, 2)
    names = [*grid.names, "undecided"]
    hues = [*(colour(k % HUES) for k in range(len(grid.names))), rest()]
    first, second = grid.axes
    x, y = (np.clip(edges(each), min(each.values), max(each.values)) for each in (first, second))
    counts = [[[at.counts()[name] for name in names] for at in row.values] for row in grid.maps]
    shares = np.array(counts) / grid.maps[0].members
    for row, low, high in zip(shares, y[:-1], y[1:], strict=True):
        parts = np.pad(row.cumsum(axis=1), ((0, 0), (1, 0))).T
        heights = low * (high / low) ** parts if second.log else low + (high - low) * parts
        for bottom, top, hue in zip(heights[:-1], heights[1:], hues, strict=True):
            axis.bar(x[:-1], top - bottom, np.diff(x), bottom, align="edge", color=mixture(hue, 0.6), lw=0)
    axis.hlines(y[1:-1], x[0], x[-1], color=paper(), lw=2)
    axis.vlines(x[1:-1], y[0], y[-1], color=paper(), lw=2)
    set_values(axis, grid.scene, first)
    set_values(axis, grid.scene, second, "y")
    axis.grid(visible=False)
    handles: list[Patch | Line2D] = [
        Patch(color=mixture(hues[k], 0.6), label=names[k]) for k in np.flatnonzero(shares.any(axis=(0, 1))).tolist()
    ]
    for (name, kind, is_birth), chains in grid.borders().items():
        look: dict[str, Any] = {
            "color": hues[names.index(name)],
            "path_effects": outline(2.8),
            "marker": "o",
            "ms": 3.5,
        }
        for chain in chains:
            axis.plot(*np.array(chain).T, **look, clip_on=False, zorder=4)
        handles.append(Line2D([], [], **look, label=border_words(grid.maps, name, kind, is_birth)))
    headline(figure, title_of(grid.scene), f"what {grid.maps[0].members} starts at each point end in")
    notes = "each cell is divided by the shares of the starts; lines are computed along each row"
    key(figure, handles, columns=2, notes=notes.partition(";")[0] if not grid.borders() else notes)
    return figure
