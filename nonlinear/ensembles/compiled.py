"""The engine compiled by numba (extra `fast`): `nonlinear.ensembles.kernels`, and what is measured beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.eigen.compiling import available
from modal.errors import ComputationError, MissingExtraError
from modal.types import Floats, Ints
from nonlinear.dynamics import Lanes, undisturbed
from nonlinear.dynamics.inputs import Inputs
from nonlinear.dynamics.lanes import Rates
from nonlinear.ensembles.found import Found, Wanted
from nonlinear.ensembles.kernels import BESIDE_LINKS, WIDTH, module_of, source
from nonlinear.ensembles.lanes import Watches, stretched, task_of, watches_of
from nonlinear.integration.lanes import NOT_FINITE, TOO_SHORT, Task, Watch
from nonlinear.integration.method import STAGES
from nonlinear.integration.within import Step
from nonlinear.system import Numbers

BUFFER = 2048  # steps that are looked at in NumPy together
REASONS = {1: TOO_SHORT, 2: NOT_FINITE}


@dataclass(eq=False)
class Ran:
    """Of S members: y (size, S) at the end, errors, horizons and ln |v| (S,), why some failed."""

    y: Floats
    error: Floats
    horizon: Floats
    gain: Floats
    reasons: dict[int, str]


def run(numbers: Numbers, y: Floats, wanted: Wanted) -> Found:
    """Members with these numbers from y (size, S) on; MissingExtraError without numba."""
    lanes = Lanes(numbers)
    task, scale, local = task_of(lanes, numbers, y, wanted)
    watches = watches_of(lanes, numbers, y, wanted)
    ran = integrate(task, scale, local, watches, grows=True)
    found = watches.found(Found(ran.y, ran.error, ran.horizon, ran.reasons))
    if wanted.stretching:
        task, scale = stretched(numbers, y[: 2 * lanes.layout.half], wanted)
        gain = integrate(task, np.concatenate((scale, scale)), np.zeros(y.shape[1]), None, grows=False)
        gain.gain[[*gain.reasons]] = np.nan
        found.stretching = gain.gain
    return found


def integrate(task: Task, scale: Floats, local: Floats, watches: Watches | None, *, grows: bool) -> Ran:
    """All members of a task to the end."""
    if not available():
        raise MissingExtraError("numba", "fast")
    module = module_of(source(task.lanes))
    size, count = task.begun.shape
    given = _given(task, count)
    members = np.full(WIDTH, -1)
    times = np.array(watches.samples.times if watches and watches.samples else ())
    if len(times) and times[0] == 0:
        times = times[1:]
    section = watches.section if watches else None
    flags = (bool(len(times)), bool(watches and watches.turns), bool(watches and watches.largest), bool(section))
    wants = np.array([*flags, section.row if section else 0, grows, task.lanes.tangent])
    front = np.zeros((BESIDE_LINKS + task.lanes.system.n_links, WIDTH))
    lanes = [np.zeros((size, WIDTH)) for _ in range(2)]
    constants = np.zeros((max(len(given), 1), WIDTH))
    ran = Ran(np.full((size, count), np.nan), np.zeros(count), np.zeros(count), np.zeros(count), {})
    status = np.zeros(count, dtype=np.int64)
    which, marks = np.zeros(BUFFER, dtype=np.int64), np.zeros((2, BUFFER))
    before, after, stages = np.zeros((size, BUFFER)), np.zeros((size, BUFFER)), np.zeros((STAGES + 1, size, BUFFER))
    spread = np.ascontiguousarray(np.broadcast_to(scale, (size, scale.shape[1])))
    ends, tables = np.append(task.breaks, task.end), _tables(task.lanes.inputs)
    inputs = np.zeros((max(task.lanes.inputs.count, 1), WIDTH))
    arguments = (
        (task.begun, given, task.relative, task.absolute, task.first, ends, task.longest, spread, local, tables),
        *(times, wants, section.level if section else 0.0, members, np.zeros(1, dtype=np.int64), front, *lanes),
        *(np.zeros((STAGES + 1, size, WIDTH)), constants, np.zeros(WIDTH)),
        *(np.ones((size, WIDTH)), np.ones((size, WIDTH)), np.zeros(WIDTH)),
        *(np.zeros((size, WIDTH)) for _ in range(3)),
        *(np.zeros(WIDTH) for _ in range(3)),
        *(ran.y, ran.error, ran.horizon, ran.gain, status, which, marks, before, after, stages, inputs),
    )
    filled = 0
    while filled >= 0:
        with undisturbed():
            filled = module.run(*arguments)
        kept = filled if filled >= 0 else -1 - filled
        if watches and kept:
            _see(
                task, watches.all, which[:kept], marks[:, :kept], before[:, :kept], after[:, :kept], stages[..., :kept]
            )
    for member in np.flatnonzero(status):
        ran.reasons[int(member)] = f"stopped at {ran.horizon[member]:.9g} s: {REASONS[int(status[member])]}"
        ran.horizon[member] = np.nan
    return ran


def _tables(inputs: Inputs) -> tuple[Ints, Floats, Floats, Floats, Floats]:
    """The polynomials of all inputs as arrays: first piece of each, knots, origins, coefficients (d last), periods."""
    if (own := inputs.polynomials) is None:
        raise ComputationError("engine numba cannot follow this function of time: take engine numpy")
    first = np.cumsum([0, *(len(one.origins) for one in own)])
    degree = max((one.coefficients.shape[1] for one in own), default=1)
    knots, origins, coefficients = np.zeros(first[-1]), np.zeros(first[-1]), np.zeros((first[-1], degree))
    for one, at, stop in zip(own, first, first[1:], strict=False):
        knots[at : stop - 1], origins[at:stop] = one.knots, one.origins
        coefficients[at:stop, degree - one.coefficients.shape[1] :] = one.coefficients[:, ::-1]
    return first, knots, origins, coefficients, np.array([one.period for one in own])


def _given(task: Task, count: int) -> Floats:
    """The constants of the equations (C, S), or (C, 1) where members do not differ."""
    constants = task.lanes.constants(task.numbers)
    width = count if any(isinstance(own, np.ndarray) for own in constants) else 1
    return np.array([np.broadcast_to(own, width) for own in constants]).reshape(len(constants), width)


def _see(
    task: Task, watches: Sequence[Watch], which: Ints, marks: Floats, before: Floats, after: Floats, stages: Floats
) -> None:
    """Show steps to watches."""

    def rates_of(columns: Any) -> Rates:
        rates: Rates = task.lanes.rates(task.numbers.at(which[columns]))
        return rates

    taken = np.ones(len(which), dtype=bool)
    step = Step(which, taken, marks[0], marks[1], before, after, stages, rates_of(slice(None)), rates_of)
    step.breaks = bool(len(task.breaks))
    for watch in watches:
        watch.see(step)
