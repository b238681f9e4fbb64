"""Hoists and travels of a crane: lengths and frequencies along a hoist; a travel before and after shaping."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.assembly import coordinate_labels, hoisting_of, rig_of
from modal.errors import ComputationError
from modal.plotting.curves import draw_curves, pick
from modal.plotting.layout import SMALL, headline, legend, set_frame
from modal.plotting.style import (
    HUES,
    MARKED,
    MOST_CURVES,
    colour,
    ink,
    paper,
    secondary_colour,
    spots,
    stack,
)
from modal.scene import title_of
from modal.scene.signal_names import link_names
from modal.statespace.shapers import shaper_for
from modal.statespace.travels import ShapedTravel, shaped_travel

if TYPE_CHECKING:
    from modal.statespace.hoisting import Along
    from modal.tuning import Tuned


def hoist_figure(hoisting: Along) -> Figure:
    """The changing lengths (m), the angular frequencies (rad/s) and the adiabatic swing of every mode against time (s).

    Only lengths where no mode oscillates.  Raise ComputationError for more modes or lengths than one picture holds.
    """
    n_curves = max(hoisting.omega.shape[1], hoisting.lengths.shape[1])
    if n_curves > MOST_CURVES:
        raise ComputationError(f"{n_curves} curves do not fit in a figure: at most {MOST_CURVES}")
    ropes = [f"link {i + 1} of pendulum {p + 1}" for p, i in hoisting.links]
    modes = [f"mode {name}" for name in hoisting.names]
    panels = [(hoisting.lengths, ropes, "length (m)")]
    if modes:
        panels += [
            (hoisting.omega, modes, "angular frequency ω (rad/s)"),
            (hoisting.swing, modes, "relative swing (–)"),
        ]
    figure, axes = stack(len(panels), 3, sharex=True)
    for axis, (values, names, words) in zip(axes, panels, strict=True):
        for k, name in enumerate(names):
            axis.plot(hoisting.times, values[:, k], color=colour(k), label=name, **spots(k, values[:, k]))
        set_frame(axis, "time (s)" if axis is axes[-1] else "", words)
        axis.set_xlim(hoisting.times[0], hoisting.times[-1])
        legend(axis)
    headline(figure, title_of(hoisting.scene), "along the hoist")
    return figure


ROWS = ("unshaped", "shaped")


def travel_figure(travel: ShapedTravel) -> Figure:
    """The place of a cart as it is and shaped, or a force and what it moves, and the angles (°) of the links for each.

    Of a travel in several pieces, as within limits, the speed too, and along a hoist the lengths.
    Dotted lines bound the residual swing from the time on at which the command is over.
    """
    force = f"torque ({travel.unit})" if travel.unit == "N m" else f"force ({travel.unit})"
    place = "angle (°)" if travel.unit == "N m" else "position (m)"
    motion = np.degrees(travel.moved) if travel.unit == "N m" else travel.moved
    panels = [(travel.command, force, "Force"), (motion, place, "Moved coordinate")]
    if travel.unit == "m":
        speeds = np.array([way(travel.times)[1] for way in travel.ways])
        panels = [(travel.command, place, "Cart, as prescribed"), (speeds, "speed (m/s)", "")]
        panels = panels[: 1 + (len(travel.ways[0].knots) > 2)]
    hoisting, labels = hoisting_of(travel.scene), link_names(coordinate_labels(rig_of(travel.scene)))
    figure, axes = stack(len(panels) + 2 + (hoisting is not None), sharex=True)
    axes[-1].sharey(axes[-2])
    if hoisting is not None:
        ropes = np.flatnonzero(hoisting.moving)
        lengths = hoisting.at(travel.times)[0][:, ropes].T
        draw_curves(axes[-3], [(travel.times, length) for length in lengths], names=[labels[k] for k in ropes])
        set_frame(axes[-3], "", "length (m)", "Hoist, as prescribed")
        legend(axes[-3])
    for axis, (rows, label, title) in zip(axes, panels, strict=False):
        _command(axis, travel, rows)
        set_frame(axis, "", label, title)
        legend(axis)
    _swings(axes[-2:], [(travel, 0), (travel, 1)], ROWS)
    headline(figure, title_of(travel.scene), f"a travel of {travel.distance:g} m, unshaped and shaped")
    return figure


def tuned_travel_figure(tuning: Tuned) -> Figure:
    """The angles (°) of the links in the travel whose residual swing was tuned, before and after."""
    setting = tuning.objective.quantities.setting
    kind = setting.kind or "zv"
    travels = [
        shaped_travel(scene, shaper_for(scene, 1, kind), setting.travel or 0.0, setting.over)
        for scene in (tuning.given, tuning.scene)
    ]
    figure, axes = stack(2, sharex=True)
    axes[1].sharey(axes[0])
    _swings(axes, [(travel, int(setting.kind is not None)) for travel in travels], ("before", "after"))
    headline(figure, title_of(tuning.given), "before and after tuning")
    return figure


def _swings(axes: Sequence[Axes], ways: Sequence[tuple[ShapedTravel, int]], titles: Sequence[str]) -> None:
    """The angles of the links along rows of travels, one below the other, and what swing they leave."""
    degrees = [np.degrees(travel.angles[row]) for travel, row in ways]
    labels = link_names(coordinate_labels(rig_of(ways[0][0].scene)))
    numbers, names, _ = pick(np.concatenate(degrees).T, labels, HUES)
    largest = max(float(np.degrees(travel.residual[row])) for travel, row in ways)
    limit = 4 / 3 * max(*(float(np.abs(part).max()) for part in degrees), largest, 1e-9)
    for axis, (travel, row), angles, title in zip(axes, ways, degrees, titles, strict=True):
        draw_curves(axis, [(travel.times, angles[:, link]) for link in numbers], names=names, bands=True)
        axis.set(xlim=(travel.times[0], travel.times[-1]), ylim=(-limit, limit))
        set_frame(axis, "", "angle (°)", f"Swing, {title}")
        _residual(axis, travel, row)
    legend(axes[0], least_count=1)
    axes[-1].set_xlabel("time (s)")


def _command(axis: Axes, travel: ShapedTravel, rows: np.ndarray) -> None:
    curves = [(travel.times, values) for values in rows]
    draw_curves(axis, curves, names=ROWS, numbers=(4, 2), lw=1.8)
    for row, over in enumerate(travel.over.tolist()):
        axis.axvline(over, color=colour((4, 2)[row]), ls=MARKED, lw=1.0, zorder=0)


def _residual(axis: Axes, travel: ShapedTravel, row: int) -> None:
    """Two dotted lines that bound the swing after the command, and how large it is."""
    angle, over = float(np.degrees(travel.residual[row])), float(travel.over[row])
    for sign in (-1, 1):
        axis.plot([over, travel.times[-1]], [sign * angle] * 2, color=secondary_colour(), ls=MARKED, lw=1.4)
    axis.axvline(over, color=secondary_colour(), ls=MARKED, lw=1.0, zorder=0)
    words = f"residual swing {angle:.3g}°" if angle >= 5e-4 else "no residual swing"
    look: dict[str, Any] = {
        "fontsize": SMALL,
        "color": ink(),
        "bbox": {"facecolor": paper(), "edgecolor": "none", "pad": 1},
    }
    axis.annotate(words, (over, angle), xytext=(5, 4), textcoords="offset points", va="bottom", **look)
