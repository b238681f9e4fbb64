"""Special points of a branch: where it turns, where other branches leave it and where stability changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary
from nonlinear.orbits.continuation import OrbitPoint, OrbitProblem, between, located
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
    mirrored = problem.parts == 4
    kinds = ((-1, "branch point", True), (1, "branch point", False))
    if not mirrored:
        kinds = ((1, "branch point", True), (-1, "period doubling", False))

    def energy(here: OrbitPoint) -> float:
        return problem.energy_slope(here.u, here.tangent)

    def frequency(here: OrbitPoint) -> float:
        return float(here.tangent[-1])

    for after, (start, end) in enumerate(pairwise(points)):
        specials: list[Special] = []
        turned = energy(start) * energy(end) < 0
        if turned:
            specials.append(_special(problem, start, end, energy, "fold", after, "energy"))
        if frequency(start) * frequency(end) < 0:
            specials.append(_special(problem, start, end, frequency, "fold", after, "omega"))
        for sign, kind, at_folds in kinds:
            if not (at_folds and turned) and (test := passing(start, end, sign)):
                specials.append(_special(problem, start, end, test, kind, after, breaks=mirrored and sign > 0))
        specials += [Special("collision", met.orbit, after, met) for met in collisions(problem, start, end)]
        yield from sorted(specials, key=lambda each: float((each.point.u - start.u) @ (end.u - start.u)))


def along_cycles(problem: Shooting, points: Sequence[OrbitPoint], accuracy: float = 1e-10) -> Iterator[Special]:
    """The special points of a branch of orbits without symmetry, in order.

    Folds are where the varied number turns, in a conservative scene the energy; `accuracy` is that of `located`.
    """

    def turning(here: OrbitPoint) -> float:
        if problem.variation is None:
            return problem.energy_slope(here.u, here.tangent)
        return float(here.tangent[-1])

    of = problem.variation.path if problem.variation else "energy"
    for after, (start, end) in enumerate(pairwise(points)):
        specials: list[Special] = []
        turned = turning(start) * turning(end) < 0
        if turned:
            specials.append(_special(problem, start, end, turning, "fold", after, of, accuracy=accuracy))
        for sign, kind, taken in ((1, "branch point", turned), (-1, "period doubling", False)):
            if not taken and (test := passing(start, end, sign)):
                specials.append(_special(problem, start, end, test, kind, after, accuracy=accuracy))
        if problem.conservative:
            specials += [
                Special("collision", met.orbit, after, met) for met in collisions(problem, start, end, accuracy)
            ]
        elif met := _circled(problem, start, end, accuracy):
            specials.append(Special("torus", met.orbit, after, met))
        yield from sorted(specials, key=lambda each: float((each.point.u - start.u) @ (end.u - start.u)))


def passing(start: OrbitPoint, end: OrbitPoint, sign: int) -> Callable[[OrbitPoint], float] | None:
    """A function that passes 0 where a multiplier passes 1 or −1 between two points; None where none is seen to.

    It is det(R ∓ 1), or the margin of the outermost pair where two pass at once, as those of equal pendula do.
    """
    which, margin = (0, 1) if sign > 0 else (1, 0)
    maps = [here.orbit.floquet.map for here in (start, end)]
    if np.prod([here.orbit.floquet.meeting[which] for here in (start, end)]) < 0:
        return lambda here: here.orbit.floquet.meeting[which]
    if maps[0].conservative and len(maps[0].margins) and maps[0].is_within[margin] != maps[1].is_within[margin]:
        return lambda here: float(here.orbit.floquet.map.margins[margin])
    return None


def collisions(
    problem: OrbitProblem, start: OrbitPoint, end: OrbitPoint, accuracy: float = 1e-10
) -> Iterator[OrbitPoint]:
    """Where two pairs of multipliers meet and leave the circle or the real axis, or return.

    There a factor of the discriminant passes 0; where that of equal pairs hides it, the number of pairs apart changes.
    """

    def factor(which: int) -> Callable[[OrbitPoint], float]:
        return lambda here: float(here.orbit.floquet.map.margins[which])

    seen = 0
    before, after = (here.orbit.floquet.map.is_within[2:] for here in (start, end))
    for which in (2 + np.flatnonzero(before != after)).tolist():
        ends = [factor(which)(here) for here in (start, end)]
        if ends[0] * ends[1] < 0:
            met = located(problem, start, end, factor(which), accuracy)
            if abs(factor(which)(met)) < MEETS * max(map(abs, ends)):
                seen += 1
                yield met
    if not seen and start.orbit.floquet.apart != end.orbit.floquet.apart:
        yield halved(problem, start, end, lambda here: here.orbit.floquet.apart)


def _circled(problem: Shooting, start: OrbitPoint, end: OrbitPoint, accuracy: float) -> OrbitPoint | None:
    """Where a complex pair of multipliers passes the unit circle; None where a pair grew apart beyond it instead."""
    if start.orbit.floquet.apart == end.orbit.floquet.apart:
        return None
    if start.orbit.floquet.closest_pair * end.orbit.floquet.closest_pair < 0:
        met = located(problem, start, end, lambda here: here.orbit.floquet.closest_pair, accuracy)
    else:
        met = halved(problem, start, end, lambda here: here.orbit.floquet.apart)
    return met if abs(met.orbit.floquet.closest_pair) < ON_CIRCLE else None


def _special(
    problem: OrbitProblem,
    start: OrbitPoint,
    end: OrbitPoint,
    test: Callable[[OrbitPoint], float],
    kind: str,
    after: int,
    of: str = "",
    *,
    breaks: bool = False,
    accuracy: float = 1e-10,
) -> Special:
    met = located(problem, start, end, test, accuracy, crossing=kind == "branch point")
    if kind == "branch point" and met.orbit.cycles and met.orbit.is_symmetric:
        of, breaks = "symmetry", True
    return Special(kind, met.orbit, after, met, of, breaks)


def halved(
    problem: OrbitProblem, start: OrbitPoint, end: OrbitPoint, test: Callable[[OrbitPoint], object]
) -> OrbitPoint:
    """The point from which on a test gives another value than at the first one, by bisection."""
    low, high, before, changed = 0.0, 1.0, test(start), end
    for _ in range(HALVINGS):
        try:
            middle = between(problem, start, end, (low + high) / 2)
        except ComputationError:
            break
        if test(middle) == before:
            low = (low + high) / 2
        else:
            high, changed = (low + high) / 2, middle
    return changed
