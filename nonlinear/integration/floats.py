"""DOP853 in Python's floats, for generated equations (`nonlinear.dynamics.generated`).

Twelve stages, both error estimates and the step size control are those of SciPy's method, whose coefficients are read
from it, so both take the same steps.  The sums over stages are written out component by component, once for each
length of y; samples are interpolated for many steps at once, in NumPy.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from math import nan, nextafter, sqrt
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.integrate import DOP853

from modal.errors import SceneError
from modal.types import Floats
from nonlinear.dynamics import Written
from nonlinear.dynamics.generated import UNDEFINED, Listed, Rate
from nonlinear.dynamics.text import function_in
from nonlinear.integration.steppers import Derivative, DOP853Stepper
from nonlinear.system import Equations

STAGES, EXTRA = DOP853.n_stages, len(DOP853.A_EXTRA)
SAFETY, SHRINKS, GROWS = 0.9, 0.2, 10.0  # factors of the step size, as in SciPy
AT_ONCE = 256  # steps

Numbers = Sequence[float]


class Passed(NamedTuple):
    """A step: its beginning and end (s), y there, and the derivative at every stage, the last at the end."""

    start: float
    end: float
    before: Numbers
    after: Numbers
    stages: Sequence[Numbers]


class FloatDOP853(DOP853):  # type: ignore[misc]
    """SciPy's method for a `rate` of y and the `inputs` at a time and y, all lists of floats.

    They are None where there are none, and the time itself where `clocked`.
    """

    t: float
    y: Floats
    f: Floats
    t_old: float
    y_old: Floats
    h_abs: float

    def __init__(self, rate: Rate, inputs: Listed | None, clocked: bool, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        beside = "" if inputs is None else ", (t + {} * h,)" if clocked else ", inputs(t + {} * h, z)"
        self.rate, self.inputs, self.attempt = rate, inputs, attempt_of(self.n, beside)
        self.passed = Passed(self.t, self.t, self.y.tolist(), self.y.tolist(), [self.f.tolist()])
        self.smallest = np.broadcast_to(self.atol, self.y.shape).tolist()

    def advance(
        self, due: Numbers, most: int, clear: Callable[[Sequence[Numbers]], bool] | None = None
    ) -> tuple[list[Passed], list[Passed], int]:
        """Up to this many steps, none if the first fails, until the last time that is `due` (all that, if none is).

        Returns the steps, those in which times are due, and how many of these times have been reached; the first step
        that is not `clear` is taken but not among them.
        """
        y, f, at = self.y.tolist(), self.f.tolist(), 0
        steps: list[Passed] = []
        wanted: list[Passed] = []
        begun = self.t
        while len(steps) < most and self.t < self.t_bound and (at < len(due) or not due):
            step = self._passed(y, f)
            if step is None:
                break
            self.passed = step
            y, f, self.t = step.after, step.stages[-1], step.end
            if clear and not clear(step.stages):
                break
            steps.append(step)
            if at < len(due) and due[at] <= self.t:
                wanted.append(step)
                at = bisect_right(due, self.t)
        if self.t > begun:
            self.t_old, self.y_old = self.passed.start, np.array(self.passed.before)
            self.y, self.f = np.array(y), np.array(f)
        return steps, wanted, at

    def _passed(self, y: Numbers, f: Numbers) -> Passed | None:
        """The next step, None where it would be too short."""
        t = self.t
        least = 10 * abs(nextafter(t, self.t_bound) - t)
        length, rejected = min(max(float(self.h_abs), least), self.max_step), False
        while length >= least:
            end = min(t + length, self.t_bound)
            length = end - t
            error, after, stages = self._attempted(length, y, f)
            if error < 1:
                grown = min(GROWS, SAFETY * error ** (-1 / 8)) if error else GROWS
                self.h_abs, self.h_previous = length * (min(1.0, grown) if rejected else grown), length
                return Passed(t, end, y, after, stages)
            length, rejected = length * max(SHRINKS, SAFETY * error ** (-1 / 8)), True
        return None

    def _step_impl(self) -> tuple[bool, str | None]:
        steps, _, _ = self.advance((), 1)
        return (True, None) if steps else (False, self.TOO_SMALL_STEP)

    def _attempted(self, length: float, y: Numbers, f: Numbers) -> tuple[float, Numbers, Sequence[Numbers]]:
        self.nfev += STAGES
        try:
            given = (self.rate, length, y, f, self.rtol, self.smallest, self.t, self.inputs)
            fifth, third, after, stages = self.attempt(*given)
        except SceneError:
            raise
        except UNDEFINED:
            return nan, y, [f]
        both = fifth + 0.01 * third
        return (length * fifth / sqrt(both * self.n) if both else 0.0), after, stages

    def _dense_output_impl(self) -> Any:
        self.K[:] = self.passed.stages
        return super()._dense_output_impl()


class FloatStepper(DOP853Stepper[Written]):
    """DOP853 in floats for generated equations, with the arguments of `DOP853Stepper`."""

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> FloatDOP853:
        listed = self.equations.listed
        inputs = self._off_breaks(listed) if listed and self.pace.breaks else listed
        clocked = self.equations.is_clocked and not self.pace.breaks
        return FloatDOP853(self.equations.rate, inputs, clocked, f, time, y, end, **options)

    def _off_breaks(self, listed: Listed) -> Listed:
        """The inputs, seen strictly between the surrounding breaks."""
        return lambda time, y: listed(self.clear_of_breaks(time), y)

    @property
    def _arranged(self) -> Equations:
        return cast("Equations", self.equations)

    def along(self, weights: Floats) -> Callable[[float], float]:
        """The sum of the components of y with these weights, as a function of time (s) within the last step."""
        if self._within is None:
            self._within = self._solver.dense_output()
        start, length = self._within.t_old, self._within.h
        first, terms = float(self._within.y_old @ weights), (self._within.F @ weights).tolist()[::-1]

        def value(time: float) -> float:
            x, found = (time - start) / length, 0.0
            for number, term in enumerate(terms):
                found = (found + term) * (1 - x if number % 2 else x)
            return first + found

        return value

    def sweep(
        self, times: Floats, every: bool = True, clear: Callable[[Sequence[Numbers]], bool] | None = None
    ) -> tuple[Floats, list[tuple[float, Numbers | Floats]], int]:
        """Many steps at once, as defined in `Sweeper`, up to the first that is not `clear`, judged by y' at its stages.

        That step is taken but not among the results.
        """
        due, reached, mends = times.tolist(), 0, self._arranged.system.spatial
        solver = cast("FloatDOP853", self._on_its_way())
        begun = solver.t
        ends: list[tuple[float, Numbers | Floats]] = []
        wanted: list[Passed] = []
        while True:
            steps, some, more = solver.advance(due[reached:], 1 if mends else AT_ONCE, clear)
            wanted, reached = wanted + some, reached + more
            ends += [(step.end, self._mended() if mends else step.after) for step in steps]
            if not (mends and steps and reached < len(due) and len(ends) < AT_ONCE and solver.t < solver.t_bound):
                break
        if solver.t == begun:
            raise self._stopped(solver.TOO_SMALL_STEP)
        self.before, self.y_before, self._within = solver.t_old, solver.y_old, None
        solver.status = "finished" if solver.t >= solver.t_bound else "running"
        self._done += EXTRA * len(wanted)
        rows = interpolated(wanted, times[:reached], self.equations.derivative) if reached else np.empty((0, solver.n))
        return self._arranged.project(rows)[0] if mends and reached else rows, ends, len(ends)

    def _mended(self) -> Floats:
        """Continue from the nearest y that satisfies every constraint."""
        mended, drift = self._arranged.project(self.y)
        if drift:
            self.drift = max(self.drift, drift)
            self.restart(mended)
        return mended


def interpolated(steps: Sequence[Passed], times: Floats, derivative: Any) -> Floats:
    """The y (T, size) at ascending times within these steps, by the method's own interpolation."""
    start, end = np.array([(step.start, step.end) for step in steps]).T
    before, after = (np.array([getattr(step, name) for step in steps]).T for name in ("before", "after"))
    rates = np.empty((len(DOP853.D.T), *before.shape))
    rates[: STAGES + 1] = np.array([step.stages for step in steps]).transpose(1, 2, 0)
    length = end - start
    for stage, share in enumerate(DOP853.A_EXTRA, STAGES + 1):
        at = start + length * DOP853.C_EXTRA[stage - STAGES - 1]
        rates[stage] = derivative(at, before + length * np.tensordot(share[:stage], rates[:stage], 1))
    moved, first, last = after - before, length * rates[0], length * rates[STAGES]
    terms = [moved, first - moved, 2 * moved - last - first, *(length * np.tensordot(DOP853.D, rates, 1))]
    at = np.searchsorted(end, times)
    x = (times - start[at]) / length[at]
    found = np.zeros((len(before), len(times)))
    for number, term in enumerate(reversed(terms)):
        found = (found + term[:, at]) * (1 - x if number % 2 else x)
    return np.where(times == end[at], after[:, at], before[:, at] + found).T


# ------------------------------------------------------------------------------------------------- one attempted step


@lru_cache(maxsize=32)
def attempt_of(size: int, beside: str = "") -> Callable[..., tuple[float, float, Numbers, Sequence[Numbers]]]:
    """One attempted step for y of this size.

    It is a function of rate, length, y, y', relative and absolute tolerances, and of time and inputs for what stands
    `beside` y at a part {} of the step.  It returns the sums of squares of the fifth- and third-order errors over their
    tolerances, y at the end, and all stages.
    """
    lines = ["def attempt(rate, h, y, k0, relative, absolute, t, inputs):", f"  {_all('y{i}', size)}, = y"]
    nodes = [*DOP853.C, 1.0]
    for stage, shares in enumerate([*DOP853.A[1:], DOP853.B], 1):
        lines += [f"  {_all(f'k{stage - 1}_{{i}}', size)}, = k{stage - 1}"]
        sums = ", ".join(f"y{i} + h * ({_sum(shares, i)})" for i in range(size))
        lines += [f"  z = [{sums}]", f"  k{stage} = rate(z{beside.format(float(nodes[stage]))})"]
    lines += [f"  {_all(f'k{STAGES}_{{i}}', size)}, = k{STAGES}"]
    lines += [f"  {_all('z{i}', size)}, = z", f"  {_all('a{i}', size)}, = absolute", "  fifth = third = 0.0"]
    for i in range(size):
        lines += [f"  allowed = a{i} + relative * max(abs(y{i}), abs(z{i}))"]
        lines += [f"  share = ({_sum(DOP853.E5, i)}) / allowed", "  fifth += share * share"]
        lines += [f"  share = ({_sum(DOP853.E3, i)}) / allowed", "  third += share * share"]
    lines += [f"  return fifth, third, z, [{', '.join(f'k{stage}' for stage in range(STAGES + 1))}]"]
    return function_in("\n".join(lines), "attempt")


def _all(name: str, size: int) -> str:
    return ", ".join(name.format(i=i) for i in range(size))


def _sum(shares: Floats, i: int) -> str:
    return " + ".join(f"{share!r} * k{stage}_{i}" for stage, share in enumerate(shares.tolist()) if share)
