"""Where rhythms without an orbit of their own, beats above all, begin and end along a number.

A beat that some start ends in at one value of the map, and none at the next, is continued: its last state is the start
at ten values on the way to the next, run together.  If it lasts as far as that, it exists there, with a share of
none.  Else the way from the last value at which it lasts to the one after is divided again, down to a thousandth of the
way between values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from modal.types import Crew, map_by_crew
from nonlinear.ensembles.endings import UNDECIDED, EndingGroup
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, ValueRhythms
from nonlinear.orbits.stable import KINDS
from nonlinear.synchronization.attractors import rhythm_of

OutcomesOf = Callable[..., Sequence[EndingGroup]]


def name_of(group: EndingGroup) -> str:
    """The name of an outcome; of a periodic motion the pattern of its orbit."""
    return rhythm_of(group.beginning.orbit) if group.beginning else group.name


def rhythm_without_orbit(group: EndingGroup, members: int) -> Rhythm:
    """The rhythm of a group of so many members that ends on no branch of stable orbits."""
    ending = group.ending
    rhythm = Rhythm(name_of(group), len(group.members), members, group.copies, None, None, ending.period)
    return replace(rhythm, slow_period=ending.slow_period, exponent=group.exponent, state=ending.state)


def continued(
    outcomes: OutcomesOf,
    values: Sequence[ValueRhythms],
    ends: Sequence[tuple[str, float]],
    crew: Crew | None = None,
) -> tuple[list[ValueRhythms], list[RhythmEvent]]:
    """The same values with the rhythms that last as far as there, and where those without orbits are born or die.

    `outcomes` tells what a rhythm ends in at several values (`MapTask.outcomes`); `ends` are kinds and values of births
    and deaths of orbits: a beat that ends next to a Neimark–Sacker point is that point's.  A `crew` continues all
    rhythms to one side together.
    """
    complete, events = list(values), list[RhythmEvent]()
    for order in (range(len(complete)), range(len(complete))[::-1]):
        ways = list(_ways(complete, order))
        follow = partial(_follow, outcomes, [each.value for each in complete], ends)
        for (_, places), (lasting, event) in zip(ways, map_by_crew(follow, ways, crew), strict=True):
            for place, rhythm in zip(places[1:], lasting, strict=False):
                complete[place] = complete[place]._replace(rhythms=(*complete[place].rhythms, rhythm))
            events += [event] if event else []
    return complete, events


def _ways(values: Sequence[ValueRhythms], order: Sequence[int]) -> Iterator[tuple[Rhythm, list[int]]]:
    """Rhythms without an orbit that are not seen at the next value: the place of the last and those beyond without."""
    names = [{rhythm.name for rhythm in value.rhythms} for value in values]
    for step, (here, there) in enumerate(pairwise(order), start=1):
        lost = {r.name: r for r in reversed(values[here].rhythms) if r.state and r.name not in names[there]}
        for rhythm in lost.values():
            seen = next((place for place in order[step:] if rhythm.name in names[place]), None)
            yield rhythm, [here, *order[step : None if seen is None else order.index(seen)]]


def _follow(
    outcomes: OutcomesOf,
    values: Sequence[float],
    ends: Sequence[tuple[str, float]],
    way: tuple[Rhythm, list[int]],
) -> tuple[list[Rhythm], RhythmEvent | None]:
    """The rhythm at the values to which it lasts, and the event that ends it, None if it lasts at all of them."""
    rhythm, places = way
    lasting: list[Rhythm] = []
    for near, target in pairwise(places):
        continuation = RhythmContinuation(outcomes, rhythm, values[near], values[target])
        following = continuation.lasting_rhythm()
        if following is None:
            return lasting, continuation.event(ends)
        lasting.append(rhythm := following)
    return lasting, None


@dataclass
class RhythmContinuation:
    """The continuation of a rhythm from a value `near`, at which it is known, to a `target` where no start ends in it.

    It was not seen at `stop`, where it goes over into the `successor`.
    """

    outcomes: OutcomesOf
    rhythm: Rhythm
    near: float
    target: float
    rounds: int = 20
    lanes: int = 10

    def __post_init__(self) -> None:
        self.stop, self.successor = self.target, ""
        self.is_birth = self.target < self.near
        # a chaotic motion needs long runs and an exponent at each step
        self.smallest = (1e-3 if self.rhythm.exponent is None else 0.1) * abs(self.target - self.near)

    def lasting_rhythm(self) -> Rhythm | None:
        """The rhythm at the target, in which no start was seen to end, None where it ends on the way.

        Its steps ahead are as many as `lanes`, and longer after it lasted at all of them; after so many `rounds` its
        end is undecided.
        """
        reach = self.target - self.near
        for _ in range(self.rounds):
            start, values = self.near, self._values_ahead(reach)
            groups = self.outcomes(values, self.rhythm, self.near)
            lasting = [k for k, group in enumerate(groups) if name_of(group) == self.rhythm.name]
            following = lasting[-1] + 1 if lasting else 0
            if lasting:
                group = groups[lasting[-1]]
                self.near = values[lasting[-1]]
                self.rhythm = replace(rhythm_without_orbit(group, self.rhythm.total), count=0)
            if self.near == self.target:
                return self.rhythm
            if following == len(values):
                reach *= 2
                continue
            settling = [k for k in range(following, len(values)) if name_of(groups[k]) != UNDECIDED]
            end, before = settling[0] if settling else following, (start, self.stop)
            self.stop, self.successor = values[end], name_of(groups[end])
            # next to the end of a rhythm motions settle slowly: what is undecided there is no end
            nearest = values[0] if (self.near, self.stop) == before else self.stop
            reach = nearest - self.near
            if abs(nearest - start) <= self.smallest * (1 + 1e-9):
                return None
        self.successor = UNDECIDED
        return None

    def _values_ahead(self, reach: float) -> list[float]:
        """Evenly spaced values to so far ahead, none beyond the target."""
        values = self.near + reach * np.arange(1, self.lanes + 1) / self.lanes
        return list(dict.fromkeys((np.maximum if self.is_birth else np.minimum)(values, self.target).tolist()))

    def event(self, ends: Sequence[tuple[str, float]]) -> RhythmEvent:
        """The birth or death on the way."""
        low, high = sorted((self.near, self.stop))
        for kind, value in ends:
            if kind == KINDS["torus"] and low - self.smallest <= value <= high + self.smallest:
                return RhythmEvent(self.rhythm.name, self.is_birth, kind, value)
        kind = UNDECIDED if self.successor == UNDECIDED else "enclosed"
        return RhythmEvent(self.rhythm.name, self.is_birth, kind, (low + high) / 2, (low, high), self.successor)
