"""Special points of a branch: where it turns, where other branches leave it and where stability changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from nonlinear.orbits.continuation import Point, Problem, between, located
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.symmetric import Quarter

HALVINGS = 30


@dataclass(frozen=True, eq=False)
class Special:
    """A special point: its kind, the quantity that turns there (of a fold), its orbit and its place in the branch.

    Kinds are "fold", "branch point", "period doubling", "torus" and "collision" (of multipliers on the unit circle,
    Krein's).  It lies between the orbits `after` and `after` + 1 of the branch.
    """

    kind: str
    orbit: Orbit
    after: int
    point: Point
    of: str = ""
    breaks: bool = False


def along_backbone(problem: Quarter, points: Sequence[Point]) -> Iterator[Special]:
    """The special points of a branch of symmetric orbits, in order.

    Energy or frequency turn at folds.  At c = −1 away from them symmetric orbits branch off, at c = 1 orbits of less
    symmetry (`breaks`).
    """

    def energy(here: Point) -> float:
        return problem.energy_slope(here.u, here.tangent)

    def frequency(here: Point) -> float:
        return float(here.tangent[-1])

    def at(sign: int) -> Callable[[Point], float]:
        return lambda here: here.orbit.floquet.meeting[0 if sign > 0 else 1]

    for after, (one, other) in enumerate(pairwise(points)):
        found: list[Special] = []
        turned = energy(one) * energy(other) < 0
        if turned:
            found.append(_special(problem, one, other, energy, "fold", after, "energy"))
        if frequency(one) * frequency(other) < 0:
            found.append(_special(problem, one, other, frequency, "fold", after, "omega"))
        for sign, taken in ((-1, turned), (1, False)):
            if not taken and at(sign)(one) * at(sign)(other) < 0:
                found.append(_special(problem, one, other, at(sign), "branch point", after, breaks=sign > 0))
        if one.orbit.floquet.apart != other.orbit.floquet.apart:
            met = halved(problem, one, other, lambda here: here.orbit.floquet.apart)
            found.append(Special("collision", met.orbit, after, met))
        yield from sorted(found, key=lambda each: float((each.point.u - one.u) @ (other.u - one.u)))


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
) -> Special:
    found = located(problem, one, other, test)
    return Special(kind, found.orbit, after, found, of, breaks)


def halved(problem: Problem, one: Point, other: Point, test: Callable[[Point], object]) -> Point:
    """The point from which on a test gives another value than at the first one, by bisection."""
    low, high, before, found = 0.0, 1.0, test(one), other
    for _ in range(HALVINGS):
        middle = between(problem, one, other, (low + high) / 2)
        if test(middle) == before:
            low = (low + high) / 2
        else:
            high, found = (low + high) / 2, middle
    return found
