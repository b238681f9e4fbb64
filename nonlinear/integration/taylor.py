"""High-order Taylor series by heyoka (extra `taylor`): the generated equations, compiled.

The constants of a scene are parameters, so one compiled series serves all scenes that differ in these alone.
heyoka computes the step size from the last two coefficients of the series [Jorba2005].  Released from rest at ±90°,
angles contain the powers 2, 6, 10, … of t and rates 1, 5, 9, …: where the order is a multiple of four both coefficients
are zero, and the first step comes out many times too long.  So the order is never a multiple of four, and the first
step no longer than FIRST_STEP_PERIODS of the shortest linear period; either measure alone preserved every digit in all
starts tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from copy import deepcopy
from importlib import import_module
from math import ceil, exp, inf, log, pi
from threading import Lock
from typing import Any
from weakref import finalize

import numpy as np

from modal.errors import ComputationError, MissingExtraError
from modal.types import Floats
from modal.vibration.prescribed import Polynomials
from nonlinear.dynamics import Arranged, Generated, Module, module_of, without_interrupts
from nonlinear.dynamics.forms import Form
from nonlinear.dynamics.inputs import at_time
from nonlinear.integration.arguments import TIGHTEST
from nonlinear.integration.readiness import Code, has_package, look_up, make_ready
from nonlinear.integration.steppers import STEPS_AT_ONCE, Pace
from nonlinear.system import System

FIRST_STEP_PERIODS = 0.05
"""Tolerance: of the shortest linear period, the longest first step: coefficients say nothing of a start from rest."""
LONGEST_CHAIN = 24
"""Limit: links of a chain, for which compiling takes longer than other methods take to run."""
SERIES_LINKS_MAX = 400
"""Limit: links of a scene, likewise."""
UNROLLED_LINKS = 4
"""Cost: links up to which a series is one function: faster, longer to compile (benchmarks/simulation.py)."""
INTEGRATORS_MAX = 32
"""Cost: compiled integrators kept in a process, of some megabytes each (benchmarks/engines.py)."""
GOES_ON = {"success", "time_limit", "step_limit"}
GIVES_UP = {"err_nf_state": "its series overflow; choose another method"}


def available() -> bool:
    """Whether heyoka is installed."""
    return has_package("heyoka")


def takes(system: System) -> bool:
    """Whether heyoka is installed and compiles for this many links in less time than other methods take to run."""
    longest = max(group.n for group in system.groups)
    return available() and longest <= LONGEST_CHAIN and system.n_links <= SERIES_LINKS_MAX


def first_step(omega: float) -> float:
    """The limit (s) on the first step, from the fastest natural frequency (rad/s); inf if nothing oscillates."""
    return FIRST_STEP_PERIODS * 2 * pi / omega if omega else inf


class TaylorStepper:
    """Integration by Taylor series, one series per step.

    The first step is no longer than `pace.first` (s), meant to come from `first_step`; `tolerance` sets the order.
    Raise MissingExtraError without heyoka, ComputationError under a load and where compiling for this many links would
    take longer than another method takes to run.
    """

    drift = 0.0

    def __init__(self, equations: Arranged, y: Floats, start: float, end: float, tolerance: float, pace: Pace) -> None:
        y_start = np.array(y, dtype=float)
        self.start, self.end, self.pace, self.calls = start, end, pace, 0
        self.integrator = integrator_of(_written_equations(equations), uneven(tolerance), self)
        self.pieces = pieces_of(equations)
        self.integrator.state[:], self.integrator.time = y_start, start
        self._coefficients, self._from = y_start[None], start
        self._failure: ComputationError | None = None

    @property
    def time(self) -> float:
        """Current time (s)."""
        return float(self.integrator.time)

    @property
    def y(self) -> Floats:
        """Current y, (size,)."""
        return np.array(self.integrator.state)

    def step(self) -> None:
        """Take one step, never beyond a break; raise ComputationError if the numbers overflow."""
        start = self.time
        since, until = self._stretch()
        first = self.pace.first or inf if start == since else inf
        longest = min(first, self.pace.longest_between(since, until), until - start)
        outcome, _ = self.integrator.step(max_delta_t=longest, write_tc=True)
        self._judge(outcome, start)
        if outcome.name == "time_limit" and longest == until - start:
            self.integrator.time = until
        self._coefficients, self._from, self.calls = np.array(self.integrator.tc).T, start, self.calls + 1

    def sweep(
        self, times: Floats, all_ends: bool = True, limit: int = STEPS_AT_ONCE
    ) -> tuple[Floats, list[tuple[float, Floats]], int]:
        """Many steps at once, as defined in `Sweeper`: heyoka visits the times itself, except just after a break."""
        if self._failure:
            raise self._failure
        start, (since, until) = self.time, self._stretch()
        if start == since:
            self.step()
            return self.inside(times[times <= self.time]), [(self.time, self.y)], 1
        ends: list[tuple[float, Floats]] = []

        def record_step(integrator: Any) -> bool:
            ends.append((integrator.time, integrator.state.copy()))
            return True

        within = times[times <= until]
        grid = np.unique(np.concatenate(([start], within, [until])))
        longest, callback = self.pace.longest_between(since, until), record_step if all_ends else None
        options = {"max_steps": limit, "max_delta_t": longest, "callback": callback}
        outcome, _, _, steps, _, rows = self.integrator.propagate_grid(grid, **options)
        now = self.time
        row_count = int(np.searchsorted(within, now, side="right"))
        try:
            self._judge(outcome, now)
            last = now, self.y
        except ComputationError as error:
            self._failure = error
            if not steps:
                raise
            last = float(grid[row_count]), rows[row_count]
        self.calls += steps
        self._coefficients, self._from = np.array(self.integrator.tc).T, now - self.integrator.last_h
        return rows[1 : 1 + row_count], ends[:steps] or [last], steps

    def _stretch(self) -> tuple[float, float]:
        """The breaks on either side, or the ends of the run."""
        low, high = self.pace.stretch(self.time)
        since, until = max(low, self.start), min(high, self.end)
        if self.pieces:
            coefficients = at_time(self.pieces, (since + until) / 2)
            self.integrator.pars[-len(coefficients) :] = coefficients
        return since, until

    def _judge(self, outcome: Any, time: float) -> None:
        """Raise ComputationError for a failed step."""
        if outcome.name not in GOES_ON:
            raise ComputationError(f"taylor stopped at {time:.9g} s: {GIVES_UP.get(outcome.name, outcome.name)}")

    def inside(self, times: Floats) -> Floats:
        """The y (T, size) at times within the last step, from its series."""
        return np.asarray(np.polynomial.polynomial.polyval(times - self._from, self._coefficients)).T

    def exact(self, time: float) -> Floats:
        """The y at one time within the last step."""
        return np.asarray(self.inside(np.array([time]))[0])

    def restart(self, y: Floats) -> None:
        """Continue from another y at the present time."""
        self.integrator.state[:] = y
        self._coefficients, self._from = np.array(y)[None], self.time


def uneven(tolerance: float) -> float:
    """The nearest tolerance from TIGHTEST on whose order, ⌈1 − ½ log(tolerance)⌉ in heyoka, is no multiple of four."""
    target = max(tolerance, TIGHTEST)
    order = ceil(1 - log(target) / 2)
    return target if order % 4 else 0.99 * exp(2 - 2 * order)


class Originals(dict[Any, Any]):
    """The code compiled in this process, by its source: a copy for every caller.

    Integrators of heyoka write into memory of their own while they work, and let Python's other threads run: no two
    threads may use the same one.  A copy has its own memory and is not compiled again; as it takes
    longer than a short run, the copies of users that are gone serve others.
    """

    def __init__(self) -> None:
        super().__init__()
        self._lock = Lock()

    def copy_of(self, key: Any, compile_original: Callable[[], Any], user: object = None) -> Any:
        """A copy of the code cached under this key, compiled first if there is none.

        It is reserved while its `user` lives, and for good without one.
        """
        with self._lock:
            if key not in self:
                with without_interrupts():
                    fresh = compile_original()
                while len(self) >= INTEGRATORS_MAX:
                    del self[next(iter(self))]
                self[key] = fresh, []
            original, idle = self[key]
            integrator = idle.pop() if idle else deepcopy(original)
        if user is not None:
            finalize(user, _leave, idle, integrator).atexit = False
        return integrator


def _leave(idle: list[Any], copy: Any) -> None:
    """Without a lock, for it may be called at any time, also in the thread that holds it."""
    if len(idle) < 4:
        idle.append(copy)


_COMPILED = Originals()
"""By the text of their equations and the options of compilation."""


def code_of(form: Form, pieces: Sequence[Polynomials], tolerance: float) -> Code:
    """The series of this order for such scenes, and how far it is."""
    links, longest = form.system.n_links, max(group.n for group in form.system.groups)
    compiling = 0.05 * longest**2 if links <= UNROLLED_LINKS else 0.2 * longest + 0.025 * links
    degrees = [piece.coefficients.shape[1] for piece in pieces]
    return look_up("heyoka", f"{form} {degrees} {tolerance}", compiling, "the Taylor series")


def pieces_of(equations: Arranged) -> Sequence[Polynomials]:
    """The polynomials that are inputs; raise ComputationError if inputs are neither these nor the time alone."""
    if (pieces := equations.inputs.pieces) is None:
        raise ComputationError("Taylor series cannot follow this function of time: choose another method")
    return pieces


def _text(module: Module, pieces: Sequence[Polynomials]) -> str:
    """The source of the code: the equations, and the degrees of the polynomials that are their inputs."""
    return f"{module.python('rates')}\n{[piece.coefficients.shape[1] for piece in pieces]}"


def integrator_of(equations: Generated, tolerance: float, user: object = None) -> Any:
    """Heyoka's integrator for these equations, compiled once per process for all constants of such a scene.

    Once its `user` is gone others get it.
    """
    module, size, pieces = module_of(equations.form), equations.layout.size, pieces_of(equations)
    code = code_of(equations.form, pieces, tolerance)
    pars = [*equations.constants, *at_time(pieces, 0.0)]

    options = {"tol": tolerance, "compact_mode": equations.system.n_links > UNROLLED_LINKS}
    with make_ready(code) as compiles:

        def compile_series() -> Any:
            heyoka = _heyoka()
            with nullcontext() if code.kept else compiles():
                return heyoka.taylor_adaptive(expressions(module, size, pieces), np.zeros(size), pars=pars, **options)

        integrator = _COMPILED.copy_of((_text(module, pieces), tolerance), compile_series, user)
    integrator.pars[:] = pars
    return integrator


def expressions(module: Module, size: int, pieces: Sequence[Polynomials] = ()) -> list[tuple[Any, Any]]:
    """Pairs of each component of y and its derivative, as heyoka's expressions, with the constants as parameters.

    Inputs are the time, or polynomials in `pieces`, whose origins and coefficients are further parameters (`at_time`).
    """
    heyoka = _heyoka()
    y = [heyoka.expression(f"y{i:03d}") for i in range(size)]
    functions = {name: getattr(heyoka, name) for name in ("sin", "cos", "sqrt", "exp", "log", "tanh")}
    rates = module.generic_function("rates", [heyoka.par[k] for k in range(len(module.names))], functions)
    u, at = [] if pieces else [heyoka.time] * module.sizes.get("u", 0), len(module.names)
    for piece in pieces:
        since, last = heyoka.time - heyoka.par[at], at + piece.coefficients.shape[1]
        polynomial = heyoka.par[last]
        for k in range(last - 1, at, -1):
            polynomial = polynomial * since + heyoka.par[k]
        u, at = [*u, polynomial], last + 1
    return [(component, heyoka.expression(0.0) + rate) for component, rate in zip(y, rates(y, u), strict=True)]


def _written_equations(equations: Arranged) -> Generated:
    """The same equations written out, if heyoka can integrate them."""
    longest, links = max(group.n for group in equations.system.groups), equations.system.n_links
    if equations.load is not None:
        raise ComputationError("Taylor series cannot follow a load: choose another method")
    if longest > LONGEST_CHAIN or links > SERIES_LINKS_MAX:
        limit = f"at most {LONGEST_CHAIN} links a chain and {SERIES_LINKS_MAX} in all, not {longest} and {links}"
        raise ComputationError(f"Taylor series take {limit}: choose another method")
    _heyoka()
    return equations if isinstance(equations, Generated) else Generated(equations.system)


def _heyoka() -> Any:
    try:
        return import_module("heyoka")
    except ImportError:
        raise MissingExtraError("heyoka", "taylor") from None
