"""Motions of several segments and their derivatives with respect to numbers and initial states, all at once.

Every derivative has a column of its own, in which that number or component of the start has an imaginary part
(`nonlinear.integration.crowds`); all columns of a segment take the steps that its motion needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics import Lanes
from nonlinear.identification.points import PointReading
from nonlinear.integration.crowds import Analytic
from nonlinear.integration.lanes import LaneTask, integrate
from nonlinear.integration.method import within_shares
from nonlinear.integration.within import Step
from nonlinear.system import Numbers

MOTION_STEPS_MAX = 100_000
"""Limit: steps of a motion: "a segment needs too many steps to be followed"."""
Parts = tuple[tuple[int, float], ...]
SHIFT_PART = 1e-3
"""Tolerance: part of a step over which rates of accelerations are differences: the steps of a motion resolve its
fastest changes, so that the third derivative adds less than 1e-7 of them."""


@dataclass(frozen=True, eq=False)
class SensorChannel:
    """The reading of a sensor: the sum of signed components of y, or that of a `point`, at times (S, K) (s).

    Times beyond the segment's end are infinite.  Without `has_rate` its rate is not needed.
    """

    parts: Parts
    times: Floats
    point: PointReading | None = None
    has_rate: bool = True

    def rates(self, half: int) -> Parts:
        """The components of y that its rate is the sum of; none where these are not there."""
        coordinates = all(row < half for row, _ in self.parts)
        return tuple((row + half, sign) for row, sign in self.parts) if coordinates else ()


@dataclass(eq=False)
class Readings:
    """A watch: `values` that every channel reads, (C, S, K, P), and their `rates` of the motion alone, (C, S, K).

    NaN stands where a segment has no sample.  ComputationError after this many steps.
    """

    channels: Sequence[SensorChannel]
    half: int
    ends: Floats
    max_steps: int
    numbers: Numbers
    values: Any = field(init=False)
    rates: Any = field(init=False)
    steps: int = 0

    def begin(self, starts: Floats, y: Any) -> None:
        """The readings at the beginning, of y (size, S, P)."""
        times = np.array([channel.times for channel in self.channels])
        self.values = np.full((*times.shape, y.shape[2]), np.nan, dtype=y.dtype)
        self.rates = np.full(times.shape, np.nan)
        at_once = [channel.point is None and bool(channel.rates(self.half)) for channel in self.channels]
        due = (times <= starts[:, None]) & np.array(at_once)[:, None, None]
        self.next, self.next_breaks = np.count_nonzero(due, axis=2), 1
        self.times = np.pad(times, ((0, 0), (0, 0), (0, 1)), constant_values=np.inf)
        for c, channel in enumerate(self.channels):
            s, k = np.nonzero(due[c])
            self.values[c, s, k] = sum(sign * y[row][s] for row, sign in channel.parts)
            self.rates[c, s, k] = sum(sign * y[row][s, 0].real for row, sign in channel.rates(self.half))

    def see(self, step: Step) -> None:
        """Samples that fall into the step."""
        self.steps += 1
        if self.steps > self.max_steps:
            raise ComputationError("a segment needs too many steps to be followed")
        begin = self.next[:, step.member]
        times, due = self._due(step, begin)
        count = np.count_nonzero(due, axis=2)
        lanes, longest = np.flatnonzero(count.any(0)), count.max()
        if not longest:
            return
        if 2 * len(lanes) > len(step.member):
            lanes = np.arange(len(step.member))
        member, start, length = step.member[lanes], step.start[lanes, None], step.length[lanes, None]
        due, begin = due[:, lanes, :longest], begin[:, lanes]
        parts = np.where(due, (times[:, lanes, :longest] - start) / length, 0.0)
        shares = length[..., None] * within_shares(parts)
        stages, states = step.extend_stages(lanes).view(float), step.before[:, lanes].view(float)
        values = self.values.view(float)
        inside = _Within(step, lanes, stages, states, self.numbers)
        for c, channel in enumerate(self.channels):
            lane, k = np.nonzero(due[c])
            at = c, member[lane], begin[c, lane] + k
            if channel.point is not None:
                self.values[at] = inside.read(channel.point, parts[c])[lane, k]
            else:
                values[at] = _combine(channel.parts, shares[c], states, stages)[lane, k]
            if channel.point is None and (of_rate := channel.rates(self.half)):
                rates = _combine(of_rate, shares[c], states[..., :1], stages[..., :1])[..., 0]
            elif channel.has_rate and len(lane):
                rates = inside.rates(channel, parts[c])
            else:
                continue
            self.rates[at] = rates[lane, k]
        self.next[:, step.member] += count

    def _due(self, step: Step, begin: Ints) -> tuple[Floats, Booleans]:
        """The next times (C, W, ...) of all lanes, and which of them fall into the step."""
        end, last = step.start + step.length, self.ends[step.member]
        until = np.where(end >= last - 4e-16 * np.abs(last), np.finfo(float).max, end)
        until = np.where(step.taken & (step.length > 0), until, -np.inf)
        channel = np.arange(len(self.channels))[:, None, None]
        while True:
            index = np.minimum(begin[..., None] + np.arange(self.next_breaks), self.times.shape[2] - 1)
            times = self.times[channel, step.member[:, None], index]
            due = times <= until[:, None]
            if not due[..., -1].any():
                return times, due
            self.next_breaks *= 2


@dataclass(frozen=True, eq=False)
class _Within:
    """A step of some of its lanes (A,), with the `states` before (size, A, Q) and all `stages` as floats."""

    step: Step
    lanes: Ints
    stages: Floats
    states: Floats
    numbers: Numbers

    def read(self, point: PointReading, parts: Floats) -> Any:
        """The readings of a point (A, m, P) at these parts (A, m) of the step."""
        length = self.step.length[self.lanes, None]
        times = self.step.start[self.lanes, None] + parts * length
        shares = length[..., None] * within_shares(parts)
        rows = [((row, 1.0),) for row in range(len(self.states))]
        y = np.array([_combine(row, shares, self.states, self.stages) for row in rows]).view(self.step.before.dtype)
        slopes = self._slopes(y, times) if point.is_acceleration else None
        return point.at(y, slopes, self._entries, times[..., None])

    def rates(self, channel: SensorChannel, parts: Floats) -> Floats:
        """How fast (A, m) a channel's reading of the motion changes, by differences within the step."""
        return np.asarray(self._reading(channel, parts + SHIFT_PART) - self._reading(channel, parts - SHIFT_PART)) / (
            2 * SHIFT_PART * self.step.length[self.lanes, None]
        )

    def _reading(self, channel: SensorChannel, parts: Floats) -> Floats:
        if channel.point is not None:
            return np.asarray(self.read(channel.point, parts)[..., 0].real)
        shares = self.step.length[self.lanes, None, None] * within_shares(parts)
        return np.asarray(_combine(channel.parts, shares, self.states[..., :1], self.stages[..., :1])[..., 0])

    def _slopes(self, y: Any, times: Floats) -> Any:
        """The rates of y (size, A, m, P) by the equations of motion."""
        rates, slopes = self.step.rates_of(self.lanes), np.empty_like(y)
        for k in range(y.shape[2]):
            for row, rate in zip(slopes, rates(np.ascontiguousarray(y[:, :, k]), times[:, k, None]), strict=True):
                row[:, k] = rate
        return slopes

    @cached_property
    def _entries(self) -> list[Any]:
        """The numbers of every lane, (A, 1, P) where these differ."""
        entries = self.numbers.at(self.step.member[self.lanes]).entries
        return [entry[:, None] if isinstance(entry, np.ndarray) else entry for entry in entries]


def _combine(parts: Parts, shares: Floats, states: Floats, stages: Floats) -> Any:
    """The sum of components (A, m, Q) at parts of a step, by the shares (A, m, 16) of all stages (16, size, A, Q)."""
    return sum(sign * (states[row][:, None] + shares @ stages[:, row].swapaxes(0, 1)) for row, sign in parts)


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


def integrate_segments(
    segments: Segments, channels: Sequence[SensorChannel], tolerance: float, max_steps: int = MOTION_STEPS_MAX
) -> Readings:
    """The readings of channels over all segments until their ends; raise ComputationError if one cannot be followed."""
    lanes, y = Lanes(segments.real, counts_work=False, target="columns"), segments.y
    size, count = y.shape[:2]
    absolute = np.repeat(tolerance * segments.scale[:, None], count, axis=1)
    first = np.full(count, tolerance ** (1 / 8) / segments.rate)  # the error of a step goes with its eighth power
    relative = np.full(count, tolerance)
    task = LaneTask(lanes, segments.numbers, y, segments.ends, relative, absolute, first, start=segments.starts)
    watch = Readings(channels, size // 2, segments.ends, max_steps, segments.numbers)
    watch.begin(segments.starts, y)
    if segments.real.switching:
        task = Analytic(lanes, segments.numbers).begin(task)
    for reason in integrate(task, [watch]).reasons.values():
        raise ComputationError(f"a motion {reason}")
    return watch
