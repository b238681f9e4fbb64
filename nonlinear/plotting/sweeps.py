"""Pictures of sweeps: quantities over one parameter as curves, over two parameters as maps."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from modal.errors import ComputationError
from modal.plotting import (
    HUES,
    MOST_CURVES,
    NUMBER,
    WIDE,
    WIDTH,
    colour,
    draw_curves,
    headline,
    ink,
    legend,
    log_ticks,
    mixture,
    paper,
    rest,
    scale,
    shade,
)
from modal.plotting.layout import TICKS_MAX
from modal.plotting.style import LOG_RATIO, VISIBLE_SHARE, sheet_of_rows
from modal.report import deferred
from modal.scene import number_label, title_of
from modal.scene.parameters import Variation
from modal.scene.signal_names import column_words
from modal.types import Floats
from modal.vibration import KINDS

if TYPE_CHECKING:
    from nonlinear.sweeps import Sweep

KIND_COLOURS = 0, 1, 2
"""Of growth at the frequency, at half of it and at a combination."""
FRACTIONS = {"order", "survivor_share"}
"""Quantities from 0 to 1, whose scales are linear however small they get."""


def sweep_figure(sweep: Sweep) -> Figure:
    """Every quantity of a sweep: curves over one parameter, maps over two; logarithmic where the variation is.

    Points that failed are hatched.  Raises ComputationError where nothing is known, for three parameters, and for
    more quantities than a picture holds.
    """
    validate_axes(sweep.study.variations)
    names = [name for name in sweep.columns if np.any(np.isfinite(sweep.values(name)))]
    if not names:
        raise ComputationError("every point of the sweep failed: there is nothing to draw")
    axes = sweep.study.variations
    limit = MOST_CURVES if len(axes) == 1 else HUES
    if len(names) > limit:
        raise ComputationError(f"{len(names)} quantities do not fit in a figure: measure at most {limit}")
    map_names = [name for name in names if name != "largest_multiplier"]  # its map is that of the growth rate
    if sweep.study.members and len(axes) == 1:
        figure: Figure = deferred("nonlinear.plotting.energies:energies_figure")(sweep)
    else:
        figure = _curves(sweep, names) if len(axes) == 1 else _maps(sweep, map_names)
    words = f"{sweep.study.members} starts at random on each energy" if sweep.study.members else "sweep"
    headline(figure, title_of(sweep.study.scene), words)
    return figure


def validate_axes(axes: Sequence[Variation]) -> None:
    """ComputationError where a sweep over these cannot be drawn."""
    if len(axes) > 2 or any(len(variation.values) < 2 for variation in axes):
        raise ComputationError("a figure needs one or two parameters, each with two or more values")


def label(column: str) -> str:
    """An axis label for a column."""
    name, unit = column_words(column)
    symbol = re.sub(r"^omega (\d+[a-z]*)$", r"ω$_{\1}$", name) if name != "omega" else "ω"
    return f"{symbol} ({unit or NUMBER})"


# ------------------------------------------------------------------------------------------------------- curves


def _curves(sweep: Sweep, columns: list[str]) -> Figure:
    """One panel for each kind of quantity, a kind being a name without its number."""
    panels: dict[str, list[str]] = {}
    for name in columns:
        panels.setdefault(re.sub(r"_\d+[a-z]*(?=_|$)", "", name), []).append(name)
    figure = sheet_of_rows(len(panels))
    variation = sweep.study.variations[0]
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    for axis, (kind, names) in zip(axes, panels.items(), strict=True):
        values = [sweep.values(name) for name in names]
        curves = [(np.array(variation.values), np.where(np.isfinite(y), y, np.nan)) for y in values]
        _range(axis, np.array([y for _, y in curves]), kind)
        log = ("x" if variation.log else "") + ("y" if axis.get_yscale() == "log" else "")
        draw_curves(axis, curves, names=[label(name) for name in names], log=log, marker=".", ms=4.0)
        if len(names) > 1:
            legend(axis, 4)
        axis.set(ylabel=label(kind if len(names) > 1 else names[0]))
        if kind == "kind":
            axis.set_yticks(list(KINDS), labels=[words.replace(" at ", "\nat ") for words in KINDS.values()])
            axis.set_ylim(min(KINDS) - 0.3, max(KINDS) + 0.3)
        for boundary in sweep.boundaries:
            over = boundary.frequency_hz if variation.path.endswith("_hz") else boundary.amplitude
            axis.axvline(over[0], color=rest(), lw=1.0, zorder=0)
    scale(axes[-1], "x", variation)
    axes[-1].set(
        xlabel=number_label(sweep.study.scene, variation.path), xlim=(variation.values[0], variation.values[-1])
    )
    return figure


def _range(axis: Axes, values: Floats, kind: str) -> None:
    """A logarithmic scale where values range widely; rounding of constant values is not magnified."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if kind in FRACTIONS:
        axis.set_ylim(-0.03, 1.03)
    elif low > 0 and high > LOG_RATIO * low:
        axis.set_yscale("log")
    elif high - low < VISIBLE_SHARE * max(abs(low), abs(high)):
        middle, half = (low + high) / 2, rcParams["axes.ymargin"] * max(abs(low), abs(high))
        axis.set_ylim(middle - half, middle + half)


# --------------------------------------------------------------------------------------------------------- maps


def _maps(sweep: Sweep, names: list[str]) -> Figure:
    columns = min(len(names), 2)
    rows = -(-len(names) // columns)
    figure = sheet_of_rows(1.5 * rows, WIDTH if columns == 1 else WIDE)
    panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    y, x = sweep.study.variations
    for place, (axis, name) in enumerate(zip(panels, names, strict=False)):
        _map(figure, axis, sweep, name)
        axis.set(xlabel=number_label(sweep.study.scene, x.path), ylabel=number_label(sweep.study.scene, y.path))
        axis.label_outer()
        if place + columns >= len(names):
            axis.set_xlabel(number_label(sweep.study.scene, x.path))
            axis.tick_params(which="both", labelbottom=True)
    for axis in panels[len(names) :]:
        axis.remove()
    return figure


def _map(figure: Figure, axis: Axes, sweep: Sweep, name: str) -> None:
    y, x = sweep.study.variations
    values = sweep.values(name)
    numbers = values[np.isfinite(values)]
    if name == "kind" and "growth_rate_per_s" in sweep.columns:
        _kinds(figure, axis, sweep, values)
        return
    by_ratio = numbers.min() > 0 and numbers.max() > LOG_RATIO * numbers.min() and name not in FRACTIONS
    norm = (LogNorm if by_ratio else Normalize)(numbers.min(), numbers.max())
    axis.patch.set(edgecolor=rest(), hatch="////", lw=0)
    image = np.ma.masked_invalid(values)
    mesh = axis.pcolormesh(edges(x), edges(y), image, norm=norm, rasterized=True, lw=0)
    scale(axis, "x", x)
    scale(axis, "y", y)
    axis.grid(visible=False)
    bar = figure.colorbar(mesh, ax=axis, pad=0.02)
    bar.set_label(label(name))
    if by_ratio:
        log_ticks(bar.ax.yaxis, numbers.max() / numbers.min())
    elif np.all(numbers == np.round(numbers)) and len(rows := np.unique(numbers)) <= TICKS_MAX:
        bar.set_ticks(rows.tolist(), labels=[f"{row:g}" for row in rows])
    bar.outline.set_visible(False)
    _boundaries(axis, sweep)


def _kinds(figure: Figure, axis: Axes, sweep: Sweep, values: Floats) -> None:
    """What small motion does, a colour for each kind, named in the colour bar."""
    y, x = sweep.study.variations
    numbers = sorted(KINDS)
    colours = ListedColormap([shade(0.04), shade(0.16), *(mixture(colour(k), 0.75) for k in KIND_COLOURS)])
    norm = BoundaryNorm([number - 0.5 for number in (*numbers, numbers[-1] + 1)], len(numbers))
    axis.patch.set(edgecolor=rest(), hatch="////", lw=0)
    mesh = axis.pcolormesh(
        edges(x), edges(y), np.ma.masked_invalid(values), cmap=colours, norm=norm, rasterized=True, lw=0
    )
    scale(axis, "x", x)
    scale(axis, "y", y)
    axis.grid(visible=False)
    bar = figure.colorbar(mesh, ax=axis, pad=0.02)
    bar.set_ticks(numbers, labels=[KINDS[number].replace(" at ", "\nat ") for number in numbers])
    bar.outline.set_visible(False)
    _boundaries(axis, sweep)


def _boundaries(axis: Axes, sweep: Sweep) -> None:
    """The boundaries of growth over a map of amplitude and frequency, outlined to be seen on every colour."""
    outline = [Stroke(linewidth=2.4, foreground=paper()), Normal()]
    is_frequency_first = sweep.study.variations[0].path.endswith("frequency_hz")
    for boundary in sweep.boundaries:
        places = (boundary.frequency_hz, boundary.amplitude)
        axis.plot(*(places[::-1] if is_frequency_first else places), color=ink(), lw=1.0, path_effects=outline)


def edges(variation: Variation) -> Floats:
    """The edges of the cells around the values, halfway between neighbours."""
    values = np.log(variation.values) if variation.log else np.array(variation.values)
    middle = (values[1:] + values[:-1]) / 2
    edges = np.concatenate(([2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]))
    return np.exp(edges) if variation.log else edges
