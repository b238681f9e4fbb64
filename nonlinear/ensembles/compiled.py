"""The engine compiled by numba (extra `fast`): `nonlinear.integration.kernels`, and the measures next to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError, MissingExtraError
from modal.types import Floats, Ints
from nonlinear.chaos import TRANSIENT
from nonlinear.dynamics import Lanes, without_interrupts
from nonlinear.dynamics.compiling import available
from nonlinear.dynamics.contacts import JAMMED as STUCK
from nonlinear.dynamics.generated import Rates
from nonlinear.dynamics.inputs import Inputs
from nonlinear.ensembles.lanes import Watches, slope_of, task_of, watches_of
from nonlinear.ensembles.results import MemberResults, Wanted
from nonlinear.integration.crowds import Crowd, RailWork
from nonlinear.integration.kernels import code_of_text, module_of, source
from nonlinear.integration.lanes import NOT_FINITE, TOO_SHORT, LaneTask
from nonlinear.integration.loops import INFINITE, JAMMED, SHORT, TURNED, WIDTH
from nonlinear.integration.method import LOOKS, STAGES
from nonlinear.integration.pacing import stretched
from nonlinear.integration.readiness import make_ready
from nonlinear.integration.switches import Switches
from nonlinear.integration.within import Step, Watch
from nonlinear.system import Numbers

BUFFER_STEPS = 2048
"""Cost: steps that are examined in NumPy together; benchmarks/ensembles.py."""
REASONS = {SHORT: TOO_SHORT, INFINITE: NOT_FINITE, JAMMED: STUCK}


@dataclass(eq=False)
class Ran:
    """Of S members: y (size, S) at the end, errors, horizons, ln |v| and largest angles at ends of steps, (S,).

    With switches also their state (m, S); `reasons` say why some failed.
    """

    y: Floats
    error: Floats
    horizon: Floats
    gain: Floats
    largest: Floats
    state: Floats
    reasons: dict[int, str] = field(default_factory=dict)


def run(numbers: Numbers, y: Floats, wanted: Wanted) -> MemberResults:
    """Members with these numbers from y (size, S) on; MissingExtraError without numba."""
    lanes = Lanes(numbers)
    task, scale, local = task_of(lanes, numbers, y, wanted)
    watches = watches_of(lanes.layout, y, slope_of(lanes, numbers, y), wanted)
    crowd = Crowd(lanes)
    rubbing = [RailWork(crowd, y.shape[1])] if numbers.switching and crowd.presses else []
    ran = integrate(task, scale, local, watches, grows=not numbers.switching, beside=rubbing)
    rubs = numbers.switching and not lanes.layout.works
    rubbed = crowd.work(ran.y, ran.state) + sum(watch.work for watch in rubbing) if rubs else 0.0
    results = watches.added_to(MemberResults(ran.y, ran.error, ran.horizon, ran.reasons, rubbed=rubbed))
    if wanted.stretching:
        end = (1 + TRANSIENT) * wanted.duration
        task, scale = stretched(numbers, y[: 2 * lanes.layout.half], end, wanted.tolerance)
        units, none = np.concatenate((scale, scale)), np.zeros(y.shape[1])
        ends = [wanted.duration * TRANSIENT, task.end]
        before, gain = (integrate(replace(task, end=end), units, none, None, grows=False) for end in ends)
        gain.gain[[*gain.reasons, *before.reasons]] = np.nan
        results.stretching = gain.gain - before.gain
    return results


def integrate(
    task: LaneTask, scale: Floats, local: Floats, watches: Watches | None, *, grows: bool, beside: Sequence[Watch] = ()
) -> Ran:
    """All members of a task to the end."""
    if not available():
        raise MissingExtraError("numba", "fast")
    crowd = Crowd(task.lanes) if task.numbers.switching else None
    switches = crowd.switches if crowd else None
    text = source(task.lanes, crowd)
    module, code = module_of(text), code_of_text(task.lanes, text, has_switches=crowd is not None)
    size, count = task.initial.shape
    constants = crowd.constants() if crowd else task.lanes.constants(task.numbers)
    numbers = _given(constants, count)
    times = np.array(watches.samples.times if watches and watches.samples else ())
    if len(times) and times[0] == 0:
        times = times[1:]
    section = watches.section if watches else None
    flags = (bool(len(times)), bool(watches and watches.turns), bool(watches and watches.largest), bool(section))
    wants = np.array([*flags, section.row if section else 0, grows, task.lanes.tangent])
    held = 2 * switches.places.J if switches else 0
    final = np.zeros((switches.places.length if switches else 0, count))
    error, horizon, gain, largest = np.zeros((4, count))
    ran = Ran(np.full((size, count), np.nan), error, horizon, gain, largest, final)
    status, which = np.zeros(count, dtype=np.int64), np.zeros(BUFFER_STEPS, dtype=np.int64)
    results = ran.y, error, horizon, gain, largest, status
    shapes = (2,), (size,), (size,), (STAGES + 1, size), (held,)
    steps = tuple(np.zeros((*shape, BUFFER_STEPS)) for shape in shapes)
    spread = np.ascontiguousarray(np.broadcast_to(scale, (size, scale.shape[1])))
    ends, tables = np.append(task.breaks, task.end), _tables(task.lanes.inputs)
    whole = task.initial, numbers, task.relative, task.absolute, task.first, ends, task.longest, spread, local, tables
    lanes = _lanes(size, len(numbers), task.lanes.system.n_links, task.lanes.inputs.count + held)
    level, begun = section.level if section else 0.0, np.zeros(1, dtype=np.int64)
    switching = _switching(switches, final)

    def rates_in(numbers: Numbers, contact_inputs: Floats) -> Rates:
        rates: Rates = crowd.rates(numbers)(contact_inputs) if crowd else task.lanes.rates(numbers)
        return rates

    filled = 0
    while filled >= 0:
        with make_ready(code), without_interrupts():
            filled = module.run(whole, times, wants, level, begun, lanes, results, (which, *steps), switching)
        kept = filled if filled >= 0 else -1 - filled
        if watches and kept:
            _see(task, [*beside, *watches.all], rates_in, which[:kept], *(rows[..., :kept] for rows in steps))
    if watches and watches.largest:
        watches.largest.angle = np.maximum(watches.largest.angle, ran.largest)
    for member in np.flatnonzero(status):
        ran.reasons[int(member)] = f"stopped at {ran.horizon[member]:.9g} s: {REASONS[int(status[member])]}"
        ran.horizon[member] = np.nan
    if switches:
        ran.error[:], ran.horizon[:] = np.nan, np.nan
    return ran


def _lanes(size: int, constants: int, links: int, inputs: int) -> tuple[Floats | Ints, ...]:
    """The arguments of a module with a column for each lane, none of which has a member yet."""
    front, K = np.zeros((TURNED + links, WIDTH)), np.zeros((STAGES + 1, size, WIDTH))
    y, z, v, w, g = (np.zeros((size, WIDTH)) for _ in range(5))
    absolute, scale = (np.ones((size, WIDTH)) for _ in range(2))
    relative, local, length, error, is_good = (np.zeros(WIDTH) for _ in range(5))
    c, u = (np.zeros((max(count, 1), WIDTH)) for count in (constants, inputs))
    first = np.full(WIDTH, -1), front, y, z, K, c, relative, absolute, scale, local
    return *first, v, w, g, length, error, is_good, u


def _switching(switches: Switches | None, final: Floats) -> tuple[Any, ...]:
    """The arguments of a module for switches, whose states at the end go into `final`."""
    count = final.shape[1]
    entries = (switches.constants, switches.numbers) if switches else ((), ())
    constants, numbers = (_given(each, count) for each in entries)
    rows = switches.module.sizes["v"] if switches else 1
    lanes = [np.zeros((len(each), WIDTH)) for each in (constants, numbers, final)]
    values = np.zeros((len(LOOKS), 2 * switches.count if switches else 0, WIDTH))
    sought = [np.full(WIDTH, -1) for _ in range(2)]
    lengths = [np.zeros(WIDTH) for _ in range(4)]
    return (constants, numbers, *lanes, np.zeros((rows, WIDTH)), values, *sought, *lengths, final)


def _tables(inputs: Inputs) -> tuple[Ints, Floats, Floats, Floats, Floats]:
    """The polynomials of all inputs as arrays: first piece of each, knots, origins, coefficients (d last), periods."""
    if (polynomials := inputs.polynomials) is None:
        raise ComputationError("engine numba cannot follow this function of time: take engine numpy")
    first = np.cumsum([0, *(len(polynomial.origins) for polynomial in polynomials)])
    degree = max((polynomial.coefficients.shape[1] for polynomial in polynomials), default=1)
    knots, origins, coefficients = np.zeros(first[-1]), np.zeros(first[-1]), np.zeros((first[-1], degree))
    for polynomial, at, stop in zip(polynomials, first, first[1:], strict=False):
        knots[at : stop - 1], origins[at:stop] = polynomial.knots, polynomial.origins
        coefficients[at:stop, degree - polynomial.coefficients.shape[1] :] = polynomial.coefficients[:, ::-1]
    return first, knots, origins, coefficients, np.array([polynomial.period for polynomial in polynomials])


def _given(values: Sequence[Any], count: int) -> Floats:
    """Numbers of members (C, S), or (C, 1) where members do not differ."""
    width = count if any(np.ndim(value) for value in values) else 1
    return np.array([np.broadcast_to(value, width) for value in values]).reshape(len(values), width)


def _see(
    task: LaneTask,
    watches: Sequence[Watch],
    rates: Callable[[Numbers, Floats], Rates],
    which: Ints,
    marks: Floats,
    before: Floats,
    after: Floats,
    stages: Floats,
    acting: Floats,
) -> None:
    """Show steps to watches."""

    def rates_of(columns: Any) -> Rates:
        return rates(task.numbers.at(which[columns]), acting[:, columns])

    taken = np.ones(len(which), dtype=bool)
    step = Step(which, taken, marks[0], marks[1], before, after, stages, rates_of(slice(None)), rates_of)
    step.breaks, step.contact_inputs = bool(len(task.breaks)), acting
    for watch in watches:
        watch.see(step)
