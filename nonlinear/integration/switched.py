"""The equations of one motion in the current phase of its escapements and dry friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from math import ulp
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.generated import Generated, InputFunction, Rate, Written
from nonlinear.integration.switches import INPUT_ASIDE, Switches, switches_of
from nonlinear.system import NO_KICKS, Friction, Kicks, Layout, Load, Motion, State, System

Phase = tuple[list[float], int]
"""The state of switches, and how much had happened when it began."""


@dataclass(eq=False)
class Switched(Written):
    """The equations `free` with switches: a phase lasts until `change`, `contact_inputs` being those in it.

    `met_switch` is the one at which the last step ended, until its change; `look` are the values of all at the present
    y.
    """

    free: Generated
    state: list[float] = field(init=False, default_factory=list)
    contact_inputs: list[float] = field(init=False, default_factory=list)
    met_switch: int | None = field(init=False, default=None)
    look: Any = field(init=False, default=None)
    rests: bool = field(init=False, default=False)
    phase: Phase = field(init=False, default=([], 0))

    @cached_property
    def switches(self) -> Switches:
        """The switches."""
        return switches_of(self.system, has_load=self.free.form.has_load, works=self.free.form.works)

    def release(self, time: float, y: Floats, before: Kicks = NO_KICKS) -> None:
        """Begin at this y, after the kicks `before`."""
        row = y.tolist()
        inputs = self.free.inputs_at(time, row) if self.free.inputs_at else ()
        self.resume(self.switches.begin(time, row, inputs, before))
        rates = self.rate(row, self.inputs_at(time, row)) if self.inputs_at else self.rate(row)
        self.met_switch = self.switches.due(row, rates, self.state)

    def resume(self, state: list[float]) -> None:
        """Continue in this state of a motion that has come to no switch."""
        self.state = state
        self._hold()

    def _hold(self) -> None:
        self.contact_inputs = self.switches.inputs(self.state)
        self.rests = self.switches.rests(self.state)
        self.met_switch = self.look = None
        self.phase = [*self.state], len(self.switches.events)

    def go_back(self, phase: Phase) -> None:
        """Things are as they were in this phase, but for the work of friction on a rail with a coefficient."""
        at, now = self.switches.places, self.state
        self.state = [*phase[0]]
        if at.presses:
            self.state[at.work] = now[at.work]
        del self.switches.events[phase[1] :]
        self._hold()

    @contextmanager
    def undo_on_interrupt(self) -> Iterator[None]:
        """Restore the present state if the block is interrupted."""
        state, count = [*self.state], len(self.switches.events)
        try:
            yield
        except KeyboardInterrupt:
            self.state = state
            del self.switches.events[count:]
            raise

    def change(
        self,
        time: float,
        y: Sequence[float],
        f: Sequence[float],
        V: list[list[float]] | None = None,
        inputs: InputFunction | None = None,
    ) -> list[float]:
        """The y after the switch that was met at y, where y' = f; columns V (k, size) are changed in place.

        Raise ComputationError if friction has none: nothing has changed then.
        """
        columns = [] if V is None else V
        u = inputs(time, y)[: self.switches.places.input_count] if inputs else ()
        met_switch = self.met_switch
        try:
            after, _ = self.switches.change(time, met_switch or 0, y, f, self.state, columns, u)
        except ComputationError:
            self.go_back(self.phase)
            self.met_switch = met_switch
            raise
        self._hold()
        return after  # type: ignore[no-any-return]

    def land(self) -> None:
        """Decide again which contacts stick after a jump of inputs."""
        if self.met_switch is None and self.switches.places.J:
            self.met_switch = self.switches.count

    def values(
        self, time: float, y: Sequence[float], f: Sequence[float], inputs: InputFunction | None, length: float
    ) -> tuple[Any, Any]:
        """The values of all switches and their rates at y, where y' = f, within a step of this length (s)."""
        u: Any = () if inputs is None else inputs(time, y)
        w: list[float] = []
        if inputs and self.free.inputs_at is not None and not self.free.is_time_only:  # not in the texts
            aside, count = max(INPUT_ASIDE * length, ulp(time) / INPUT_ASIDE), self.switches.places.input_count
            times = time - aside, time + aside
            ends = [inputs(at, y)[:count] for at in times]
            w = [(late - early) / (times[1] - times[0]) for early, late in zip(*ends, strict=True)]
        return self.switches.values(y, f, u, self.state, w)

    def add_rail_work(
        self, inside: Callable[[Floats], Floats], spans: Floats, contact_inputs: Sequence[Sequence[float]]
    ) -> None:
        """Count the work of friction on a rail with a coefficient, as `Switches.add_rail_work` does."""
        self.switches.add_rail_work(inside, spans, contact_inputs, self.state, self.free.inputs_beside)

    @property
    def presses(self) -> bool:
        """Whether the friction of the rail has a coefficient."""
        return self.switches.places.presses

    def record(self, time: float, y: Sequence[float]) -> Friction:
        """Return the friction record until this time."""
        return self.switches.friction_record(time, y, self.state)

    # ------------------------------------------------------------------------------------------------- the equations

    @property
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""
        at = self.switches.places
        if not at.J:
            return self.free.rate
        sliding, sticking = self._rates
        return sliding if all(self.state[at.K : at.e]) else sticking

    @cached_property
    def _rates(self) -> tuple[Rate, Rate]:
        """Where all contacts slide, and where any sticks."""
        return self.switches.function("rates"), self.switches.function("sticking")

    @cached_property
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y at once, whether contacts slide or stick."""
        contacts = self.switches.places.J
        return self.switches.function("sticking", "arrays") if contacts else self.free.rate_of_arrays

    @cached_property
    def inputs_at(self) -> InputFunction | None:
        """The inputs u at a time (s) and a state y; None if there are none."""
        time_inputs = self.free.inputs_at
        if not self.switches.places.J:
            return time_inputs
        return (
            (lambda time, y: [*time_inputs(time, y), *self.contact_inputs])
            if time_inputs
            else (lambda time, y: self.contact_inputs)
        )

    def rates_in(self, contact_inputs: Sequence[Sequence[float]]) -> Callable[[Any, Any], Any]:
        """The derivative (size, S) of several states in phases with these inputs of contacts, (S, 2 J)."""
        free, columns = self.free, np.array(contact_inputs).T

        def derivative(times: Any, y: Any) -> Any:
            rates = np.empty_like(y)
            for row, rate in zip(rates, self.rate_of_arrays(y, (*free.inputs_beside(times, y), *columns)), strict=True):
                row[...] = rate
            return rates

        return derivative if len(columns) else free.derivative

    @property
    def is_time_only(self) -> bool:
        """Whether the only input is the time."""
        return self.free.is_time_only and not self.switches.places.J

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The same y: nothing moves where contacts stick."""
        return y, 0.0

    def level(self, y: list[float]) -> None:
        """Take the rounding by which sticking contacts move from y, in place."""
        self.switches.project(y, self.state)

    @property
    def system(self) -> System:
        """The scene as arrays."""
        return self.free.system

    @property
    def load(self) -> Load | None:
        """The external load."""
        return self.free.load

    @property
    def layout(self) -> Layout:
        """The arrangement of y."""
        return self.free.layout

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.free.scale

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        return self.free.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        return self.free.read(rows)
