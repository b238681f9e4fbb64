"""Continuation of the configurations of a self-excited scene along a parameter: stability and ends.

A configuration at one value, as the physical motion q = Σ_r φ_r z_r, starts Newton's method at the next value, in
the modes φ' of the scene there: z' = φ'ᵀ M' q.  Steps are halved where amplitudes change too fast, down to RESOLUTION
of the range; a branch that cannot be continued further, or not back from there, is lost.  Where stability changes,
intermediate values are inserted by bisection.

At a critical value a branch meets another and both end ([Adler1946]: the critical detuning), or it joins one that
continues, or dies out, or continues with a change of stability. Each is located to RESOLUTION of the range, and next to
it the point where the periodic orbits of the full equations do the same (`nonlinear.synchronization.certificates`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from math import exp, log
from typing import NamedTuple

import numpy as np

from modal.errors import SceneError
from modal.modes import table_numbers
from modal.report import Displayed, TextResult, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, formerly
from modal.scene.parameters import Variation, validate_variations, variation_of, vary
from modal.types import Crew, Floats, map_by_crew
from nonlinear.averaging import (
    LOCKED,
    AveragedEquations,
    RelativeEquilibrium,
    average,
    is_same_motion,
    relative_equilibria,
    relative_equilibrium,
    swinging,
)
from nonlinear.orbits import Orbit, Special
from nonlinear.orbits.cycles import is_same_orbit
from nonlinear.synchronization.certificates import certified_orbit, critical_point, special_point_beyond
from nonlinear.synchronization.patterns import agreement

DEATH_AMPLITUDE_RATIO = 0.1
"""Limit: of a branch's largest amplitude, below which a branch that ends "dies out" and does not "disappear"."""
SEARCHES_MAX = 8
"""Limit: searches for configurations beyond critical values."""
FALLS = ("disappears", "dies out", "loses stability")
RESOLUTION = 1e-4
"""Tolerance: fraction of the range to which a critical value is located; the first order of averaging errs by more."""
AMPLITUDE_JUMP_MAX = 0.3
"""Tolerance: largest relative change of the amplitudes from one value to the next: that of another branch is 1."""
RETURN_DIFFERENCE_MAX = 1e-5
"""Tolerance: relative, of the way back to the previous state: Newton's method leaves 1e-8."""
Report = Callable[[int], object]
Step = tuple[float, RelativeEquilibrium]


@dataclass(frozen=True)
class Change:
    """The event of a branch at a critical value, as the parameter increases.

    `kind` is one of appears, disappears, emerges from rest, dies out, becomes stable, loses stability. Where stability
    changes, `beat` is the rate (rad/s) at which growing perturbations oscillate, 0 if they grow monotonically, and
    `rival` the mode that takes the energy in them, "" where they are of the motion's own mode.
    """

    value: float
    kind: str
    beat: float = 0.0
    rival: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBranch(Displayed):
    """One configuration at K ascending values: those of the variation within its range and others between.

    Angle, frequency and `is_stable` are those of averaged equations; `orbits` are the exact motions next to them.
    """

    what = "Configuration along a number"
    shows = "variation: along; values: values; states: states"

    variation: Variation
    values: Floats
    states: tuple[RelativeEquilibrium, ...]
    _orbits: dict[int, Orbit | None] = field(default_factory=dict)

    def orbit(self, at: int) -> Orbit | None:
        """The periodic orbit of the full equations next to the state at an index, None if there is none; found once."""
        if at not in self._orbits:
            self._orbits[at] = orbit_beside(self.states[at])
        return self._orbits[at]

    @property
    def orbits(self) -> tuple[Orbit | None, ...]:
        """These orbits at all values."""
        return tuple(map(self.orbit, range(len(self.states))))

    def find_orbits(self, crew: Crew | None) -> None:
        """Find all orbits together."""
        indices = [at for at in range(len(self.states)) if at not in self._orbits]
        orbits = map_by_crew(orbit_beside, [self.states[at] for at in indices], crew)
        self._orbits.update(zip(indices, orbits, strict=True))

    @cached_property
    def is_stable(self) -> tuple[bool, ...]:
        """Whether all perturbations decay by averaged equations, at every value."""
        return tuple(state.is_stable is True for state in self.states)

    @cached_property
    def angle(self) -> Floats:
        """The largest angle (rad) of any link, (K,)."""
        return np.array([state.averaged.largest(state.z) for state in self.states])

    @cached_property
    def omega(self) -> Floats:
        """Frequency (rad/s), (K,)."""
        return np.array([state.omega for state in self.states])

    @cached_property
    def words(self) -> str:
        """The pattern of the pendula at the first value, and at the last where that differs."""
        return " → ".join(dict.fromkeys(agreement(self.states[at]) for at in (0, -1)))

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """The intervals in which it is stable by averaged equations."""
        flips = [value for value, _ in self._flips()]
        edges = [*[self.values[0]] * self.is_stable[0], *flips, *[self.values[-1]] * self.is_stable[-1]]
        return tuple((float(low), float(high)) for low, high in zip(edges[::2], edges[1::2], strict=True))

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """The critical values, ascending."""
        ends = (self._end(0, "emerges from rest", "appears"), self._end(-1, "dies out", "disappears"))
        fates = [
            Change(value, "becomes stable" if self.is_stable[index] else "loses stability", *self._growing(index))
            for value, index in self._flips()
        ]
        return tuple(change for change in (ends[0], *fates, ends[1]) if change)

    def _flips(self) -> Iterator[tuple[float, int]]:
        """The midpoint of two values of different stability, and the index of the second."""
        for index, (state, following) in enumerate(pairwise(self.is_stable), start=1):
            if state != following:
                yield float((self.values[index - 1] + self.values[index]) / 2), index

    def _growing(self, index: int) -> tuple[float, str]:
        """The oscillation rate and the mode of the fastest growing perturbation, on the unstable side."""
        state = self.states[index - self.is_stable[index]]
        if not len(state.rates):
            return 0.0, ""
        modes, row = state.averaged.modes, int(state.rivals[0])
        rival = f"mode {table_numbers(state.averaged.scene, modes)[row]} ({modes[row].family})"
        return float(abs(state.rates[0].imag)), rival if state.leaving[0] > LOCKED else ""

    def _end(self, at: int, faint: str, fold: str) -> Change | None:
        """The event at the first or last value, None if it is an end of the variation."""
        if self.values[at] == self.variation.values[at]:
            return None
        return Change(
            float(self.values[at]), faint if self.angle[at] < DEATH_AMPLITUDE_RATIO * self.angle.max() else fold
        )


class ExactBranch(NamedTuple):
    """The intervals in which the orbits next to a branch are stable, and the special points of these orbits."""

    intervals: tuple[tuple[float, float], ...]
    points: tuple[Special, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Branches(TextResult):
    """All branches that were found, those at the first value first."""

    scene: Scene
    variation: Variation
    branches: tuple[EquilibriumBranch, ...]
    writer = "nonlinear.synchronization.branch_report:branches_text"

    @property
    def changes(self) -> tuple[tuple[Change, int], ...]:
        """Critical values of all branches in ascending order, each with the number of its branch, from 0."""
        numbered_changes = (
            (change, number) for number, branch in enumerate(self.branches) for change in branch.changes
        )
        return tuple(sorted(numbered_changes, key=lambda pair: pair[0].value))

    @cached_property
    def special_points(self) -> tuple[Special | None, ...]:
        """For every one of the `changes` where the periodic orbits of the full equations turn or change stability.

        None if no such point was found next to it.
        """
        return tuple(_locate(self, at) for at in range(len(self.changes)))

    @cached_property
    def exact(self) -> tuple[ExactBranch, ...]:
        """Where the orbits next to every branch are stable, and their special points."""
        return tuple(map(self._exact, range(len(self.branches))))

    def _exact(self, number: int) -> ExactBranch:
        branch, pairs = self.branches[number], zip(self.changes, self.special_points, strict=True)
        points = [special for (_, branch_number), special in pairs if special and branch_number == number]
        verdicts = zip(branch.values.tolist(), branch.orbits, branch.states, strict=True)
        rows = [(value, orbit.is_stable, state) for value, orbit, state in verdicts if orbit]
        first, last = ((value, False, None) for value in (self.variation.values[0], self.variation.values[-1]))
        borders = []
        for (low, was_stable, state), (high, is_stable, following) in pairwise((first, *rows, last)):
            if was_stable == is_stable:
                continue
            here, beyond = (low, high) if was_stable else (high, low)
            within = [point for point in points if low <= value_of(point) <= high]
            begin = state if was_stable else following
            if state and following and begin and not within:  # at an end of the branch it has been sought before
                special = special_point_beyond(self.scene, self.variation, begin, here, beyond)
                points += [special] if special else []
                within = [special] if special else []
            borders.append(min(map(value_of, within), key=lambda value: abs(value - here), default=here))
        intervals = tuple(zip(borders[::2], borders[1::2], strict=True))
        return ExactBranch(intervals, tuple(sorted(points, key=value_of)))


def value_of(special: Special) -> float:
    """The value of the number at a special point."""
    return float(special.orbit.value or 0.0)


@formerly(variation="vary")
@checked
def follow_branches(
    scene: Scene, vary: str | Variation, report: Report = silent, *, crew: Crew | None = None
) -> Branches:
    """The branches of a self-excited scene; `report` is called with the number followed so far.

    A `crew` follows those from one value together and locates their critical values, too.

    Configurations are searched for at both ends of the range and, up to eight times, at the next value beyond a point
    where a branch ends or loses stability. Raise SceneError for a variation of fewer than two values or of a count,
    ComputationError if nothing excites the scene or it is outside the scope of `nonlinear.averaging.equations`.
    """
    variation = variation_of(vary)
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError([f"{variation.path}: branches need two or more values of a continuous parameter"])
    require(scene, "a branch of configurations")
    walk = Walk(scene, variation)
    branches: list[EquilibriumBranch] = []
    for value in _places(variation, branches):
        equilibria = relative_equilibria(walk.at(value))
        new = (state for state in equilibria if not _is_known(state, value, branches))
        for state, branch in map_by_crew(partial(_follow, walk, value), new, crew):
            if not _is_known(state, value, branches):
                branches.append(branch)
                report(len(branches))
    branches.sort(key=lambda branch: (branch.values[0], branch.omega[0]))
    result = Branches(scene, variation, tuple(_distinct_branches(branches)))
    if crew is not None:
        result.__dict__["special_points"] = tuple(
            map_by_crew(partial(_locate, result), range(len(result.changes)), crew)
        )
        for branch in result.branches:
            branch.find_orbits(crew)
    return result


def _follow(walk: Walk, value: float, state: RelativeEquilibrium) -> tuple[RelativeEquilibrium, EquilibriumBranch]:
    """The configuration at a value with its branch."""
    values, states = zip(*walk.trace(value, state), strict=True)
    return state, EquilibriumBranch(walk.variation, np.array(values), states)


def orbit_beside(state: RelativeEquilibrium) -> Orbit | None:
    """The periodic orbit of the full equations next to a configuration."""
    return certified_orbit(state.averaged.scene, state)


def _distinct_branches(branches: Sequence[EquilibriumBranch]) -> list[EquilibriumBranch]:
    """The branches, without those whose periodic orbits are the ones of another branch before them."""
    distinct: list[EquilibriumBranch] = []
    for branch in branches:
        if not any(_has_orbits_of(branch, other) for other in distinct):
            distinct.append(branch)
    return distinct


def _has_orbits_of(branch: EquilibriumBranch, other: EquilibriumBranch) -> bool:
    """Whether a branch has the orbits of another, at the first and the last of its values of the variation."""
    places, others = ({value: at for at, value in enumerate(each.values.tolist())} for each in (branch, other))
    values = [value for value in branch.variation.values if value in places]
    if not values or not set(values) <= set(others):
        return False
    pairs = [(places[value], others[value]) for value in (values[0], values[-1])]
    if any(agreement(branch.states[at]) != agreement(other.states[there]) for at, there in pairs):
        return False
    orbits = ((branch.orbit(at), other.orbit(there)) for at, there in pairs)
    return all(orbit and neighbour and is_same_orbit(orbit, neighbour) for orbit, neighbour in orbits)


def _locate(branches: Branches, at: int) -> Special | None:
    """Where the periodic orbits of the full equations have the event of one of the critical values."""
    change, number = branches.changes[at]
    branch = branches.branches[number]
    return critical_point(branches.scene, branch.variation, branch.states, branch.values, change.value)


def _is_known(state: RelativeEquilibrium, value: float, branches: Sequence[EquilibriumBranch]) -> bool:
    """Whether one of these branches has this configuration at a value."""
    pairs = (pair for branch in branches for pair in zip(branch.values, branch.states, strict=True))
    return any(at == value and is_same_motion(state, neighbour) for at, neighbour in pairs)


def _places(variation: Variation, branches: Sequence[EquilibriumBranch]) -> Iterator[float]:
    """Where to search, updated with what has been found by then."""
    values = np.array(variation.values)
    places = [variation.values[0], variation.values[-1]]
    yield from places
    while len(places) < SEARCHES_MAX + 2:
        new = []
        for change in (change for branch in branches for change in branch.changes):
            # the next value on the side where a branch does not exist or is unstable
            side = np.searchsorted(values, change.value, "right") - (change.kind not in FALLS)
            new.append(float(values[np.clip(side, 0, len(values) - 1)]))
        place = next((value for value in new if value not in places), None)
        if place is None:
            return
        places.append(place)
        yield place


class Walk:
    """Continuation along the values of a variation, with as many in between as amplitudes require."""

    def __init__(self, scene: Scene, variation: Variation) -> None:
        self.scene, self.variation = scene, variation
        self._made: dict[float, AveragedEquations] = {}

    def at(self, value: float) -> AveragedEquations:
        """The averaged equations at a value."""
        if value not in self._made:
            self._made[value] = average(vary(self.scene, {self.variation.path: value}))
        return self._made[value]

    def trace(self, value: float, state: RelativeEquilibrium) -> list[Step]:
        """Everything reached from a configuration, in both directions, in ascending order."""
        up = [v for v in self.variation.values if v > value]
        down = [v for v in reversed(self.variation.values) if v < value]
        steps = [*reversed(self._follow(value, state, down)), (value, state), *self._follow(value, state, up)]
        return [steps[0], *(step for pair in pairwise(steps) for step in self._sharpen(*pair))]

    def _follow(self, value: float, state: RelativeEquilibrium, further: Sequence[float]) -> list[Step]:
        """Follow to the last of these values, or to the end of the branch."""
        steps: list[Step] = []
        for target in further:
            steps += self._between(steps[-1] if steps else (value, state), target)
            if not steps or steps[-1][0] != target:
                break
        return steps

    def _between(self, step: Step, target: float) -> list[Step]:
        """The steps up to a value, including that value if it is reached."""
        if state := self._next(step, target):
            return [(target, state)]
        if self._is_close(step[0], target):
            return []
        middle = self._middle(step[0], target)
        half = self._between(step, middle)
        is_reached = bool(half) and half[-1][0] == middle
        return half + (self._between(half[-1], target) if is_reached else [])

    def _sharpen(self, first: Step, second: Step) -> list[Step]:
        """The steps from one to the next, with values inserted where stability changes between them."""
        if (first[1].is_stable is True) == (second[1].is_stable is True) or self._is_close(first[0], second[0]):
            return [second]
        middle = self._middle(first[0], second[0])
        state = self._next(first, middle) or self._next(second, middle)
        if state is None:
            return [second]
        return self._sharpen(first, (middle, state)) + self._sharpen((middle, state), second)

    def _next(self, step: Step, value: float) -> RelativeEquilibrium | None:
        """The same configuration there, None if the way back leads elsewhere: that is another branch."""
        state = self.move(step[1], value)
        back = self.move(state, step[0]) if state else None
        return state if back and is_same_motion(back, step[1], RETURN_DIFFERENCE_MAX) else None

    def move(self, state: RelativeEquilibrium, value: float) -> RelativeEquilibrium | None:
        """The same configuration at another value, None if there is none nearby."""
        equations = self.at(value)
        z = equations.dual.T @ (state.averaged.shapes @ state.z)
        energy = np.bincount(equations.band, weights=(equations.omega * np.abs(z)) ** 2)
        bands = np.argsort(-energy)[: len(swinging(state.averaged, state.z))]  # as many as oscillated before
        z = np.where(np.isin(equations.band, bands), z, 0.0)
        equilibrium = relative_equilibrium(equations, z)
        if equilibrium is None or len(swinging(equations, equilibrium.z)) != len(swinging(equations, z)):
            return None
        jump = np.linalg.norm(equations.omega * (equilibrium.z - z)) / np.linalg.norm(equations.omega * z)
        return equilibrium if jump <= AMPLITUDE_JUMP_MAX else None

    def _is_close(self, value: float, second: float) -> bool:
        a, b, first, last = map(self._coordinate, (value, second, self.variation.values[0], self.variation.values[-1]))
        return abs(a - b) <= RESOLUTION * (last - first)

    def _middle(self, value: float, second: float) -> float:
        middle = (self._coordinate(value) + self._coordinate(second)) / 2
        return exp(middle) if self.variation.log else middle

    def _coordinate(self, value: float) -> float:
        return log(value) if self.variation.log else value
