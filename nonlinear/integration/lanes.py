"""DOP853 over lanes: members side by side, each with its own steps and error; who is through leaves, others come in.

Stages, both error estimates and the control of steps are those of SciPy's method, whose coefficients are read from it,
so that a lane takes the steps that it would take alone.  Whoever wants to know what happens within steps is a `Watch`,
and gets every step of all lanes, with the method's own interpolation in those that it asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any, Protocol

import numpy as np
from scipy.integrate import DOP853

from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics.lanes import Lanes, Rates
from nonlinear.integration.steppers import BESIDE
from nonlinear.system import Numbers

STAGES, EXTRA, DENSE = DOP853.n_stages, len(DOP853.A_EXTRA), len(DOP853.D)
SAFETY, SHRINKS, GROWS = 0.9, 0.2, 10.0  # of a step's length, as in SciPy
NUMBERS, NARROWEST, WIDEST = 20_480, 128, 2048  # numbers of y in work at once; lanes
LEAVING = 8  # the part of all lanes that are through when they leave
LOOKS = 16  # parts of a step, within each of which a component turns back once at most
ROUNDS = 14  # of the secant method with its ends kept apart (Illinois), to the last digits of a step
TINY = 10  # units in the last place of the time that no step is shorter than
TOO_SHORT = "the step needed is smaller than the spacing between numbers"
NOT_FINITE = "the motion leaves the finite numbers"


def _terms(shares: Any) -> list[tuple[int, float]]:
    return [(stage, float(share)) for stage, share in enumerate(shares) if share]


ROWS = [_terms(row[:stage]) for stage, row in enumerate(DOP853.A)]
END, FIFTH, THIRD = _terms(DOP853.B), _terms(DOP853.E5), _terms(DOP853.E3)
MORE = [_terms(row) for row in DOP853.A_EXTRA]
POWERS = [_terms(row) for row in DOP853.D]
NODES = [float(node) for node in (*DOP853.C, 1.0, *DOP853.C_EXTRA)]
"""The part of a step at each stage."""
ALL = slice(None)


class Watch(Protocol):
    """Sees every step."""

    def see(self, step: Step) -> None:
        """A step of all lanes, of which some may have been refused."""
        ...


@dataclass(eq=False)
class Step:
    """One step of W lanes: `member` in each, whether it was `taken`, from when (s), how long, y before and after.

    `stages` (13, size, W) are the rates on the way; the first and the last those at the ends.
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

    def times(self, part: float, columns: Any = ALL) -> Floats:
        """The times (s) of a part of the step, strictly within it where it may begin or end at a break."""
        start, length = self.start[columns], self.length[columns]
        found = start + part * length
        if not self.breaks:
            return np.asarray(found)
        clear = BESIDE * np.spacing(start + length)
        return np.asarray(np.minimum(np.maximum(found, start + clear), start + length - clear))

    def within(self, columns: Ints) -> Inside:
        """The motion inside the step of the lanes in these columns."""
        length, before = self.length[columns], self.before[:, columns]
        stages = np.empty((STAGES + 1 + EXTRA, *before.shape))
        np.take(self.stages, columns, axis=2, out=stages[: STAGES + 1])
        rates, work, rows = self.rates_of(columns), np.empty_like(before), np.empty_like(before)
        for more, shares in enumerate(MORE, STAGES + 1):
            summed(shares, stages, rows, work)
            fill(rates(before + length * rows, self.times(NODES[more], columns)), stages[more])
        moved = self.after[:, columns] - before
        first, last = length * stages[0], length * stages[STAGES]
        terms = np.empty((3 + DENSE, *before.shape))
        terms[0], terms[1], terms[2] = moved, first - moved, 2 * moved - last - first
        for own, shares in zip(terms[3:], POWERS, strict=True):
            summed(shares, stages, own, work)
        terms[3:] *= length
        return Inside(before, terms)


@dataclass(frozen=True, eq=False)
class Inside:
    """The motion within one step of each of some lanes, from its interpolation."""

    before: Floats
    terms: Floats

    def at(self, part: Floats, rows: Any = slice(None)) -> Floats:
        """The y (size, A), or of one component (A,), at these parts of the step, from 0 to 1."""
        found = 0.0
        for number, term in enumerate(self.terms[::-1]):
            found = (found + term[rows]) * (1 - part if number % 2 else part)
        return np.asarray(self.before[rows] + found)

    def take(self, lanes: Any) -> Inside:
        """Of some of these lanes."""
        return Inside(self.before[:, lanes], self.terms[:, :, lanes])

    def slope(self, part: Floats, row: int) -> Floats:
        """The derivative of one component with respect to the part of the step."""
        found, slope = np.zeros(1), np.zeros(1)
        for number, term in enumerate(self.terms[::-1]):
            factor, own = (1 - part, -1.0) if number % 2 else (part, 1.0)
            found, slope = (found + term[row]) * factor, slope * factor + own * (found + term[row])
        return slope

    def pieces(self, row: int, after: Floats) -> tuple[Floats, Floats]:
        """Parts of the step (K, A) between which one component rises or falls throughout, and the component there.

        It is `after` (A,) at the end.
        """
        grid = np.linspace(0.0, 1.0, LOOKS + 1)[:, None]
        slope = self.slope(grid, row)
        low, high = (np.broadcast_to(own, slope[1:].shape) for own in (grid[:-1], grid[1:]))
        piece, lane = np.nonzero(np.signbit(slope[:-1]) != np.signbit(slope[1:]))
        turning = low.copy()
        if len(piece):
            some = self.take(lane)
            turning[piece, lane] = crossing(lambda part: some.slope(part, row), low[piece, lane], high[piece, lane])
        parts = np.empty((2 * LOOKS + 1, after.size))
        parts[::2], parts[1::2] = grid, turning
        values = self.at(parts, row)
        values[0], values[-1] = self.before[row], after
        return parts, values

    def root(self, row: int, level: Floats, low: Floats | None = None, high: Floats | None = None) -> Floats:
        """Where one component passes a level (A,) between two parts of the step on either side of it, or its ends."""
        low, high = np.zeros(level.shape) if low is None else low, np.ones(level.shape) if high is None else high
        return crossing(lambda part: self.at(part, row) - level, low, high)


def crossing(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Where a function of many (A,) is zero between ends on either side of that, by the secant method (Illinois)."""
    at_low, at_high = function(low), function(high)
    side, middle = np.zeros(low.shape), low
    for _ in range(ROUNDS):
        across = at_high - at_low
        middle = np.where(across != 0, (low * at_high - high * at_low) / np.where(across != 0, across, 1.0), low)
        value = function(middle)
        upper = np.signbit(value) == np.signbit(at_high)
        low, high = np.where(upper, low, middle), np.where(upper, middle, high)
        at_low = np.where(upper, np.where(side > 0, at_low / 2, at_low), value)
        at_high = np.where(upper, value, np.where(side < 0, at_high / 2, at_high))
        side = np.where(upper, 1.0, -1.0)
    return np.asarray(middle)


def summed(shares: Sequence[tuple[int, float]], stages: Floats, found: Floats, work: Floats) -> None:
    """Σ share · stage into `found`."""
    (stage, share), *others = shares
    np.multiply(stages[stage], share, out=found)
    for stage, share in others:
        np.multiply(stages[stage], share, out=work)
        found += work


def squared(rows: Floats) -> Floats:
    """The sum of the squares of each column, row by row: the same for a column whatever stands beside it."""
    found = rows[0] * rows[0]
    for row in rows[1:]:
        found += row * row
    return np.asarray(found)


def fill(rates: Any, found: Floats) -> None:
    """Rows, each an array or one number, into an array."""
    for row, rate in zip(found, rates, strict=True):
        row[...] = rate


@dataclass(frozen=True, eq=False)
class Task:
    """Members to integrate from t = 0: y (size, S) of each, until `end` (s).

    `relative` (S,) and `absolute` (size, S) are tolerances, `first` (S,) steps to try (s).  Steps are no longer than
    `longest` (s), and end at the `breaks` (s).
    """

    lanes: Lanes
    numbers: Numbers
    begun: Floats
    end: float
    relative: Floats
    absolute: Floats
    first: Floats

    @cached_property
    def longest(self) -> float:
        """The time (s) in which a moved support may change."""
        support = self.lanes.system.support
        return support.motion.shortest if support else inf

    @cached_property
    def breaks(self) -> Floats:
        """Where a support or a length may change suddenly, before the end."""
        support, hoisting = self.lanes.system.support, self.lanes.system.hoisting
        found = {*(support.motion.breaks if support else ()), *(hoisting.breaks if hoisting else ())}
        return np.array(sorted(time for time in found if 0 < time < self.end))


@dataclass(eq=False)
class Outcome:
    """The y (size, S) of all members at the end, or where they failed; why and when (s) these did, by member."""

    y: Floats
    steps: Ints
    reasons: dict[int, str] = field(default_factory=dict)
    calls: int = 0


def width_of(size: int) -> int:
    """How many lanes of so long a y a processor works at best at once."""
    return int(min(max(NUMBERS // size, NARROWEST), WIDEST))


class Front:
    """The lanes in work: who is in each, where it stands, its next step."""

    def __init__(self, task: Task, width: int) -> None:
        self.task, self.waiting = task, min(width, task.begun.shape[1])
        self.member = np.arange(self.waiting)
        self.y = np.ascontiguousarray(task.begun[:, : self.waiting])
        self.ends = np.append(task.breaks, task.end)
        self.most = min(task.longest, float(self.ends[0]))
        self.t, self.h = np.zeros(self.waiting), np.minimum(task.first[: self.waiting], self.most)
        self.refused = np.zeros(self.waiting, dtype=bool)
        self._prepare()
        fill(self.rates(self.y, self._now()), self.stages[0])

    def _prepare(self) -> None:
        """Numbers and room for the lanes that are there now."""
        task, members = self.task, self.member
        self.numbers = task.numbers.at(members)
        self.rates = task.lanes.rates(self.numbers)
        self.relative, self.absolute = task.relative[members], task.absolute[:, members]
        self.stages = np.empty((STAGES + 1, *self.y.shape))
        self.next, self.work, self.sums = (np.empty_like(self.y) for _ in range(3))

    def rates_of(self, columns: Ints) -> Rates:
        """The rates of the lanes in some columns."""
        return self.task.lanes.rates(self.numbers.at(columns))

    def _now(self, columns: Any = ALL) -> Floats:
        """The times (s) of lanes that begin a step, after a break."""
        return np.asarray(self.t[columns] + BESIDE * np.spacing(self.t[columns]))

    def attempt(self) -> Step:
        """A step of every lane."""
        y, z, work, stages = self.y, self.next, self.work, self.stages
        step = Step(self.member, self.refused, self.t, self.h, y, z, stages, self.rates, self.rates_of)
        step.breaks, timed = bool(len(self.task.breaks)), self.task.lanes.inputs.count > 0
        for stage in range(1, STAGES + 1):
            summed(ROWS[stage] if stage < STAGES else END, stages, z, work)
            z *= self.h
            z += y
            fill(self.rates(z, step.times(NODES[stage])) if timed else self.rates(z), stages[stage])
        error = self._error()
        step.taken = taken = error < 1
        with np.errstate(divide="ignore"):
            factor = np.clip(SAFETY * error ** (-1 / 8), SHRINKS, GROWS)
        factor = np.where(taken, np.where(self.refused, np.minimum(factor, 1.0), factor), np.minimum(factor, 1.0))
        self.tried = self.h * np.where(np.isfinite(factor), factor, SHRINKS)
        return step

    def _error(self) -> Floats:
        work, sums, z = self.work, self.sums, self.next
        scale = np.maximum(np.abs(self.y), np.abs(z))
        scale *= self.relative
        scale += self.absolute
        squares = []
        for shares in (FIFTH, THIRD):
            summed(shares, self.stages, sums, work)
            sums /= scale
            squares.append(squared(sums))
        fifth, third = squares
        both = fifth + 0.01 * third
        with np.errstate(invalid="ignore", divide="ignore"):
            error = self.h * fifth / np.sqrt(both * len(sums))
        return np.asarray(np.where(both == 0, 0.0, error))

    def go_on(self, step: Step) -> None:
        """Make the step the present; refused ones are tried again."""
        taken = step.taken
        self.y = np.where(taken, step.after, step.before)
        np.copyto(self.stages[0], self.stages[STAGES], where=taken)
        before, self.t = self.t, np.where(taken, self.t + self.h, self.t)
        self.refused = ~taken
        if step.breaks:
            self._land(before)
        ahead = self.ends[np.searchsorted(self.ends[:-1], self.t, side="right")] if step.breaks else self.ends[0]
        self.h = np.minimum(np.minimum(self.tried, self.task.longest), ahead - self.t)

    def _land(self, before: Floats) -> None:
        """Begin anew the lanes that have come to a break."""
        ahead = np.append(self.ends, inf)[np.searchsorted(self.ends, before, side="right")]
        came = np.flatnonzero(self.t >= ahead - BESIDE * np.spacing(ahead))
        if len(came):
            self.t[came] = ahead[came]
            rows = np.empty((len(self.y), len(came)))
            fill(self.rates_of(came)(self.y[:, came], self._now(came)), rows)
            self.stages[0][:, came] = rows

    def change(self, out: Booleans, size: int) -> None:
        """Lanes that are through leave; others come in for them while there are any of `size`."""
        came = np.flatnonzero(out)[: size - self.waiting]
        task = self.task
        if len(came):
            fresh = np.arange(self.waiting, self.waiting + len(came))
            self.member = self.member.copy()
            self.member[came] = fresh
            self.waiting += len(came)
            self.y[:, came], self.t[came] = task.begun[:, fresh], 0.0
            self.h[came], self.refused[came] = np.minimum(task.first[fresh], self.most), False
        stay = ~out
        stay[came] = True
        first = self.stages[0]
        if not stay.all():
            first = first[:, stay]
            self.y = np.ascontiguousarray(self.y[:, stay])
            self.member, self.t, self.h, self.refused = (
                own[stay] for own in (self.member, self.t, self.h, self.refused)
            )
        self._prepare()
        self.stages[0] = first
        if len(came):
            columns = np.flatnonzero(self.member >= self.waiting - len(came))
            rows = np.empty((len(self.y), len(columns)))
            fill(self.rates_of(columns)(self.y[:, columns], self._now(columns)), rows)
            self.stages[0][:, columns] = rows


def integrate(task: Task, watches: Sequence[Watch] = (), width: int | None = None) -> Outcome:
    """All members to the end, as many at once as `width` says."""
    size = task.begun.shape[1]
    outcome = Outcome(task.begun.copy(), np.zeros(size, dtype=np.int64))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        front = Front(task, width or width_of(len(task.begun)))
        while len(front.member):
            step = front.attempt()
            moving = step.length > 0
            step.taken &= moving
            outcome.calls += STAGES * int(np.count_nonzero(moving))
            outcome.steps[front.member] += moving
            for watch in watches:
                watch.see(step)
            front.go_on(step)
            out = _through(front, step, task.end, outcome)
            gone = int(np.count_nonzero(out))
            if gone and (gone * LEAVING >= len(out) or gone == len(out)):
                outcome.y[:, front.member[out]] = front.y[:, out]
                front.change(out, size)
    return outcome


def _through(front: Front, step: Step, end: float, outcome: Outcome) -> Booleans:
    """Which lanes are at the end, or can go no further; these are told why."""
    done = front.t >= end * (1 - 4e-16)
    broken = ~step.taken & ~done & ~(front.h >= TINY * np.spacing(front.t))
    for column in np.flatnonzero(broken):
        member = int(front.member[column])
        if member not in outcome.reasons:
            finite = bool(np.all(np.isfinite(front.stages[0][:, column])))
            outcome.reasons[member] = f"stopped at {front.t[column]:.9g} s: {TOO_SHORT if finite else NOT_FINITE}"
    if outcome.reasons:
        failed = np.isin(front.member, [*outcome.reasons])
        front.h[failed] = 0.0
        done = done | failed
    front.h[done] = 0.0
    return np.asarray(done)
