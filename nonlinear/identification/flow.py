"""Motions of several segments and their derivatives with respect to numbers and initial states, side by side.

Every derivative has a column of its own, in which that number or component of the start has an imaginary part
(`nonlinear.integration.analytic`); all columns of a segment take the steps that its motion needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.integration.analytic import Analytic
from nonlinear.integration.lanes import Task, integrate
from nonlinear.integration.within import Inside, Step
from nonlinear.system import Numbers

MOST_STEPS = 100_000
Parts = tuple[tuple[int, float], ...]
FIRST = 0.02  # of sqrt(l/g), the first step


@dataclass(frozen=True, eq=False)
class Channel:
    """What a sensor reads: the sum of signed components of y, at times (S, K) (s).

    Times beyond the segment's end are infinite.
    """

    parts: Parts
    times: Floats

    @property
    def rows(self) -> list[int]:
        """The components of y that it reads."""
        return [row for row, _ in self.parts]


@dataclass(eq=False)
class Readings:
    """A watch: readings of every channel, (C, S, K, P) complex, and the `rates` of the motion's own, (C, S, K).

    NaN stands where a segment has no sample.  ComputationError after so many steps.
    """

    channels: Sequence[Channel]
    half: int
    ends: Floats
    most: int
    values: Any = field(init=False)
    rates: Any = field(init=False)
    steps: int = 0

    def begin(self, starts: Floats, y: Any) -> None:
        """The readings at the beginning, of y (size, S, P)."""
        self.times = np.array([channel.times for channel in self.channels])
        self.values = np.full((*self.times.shape, y.shape[2]), np.nan, dtype=complex)
        self.rates, due = np.full(self.times.shape, np.nan), self.times <= starts[:, None]
        self.next = np.count_nonzero(due, axis=2)
        for c, channel in enumerate(self.channels):
            s, k = np.nonzero(due[c])
            self.values[c, s, k] = sum(sign * y[row][s] for row, sign in channel.parts)
            self.rates[c, s, k] = sum(sign * y[row][s, 0].real for row, sign in self._rates(channel))

    def see(self, step: Step) -> None:
        """Samples that fall into the step."""
        self.steps += 1
        if self.steps > self.most:
            raise ComputationError("a segment needs too many steps to be followed")
        member, end, last = step.member, step.start + step.length, self.ends[step.member]
        until = np.where(end >= last - 4e-16 * np.abs(last), np.finfo(float).max, end)
        begin = self.next[:, member]
        passed = np.count_nonzero(self.times[:, member] <= until[:, None], axis=2)
        passed = np.where(step.taken & (step.length > 0), np.maximum(passed, begin), begin)
        columns = np.flatnonzero((passed > begin).any(0))
        if not len(columns):
            return
        inside, start, length = step.within(columns), step.start[columns], step.length[columns]
        for c, channel in enumerate(self.channels):
            count = (passed - begin)[c, columns]
            lane = np.repeat(np.arange(len(columns)), count)
            k = np.arange(len(lane)) - np.repeat(np.cumsum(count) - count - begin[c, columns], count)
            s = member[columns][lane]
            part = (self.times[c, s, k] - start[lane]) / length[lane]
            self.values[c, s, k] = _read(inside.take(lane, channel.rows), part, channel.parts)
            rates = self._rates(channel)
            self.rates[c, s, k] = _read(inside.motion.take(lane, [row for row, _ in rates]), part, rates)
        self.next[:, member] = passed

    def _rates(self, channel: Channel) -> Parts:
        """The components of y that a rate is made of; velocities have none there."""
        return tuple((row + self.half * (row < self.half), sign) for row, sign in channel.parts)


def _read(inside: Inside, part: Floats, parts: Parts) -> Any:
    return sum(sign * one for one, (_, sign) in zip(inside.at(part), parts, strict=True))


@dataclass(frozen=True, eq=False)
class Segments:
    """S segments of P columns each: their `real` numbers (S,), those of columns (S, P), and y (size, S, P).

    They go from `starts` to `ends` (s), (S,); `scale` (size,) are the natural units of y.
    """

    real: Numbers
    numbers: Numbers
    y: Any
    starts: Floats
    ends: Floats
    scale: Floats
    rate: float


def integrated(segments: Segments, channels: Sequence[Channel], tolerance: float, most: int = MOST_STEPS) -> Readings:
    """What channels read of all segments until their ends; ComputationError where one cannot be followed."""
    lanes, y = Lanes(segments.real, counts_work=False, target="columns"), segments.y
    size, count = y.shape[:2]
    absolute = np.repeat(tolerance * segments.scale[:, None], count, axis=1)
    first = np.full(count, FIRST / segments.rate)
    relative = np.full(count, tolerance)
    task = Task(lanes, segments.numbers, y, segments.ends, relative, absolute, first, start=segments.starts)
    watch = Readings(channels, size // 2, segments.ends, most)
    watch.begin(segments.starts, y)
    if segments.real.switching:
        task = Analytic(lanes, segments.numbers).begin(task)
    for reason in integrate(task, [watch]).reasons.values():
        raise ComputationError(f"a motion {reason}")
    return watch
