"""DOP853 over lanes: many segments at once, each with its own steps and error; finished ones are replaced by others.

A segment is a member's y (size, S), or y and k columns next to it, (size, S, 1 + k), which share its steps: derivatives
V of y, or with complex numbers the same motion with imaginary parts. Column 0 is the motion: its real part alone tells
the error, unless the `whole` does. A lane takes the steps that it would take alone.

A flow (`nonlinear.dynamics.Lanes` is one) gives, with `rates(numbers)` of the present segments, a function of y and of
the times (s), an array like y without its first axis or one that broadcasts with it, for the rates (size, S, 1 + k);
a third argument are the inputs of these times, where they are known.  Where there are switches, `rates(numbers)` is a
function of their states' contribution to the inputs, which gives that function.  Numbers of columns have a last axis
of 1 or 1 + k.

An observer of the motion within steps is a `Watch`, and gets every step of all lanes, with the method's own
interpolation in those that it asks for.  A step in which a switch passes is not one of them: it is tried again, until
it ends there (`meeting`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any, Protocol

import numpy as np

from modal.errors import ComputationError
from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics.generated import Rates
from nonlinear.integration.meeting import AGAIN, MET, PASSING_SHARE, meet
from nonlinear.integration.method import (
    EXTRA,
    FIFTH,
    LOOKS,
    NODES,
    SEEN,
    STAGES,
    THIRD,
    advance,
    control_steps,
    sum_stages,
)
from nonlinear.integration.steppers import BREAK_ULPS, SHORTEST_STEP
from nonlinear.integration.switches import INPUT_ASIDE
from nonlinear.integration.within import Step, Watch, align_lanes, fill, spread, sums_of_squares

NUMBERS_AT_ONCE = 20_480
"""Cost: numbers of y in work at once, which fit the cache with their stages (benchmarks/ensembles.py)."""
LANES_MIN = 128
"""Cost: lanes below which NumPy's overhead dominates, so that long y are taken too (benchmarks/ensembles.py)."""
SWITCHES_AT_ONCE = 20
"""Limit: switches one after the other at one time; further ones wait for the next step."""
TOO_SHORT = "the step needed is smaller than the spacing between numbers"
NOT_FINITE = "the motion leaves the finite numbers"
ALL = slice(None)


class LaneSwitches(Protocol):
    """The result of `LaneTask.switches.at(members)`: steps end where a value passes 0 upwards, which changes y."""

    count: int

    def inputs(self, state: Any) -> Any:
        """The contribution of a state to the inputs of the rates, arrays (S,)."""

    def values(self, u: Any, w: Any, y: Any, f: Any, state: Any) -> tuple[Any, Any]:
        """The values (count, S) and their rates, of y and y' (size, S) of the motion, inputs u and their rates w."""

    def change(self, t: float, j: int, y: Any, f: Any, state: Any) -> Any:
        """The y (size,) or (size, 1 + k) of one member after value j has passed, with its state changed in place.

        For j = `count` inputs have jumped.
        """


@dataclass(frozen=True, eq=False)
class LaneTask:
    """Segments to integrate: y (size, S) or (size, S, 1 + k) of each, from `start` to `end` (s), one or each its own.

    `relative` (S,) and `absolute` (size, S) are tolerances, `first` (S,) steps to try (s).  Steps are no longer than
    `longest` (s), and end at the `breaks` (s) and where `switches` pass, from their `state` (m, S).  `lanes` is the
    flow, and `numbers` are those of all segments, some of which are `numbers.at(members)`.
    """

    lanes: Any
    numbers: Any
    initial: Floats
    end: Any
    relative: Floats
    absolute: Floats
    first: Floats
    switches: Any = None
    state: Floats | None = None
    whole: bool = False
    start: Any = 0.0

    @cached_property
    def longest(self) -> float:
        """The time (s) in which a moving support may change."""
        return float(self.lanes.inputs.longest_step(float(self.relative.min())))

    @cached_property
    def ends(self) -> Floats:
        """When each segment ends (s), (S,)."""
        return np.broadcast_to(np.asarray(self.end, dtype=float), self.initial.shape[1])

    @cached_property
    def starts(self) -> Floats:
        """When each segment begins (s), (S,)."""
        return np.broadcast_to(np.asarray(self.start, dtype=float), self.initial.shape[1])

    @cached_property
    def breaks(self) -> Floats:
        """Where a support or a length may change suddenly, as far as the tolerances show, before the end."""
        times = np.array(self.lanes.inputs.breaks(float(self.relative.min())))
        return np.asarray(times[(times > self.starts.min()) & (times < self.ends.max())])

    def next_breaks(self, times: Floats) -> Floats:
        """The next break after each of some times (s), infinite after the last."""
        return np.append(self.breaks, inf)[np.searchsorted(self.breaks, times, side="right")]


@dataclass(eq=False)
class Outcome:
    """The y of all segments at the end, or where they failed; why and when (s) these did, by member.

    `events` (S,) counts switches that were met, `state` (m, S) is theirs at the end.
    """

    y: Floats
    steps: Ints
    events: Ints
    state: Floats
    reasons: dict[int, str] = field(default_factory=dict)
    calls: int = 0


class Front:
    """The lanes in work: who is in each, where it stands, its next step."""

    LANES = ("member", "t", "h", "refused", "usual", "low", "high", "which", "met")

    def __init__(self, task: LaneTask, width: int) -> None:
        self.task, self.waiting = task, min(width, task.initial.shape[1])
        W = self.waiting
        self.member = np.arange(W)
        self.y = np.ascontiguousarray(task.initial[:, :W])
        self.state = np.zeros((0, W)) if task.state is None else task.state[:, :W].copy()
        self.t, self.h = task.starts[:W].copy(), self._first(self.member)
        self.refused, self.met = np.zeros((2, W), dtype=bool)
        self.came = np.zeros(0, dtype=np.int64)
        self.which, self.low, self.high, self.usual = np.full(W, -1), np.zeros(W), np.full(W, inf), self.h.copy()
        self._prepare()
        self._renew(np.arange(W))

    def _first(self, members: Any) -> Any:
        task = self.task
        start = task.starts[members]
        limit = np.minimum(np.minimum(task.ends[members], task.next_breaks(start)) - start, task.longest)
        return np.minimum(task.first[members], limit)

    def _prepare(self) -> None:
        """Numbers and storage for the lanes that are there now."""
        task, members = self.task, self.member
        self.numbers, self.until = task.numbers.at(members), task.ends[members]
        if task.switches:
            self.switches: LaneSwitches = task.switches.at(members)
            self.value, self.rise = np.empty((2, task.switches.count, len(members)))
        self.rates_without_contacts = task.lanes.rates(self.numbers)
        self.rates = self.rates_of(np.arange(len(members)))
        self.relative, self.absolute = task.relative[members], task.absolute[:, members]
        self.room = np.empty((STAGES + 1 + EXTRA, *self.y.shape), self.y.dtype)
        self.stages = self.room[: STAGES + 1]
        self.next, self.work = np.empty_like(self.y), np.empty_like(self.y)
        self.sums = np.empty((3, *self._error_part(self.y).shape))

    def rates_of(self, columns: Ints) -> Rates:
        """The rates of the lanes in some columns, with the contribution of the state of switches to their inputs."""
        rates: Callable[..., Any] = self.rates_without_contacts
        if not self._are_all(columns):
            rates = self.task.lanes.rates(self.numbers.at(columns))
        if self.task.switches is None:
            return rates
        contact_inputs = [
            values if np.ndim(values) > 1 else align_lanes(values, self.y)
            for values in self._switches_of(columns).inputs(self.state[:, columns])
        ]
        rates_in_state: Rates = rates(contact_inputs)
        return rates_in_state

    def _are_all(self, columns: Ints) -> bool:
        """Whether these are all lanes, once each and in their order."""
        return len(columns) == len(self.member) and bool(np.all(columns == np.arange(len(columns))))

    def _switches_of(self, columns: Ints) -> LaneSwitches:
        if self._are_all(columns):
            return self.switches
        switches: LaneSwitches = self.task.switches.at(self.member[columns])
        return switches

    def _inputs(self, times: Floats) -> list[Any]:
        """The inputs at times (..., S), each an array of that shape."""
        return [*self.task.lanes.inputs.beside(times)]

    def _inputs_with_rates(self, times: Floats, early: Floats, late: Floats) -> tuple[list[Any], list[Any]]:
        """The inputs that switches see at times (..., S), and their rates, as between times on the same side of breaks.

        Of the time alone, or of nothing, they know the rates.
        """
        inputs = self.task.lanes.inputs
        if not inputs.count or (inputs.count == 1 and inputs.is_analytic):
            return self._inputs(times), []
        now, before, after = zip(*self._inputs(np.array([times, early, late])), strict=True)
        return [*now], [(b - a) / (late - early) for a, b in zip(before, after, strict=True)]

    def _now(self, columns: Any = ALL) -> Floats:
        """The times (s) of lanes that begin a step, after a break."""
        return np.asarray(self.t[columns] + BREAK_ULPS * np.spacing(np.abs(self.t[columns])))

    def _renew(self, columns: Ints) -> None:
        """The rates, and the values of switches, where lanes are now."""
        y = self.y[:, columns]
        rows = np.empty_like(y)
        fill(self.rates_of(columns)(y, align_lanes(self._now(columns), y)), rows)
        self.stages[0][:, columns] = rows
        if self.task.switches and len(columns):
            motion, now = (self._motion(y), self._motion(rows), self.state[:, columns]), self._now(columns)
            later = now + np.maximum(INPUT_ASIDE * self.usual[columns], BREAK_ULPS * np.spacing(now))
            u, w = self._inputs_with_rates(now, now, later)
            values = self._switches_of(columns).values(u, w, *motion)
            self.value[:, columns], self.rise[:, columns] = values

    def _motion(self, y: Floats) -> Floats:
        return y if self.y.ndim < 3 else y[..., 0].real

    def _error_part(self, y: Floats) -> Floats:
        """The estimates of the error."""
        return y if self.y.ndim < 3 else (y if self.task.whole else y[..., :1]).real

    def attempt(self) -> Step:
        """A step of every lane."""
        y, z, work, stages = self.y, self.next, self.work, self.stages
        step = Step(self.member, self.refused, self.t, self.h, y, z, stages, self.rates, self.rates_of)
        step.contact_inputs = self.switches.inputs(self.state) if self.task.switches else ()
        step.room, step.breaks = self.room, bool(len(self.task.breaks))
        start, *others = (array.view(float) for array in (y, stages, z, work))
        length, looks = spread(self.h, start), []
        inputs = self._inputs_of_stages(step)
        seen = self._inputs_of_looks(step) if self.task.switches else {}
        for stage in range(1, STAGES + 1):
            advance(stage, start, length, *others)
            fill(self.rates(z, inputs=inputs[stage - 1]), stages[stage])
            if stage in seen:
                motion = self._motion(z), self._motion(stages[stage]), self.state
                u, w = seen[stage]
                looks.append(self.switches.values(u, w, *motion))
        error, factor = self._error()
        self.tried = self.h * factor
        step.taken = (error < 1) & (self.h > 0)
        self.refused = ~step.taken
        if looks:
            self._meet(step, looks)
        return step

    def _inputs_of_stages(self, step: Step) -> list[Any]:
        """The inputs at all stages of a step, looked up at once: of one lane, one by one takes as long as its rates."""
        if not self.task.lanes.inputs.count:
            return [()] * STAGES
        times = step.times(np.array(NODES[1 : STAGES + 1])[:, None])
        return [*zip(*self._inputs(align_lanes(times, self.y)), strict=True)]

    def _inputs_of_looks(self, step: Step) -> dict[int, Any]:
        """The inputs that switches see, and their rates, by the stage at which they look."""
        stages = (*SEEN, STAGES)
        parts = np.array([NODES[stage] for stage in stages])[:, None]
        side_times = step.times(parts - INPUT_ASIDE), step.times(parts + INPUT_ASIDE)
        inputs, rates = self._inputs_with_rates(step.times(parts), *side_times)
        return {stage: ([u[k] for u in inputs], [w[k] for w in rates]) for k, stage in enumerate(stages)}

    def _error(self) -> tuple[Floats, Floats]:
        work, sums, scale = self.sums
        y, z, stages = (self._error_part(rows) for rows in (self.y, self.next, self.stages))
        np.maximum(np.abs(y), np.abs(z), out=scale)
        scale *= align_lanes(self.relative, y)
        scale += align_lanes(self.absolute, y)
        squares = []
        for shares in (FIFTH, THIRD):
            sum_stages(shares, stages, sums, work)
            sums /= scale
            squared_sums = sums_of_squares(sums)
            squares.append(squared_sums if squared_sums.ndim < 2 else squared_sums.max(1))
        return control_steps(squares[0], squares[1], self.h, len(sums), self.refused)

    def _meet(self, step: Step, looks: Sequence[Any]) -> None:
        """Which steps end at a switch, and which are tried again; the former end there to rounding."""
        V, R = (np.array(rows) for rows in zip((self.value, self.rise), *looks, strict=True))
        width = (np.diff(LOOKS)[:, None] * self.h)[:, None]
        # Of all lanes at once, those of which `seen` says that a value may pass.
        may_pass = ((V[:-1] < 0) | ((V[:-1] == 0) & ((R[:-1] < 0) | (V[1:] > 0)))) & (V[1:] >= 0)
        may_pass |= (R[:-1] > 0) & (R[1:] < 0) & (np.maximum(V[:-1], V[1:]) + 0.25 * width * (R[:-1] - R[1:]) > 0)
        may_pass |= (V[0] > 0) & (R[0] > 0)
        self._seek_none(np.flatnonzero(~step.taken))
        suspect, seeking = may_pass.any((0, 1)), self.which >= 0
        np.copyto(self.usual, self.tried, where=step.taken & ~suspect & ~seeking)
        self.met = np.zeros(len(self.t), dtype=bool)
        for i in np.flatnonzero((suspect | seeking) & step.taken):
            samples = V[:, :, i].tolist(), R[:, :, i].tolist(), LOOKS
            answer = meet(int(i), self.h, *samples, self.which, self.low, self.high, self.tried, self.usual)
            step.taken[i], self.met[i] = answer != AGAIN, answer == MET
        self.value, self.rise = (np.where(step.taken, rows[-1], rows[0]) for rows in (V, R))
        met_columns = np.flatnonzero(self.met)
        if len(met_columns):
            at = self.which[met_columns], met_columns
            remaining = -self.value[at] / self.rise[at]
            remaining = np.where(
                np.abs(remaining) <= 2 * PASSING_SHARE * (self.usual[met_columns] + self.h[met_columns]), remaining, 0.0
            )
            remaining = np.maximum(remaining, -self.h[met_columns] / 2)
            self.h[met_columns] += remaining
            step.after[:, met_columns] += align_lanes(remaining, self.y) * step.stages[-1][:, met_columns]
            self.tried[met_columns] = self.usual[met_columns]

    def go_on(self, step: Step) -> None:
        """Make the step the present; refused ones are tried again."""
        is_taken = step.taken
        self.y = np.where(align_lanes(is_taken, step.after), step.after, step.before)
        np.copyto(self.stages[0], self.stages[STAGES], where=align_lanes(is_taken, step.after))
        previous, self.t = self.t, np.where(is_taken, self.t + self.h, self.t)
        if step.breaks:
            self._land(previous)
        next_break = self.until
        if step.breaks:
            next_break = np.minimum(self.task.next_breaks(self.t), next_break)
        self.h = np.minimum(np.minimum(self.tried, self.task.longest), next_break - self.t)

    def switch(self, outcome: Outcome) -> None:
        """Change y and the state of lanes that met a switch or a break, and of others within rounding of it.

        What is due at the end of a lane is left to the caller that continues from there.
        """
        changing = self.met.copy()
        changing[self.came] |= (self.value[:, self.came] > 0).any(0)
        columns = np.flatnonzero(changing & ~self.through)
        which = np.where(self.met, self.which, self.task.switches.count)[columns]
        self._seek_none(np.flatnonzero(self.met))
        if not len(columns):
            return
        now = self.t.copy()
        now[self.came] = self._now(self.came)
        for _ in range(SWITCHES_AT_ONCE):
            if not len(columns):
                break
            for column, j in zip(columns.tolist(), which.tolist(), strict=True):
                switches = self.task.switches.at(self.member[column])
                motion, state = (self.y[:, column], self.stages[0][:, column]), self.state[:, column].copy()
                try:
                    self.y[:, column] = switches.change(float(now[column]), j, *motion, state)
                except ComputationError as error:
                    outcome.reasons[int(self.member[column])] = f"stopped at {self.t[column]:.9g} s: {error}"
                    continue
                self.state[:, column] = state
            outcome.events[self.member[columns]] += 1
            self._renew(columns)
            value, rise = self.value[:, columns], self.rise[:, columns]
            due = (value > 0) & (rise > 0)
            which = np.argmax(np.where(due, value, -inf), axis=0)
            columns, which = columns[due.any(0)], which[due.any(0)]
        self.rates = self.rates_of(np.arange(len(self.member)))

    @property
    def through(self) -> Booleans:
        """Which lanes are at their end."""
        return np.asarray(self.t >= self.until - BREAK_ULPS * np.spacing(np.abs(self.until)))

    def _seek_none(self, columns: Any) -> None:
        self.which[columns], self.low[columns], self.high[columns] = -1, 0.0, inf

    def _land(self, previous: Floats) -> None:
        """Restart the lanes that have come to a break."""
        next_break = self.task.next_breaks(previous)
        self.came = np.flatnonzero(self.t >= next_break - BREAK_ULPS * np.spacing(np.abs(next_break)))
        if len(self.came):
            self.t[self.came] = next_break[self.came]
            self._renew(self.came)

    def change(self, out: Booleans, size: int) -> None:
        """Lanes that are through leave; others come in for them while there are any of `size`."""
        came = np.flatnonzero(out)[: size - self.waiting]
        task = self.task
        if len(came):
            fresh = np.arange(self.waiting, self.waiting + len(came))
            self.member = self.member.copy()
            self.member[came] = fresh
            self.waiting += len(came)
            self.y[:, came], self.t[came] = task.initial[:, fresh], task.starts[fresh]
            self.h[came], self.refused[came] = self._first(fresh), False
            self.which[came], self.low[came], self.high[came], self.usual[came] = -1, 0.0, inf, self.h[came]
            if task.state is not None:
                self.state[:, came] = task.state[:, fresh]
        stay = ~out
        stay[came] = True
        first, switch_rows = self.stages[0][:, stay], (self.value, self.rise) if task.switches else ()
        if not stay.all():
            self.y, self.state = np.ascontiguousarray(self.y[:, stay]), self.state[:, stay]
            for name in self.LANES:
                setattr(self, name, getattr(self, name)[stay])
        self._prepare()
        self.stages[0] = first
        if task.switches:
            self.value, self.rise = (rows[:, stay] for rows in switch_rows)
        if len(came):
            self._renew(np.flatnonzero(self.member >= self.waiting - len(came)))


def integrate(task: LaneTask, watches: Sequence[Watch] = (), width: int | None = None) -> Outcome:
    """All members to the end, as many at once as `width` says."""
    size = task.initial.shape[1]
    steps, events = np.zeros((2, size), dtype=np.int64)
    state = np.zeros((0, size)) if task.state is None else task.state.copy()
    outcome = Outcome(task.initial.copy(), steps, events, state)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        front = Front(task, width or max(NUMBERS_AT_ONCE // task.initial[:, 0].size, LANES_MIN))
        while len(front.member):
            step = front.attempt()
            moving = step.length > 0
            outcome.calls += STAGES * int(np.count_nonzero(moving))
            outcome.steps[front.member] += moving
            for watch in watches:
                watch.see(step)
            front.go_on(step)
            if task.switches and (len(front.came) or front.met.any()):
                front.switch(outcome)
            out = _through(front, step, outcome)
            count = int(np.count_nonzero(out))
            if count and (4 * count >= len(out) or count == len(out)):
                outcome.y[:, front.member[out]] = front.y[:, out]
                outcome.state[:, front.member[out]] = front.state[:, out]
                front.change(out, size)
    return outcome


def _through(front: Front, step: Step, outcome: Outcome) -> Booleans:
    """Which lanes are at the end, or cannot continue; these get the reason."""
    is_done = front.through
    shortest = np.where(front.which >= 0, 0.0, SHORTEST_STEP * np.spacing(np.abs(front.t)))
    broken = ~step.taken & ~is_done & ~(front.h >= shortest)
    for column in np.flatnonzero(broken):
        member = int(front.member[column])
        if member not in outcome.reasons:
            finite = bool(np.all(np.isfinite(front.stages[0][:, column])))
            outcome.reasons[member] = f"stopped at {front.t[column]:.9g} s: {TOO_SHORT if finite else NOT_FINITE}"
    if outcome.reasons:
        failures = np.isin(front.member, [*outcome.reasons])
        front.h[failures] = 0.0
        is_done = is_done | failures
    front.h[is_done] = 0.0
    return np.asarray(is_done)
