"""Mode shapes of many pendula: the angles of their links over the number of the pendulum."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from modal.modes import Mode, Modes
from modal.plotting.curves import draw_curves
from modal.plotting.layout import NUMBER, caption, evenly, headline, key
from modal.plotting.style import HUES, WIDE, WIDTH, colour, muted, sheet
from modal.scene import Scene, title_of
from modal.types import Floats, Ints

COLUMNS, LETTERS = 3, 40
ROOM = 1.15  # of the axis over the largest angle
MOVES, LOCAL, FEWEST = 0.02, 0.2, 6
"""Angle over the largest from which a pendulum counts as moving; part of the pendula below which only those about the
moving ones are drawn, with as many or FEWEST to either side."""
DOTS = 120  # pendula up to which dots are large


def profiles_figure(
    modes: Modes, rows: Sequence[Mode], words: Callable[[Mode, int], str], amplitude_deg: float, first: str = ""
) -> Figure:
    """One panel for each row: angles (°) over the number of the pendulum, a curve for every level of links.

    The shape is linear and to scale, the largest angle of any link `amplitude_deg`; `words` titles a row in lines of so
    many letters; `first` is the first of the notes below.
    """
    lines = -(-len(rows) // COLUMNS)
    columns = -(-len(rows) // lines)
    figure = sheet(WIDE if columns > 1 else WIDTH, 1.2 + 2.9 * lines)
    axes = figure.subplots(lines, columns, squeeze=False, sharey=True)
    levels = levels_of(modes.scene)
    drawn = evenly(levels.shape[1], HUES)
    for place, (axis, row) in enumerate(zip(axes.flat, rows, strict=False)):
        cart = _panel(axis, modes, row, levels[:, drawn], amplitude_deg)
        axis.set_title(words(row, LETTERS) + cart, linespacing=1.3)
        if place % columns:
            axis.set_ylabel("")
    for axis in axes.flat[len(rows) :]:
        axis.remove()
    local = any(np.ptp(axis.get_xlim()) < len(levels) - 1 for axis in axes.flat[: len(rows)])
    headline(figure, title_of(modes.scene), "mode shapes")
    notes = first + _notes(modes, rows, levels, drawn, amplitude_deg, local=local)
    if len(drawn) > 1:
        marks = [Line2D([], [], color=colour(k), marker="o", ms=3) for k in range(len(drawn))]
        key(figure, marks, [f"link {level + 1}" for level in drawn], columns=HUES, notes=notes)
    else:
        caption(figure, notes)
    return figure


def levels_of(scene: Scene) -> Ints:
    """The index of the link of each pendulum (rows) at each level (columns), −1 where it has none."""
    counts = [sum(link.count for link in pendulum.links) for pendulum in scene.pendulum for _ in range(pendulum.count)]
    levels = np.full((len(counts), max(counts)), -1, dtype=np.int64)
    first = np.cumsum([0, *counts[:-1]])
    for k, (start, count) in enumerate(zip(first.tolist(), counts, strict=True)):
        levels[k, :count] = start + np.arange(count)
    return levels


def _panel(axis: Axes, modes: Modes, row: Mode, levels: Ints, amplitude_deg: float) -> str:
    """Draw a row; how far the cart goes, in words."""
    shape = modes.shape(modes.index_of(row))
    angles: Floats = amplitude_deg * np.real(shape.angles)
    numbers = np.arange(1.0, len(levels) + 1)
    curves = [(numbers, np.where(level < 0, np.nan, angles[level])) for level in levels.T]
    draw_curves(axis, curves, first=1.1, marker="o", ms=3.5 if len(numbers) <= DOTS else 1.8, mew=0)
    number_pendula(axis, *_part(np.array([y for _, y in curves])), amplitude_deg)
    if modes.rig.cart is None or row.omega == 0:
        return ""
    cart = float(np.radians(amplitude_deg) * complex(shape.cart).real)
    return f"\ncart at {cart:.3g} m".replace("-", "−") if cart else "\ncart at rest"


def number_pendula(axis: Axes, first: int, last: int, amplitude_deg: float) -> None:
    """Make an axis of angles (°), up to the largest, over the numbers of these pendula."""
    side = 0.02 * (last - first) + 0.5
    axis.set(xlim=(first - side, last + side), ylim=(-ROOM * amplitude_deg, ROOM * amplitude_deg))
    axis.set(xlabel=f"number of the pendulum ({NUMBER})", ylabel="angle (°)")
    axis.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axis.axhline(0.0, color=muted(), lw=0.8, zorder=0)


def _part(angles: Floats) -> tuple[int, int]:
    """The first and the last pendulum drawn, of angles (D, N): all, or those about a small part that moves."""
    size, count = np.nan_to_num(np.abs(angles)).max(0), angles.shape[1]
    moving = np.flatnonzero(size > MOVES * size.max())
    if not moving.size or moving[-1] - moving[0] + 1 > LOCAL * count:
        return 1, count
    first, last = int(moving[0]) + 1, int(moving[-1]) + 1
    room = max(last - first + 1, FEWEST)
    return max(1, first - room), min(count, last + room)


def _notes(modes: Modes, rows: Sequence[Mode], levels: Ints, drawn: Ints, amplitude_deg: float, *, local: bool) -> str:
    words = [f"angles at one end of the motion, the largest {amplitude_deg:g}°", f"{len(levels)} pendula"]
    if local:
        words += ["of local modes those about the moving ones drawn"]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    if len(drawn) < levels.shape[1]:
        words += [f"{len(drawn)} of {levels.shape[1]} links of each drawn"]
    return "; ".join(words)
