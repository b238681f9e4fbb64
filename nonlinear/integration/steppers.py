"""Integrators advanced one step at a time, with dense output within the step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, ulp
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.report import silent
from modal.types import Floats

Derivative = Callable[[float, Floats], Floats]
EXPLICIT = ("DOP853", "RK45", "RK23")
OTHERS = ("Radau", "BDF", "LSODA")
SCIPY = EXPLICIT + OTHERS
"""Methods by their names in `scipy.integrate`, which is loaded when the first of its own takes a step."""
SMALLEST = 2.3e-14
"""Format: the smallest relative tolerance that SciPy accepts without a warning, a little above 100 ε."""
FEW_COMPONENTS = 32
"""Tolerance: components of y up to which those at rest hide no significant error in the root mean square."""
SMALL_STEP = "Required step size is less than spacing between numbers."  # in SciPy's words
SHORTEST_STEP = 10
"""Format: units in the last place of the time that no step is shorter than, as in SciPy."""
STEPS_AT_ONCE = 256
"""Cost: steps of one sweep, between which events are looked for and Ctrl-C is heard (benchmarks/simulation.py)."""
BREAK_ULPS = 4
"""Tolerance: units in the last place within which a time is at a break or an end: sums of steps err by this."""


@dataclass(frozen=True)
class Pace:
    """Limits on the steps of an integrator, which ends a step at each of the `breaks` (s, ascending) and restarts.

    `first` (s) is the first step to try, or None for the method's own choice; no step is longer than `longest` (s).  A
    `share` below 1 makes every step shorter than that fraction of `longest` and of the interval between two breaks, so
    that runs with different shares step differently, whatever limits their steps.  `landing` is called at each break,
    with its time and y, before the next step.
    """

    first: float | None = None
    longest: float = inf
    breaks: tuple[float, ...] = ()
    share: float = 1.0
    landing: Callable[[float, Any], object] = silent

    def stretch(self, time: float) -> tuple[float, float]:
        """The breaks on either side of a time, a break at that time counting as before it; infinite if none."""
        at = bisect_right(self.breaks, time)
        return (self.breaks[at - 1] if at else -inf), (self.breaks[at] if at < len(self.breaks) else inf)

    def longest_between(self, start: float, end: float) -> float:
        """The longest step (s) between these two times, breaks or the ends of the run."""
        return self.longest if self.share == 1 else self.share * min(self.longest, end - start)


AT_EASE = Pace()


def first_step_of(y: Floats, slope: Floats, scale: Floats, longest: Floats | float) -> Floats:
    """First steps (s) to try, at most `longest`: those in which y at this slope changes by its distance from zero.

    Of one y (size,), or of many (size, S).  Both are measured in `scale`, the absolute tolerance of each component.
    SciPy's rule [Hairer1993, §II.4] ends with a power of seconds, so its steps depend on the units.
    """
    distance, speed = (np.max(np.abs(values / scale), axis=0) for values in (y, slope))
    is_known = (distance > 0) & (speed > 0)
    steps = np.minimum(distance / np.where(is_known, speed, 1.0), longest)
    return np.asarray(np.where(is_known, steps, longest))


def tolerance_factor(slope: Floats, units: Floats) -> Floats:
    """A factor, at most 1, for the tolerance of a run in which most of y is at rest at the start; of many runs (S,).

    SciPy's methods except LSODA bound the root mean square of all errors by the tolerance, so that of k moving
    components among n may be √(n/k) too large.  With s the slope in natural units (size, …), k = (Σ s²)²/Σ s⁴; since
    velocities are zero in a start from rest and unequal pendula move unequally, 4 k components count, and few
    components are never sharpened.
    """
    speed = np.abs(slope / units)
    largest = speed.max(0)
    rests = largest == 0
    shares = (speed / (largest + rests)) ** 2
    alive = shares.sum(0) ** 2 / ((shares**2).sum(0) + rests)
    factors = np.minimum(1.0, np.sqrt(np.maximum(4 * alive, FEW_COMPONENTS) / len(slope)))
    return np.where(largest > 0, factors, 1.0)  # also where rates are not numbers: such a member fails by itself


class DOP853Solver(ABC):
    """The state of an integration by our own steps of the method, with SciPy's names.

    `derivative` is that of arrays.
    """

    def __init__(
        self,
        derivative: Derivative,
        t: float,
        y: Floats,
        t_bound: float,
        *,
        rtol: float,
        atol: Floats,
        first_step: float | None = None,
        max_step: float = inf,
    ) -> None:
        self.derivative, self.n, self.nfev, self.status = derivative, len(y), 0, "running"
        self.t, self.t_bound, self.max_step, self.rtol = t, t_bound, max_step, rtol
        self.y, self.f = y, self.fun(t, y)
        self.t_old, self.y_old, self.atol = t, y, np.array(np.broadcast_to(atol, y.shape))
        self.h_abs = first_step or float(first_step_of(y, self.f, atol + rtol * np.abs(y), min(max_step, t_bound - t)))

    def fun(self, time: float, y: Floats) -> Floats:
        """The derivative, counted."""
        self.nfev += 1
        return self.derivative(time, y)

    def step(self) -> str | None:
        """Take one step; the message where that fails."""
        is_taken = self.take_step()
        self.status = "failed" if not is_taken else "finished" if self.t >= self.t_bound else "running"
        return None if is_taken else SMALL_STEP

    @abstractmethod
    def take_step(self) -> bool:
        """Take one step; whether one was short enough."""


class Stepper(Protocol):
    """An integrator in progress."""

    @property
    def time(self) -> float:
        """Current time (s)."""

    @property
    def y(self) -> Floats:
        """Current y, (size,)."""

    @property
    def calls(self) -> int:
        """Number of derivatives computed."""

    def step(self) -> None:
        """Take one step; raise ComputationError if that fails."""

    def inside(self, times: Floats) -> Floats:
        """The y (T, size) at times within the last step, as accurate as the integrator's dense output."""

    def exact(self, time: float) -> Floats:
        """The y at one time within the last step, as accurate as the step itself."""

    def restart(self, y: Floats) -> None:
        """Continue from another y at the present time."""


@runtime_checkable
class Sweeper(Stepper, Protocol):
    """An integrator that takes many steps at once, after each of which it satisfies every constraint.

    `drift` is the largest violation that was removed.
    """

    drift: float

    def sweep(
        self, times: Floats, all_ends: bool = True, limit: int = ...
    ) -> tuple[Floats, Sequence[tuple[float, Sequence[float] | Floats]], int]:
        """Take some steps, at least one and at most `limit`, towards the last of these times (ascending).

        Returns the y (T, size) at those times that are reached, (s, y) at `all_ends` of steps or at the last, and the
        number of steps. Raise ComputationError if not even the first step succeeds.
        """


class SciPyStepper:
    """A method of `scipy.integrate` (see there for the papers behind each).

    `tolerance` is relative, at least SMALLEST; `absolute` (size,) is the tolerance of components near zero.  At a break
    a discontinuous derivative is evaluated just off it, on the side of the step.
    """

    def __init__(
        self,
        method: str,
        f: Derivative,
        start: float,
        y: Floats,
        end: float,
        tolerance: float,
        absolute: Floats,
        pace: Pace = AT_EASE,
    ) -> None:
        self.method, self.f, self.tolerance, self.absolute, self.pace = method, f, tolerance, absolute, pace
        self.start, self.end, self._done = start, end, 0
        self.before, self.y_before = start, y
        self._within: Callable[[Floats], Floats] | None = None
        with np.errstate(all="ignore"):
            self._solver = self._start_solver(start, y, pace.first)

    def _start_solver(self, time: float, y: Floats, first: float | None) -> Any:
        """An integrator from here to the next break or the end."""
        self._low, self._high = self.pace.stretch(time)
        return self._make_solver(time, y, min(self._high, self.end), first)

    def _make_solver(self, time: float, y: Floats, end: float, first: float | None) -> Any:
        first_length = None if first is None or self.method == "LSODA" else min(first, end - time) or None
        longest = self.pace.longest_between(max(self._low, self.start), min(self._high, self.end))
        options = {"rtol": max(self.tolerance, SMALLEST), "atol": self.absolute, "first_step": first_length}
        f = self._between_breaks if self.pace.breaks else self.f
        return self._solver_of(f, time, y, end, max_step=longest, **options)

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> Any:
        return getattr(scipy.integrate, self.method)(f, time, y, end, **options)

    def _between_breaks(self, time: float, y: Floats) -> Floats:
        """The derivative, evaluated strictly between the surrounding breaks."""
        return self.f(self.clear_of_breaks(time), y)

    def clear_of_breaks(self, time: float) -> float:
        """A time (s) strictly between the breaks around the present step."""
        clear = BREAK_ULPS * ulp(time)
        return min(max(time, self._low + clear), self._high - clear)

    @property
    def time(self) -> float:
        """Current time (s)."""
        return float(self._solver.t)

    @property
    def lands(self) -> bool:
        """Whether the last step ended at a break, behind which the next one begins."""
        return self._high <= self.time < self.end

    @property
    def y(self) -> Floats:
        """Current y, (size,)."""
        return np.asarray(self._solver.y)

    @property
    def calls(self) -> int:
        """Number of derivatives computed."""
        return self._done + int(self._solver.nfev)

    def step(self) -> None:
        """Take one step."""
        solver = self._on_its_way()
        self.before, self.y_before, self._within = self.time, self.y, None
        try:
            message = solver.step()
        except ValueError:
            if np.all(np.isfinite(getattr(self._solver, "J", 0.0))):
                raise
            message = "its Jacobian overflows"
        if message or self._solver.status == "failed" or not np.all(np.isfinite(self.y)):
            raise self._stop_error(message or "not finite")

    def _on_its_way(self) -> Any:
        """The integrator, a new one where a break has been reached."""
        if self.lands:
            self._done += self._solver.nfev
            self.pace.landing(self.time, self.y)
            self._solver = self._start_solver(self.time, self.y, self.pace.first)
        return self._solver

    def _stop_error(self, message: str) -> ComputationError:
        return ComputationError(f"{self.method} stopped at {self.before:.9g} s: {message}")

    def inside(self, times: Floats) -> Floats:
        """Dense output by the method's own interpolation."""
        if self._within is None:
            self._within = self._solver.dense_output()
        return np.asarray(self._within(times)).T

    def exact(self, time: float) -> Floats:
        """The y at one time within the last step, integrated again from the beginning of the step."""
        if time <= self.before:
            return self.y_before
        solver = self._make_solver(self.before, self.y_before, time, time - self.before)
        while solver.status == "running":
            solver.step()
        self._done += solver.nfev
        return np.asarray(solver.y)

    def restart(self, y: Floats) -> None:
        """Continue from another y with the same step size: the method is explicit."""
        self._solver.y, self._solver.f = y, self._solver.fun(self.time, y)


E = TypeVar("E", bound=Any)


class DOP853Stepper(SciPyStepper, Generic[E]):
    """DOP853 in another implementation, given the `equations` themselves; otherwise as `SciPyStepper`.

    Where it `keeps_steps`, it has those of each sweep.
    """

    drift, keeps_steps = 0.0, False

    def __init__(
        self,
        equations: E,
        start: float,
        y: Floats,
        end: float,
        tolerance: float,
        absolute: Floats,
        pace: Pace = AT_EASE,
    ) -> None:
        self.equations = equations
        super().__init__("DOP853", equations.derivative, start, y, end, tolerance, absolute, pace)

    def steps_of_sweep(self) -> Any:
        """The steps of the last sweep, joined, a `nonlinear.integration.within.Step`."""
        raise NotImplementedError
