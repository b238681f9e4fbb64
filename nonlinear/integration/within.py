"""One step of lanes, and the motion within it by the method's dense output, as used by watches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics.generated import Rates
from nonlinear.integration.method import EXTRA, NODES, STAGES, advance, gain_at, terms_of
from nonlinear.integration.steppers import BREAK_ULPS

STEP_PIECES = 16
"""Tolerance: parts of a step, within each of which a component turns back once at most: its interpolant has degree 7,
and a step of DOP853 is a fraction of the fastest period."""
ILLINOIS_ROUNDS = 14
"""Tolerance: of the secant method with its ends kept apart (Illinois), to the last digits of a step."""
ALL = slice(None)


@dataclass(eq=False)
class Step:
    """One step of W lanes: `member` in each, whether it was `taken`, from when (s), how long, y before and after.

    `stages` (13, size, W) are the rates on the way; the first and the last those at the ends.  All of these have the
    columns of segments as a last axis where they have any.  `contact_inputs` (2 J, W) are those of contacts.  Where the
    stages are the first of a longer array, further ones have `room` there.  Those of one run have `is_single_run`.
    """

    member: Ints
    taken: Booleans
    start: Floats
    length: Floats
    before: Floats
    after: Floats
    stages: Floats
    rates: Rates
    rates_of: Callable[[Ints], Rates]
    breaks: bool = False
    contact_inputs: Any = ()
    room: Floats | None = None
    inside: Inside | None = None
    is_single_run: bool = False

    @cached_property
    def ends(self) -> Floats:
        """When each lane ends (s)."""
        return np.asarray(self.start + self.length)

    def times(self, part: Any, columns: Any = ALL) -> Floats:
        """The times (s) of a part of the step, or of parts (n, 1): within it where it may begin or end at a break."""
        start, length = self.start[columns], self.length[columns]
        times = start + part * length
        if not self.breaks:
            return np.asarray(times)
        clear = BREAK_ULPS * np.spacing(np.abs(start + length))
        return np.asarray(np.minimum(np.maximum(times, start + clear), start + length - clear))

    def motion(self, y: Floats) -> Floats:
        """The motion alone in an array with the columns of segments."""
        return y if self.before.ndim < 3 else y[..., 0].real

    def reach(self, row: int) -> tuple[Floats, Floats]:
        """The lowest and the highest that a component of y can be within the step, (W,)."""
        start, end, rates = map(self.motion, (self.before[row], self.after[row], self.stages[:, row]))
        rates = np.ascontiguousarray(rates)
        slowest, fastest = rates.min(0), rates.max(0)
        turns = (slowest < 0) & (fastest > 0)
        excess = np.where(turns, self.length * np.maximum(-slowest, fastest) / 2, 0.0)
        return np.minimum(start, end) - excess, np.maximum(start, end) + excess

    @classmethod
    def of_run(cls, times: Floats, y: Floats, stages: Floats, rates: Any, breaks: bool = False) -> Step:
        """The W steps of one run between these times (W + 1,), with y (W + 1, size) there and stages (W, 13, size)."""
        count = len(times) - 1
        lanes = np.zeros(count, dtype=np.int64), np.ones(count, dtype=bool), times[:-1], np.diff(times)
        stage_columns = np.moveaxis(stages, 0, 2)
        return cls(*lanes, y[:-1].T, y[1:].T, stage_columns, rates, lambda columns: rates, breaks, is_single_run=True)

    def trace(self) -> Floats:
        """The y at the end by one step of the method, whose stages are filled."""
        y, work = np.empty_like(self.before), np.empty_like(self.before)
        fill(self.rates(self.before, self.times(0.0)), self.stages[0])
        for stage in range(1, STAGES + 1):
            advance(stage, self.before, self.length, self.stages, y, work)
            fill(self.rates(y, self.times(NODES[stage])), self.stages[stage])
        return y

    def ending(self, columns: Ints, part: Floats) -> tuple[Floats, Floats]:
        """The y and y' (size, A) where steps of these lanes would end at parts of them: as accurate as steps are."""
        starts = np.ascontiguousarray(self.before[:, columns])
        lanes = self.member[columns], self.taken[columns], self.start[columns], self.length[columns] * part
        stages = np.empty((STAGES + 1, *starts.shape))
        step = Step(*lanes, starts, starts, stages, self.rates_of(columns), self.rates_of, self.breaks)
        return step.trace(), stages[STAGES]

    def within(self, columns: Ints) -> Inside:
        """The motion inside the step of the lanes in these columns."""
        if self.inside is not None:
            return self.inside.take(columns)
        start, length = self.before[:, columns], align_lanes(self.length[columns], self.before)
        change = self.after[:, columns] - start
        return Inside(start, np.array(terms_of(length, change, self.extend_stages(columns))))

    def within_all(self) -> Inside:
        """The motion inside the step of all lanes, cached for later requests."""
        if self.inside is None:
            self.inside = self.within(np.arange(len(self.member)))
        return self.inside

    def extend_stages(self, columns: Ints) -> Floats:
        """The rates (16, size, A) at all stages of the lanes in these columns, and at further ones."""
        if self.room is not None and len(columns) == len(self.member):
            stages, start, rates = self.room, self.before, self.rates
        else:
            start, rates = np.ascontiguousarray(self.before[:, columns]), self.rates_of(columns)
            stages = np.empty((STAGES + 1 + EXTRA, *start.shape), start.dtype)
            np.take(self.stages, columns, axis=2, out=stages[: STAGES + 1])
        y = np.empty_like(start)
        start_view, *others = (array.view(float) for array in (start, stages, y, np.empty_like(y)))
        length = spread(self.length[columns], start_view)
        for stage in range(STAGES + 1, len(stages)):
            advance(stage, start_view, length, *others)
            fill(rates(y, align_lanes(self.times(NODES[stage], columns), start)), stages[stage])
        return stages


class Watch(Protocol):
    """Is called with every step, of an ensemble or of one run."""

    def see(self, step: Step) -> None:
        """A step of all lanes, of which some may have been refused."""


@dataclass(frozen=True, eq=False)
class Inside:
    """The motion within one step of each of some lanes, from its interpolation."""

    before: Floats
    terms: Floats

    @cached_property
    def motion(self) -> Inside:
        """Without columns next to it."""
        return self if self.before.ndim < 3 else Inside(self.before[..., 0].real, self.terms[..., 0].real)

    def at(self, part: Floats, rows: Any = ALL) -> Floats:
        """The y (size, A), or of one component (A,), at these parts of the step, from 0 to 1."""
        return np.asarray(self.before[rows] + gain_at(align_lanes(part, self.before), [*self.terms[:, rows]]))

    def take(self, lanes: Any, rows: Any = ALL) -> Inside:
        """Of some of these lanes, and of some components."""
        return Inside(self.before[rows][:, lanes], self.terms[:, rows][:, :, lanes])

    def slope(self, part: Floats, row: Any = ALL) -> Floats:
        """The derivative of one component, or of all, with respect to the part of the step."""
        value, slope = np.zeros(1), np.zeros(1)
        for number, term in enumerate(self.motion.terms[::-1]):
            factor, sign = (1 - part, -1.0) if number % 2 else (part, 1.0)
            value, slope = (value + term[row]) * factor, slope * factor + sign * (value + term[row])
        return slope

    def pieces(self, row: int, after: Floats) -> tuple[Floats, Floats]:
        """Parts of the step (K, A) between which one component rises or falls throughout, and the component there.

        It is `after` (A,) at the end.
        """
        grid = np.linspace(0.0, 1.0, STEP_PIECES + 1)[:, None]
        slope = self.slope(grid, row)
        low, high = (np.broadcast_to(ends, slope[1:].shape) for ends in (grid[:-1], grid[1:]))
        piece, lane = np.nonzero(np.signbit(slope[:-1]) != np.signbit(slope[1:]))
        turning = low.copy()
        if len(piece):
            turning_lanes = self.take(lane)
            turning[piece, lane] = crossing(
                lambda part: turning_lanes.slope(part, row), low[piece, lane], high[piece, lane]
            )
        parts = np.empty((2 * STEP_PIECES + 1, after.size))
        parts[::2], parts[1::2] = grid, turning
        values = self.motion.at(parts, row)
        values[0], values[-1] = self.motion.before[row], after
        return parts, values

    def root(self, row: int, level: Floats, low: Floats | None = None, high: Floats | None = None) -> Floats:
        """Where one component passes a level (A,) between two parts of the step on either side of it, or its ends."""
        low, high = np.zeros(level.shape) if low is None else low, np.ones(level.shape) if high is None else high
        return crossing(lambda part: self.motion.at(part, row) - level, low, high)


NODES_INSIDE = (1 - np.cos(np.pi * np.arange(10) / 9)) / 2
"""Format: parts of a step at which its interpolant, a polynomial by any method, is known by its values to the last
digits: Chebyshev's."""
RANGE_EXCESS = 0.1
"""Tolerance: of the range of these values, by which what lies between them may be beyond."""
_OF_TERMS = np.array([gain_at(NODES_INSIDE[1:], [*np.eye(9)[:, [k]]]) for k in range(9)]).T


@dataclass(eq=False)
class KnownStep(Step):
    """A step of one run by any method: from its `values` (10, size) at `NODES_INSIDE`, and `exact` y at times in it."""

    values: Floats = field(kw_only=True)
    exact: Callable[[float], Floats] = field(kw_only=True)

    @classmethod
    def of(cls, start: float, end: float, inside: Callable[[Floats], Floats], exact: Callable[[float], Floats]) -> Step:
        """The step between these times (s), with the method's own interpolation."""
        values = inside(start + NODES_INSIDE * (end - start))
        lane = np.zeros(1, dtype=np.int64), np.ones(1, dtype=bool), np.array([start]), np.array([end - start])
        ends, unknown = (values[0][:, None], values[-1][:, None]), values[:0]
        return cls(
            *lane, *ends, unknown, _unknown, lambda columns: _unknown, is_single_run=True, values=values, exact=exact
        )

    def reach(self, row: int) -> tuple[Floats, Floats]:
        """The lowest and the highest that a component of y can be within the step, (1,)."""
        values = self.values[:, row].tolist()
        low, high = min(values), max(values)
        excess = RANGE_EXCESS * (high - low)
        return np.array([low - excess]), np.array([high + excess])

    @cached_property
    def interpolant(self) -> Inside:
        """The motion inside the step."""
        change = self.values[1:] - self.values[0]
        return Inside(self.before, np.linalg.solve(_OF_TERMS, change)[..., None])

    def within(self, columns: Ints) -> Inside:
        """The motion inside the step."""
        return self.interpolant.take(columns)

    def ending(self, columns: Ints, part: Floats) -> tuple[Floats, Floats]:
        """The y (size, A) at parts of the step, integrated again from its beginning, and y'."""
        y = [self.exact(time) for time in (self.start + part * self.length).tolist()]
        return np.stack(y, axis=1), self.within(columns).slope(part) / self.length


def _unknown(y: Floats, times: Any = 0.0) -> Sequence[Any]:
    raise NotImplementedError


def crossing(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Where a function of many (A,) is zero between ends on either side of that, by the secant method (Illinois)."""
    at_low, at_high = function(low), function(high)
    side, middle = np.zeros(low.shape), low
    for _ in range(ILLINOIS_ROUNDS):
        rise = at_high - at_low
        middle = np.where(rise != 0, (low * at_high - high * at_low) / np.where(rise != 0, rise, 1.0), low)
        value = function(middle)
        upper = np.signbit(value) == np.signbit(at_high)
        low, high = np.where(upper, low, middle), np.where(upper, middle, high)
        at_low = np.where(upper, np.where(side > 0, at_low / 2, at_low), value)
        at_high = np.where(upper, value, np.where(side < 0, at_high / 2, at_high))
        side = np.where(upper, 1.0, -1.0)
    return np.asarray(middle)


def quintic(h: Floats, x0: Floats, x1: Floats, v0: Floats, v1: Floats, a0: Floats, a1: Floats) -> Floats:
    """Coefficients (6, K, L) of powers of t/h, of curves with these x, slopes and curvatures at t = 0 and h (K, 1)."""
    v0, v1, a0, a1 = v0 * h, v1 * h, a0 * h**2, a1 * h**2
    d, m, e = x1 - x0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    return np.array([x0, v0, a0 / 2, 10 * d - 4 * m + e / 2, -15 * d + 7 * m - e, 6 * d - 3 * m + e / 2])


def between_samples(times: Floats, x: Floats, v: Floats, a: Floats, at: Floats) -> tuple[Floats, Floats]:
    """The curves through x with slopes v and curvatures a, (K, L), at other times (T,), and the slopes, (T, L)."""
    sample = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    h = np.diff(times)[sample][:, None]
    powers = quintic(h, *(values[sample + k] for values in (x, v, a) for k in (0, 1)))
    part = (at - times[sample])[:, None] / h
    places = sum(power * part**k for k, power in enumerate(powers))
    slopes = sum(k * power * part ** (k - 1) for k, power in enumerate(powers) if k) / h
    return np.asarray(places), np.asarray(slopes)


def align_lanes(values: Any, y: Floats) -> Any:
    """Values of lanes (..., S), ready to be combined with y (size, S) or (size, S, 1 + k)."""
    return values if y.ndim < 3 else np.asarray(values)[..., None]


def spread(values: Floats, y: Floats) -> Floats:
    """Values (S,) of lanes, as often as y (size, S) or (size, S, 1 + k) has columns: NumPy is slow in short rows."""
    return values if y.ndim < 3 else np.repeat(values, y.shape[2]).reshape(y.shape[1:])


def sums_of_squares(rows: Floats) -> Floats:
    """The sum of the squares of each column, row by row: the same for a column whatever stands next to it."""
    sums = rows[0] * rows[0]
    for row in rows[1:]:
        sums += row * row
    return np.asarray(sums)


def fill(rates: Any, rows: Floats) -> None:
    """Rows, each an array or one number, into an array."""
    for row, rate in zip(rows, rates, strict=True):
        row[...] = rate
