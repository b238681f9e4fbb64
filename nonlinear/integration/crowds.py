"""Many members with escapements or dry friction at once: their equations, and the events of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.forms import module_of
from nonlinear.dynamics.generated import Lanes, Rates
from nonlinear.dynamics.inputs import Inputs
from nonlinear.dynamics.switching import switching_of, with_contacts
from nonlinear.dynamics.text import Module
from nonlinear.integration.lanes import LaneTask
from nonlinear.integration.switches import NODES as GAUSS
from nonlinear.integration.switches import WEIGHTS, Switches, kicks_of
from nonlinear.integration.within import Step, align_lanes, fill
from nonlinear.system import Numbers, System


@dataclass(frozen=True, eq=False)
class Crowd:
    """The flow of members with these numbers, whose `switching` entries are those of `Switches`.

    After y `tangent` lanes have a column of derivatives, which kicks change by saltation.
    """

    lanes: Lanes

    @property
    def system(self) -> System:
        """The form of all members."""
        return self.lanes.system

    @property
    def inputs(self) -> Inputs:
        """The inputs that depend on time."""
        return self.lanes.inputs

    @cached_property
    def switches(self) -> Switches:
        """The switches of all members."""
        form, numbers = with_contacts(self.lanes.form), self.lanes.numbers
        pairs, _ = kicks_of(self.system)
        constants = switching_of(form, pairs).constants(form.numbers(numbers.entries, numbers.constants))
        return Switches(form, pairs, constants, numbers.switching)

    @cached_property
    def members(self) -> dict[int, Switches]:
        """Those of every member, by its number, with its outcome."""
        return {}

    def of(self, member: int) -> Switches:
        """The switches of one member."""
        if member not in self.members:
            self.members[member] = self.switches.member(member)
        return self.members[member]

    def begin(self, task: LaneTask) -> LaneTask:
        """The same task with the state of its members, after the kicks that are due at once."""
        y, size, starts = task.initial.copy(), self.lanes.layout.size, task.starts
        motion = y if y.ndim < 3 else y[..., 0].real
        members = zip(starts.tolist(), motion[:size].T.tolist(), strict=True)
        state = np.array(
            [self.of(k).begin(t, column, self.inputs.of_time(t)) for k, (t, column) in enumerate(members)]
        ).T
        slope, contact_inputs = np.empty_like(y), self.at(slice(None)).inputs(state)
        contact_inputs = [values if np.ndim(values) > 1 else align_lanes(values, y) for values in contact_inputs]
        fill(self.rates(task.numbers)(contact_inputs)(y, align_lanes(starts, y)), slope)
        motion_slope = slope if y.ndim < 3 else slope[..., 0].real
        for k, t in enumerate(starts.tolist()):
            due = self.of(k).due(motion[:size, k].tolist(), motion_slope[:size, k].tolist(), state[:, k].tolist())
            if due is not None:
                y[:, k] = self.at(k).change(t, due, y[:, k], slope[:, k], state[:, k])
        return replace(task, lanes=self, initial=y, switches=self, state=state)

    def rates(self, numbers: Numbers) -> Callable[[Any], Rates]:
        """The rates of this many members as these numbers are of, from the inputs of contacts."""
        module, name = self.equations
        constants = module.constants(self.switches.form.numbers(numbers.entries, numbers.constants))
        sticking, sliding = (module.function(text, constants, self.lanes.target) for text in (name, "rates"))

        def rates_in(contact_inputs: Any) -> Rates:
            sticks = any(np.any(stuck) for stuck in contact_inputs[len(contact_inputs) // 2 :])
            rates = sticking if sticks else sliding

            def rates_with_contacts(y: Any, times: Any = 0.0, inputs: Any = None) -> Any:
                return rates(y, (*(self.inputs.beside(times) if inputs is None else inputs), *contact_inputs))

            return rates_with_contacts

        return rates_in

    @cached_property
    def equations(self) -> tuple[Module, str]:
        """The texts in which the rates stand, and their names there."""
        form = self.switches.form
        if self.lanes.tangent:
            return module_of(form, tangent=True), "rates"
        return self.switches.module, "sticking" if form.contacts else "rates"

    def constants(self) -> list[Any]:
        """The values in the text of the rates for these members: numbers and arrays (S,)."""
        numbers = self.lanes.numbers
        return self.equations[0].constants(self.switches.form.numbers(numbers.entries, numbers.constants))

    @property
    def presses(self) -> bool:
        """Whether the friction of the rail has a coefficient."""
        return self.switches.places.presses

    @property
    def count(self) -> int:
        """How many switches there are."""
        return self.switches.count

    def at(self, members: Any) -> Some:
        """The switches of some members."""
        return Some(self, members)

    def work(self, y: Floats, state: Floats) -> Floats:
        """The work (J) of friction of given size on every member until y (size, S) in this state (m, S), (S,)."""
        return np.asarray(sum(self.switches.work(y, state), np.zeros(y.shape[1])))


def switching(task: LaneTask) -> LaneTask:
    """The same task with the switches of its members, where they have any: its flow then is a `Crowd`."""
    if not task.numbers.switching:
        return task
    return Crowd(task.lanes).begin(task)


@dataclass(frozen=True, eq=False)
class Some:
    """The switches of some members of a crowd."""

    crowd: Crowd
    members: Any

    @cached_property
    def _member_switches(self) -> Switches:
        all_switches, members = self.crowd.switches, self.members

        def values_of_members(values: Any) -> list[Any]:
            return [value[members] if np.ndim(value) else value for value in values]

        return Switches(
            all_switches.form,
            all_switches.kicks,
            values_of_members(all_switches.constants),
            values_of_members(all_switches.numbers),
        )

    def inputs(self, state: Floats) -> list[Any]:
        """The inputs of contacts, arrays (S,)."""
        return self._member_switches.inputs(state)

    @cached_property
    def friction(self) -> Rates:
        """The friction τ at every contact, as inputs say."""
        return partial(self._member_switches.function("friction", "arrays"), v=())

    def values(self, u: Any, w: Any, y: Floats, f: Floats, state: Floats) -> tuple[Floats, Floats]:
        """The values (count, S) of all switches and their rates, of inputs of time u with rates w."""
        switches = self._member_switches
        values_and_rates = np.empty((2, switches.count, y.shape[1]))
        all_inputs = (*u, *switches.inputs(state))
        for rows, values in zip(
            values_and_rates, switches.values(y[: self.crowd.lanes.layout.size], f, all_inputs, state, w), strict=True
        ):
            for row, value in zip(rows, values, strict=True):
                row[...] = value
        return values_and_rates[0], values_and_rates[1]

    def change(self, t: float, j: int, y: Floats, f: Floats, state: Floats) -> Any:
        """The y of one member after switch j, with its state changed in place."""
        state_values, switches, u = state.tolist(), self.crowd.of(int(self.members)), self.crowd.inputs.of_time(t)
        size = self.crowd.lanes.layout.size
        columns = [y[size:].tolist()] if len(y) > size else []
        after, columns = switches.change(t, j, y[:size].tolist(), f[:size].tolist(), state_values, columns, u)
        state[:] = state_values
        return [*after, *(value for column in columns for value in column)]


class RailWork:
    """A watch: the `work` (J) of friction on a rail with a coefficient, by Gauss's quadrature within steps, (S,)."""

    def __init__(self, crowd: Crowd, members: int) -> None:
        self.crowd, self.work = crowd, np.zeros(members)

    def see(self, step: Step) -> None:
        """A step of all lanes."""
        at = self.crowd.switches.places
        sliding = np.flatnonzero(step.taken & (step.length > 0) & (np.asarray(step.contact_inputs[at.J]) == 0))
        if not len(sliding):
            return
        inside, members, length = step.within(sliding), step.member[sliding], step.length[sliding]
        friction = self.crowd.at(members).friction
        contact_inputs = [np.broadcast_to(values, step.length.shape)[sliding] for values in step.contact_inputs]
        for node, weight in zip(GAUSS, WEIGHTS, strict=True):
            part = np.full(len(sliding), (1 + node) / 2)
            y = inside.motion.at(part)
            force = friction(y, (*self.crowd.inputs.beside(step.start[sliding] + part * length), *contact_inputs))[0]
            np.add.at(self.work, members, length / 2 * weight * force * y[at.half])
