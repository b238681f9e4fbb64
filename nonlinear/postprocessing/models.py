"""Linear models of a scene in motion: at any state, and along a run.

A small deviation z of a motion (q, q') obeys, with the derivatives of its equations along it,

    z' = A z + B u,   A = ∂f/∂y,   B = ∂f/∂u,

where A is taken from the tape of the equations and B by an infinitesimal step of the inputs, so that no M is inverted.
The place h(q) of a point with the rows J = ∂h/∂q deviates by J δq, and its acceleration by J δq'' + 2 J' δq' + J'' δq.
At a state that is no equilibrium the model holds at that instant alone: the motion passes through it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modal.errors import SceneError, refuse_any
from modal.scene import Scene, require, validate_scene
from modal.scene.doors import checked
from modal.statespace import StateSpace
from modal.statespace.geometry import Geometry, geometry_of
from modal.statespace.model import LocalModel, assemble
from modal.statespace.sampling import VaryingModel, table_of
from modal.statespace.signals import is_point
from modal.types import EPS, Floats
from nonlinear.dynamics.variational import Variational
from nonlinear.integration.trajectory import Trajectory
from nonlinear.system import State, system_of, validate_state

OF_POINTS = {"link_forces", "joint_torques", "joint_positions", "tip_positions", "tip_accelerations", "pivot_forces"}
OF_SPRINGS = {"spring_forces", "spring_extensions"}
CHANGING = {"cart_velocity", "support_displacement", "support_velocity", "support_acceleration"}


@checked
def model_at(
    scene: Scene, state: State, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = (), *, time: float = 0.0
) -> StateSpace:
    """The linear model of a scene about its motion through a state.

    Parameters
    ----------
    scene
        The scene, in the plane.
    state
        Where it is: angles (rad) and rates (rad/s), and those of their supports.
    inputs, outputs
        As in `modal.statespace.state_space`.
    time
        When (s), for supports that move and forces that change.

    Returns
    -------
    StateSpace
        The model of deviations.  `operating_point` has coordinates, and where these do not stay, all rates and
        accelerations.

    Raises
    ------
    SceneError
        What the scene has, or an input or output, has no such model.
    ComputationError
        The mass matrix is singular.

    Examples
    --------
    >>> import numpy as np
    >>> from modal import load
    >>> from nonlinear import state_at_rest
    >>> model = model_at(load("chain-1"), state_at_rest(load("chain-1"), [60.0]))
    >>> round(float(model.A[1, 0]), 6)
    -4.905
    """
    motion = _InMotion(validate_scene(scene))
    motion.validate(inputs, outputs)
    y = motion.equations.begin(validate_state(state, motion.equations.system))
    return assemble(scene, None, inputs, outputs, motion.local(time, y))


@checked
def models_along(run: Trajectory, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> VaryingModel:
    """The linear models of a run's scene about the run, one for each of its times.

    Parameters
    ----------
    run
        The run, in the plane, without a load.
    inputs, outputs
        As in `modal.statespace.state_space`.

    Returns
    -------
    VaryingModel
        A (T, n, n) and B (T, n, m) at the run's times, C and D; `operating_point` has arrays (T,).

    Raises
    ------
    SceneError
        As in `model_at`; or unrecorded forces acted on the run.
    ComputationError
        The mass matrix is singular, or the table is too large.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import simulate
    >>> models_along(simulate(load("chain-2"), 1.0, output=5)).A.shape
    (5, 4, 4)
    """
    if run.driven:
        raise SceneError(["run: applied forces acted on it, which are not stored with it"])
    motion = _InMotion(run.scene)
    motion.validate(inputs, outputs)
    rows = motion.equations.layout.rows(run.motion)
    rows_by_time = dict(zip(run.times.tolist(), rows, strict=True))
    points = []

    def model(time: float) -> StateSpace:
        local = motion.local(time, rows_by_time[time], is_momentary=True)
        points.append([value for _, value in local.operating_point])
        return assemble(run.scene, None, inputs, outputs, local)

    table = table_of(run.scene, run.times, model)
    return replace(table, operating_point=tuple(zip(motion.names, np.array(points).T, strict=True)))


@dataclass(frozen=True)
class _InMotion:
    """The derivatives of a scene's equations of motion."""

    scene: Scene

    def validate(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        """Raise SceneError for a scene, inputs and outputs without such a model."""
        require(self.scene, "a model along a motion")
        problems = [f"input {name}: in motion only its acceleration has a model" for name in inputs if name in CHANGING]
        if self.scene.has_modal_damping and "cart_acceleration" in inputs:
            problems += ["input cart_acceleration: damping ratios are those of the cart free: use cart_force"]
        is_carried = self.scene.is_structured
        for kind, names in (("input", inputs), ("output", outputs)):
            for name in names:
                if is_carried and (name in OF_POINTS or is_point(name)):
                    problems.append(f"{kind} {name}: points on a structure have no model in motion")
                elif name in OF_SPRINGS or (name == "pivot_forces" and self.scene.spring):
                    problems.append(f"{kind} {name}: springs between points have no model of their forces in motion")
        if "pivot_forces" in outputs and "quadratic_drag" in self.scene.features:
            problems.append("output pivot_forces: has no term for quadratic drag")
        refuse_any(problems)

    @cached_property
    def equations(self) -> Variational:
        """The equations of motion under a force on every coordinate, of nothing."""
        system = system_of(self.scene)
        nothing = np.zeros(Variational(system).layout.half)
        return Variational(system, force=lambda time: nothing)

    @cached_property
    def geometry(self) -> Geometry:
        """The rows of the scene at rest, with links along the vertical."""
        return geometry_of(self.scene.still.replace(force=()))

    @cached_property
    def names(self) -> list[str]:
        """The names of all coordinates, their rates and their accelerations."""
        first, labels = self.geometry.coordinates, self.geometry.labels
        places = [*(coordinate.name for coordinate in first), *(f"theta_{label}" for label in labels)]
        rates = [*(coordinate.derivative(1) for coordinate in first), *(f"theta_dot_{label}" for label in labels)]
        seconds = [*(coordinate.derivative(2) for coordinate in first), *(f"theta_ddot_{label}" for label in labels)]
        return places + rates + seconds

    def local(self, time: float, y: Floats, *, is_momentary: bool = False) -> LocalModel:
        """The equations near one y (d,) at a time (s)."""
        equations, half = self.equations, self.equations.layout.half
        u = [] if equations.inputs_at is None else [*equations.inputs_at(time, y.tolist())]
        rates, J = equations.linearize(y, u)

        def accelerations(F: Floats) -> Floats:
            count = F.shape[1]
            if not count:
                return np.zeros((half, 0))
            steps = np.zeros((len(u), count))
            steps[len(u) - half :] = F
            sides = np.repeat(y[:, None], count, axis=1)
            inputs = np.repeat(np.array(u)[:, None], count, axis=1)
            return equations.moved_by(np.zeros(len(equations.numbers)), sides, inputs, steps)[half:]

        values = np.concatenate((y, rates[half:]))
        unit = equations.layout.natural(equations.system)
        speeds = np.concatenate((y[half:], rates[half:] / equations.system.rate)) / np.tile(unit[half:], 2)
        is_steady = bool(np.abs(speeds).max(initial=0.0) <= EPS**0.5)
        shown = half if is_steady and not is_momentary else len(values)
        point = tuple(zip(self.names[:shown], values[:shown].tolist(), strict=True))
        geometry = self._geometry_at(y[:half], y[half:], rates[half:])
        return LocalModel(geometry, -J[half:, :half], -J[half:, half:], accelerations, point)

    def _geometry_at(self, q: Floats, v: Floats, a: Floats) -> Geometry:
        """The rows of all points where links lean, with their first two derivatives in time."""
        geometry, first = self.geometry, self.geometry.leading
        angle, rate, bend = q[first:], v[first:], a[first:]
        across, sinking = np.cos(angle), -np.sin(angle)
        at_angles = replace(geometry, across=across, sinking=sinking, rest=angle)
        if self.scene.is_structured:
            return at_angles
        rail, none = geometry.centres[:, :first], np.zeros((len(angle), first))
        (centres, joints), (rates, end_rates), (bends, end_bends) = map(
            self._rows, (across, sinking * rate, sinking * bend - across * rate**2)
        )
        return replace(
            at_angles,
            centres=np.hstack([rail, centres]),
            joints=np.hstack([rail, joints]),
            rate=np.hstack([none, rates]),
            bend=np.hstack([none, bends]),
            end_rate=np.hstack([none, end_rates]),
            end_bend=np.hstack([none, end_bends]),
        )

    def _rows(self, parts: Floats) -> tuple[Floats, Floats]:
        """Rows (L, L) over the angles of centres and lower joints, where a metre of a link adds these `parts` (L,)."""
        geometry = self.geometry
        belongs = geometry.pendulum[:, None] == geometry.pendulum
        reaches = belongs * (parts * geometry.length)
        return np.tril(reaches, -1) + np.diag(parts * geometry.centre), np.tril(reaches)
