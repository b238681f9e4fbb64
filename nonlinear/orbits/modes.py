"""Nonlinear normal modes: the family of periodic orbits that emanates from a linear mode, and its backbone.

Along a parameter of the scene they have a constant amplitude: to the equations of `symmetric` comes the largest angle
of any link over the period, A(q) = A_0.  It is reached by one link at an instant t at which that link turns back, so
that its derivative is that of the link's angle at t.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import takewhile
from math import degrees, radians

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes, table_numbers
from modal.report import silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_number, formerly
from modal.scene.parameters import Variable, Variation, validate_variations, variation_of
from modal.types import Floats
from nonlinear.orbits.branch import Branch, Report, finished_branch
from nonlinear.orbits.continuation import (
    BRANCH_ORBITS_MAX,
    DENSE_BRANCH_ORBITS_MAX,
    STEP_MAX,
    OrbitPoint,
    correct,
    follow,
    follow_until,
    locate,
    outside_range,
    point,
    tangent_of,
    value_in,
)
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import TOLERANCE_MAX, TOLERANCE_MIN
from nonlinear.orbits.special import (
    Passage,
    Special,
    along_backbone,
    at_energy_fold,
    last_slope,
    special_points,
    symmetric_passage,
)
from nonlinear.orbits.symmetric import Quarter, quarter_of

FIRST_ANGLE = radians(0.5)
"""Cost: default of the first orbit's largest angle; benchmarks/orbits.py."""
SEARCH_ANGLE_MAX = radians(170)
"""Limit: where no frequency is off by that much up to here, none is."""
ANGLE_MAX = 20.0
"""Limit: largest angle (rad) that can be requested, "must be a finite number from 1e-12 to 20"."""


@formerly(number="mode", to="largest_angle")
@checked
def nonlinear_mode(
    scene: Scene,
    mode: int,
    largest_angle: float = radians(90),
    *,
    energy: float | None = None,
    first: float = FIRST_ANGLE,
    longest: float = 0.08,
    tolerance: float = ORBIT_TOLERANCE,
    max_orbits: int | None = None,
    locate: bool = True,
    report: Report = silent,
) -> Branch:
    """Follow the orbits from a `mode` of the table (from 1) up to a `largest_angle` (rad), which the last one has.

    With an `energy` (J, above that of the equilibrium) the last one has this energy instead, if that comes first.
    Dampers and drives are omitted. To `locate` special points, orbits are added where stability changes twice between
    two others. The branch ends before that where it ends by itself or after `max_orbits` (4,000) orbits, and is then
    not `complete`. Raise SceneError for a mode that the scene does not have or that is no oscillation along the rail,
    ComputationError if no orbit is found next to the linear mode.
    """
    checked_number("largest_angle", largest_angle, ORBIT_TOLERANCE, ANGLE_MAX)
    checked_number("first", first, ORBIT_TOLERANCE, ANGLE_MAX)
    checked_number("tolerance", tolerance, TOLERANCE_MIN, TOLERANCE_MAX)
    if energy is not None:
        checked_number("energy", energy, ORBIT_TOLERANCE)
    modes, row = oscillating(scene, mode)
    problem = quarter_of(modes.scene, tolerance)
    first = min(first, largest_angle / 2)
    steps = follow(problem, beginning(problem, modes, row, first), step=first, longest=longest)

    def excess(current: OrbitPoint) -> float:
        """How far an orbit is beyond the largest angle or the energy requested, whichever is nearer."""
        over = current.orbit.amplitude - largest_angle
        return over if energy is None else max(over, current.orbit.energy / energy - 1)

    def tell(points: Sequence[OrbitPoint]) -> None:
        report(degrees(points[-1].orbit.amplitude))

    points, complete = follow_until(problem, steps, excess, max_orbits or DENSE_BRANCH_ORBITS_MAX, report=tell)
    origin, linear = f"mode {mode}", float(modes.omega[row])
    if locate:
        return finished_branch(origin, problem, points, along_backbone, complete=complete, linear=linear)
    return Branch(origin, tuple(points), (), problem, complete=complete, linear=linear)


@checked
def mode_orbit(scene: Scene, number: int, amplitude: float) -> Orbit:
    """The orbit of mode `number` of the table (from 1) with this largest angle (rad) of any link.

    Raises what `nonlinear_mode` does, and ComputationError where the branch does not reach this angle.
    """
    branch = nonlinear_mode(scene, number, amplitude, longest=2 * STEP_MAX, locate=False)
    if not branch.complete:
        raise ComputationError(f"the orbits of mode {number} do not reach {degrees(amplitude):.4g} deg")
    return branch.orbits[-1]


@checked
def orbit_where_off(scene: Scene, number: int, share: float = 0.01) -> Orbit | None:
    """The first orbit of mode `number` whose frequency is this share off the linear one.

    None if there is none up to 170°; raises what `nonlinear_mode` does.
    """
    modes, row = oscillating(scene, number)
    problem, linear = quarter_of(modes.scene, ORBIT_TOLERANCE), float(modes.omega[row])

    def off(current: OrbitPoint) -> float:
        return abs(current.orbit.omega / linear - 1) - share

    steps = follow(problem, beginning(problem, modes, row, FIRST_ANGLE), step=FIRST_ANGLE, longest=2 * STEP_MAX)
    inside = takewhile(lambda current: current.orbit.amplitude < SEARCH_ANGLE_MAX, steps)
    points, has_reached = follow_until(problem, inside, off, DENSE_BRANCH_ORBITS_MAX)
    return points[-1].orbit if has_reached else None


def at_amplitude(branch: Branch, amplitude: float) -> Orbit | None:
    """The first orbit of a branch with this largest angle (rad), None if it has none."""
    larger = np.flatnonzero(branch.amplitude >= amplitude)
    if not larger.size or larger[0] == 0:
        return None
    last_below, first_above = branch.points[larger[0] - 1], branch.points[larger[0]]
    return locate(branch.problem, last_below, first_above, lambda current: current.orbit.amplitude - amplitude).orbit


@checked
def oscillating(scene: Scene, number: int) -> tuple[Modes, int]:
    """The modes of a scene without dampers and drives, and the index among them of this mode of its table (from 1).

    Raise SceneError if it is no oscillation along the rail.
    """
    require(scene, "a periodic orbit of a mode")
    modes, conservative_modes = natural_modes(scene), natural_modes(scene.conservative)
    if not 1 <= number <= len(modes):
        raise SceneError([f"mode {number}: the scene has modes 1 to {len(modes)}"])
    rows = np.flatnonzero(table_numbers(scene, conservative_modes) == number)
    if not rows.size:
        raise SceneError([f"mode {number}: is overdamped and does not oscillate"])
    row = int(rows[0])
    if conservative_modes.eigenvalue[row].real > 0:
        raise SceneError([f"mode {number}: grows without oscillating, as inverted links do, and has no orbits"])
    if conservative_modes.omega[row] == 0:
        raise SceneError([f"mode {number}: a rigid translation does not oscillate"])
    shape = conservative_modes.shape(row)
    hanging = float(np.finfo(float).eps ** 0.5) * np.abs(shape.supports).max(initial=0.0)
    if np.abs(shape.angles).max() < hanging:  # a mode of supports, which leaves every link as it hangs
        raise SceneError([f"mode {number}: moves no link, and orbits are labelled by the largest angle of one"])
    return conservative_modes, row


def beginning(problem: Quarter, modes: Modes, row: int, amplitude: float) -> OrbitPoint:
    """The orbit of this amplitude (rad) next to the linear mode of this index, with the tangent towards larger ones."""
    shape = modes.shape(row)
    phi = np.real(modes.column(shape)) / problem.flow.scale[: problem.half]
    phi = phi / np.abs(np.real(shape.angles)).max()
    quarter = 2 * np.pi / problem.parts / modes.omega[row] * problem.clock
    direction = np.append(phi, 0.0) / np.linalg.norm(phi)
    start = point(problem, np.append(amplitude * phi, quarter), direction)
    if start is None:
        raise ComputationError(f"no periodic orbit of {degrees(amplitude):.3g} deg was found near the linear mode")
    return start


@dataclass(frozen=True, eq=False)
class Held:
    """Equations of orbits with the largest angle `amplitude` (rad): the u of `Quarter`, then the place in the range."""

    quarter_at: Callable[[float], Quarter]
    variation: Variation
    amplitude: float

    def quarter(self, u: Floats, aside: float = 0.0) -> Quarter:
        """The equations at the value of the number in u, or this far aside in its range."""
        return self.quarter_at(value_in(self.variation, float(u[-1]) + aside))

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """The coordinates a quarter of a period later and the excess of the largest angle, and their derivatives."""
        quarter = self.quarter(u)
        nudge = quarter.flow.tolerance**0.5  # rounding and curvature take equal parts of a one-sided difference
        neighbour = self.quarter(u, nudge)
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
        return replace(self.quarter(u).orbit(u[:-1]), value=value_in(self.variation, float(u[-1])))


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

    def tell(points: Sequence[OrbitPoint]) -> None:
        report(len(points))

    steps = follow(problem, first, step=STEP_MAX / 4, longest=STEP_MAX)
    points, complete = follow_until(problem, steps, outside_range(first), BRANCH_ORBITS_MAX, report=tell)
    return finished_branch(
        f"mode {mode}", problem, points, _along_number, variation, complete=complete, linear=begin.linear
    )


def _along_number(problem: Held, points: Sequence[OrbitPoint]) -> Iterator[Special]:
    """Folds of the number; and of the orbits of one scene, folds of their energy, branch points and collisions."""

    def passage(start: OrbitPoint, end: OrbitPoint, sign: int) -> Passage:
        is_mirrored = problem.quarter(start.u).parts == 4
        if at_energy_fold(sign, is_mirrored) and _energy_turns(problem, start, end):
            return "fold", "energy", False
        return symmetric_passage(sign, is_mirrored)

    return special_points(problem, points, {problem.variation.path: last_slope}, passage)


def _energy_turns(problem: Held, start: OrbitPoint, end: OrbitPoint) -> bool:
    """Whether the energy along the orbits of one scene grows at one point and falls at the other."""
    tangent = np.zeros(len(start.u) - 1)
    slopes = []
    for end_point in (start, end):
        quarter = problem.quarter(end_point.u)
        tangent = tangent_of(quarter.equations(end_point.u[:-1])[1], tangent)
        slopes.append(quarter.energy_slope(end_point.u[:-1], tangent))
    return slopes[0] * slopes[1] < 0
