"""The engine of Taylor series by heyoka (extra `taylor`), several members at a time in vector registers.

The numbers of a scene, and what follows from them alone, are parameters: one compiled series serves all members and
all scenes of the same form.  What happens within steps is found by heyoka's own events.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, floor, inf, log10, pi
from typing import Any

import numpy as np

from modal.types import Floats, Ints
from nonlinear.chaos import TRANSIENT
from nonlinear.dynamics import Lanes
from nonlinear.dynamics.inputs import at_time
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.lanes import slope_of, stretched, task_of
from nonlinear.ensembles.results import MemberResults, Wanted, merged
from nonlinear.integration import taylor
from nonlinear.integration.lanes import LaneTask
from nonlinear.integration.passages import Level, Passages, counted, level_of, starts_of
from nonlinear.integration.readiness import Code, made
from nonlinear.integration.watches import ROUNDING, UNKNOWN
from nonlinear.system import Layout, Numbers

SEEN = frozenset({"first_turn", "largest_angle", "section"})  # measures that are found within steps
PLACES = 0.12  # places a radian of the fastest motion from which the growth of errors is seen
SHARED = 0.7  # of the speed of the lightest link if it had all the energy: what is reckoned with
SEGMENT = 20.0  # radians of it after which a tangent vector is brought back to length 1
AT_ONCE = 1024  # members between whose places in memory no time is lost
STEP, STEPS = 0.7, 3  # radians of it in a step of the estimate, and steps of lanes in NumPy in that time
FIRST_FEW = 3  # passages of the top, of which the first that counts is one
FAR = 100.0  # in y, up to which a series is accurate enough
FINEST, SPARED = 1e-5, 1e-2  # sizes of motions: the smallest that is told, and the largest that needs a finer series


@dataclass(eq=False)
class Events:
    """What heyoka finds within steps of members from y on, with y' (size, S).

    `first` is the member in the first lane, `count` how many lanes matter.
    """

    layout: Layout
    begun: Floats
    slope: Floats
    largest: Floats = field(init=False)
    passed: dict[Level, list[tuple[int, float, Floats, float, float]]] = field(default_factory=dict)
    first: int = 0
    count: int = 0

    def __post_init__(self) -> None:
        self.largest = np.zeros(self.begun.shape[1])

    def top(self, link: int) -> Level:
        """Over which a link turns."""
        return Level(self.layout.first + link, pi, turns=True)

    def widest(self, link: int) -> Callable[..., None]:
        """For links that turn back."""
        row = self.layout.first + link

        def seen(integrator: Any, time: float, sign: int, lane: int) -> None:
            if lane < self.count:
                member, angle = self.first + lane, abs(float(_at(integrator, time, lane)[row]))
                self.largest[member] = max(self.largest[member], angle)

        return seen

    def passing(self, level: Level, most: float = inf) -> Callable[..., None]:
        """For a level, of which each member's first so many passages are kept."""
        passages, kept = self.passed.setdefault(level, []), np.zeros(self.begun.shape[1])

        def seen(integrator: Any, time: float, sign: int, lane: int) -> None:
            if lane < self.count and kept[member := self.first + lane] < most:
                y = _at(integrator, time, lane)
                number = float(level.number(y[level.row]))
                kept[member] += 1
                passages.append((member, time, y, number, -sign if level.turns and number % 2 else sign))

        return seen

    def passages(self, level: Level, direction: int = 0) -> Passages:
        """The passages that count, member by member in the order of time."""
        passages = self.passed[level]
        members = np.array([passage[0] for passage in passages], dtype=np.int64)
        rows = np.array([passage[2] for passage in passages]).reshape(len(passages), self.layout.size)
        time, number, way = (np.array([passage[k] for passage in passages], dtype=float) for k in (1, 3, 4))
        starts = starts_of(level, self.layout, self.begun, self.slope)
        return counted(Passages(members, time, rows, number, way), starts, self.begun, direction)

    @property
    def turns(self) -> Floats:
        """The times (s) at which links first go over the top, (L, S), inf where they never do."""
        times = np.full((self.layout.links, self.begun.shape[1]), inf)
        for link, earliest in enumerate(times):
            passages = self.passages(self.top(link))
            np.minimum.at(earliest, passages.member, passages.time)
        return times


def _at(integrator: Any, time: float, lane: int) -> Floats:
    """The y of a lane at a time within the last step."""
    times = np.array(integrator.time)
    times[lane] = time
    return np.array(integrator.update_d_output(times)[:, lane])


def run(numbers: Numbers, y: Floats, wanted: Wanted) -> MemberResults:
    """Members with these numbers from y (size, S) on; MissingExtraError without heyoka.

    Small motions, and those of links that have turned often, need finer series than the others, which then go by
    themselves.
    """
    task, _, local = task_of(Lanes(numbers), numbers, y, wanted)
    fine = _fineness(task, local, y) < 1
    if not 0 < np.count_nonzero(fine) < len(fine):
        return _run(numbers, y, wanted)
    groups = [np.flatnonzero(some) for some in (~fine, fine)]
    return merged([(some, _run(numbers.at(some), np.ascontiguousarray(y[:, some]), wanted)) for some in groups])


def _fineness(task: LaneTask, local: Floats, y: Floats) -> Floats:
    """What to take the tolerance of a series times, (S,): it is relative to the largest number in y (size, S)."""
    size, far = local / task.relative, np.abs(y).max(0)
    return np.asarray(np.minimum(np.maximum(size, FINEST) / SPARED, 1.0) * np.minimum(FAR / np.maximum(far, FAR), 1.0))


def _run(numbers: Numbers, y: Floats, wanted: Wanted) -> MemberResults:
    lanes = Lanes(numbers)
    task, scale, local = task_of(lanes, numbers, y, wanted)
    events = Events(lanes.layout, y, slope_of(lanes, numbers, y))
    pace = max(_pace(numbers, lanes.layout, y), pi / task.longest)
    places = np.linspace(0.0, wanted.duration, max(1, ceil(PLACES * wanted.duration * pace)) + 1)
    grid = np.unique(np.concatenate((places, wanted.times)))
    seen, kept = np.searchsorted(grid, places), np.searchsorted(grid, wanted.times)
    tolerance = wanted.tolerance * 10.0 ** floor(log10(np.min(_fineness(task, local, y), initial=1.0)))
    spared = max(tolerance, taylor.TIGHTEST) / (wanted.tolerance * FAR)
    judge = Judge(numbers, lanes.layout, scale, local, spared)
    results = MemberResults(np.empty_like(y), np.zeros(y.shape[1]), np.full(y.shape[1], inf))
    if wanted.times:
        results.rows = np.empty((y.shape[1], len(wanted.times), len(y)))
    integrator = _integrator(task, tolerance, events, wanted)
    for first in range(0, y.shape[1], AT_ONCE):
        members = slice(first, min(first + AT_ONCE, y.shape[1]))
        rows = _propagated(integrator, task, members, grid, events, results)
        results.y[:, members] = rows[-1]
        if results.rows is not None:
            results.rows[members] = rows[kept].transpose(2, 0, 1)
        judge.see(members, places, rows[seen], pace, results)
    if wanted.first_turns:
        results.first_turns = events.turns
    if wanted.largest:
        half, start = lanes.layout.half, lanes.layout.first
        results.largest = np.max(
            [np.abs(members[start:half]).max(0) for members in (y, results.y)] + [events.largest], axis=0
        )
    if wanted.section:
        section = wanted.section
        results.crossed = events.passages(level_of(lanes.layout, section.row, section.level), section.direction)[:3]
    if wanted.stretching:
        results.stretching = _stretching(numbers, y[: 2 * lanes.layout.half], wanted)
    return results


def series_of(lanes: Lanes, tolerance: float, seen: Set[str] = frozenset()) -> Code:
    """What is compiled for members of this form of which such is SEEN on the way, and how far it is."""
    kind = f"side by side {'tangent' if lanes.tangent else sorted(seen)}"
    return taylor.code_of(lanes.form, taylor.pieces_of(lanes), tolerance, kind)


def _pace(numbers: Numbers, layout: Layout, y: Floats) -> float:
    """The pace of the fastest motion (rad/s)."""
    accounts = Accounts(numbers, layout)
    energy = accounts.energies(y, accounts.coasting(y)).total - accounts.lowest
    groups = numbers.arrays.groups
    lightest = min(float(np.min(group.block.inertia + group.block.mass * group.block.centre**2)) for group in groups)
    return max(_swing(numbers), SHARED * float(np.sqrt(2 * np.median(energy).clip(0) / lightest)))


def _swing(numbers: Numbers) -> float:
    """The fastest swing of any member (rad/s), as guessed from its shortest link."""
    system = numbers.arrays
    shortest = np.min([group.block.length.min((0, 1)) for group in system.groups], axis=0)
    return float(np.sqrt(4 * np.max(np.atleast_1d(system.gravity) / shortest)))


def _integrator(task: LaneTask, tolerance: float, events: Events | None, wanted: Wanted) -> Any:
    """For so many members as fit into a register, with what is to be seen on the way."""
    layout = task.lanes.layout
    seen: list[tuple[str, int, float, Any]] = []
    if events is not None:
        start, half = layout.first, layout.half
        if wanted.first_turns:
            tops = [events.top(link) for link in range(layout.links)]
            seen += [("sin", top.row, top.value, events.passing(top, FIRST_FEW)) for top in tops]
        if wanted.largest:
            seen += [("rest", half + start + link, 0.0, events.widest(link)) for link in range(layout.links)]
        if section := wanted.section:
            level = level_of(layout, section.row, section.level)
            seen.append(("sin" if level.turns else "level", level.row, level.value, events.passing(level)))
    lanes, pieces = task.lanes, taylor.pieces_of(task.lanes)
    integrator = taylor.batch_integrator(lanes.module, lanes.size, tolerance, seen, pieces)
    kinds = {"first_turn": wanted.first_turns, "largest_angle": wanted.largest, "section": wanted.section}
    made(series_of(lanes, tolerance, {name for name in SEEN if kinds[name]}))
    return integrator


def _propagated(
    integrator: Any, task: LaneTask, some: slice, grid: Floats, events: Events | None, results: MemberResults
) -> Floats:
    """The y (K, size, members) of some members at the times of a grid, whose first is the start."""
    members = np.arange(some.start, some.stop)
    width = integrator.state.shape[1]
    rows = np.empty((len(grid), len(task.begun), len(members)))
    numbers = task.lanes.constants(task.numbers.at(members))
    constants = np.array([np.broadcast_to(x, len(members)) for x in numbers]).reshape(len(numbers), len(members))
    stretches, pieces = [*_stretches(grid, np.array(task.lanes.inputs.breaks()))], taylor.pieces_of(task.lanes)
    for at in range(0, len(members), width):
        taken = np.minimum(np.arange(at, at + width), len(members) - 1)
        count = min(width, len(members) - at)
        if events is not None:
            events.first, events.count = int(members[at]), count
        integrator.set_time(float(grid[0]))
        integrator.state[:] = task.begun[:, members[taken]]
        integrator.pars[: len(numbers)] = constants[:, taken]
        for times, inside, kept in stretches:
            integrator.pars[len(numbers) :] = np.array(at_time(pieces, (times[0] + times[-1]) / 2))[:, None]
            found_rows = integrator.propagate_grid(np.repeat(times[:, None], width, axis=1))[1]
            rows[inside, :, at : at + count] = found_rows[kept, :, :count]
    for lane in np.flatnonzero(~np.isfinite(rows[-1]).all(0)):
        known = int(np.isfinite(rows[..., lane]).all(1).sum())
        results.reasons[int(members[lane])] = (
            f"taylor stopped after {grid[max(known - 1, 0)]:.9g} s: its series overflow"
        )
    return rows


def _stretches(grid: Floats, breaks: Floats) -> Iterator[tuple[Floats, Ints, Ints]]:
    """Between two breaks each: the times of a grid and its ends (s), which of the grid they are, and where they are."""
    edges = [grid[0], *breaks[(breaks > grid[0]) & (breaks < grid[-1])], grid[-1]]
    for low, high in pairwise(edges):
        inside = np.flatnonzero((grid >= low) & (grid <= high))
        times = np.unique(np.concatenate(([low], grid[inside], [high])))
        yield times, inside, np.searchsorted(times, grid[inside])


class Judge:
    """Estimates errors and horizons as `nonlinear.integration.watches.Growth` does, from places of a grid.

    From each place y and a tangent vector go on together by the classical Runge-Kutta method, with compiled rates,
    until the next place, where y is known again.  Errors in a step are `local`, times `spared` |y| where that is more.
    """

    def __init__(self, numbers: Numbers, layout: Layout, scale: Floats, local: Floats, spared: float) -> None:
        lanes = Lanes(numbers, tangent=True)
        self.size, self.scale, self.local = 2 * layout.half, scale[: 2 * layout.half], local
        self.spared, self.angles = spared, slice(layout.first, layout.half)
        self.constants = lanes.constants(numbers)
        self.pieces, self.timed = taylor.pieces_of(lanes), lanes.inputs.count > 0
        self.rates = taylor.evaluator(lanes.module, lanes.size, self.pieces)

    def see(self, some: slice, grid: Floats, rows: Floats, pace: float, results: MemberResults) -> None:
        """Members with y (K, size, S) at evenly spaced times (s), of a motion of this pace (rad/s)."""
        size, members = self.size, rows.shape[2]
        scale = self.scale if self.scale.shape[1] == 1 else self.scale[:, some]
        numbers = np.array([np.broadcast_to(x[some] if np.ndim(x) else x, members) for x in self.constants])
        varying = np.zeros((len(at_time(self.pieces, 0.0)), members))
        numbers = np.concatenate((numbers.reshape(len(self.constants), members), varying))
        steps = max(1, ceil((grid[1] - grid[0]) * pace / STEP))
        step = (grid[1] - grid[0]) / steps
        both, tried = np.empty((2, 2 * size, members))
        slopes = np.empty((4, 2 * size, members))
        both[size:] = scale * size**-0.5
        error, horizon = np.zeros(members), np.full(members, inf)
        with np.errstate(all="ignore"):
            for k in range(1, len(grid)):
                both[:size] = rows[k - 1, :size]
                for part in range(steps):
                    self._go(grid[k - 1] + part * step, step, both, tried, slopes, numbers)
                v = both[size:]
                grown = np.sqrt(np.sum((v / scale) ** 2, axis=0))
                v /= grown
                far = np.abs(rows[k, self.angles]).max(0)
                erring = np.maximum(self.local[some] * np.maximum(1.0, self.spared * far), ROUNDING * far)
                error = error * grown + steps * STEPS * erring
                horizon = np.where((error > UNKNOWN) & (horizon == inf), grid[k], horizon)
        results.error[some], results.horizon[some] = error, horizon

    def _rates(self, time: float, both: Floats, slope: Floats, numbers: Floats) -> None:
        if self.pieces:
            numbers[len(self.constants) :] = np.array(at_time(self.pieces, time))[:, None]
        more = {"time": np.full(both.shape[1], time)} if self.timed else {}
        self.rates(inputs=both, outputs=slope, pars=numbers, **more)

    def _go(self, time: float, step: float, both: Floats, tried: Floats, slopes: Floats, numbers: Floats) -> None:
        """One step of y and v together, in place."""
        self._rates(time, both, slopes[0], numbers)
        for stage, part in ((1, step / 2), (2, step / 2), (3, step)):
            np.multiply(slopes[stage - 1], part, out=tried)
            tried += both
            self._rates(time + part, tried, slopes[stage], numbers)
        slopes[1] += slopes[2]
        slopes[1] *= 2
        slopes[0] += slopes[1]
        slopes[0] += slopes[3]
        slopes[0] *= step / 6
        both += slopes[0]


def _stretching(numbers: Numbers, y: Floats, wanted: Wanted) -> Floats:
    """What ln |v| gains after the transient, as `nonlinear.ensembles.lanes.stretching` has it."""
    task, scale = stretched(numbers, y, wanted)
    integrator = _integrator(task, wanted.tolerance, None, wanted)
    half, members = len(y), y.shape[1]
    pieces = max(1, ceil(TRANSIENT * wanted.duration * _swing(numbers) / SEGMENT))
    whole = round(pieces * (1 + TRANSIENT) / TRANSIENT)
    grid = np.linspace(0.0, task.end, whole + 1)
    results = MemberResults(np.empty_like(task.begun), np.zeros(members), np.zeros(members))
    gained = np.zeros(members)
    for first in range(0, members, AT_ONCE):
        some = slice(first, min(first + AT_ONCE, members))
        units = scale[:, some] if scale.shape[1] > 1 else scale
        for k in range(whole):
            rows = _propagated(integrator, task, some, grid[k : k + 2], None, results)
            length = np.sqrt(np.sum((rows[-1, half:] / units) ** 2, axis=0))
            gained[some] += np.log(length) * (k >= pieces)
            task.begun[:half, some], task.begun[half:, some] = rows[-1, :half], rows[-1, half:] / length
    gained[[*results.reasons]] = np.nan
    return gained
