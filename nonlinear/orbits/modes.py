"""Nonlinear normal modes: the family of periodic orbits that begins in a mode of the table, and its backbone."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes, table_numbers
from modal.scene import Scene
from nonlinear.orbits.branch import Branch, Report
from nonlinear.orbits.continuation import Point, follow, located, point
from nonlinear.orbits.special import along_backbone
from nonlinear.orbits.symmetric import Quarter, quarter_of

TOLERANCE = 1e-12
SMALL = radians(0.5)  # the first orbit of a branch
STEP = 0.08  # longest step in natural units
MOST = 2000  # orbits of a branch


def nonlinear_mode(
    scene: Scene,
    number: int,
    to: float = radians(90),
    *,
    first: float = SMALL,
    longest: float = STEP,
    tolerance: float = TOLERANCE,
    most: int = MOST,
    locate: bool = True,
    fast: bool | None = None,
    report: Report = lambda reached: None,
) -> Branch:
    """The orbits from mode `number` of the table (from 1) up to a largest angle `to` (rad), which the last one has.

    Dampers and drives are left out.  The branch ends before `to` where it ends by itself or after `most` orbits, and is
    then not `complete`.  Raises SceneError for a mode that the scene does not have or that is no oscillation along the
    rail, ComputationError where no orbit is found beside the linear mode.
    """
    modes, row = oscillating(scene, number)
    problem = quarter_of(modes.scene, tolerance, fast)
    first = min(first, to / 2)
    points: list[Point] = []
    for here in follow(problem, beginning(problem, modes, row, first), step=first, longest=longest):
        points.append(here)
        report(degrees(here.orbit.amplitude))
        if here.orbit.amplitude >= to or len(points) >= most:
            break
    complete = points[-1].orbit.amplitude >= to
    if complete:
        points[-1] = located(problem, points[-2], points[-1], lambda each: each.orbit.amplitude - to)
    special = tuple(along_backbone(problem, points)) if locate else ()
    return Branch(f"mode {number}", tuple(points), special, problem, complete=complete)


def oscillating(scene: Scene, number: int) -> tuple[Modes, int]:
    """The modes of a scene without dampers and drives, and the index among them of this mode of its table (from 1).

    SceneError where it is no oscillation along the rail.
    """
    if scene.space == "space":
        raise SceneError(["periodic orbits: only for scenes in the plane"])
    modes, still = natural_modes(scene), natural_modes(scene.conservative)
    if not 1 <= number <= len(modes):
        raise SceneError([f"mode {number}: the scene has modes 1 to {len(modes)}"])
    rows = np.flatnonzero(table_numbers(scene, still) == number)
    if not rows.size:
        raise SceneError([f"mode {number}: is a mode of the dampers alone, which does not oscillate"])
    row = int(rows[0])
    if np.any(still.eigenvalue.real > 0):
        raise SceneError([f"mode {number}: the equilibrium is unstable"])
    if still.omega[row] == 0:
        raise SceneError([f"mode {number}: a rigid translation does not oscillate"])
    return still, row


def beginning(problem: Quarter, modes: Modes, row: int, amplitude: float) -> Point:
    """The orbit of this amplitude (rad) beside the linear mode of this index, with the tangent towards larger ones."""
    shape = modes.shape(row)
    cart = [float(np.real(shape.cart))] if problem.half > len(shape.angles) else []
    phi = np.array([*cart, *np.real(shape.angles)]) / problem.flow.scale[: problem.half]
    phi = phi / np.abs(np.real(shape.angles)).max()
    quarter = np.pi / 2 / modes.omega[row] * problem.clock
    across = np.append(phi, 0.0) / np.linalg.norm(phi)
    found = point(problem, np.append(amplitude * phi, quarter), across)
    if found is None:
        raise ComputationError(f"no periodic orbit of {degrees(amplitude):.3g} deg was found beside the linear mode")
    return found
