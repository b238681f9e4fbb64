"""Pseudo-arclength continuation of the solutions of r(u) = 0, one more unknown than independent equations.

The tangent t is the null vector of J = ∂r/∂u.  A step s along it is corrected by Newton's method (of least squares:
conserved quantities make some equations follow from the others) in the plane across it [Keller1977, p. 359],
[Seydel2010, ch. 4].  Steps grow where few corrections suffice and the tangent hardly turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite, radians
from typing import Protocol

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed
from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.integration.method import STEP_SAFETY
from nonlinear.orbits.orbit import ORBIT_RESIDUAL_MAX, Orbit

CORRECTION_MIN = 1e-7
"""Cost: a correction below it is the last, as its square is left; a step below it does not leave its point;
benchmarks/orbits.py."""
STEP_MAX = 0.1
"""Cost: the default of `longest`, in natural units and parts of a range, and how far the phases (rad) of neighbours of
a forced branch may differ; benchmarks/orbits.py."""
TANGENT_TURN_MAX = 0.3
"""Cost: largest angle (rad) between neighbouring tangents; benchmarks/orbits.py."""
NEIGHBOUR_GROWTH_MAX = 0.02
"""Cost: how far neighbours of a forced branch may differ in amplitude, relative; benchmarks/orbits.py."""
MEASURED_ANGLE_MIN = radians(0.1)
"""Cost: amplitudes below it differ by parts of it; benchmarks/orbits.py."""
CROSSING_SINGULAR_RATIO = 1e-5
"""Tolerance: singular values below it, relative, are those of a second branch, within the accuracy of a crossing."""
PLACE_ACCURACY = 1e-10
"""Tolerance: of the way between two points, to which a point in it is located: an orbit is known to 1e-11."""
BRANCH_ORBITS_MAX = 400
"""Limit: orbits of a branch, which then "was followed no further than" its last."""
DENSE_BRANCH_ORBITS_MAX = 4000
"""Limit: the same where orbits lie close together, as of forced motions."""
BRACKET_PARTS = (0.3, 0.7, 0.5, 0.1, 0.9)
"""Cost: tried in a bracket where a point in it was not found; benchmarks/orbits.py."""


class OrbitProblem(Protocol):
    """Equations whose solutions are periodic orbits."""

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """The r (k,) and ∂r/∂u (k, N)."""
        ...

    def orbit(self, u: Floats) -> Orbit:
        """The orbit of a solution."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class OrbitPoint(Displayed):
    """A solution u with the tangent of its branch (N,), and its orbit."""

    u: Floats
    tangent: Floats
    orbit: Orbit


def correct(
    problem: OrbitProblem, guess: Floats, row: Floats | None = None, rcond: float | None = None
) -> tuple[Floats, Floats] | None:
    """The solution near a guess, in the plane through it across `row` if there is one, and ∂r/∂u (k, N) there.

    Directions whose singular values are below `rcond`, relative, are left as guessed.  None where Newton's method does
    not converge.
    """
    u, last_size = guess, 1.0
    while True:
        try:
            r, J = problem.equations(u)
        except (ComputationError, FloatingPointError):
            return None
        if row is not None:
            r, J = np.append(r, row @ (u - guess)), np.vstack((J, row))
        if not (np.all(np.isfinite(J)) and np.all(np.isfinite(r))):
            return None
        step = np.linalg.lstsq(J, -r, rcond=rcond)[0]
        size = float(np.linalg.norm(step))
        u = u + step
        if size < CORRECTION_MIN:
            return u, J if row is None else J[:-1]
        if size > last_size / 2:  # neither near nor coming nearer
            return None
        last_size = size


def tangent_of(J: Floats, direction: Floats) -> Floats:
    """The null vector (N,) of J that points along another vector."""
    tangent = np.linalg.svd(J)[2][-1]
    return np.asarray(tangent if tangent @ direction >= 0 else -tangent)


def point(problem: OrbitProblem, guess: Floats, row: Floats, rcond: float | None = None) -> OrbitPoint | None:
    """The point of a branch across `row` from a guess, None if there is none."""
    if (solution := correct(problem, guess, row, rcond)) is None:
        return None
    u, J = solution
    try:
        orbit = problem.orbit(u)
    except ComputationError:
        return None
    return OrbitPoint(u, tangent_of(J, row), orbit) if orbit.residual < ORBIT_RESIDUAL_MAX else None


def level(current: OrbitPoint, following: OrbitPoint) -> float:
    """No limit to how far neighbours are apart."""
    return 0.0


def relative_distance(current: OrbitPoint, following: OrbitPoint) -> float:
    """How far neighbouring forced motions are apart in amplitude and in phase, over their tolerances.

    The phase is that of the link with the largest angle of the first, if it has one.
    """
    first, second = current.orbit, following.orbit
    size, link = max(first.amplitude, MEASURED_ANGLE_MIN), first.amplitudes.argmax()
    grown = abs(second.amplitude - first.amplitude) / size / NEIGHBOUR_GROWTH_MAX
    turn = float(np.abs(np.angle(np.exp(1j * (second.phases[link] - first.phases[link]))))) / STEP_MAX
    return max(grown, min(first.amplitude / MEASURED_ANGLE_MIN, 1.0) * turn) if isfinite(turn) else grown


def follow(
    problem: OrbitProblem,
    first: OrbitPoint,
    *,
    step: float,
    longest: float,
    distance: Callable[[OrbitPoint, OrbitPoint], float] = level,
) -> Iterator[OrbitPoint]:
    """The points of a branch, from the first one on, as long as there are any; `distance` at most 1 for neighbours."""
    current = first
    yield current
    while step >= CORRECTION_MIN:
        following = point(problem, current.u + step * current.tangent, current.tangent)
        if following is None or following.tangent @ current.tangent < np.cos(TANGENT_TURN_MAX):
            step /= 2
            continue
        if (gap := distance(current, following)) > 1:
            step *= max(0.25, STEP_SAFETY / gap)
            continue
        turn = float(np.arccos(np.clip(following.tangent @ current.tangent, -1, 1)))
        grown = min(float(np.clip(TANGENT_TURN_MAX / 3 / max(turn, 1e-9), 0.5, 1.5)), STEP_SAFETY / max(gap, 1e-9))
        step = min(step * grown, longest)
        current = following
        yield current


def follow_until(
    problem: OrbitProblem,
    steps: Iterable[OrbitPoint],
    excess: Callable[[OrbitPoint], float],
    max_orbits: int,
    *,
    smallest: float = 0.0,
    report: Callable[[Sequence[OrbitPoint]], object] = lambda points: None,
) -> tuple[list[OrbitPoint], bool]:
    """The points up to the one where a test function reaches 0, and whether it does.

    They end before that after `max_orbits`, and where the largest angle (rad) has become the `smallest`.
    """
    points: list[OrbitPoint] = []
    for current in steps:
        points.append(current)
        report(points)
        if excess(current) >= 0:
            if len(points) > 1:
                points[-1] = locate(problem, points[-2], current, excess)
            return points, True
        if len(points) >= max_orbits or current.orbit.amplitude < smallest:
            break
    return points, False


def outside_range(first: OrbitPoint) -> Callable[[OrbitPoint], float]:
    """A test function that reaches 0 where a number leaves its range, once past the first point at one of its ends."""
    return lambda current: -0.5 if current is first else abs(float(current.u[-1]) - 0.5) - 0.5


def between(
    problem: OrbitProblem, start_point: OrbitPoint, end_point: OrbitPoint, part: float, rcond: float | None = None
) -> OrbitPoint:
    """The point at a fraction of the way from one point to the next, from the cubic through both and their tangents.

    Directions with singular values below `rcond`, relative, are those of the cubic, if that is a solution.
    """
    way = end_point.u - start_point.u
    length, x = float(np.linalg.norm(way)), part
    start, end = length * start_point.tangent, length * end_point.tangent
    guess = start_point.u + x * x * (3 - 2 * x) * way + x * (1 - x) * ((1 - x) * start - x * end)
    row = 6 * x * (1 - x) * way + (1 - x) * (1 - 3 * x) * start + x * (3 * x - 2) * end
    row = row / np.linalg.norm(row)
    tries = [(guess, None), (start_point.u + x * way, None)]
    for trial, cutoff in tries if rcond is None else [(guess, rcond), *tries]:
        if inner := point(problem, trial, row, cutoff):
            return inner
    raise ComputationError("the branch of orbits was lost between two of its points")


def place_in(variation: Variation, value: float) -> float:
    """The place of a value in the range of a number, 0 at its lower end and 1 at its upper one."""
    low, high = variation.values[0], variation.values[-1]
    return float(np.log(value / low) / np.log(high / low)) if variation.log else (value - low) / (high - low)


def value_in(variation: Variation, place: float) -> float:
    """The value at a place in the range of a number."""
    low, high = variation.values[0], variation.values[-1]
    return float(low * (high / low) ** place if variation.log else low + (high - low) * place)


def with_values(problem: OrbitProblem, points: Sequence[OrbitPoint], variation: Variation) -> list[OrbitPoint]:
    """The points of a branch and those at the values of a number between two of them; u ends with its place."""
    places = np.array([place_in(variation, value) for value in variation.values[1:-1]])
    merged_points = list(points[:1])
    for following in points[1:]:
        low, high = sorted((float(merged_points[-1].u[-1]), float(following.u[-1])))
        passed_places = np.sort(places[(places > low) & (places < high)])
        for place in passed_places if merged_points[-1].u[-1] < following.u[-1] else passed_places[::-1]:
            merged_points.append(locate(problem, merged_points[-1], following, partial(_past, float(place))))
        merged_points.append(following)
    return merged_points


def at_edge(problem: OrbitProblem, inner: OrbitPoint, outer: OrbitPoint) -> OrbitPoint:
    """The point at the end of the range of a number that the second of two neighbours has passed."""
    return locate(problem, inner, outer, partial(_past, float(outer.u[-1] > 0.5)))


def _past(place: float, current: OrbitPoint) -> float:
    return float(current.u[-1]) - place


def locate(
    problem: OrbitProblem,
    start: OrbitPoint,
    end: OrbitPoint,
    test: Callable[[OrbitPoint], float],
    *,
    crossing: bool = False,
) -> OrbitPoint:
    """The point between two where a test function is 0; it has different signs at them (Illinois' rule).

    Where branches cross, the equations do not fix how far along the other branch a point is: there it is that of the
    cubic.  If Newton's method fails all the same, the nearest point found is the answer.
    """
    low, high, f_low, f_high = 0.0, 1.0, test(start), test(end)
    best, size = (start, abs(f_low)) if abs(f_low) < abs(f_high) else (end, abs(f_high))
    kept_end, enough, misses = 0, PLACE_ACCURACY * max(abs(f_low), abs(f_high)), 0
    while high - low >= PLACE_ACCURACY:
        part = (low * f_high - high * f_low) / (f_high - f_low)
        if misses:
            part = low + BRACKET_PARTS[misses - 1] * (high - low)
        if not low < part < high:
            break
        try:
            inner = between(problem, start, end, part, CROSSING_SINGULAR_RATIO if crossing else None)
        except ComputationError:
            misses += 1
            if misses > len(BRACKET_PARTS):
                break
            continue
        value, misses = test(inner), 0
        if abs(value) < size:
            best, size = inner, abs(value)
        if size < enough:
            break
        if (value > 0) == (f_high > 0):
            high, f_high = part, value
            f_low, kept_end = (f_low / 2, 0) if kept_end == 1 else (f_low, 1)
        else:
            low, f_low = part, value
            f_high, kept_end = (f_high / 2, 0) if kept_end == -1 else (f_high, -1)
    return best
