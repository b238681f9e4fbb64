"""Special points of a branch: folds, branch points and changes of stability."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary
from nonlinear.orbits.continuation import PLACE_ACCURACY, OrbitPoint, OrbitProblem, between, locate
from nonlinear.orbits.floquet import PAIR_SPLIT_MIN
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import Shooting
from nonlinear.orbits.symmetric import Quarter

Passage = tuple[str, str, bool]
"""The kind of a special point, the quantity that turns there, and whether orbits lose their symmetry."""


@dataclass(frozen=True, eq=False, repr=False)
class Special(Displayed):
    """A special point: its kind, the quantity that turns there (of a fold), its orbit and its place in the branch.

    Kinds are "fold", "branch point", "period doubling", "torus" and "collision" (of multipliers on the unit circle,
    Krein's).  It lies between the orbits `after` and `after` + 1 of the branch.
    """

    kind: str
    orbit: Orbit
    after: int
    point: OrbitPoint = field(repr=False)
    of: str = ""
    breaks: bool = False

    def _summary(self) -> Summary:
        of = f" of {self.of}" if self.of else ""
        summary = self.orbit._summary()
        return Summary(f"{self.kind.capitalize()}{of} after orbit {self.after}: {summary.title}", summary.facts)


def along_backbone(problem: Quarter, points: Sequence[OrbitPoint]) -> Iterator[Special]:
    """The special points of a branch of symmetric orbits, in order.

    Energy or frequency turn at folds.  At c = −1 away from them orbits branch off that are still the same to the left
    and to the right, though they need not come to rest; at c = 1 orbits that are not (`breaks`).  Where left and right
    differ c is that of the whole period: at c = 1 away from folds orbits branch off, at c = −1 of twice the period.
    """
    is_mirrored = problem.parts == 4

    def energy(point: OrbitPoint) -> float:
        return problem.energy_slope(point.u, point.tangent)

    def passage(start: OrbitPoint, end: OrbitPoint, sign: int) -> Passage | None:
        is_fold = at_energy_fold(sign, is_mirrored) and energy(start) * energy(end) < 0
        return None if is_fold else symmetric_passage(sign, is_mirrored)

    return special_points(problem, points, {"energy": energy, "omega": last_slope}, passage)


def along_cycles(problem: Shooting, points: Sequence[OrbitPoint]) -> Iterator[Special]:
    """The special points of a branch of orbits without symmetry, in order.

    Folds are where the varied number turns, in a conservative scene the energy.
    """

    def turning(point: OrbitPoint) -> float:
        return last_slope(point) if problem.variation else problem.energy_slope(point.u, point.tangent)

    def passage(start: OrbitPoint, end: OrbitPoint, sign: int) -> Passage | None:
        if sign < 0:
            return "period doubling", "", False
        return None if turning(start) * turning(end) < 0 else ("branch point", "", False)

    of = problem.variation.path if problem.variation else "energy"
    return special_points(problem, points, {of: turning}, passage)


def last_slope(point: OrbitPoint) -> float:
    """The slope of the last unknown along the branch: the number that is varied, or the period."""
    return float(point.tangent[-1])


def at_energy_fold(sign: int, is_mirrored: bool) -> bool:
    """Whether c of symmetric orbits passes this sign of 1 where their energy turns."""
    return sign == (-1 if is_mirrored else 1)


def symmetric_passage(sign: int, is_mirrored: bool) -> Passage:
    """What happens where c of symmetric orbits passes this sign of 1 away from folds."""
    return "branch point" if is_mirrored or sign > 0 else "period doubling", "", is_mirrored and sign > 0


def special_points(
    problem: OrbitProblem,
    points: Sequence[OrbitPoint],
    folds: Mapping[str, Callable[[OrbitPoint], float]],
    passage: Callable[[OrbitPoint, OrbitPoint, int], Passage | None],
) -> Iterator[Special]:
    """Where quantities turn, by their slopes along the branch, and where multipliers pass 1 or −1 or meet, in order."""
    for index, (start, end) in enumerate(pairwise(points)):
        specials = [
            _special(problem, start, end, slope, index, ("fold", of, False))
            for of, slope in folds.items()
            if slope(start) * slope(end) < 0
        ]
        for sign in (1, -1):
            if (test := passing(start, end, sign)) and (what := passage(start, end, sign)):
                specials.append(_special(problem, start, end, test, index, what))
        if start.orbit.floquet.conservative:
            specials += [Special("collision", place.orbit, index, place) for place in collisions(problem, start, end)]
        elif place := _torus_point(problem, start, end):
            specials.append(Special("torus", place.orbit, index, place))
        yield from sorted(specials, key=lambda special: float((special.point.u - start.u) @ (end.u - start.u)))


def passing(start: OrbitPoint, end: OrbitPoint, sign: int) -> Callable[[OrbitPoint], float] | None:
    """A function that passes 0 if a multiplier passes 1 or −1 between two points; None if none is seen to.

    It is det(R ∓ 1), or the margin of the outermost pair where two pass at once, as those of equal pendula do.
    """
    which, margin = (0, 1) if sign > 0 else (1, 0)
    maps = [point.orbit.floquet.map for point in (start, end)]
    if np.prod([point.orbit.floquet.meeting[which] for point in (start, end)]) < 0:
        return lambda point: point.orbit.floquet.meeting[which]
    if maps[0].conservative and len(maps[0].margins) and maps[0].is_within[margin] != maps[1].is_within[margin]:
        return lambda point: float(point.orbit.floquet.map.margins[margin])
    return None


def collisions(problem: OrbitProblem, start: OrbitPoint, end: OrbitPoint) -> Iterator[OrbitPoint]:
    """Where two pairs of multipliers meet and leave the circle or the real axis, or return.

    There a factor of the discriminant passes 0; where that of equal pairs hides it, the number of pairs apart changes.
    """

    def factor(which: int) -> Callable[[OrbitPoint], float]:
        return lambda point: float(point.orbit.floquet.map.margins[which])

    count = 0
    before, after = (point.orbit.floquet.map.is_within[2:] for point in (start, end))
    for which in (2 + np.flatnonzero(before != after)).tolist():
        ends = [factor(which)(point) for point in (start, end)]
        if ends[0] * ends[1] < 0:
            meeting = locate(problem, start, end, factor(which))
            if abs(factor(which)(meeting)) < PAIR_SPLIT_MIN * max(map(abs, ends)):
                count += 1
                yield meeting
    if not count and start.orbit.floquet.n_split_pairs != end.orbit.floquet.n_split_pairs:
        yield bisect(problem, start, end, lambda point: point.orbit.floquet.n_split_pairs)


def _torus_point(problem: OrbitProblem, start: OrbitPoint, end: OrbitPoint) -> OrbitPoint | None:
    """Where a complex pair of multipliers passes the unit circle; None if a pair grew apart beyond it instead."""
    if start.orbit.floquet.n_split_pairs == end.orbit.floquet.n_split_pairs:
        return None
    if start.orbit.floquet.closest_pair * end.orbit.floquet.closest_pair < 0:
        meeting = locate(problem, start, end, lambda point: point.orbit.floquet.closest_pair)
    else:
        meeting = bisect(problem, start, end, lambda point: point.orbit.floquet.n_split_pairs)
    return meeting if abs(meeting.orbit.floquet.closest_pair) < PAIR_SPLIT_MIN else None


def _special(
    problem: OrbitProblem,
    start: OrbitPoint,
    end: OrbitPoint,
    test: Callable[[OrbitPoint], float],
    index: int,
    what: Passage,
) -> Special:
    kind, of, breaks = what
    place = locate(problem, start, end, test, crossing=kind == "branch point")
    if kind == "branch point" and place.orbit.cycles and place.orbit.is_symmetric:
        of, breaks = "symmetry", True
    return Special(kind, place.orbit, index, place, of, breaks)


def bisect(
    problem: OrbitProblem, start: OrbitPoint, end: OrbitPoint, test: Callable[[OrbitPoint], object]
) -> OrbitPoint:
    """The point from which on a test gives another value than at the first one, by bisection."""
    low, high, first_value, changed_point = 0.0, 1.0, test(start), end
    while high - low > PLACE_ACCURACY:
        try:
            middle = between(problem, start, end, (low + high) / 2)
        except ComputationError:
            break
        if test(middle) == first_value:
            low = (low + high) / 2
        else:
            high, changed_point = (low + high) / 2, middle
    return changed_point
