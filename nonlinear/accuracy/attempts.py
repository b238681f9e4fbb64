"""What is asked for to an accuracy, and ways to it that need not integrate the whole scene: modes, all or a few."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, inf, nan, pi
from time import perf_counter

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.types import Floats
from nonlinear.integration import CLOSED, LOOSEST, Request, SimulationError, SolverInfo, Trajectory, estimate_timescales
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

AIM = 35.0  # accuracy wished for over the error that is aimed at
SOME, A_PERIOD = 3.0, 0.15  # of C over the motion's size: always, and for every period of the fastest swing
PER_PERIOD, FEWEST, MOST = 12, 200, 4000  # instants at which errors are looked for
MODAL = "the motion is small enough"
CURVED = 1 / 200  # least error of any closed form, times the cube of the motion's size
LONG, SHARE = 200, 1 / 8  # links of a scene, and the share of its shapes, that make a few modes worth their while


@dataclass(frozen=True)
class Attempt:
    """A way that was tried: its tolerance (NaN for a closed form), what it cost (s; derivatives), its error (rad).

    The error is an upper estimate, inf where nothing is known of it.
    """

    way: str
    tolerance: float
    seconds: float
    calls: int
    error: float


@dataclass(frozen=True, eq=False)
class Found:
    """A trajectory, what its angles may be off by until every of its times (T,) in rad, and what it cost.

    `again` goes the same way from another start; `gave_up` is the reason of an integrator that did,
    of whose run nothing is known.
    """

    trajectory: Trajectory
    errors: Floats
    attempt: Attempt
    again: Callable[[Request], Trajectory]
    gave_up: SimulationError | None = None


@dataclass(frozen=True, eq=False)
class Goal:
    """A motion that is asked for to an accuracy (rad)."""

    request: Request
    accuracy: float

    @property
    def periods(self) -> float:
        """Of the fastest swing in all that time."""
        return self.request.duration * estimate_timescales(self.request.scene).swing / (2 * pi)

    @cached_property
    def looked_at(self) -> Request:
        """The request at the times when errors are looked for: the kept ones, and as often as the scene swings."""
        times, count = self.request.times, min(max(ceil(self.periods * PER_PERIOD), FEWEST), MOST)
        return replace(self.request, times=np.union1d(times, np.linspace(times[0], times[-1], count + 1)))

    @property
    def constant(self) -> float:
        """A guess at C (rad)."""
        return self.request.size * (SOME + (A_PERIOD + self.request.size**2) * self.periods)

    @property
    def tolerance(self) -> float:
        """Of an integrator, that should meet the accuracy."""
        return self.accuracy / (AIM * self.constant)

    @property
    def free(self) -> bool:
        """Whether anything may stand in for the integration of the whole scene."""
        asked = self.request
        return asked.method == asked.form == "auto" and not (asked.load or asked.events or asked.system.excites)


def in_closed_form(goal: Goal) -> Iterator[Found]:
    """Linear and corrected modes, where these can be judged."""
    if not goal.free or CURVED * goal.request.size**3 > goal.accuracy or goal.request.system.n_links > LARGEST:
        return
    begun = perf_counter()
    try:
        motion = superpose(goal.request.scene, goal.request.start, corrected=True)
    except ComputationError:
        return
    for kind, each in ((LINEAR, motion.linear), (CORRECTED, motion)):
        if found := _superposed(goal, kind, each, begun):
            yield found
        begun = perf_counter()


def _superposed(goal: Goal, kind: str, motion: Superposition, begun: float) -> Found | None:
    asked = goal.looked_at
    estimate = defect_error(motion, asked.duration)
    if estimate is None:
        return None
    elapsed = asked.times - asked.times[0]
    errors = estimate.bounds[np.minimum(np.searchsorted(estimate.times, elapsed), len(estimate.at) - 1)]
    trajectory = Trajectory(
        asked.scene, asked.system, asked.times, motion(elapsed), SolverInfo(kind, CLOSED, MODAL, inf)
    )

    def again(other: Request) -> Trajectory:
        moved = superpose(other.scene, other.start, corrected=kind == CORRECTED)
        return replace(trajectory, motion=moved(elapsed))

    return Found(trajectory, errors, Attempt(kind, nan, perf_counter() - begun, 0, float(errors[-1])), again)


def in_few_modes(goal: Goal) -> Iterator[Found]:
    """The lowest modes of a long scene that starts in them."""
    asked = goal.looked_at
    if not goal.free or asked.system.spatial or asked.system.n_links < LONG:
        return
    begun = perf_counter()
    try:
        survey = survey_modes(asked.scene, asked.system, asked.start)
    except (ComputationError, SceneError):
        return
    modes = survey.automatic()
    if survey.columns(modes) > SHARE * asked.system.n_links:
        return
    tolerance = min(goal.tolerance, LOOSEST)
    found = in_modes(survey, modes, asked.times, tolerance=tolerance, report=asked.report)
    run, way = found.trajectory.run, f"{len(found.kept)} mode shapes"

    def again(other: Request) -> Trajectory:
        beside = replace(survey, start=other.start)
        return in_modes(beside, modes, other.times, tolerance=tolerance, report=other.report).trajectory

    attempt = Attempt(way, run.tolerance, perf_counter() - begun, run.calls, found.error)
    yield Found(found.trajectory, found.errors, attempt, again)
