"""Prediction of the surviving mode by the averaged equations for a start, and its reliability."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import degrees, pi

import numpy as np

from modal.errors import ComputationError
from modal.modes import table_numbers
from modal.report import Displayed
from modal.scene import Scene, require, validate_scene
from modal.types import Complexes, Floats
from nonlinear.averaging.equations import AveragedEquations, average
from nonlinear.averaging.equilibria import RelativeEquilibrium, relative_equilibrium
from nonlinear.averaging.slow_flow import SlowFlow, runs_away, settle
from nonlinear.system import Layout, State, initial_state, system_of, validate_state

AVERAGED_RATE_MAX = 0.2
"""Limit: largest rate of growth or decay over the frequency, beyond which it is "too fast to be averaged"."""
FIRST_ORDER_ANGLE_MAX = 0.7
"""Limit: largest angle (rad), beyond which links are "beyond the range of first order"."""
KICK_REACH_MIN = 1.25
"""Limit: least reach of an escapement over its angle, below which it "may miss kicks"."""
WINNER_ENERGY_MIN = 0.9
"""Limit: least fraction of the energy in a survivor: with less "no mode wins"."""
RESONANCE_WIDTH = 0.1
"""Limit: largest sum of frequencies over the lowest that is "in resonance"; three times as wide for times."""
TIMED_RATE_MARGIN_MIN = 5.0
"""Limit: least decay rate of other modes over its error, else "the last rate is a small difference of large ones"."""
TIMED_SWINGS_MIN = 10
"""Limit: shortest locking time in periods; "it comes within 10 swings"."""
TIME_DIFFERENCE_MAX = 0.2
"""Limit: largest relative difference of neighbours' times; they "lock more than 20 % sooner or later"."""
ASIDE = 0.05
"""Limit: relative distance of neighbouring starts; "starts 5 % away from this one end elsewhere"."""
NEIGHBOUR_SEED = 11
"""Format: of the neighbouring starts, which are the same in every run."""
E_FOLDING_TIMES = 10.0
"""Limit: of a slowest rate, that a transient lasts: a perturbation of 5e-5 has grown or decayed to order 1 then."""


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Displayed):
    """The slow `motion` from a `start`, those of its neighbours, and the configuration in which it ends, if any.

    A symmetric start may end in an `unstable` configuration that real pendula would leave.  Then `start` is a perturbed
    start, 5 % in relative amplitude, to which everything else refers.
    """

    what = "Slow motion as averaged equations predict it"
    shows = "ending: ends in; motion: motion; neighbours: neighbours; unstable: unstable equilibria on the way"

    averaged: AveragedEquations
    start: State
    unstable: RelativeEquilibrium | None
    motion: SlowFlow
    neighbours: tuple[SlowFlow, ...]
    ending: RelativeEquilibrium | None

    @property
    def row(self) -> int:
        """The row of the mode table without dampers that survives, from 0."""
        return self.motion.survivor

    @property
    def number(self) -> int:
        """The number of that mode in the table of the scene."""
        return int(table_numbers(self.averaged.scene, self.averaged.modes)[self.row])

    @property
    def share(self) -> float:
        """The survivor's share of the energy at the end."""
        return float(self.motion.share[self.row, -1])

    @property
    def is_won(self) -> bool:
        """Whether the surviving mode has enough of the energy to be the only one."""
        return self.share >= WINNER_ENERGY_MIN

    @property
    def indecision(self) -> str:
        """The doubt that no mode survives alone, with the share of the strongest; "" if one does."""
        if self.is_won:
            return ""
        return f"no mode wins: the strongest has {100 * self.share:.3g} % of the energy"

    @property
    def unsettled(self) -> str:
        """The doubt that the slow motion has not settled; "" if it has, or dies."""
        if self.motion.dies or self.motion.settled:
            return ""
        return f"nothing has settled after {self.motion.times[-1]:.3g} s"

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why the survivor is not certain; empty if it is."""
        return tuple(words for words, _ in self._doubts())

    @property
    def doubts_of_start(self) -> tuple[str, ...]:
        """Those reasons that would remain if the final state were known to be stable in the full equations."""
        return tuple(words for words, of_start in self._doubts() if of_start)

    @property
    def certain(self) -> bool:
        """Whether the survivor is certain."""
        return not self.doubts

    def locking_time(self) -> float | None:
        """The time (s) from which all other rows hold less than 1 % of the energy; None if never."""
        return None if self.motion.dies else self.motion.locking_time()

    @cached_property
    def timing_doubts(self) -> tuple[str, ...]:
        """Reasons why the locking time is not certain to 20 %; empty if it is."""
        return tuple(self._timing_doubts())

    def _timing_doubts(self) -> Iterator[str]:
        yield from self.doubts
        locking = self.locking_time()
        if locking is None:
            yield "no mode ever contains 99 % of the energy"
            return
        if locking < TIMED_SWINGS_MIN * 2 * pi / self.averaged.omega.min():
            yield f"it comes within {TIMED_SWINGS_MIN} swings, less than averaging resolves"
        times = [neighbour.locking_time() for neighbour in self.neighbours]
        if any(time is None or abs(time - locking) > TIME_DIFFERENCE_MAX * locking for time in times):
            yield f"neighbouring starts lock more than {100 * TIME_DIFFERENCE_MAX:.0f} % sooner or later"
        if resonant(self.averaged.centre, 3 * RESONANCE_WIDTH):
            yield "another mode follows the survivor as its third harmonic, or as another combination"
        if self.ending and self.ending.hold < TIMED_RATE_MARGIN_MIN * self._error:
            yield "the last rate is a small difference of large ones"

    def _doubts(self) -> Iterator[tuple[str, bool]]:
        """Every reason, and whether it concerns the way from this start instead of the final state."""
        if self.motion.dies:
            if self.motion.reach < KICK_REACH_MIN:
                yield "a clock starts so close to the angle of its escapement that it may go on", True
            yield from ((words, False) for words in self._limits())
            return
        if self.unsettled:
            yield self.unsettled, True
        elif not self.is_won:
            yield self.indecision, False
        if self.ending is None or self.ending.hold < 2 * self._error:
            yield "the final state attracts its neighbours only weakly", False
        if min(flow.reach for flow in (self.motion, *self.neighbours)) < KICK_REACH_MIN:
            yield "a clock starts or passes below the angle of its escapement, or near it, and may miss kicks", True
        if any(neighbour.survivor != self.row or neighbour.dies for neighbour in self.neighbours):
            yield f"starts {100 * ASIDE:.0f} % away from this one end elsewhere", True
        yield from ((words, False) for words in self._limits())

    @cached_property
    def _error(self) -> float:
        """The uncertainty (1/s) of the final rates, as a fraction of the fastest, whose differences they are.

        It is (fastest/ω)², as damping shifts frequencies, plus a²/16, as a pendulum is slower at large angles.
        """
        equations, ending = self.averaged, self.ending
        assert ending is not None
        fast, lowest = float(np.abs(ending.rates.real).max(initial=0.0)), float(equations.omega.min())
        return fast * ((fast / lowest) ** 2 + equations.largest(ending.z) ** 2 / 16)

    def _limits(self) -> Iterator[str]:
        """Reasons to doubt averaging itself."""
        equations = self.averaged
        if (fast := fastest(equations)) > AVERAGED_RATE_MAX:
            yield f"dampers and drives act within {1 / fast:.3g} radians of a swing, too fast to be averaged"
        if (angle := equations.largest(self.motion.z)) > FIRST_ORDER_ANGLE_MAX:
            yield f"links may reach {degrees(angle):.3g} deg, beyond the range of first order"
        if equations.mixing(self.motion.z, equations.turning(self.motion.z)) > 0.5:
            yield "an escapement responds to several frequencies at once, and may kick out of turn"
        if resonant(equations.centre, RESONANCE_WIDTH):
            yield "frequencies of different bands are in resonance"


def predict(scene: Scene, start: State | None = None) -> Prediction:
    """The prediction for a self-excited scene from its own start or another, perturbed if it ends in an unstable state.

    Raise ComputationError if nothing excites it or it is outside the scope of `nonlinear.averaging.equations`, for a
    start at rest, and where drives are so strong that averaged amplitudes grow without bound.
    """
    validate_scene(scene)
    require(scene, "a prediction of synchronization")
    system = system_of(scene)
    state = validate_state(start if start is not None else initial_state(scene), system)
    equations = average(scene, system)
    z = equations.amplitudes(state)
    if not np.abs(z).max():
        raise ComputationError("the scene starts at rest, where nothing determines which mode grows")
    starts, unstable = np.array([z, *_neighbours(z)]).T, None
    motions = settle(equations, starts)
    if runs_away(equations, motions[0].z):
        raise ComputationError("drives are too strong for averaged equations: their amplitudes exceed half a turn")
    if (ending := _ending(motions[0])) and ending.is_stable is False:
        motions = settle(equations, starts, shortest=E_FOLDING_TIMES * ending.relaxation)
        if (ending := _ending(motions[0])) and ending.is_stable is False:
            state, unstable, motions = _aside(equations, state), ending, motions[1:]
            ending = _ending(motions[0])
    return Prediction(equations, state, unstable, motions[0], motions[1:], ending)


def _ending(motion: SlowFlow) -> RelativeEquilibrium | None:
    return None if motion.dies else relative_equilibrium(motion.averaged, motion.z[:, -1])


def _aside(equations: AveragedEquations, start: State) -> State:
    """The first of the neighbouring starts."""
    z = equations.amplitudes(start)
    off = next(_neighbours(z)) - z
    aside = np.concatenate((equations.shapes @ off, equations.shapes @ (1j * equations.omega * off))).real
    layout = Layout.of(equations.system, works=False)
    return layout.state(layout.begin(start) + aside)


def _neighbours(z: Complexes) -> Iterator[Complexes]:
    """Neighbouring starts: every amplitude slightly perturbed, including zero ones."""
    random = np.random.default_rng(NEIGHBOUR_SEED)
    for _ in range(4):
        off = random.standard_normal(len(z)) + 1j * random.standard_normal(len(z))
        yield z + ASIDE * off * (np.abs(z) + ASIDE * np.abs(z).max())


def resonant(omega: Floats, width: float) -> bool:
    """Whether sums of up to four of these frequencies (B,), with signs, nearly vanish, as for ω and 3ω."""
    for turns in product(range(-3, 4), repeat=len(omega)):
        if 0 < sum(map(abs, turns)) <= 4 and abs(np.dot(turns, omega)) < width * omega.min():
            return True
    return False


def fastest(equations: AveragedEquations) -> float:
    """The largest growth or decay rate of small oscillations over their frequency."""
    unit: Complexes = np.eye(len(equations.omega), dtype=complex)
    tiny = 1e-6 / equations.largest(unit)
    small = (tiny * unit).astype(complex)
    linear = equations.linear(small, equations.turning(small)) / tiny
    return float(np.abs(np.linalg.eigvals(linear).real).max() / equations.omega.min())
