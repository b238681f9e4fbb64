"""The cheapest way to a motion of a wished accuracy, and the evidence that it is met.

An error is the largest angle (rad) by which any link is off at any instant so far.  Ways are tried from cheap to dear:

    modes in closed form     their error from what they leave of the equations (`nonlinear.defect`)
    a few modes              of long chains, their error from more modes (`nonlinear.truncation`)
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
from itertools import chain
from math import inf
from time import perf_counter

import numpy as np

from modal.rig import Floats
from nonlinear.attempts import AIM, SAFETY, Attempt, Found, Goal
from nonlinear.methods import Choice
from nonlinear.preparation import Request
from nonlinear.requests import LOOSEST
from nonlinear.shortcuts import in_closed_form, in_few_modes
from nonlinear.state import apart
from nonlinear.steppers import SMALLEST
from nonlinear.trajectory import Trajectory

RATIO, CLIMB = 32.0, 16.0  # of the first two tolerances, and of the next ones at least
NEAREST = 4.0  # ratio of tolerances below which two runs may be one
FARTHEST = 100.0  # ratio beyond which none is trusted to be better still
ROUNDING = 4 * float(np.finfo(float).eps)  # a tolerance below which errors do not follow it
LOST, LEAP = 0.3, 1e-4  # a difference (rad) that says nothing of C; the next tolerance over this one then
TOGETHER = 2  # instants by which an event may end two runs apart


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


def advised(goal: Goal) -> Advice:
    """The cheapest way to the wished accuracy, or the finest there is where none meets it.

    After Ctrl-C what was being computed is returned, judged where a looser run has been.  Raises SimulationError where
    an integrator gives up.
    """
    attempts: list[Attempt] = []
    for found in chain(in_closed_form(goal), in_few_modes(goal), _integrated(goal)):
        attempts.append(found.attempt)
        if found.errors[-1] <= goal.accuracy or found.trajectory.run.interrupted:
            break
    run = replace(found.trajectory.run, error=found.attempt.error)
    times, last = found.trajectory.times, max(int(np.sum(found.errors <= goal.accuracy)) - 1, 0)
    kept = np.isin(times, goal.request.times)
    kept[[last, -1]] = True
    trajectory = replace(found.trajectory, run=run).at(kept)
    return Advice(goal.accuracy, trajectory, found.errors[kept], tuple(attempts), float(times[last]))


def _integrated(goal: Goal) -> Iterator[Found]:
    """Runs at tighter and tighter tolerances, each judged by the one before."""
    asked = goal.looked_at
    choice = asked.choice(min(max(goal.tolerance, SMALLEST), LOOSEST / RATIO))
    before = _run(asked, replace(choice, tolerance=RATIO * choice.tolerance))
    yield before
    while True:
        found = _beside(_run(asked, choice), before, ROUNDING * goal.constant)
        yield found
        tighter = asked.choice(max(_next(goal, found, before), SMALLEST))
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


def _next(goal: Goal, found: Found, before: Found) -> float:
    """The tolerance that should meet the accuracy; the finest of all only after one that is near enough to judge it."""
    tolerance = found.attempt.tolerance
    difference = float(_difference(found.trajectory, before.trajectory)[-1])
    if difference == inf:
        near = FARTHEST * SMALLEST
        return near if LEAP * tolerance < near < tolerance / NEAREST else LEAP * tolerance
    return min(goal.accuracy * before.attempt.tolerance / (AIM * difference), tolerance / CLIMB)
