"""DOP853 compiled by numba (extra `fast`): steps, error control and samples in one kernel, for any plane scene.

Its sums over stages are written out from the data of `method`, where its control of steps stands too, so that it takes
the steps of SciPy's.  Scenes are passed as arrays: one kernel serves all, and is cached on disk.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import prod
from typing import Any, cast

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.compiled import TURNS, Compiled, rate
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
    THIRD,
    advance,
    begun,
    controlled,
    gained,
    terms_of,
    weighted,
)
from nonlinear.integration.methods import Choice, equations_of
from nonlinear.integration.readiness import readied
from nonlinear.integration.steppers import SMALL_STEP, Derivative, DOP853Solver, DOP853Stepper
from nonlinear.integration.within import Step

NOTHING_DUE, NOT_KEPT = np.empty(0), np.empty((0, 0, 0))
WRITTEN_OUT = Choice("minimal", "DOP853", False, "")  # equations that take many y at once
TERMS = len(POWERS) + 3  # of the interpolant
MOST, NUMBERS = 1024, 200_000  # steps in one call of the kernel, and numbers of y that it returns


def _texts() -> str:
    """The sums over stages, written out: `stage`, `errors`, `terms`; and `inside`, from the terms."""
    stage = "K[{}, i]"
    lines = ["def stage(number, y, h, K, z):"]
    for number, row in enumerate([*ROWS[1:], *MORE], 1):
        lines += [
            f" if number == {number}:",
            "  for i in range(y.size):",
            f"   z[i] = y[i] + h * ({weighted(row, stage)})",
        ]
    lines += ["def errors(y, K, z, relative, absolute):", " fifth = third = 0.0", " for i in range(y.size):"]
    lines += ["  scale = 1.0 / (absolute[i] + relative * max(abs(y[i]), abs(z[i])))"]
    lines += [f"  a, b = ({weighted(FIFTH, stage)}) * scale, ({weighted(THIRD, stage)}) * scale"]
    lines += ["  fifth, third = fifth + a * a, third + b * b", " return fifth, third"]
    lines += ["def terms(y, h, K, z, F):", " for i in range(y.size):"]
    lines += [f"  F[0, i], F[1, i], F[2, i] = begun(z[i] - y[i], h * K[0, i], h * K[{STAGES}, i])"]
    lines += [f"  F[{number}, i] = h * ({weighted(row, stage)})" for number, row in enumerate(POWERS, 3)]
    every = ", ".join(f"F[{number}, i]" for number in range(TERMS))
    lines += ["def inside(part, y, F, rows, row):", " for i in range(y.size):"]
    lines += [f"  rows[row, i] = y[i] + gained(part, ({every}))"]
    return "\n".join(lines)


def _written(text: str, *names: str) -> list[Any]:
    space: dict[str, Any] = {"begun": in_place(begun), "gained": in_place(gained)}
    exec(compile(text, "<method>", "exec"), space)
    return [in_place(space[name]) for name in names]


_controlled = part(controlled)
_stage, _errors, _terms, _inside = _written(_texts(), "stage", "errors", "terms", "inside")


@in_place
def _stages(first, last, y, h, K, z, scene, turns):  # type: ignore[no-untyped-def]
    """The rates K at these stages of a step from y, whose last ends at z."""
    for number in range(first, last):
        _stage(number, y, h, K, z)
        rate(z, *scene, turns, K[number])


@compiled
def steps(scene, clock, relative, absolute, y, stages, due, rows, ends, states, kept):  # type: ignore[no-untyped-def]
    """Up to len(ends) steps to the end of `clock` (time, length to try, longest, end, length of the last step).

    `y` and the first of the `stages` are those of the beginning, then of the end.  Fills `rows` at the times `due`, and
    `ends` and `states` for every step, and its stages (len(ends), 13, size) in `kept` unless it is empty; returns how
    many of each and the number of derivatives.  The stages of the last step stay.
    """
    time, tried, longest, end, _ = clock
    z, work, terms = np.empty_like(y), np.empty_like(y), np.empty((TERMS, y.size))
    turns = np.empty((TURNS, len(scene[0])))
    passed = filled = calls = 0
    while passed < len(ends) and time < end and (filled < len(due) or not len(due)):
        least, refused, accepted = 10 * abs(np.nextafter(time, end) - time), False, False
        length = min(max(tried, least), longest)
        for i in range(y.size if passed else 0):
            stages[0, i] = stages[STAGES, i]
        while length >= least:
            until = min(time + length, end)
            length = until - time
            _stages(1, STAGES + 1, y, length, stages, z, scene, turns)
            fifth, third = _errors(y, stages, z, relative, absolute)
            calls += STAGES
            error, factor = _controlled(fifth, third, length, y.size, refused)
            if error < 1:
                tried, accepted = length * factor, True
                break
            length, refused = length * factor, True
        if not accepted:
            break
        if filled < len(due) and due[filled] <= until:
            _stages(STAGES + 1, STAGES + EXTRA + 1, y, length, stages, work, scene, turns)
            _terms(y, length, stages, z, terms)
            calls += EXTRA
            while filled < len(due) and due[filled] <= until:
                if due[filled] == until:
                    rows[filled] = z
                else:
                    _inside((due[filled] - time) / length, y, terms, rows, filled)
                filled += 1
        for stage in range(STAGES + 1 if kept.size else 0):
            for i in range(y.size):
                kept[passed, stage, i] = stages[stage, i]
        for i in range(y.size):
            y[i] = states[passed, i] = z[i]
        ends[passed] = until
        clock[0], clock[1], clock[4] = until, tried, length
        time, passed = until, passed + 1
    return passed, filled, calls


class CompiledDOP853(DOP853Solver):
    """The method in compiled steps, for the `scene` of compiled equations."""

    def __init__(self, scene: tuple[Any, ...], *arguments: Any, **limits: Any) -> None:
        super().__init__(*arguments, **limits)
        self.scene, self.length, self.stages = scene, 0.0, np.empty((STAGES + EXTRA + 1, self.n))

    def advance(self, due: Floats, most: int, kept: Floats = NOT_KEPT) -> tuple[Floats, Floats, Floats]:
        """Up to this many steps, none if the first fails: y at the times `due`, the ends of steps, y there.

        The stages of all are `kept` (most, 13, size) where there is room.
        """
        clock = np.array([self.t, self.h_abs, self.max_step, self.t_bound, 0.0])
        rows, ends, states = np.empty((len(due), self.n)), np.empty(most), np.empty((most, self.n))
        y, self.stages[0] = self.y.copy(), self.f
        arguments = (self.rtol, self.atol, y, self.stages, due, rows, ends, states, kept)
        passed, filled, calls = steps(self.scene, clock, *arguments)
        self.nfev += calls
        if passed:
            self.t_old, self.y_old = (self.t, self.y) if passed == 1 else (float(ends[passed - 2]), states[passed - 2])
            self.t, self.h_abs, *_, self.length = clock.tolist()
            self.y, self.f = y, self.stages[STAGES].copy()
        return rows[:filled], ends[:passed], states[:passed]

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
        return lambda times: y[:, None] + gained((times - start) / length, [term[:, None] for term in terms])


class CompiledStepper(DOP853Stepper[Compiled]):
    """DOP853 compiled, for compiled equations, with the arguments of `DOP853Stepper`; ready once it is made."""

    at_once = MOST
    _seen: tuple[Floats, Floats, Floats]

    def __init__(self, equations: Compiled, *arguments: Any, **options: Any) -> None:
        with readied(integrator(structured=equations.system.structure is not None)):
            super().__init__(equations, *arguments, **options)
            cast("CompiledDOP853", self._solver).advance(NOTHING_DUE, 0)

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> CompiledDOP853:
        return CompiledDOP853(self.equations.scene, self.f, time, y, end, **options)

    def sweep(
        self, times: Floats, every: bool = True, most: int = MOST
    ) -> tuple[Floats, list[tuple[float, Floats]], int]:
        """Many steps at once, as defined in `Sweeper`."""
        solver = cast("CompiledDOP853", self._on_its_way())
        begun, most = (solver.t, solver.y), max(1, min(most, NUMBERS // solver.n))
        kept = self._room[:most] if self.watched else NOT_KEPT
        rows, ends, states = solver.advance(times, len(kept) or most, kept)
        good = len(ends) if np.all(np.isfinite(states)) else int(np.argmin(np.isfinite(states).all(axis=1)))
        if not good:
            raise self._stopped("not finite" if len(ends) else SMALL_STEP)
        self.before, self.y_before, self._within = solver.t_old, solver.y_old, None
        solver.status = "finished" if solver.t >= solver.t_bound else "running"
        if self.watched:
            self._seen = np.append(begun[0], ends[:good]), np.vstack((begun[1], states[:good])), kept[:good]
        reached = int(np.searchsorted(times[: len(rows)], ends[good - 1], side="right"))
        shown = slice(0 if every else good - 1, good)
        return rows[:reached], list(zip(ends[shown].tolist(), states[shown], strict=True)), good

    def traced(self) -> Step:
        """The steps of the last sweep side by side."""
        return Step.of_run(*self._seen, self._rates_beside, bool(self.pace.breaks))

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
        """Of the stages of the steps of one sweep."""
        shape = STAGES + 1, self.y.size
        return np.empty((max(1, min(MOST, NUMBERS // prod(shape))), *shape))
