"""Where rhythms without an orbit of their own, beats above all, begin and end along a number.

A beat that some start ends in at one value of the map, and none at the next, is continued: its last state is the start
at the next value, then at nearer ones.  If it lasts as far as the next value, it exists there, with a share of none.
Else the steps are halved from the last value at which it lasts, down to a thousandth of the way between values.
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
from nonlinear.synchronization.attractors import PERIODIC, rhythm_of
from nonlinear.synchronization.patterns import rhythm_name
from nonlinear.system import motion_of


def name_of(group: EndingGroup) -> str:
    """The name of an outcome; of a periodic motion the pattern of its orbit."""
    if group.name != PERIODIC:
        return group.name
    if group.beginning:
        return rhythm_of(group.beginning.orbit)
    state, omega = group.ending.state, 2 * np.pi * group.ending.returns / group.ending.period
    return rhythm_name(np.asarray(state.links - 1j * state.link_rates / omega))


def rhythm_without_orbit(group: EndingGroup, members: int) -> Rhythm:
    """The rhythm of a group of so many members that ends on no branch of stable orbits."""
    ending = group.ending
    rhythm = Rhythm(name_of(group), len(group.members), members, group.copies, None, None, ending.period)
    return replace(rhythm, slow_period=ending.slow_period, exponent=group.exponent, state=ending.state)


def continued(
    groups: Callable[..., tuple[EndingGroup, ...]],
    values: Sequence[ValueRhythms],
    ends: Sequence[tuple[str, float]],
    crew: Crew | None = None,
) -> tuple[list[ValueRhythms], list[RhythmEvent]]:
    """The same values with the rhythms that last as far as there, and where those without orbits are born or die.

    `groups` gives the outcomes of starts at a value (`MapTask.groups`); `ends` are kinds and values of births and
    deaths of orbits: a beat that ends next to a Neimark–Sacker point is that point's.  A `crew` continues all rhythms
    to one side together.
    """
    complete, events = list(values), list[RhythmEvent]()
    for order in (range(len(complete)), range(len(complete))[::-1]):
        ways = list(_ways(complete, order))
        follow = partial(_follow, groups, [each.value for each in complete], ends)
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
    groups: Callable[..., tuple[EndingGroup, ...]],
    values: Sequence[float],
    ends: Sequence[tuple[str, float]],
    way: tuple[Rhythm, list[int]],
) -> tuple[list[Rhythm], RhythmEvent | None]:
    """The rhythm at the values to which it lasts, and the event that ends it, None if it lasts at all of them."""
    rhythm, places = way
    lasting: list[Rhythm] = []
    for near, target in pairwise(places):
        continuation = RhythmContinuation(groups, rhythm, values[near], values[target])
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

    groups: Callable[..., tuple[EndingGroup, ...]]
    rhythm: Rhythm
    near: float
    target: float
    tries: int = 60

    def __post_init__(self) -> None:
        self.stop, self.successor = self.target, ""
        self.is_birth = self.target < self.near
        # a chaotic motion needs long runs and an exponent at each step
        self.smallest = (1e-3 if self.rhythm.exponent is None else 0.05) * abs(self.target - self.near)

    def lasting_rhythm(self) -> Rhythm | None:
        """The rhythm at the target, in which no start was seen to end, None where it ends on the way.

        Steps double where the rhythm lasts and are halved where it is lost; after `tries` of them its end is undecided.
        """
        step = self.target - self.near
        for _ in range(self.tries):
            value = self.near + step if abs(step) < abs(self.target - self.near) else self.target
            group = self._group_at(value)
            if name_of(group) == self.rhythm.name:
                self.near, self.rhythm = value, replace(rhythm_without_orbit(group, self.rhythm.total), count=0)
                if value == self.target:
                    return self.rhythm
                step *= 2
                continue
            self.stop, self.successor = value, name_of(group)
            if abs(self.stop - self.near) <= self.smallest:
                return None
            step = (self.stop - self.near) / 2
        self.successor = UNDECIDED
        return None

    def _group_at(self, value: float) -> EndingGroup:
        assert self.rhythm.state
        start, is_chaotic = motion_of([self.rhythm.state]), self.rhythm.exponent is not None
        (group,) = self.groups(value, start, may_be_chaotic=is_chaotic)
        return group

    def event(self, ends: Sequence[tuple[str, float]]) -> RhythmEvent:
        """The birth or death on the way."""
        low, high = sorted((self.near, self.stop))
        for kind, value in ends:
            if kind == KINDS["torus"] and low - self.smallest <= value <= high + self.smallest:
                return RhythmEvent(self.rhythm.name, self.is_birth, kind, value)
        kind = UNDECIDED if self.successor == UNDECIDED else "enclosed"
        return RhythmEvent(self.rhythm.name, self.is_birth, kind, (low + high) / 2, (low, high), self.successor)
