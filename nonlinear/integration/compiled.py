"""DOP853 compiled by numba (extra `fast`): steps, error control and samples in one kernel, for any plane scene.

Its sums over stages are written out from the data of `method`, where its control of steps stands too, so that it takes
the steps of SciPy's.  Scenes are passed as arrays: one kernel serves all, and is cached on disk.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, cast

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.compiled import TURN_ROWS, Compiled, rate
from nonlinear.dynamics.compiling import compiled, in_place, part
from nonlinear.integration.kernels import integrator
from nonlinear.integration.method import (
    EXTRA,
    FIFTH,
    MORE,
    NODES,
    POWERS,
    ROWS,
    STAGES,
    TERMS,
    THIRD,
    advance,
    control_step,
    cubic_terms,
    gain_at,
    terms_of,
    weighted_sum,
)
from nonlinear.integration.methods import Choice, equations_of
from nonlinear.integration.readiness import make_ready
from nonlinear.integration.steppers import (
    SHORTEST_STEP,
    SMALL_STEP,
    STEPS_AT_ONCE,
    Derivative,
    DOP853Solver,
    DOP853Stepper,
)
from nonlinear.integration.within import Step

NOTHING_DUE, NOT_KEPT = np.empty(0), np.empty((0, 0, 0))
WRITTEN_OUT = Choice("minimal", "DOP853", False, "")  # equations that take many y at once
TERM_COUNT = len(TERMS)


def _texts() -> str:
    """The sums over stages, written out: `stage`, `errors`, `terms`; and `inside`, from the terms."""
    stage = "K[{}, i]"
    lines = ["def stage(number, y, h, K, z):"]
    for number, row in enumerate([*ROWS[1:], *MORE], 1):
        lines += [
            f" if number == {number}:",
            "  for i in range(y.size):",
            f"   z[i] = y[i] + h * ({weighted_sum(row, stage)})",
        ]
    lines += ["def errors(y, K, z, relative, absolute):", " fifth = third = 0.0", " for i in range(y.size):"]
    lines += ["  scale = 1.0 / (absolute[i] + relative * max(abs(y[i]), abs(z[i])))"]
    lines += [f"  a, b = ({weighted_sum(FIFTH, stage)}) * scale, ({weighted_sum(THIRD, stage)}) * scale"]
    lines += ["  fifth, third = fifth + a * a, third + b * b", " return fifth, third"]
    lines += ["def terms(y, h, K, z, F):", " for i in range(y.size):"]
    lines += [f"  F[0, i], F[1, i], F[2, i] = cubic_terms(z[i] - y[i], h * K[0, i], h * K[{STAGES}, i])"]
    lines += [f"  F[{number}, i] = h * ({weighted_sum(row, stage)})" for number, row in enumerate(POWERS, 3)]
    all_terms = ", ".join(f"F[{number}, i]" for number in range(TERM_COUNT))
    lines += ["def inside(part, y, F, rows, row):", " for i in range(y.size):"]
    lines += [f"  rows[row, i] = y[i] + gain_at(part, ({all_terms}))"]
    return "\n".join(lines)


def _functions_in(text: str, *names: str) -> list[Any]:
    space: dict[str, Any] = {"cubic_terms": in_place(cubic_terms), "gain_at": in_place(gain_at)}
    exec(compile(text, "<method>", "exec"), space)
    return [in_place(space[name]) for name in names]


_control_step = part(control_step)
_stage, _errors, _terms, _inside = _functions_in(_texts(), "stage", "errors", "terms", "inside")


@in_place
def _stages(first, last, y, h, K, z, scene, turns):  # type: ignore[no-untyped-def]
    """The rates K at these stages of a step from y, whose last ends at z."""
    for number in range(first, last):
        _stage(number, y, h, K, z)
        rate(z, *scene, turns, K[number])


@compiled
def steps(scene, clock, relative, absolute, y, stages, due, rows, ends, states, kept_stages):  # type: ignore[no-untyped-def]
    """Up to len(ends) steps to the end of `clock` (time, length to try, longest, end, length of the last step).

    `y` and the first of the `stages` are those of the beginning, then of the end.  Fills `rows` at the times `due`, and
    `ends` and `states` for every step, and its stages (len(ends), 13, size) in `kept_stages` unless it is empty;
    returns how many of each and the number of derivatives.  The stages of the last step stay.
    """
    time, next_length, longest, end, _ = clock
    z, work, terms = np.empty_like(y), np.empty_like(y), np.empty((TERM_COUNT, y.size))
    turns = np.empty((TURN_ROWS, len(scene[0])))
    step_count = row_count = calls = 0
    while step_count < len(ends) and time < end and (row_count < len(due) or not len(due)):
        shortest, is_retry, is_good = SHORTEST_STEP * abs(np.nextafter(time, end) - time), False, False
        length = min(max(next_length, shortest), longest)
        for i in range(y.size if step_count else 0):
            stages[0, i] = stages[STAGES, i]
        while length >= shortest:
            until = min(time + length, end)
            length = until - time
            _stages(1, STAGES + 1, y, length, stages, z, scene, turns)
            fifth, third = _errors(y, stages, z, relative, absolute)
            calls += STAGES
            error, factor = _control_step(fifth, third, length, y.size, is_retry)
            if error < 1:
                next_length, is_good = length * factor, True
                break
            length, is_retry = length * factor, True
        if not is_good:
            break
        if row_count < len(due) and due[row_count] <= until:
            _stages(STAGES + 1, STAGES + EXTRA + 1, y, length, stages, work, scene, turns)
            _terms(y, length, stages, z, terms)
            calls += EXTRA
            while row_count < len(due) and due[row_count] <= until:
                if due[row_count] == until:
                    rows[row_count] = z
                else:
                    _inside((due[row_count] - time) / length, y, terms, rows, row_count)
                row_count += 1
        for stage in range(STAGES + 1 if kept_stages.size else 0):
            for i in range(y.size):
                kept_stages[step_count, stage, i] = stages[stage, i]
        for i in range(y.size):
            y[i] = states[step_count, i] = z[i]
        ends[step_count] = until
        clock[0], clock[1], clock[4] = until, next_length, length
        time, step_count = until, step_count + 1
    return step_count, row_count, calls


class CompiledDOP853(DOP853Solver):
    """The method in compiled steps, for the `scene` of compiled equations."""

    def __init__(self, scene: tuple[Any, ...], *arguments: Any, **limits: Any) -> None:
        super().__init__(*arguments, **limits)
        self.scene, self.length, self.stages = scene, 0.0, np.empty((STAGES + EXTRA + 1, self.n))

    def advance(self, due: Floats, limit: int, kept_stages: Floats = NOT_KEPT) -> tuple[Floats, Floats, Floats]:
        """Up to this many steps, none if the first fails: y at the times `due`, the ends of steps, y there.

        The stages of all are `kept_stages` (most, 13, size) where there is room.
        """
        clock = np.array([self.t, self.h_abs, self.max_step, self.t_bound, 0.0])
        rows, ends, states = np.empty((len(due), self.n)), np.empty(limit), np.empty((limit, self.n))
        y, self.stages[0] = self.y.copy(), self.f
        arguments = (self.rtol, self.atol, y, self.stages, due, rows, ends, states, kept_stages)
        step_count, row_count, calls = steps(self.scene, clock, *arguments)
        self.nfev += calls
        if step_count:
            self.t_old, self.y_old = (
                (self.t, self.y) if step_count == 1 else (float(ends[step_count - 2]), states[step_count - 2])
            )
            self.t, self.h_abs, *_, self.length = clock.tolist()
            self.y, self.f = y, self.stages[STAGES].copy()
        return rows[:row_count], ends[:step_count], states[:step_count]

    def take_step(self) -> bool:
        """Take one step; whether one was short enough."""
        return len(self.advance(NOTHING_DUE, 1)[1]) > 0

    def dense_output(self) -> Callable[[Floats], Floats]:
        """The y (size, T) at times within the last step."""
        start, y, length, stages = self.t_old, self.y_old, self.t - self.t_old, self.stages.copy()
        for number in range(STAGES + 1, len(stages)):
            z, work = np.empty((2, self.n))
            advance(number, y, np.array(self.length), stages, z, work)
            stages[number] = self.fun(start + self.length * NODES[number], z)
        terms = terms_of(self.length, self.y - y, stages)
        return lambda times: y[:, None] + gain_at((times - start) / length, [term[:, None] for term in terms])


class CompiledStepper(DOP853Stepper[Compiled]):
    """DOP853 compiled, for compiled equations, with the arguments of `DOP853Stepper`; ready once it is made."""

    _last_steps: tuple[Floats, Floats, Floats]

    def __init__(self, equations: Compiled, *arguments: Any, **options: Any) -> None:
        with make_ready(integrator(equations.system)):
            super().__init__(equations, *arguments, **options)
            cast("CompiledDOP853", self._solver).advance(NOTHING_DUE, 0)

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> CompiledDOP853:
        return CompiledDOP853(self.equations.scene, self.f, time, y, end, **options)

    def sweep(
        self, times: Floats, all_ends: bool = True, limit: int = STEPS_AT_ONCE
    ) -> tuple[Floats, list[tuple[float, Floats]], int]:
        """Many steps at once, as defined in `Sweeper`."""
        solver = cast("CompiledDOP853", self._on_its_way())
        start = solver.t, solver.y
        kept_stages = self._room[:limit] if self.keeps_steps else NOT_KEPT
        rows, ends, states = solver.advance(times, limit, kept_stages)
        good = len(ends) if np.all(np.isfinite(states)) else int(np.argmin(np.isfinite(states).all(axis=1)))
        if not good:
            raise self._stop_error("not finite" if len(ends) else SMALL_STEP)
        self.before, self.y_before, self._within = solver.t_old, solver.y_old, None
        solver.status = "finished" if solver.t >= solver.t_bound else "running"
        if self.keeps_steps:
            times_of_steps, y_of_steps = np.append(start[0], ends[:good]), np.vstack((start[1], states[:good]))
            self._last_steps = times_of_steps, y_of_steps, kept_stages[:good]
        row_count = int(np.searchsorted(times[: len(rows)], ends[good - 1], side="right"))
        selection = slice(0 if all_ends else good - 1, good)
        return rows[:row_count], list(zip(ends[selection].tolist(), states[selection], strict=True)), good

    def steps_of_sweep(self) -> Step:
        """The steps of the last sweep, joined."""
        return Step.of_run(*self._last_steps, self._rates_beside, bool(self.pace.breaks))

    def _rates_beside(self, y: Floats, times: Any = 0.0) -> Floats:
        """The rates of many y at once, counted: by the equations written out where that is faster than one by one."""
        self._done += y.shape[1]
        if y.shape[1] <= self.equations.system.n_links**2:
            return np.stack([self.f(0.0, column) for column in y.T], axis=1)
        return self._written_out(times, y)

    @cached_property
    def _written_out(self) -> Derivative:
        return equations_of(self.equations.system, WRITTEN_OUT).derivative

    @cached_property
    def _room(self) -> Floats:
        """Storage for the stages of the steps of one sweep."""
        return np.empty((STEPS_AT_ONCE, STAGES + 1, self.y.size))
