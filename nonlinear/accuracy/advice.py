"""The cheapest method for a requested accuracy, and the evidence that the accuracy is met.

The error is the largest deviation of any link's angle (rad) at any time so far.  Methods are tried in order of cost:

    modes in closed form     error from their residual in the equations of motion (`nonlinear.reduction.defect`)
    a few modes              for long chains, error from more modes (`nonlinear.reduction.truncation`)
    integration, twice       at tolerances Rτ and τ, then at tighter ones

Two runs that differ by d indicate that the tighter one is off by no more than DIFFERENCE_SAFETY d: errors scatter by
factors of ten, wherever steps are few or limited by something other than the tolerance, as by stiff joints, and both
runs may share an error.  Where a third run has shown how errors depend on the tolerance, e ∝ τ^p with p at most 1,
that is used,

    e(τ) ≤ min(DIFFERENCE_SAFETY / R^p, 2) d

for a tolerance R times tighter.  Where that is too large the next tolerance follows from C in e ≈ Cτ: a few times the
size of the motion where little grows, more over many periods and at large angles, and millions where small errors grow.
Where even the finest tolerance is too coarse the motion is known up to a horizon and no further.

Two runs that share a symmetry agree for longer than they are right.  Where the start has a symmetry that rounding
preserves, or is an unstable equilibrium, a run by the same method from a start perturbed in its last digits
(`nonlinear.integration.run`) is compared as well: each error is at least twice the distance to it.

A requested accuracy, and methods that do not integrate the full scene: all modes or a few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from math import inf, nan, pi
from sys import float_info
from time import perf_counter
from typing import Any

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.report import Displayed, Form, ReportColumn, Result, finite
from modal.scene import Scene, refusals
from modal.scene.doors import checked
from modal.types import Floats
from nonlinear.integration import (
    CLOSED,
    COARSEST,
    LOOSEST,
    SMALLEST,
    Choice,
    Request,
    SimulationError,
    SolverInfo,
    Trajectory,
    estimate_timescales,
    perturb_last_digits,
    sample_count,
)
from nonlinear.reduction import (
    CORRECTED,
    LARGEST,
    LINEAR,
    Superposition,
    defect_error,
    in_modes,
    superpose,
    survey_modes,
)
from nonlinear.system import apart

ERROR_AIM_RATIO = 200.0
"""Cost: requested accuracy over the error aimed at, so that one pair of runs is enough (benchmarks/advice.py)."""
ERROR_PER_PERIOD = 0.15
"""Cost: of the motion's size, the share of C for every period of the fastest oscillation (benchmarks/advice.py)."""
ERROR_TIMES_MAX = 4000
"""Cost: times at which errors are evaluated, half of the default samples up to that (benchmarks/advice.py)."""
MODAL = "the motion is small enough"
CLOSED_FORM_ERROR = 1 / 200
"""Cost: the least error of any closed form over the cube of the motion's size (benchmarks/advice.py)."""
LONG_LINKS = 200
"""Cost: links of a scene from which a few modes may pay (benchmarks/advice.py)."""
SHAPE_SHARE_MAX = 1 / 8
"""Cost: of all shapes, the most with which a few modes may pay (benchmarks/advice.py)."""


def error_time_count(duration: float, swing: float) -> int:
    """Return at how many times errors are evaluated over `duration` (s) for a fastest oscillation `swing` (rad/s)."""
    return min(sample_count(duration, swing) // 2, ERROR_TIMES_MAX)


@dataclass(frozen=True)
class Attempt:
    """One method that was tried: its tolerance (NaN for a closed form), its cost (s; derivatives), its error (rad).

    The error is an upper estimate, inf if it is unknown.
    """

    way: str
    tolerance: float
    seconds: float
    calls: int
    error: float


@dataclass(frozen=True, eq=False)
class TriedRun:
    """A trajectory, the error bound of its angles up to each of its times (T,) in rad, and its cost.

    `again` repeats the method from another start; `gave_up` is the error of an integrator that failed, of whose run
    nothing is known.
    """

    trajectory: Trajectory
    errors: Floats
    attempt: Attempt
    repeat: Callable[[Request], Trajectory]
    gave_up: SimulationError | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Goal(Displayed):
    """A requested motion and its accuracy (rad)."""

    what = "Motion and the accuracy asked for"
    shows = "request: motion; accuracy: accuracy, rad"

    request: Request
    accuracy: float

    @property
    def swing(self) -> float:
        """The fastest oscillation (rad/s)."""
        return estimate_timescales(self.request.scene).swing

    @property
    def periods(self) -> float:
        """Periods of the fastest oscillation in the whole duration."""
        return self.request.duration * self.swing / (2 * pi)

    @cached_property
    def looked_at(self) -> Request:
        """The request at the times where errors are evaluated: the output times, and others as the scene oscillates."""
        times, duration = self.request.times, self.request.duration
        count = error_time_count(duration, self.swing)
        return replace(self.request, times=np.union1d(times, np.linspace(times[0], times[-1], count + 1)))

    @property
    def constant(self) -> float:
        """An estimate of C (rad)."""
        return self.request.size * (3 + (ERROR_PER_PERIOD + self.request.size**2) * self.periods)

    @property
    def tolerance(self) -> float:
        """The integrator's tolerance expected to meet the accuracy."""
        return self.accuracy / (ERROR_AIM_RATIO * self.constant)

    @property
    def free(self) -> bool:
        """Whether the full scene need not be integrated."""
        request = self.request
        system = request.system
        acted_on = request.load or request.events or system.excites or system.rubs or system.has_drag
        is_prescribed = system.hoisting or system.prescribed_motions
        return request.method == request.form == "auto" and not (acted_on or is_prescribed)


def in_closed_form(goal: Goal) -> Iterator[TriedRun]:
    """Linear and corrected modes, where their error can be estimated."""
    is_large = CLOSED_FORM_ERROR * goal.request.size**3 > goal.accuracy or goal.request.system.n_links > LARGEST
    if not goal.free or is_large or refusals(goal.request.scene, "motion in closed form"):
        return
    start = perf_counter()
    try:
        motion = superpose(goal.request.scene, goal.request.start, corrected=True)
    except ComputationError:
        return
    for kind, superposition in ((LINEAR, motion.linear), (CORRECTED, motion)):
        if tried_run := _superpose(goal, kind, superposition, start):
            yield tried_run
        start = perf_counter()


def _superpose(goal: Goal, kind: str, motion: Superposition, start: float) -> TriedRun | None:
    request = goal.looked_at
    estimate = defect_error(motion, request.duration)
    if estimate is None:
        return None
    times = request.times - request.times[0]
    errors = estimate.bounds[np.minimum(np.searchsorted(estimate.times, times), len(estimate.at) - 1)]
    trajectory = Trajectory(
        request.scene, request.system, request.times, motion(times), SolverInfo(kind, CLOSED, MODAL, inf)
    )

    def repeat(twin: Request) -> Trajectory:
        twin_motion = superpose(twin.scene, twin.start, corrected=kind == CORRECTED)
        return replace(trajectory, motion=twin_motion(times))

    return TriedRun(trajectory, errors, Attempt(kind, nan, perf_counter() - start, 0, float(errors[-1])), repeat)


def in_few_modes(goal: Goal) -> Iterator[TriedRun]:
    """The lowest modes of a long scene that starts in them."""
    request = goal.looked_at
    if not goal.free or request.system.spatial or request.system.n_links < LONG_LINKS:
        return
    start = perf_counter()
    try:
        survey = survey_modes(request.scene, request.system, request.start)
    except (ComputationError, SceneError):
        return
    modes = survey.automatic()
    if survey.columns(modes) > SHAPE_SHARE_MAX * request.system.n_links:
        return
    tolerance = min(goal.tolerance, LOOSEST)
    truncation = in_modes(survey, modes, request.times, tolerance=tolerance, report=request.report)
    info, way = truncation.trajectory.run, f"{len(truncation.kept)} mode shapes"

    def repeat(twin: Request) -> Trajectory:
        twin_survey = replace(survey, start=twin.start)
        return in_modes(twin_survey, modes, twin.times, tolerance=tolerance, report=twin.report).trajectory

    attempt = Attempt(way, info.tolerance, perf_counter() - start, info.calls, truncation.error)
    yield TriedRun(truncation.trajectory, truncation.errors, attempt, repeat)


TOLERANCE_RATIO = 10.0
"""Cost: of a tolerance to the next: no gain beyond its square is credited, where a run was lost it is taken to the
fourth power (benchmarks/advice.py)."""
DIFFERENCE_SAFETY = 16.0
"""Tolerance: the bound of an error over the difference of two runs whose ratio of errors is not known."""
STEP_RATIO = 0.7
"""Tolerance: ratio of steps from run to run where the tolerance does not limit them: two that step alike may be wrong
alike."""
ATTEMPT = (
    ReportColumn("way", "way", "way"),
    ReportColumn("tolerance", "tolerance", "tolerance", ".1e"),
    ReportColumn("seconds", "seconds", "time (ms)", lambda seconds: f"{1e3 * seconds:.3g}"),
    ReportColumn("calls", "derivatives", "derivatives"),
    ReportColumn("error", "error_rad", "error (rad)", lambda x: "unknown" if finite(x) is None else f"{x:.1e}"),
)
"""The quantities of an attempt."""
EVIDENCE = (
    "error: for modes, from their residual in the equations of motion; for a run, from its difference from the "
    "previous run, whose own error is unknown."
)


@dataclass(frozen=True, eq=False, repr=False)
class Advice(Result):
    """The trajectory for a requested accuracy (rad), its `errors` (T,) in rad so far, and all attempts, its own last.

    `horizon` is the time (s) up to which the accuracy is met, one of the trajectory's; `has_parted` says whether the
    departure of a twin ends it.
    """

    accuracy: float
    trajectory: Trajectory
    errors: Floats
    attempts: tuple[Attempt, ...]
    horizon: float
    has_parted: bool = False

    @property
    def is_met(self) -> bool:
        """Whether the accuracy is met over the whole trajectory."""
        return bool(self.errors[-1] <= self.accuracy)

    @property
    def limit(self) -> str:
        """The message if the accuracy is not met throughout."""
        words = f"{self.accuracy:g} rad can be shown to be met up to {self.horizon:.4g} s and no further"
        if self.has_parted or self.attempts[-1].tolerance <= TOLERANCE_RATIO**2 * SMALLEST:
            words += ": beyond it double precision cannot determine where the links are"
        return words + (", since starts that differ only in their last digits diverge" if self.has_parted else "")

    @property
    def certain(self) -> Trajectory:
        """The trajectory up to the horizon."""
        if self.is_met:
            return self.trajectory
        within = self.trajectory.times <= self.horizon
        reason = f"{self.accuracy:g} rad cannot be met beyond {self.horizon:.9g} s"
        info = replace(self.trajectory.run, error=float(self.errors[within][-1]), stopped=reason)
        happenings = tuple(happening for happening in self.trajectory.happenings if happening.time <= self.horizon)
        return replace(self.trajectory.at(within), run=info, happenings=happenings)

    key = "attempts"

    @property
    def what(self) -> str:  # type: ignore[override]
        """The request in words."""
        return f"the cheapest method for {self.accuracy:g} rad"

    @property
    def scene(self) -> Scene:
        """The scene of the trajectory."""
        return self.trajectory.scene

    def entries(self) -> tuple[Attempt, ...]:
        """Every attempt."""
        return self.attempts

    def columns(self) -> tuple[ReportColumn, ...]:
        """The quantities of an attempt."""
        return ATTEMPT

    def footnotes(self) -> Iterator[str]:
        """The verdict, and its grounds."""
        last, info, times = self.attempts[-1], self.trajectory.run, self.trajectory.times
        if info.interrupted:
            yield f"{info.stopped}: no accuracy is guaranteed."
        elif self.is_met:
            yield f"{last.way}: no angle is off by more than {last.error:.2g} rad until {times[-1]:.9g} s."
        else:
            yield f"{self.limit}."
        yield EVIDENCE

    def facts(self) -> dict[str, Any]:
        """The request, and whether and how long it is met."""
        return {
            "accuracy_rad": self.accuracy,
            "met": self.is_met,
            "horizon_s": self.horizon,
            "stopped": self.trajectory.run.stopped,
            "duration_s": float(self.trajectory.times[-1] - self.trajectory.times[0]),
        }


@checked
def advice_table(advice: Advice, form: Form) -> str:
    """Every attempt as text, markdown, csv (one line per attempt) or json, as `form` says."""
    return advice.report(form)


def seek_accuracy(goal: Goal) -> Advice:
    """Find the cheapest method that meets the accuracy, or the finest method if none does.

    After Ctrl-C the run in progress is returned, with errors where a looser run has been. Raise SimulationError if the
    integrator fails at the finest tolerance too: a loose run may fail where a tighter one does not.
    """
    attempts: list[Attempt] = []
    for tried_run in chain(in_closed_form(goal), in_few_modes(goal), _integrate(goal)):
        attempts.append(tried_run.attempt)
        if tried_run.errors[-1] <= goal.accuracy or tried_run.trajectory.run.interrupted:
            break
    if tried_run.gave_up:
        raise tried_run.gave_up
    first_run = tried_run
    if not tried_run.trajectory.run.interrupted and (twin_request := perturb_last_digits(goal.looked_at)):
        tried_run = _with_twin(tried_run, twin_request)
        attempts[-1] = tried_run.attempt
    info = replace(tried_run.trajectory.run, error=tried_run.attempt.error)
    times, last = tried_run.trajectory.times, max(int(np.sum(tried_run.errors <= goal.accuracy)) - 1, 0)
    selection = np.isin(times, goal.request.times)
    selection[[last, -1]] = True
    trajectory = replace(tried_run.trajectory, run=info).at(selection)
    has_parted = last + 1 < len(times) and bool(first_run.errors[last + 1] <= goal.accuracy)
    return Advice(
        goal.accuracy, trajectory, tried_run.errors[selection], tuple(attempts), float(times[last]), has_parted
    )


def _integrate(goal: Goal) -> Iterator[TriedRun]:
    """Runs at tighter and tighter tolerances, each compared with those before."""
    request = goal.looked_at
    choice = request.choice(min(max(goal.tolerance, SMALLEST), LOOSEST / TOLERANCE_RATIO))
    runs = [_time_run(request, replace(choice, tolerance=TOLERANCE_RATIO * choice.tolerance))]
    yield runs[0]
    while True:
        request = replace(request, pace=replace(request.pace, share=STEP_RATIO * request.pace.share))
        runs.append(_with_errors(_time_run(request, choice), runs, 4 * float_info.epsilon * goal.constant))
        yield runs[-1]
        tighter = request.choice(max(_next(goal, runs[-1], runs[-2]), SMALLEST))
        if tighter.tolerance * 4 > 1.01 * choice.tolerance:
            return
        choice = tighter


def _time_run(request: Request, choice: Choice) -> TriedRun:
    start, gave_up = perf_counter(), None
    try:
        trajectory = request.run(choice)
    except SimulationError as error:
        trajectory, gave_up = error.trajectory, error
    words = " ".join(part for part in (choice.form, choice.method, "compiled" * choice.compiled) if part)
    attempt = Attempt(words, choice.tolerance, perf_counter() - start, trajectory.run.calls, inf)
    errors = np.full(len(trajectory.times), inf)
    return TriedRun(trajectory, errors, attempt, lambda twin: twin.run(twin.choice(choice.tolerance)), gave_up)


def _with_twin(tried_run: TriedRun, twin_request: Request) -> TriedRun:
    """A run that is compared with its twin as well."""
    start = perf_counter()
    trajectory, twin = tried_run.trajectory, tried_run.repeat(twin_request)
    errors = np.maximum(tried_run.errors, 2 * _difference(trajectory, twin))
    if twin.run.interrupted:
        info = replace(trajectory.run, interrupted=True, stopped=twin.run.stopped)
        trajectory = replace(trajectory.at(trajectory.times <= twin.times[-1]), run=info)
    seconds, calls = tried_run.attempt.seconds + perf_counter() - start, tried_run.attempt.calls + twin.run.calls
    attempt = replace(tried_run.attempt, seconds=seconds, calls=calls, error=float(errors[-1]))
    return replace(tried_run, trajectory=trajectory, errors=errors[: len(trajectory.times)], attempt=attempt)


def _with_errors(tried_run: TriedRun, runs: Sequence[TriedRun], rounding: float) -> TriedRun:
    """A run with its errors, estimated from looser runs, plus rounding errors (rad) where they differ at all."""
    previous = runs[-1]
    if tried_run.gave_up:
        return tried_run
    difference = _difference(tried_run.trajectory, previous.trajectory)
    credit = np.full(len(difference), 1 / DIFFERENCE_SAFETY)
    if len(runs) > 1:
        ratio = min(previous.attempt.tolerance / tried_run.attempt.tolerance, TOLERANCE_RATIO**2)
        differences = _difference(tried_run.trajectory, runs[-2].trajectory), difference
        order = _order(*differences, runs[-2].attempt.tolerance / previous.attempt.tolerance)
        credit = np.maximum(ratio**order / DIFFERENCE_SAFETY, 1 / 2)
    errors = np.maximum.accumulate(difference / credit) + rounding * (difference > 0)
    return replace(tried_run, errors=errors, attempt=replace(tried_run.attempt, error=float(errors[-1])))


def _order(looser: Floats, tighter: Floats, ratio: float) -> Floats:
    """The p of e ∝ τ^p so far, (T,), from 0 to 1, from the errors of two runs whose tolerances have this ratio.

    Where one of them has parted, the last value before is kept.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        order = np.log(looser / tighter) / np.log(ratio)
    is_known = np.isfinite(order)
    last = np.maximum.accumulate(np.where(is_known, np.arange(len(order)), 0))
    return np.where(is_known[last], np.clip(order[last], 0.0, 1.0), 0.0)


def _difference(first: Trajectory, second: Trajectory) -> Floats:
    """The largest angle (rad) so far between two runs at the times of the first, (T,), as far as both go.

    It is inf if it is meaningless: where the runs have parted or are identical, or the other ended long before. Where
    an event ends both at slightly different times, the last samples take the difference before them.
    """
    count = min(len(first.times), len(second.times))
    count = int(np.sum(first.times[:count] == second.times[:count]))
    rows = slice(count)
    distance = np.maximum.accumulate(apart(first.motion.at(rows), second.motion.at(rows)))
    distance[distance > COARSEST] = inf
    if not distance.any() and np.ptp(first.motion.links, axis=0).any():
        distance[:] = inf
    surplus = len(first.times) - count
    return np.pad(distance, (0, surplus), constant_values=inf if surplus > 2 else distance[-1])


def _next(goal: Goal, current: TriedRun, previous: TriedRun) -> float:
    """The tolerance expected to meet the accuracy; the finest only after one close enough to be compared with it."""
    tolerance = current.attempt.tolerance
    difference = float(_difference(current.trajectory, previous.trajectory)[-1])
    if difference == inf:
        finest, leap = TOLERANCE_RATIO**2 * SMALLEST, tolerance / TOLERANCE_RATIO**4
        return finest if leap < finest < tolerance / 4 else leap  # two runs within a factor of 4 may be identical
    return min(goal.accuracy * previous.attempt.tolerance / (ERROR_AIM_RATIO * difference), tolerance / TOLERANCE_RATIO)
