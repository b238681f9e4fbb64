"""Many members with escapements or dry friction at once: their equations, and the events of each.

Columns that are the same motion with imaginary parts: derivatives by numbers and starts, through switches too.

The equations are analytic, so that the imaginary part ε of a number makes ε times the derivative by it in the imaginary
part of the motion, to the last digit [Squire1998].  The real part takes the steps and
meets the switches; where a column would meet one earlier or later by δt = −Im(value)/value', it continues in the flow
before until then and in the flow after from then on: y₊ = G(y₋ + i f₋ δt) − i f₊ δt, which is the saltation matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.forms import module_of, switching_of, with_contacts
from nonlinear.dynamics.generated import Lanes, Rates
from nonlinear.dynamics.inputs import Inputs
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

        values = map(values_of_members, (all_switches.constants, all_switches.numbers))
        return Switches(all_switches.form, all_switches.kicks, *values)

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


@dataclass(frozen=True, eq=False)
class Analytic(Crowd):
    """A crowd in which the `columns` of every member have numbers of their own, (S, 1 + k), with imaginary parts."""

    columns: Numbers

    def at(self, members: Any) -> Some:
        """Those of some members."""
        return _MemberColumns(self, members, self.columns.at(members))


@dataclass(frozen=True, eq=False)
class _MemberColumns(Some):
    """The switches of some members, of which a change is one of all their columns."""

    columns: Numbers

    def inputs(self, state: Floats) -> list[Any]:
        """The inputs of contacts, arrays (S, 1 + k)."""
        switches = Switches(self._member_switches.form, self._member_switches.kicks, (), self.columns.switching)
        return switches.inputs(np.asarray(state)[..., None])

    def change(self, t: float, j: int, y: Any, f: Any, state: Floats) -> Any:
        """The y (size, 1 + k) of one member after switch j, with its state changed in place."""
        member, state_values, derivatives = self.crowd.of(int(self.members)), state.tolist(), np.iscomplexobj(y)
        u, count = self.crowd.inputs.of_time(t), len(member.events)
        start, slope = y[:, 0].real.tolist(), f[:, 0].real.tolist()
        kicks, inputs_before = j < 2 * member.places.K, member.inputs(state.tolist())
        after, imaginary = member.change(
            t, j, start, slope, state_values, y.imag.T.tolist() if derivatives and not kicks else [], u
        )
        if derivatives and kicks:
            columns = self.columns
            numbers = member.form.numbers(columns.entries, columns.constants), columns.switching
            imaginary = imaginary_after_kick(
                member, numbers, j, y, slope, impulses_since(member, count), [*u, *inputs_before], state_values, u
            ).T
        state[:] = state_values
        return np.array(after)[:, None] + (1j * np.reshape(imaginary, y.T.shape).T if derivatives else 0.0)


def impulses_since(switches: Switches, count: int) -> dict[int, float]:
    """The impulses of every joint that was kicked after this many happenings."""
    return {int(kick[1]): kick[2] for kick in switches.events[count:] if kick[1] < switches.places.K}


def imaginary_after_kick(
    switches: Switches,
    numbers: tuple[Sequence[Any], Sequence[Any]],
    j: int,
    y: Any,
    slope: Sequence[float],
    impulses: dict[int, float],
    inputs_before: Sequence[float],
    state: Sequence[float],
    u: Sequence[float],
) -> Floats:
    """The imaginary parts (size, 1 + k) of y after these impulses, of which that of switch j is the first.

    `numbers` are those of the form and of the switches, with imaginary parts; `slope` is y' before, `inputs_before` are
    all inputs then, `state` is that after, u are the inputs without those of contacts.
    """
    at, form, (constants, switching) = switches.places, switches.form, numbers
    kick = switches.module.function("kick", switches.module.constants(constants), "arrays")
    rate = switches.function("sticking" if form.contacts else "rates")
    z, g, first = y, np.array(slope), j % at.K
    for i in [first, *(k for k in impulses if k != first)]:
        side, (below, above) = np.sign(impulses[i]), at.kicks[i]
        gamma = z[below] - (z[above] if above >= 0 else 0.0) - switching[i]
        rise = g[below] - (g[above] if above >= 0 else 0.0)
        late = -np.imag(side * gamma - switching[at.K + i]) / (side * rise)
        pushes = [side * switching[2 * at.K + i] if k == i else 0.0 for k in range(at.K)]
        v = [*[0.0] * at.size, *pushes, *state[at.K : at.state_count], *switching[:-1], *[0.0] * at.input_count]
        z = z + 1j * g[:, None] * late
        z = np.array(np.broadcast_arrays(*kick(z, inputs_before, v), z[0])[:-1])
        g = np.array(rate(z[:, 0].real.tolist(), [*u, *switches.inputs(state)], ()))
        z = z - 1j * g[:, None] * late
    return np.asarray(z.imag)
