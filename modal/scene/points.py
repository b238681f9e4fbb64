"""Points of a scene by name, where forces act: the cart, or a point of a link.

    cart
    pendulum[0].links[1]              the centre of mass of a link; under a torque its upper joint
    pendulum[0].links[1]@0.5          0.5 m below its upper joint
    pendulum[0].copies[3].links[1]    of one copy; without `copies` of every copy

An entry of `links` with a `count` names all of its links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from modal.scene.features import Described

CART = "cart"
WRITTEN = re.compile(
    r"pendulum\[(?P<pendulum>[0-9]{1,9})\](?:\.copies\[(?P<copy>[0-9]{1,9})\])?"
    r"\.links\[(?P<link>[0-9]{1,9})\](?:@(?P<below>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?))?",
    re.ASCII,
)
EXAMPLE = '"cart" or "pendulum[0].links[1]@0.5"'


class Point(NamedTuple):
    """A point of links: `pendulum` and `link` index the entries of a scene, `copy` one of the copies (None: all).

    `below` (m) is the distance from the upper joint, None for the centre of mass.
    """

    pendulum: int
    link: int
    copy: int | None = None
    below: float | None = None


class Place(NamedTuple):
    """A point of one link: the `link` in the order of the file, counting copies, and the distance `below` (m).

    `above` is the link that it hangs from, −1 for the support.
    """

    link: int
    above: int
    below: float | None


def parse_point(text: str) -> Point | None:
    """The point that a text names, None for the cart; ValueError for any other text.

    >>> parse_point("pendulum[0].links[1]@0.5")
    Point(pendulum=0, link=1, copy=None, below=0.5)
    """
    if text == CART:
        return None
    written = WRITTEN.fullmatch(text)
    if written is None:
        raise ValueError(f"is not a point such as {EXAMPLE}")
    copy, below = written["copy"], written["below"]
    where = int(written["pendulum"]), int(written["link"])
    return Point(*where, None if copy is None else int(copy), None if below is None else float(below))


def point_problems(scene: Described, text: str) -> Iterator[str]:
    """Why a scene has no such point."""
    point = parse_point(text)
    if point is None:
        if scene.support.kind != CART:
            yield f'the support is {scene.support.kind}, and there is no cart: give it kind = "cart", or name a link'
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


def places_of(scene: Described, text: str) -> list[Place]:
    """Every link at which a point is; none for the cart."""
    point = parse_point(text)
    if point is None:
        return []
    before = sum(one.n_links * one.count for one in scene.pendulum[: point.pendulum])
    pendulum = scene.pendulum[point.pendulum]
    first = sum(link.count for link in pendulum.links[: point.link])
    copies = range(pendulum.count) if point.copy is None else [point.copy]
    return [
        Place(top + first + k, top + first + k - 1 if first + k else -1, point.below)
        for top in (before + copy * pendulum.n_links for copy in copies)
        for k in range(pendulum.links[point.link].count)
    ]
