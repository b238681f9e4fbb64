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

from modal.errors import ComputationError
from modal.modes import Mode, Modes, Shape
from modal.plotting.carriers import draw_pieces
from modal.plotting.layout import caption, evenly, headline, side_by_side
from modal.plotting.profiles import profiles_figure
from modal.plotting.style import MARKED, QUIET, WIDE, colour, ink, mixed, muted, paper, rest, save, sheet
from modal.scene import AnyLink, Bob, Rod, Scene, title_of
from modal.scene.doors import require_type
from modal.structure import Scaffold
from modal.types import Floats

FARTHEST = 0.3  # largest displacement of the cart over the picture's depth
LINE, LETTER = 0.2, 0.08  # height of a title line and width of a letter (inches)
MOST_PANELS, USUAL_PANELS, MOST_PENDULA, MOST_MARKS = 24, 12, 12, 40
"""Most panels that can be asked for, and that are drawn unasked; most pendula as they hang; most links with marks."""
FEW_LINKS = 6
"""Links of a chain up to which its angles are drawn; a longer one is drawn by its displacements, with thin links."""
AMPLITUDE_DEG = 25.0
"""Largest angle of a drawing, and what stands for full displacement of a long chain."""
SIDEWAYS = 0.4
"""Largest displacement of a long chain over the picture's depth."""
MARK, SMALLEST = 11.0, 3.5  # width of the heaviest bob and of the lightest (points)
APART = 0.55  # width of the heaviest bob over the length of a short link
THICK, THIN = 1.6, 1.0  # width of the links of a few, and of a long chain (points)
FAINTEST = 0.3  # part of the colour in a motion that has faded
LEAST, WIDEST = 4.6, 1.4  # least width of a picture (inches); width over height of panels, four in a row


@dataclass(frozen=True, eq=False)
class ShapeLayout:
    """The pendula drawn, their links' angles at equilibrium, the index of the first link of each, and their pivots.

    In metres: the longest chain, the extent below and above the rail, and half the width, about `middle`.  What hangs
    from a structure is drawn with its `scaffold`.  The heaviest bob is `mark` points wide.
    """

    links: tuple[tuple[AnyLink, ...], ...]
    rests: tuple[Floats, ...]
    offsets: tuple[int, ...]
    pivots: Floats
    depth: float
    below: float
    above: float
    half_width: float
    scaffold: Scaffold | None = None
    middle: float = 0.0
    mark: float = MARK

    def within(self, width: float) -> ShapeLayout:
        """The same with marks small enough for structures and long chains, in a panel of this width (inches)."""
        points = 72 * width / (2 * self.half_width)
        mark = MARK if self.scaffold is None else min(MARK, 0.4 * self.depth * points)
        if self.is_linear:
            mark = min(mark, APART * points * min(link.length for links in self.links for link in links))
        return replace(self, mark=mark)

    @property
    def is_linear(self) -> bool:
        """Whether displacements are drawn, exaggerated, and not angles: of a chain of more than FEW_LINKS."""
        return max(map(len, self.links)) > FEW_LINKS

    @property
    def bottom(self) -> float:
        """The lower edge of a panel."""
        return -(self.below + 0.14 * self.depth)

    @property
    def top(self) -> float:
        """The upper edge of a panel."""
        return max(0.22 * self.depth, self.above + 0.14 * self.depth) if self.scaffold is None else self.above

    @property
    def ends(self) -> tuple[float, float]:
        """The left and the right edge of a panel."""
        return self.middle - self.half_width, self.middle + self.half_width

    def places(self, shape: Shape, amplitude: float) -> Floats:
        """Where the pendula hang in a real shape times an amplitude, (K, 2) in m to the right and up."""
        if self.scaffold is None:
            shift = shape.cart.real * amplitude
            return np.column_stack((self.pivots + shift, np.zeros_like(self.pivots)))
        return np.asarray(self.scaffold.pivots(amplitude * shape.supports.real[None])[0])


def draw_shapes(
    modes: Modes,
    numbers: Sequence[int] | None,
    stream: IO[bytes],
    *,
    amplitude_deg: float = AMPLITUDE_DEG,
    form: str = "png",
) -> None:
    """Write the picture as png, svg or pdf."""
    require_type("modes", modes, "Modes")
    save(shapes_figure(modes, numbers, amplitude_deg=amplitude_deg), stream, form)


def shapes_figure(
    modes: Modes, numbers: Sequence[int] | None = None, *, amplitude_deg: float = AMPLITUDE_DEG
) -> Figure:
    """The modes with these indices (from 0), by default the first USUAL_PANELS, one panel each.

    The largest angle of each is `amplitude_deg`.  Chains of more than FEW_LINKS are drawn by their displacements: that
    of each mode is exaggerated until its largest is the same part of the picture, SIDEWAYS at 25°.

    Up to MOST_PENDULA pendula are drawn as they hang; of more, the angles over the number of the pendulum.  An
    overdamped mode is drawn where it begins and after one and two time constants.

    Raises ComputationError for more modes than one picture holds.
    """
    require_type("modes", modes, "Modes")
    first = some_words(modes, numbers)
    numbers = range(min(len(modes), USUAL_PANELS)) if numbers is None else numbers
    if len(numbers) > MOST_PANELS:
        raise ComputationError(f"{len(numbers)} modes do not fit in one figure: choose at most {MOST_PANELS} modes")
    rows = list(modes.rows(numbers))
    if is_crowded(modes.scene):
        return profiles_figure(modes, rows, panel_words, amplitude_deg, first)
    layout = layout_of(modes)
    panel = 2 * layout.half_width / (0.955 * (layout.top - layout.bottom))
    columns, lines = arranged(len(rows), panel)
    width = float(np.clip(2.6 * panel, 2.6, WIDE / columns))
    layout = layout.within(width)
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
    caption(figure, f"{first}{_caption(modes, rows, layout, amplitude_deg)}")
    return figure


def some_words(modes: Modes, numbers: Sequence[int] | None) -> str:
    """What is left out where no modes are asked for, "" where none is."""
    return f"the first {USUAL_PANELS} of {len(modes)} modes; " if numbers is None and len(modes) > USUAL_PANELS else ""


def is_crowded(scene: Scene) -> bool:
    """Whether a scene has so many pendula that their angles are drawn over their numbers.

    Of equal pendula on a structure some are drawn, as long as there is room for one of each entry.
    """
    return (len(scene.pendulum) if scene.is_structured else scene.n_pendula) > MOST_PENDULA


def arranged(count: int, ratio: float) -> tuple[int, int]:
    """Columns and lines of so many panels, of this width over height."""
    lines = -(-count // min(count, 4 if ratio < WIDEST else 3))
    return -(-count // lines), lines


def layout_of(modes: Modes) -> ShapeLayout:
    """What is drawn of the pendula, and where."""
    hanging: list[tuple[tuple[AnyLink, ...], Floats, int]] = []
    first, angles = 0, modes.rig.rest_angles
    most = max(1, MOST_PENDULA // len(modes.scene.pendulum)) if modes.rig.structure else MOST_PENDULA
    for pendulum in modes.scene.pendulum:
        links = tuple(link for link in pendulum.links for _ in range(link.count))
        firsts = [first + k * len(links) for k in range(min(pendulum.count, most))]
        hanging += [(links, angles[at : at + len(links)], at) for at in firsts]
        first += pendulum.count * len(links)
    picked = evenly(len(hanging), MOST_PENDULA)
    if modes.rig.structure:
        return _on_structure(modes, [hanging[k] for k in picked])
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
    return ShapeLayout(chains, rests, offsets, pivots, depth, below, above, half_width)


def _on_structure(modes: Modes, hanging: list[tuple[tuple[AnyLink, ...], Floats, int]]) -> ShapeLayout:
    """The layout of pendula on a structure: as it is drawn at rest, with room for it to move."""
    structure = modes.rig.structure
    assert structure is not None
    first = np.cumsum([0, *(pendulum.n_links for pendulum in modes.scene.pendulum for _ in range(pendulum.count))])
    chains, rests, offsets = (tuple(column) for column in zip(*hanging, strict=True))
    depth = max(float(np.ptp(_placed(chain, np.ones(len(chain))))) for chain in chains)
    drawn = np.searchsorted(first, offsets)
    scaffold = Scaffold(structure, drawn, first, depth)
    layout = ShapeLayout(chains, rests, offsets, np.zeros(0), depth, 0.0, 0.0, 0.0, scaffold)
    still = np.zeros((1, structure.size))
    pivots = scaffold.pivots(still)[0]
    hung = [_hung(chain, rest, pivot)[None] for chain, rest, pivot in zip(chains, rests, pivots, strict=True)]
    pieces = scaffold.pieces(still, dict(zip(drawn.tolist(), hung, strict=True)))
    points = np.concatenate([part.reshape(-1, 2) for part in (*hung, *(piece.points for piece in pieces))])
    (left, low), (right, high) = points.min(0), points.max(0)
    rises = 0.3 * any(carrier.kind in {"tilt", "heave", "platform", "modal"} for carrier in structure.carriers)
    return replace(
        layout,
        below=-float(low) + rises * depth,
        above=float(high) + (0.1 + rises) * depth,
        half_width=(right - left) / 2 + 0.6 * depth,
        middle=(left + right) / 2,
    )


def _hung(links: tuple[AnyLink, ...], angles: Floats, pivot: Floats) -> Floats:
    """The joints of a chain at these angles from the downward vertical, (n + 1, 2) to the right and up."""
    length = np.array([link.length for link in links])[:, None]
    ways = np.column_stack((np.sin(angles), -np.cos(angles)))
    return np.asarray(pivot + np.vstack(([0.0, 0.0], np.cumsum(length * ways, axis=0))))


def _placed(links: tuple[AnyLink, ...], way: Floats) -> Floats:
    """How far the joints and the centres of mass of a chain are away, with the way of its links per length."""
    joints = np.cumsum([0.0, *(way * [link.length for link in links])])
    return np.concatenate([joints, joints[:-1] + way * [link.centre for link in links]])


def _panel(axis: Axes, modes: Modes, row: Mode, layout: ShapeLayout, amplitude: float) -> None:
    shape = modes.shape(modes.index_of(row)).at()
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


def draw_rest(axis: Axes, modes: Modes, layout: ShapeLayout, shape: Shape) -> None:
    """The rail and everything at equilibrium, on an axis with the limits of the layout."""
    axis.set_xlim(*layout.ends)
    axis.set_ylim(layout.bottom, layout.top)
    axis.set_aspect("equal")
    if layout.scaffold is None:
        axis.plot(layout.ends, [0, 0], color=muted(), lw=1.0, zorder=0)
    draw_swing(axis, modes, layout, shape, 0.0, {"color": rest(), "gid": QUIET})


def draw_translation(axis: Axes, layout: ShapeLayout) -> None:
    """The sign of a rigid translation."""
    reach, height = 0.3 * layout.depth, 0.13 * layout.depth
    if layout.scaffold is not None:
        height = layout.top - 0.05 * layout.depth
    arrow = {"arrowstyle": "<->", "color": colour(0), "lw": 1.6}
    axis.annotate("", (layout.middle + reach, height), (layout.middle - reach, height), arrowprops=arrow)


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


def fitting_amplitude(layout: ShapeLayout, shape: Shape, amplitude: float) -> float:
    """A reduced amplitude where the cart would leave the picture; long chains are drawn linearly, by displacement."""
    if layout.is_linear:
        cart = float(np.real(shape.cart))
        reach = [
            np.abs(cart + np.cumsum([link.length for link in links] * shape.angles[first : first + len(links)])).max()
            for links, first in zip(layout.links, layout.offsets, strict=True)
        ]
        amplitude *= SIDEWAYS * layout.depth / (np.radians(AMPLITUDE_DEG) * max(*reach, abs(cart), 1e-300))
    if layout.scaffold is not None:
        return float(min(amplitude, FARTHEST * layout.depth / max(layout.scaffold.reach(shape.supports), 1e-300)))
    return float(min(amplitude, FARTHEST * layout.depth / max(abs(shape.cart), 1e-300)))


def draw_swing(
    axis: Axes, modes: Modes, layout: ShapeLayout, shape: Shape, amplitude: float, look: dict[str, Any]
) -> None:
    """A real shape times an amplitude (rad)."""
    places, still = layout.places(shape, amplitude), layout.places(shape, 0.0)
    joints = {}
    for k, (links, angle, first) in enumerate(zip(layout.links, layout.rests, layout.offsets, strict=True)):
        angles = amplitude * shape.angles[first : first + len(links)]
        length = np.array([link.length for link in links])
        sin, cos = np.sin(angle), np.cos(angle)
        lean = np.sin(angle + angles), np.cos(angle + angles)
        if layout.is_linear:
            lean = sin + angles * cos, cos - angles * sin
        x, y = (np.concatenate([[0.0], np.cumsum(length * part)]) for part in lean)
        x, y = places[k, 0] + x, places[k, 1] - y
        joints[k] = np.column_stack((x, y))
        if amplitude != 0 and np.array_equal(places[k], still[k]) and not angles.any():
            continue
        axis.plot(x, y, **look, lw=THIN if layout.is_linear else THICK, zorder=2)
        if len(links) <= MOST_MARKS:
            _marks(axis, links, x, y, look, layout)
    if layout.scaffold is None:
        _support(axis, modes, layout, float(shape.cart.real) * amplitude, look, filled=amplitude == 0)
        return
    shown = {p: joints[k][None] for k, p in enumerate(layout.scaffold.drawn.tolist())}
    pieces = layout.scaffold.pieces(amplitude * shape.supports.real[None], shown)
    if amplitude != 0 and not shape.supports.any():
        pieces = [piece for piece in pieces if piece.role == "spring"]
    draw_pieces(axis, pieces, look, rests=amplitude == 0)


def _marks(
    axis: Axes, links: Sequence[AnyLink], x: Floats, y: Floats, look: dict[str, Any], layout: ShapeLayout
) -> None:
    heaviest, most = max(link.mass for link in links), layout.mark
    for i, link in enumerate(links):
        part = link.centre / link.length
        centre = (x[i] + part * (x[i + 1] - x[i]), y[i] + part * (y[i + 1] - y[i]))
        if part > 1:
            axis.plot([x[i + 1], centre[0]], [y[i + 1], centre[1]], ls=MARKED, **look, lw=1.2, zorder=2)
        if isinstance(link, Rod):
            axis.plot(x[i : i + 2], y[i : i + 2], **look, lw=min(4.0, 0.6 * most), zorder=3)
        else:
            size = most * (link.mass / heaviest) ** (1 / 3)
            marker = "o" if isinstance(link, Bob) else "D"
            axis.plot(*centre, marker, ms=max(size, min(SMALLEST, most)), **look, mec=paper(), mew=0.7, zorder=4)
    if layout.is_linear:
        return
    axis.plot(
        x[:-1], y[:-1], "o", ms=min(2.6, 0.4 * most), **look | {"color": paper()}, mec=look["color"], mew=0.9, zorder=5
    )


def _support(
    axis: Axes, modes: Modes, layout: ShapeLayout, shift: float, look: dict[str, Any], *, filled: bool
) -> None:
    left, right = layout.pivots[0] - 0.16 * layout.depth, layout.pivots[-1] + 0.16 * layout.depth
    height = 0.075 * layout.depth
    if modes.rig.cart is None:
        axis.plot([left, right], [0, 0], color=ink(), lw=3.0, zorder=1)
        return
    face = look["color"] if filled else "none"
    style: dict[str, Any] = {"boxstyle": f"round,pad=0,rounding_size={height / 3}", "lw": 1.3, "zorder": 1}
    axis.add_patch(FancyBboxPatch((left + shift, 0.0), right - left, height, fc=face, ec=look["color"], **style))


def _caption(modes: Modes, rows: Sequence[Mode], layout: ShapeLayout, amplitude_deg: float) -> str:
    words = ["grey: rest"]
    if any(row.oscillates for row in rows):
        words += ["blue and orange: the two ends of the swing"]
    if any(row.growth_rate for row in rows):
        words += ["of growing modes: the two ways they leave it"]
    if any(row.is_overdamped for row in rows):
        words += ["fading blue: an overdamped mode at the start, after one and after two time constants"]
    sideways, angles = "each mode exaggerated sideways to the same width", f"drawn with angles up to {amplitude_deg:g}°"
    words += [sideways if layout.is_linear else angles]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    if layout.scaffold is not None:
        words += set_apart(layout.scaffold, modes.scene.n_pendula)
    return "; ".join(words)


def set_apart(scaffold: Scaffold, count: int) -> list[str]:
    """What is not drawn of `count` pendula on a structure, and what is not in its place."""
    drawn = len(scaffold.drawn)
    words = [f"{drawn} of {count} pendula drawn"] if drawn < count else []
    return [*words, *["what would overlap is set apart"] * bool(scaffold.shifts.any() or scaffold.aside.any())]
