"""Where rhythms without an orbit of their own, beats above all, begin and end along a number.

A beat that some start ends in at one value of the map, and none at the next, is continued: its last state is the start
at the next value, then at nearer ones.  If it lasts as far as the next value, it exists there, with a share of none.
Else the steps are halved from the last value at which it lasts, down to a thousandth of the way between values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

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
    groups: Callable[..., tuple[EndingGroup, ...]], values: Sequence[ValueRhythms], ends: Sequence[tuple[str, float]]
) -> tuple[list[ValueRhythms], list[RhythmEvent]]:
    """The same values with the rhythms that last as far as there, and where those without orbits are born or die.

    `groups` gives the outcomes of starts at a value (`MapTask.groups`); `ends` are kinds and values of births and
    deaths of orbits: a beat that ends next to a Neimark–Sacker point is that point's.
    """
    complete, events = list(values), list[RhythmEvent]()
    count = len(complete)
    for order in (range(count), range(count)[::-1]):
        for here, there in pairwise(order):
            present = {rhythm.name for rhythm in complete[there].rhythms}
            lost = {r.name: r for r in reversed(complete[here].rhythms) if r.state and r.name not in present}
            for rhythm in lost.values():
                way = RhythmContinuation(groups, rhythm, complete[here].value, complete[there].value)
                if lasting := way.lasting_rhythm():
                    complete[there] = complete[there]._replace(rhythms=(*complete[there].rhythms, lasting))
                else:
                    events.append(way.event(ends))
    return complete, events


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
