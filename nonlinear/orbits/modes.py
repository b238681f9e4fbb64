"""Nonlinear normal modes: the family of periodic orbits that begins in a mode of the table, and its backbone."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes
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
    modes, scene = checked(scene, number), scene.conservative
    problem, linear = quarter_of(scene, tolerance, fast), modes[number - 1]
    first = min(first, to / 2)
    points: list[Point] = []
    for here in follow(problem, beginning(problem, modes, number, first), step=first, longest=longest):
        points.append(here)
        report(degrees(here.orbit.amplitude))
        if here.orbit.amplitude >= to or len(points) >= most:
            break
    complete = points[-1].orbit.amplitude >= to
    if complete:
        points[-1] = located(problem, points[-2], points[-1], lambda each: each.orbit.amplitude - to)
    special = tuple(along_backbone(problem, points)) if locate else ()
    origin = f"mode {linear.number}"
    return Branch(origin, tuple(points), special, problem, complete=complete)


def checked(scene: Scene, number: int) -> Modes:
    """The modes of a scene without dampers and drives; SceneError where this one is no oscillation along the rail."""
    modes = natural_modes(scene.conservative)
    if scene.space == "space":
        raise SceneError(["periodic orbits: only for scenes in the plane"])
    if not 1 <= number <= len(modes):
        raise SceneError([f"mode {number}: the scene has modes 1 to {len(modes)}"])
    if np.any(modes.eigenvalue.real > 0):
        raise SceneError([f"mode {number}: the equilibrium is unstable"])
    if modes.omega[number - 1] == 0:
        raise SceneError([f"mode {number}: a rigid translation does not oscillate"])
    return modes


def beginning(problem: Quarter, modes: Modes, number: int, amplitude: float) -> Point:
    """The orbit of this amplitude (rad) beside a linear mode, with the tangent towards larger ones."""
    shape = modes.shape(number - 1)
    cart = [float(np.real(shape.cart))] if problem.half > len(shape.angles) else []
    phi = np.array([*cart, *np.real(shape.angles)]) / problem.flow.scale[: problem.half]
    phi = phi / np.abs(np.real(shape.angles)).max()
    quarter = np.pi / 2 / modes.omega[number - 1] * problem.clock
    row = np.append(phi, 0.0) / np.linalg.norm(phi)
    found = point(problem, np.append(amplitude * phi, quarter), row)
    if found is None:
        raise ComputationError(f"mode {number}: no periodic orbit of {degrees(amplitude):.3g} deg was found beside it")
    return found
