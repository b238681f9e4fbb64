"""Pictures of mode shapes: pendula and supports, grey at rest, and at both extremes of the oscillation.

Of many pendula the angles of their links are drawn over the number of the pendulum.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from modal.errors import ComputationError
from modal.modes import Mode, Modes, Shape
from modal.plotting.curves import draw_curves
from modal.plotting.layout import NUMBER, SMALL, caption, even_choice, headline, key
from modal.plotting.style import (
    COMPUTED,
    HUES,
    MARKED,
    QUIET,
    WIDE,
    WIDTH,
    colour,
    ink,
    mixture,
    paper,
    rest,
    secondary_colour,
    sheet,
    sheet_of_rows,
)
from modal.scene import AnyLink, Bob, Rod, Scene, title_of
from modal.scene.doors import require_type
from modal.structure import STILL, Piece, Scaffold
from modal.types import Floats, Ints

WIDTHS = {"body": 1.3, "line": 1.6, "spring": 1.0, "dot": 1.2, "ground": 1.8, "hatch": 0.8, "guide": 0.9}
ORDER = {"body": 1.5, "line": 1.2, "spring": 1.1, "dot": 1.8, "ground": 0.8, "hatch": 0.7, "guide": 0.6}


def draw_pieces(axis: Axes, pieces: Iterable[Piece], look: dict[str, Any], *, rests: bool) -> None:
    """The pieces of one instant with the colour of a `look`; at rest bodies are filled, and the ground is drawn."""
    for piece in pieces:
        if piece.role not in STILL:
            draw_piece(axis, piece, look, mixture(look["color"], 0.5) if rests else "none")
        elif rests:
            draw_piece(axis, piece, look | {"color": ink() if piece.role == "ground" else secondary_colour()}, "none")


def draw_piece(axis: Axes, piece: Piece, look: dict[str, Any], face: str) -> Polygon | Line2D:
    """A piece where it is first; `face` is the colour within a closed outline."""
    points, width, order = piece.points[0], WIDTHS[piece.role], ORDER[piece.role]
    if piece.is_outline:
        edge = {"ec": look["color"], "lw": width, "joinstyle": "round", "gid": look.get("gid")}
        outline = Polygon(points, closed=True, fc=face, zorder=order, **edge)
        axis.add_patch(outline)
        return outline
    look = look | {"ls": MARKED if piece.role == "guide" else COMPUTED}
    if piece.role == "dot":
        look |= {"ls": "", "marker": "o", "ms": 4.0, "color": paper(), "mec": look["color"], "mew": 1.2}
    return axis.plot(*points.T, **look, lw=width, solid_joinstyle="round", zorder=order)[0]


UNBROKEN = "\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}"
"""An equals sign at which no line ends."""
MOVING_SHARE = 0.02
"""Format: angle over the largest from which a pendulum is seen to move."""


def profiles_figure(modes: Modes, rows: Sequence[Mode], amplitude_deg: float, first: str = "") -> Figure:
    """One panel for each row: angles (°) over the number of the pendulum, a curve for every level of links.

    The shape is linear and to scale, the largest angle of any link `amplitude_deg`; `first` is the first of the
    notes below.
    """
    lines = -(-len(rows) // 3)
    columns = -(-len(rows) // lines)
    figure = sheet_of_rows(1.2 * lines, WIDE if columns > 1 else WIDTH)
    axes = figure.subplots(lines, columns, squeeze=False, sharey=True)
    levels = levels_of(modes.scene)
    numbers = even_choice(levels.shape[1], HUES)
    for place, (axis, row) in enumerate(zip(axes.flat, rows, strict=False)):
        cart = _profile(axis, modes, row, levels[:, numbers], amplitude_deg)
        axis.set_title(panel_words(row, letters_across(WIDE / 3)) + cart, linespacing=1.3)
        if place % columns:
            axis.set_ylabel("")
    for axis in axes.flat[len(rows) :]:
        axis.remove()
    local = any(np.ptp(axis.get_xlim()) < len(levels) - 1 for axis in axes.flat[: len(rows)])
    headline(figure, title_of(modes.scene), "mode shapes")
    notes = first + _notes(rows, levels, numbers, amplitude_deg, local=local)
    if len(numbers) > 1:
        marks = [Line2D([], [], color=colour(k), marker="o", ms=3) for k in range(len(numbers))]
        key(figure, marks, [f"link {level + 1}" for level in numbers], columns=HUES, notes=notes)
    else:
        caption(figure, notes)
    return figure


def title_size() -> float:
    """The size of the letters of a panel's title in inches."""
    return FontProperties(size=rcParams["axes.titlesize"]).get_size_in_points() / 72


def letters_across(inches: float) -> int:
    """How many letters of a panel's title stand in a line so long: one is two thirds as wide as its size."""
    return int(3 / 2 * inches / title_size())


def levels_of(scene: Scene) -> Ints:
    """The index of the link of each pendulum (rows) at each level (columns), −1 where it has none."""
    counts = [pendulum.n_links for pendulum in scene.hanging]
    levels = np.full((len(counts), max(counts)), -1, dtype=np.int64)
    first = np.cumsum([0, *counts[:-1]])
    for k, (start, count) in enumerate(zip(first.tolist(), counts, strict=True)):
        levels[k, :count] = start + np.arange(count)
    return levels


def _profile(axis: Axes, modes: Modes, row: Mode, levels: Ints, amplitude_deg: float) -> str:
    """Draw a row; how far the cart goes, in words."""
    shape = modes.shape(modes.index_of(row))
    angles: Floats = amplitude_deg * np.real(shape.angles)
    numbers = np.arange(1.0, len(levels) + 1)
    curves = [(numbers, np.where(level < 0, np.nan, angles[level])) for level in levels.T]
    draw_curves(axis, curves, first=1.1, marker="o", ms=3.5 if len(numbers) <= MARKS_MAX else 2.0, mew=0)
    number_pendula(axis, *_part(np.array([y for _, y in curves])), amplitude_deg)
    if modes.rig.cart is None or row.omega == 0:
        return ""
    cart = float(np.radians(amplitude_deg) * complex(shape.cart).real)
    return f"\ncart at {cart:.3g} m".replace("-", "−") if cart else "\ncart at rest"


def number_pendula(axis: Axes, first: int, last: int, amplitude_deg: float) -> None:
    """Make an axis of angles (°), up to the largest, over the numbers of these pendula."""
    side = 0.02 * (last - first) + 0.5
    height = (1 + 2 * rcParams["axes.ymargin"]) * amplitude_deg
    axis.set(xlim=(first - side, last + side), ylim=(-height, height))
    axis.set(xlabel=f"number of the pendulum ({NUMBER})", ylabel="angle (°)")
    axis.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axis.axhline(0.0, color=secondary_colour(), lw=0.8, zorder=0)


def _part(angles: Floats) -> tuple[int, int]:
    """The first and the last pendulum drawn, of angles (D, N): all, or those about a small part that moves."""
    size, count = np.nan_to_num(np.abs(angles)).max(0), angles.shape[1]
    moving = np.flatnonzero(size > MOVING_SHARE * size.max())
    if not moving.size:
        return 1, count
    first, last = int(moving[0]) + 1, int(moving[-1]) + 1
    room = max(last - first + 1, HUES)  # as many at rest to either side, which show that the mode is local
    return (1, count) if 2 * room >= count / 2 else (max(1, first - room), min(count, last + room))


def _notes(rows: Sequence[Mode], levels: Ints, numbers: Ints, amplitude_deg: float, *, local: bool) -> str:
    words = [f"angles at one end of the motion, the largest {amplitude_deg:g}°", f"{len(levels)} pendula"]
    if local:
        words += ["of local modes those about the moving ones drawn"]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    if len(numbers) < levels.shape[1]:
        words += [f"{len(numbers)} of {levels.shape[1]} links of each drawn"]
    return "; ".join(words)


MOST_PANELS = 24
"""Limit: modes of a figure or film: "choose at most 24 modes with `modes`"."""
USUAL_PANELS = 12
"""Format: modes that are drawn where none are chosen."""
PENDULA_MAX = 12
"""Format: most pendula that are drawn as they hang."""
MARKS_MAX = 40
"""Format: most links of a chain that have marks; of more they would touch."""
FEW_LINKS = 6
"""Format: links of a chain up to which its angles are drawn; a longer one is drawn by its displacements."""
AMPLITUDE_DEG = 25.0
"""Format: largest angle of a drawing, and what stands for full displacement of a long chain."""
SIDEWAYS = 0.4
"""Format: largest displacement of a long chain, and of what pendula hang from, over the picture's depth."""
BOB_POINTS = 11.0
"""Format: width of the heaviest bob in points."""


@dataclass(frozen=True, eq=False)
class ShapeLayout:
    """The pendula drawn, their links' angles at equilibrium, the index of the first link of each, what they hang from.

    In metres: the longest chain, the lower and the upper edge of a panel, and half its width, about `middle`.  The
    heaviest bob is `mark` points wide.
    """

    links: tuple[tuple[AnyLink, ...], ...]
    rests: tuple[Floats, ...]
    offsets: tuple[int, ...]
    scaffold: Scaffold
    depth: float
    bottom: float = 0.0
    top: float = 0.0
    half_width: float = 0.0
    middle: float = 0.0
    mark: float = BOB_POINTS

    def within(self, width: float) -> ShapeLayout:
        """The same with marks small enough for structures and long chains, in a panel of this width (inches)."""
        points = 72 * width / (2 * self.half_width)
        mark = min(BOB_POINTS, 0.25 * self.depth * points)
        if self.is_linear:
            mark = min(mark, 0.5 * points * min(link.length for links in self.links for link in links))
        return replace(self, mark=mark)

    @property
    def ratio(self) -> float:
        """The width of a panel over its height."""
        return 2 * self.half_width / (self.top - self.bottom)

    @property
    def is_linear(self) -> bool:
        """Whether displacements are drawn, exaggerated, and not angles: of a chain of more than FEW_LINKS."""
        return max(map(len, self.links)) > FEW_LINKS

    @property
    def ends(self) -> tuple[float, float]:
        """The left and the right edge of a panel."""
        return self.middle - self.half_width, self.middle + self.half_width

    def moved(self, shape: Shape, amplitude: float) -> Floats:
        """The coordinates η (1, d) of the supports in a real shape times an amplitude."""
        return np.asarray(amplitude * shape.leading.real[None, : self.scaffold.structure.size])

    def chains(self, shape: Shape, amplitude: float) -> list[Floats]:
        """The joints of the pendula in a real shape times an amplitude, (n + 1, 2) each."""
        pivots = self.scaffold.pivots(self.moved(shape, amplitude))[0]
        return [
            _joint_places(
                links, rest, pivot, amplitude * shape.angles.real[at : at + len(links)], linear=self.is_linear
            )
            for links, rest, at, pivot in zip(self.links, self.rests, self.offsets, pivots, strict=True)
        ]

    def pieces(self, eta: Floats, chains: Sequence[Floats]) -> list[Piece]:
        """Return the supports and their springs at η (1, d)."""
        joints = (chain[None] for chain in chains)
        return self.scaffold.pieces(eta, dict(zip(self.scaffold.pendula.tolist(), joints, strict=True)))


def shapes_figure(
    modes: Modes, numbers: Sequence[int] | None = None, *, amplitude_deg: float = AMPLITUDE_DEG
) -> Figure:
    """The modes with these indices (from 0), by default the first USUAL_PANELS, one panel each.

    The largest angle of each is `amplitude_deg`.  Chains of more than FEW_LINKS are drawn by their displacements: that
    of each mode is exaggerated until its largest is the same part of the picture, SIDEWAYS at 25°.

    Up to PENDULA_MAX pendula are drawn as they hang; of more, the angles over the number of the pendulum.  An
    overdamped mode is drawn where it begins and after one and two time constants.

    Raise ComputationError for more modes than one picture holds.
    """
    require_type("modes", modes, "Modes")
    first = some_words(modes, numbers)
    numbers = range(min(len(modes), USUAL_PANELS)) if numbers is None else numbers
    if len(numbers) > MOST_PANELS:
        raise ComputationError(
            f"{len(numbers)} modes do not fit in one figure: choose at most {MOST_PANELS} modes with `modes`"
        )
    rows = list(modes.rows(numbers))
    if is_crowded(modes.scene):
        return profiles_figure(modes, rows, amplitude_deg, first)
    layout = layout_of(modes, rows, np.radians(amplitude_deg))
    figure, axes, width = panels_of(modes, rows, layout.ratio, "mode shapes")
    layout = layout.within(width)
    for axis, row in zip(axes, rows, strict=True):
        _panel(axis, modes, row, layout, np.radians(amplitude_deg))
        axis.set_axis_off()
    caption(figure, f"{first}{_caption(modes, rows, layout, amplitude_deg)}")
    return figure


def some_words(modes: Modes, numbers: Sequence[int] | None) -> str:
    """The note on modes omitted where none were requested, "" if none were."""
    return f"the first {USUAL_PANELS} of {len(modes)} modes; " if numbers is None and len(modes) > USUAL_PANELS else ""


def is_crowded(scene: Scene) -> bool:
    """Whether a scene has so many pendula that their angles are drawn over their numbers.

    Of equal pendula on a structure some are drawn, as long as there is room for one of each entry.
    """
    return (len(scene.pendulum) if scene.is_structured else scene.n_pendula) > PENDULA_MAX


def panels_of(modes: Modes, rows: Sequence[Mode], ratio: float, what: str) -> tuple[Figure, list[Axes], float]:
    """A figure with a panel for each row, of this width over height; its axes with their titles; their width (inches).

    `what` the figure shows stands in its title.
    """
    lines = -(-len(rows) // min(len(rows), 4 if ratio < 3 / 2 else 3))
    columns = -(-len(rows) // lines)
    width = float(np.clip(2.6 * ratio, 2.6, WIDE / columns))
    titles = [panel_words(row, letters_across(max(width, WIDTH / 2 / columns))) for row in rows]
    line = 3 / 2 * title_size()
    height = width / ratio + line * max(title.count("\n") + 1 for title in titles)
    figure = sheet(max(width * columns, WIDTH / 2), height * lines + 4 * line)
    headline(figure, title_of(modes.scene), what)
    axes = figure.subplots(lines, columns, squeeze=False).ravel().tolist()
    for axis, title in zip(axes, titles, strict=False):
        axis.set_title(title, linespacing=1.3)
    for axis in axes[len(rows) :]:
        axis.remove()
    return figure, axes[: len(rows)], width


def layout_of(modes: Modes, rows: Sequence[Mode] = (), amplitude: float = 0.0) -> ShapeLayout:
    """Return the layout of the drawn pendula, with room for the motion of these modes at their amplitude (rad)."""
    scene, structure = modes.scene, modes.rig.on_structure.structure
    assert structure is not None
    copies = scene.hanging
    first = np.cumsum([0, *(pendulum.n_links for pendulum in copies)])
    most = 5 * PENDULA_MAX // 2  # of equal pendula on a structure, which hang closer
    limit = PENDULA_MAX if len(copies) <= PENDULA_MAX else max(1, most // len(scene.pendulum))
    counts = [pendulum.count for pendulum in scene.pendulum]
    begins = np.cumsum([0, *counts[:-1]]).tolist()
    indices = np.concatenate(
        [begin + np.arange(min(count, limit)) for begin, count in zip(begins, counts, strict=True)]
    )
    numbers = indices[even_choice(len(indices), most)]
    chains = tuple(copies[k].chain for k in numbers)
    rests = tuple(modes.rig.rest_angles[first[k] : first[k + 1]] for k in numbers)
    depth = max(_extent(chain) for chain in chains)
    scaffold = Scaffold(structure, numbers, first, depth)
    layout = ShapeLayout(chains, rests, tuple(first[numbers].tolist()), scaffold, depth)
    shapes = [modes.shape(modes.index_of(row)) for row in rows if row.omega] or [modes.shape(0)]
    points = np.concatenate([_reached(layout, shape, amplitude) for shape in shapes])
    (left, bottom), (right, top) = points.min(0), points.max(0)
    has_arrow = any(row.omega == 0 for row in rows)
    return replace(
        layout,
        bottom=float(bottom) - 0.14 * depth,
        top=float(top) + (0.25 if has_arrow else 0.12) * depth,
        half_width=float(max(right - left, depth)) / 2 + 0.14 * depth,
        middle=float(left + right) / 2,
    )


def _reached(layout: ShapeLayout, shape: Shape, amplitude: float) -> Floats:
    """Everything that is drawn of a shape (K, 2), at rest and at quarters of a swing."""
    amplitude = fitting_amplitude(layout, shape.at(), amplitude)
    points = [np.array([[x, y + 0.15 * layout.depth]]) for _, x, y in layout.scaffold.names]
    for turn, factor in ((1.0, 0.0), (1.0, amplitude), (1j, amplitude), (-1.0, amplitude), (-1j, amplitude)):
        real = shape.at(turn)
        chains = layout.chains(real, factor)
        points += [*chains, *map(_centres, layout.links, chains)]
        points += [piece.points.reshape(-1, 2) for piece in layout.pieces(layout.moved(real, factor), chains)]
    return np.concatenate(points)


def _extent(links: tuple[AnyLink, ...]) -> float:
    """The length of a chain, of one whose last centre of mass is beyond it as far as that."""
    joints = np.cumsum([0.0, *(link.length for link in links)])
    return float(max(joints[-1], *(joints[:-1] + [link.centre for link in links])))


def _joint_places(
    links: tuple[AnyLink, ...], rest: Floats, pivot: Floats, angles: Floats | float = 0.0, *, linear: bool = False
) -> Floats:
    """The joints of a chain turned by angles from rest, or displaced as by small ones, (n + 1, 2) right and up."""
    length = np.array([link.length for link in links])[:, None]
    ways = np.column_stack((np.sin(rest + angles), -np.cos(rest + angles)))
    if linear:
        ways = np.column_stack((np.sin(rest) + angles * np.cos(rest), angles * np.sin(rest) - np.cos(rest)))
    return np.asarray(pivot + np.vstack(([0.0, 0.0], np.cumsum(length * ways, axis=0))))


def _panel(axis: Axes, modes: Modes, row: Mode, layout: ShapeLayout, amplitude: float) -> None:
    shape = modes.shape(modes.index_of(row)).at()
    draw_rest(axis, layout, shape)
    if row.omega == 0:
        draw_translation(axis, layout)
        return
    amplitude = fitting_amplitude(layout, shape, amplitude)
    if row.is_overdamped:
        for constants in (2, 1, 0):
            remaining_part = float(np.exp(-constants))
            look = {"color": mixture(colour(0), 1 / (1 + constants)), **({"gid": QUIET} if constants else {})}
            draw_swing(axis, layout, shape, remaining_part * amplitude, look)
    else:
        draw_swing(axis, layout, shape, -amplitude, {"color": colour(1)})
        draw_swing(axis, layout, shape, amplitude, {"color": colour(0)})


def draw_rest(axis: Axes, layout: ShapeLayout, shape: Shape) -> None:
    """The rail and everything at equilibrium, on an axis with the limits of the layout."""
    axis.set_xlim(*layout.ends)
    axis.set_ylim(layout.bottom, layout.top)
    axis.set_aspect("equal")
    for name, x, y in layout.scaffold.names:
        align = ("left", "center") if layout.scaffold.storeys else ("center", "bottom")
        look: dict[str, Any] = dict(zip(("ha", "va"), align, strict=True))
        axis.text(x, y, name, fontsize=SMALL, color=secondary_colour(), parse_math=False, **look)
    draw_swing(axis, layout, shape, 0.0, {"color": rest(), "gid": QUIET})


def draw_translation(axis: Axes, layout: ShapeLayout) -> None:
    """The sign of a rigid translation."""
    reach, height = 0.3 * layout.depth, layout.top - 0.05 * layout.depth
    arrow = {"arrowstyle": "<->", "color": colour(0), "lw": 1.6}
    axis.annotate("", (layout.middle + reach, height), (layout.middle - reach, height), arrowprops=arrow)


def panel_words(row: Mode, letters: int) -> str:
    """The title of a panel: number, frequencies or rates, and family."""
    decay = f", ζ = {row.damping_ratio:.3g}".replace(" = ", UNBROKEN) if row.damping_ratio > 0 else ""
    rate = "no digit certain" if row.is_uncertain else f"ω{UNBROKEN}{row.omega:.5g}\N{NO-BREAK SPACE}rad/s{decay}"
    if row.growth_rate:
        rate = f"grows at {row.growth_rate:.5g} 1/s"
    elif row.is_overdamped:
        rate = f"decays at {row.omega:.5g} 1/s without a swing"
    frequency = "" if row.frequency is None else f":  {row.frequency:.4g} Hz"
    return f"mode {row.number}{frequency}\n{fill(rate, letters)}\n{fill(row.family, letters)}"


def fitting_amplitude(layout: ShapeLayout, shape: Shape, amplitude: float) -> float:
    """A reduced amplitude where the support would leave the picture; long chains are drawn by displacements."""
    support = layout.scaffold.reach(layout.moved(shape, 1.0)[0])
    if layout.is_linear:
        small = 1e-4 / max(float(np.abs(shape.leading).max()), 1.0)
        pairs = zip(layout.chains(shape, small), layout.chains(shape, 0.0), strict=True)
        reach = max(float(np.abs(now - still)[:, 0].max()) / small for now, still in pairs)
        amplitude *= SIDEWAYS * layout.depth / (np.radians(AMPLITUDE_DEG) * max(reach, support, 1e-300))
    return float(min(amplitude, SIDEWAYS * layout.depth / max(support, 1e-300)))


def draw_swing(axis: Axes, layout: ShapeLayout, shape: Shape, amplitude: float, look: dict[str, Any]) -> None:
    """A real shape times an amplitude (rad): at rest all of it, else what is not where it rests."""
    swung_chains, resting_chains = (layout.chains(shape, factor) for factor in (amplitude, 0.0))
    rests = amplitude == 0
    for links, joints, before in zip(layout.links, swung_chains, resting_chains, strict=True):
        if rests or not np.array_equal(joints, before):
            axis.plot(*joints.T, **look, lw=1.0 if layout.is_linear else None, zorder=2)
            if len(links) <= MARKS_MAX:
                _marks(axis, links, joints, look, layout)
    pieces, resting = (
        layout.pieces(layout.moved(shape, factor), chains)
        for factor, chains in ((amplitude, swung_chains), (0.0, resting_chains))
    )
    moving = (
        piece
        for piece, before in zip(pieces, resting, strict=True)
        if rests or not np.array_equal(piece.points, before.points)
    )
    draw_pieces(axis, moving, look, rests=rests)


def _centres(links: Sequence[AnyLink], joints: Floats) -> Floats:
    """The centres of mass of the links between these joints."""
    part = np.array([[link.centre / link.length] for link in links])
    return np.asarray(joints[:-1] + part * np.diff(joints, axis=0))


def _marks(axis: Axes, links: Sequence[AnyLink], joints: Floats, look: dict[str, Any], layout: ShapeLayout) -> None:
    heaviest, largest_mark = max(link.mass for link in links), layout.mark
    for i, (link, centre) in enumerate(zip(links, _centres(links, joints), strict=True)):
        if link.centre > link.length:
            axis.plot(*np.transpose([joints[i + 1], centre]), ls=MARKED, **look, lw=1.2, zorder=2)
        if isinstance(link, Rod):
            axis.plot(*joints[i : i + 2].T, **look, lw=min(4.0, 0.6 * largest_mark), zorder=3)
        else:
            size = largest_mark * (link.mass / heaviest) ** (1 / 3)
            marker = "o" if isinstance(link, Bob) else "D"
            axis.plot(*centre, marker, ms=max(size, min(4, largest_mark)), **look, mec=paper(), mew=0.7, zorder=4)
    if layout.is_linear:
        return
    look = look | {"color": paper(), "mec": look["color"]}
    axis.plot(*joints[:-1].T, "o", ms=min(2.6, 0.4 * largest_mark), **look, mew=0.9, zorder=5)


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
    return "; ".join([*words, *set_apart(layout.scaffold, modes.scene.n_pendula)])


def set_apart(scaffold: Scaffold, count: int) -> list[str]:
    """Return which of `count` pendula on a structure are not drawn, or not in their places."""
    n_drawn = len(scaffold.pendula)
    words = [f"{n_drawn} of {count} pendula drawn"] if n_drawn < count else []
    return [*words, *scaffold.notes]
