"""One step of an integrator at a time, with the motion inside the step at hand."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Protocol

import numpy as np
from scipy import integrate

from modal.errors import ComputationError
from modal.rig import Floats

Derivative = Callable[[float, Floats], Floats]
EXPLICIT = {"DOP853": integrate.DOP853, "RK45": integrate.RK45, "RK23": integrate.RK23}
OTHERS = {"Radau": integrate.Radau, "BDF": integrate.BDF, "LSODA": integrate.LSODA}
SCIPY = {**EXPLICIT, **OTHERS}
SMALLEST = 2.3e-14  # relative tolerance that SciPy accepts
FEW = 32  # components among which resting ones hide no error worth a step


def first_step(y: Floats, slope: Floats, scale: Floats, longest: float) -> float:
    """A first step (s) to try, at most `longest`: in which y at this slope goes as far as it is from zero.

    Both are measured in `scale`, what is left of each component.  SciPy's rule (Hairer, Nørsett and Wanner, Solving
    Ordinary Differential Equations I, 1993, §II.4) ends with a power of seconds, so other units change every step.
    """
    size, speed = (float(np.max(np.abs(values / scale))) for values in (y, slope))
    return min(size / speed, longest) if size and speed else longest


def sharpened(slope: Floats, units: Floats) -> float:
    """What to take a tolerance times where much of y rests at the start, at most 1.

    SciPy's methods but LSODA hold the mean square of all errors to the tolerance, so that of k among n components in
    motion may be √(n/k) too large.  With s the slope in natural units (size,), k = (Σ s²)²/Σ s⁴; a start from rest has
    speeds of zero and unequal pendula unequal ones, wherefore 4 k count, and a few are never told from many.
    """
    speed = np.abs(slope / units)
    if not (most := float(speed.max())):
        return 1.0
    moved = (speed / most) ** 2
    alive = float(moved.sum() ** 2 / (moved**2).sum())
    return min(1.0, sqrt(max(4 * alive, FEW) / moved.size))


class Stepper(Protocol):
    """An integrator on its way."""

    @property
    def time(self) -> float:
        """Where it stands (s)."""
        ...

    @property
    def y(self) -> Floats:
        """What it found there, (size,)."""
        ...

    @property
    def calls(self) -> int:
        """How often it asked for a derivative."""
        ...

    def step(self) -> None:
        """Go one step on; ComputationError where that cannot be."""
        ...

    def inside(self, times: Floats) -> Floats:
        """The y (T, size) at times within the last step, as accurate as the integrator gives them cheaply."""
        ...

    def exact(self, time: float) -> Floats:
        """The y at one time within the last step, as accurate as the step itself."""
        ...

    def restart(self, y: Floats, time: float | None = None) -> None:
        """Go on from another y at the present time, or at one within the last step."""
        ...


class SciPyStepper:
    """A method of `scipy.integrate` (see there for the papers behind each).

    `tolerance` is relative, at least SMALLEST; `absolute` (size,) is what it leaves of components near zero.  `first`
    (s) is the first step to try, SciPy's own where it is None.
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
        first: float | None = None,
    ) -> None:
        self.method, self.f, self.end, self.tolerance, self.absolute = method, f, end, tolerance, absolute
        self._done = 0
        self.before, self.y_before = start, y
        self._within: integrate.DenseOutput | None = None
        with np.errstate(all="ignore"):
            self._solver = self._made(start, y, end, first)

    def _made(self, start: float, y: Floats, end: float, first: float | None) -> integrate.OdeSolver:
        tried = None if first is None or self.method == "LSODA" else min(first, end - start) or None
        options = {"rtol": max(self.tolerance, SMALLEST), "atol": self.absolute, "first_step": tried}
        return SCIPY[self.method](self.f, start, y, end, **options)

    @property
    def time(self) -> float:
        """Where it stands (s)."""
        return float(self._solver.t)

    @property
    def y(self) -> Floats:
        """What it found there."""
        return np.asarray(self._solver.y)

    @property
    def calls(self) -> int:
        """Derivatives so far."""
        return self._done + int(self._solver.nfev)

    def step(self) -> None:
        """Go one step on."""
        self.before, self.y_before, self._within = self.time, self.y, None
        message = self._solver.step()
        if self._solver.status == "failed" or not np.all(np.isfinite(self.y)):
            raise ComputationError(f"{self.method} stopped at {self.before:.9g} s: {message or 'not finite'}")

    def inside(self, times: Floats) -> Floats:
        """By the method's own interpolation."""
        if self._within is None:
            self._within = self._solver.dense_output()
        return np.asarray(self._within(times)).T

    def exact(self, time: float) -> Floats:
        """By integrating anew from the beginning of the step."""
        if time <= self.before:
            return self.y_before
        solver = self._made(self.before, self.y_before, time, time - self.before)
        while solver.status == "running":
            solver.step()
        self._done += solver.nfev
        return np.asarray(solver.y)

    def restart(self, y: Floats, time: float | None = None) -> None:
        """Go on from another y; an explicit method that stays where it is keeps its length of step."""
        if time is None and self.method in EXPLICIT:
            self._solver.y, self._solver.f = y, self._solver.fun(self.time, y)
            return
        self._done += self._solver.nfev
        self._solver = self._made(self.time if time is None else time, y, self.end, self.time - self.before)
