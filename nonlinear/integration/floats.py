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

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import Generated
from nonlinear.dynamics.generated import UNDEFINED
from nonlinear.dynamics.text import function_in
from nonlinear.integration.steppers import Derivative, DOP853Stepper

STAGES, EXTRA = DOP853.n_stages, len(DOP853.A_EXTRA)
SAFETY, SHRINKS, GROWS = 0.9, 0.2, 10.0  # factors of the step size, as in SciPy
AT_ONCE = 256  # steps

Numbers = Sequence[float]
Rate = Callable[..., list[float]]
Listed = Callable[[float, Numbers], Numbers]


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
    h_abs: float

    def __init__(self, rate: Rate, inputs: Listed | None, clocked: bool, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        beside = "" if inputs is None else ", (t + {} * h,)" if clocked else ", inputs(t + {} * h, z)"
        self.rate, self.inputs, self.attempt = rate, inputs, attempt_of(self.n, beside)
        self.passed = Passed(self.t, self.t, self.y.tolist(), self.y.tolist(), [self.f.tolist()])
        self.smallest = np.broadcast_to(self.atol, self.y.shape).tolist()

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y, f = self.t, self.y.tolist(), self.f.tolist()
        least = 10 * abs(nextafter(t, self.t_bound) - t)
        length, rejected = min(max(float(self.h_abs), least), self.max_step), False
        while length >= least:
            end = min(t + length, self.t_bound)
            length = end - t
            error, after, stages = self._attempted(length, y, f)
            if error < 1:
                grown = min(GROWS, SAFETY * error ** (-1 / 8)) if error else GROWS
                self.h_abs, self.h_previous = length * (min(1.0, grown) if rejected else grown), length
                self.y_old, self.t, self.y, self.f = self.y, end, np.array(after), np.array(stages[-1])
                self.passed = Passed(t, end, y, after, stages)
                return True, None
            length, rejected = length * max(SHRINKS, SAFETY * error ** (-1 / 8)), True
        return False, self.TOO_SMALL_STEP

    def _attempted(self, length: float, y: Numbers, f: Numbers) -> tuple[float, Numbers, Sequence[Numbers]]:
        self.nfev += STAGES
        try:
            given = (self.rate, length, y, f, self.rtol, self.smallest, self.t, self.inputs)
            fifth, third, after, stages = self.attempt(*given)
        except UNDEFINED:
            return nan, y, [f]
        both = fifth + 0.01 * third
        return (length * fifth / sqrt(both * self.n) if both else 0.0), after, stages

    def _dense_output_impl(self) -> Any:
        self.K[:] = self.passed.stages
        return super()._dense_output_impl()


class FloatStepper(DOP853Stepper[Generated]):
    """DOP853 in floats for generated equations, with the arguments of `DOP853Stepper`."""

    _failure: ComputationError | None = None

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> FloatDOP853:
        listed = self.equations.listed
        inputs = self._off_breaks(listed) if listed and self.pace.breaks else listed
        clocked = self.equations.is_clocked and not self.pace.breaks
        return FloatDOP853(self.equations.rate, inputs, clocked, f, time, y, end, **options)

    def _off_breaks(self, listed: Listed) -> Listed:
        """The inputs, seen strictly between the surrounding breaks."""
        return lambda time, y: listed(self.clear_of_breaks(time), y)

    def sweep(self, times: Floats, every: bool = True) -> tuple[Floats, list[tuple[float, Numbers | Floats]], int]:
        """Many steps at once, as defined in `Sweeper`."""
        if self._failure:
            raise self._failure
        due, at = times.tolist(), 0
        ends: list[tuple[float, Numbers | Floats]] = []
        kept: list[Passed] = []
        mends = self.equations.system.spatial
        try:
            while at < len(due) and len(ends) < AT_ONCE:
                self.step()
                passed = cast("FloatDOP853", self._solver).passed
                if due[at] <= passed.end:
                    kept.append(passed)
                    at = bisect_right(due, passed.end)
                ends.append((passed.end, self._mended() if mends else passed.after))
        except ComputationError as error:
            self._failure = error
            if not ends:
                raise
        self._done += EXTRA * len(kept)
        rows = interpolated(kept, times[:at], self.equations.derivative) if at else np.empty((0, len(self.y)))
        return self.equations.project(rows)[0] if at else rows, ends, len(ends)

    def _mended(self) -> Floats:
        """Continue from the nearest y that satisfies every constraint."""
        mended, drift = self.equations.project(self.y)
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
