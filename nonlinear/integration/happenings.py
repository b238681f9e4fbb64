"""What happens within the steps of one run: its events, found as everything is that is seen in steps.

A coordinate that passes a level is read off the interpolant of y, as in lanes.  Any other function of the state is
looked at, at some points of every step.  Either is found on the interpolant first, then where the integrator says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import isfinite, ulp
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import Arranged, Hamiltonian, Reduced, SpatialHamiltonian
from nonlinear.integration.passages import Level, passages
from nonlinear.integration.switched import Switched
from nonlinear.integration.within import Inside, Step
from nonlinear.system import CoordinateReading, Equations, Event, State

SILENT, AFTER = 1e-9, 0.02
"""An event's value that starts below this fraction of its value in the first step starts at zero, which is no crossing:
its side is that after this fraction of the time to the first look."""
ASIDE = 0.01
"""Of the time between two looks: at which the slope is seen."""
SHARP, TURNS = 1e-15, 1e-9  # of an interval, to which a root and a turning point are sought
EPSILON = float(np.finfo(float).eps)


class Happening(NamedTuple):
    """What happens at a time (s): the event, the y of the run and the state, and how the run fails there."""

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
    if not isinstance(reading, CoordinateReading) or isinstance(inner, Hamiltonian | SpatialHamiltonian):
        return None
    if not isinstance(inner, Arranged | Switched):
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

    @cached_property
    def components(self) -> list[tuple[Level, float] | None]:
        """The level of a component of y that every event is, and its sign, where it is one."""
        readings = (event.value for event in self.events)
        return [
            component_of(self.equations, each) if isinstance(each, CoordinateReading) else None for each in readings
        ]

    def see(self, step: Step) -> None:
        """All events within the step."""
        for event, component in zip(self.events, self.components, strict=True):
            self.happenings += self._passed(event, *component, step) if component else self._looked_for(event, step)

    def taken(self) -> list[Happening]:
        """Those since they were last taken, in the order of time, up to the first that ends the run."""
        inorder = sorted(self.happenings, key=lambda happening: happening.time)
        self.happenings = []
        last = next((k for k, each in enumerate(inorder, 1) if each.event.stop or each.failure), None)
        return inorder[:last]

    def _passed(self, event: Event, level: Level, sign: float, step: Step) -> Iterator[Happening]:
        """Where a component passes its level; what is seen of a start on it is no crossing."""
        if (passed := passages(step, level)) is None:
            return
        counts = passed.way * sign * event.direction >= 0
        if step.start[0] == self.start:
            most = max(abs(float(end[0]) - level.value) for end in step.reach(level.row))
            silent = abs(step.before[level.row, 0] - level.value) < SILENT * most
            counts &= ~silent | (passed.time > self.start + AFTER / 4 * step.length[0])
        passed = passed.take(counts)
        motion = self.equations.read(passed.rows)
        for k, time in enumerate(passed.time.tolist()):
            yield Happening(time, event, passed.rows[k], motion[k])

    def _looked_for(self, event: Event, step: Step) -> Iterator[Happening]:
        """Where a function of the state that is looked at passes zero."""
        parts = np.linspace(0.0, 1.0, event.looks + 1)
        inside = step.within_all()
        rows = np.array([inside.at(np.full(len(step.start), part)) for part in parts])  # (looks, size, W)
        motion = self.equations.read(np.moveaxis(rows, 1, 2).reshape(-1, rows.shape[1]))
        values = np.reshape([float(event.value(motion[k])) for k in range(len(motion.cart))], (len(parts), -1))
        for lane, start in enumerate(step.start.tolist()):
            one = Look(event, self.equations, step, inside.take([lane]), lane)
            looks, seen = parts.tolist(), values[:, lane].tolist()
            try:
                if not all(map(isfinite, seen)):
                    one.refuse(looks, seen)
                if start == self.start and abs(seen[0]) < SILENT * max(map(abs, seen)):
                    looks[0] = AFTER * looks[1]
                    seen[0] = one.value(looks[0])
                for low, high in one.passing(looks, seen):
                    yield one.refined(low, high)
            except ComputationError as error:
                yield Happening(start, event, step.before[:, lane], motion[lane], str(error))
                return


@dataclass(frozen=True, eq=False)
class Look:
    """An event that is looked at in one lane of a step, by its parts."""

    event: Event
    equations: Equations
    step: Step
    inside: Inside
    lane: int

    def value(self, part: float) -> float:
        """The value on the interpolant; ComputationError where it is not finite."""
        value = self.of(self.inside.at(np.array([part]))[:, 0])
        if not isfinite(value):
            self.refuse([part], [value])
        return value

    def of(self, y: Floats) -> float:
        """The value at y."""
        return float(self.event.value(self.equations.read(y[None])[0]))

    def time(self, part: float) -> float:
        """The time (s) of a part."""
        return float(self.step.start[self.lane] + part * self.step.length[self.lane])

    def refuse(self, parts: Sequence[float], values: Sequence[float]) -> None:
        """ComputationError that names the first of these values that is not finite."""
        part, value = next(each for each in zip(parts, values, strict=True) if not isfinite(each[1]))
        raise ComputationError(f"event {self.event.name} is {value} at {self.time(part):.9g} s")

    def passing(self, parts: Sequence[float], values: Sequence[float]) -> Iterator[tuple[float, float]]:
        """Between which parts the value passes zero, as far as looks tell, also there and back between two."""
        widest = max(abs(high - low) for low, high in pairwise(values))
        for (start, low), (end, high) in pairwise(zip(parts, values, strict=True)):
            between = []
            if low * high > 0 and min(abs(low), abs(high)) < widest:
                between = [*self._turn((start, end), (low, high))]
            for one, other in pairwise([(start, low), *between, (end, high)]):
                if passes(self.event, one[1], other[1]):
                    yield one[0], other[0]

    def _turn(self, ends: tuple[float, float], values: tuple[float, float]) -> Iterator[tuple[float, float]]:
        """Where between two parts a value turns beyond zero, if it approaches zero from either."""
        start, end = ends
        side, aside = np.sign(values[0]), ASIDE * (end - start)

        def height(part: float) -> float:
            return float(side * self.value(part))

        if height(start + aside) < abs(values[0]) and height(end - aside) < abs(values[1]):
            part, least = lowest(height, start, end)
            if least < 0:
                yield part, float(side * least)

    def refined(self, low: float, high: float) -> Happening:
        """The root on the interpolant, then one secant step with the integrator's own value there."""
        part = root(self.value, low, high)
        y, width = self._ending(part), (high - low) / 1000
        slope = (self.value(part + width) - self.value(part - width)) / (2 * width)
        moved = part - self.of(y) / slope if slope else part
        if low <= moved <= high and moved != part:
            part, y = moved, self._ending(moved)
        return Happening(self.time(part), self.event, y, self.equations.read(y[None])[0])

    def _ending(self, part: float) -> Floats:
        """The y at a part, integrated anew."""
        return self.step.ending(np.array([self.lane]), np.array([part]))[0][:, 0]


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


def passes(event: Event, low: float, high: float) -> bool:
    """Whether an event occurs between these two values."""
    return (low < 0 <= high and event.direction >= 0) or (low > 0 >= high and event.direction <= 0)
