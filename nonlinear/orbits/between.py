"""Stability of a branch between two of its computed orbits.

Two pairs of multipliers may collide and part again within one step, so that both ends are stable and orbits between
them are not: a bubble of instability, as narrow as the coupling of the pairs is weak. The margins of `floquet` see it
as they dip below 0. The map of perturbations itself has no narrow feature: it changes smoothly along the branch, and
Lagrange's polynomials through the orbits nearby give it between them, with the difference of two orders as its doubt.
Where the margins of that map less their doubt fall below 0, an orbit is computed, and the search continues next to
it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.orbits.continuation import OrbitPoint, OrbitProblem, between
from nonlinear.orbits.floquet import Map

POLYNOMIAL_NODES = 6
"""Tolerance: orbits through which the finer polynomial passes, the coarser through two fewer: their difference
judges both."""
INTERVAL_PLACES = 24
"""Cost: places between two orbits at which the polynomials are evaluated, and in turn about the lowest of them, and
twice as many as orbits that are computed there; benchmarks/orbits.py."""


@dataclass(frozen=True, eq=False)
class Node:
    """An orbit at a length along the branch; `is_in_branch` where it belongs to it."""

    length: float
    point: OrbitPoint
    is_in_branch: bool = True

    @property
    def map(self) -> Map:
        """The map of perturbations."""
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
    budget = INTERVAL_PLACES // 2
    waiting = [(first, last)]
    while waiting and budget:
        start, end = waiting.pop()
        if not len(start.map.margins):
            continue
        # a margin below −1 at both ends is far from any change: the orbits between are unstable for sure
        is_unstable = bool(np.any((start.map.margins < -1) & (end.map.margins < -1)))
        part = None if is_unstable else _lowest(nodes, start, end)
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
    # those of equal pendula stay one along the branch
    is_equal_pair = np.maximum(np.abs(start.map.margins), np.abs(end.map.margins)) < start.map.doubt
    is_equal_pair[:2] = False
    agree = (start.map.is_within == end.map.is_within) & ~is_equal_pair
    sign = np.where(start.map.is_within, 1.0, -1.0)
    chosen = _spread(nodes, start, end)
    counts = POLYNOMIAL_NODES, min(POLYNOMIAL_NODES - 2, max(2, len(chosen) - 1))

    def margins(parts: Floats) -> tuple[Floats, Floats]:
        """The margins of the polynomials at parts (P,) of the way, by sign, and their doubts, (P, m)."""
        at = start.length + parts * (end.length - start.length)
        fine, coarse = (_margins_between(chosen[:count], at) for count in counts)
        return sign * fine, np.abs(fine - coarse) if start.map.conservative else np.zeros_like(fine)

    parts = np.linspace(0.0, 1.0, INTERVAL_PLACES + 1)
    lowest, doubt = margins(parts)
    for which in np.flatnonzero(agree):
        for at in _dips(lowest[:, which], doubt[:, which]):
            part, low, unsure = parts[at], lowest[at, which], doubt[at, which]
            width = 1 / INTERVAL_PLACES
            for _ in range(3):
                closer = np.clip(part + np.linspace(-width, width, INTERVAL_PLACES + 1), 0.0, 1.0)
                values, doubts = (table[:, which] for table in margins(closer))
                index = int(values.argmin())
                part, low, unsure, width = closer[index], values[index], doubts[index], 2 * width / INTERVAL_PLACES
            if low - unsure < -start.map.doubt[which] and 0 < part < 1:
                return float(part)
    return None


def _dips(values: Floats, doubt: Floats) -> Iterator[int]:
    """Where values (P,) have a minimum that may lie near 0, by the parabola through it and its neighbours."""
    previous, centre, following = values[:-2], values[1:-1], values[2:]
    bend = previous - 2 * centre + following
    for at in np.flatnonzero((centre <= previous) & (centre <= following) & (bend > 0)):
        low = centre[at] - (following[at] - previous[at]) ** 2 / (8 * bend[at])
        if low - doubt[at + 1] < centre[at] / 2:
            yield int(at) + 1


def _spread(nodes: Sequence[Node], start: Node, end: Node) -> list[Node]:
    """Both ends and the nodes nearest to them, at most POLYNOMIAL_NODES, none too near another."""
    middle, spacing = (start.length + end.length) / 2, (end.length - start.length) / 4
    chosen = [start, end]
    for node in sorted(nodes, key=lambda neighbour: abs(neighbour.length - middle)):
        if len(chosen) == POLYNOMIAL_NODES:
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
