"""Simulate a scene: one call from a start to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import cast

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.rig import Floats
from modal.scene import Scene
from nonlinear.events import Event
from nonlinear.integrate import Drive, Record
from nonlinear.methods import Choice, choose, survey, system_of
from nonlinear.minimal import Minimal
from nonlinear.plant import plant_of
from nonlinear.starts import checked, start_of
from nonlinear.state import Load, State, System
from nonlinear.steppers import SciPyStepper, Stepper
from nonlinear.trajectory import Run, Trajectory

LOOSEST, TIGHTEST = 1e-2, 1e-15
SAMPLES_PER_SECOND, MOST_SAMPLES, FEWEST_SAMPLES, MOST_NUMBERS = 50, 100_000, 1000, 400_000_000
CLAUSE = 20_000_000  # numbers kept where nobody says how many


class SimulationError(ComputationError):
    """A run that could not reach its end; `trajectory` holds what was computed."""

    def __init__(self, problem: str, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        super().__init__(problem)


def simulate(
    scene: Scene,
    duration: float,
    *,
    method: str = "auto",
    form: str = "auto",
    tolerance: float = 1e-9,
    output: int | Sequence[float] | Floats | None = None,
    start: State | None = None,
    start_time: float = 0.0,
    load: Load | None = None,
    events: Sequence[Event] = (),
    report: Callable[[float], object] | None = None,
) -> Trajectory:
    """The motion of a scene over `duration` seconds at large angles.

    `method` is "auto", one of SciPy's ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA") or "taylor" (heyoka, extra
    `taylor`); `form` is "auto", "minimal", "hamiltonian" or "maximal" in the plane, "spatial" in space.  `tolerance`
    is the integrator's, relative and in SI units; `output` a number of evenly spaced samples or their times after the
    start (s), ascending; `start` replaces the scene file's own.  `load(t, state)` returns the `Push` from outside.
    `report` hears of the seconds gone through after every step.

    On Ctrl-C what was computed is returned, `run.stopped` saying how far it goes.  Raises SceneError for arguments
    that cannot be, SimulationError (with the part that was computed) where the integrator gives up.
    """
    _check(duration, tolerance)
    plant = plant_of(scene)
    state = checked(start if start is not None else start_of(scene), plant)
    choice = choose(scene, duration, tolerance, method, form, driven=load is not None)
    system = system_of(plant, choice, load)
    y = system.begin(state)
    times = start_time + _sampled(duration, output, len(y))
    stepper = _stepper(scene, system, choice, y, times, tolerance)
    record = Drive(stepper, system, times, events, report or (lambda time: None)).run()
    return _found(scene, system, choice, tolerance, stepper, record)


def _found(
    scene: Scene, system: System, choice: Choice, tolerance: float, stepper: Stepper, record: Record
) -> Trajectory:
    run = Run(
        choice.form,
        choice.method,
        choice.reason,
        tolerance,
        record.steps,
        stepper.calls,
        record.drift,
        record.stopped,
    )
    trajectory = Trajectory(
        scene,
        system.plant,
        record.times[: record.filled],
        system.read(record.rows[: record.filled]),
        run,
        tuple(record.happenings),
        system.load is not None,
        system,
    )
    if record.failed:
        raise SimulationError(record.stopped, trajectory)
    return trajectory


def resumed(trajectory: Trajectory, duration: float, **options: object) -> Trajectory:
    """The motion after a trajectory's last state, its times going on; `options` are those of `simulate`."""
    last = float(trajectory.times[-1])
    return simulate(trajectory.scene, duration, start=trajectory.final, start_time=last, **options)  # type: ignore[arg-type]


def _stepper(scene: Scene, system: System, choice: Choice, y: Floats, times: Floats, tolerance: float) -> Stepper:
    first, last = float(times[0]), float(times[-1])
    if choice.method == "taylor":
        from nonlinear.taylor import TaylorStepper, longest_step

        cap = longest_step(np.array([survey(scene).swing]))
        return TaylorStepper(cast("Minimal", system), y, first, last, tolerance, cap)
    return SciPyStepper(choice.method, system.derivative, first, y, last, tolerance)


def _check(duration: float, tolerance: float) -> None:
    problems = []
    if not (0 < duration < float("inf")):
        problems.append(f"duration {duration!r}: must be a positive number of seconds")
    if not (TIGHTEST <= tolerance <= LOOSEST):
        problems.append(f"tolerance {tolerance!r}: must be from {TIGHTEST:g} to {LOOSEST:g}")
    if problems:
        raise SceneError(problems)


def _sampled(duration: float, output: int | Sequence[float] | Floats | None, size: int) -> Floats:
    """Times after the start, the first of them 0."""
    if output is None:
        wished = min(max(ceil(duration * SAMPLES_PER_SECOND), FEWEST_SAMPLES), MOST_SAMPLES)
        output = max(2, min(wished, CLAUSE // size)) + 1
    if isinstance(output, int):
        if not 2 <= output <= MOST_NUMBERS // size:
            raise SceneError([f"output {output}: must be from 2 to {MOST_NUMBERS // size} samples for this scene"])
        return np.linspace(0.0, duration, output)
    times = np.array(output, dtype=float)
    if times.ndim != 1 or times.size == 0 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise SceneError(["output: must be ascending times in seconds"])
    if times[0] < 0 or times[-1] > duration:
        raise SceneError([f"output: must lie between 0 and {duration:g} s"])
    return times if times[0] == 0 else np.concatenate(([0.0], times))
