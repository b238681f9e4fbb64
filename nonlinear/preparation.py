"""Equations, start and integrator put together: a run that is ready to go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

from modal.errors import ComputationError
from modal.rig import Floats
from modal.scene import Scene
from nonlinear.events import Event
from nonlinear.integrate import Drive, Record
from nonlinear.methods import Choice, system_of
from nonlinear.minimal import Minimal
from nonlinear.plant import Plant
from nonlinear.reduced import Reduced
from nonlinear.requests import extent
from nonlinear.state import Load, State, System
from nonlinear.steppers import SciPyStepper, Stepper
from nonlinear.symmetries import Symmetry
from nonlinear.timescales import timescales
from nonlinear.trajectory import Run, Trajectory

NEAR_ZERO = 0.1  # share of the motion's size that the tolerance is relative to where a quantity passes zero


class SimulationError(ComputationError):
    """A run that could not reach its end; `trajectory` holds what was computed."""

    def __init__(self, problem: str, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        super().__init__(problem)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run of a scene, sampled at `times` (s), which begins where its stepper stands."""

    scene: Scene
    choice: Choice
    system: System
    stepper: Stepper
    times: Floats

    def go(self, events: Sequence[Event] = (), report: Callable[[float], object] = lambda elapsed: None) -> Trajectory:
        """Once, to the end or as far as can be gone; SimulationError where the integrator gives up."""
        record = Drive(self.stepper, self.system, self.times, events, report).run()
        trajectory = self._trajectory(record)
        if record.failed:
            raise SimulationError(f"{record.stopped}{_hint(self.system.plant)}", trajectory)
        return trajectory

    def _trajectory(self, record: Record) -> Trajectory:
        system, choice = self.system, self.choice
        run = Run(
            form=choice.form,
            method=choice.method,
            reason=choice.reason,
            tolerance=choice.tolerance,
            steps=record.steps,
            calls=self.stepper.calls,
            drift=record.drift,
            stopped=record.stopped,
            interrupted=record.interrupted,
            reduced=system.words if isinstance(system, Reduced) else "",
        )
        motion, events = system.read(record.rows), tuple(record.happenings)
        driven = system.load is not None
        return Trajectory(self.scene, system.plant, record.times, motion, run, events, driven=driven, system=system)


def prepared(
    scene: Scene,
    plant: Plant,
    start: State,
    times: Floats,
    choice: Choice,
    *,
    load: Load | None = None,
    symmetries: Sequence[Symmetry] = (),
) -> Prepared:
    """A run from this start in the chosen way, of what symmetries leave to be integrated."""
    system = system_of(plant, choice, load, symmetries)
    size = 1.0 if load else extent(start, plant)
    return Prepared(scene, choice, system, _stepper(scene, system, choice, system.begin(start), times, size), times)


def _stepper(scene: Scene, system: System, choice: Choice, y: Floats, times: Floats, size: float) -> Stepper:
    """The chosen integrator, ready at the first of the times, for a motion of this size (`extent`)."""
    first, last = float(times[0]), float(times[-1])
    if choice.method == "taylor":
        from nonlinear.taylor import TaylorStepper, first_step

        cap, series = first_step(timescales(scene).swing), system.inner if isinstance(system, Reduced) else system
        return TaylorStepper(cast("Minimal", series), y, first, last, choice.tolerance * size, cap)
    absolute = NEAR_ZERO * choice.tolerance * size * system.scale
    return SciPyStepper(choice.method, system.derivative, first, y, last, choice.tolerance, absolute)


def _hint(plant: Plant) -> str:
    if plant.cart is None or plant.cart.mass:
        return ""
    return "; a massless cart has no equation of motion where all that pulls it hangs straight down: give it a mass"
