"""Reference solutions for the candidates, and the horizon up to which they are reliable.

The reference is the finest run available, checked against a second one with another implementation or form of the
equations or another integrator; in space, if there is one form, with another tolerance. With d(t) the largest
difference of angles so far, an error e can be measured where d < e/100. A run with a start perturbed by 1e-9
(`nonlinear.integration.run`) also gives the factor G(t) by which an error grows: a reference of relative accuracy ε
has an error of ε G(t), which for G = exp λt becomes intolerable at ln(tolerable/ε)/λ. So both

    d(t) < 1e-8   and   ε G(t) < 1e-8     (rad; for small motions relative to the motion's size)

hold up to the horizon: until then errors from 1e-6 on are certain, and smaller ones where d and ε G permit.
The perturbed start has no symmetry, as the start may have: two runs that share a symmetry agree for longer than they
are right.

Levels of fidelity as data: every method for the motion of a scene, from coarse to fine.

    (0) linear modes            superposed in closed form (`nonlinear.reduction.superposition`)
    (1) corrected modes         the same with each mode's frequency at its own amplitude
    (2) minimal coordinates     integrators × tolerances, plain and compiled; in space unit vectors
    (3) maximal coordinates     the DAE with every pivot force

A candidate prepares what it needs for a question (modes, series, compiled code) and returns a task that computes the
motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.util import find_spec
from math import inf, log, nan
from time import perf_counter
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, silent
from modal.scene import Scene, refusals, require, validate_scene
from modal.types import Floats
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration import (
    CLOSED,
    PROVED,
    SMALLEST,
    TIGHTEST,
    Choice,
    Request,
    SolverInfo,
    Trajectory,
    aside,
    enclose_motion,
    slightly,
    taylor,
    validate_method,
)
from nonlinear.reduction import CORRECTED, LINEAR, superpose
from nonlinear.system import State, apart, system_of

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
IN_PLANE = ("RK23", "RK45", "DOP853", "Radau", "LSODA")
IN_SPACE = ("RK23", "RK45", "DOP853")

Task = Callable[[], Trajectory]


class GivenUpError(ComputationError):
    """A run that takes longer than its time limit."""


@dataclass(frozen=True, eq=False, repr=False)
class Question(Displayed):
    """The motion of a scene at `times` (T,) in s from 0 on after this start; a run may take `patience` seconds.

    `report` is called with the share of each run that is done.
    """

    what = "Motion by which methods are compared"
    shows = "scene: scene; times: times; patience: longest run, s"

    scene: Scene
    start: State
    times: Floats
    patience: float = inf
    report: Callable[[float], object] = silent

    @property
    def request(self) -> Request:
        """The request to the integrators."""
        return Request(self.scene, system_of(self.scene), self.start, self.times)


@dataclass(frozen=True)
class Candidate:
    """One method: a `kind`, and for an integration the integrator, its tolerance and whether it is compiled.

    `kind` is "linear modes", "corrected modes" or a form of the equations.
    """

    kind: str
    method: str = ""
    tolerance: float = nan
    compiled: bool = False

    @property
    def modal(self) -> bool:
        """Whether nothing is integrated."""
        return self.kind in {LINEAR, CORRECTED}

    @property
    def family(self) -> str:
        """The name of the candidate without its tolerance."""
        return " ".join(part for part in (self.kind, self.method, "compiled" * self.compiled) if part)

    @property
    def name(self) -> str:
        """The full name."""
        return self.family if self.modal else f"{self.family} {self.tolerance:g}"

    def prepare(self, question: Question) -> Task:
        """A task that computes the motion, once; ComputationError or SceneError if this is impossible.

        The task raises ComputationError if the run fails, GivenUpError if it takes too long, KeyboardInterrupt on
        Ctrl-C.
        """
        return self._superposition_task(question) if self.modal else self._integration_task(question)

    def _superposition_task(self, question: Question) -> Task:
        scene, times, system = question.scene, question.times, system_of(question.scene)
        motion = superpose(scene, question.start, corrected=self.kind == CORRECTED)
        info = SolverInfo(self.kind, CLOSED, "one level of fidelity of several", inf)

        def task() -> Trajectory:
            states = motion(times)
            if not np.all(np.isfinite(states.links)):
                raise ComputationError("the modes overflow")
            return Trajectory(scene, system, times, states, info)

        return task

    def _integration_task(self, question: Question) -> Task:
        request = question.request
        validate_method(question.scene, self.method, self.kind)
        if self.compiled:
            require(question.scene, "compiled equations")
        request = replace(request, form=self.kind)
        choice = Choice(self.kind, self.method, self.compiled, "one level of fidelity of several", self.tolerance)
        ready = request.prepare_run(choice)

        def task() -> Trajectory:
            try:
                trajectory = ready.go(report=_impatient(question))
            except TimeoutError as error:
                raise GivenUpError(str(error)) from None
            if trajectory.run.interrupted:
                raise KeyboardInterrupt
            return trajectory

        return task


def _impatient(question: Question) -> Callable[[float], None]:
    """A report that ends a run which exceeds its time limit, or clearly will at its present pace."""
    start, patience, duration = perf_counter(), question.patience, question.times[-1]

    def report(time: float) -> None:
        seconds = perf_counter() - start
        share = min(1.0, time / duration)
        question.report(share)
        if seconds > patience * max(share, 0.5):  # from half of its time on a run is judged by its pace
            raise TimeoutError(f"given up after {seconds:.2g} s, at {time:.3g} s of the motion")

    return report


def list_candidates(scene: Scene) -> tuple[Candidate, ...]:
    """Every candidate for a scene, by family, each from loose to tight; only what is installed."""
    validate_scene(scene)
    if scene.space == "space":
        families = [("spatial", method, False) for method in IN_SPACE]
    else:
        families = [("minimal", method, False) for method in (*IN_PLANE, *(["taylor"] if taylor.available() else []))]
        families += [("minimal", "DOP853", True)] if find_spec("numba") and not scene.has_modal_damping else []
        families += [("maximal", "DOP853", False)]
    integrators = [
        Candidate(kind, method, tolerance, is_compiled)
        for kind, method, is_compiled in families
        for tolerance in TOLERANCES
    ]
    return Candidate(LINEAR), Candidate(CORRECTED), *integrators


DIFFERENCE_SHARE_MAX = 1e-2
"""Tolerance: the largest difference of the references over an error that they can measure."""
ERROR_MEASURABLE = 1e-6
"""Limit: error (rad at angles of order 1) that must still be measurable at the horizon, as the report says."""
TWIN = Candidate("minimal", "DOP853", 1e-12)


@dataclass(frozen=True, eq=False, repr=False)
class Reference(Displayed):
    """A trajectory up to the horizon, computed by `candidate` and checked by `check`.

    `difference` (T,) is the largest difference of the two so far (rad), `growth` (T,) the largest factor so far by
    which a small perturbation of the start has grown, `duration` (s) the requested duration.
    """

    candidate: Candidate
    check: Candidate
    trajectory: Trajectory
    difference: Floats
    growth: Floats
    duration: float

    @property
    def horizon(self) -> float:
        """Time (s) up to which errors are compared."""
        return float(self.trajectory.times[-1])

    @property
    def is_proved(self) -> bool:
        """Whether the trajectory is the middle of a tube."""
        return self.candidate.method == PROVED

    @property
    def whole(self) -> bool:
        """Whether the reference is reliable for the whole duration."""
        return self.horizon >= self.duration

    @cached_property
    def floor(self) -> float:
        """The smallest error (rad) that can be measured up to the horizon."""
        trajectory = self.trajectory
        size = Question(trajectory.scene, trajectory.motion[0], trajectory.times).request.size
        return float(max(self.difference[-1], self.candidate.tolerance * self.growth[-1] * size) / DIFFERENCE_SHARE_MAX)

    @property
    def exponent(self) -> float:
        """Mean rate (1/s) at which a perturbation grew up to the horizon."""
        return log(max(float(self.growth[-1]), 1.0)) / self.horizon


def reference_of(question: Question) -> Reference:
    """The finest motion and its horizon; raise ComputationError if two references disagree from the beginning."""
    scene, duration = question.scene, float(question.times[-1])
    finest, check = choose_references(scene)
    size = question.request.size
    tolerable = DIFFERENCE_SHARE_MAX * ERROR_MEASURABLE * size
    growth = _growth(question)
    question = _shorten(question, finest.tolerance * growth * size < tolerable)
    solution, check_solution = (candidate.prepare(question)() for candidate in (finest, check))
    difference = np.maximum.accumulate(apart(solution.motion, check_solution.motion))
    shorter = _shorten(question, difference < tolerable)
    if len(shorter.times) < len(question.times):
        solution = finest.prepare(shorter)()
    count = len(shorter.times)
    return Reference(finest, check, solution, difference[:count], growth[:count], duration)


def enclose_reference(question: Question) -> Reference:
    """Return the midpoints of a tube that provably contains the motion, independent of the errors of candidates."""
    duration = float(question.times[-1])
    scene, times, start = question.scene, question.times, question.start

    def report(time: float) -> None:
        question.report(time / duration)

    tube = enclose_motion(scene, duration, radius=TIGHTEST, output=times, start=start, report=report)
    proof = Candidate("minimal", PROVED, TIGHTEST)
    return Reference(proof, proof, tube.trajectory, tube.radii, np.ones(len(tube.rows)), duration)


def choose_references(scene: Scene) -> tuple[Candidate, Candidate]:
    """The finest candidate for a scene and another one to check it."""
    validate_scene(scene)
    if scene.space == "space":
        return Candidate("spatial", "DOP853", SMALLEST), Candidate("spatial", "DOP853", 1e-13)
    finest = Candidate("minimal", "DOP853", SMALLEST)
    plain = not refusals(scene, "method taylor") and Inputs(system_of(scene)).pieces is not None
    if plain and taylor.takes(system_of(scene)):
        return Candidate("minimal", "taylor", TIGHTEST), finest
    if not refusals(scene, "form hamiltonian"):
        return finest, Candidate("hamiltonian", "DOP853", 1e-13)
    if not refusals(scene, "an implicit method"):
        return finest, Candidate("minimal", "LSODA", 1e-13)
    return finest, Candidate("minimal", "DOP853", 1e-12)


def _growth(question: Question) -> Floats:
    """G (T,): the largest distance so far of the perturbed run from the run, over the perturbation of its start."""
    candidate = TWIN if question.scene.space == "plane" else replace(TWIN, kind="spatial")
    system = system_of(question.scene)
    twin = replace(question, start=aside(system, question.start, slightly(system, question.start)))
    motion, twin_motion = (candidate.prepare(task_question)().motion for task_question in (question, twin))
    distance = np.maximum.accumulate(apart(motion, twin_motion))
    return np.asarray(distance / distance[0])


def _shorten(question: Question, is_trusted: Any) -> Question:
    """The question up to the last time before which everything is trusted."""
    count = len(is_trusted) if np.all(is_trusted) else int(np.argmin(is_trusted))
    if count < 2:
        raise ComputationError(
            f"two references disagree from {question.times[count]:.3g} s on: no reference is left to measure errors by"
        )
    return replace(question, times=question.times[:count])
