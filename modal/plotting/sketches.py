"""A sketch of a scene: its coordinates, lengths, masses and the forces on it, each with its symbol.

θ is measured from the downward vertical, positive towards positive x; l runs from joint to joint, c to the centre of
mass.  A symbol has the number of its link, of its pendulum, or of both; numbers that are equal throughout the scene
have one symbol without a number.  A sketch is not to scale, and without springs, dampers, friction and drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, FancyBboxPatch

from modal.errors import ComputationError
from modal.plotting.carriers import draw_pieces
from modal.plotting.structure_sketches import labels_of, schematic
from modal.plotting.style import MARKED, colour, ink, muted, paper, shade, sheet
from modal.scene import AnyLink, Bob, Rod, Scene, validate_scene
from modal.types import Floats

TILTS = (31.0, 48.0, 26.0, 40.0)
"""Angles (degrees) of the links from the top, where none are given."""
MOST_PENDULA, MOST_LINKS = 3, 4
SHORTEST = 0.7
"""Least length of a drawn link over that of the longest, which is the unit of all lengths below."""
INCHES = 1.6
"""Inches of the longest link."""
ABOVE, MARGIN, BESIDE = 0.56, 0.42, 0.72
TALL, WHEEL, OVERHANG = 0.2, 0.06, 0.34
WEIGHT, ARC = 0.36, 0.36
BODY = 0.14  # fraction of ink in the cart
OBLIQUE = 0.55 * np.array([np.cos(np.radians(35)), np.sin(np.radians(35))])


@dataclass(frozen=True)
class _SketchedLink:
    """One link: its upper and lower joint and its centre in the picture, its tilt (rad), its symbols' numbers."""

    link: AnyLink
    joint: Floats
    end: Floats
    centre: Floats
    tilt: float
    number: str


def sketch_figure(scene: Scene, angles_deg: Sequence[float] | None = None, *, push: str = "") -> Figure:
    r"""The scene at these angles (degrees, one for each link of each pendulum), with every symbol.

    `push` is the symbol of a horizontal force on the cart, such as "F".  Where the angles are left out they are chosen
    so that every symbol has its place.  Raises ComputationError for more than 3 pendula or 4 links below each other,
    in space for more than one link, for links that stand upright and for a push without a cart.  Of equal pendula on a
    structure one is drawn.

    >>> from modal import load
    >>> from modal.plotting import sketch_figure
    >>> [text.get_text() for text in sketch_figure(load("paper-cart-1"), push="F").axes[0].texts]
    ['$g$', '$m_c$', '$x$', '$F$', '$\\theta_{1}$', '$l$', '$c$', '$m g$', '$\\theta_{2}$', '$l$', '$c$', '$m g$']
    """
    validate_scene(scene)
    chains = _chains(scene)
    _refuse(scene, chains, push)
    if scene.space == "space":
        return _in_space()
    tilts = _tilts(chains, angles_deg)
    if scene.is_structured:
        return _structured(scene, chains, tilts)
    pendula = _placed(scene, chains, tilts)
    links = [drawn for chain in pendula for drawn in chain]
    weighed = [drawn.centre - np.array([0, WEIGHT]) for drawn in links]
    points = np.array([*weighed, *(point for drawn in links for point in (drawn.joint, drawn.end))])
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    pivots = np.array([chain[0].joint[0] for chain in pendula])
    gravity = max(right + 0.2, pivots.max() + OVERHANG + 0.5)
    lowest, highest = bottom - 0.14, max(top + 0.2, ABOVE)
    figure, axis = _sheet(min(left, pivots.min()) - BESIDE, gravity + 0.3, lowest, highest)
    _arrow(axis, (gravity, WEIGHT / 2), (gravity, -WEIGHT / 2), ink())
    _say(axis, "g", gravity + 0.13, 0.0)
    _support(axis, scene, pivots, push)
    for chain in pendula:
        for drawn, below in zip(chain, [*chain[1:], None], strict=True):
            _link(axis, drawn, below, _symbols(scene))
    return figure


def _structured(scene: Scene, chains: list[list[AnyLink]], tilts: list[Floats]) -> Figure:
    """Carriers side by side with their coordinates, springs, and a pendulum of each entry."""
    longest = max(link.length for chain in chains for link in chain)
    lengths = [np.maximum([link.length / longest for link in chain], SHORTEST) for chain in chains]
    scaffold = schematic(scene, lengths)
    still = np.zeros((1, scaffold.structure.size))
    drawn, joints = [], {}
    for p, (chain, angles, length) in enumerate(zip(chains, tilts, lengths, strict=True)):
        ways = np.stack((np.sin(angles), -np.cos(angles)), axis=1)
        joints[p] = scaffold.pivots(still)[0, p] + np.vstack(([0, 0], np.cumsum(length[:, None] * ways, axis=0)))
        named = [_number(scene, p + 1, i) for i in range(1, len(chain) + 1)]
        centres = [min(link.centre / link.length, 1.4) for link in chain]
        drawn.append(
            [
                _SketchedLink(link, start, end, start + centre * (end - start), float(angle), number)
                for link, start, end, centre, angle, number in zip(
                    chain, joints[p], joints[p][1:], centres, angles, named, strict=False
                )
            ]
        )
    pieces = scaffold.pieces(still, {p: places[None] for p, places in joints.items()})
    told = list(labels_of(scaffold, pieces))
    weights = [link.centre - np.array([0, WEIGHT]) for chain in drawn for link in chain]
    points = np.concatenate(
        [piece.points.reshape(-1, 2) for piece in pieces]
        + list(joints.values())
        + [np.array(weights), *(np.array([label.place]) for label in told)]
    )
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    figure, axis = _sheet(left - MARGIN, right + 0.8, bottom - 0.2, max(top, ABOVE) + 0.2)
    _arrow(axis, (right + 0.45, WEIGHT / 2), (right + 0.45, -WEIGHT / 2), ink())
    _say(axis, "g", right + 0.58, 0.0)
    draw_pieces(axis, pieces, {"color": shade(0.6)}, rests=True)
    for links in drawn:
        for link, below in zip(links, [*links[1:], None], strict=True):
            _link(axis, link, below, _symbols(scene))
    for label in told:
        x, y = label.place
        if label.arrow:
            _arrow(axis, (x, y), label.arrow, ink())
            x, y = label.arrow[0] + 0.14, label.arrow[1] + 0.04
        _say(axis, label.symbol, x, y, zorder=7)
    return figure


def _chains(scene: Scene) -> list[list[AnyLink]]:
    """The links of every pendulum, of an entry on a structure once."""
    pendula = (pendulum for pendulum in scene.pendulum for _ in range(1 if scene.is_structured else pendulum.count))
    return [[link for link in pendulum.links for _ in range(link.count)] for pendulum in pendula]


def _refuse(scene: Scene, chains: list[list[AnyLink]], push: str) -> None:
    longest = max(map(len, chains))
    if len(chains) > MOST_PENDULA or longest > MOST_LINKS:
        size = f"{len(chains)} pendula of up to {longest} links"
        raise ComputationError(f"a sketch has room for {MOST_PENDULA} pendula of {MOST_LINKS} links, not for {size}")
    if scene.space == "space" and (len(chains), longest) != (1, 1):
        raise ComputationError("a sketch in space has room for one link only")
    if any("up" in pendulum.ways for pendulum in scene.pendulum):
        raise ComputationError("a sketch shows links that hang, not links that stand upright")
    if push and scene.cart is None:
        raise ComputationError("a push needs a cart")


def _tilts(chains: list[list[AnyLink]], angles_deg: Sequence[float] | None) -> list[Floats]:
    count = sum(map(len, chains))
    if angles_deg is not None and len(angles_deg) != count:
        raise ComputationError(f"{len(angles_deg)} angles for {count} links")
    angles = np.concatenate([TILTS[: len(chain)] for chain in chains]) if angles_deg is None else np.array(angles_deg)
    return np.split(np.radians(angles), np.cumsum([len(chain) for chain in chains])[:-1])


def _placed(scene: Scene, chains: list[list[AnyLink]], tilts: list[Floats]) -> list[list[_SketchedLink]]:
    """Every link in its place; pendula as far apart as their extents ask for."""
    longest = max(link.length for chain in chains for link in chain)
    shapes = []
    for chain, angles in zip(chains, tilts, strict=True):
        length = np.maximum([link.length / longest for link in chain], SHORTEST)
        ways = np.stack((np.sin(angles), -np.cos(angles)), axis=1)
        shapes.append((length, ways, np.vstack(([0, 0], np.cumsum(length[:, None] * ways, axis=0)))))
    widths = [float(np.ptp(joints[:, 0])) + 2.2 * MARGIN for _, _, joints in shapes]
    places = np.cumsum([0.0, *widths[:-1]])
    numbers = [_number(scene, p, i) for p, chain in enumerate(chains, 1) for i in range(1, len(chain) + 1)]
    named = iter(numbers)
    return [
        [
            _SketchedLink(
                link,
                joints[i] + (place, 0),
                joints[i + 1] + (place, 0),
                joints[i] + (place, 0) + min(link.centre / link.length, 1.4) * length[i] * ways[i],
                float(angles[i]),
                next(named),
            )
            for i, link in enumerate(chain)
        ]
        for chain, angles, (length, ways, joints), place in zip(chains, tilts, shapes, places, strict=True)
    ]


def _number(scene: Scene, pendulum: int, link: int) -> str:
    """The subscript of a link's symbols: none, its number, that of its pendulum, or both."""
    single = all(entry.n_links == 1 for entry in scene.pendulum)
    if len(_chains(scene)) == 1:
        return "" if single else f"{link}"
    return f"{pendulum}" if single else f"{pendulum},{link}"


def _symbols(scene: Scene) -> dict[str, bool]:
    """Which of mass, length and centre differ among links."""
    links = [link for chain in _chains(scene) for link in chain]
    return {name: len({getattr(link, name) for link in links}) > 1 for name in ("mass", "length", "centre")}


def _sheet(left: float, right: float, bottom: float, top: float) -> tuple[Figure, Axes]:
    figure = sheet(INCHES * (right - left), INCHES * (top - bottom))
    figure.set_layout_engine("none")
    axis = figure.add_axes((0, 0, 1, 1))
    axis.set(xlim=(left, right), ylim=(bottom, top))
    axis.set_axis_off()
    return figure, axis


def _say(axis: Axes, symbol: str, x: float, y: float, **look: Any) -> None:
    axis.text(x, y, f"${symbol}$", **{"ha": "center", "va": "center", "fontsize": "large", "color": ink()} | look)


def _arrow(
    axis: Axes, start: Sequence[float] | Floats, end: Sequence[float] | Floats, hue: str, style: str = "-|>"
) -> None:
    look: dict[str, Any] = {
        "arrowstyle": style,
        "color": hue,
        "lw": 1.5,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 11,
    }
    axis.add_patch(FancyArrowPatch((start[0], start[1]), (end[0], end[1]), **look, zorder=6))


def _support(axis: Axes, scene: Scene, pivots: Floats, push: str) -> None:
    left, right = pivots.min() - OVERHANG, pivots.max() + OVERHANG
    if scene.cart is not None:
        _cart(axis, left, right, push)
        return
    axis.plot([left, right], [0, 0], color=ink(), lw=2.6, zorder=2)
    for foot in np.arange(left, right - 0.05, 0.09):
        axis.plot([foot, foot + 0.07], [0, 0.07], color=muted(), lw=0.9, zorder=1)
    if scene.is_moved:
        middle = (left + right) / 2
        _arrow(axis, (middle, 0.22), (middle + 0.42, 0.22), ink())
        _say(axis, "s", middle + 0.21, 0.38)


def _cart(axis: Axes, left: float, right: float, push: str) -> None:
    """A box on its rail, its coordinate x from a mark on the left, and the push on its right end."""
    middle, low = (left + right) / 2, -TALL / 2
    axis.plot([left - 0.3, right + 0.3], [low - 2 * WHEEL] * 2, color=muted(), lw=1.4, zorder=1)
    look: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.04", "ec": ink(), "lw": 1.3}
    axis.add_patch(FancyBboxPatch((left, low), right - left, TALL, fc=shade(BODY), zorder=2, **look))
    for wheel in (left + 0.13, right - 0.13):
        axis.add_patch(Circle((wheel, low - WHEEL), WHEEL, fc=paper(), ec=ink(), lw=1.3, zorder=1.5))
    _say(axis, "m_c", left + 0.17, 0.0, zorder=7)
    start = left - 0.3
    axis.plot([start, start], [low - 2 * WHEEL, 0.34], color=muted(), lw=1.0, zorder=1)
    axis.plot([middle, middle], [TALL / 2, 0.34], color=muted(), lw=1.0, zorder=1)
    _arrow(axis, (start, 0.28), (middle, 0.28), ink())
    _say(axis, "x", (start + middle) / 2, 0.42)
    if push:
        _arrow(axis, (right, 0.0), (right + 0.34, 0.0), colour(4))
        _say(axis, push, right + 0.24, 0.14, color=colour(4))


def _link(axis: Axes, drawn: _SketchedLink, below: _SketchedLink | None, differ: dict[str, bool]) -> None:
    """One link with its angle, length and centre, and the weight at its centre of mass."""
    side = 1.0 if drawn.tilt >= 0 else -1.0
    across, hue = side * np.array([np.cos(drawn.tilt), np.sin(drawn.tilt)]), colour(0)
    thick = isinstance(drawn.link, Rod) or not isinstance(drawn.link, Bob)
    axis.plot(
        *np.transpose([drawn.joint, drawn.end]), color=hue, lw=5.5 if thick else 1.8, solid_capstyle="round", zorder=3
    )
    axis.plot(*drawn.joint, "o", ms=4, color=paper(), mec=ink(), mew=1.1, zorder=7)
    _angle(axis, drawn, side)
    along, middle = drawn.end - drawn.joint, drawn.link.centre / drawn.link.length
    at = 0.5 if not thick else 0.8 if middle < 0.65 else 0.32
    _say(axis, _symbol("l", drawn, differ["length"]), *(drawn.joint + at * along + 0.17 * across))
    if thick:
        axis.plot(*drawn.centre, "o", ms=5, color=ink(), zorder=6)
        _arrow(axis, drawn.joint + 0.08 * across, drawn.centre + 0.08 * across, muted(), "<->")
        place = drawn.joint + 0.85 * (drawn.centre - drawn.joint) + 0.19 * across
        _say(axis, _symbol("c", drawn, differ["centre"]), *place)
    else:
        axis.plot(*drawn.end, "o", ms=13, color=hue, mec=paper(), mew=0.8, zorder=4)
    _arrow(axis, drawn.centre, drawn.centre - (0, WEIGHT), colour(4))
    away = -side if thick or (below is not None and below.tilt * side >= 0) else side
    x, y = drawn.centre - (-0.2 * away, WEIGHT - (0.0 if thick else 0.06))
    _say(axis, f"{_symbol('m', drawn, differ['mass'])} g", x, y, color=colour(4))


def _symbol(letter: str, drawn: _SketchedLink, numbered: bool) -> str:
    return f"{letter}_{{{drawn.number}}}" if numbered and drawn.number else letter


def _angle(axis: Axes, drawn: _SketchedLink, side: float) -> None:
    """The vertical through the upper joint, and the arc of θ."""
    x, y = drawn.joint
    axis.plot([x, x], [y, y - 0.54], ls=MARKED, color=muted(), lw=1.0, zorder=1)
    degrees = np.sort([270.0, 270.0 + np.degrees(drawn.tilt)])
    axis.add_patch(Arc((x, y), 2 * ARC, 2 * ARC, theta1=degrees[0], theta2=degrees[1], color=ink(), lw=1.2, zorder=2))
    half = drawn.tilt / 2
    symbol = rf"\theta_{{{drawn.number}}}" if drawn.number else r"\theta"
    _say(axis, symbol, x + (ARC + 0.14) * np.sin(half), y - (ARC + 0.14) * np.cos(half))


def _in_space() -> Figure:
    """One link from a pivot, with the polar angle θ from the vertical and the azimuth φ around it."""
    figure, axis = _sheet(-0.9, 1.4, -1.85, 0.75)

    def seen(radius: Any, theta: Any, phi: Any) -> Floats:
        across, depth = np.sin(theta) * np.sin(phi), np.cos(theta)
        return np.asarray(
            radius * np.array([np.sin(theta) * np.cos(phi) + OBLIQUE[0] * across, OBLIQUE[1] * across - depth])
        )

    ends = {"x": seen(1.1, np.pi / 2, 0), "y": seen(1.1, np.pi / 2, np.pi / 2), "z": seen(1.55, 0, 0)}
    for symbol, tip in ends.items():
        _arrow(axis, (0.0, 0.0), tip, muted())
        _say(axis, symbol, *(tip * (1 + 0.12 / np.hypot(*tip))))
    theta, phi = np.radians(48), np.radians(42)
    tip, foot = seen(1.0, theta, phi), np.array([0, -np.cos(theta)])
    axis.plot(*np.transpose([(0, 0), tip]), color=colour(0), lw=1.8, zorder=3)
    axis.plot(*tip, "o", ms=13, color=colour(0), mec=paper(), mew=0.8, zorder=4)
    _say(axis, "l", *(0.55 * tip + (0.1, 0.1)))
    _arrow(axis, tip, tip - (0, WEIGHT), colour(4))
    _say(axis, "m g", tip[0] + 0.2, tip[1] - WEIGHT + 0.06, color=colour(4))
    axis.plot(*np.transpose([foot, tip]), ls=MARKED, color=muted(), lw=1.0)
    axis.plot(*np.transpose([foot, foot + np.array([0.75, 0])]), ls=MARKED, color=muted(), lw=1.0)
    lean, turn = np.linspace(0, theta, 30), np.linspace(0, phi, 30)
    axis.plot(*seen(ARC, lean, phi), color=ink(), lw=1.2)
    _say(axis, r"\theta", *seen(ARC + 0.14, theta / 2, phi))
    axis.plot(*(foot[:, None] + seen(0.5, np.pi / 2, turn)), color=ink(), lw=1.2)
    _say(axis, r"\varphi", *(foot + np.array([0.62, -0.12])))
    return figure
