"""Drive a stepper from beginning to end: samples, events, constraints, progress, and a clean stop on Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from math import isfinite, ulp
from typing import Any, cast

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.report import silent
from modal.types import Floats
from nonlinear.dynamics import Arranged, Recursion
from nonlinear.dynamics.bearing import inverted
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.steppers import Stepper, Sweeper
from nonlinear.integration.switched import Switched
from nonlinear.system import NO_FRICTION, NO_KICKS, Equations, Event, EventRecord, Friction, Kicks, State

BESIDE = 1e-6
"""Fraction of a step before a change of friction within which an event that was found there is the same."""
SILENT, AFTER = 1e-9, 0.02
"""An event's value that starts below this fraction of its value in the first step starts at zero, which is no crossing:
its side is that after this fraction of the time to the first look."""
LAST = 4e-16
"""Of the time: how far before the end of a run is its end, as in lanes."""
SINGULAR = 1.5e-8
"""Share of all masses that a massless cart feels: the root of rounding, where accelerations keep half their digits."""
ASIDE = 0.01
"""Of the time between two looks: at which the slope is seen."""
SHARP, TURNS = 1e-15, 1e-9  # of an interval, to which a root and a turning point are sought
EPSILON = float(np.finfo(float).eps)


@dataclass
class RunRecord:
    """The results of a run so far: y at the sampled times, events, and statistics."""

    times: Floats
    rows: Floats
    filled: int = 0
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
    def reached(self) -> float:
        """The time reached (s)."""
        return float(self.last[0] if self.last else self.times[0])

    def close(self) -> None:
        """Remove samples that were not reached; the last sample is the state where the run stopped."""
        self.times, self.rows = self.times[: self.filled], self.rows[: self.filled]
        if self.stopped and self.last and self.last[0] > self.times[-1]:
            time, row = self.last
            self.times, self.rows = np.append(self.times, time), np.vstack((self.rows, row))

    def keep(self, rows: Floats) -> None:
        """Append the next samples."""
        self.rows[self.filled : self.filled + len(rows)] = rows
        self.filled += len(rows)


@dataclass
class Drive:
    """A stepper, the system it integrates, the sampled times (ascending, the first is the start) and the events.

    `report` is called with the simulated time.
    """

    stepper: Stepper
    equations: Equations
    times: Floats
    events: Sequence[Event] = ()
    report: Callable[[float], object] = silent

    def run(self) -> RunRecord:
        """Advance to the last sampled time, or as far as possible."""
        record = RunRecord(self.times, np.empty((len(self.times), len(self.stepper.y))))
        record.keep(self.stepper.y[None])
        advance = self._far if self._sweeps else self._on
        try:
            while record.filled < len(self.times) and not record.stopped:
                if self._rests:
                    self._rest(record)
                else:
                    advance(record)
                    if self.equations.system.may_turn_singular:
                        self._refuse_singular(record)
        except KeyboardInterrupt:
            record.stopped, record.interrupted = f"interrupted at {record.reached:.9g} s", True
        except ComputationError as error:
            record.stopped, record.failed = str(error), True
        record.friction = self._rubbed(record)
        record.close()
        if isinstance(self.equations, Switched):
            record.kicks = self.equations.switches.kicked()
        return record

    def _refuse_singular(self, record: RunRecord) -> None:
        """ComputationError where the cart feels next to nothing of all masses."""
        system, state = self.equations.system, self._state(self.stepper.y)
        pushes = np.eye(1, system.first + system.n_links)[0]
        with np.errstate(all="ignore"):
            solvers = [(group, Recursion(group)) for group in system.groups]
            answers = inverted(system, solvers, np.append(0.0, state.links), pushes)
        share = 1 / (float(answers[0]) * system.total_mass)
        if not share > SINGULAR:
            words = f"the cart moves as if {share:.0e} of all masses hung from it"
            raise ComputationError(f"the run stopped at {record.reached:.9g} s: {words}")

    @property
    def _rests(self) -> bool:
        """Whether nothing moves any more."""
        return isinstance(self.equations, Switched) and self.equations.rests and not self._sweeps

    @property
    def _at_once(self) -> bool:
        """Whether many y are projected at once."""
        return isinstance(self.equations, Arranged)

    @property
    def _sweeps(self) -> bool:
        return isinstance(self.stepper, Sweeper) and not self.events

    def _rest(self, record: RunRecord) -> None:
        """Everything is at rest for good: the samples that are left are all the same."""
        row = self.equations.project(self.stepper.y)[0]
        record.keep(np.tile(row, (len(self.times) - record.filled, 1)))
        record.last = float(self.times[-1]), row
        self.report(self.times[-1] - self.times[0])

    def _rubbed(self, record: RunRecord) -> Friction:
        """What friction did as far as the run came."""
        time, row = record.last or (float(self.times[0]), self.stepper.y)
        if isinstance(self.equations, Switched):
            return self.equations.record(time, np.asarray(row).tolist())
        return NO_FRICTION

    def _far(self, record: RunRecord) -> None:
        """Many steps in which nothing but samples is needed."""
        whole = self.equations.whole() if isinstance(self.equations, Switched) else nullcontext()
        with np.errstate(all="ignore"), whole:
            stepper = cast("Sweeper", self.stepper)
            swept = stepper.sweep(self.times[record.filled :], self.report is not silent)
        record.drift = stepper.drift
        self._keep(record, *swept)

    def _keep(self, record: RunRecord, rows: Floats, ends: Sequence[Any], steps: int) -> None:
        first = record.filled
        if self.report is silent:
            record.keep(rows)
            record.steps, record.last = record.steps + steps, ends[-1]
            return
        switched = isinstance(self.equations, Switched)
        passed = np.searchsorted(self.times, [time for time, _ in ends], side="right") - first
        for end, count in zip(ends, passed.tolist(), strict=True):
            record.keep(rows[record.filled - first : count])
            record.steps, record.last = record.steps + 1, end
            if not switched:
                self.report(end[0] - self.times[0])
        if switched:
            self.report(record.reached - self.times[0])

    def _on(self, record: RunRecord) -> None:
        """One step and everything that happens within it."""
        before = self.stepper.time
        with np.errstate(all="ignore"):
            self.stepper.step()
        self._within(record, before)

    def _within(self, record: RunRecord, before: float) -> None:
        """Everything that happens within the last step."""
        record.steps += 1
        now, y = self.stepper.time, self.stepper.y
        stop = _first_stop(record, sorted(self._happenings(before, now), key=lambda happening: happening[0].time))
        if stop is not None:
            now, y = stop, self.stepper.exact(stop)
        self._sample(record, now)
        record.last = now, self.equations.project(y)[0]
        if isinstance(self.equations, Switched):
            self._switch(record, before, y)
        else:
            mended, drift = self.equations.project(self.stepper.y)
            record.drift = max(record.drift, drift)
            if drift:
                self.stepper.restart(mended)
        self.report(now - self.times[0])

    def _switch(self, record: RunRecord, before: float, y: Floats) -> None:
        """What happens at y where the last step ended at a switch of its own."""
        stepper, now = cast("FloatStepper", self.stepper), self.stepper.time
        stepper.worked(before, record.reached)
        switched = None if self._ends(record) else stepper.switch()
        if switched is not None:
            known = {event.name for event in record.happenings if event.time > now - BESIDE * (now - before)}
            _first_stop(record, (event for event in self._jumps(now, y, switched) if event[0].name not in known))
            record.last = now, switched

    def _ends(self, record: RunRecord) -> bool:
        """Whether the run ends here: what is due belongs to a run that goes on."""
        return bool(record.stopped) or record.reached >= self.times[-1] - LAST * abs(self.times[-1])

    def _sample(self, record: RunRecord, now: float) -> None:
        """The sampled times up to now; where the step ends on one, the step's own result is used."""
        count = int(np.searchsorted(self.times, now, side="right")) - record.filled
        if count > 0:
            times = self.times[record.filled : record.filled + count]
            rows = self.stepper.inside(times)
            rows[times == self.stepper.time] = self.stepper.y
            project = self.equations.project
            record.keep(project(rows)[0] if self._at_once else np.array([project(row)[0] for row in rows]))

    def _happenings(self, before: float, now: float) -> Iterator[tuple[EventRecord, bool]]:
        if not self.events:
            return
        for event in self.events:
            looks = np.linspace(before, now, event.looks + 1)
            values = [self._value(event, time) for time in looks]
            if before == self.times[0] and abs(values[0]) < SILENT * max(map(abs, values)):
                looks[0] += AFTER * (looks[1] - looks[0])
                values[0] = self._value(event, looks[0])
            widest = max(abs(high - low) for low, high in pairwise(values))
            for (start, low), (end, high) in pairwise(self._looked(event, looks.tolist(), values, widest)):
                if _passes(event, low, high):
                    time = self._refined(event, start, end)
                    yield EventRecord(event.name, time, self._state(self.stepper.exact(time))), event.stop

    def _looked(
        self, event: Event, looks: Sequence[float], values: Sequence[float], widest: float
    ) -> Iterator[tuple[float, float]]:
        """Times and values, with those in between at which the value has passed zero and is about to return."""
        yield looks[0], values[0]
        for (start, low), (end, high) in pairwise(zip(looks, values, strict=True)):
            if low * high > 0 and min(abs(low), abs(high)) < widest:
                yield from self._turn(event, (start, end), (low, high))
            yield end, high

    def _turn(
        self, event: Event, ends: tuple[float, float], values: tuple[float, float]
    ) -> Iterator[tuple[float, float]]:
        """Where between two times a value turns beyond zero, if it approaches zero from either."""
        start, end = ends
        side, aside = np.sign(values[0]), ASIDE * (end - start)

        def height(time: float) -> float:
            return float(side * self._value(event, time))

        if height(start + aside) < abs(values[0]) and height(end - aside) < abs(values[1]):
            time, least = lowest(height, start, end)
            if least < 0:
                yield time, float(side * least)

    def _jumps(self, time: float, before: Floats, after: Floats) -> Iterator[tuple[EventRecord, bool]]:
        """The events triggered by the jump of a kick."""
        for event in self.events:
            if _passes(event, *(event.value(self._state(row)) for row in (before, after))):
                yield EventRecord(event.name, time, self._state(after)), event.stop

    def _refined(self, event: Event, start: float, end: float) -> float:
        """The root on the interpolant, then one secant step with the integrator's own value there."""
        within = partial(self._value, event)
        time = root(within, start, end)
        width = (end - start) / 1000
        slope = (within(time + width) - within(time - width)) / (2 * width)
        moved = time - event.value(self._state(self.stepper.exact(time))) / slope if slope else time
        return moved if start <= moved <= end else time

    def _value(self, event: Event, time: float) -> float:
        value = event.value(self._state(self.stepper.inside(np.array([time]))[0]))
        if not isfinite(value):
            raise ComputationError(f"event {event.name} is {value} at {time:.9g} s")
        return value

    def _state(self, row: Floats) -> State:
        return self.equations.read(row[None])[0]


def root(value: Callable[[float], float], start: float, end: float) -> float:
    """Where a value between two times of either sign is zero, to the last digits of the interval or of the time."""
    close = max(SHARP * (end - start), ulp(max(abs(start), abs(end))))
    return float(scipy.optimize.brentq(value, start, end, xtol=close, rtol=4 * EPSILON))


def lowest(value: Callable[[float], float], start: float, end: float) -> tuple[float, float]:
    """Where a value between two times is lowest, and that value.

    It is sought in parts of the interval: SciPy's own tolerance is 1.5e-8 of what varies, of a late time whole steps.
    """

    def inside(part: float) -> float:
        return value(start + part * (end - start))

    least = scipy.optimize.minimize_scalar(inside, bounds=(0.0, 1.0), method="bounded", options={"xatol": TURNS})
    return float(start + least.x * (end - start)), float(least.fun)


def _passes(event: Event, low: float, high: float) -> bool:
    """Whether an event occurs between these two values."""
    return (low < 0 <= high and event.direction >= 0) or (low > 0 >= high and event.direction <= 0)


def _first_stop(record: RunRecord, events: Iterable[tuple[EventRecord, bool]]) -> float | None:
    """Keep the events up to the first one that stops the run; its time (s)."""
    for happening, stop in events:
        record.happenings.append(happening)
        if stop:
            record.stopped = f"{happening.name} at {happening.time:.9g} s"
            return happening.time
    return None
