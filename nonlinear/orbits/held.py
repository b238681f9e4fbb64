"""Symmetric orbits of constant amplitude along a parameter of the scene.

To the equations of `symmetric` comes the largest angle of any link over the period, A(q) = A_0.  It is reached by one
link at an instant t at which that link turns back, so that its derivative is that of the link's angle at t.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import degrees, radians

import numpy as np

from modal.errors import ComputationError
from modal.report import silent
from modal.scene import Scene
from modal.scene.doors import checked, formerly
from modal.scene.parameters import Variable, Variation, validate_variations, variation_of
from modal.types import Floats
from nonlinear.orbits.between import refined_points
from nonlinear.orbits.branch import Branch, Report
from nonlinear.orbits.continuation import (
    BRANCH_ORBITS_MAX,
    STEP_MAX,
    OrbitPoint,
    at_edge,
    correct,
    follow,
    locate,
    tangent_of,
    with_values,
)
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.modes import nonlinear_mode, oscillating
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import Special, collisions, passing
from nonlinear.orbits.symmetric import Quarter, quarter_of


@dataclass(frozen=True, eq=False)
class Held:
    """Equations of orbits with the largest angle `amplitude` (rad): the u of `Quarter`, then the place in the range."""

    quarter_at: Callable[[float], Quarter]
    variation: Variation
    amplitude: float

    def value(self, place: float) -> float:
        """The value at a place in the range, 0 at its lower end and 1 at its upper one."""
        low, high = self.variation.values[0], self.variation.values[-1]
        return float(low * (high / low) ** place if self.variation.log else low + (high - low) * place)

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """The coordinates a quarter of a period later and the excess of the largest angle, and their derivatives."""
        quarter = self.quarter_at(self.value(u[-1]))
        nudge = quarter.flow.tolerance**0.5  # rounding and curvature take equal parts of a one-sided difference
        neighbour = self.quarter_at(self.value(u[-1] + nudge))
        r, J = quarter.equations(u[:-1])
        neighbour_r, _ = neighbour.equations(u[:-1])
        angle, slope = _largest(quarter, u[:-1])
        neighbour_angle, _ = _largest(neighbour, u[:-1])
        rows = np.vstack(
            (np.column_stack((J, (neighbour_r - r) / nudge)), np.append(slope, (neighbour_angle - angle) / nudge))
        )
        return np.append(r, angle - self.amplitude), rows

    def orbit(self, u: Floats) -> Orbit:
        """The orbit with its multipliers."""
        value = self.value(u[-1])
        return replace(self.quarter_at(value).orbit(u[:-1]), value=value)


def _largest(problem: Quarter, u: Floats) -> tuple[float, Floats]:
    """The largest angle (rad) of any link over a quarter of a period, and its derivative by u."""
    n, scale, first = problem.half, problem.flow.scale, problem.flow.equations.layout.first
    y, quarter = problem.start(u), float(u[-1]) / problem.clock
    path = problem.flow(y, np.zeros((2 * n, 0)), quarter).path
    angles = np.abs(path.states[:, first:n] - problem.flow.rest[first:])
    at, link = np.unravel_index(int(angles.argmax()), angles.shape)
    time, column = float(path.times[at]), first + int(link)
    for _ in range(4 if at else 0):
        end = problem.flow(y, np.zeros((2 * n, 0)), time)
        time -= float(end.y[n + column] / end.path.rates[-1][n + column])
    if time <= 0:
        end_y, V = y, np.eye(2 * n)[:, :n] * scale[:n]
    else:
        arrival = problem.flow(y, np.eye(2 * n)[:, :n] * scale[:n], time)
        end_y, V = arrival.y, arrival.V
    turn = float(end_y[column] - problem.flow.rest[column])
    return abs(turn), np.append(np.sign(turn) * V[column], 0.0)


@formerly(number="mode", variation="vary", amplitude="largest_angle")
@checked
def mode_along(
    scene: Scene,
    mode: int,
    vary: str | Variation,
    largest_angle: float = radians(30),
    *,
    tolerance: float = ORBIT_TOLERANCE,
    report: Report = silent,
) -> Branch:
    """The orbits of a `mode` of the table with this largest angle (rad), along a number of the scene.

    They begin at the first value and are followed, through folds, until they leave the range.  Raises what
    `nonlinear_mode` does, and SceneError for a place that the scene does not have.
    """
    variation = variation_of(vary)
    validate_variations(scene, [variation])
    variable = Variable(scene, [variation.path])

    @lru_cache(maxsize=8)
    def quarter_at(value: float) -> Quarter:
        return quarter_of(variable.at({variation.path: value}).conservative, tolerance)

    problem = Held(quarter_at, variation, largest_angle)
    first_scene = variable.at({variation.path: variation.values[0]})
    begin = nonlinear_mode(first_scene, mode, largest_angle, longest=2 * STEP_MAX, locate=False)
    if not begin.complete:
        raise ComputationError(f"the orbits of mode {mode} do not reach {degrees(largest_angle):.4g} deg")
    u = np.append(begin.points[-1].u, 0.0)
    up = np.append(np.zeros(len(u) - 1), 1.0)
    if (solution := correct(problem, u, up)) is None:
        raise ComputationError("no periodic orbit was found at the first value")
    first = OrbitPoint(solution[0], tangent_of(solution[1], up), problem.orbit(solution[0]))
    points: list[OrbitPoint] = []
    complete = False
    for current in follow(problem, first, step=STEP_MAX / 4, longest=STEP_MAX):
        points.append(current)
        report(len(points))
        if len(points) > 1 and not 0 < current.u[-1] < 1:
            points[-1] = at_edge(problem, points[-2], current)
            complete = True
            break
        if len(points) >= BRANCH_ORBITS_MAX:
            break
    modes, row = oscillating(first_scene, mode)
    points = with_values(problem, refined_points(problem, points), variation)
    special = tuple(_specials(problem, points))
    return Branch(
        f"mode {mode}", tuple(points), special, problem, variation, complete=complete, linear=float(modes.omega[row])
    )


def _specials(problem: Held, points: Sequence[OrbitPoint]) -> Iterator[Special]:
    """Folds of the number; and of the orbits of one scene, folds of their energy, branch points and collisions."""

    def turning(point: OrbitPoint) -> float:
        return float(point.tangent[-1])

    for index, (start, end) in enumerate(pairwise(points)):
        if turning(start) * turning(end) < 0:
            special = locate(problem, start, end, turning)
            yield Special("fold", special.orbit, index, special, problem.variation.path)
        is_mirrored = problem.quarter_at(problem.value(start.u[-1])).parts == 4
        for sign in (1, -1):
            if test := passing(start, end, sign):
                special = locate(problem, start, end, test)
                is_energy_fold = sign == (-1 if is_mirrored else 1) and _energy_turns(problem, start, end)
                kind, of = ("fold", "energy") if is_energy_fold else ("branch point", "")
                if not is_mirrored and sign < 0:
                    kind = "period doubling"
                yield Special(kind, special.orbit, index, special, of, breaks=is_mirrored and sign > 0)
        for collision in collisions(problem, start, end):
            yield Special("collision", collision.orbit, index, collision)


def _energy_turns(problem: Held, start: OrbitPoint, end: OrbitPoint) -> bool:
    """Whether the energy along the orbits of one scene grows at one point and falls at the other."""
    tangent = np.zeros(len(start.u) - 1)
    slopes = []
    for point in (start, end):
        quarter = problem.quarter_at(problem.value(point.u[-1]))
        tangent = tangent_of(quarter.equations(point.u[:-1])[1], tangent)
        slopes.append(quarter.energy_slope(point.u[:-1], tangent))
    return slopes[0] * slopes[1] < 0
