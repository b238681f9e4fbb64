"""Pictures of maps of rhythms: shares of starts along a parameter, the most frequent rhythm over two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from modal.plotting.layout import headline, key, set_values
from modal.plotting.style import HUES, colour, ink, rest, secondary_colour, stack
from modal.scene import title_of
from nonlinear.plotting.sweeps import colours_of, draw_map

if TYPE_CHECKING:
    from nonlinear.ensembles import RhythmGrid, RhythmMap
    from nonlinear.ensembles.rhythms import ValueRhythms


def rhythm_figure(rhythms: RhythmMap) -> Figure:
    """The share of each rhythm along the number with its 95 % interval.

    Births and deaths are vertical lines, thresholds of averaged equations dashed ones.
    """
    figure, (axis,) = stack(1, 2)
    values, names = np.array(rhythms.variation.values), rhythms.names
    for number, name in enumerate(names):
        shares = 100 * np.array(rhythms.shares(name))
        is_there = np.array([any(r.name == name for r in value.rhythms) for value in rhythms.values])
        ends = rhythms.intervals(name)
        axis.plot(values, np.where(is_there, shares, np.nan), "o-", ms=3, color=colour(number % HUES))
        low, high = 100 * np.array(ends).T
        axis.fill_between(values, low, high, where=is_there, color=colour(number % HUES), alpha=0.2, lw=0)
    undecided = 100 * np.array([value.undecided / rhythms.members for value in rhythms.values])
    handles = [Line2D([], [], marker="o", ms=3, color=colour(k % HUES), label=name) for k, name in enumerate(names)]
    if undecided.any():
        axis.plot(values, undecided, color=rest())
        handles.append(Line2D([], [], color=rest(), label="undecided"))
    axis.set(ylabel="starts (%)", ylim=(-3, 118), yticks=range(0, 101, 20))
    set_values(axis, rhythms.scene, rhythms.variation)
    marks = [
        (e.value, f"{e.kind}: {e.name} {'born' if e.is_birth else 'dies'}", "-")
        for e in rhythms.births
        if e.kind != "undecided"
    ]
    dashed = [(each.value, f"averaged: {each.words}", "--") for each in rhythms.averaged]
    _mark(axis, [*marks, *dashed])
    headline(figure, title_of(rhythms.scene), f"rhythms of {rhythms.members} starts at each value")
    key(figure, handles, columns=min(3, len(handles)))
    return figure


def _mark(axis: Axes, marks: Sequence[tuple[float, str, str]]) -> None:
    """Vertical lines with words at their tops, each row of words a little lower."""
    low, high = axis.get_xlim()
    for number, (value, words, dashes) in enumerate(sorted(marks)):
        axis.axvline(value, color=ink() if dashes == "-" else secondary_colour(), lw=0.9, ls=dashes, ymax=0.86)
        is_right = value > (low + high) / 2
        axis.text(value, 115 - 5 * (number % 3), words, fontsize="small", ha="right" if is_right else "left", va="top")


def grid_figure(grid: RhythmGrid) -> Figure:
    """The rhythm in which most starts end, a colour each, and the borders along each row, joined from row to row.

    The outcomes of other starts of a cell are dots in it, the larger the more.
    """
    figure, (axis,) = stack(1, 2)
    names = [*grid.names, "undecided"]
    shares = np.array([[_shares(at, names, row.members) for at in row.values] for row in grid.maps])
    kinds = shares.argmax(axis=-1)
    hues = [*(colour(k % HUES) for k in range(len(names) - 1)), rest()]
    first, second = grid.axes
    draw_map(axis, grid.scene, (second, first), kinds, alpha=0.75, **colours_of(hues))
    others = np.argwhere((shares > 0) & (np.arange(len(names)) != kinds[..., None])).tolist()
    for row, column, k in sorted(others, key=lambda place: -shares[tuple(place)]):
        dot = first.values[column], second.values[row]
        axis.scatter(*dot, s=300 * shares[row, column, k], color=hues[k], edgecolors=ink(), linewidths=0.6, zorder=3)
    for chains in grid.borders().values():
        for chain in chains:
            axis.plot(*np.array(chain).T, "o-", ms=2.5, lw=1.4, color=ink())
    headline(figure, title_of(grid.scene), "where most starts end, others as dots, and where rhythms are born and die")
    present = np.flatnonzero(shares.any(axis=(0, 1))).tolist()
    handles: list[Patch | Line2D] = [Patch(color=hues[k], label=names[k]) for k in present]
    if grid.borders():
        handles.append(Line2D([], [], marker="o", ms=2.5, color=ink(), label="birth or death, computed"))
    key(figure, handles, columns=min(3, len(handles)))
    return figure


def _shares(at: ValueRhythms, names: list[str], members: int) -> list[float]:
    """The shares of starts that end in each rhythm, the last one undecided."""
    counts = [sum(rhythm.count for rhythm in at.rhythms if rhythm.name == name) for name in names[:-1]]
    return [count / members for count in (*counts, at.undecided)]
