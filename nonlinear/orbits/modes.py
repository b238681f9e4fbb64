"""Nonlinear normal modes: the family of periodic orbits that emanates from a linear mode, and its backbone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import takewhile
from math import degrees, radians

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes, table_numbers
from modal.report import silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_number, formerly
from nonlinear.orbits.between import refined_points
from nonlinear.orbits.branch import Branch, Report
from nonlinear.orbits.continuation import (
    DENSE_BRANCH_ORBITS_MAX,
    STEP_MAX,
    OrbitPoint,
    follow,
    locate,
    point,
)
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import TOLERANCE_MAX, TOLERANCE_MIN
from nonlinear.orbits.special import along_backbone
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

    points, complete = _until(problem, steps, excess, max_orbits or DENSE_BRANCH_ORBITS_MAX, report)
    points = refined_points(problem, points) if locate else points
    special = tuple(along_backbone(problem, points)) if locate else ()
    return Branch(f"mode {mode}", tuple(points), special, problem, complete=complete, linear=float(modes.omega[row]))


def _until(
    problem: Quarter,
    steps: Iterable[OrbitPoint],
    excess: Callable[[OrbitPoint], float],
    max_orbits: int,
    report: Report = silent,
) -> tuple[list[OrbitPoint], bool]:
    """The points up to the one where a test function reaches 0, and whether it does."""
    points: list[OrbitPoint] = []
    for current in steps:
        points.append(current)
        report(degrees(current.orbit.amplitude))
        if excess(current) >= 0:
            if len(points) > 1:
                points[-1] = locate(problem, points[-2], current, excess)
            return points, True
        if len(points) >= max_orbits:
            break
    return points, False


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
    points, has_reached = _until(problem, inside, off, DENSE_BRANCH_ORBITS_MAX)
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
