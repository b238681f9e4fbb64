"""Drive a stepper from beginning to end: samples, events, constraints, progress, and a clean stop on Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from math import sqrt, ulp
from sys import float_info
from typing import Any, cast

import numpy as np

from modal.errors import ComputationError
from modal.report import silent
from modal.types import Floats
from nonlinear.dynamics import Arranged, Recursion
from nonlinear.dynamics.bearing import apply_inverse_mass
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.happenings import Events, Happening
from nonlinear.integration.steppers import BREAK_ULPS, STEPS_AT_ONCE, DOP853Stepper, Stepper, Sweeper
from nonlinear.integration.switched import Switched
from nonlinear.integration.within import KnownStep, Step, Watch
from nonlinear.system import NO_FRICTION, NO_KICKS, Equations, Event, EventRecord, Friction, Kicks


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
        record.friction = self._friction(record)
        record.close()
        if isinstance(self.equations, Switched):
            record.kicks = self.equations.switches.kicks_so_far()
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

    def _friction(self, record: RunRecord) -> Friction:
        """The phases of friction as far as the run came."""
        time, row = record.last or (float(self.times[0]), self.stepper.y)
        if isinstance(self.equations, Switched):
            return self.equations.record(time, np.asarray(row).tolist())
        return NO_FRICTION

    def _sweep(self, record: RunRecord) -> None:
        """Many steps, with events within them, up to an event that ends the run."""
        guard = self.equations.undo_on_interrupt() if isinstance(self.equations, Switched) else nullcontext()
        stepper, all_ends = cast("Sweeper", self.stepper), self.report is not silent or self._has_watches
        with np.errstate(all="ignore"), guard:
            rows, ends, steps = stepper.sweep(self.times[record.row_count :], all_ends, self._most)
            record.drift = stepper.drift
            stop = (
                self._find_stop(record, cast("DOP853Stepper[Any]", stepper).steps_of_sweep())
                if steps and self._has_watches
                else None
            )
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
