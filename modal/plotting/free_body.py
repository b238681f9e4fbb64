"""Free-body diagrams: every part of a scene with its weight, the forces and moments of its joints, and its inertia.

Paper 000, figures 2 and 4 to 7: the whole scene with the forces from outside, the cart with its wheels, each pendulum
as a whole, and each link.  Diagrams are lists of strokes and letters, drawn by matplotlib, or as TikZ, whose text
LaTeX sets.

A diagram of a part says "these forces = mass times acceleration": on the left the part with all that acts on it, each
arrow in the direction in which its letter is positive, and on the right what they cause.  What a joint exerts on one
part it exerts reversed on the other, so the same letter stands at both with the arrow turned round.  Which force acts
where is read from `modal.scene.free_body`.  Shapes and angles are not to scale.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, radians, sin
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from modal.errors import SceneError
from modal.plotting.layout import SMALL, caption, headline
from modal.plotting.style import HEAD, QUIET, colour, ink, mixture, paper, secondary_colour, sheet, theme
from modal.scene import FreeBodies, FreeBody, Scene, free_bodies, title_of
from modal.scene.doors import checked
from modal.scene.free_body import Effort, normal

MOST_PARTS = 12
"""Format: most parts that are drawn where none are chosen."""
MOST_AT_ONCE = 120
"""Limit: parts of one picture: "one picture has room for 120"."""
MOST_PENDULA = 3
"""Format: most pendula that are drawn on their support."""
LINK_INCHES = 0.96
"""Format: inches of a link, which is the unit of all lengths below."""
TILTS = tuple(map(radians, (32.0, 52.0, 24.0, 42.0)))
"""The angles of the links of a pendulum that is drawn as a whole; longer chains are not."""
TILT = TILTS[0]
TOP = np.array([-0.32, 0.5])
ARROW = 0.4
"""Format: length of the arrow of a force."""
BOB = 0.1
"""Format: radius of bobs and wheels."""
LEFT_EDGE = -1.3
"""Format: left edge of a diagram, about the joint of its part."""
RIGHT_EDGE = 3.1
"""Format: right edge of a diagram."""
HIGH = 1.2
"""Format: half the height of a diagram."""
BESIDE = LEFT_EDGE + RIGHT_EDGE
"""From a part to what its forces cause, so that the two stand in the middles of the diagram's halves."""
TALL = 0.3
"""Format: height of a cart, and of the pins above its middle."""
LOOKS = ("body", "faint", "force", "joint", "inertia", "guide", "ink")
SIZES = {"body": 5.0, "wire": 1.6, "faint": 3.0, "arrow": 1.4, "guide": 0.9}


class Stroke(NamedTuple):
    """A line, an arrow, a disc or a box through points, by one of LOOKS; `width` in points.

    The points of a disc are its centre and one at its edge, those of a box two opposite corners.
    """

    kind: str
    points: tuple[tuple[float, float], ...]
    look: str
    width: float = SIZES["arrow"]
    is_dashed: bool = False


class Lettering(NamedTuple):
    """Words or a formula of LaTeX at a place, centred or to its left or right."""

    text: str
    x: float
    y: float
    look: str = "ink"
    side: str = "center"


@dataclass(frozen=True)
class Diagram:
    """The strokes and the words of one part, in this many columns of the sheet; `title` is above it."""

    title: str
    strokes: tuple[Stroke, ...]
    words: tuple[Lettering, ...]
    columns: int = 1


def diagrams(bodies: FreeBodies, parts: str = "") -> tuple[list[Diagram], str]:
    """Return the diagrams that are drawn, and notes on those that are not.

    Raise SceneError if `parts` is none of "3" and "1:8" within the parts of the scene.
    """
    total = len(bodies.parts)
    numbers = _chosen(parts, total) if parts else range(min(total, MOST_PARTS))
    pendula = bodies.pendula
    pictures: list[Diagram] = []
    if not parts and bodies.support.kind == "cart" and _fits(pendula):
        pictures.append(_whole_scene(bodies))
    for number in numbers:
        part = bodies.parts[number]
        if part.link is None:
            pictures.append(_cart(bodies) if part.kind == "cart" else _standing(bodies))
            continue
        chain = pendula[part.place[0]]
        if not parts and part.place[1] == 0 and 1 < len(chain) <= len(TILTS):
            pictures.append(_pendulum(chain))
        pictures.append(_link(bodies, part))
    note = f" {len(numbers)} of {total} parts are drawn." if len(numbers) < total else ""
    return pictures, note


def _fits(pendula: list[list[FreeBody]]) -> bool:
    return len(pendula) <= MOST_PENDULA and max(map(len, pendula)) <= len(TILTS)


def _chosen(parts: str, total: int) -> range:
    first, colon, last = parts.partition(":")
    try:
        low = int(first) if first or not colon else 1
        high = (int(last) if last else total) if colon else low
    except ValueError:
        raise SceneError([f"parts {parts}: must be a number or a range such as 1:8"]) from None
    if not 1 <= low <= high <= total:
        raise SceneError([f"parts {parts}: the scene has parts 1 to {total}, the support first"])
    if high - low >= MOST_AT_ONCE:
        raise SceneError([f"parts {parts}: one picture has room for {MOST_AT_ONCE}"])
    return range(low - 1, high)


# -------------------------------------------------------------------------------------------------------- letters


def in_latex(name: str, letters: str = "own") -> str:
    r"""The LaTeX of a letter by its name, `R_Bx_1` as R_{Bx,1}; of a product of two, one after the other.

    >>> in_latex("m_1_2 g")
    'm_{1,2}\\,g'
    """
    return r"\,".join(_letter(letter, letters) for letter in name.split())


def _letter(name: str, letters: str) -> str:
    letter, *index = name.split("_")
    if letter == "l" and letters == "paper":
        letter = r"\ell"
    if letter == "theta":
        letter = r"\theta"
    return f"{letter}_{{{','.join(index)}}}" if index else letter


def _second_derivative(letter: str, index: Sequence[int]) -> str:
    tail = f"_{{{','.join(map(str, index))}}}" if index else ""
    return rf"\ddot{{{letter}}}{tail}"


def _inertia(bodies: FreeBodies, part: FreeBody) -> str:
    """The rotational inertia of a link: I of a body, ⅓ m (l/2)² of a rod as paper 000 writes it, or m l²/12."""
    if part.kind == "body":
        return in_latex(part.inertia)
    m, l = in_latex(part.mass), in_latex(part.length, bodies.letters)
    if bodies.letters == "paper":
        return rf"\frac{{1}}{{3}}{m}\left(\frac{{{l}}}{{2}}\right)^2"
    return rf"\frac{{1}}{{12}}{m}\,{l}^2"


# -------------------------------------------------------------------------------------------------------- strokes


def _line(start: Any, end: Any, look: str, width: float, is_dashed: bool = False) -> Stroke:
    return Stroke("line", (point(start), point(end)), look, width, is_dashed)


def _shaft(start: Any, end: Any, look: str) -> Stroke:
    """A straight arrow."""
    return Stroke("arrow", (point(start), point(end)), look)


def _round(kind: str, centre: Any, radius: float, look: str = "ink", width: float = SIZES["arrow"]) -> Stroke:
    """A disc, a ring or a wheel."""
    return Stroke(kind, (point(centre), point(np.add(centre, (radius, 0)))), look, width)


def _formula(text: str, place: Any, look: str = "ink", side: str = "center") -> Lettering:
    return Lettering(f"${text}$", *point(place), look, side)


def _way(angle: float, length: float = 1.0) -> Any:
    """The vector of this length at an angle from the right."""
    return length * np.array([cos(angle), sin(angle)])


def point(place: Any) -> tuple[float, float]:
    """A place as two floats."""
    return float(place[0]), float(place[1])


def _force(place: Any, shaft: Any, positive: bool, text: str, look: str) -> Iterator[Stroke | Lettering]:
    """An arrow whose shaft lies on one side of a place: into it, or out of it; its label at the far end.

    `shaft` is the unit vector from the place to the far end; the arrow points outwards where `positive`.
    """
    ends = place + BOB / 2 * shaft, place + (BOB / 2 + ARROW) * shaft
    yield _shaft(*(ends if positive else ends[::-1]), look)
    side = "center" if abs(shaft[0]) <= 0.5 else "right" if shaft[0] > 0 else "left"
    yield _formula(text, ends[1] + shaft * (0.06 if abs(shaft[0]) > 0.5 else 0.13), look, side)


def _turn(
    place: Any, begin: float, end: float, positive: bool, text: str, look: str, radius: float = ARROW / 2
) -> Iterator[Stroke | Lettering]:
    """A curved arrow about a place from one angle (degrees) to another, turned round where it is not positive."""
    points = [point(place + _way(a, radius)) for a in np.radians(np.linspace(begin, end, 25))]
    yield Stroke("arrow", tuple(points if positive else points[::-1]), look)
    middle = radians((begin + end) / 2)
    yield _formula(text, place + _way(middle, radius + 0.08), look, "right" if cos(middle) > 0 else "left")


def _joint(place: Any, effort: Effort) -> Iterator[Stroke | Lettering]:
    """The load of a joint on the part below it or on its pin: a moment, or forces above and to the left."""
    if effort.turning:
        yield from _turn(place, -42.0, 75.0, effort.sign > 0, in_latex(effort.turning), "joint")
        return
    yield from _force(place, np.array([0.0, 1.0]), effort.sign < 0, in_latex(effort.down), "joint")
    yield from _force(place, np.array([-1.0, 0.0]), effort.sign < 0, in_latex(effort.along), "joint")


def _diagram(title: str, pieces: Sequence[Stroke | Lettering], columns: int = 1) -> Diagram:
    strokes = tuple(piece for piece in pieces if isinstance(piece, Stroke))
    return Diagram(title, strokes, tuple(piece for piece in pieces if isinstance(piece, Lettering)), columns)


def _bar(part: FreeBody, joint: Any, end: Any, look: str = "body") -> Iterator[Stroke]:
    """A link from its upper to its lower end, a bob at that of a wire, and the open circle of its joint."""
    yield _line(joint, end, look, SIZES["wire" if part.kind == "bob" else look])
    if part.kind == "bob":
        yield _round("disc", end, BOB, look)
    if look != "faint":
        yield _round("ring", joint, 0.045, width=1.0)


# ------------------------------------------------------------------------------------------------------- each part


def _link(bodies: FreeBodies, part: FreeBody) -> Diagram:
    """One link: the forces on it, and to the right their effect."""
    link: Any = part.link
    way, normal_direction, share = -_way(TILT + pi / 2), _way(TILT), min(link.centre / link.length, 1.25)
    end, centre = TOP + way, TOP + share * way
    pieces: list[Stroke | Lettering] = [*_bar(part, TOP, end), *_leaning(part)]
    if bodies.of(part):
        pieces.append(_round("ring", end, 0.045, width=1.0))
    if part.kind != "bob":
        pieces.append(_round("disc", centre, 0.035))
    at = TOP + (0.48 if part.kind == "bob" else 0.74) * way + 0.13 * normal_direction
    pieces.append(_formula(in_latex(part.length, bodies.letters), at, "ink", "right"))
    for effort in part.efforts:
        pieces += _effort(part, effort, centre, end, normal_direction)
    pieces += _caused_motion(bodies, part, way, share)
    return _diagram(part.words, pieces)


def _leaning(part: FreeBody) -> Iterator[Stroke | Lettering]:
    """The vertical below the upper joint and the angle of the link."""
    yield _line(TOP, TOP - (0, 0.52), "guide", SIZES["guide"], is_dashed=True)
    points = tuple(point(TOP + _way(a, 0.3)) for a in np.linspace(-pi / 2, TILT - pi / 2, 15))
    yield Stroke("line", points, "guide", SIZES["guide"])
    yield _formula(in_latex("_".join(("theta", *map(str, part.index)))), TOP - (0.06, 0.34), "ink", "left")


def _effort(
    part: FreeBody, effort: Effort, centre: Any, end: Any, normal_direction: Any
) -> Iterator[Stroke | Lettering]:
    """Arrows of the forces on a link, shafts above and left of its upper joint, below and right of the lower one."""
    bob = part.kind == "bob"
    if effort.kind == "weight":
        low = centre - (0.07 * bob, BOB / 2 * bob)
        yield _shaft(low, low - (0, 0.4), "force")
        yield _formula(in_latex(effort.down), low - (0.09, 0.3), "force", "left")
    elif effort.kind == "drag":
        yield from _oblique(part, centre, normal_direction, 0.62)
    elif effort.kind == "applied":
        yield from _applied_force(part, effort, centre, end)
    elif effort.at == "upper":
        yield from _joint(TOP, effort)
    elif effort.turning:
        begin, stop = (135.0, 215.0) if bob else (145.0, 250.0)
        yield from _turn(end, begin, stop, effort.sign > 0, in_latex(effort.turning), "joint")
    else:
        low, out = end - (-0.07 * bob, BOB / 2 * bob), end - (-BOB / 2 * bob, 0.0)
        yield from _force(low, np.array([0.0, -1.0]), effort.sign > 0, in_latex(effort.down), "joint")
        yield from _force(out, np.array([1.0, 0.0]), effort.sign > 0, in_latex(effort.along), "joint")


def _oblique(part: FreeBody, centre: Any, direction: Any, length: float) -> Iterator[Stroke | Lettering]:
    """The drag on a link as one arrow."""
    tip = centre + length * direction
    yield _shaft(centre + 0.1 * direction if part.kind == "bob" else centre, tip, "force")
    yield _formula(in_latex("_".join(("D", *map(str, part.index)))), tip + 0.05 * direction, "force", "right")


def _applied_force(part: FreeBody, effort: Effort, centre: Any, end: Any) -> Iterator[Stroke | Lettering]:
    """A force of the scene, to the right or up from its point, or a torque around a joint or the centre."""
    link: Any = part.link
    if effort.turning:
        place = {"upper": TOP, "lower": end}.get(effort.at, centre)
        first, last = (-38.0, 60.0) if effort.at != "lower" else (150.0, 240.0)
        yield from _turn(place, first, last, effort.sign > 0, in_latex(effort.turning), "force", radius=0.38)
        return
    share = effort.below / link.length if effort.at == "point" else None
    place = centre if share is None else TOP + min(share, 1.25) * (end - TOP)
    shaft = np.array([1.0, 0.0]) if effort.along else np.array([0.0, 1.0])
    yield from _push(effort, place + (BOB if part.kind == "bob" and share is None else 0.0) * shaft, ARROW * shaft)


def _push(effort: Effort, place: Any, shaft: Any) -> Iterator[Stroke | Lettering]:
    """The arrow of a force of the scene to the right or up, its label at its tip."""
    yield _shaft(place, place + shaft, "force")
    at = place + shaft + (0.06, 0.0 if effort.along else -0.1)
    yield _formula(in_latex(effort.along or effort.down), at, "force", "right")


def _caused_motion(bodies: FreeBodies, part: FreeBody, way: Any, share: float) -> Iterator[Stroke | Lettering]:
    """The same link with mass times acceleration at its centre, and inertia times angular acceleration."""
    top = np.add(TOP, (BESIDE, 0))
    centre = top + share * way
    yield Lettering("$=$", BESIDE - 0.78, 0.66)
    yield from _bar(part, top, top + way, "faint")
    yield from _accelerating(bodies, part, centre)
    if part.kind == "body":
        start, end = top - _way(TILT, 0.09), centre - _way(TILT, 0.09)
        yield Stroke("measure", (point(start), point(end)), "guide", SIZES["guide"])
        yield _formula(in_latex(part.centre), (start + end) / 2 - _way(TILT, 0.06), "ink", "left")
    if part.kind != "bob":
        text = _inertia(bodies, part) + r"\," + _second_derivative(r"\theta", part.index)
        points = tuple(point(centre + _way(a, 0.3)) for a in np.radians(np.linspace(18, 108, 20)))
        yield Stroke("arrow", points, "inertia")
        yield _formula(text, np.add(centre, (0.34, 0.33)), "inertia", "right")


def _accelerating(bodies: FreeBodies, part: FreeBody, centre: Any) -> Iterator[Stroke | Lettering]:
    m, right, low = in_latex(part.mass), np.add(centre, (ARROW, 0)), centre - (0, ARROW)
    yield _shaft(centre, right, "inertia")
    yield _formula(rf"{m}\,{_second_derivative('x', part.index)}", np.add(right, (0.05, 0)), "inertia", "right")
    yield _shaft(centre, low, "inertia")
    yield _formula(rf"{m}\,{_second_derivative(bodies.downward, part.index)}", low - (0, 0.15), "inertia")


def _pins(bodies: FreeBodies) -> tuple[list[int], list[float]]:
    """The pendula whose joints are drawn on the support, at most three, and their places along it."""
    total = len(bodies.pendula)
    numbers = list(range(total)) if total <= MOST_PENDULA else [0, 1, total - 1]
    spacing = 1.2 + 0.6 * any(effort.turning for effort in bodies.support.efforts)
    return numbers, [spacing * (k - (len(numbers) - 1) / 2) for k in range(len(numbers))]


def _on_pins(bodies: FreeBodies, height: float) -> Iterator[Stroke | Lettering]:
    """The loads of the first links on their pins: forces above and to the left, moments to the right."""
    numbers, places = _pins(bodies)
    for p, x in zip(numbers, places, strict=True):
        pin = np.array([x, height])
        for effort in (acting for acting in bodies.support.efforts if acting.at == "support" and acting.pendulum == p):
            if effort.kind == "applied":
                yield from _turn(pin, -38.0, 60.0, effort.sign > 0, in_latex(effort.turning), "force", radius=0.38)
            elif effort.kind == "joint":
                yield from _joint(pin, effort)
        yield _round("ring", pin, 0.045, width=1.0)
    if len(numbers) < len(bodies.pendula):
        yield Lettering(r"$\ldots$", (places[1] + places[2]) / 2, height)


def _cart(bodies: FreeBodies) -> Diagram:
    """The cart on its wheels: weight, normal forces, the joints of the first links, a spring's or a damper's force."""
    _, places = _pins(bodies)
    half = places[-1] + 0.75
    pieces: list[Stroke | Lettering] = [*_brackets(places, TALL / 2), *_box(half), *_on_pins(bodies, TALL)]
    for k, x in enumerate((-half + 0.2, half - 0.2)):
        wheel = np.array([x, -TALL / 2 - BOB])
        R = rf"{normal(bodies.letters)}_{{{k + 1}}}"
        pieces += _force(wheel - np.array([0, BOB]), np.array([0.0, -1.0]), False, R, "force")
    pieces += [_shaft((0, 0), (0, -0.55), "force"), _round("disc", (0, 0), 0.035)]
    pieces.append(_formula(in_latex("m_c g"), (0, -0.7), "force"))
    pieces += _on_cart(bodies, half, 0.0)
    ghost_place = half + 1.55
    pieces.append(Lettering("$=$", half + 0.85, 0.4))
    ghost = [_shift(piece._replace(look="faint"), ghost_place) for piece in _box(0.45)]
    pieces += [*ghost, *_accelerating(bodies, bodies.support, np.array([ghost_place, 0.0]))]
    middle = (LEFT_EDGE + RIGHT_EDGE) / 2 - (ghost_place + 0.9 - half) / 2
    return _diagram("cart", [_shift(piece, middle) for piece in pieces], 2)


def _on_cart(bodies: FreeBodies, right: float, height: float) -> Iterator[Stroke | Lettering]:
    """Forces on the cart along the rail, drawn at its right end: H of its spring and damper, forces of the scene."""
    names = [effort.along for effort in bodies.support.efforts if effort.kind in {"held", "applied"} and effort.along]
    for k, name in enumerate(names):
        place = np.array([right, height + 0.2 * (k - (len(names) - 1) / 2)])
        yield from _force(place, np.array([1.0, 0.0]), True, in_latex(name), "force")


def _box(half: float, middle: float = 0.0) -> list[Stroke | Lettering]:
    """A cart so long to each side of its middle."""
    wheels = (middle - half + 0.2, middle + half - 0.2)
    box = Stroke("box", ((middle - half, -TALL / 2), (middle + half, TALL / 2)), "ink", 1.3)
    return [box, *(_round("wheel", (x, -TALL / 2 - BOB), BOB, width=1.3) for x in wheels)]


def _shift(piece: Stroke | Lettering, across_shift: float, up: float = 0.0) -> Stroke | Lettering:
    if isinstance(piece, Lettering):
        return piece._replace(x=piece.x + across_shift, y=piece.y + up)
    return piece._replace(points=tuple((x + across_shift, y + up) for x, y in piece.points))


def _standing(bodies: FreeBodies) -> Diagram:
    """A support that stands still or moves as prescribed, with what the first links exert on it."""
    _, places = _pins(bodies)
    left, right = places[0] - 0.6, places[-1] + 0.6
    pieces: list[Stroke | Lettering] = [_line((left, 0.0), (right, 0.0), "ink", 2.4)]
    for foot in np.arange(left + 0.08, right, 0.1):
        pieces.append(_line((foot, 0.0), (foot - 0.08, -0.08), "guide", 0.8))
    pieces += _brackets(places, 0.0)
    pieces += _on_pins(bodies, TALL)
    is_fixed = bodies.support.kind == "fixed"
    words = "stands still: the ground holds it" if is_fixed else "moves as prescribed"
    pieces.append(Lettering(words, (left + right) / 2, -0.3))
    middle = (LEFT_EDGE + RIGHT_EDGE) / 2
    has_several = len(places) > 1
    return _diagram(bodies.support.words, [_shift(piece, middle) for piece in pieces], 2 if has_several else 1)


def _brackets(places: Sequence[float], low: float) -> Iterator[Stroke]:
    """The body that holds the pins."""
    for x in places:
        for side in (-0.1, 0.1):
            yield _line((x + side, low), (x, TALL), "guide", 1.2)


def _chain(chain: Sequence[FreeBody], top: Any, scale: float) -> tuple[list[Stroke | Lettering], list[Any], list[Any]]:
    """A pendulum from its first joint: its strokes, the centres and the lower joints of its links."""
    pieces: list[Stroke | Lettering] = []
    centres, joints, joint = [], [], np.asarray(top, dtype=float)
    for part, tilt in zip(chain, TILTS, strict=False):
        link: Any = part.link
        way = np.array([sin(tilt), -cos(tilt)])
        end = joint + scale * way
        pieces += _bar(part, joint, end)
        centres.append(joint + scale * min(link.centre / link.length, 1.2) * way)
        joints.append(end)
        joint = end
    return pieces, centres, joints


def _weights(chain: Sequence[FreeBody], centres: Sequence[Any], lean: float = TILT) -> Iterator[Stroke | Lettering]:
    """Weights and forces from outside on a pendulum, arrows of drag so far above the horizontal."""
    for part, centre in zip(chain, centres, strict=True):
        low = centre - (0, 0.38)
        yield _round("disc", centre, 0.03)
        yield _shaft(centre, low, "force")
        yield _formula(in_latex(f"{part.mass} g"), low - (0.08, -0.08), "force", "left")
        for effort in part.efforts:
            if effort.kind == "drag":
                yield from _oblique(part, centre, _way(lean), 0.32 if lean == TILT else 0.5)
            elif effort.kind == "applied" and not effort.turning:
                yield from _push(effort, centre, np.array([ARROW, 0.0]) if effort.along else np.array([0.0, 0.36]))


def _pendulum(chain: Sequence[FreeBody]) -> Diagram:
    """A pendulum as a whole: weights, and what its first joint exerts."""
    scale = min(0.85, 1.2 / sum(cos(tilt) for tilt in TILTS[: len(chain)]))
    top = np.array([0.3, 0.62])
    pieces, centres, _ = _chain(chain, top, scale)
    first = chain[0]
    for effort in (acting for acting in first.efforts if acting.at == "upper"):
        pieces += _joint(top, effort)
    has_push = any(acting.kind == "applied" and acting.along for part in chain for acting in part.efforts)
    pieces += _weights(chain, centres, TILT if has_push else radians(5.0))
    return _diagram(f"pendulum {first.place[0] + 1}", pieces)


def _whole_scene(bodies: FreeBodies) -> Diagram:
    """The cart with its pendula: the forces from outside alone."""
    pendula = bodies.pendula
    longest = max(map(len, pendula))
    scale = min(0.62, 1.3 / sum(cos(tilt) for tilt in TILTS[:longest]))
    reach = scale * sum(sin(tilt) for tilt in TILTS[:longest])
    has_forces = any(effort.kind in {"drag", "applied"} for part in bodies.parts[1:] for effort in part.efforts)
    places = [(reach + (1.0 if has_forces else 0.5)) * k for k in range(len(pendula))]
    left, right, high = -1.3, places[-1] + reach + (1.0 if has_forces else 0.6), 0.85
    pieces: list[Stroke | Lettering] = [
        _shift(piece, 0.0, high) for piece in _box((right - left) / 2, (left + right) / 2)
    ]
    for chain, x in zip(pendula, places, strict=True):
        links, centres, _ = _chain(chain, (x, high), scale)
        pieces += [*links, *_weights(chain, centres)]
    for k, x in enumerate((left + 0.2, right - 0.2)):
        wheel = np.array([x, high - TALL / 2 - 2 * BOB])
        R = rf"{normal(bodies.letters)}_{{{k + 1}}}"
        pieces += _force(wheel, np.array([0.0, -1.0]), False, R, "force")
    pieces.append(_shaft((-0.76, high), (-0.76, high - 0.5), "force"))
    pieces.append(_formula(in_latex("m_c g"), (-0.76, high - 0.63), "force"))
    carriage = list(_on_cart(bodies, right, high))
    pieces += carriage
    middle = (LEFT_EDGE + RIGHT_EDGE) / 2 - (left + right) / 2 - 0.3 * bool(carriage)
    return _diagram(
        "whole scene",
        [_shift(piece, middle) for piece in pieces],
        1 if right - left + 0.6 * bool(carriage) < 4.3 else 2,
    )


COLUMNS = 3
"""Format: diagrams in a row."""

# ------------------------------------------------------------------------------------------------------- the door


@checked
def plot_free_body(scene: Scene, *, letters: str = "own", parts: str = "") -> Figure:
    """The free-body diagrams of a scene's parts, the support first, then link by link.

    `letters` are the toolkit's "own", or those of paper 000, "paper"; `parts` "1:8" chooses, counted from 1, else at
    most MOST_PARTS are drawn. Raise SceneError for scenes that are not taken apart, and for a wrong choice.

    >>> from modal import load
    >>> from modal.plotting import plot_free_body
    >>> figure = plot_free_body(load("paper-cart-1"), letters="paper")
    >>> [axis.get_title(loc="left") for axis in figure.axes]
    ['whole scene', 'cart', 'pendulum 1', 'link 1', 'link 2']
    """
    bodies = free_bodies(scene, letters)
    pictures, note = diagrams(bodies, parts)
    rows = _rows(pictures)
    width, height = RIGHT_EDGE - LEFT_EDGE, 2 * HIGH
    figure = sheet(LINK_INCHES * width * COLUMNS, LINK_INCHES * height * len(rows) + HEAD)
    grid = figure.add_gridspec(len(rows), COLUMNS)
    for k, row in enumerate(rows):
        at = 0
        for diagram in row:
            axis = figure.add_subplot(grid[k, at : at + diagram.columns])
            middle, half = (LEFT_EDGE + RIGHT_EDGE) / 2, width * diagram.columns / 2
            axis.set(xlim=(middle - half, middle + half), ylim=(-HIGH, HIGH), aspect="equal")
            axis.set_axis_off()
            axis.set_title(diagram.title, loc="left")
            for stroke in diagram.strokes:
                _draw(axis, stroke)
            for words in diagram.words:
                _write(axis, words)
            at += diagram.columns
    headline(figure, title_of(scene), "free-body diagrams")
    caption(figure, f"{_caption_words(bodies)}{note}")
    return figure


def free_body_tikz(scene: Scene, letters: str = "own", parts: str = "") -> str:
    r"""The same diagrams as a TikZ picture, as wide as a line of LaTeX's article, for a document with the package tikz.

    >>> from modal import load
    >>> print(free_body_tikz(load("chain-2")).splitlines()[0])
    \definecolor{fbbody}{HTML}{005F9E}
    """
    bodies = free_bodies(scene, letters)
    pictures, _ = diagrams(bodies, parts)
    with theme("light"):
        hues = {look: _hue(look).removeprefix("#").upper() for look in LOOKS}
    lines = [rf"\definecolor{{fb{look}}}{{HTML}}{{{hue}}}" for look, hue in hues.items()]
    unit = 10.9 / (2 * (RIGHT_EDGE - LEFT_EDGE))  # cm: two diagrams and their letters fill a line of the article class
    style = rf"x={unit:.3f}cm, y={unit:.3f}cm, line cap=round, >=stealth, font=\footnotesize"
    lines.append(rf"\begin{{tikzpicture}}[{style}]")
    for k, row in enumerate(_rows(pictures, 2)):
        at = 0
        for diagram in row:
            shift = (
                at * (RIGHT_EDGE - LEFT_EDGE) + (diagram.columns - 1) * (RIGHT_EDGE - LEFT_EDGE) / 2,
                -k * (2 * HIGH + 0.5),
            )
            lines.append(rf"\begin{{scope}}[shift={{({shift[0]:.3f},{shift[1]:.3f})}}]")
            lines.append(rf"\node[right] at ({LEFT_EDGE:.3f},{HIGH + 0.2:.3f}) {{{diagram.title}}};")
            lines += [_tikz(stroke) for stroke in diagram.strokes]
            lines += [
                rf"\node[{_ANCHORS[lettering.side]}inner sep=1pt, text=fb{lettering.look}] "
                rf"at ({lettering.x:.3f},{lettering.y:.3f}) {{{lettering.text}}};"
                for lettering in diagram.words
            ]
            lines.append(r"\end{scope}")
            at += diagram.columns
    return "\n".join([*lines, r"\end{tikzpicture}", ""])


_ANCHORS = {"center": "", "left": "anchor=east, ", "right": "anchor=west, "}


def _caption_words(bodies: FreeBodies) -> str:
    down = bodies.downward
    words = (
        f"x along the rail, {down} down. Green: joints, equal and opposite on the adjoining part; "
        f"red: forces from outside; pink: the mass times acceleration that they cause."
    )
    if bodies.support.kind == "cart":
        R = normal(bodies.letters)
        words += f" The wheels share {R} = {R}1 + {R}2."
    return words


def _rows(pictures: Sequence[Diagram], columns: int = COLUMNS) -> list[list[Diagram]]:
    """Diagrams in rows of this many columns; the links of a pendulum begin a row where they fit into one."""
    several = sum(diagram.title.startswith("pendulum") for diagram in pictures) > 1
    rows: list[list[Diagram]] = [[]]
    for diagram in pictures:
        begins = several and diagram.title.startswith("pendulum")
        if rows[-1] and (begins or sum(neighbour.columns for neighbour in rows[-1]) + diagram.columns > columns):
            rows.append([])
        rows[-1].append(diagram)
    return rows


# ------------------------------------------------------------------------------------------------- with matplotlib


def _hue(look: str) -> str:
    hues = {
        "body": colour(0),
        "faint": mixture(colour(0), 0.3),
        "force": colour(4),
        "joint": colour(2),
        "inertia": colour(3),
        "guide": secondary_colour(),
        "ink": ink(),
    }
    return hues[look]


def _draw(axis: Axes, stroke: Stroke) -> None:
    hue, points = _hue(stroke.look), stroke.points
    if stroke.kind == "line":
        dash = "--" if stroke.is_dashed else "-"
        faint: dict[str, Any] = {"gid": QUIET} if stroke.look == "faint" else {}
        axis.plot(*np.transpose(points), dash, color=hue, lw=stroke.width, solid_capstyle="round", zorder=3, **faint)
    elif stroke.kind in {"arrow", "measure"}:
        _arrow(axis, stroke, hue)
    elif stroke.kind == "box":
        (left, bottom), (right, top) = points
        face = mixture(ink(), 0.1) if stroke.look == "ink" else paper()
        box = Rectangle((left, bottom), right - left, top - bottom, fc=face, ec=hue, lw=stroke.width, zorder=2)
        axis.add_patch(box)
    else:
        (x, y), edge = points
        face = hue if stroke.kind == "disc" else paper()
        radius = hypot(edge[0] - x, edge[1] - y)
        order = 2.5 if stroke.kind == "wheel" else 6
        axis.add_patch(Circle((x, y), radius, fc=face, ec=hue, lw=stroke.width, zorder=order))


def _arrow(axis: Axes, stroke: Stroke, hue: str) -> None:
    """An arrow along its points, with the head at the last, of a measure at both ends."""
    points = np.array(stroke.points)
    if len(points) > 2:
        axis.plot(*points[:-2].T, color=hue, lw=stroke.width, zorder=5)
        points = points[-3:]
    look: dict[str, Any] = {"color": hue, "lw": stroke.width, "shrinkA": 0, "shrinkB": 0, "zorder": 5}
    style = "<->" if stroke.kind == "measure" else "-|>"
    start, end = point(points[0]), point(points[-1])
    axis.add_patch(FancyArrowPatch(start, end, arrowstyle=style, mutation_scale=10, **look))


def _write(axis: Axes, words: Lettering) -> None:
    side = {"left": "right", "right": "left"}.get(words.side, "center")
    size = "medium" if words.text.startswith("$") else SMALL
    axis.text(words.x, words.y, words.text, ha=side, va="center", color=_hue(words.look), fontsize=size, zorder=8)


# ------------------------------------------------------------------------------------------------------- with TikZ


def _tikz(stroke: Stroke) -> str:
    look, points = f"fb{stroke.look}", " -- ".join(f"({x:.3f},{y:.3f})" for x, y in stroke.points)
    width = f"line width={stroke.width:g}pt"
    if stroke.kind == "box":
        (left, bottom), (right, top) = stroke.points
        fill = "fill=fbink!10" if stroke.look == "ink" else "fill=white"
        return rf"\draw[{look}, {fill}, {width}] ({left:.3f},{bottom:.3f}) rectangle ({right:.3f},{top:.3f});"
    if stroke.kind in {"disc", "ring", "wheel"}:
        (x, y), edge = stroke.points
        fill = look if stroke.kind == "disc" else "white"
        return rf"\draw[{look}, fill={fill}, {width}] ({x:.3f},{y:.3f}) circle ({hypot(edge[0] - x, edge[1] - y):.3f});"
    line_style = {"arrow": ", ->", "measure": ", <->"}.get(stroke.kind, ", dashed" if stroke.is_dashed else "")
    return rf"\draw[{look}, {width}{line_style}] {points};"
