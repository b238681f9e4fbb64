"""Pictures of sweeps: curves over one parameter or over energy, maps over two parameters."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rcParams
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke

from modal.errors import ComputationError
from modal.plotting.curves import draw_curves
from modal.plotting.layout import NUMBER, TICKS_MAX, colour_bar, headline, legend, log_ticks, set_values
from modal.plotting.style import (
    BAND_OPACITY,
    HUES,
    LOG_RATIO,
    MARKED,
    MOST_CURVES,
    VISIBLE_SHARE,
    WIDE,
    WIDTH,
    colour,
    ink,
    mixture,
    paper,
    rest,
    shade,
    sheet_of_rows,
    stack,
)
from modal.scene import Scene, number_label, title_of
from modal.scene.parameters import Variation
from modal.scene.signal_names import column_name, column_words
from modal.types import Floats
from modal.vibration import KINDS
from nonlinear.chaos import regular_exponent, usual_duration
from nonlinear.sweeps import CHAOTIC, LYAPUNOV

if TYPE_CHECKING:
    from nonlinear.sweeps import Sweep

KIND_COLOURS = 0, 1, 2
"""Of growth at the frequency, at half of it and at a combination."""
FRACTIONS = {"order", "survivor_share"}
"""Quantities from 0 to 1, whose scales are linear however small they get."""
MEDIAN = "_median"


def sweep_figure(sweep: Sweep) -> Figure:
    """Every quantity of a sweep: curves over one parameter, maps over two; logarithmic where the variation is.

    Points that failed are hatched. Raise ComputationError if nothing is known, for three parameters, and for more
    quantities than a picture holds.
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
        figure = energies_figure(sweep)
    else:
        figure = _curves(sweep, names) if len(axes) == 1 else _maps(sweep, map_names)
    words = f"{sweep.study.members} starts at random on each energy" if sweep.study.members else "sweep"
    headline(figure, title_of(sweep.study.scene), words)
    return figure


def validate_axes(axes: Sequence[Variation]) -> None:
    """Raise ComputationError if a sweep over these cannot be drawn."""
    if len(axes) > 2 or any(len(variation.values) < 2 for variation in axes):
        raise ComputationError("a figure needs one or two parameters, each with two or more values")


def label(column: str) -> str:
    """An axis label for a column."""
    return f"{column_name(column)} ({column_words(column)[1] or NUMBER})"


# ------------------------------------------------------------------------------------------------------- curves


def _curves(sweep: Sweep, columns: list[str]) -> Figure:
    """One panel for each kind of quantity, a kind being a name without its number."""
    panels: dict[str, list[str]] = {}
    for name in columns:
        panels.setdefault(re.sub(r"_\d+[a-z]*(?=_|$)", "", name), []).append(name)
    variation = sweep.study.variations[0]
    figure, axes = stack(len(panels), sharex=True)
    for axis, (kind, names) in zip(axes, panels.items(), strict=True):
        values = [sweep.values(name) for name in names]
        curves = [(np.array(variation.values), np.where(np.isfinite(y), y, np.nan)) for y in values]
        _range(axis, np.array([y for _, y in curves]), kind)
        log = ("x" if variation.log else "") + ("y" if axis.get_yscale() == "log" else "")
        draw_curves(axis, curves, names=[column_name(name) for name in names], log=log, marker=".", ms=4.0)
        if len(names) > 1:
            legend(axis, 4)
        axis.set(ylabel=label(kind if len(names) > 1 else names[0]))
        if kind == "kind":
            axis.set_yticks(list(KINDS), labels=[words.replace(" at ", "\nat ") for words in KINDS.values()])
            axis.set_ylim(min(KINDS) - 0.3, max(KINDS) + 0.3)
        for boundary in sweep.boundaries:
            over = boundary.frequency_hz if variation.path.endswith("_hz") else boundary.amplitude
            axis.axvline(over[0], color=rest(), lw=1.0, zorder=0)
    set_values(axes[-1], sweep.study.scene, variation)
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
    columns = 1 if len(names) in (1, 3) else 2
    rows = -(-len(names) // columns)
    figure = sheet_of_rows(1.5 * rows, WIDTH if columns == 1 else WIDE)
    panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    for place, (axis, name) in enumerate(zip(panels, names, strict=False)):
        _map(axis, sweep, name)
        axis.label_outer()
        if place + columns >= len(names):
            axis.set_xlabel(number_label(sweep.study.scene, sweep.study.variations[1].path))
            axis.tick_params(which="both", labelbottom=True)
    for axis in panels[len(names) :]:
        axis.remove()
    return figure


def _map(axis: Axes, sweep: Sweep, name: str) -> None:
    where, values = (axis, sweep.study.scene, sweep.study.variations), sweep.values(name)
    if name == "kind" and "growth_rate_per_s" in sweep.columns:
        numbers = sorted(KINDS)
        hues = [shade(0.04), shade(0.16), *(mixture(colour(k), 0.75) for k in KIND_COLOURS)]
        bar = colour_bar(axis, draw_map(*where, values, **colours_of(hues, numbers[0])), "")
        bar.set_ticks(numbers, labels=[KINDS[number].replace(" at ", "\nat ") for number in numbers])
    else:
        draw_shades(*where, values, label(name), is_linear=name in FRACTIONS)
    _boundaries(axis, sweep)


def draw_map(axis: Axes, scene: Scene, variations: Sequence[Variation], values: Floats, **look: Any) -> QuadMesh:
    """Colours of values (Y, X) over two numbers of a scene, hatched where there is none; `look` is of `pcolormesh`."""
    y, x = variations
    axis.patch.set(edgecolor=rest(), hatch="////", lw=0)
    mesh = axis.pcolormesh(edges(x), edges(y), np.ma.masked_invalid(values), rasterized=True, lw=0, **look)
    set_values(axis, scene, x, has_limits=False)
    set_values(axis, scene, y, "y", has_limits=False)
    axis.grid(visible=False)
    return mesh


def colours_of(hues: Sequence[str], first: int = 0) -> dict[str, Any]:
    """The look of a map whose values are whole numbers from the first on, a hue each."""
    bounds = first - 0.5 + np.arange(len(hues) + 1)
    return {"cmap": ListedColormap([to_rgb(hue) for hue in hues]), "norm": BoundaryNorm(bounds, len(hues))}


def draw_shades(
    axis: Axes,
    scene: Scene,
    variations: Sequence[Variation],
    values: Floats,
    words: str,
    *,
    is_linear: bool = False,
    lowest: float = -np.inf,
) -> None:
    """A map of values in shades with a bar: logarithmic where they range widely, steps where they are few numbers.

    Values below the `lowest` have its shade.
    """
    numbers = np.unique(values[np.isfinite(values)])
    low, high = (max(lowest, float(numbers[0])), float(numbers[-1])) if len(numbers) else (0.0, 1.0)
    is_log = low > 0 and high > LOG_RATIO * low and not is_linear
    has_steps = bool(np.all(numbers == np.round(numbers))) and high - low < TICKS_MAX and not is_linear
    if has_steps:
        steps = round(high - low) + 1
        look = {"cmap": colormaps[rcParams["image.cmap"]].resampled(steps), "norm": Normalize(low - 0.5, high + 0.5)}
    else:
        look = {"norm": (LogNorm if is_log else Normalize)(low, high)}
    mesh = draw_map(axis, scene, variations, values, **look)
    if not len(numbers):
        return
    bar = colour_bar(axis, mesh, words)
    if has_steps:
        bar.set_ticks(numbers.tolist(), labels=[f"{number:g}" for number in numbers])
    elif is_log:
        log_ticks(bar.ax.yaxis, high / low)


def _boundaries(axis: Axes, sweep: Sweep) -> None:
    """The boundaries of growth over a map of amplitude and frequency, outlined to be seen on every colour."""
    is_frequency_first = sweep.study.variations[0].path.endswith("frequency_hz")
    for boundary in sweep.boundaries:
        places = (boundary.frequency_hz, boundary.amplitude)
        axis.plot(*(places[::-1] if is_frequency_first else places), color=ink(), lw=1.0, path_effects=outline(2.4))


def outline(width: float) -> list[AbstractPathEffect]:
    """The effect of a line to be seen on every colour: a wider one of paper's colour below it."""
    return [Stroke(linewidth=width, foreground=paper()), Normal()]


def edges(variation: Variation) -> Floats:
    """The edges of the cells around the values, halfway between neighbours."""
    values = np.log(variation.values) if variation.log else np.array(variation.values)
    middle = (values[1:] + values[:-1]) / 2
    edges = np.concatenate(([2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]))
    return np.exp(edges) if variation.log else edges


def energies_figure(sweep: Sweep) -> Figure:
    """A panel for every quantity: the median over the energy, from 5 to 95 % of the starts; and the chaotic share."""
    study = sweep.study
    (variation,) = study.variations
    medians = [name for name in sweep.columns if MEDIAN in name]
    shares = [name for name in sweep.columns if name == CHAOTIC]
    figure, axes = stack(len(medians) + len(shares), sharex=True)
    for axis, name in zip(axes, medians, strict=False):
        low, middle, high = (sweep.values(name.replace(MEDIAN, part)) for part in ("_q05", MEDIAN, "_q95"))
        axis.fill_between(
            variation.values, low, high, color=colour(0), alpha=BAND_OPACITY, lw=0, label="5 to 95 % of starts"
        )
        axis.plot(variation.values, middle, ".-", color=colour(0), label="median")
        if name.startswith(LYAPUNOV):
            _limit(axis, sweep)
        axis.set_ylabel(label(name.replace(MEDIAN, "")))
        legend(axis, 3)
    for axis, name in zip(axes[len(medians) :], shares, strict=True):
        axis.plot(variation.values, 100 * sweep.values(name), ".-", color=colour(1))
        axis.set(ylabel="chaotic starts (%)", ylim=(-3, 103))
    set_values(axes[-1], study.scene, variation, words="energy above rest (J)")
    return figure


def _limit(axis: Axes, sweep: Sweep) -> None:
    """Above which an exponent is too large for regular motion in this many seconds."""
    scene = sweep.study.scene
    (seconds,) = (request.number for request in sweep.study.measures if request.name == LYAPUNOV)
    limit = regular_exponent(scene, seconds or usual_duration(scene))
    axis.axhline(limit, color=rest(), lw=1.0, ls=MARKED, label="limit of regular motion")
