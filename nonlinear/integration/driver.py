"""Drive a stepper from beginning to end: samples, events, constraints, progress, and a clean stop on Ctrl-C.

Event detection within the steps of one run.

A coordinate that passes a level is read off the interpolant of y, as in lanes.  Any other function of the state is
looked at, at some points of every step.  Either is found on the interpolant first, then where the integrator says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import isfinite, sqrt, ulp
from sys import float_info
from typing import Any, NamedTuple, cast

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.report import silent
from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics import Arranged, Hamiltonian, Recursion, Reduced
from nonlinear.dynamics.bearing import apply_inverse_mass
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.steppers import BREAK_ULPS, STEPS_AT_ONCE, DOP853Stepper, Stepper, Sweeper
from nonlinear.integration.switches import Switched
from nonlinear.integration.watches import Level, passages
from nonlinear.integration.within import Inside, KnownStep, Step, Watch
from nonlinear.system import (
    NO_FRICTION,
    NO_KICKS,
    CoordinateReading,
    Equations,
    Event,
    EventRecord,
    Friction,
    Kicks,
    State,
)

JUMP_EVENT_SHARE = 1e-6
"""Tolerance: of a step before its end, within which an event that was found is the one that a jump there brings."""
START_SILENCE = 1e-9
"""Tolerance: an event's value that starts below this fraction of its value in the first step starts at zero, which is
no crossing: its side is that a little later."""
LOOK_ASIDE = 0.01
"""Tolerance: of the time between two looks, at which the slope is seen, and the side after a start at zero."""


class Happening(NamedTuple):
    """An event at a time (s): the event, the y of the run and the state, and how the run fails there."""

    time: float
    event: Event
    y: Floats
    state: State
    failure: str = ""


def component_of(equations: Equations, reading: Any) -> tuple[Level, float] | None:
    """The level of a component of y where a value is zero, and ±1 as it rises or falls with that; None for none.

    Momenta, positions of constraints and unit vectors made of angles have no such component.
    """
    inner = equations.inner if isinstance(equations, Reduced) else equations
    if not isinstance(reading, CoordinateReading) or isinstance(inner, Hamiltonian) or not isinstance(inner, Arranged):
        return None
    if inner is equations:
        return Level(reading.row + inner.layout.half * reading.rate, reading.level, turns=False), 1.0
    if equations.system.spatial:
        return None
    size = inner.layout.size
    motion = equations.read(np.vstack((np.zeros(size), np.eye(size))))
    values = np.array([reading(motion[k]) for k in range(size + 1)])
    shares = values[1:] - values[0]
    row = int(np.argmax(np.abs(shares)))
    return Level(row, -float(values[0] / shares[row]), turns=False), float(np.sign(shares[row]))


@dataclass(eq=False)
class Events:
    """A watch of one run: its happenings, of every `event` in steps that begin at the start of the run or later."""

    equations: Equations
    events: Sequence[Event]
    start: float
    happenings: list[Happening] = field(init=False, default_factory=list)
    past: list[Happening] = field(init=False, default_factory=list)

    @cached_property
    def components(self) -> list[tuple[Level, float] | None]:
        """The level of a component of y that every event is, and its sign, where it is one."""
        return [component_of(self.equations, event.value) for event in self.events]

    def see(self, step: Step) -> None:
        """All events within the step."""
        for event, component in zip(self.events, self.components, strict=True):
            self.happenings += self._passages(event, *component, step) if component else self._looked_for(event, step)

    def jump(self, start: float, time: float, y: Floats, after: Floats) -> None:
        """All events by which y changes suddenly at the end of a step that began at this time (s)."""
        window_start = time - JUMP_EVENT_SHARE * (time - start)
        states = self.equations.read(np.array([y, after]))
        for event in self.events:
            is_known = any(
                happening.event is event and window_start < happening.time <= time
                for happening in (*self.past, *self.happenings)
            )
            if not is_known and passes(event, event.value(states[0]), event.value(states[1])):
                self.happenings.append(Happening(time, event, after, states[1]))

    def take(self) -> list[Happening]:
        """Those since they were last taken, in the order of time, up to the first that ends the run."""
        self.past, self.happenings = sorted(self.happenings, key=lambda happening: happening.time), []
        last = next((k for k, happening in enumerate(self.past, 1) if happening.event.stop or happening.failure), None)
        return self.past[:last]

    def _passages(self, event: Event, level: Level, sign: float, step: Step) -> Iterator[Happening]:
        """Where a component passes its level; a start on it is no crossing."""
        if (crossings := passages(step, level)) is None:
            return
        counts = crossings.way * sign * event.direction >= 0
        if step.start[0] == self.start:
            largest = max(abs(float(end[0]) - level.value) for end in step.reach(level.row))
            silent = abs(step.before[level.row, 0] - level.value) < START_SILENCE * largest
            counts &= ~silent | (crossings.time > self.start + LOOK_ASIDE / 4 * step.length[0])
        crossings = crossings.take(counts)
        motion = self.equations.read(crossings.rows)
        for k, time in enumerate(crossings.time.tolist()):
            yield Happening(time, event, crossings.rows[k], motion[k])

    def _looked_for(self, event: Event, step: Step) -> list[Happening]:
        """Where a function of the state that is monitored passes zero."""
        inside, parts, lanes = step.within_all(), np.linspace(0.0, 1.0, event.looks + 1), np.arange(len(step.start))
        values = self._values(event, inside, np.tile(lanes, len(parts)), np.repeat(parts, len(lanes)))
        values = values.reshape(len(parts), -1)
        sought = self._suspect(event, inside, parts, values)
        sought[0] |= step.start[0] == self.start
        roots: list[tuple[int, float, float, float, float]] = []
        failures: list[Happening] = []
        for lane in np.flatnonzero(sought).tolist():
            start, looks, samples = float(step.start[lane]), parts.tolist(), values[:, lane].tolist()
            look = Look(event, self.equations, step, inside.take([lane]), lane)
            try:
                if not all(map(isfinite, samples)):
                    look.refuse(looks, samples)
                if start == self.start and abs(samples[0]) < START_SILENCE * max(map(abs, samples)):
                    looks[0] = LOOK_ASIDE * looks[1]
                    samples[0] = look.value(looks[0])
                roots += [(lane, low, high, *look.locate(low, high)) for low, high in look.passing(looks, samples)]
            except ComputationError as error:
                y = step.before[:, lane]
                failures = [Happening(start, event, y, self.equations.read(y[None])[0], str(error))]
                break
        return [*self._refine(event, step, np.array(roots).reshape(-1, 5).T), *failures]

    def _refine(self, event: Event, step: Step, roots: Floats) -> Iterator[Happening]:
        """Roots on the interpolant, after one secant step with the integrator's own values there.

        Of each: the lane, between which parts and at which it was found, and by how much the value grows a part.
        """
        lanes, (low, high, part, slope) = roots[0].astype(int), roots[1:]
        if len(lanes):
            y, rates = step.ending(lanes, part)
            motion = self.equations.read(y.T)
            values = np.array([float(event.value(motion[k])) for k in range(len(part))])
            new_part = part - values / np.where(slope == 0, np.inf, slope)
            new_part = np.where((low <= new_part) & (new_part <= high), new_part, part)
            rows = (y + (new_part - part) * step.length[lanes] * rates).T
            motion, times = self.equations.read(rows), step.start[lanes] + new_part * step.length[lanes]
            for k, time in enumerate(times.tolist()):
                yield Happening(time, event, rows[k], motion[k])

    def _values(self, event: Event, inside: Inside, lanes: Ints, parts: Floats) -> Floats:
        """The values of an event in these lanes at these parts of the step."""
        motion = self.equations.read(inside.take(lanes).at(parts).T)
        return np.array([float(event.value(motion[k])) for k in range(len(parts))])

    def _suspect(self, event: Event, inside: Inside, parts: Floats, values: Floats) -> Booleans:
        """In which lanes a value passes zero, or may between two looks, as it approaches zero from either."""
        low, high = values[:-1], values[1:]
        crosses = ~(low * high > 0)
        widest = np.abs(high - low).max(0)
        look, lane = np.nonzero(~crosses & (np.minimum(np.abs(low), np.abs(high)) < widest))
        aside = LOOK_ASIDE * parts[1]
        if len(lane):
            side, sides = np.sign(low[look, lane]), [(low, parts[look] + aside), (high, parts[look + 1] - aside)]
            nearer = [side * self._values(event, inside, lane, at) < abs(v[look, lane]) for v, at in sides]
            crosses[look, lane] = nearer[0] & nearer[1]
        return np.asarray(crosses.any(0))


@dataclass(frozen=True, eq=False)
class Look:
    """An event that is monitored in one lane of a step, by its parts."""

    event: Event
    equations: Equations
    step: Step
    inside: Inside
    lane: int

    def value(self, part: float) -> float:
        """The value on the interpolant; raise ComputationError if it is not finite."""
        motion = self.equations.read(self.inside.at(np.array([part])).T)
        value = float(self.event.value(motion[0]))
        if not isfinite(value):
            self.refuse([part], [value])
        return value

    def time(self, part: float) -> float:
        """The time (s) of a part."""
        return float(self.step.start[self.lane] + part * self.step.length[self.lane])

    def refuse(self, parts: Sequence[float], values: Sequence[float]) -> None:
        """ComputationError that names the first of these values that is not finite."""
        part, value = next(pair for pair in zip(parts, values, strict=True) if not isfinite(pair[1]))
        raise ComputationError(f"event {self.event.name} is {value} at {self.time(part):.9g} s")

    def passing(self, parts: Sequence[float], values: Sequence[float]) -> Iterator[tuple[float, float]]:
        """Between which parts the value passes zero, as far as samples show, also there and back between two."""
        widest = max(abs(high - low) for low, high in pairwise(values))
        for (start, low), (end, high) in pairwise(zip(parts, values, strict=True)):
            between = []
            if low * high > 0 and min(abs(low), abs(high)) < widest:
                between = [*self._turn((start, end), (low, high))]
            for one, following in pairwise([(start, low), *between, (end, high)]):
                if passes(self.event, one[1], following[1]):
                    yield one[0], following[0]

    def _turn(self, ends: tuple[float, float], values: tuple[float, float]) -> Iterator[tuple[float, float]]:
        """Where between two parts a value turns beyond zero, if it approaches zero from either."""
        start, end = ends
        side, aside = np.sign(values[0]), LOOK_ASIDE * (end - start)

        def height(part: float) -> float:
            return float(side * self.value(part))

        if height(start + aside) < abs(values[0]) and height(end - aside) < abs(values[1]):
            part, minimum = lowest(height, start, end)
            if minimum < 0:
                yield part, float(side * minimum)

    def locate(self, low: float, high: float) -> tuple[float, float]:
        """The part of the root on the interpolant between two, and by how much the value grows a part there."""
        part, width = root(self.value, low, high), (high - low) / 1000
        return part, (self.value(part + width) - self.value(part - width)) / (2 * width)


def root(value: Callable[[float], float], start: float, end: float) -> float:
    """Where a value between two times of either sign is zero, to the last digits."""
    accuracy = ulp(max(abs(start), abs(end)))
    return float(scipy.optimize.brentq(value, start, end, xtol=accuracy, rtol=4 * float_info.epsilon))


def lowest(value: Callable[[float], float], start: float, end: float) -> tuple[float, float]:
    """Where a value between two times is lowest, and that value.

    It is sought in parts of the interval: SciPy's own tolerance is 1.5e-8 relative, at late times whole steps.
    """

    def inside(part: float) -> float:
        return value(start + part * (end - start))

    minimum = scipy.optimize.minimize_scalar(
        inside, bounds=(0.0, 1.0), method="bounded", options={"xatol": sqrt(float_info.epsilon)}
    )
    return float(start + minimum.x * (end - start)), float(minimum.fun)


def passes(event: Event, low: float, high: float) -> bool:
    """Whether an event occurs between these two values."""
    return (low < 0 <= high and event.direction >= 0) or (low > 0 >= high and event.direction <= 0)


@dataclass
class RunRecord:
    """The results of a run so far: y at the sampled times, events, and statistics."""

    times: Floats
    rows: Floats
    row_count: int = 0
    last: tuple[float, Sequence[float] | Floats] | None = None  # time and y of a stop between samples
    happenings: list[EventRecord] = field(default_factory=list)
    drift: float = 0.0
    kicks: Kicks = NO_KICKS
    friction: Friction = NO_FRICTION
    steps: int = 0
    stopped: str = ""  # the reason, if it did not reach its end
    interrupted: bool = False
    failed: bool = False

    @property
    def last_time(self) -> float:
        """The time reached (s)."""
        return float(self.last[0] if self.last else self.times[0])

    def close(self) -> None:
        """Remove samples that were not reached; the last sample is the state where the run stopped."""
        self.times, self.rows = self.times[: self.row_count], self.rows[: self.row_count]
        if self.stopped and self.last and self.last[0] > self.times[-1]:
            time, row = self.last
            self.times, self.rows = np.append(self.times, time), np.vstack((self.rows, row))

    def keep(self, rows: Floats) -> None:
        """Append the next samples."""
        self.rows[self.row_count : self.row_count + len(rows)] = rows
        self.row_count += len(rows)


@dataclass
class Drive:
    """A stepper, the system it integrates, the sampled times (ascending, the first is the start) and the events.

    `report` is called with the simulated time.  Every step is seen by the `watches`.
    """

    stepper: Stepper
    equations: Equations
    times: Floats
    events: Sequence[Event] = ()
    report: Callable[[float], object] = silent
    watches: Sequence[Watch] = ()

    def __post_init__(self) -> None:
        self._sought = Events(self.equations, self.events, float(self.times[0])) if self.events else None
        ends, has_switches = any(event.stop for event in self.events), isinstance(self.equations, Switched)
        if isinstance(self.stepper, DOP853Stepper):
            self.stepper.keeps_steps = self._has_watches
        # Few steps where progress is reported once a sweep; where an event may end the run, more and more, so that work
        # beyond it is at most what came before.
        self._longest = 4 if has_switches and self.report is not silent else STEPS_AT_ONCE
        self._most = 4 if ends else self._longest

    def run(self) -> RunRecord:
        """Advance to the last sampled time, or as far as possible."""
        record = RunRecord(self.times, np.empty((len(self.times), len(self.stepper.y))))
        record.keep(self.stepper.y[None])
        advance = self._sweep if isinstance(self.stepper, DOP853Stepper if self._has_watches else Sweeper) else self._on
        try:
            while record.row_count < len(self.times) and not record.stopped:
                advance(record)
                if self.equations.system.may_turn_singular:
                    self._refuse_singular(record)
        except KeyboardInterrupt:
            record.stopped, record.interrupted = f"interrupted at {record.last_time:.9g} s", True
        except ComputationError as error:
            record.stopped, record.failed = str(error), True
        if isinstance(self.equations, Switched):
            time, y = record.last or (float(self.times[0]), self.stepper.y)
            switches, state = self.equations.switches, self.equations.state
            record.friction = switches.friction_record(time, np.asarray(y).tolist(), state)
            record.kicks = switches.kicks_so_far()
        record.close()
        return record

    def _refuse_singular(self, record: RunRecord) -> None:
        """Raise ComputationError if the cart's effective mass is negligible."""
        system, state = self.equations.system, self.equations.read(self.stepper.y[None])[0]
        pushes = np.eye(1, system.first + system.n_links)[0]
        with np.errstate(all="ignore"):
            solvers = [(group, Recursion(group)) for group in system.groups]
            answers = apply_inverse_mass(system, solvers, np.append(0.0, state.links), pushes)
        share = 1 / (float(answers[0]) * system.total_mass)
        if not share > sqrt(float_info.epsilon):  # accelerations keep half their digits
            words = f"the cart moves as if {share:.0e} of all masses hung from it"
            raise ComputationError(f"the run stopped at {record.last_time:.9g} s: {words}")

    @property
    def _has_watches(self) -> bool:
        return bool(self.events or self.watches)

    def _sweep(self, record: RunRecord) -> None:
        """Many steps, with events within them, up to an event that ends the run."""
        guard = self.equations.undo_on_interrupt() if isinstance(self.equations, Switched) else nullcontext()
        stepper, all_ends = cast("Sweeper", self.stepper), self.report is not silent or self._has_watches
        with np.errstate(all="ignore"), guard:
            rows, ends, steps = stepper.sweep(self.times[record.row_count :], all_ends, self._most)
            record.drift = stepper.drift
            stop = None
            if steps and self._has_watches:
                stop = self._find_stop(record, cast("DOP853Stepper[Any]", stepper).steps_of_sweep())
        if stop is not None:
            if isinstance(stepper, FloatStepper):
                stepper.take_back(stop.time, stop.y)
            rows = rows[: np.searchsorted(self.times, stop.time, side="right") - record.row_count]
            ends = [end for end in ends if end[0] < stop.time]
            ends, steps = [*ends, (stop.time, self.equations.project(stop.y)[0])], len(ends) + 1
        else:
            self._most = min(2 * self._most, self._longest)
        self._keep(record, rows, ends, steps)
        if self._has_watches and isinstance(self.equations, Switched) and not self._ends(record):
            self._switch(record)

    def _keep(self, record: RunRecord, rows: Floats, ends: Sequence[Any], steps: int) -> None:
        first = record.row_count
        if self.report is silent:
            record.keep(rows)
            record.steps, record.last = record.steps + steps, ends[-1]
            return
        has_switches = isinstance(self.equations, Switched)
        counts = np.searchsorted(self.times, [time for time, _ in ends], side="right") - first
        for end, count in zip(ends, counts.tolist(), strict=True):
            record.keep(rows[record.row_count - first : count])
            record.steps, record.last = record.steps + 1, end
            if not has_switches:
                self.report(end[0] - self.times[0])
        if has_switches:
            self.report(record.last_time - self.times[0])

    def _on(self, record: RunRecord) -> None:
        """One step and everything that happens within it."""
        start = self.stepper.time
        with np.errstate(all="ignore"):
            self.stepper.step()
        self._within(record, start)

    def _within(self, record: RunRecord, start: float) -> None:
        """Everything that happens within the last step."""
        record.steps += 1
        now, y = self.stepper.time, self.stepper.y
        stop = None
        if self._has_watches:
            stop = self._find_stop(record, KnownStep.of(start, now, self.stepper.inside, self.stepper.exact))
        if stop is not None:
            now, y = stop.time, stop.y
        self._sample(record, now)
        record.last = now, self.equations.project(y)[0]
        result, drift = self.equations.project(self.stepper.y)
        record.drift = max(record.drift, drift)
        if drift:
            self.stepper.restart(result)
        self.report(now - self.times[0])

    def _find_stop(self, record: RunRecord, step: Step) -> Happening | None:
        """Keep the events within a step, up to the first one that ends the run."""
        for watch in self.watches:
            watch.see(step)
        if self._sought is None:
            return None
        self._sought.see(step)
        for jump in self.stepper.jumps() if isinstance(self.stepper, FloatStepper) else ():
            self._sought.jump(*jump)
        return self._record_events(record, self._sought.take())

    def _record_events(self, record: RunRecord, happenings: Sequence[Happening]) -> Happening | None:
        """Keep these events; the last where it ends the run."""
        for time, event, _, state, failure in happenings:
            if failure:
                record.stopped, record.failed = failure, True
                break
            record.happenings.append(EventRecord(event.name, time, state))
            if event.stop:
                record.stopped = f"{event.name} at {time:.9g} s"
        return happenings[-1] if record.stopped else None

    def _switch(self, record: RunRecord) -> None:
        """The change at the switch at which the last step ended."""
        stepper = cast("FloatStepper", self.stepper)
        start, now, y = stepper.before, stepper.time, stepper.y
        y_after = stepper.switch()
        if y_after is not None:
            if self._sought:
                self._sought.jump(start, now, y, y_after)
                self._record_events(record, self._sought.take())
            record.last = now, y_after

    def _ends(self, record: RunRecord) -> bool:
        """Whether the run ends here: what is due belongs to a run that continues."""
        return bool(record.stopped) or record.last_time >= self.times[-1] - BREAK_ULPS * ulp(self.times[-1])

    def _sample(self, record: RunRecord, now: float) -> None:
        """The sampled times up to now; where the step ends on one, the step's own result is used."""
        count = int(np.searchsorted(self.times, now, side="right")) - record.row_count
        if count > 0:
            times = self.times[record.row_count : record.row_count + count]
            rows = self.stepper.inside(times)
            rows[times == self.stepper.time] = self.stepper.y
            project, at_once = self.equations.project, isinstance(self.equations, Arranged)
            record.keep(project(rows)[0] if at_once else np.array([project(row)[0] for row in rows]))
