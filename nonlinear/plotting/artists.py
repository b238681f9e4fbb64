"""The two halves of a film, drawn once and updated frame by frame.

On the left pendula hang from their cart or support; on the right are the energies of every pendulum and the cart, and
the total against time.
"""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import MaxNLocator

from modal.plotting.layout import OBLIQUE, SMALL
from modal.plotting.shapes import MARKS_MAX, draw_piece
from modal.plotting.style import MARKED, QUIET, colour, ink, mixture, paper, rest, secondary_colour, shade
from modal.scene import Bob, Rod
from modal.structure import Piece
from modal.structure.outlines import HALF_HEIGHT
from modal.types import Floats
from nonlinear.plotting.scene import TRAIL_POINTS, WIDE_BARS, Actor, FilmEnergies, Stage

POTENTIAL = 0.52
"""Format: ink in the colour of potential energy: the palest that stands out 3:1 from its paper."""


def limits_of(stage: Stage, ratio: float) -> tuple[Floats, Floats]:
    """The lower left and the upper right corner, relative to the camera (m), of a panel of this aspect ratio.

    It contains everything that moves, with a margin.
    """
    low, high = stage.extent
    middle, half = (low + high) / 2, (1 + 4 * rcParams["axes.xmargin"]) * (high - low) / 2
    half = np.maximum(half, (half[1] * ratio, half[0] / ratio))
    return middle - half, middle + half


class Scenery:
    """A stage on an axis whose panel has the aspect ratio `ratio`; `trail` is the length of the trails in frames."""

    def __init__(self, axis: Axes, stage: Stage, ratio: float, trail: int) -> None:
        self.axis, self.stage = axis, stage
        (left, bottom), (right, top) = limits_of(stage, ratio)
        self.ends = np.array([left, right])
        axis.set(xlim=self.ends, ylim=(bottom, top))
        axis.set_aspect("equal")
        if stage.has_rail:
            _rail(axis, -3 * HALF_HEIGHT * stage.depth)
        else:
            axis.set_axis_off()
        self.drawn = [_piece(axis, piece) for piece in stage.pieces]
        points = float(72 * axis.get_window_extent().width / axis.figure.dpi / (right - left))  # of a metre
        self.players = [_Player(axis, actor, colour(k), points, trail) for k, actor in enumerate(stage.actors)]
        if stage.floor is not None:
            _floor(axis, stage)

    @property
    def moving(self) -> list[Artist]:
        """The artists redrawn in each frame, and over them the axis lines, if shown."""
        pieces = zip(self.drawn, self.stage.pieces, strict=True)
        return [
            *(artist for artist, piece in pieces if len(piece.points) > 1),
            *chain.from_iterable(player.moving for player in self.players),
            *(self.axis.spines.values() if self.axis.axison else ()),
        ]

    def show(self, frame: int) -> None:
        """Update everything to a frame."""
        self.axis.set_xlim(*self.stage.camera[frame] + self.ends)
        for artist, piece in zip(self.drawn, self.stage.pieces, strict=True):
            if len(piece.points) == 1:
                continue
            if isinstance(artist, Polygon):
                artist.set_xy(piece.points[frame])
            else:
                artist.set_data(*piece.points[frame].T)
        for player in self.players:
            player.show(frame)


def _rail(axis: Axes, height: float) -> None:
    """A rail with ticks, with metres along it at the lower edge."""
    axis.spines[["left", "right", "bottom"]].set_visible(False)
    axis.spines["top"].set(position=("data", height), color=secondary_colour(), lw=1.6, visible=True)
    axis.set_yticks([])
    axis.set_xlabel("along the rail (m)", fontsize=SMALL, labelpad=1)
    axis.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axis.xaxis.set_major_formatter("{x:.3g}")
    axis.grid(visible=False)
    axis.tick_params(axis="x", top=True, bottom=False, colors=secondary_colour(), labelsize=SMALL, length=3.5, pad=1)


def _piece(axis: Axes, piece: Piece) -> Polygon | Line2D:
    hue = ink() if piece.role in {"body", "dot", "ground", "line"} else secondary_colour()
    return draw_piece(axis, piece, {"color": hue}, rcParams["grid.color"] if piece.role == "body" else paper())


def _floor(axis: Axes, stage: Stage) -> None:
    """The floor on which shadows fall, as wide and as deep as they are wherever the cart goes."""
    shadows = np.concatenate([actor.shadow for actor in stage.actors if actor.shadow is not None], axis=1)
    level = -(stage.floor or 0.0)
    y = (shadows[..., 1] - level) / OBLIQUE[1]
    x = shadows[..., 0] - y * OBLIQUE[0]
    pad = 0.08 * stage.depth
    (left, right), (front, back) = ((float(v.min()) - pad, float(v.max()) + pad) for v in (x, y))
    corners = [
        (a + b * OBLIQUE[0], level + b * OBLIQUE[1])
        for a, b in ((left, front), (right, front), (right, back), (left, back))
    ]
    axis.add_patch(Polygon(corners, facecolor=rcParams["grid.color"], edgecolor=rest(), lw=0.8, zorder=0))


class _Player:
    """A pendulum: links as lines with round ends, bobs as discs, the centres of bodies as diamonds, a fading trail."""

    def __init__(self, axis: Axes, actor: Actor, hue: str, points: float, trail: int) -> None:
        self.actor, self.trail = actor, TRAIL_POINTS * trail
        has_marks = len(actor.links) <= MARKS_MAX
        links = list(enumerate(actor.links)) if has_marks else []
        self.rods, self.bobs = ([i for i, link in links if isinstance(link, kind)] for kind in (Rod, Bob))
        self.bodies = [i for i, _ in links if i not in {*self.rods, *self.bobs}]
        self.pinned = [0, *(i + 1 for i in range(len(actor.links) - 1) if i not in self.bobs)]
        shortest = points * min(link.length for link in actor.links)
        thick = float(np.clip(0.16 * shortest, 2.5, 7.0))
        round_style: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round", "color": hue}
        self.shadow = axis.plot([], [], color=rest(), lw=0.6 * thick, gid=QUIET, zorder=0.5)[0]
        self.wake = _wake(axis, hue, self.trail)
        self.line = axis.plot([], [], lw=min(2.2, thick), **round_style, zorder=4)[0]
        self.bars = axis.plot([], [], lw=thick, **round_style, zorder=5)[0]
        self.reach = axis.plot([], [], ls=MARKED, lw=1.2, color=hue, zorder=4)[0]
        self.discs = _dots(axis, "o", self._sizes(self.bobs, shortest), hue, 6)
        self.diamonds = _dots(axis, "D", 0.5 * self._sizes(self.bodies, shortest), hue, 6)
        size = min(2.8, 0.6 * thick) if has_marks else 0.0
        self.pins = axis.plot([], [], "o", ms=size, color=paper(), mec=hue, mew=0.8, zorder=7)[0]

    @property
    def moving(self) -> list[Artist]:
        """All of it."""
        lines = self.shadow, self.wake, self.line, self.bars, self.reach
        return [*lines, self.discs, self.diamonds, self.pins]

    def _sizes(self, links: list[int], shortest: float) -> Floats:
        """Areas (pt²) of discs, volumes in proportion to masses."""
        mass = np.array([link.mass for link in self.actor.links])
        diameters = min(15.0, max(5.0, 0.6 * shortest)) * np.cbrt(mass[links] / mass.max())
        return np.asarray(np.maximum(diameters, 3.5) ** 2)

    def show(self, frame: int) -> None:
        joints, centres = self.actor.joints[frame], self.actor.centres[frame]
        self.line.set_data(*joints.T)
        _pieces(self.bars, joints[:-1][self.rods], joints[1:][self.rods])
        _pieces(self.reach, joints[1:][self.bodies], centres[self.bodies])
        self.discs.set_offsets(centres[self.bobs])
        self.diamonds.set_offsets(centres[self.bodies])
        self.pins.set_data(*joints[self.pinned].T)
        way = self.actor.trail[max(0, TRAIL_POINTS * frame - self.trail) : TRAIL_POINTS * frame + 1][::-1]
        self.wake.set_segments(list(np.stack((way[:-1], way[1:]), axis=1)))
        if self.actor.shadow is not None:
            self.shadow.set_data(*self.actor.shadow[frame].T)


def _wake(axis: Axes, hue: str, length: int) -> LineCollection:
    """Segments of a trail, the newest the strongest and widest."""
    age = np.linspace(0, 1, max(length, 1))
    colours = [(*to_rgb(hue), 0.6 * (1 - a) ** 1.5) for a in age]
    wake = LineCollection([], colors=colours, linewidths=2.4 - 1.6 * age, zorder=3)
    axis.add_collection(wake, autolim=False)
    return wake


def _dots(axis: Axes, marker: str, sizes: Floats, hue: str, zorder: int) -> PathCollection:
    none = np.full(len(sizes), np.nan)
    return axis.scatter(none, none, sizes, marker=marker, color=hue, edgecolors=paper(), linewidths=0.8, zorder=zorder)


def _pieces(line: Line2D, starts: Floats, ends: Floats) -> None:
    """Separate line segments as one line with gaps."""
    gaps = np.full_like(starts, np.nan)
    line.set_data(*np.stack((starts, ends, gaps), axis=1).reshape(-1, 2).T)


class Gauges:
    """Bars of kinetic below fainter potential energy on one axis, the totals against time (s) on the other."""

    def __init__(self, bars: Axes, line: Axes, energies: FilmEnergies, times: Floats) -> None:
        self.energies, self.times, self.axes = energies, times, (bars, line)
        self.bars = _bars(bars, energies)
        self.lines, self.dot = _lines(line, energies, times)

    @property
    def moving(self) -> list[Artist]:
        """The artists that a frame redraws, and the axes' own lines over it."""
        spines = chain.from_iterable(axis.spines.values() for axis in self.axes)
        return [*self.bars[0], *self.bars[1], *self.lines, self.dot, *spines]

    def show(self, frame: int) -> None:
        """Update everything to a frame."""
        kinetic, potential = self.energies.kinetic[frame], self.energies.potential[frame]
        for lower, upper, t, v in zip(*self.bars, kinetic, potential, strict=True):
            lower.set_height(t)
            upper.set(y=t, height=v)
        totals = self.energies.totals
        for line, values in zip(self.lines, (*totals, totals[0] + totals[1]), strict=True):
            line.set_data(self.times[: frame + 1], values[: frame + 1])
        self.dot.set_data(self.times[frame : frame + 1], [totals[0][frame] + totals[1][frame]])


def _decorate(axis: Axes, title: str, pad: float) -> None:
    axis.grid(visible=False, axis="x")
    axis.tick_params(labelsize=SMALL, length=0)
    axis.yaxis.set_major_locator(MaxNLocator(4))
    axis.yaxis.set_major_formatter("{x:.4g}")
    axis.set_title(title, loc="left", pad=pad)


def _top(values: Floats) -> float:
    return 1.06 * float(values.max()) or 1.0


def _bars(axis: Axes, energies: FilmEnergies) -> tuple[list[Rectangle], list[Rectangle]]:
    kinetic, potential = energies.kinetic, energies.potential
    count = kinetic.shape[1]
    _decorate(axis, "energy of each (J)", 5)
    hues = [colour(k) if name.isdigit() else secondary_colour() for k, name in enumerate(energies.names)]
    lower = axis.bar(range(count), kinetic[0], 0.62, color=hues)
    faint = [mixture(hue, POTENTIAL) for hue in hues]
    upper = axis.bar(range(count), potential[0], 0.62, bottom=kinetic[0], color=faint)
    spare = max(WIDE_BARS - count, 0) / 2
    low = min(0.0, 1.06 * float(potential.min()))
    axis.set(xlim=(-0.6 - spare, count - 0.4 + spare), ylim=(low, _top(kinetic + potential)))
    axis.set_xticks(range(count), energies.names)
    labels = axis.get_xticklabels()
    width = sum(label.get_window_extent().width for label in labels)
    for label in labels:
        label.set_fontsize(float(label.get_fontsize()) * min(1.0, 0.8 * axis.get_window_extent().width / width))
    return list(lower), list(upper)


def _lines(axis: Axes, energies: FilmEnergies, times: Floats) -> tuple[list[Line2D], Line2D]:
    kinetic, potential = energies.totals
    _decorate(axis, "total energy (J)", 17)
    looks = (("kinetic", secondary_colour(), 1.0), ("potential", shade(POTENTIAL), 1.8), ("total", ink(), 1.8))
    lines = [axis.plot([], [], lw=width, color=hue, label=name)[0] for name, hue, width in looks]
    dot = axis.plot([], [], "o", ms=4.5, color=ink())[0]
    span = max(float(times[-1] - times[0]), 1e-300)
    axis.set(xlim=(times[0], times[-1] + 0.03 * span), ylim=(0, 1.08 * _top(kinetic + potential)))
    axis.set_xlabel("time (s)", fontsize=SMALL, labelpad=1)
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.xaxis.set_major_formatter("{x:.4g}")
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.02, 0.985), "ncols": 3, "fontsize": SMALL}
    axis.legend(**place, borderpad=0.1, handlelength=1.2, columnspacing=1.0)
    return lines, dot
