"""Pictures of mode shapes: pendula and their cart, at equilibrium in grey and at both extremes of the oscillation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import IO, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from modal.doors import require_type
from modal.errors import ComputationError
from modal.modes import Mode, Modes, Shape
from modal.plotting.layout import caption, evenly, headline, side_by_side
from modal.plotting.profiles import profiles_figure
from modal.plotting.style import QUIET, WIDE, colour, ink, mixed, muted, paper, rest, save, sheet
from modal.scene import AnyLink, Bob, Rod, title_of
from modal.types import Floats

FARTHEST = 0.3  # largest displacement of the cart over the picture's depth
LINE, LETTER = 0.2, 0.08  # height of a title line and width of a letter (inches)
MOST_PANELS, MOST_PENDULA, MOST_MARKS = 24, 12, 40
FAINTEST = 0.3  # part of the colour in a motion that has faded
LEAST, WIDEST = 4.6, 1.4  # least width of a picture (inches); width over height of panels, four in a row


@dataclass(frozen=True, eq=False)
class Layout:
    """The pendula drawn, their links' angles at equilibrium, the index of the first link of each, and their pivots.

    In metres: the longest chain, the extent below and above the rail, and half the width.
    """

    links: tuple[tuple[AnyLink, ...], ...]
    rests: tuple[Floats, ...]
    offsets: tuple[int, ...]
    pivots: Floats
    depth: float
    below: float
    above: float
    half_width: float

    @property
    def bottom(self) -> float:
        """The lower edge of a panel."""
        return -(self.below + 0.14 * self.depth)

    @property
    def top(self) -> float:
        """The upper edge of a panel."""
        return max(0.22 * self.depth, self.above + 0.14 * self.depth)


def draw_shapes(
    modes: Modes, numbers: Sequence[int], stream: IO[bytes], *, amplitude_deg: float = 25.0, form: str = "png"
) -> None:
    """Write the picture as png, svg or pdf."""
    require_type("modes", modes, "Modes")
    save(shapes_figure(modes, numbers, amplitude_deg=amplitude_deg), stream, form)


def shapes_figure(modes: Modes, numbers: Sequence[int] | None = None, *, amplitude_deg: float = 25.0) -> Figure:
    """The modes with these indices (from 0), by default the first ones, one panel each.

    The largest angle of each is `amplitude_deg`.

    Up to MOST_PENDULA pendula are drawn as they hang; of more, the angles over the number of the pendulum.  An
    overdamped mode is drawn where it begins and after one and two time constants.

    Raises ComputationError for more modes than one picture holds.
    """
    require_type("modes", modes, "Modes")
    numbers = range(min(len(modes), MOST_PANELS)) if numbers is None else numbers
    if len(numbers) > MOST_PANELS:
        raise ComputationError(f"{len(numbers)} modes do not fit in one figure: choose at most {MOST_PANELS} modes")
    rows = list(modes.rows(numbers))
    if modes.scene.n_pendula > MOST_PENDULA:
        return profiles_figure(modes, rows, panel_words, amplitude_deg)
    layout = layout_of(modes)
    panel = 2 * layout.half_width / (0.955 * (layout.top - layout.bottom))
    columns, lines = arranged(len(rows), panel)
    width = float(np.clip(2.6 * panel, 2.6, WIDE / columns))
    words = [panel_words(row, int(max(width, LEAST / columns) / LETTER)) for row in rows]
    height = width / panel + LINE * max(text.count("\n") + 1 for text in words) + 0.15
    figure = sheet(max(width * columns, LEAST), height * lines + 0.8)
    headline(figure, title_of(modes.scene), "mode shapes")
    axes = figure.subplots(lines, columns, squeeze=False)
    for axis, row, text in zip(axes.flat, rows, words, strict=False):
        _panel(axis, modes, row, layout, np.radians(amplitude_deg))
        axis.set_axis_off()
        axis.set_title(text, linespacing=1.3)
    for axis in axes.flat[len(rows) :]:
        axis.remove()
    caption(figure, _caption(modes, rows, layout, amplitude_deg))
    return figure


def arranged(count: int, ratio: float) -> tuple[int, int]:
    """Columns and lines of so many panels, of this width over height."""
    lines = -(-count // min(count, 4 if ratio < WIDEST else 3))
    return -(-count // lines), lines


def layout_of(modes: Modes) -> Layout:
    """What is drawn of the pendula, and where."""
    hanging: list[tuple[tuple[AnyLink, ...], Floats, int]] = []
    first, angles = 0, modes.rig.rest_angles
    for pendulum in modes.scene.pendulum:
        links = tuple(link for link in pendulum.links for _ in range(link.count))
        firsts = [first + k * len(links) for k in range(min(pendulum.count, MOST_PENDULA))]
        hanging += [(links, angles[at : at + len(links)], at) for at in firsts]
        first += pendulum.count * len(links)
    picked = evenly(len(hanging), MOST_PENDULA)
    chains, rests, offsets = (tuple(column) for column in zip(*(hanging[k] for k in picked), strict=True))
    levels = [_placed(chain, np.cos(angle)) for chain, angle in zip(chains, rests, strict=True)]
    aside = max(float(np.abs(_placed(chain, np.sin(angle))).max()) for chain, angle in zip(chains, rests, strict=True))
    depth = max(aside, *(float(np.ptp(level)) for level in levels))
    pivots = side_by_side(len(picked), depth)
    below, above = (max(float((sign * level).max()) for level in levels) for sign in (1, -1))
    half_width = float(pivots[-1] + 0.6 * depth)
    if modes.rig.leans:
        below = max(sum(link.length for link in chain) for chain in chains)
        half_width += aside + 0.2 * depth
    return Layout(chains, rests, offsets, pivots, depth, below, above, half_width)


def _placed(links: tuple[AnyLink, ...], way: Floats) -> Floats:
    """How far the joints and the centres of mass of a chain are away, with the way of its links per length."""
    joints = np.cumsum([0.0, *(way * [link.length for link in links])])
    return np.concatenate([joints, joints[:-1] + way * [link.centre for link in links]])


def _panel(axis: Axes, modes: Modes, row: Mode, layout: Layout, amplitude: float) -> None:
    shape = modes.shape(modes.index_of(row))
    if np.iscomplexobj(shape.angles):
        shape = replace(shape, cart=complex(shape.cart).real, angles=shape.angles.real)
    draw_rest(axis, modes, layout, shape)
    if row.omega == 0:
        draw_translation(axis, layout)
        return
    amplitude = fitting_amplitude(layout, shape, amplitude)
    if row.is_overdamped:
        for constants in (2, 1, 0):
            left = float(np.exp(-constants))
            look = {"color": mixed(colour(0), max(left, FAINTEST)), **({"gid": QUIET} if constants else {})}
            draw_swing(axis, modes, layout, shape, left * amplitude, look)
    else:
        draw_swing(axis, modes, layout, shape, -amplitude, {"color": colour(1)})
        draw_swing(axis, modes, layout, shape, amplitude, {"color": colour(0)})


def draw_rest(axis: Axes, modes: Modes, layout: Layout, shape: Shape) -> None:
    """The rail and everything at equilibrium, on an axis with the limits of the layout."""
    axis.set_xlim(-layout.half_width, layout.half_width)
    axis.set_ylim(layout.bottom, layout.top)
    axis.set_aspect("equal")
    axis.plot([-layout.half_width, layout.half_width], [0, 0], color=muted(), lw=1.0, zorder=0)
    draw_swing(axis, modes, layout, shape, 0.0, {"color": rest(), "gid": QUIET})


def draw_translation(axis: Axes, layout: Layout) -> None:
    """The sign of a rigid translation."""
    reach, height = 0.3 * layout.depth, 0.13 * layout.depth
    arrow = {"arrowstyle": "<->", "color": colour(0), "lw": 1.6}
    axis.annotate("", (reach, height), (-reach, height), arrowprops=arrow)


def panel_words(row: Mode, letters: int) -> str:
    """The title of a panel: number, frequencies or rates, and family."""
    decay = f",  ζ = {row.damping_ratio:.3g}" if row.damping_ratio > 0 else ""
    rate = "no digit certain" if row.is_uncertain else f"ω = {row.omega:.5g} rad/s{decay}"
    if row.growth_rate:
        rate = f"grows at {row.growth_rate:.5g} 1/s"
    elif row.is_overdamped:
        rate = f"decays at {row.omega:.5g} 1/s without a swing"
    frequency = "" if row.frequency is None else f":  {row.frequency:.4g} Hz"
    return f"mode {row.number}{frequency}\n{fill(rate, letters)}\n{fill(row.family, letters)}"


def fitting_amplitude(layout: Layout, shape: Shape, amplitude: float) -> float:
    """A reduced amplitude where the cart would leave the picture; long chains are drawn linearly, by displacement."""
    if max(map(len, layout.links)) > MOST_MARKS:
        reach = [
            np.abs(np.cumsum([link.length for link in links] * shape.angles[first : first + len(links)])).max()
            for links, first in zip(layout.links, layout.offsets, strict=True)
        ]
        amplitude = FARTHEST * layout.depth / max(*reach, 1e-300)
    return float(min(amplitude, FARTHEST * layout.depth / max(abs(shape.cart), 1e-300)))


def draw_swing(axis: Axes, modes: Modes, layout: Layout, shape: Shape, amplitude: float, look: dict[str, Any]) -> None:
    """A real shape times an amplitude (rad)."""
    shift = float(shape.cart.real) * amplitude
    _support(axis, modes, layout, shift, look, filled=amplitude == 0)
    for links, angle, first, pivot in zip(layout.links, layout.rests, layout.offsets, layout.pivots, strict=True):
        angles = amplitude * shape.angles[first : first + len(links)]
        if amplitude != 0 and shift == 0 and not angles.any():
            continue
        length = np.array([link.length for link in links])
        sin, cos = np.sin(angle), np.cos(angle)
        lean = np.sin(angle + angles), np.cos(angle + angles)
        if len(links) > MOST_MARKS:
            lean = sin + angles * cos, cos - angles * sin
        x, y = (np.concatenate([[0.0], np.cumsum(length * part)]) for part in lean)
        x, y = pivot + shift + x, -y
        axis.plot(x, y, **look, lw=1.6, zorder=2)
        if len(links) <= MOST_MARKS:
            _marks(axis, links, x, y, look)


def _marks(axis: Axes, links: Sequence[AnyLink], x: Floats, y: Floats, look: dict[str, Any]) -> None:
    heaviest = max(link.mass for link in links)
    for i, link in enumerate(links):
        part = link.centre / link.length
        centre = (x[i] + part * (x[i + 1] - x[i]), y[i] + part * (y[i + 1] - y[i]))
        if part > 1:
            axis.plot([x[i + 1], centre[0]], [y[i + 1], centre[1]], ":", **look, lw=1.2, zorder=2)
        if isinstance(link, Rod):
            axis.plot(x[i : i + 2], y[i : i + 2], **look, lw=4.0, zorder=3)
        else:
            size = 11.0 * (link.mass / heaviest) ** (1 / 3)
            marker = "o" if isinstance(link, Bob) else "D"
            axis.plot(*centre, marker, ms=max(size, 3.5), **look, mec=paper(), mew=0.7, zorder=4)
    axis.plot(x[:-1], y[:-1], "o", ms=2.6, **look | {"color": paper()}, mec=look["color"], mew=0.9, zorder=5)


def _support(axis: Axes, modes: Modes, layout: Layout, shift: float, look: dict[str, Any], *, filled: bool) -> None:
    left, right = layout.pivots[0] - 0.16 * layout.depth, layout.pivots[-1] + 0.16 * layout.depth
    height = 0.075 * layout.depth
    if modes.rig.cart is None:
        axis.plot([left, right], [0, 0], color=ink(), lw=3.0, zorder=1)
        return
    face = look["color"] if filled else "none"
    style: dict[str, Any] = {"boxstyle": f"round,pad=0,rounding_size={height / 3}", "lw": 1.3, "zorder": 1}
    axis.add_patch(FancyBboxPatch((left + shift, 0.0), right - left, height, fc=face, ec=look["color"], **style))


def _caption(modes: Modes, rows: Sequence[Mode], layout: Layout, amplitude_deg: float) -> str:
    linear = max(map(len, layout.links)) > MOST_MARKS
    words = ["grey: rest"]
    if any(row.oscillates for row in rows):
        words += ["blue and orange: the two ends of the swing"]
    if any(row.growth_rate for row in rows):
        words += ["of growing modes: the two ways they leave it"]
    if any(row.is_overdamped for row in rows):
        words += ["fading blue: an overdamped mode at the start, after one and after two time constants"]
    words += ["sideways motion exaggerated" if linear else f"drawn with angles up to {amplitude_deg:g}°"]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    return "; ".join(words)
