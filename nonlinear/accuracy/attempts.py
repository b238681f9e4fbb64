"""A requested accuracy, and methods that do not integrate the full scene: all modes or a few."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, nan, pi
from time import perf_counter

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.report import Displayed
from modal.scene import refusals
from modal.types import Floats
from nonlinear.integration import (
    CLOSED,
    LOOSEST,
    Request,
    SimulationError,
    SolverInfo,
    Trajectory,
    estimate_timescales,
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
    if (
        not goal.free
        or CLOSED_FORM_ERROR * goal.request.size**3 > goal.accuracy
        or goal.request.system.n_links > LARGEST
    ):
        return
    if refusals(goal.request.scene, "motion in closed form"):
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
