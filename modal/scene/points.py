"""Points of a scene by name, where forces act and springs end: of a support, of the ground, or of a link.

    cart                              the cart
    left, left@0.2,0.1                a support by its name, there its origin, or 0.2 m along and 0.1 m below it
    frame[3]                          a point of a modal support
    ground, ground@1.0,0.5            the ground: below the other end, or at a place (m along, m down)
    pendulum[0].links[1]              the centre of mass of a link; under a torque its upper joint
    pendulum[0].links[1]@0.5          0.5 m below its upper joint
    pendulum[0].copies[3].links[1]    of one copy; without `copies` of every copy

An entry of `links` with a `count` names all of its links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from modal.errors import spelling_hint
from modal.scene.features import Described
from modal.scene.validation import NUMBER_SIZE_MAX

CART = "cart"
WRITTEN = re.compile(
    r"pendulum\[(?P<pendulum>[0-9]{1,9})\](?:\.copies\[(?P<copy>[0-9]{1,9})\])?"
    r"\.links\[(?P<link>[0-9]{1,9})\](?:@(?P<below>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?))?",
    re.ASCII,
)
NUMBER = r"[+-]?[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?"
PLACED = re.compile(
    rf"(?P<name>[A-Za-z0-9_]+)(?:\[(?P<point>[0-9]{{1,9}})\])?(?:@(?P<along>{NUMBER}),(?P<below>{NUMBER}))?", re.ASCII
)
GROUND = "ground"
EXAMPLE = '"cart", "NAME@0.2,0.1" of a support or "pendulum[0].links[1]@0.5"'


class PendulumPoint(NamedTuple):
    """A point of links: `pendulum` and `link` index the entries of a scene, `copy` one of the copies (None: all).

    `below` (m) is the distance from the upper joint, None for the centre of mass.
    """

    pendulum: int
    link: int
    copy: int | None = None
    below: float | None = None


class CarrierPoint(NamedTuple):
    """A point of the support of a `name`: `place` (m) along and below its origin, or the `point` of a modal one."""

    name: str
    place: tuple[float, float] = (0.0, 0.0)
    point: int | None = None


class GroundPoint(NamedTuple):
    """A point of the ground, `place` (m) along and down; None: at the other end of a spring, as drawn."""

    place: tuple[float, float] | None = None


class Place(NamedTuple):
    """A point of one link: the `link` in the order of the file, counting copies, and the distance `below` (m).

    `above` is the link from which it hangs, −1 for the support.
    """

    link: int
    above: int
    below: float | None


Where = tuple[Any, Any] | int
"""A point of a support: (s, h) in m from its origin, or the number of a point of a modal one."""


class LinkEnd(NamedTuple):
    """A point of a link, `link` in the order of the file, `below` (m) its upper joint (None: its centre of mass)."""

    link: int
    below: Any


class CarrierEnd(NamedTuple):
    """A point of a support by its index."""

    carrier: int
    where: Where


class GroundEnd(NamedTuple):
    """A point of the ground (m along, m down); None: at the other end as drawn."""

    place: tuple[Any, Any] | None


End = LinkEnd | CarrierEnd | GroundEnd


def parse_point(text: str) -> PendulumPoint | CarrierPoint | GroundPoint | None:
    """Return the point that a text names, None for the cart; raise ValueError for any other text.

    >>> parse_point("pendulum[0].links[1]@0.5")
    PendulumPoint(pendulum=0, link=1, copy=None, below=0.5)
    """
    if text == CART:
        return None
    match = WRITTEN.fullmatch(text)
    if match is None:
        return _parse_carrier_point(text)
    copy, distance = match["copy"], match["below"]
    where = int(match["pendulum"]), int(match["link"])
    return PendulumPoint(*where, None if copy is None else int(copy), None if distance is None else float(distance))


def _parse_carrier_point(text: str) -> CarrierPoint | GroundPoint:
    """A point of a support or of the ground."""
    match = PLACED.fullmatch(text)
    if match is None or match["name"] == "pendulum":
        raise ValueError(f"is not a point such as {EXAMPLE}")
    place = None if match["along"] is None else (float(match["along"]), float(match["below"]))
    if place and max(map(abs, place)) > NUMBER_SIZE_MAX:
        raise ValueError(f"a place is at most {NUMBER_SIZE_MAX:g} m away")
    if match["name"] == GROUND:
        if match["point"] is not None:
            raise ValueError("the ground has no numbered points: write ground@x,z")
        return GroundPoint(place)
    if match["point"] is not None:
        if place is not None:
            raise ValueError("a numbered point of a support has no place beside its number")
        return CarrierPoint(match["name"], point=int(match["point"]))
    return CarrierPoint(match["name"], place or (0.0, 0.0))


def point_problems(scene: Described, text: str) -> Iterator[str]:
    """Return why a scene has no such point."""
    point = parse_point(text)
    if point is None:
        kinds = [support.kind for support in scene.supports]
        if len(kinds) > 1:
            yield f"there are several supports: write the name of one{spelling_hint(text, scene.support_names)}"
        elif kinds[0] != CART:
            yield f'the support is {kinds[0]}, and there is no cart: give it kind = "cart", or name a link'
        return
    if isinstance(point, CarrierPoint):
        yield from _carrier_problems(scene, point)
    if not isinstance(point, PendulumPoint):
        return
    if point.pendulum >= len(scene.pendulum):
        yield f"the scene has {len(scene.pendulum)} entries of pendulum, numbered from 0"
        return
    pendulum = scene.pendulum[point.pendulum]
    if point.copy is not None and point.copy >= pendulum.count:
        yield f"pendulum[{point.pendulum}] has count = {pendulum.count}, and its copies are numbered from 0"
    if point.link >= len(pendulum.links):
        yield f"pendulum[{point.pendulum}] has {len(pendulum.links)} entries of links, numbered from 0"
        return
    link = pendulum.links[point.link]
    reach = max(link.length, link.centre)
    if point.below is not None and link.hoist:
        yield "the length of this rope changes: leave out @, and the force acts on its bob"
    elif point.below is not None and point.below > reach:
        yield f"the link reaches {reach:g} m below its upper joint"


def _carrier_problems(scene: Described, point: CarrierPoint) -> Iterator[str]:
    """Why a scene has no such point of a support."""
    names = scene.support_names
    if point.name not in names:
        yield f'there is no support "{point.name}"{spelling_hint(point.name, names)}'
        return
    support = scene.supports[names.index(point.name)]
    if support.kind == "modal" and point.point is None:
        yield f"a modal support has numbered points: write {point.name}[0]"
    elif support.kind != "modal" and point.point is not None:
        yield f"only a modal support has numbered points: write {point.name}@s,h"
    elif support.kind == "modal" and (point.point or 0) >= len(support.points):
        yield f'support "{point.name}" has {len(support.points)} points, numbered from 0'


def point_text(text: str) -> str:
    """Return a text that denotes a point; raise ValueError for any other."""
    parse_point(text)
    return text


def points_at(scene: Described, text: str) -> int:
    """Return the number of points that a name denotes: one for every copy and every link of a run."""
    point = parse_point(text)
    if not isinstance(point, PendulumPoint):
        return 1
    pendulum = scene.pendulum[point.pendulum]
    return int(pendulum.links[point.link].count * (pendulum.count if point.copy is None else 1))


def places_of(scene: Described, text: str) -> list[Place]:
    """Return every link on which a point lies; none for points of supports."""
    point = parse_point(text)
    if not isinstance(point, PendulumPoint):
        return []
    n_before = sum(earlier.n_links * earlier.count for earlier in scene.pendulum[: point.pendulum])
    pendulum = scene.pendulum[point.pendulum]
    first = sum(link.count for link in pendulum.links[: point.link])
    copies = range(pendulum.count) if point.copy is None else [point.copy]
    return [
        Place(top + first + k, top + first + k - 1 if first + k else -1, point.below)
        for top in (n_before + copy * pendulum.n_links for copy in copies)
        for k in range(pendulum.links[point.link].count)
    ]


def hanging_points(scene: Described) -> list[CarrierEnd]:
    """Return the point from which every pendulum hangs, counting copies; those of one entry share one end."""
    numbers, ends = _numbers(scene), list[CarrierEnd]()
    for pendulum in scene.pendulum:
        point = None if pendulum.on is None else parse_point(pendulum.on)
        carrier, where = 0, pendulum.position
        if isinstance(point, CarrierPoint):
            carrier, where = numbers[point.name], where if point.point is None else point.point
        ends += [CarrierEnd(carrier, where)] * pendulum.count
    return ends


def joined_points(scene: Described) -> Iterator[tuple[int, tuple[End, End]]]:
    """Return the entry and both ends of every spring, those of copies one after another."""
    numbers = _numbers(scene)
    for entry, spring in enumerate(scene.spring):
        ends = [_ends(scene, text, numbers) for text in spring.between]
        count = max(map(len, ends))
        for a, b in zip(*(end * (count if len(end) == 1 else 1) for end in ends), strict=True):
            yield entry, (a, b)


def carrier_end(scene: Described, text: str) -> CarrierEnd | None:
    """Return the point of a support that a text names, None for any other point."""
    ends = _ends(scene, text, _numbers(scene))
    return ends[0] if len(ends) == 1 and isinstance(ends[0], CarrierEnd) else None


def _numbers(scene: Described) -> dict[str, int]:
    """The index of every support by its name."""
    return {name: index for index, name in enumerate(scene.support_names)}


def _ends(scene: Described, text: str, numbers: dict[str, int]) -> list[End]:
    """All points that the name of one end of a spring means: one, or one of every copy."""
    point = parse_point(text)
    if point is None:
        return [CarrierEnd(0, (0.0, 0.0))]
    if isinstance(point, GroundPoint):
        return [GroundEnd(point.place)]
    if isinstance(point, CarrierPoint):
        return [CarrierEnd(numbers[point.name], point.place if point.point is None else point.point)]
    return [LinkEnd(place.link, place.below) for place in places_of(scene, text)]
