"""Special points of a branch: where it turns, where other branches leave it and where stability changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary
from nonlinear.orbits.continuation import Point, Problem, between, located
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import Shooting
from nonlinear.orbits.symmetric import Quarter

HALVINGS = 30
ON_CIRCLE = 1e-6
MEETS = 1e-6  # of its values at the ends: a factor of the discriminant where pairs meet


@dataclass(frozen=True, eq=False, repr=False)
class Special(Displayed):
    """A special point: its kind, the quantity that turns there (of a fold), its orbit and its place in the branch.

    Kinds are "fold", "branch point", "period doubling", "torus" and "collision" (of multipliers on the unit circle,
    Krein's).  It lies between the orbits `after` and `after` + 1 of the branch.
    """

    kind: str
    orbit: Orbit
    after: int
    point: Point = field(repr=False)
    of: str = ""
    breaks: bool = False

    def _summary(self) -> Summary:
        of = f" of {self.of}" if self.of else ""
        found = self.orbit._summary()
        return Summary(f"{self.kind.capitalize()}{of} after orbit {self.after}: {found.title}", found.facts)


def along_backbone(problem: Quarter, points: Sequence[Point]) -> Iterator[Special]:
    """The special points of a branch of symmetric orbits, in order.

    Energy or frequency turn at folds.  At c = −1 away from them orbits branch off that are still the same to the left
    and to the right, though they need not come to rest; at c = 1 orbits that are not (`breaks`).  Where left and right
    differ c is that of the whole period: at c = 1 away from folds orbits branch off, at c = −1 of twice the period.
    """
    mirrored = problem.parts == 4
    kinds = ((-1, "branch point", True), (1, "branch point", False))
    if not mirrored:
        kinds = ((1, "branch point", True), (-1, "period doubling", False))

    def energy(here: Point) -> float:
        return problem.energy_slope(here.u, here.tangent)

    def frequency(here: Point) -> float:
        return float(here.tangent[-1])

    for after, (one, other) in enumerate(pairwise(points)):
        found: list[Special] = []
        turned = energy(one) * energy(other) < 0
        if turned:
            found.append(_special(problem, one, other, energy, "fold", after, "energy"))
        if frequency(one) * frequency(other) < 0:
            found.append(_special(problem, one, other, frequency, "fold", after, "omega"))
        for sign, kind, at_folds in kinds:
            if not (at_folds and turned) and (test := passing(one, other, sign)):
                found.append(_special(problem, one, other, test, kind, after, breaks=mirrored and sign > 0))
        found += [Special("collision", met.orbit, after, met) for met in collisions(problem, one, other)]
        yield from sorted(found, key=lambda each: float((each.point.u - one.u) @ (other.u - one.u)))


def along_cycles(problem: Shooting, points: Sequence[Point], accuracy: float = 1e-10) -> Iterator[Special]:
    """The special points of a branch of orbits without symmetry, in order.

    Folds are where the varied number turns, in a conservative scene the energy; `accuracy` is that of `located`.
    """

    def turning(here: Point) -> float:
        if problem.variation is None:
            return problem.energy_slope(here.u, here.tangent)
        return float(here.tangent[-1])

    of = problem.variation.path if problem.variation else "energy"
    for after, (one, other) in enumerate(pairwise(points)):
        found: list[Special] = []
        turned = turning(one) * turning(other) < 0
        if turned:
            found.append(_special(problem, one, other, turning, "fold", after, of, accuracy=accuracy))
        for sign, kind, taken in ((1, "branch point", turned), (-1, "period doubling", False)):
            if not taken and (test := passing(one, other, sign)):
                found.append(_special(problem, one, other, test, kind, after, accuracy=accuracy))
        if problem.conservative:
            found += [Special("collision", met.orbit, after, met) for met in collisions(problem, one, other, accuracy)]
        elif met := _circled(problem, one, other, accuracy):
            found.append(Special("torus", met.orbit, after, met))
        yield from sorted(found, key=lambda each: float((each.point.u - one.u) @ (other.u - one.u)))


def passing(one: Point, other: Point, sign: int) -> Callable[[Point], float] | None:
    """A function that passes 0 where a multiplier passes 1 or −1 between two points; None where none is seen to.

    It is det(R ∓ 1), or the margin of the outermost pair where two pass at once, as those of equal pendula do.
    """
    which, margin = (0, 1) if sign > 0 else (1, 0)
    maps = [here.orbit.floquet.map for here in (one, other)]
    if np.prod([here.orbit.floquet.meeting[which] for here in (one, other)]) < 0:
        return lambda here: here.orbit.floquet.meeting[which]
    if maps[0].conservative and len(maps[0].margins) and maps[0].is_within[margin] != maps[1].is_within[margin]:
        return lambda here: float(here.orbit.floquet.map.margins[margin])
    return None


def collisions(problem: Problem, one: Point, other: Point, accuracy: float = 1e-10) -> Iterator[Point]:
    """Where two pairs of multipliers meet and leave the circle or the real axis, or return.

    There a factor of the discriminant passes 0; where that of equal pairs hides it, the number of pairs apart changes.
    """

    def factor(which: int) -> Callable[[Point], float]:
        return lambda here: float(here.orbit.floquet.map.margins[which])

    seen = 0
    before, after = (here.orbit.floquet.map.is_within[2:] for here in (one, other))
    for which in (2 + np.flatnonzero(before != after)).tolist():
        ends = [factor(which)(here) for here in (one, other)]
        if ends[0] * ends[1] < 0:
            met = located(problem, one, other, factor(which), accuracy)
            if abs(factor(which)(met)) < MEETS * max(map(abs, ends)):
                seen += 1
                yield met
    if not seen and one.orbit.floquet.apart != other.orbit.floquet.apart:
        yield halved(problem, one, other, lambda here: here.orbit.floquet.apart)


def _circled(problem: Shooting, one: Point, other: Point, accuracy: float) -> Point | None:
    """Where a complex pair of multipliers passes the unit circle; None where a pair grew apart beyond it instead."""
    if one.orbit.floquet.apart == other.orbit.floquet.apart:
        return None
    if one.orbit.floquet.closest_pair * other.orbit.floquet.closest_pair < 0:
        met = located(problem, one, other, lambda here: here.orbit.floquet.closest_pair, accuracy)
    else:
        met = halved(problem, one, other, lambda here: here.orbit.floquet.apart)
    return met if abs(met.orbit.floquet.closest_pair) < ON_CIRCLE else None


def _special(
    problem: Problem,
    one: Point,
    other: Point,
    test: Callable[[Point], float],
    kind: str,
    after: int,
    of: str = "",
    *,
    breaks: bool = False,
    accuracy: float = 1e-10,
) -> Special:
    found = located(problem, one, other, test, accuracy, crossing=kind == "branch point")
    if kind == "branch point" and found.orbit.cycles and found.orbit.is_symmetric:
        of, breaks = "symmetry", True
    return Special(kind, found.orbit, after, found, of, breaks)


def halved(problem: Problem, one: Point, other: Point, test: Callable[[Point], object]) -> Point:
    """The point from which on a test gives another value than at the first one, by bisection."""
    low, high, before, found = 0.0, 1.0, test(one), other
    for _ in range(HALVINGS):
        try:
            middle = between(problem, one, other, (low + high) / 2)
        except ComputationError:
            break
        if test(middle) == before:
            low = (low + high) / 2
        else:
            high, found = (low + high) / 2, middle
    return found
