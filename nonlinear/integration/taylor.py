"""Taylor series of high order by heyoka (extra `taylor`): the plain recursion written out as expressions, compiled.

heyoka takes the length of a step from the last two coefficients of the series (Jorba and Zou, Experimental Mathematics
14, 2005).  Released from rest at ±90°, angles move in the powers 2, 6, 10, … of t and rates in 1, 5, 9, …: where the
order is a multiple of four both coefficients are zero, and the first step comes out many times too long.  So the order
is never a multiple of four, and the first step no longer than FIRST of the shortest linear period; either alone keeps
every digit of the starts that were tried.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from math import ceil, exp, inf, log, pi
from typing import Any

import numpy as np

from modal.errors import ComputationError, MissingExtraError
from modal.types import Floats
from nonlinear.dynamics import Minimal, Recursion, undisturbed
from nonlinear.integration.steppers import Pace

FIRST = 0.05
TIGHTEST = 1e-15
LONGEST_CHAIN, MOST_LINKS = 24, 400
GIVES_UP = {"err_nf_state": "its series overflow; choose another method"}


def available() -> bool:
    """Whether heyoka is installed."""
    return find_spec("heyoka") is not None


def first_step(omega: float) -> float:
    """The cap (s) on the first step, from the fastest natural frequency (rad/s); inf where nothing swings."""
    return FIRST * 2 * pi / omega if omega else inf


class TaylorStepper:
    """One Taylor series after another.

    The first is no longer than `pace.first` (s), for which `first_step` is meant; `tolerance` sets the order.  Raises
    MissingExtraError without heyoka, ComputationError under a load and where
    compiling so many links would take longer than another method takes to run.
    """

    def __init__(self, equations: Minimal, y: Floats, start: float, end: float, tolerance: float, pace: Pace) -> None:
        begun = np.array(y, dtype=float)
        self.start, self.end, self.pace, self.calls = start, end, pace, 0
        with undisturbed():
            self.integrator = _heyoka().taylor_adaptive(
                expressions(equations), begun, time=start, tol=uneven(tolerance), compact_mode=True
            )
        self._coefficients, self._from = begun[None], start

    @property
    def time(self) -> float:
        """Where it stands (s)."""
        return float(self.integrator.time)

    @property
    def y(self) -> Floats:
        """What it found there, (size,)."""
        return np.array(self.integrator.state)

    def step(self) -> None:
        """One series further, never beyond a break; ComputationError where it leaves the finite numbers."""
        start, (low, high) = self.time, self.pace.stretch(self.time)
        since, until = max(low, self.start), min(high, self.end)
        first = self.pace.first or inf if start == since else inf
        longest = min(first, self.pace.most(since, until), until - start)
        outcome, _ = self.integrator.step(max_delta_t=longest, write_tc=True)
        if outcome.name not in {"success", "time_limit"}:
            raise ComputationError(f"taylor stopped at {start:.9g} s: {GIVES_UP.get(outcome.name, outcome.name)}")
        if outcome.name == "time_limit" and longest == until - start:
            self.integrator.time = until
        self._coefficients, self._from, self.calls = np.array(self.integrator.tc).T, start, self.calls + 1

    def inside(self, times: Floats) -> Floats:
        """The y (T, size) at times within the last step, by its series."""
        return np.asarray(np.polynomial.polynomial.polyval(times - self._from, self._coefficients)).T

    def exact(self, time: float) -> Floats:
        """The y at one time within the last step."""
        return np.asarray(self.inside(np.array([time]))[0])

    def restart(self, y: Floats, time: float | None = None) -> None:
        """Go on from another y at the present time, or at one within the last step."""
        self.integrator.state[:] = y
        self.integrator.time = self.time if time is None else time
        self._coefficients, self._from = np.array(y)[None], self.time


def uneven(tolerance: float) -> float:
    """The nearest tolerance from TIGHTEST on whose order, ⌈1 − ½ log(tolerance)⌉ in heyoka, is no multiple of four."""
    wanted = max(tolerance, TIGHTEST)
    order = ceil(1 - log(wanted) / 2)
    return wanted if order % 4 else 0.99 * exp(2 - 2 * order)


def expressions(equations: Minimal) -> list[tuple[Any, Any]]:
    """Every component of y beside its derivative, as heyoka's expressions."""
    heyoka, system = _admitted(equations), equations.system
    sine, cosine = (np.frompyfunc(function, 1, 1) for function in (heyoka.sin, heyoka.cos))
    written = Minimal(system, tuple(Recursion(group, sine=sine, cosine=cosine) for group in system.groups))
    y = np.array([heyoka.expression(f"y{i}") for i in range(equations.layout.size)], dtype=object)
    return list(zip(y, written.derivative(0.0, y) + heyoka.expression(0.0), strict=True))


def _admitted(equations: Minimal) -> Any:
    """heyoka, for a system that it can take."""
    longest, links = max(group.n for group in equations.system.groups), equations.system.n_links
    if equations.load is not None:
        raise ComputationError("Taylor series cannot follow a load: choose another method")
    if longest > LONGEST_CHAIN or links > MOST_LINKS:
        limit = f"at most {LONGEST_CHAIN} links a chain and {MOST_LINKS} in all, not {longest} and {links}"
        raise ComputationError(f"Taylor series take {limit}: choose another method")
    return _heyoka()


def _heyoka() -> Any:
    try:
        return import_module("heyoka")
    except ImportError:
        raise MissingExtraError("heyoka", "taylor") from None
