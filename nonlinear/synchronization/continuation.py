"""Configurations of a self-excited scene continued along a parameter: where each is stable, and where it ends.

A configuration at one value, as the physical motion q = Σ_r φ_r z_r, starts Newton's method at the next value, in
the modes φ' of the scene there: z' = φ'ᵀ M' q.  Steps are halved where amplitudes change too fast, down to RESOLUTION
of the range; a branch that cannot be continued further, or not back from there, is lost.  Where stability changes,
intermediate values are inserted by bisection.

At a critical value a branch meets another and both end ([Adler1946]: the critical detuning), or
it joins one that continues, or dies out, or continues with a change of stability.  Each is located to RESOLUTION of the
range, and beside it the point where the periodic orbits of the full equations do the same
(`nonlinear.synchronization.certificates`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from math import exp, log

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed, TextResult, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, formerly
from modal.scene.parameters import Variation, validate_variations, variation_of, vary
from modal.types import Complexes, Crew, Floats, map_by_crew
from nonlinear.averaging import (
    AveragedEquations,
    RelativeEquilibrium,
    average,
    relative_equilibria,
    relative_equilibrium,
    same,
    swinging,
)
from nonlinear.orbits import Special
from nonlinear.synchronization.certificates import critical
from nonlinear.synchronization.patterns import agreement

DYING = 0.1  # fraction of a branch's largest amplitude below which a branch that ends has died out
MOST_SEARCHES = 8
FALLS = ("disappears", "dies out", "loses stability")
RESOLUTION = 1e-4  # fraction of the range, logarithmic where the variation is
JUMP = 0.3  # largest relative change of the amplitudes from one value to the next
CLOSE = 1e-5  # relative tolerance of the return to the previous state
Report = Callable[[int], object]
Step = tuple[float, RelativeEquilibrium]


@dataclass(frozen=True)
class Change:
    """What happens to a branch at a critical value, as the parameter increases.

    `kind` is one of appears, disappears, emerges from rest, dies out, becomes stable, loses stability.  Where stability
    changes, `beat` is the rate (rad/s) at which growing perturbations oscillate, 0 where they grow monotonically.
    """

    value: float
    kind: str
    beat: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBranch(Displayed):
    """One configuration at K ascending values: those of the variation within its range and others between."""

    what = "Configuration along a number"
    shows = "variation: along; values: values; states: states"

    variation: Variation
    values: Floats
    states: tuple[RelativeEquilibrium, ...]

    @cached_property
    def is_stable(self) -> tuple[bool, ...]:
        """Whether all perturbations decay, at every value."""
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
        """The intervals in which it is stable."""
        flips = [value for value, _ in self._flips()]
        edges = [*[self.values[0]] * self.is_stable[0], *flips, *[self.values[-1]] * self.is_stable[-1]]
        return tuple((float(low), float(high)) for low, high in zip(edges[::2], edges[1::2], strict=True))

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """The critical values, ascending."""
        ends = (self._end(0, "emerges from rest", "appears"), self._end(-1, "dies out", "disappears"))
        fates = [
            Change(value, "becomes stable" if self.is_stable[after] else "loses stability", self._beat(after))
            for value, after in self._flips()
        ]
        return tuple(change for change in (ends[0], *fates, ends[1]) if change)

    def _flips(self) -> Iterator[tuple[float, int]]:
        """The midpoint of two values of different stability, and the index of the second."""
        for after, (state, other) in enumerate(pairwise(self.is_stable), start=1):
            if state != other:
                yield float((self.values[after - 1] + self.values[after]) / 2), after

    def _beat(self, after: int) -> float:
        """The oscillation rate of the fastest growing perturbation, on the unstable side."""
        rates = self.states[after - self.is_stable[after]].rates
        return float(abs(rates[0].imag)) if len(rates) else 0.0

    def _end(self, at: int, faint: str, folded: str) -> Change | None:
        """What happens at the first or last value, None where it is an end of the variation."""
        if self.values[at] == self.variation.values[at]:
            return None
        return Change(float(self.values[at]), faint if self.angle[at] < DYING * self.angle.max() else folded)


@dataclass(frozen=True, eq=False, repr=False)
class Branches(TextResult):
    """All branches that were found, those at the first value first."""

    scene: Scene
    variation: Variation
    branches: tuple[EquilibriumBranch, ...]
    writer = "nonlinear.synchronization.report:branches_text"

    @property
    def changes(self) -> tuple[tuple[Change, int], ...]:
        """Critical values of all branches in ascending order, each with the number of its branch, from 0."""
        every = ((change, number) for number, branch in enumerate(self.branches) for change in branch.changes)
        return tuple(sorted(every, key=lambda pair: pair[0].value))

    @cached_property
    def located(self) -> tuple[Special | None, ...]:
        """For every one of the `changes` where the periodic orbits of the full equations turn or change stability.

        None where no such point was found beside it.
        """
        return tuple(_located(self, at) for at in range(len(self.changes)))


@formerly(variation="vary")
@checked
def follow_branches(
    scene: Scene, vary: str | Variation, report: Report = silent, *, crew: Crew | None = None
) -> Branches:
    """The branches of a self-excited scene; `report` is called with the number followed so far.

    A `crew` follows those from one value together and locates their critical values, too.

    Configurations are searched for at both ends of the range and, up to MOST_SEARCHES times, at the next value beyond
    a point where a branch ends or loses stability.  Raises SceneError for a variation of fewer than two values or
    of a count, ComputationError where nothing excites the scene or it is outside the scope of
    `nonlinear.averaging.equations`.
    """
    variation = variation_of(vary)
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError([f"{variation.path}: branches need two or more values of a continuous parameter"])
    require(scene, "a branch of configurations")
    walk = Walk(scene, variation)
    branches: list[EquilibriumBranch] = []
    for value in _places(variation, branches):
        begun = relative_equilibria(walk.at(value))
        new = (state for state in begun if not _is_known(state, value, branches))
        for state, branch in map_by_crew(partial(_followed, walk, value), new, crew):
            if not _is_known(state, value, branches):
                branches.append(branch)
                report(len(branches))
    branches.sort(key=lambda branch: (branch.values[0], branch.omega[0]))
    found = Branches(scene, variation, tuple(branches))
    if crew is not None:
        found.__dict__["located"] = tuple(map_by_crew(partial(_located, found), range(len(found.changes)), crew))
    return found


def _followed(walk: Walk, value: float, state: RelativeEquilibrium) -> tuple[RelativeEquilibrium, EquilibriumBranch]:
    """The configuration at a value with its branch."""
    values, states = zip(*walk.whole(value, state), strict=True)
    return state, EquilibriumBranch(walk.variation, np.array(values), states)


def _located(found: Branches, at: int) -> Special | None:
    """Where the periodic orbits of the full equations do what happens at one of the critical values."""
    change, number = found.changes[at]
    branch = found.branches[number]
    return critical(found.scene, branch.variation, branch.states, branch.values, change.value)


def _is_known(state: RelativeEquilibrium, value: float, branches: Sequence[EquilibriumBranch]) -> bool:
    """Whether one of these branches has this configuration at a value."""
    pairs = (pair for branch in branches for pair in zip(branch.values, branch.states, strict=True))
    return any(at == value and same(state, other) for at, other in pairs)


def _places(variation: Variation, branches: Sequence[EquilibriumBranch]) -> Iterator[float]:
    """Where to search, updated with what has been found by then."""
    seen = [variation.values[0], variation.values[-1]]
    yield from seen
    while len(seen) < MOST_SEARCHES + 2 and (new := [v for v in _beyond(variation, branches) if v not in seen]):
        seen.append(new[0])
        yield new[0]


def _beyond(variation: Variation, branches: Sequence[EquilibriumBranch]) -> Iterator[float]:
    """The variation's values next to critical ones, on the side where a branch does not exist or is unstable."""
    values = np.array(variation.values)
    for change in (change for branch in branches for change in branch.changes):
        side = np.searchsorted(values, change.value, "right") - (change.kind not in FALLS)
        yield float(values[np.clip(side, 0, len(values) - 1)])


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

    def whole(self, value: float, state: RelativeEquilibrium) -> list[Step]:
        """Everything reached from a configuration, in both directions, in ascending order."""
        up = [v for v in self.variation.values if v > value]
        down = [v for v in reversed(self.variation.values) if v < value]
        steps = [*reversed(self._followed(value, state, down)), (value, state), *self._followed(value, state, up)]
        return [steps[0], *(step for pair in pairwise(steps) for step in self._sharpened(*pair))]

    def _followed(self, value: float, state: RelativeEquilibrium, further: Sequence[float]) -> list[Step]:
        """Follow to the last of these values, or to the end of the branch."""
        steps: list[Step] = []
        for target in further:
            steps += self._between(steps[-1] if steps else (value, state), target)
            if not steps or steps[-1][0] != target:
                break
        return steps

    def _between(self, here: Step, target: float) -> list[Step]:
        """The steps up to a value, including that value if it is reached."""
        if state := self._next(here, target):
            return [(target, state)]
        if self._close(here[0], target):
            return []
        middle = self._middle(here[0], target)
        half = self._between(here, middle)
        reached = bool(half) and half[-1][0] == middle
        return half + (self._between(half[-1], target) if reached else [])

    def _sharpened(self, before: Step, after: Step) -> list[Step]:
        """The steps from one to the next, with values inserted where stability changes between them."""
        if (before[1].is_stable is True) == (after[1].is_stable is True) or self._close(before[0], after[0]):
            return [after]
        middle = self._middle(before[0], after[0])
        state = self._next(before, middle) or self._next(after, middle)
        if state is None:
            return [after]
        return self._sharpened(before, (middle, state)) + self._sharpened((middle, state), after)

    def _next(self, here: Step, value: float) -> RelativeEquilibrium | None:
        """The same configuration there, None where the way back leads elsewhere: that is another branch."""
        state = self.moved(here[1], value)
        back = self.moved(state, here[0]) if state else None
        return state if back and same(back, here[1], CLOSE) else None

    def moved(self, state: RelativeEquilibrium, value: float) -> RelativeEquilibrium | None:
        """The same configuration at another value, None where there is none nearby."""
        z = _carried(state, self.at(value))
        moved = relative_equilibrium(self.at(value), z)
        if moved is None or len(swinging(moved.averaged, moved.z)) != len(swinging(moved.averaged, z)):
            return None
        weight = moved.averaged.omega
        return moved if np.linalg.norm(weight * (moved.z - z)) <= JUMP * np.linalg.norm(weight * z) else None

    def _close(self, value: float, other: float) -> bool:
        a, b, first, last = map(self._scaled, (value, other, self.variation.values[0], self.variation.values[-1]))
        return abs(a - b) <= RESOLUTION * (last - first)

    def _middle(self, value: float, other: float) -> float:
        middle = (self._scaled(value) + self._scaled(other)) / 2
        return exp(middle) if self.variation.log else middle

    def _scaled(self, value: float) -> float:
        return log(value) if self.variation.log else value


def _carried(state: RelativeEquilibrium, new: AveragedEquations) -> Complexes:
    """The amplitudes of the same motion in other modes, in as many bands as oscillated before."""
    z = new.dual.T @ (state.averaged.shapes @ state.z)
    energy = np.bincount(new.band, weights=(new.omega * np.abs(z)) ** 2)
    kept = np.argsort(-energy)[: len(swinging(state.averaged, state.z))]
    return np.where(np.isin(new.band, kept), z, 0.0)
