"""Simulate a scene: one call from an initial condition to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from modal._compatibility import exported
from modal.errors import SceneError
from modal.scene import Scene, validate_scene
from modal.types import Floats
from nonlinear.accuracy import Advice, Goal, seek_accuracy
from nonlinear.integration import (
    ASKED,
    FORMS,
    Request,
    SimulationError,
    Trajectory,
    choose,
    paced,
    sample_times,
    silent,
    validate,
    validate_accuracy,
    validate_forces,
    validate_numbers,
    validate_observable,
)
from nonlinear.system import NO_KICKS, Event, Kicks, Load, State, initial_state, system_of, validate_state

USUAL = 1e-9  # tolerance

Output = int | Sequence[float] | Floats | None
Report = Callable[[float], object]


def simulate(
    scene: Scene,
    duration: float,
    *,
    method: str = "auto",
    form: str = "auto",
    tolerance: float | None = None,
    accuracy: float | None = None,
    output: Output = None,
    start: State | None = None,
    start_time: float = 0.0,
    load: Load | None = None,
    breaks: Sequence[float] | Floats | None = None,
    max_step: float | None = None,
    events: Sequence[Event] = (),
    before: Kicks = NO_KICKS,
    report: Report = silent,
) -> Trajectory:
    """The motion of a scene over `duration` seconds at large angles.

    `method` is "auto", one of SciPy's ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA") or "taylor" (heyoka, extra
    `taylor`); `form` is "auto", "minimal", "hamiltonian" or "maximal" in the plane, "spatial" in space.  `tolerance`
    is the integrator's (default 1e-9), relative, and where a quantity passes through zero of the motion's own size.
    `accuracy` is given in its place by who wants no angle to be off by more (rad): the cheapest way that meets it is
    found and judged (`nonlinear.accuracy.advice`), `run.error` and `run.reason` say how.  `output` is a number of
    evenly spaced samples or their times after the start (s), ascending; `start` replaces the scene file's own, at
    `start_time` (s). `load(t, state)` returns the `Push` from outside.  One that acts for less than a step may be
    missed: at the times t (s) that are its `breaks` steps end and the integrator restarts, and no step is longer
    than `max_step` (s).  An accuracy under a load needs one of them; `breaks=[]` says that it changes no faster than
    the scene swings.  `before` are the kicks of escapements until the start, which say on which side the next ones
    come.  `report` hears of the seconds gone through after every step.

    On Ctrl-C what was computed is returned, `run.stopped` saying how far it goes.  Raises SceneError for arguments
    that cannot be, SimulationError (with the part that was computed) where the integrator gives up or an accuracy
    cannot be met to the end.
    """
    validate_scene(scene)
    if accuracy is not None and tolerance is not None:
        raise SceneError(["accuracy: cannot be combined with a tolerance"])
    used = USUAL if tolerance is None else tolerance
    more: dict[str, Any] = {"method": method, "form": form, "events": events, "before": before, "report": report}
    more |= {"load": load, "breaks": breaks, "max_step": max_step}
    request = _request(scene, duration, used, accuracy, output, start, start_time, more)
    if accuracy is not None:
        return certain(seek_accuracy(Goal(request, float(accuracy))))
    return request.run(request.choice(float(used)))


def advise(
    scene: Scene,
    duration: float,
    accuracy: float,
    *,
    output: Output = None,
    start: State | None = None,
    start_time: float = 0.0,
    **more: Any,
) -> Advice:
    """The cheapest method by which no angle is off by more than `accuracy` (rad), and all attempts.

    The other arguments are those of `simulate`.  Raises SceneError for arguments that cannot be, SimulationError where
    an integrator gives up.
    """
    return seek_accuracy(
        Goal(_request(scene, duration, USUAL, accuracy, output, start, start_time, more), float(accuracy))
    )


def _request(
    scene: Scene,
    duration: float,
    tolerance: float,
    accuracy: float | None,
    output: Output,
    start: State | None,
    start_time: float,
    more: dict[str, Any],
) -> Request:
    """What is asked; SceneError names every mistake."""
    system, load = system_of(scene), more.get("load")
    told = {name: more.pop(name, None) for name in ("breaks", "max_step")}
    *_, pace = validate(
        lambda: validate_numbers(duration, tolerance, start_time),
        lambda: validate_accuracy(accuracy),
        lambda: validate_observable(load, accuracy, *told.values()),
        lambda: paced(**told),
    )
    words = {name: more[name] for name in ("method", "form") if name in more}
    state, _, times = validate(
        lambda: validate_state(start if start is not None else initial_state(scene), system),
        lambda: choose(scene, duration, tolerance, **words, driven=load is not None, system=system),
        lambda: sample_times(scene, duration, start_time, output),
    )
    validate_forces(load, system, state, start_time)
    return Request(scene, system, state, times, pace=pace, **more)


def certain(advice: Advice) -> Trajectory:
    """The trajectory that meets its accuracy; SimulationError with the part that does where not all of it can."""
    if advice.met or advice.trajectory.run.interrupted:
        return advice.trajectory
    raise SimulationError(advice.limit, advice.certain)


def resume(
    trajectory: Trajectory,
    duration: float,
    *,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    load: Load | None = None,
    **options: Any,
) -> Trajectory:
    """The motion after a trajectory's last state, with its times continued.

    Form (in the plane), tolerance and a method that was asked for are those of the trajectory unless given, or an
    accuracy in their place; the work starts again at 0.  A run in a few modes or in closed form goes on as the whole
    scene.  Raises SceneError for a driven trajectory without its `load`.
    """
    if trajectory.driven and load is None:
        raise SceneError(["load: this run had applied forces, which are not saved with it"])
    run, last = trajectory.run, float(trajectory.times[-1])
    if options.get("accuracy") is None and run.form in FORMS:
        method = method or (run.method if run.reason.startswith(ASKED) else None)
        form = form or (None if trajectory.system.spatial else run.form)
        tolerance = run.tolerance if tolerance is None else tolerance
    options |= {"method": method or "auto", "form": form or "auto", "tolerance": tolerance, "load": load}
    options.setdefault("before", trajectory.kicks)
    return simulate(trajectory.scene, duration, start=trajectory.final, start_time=last, **options)


if not TYPE_CHECKING:
    __getattr__ = exported(__name__, {"resumed": "resume"})
