"""Ways to a motion that do not integrate the whole scene: modes in closed form, and long chains in a few modes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf, nan
from time import perf_counter

import numpy as np

from modal.errors import ComputationError, SceneError
from nonlinear.accuracy.attempts import Attempt, Found, Goal
from nonlinear.integration import CLOSED, LOOSEST, Request, SolverInfo, Trajectory
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

MODAL = "the motion is small enough"
CURVED = 1 / 200  # least error of any closed form, times the cube of the motion's size
LONG, SHARE = 200, 1 / 8  # links of a scene, and the share of its shapes, that make a few modes worth their while


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
