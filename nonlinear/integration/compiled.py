"""DOP853 compiled by numba (extra `fast`): steps, error control and samples in one kernel, for any plane scene.

Its coefficients and its control of steps are those of `method`, so that it takes the steps of SciPy's.  Scenes are
passed as arrays: one kernel serves all, and is cached on disk.  numba's cache depends on the date of this file alone:
whoever changes `nonlinear.dynamics.compiled`, `controlled` or `joint_law` must touch this file as well.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
from scipy.integrate import DOP853

from modal.eigen.compiling import compiled
from modal.types import Floats, Ints
from nonlinear.dynamics import undisturbed
from nonlinear.dynamics.compiled import LOOSE, Compiled, rate
from nonlinear.integration.costs import integrator
from nonlinear.integration.method import FIFTH, MORE, POWERS, ROWS, STAGES, THIRD, controlled
from nonlinear.integration.steppers import Derivative, DOP853Stepper

SMALL_STEP = DOP853.TOO_SMALL_STEP
COMPILING = "Compiling the integrator, which takes some ten seconds; the result is saved for later runs."
NOTHING_DUE = np.empty(0)
MOST, NUMBERS = 256, 200_000  # steps in one call of the kernel, and numbers of y that it returns


def _table() -> tuple[Ints, Ints, Floats]:
    """Sparse rows: where each begins among all shares, the stages that these are of, and the shares."""
    rows = [*ROWS, *MORE, *POWERS, FIFTH, THIRD]
    columns, shares = zip(*(own for row in rows for own in row), strict=True)
    return np.cumsum([0, *map(len, rows)]), np.array(columns), np.array(shares)


TABLE = _table()
WEIGHTS, EXTRA, DENSE, ERRORS = STAGES, STAGES + 1, STAGES + 4, STAGES + 8  # rows of it
"""Rows of the table: end of a step, three more stages and four terms for samples, both error estimates."""


_controlled = compiled(controlled)


@compiled
def _weighted(table, row, stages, found):  # type: ignore[no-untyped-def]
    """Add the weighted stages of one row of the table."""
    begins, columns, shares = table
    for m in range(begins[row], begins[row + 1]):
        share, stage = shares[m], stages[columns[m]]
        for i in range(found.size):
            found[i] += share * stage[i]


@compiled
def _stage(table, row, into, y, length, stages, z, scene, turns):  # type: ignore[no-untyped-def]
    """One stage: z = y + length (its row of the table), and the derivative there."""
    z[:] = 0.0
    _weighted(table, row, stages, z)
    for i in range(z.size):
        z[i] = y[i] + length * z[i]
    rate(z, *scene, 0.0, LOOSE, turns, stages[into])


@compiled
def _error(table, y, z, stages, relative, absolute, work):  # type: ignore[no-untyped-def]
    """The sums of squares of both errors of a step over their tolerances."""
    fifth = third = 0.0
    for row in range(ERRORS, ERRORS + 2):
        work[:] = 0.0
        _weighted(table, row, stages, work)
        total = 0.0
        for i in range(y.size):
            share = work[i] / (absolute[i] + relative * max(abs(y[i]), abs(z[i])))
            total += share * share
        if row == ERRORS:
            fifth = total
        else:
            third = total
    return fifth, third


@compiled
def _terms(table, y, z, length, stages, terms, work, scene, turns):  # type: ignore[no-untyped-def]
    """The seven terms of the interpolation within a step, after three more stages."""
    for k in range(3):
        _stage(table, EXTRA + k, STAGES + 1 + k, y, length, stages, work, scene, turns)
    for i in range(y.size):
        moved, first, last = z[i] - y[i], length * stages[0, i], length * stages[STAGES, i]
        terms[0, i], terms[1, i], terms[2, i] = moved, first - moved, 2 * moved - last - first
    for k in range(4):
        terms[3 + k] = 0.0
        _weighted(table, DENSE + k, stages, terms[3 + k])
        terms[3 + k] *= length


@compiled
def _within(x, y, terms, found):  # type: ignore[no-untyped-def]
    """The y at the fraction x of a step."""
    found[:] = 0.0
    for k in range(6, -1, -1):
        part = x if k % 2 == 0 else 1 - x
        for i in range(y.size):
            found[i] = (found[i] + terms[k, i]) * part
    for i in range(y.size):
        found[i] += y[i]


@compiled
def _steps(table, scene, clock, relative, absolute, y, stages, due, rows, ends, states):  # type: ignore[no-untyped-def]
    """Up to len(ends) steps to the end of `clock` (time, length to try, longest, end, length of the last step).

    `y` and the first of the `stages` are those of the beginning, then of the end.  Fills `rows` at the times `due`, and
    `ends` and `states` for every step; returns how many of each and the number of derivatives.  The stages of the last
    step are kept.
    """
    time, tried, longest, end, _ = clock
    z, work, begun = np.empty_like(y), np.empty_like(y), y.copy()
    turns, terms = np.empty((len(scene[0]), 6)), np.empty((7, y.size))
    steps = filled = calls = 0
    while steps < len(ends) and time < end and (filled < len(due) or not len(due)):
        least, rejected, accepted = 10 * abs(np.nextafter(time, end) - time), False, False
        length = min(max(tried, least), longest)
        if steps:
            stages[0] = stages[STAGES]
        begun[:] = y
        while length >= least:
            until = min(time + length, end)
            length = until - time
            for row in range(1, STAGES + 1):
                _stage(table, row, row, begun, length, stages, z, scene, turns)
            calls += STAGES
            fifth, third = _error(table, begun, z, stages, relative, absolute, work)
            error, factor = _controlled(fifth, third, length, y.size, rejected)
            if error < 1:
                tried, accepted = length * factor, True
                break
            length, rejected = length * factor, True
        if not accepted:
            break
        y[:] = z
        if filled < len(due) and due[filled] <= until:
            _terms(table, begun, y, length, stages, terms, work, scene, turns)
            calls += 3
            while filled < len(due) and due[filled] <= until:
                if due[filled] == until:
                    rows[filled] = y
                else:
                    _within((due[filled] - time) / length, begun, terms, rows[filled])
                filled += 1
        ends[steps], states[steps] = until, y
        clock[0], clock[1], clock[4] = until, tried, length
        time, steps = until, steps + 1
    return steps, filled, calls


def loaded() -> bool:
    """Whether the kernel is ready in this process."""
    return bool(getattr(_steps, "signatures", ()))


@contextmanager
def announced() -> Iterator[None]:
    """A block that may load or compile the kernel, uninterrupted; a terminal is told what takes long."""
    if loaded():
        yield
        return
    if not integrator().kept and sys.stderr.isatty():
        print(COMPILING, file=sys.stderr)
    with undisturbed():
        yield


class CompiledDOP853(DOP853):  # type: ignore[misc]
    """SciPy's method in compiled steps, for the `scene` of compiled equations."""

    t: float
    t_old: float
    y: Floats
    y_old: Floats
    f: Floats
    h_abs: float

    def __init__(self, scene: tuple[Any, ...], *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.scene, self.absolute = scene, np.array(np.broadcast_to(self.atol, self.y.shape))

    def advance(self, due: Floats, most: int) -> tuple[Floats, Floats, Floats]:
        """Up to this many steps, none if the first fails: y at the times `due`, the ends of steps, y there."""
        clock = np.array([self.t, self.h_abs, self.max_step, self.t_bound, 0.0])
        rows, ends, states = np.empty((len(due), self.n)), np.empty(most), np.empty((most, self.n))
        y, self.K_extended[0] = self.y.copy(), self.f
        given = (self.rtol, self.absolute, y, self.K_extended, due, rows, ends, states)
        with announced():
            steps, filled, calls = _steps(TABLE, self.scene, clock, *given)
        self.nfev += calls
        if steps:
            self.t_old, self.y_old = (self.t, self.y) if steps == 1 else (float(ends[steps - 2]), states[steps - 2])
            self.t, self.h_abs, *_, self.h_previous = clock.tolist()
            self.y, self.f = y, self.K[STAGES].copy()
        return rows[:filled], ends[:steps], states[:steps]

    def _step_impl(self) -> tuple[bool, str | None]:
        _, ends, _ = self.advance(NOTHING_DUE, 1)
        return (True, None) if len(ends) else (False, SMALL_STEP)


class CompiledStepper(DOP853Stepper[Compiled]):
    """DOP853 compiled, for compiled equations, with the arguments of `DOP853Stepper`."""

    def _solver_of(self, f: Derivative, time: float, y: Floats, end: float, **options: Any) -> CompiledDOP853:
        return CompiledDOP853(self.equations.scene, self.f, time, y, end, **options)

    def sweep(self, times: Floats, every: bool = True) -> tuple[Floats, list[tuple[float, Floats]], int]:
        """Many steps at once, as defined in `Sweeper`."""
        solver = cast("CompiledDOP853", self._on_its_way())
        rows, ends, states = solver.advance(times, max(1, min(MOST, NUMBERS // solver.n)))
        good = len(ends) if np.all(np.isfinite(states)) else int(np.argmin(np.isfinite(states).all(axis=1)))
        if not good:
            raise self._stopped("not finite" if len(ends) else SMALL_STEP)
        self.before, self.y_before, self._within = solver.t_old, solver.y_old, None
        solver.status = "finished" if solver.t >= solver.t_bound else "running"
        reached = int(np.searchsorted(times[: len(rows)], ends[good - 1], side="right"))
        shown = slice(0 if every else good - 1, good)
        return rows[:reached], list(zip(ends[shown].tolist(), states[shown], strict=True)), good
