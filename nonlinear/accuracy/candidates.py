"""Levels of fidelity as data: every method for the motion of a scene, from coarse to fine.

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
from importlib.util import find_spec
from math import inf, nan
from time import perf_counter

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, silent
from modal.scene import Scene, require, validate_scene
from modal.types import Floats
from nonlinear.integration import CLOSED, Choice, Request, SolverInfo, Trajectory, taylor, validate_method
from nonlinear.reduction import CORRECTED, LINEAR, superpose
from nonlinear.system import State, system_of

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
