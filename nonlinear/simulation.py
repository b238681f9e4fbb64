"""Simulate a scene: one call from an initial condition to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from modal.errors import SceneError
from modal.report import silent
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Floats
from nonlinear.accuracy import Advice, Goal, seek_accuracy
from nonlinear.integration import (
    ASKED,
    FORMS,
    Choice,
    Request,
    SimulationError,
    Trajectory,
    pace_of,
    sample_times,
    validate,
    validate_accuracy,
    validate_events,
    validate_forces,
    validate_load,
    validate_method,
    validate_numbers,
    validate_observable,
)
from nonlinear.system import (
    NO_KICKS,
    Event,
    Hoists,
    Kicks,
    Load,
    State,
    initial_state,
    system_of,
    validate_state,
)

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
    hoist: Hoists | None = None,
    events: Sequence[Event] = (),
    before: Kicks = NO_KICKS,
    report: Report = silent,
) -> Trajectory:
    """Simulate the motion of a scene over `duration` seconds at any angle.

    On Ctrl-C the part computed so far is returned, and `run.stopped` says how far it goes.

    Parameters
    ----------
    scene
        Any scene; an error names what simulations do not take.
    duration
        The simulated time (s).
    method
        "auto", one of SciPy's ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA"), or "taylor" (heyoka,
        extra `taylor`).
    form
        The form of the equations: "auto"; "minimal" or "maximal" in the plane, "spatial" in space; "hamiltonian".
    tolerance
        The integrator's (default 1e-9): relative to each quantity, or, where that passes through zero, to the size of
        the motion.
    accuracy
        The largest permitted error of any angle (rad), in place of a tolerance.  The cheapest method that meets it is
        found and its error estimated (`nonlinear.accuracy.advice`); `run.error` and `run.reason` report the result.
    output
        A number of evenly spaced samples, or their times after the start (s), ascending.
    start
        The initial condition in place of that of the scene file.
    start_time
        The time (s) of the start, for motions of supports, hoists and forces that depend on it.
    load
        A function `load(t, state)` that returns the external `AppliedForces`.  One that acts for less than a step may
        be missed: give `breaks` or `max_step`.
    breaks
        Times (s) at which steps end and the integrator restarts.  An accuracy under a load needs them or `max_step`;
        `breaks=[]` states that the load changes no faster than the scene swings.
    max_step
        The longest step (s).
    hoist
        Lengths of bobs in place of the scene's, by the indices of pendulum and link from 0, `{(0, 0): law}`.  A law is
        a spline with `derivative`, such as SciPy's, or a function of time that returns length, speed and acceleration
        (m, m/s, m/s²).
    events
        What to look for on the way: crossings and turning points (`level_crossing`, `turning_point`, `Event`).
    before
        The escapements' kicks up to the start, which determine on which side each kicks next.
    report
        Is called with the simulated time (s) after every step.

    Returns
    -------
    Trajectory
        Samples of the motion, events, and in `run` how they were computed.

    Raises
    ------
    SceneError
        Arguments are invalid, or the scene has what simulations do not take.
    SimulationError
        The integrator fails, or an accuracy cannot be met to the end.  Its `trajectory` is the part computed so far.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import simulate
    >>> run = simulate(load("chain-2"), 5.0, output=11)
    >>> run.motion.links.shape, run.energy_drift() < 1e-7
    ((11, 2), True)
    """
    if accuracy is not None and tolerance is not None:
        raise SceneError(["accuracy: cannot be combined with a tolerance"])
    used = Choice.tolerance if tolerance is None else tolerance
    options: dict[str, Any] = {"method": method, "form": form, "events": events, "before": before, "report": report}
    options |= {"load": load, "breaks": breaks, "max_step": max_step, "hoist": hoist}
    if accuracy is not None:
        return certain(advise(scene, duration, accuracy, output=output, start=start, start_time=start_time, **options))
    request = request_of(scene, duration, used, None, output, start, start_time, options)
    return request.run(request.choice(float(used)))


@checked
def advise(
    scene: Scene,
    duration: float,
    accuracy: float,
    *,
    output: Output = None,
    start: State | None = None,
    start_time: float = 0.0,
    **options: Any,
) -> Advice:
    """Find the cheapest method with errors of at most `accuracy` (rad) in any angle, and list all attempts.

    It is what `simulate` does with an accuracy, whose other arguments these are. Raise SceneError for invalid
    arguments, SimulationError if an integrator fails.
    """
    request = request_of(scene, duration, Choice.tolerance, accuracy, output, start, start_time, options)
    return seek_accuracy(Goal(request, float(accuracy)))


def request_of(
    scene: Scene,
    duration: float,
    tolerance: float,
    accuracy: float | None,
    output: Output,
    start: State | None,
    start_time: float,
    options: dict[str, Any],
) -> Request:
    """The validated request of a run, by the arguments of `simulate`; raise SceneError with every mistake."""
    system, load = system_of(scene, options.pop("hoist", None)), options.get("load")
    validate(lambda: validate_load(load), lambda: validate_events(options.get("events", ())))
    pace_options = {name: options.pop(name, None) for name in ("breaks", "max_step")}
    *_, pace = validate(
        lambda: validate_numbers(duration, tolerance, start_time),
        lambda: validate_accuracy(accuracy),
        lambda: validate_observable(load, accuracy, *pace_options.values()),
        lambda: pace_of(**pace_options),
    )
    words = {name: options[name] for name in ("method", "form") if name in options}
    state, _, times = validate(
        lambda: validate_state(start if start is not None else initial_state(scene), system),
        lambda: validate_method(scene, **words, driven=load is not None, system=system),
        lambda: sample_times(scene, duration, start_time, output),
    )
    validate_forces(load, system, state, start_time)
    if system.hoisting is not None:
        system.hoisting.at(times)
    return Request(scene, system, state, times, pace=pace, **options)


def certain(advice: Advice) -> Trajectory:
    """The trajectory if it meets its accuracy throughout; else SimulationError with the part that does."""
    if advice.is_met or advice.trajectory.run.interrupted:
        return advice.trajectory
    raise SimulationError(advice.limit, advice.certain)


@checked
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
    """Continue a trajectory from its last state, with its times carried on.

    The work restarts from 0.  A run in a few modes or in closed form continues as a simulation of the whole scene.

    Parameters
    ----------
    trajectory
        A run of `simulate`, also one that was saved and loaded.
    duration
        The time (s) to add.
    method, form, tolerance
        Those of `simulate`.  Unless given, they are the trajectory's: its form in the plane, its tolerance, or its
        accuracy instead, and its method if that was chosen by name.
    load
        The external forces, which files do not hold: a driven trajectory needs them again.
    **options
        Further arguments of `simulate`, such as `output` or `events`.

    Returns
    -------
    Trajectory
        The continuation alone, whose first sample is the last of `trajectory`.

    Raises
    ------
    SceneError
        A driven trajectory has no `load`, or arguments are invalid.
    SimulationError
        As for `simulate`.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import resume, simulate
    >>> first = simulate(load("chain-2"), 2.0)
    >>> second = resume(first, 3.0)
    >>> float(second.times[0]), float(second.times[-1])
    (2.0, 5.0)
    """
    if trajectory.driven and load is None:
        raise SceneError(["load: this run had applied forces, which are not saved with it"])
    info, last = trajectory.run, float(trajectory.times[-1])
    if options.get("accuracy") is None and info.form in FORMS:
        method = method or (info.method if info.reason.startswith(ASKED) else None)
        form = form or (None if trajectory.system.spatial and info.form != "hamiltonian" else info.form)
        tolerance = info.tolerance if tolerance is None else tolerance
    options |= {"method": method or "auto", "form": form or "auto", "tolerance": tolerance, "load": load}
    options.setdefault("before", trajectory.kicks)
    options.setdefault("hoist", trajectory.system.hoisting and trajectory.system.hoisting.custom_laws)
    return simulate(trajectory.scene, duration, start=trajectory.final, start_time=last, **options)
