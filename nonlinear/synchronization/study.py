"""The synchronization of one scene: the prediction of the averaged equations, and the result of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from math import ceil, pi
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, TextResult, silent
from modal.scene import Scene, refusals, require, validate_scene
from modal.scene.doors import checked
from nonlinear.averaging import Prediction, RelativeEquilibrium, is_same_motion, predict, relative_equilibria
from nonlinear.averaging.prediction import E_FOLDING_TIMES
from nonlinear.integration import Trajectory, estimate_timescales
from nonlinear.orbits import Orbit
from nonlinear.simulation import resume, simulate
from nonlinear.synchronization.certificates import (
    certificate_refusal,
    certified_orbit,
    orbit_at_the_end,
    with_distinct_orbits,
)
from nonlinear.synchronization.modal_energy import SHARE_DIFFERENCE_MAX, Survival, find_survival
from nonlinear.synchronization.phases import Phases, phases_of
from nonlinear.synchronization.populations import PopulationPhases, population_phases
from nonlinear.synchronization.sectors import SymmetricMotion, symmetric_motions
from nonlinear.system import Kicks, Motion, State

LOCKING_TIMES = 1.5
"""Limit: default of `duration` over the predicted locking time."""
PERIODS_AFTER_LOCKING = 30
"""Limit: periods of the slowest mode that are added to it."""
USUAL_PERIODS = 200
"""Limit: default of `duration` in periods where nothing predicts it, and the least transient before samples."""
UNCERTIFIED = "no stable periodic orbit of the full equations was found near the final state"
PERIODS_MAX = 5000
"""Limit: the longest default of `duration` in periods."""
SEARCHED_PENDULA_MAX = 8
"""Limit: "among … pendula on a structure steady motions are not searched for one by one"."""
POPULATION_PERIODS_MAX = 2000
"""Limit: the longest default of it in periods."""
POPULATION_TOLERANCE = 1e-7
"""Limit: default of `tolerance` in runs of populations, whose outcome is a class and no number."""


@dataclass(frozen=True, eq=False, repr=False)
class Theory(Displayed):
    """The prediction of the averaged equations: the steady oscillations of a scene, and the outcome of its start."""

    configurations: tuple[RelativeEquilibrium, ...]
    prediction: Prediction

    @cached_property
    def orbits(self) -> tuple[Orbit | None, ...]:
        """The periodic orbit of every configuration in the full equations, None if none was found next to it."""
        scene = self.prediction.averaged.scene
        return tuple(certified_orbit(scene, state) for state in self.configurations)

    @cached_property
    def ending(self) -> Orbit | None:
        """The stable orbit of the full equations in which the predicted motion ends, None if none was found."""
        state = self.prediction.ending
        if state is None:
            return None
        neighbours = (
            orbit
            for neighbour, orbit in zip(self.configurations, self.orbits, strict=True)
            if is_same_motion(state, neighbour)
        )
        orbit = None if state.is_family else next(neighbours, None)
        orbit = orbit or certified_orbit(self.prediction.averaged.scene, state)
        return orbit if orbit and orbit.is_stable else None

    @cached_property
    def distinct(self) -> tuple[tuple[RelativeEquilibrium, Orbit | None], ...]:
        """Every configuration with its orbit, and of several next to one and the same orbit the first."""
        return with_distinct_orbits(zip(self.configurations, self.orbits, strict=True))

    @property
    def certificate_refusal(self) -> str:
        """Why stability is that of the averaged equations alone, "" where periodic orbits are looked for."""
        return certificate_refusal(self.prediction.averaged.scene)

    @property
    def is_family(self) -> bool:
        """Whether the predicted motion is one of a continuous family, none of which is an orbit by itself."""
        return self.prediction.ending is not None and self.prediction.ending.is_family

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the survivor is not certain before anything is simulated.

        Where a stable orbit was found those of averaging do not count; where none was found, that is one.
        """
        if self.ending:
            return self.prediction.doubts_of_start
        missing = () if self.is_family or self.prediction.motion.dies else (self.certificate_refusal or UNCERTIFIED,)
        return (*self.prediction.doubts, *missing)


@dataclass(frozen=True, eq=False, repr=False)
class SynchronizationStudy(TextResult):
    """Theory and simulation of a scene; without theory or modes, `silent` and `unmeasured_reason` say why.

    `orbit` is the stable periodic orbit at the end of the run, looked for where the prediction alone is not certain.
    On a structure `populations` are the phases of the run by populations, and `motions` their symmetric motions, or
    `motionless` says why there are none.
    """

    scene: Scene
    theory: Theory | None
    silent: str
    trajectory: Trajectory
    phases: Phases
    survival: Survival | None
    unmeasured_reason: str
    orbit: Orbit | None = None
    populations: PopulationPhases | None = None
    motions: tuple[SymmetricMotion, ...] = ()
    motionless: str = ""
    writer = "nonlinear.synchronization.report:sync_text"

    @property
    def agrees(self) -> bool | None:
        """Whether the simulated survivor is the predicted one with its share of the energy, within 5 %.

        None if one of them is missing, or the run too short: where it has not settled, or the predicted one has not
        locked by its end. A beat is what is predicted where no mode wins, and the predicted share occurs in it.
        """
        if self.theory is None or self.survival is None or self.theory.prediction.motion.dies:
            return None
        prediction = self.theory.prediction
        if self.survival.beat:
            beating = self.survival.times >= self.survival.times[-1] - self.survival.beat.period
            share = self.survival.share[beating][:, self.survival.row == prediction.row + 1]
            off = max(float(share.min()) - prediction.share, prediction.share - float(share.max()))
            return not prediction.is_won and off <= SHARE_DIFFERENCE_MAX
        if self.locks_later:
            return None
        alike = self.leads and abs(prediction.share - self.survival.survivor_share) <= SHARE_DIFFERENCE_MAX
        goes_on = self.survival.is_settled or bool(self.survival.beating)
        has_ended = self.orbit is not None or (goes_on and not self.too_short)
        return alike if alike or has_ended else None

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the prediction is not certain, the run and the orbit at its end included."""
        if self.theory is None:
            return ()
        if self.agrees is False:
            return ("the simulation ends elsewhere", *self.theory.doubts)
        if self.survival and self.survival.beat and self.agrees:
            prediction = self.theory.prediction
            return tuple(doubt for doubt in prediction.doubts_of_start if doubt != prediction.unsettled)
        if self.orbit and self.agrees:
            return ()
        if self.theory.is_family and self.agrees:
            of_start = self.theory.prediction.doubts_of_start
            return tuple(doubt for doubt in self.theory.doubts if doubt not in of_start)
        return self.theory.doubts

    @property
    def verdict(self) -> str:
        """The outcome of the run: "settles", "beats", "rests", or "undecided"; "" where energies were not measured."""
        if self.survival is None:
            return ""
        if self.survival.is_at_rest:
            return "rests"
        if self.orbit or self.survival.is_steady:
            return "settles"
        return "beats" if self.survival.beat else "undecided"

    @property
    def leads(self) -> bool:
        """Whether the predicted survivor holds most of the energy at the end of the run."""
        if self.theory is None or self.survival is None:
            return False
        return self.theory.prediction.row + 1 == self.survival.survivor

    @cached_property
    def locks_later(self) -> bool:
        """Whether the run is too short, and its pendula still drift by 9° or more in its second half."""
        try:
            spread = float(np.ptp(self.phases.frequency))
        except ComputationError:
            return self.too_short
        return self.too_short and spread > self.phases.resolution / 10

    @property
    def too_short(self) -> bool:
        """Whether the run ends before the predicted survivor has locked."""
        locking = self.theory.prediction.locking_time() if self.theory else None
        return locking is not None and float(self.trajectory.times[-1]) < locking


def theory_of_scene(scene: Scene, start: State | None = None, report: Callable[[float], object] = silent) -> Theory:
    """The theory of a self-excited scene; ComputationError outside the scope of averaged equations.

    `report` is called with the part that is done.
    """
    validate_scene(scene)
    prediction = predict(scene, start)
    report(1 / 4)
    equilibria = relative_equilibria(prediction.averaged, lambda part: report((1 + 3 * part) / 4))
    return Theory(equilibria, prediction)


def usual_duration(scene: Scene, theory: Theory | None, motions: Sequence[SymmetricMotion] = ()) -> float:
    """Seconds after which the predicted outcome is visible, at most 5,000 periods of the slowest mode.

    Of populations that is ten times as long as the slowest of their growth rates needs, up to 2,000 periods.
    """
    orbits = [motion.orbit for motion in motions if motion.orbit]
    if orbits:
        period = max(motion.orbit.period for motion in orbits)
        longest = POPULATION_PERIODS_MAX * period
        slowest = min(abs(rate) for motion in orbits for rate in motion.growth)
        return float(np.clip(longest if not slowest else E_FOLDING_TIMES / slowest, USUAL_PERIODS * period, longest))
    if theory is None:
        return USUAL_PERIODS * 2 * pi / (estimate_timescales(scene).swing or 1.0)
    period = 2 * pi / float(theory.prediction.averaged.omega.min())
    locking = theory.prediction.locking_time()
    duration = USUAL_PERIODS * period if locking is None else LOCKING_TIMES * locking + PERIODS_AFTER_LOCKING * period
    return min(duration, PERIODS_MAX * period)


def longest_duration(theory: Theory | None, usual: float) -> float:
    """Seconds after which a run is not prolonged: four times its `usual` duration, or as long as the slow flow took.

    The second, which is longer where averaged motion settles slowly, counts up to 5,000 periods of the slowest mode.
    """
    if theory is None:
        return 4 * usual
    longest = PERIODS_MAX * 2 * pi / float(theory.prediction.averaged.omega.min())
    return max(4 * usual, min(float(theory.prediction.motion.times[-1]), longest))


@checked
def study_synchronization(
    scene: Scene,
    duration: float | None = None,
    *,
    start: State | None = None,
    report: Callable[[float, float], object] = silent,
    predicting: Callable[[float], object] = silent,
    **options: Any,
) -> SynchronizationStudy:
    """Predict, simulate for `duration` seconds (by default as long as the prediction needs) and measure.

    A run without a duration is prolonged until it has settled, at most to `longest_duration`: in a beat, or where the
    prediction alone is not certain within 5 % of a stable periodic orbit, by whose multipliers it stays there.

    `start` replaces the initial condition of the scene file, `options` are those of `simulate`; `predicting` is called
    with the part of the prediction that is done, `report` with the simulated time and the duration.  A start that ends
    in an unstable state is replaced by a perturbed one, in prediction and simulation.  KeyboardInterrupt where Ctrl-C
    cuts the run short.
    """
    require(scene, "synchronization")
    silent = "; ".join(refusals(scene, "a prediction of synchronization"))
    motions: tuple[SymmetricMotion, ...] = ()
    motionless = silent
    if scene.is_structured and not silent:
        motions, motionless = _attempt(lambda: symmetric_motions(scene, predicting))
        motions = motions or ()
        if scene.n_pendula > SEARCHED_PENDULA_MAX:
            silent = f"among {scene.n_pendula} pendula on a structure steady motions are not searched for one by one"
    theory, silent = (None, silent) if silent else _attempt(lambda: theory_of_scene(scene, start, predicting))
    length = duration or usual_duration(scene, theory, motions)
    if scene.is_structured:
        options.setdefault("tolerance", POPULATION_TOLERANCE)
    if theory is not None and theory.prediction.unstable:
        start = theory.prediction.start
    modes = theory and theory.prediction.averaged.modes
    is_certain = theory is not None and not theory.doubts
    trajectory = simulate(
        scene, length, start=start, report=partial(_forward, report, length), **options
    ).uninterrupted()
    longest = duration or longest_duration(theory, length)
    while True:
        survival, unmeasured_reason = _attempt(partial(find_survival, trajectory, modes))
        orbit = None if is_certain or survival is None else orbit_at_the_end(trajectory)
        is_enough = is_certain or theory is None or theory.is_family
        has_ended = survival is None or survival.is_at_rest or survival.beat or (survival.is_steady and is_enough)
        passed = float(trajectory.times[-1])
        if orbit or has_ended or passed >= longest * (1 - 1e-9):
            break
        more = min(passed, longest - passed)
        samples = 1 + ceil((len(trajectory.times) - 1) * more / passed)
        seconds = partial(_forward, report, passed + more)
        trajectory = joined(trajectory, resume(trajectory, more, output=samples, report=seconds).uninterrupted())
    phases = phases_of(trajectory)
    populations = population_phases(phases), motions, motionless
    return SynchronizationStudy(
        scene, theory, silent, trajectory, phases, survival, unmeasured_reason, orbit, *populations
    )


def joined(first: Trajectory, later: Trajectory) -> Trajectory:
    """A run and the one that continues it, as one run."""
    parts = [(getattr(first.motion, part.name), getattr(later.motion, part.name)[1:]) for part in fields(Motion)]
    motion = Motion(*map(np.concatenate, parts))
    motion.work[len(first.times) :] += first.motion.work[-1]
    kicks = Kicks._make(np.concatenate(pair) for pair in zip(first.kicks, later.kicks, strict=True))
    times = np.concatenate((first.times, later.times[1:]))
    return replace(later, times=times, motion=motion, kicks=kicks)


def _forward(report: Callable[[float, float], object], length: float, seconds: float) -> None:
    report(seconds, length)


def _attempt(action: Callable[[], Any]) -> tuple[Any, str]:
    """The result of an action, or None and the reason for its failure."""
    try:
        return action(), ""
    except ComputationError as error:
        return None, str(error)
