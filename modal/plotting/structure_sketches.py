"""A sketch of a scene on a structure: carriers side by side with their coordinates, one pendulum of each entry.

Not to scale: carriers stand side by side, their pivots no farther from each other than the longest link.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.scene import AnyLink, Scene
from modal.structure import (
    CarrierEnd,
    End,
    LinkEnd,
    Piece,
    Pivot,
    Scaffold,
    SpringNumbers,
    Structure,
    Where,
    structure_of,
)
from modal.types import Floats, Ints

FARTHEST, FIXED, ROD, GAP = 0.85, 1.25, 0.8, 1.05
"""Largest distance of a point from its carrier's origin, the same of what is fixed, length of a swing's rods, and room
between carriers, over the longest link."""
COORDINATES = {
    "cart": ("x",),
    "swing": ("x",),
    "tilt": (r"\varphi",),
    "heave": ("z",),
    "platform": ("x", "z", r"\varphi"),
}


class Label(NamedTuple):
    """A symbol at a place (m), and the end of an arrow that begins there, of a coordinate."""

    symbol: str
    place: tuple[float, float]
    arrow: tuple[float, float] | None = None


def schematic(scene: Scene, lengths: list[Floats]) -> Scaffold:
    """The structure of a scene not to scale, with one pendulum of each entry, whose drawn `lengths` these are."""
    structure = structure_of(scene)
    longest = max(link.length for pendulum in scene.pendulum for link in pendulum.links)
    copies = [pendulum.count for pendulum in scene.pendulum]
    pivots = [structure.pivots[first] for first in np.cumsum([0, *copies[:-1]]).tolist()]
    sizes = [pendulum.n_links for pendulum in scene.pendulum]
    factors = [_factor(structure, k, pivots, longest) for k in range(len(structure.carriers))]
    carriers = tuple(
        replace(carrier, position=(0.0, 0.0), length=ROD, centre=(carrier.centre[0] * by, carrier.centre[1] * by))
        for carrier, by in zip(structure.carriers, factors, strict=True)
    )
    placed = tuple(Pivot(pivot.carrier, _scaled(pivot.where, factors[pivot.carrier])) for pivot in pivots)
    first = np.cumsum([0, *sizes])
    springs = tuple(
        spring for each in structure.springs if (spring := _kept(each, scene, factors, first, lengths)) is not None
    )
    drawn = Structure(carriers, placed, tuple(dict.fromkeys(springs)))
    return Scaffold(drawn, np.arange(len(placed)), first, 1.0, GAP)


def _factor(structure: Structure, k: int, pivots: list[Pivot], longest: float) -> float:
    """By how much the points of a carrier are drawn nearer."""
    points: list[Where] = [pivot.where for pivot in pivots if pivot.carrier == k]
    ends = (end for spring in structure.springs for end in spring.ends)
    points += [end.where for end in ends if isinstance(end, CarrierEnd) and end.carrier == k]
    far = max((abs(float(part)) for where in points if not isinstance(where, int) for part in where), default=0.0)
    if far and not structure.carriers[k].size:
        return FIXED / far
    return min(1 / longest, FARTHEST / far) if far else 1 / longest


def _scaled(where: Where, by: float) -> Where:
    return where if isinstance(where, int) else (where[0] * by, where[1] * by)


def _kept(
    spring: SpringNumbers, scene: Scene, factors: list[float], first: Ints, lengths: list[Floats]
) -> SpringNumbers | None:
    """A spring between what is drawn; None for one of another copy."""
    ends: list[End] = []
    for end in spring.ends:
        if isinstance(end, CarrierEnd):
            ends.append(CarrierEnd(end.carrier, _scaled(end.where, factors[end.carrier])))
        elif isinstance(end, LinkEnd):
            kept = _link_of(end, scene, first, lengths)
            if kept is None:
                return None
            ends.append(kept)
        else:
            ends.append(end._replace(place=None))
    return spring._replace(ends=(ends[0], ends[1]))


def _link_of(end: LinkEnd, scene: Scene, first: Ints, lengths: list[Floats]) -> LinkEnd | None:
    before = 0
    for k, pendulum in enumerate(scene.pendulum):
        if end.link < before + pendulum.count * pendulum.n_links:
            at = end.link - before
            if at >= pendulum.n_links:
                return None
            link = _links(pendulum.links)[at]
            below = end.below if end.below is None else end.below / link.length * float(lengths[k][at])
            return LinkEnd(int(first[k]) + at, below)
        before += pendulum.count * pendulum.n_links
    return None


def _links(links: tuple[AnyLink, ...]) -> list[AnyLink]:
    return [link for link in links for _ in range(link.count)]


def labels_of(scaffold: Scaffold, pieces: list[Piece]) -> Iterator[Label]:
    """The symbols of carriers with their coordinates, and of springs."""
    still = np.zeros((1, scaffold.structure.size))
    named = sum(carrier.size > 0 for carrier in scaffold.structure.carriers) > 1
    for k, carrier in enumerate(scaffold.structure.carriers):
        if not carrier.size or carrier.points is not None:
            continue
        index = rf"_\mathrm{{{carrier.name.replace('_', chr(92) + '_')}}}" if named else ""
        left, right, level = scaffold.body(k)
        platform = carrier.kind == "platform"
        (x, y), (end, _) = (scaffold.place(k, (s, level), still)[0].tolist() for s in (left, right))
        yield Label("m" + (index or "_s"), _beside(carrier.kind, x, y))
        start = x + 0.2 if platform else (x + end) / 2 + 0.06
        for number, symbol in enumerate(COORDINATES[carrier.kind]):
            place = (start, y + 0.2 if not platform else y + 0.16)
            way = {"x": (0.3, 0.0), "z": (0.0, 0.3)}.get(symbol)
            if symbol == r"\varphi":
                place = (place[0] + 0.16 * (number > 0), place[1] + 0.2 * (number > 0))
            yield Label(symbol + index, place, way and (place[0] + way[0], place[1] + way[1]))
    springs = [piece for piece in pieces if piece.role == "spring"]
    for number, piece in enumerate(springs, 1):
        x, y = piece.points[0].mean(0)
        across, down = np.ptp(piece.points[0], axis=0)
        tall = down > 0.8 * across
        place = (float(x) + 0.17, float(y)) if tall else (float(x), float(y) - 0.16)
        yield Label(f"k_{{{number}}}" if len(springs) > 1 else "k", place)


def _beside(kind: str, x: float, y: float) -> tuple[float, float]:
    """Where the mass of a carrier is written, by the left end of its body."""
    return {"platform": (x + 0.1, y), "swing": (x - 0.2, y)}.get(kind, (x + 0.02, y + 0.2))
