"""DOP853 in Python's floats, for generated equations (`nonlinear.dynamics.generated`), which end steps at switches.

The sums over stages are written out component by component, once for each length of y; samples are interpolated for
many steps at once, in NumPy.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import chain, pairwise
from math import nan, nextafter, ulp
from typing import Any, NamedTuple, cast

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.types import Floats, Ints
from nonlinear.dynamics import Written
from nonlinear.dynamics.contacts import JAMMED
from nonlinear.dynamics.generated import UNDEFINED, InputFunction, Rate
from nonlinear.dynamics.text import function_in
from nonlinear.integration.meeting import AGAIN, PASSING_SHARE, STANDS, meet
from nonlinear.integration.method import (
    ERRORS,
    EXTRA,
    FIFTH,
    LOOKS,
    NODES,
    ROWS,
    SEEN,
    STAGES,
    STEP_RATIO_MIN,
    THIRD,
    WEIGHTS,
    control_step,
    weighted_sum,
)
from nonlinear.integration.steppers import (
    BREAK_ULPS,
    SHORTEST_STEP,
    SMALL_STEP,
    STEPS_AT_ONCE,
    Derivative,
    DOP853Solver,
    DOP853Stepper,
)
from nonlinear.integration.switches import Phase, Switched
from nonlinear.integration.within import Step
from nonlinear.system import Equations

WIDE_SIZE = 64
"""Cost: components of y from which on sums over stages are NumPy's, 1.4 times as fast for 40 clocks on a cart, which
would take seconds to write out for the longest (benchmarks/forms.py)."""

Numbers = Sequence[float]


class FloatStep(NamedTuple):
    """A step: its beginning and end (s), y there, the derivative at every stage, the last at the end, and inputs.

    The inputs are those that dry friction has throughout, `phase` is that of the switches.
    """

    start: float
    end: float
    before: Numbers
    after: Numbers
    stages: Sequence[Numbers]
    contact_inputs: Numbers = ()
    phase: Phase | None = None


class FloatDOP853(DOP853Solver):
    """The method for a `rate` of y and the `inputs` at a time and y, all lists of floats.

    Inputs are None if there are none, and the time itself where `is_time_only`. Steps end at the switches of
    `switching`.
    """

    switching: Switched | None = None
    next_stretch: Callable[[float, Numbers], tuple[float, float] | None] = staticmethod(lambda time, y: None)
    """The next end (s) and the longest step (s) after a break at this time and y; None at the end of the run."""

    def __init__(
        self,
        rate: Rate,
        inputs: InputFunction | None,
        is_time_only: bool,
        derivative: Derivative,
        t: float,
        y: Floats,
        t_bound: float,
        **limits: Any,
    ) -> None:
        super().__init__(derivative, t, y, t_bound, **limits)
        input_text = "" if inputs is None else ", (t + {} * h,)" if is_time_only else ", inputs(t + {} * h, z)"
        attempt = (
            attempt_of(len(y), input_text) if len(y) < WIDE_SIZE else partial(wide_attempt, is_time_only=is_time_only)
        )
        self.rate, self.inputs, self.attempt = rate, inputs, attempt
        self.smallest = self.atol.tolist()
        self.passed = FloatStep(t, t, y.tolist(), y.tolist(), [self.f.tolist()])
        self._which, self._low, self._high, self._tried, self._usual = [-1], [0.0], [np.inf], [0.0], [0.0]

    def take_step(self) -> bool:
        """Take one step; whether one was short enough."""
        return bool(self.advance((), 1)[0])

    def dense_output(self) -> Callable[[Floats], Floats]:
        """The y (size, T) at times within the last step."""
        self.nfev += EXTRA
        start, end = self.passed.start, self.passed.end

        def derivative(times: Any, y: Any) -> Any:
            return self.derivative(float(times[0]), y[:, 0])[:, None]

        inside = side_by_side([self.passed], lambda columns: derivative).within_all()
        return lambda times: inside.take(np.zeros(np.size(times), dtype=np.int64)).at((times - start) / (end - start))

    def advance(self, due: Numbers, limit: int) -> tuple[list[FloatStep], list[FloatStep], int]:
        """Up to this many steps, none if the first fails, until the last time that is `due` (all that, if none is).

        Returns the steps, those in which times are due, and how many of these times have been reached.
        """
        self.switch()
        y, f, at = self.y.tolist(), self.f.tolist(), 0
        steps: list[FloatStep] = []
        due_steps: list[FloatStep] = []
        switching = self.switching
        while len(steps) < limit and (at < len(due) or not due):
            if self.t >= self.t_bound:
                if (slope := self.carried_on(y)) is None:
                    break
                f = slope
            if switching and switching.met_switch is not None:
                try:
                    y, f = self._change(y, f)
                except ComputationError:
                    if not steps:
                        raise
                    break
            step = None if switching and switching.rests else self._next_step(y, f)
            if step is None:
                break
            if switching and switching.switches.jams(step.after, self._last[0], switching.state):
                if not steps:
                    raise ComputationError(JAMMED)
                switching.met_switch = None
                break
            steps.append(step)
            self.passed = step
            y, f, self.t = step.after, step.stages[-1], step.end
            if at < len(due) and due[at] <= self.t:
                due_steps.append(step)
                at = bisect_right(due, self.t)
        if steps:
            self.t_old, self.y_old = self.passed.start, np.array(self.passed.before)
        self.y, self.f = np.array(y), np.array(f)
        return steps, due_steps, at

    def carried_on(self, y: Numbers) -> Numbers | None:
        """The derivative after a break, from which steps continue as long as before; None at the end of the run."""
        if (stretch := self.next_stretch(self.t, y)) is None:
            return None
        (self.t_bound, self.max_step), self.status = stretch, "running"
        if self.switching:
            self.switching.land()
        return self._slope(y)

    def switch(self, V: list[list[float]] | None = None) -> None:
        """Continue in the phase after the switch at which the last step ended, if it did; so do columns V (k, size)."""
        if self.switching and self.switching.met_switch is not None:
            self.y, self.f = map(np.array, self._change(self.y.tolist(), self.f.tolist(), V))

    def _change(self, y: Numbers, f: Numbers, V: list[list[float]] | None = None) -> tuple[Numbers, Numbers]:
        """The y after the switch that was met, and its derivative."""
        switching = cast("Switched", self.switching)
        after = switching.change(self.t, y, f, V, self.inputs)
        self.rate = switching.rate
        return after, self._slope(after)

    def _slope(self, y: Numbers) -> Numbers:
        """The derivative at the present time."""
        return self.rate(y, self.inputs(self.t, y)) if self.inputs else self.rate(y)

    def _next_step(self, y: Numbers, f: Numbers) -> FloatStep | None:
        """The next step, None if it would be too short."""
        t, switching = self.t, self.switching
        shortest = SHORTEST_STEP * abs(nextafter(t, self.t_bound) - t)
        length, is_retry = min(max(float(self.h_abs), shortest), self.max_step), False
        while length >= shortest or self._which[0] >= 0:
            end = min(t + length, self.t_bound)
            if self.t_bound - end <= BREAK_ULPS * ulp(self.t_bound):
                end = self.t_bound
            if self._which[0] < 0:  # a switch is sought on a scale finer than the floats of the time
                length = end - t
            error, factor, after, stages, looks = self._attempt(length, y, f, is_retry)
            if not error < 1:
                length, is_retry = length * factor, True
                self._seek_none()
                continue
            answer = self._judge(length, y, after, stages, looks, length * factor) if switching else STANDS
            if answer == AGAIN:
                length, is_retry = self._tried[0], False
                continue
            if switching is None:
                minimum = 0.0 if is_retry or end < self.t_bound else self.h_abs
                self.h_abs = max(length * factor, minimum)
                return FloatStep(t, end, y, after, stages)
            if answer == STANDS:
                self.h_abs = self._tried[0]
            else:
                after, end = self._end_at_switch(switching, after, stages[-1], end)
            switching.level(after)
            return FloatStep(t, end, y, after, stages, switching.contact_inputs, switching.phase)
        return None

    def _judge(
        self, length: float, y: Numbers, after: Numbers, stages: Sequence[Numbers], looks: Any, following: float
    ) -> int:
        """The outcome of this accepted step, as `meet` says."""
        t, switching = self.t, cast("Switched", self.switching)
        values, inputs = switching.values, self.inputs
        readings = [switching.look or values(t, y, stages[0], inputs, length)]
        for stage, z in zip(SEEN, looks, strict=True):
            readings.append(values(t + NODES[stage] * length, z, stages[stage], inputs, length))
        readings.append(values(t + length, after, stages[-1], inputs, length))
        V, R = zip(*readings, strict=True)
        self._tried[0], aim = following, self._which[0]
        candidates = lively(V, R, aim)
        which = [candidates.index(aim) if aim >= 0 else -1]
        v, r = ([[row[j] for j in candidates] for row in rows] for rows in (V, R))
        answer = meet(0, (length,), v, r, LOOKS, which, self._low, self._high, self._tried, self._usual)
        self._which[0] = candidates[which[0]] if which[0] >= 0 else -1
        switching.look, self._last = readings[-1 if answer == STANDS else 0], readings[-1]
        return answer

    def _end_at_switch(self, switching: Switched, after: Numbers, f: Numbers, end: float) -> tuple[list[float], float]:
        """The y and the time (s) of the switch that was met, near the end of this step."""
        j, (V, R) = self._which[0], self._last
        remaining = -V[j] / R[j] if R[j] > 0 else 0.0
        if abs(remaining) > 2 * PASSING_SHARE * (self._usual[0] + end - self.t):
            remaining = 0.0
        remaining = max(remaining, (self.t - end) / 2)  # no switch is before its step, where inputs may be others
        self.h_abs, switching.met_switch = self._usual[0], j
        self._seek_none()
        return [value + remaining * rate for value, rate in zip(after, f, strict=True)], end + remaining

    def _seek_none(self) -> None:
        self._which[0], self._low[0], self._high[0] = -1, 0.0, np.inf

    def _attempt(
        self, length: float, y: Numbers, f: Numbers, is_retry: bool
    ) -> tuple[float, float, list[float], Sequence[Numbers], Any]:
        """The error over the tolerance, the next length over this, y at the end, all stages, and y at `SEEN`."""
        self.nfev += STAGES
        try:
            arguments = (self.rate, length, y, f, self.rtol, self.smallest, self.t, self.inputs)
            fifth, third, after, stages, looks = self.attempt(*arguments)
        except SceneError:
            raise
        except UNDEFINED:
            return nan, STEP_RATIO_MIN, [*y], [f], ()
        return *control_step(fifth, third, length, self.n, is_retry), after, stages, looks


class FloatStepper(DOP853Stepper[Written]):
    """DOP853 in floats for generated equations, with the arguments of `DOP853Stepper`."""

    _sweep_steps: Sequence[FloatStep] = ()
    _last_steps: Step | None = None

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> FloatDOP853:
        inputs_at = self.equations.inputs_at
        inputs = self._off_breaks(inputs_at) if inputs_at and self.pace.breaks else inputs_at
        is_time_only = self.equations.is_time_only and not self.pace.breaks
        return FloatDOP853(self.equations.rate, inputs, is_time_only, f, time, y, end, **options)

    def _next_stretch(self, time: float, y: Numbers) -> tuple[float, float] | None:
        """Continue after a break, to the next one or the end of the run (s), in steps no longer than this (s)."""
        if time >= self.end:
            return None
        self.pace.landing(time, y)
        self._low, self._high = self.pace.stretch(time)
        until = min(self._high, self.end)
        return until, self.pace.longest_between(max(self._low, self.start), until)

    def _off_breaks(self, inputs_at: InputFunction) -> InputFunction:
        """The inputs, seen strictly between the surrounding breaks."""

        def inside(time: float, y: Numbers) -> Any:
            return inputs_at(time if self._low < time < self._high else self.clear_of_breaks(time), y)

        return inside

    def _start_solver(self, time: float, y: Floats, first: float | None) -> FloatDOP853:
        solver = cast("FloatDOP853", super()._start_solver(time, y, first))
        solver.next_stretch = self._next_stretch
        if isinstance(self.equations, Switched):
            solver.switching, self.equations.look = self.equations, None
        return solver

    def _on_its_way(self) -> FloatDOP853:
        """The integrator, after a break that has been reached."""
        solver = cast("FloatDOP853", self._solver)
        if self.lands:
            solver.f = np.array(solver.carried_on(solver.y.tolist()))
        return solver

    @property
    def _as_equations(self) -> Equations:
        return cast("Equations", self.equations)

    @property
    def rests(self) -> bool:
        """Whether nothing moves any more."""
        return isinstance(self.equations, Switched) and self.equations.rests

    def switch(self) -> Floats | None:
        """The y after the switch at which the last step ended, from which it continues; None if it did not."""
        solver = cast("FloatDOP853", self._solver)
        if solver.switching is None or solver.switching.met_switch is None:
            return None
        solver.switch()
        return np.asarray(solver.y)

    def take_back(self, time: float, y: Floats) -> None:
        """Undo the changes by friction and kicks after a time (s) and y within the last sweep."""
        late = [step for step in self._sweep_steps if step.end > time]
        self._work(late, [(step.end, max(step.start, time)) for step in late])
        if isinstance(self.equations, Switched):
            at = len(self._sweep_steps) - len(late)
            previous = self._sweep_steps[max(at - 1, 0)]
            if previous.end == time and (not late or y.tolist() != late[0].before or previous.after == late[0].before):
                late = [previous]
            self.equations.go_back(cast("Phase", late[0].phase))

    def _work(self, steps: Sequence[FloatStep], spans: Sequence[tuple[float, float]]) -> None:
        """Count the work of friction in these steps between these times (s)."""
        switched = self.equations
        if not steps or not isinstance(switched, Switched) or not switched.switches.places.presses:
            return
        inside, inputs = partial(samples, self._abreast(steps)), [step.contact_inputs for step in steps]
        beside = switched.free.inputs_beside
        switched.switches.add_rail_work(inside, np.array(spans), inputs, switched.state, beside)

    def sweep(
        self, times: Floats, all_ends: bool = True, limit: int = STEPS_AT_ONCE
    ) -> tuple[Floats, list[tuple[float, Numbers | Floats]], int]:
        """Many steps at once, as defined in `Sweeper`."""
        due, row_count, mends = times.tolist(), 0, self._as_equations.system.spatial
        solver = self._on_its_way()
        ends: list[tuple[float, Numbers | Floats]] = []
        due_steps: list[FloatStep] = []
        self._sweep_steps, self._last_steps = [], None
        portion = 1 if mends else limit
        while True:
            steps, new_due_steps, new_rows = solver.advance(due[row_count:], portion)
            due_steps, row_count = due_steps + new_due_steps, row_count + new_rows
            self._sweep_steps = [*self._sweep_steps, *steps]
            self._work(steps, [(step.start, step.end) for step in steps])
            ends += [(step.end, self._project() if mends else step.after) for step in steps]
            if not (mends and steps and row_count < len(due) and len(ends) < limit and solver.t < solver.t_bound):
                break
        if not ends and not self.rests:
            raise self._stop_error(SMALL_STEP)
        self.before, self.y_before, self._within = solver.t_old, solver.y_old, None
        solver.status = "finished" if solver.t >= solver.t_bound else "running"
        rows = samples(self._lanes(due_steps), times[:row_count]) if due_steps else np.empty((0, solver.n))
        rows, step_count = self._as_equations.project(rows)[0] if mends and row_count else rows, len(ends)
        if self.rests and row_count < len(due):
            rows, ends = np.vstack((rows, np.tile(solver.y, (len(due) - row_count, 1)))), [*ends, (due[-1], solver.y)]
        return rows, ends, step_count

    def jumps(self) -> list[tuple[float, float, Floats, Floats]]:
        """Sudden changes of y between steps of the last sweep: beginning and end (s) of one, y before and after."""
        pairs = pairwise(self._sweep_steps) if isinstance(self.equations, Switched) else ()
        discontinuities = ((step, later) for step, later in pairs if step.after != later.before)
        return [(step.start, step.end, np.array(step.after), np.array(later.before)) for step, later in discontinuities]

    def steps_of_sweep(self) -> Step:
        """The steps of the last sweep, joined."""
        return self._lanes(self._sweep_steps)

    def _lanes(self, steps: Sequence[FloatStep]) -> Step:
        """Some or all steps of the last sweep, joined."""
        if (lanes := self._last_steps) is None or len(lanes.start) != len(steps):
            self._last_steps = lanes = self._abreast(steps)
        return lanes

    def _abreast(self, steps: Sequence[FloatStep]) -> Step:
        rates_of = lambda columns: self._derivative_in([steps[column] for column in columns])  # noqa: E731
        return side_by_side(steps, rates_of, breaks=bool(self.pace.breaks))

    def _derivative_in(self, steps: Sequence[FloatStep]) -> Derivative:
        """The derivative in these steps at once, counted."""
        switching = self.equations if isinstance(self.equations, Switched) else None
        derivative = (
            switching.rates_in([step.contact_inputs for step in steps]) if switching else self.equations.derivative
        )

        def count_calls(times: Any, y: Any) -> Any:
            self._done += y.shape[1]
            return derivative(times, y)

        return count_calls

    def _project(self) -> Floats:
        """Continue from the nearest y that satisfies every constraint."""
        result, drift = self._as_equations.project(self.y)
        if drift:
            self.drift = max(self.drift, drift)
            self.restart(result)
        return result


def lively(V: Sequence[Numbers], R: Sequence[Numbers], aim: int) -> list[int]:
    """Which values may pass within a step, from them and their rates at its samples, and the one aimed at."""
    candidates = {j for j, a in enumerate(V[0]) if a > 0 and R[0][j] > 0} | {aim} - {-1}
    for b, rates, later in zip(V[1:], R, R[1:], strict=False):
        candidates.update([j for j, v in enumerate(b) if not v < 0])
        candidates.update([j for j, rate in enumerate(rates) if rate > 0 and later[j] < 0])
    return sorted(candidates)


def side_by_side(
    steps: Sequence[FloatStep], derivatives: Callable[[Ints], Derivative], *, breaks: bool = False
) -> Step:
    """These steps as lanes, with the derivatives in some of them."""

    def rates_of(columns: Ints) -> Any:
        derivative = derivatives(columns)
        return lambda y, times=0.0: derivative(times, y)

    start, end = np.array([(step.start, step.end) for step in steps]).T
    before, after = (np.array([getattr(step, name) for step in steps]).T for name in ("before", "after"))
    stage_numbers = chain.from_iterable(chain.from_iterable(step.stages for step in steps))
    stages = np.fromiter(stage_numbers, float, (STAGES + 1) * before.size).reshape(len(steps), STAGES + 1, -1)
    lane_numbers = np.arange(len(steps))
    lanes = np.zeros_like(lane_numbers), np.ones(len(steps), dtype=bool), start, end - start
    step = Step(
        *lanes, before, after, np.moveaxis(stages, 0, 2), rates_of(lane_numbers), rates_of, breaks, is_single_run=True
    )
    step.ends = end
    return step


def samples(step: Step, times: Floats) -> Floats:
    """The y (T, size) at times within these steps of one run, by the method's own interpolation."""
    at = np.searchsorted(step.ends, times)
    inside = step.within_all().take(at).at((times - step.start[at]) / step.length[at])
    return np.where(times == step.ends[at], step.after[:, at], inside).T


# ------------------------------------------------------------------------------------------------- one attempted step


@lru_cache(maxsize=32)
def attempt_of(size: int, input_text: str = "") -> Callable[..., Any]:
    """One attempted step for y of this size.

    It is a function of rate, length, y, y', relative and absolute tolerances, and where y at a part {} of the step is
    `input_text`, of time and inputs.  It returns the sums of squares of the fifth- and third-order errors over
    their tolerances, y at the end, all stages, and y at those of `SEEN`.
    """
    lines = ["def attempt(rate, h, y, k0, relative, absolute, t, inputs):", f"  {_all('y{i}', size)}, = y"]
    for stage, shares in enumerate(ROWS[1:], 1):
        lines += [f"  {_all(f'k{stage - 1}_{{i}}', size)}, = k{stage - 1}"]
        sums = ", ".join(f"y{i} + h * ({weighted_sum(shares, f'k{{}}_{i}')})" for i in range(size))
        lines += [f"  z = [{sums}]", f"  k{stage} = rate(z{input_text.format(NODES[stage])})"]
        lines += [f"  z{stage}_ = z"] if stage in SEEN else []
    lines += [f"  {_all(f'k{STAGES}_{{i}}', size)}, = k{STAGES}"]
    lines += [f"  {_all('z{i}', size)}, = z", f"  {_all('a{i}', size)}, = absolute", "  fifth = third = 0.0"]
    for i in range(size):
        lines += [f"  allowed = a{i} + relative * max(abs(y{i}), abs(z{i}))"]
        lines += [f"  share = ({weighted_sum(FIFTH, f'k{{}}_{i}')}) / allowed", "  fifth += share * share"]
        lines += [f"  share = ({weighted_sum(THIRD, f'k{{}}_{i}')}) / allowed", "  third += share * share"]
    stages, looks = (", ".join(names) for names in ([f"k{s}" for s in range(STAGES + 1)], [f"z{s}_" for s in SEEN]))
    lines += [f"  return fifth, third, z, [{stages}], ({looks})"]
    return function_in("\n".join(lines), "attempt")


def wide_attempt(
    rate: Rate,
    h: float,
    y: Numbers,
    first: Numbers,
    relative: float,
    absolute: Numbers,
    t: float,
    inputs: Any,
    *,
    is_time_only: bool,
) -> tuple[float, float, list[float], Sequence[Numbers], Sequence[Numbers]]:
    """The same step for long y, to rounding, with sums over stages by products of matrices."""
    rates, start, after = np.empty((STAGES + 1, len(y))), np.array(y), np.empty(len(y))
    stages, looks, z = [first], list[Numbers](), list[float]()
    rates[0] = first
    for stage in range(1, STAGES + 1):
        np.dot(WEIGHTS[stage], rates[: len(WEIGHTS[stage])], out=after)
        after *= h
        after += start
        z, time = after.tolist(), t + NODES[stage] * h
        stages.append(rate(z) if inputs is None else rate(z, (time,) if is_time_only else inputs(time, z)))
        rates[stage] = stages[-1]
        looks += [z] * (stage in SEEN)
    errors = ERRORS @ rates / (absolute + relative * np.maximum(abs(start), abs(after)))
    fifth, third = (errors * errors).sum(axis=1).tolist()
    return fifth, third, z, stages, looks


def _all(name: str, size: int) -> str:
    return ", ".join(name.format(i=i) for i in range(size))
