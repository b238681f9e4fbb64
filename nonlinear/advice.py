"""The cheapest way to a motion of a wished accuracy, and the evidence that it is met.

An error is the largest angle (rad) by which any link is off at any instant so far.  Ways are tried from cheap to dear:

    modes in closed form     their error from what they leave of the equations (`nonlinear.defect`)
    integration, twice       at tolerances Rτ and τ, then at tighter ones

Errors of integration follow the tolerance, e ≈ Cτ.  Where little grows, C is a few times the motion's size, more over
many periods and at large angles; where small errors grow it is millions.  Two runs that differ by d say C ≈ d/Rτ, and

    e(τ) ≤ SAFETY d / R

of the tighter one, as measured on hundreds of random scenes.  Where that is too much, C says which tolerance comes
next.  Where even the finest is too coarse the motion is known up to a horizon and no further.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from math import ceil, inf, nan, pi
from time import perf_counter

import numpy as np

from modal.errors import ComputationError
from modal.rig import Floats
from nonlinear.defect import defect_error
from nonlinear.methods import Choice
from nonlinear.preparation import Request
from nonlinear.requests import LOOSEST
from nonlinear.state import apart
from nonlinear.steppers import SMALLEST
from nonlinear.superposition import CORRECTED, LINEAR, Superposition, superposed
from nonlinear.timescales import timescales
from nonlinear.trajectory import CLOSED, Run, Trajectory

RATIO, CLIMB = 32.0, 16.0  # of the first two tolerances, and of the next ones at least
NEAREST = 4.0  # ratio of tolerances below which two runs may be one
FARTHEST = 100.0  # ratio beyond which none is trusted to be better still
SAFETY = 8.0
MODAL = "the motion is small enough"
SOME, A_PERIOD = 3.0, 0.15  # of C over the motion's size: always, and for every period of the fastest swing
CURVED = 1 / 200  # least error of any closed form, times the cube of the motion's size
ROUNDING = 4 * float(np.finfo(float).eps)  # a tolerance below which errors do not follow it
LOST, LEAP = 0.3, 1e-4  # a difference (rad) that says nothing of C; the next tolerance over this one then
AIM = 1.1 * SAFETY  # accuracy wished for over the error that is aimed at
TOGETHER = 2  # instants by which an event may end two runs apart
PER_PERIOD, FEWEST, MOST = 12, 200, 4000  # instants at which errors are looked for


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
    """A trajectory, what its angles may be off by until every of its times (T,) in rad, and what it cost."""

    trajectory: Trajectory
    errors: Floats
    attempt: Attempt


@dataclass(frozen=True, eq=False)
class Advice:
    """The trajectory for a wished accuracy (rad), its `errors` (T,) in rad so far, and all attempts, its own last.

    `horizon` is the time (s) up to which the accuracy is met, and one of the trajectory's.
    """

    accuracy: float
    trajectory: Trajectory
    errors: Floats
    attempts: tuple[Attempt, ...]
    horizon: float

    @property
    def met(self) -> bool:
        """Whether the accuracy is met wherever the trajectory goes."""
        return bool(self.errors[-1] <= self.accuracy)

    @property
    def limit(self) -> str:
        """What is to be said where it is not met."""
        finest = self.attempts[-1].tolerance <= FARTHEST * SMALLEST
        why = ": beyond it the digits of double precision do not tell where the links are" if finest else ""
        return f"{self.accuracy:g} rad can be shown to be met up to {self.horizon:.4g} s and no further{why}"

    @property
    def certain(self) -> Trajectory:
        """The trajectory up to the horizon."""
        if self.met:
            return self.trajectory
        kept = self.trajectory.times <= self.horizon
        stopped = f"{self.accuracy:g} rad cannot be met beyond {self.horizon:.9g} s"
        run = replace(self.trajectory.run, error=float(self.errors[kept][-1]), stopped=stopped)
        happenings = tuple(one for one in self.trajectory.happenings if one.time <= self.horizon)
        return replace(self.trajectory.at(kept), run=run, happenings=happenings)


@dataclass(frozen=True, eq=False)
class Task:
    """A motion that is asked for to an accuracy (rad)."""

    request: Request
    accuracy: float

    @property
    def periods(self) -> float:
        """Of the fastest swing in all that time."""
        return self.request.duration * timescales(self.request.scene).swing / (2 * pi)

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
    def small(self) -> bool:
        """Whether modes in closed form may do."""
        asked = self.request
        free = asked.method == asked.form == "auto" and not (asked.load or asked.events)
        return free and CURVED * asked.size**3 <= self.accuracy


def advised(task: Task) -> Advice:
    """The cheapest way to the wished accuracy, or the finest there is where none meets it.

    After Ctrl-C what was being computed is returned, judged where a looser run has been.  Raises SimulationError where
    an integrator gives up.
    """
    attempts: list[Attempt] = []
    for found in chain(_in_closed_form(task), _integrated(task)):
        attempts.append(found.attempt)
        if found.errors[-1] <= task.accuracy or found.trajectory.run.interrupted:
            break
    run = replace(found.trajectory.run, error=found.attempt.error)
    times, last = found.trajectory.times, max(int(np.sum(found.errors <= task.accuracy)) - 1, 0)
    kept = np.isin(times, task.request.times)
    kept[[last, -1]] = True
    trajectory = replace(found.trajectory, run=run).at(kept)
    return Advice(task.accuracy, trajectory, found.errors[kept], tuple(attempts), float(times[last]))


def _in_closed_form(task: Task) -> Iterator[Found]:
    """Linear and corrected modes, where these can be judged."""
    if not task.small:
        return
    begun = perf_counter()
    try:
        motion = superposed(task.request.scene, task.request.start, corrected=True)
    except ComputationError:
        return
    for kind, each in ((LINEAR, motion.linear), (CORRECTED, motion)):
        if found := _superposed(task, kind, each, begun):
            yield found
        begun = perf_counter()


def _superposed(task: Task, kind: str, motion: Superposition, begun: float) -> Found | None:
    asked = task.looked_at
    estimate = defect_error(motion, asked.duration)
    if estimate is None:
        return None
    elapsed = asked.times - asked.times[0]
    errors = estimate.bounds[np.minimum(np.searchsorted(estimate.times, elapsed), len(estimate.at) - 1)]
    trajectory = Trajectory(asked.scene, asked.plant, asked.times, motion(elapsed), Run(kind, CLOSED, MODAL, inf))
    return Found(trajectory, errors, Attempt(kind, nan, perf_counter() - begun, 0, float(errors[-1])))


def _integrated(task: Task) -> Iterator[Found]:
    """Runs at tighter and tighter tolerances, each judged by the one before."""
    asked = task.looked_at
    wished = task.accuracy / (AIM * task.constant)
    choice = asked.choice(min(max(wished, SMALLEST), LOOSEST / RATIO))
    before = _run(asked, replace(choice, tolerance=RATIO * choice.tolerance))
    yield before
    while True:
        found = _beside(_run(asked, choice), before, ROUNDING * task.constant)
        yield found
        tighter = asked.choice(max(_next(task, found, before), SMALLEST))
        if tighter.tolerance * NEAREST > 1.01 * choice.tolerance:
            return
        before, choice = found, tighter


def _run(asked: Request, choice: Choice) -> Found:
    begun = perf_counter()
    trajectory = asked.run(choice)
    words = " ".join(part for part in (choice.form, choice.method, "compiled" * choice.compiled) if part)
    attempt = Attempt(words, choice.tolerance, perf_counter() - begun, trajectory.run.calls, inf)
    return Found(trajectory, np.full(len(trajectory.times), inf), attempt)


def _beside(found: Found, before: Found, rounding: float) -> Found:
    """A run with its errors, as a looser one tells them, and what rounding (rad) adds where they differ at all."""
    ratio = min(before.attempt.tolerance / found.attempt.tolerance, FARTHEST)
    difference = _difference(found.trajectory, before.trajectory)
    errors = SAFETY / ratio * difference + rounding * (difference > 0)
    return replace(found, errors=errors, attempt=replace(found.attempt, error=float(errors[-1])))


def _difference(one: Trajectory, other: Trajectory) -> Floats:
    """The largest angle (rad) so far between two runs at the times of the first, (T,), as far as both go.

    It is inf where it says nothing: where the runs have parted, or are one, or the other has ended long before.  Where
    an event ends both, a little sooner or later, the last instants take the difference before them.
    """
    both = min(len(one.times), len(other.times))
    both = int(np.sum(one.times[:both] == other.times[:both]))
    rows = slice(both)
    gone = np.maximum.accumulate(apart(one.motion.at(rows), other.motion.at(rows)))
    gone[gone > LOST] = inf
    if not gone.any() and np.ptp(one.motion.links, axis=0).any():
        gone[:] = inf
    beyond = len(one.times) - both
    return np.pad(gone, (0, beyond), constant_values=inf if beyond > TOGETHER else gone[-1])


def _next(task: Task, found: Found, before: Found) -> float:
    """The tolerance that should meet the accuracy; the finest of all only after one that is near enough to judge it."""
    tolerance = found.attempt.tolerance
    difference = float(_difference(found.trajectory, before.trajectory)[-1])
    if difference == inf:
        near = FARTHEST * SMALLEST
        return near if LEAP * tolerance < near < tolerance / NEAREST else LEAP * tolerance
    return min(task.accuracy * before.attempt.tolerance / (AIM * difference), tolerance / CLIMB)
