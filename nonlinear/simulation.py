"""Simulate a scene: one call from a start to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from modal.errors import SceneError
from modal.rig import Floats
from modal.scene import Scene
from nonlinear.events import Event
from nonlinear.methods import ASKED, choose
from nonlinear.plant import plant_of
from nonlinear.preparation import prepared
from nonlinear.requests import extent, gathered, insist_numbers, insist_push, sampled
from nonlinear.starts import checked, start_of
from nonlinear.state import Load, State
from nonlinear.symmetries import symmetries
from nonlinear.trajectory import Trajectory


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
    report: Callable[[float], object] = lambda elapsed: None,
) -> Trajectory:
    """The motion of a scene over `duration` seconds at large angles.

    `method` is "auto", one of SciPy's ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA") or "taylor" (heyoka, extra
    `taylor`); `form` is "auto", "minimal", "hamiltonian" or "maximal" in the plane, "spatial" in space.  `tolerance`
    is the integrator's, relative, and where a quantity passes through zero of the motion's own size.  `output` is a
    number of evenly spaced samples or their times after the start (s), ascending; `start` replaces the scene file's
    own, at `start_time` (s).  `load(t, state)` returns the `Push` from outside.  `report` hears of the seconds gone
    through after every step.

    On Ctrl-C what was computed is returned, `run.stopped` saying how far it goes.  Raises SceneError for arguments
    that cannot be, SimulationError (with the part that was computed) where the integrator gives up.
    """
    plant = plant_of(scene)
    insist_numbers(duration, tolerance, start_time)
    state, _, times = gathered(
        lambda: checked(start if start is not None else start_of(scene), plant),
        lambda: choose(scene, duration, tolerance, method, form, driven=load is not None),
        lambda: sampled(scene, duration, start_time, output),
    )
    insist_push(load, plant, state, start_time)
    size = 1.0 if load else extent(state, plant)
    smaller = () if load else symmetries(plant, state, planar=form == "auto")
    least = smaller[-1].plant if smaller else plant
    choice = choose(scene, duration, float(tolerance), method, form, driven=load is not None, size=size, plant=least)
    return prepared(scene, plant, state, times, choice, load=load, symmetries=smaller).go(events, report)


def resumed(
    trajectory: Trajectory,
    duration: float,
    *,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    load: Load | None = None,
    **options: Any,
) -> Trajectory:
    """The motion after a trajectory's last state, its times going on.

    Form (in the plane), tolerance and a method that was asked for are those of the trajectory unless given; the work
    begins anew at 0.  Raises SceneError for a driven trajectory without its `load`.
    """
    if trajectory.driven and load is None:
        raise SceneError(["load: this run was driven, and forces from outside are not kept with it"])
    run = trajectory.run
    return simulate(
        trajectory.scene,
        duration,
        method=method or (run.method if run.reason.startswith(ASKED) else "auto"),
        form=form or ("auto" if trajectory.plant.spatial else run.form),
        tolerance=run.tolerance if tolerance is None else tolerance,
        load=load,
        start=trajectory.final,
        start_time=float(trajectory.times[-1]),
        **options,
    )
