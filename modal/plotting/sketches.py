"""A sketch of a scene: its coordinates, lengths, masses and the forces on it, each with its symbol.

θ is measured from the downward vertical, positive towards positive x; l runs from joint to joint, c to the centre of
mass.  A symbol has the number of its link, of its pendulum, or of both; numbers that are equal throughout the scene
have one symbol without a number.  A sketch is not to scale, and without dampers, friction and drives: what pendula hang
from stands side by side, their pivots no farther from each other than the longest link and their own extent ask for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyArrowPatch

from modal.errors import ComputationError
from modal.plotting.free_body import ARROW, MOST_PENDULA
from modal.plotting.layout import OBLIQUE
from modal.plotting.shapes import draw_pieces
from modal.plotting.style import MARKED, colour, ink, paper, secondary_colour, shade, sheet
from modal.scene import AnyLink, Bob, Scene, validate_scene
from modal.structure import (
    CarrierEnd,
    End,
    LinkEnd,
    Piece,
    Scaffold,
    SpringNumbers,
    Structure,
    Where,
    structure_of,
)
from modal.types import Floats

TILTS = (31.0, 48.0, 26.0, 40.0)
"""Angles (degrees) of the links from the top, where none are given."""
SHORT_LENGTH = 0.75
"""Format: least length of a link over that of the longest, of a swing's rods, and reach of a support's points."""
INCHES = 1.6
"""Format: inches of the longest link."""
LETTERS = {"phi": r"\varphi", "y": "z", "s": "x"}
"""Letters of coordinates that a picture writes in another way than equations do."""


@dataclass(frozen=True)
class _SketchedLink:
    """One link: its upper and lower joint and its centre in the picture, its tilt (rad), its symbols' numbers."""

    link: AnyLink
    joint: Floats
    end: Floats
    centre: Floats
    tilt: float
    number: str


class Label(NamedTuple):
    """A symbol at a place, and the end of an arrow that begins there, of a coordinate."""

    symbol: str
    place: tuple[float, float]
    arrow: tuple[float, float] | None = None


def sketch_figure(scene: Scene, angles_deg: Sequence[float] | None = None, *, push: str = "") -> Figure:
    r"""The scene at these angles (degrees, one for each link of each pendulum), with every symbol.

    `push` is the symbol of a horizontal force on the cart, such as "F". Where the angles are omitted they are chosen so
    that every symbol has its place. Raise ComputationError for more than 3 pendula or 4 links below each other, in
    space for more than one link, for links that stand upright and for a push without a cart. Of equal pendula on a
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
    longest = max(link.length for chain in chains for link in chain)
    lengths = [np.maximum([link.length / longest for link in chain], SHORT_LENGTH) for chain in chains]
    tilts = _tilts(chains, angles_deg)
    joint_places = [
        np.vstack(([0, 0], np.cumsum(length[:, None] * np.stack((np.sin(tilt), -np.cos(tilt)), axis=1), axis=0)))
        for length, tilt in zip(lengths, tilts, strict=True)
    ]
    scaffold = _schematic(scene, chains, lengths, joint_places)
    at_rest = np.zeros((1, scaffold.structure.size))
    joints = [pivot + chain for pivot, chain in zip(scaffold.pivots(at_rest)[0], joint_places, strict=True)]
    pendula = [
        _sketch_links(scene, p, *pendulum) for p, pendulum in enumerate(zip(chains, tilts, joints, strict=True), 1)
    ]
    pieces = scaffold.pieces(at_rest, {p: places[None] for p, places in enumerate(joints)})
    labels = list(_labels(scaffold, pieces, push))
    weights = np.array([link.centre - (0, ARROW) for chain in pendula for link in chain])
    points = np.concatenate(
        [piece.points.reshape(-1, 2) for piece in pieces]
        + joints
        + [np.array([*weights, *(label.place for label in labels)])]
    )
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    figure, axis = _sheet(left - 0.5, right + 0.8, bottom - 0.2, max(top, 0.5) + 0.2)
    _arrow(axis, (right + 0.45, ARROW / 2), (right + 0.45, -ARROW / 2), ink())
    _say(axis, "g", right + 0.58, 0.0)
    draw_pieces(axis, pieces, {"color": shade(0.6)}, rests=True)
    for label in labels:
        (x, y), hue = label.place, colour(4) if label.symbol == push else ink()
        if label.arrow:
            _arrow(axis, (x, y), label.arrow, hue)
            x, y = label.arrow[0] + 0.14, label.arrow[1] + 0.04
        _say(axis, label.symbol, x, y, zorder=7, color=hue)
    for chain in pendula:
        for link, lower_link in zip(chain, [*chain[1:], None], strict=True):
            _link(axis, link, lower_link, _symbols(scene))
    return figure


def _sketch_links(
    scene: Scene, pendulum: int, chain: list[AnyLink], tilts: Floats, joints: Floats
) -> list[_SketchedLink]:
    """The links of a pendulum by its number."""
    links = []
    for i, (link, tilt) in enumerate(zip(chain, tilts.tolist(), strict=True)):
        centre = joints[i] + min(link.centre / link.length, 1.4) * (joints[i + 1] - joints[i])
        links.append(_SketchedLink(link, joints[i], joints[i + 1], centre, tilt, _number(scene, pendulum, i + 1)))
    return links


def _pendulum_numbers(scene: Scene) -> list[int]:
    """The numbers of the pendula that are drawn, from 0: of equal ones on a structure the first."""
    counts = [pendulum.count for pendulum in scene.pendulum]
    return np.cumsum([0, *counts[:-1]]).tolist() if scene.is_structured else list(range(sum(counts)))


def _chains(scene: Scene) -> list[list[AnyLink]]:
    """The links of every pendulum that is drawn."""
    return [list(scene.hanging[k].chain) for k in _pendulum_numbers(scene)]


def _refuse(scene: Scene, chains: list[list[AnyLink]], push: str) -> None:
    longest = max(map(len, chains))
    if len(chains) > MOST_PENDULA or longest > len(TILTS):
        size = f"{len(chains)} pendula of up to {longest} links"
        raise ComputationError(f"a sketch has room for {MOST_PENDULA} pendula of {len(TILTS)} links, not for {size}")
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
    look: dict[str, Any] = {"arrowstyle": style, "color": hue, "lw": 1.5, "mutation_scale": 11}
    axis.add_patch(FancyArrowPatch((start[0], start[1]), (end[0], end[1]), **look, shrinkA=0, shrinkB=0, zorder=6))


def _schematic(
    scene: Scene, chains: list[list[AnyLink]], lengths: list[Floats], joint_places: list[Floats]
) -> Scaffold:
    """The supports, not to scale, with those that are drawn, of these lengths and places of joints."""
    structure, numbers = structure_of(scene), _pendulum_numbers(scene)
    longest = max(link.length for chain in chains for link in chain)
    pivots = [structure.pivots[k] for k in numbers]
    factors = [_factor(structure, k, pivots, longest) for k in range(len(structure.carriers))]
    carriers = tuple(
        replace(
            carrier,
            position=(0.0, 0.0),
            parameters=(SHORT_LENGTH,) if carrier.kind == "swing" else carrier.parameters,
            centre=(carrier.centre[0] * by, carrier.centre[1] * by),
            damping=(0.0,) * len(carrier.damping),
        )
        for carrier, by in zip(structure.carriers, factors, strict=True)
    )
    ends = [CarrierEnd(pivot.carrier, _scale(pivot.where, factors[pivot.carrier])) for pivot in pivots]
    starts = np.cumsum([0, *(pendulum.n_links for pendulum in scene.hanging)])
    links: dict[int, tuple[int, float]] = {}
    for k, chain, length in zip(numbers, chains, lengths, strict=True):
        for at, link in enumerate(chain):
            links[int(starts[k]) + at] = len(links), float(length[at]) / link.length
    springs = (_drawn_spring(spring, factors, links) for spring in structure.springs if spring.stiffness)
    connections = tuple(spring for spring in springs if spring is not None)
    first = np.cumsum([0, *map(len, chains)])
    return Scaffold(
        Structure(carriers, tuple(_spread(ends, joint_places)), connections), np.arange(len(ends)), first, 1.0, 1.0
    )


def _spread(pivots: list[CarrierEnd], joint_places: list[Floats]) -> list[CarrierEnd]:
    """Pivots in a row, at least as far apart as the extents of their pendula ask for."""
    rows: dict[tuple[int, float], list[int]] = {}
    for p, (carrier, where) in enumerate(pivots):
        if not isinstance(where, int):
            rows.setdefault((carrier, where[1]), []).append(p)
    for members in rows.values():
        places_before = [pivots[p].where[0] for p in members]  # type: ignore[index]
        places = list(places_before)
        for k in range(1, len(members)):
            places[k] = max(places[k], places[k - 1] + float(np.ptp(joint_places[members[k - 1]][:, 0])) + 1)
        shift = float(np.mean(places) - np.mean(places_before))
        for p, place in zip(members, places, strict=True):
            pivots[p] = CarrierEnd(pivots[p].carrier, (place - shift, pivots[p].where[1]))  # type: ignore[index]
    return pivots


def _factor(structure: Structure, k: int, pivots: list[CarrierEnd], longest: float) -> float:
    """The factor by which the points of a support are drawn closer together."""
    points: list[Where] = [pivot.where for pivot in pivots if pivot.carrier == k]
    ends = (end for spring in structure.springs for end in spring.ends)
    points += [end.where for end in ends if isinstance(end, CarrierEnd) and end.carrier == k]
    distance = max((abs(float(part)) for where in points if not isinstance(where, int) for part in where), default=0.0)
    if distance and not structure.carriers[k].size:
        return 1 / distance
    return min(1 / longest, SHORT_LENGTH / distance) if distance else 1 / longest


def _scale(where: Where, by: float) -> Where:
    return where if isinstance(where, int) else (where[0] * by, where[1] * by)


def _drawn_spring(
    spring: SpringNumbers, factors: list[float], links: dict[int, tuple[int, float]]
) -> SpringNumbers | None:
    """A spring between what is drawn, None for one of another copy.

    `links` are the drawn ones by their numbers in the file, each with its number here and by how much it is longer.
    """
    ends: list[End] = []
    for end in spring.ends:
        if isinstance(end, CarrierEnd):
            ends.append(CarrierEnd(end.carrier, _scale(end.where, factors[end.carrier])))
        elif not isinstance(end, LinkEnd):
            ends.append(end._replace(place=None))
        elif end.link in links:
            number, longer = links[end.link]
            ends.append(LinkEnd(number, None if end.below is None else end.below * longer))
        else:
            return None
    return spring._replace(ends=(ends[0], ends[1]))


def _labels(scaffold: Scaffold, pieces: list[Piece], push: str) -> Iterator[Label]:
    """The symbols of supports with their coordinates, of a force on a cart, and of springs."""
    at_rest = np.zeros((1, scaffold.structure.size))
    has_names = sum(carrier.size > 0 for carrier in scaffold.structure.carriers) > 1
    for k, carrier in enumerate(scaffold.structure.carriers):
        if carrier.kind != "moved" and carrier.path is None:
            continue
        letters = [coordinate.letter for coordinate in carrier.path.coordinates] if carrier.path else []
        symbols = [LETTERS.get(letter, letter) for letter in letters] or ["s"]
        index = rf"_\mathrm{{{carrier.name.replace('_', chr(92) + '_')}}}" if has_names else ""
        left, right, level = scaffold.bodies[k]
        platform = carrier.kind == "platform"
        (x, y), (end, _) = (scaffold.place(k, (s, level), at_rest)[0].tolist() for s in (left, right))
        if carrier.size:
            letter = "_c" if carrier.kind == "cart" else "_s"
            places = {"platform": (x + 0.1, y), "swing": (x, y - 0.2)}  # by the left end of its body
            yield Label("m" + (index or letter), places.get(carrier.kind, (x + 0.02, y + 0.2)))
        start = x + 0.2 if platform else (x + end) / 2 + 0.06
        for number, symbol in enumerate(symbols):
            place = (start, y + 0.2 if not platform else y + 0.16)
            way = {"x": (0.3, 0.0), "s": (0.3, 0.0), "z": (0.0, 0.3)}.get(symbol)
            if symbol == r"\varphi":
                place = (place[0] + 0.16 * (number > 0), place[1] + 0.2 * (number > 0))
            yield Label(symbol + index, place, way and (place[0] + way[0], place[1] + way[1]))
        if push and carrier.kind == "cart":
            yield Label(push, (end, y), (end + 0.34, y))
    springs = [piece for piece in pieces if piece.role == "spring"]
    for number, piece in enumerate(springs, 1):
        x, y = piece.points[0].mean(0)
        width, height = np.ptp(piece.points[0], axis=0)
        tall = height > 0.8 * width
        place = (float(x) + 0.17, float(y)) if tall else (float(x), float(y) + 0.16)
        yield Label(f"k_{{{number}}}" if len(springs) > 1 else "k", place)


def _link(axis: Axes, sketch: _SketchedLink, lower_link: _SketchedLink | None, differ: dict[str, bool]) -> None:
    """One link with its angle, length and centre, and the weight at its centre of mass."""
    side = 1.0 if sketch.tilt >= 0 else -1.0
    normal, hue = side * np.array([np.cos(sketch.tilt), np.sin(sketch.tilt)]), colour(0)
    thick, ends = not isinstance(sketch.link, Bob), np.transpose([sketch.joint, sketch.end])
    axis.plot(*ends, color=hue, lw=5.5 if thick else 1.8, solid_capstyle="round", zorder=3)
    axis.plot(*sketch.joint, "o", ms=4, color=paper(), mec=ink(), mew=1.1, zorder=7)
    _angle(axis, sketch)
    direction, middle = sketch.end - sketch.joint, sketch.link.centre / sketch.link.length
    at = 0.5 if not thick else 0.8 if middle < 0.65 else 0.32
    _say(axis, _symbol("l", sketch, differ["length"]), *(sketch.joint + at * direction + 0.17 * normal))
    if thick:
        axis.plot(*sketch.centre, "o", ms=5, color=ink(), zorder=6)
        _arrow(axis, sketch.joint + 0.08 * normal, sketch.centre + 0.08 * normal, secondary_colour(), "<->")
        place = sketch.joint + 0.85 * (sketch.centre - sketch.joint) + 0.19 * normal
        _say(axis, _symbol("c", sketch, differ["centre"]), *place)
    else:
        axis.plot(*sketch.end, "o", ms=13, color=hue, mec=paper(), mew=0.8, zorder=4)
    _arrow(axis, sketch.centre, sketch.centre - (0, ARROW), colour(4))
    side_of_weight = -side if thick or (lower_link is not None and lower_link.tilt * side >= 0) else side
    x, y = sketch.centre - (-0.2 * side_of_weight, ARROW - (0.0 if thick else 0.06))
    _say(axis, f"{_symbol('m', sketch, differ['mass'])} g", x, y, color=colour(4))


def _symbol(letter: str, sketch: _SketchedLink, has_number: bool) -> str:
    return f"{letter}_{{{sketch.number}}}" if has_number and sketch.number else letter


def _angle(axis: Axes, sketch: _SketchedLink) -> None:
    """The vertical through the upper joint, and the arc of θ."""
    x, y = sketch.joint
    axis.plot([x, x], [y, y - 0.54], ls=MARKED, color=secondary_colour(), lw=1.0, zorder=1)
    degrees = np.sort([270.0, 270.0 + np.degrees(sketch.tilt)])
    axis.add_patch(
        Arc((x, y), 2 * ARROW, 2 * ARROW, theta1=degrees[0], theta2=degrees[1], color=ink(), lw=1.2, zorder=2)
    )
    half = sketch.tilt / 2
    symbol = rf"\theta_{{{sketch.number}}}" if sketch.number else r"\theta"
    _say(axis, symbol, x + (ARROW + 0.14) * np.sin(half), y - (ARROW + 0.14) * np.cos(half))


def _in_space() -> Figure:
    """One link from a pivot, with the polar angle θ from the vertical and the azimuth φ around it."""
    figure, axis = _sheet(-0.9, 1.4, -1.85, 0.75)

    def projection(radius: Any, theta: Any, phi: Any) -> Floats:
        depth_part, depth = np.sin(theta) * np.sin(phi), np.cos(theta)
        return np.asarray(
            radius * np.array([np.sin(theta) * np.cos(phi) + OBLIQUE[0] * depth_part, OBLIQUE[1] * depth_part - depth])
        )

    ends = {"x": projection(1.1, np.pi / 2, 0), "y": projection(1.1, np.pi / 2, np.pi / 2), "z": projection(1.55, 0, 0)}
    for symbol, tip in ends.items():
        _arrow(axis, (0.0, 0.0), tip, secondary_colour())
        _say(axis, symbol, *(tip * (1 + 0.12 / np.hypot(*tip))))
    theta, phi = np.radians(48), np.radians(42)
    tip, foot = projection(1.0, theta, phi), np.array([0, -np.cos(theta)])
    axis.plot(*np.transpose([(0, 0), tip]), color=colour(0), lw=1.8, zorder=3)
    axis.plot(*tip, "o", ms=13, color=colour(0), mec=paper(), mew=0.8, zorder=4)
    _say(axis, "l", *(0.55 * tip + (0.1, 0.1)))
    _arrow(axis, tip, tip - (0, ARROW), colour(4))
    _say(axis, "m g", tip[0] + 0.2, tip[1] - ARROW + 0.06, color=colour(4))
    axis.plot(*np.transpose([foot, tip]), ls=MARKED, color=secondary_colour(), lw=1.0)
    axis.plot(*np.transpose([foot, foot + np.array([0.75, 0])]), ls=MARKED, color=secondary_colour(), lw=1.0)
    lean, turn = np.linspace(0, theta, 30), np.linspace(0, phi, 30)
    axis.plot(*projection(ARROW, lean, phi), color=ink(), lw=1.2)
    _say(axis, r"\theta", *projection(ARROW + 0.14, theta / 2, phi))
    axis.plot(*(foot[:, None] + projection(0.5, np.pi / 2, turn)), color=ink(), lw=1.2)
    _say(axis, r"\varphi", *(foot + np.array([0.62, -0.12])))
    return figure
