"""What happens to the stability of a branch between two of its orbits.

Two pairs of multipliers may collide and part again within one step, so that both ends are stable and orbits between
them are not: a bubble of instability, as narrow as the coupling of the pairs is weak.  The margins of `floquet` see
it as they dip below 0.  The map of disturbances itself has no narrow feature: it changes smoothly along the branch,
and Lagrange's polynomials through the orbits nearby give it between them, with the difference of two orders as its
doubt.  Where the margins of that map less their doubt fall below 0, the orbit there is computed, and the search goes
on beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.orbits.continuation import OrbitPoint, OrbitProblem, between
from nonlinear.orbits.floquet import Map

FINE, COARSE = 6, 4  # orbits through which the two polynomials pass
APART = 0.2  # of an interval: how near each other these may be
LOOKS, ZOOMS = 24, 3  # places in an interval, and in turn about the lowest of them
NEAR = 0.1  # of a value at such a place, below which the minimum beside it is looked at
MOST = 12  # orbits computed between two of a branch
SHORTEST = 1e-4  # of an interval
FIRM = 1.0  # below −FIRM at both ends, a margin is taken to stay negative between them
ALIKE = 1e-10  # squared distance below which two pairs are the same: those of equal pendula


@dataclass(frozen=True, eq=False)
class Node:
    """An orbit at a length along the branch; `is_in_branch` where it belongs to it."""

    length: float
    point: OrbitPoint
    is_in_branch: bool = True

    @property
    def map(self) -> Map:
        """The map of disturbances."""
        return self.point.orbit.floquet.map


def refined_points(problem: OrbitProblem, points: Sequence[OrbitPoint]) -> list[OrbitPoint]:
    """The points of a branch and those between them whose orbits differ in stability from both neighbours."""
    if len(points) < 2:
        return list(points)
    nodes = [Node(length, point) for length, point in zip(_lengths(points), points, strict=True)]
    for start, end in pairwise(tuple(nodes)):
        _search(problem, nodes, start, end)
    return [node.point for node in nodes if node.is_in_branch]


def _lengths(points: Sequence[OrbitPoint]) -> Iterator[float]:
    length = 0.0
    yield length
    for point, following in pairwise(points):
        length += _arc(point, following)
        yield length


def _arc(start: OrbitPoint, end: OrbitPoint) -> float:
    """The length of the branch between two points, from their distance and the angle between their tangents."""
    turn = float(np.arccos(np.clip(start.tangent @ end.tangent, -1, 1)))
    return float(np.linalg.norm(end.u - start.u)) * (1 + turn**2 / 24)


def _search(problem: OrbitProblem, nodes: list[Node], first: Node, last: Node) -> None:
    """Add to the nodes, in order, those between two of them that the search computes."""
    budget = MOST
    waiting = [(first, last)]
    while waiting and budget:
        start, end = waiting.pop()
        part = None if _stays(start.map, end.map) else _lowest(nodes, start, end)
        if part is None:
            continue
        budget -= 1
        try:
            inner = between(problem, start.point, end.point, part)
        except ComputationError:
            continue
        first_arc, second_arc = _arc(start.point, inner), _arc(inner, end.point)
        is_within = inner.orbit.floquet.map.is_within
        agree = start.map.is_within == end.map.is_within
        is_in_branch = bool(np.any(agree & (is_within != start.map.is_within)))
        node = Node(
            start.length + (end.length - start.length) * first_arc / (first_arc + second_arc), inner, is_in_branch
        )
        nodes.insert(nodes.index(end), node)
        waiting += [(start, node), (node, end)]


def _lowest(nodes: Sequence[Node], start: Node, end: Node) -> float | None:
    """The part of the way to an orbit at which a margin, of one sign at both ends, may have the other; else None."""
    agree = (start.map.is_within == end.map.is_within) & ~_alike(start.map, end.map)
    sign = np.where(start.map.is_within, 1.0, -1.0)
    chosen = _spread(nodes, start, end)

    def margins(parts: Floats) -> tuple[Floats, Floats]:
        """Those of the polynomials at parts (P,) of the way, by sign, and their doubts, (P, m)."""
        at = start.length + parts * (end.length - start.length)
        fine, coarse = (_margins_between(chosen[:count], at) for count in (FINE, min(COARSE, max(2, len(chosen) - 1))))
        return sign * fine, np.abs(fine - coarse) if start.map.conservative else np.zeros_like(fine)

    parts = np.linspace(0.0, 1.0, LOOKS + 1)
    lowest, doubt = margins(parts)
    for which in np.flatnonzero(agree):
        for at in _dips(lowest[:, which], doubt[:, which]):
            part, low, unsure = parts[at], lowest[at, which], doubt[at, which]
            width = 1 / LOOKS
            for _ in range(ZOOMS):
                closer = np.clip(part + np.linspace(-width, width, LOOKS + 1), 0.0, 1.0)
                values, doubts = (table[:, which] for table in margins(closer))
                index = int(values.argmin())
                part, low, unsure, width = closer[index], values[index], doubts[index], 2 * width / LOOKS
            if low - unsure < -start.map.doubt[which] and SHORTEST < part < 1 - SHORTEST:
                return float(part)
    return None


def _stays(start: Map, end: Map) -> bool:
    """Whether the orbits between are unstable for sure, or have no disturbances."""
    return not len(start.margins) or bool(np.any((start.margins < -FIRM) & (end.margins < -FIRM)))


def _alike(start: Map, end: Map) -> NDArray[np.bool_]:
    """Which margins are those of two pairs that are the same along the branch."""
    is_same = np.maximum(np.abs(start.margins), np.abs(end.margins)) < ALIKE
    is_same[:2] = False
    return np.asarray(is_same)


def _dips(values: Floats, doubt: Floats) -> Iterator[int]:
    """Where values (P,) have a minimum that may lie below 0, by the parabola through it and its neighbours."""
    previous, centre, following = values[:-2], values[1:-1], values[2:]
    bend = previous - 2 * centre + following
    for at in np.flatnonzero((centre <= previous) & (centre <= following) & (bend > 0)):
        low = centre[at] - (following[at] - previous[at]) ** 2 / (8 * bend[at])
        if low - doubt[at + 1] < NEAR * centre[at]:
            yield int(at) + 1


def _spread(nodes: Sequence[Node], start: Node, end: Node) -> list[Node]:
    """Both ends and the nodes nearest to them, at most FINE, none too near another."""
    middle, spacing = (start.length + end.length) / 2, APART * (end.length - start.length)
    chosen = [start, end]
    for node in sorted(nodes, key=lambda neighbour: abs(neighbour.length - middle)):
        if len(chosen) == FINE:
            break
        if all(abs(node.length - neighbour.length) >= spacing for neighbour in chosen):
            chosen.append(node)
    return chosen


def _margins_between(nodes: Sequence[Node], lengths: Floats) -> Floats:
    """The margins (P, m) of the map between the nodes at these lengths along the branch (P,)."""
    x = np.array([node.length for node in nodes])
    weights = np.array([np.prod([(lengths - b) / (a - b) for b in x if b != a], axis=0) for a in x])
    M, right, left = (
        np.tensordot(weights.T, np.array([getattr(node.map, name) for node in nodes]), 1)
        for name in ("M", "right", "left")
    )
    kind = nodes[0].map
    if not (kind.conservative or right.size or left.size):  # all at once
        return np.asarray(1 - np.abs(np.linalg.eigvals(M)).max(axis=1, keepdims=True))
    parts = zip(M, right, left, strict=True)
    return np.array([replace(kind, M=m, right=r, left=l).margins for m, r, l in parts])
