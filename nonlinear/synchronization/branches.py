"""Configurations of a self-excited scene followed along one of its numbers: where each lasts, and where it is lost.

At a critical value a branch meets another and both cease (Adler, Proc. IRE 34, 351 (1946): the critical detuning), or
it comes upon one that goes on, or dies out, or goes on while neighbours that came back leave.  Each is found to
`continuation.RESOLUTION` of the range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.scene import Scene
from modal.scene.parameters import Variation, validate_variations
from modal.types import Floats
from nonlinear.averaging import RelativeEquilibrium, relative_equilibria, same
from nonlinear.synchronization.continuation import Walk
from nonlinear.synchronization.patterns import agreement

DYING = 0.1  # of a branch's largest amplitude: below it a branch that ceases has died out
MOST_SEARCHES = 8
FALLS = ("is lost", "dies out", "stops lasting")

Report = Callable[[int], object]


@dataclass(frozen=True)
class Change:
    """What becomes of a branch at a critical value, as the parameter grows.

    `kind` is one of appears, is lost, comes alive, dies out, starts to last, stops lasting.  Where fate changes, `beat`
    is the rate (rad/s) at which neighbours beat as they leave, 0 where they leave steadily.
    """

    value: float
    kind: str
    beat: float = 0.0


@dataclass(frozen=True, eq=False)
class Branch:
    """One configuration at K ascending values: those of the variation that it reaches and others between."""

    variation: Variation
    values: Floats
    states: tuple[RelativeEquilibrium, ...]

    @cached_property
    def lasts(self) -> tuple[bool, ...]:
        """Whether all neighbours come back, at every value."""
        return tuple(state.lasts is True for state in self.states)

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
        """How the pendula agree at the first value, and at the last where that is something else."""
        return " → ".join(dict.fromkeys(agreement(self.states[at]) for at in (0, -1)))

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """From where to where it lasts."""
        flips = [value for value, _ in self._flips()]
        edges = [*[self.values[0]] * self.lasts[0], *flips, *[self.values[-1]] * self.lasts[-1]]
        return tuple((float(low), float(high)) for low, high in zip(edges[::2], edges[1::2], strict=True))

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """In the order of the values."""
        ends = (self._end(0, "comes alive", "appears"), self._end(-1, "dies out", "is lost"))
        fates = [
            Change(value, "starts to last" if self.lasts[after] else "stops lasting", self._beat(after))
            for value, after in self._flips()
        ]
        return tuple(change for change in (ends[0], *fates, ends[1]) if change)

    def _flips(self) -> Iterator[tuple[float, int]]:
        """The middle of two values of different fates, and the place of the second."""
        for after, (one, other) in enumerate(pairwise(self.lasts), start=1):
            if one != other:
                yield float((self.values[after - 1] + self.values[after]) / 2), after

    def _beat(self, after: int) -> float:
        """Of the fastest growing neighbours, on the side that does not last."""
        rates = self.states[after - self.lasts[after]].rates
        return float(abs(rates[0].imag)) if len(rates) else 0.0

    def _end(self, at: int, faint: str, folded: str) -> Change | None:
        """What happens at the first or last value, None where it is that of the variation."""
        if self.values[at] == self.variation.values[at]:
            return None
        return Change(float(self.values[at]), faint if self.angle[at] < DYING * self.angle.max() else folded)


@dataclass(frozen=True, eq=False)
class Branches:
    """All branches that were found, those at the first value first."""

    scene: Scene
    variation: Variation
    branches: tuple[Branch, ...]

    @property
    def changes(self) -> tuple[tuple[Change, int], ...]:
        """Critical values of all branches in ascending order, each with the number of its branch, from 0."""
        every = ((change, number) for number, one in enumerate(self.branches) for change in one.changes)
        return tuple(sorted(every, key=lambda pair: pair[0].value))


def follow_branches(scene: Scene, variation: Variation, report: Report = lambda done: None) -> Branches:
    """The branches of a scene that excites itself, `report` hearing how many have been followed.

    Configurations are searched for at both ends of the range and, up to MOST_SEARCHES times, at the next value beyond
    the place where a branch is lost or no longer lasts.  Raises SceneError for a variation of fewer than two values or
    of a count, ComputationError where nothing excites the scene or `nonlinear.averaging.equations` cannot take it.
    """
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError(
            [f"{variation.path}: branches are over two values or more of a parameter that varies smoothly"]
        )
    if not scene.is_driven:
        raise ComputationError("nothing excites this scene: no configuration keeps swinging")
    walk = Walk(scene, variation)
    found: list[Branch] = []
    for value in _places(variation, found):
        for state in relative_equilibria(walk.at(value)):
            if not any(same(state, other) for other in _known(found, value)):
                values, states = zip(*walk.whole(value, state), strict=True)
                found.append(Branch(variation, np.array(values), states))
                report(len(found))
    order = sorted(found, key=lambda one: (one.values[0], one.omega[0]))
    return Branches(scene, variation, tuple(order))


def _known(found: Sequence[Branch], value: float) -> list[RelativeEquilibrium]:
    return [state for one in found for at, state in zip(one.values, one.states, strict=True) if at == value]


def _places(variation: Variation, found: Sequence[Branch]) -> Iterator[float]:
    """Where to search, with an eye on what has been found by then."""
    seen = [variation.values[0], variation.values[-1]]
    yield from seen
    while len(seen) < MOST_SEARCHES + 2 and (new := [v for v in _beyond(variation, found) if v not in seen]):
        seen.append(new[0])
        yield new[0]


def _beyond(variation: Variation, found: Sequence[Branch]) -> Iterator[float]:
    """The variation's values next to critical ones, on the side where a branch is not or does not last."""
    values = np.array(variation.values)
    for change in (change for one in found for change in one.changes):
        side = np.searchsorted(values, change.value, "right") - (change.kind not in FALLS)
        yield float(values[np.clip(side, 0, len(values) - 1)])
