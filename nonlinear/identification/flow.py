"""Motions of several segments and their derivatives with respect to numbers and initial states, side by side.

Every derivative has a lane of its own, in which that number or component of the start has an imaginary part of ε: the
equations are analytic, so the imaginary part of the motion, over ε, is the derivative to the last digit (Squire &
Trapp, SIAM Review 40, 110 (1998)).  All lanes of a segment take the steps of DOP853 that its motion needs.

Joints with dry friction slip or stick (`sticking`).  Where a joint changes from one to the other, at a time that
depends on the numbers, y gains (f₋ − f₊) δt with δt = −γ'/γ'' in each lane (the saltation matrix; Leine &
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, §7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics import Lanes
from nonlinear.identification.sticking import Joint, Rates, Responses
from nonlinear.integration.method import END, EXTRA, FIFTH, MORE, POWERS, ROWS, STAGES, THIRD, summed
from nonlinear.system import Numbers

SAFETY, SHRINKS, GROWS = 0.9, 0.2, 5.0
LOOKS = (0.25, 0.5, 0.75, 1.0)
"""Parts of a step at which joints are looked at."""
ROUNDS = 40  # of the secant method with its ends kept apart
HALVINGS = 16  # of the time in which a joint that just began to slip may already have turned back
NEAR = 1e-8  # of a step: what is left of an event's time is made up for to first order
MOST_EVENTS = 1_000
MOST_STEPS = 100_000
FIRST = 0.05  # of sqrt(l/g), the first step


@dataclass(frozen=True, eq=False)
class Channel:
    """What a sensor reads: the sum of signed components of y, at times (S, K) since each segment's start.

    Times beyond the segment's end are infinite.
    """

    parts: tuple[tuple[int, float], ...]
    times: Floats

    def read(self, rows: Any, offset: int = 0) -> Any:
        """Its value from the rows of y, with `offset` the size of a half the rate of a position."""
        return sum(sign * rows[at] for (_, sign), at in zip(self.parts, self.rows(offset), strict=True))

    def rows(self, offset: int) -> list[int]:
        """The rows of y that it reads, with `offset` those of their rates; velocities have none there."""
        return [row + offset if row < offset else row for row, _ in self.parts]


@dataclass(frozen=True, eq=False)
class Task:
    """S segments in P lanes each: numbers and y0 of all W = S P lanes, segment by segment.

    `ends` (S,) are durations (s); `scale` (size,) the natural units of y.
    """

    lanes: Lanes
    numbers: Any
    y0: Any
    ends: Floats
    channels: Sequence[Channel]
    joints: Sequence[Joint]
    scale: Floats
    tolerance: float
    first: float
    most: int = MOST_STEPS


@dataclass(eq=False)
class Result:
    """Readings and their rates of every channel, (C, S, K, P) complex, NaN where a segment has no sample.

    `events` counts changes between slip and stick.
    """

    values: Any
    rates: Any
    events: int = 0
    steps: int = 0


def integrate(task: Task) -> Result:
    """All segments to their ends; ComputationError where one cannot be followed."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        return _Front(task).run()


class _Front:
    """Where every segment stands."""

    def __init__(self, task: Task) -> None:
        self.task, self.S = task, len(task.ends)
        self.P = task.y0.shape[1] // self.S
        self.segment = np.arange(self.S)
        self.t, self.ends = np.zeros(self.S), task.ends.astype(float)
        self.h = np.minimum(task.first, self.ends)
        self.y = np.array(task.y0, dtype=complex)
        self.half = task.lanes.layout.half
        self.times = np.array([channel.times for channel in task.channels])  # (C, S, K)
        self.next = np.zeros(self.times.shape[:2], dtype=int)
        shape = (*self.times.shape, self.P)
        self.result = Result(np.full(shape, np.nan, dtype=complex), np.full(shape, np.nan, dtype=complex))
        self.landing = np.full(self.S, -1)
        self.refused = np.zeros(self.S, dtype=bool)
        self.sides = np.zeros((len(task.joints), self.S))
        for joint, side in zip(task.joints, self.sides, strict=True):
            side[:] = np.sign(joint.relative(self.base(self.y)[self.half :]).real)
        self.usual, self.changes = self.h.copy(), np.zeros(self.S, dtype=np.int64)
        self.single: dict[int, Responses] = {}
        for at in range(self.S if task.joints else 0):
            self._settle(at, *self._of(at)(self.y[:, self.columns(np.array([at]))]))
        self._set_rates()
        self.first = self.rates(self.y)
        self._sample_start()

    def _set_rates(self) -> None:
        numbers, joints = self._taken(self.columns(np.arange(len(self.segment))))
        self.rates = Rates(self.task.lanes, numbers, joints, self.spread(self.sides))
        self.single = {}

    def _taken(self, columns: Ints) -> tuple[Numbers, list[Joint]]:
        """Numbers and joints of lanes in columns of the present front."""
        own = self.origin(columns)
        return self.task.numbers.at(own), [replace(one, limit=one.limit[own]) for one in self.task.joints]

    def origin(self, columns: Ints) -> Ints:
        """The lane of the task that stands in a column."""
        return np.asarray(self.segment[columns // self.P] * self.P + columns % self.P)

    def columns(self, segments: Ints) -> Ints:
        """The columns of segments of the front."""
        return np.asarray((np.asarray(segments)[:, None] * self.P + np.arange(self.P)).ravel())

    def _set_sides(self) -> None:
        sides = self.spread(self.sides)
        if self.task.joints and not np.array_equal(sides, self.rates.sides):
            self.rates.set(sides)

    def spread(self, values: Any) -> Any:
        """Values (..., S) of segments for each of their lanes."""
        return np.repeat(values, self.P, axis=-1)

    def base(self, rows: Any) -> Any:
        """Of the first lane of every segment, (size, S)."""
        return rows[:, :: self.P]

    def run(self) -> Result:
        """Steps until all are at their ends."""
        for _ in range(self.task.most):
            if not len(self.segment):
                return self.result
            self.step()
            self.result.steps += 1
        raise ComputationError("a segment needs too many steps to be followed")

    def step(self) -> None:
        """One step of every segment, accepted or not."""
        h, y = self.spread(self.h), self.y
        stages = np.empty((STAGES + 1 + EXTRA, *y.shape), dtype=complex)
        stages[0] = self.first
        work, z = np.empty_like(y), np.empty_like(y)
        for stage in range(1, STAGES + 1):
            summed(ROWS[stage] if stage < STAGES else END, stages, z, work)
            z *= h
            z += y
            stages[stage] = self.rates(z)
        error = self._error(stages, z)
        taken = (error < 1) | (self.landing >= 0)
        factor = np.clip(SAFETY * np.where(error > 0, error, 1e-30) ** (-1 / 8), SHRINKS, GROWS)
        factor = np.where(taken & ~self.refused, factor, np.minimum(factor, 1.0))
        tried = self.h * np.where(np.isfinite(factor), factor, SHRINKS)
        for more, shares in enumerate(MORE, STAGES + 1):
            row = np.empty_like(y)
            summed(shares, stages, row, work)
            stages[more] = self.rates(y + h * row)
        inside = _Inside(y, z, h, stages)
        landed = self.landing.copy()
        self.landing[:] = -1
        for at in self._suspects(inside, taken & (landed < 0)):
            part, joint = self._event(int(at), inside)
            if joint >= 0:
                taken[at], tried[at], self.landing[at] = False, part * self.h[at], joint
        self._sample(inside, taken)
        lane = self.spread(taken)
        self.y = np.where(lane, z, y)
        self.first = np.where(lane, stages[STAGES], self.first)
        self.t = np.where(taken, self.t + self.h, self.t)
        self.refused = ~taken & (self.landing < 0)
        self.usual = np.where((self.landing < 0) & (landed < 0), tried, self.usual)
        self.h = tried
        for at in np.flatnonzero(taken & (landed >= 0)):
            self._change(int(at), int(landed[at]))
        self._set_sides()
        free = self.landing < 0
        self.h = np.where(free, np.minimum(self.h, self.ends - self.t), self.h)
        done = self.t >= self.ends * (1 - 4e-16)
        if np.any(~done & free & ~(self.h > 4 * np.spacing(np.maximum(self.t, 1e-9)))):
            raise ComputationError("a motion leaves the finite numbers, or its steps become too short")
        self.h = np.where(done, 0.0, self.h)
        if done.all() or np.count_nonzero(done) * 4 >= len(done):
            self._drop(done)

    def _error(self, stages: Any, z: Any) -> Floats:
        y, base = self.base(self.y).real, self.base(z).real
        scale = self.task.tolerance * (np.maximum(np.abs(y), np.abs(base)) + self.task.scale[:, None])
        squares = []
        rows, work = np.empty(base.shape), np.empty(base.shape)
        for shares in (FIFTH, THIRD):
            summed(shares, stages[:, :, :: self.P].real, rows, work)
            squares.append(np.sum((rows / scale) ** 2, axis=0))
        fifth, third = squares
        both = fifth + 0.01 * third
        error = np.where(both == 0, 0.0, self.h * fifth / np.sqrt(both * len(scale)))
        return np.asarray(np.where(self.h == 0, 0.0, np.where(np.isfinite(error), error, np.inf)))

    # ------------------------------------------------------------------------------------------------ readings

    def _sample_start(self) -> None:
        at_zero = self.times <= 0
        for c, channel in enumerate(self.task.channels):
            values, rates = (channel.read(self.y, off).reshape(self.S, self.P) for off in (0, self.half))
            for s in range(self.S):
                count = int(np.count_nonzero(at_zero[c, s]))
                self.result.values[c, s, :count], self.result.rates[c, s, :count] = values[s], rates[s]
                self.next[c, s] = count

    def _sample(self, inside: _Inside, taken: Booleans) -> None:
        """Readings within the steps that were taken."""
        after, times = self.t + self.h, self.times[:, self.segment]
        last = np.where(after >= self.ends * (1 - 4e-16), np.inf, after)
        until = np.sum(times <= np.minimum(last, 1e300)[None, :, None], axis=2)
        begin = self.next[:, self.segment]
        until = np.where(taken & (self.h > 0), np.maximum(until, begin), begin)
        most = int((until - begin).max())
        if not most:
            return
        C = len(times)
        index = begin[..., None] + np.arange(most)
        there = index < until[..., None]
        index = np.minimum(index, times.shape[2] - 1)
        parts = (np.take_along_axis(times, index, axis=2) - self.t[None, :, None]) / np.where(self.h, self.h, 1)[
            :, None
        ]
        parts = np.where(there, parts, 0.0)
        for c, channel in enumerate(self.task.channels):
            own = self.spread(parts[c].T)  # (most, W)
            rows = sorted({row for offset in (0, self.half) for row in channel.rows(offset)})
            found = dict(zip(rows, inside.at(own, rows), strict=True))
            s, k = np.nonzero(there[c])
            for offset, into in ((0, self.result.values), (self.half, self.result.rates)):
                values = channel.read(found, offset).reshape(most, -1, self.P)
                into[c, self.segment[s], index[c][s, k]] = values[k, s]
        self.next[:, self.segment] = until if C else begin

    def _drop(self, done: Booleans) -> None:
        keep = ~done
        columns = self.columns(np.flatnonzero(keep))
        self.y, self.first = self.y[:, columns], self.first[:, columns]
        self.sides = self.sides[:, keep]
        for name in ("segment", "t", "h", "ends", "landing", "refused", "usual"):
            setattr(self, name, getattr(self, name)[keep])
        if keep.any():
            self._set_rates()

    # ------------------------------------------------------------------------------------------------ friction

    def _of(self, at: int) -> Responses:
        """The responses of a segment's lanes."""
        if at not in self.single:
            self.single[at] = Responses(self.task.lanes, *self._taken(self.columns(np.array([at]))), self.P)
        return self.single[at]

    def _speeds(self, y: Any) -> Floats:
        """The relative rates (J, ...) of all joints in y (size, ...)."""
        return np.array([joint.relative(y[self.half :]).real for joint in self.task.joints])

    def _suspects(self, inside: _Inside, among: Booleans) -> Ints:
        """Segments in which a joint turns back within the step, or sticks."""
        if not self.task.joints:
            return np.zeros(0, dtype=np.int64)
        base = inside.lanes(slice(None, None, self.P))
        speeds = self._speeds(np.moveaxis(base.at_all(np.array(LOOKS)), 1, 0))
        turned = np.any(speeds * self.sides[:, None] < 0, axis=(0, 1))
        return np.flatnonzero(among & (self.h > 0) & (turned | np.any(self.sides == 0, axis=0)))

    def _event(self, at: int, inside: _Inside) -> tuple[float, int]:
        """The part of the step at which a joint of this segment first changes, and the joint, −1 where none does."""
        one, sides = inside.lanes(slice(at * self.P, at * self.P + 1)), self.sides[:, at]
        responses, sticks = self._of(at), bool(np.any(sides == 0))
        limits = np.array([joint.limit[0].real for joint in responses.joints])

        def beyond(part: float) -> Floats:
            """Negative where a joint may no longer be as it is."""
            y = one.at_all(np.array([part]))[0]
            found = sides * self._speeds(y)[:, 0]
            if sticks:
                torques = responses.torques(*responses(y.repeat(self.P, axis=1)), sides[:, None])[:, 0].real
                found = np.where(sides == 0, limits - np.abs(torques), found)
            return found

        low, at_low = 0.0, beyond(0.0)
        for high in LOOKS:
            at_high = beyond(high)
            grazing = (at_low < 0) & (at_high > at_low)
            out = np.flatnonzero((at_high < 0) & ~grazing)
            if len(out):
                return min(
                    (_root(lambda part, j=j: float(beyond(part)[j]), low, high, at_low[j], at_high[j]), j)
                    for j in out.tolist()
                )
            low, at_low = high, at_high
        return 1.0, -1

    def _change(self, at: int, joint: int) -> None:
        """A joint changes here: from slip to stick or the other side, or from stick to slip."""
        self.result.events += 1
        self.changes[self.segment[at]] += 1
        if self.changes[self.segment[at]] > MOST_EVENTS:
            raise ComputationError("dry friction changes between slip and stick without end")
        columns = self.columns(np.array([at]))
        y, own, responses = self.y[:, columns], self.task.joints[joint], self._of(at)
        free, found = responses(y)
        before = self._under(at, free, found)
        slipped = self.sides[joint, at] != 0
        if slipped:
            self.sides[joint, at] = 0
        else:
            needed = responses.torques(free, found, self.sides[:, at, None])
            self.sides[joint, at] = -np.sign(needed[joint, 0].real)
        self._settle(at, free, found)
        after = self._under(at, free, found)
        if slipped:
            y = y - (before - after) * own.relative(y[self.half :]) / own.relative(before[self.half :])
            if self.sides[joint, at] == 0:
                y[self.half + own.below] -= own.relative(y[self.half :])
            self.y[:, columns] = y
            after = self._under(at, *responses(y))
        self.first[:, columns] = after
        self.h[at] = self.usual[at]

    def _under(self, at: int, free: Any, responses: Any) -> Any:
        """The rates y' of a segment's lanes with its present sides."""
        own = self._of(at)
        return own.under(free, responses, own.torques(free, responses, self.sides[:, at, None]))

    def _settle(self, at: int, free: Any, responses: Any) -> None:
        """Let go of joints that stick with more than their limit, the worst first."""
        own = self._of(at)
        limits = np.array([joint.limit[0].real for joint in own.joints])
        for _ in self.task.joints:
            torques = own.torques(free, responses, self.sides[:, at, None])[:, 0].real
            over = np.where(self.sides[:, at] == 0, np.abs(torques) - limits * (1 + 1e-12), -1.0)
            worst = int(np.argmax(over))
            if over[worst] <= 0:
                return
            self.sides[worst, at] = -np.sign(torques[worst])


class _Inside:
    """The motion within a step, by the method's own interpolation."""

    def __init__(self, before: Any, after: Any, length: Any, stages: Any) -> None:
        self.before = before
        moved, first, last = after - before, length * stages[0], length * stages[STAGES]
        terms = [moved, first - moved, 2 * moved - last - first]
        for shares in POWERS:
            row, work = np.empty_like(before), np.empty_like(before)
            summed(shares, stages, row, work)
            terms.append(length * row)
        self.terms = np.array(terms)

    def at(self, part: Floats, rows: Any) -> Any:
        """The y of these rows, (rows, m, W), at parts (m, W) of the step."""
        rows = list(rows)
        found: Any = 0.0
        for number, term in enumerate(self.terms[::-1]):
            found = (found + term[rows][:, None]) * (1 - part if number % 2 else part)
        return self.before[rows][:, None] + found

    def at_all(self, parts: Floats) -> Any:
        """Y (m, size, W) of all rows and lanes at the same parts (m,) of the step."""
        return self.before + np.tensordot(_weights(parts), self.terms, axes=1)

    def lanes(self, columns: slice) -> _Inside:
        """Of some lanes."""
        found = _Inside.__new__(_Inside)
        found.before, found.terms = self.before[:, columns], self.terms[:, :, columns]
        return found


def _weights(parts: Floats) -> Floats:
    """Of the terms of the interpolation, (m, 7)."""
    factors = [1 - parts if number % 2 else parts for number in range(7)]
    return np.asarray(np.cumprod(np.array(factors), axis=0).T)


def _root(value: Any, low: float, high: float, at_low: float, at_high: float) -> float:
    """Where a function passes from above 0 to below, by the secant method with its ends kept apart (Illinois)."""
    for _ in range(HALVINGS if at_low <= 0 else 0):
        middle = low + (high - low) / 2
        now = value(middle)
        if now > 0:
            low, at_low = middle, now
            break
        high, at_high = middle, now
    if at_low <= 0:
        return low
    side, middle = 0, low
    for _ in range(ROUNDS):
        last, middle = middle, (low * at_high - high * at_low) / (at_high - at_low)
        now = value(middle)
        if now < 0:
            high, at_high, at_low, side = middle, now, at_low / 2 if side < 0 else at_low, -1
        else:
            low, at_low, at_high, side = middle, now, at_high / 2 if side > 0 else at_high, 1
        if high - low <= NEAR or now == 0 or abs(middle - last) <= NEAR / 10:
            break
    return middle
