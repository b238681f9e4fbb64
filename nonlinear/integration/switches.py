"""Events of escapements and dry friction, for one motion or many members at once.

The equations of one motion in the current phase of its escapements and dry friction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import nan, ulp
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.contacts import JAMMED, contacts_of, escaping, jams
from nonlinear.dynamics.forms import Form, Pairs, form_of, joint_value, switching_of, with_contacts
from nonlinear.dynamics.generated import Generated, InputFunction, Rate, Written
from nonlinear.dynamics.inputs import Inputs
from nonlinear.dynamics.minimal import Arranged
from nonlinear.dynamics.text import Function, Module, function_in
from nonlinear.integration.changes import TEXTS, Places, changing, compiled_source
from nonlinear.system import NO_KICKS, Friction, Kicks, Load, System

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
INPUT_ASIDE = 1e-3
"""Tolerance: of a step, on either side of which inputs that texts do not know are seen for their rates at switches."""
Happening = tuple[float, float, float, float]


@dataclass(eq=False)
class Switches:
    """The switches of motions with a form: `constants` of its texts and `numbers` of a member, or arrays of these.

    `numbers` are bent, angle (rad) and impulse (N m s) of each kicked joint, the limit of each contact (of a rail with
    a coefficient the coefficient), then √(g/l) (rad/s); those of ensembles are arrays (g, S).
    """

    form: Form
    kicks: Pairs
    constants: Sequence[Any]
    numbers: Sequence[Any]
    events: list[Happening] = field(default_factory=list)

    @cached_property
    def places(self) -> Places:
        """Where numbers stand."""
        form, width = self.form, 3 if self.form.spatial else 1
        half = form.first + width * form.system.n_links
        contacts = 2 * len(form.contacts)
        input_count = self.module.sizes.get("u", 0) - contacts
        size = 2 * half + form.works
        return Places(size, half, len(self.kicks), contacts // 2, self.kicks, form.contacts, form.presses, input_count)

    @cached_property
    def module(self) -> Module:
        """The texts."""
        return switching_of(self.form, self.kicks)

    def member(self, k: int) -> Switches:
        """Those of one of many members."""

        def of(values: Sequence[Any]) -> list[float]:
            return [float(value[k]) if np.ndim(value) else float(value) for value in values]

        return replace(self, constants=of(self.constants), numbers=of(self.numbers), events=[])

    def function(self, name: str, target: str = "floats") -> Function:
        """A function (y, u, v) of `switching_of`."""
        return self.module.function(name, self.constants, target)

    # ------------------------------------------------------------------------------------------------- of one motion

    def begin(self, t: float, y: Sequence[float], u: Sequence[float] = (), before: Kicks = NO_KICKS) -> list[float]:
        """The state of a segment that begins at y, after the kicks `before`; u are the inputs without contacts'.

        A joint that starts beyond its angle, or that was kicked before, has already had the kick on that side.
        """
        at, first = self.places, self.form.first
        state, impulses = [0.0] * at.length, dict(zip(before.link.tolist(), before.impulse.tolist(), strict=True))
        last = [float(impulses.get(pair[0] - first, 0.0)) for pair in self.kicks]
        self._changing[0](t, [*map(float, y)], last, state, [*self.numbers], self.constants, [*u], self.events)
        self._refuse(state)
        return state

    def due(self, y: Sequence[float], f: Sequence[float], state: Sequence[float]) -> int | None:
        """The kick due at once where a motion begins at y with y' = f, at its angle on the way out; None without."""
        kick = self._changing[1](y, f, state, self.numbers)
        return None if kick < 0 else int(kick)

    def inputs(self, state: Any) -> list[Any]:
        """The inputs u of contacts, after those of time and load: floats, or arrays where the state has them."""
        at = self.places
        signs, limits = state[at.K : at.K + at.J], self.numbers[3 * at.K : 3 * at.K + at.J]
        forces = [-s * M for s, M in zip(signs, limits, strict=True)]
        if at.presses:
            forces[0] = forces[0] * state[at.e]
        return forces + [1.0 - s * s for s in signs]

    def values(self, y: Any, f: Any, u: Any, state: Any, w: Sequence[Any] = ()) -> tuple[Any, Any]:
        """The values V of all switches and their rates R: lists of floats, or of arrays.

        `f` is y', `u` the inputs with those of contacts, `w` the rates of the inputs before these, by default 0 but
        for a time (1).
        """
        arrays, at = isinstance(y, np.ndarray) and y.ndim > 1, self.places
        if not len(w):
            w = [float(self.form.system.is_analytic and at.input_count == 1)] * at.input_count
        signs = state[at.K : at.e]
        slides = not at.presses and (bool(np.all(signs)) if arrays else all(signs))
        v = [*f[: at.size], *state[: at.state_count], *self.numbers[:-1], *w]
        count = self.count
        values_and_rates = self._functions_of_values[arrays][slides](y, u, v)
        return values_and_rates[:count], values_and_rates[count:]

    def change(
        self,
        t: float,
        j: int,
        y: Sequence[float],
        f: Sequence[float],
        state: Any,
        V: list[list[float]] | None = None,
        u: Sequence[float] = (),
    ) -> Any:
        """The y after switch j at y with y' = f, the state being changed in place; with columns V, (y, V).

        V are k lists (size,).  `u` are the inputs before those of contacts.  ComputationError where friction has none.
        """
        columns = [] if V is None else V
        after = self._changing[2](t, j, y, f, state, self.numbers, self.constants, [*u], columns, self.events)
        self._refuse(state)
        return after if V is None else (after, columns)

    def project(self, y: list[float], state: Sequence[float]) -> None:
        """Take the rounding by which sticking contacts move from y, in place."""
        at = self.places
        for i, (below, above) in enumerate(at.contacts):
            if state[at.K + i] == 0:
                y[below] = state[at.state_count + 2 * at.J + i] + (y[above] if above >= 0 else 0.0)
                y[at.half + below] = y[at.half + above] if above >= 0 else 0.0

    def add_rail_work(
        self,
        inside: Callable[[Floats], Floats],
        spans: Floats,
        contact_inputs: Sequence[Sequence[float]],
        state: list[float],
        inputs: Callable[[Floats, Floats], Sequence[Any]],
    ) -> None:
        """The work of friction on a rail with a coefficient between times (s), (S, 2), in steps, added to the state.

        By Gauss's quadrature, and taken back where a span ends before it begins.  `inside` gives y (T, size) at times,
        `contact_inputs` are those of contacts in each step, `inputs` those before them at times (T,) and y (size, T).
        """
        at = self.places
        if not at.presses:
            return
        slides = np.array([not step[at.J] for step in contact_inputs]) & (spans[:, 1] != spans[:, 0])
        if not slides.any():
            return
        since, now = spans[slides].T
        times = ((since + now)[:, None] / 2 + (now - since)[:, None] / 2 * NODES).ravel()
        y, contacts = inside(times).T, np.repeat(np.array(contact_inputs)[slides].T, len(NODES), axis=1)
        power = self.function("friction", "arrays")(y, (*inputs(times, y), *contacts), ())[0] * y[at.half]
        state[at.work] += float((now - since) / 2 @ (power.reshape(-1, len(NODES)) @ WEIGHTS))

    def jams(self, y: Sequence[float], values: Sequence[float], state: Sequence[float]) -> bool:
        """Whether the rail's friction, which slides, has no bound at y with these values of the switches."""
        at = self.places
        links = slice(at.half + self.form.first, 2 * at.half)
        return at.presses and state[at.K] != 0 and jams(self.form.system, y[links], values[-1])

    def rests(self, state: Sequence[float]) -> bool:
        """Whether every coordinate is held for good, as nothing from outside changes."""
        at, system = self.places, self.form.system
        acted_on = self.form.has_load or system.prescribed_motions or system.hoisting
        return not acted_on and at.half == at.J and not any(state[at.K : at.e])

    def kicks_so_far(self) -> Kicks:
        """The kicks so far."""
        kicks = [event for event in self.events if event[1] < len(self.kicks)]
        which = np.array([self.kicks[int(event[1])][0] for event in kicks], dtype=np.int64) - self.form.first
        time, _, impulse, energy = np.array(kicks).reshape(-1, 4).T
        return Kicks(time, which, impulse, energy)

    def friction_record(self, t: float, y: Sequence[float], state: Sequence[float]) -> Friction:
        """Return the friction record until this time."""
        at, contacts = self.places, range(2 * self.places.K, 2 * self.places.K + self.places.J)
        phases, rest = [], nan
        for j in contacts:
            times = [event[0] for event in self.events if event[1] == j] + [t]
            phases += [(begin, end, j - contacts[0]) for begin, end in zip(times[::2], times[1::2], strict=False)]
        if self.rests(state):
            rest = max(event[0] for event in self.events if event[1] in contacts)
        links = np.array([below for below, _ in at.contacts], dtype=np.int64) - self.form.first
        phases.sort()
        begin, end = (np.array([phase[k] for phase in phases], dtype=float) for k in (0, 1))
        return Friction(links[[phase[2] for phase in phases]], begin, end, links, np.array(self.work(y, state)), rest)

    def work(self, y: Any, state: Any) -> list[Any]:
        """The work (J) of friction at every contact until y: floats, or arrays over members."""
        at, work = self.places, [*state[self.places.work :]]
        for i, pair in enumerate(at.contacts):
            if not (at.presses and i == 0):
                way = abs(joint_value(y, pair) - state[at.state_count + 2 * at.J + i]) * abs(state[at.K + i])
                work[i] = work[i] - self.numbers[3 * at.K + i] * way
        return work

    @cached_property
    def count(self) -> int:
        """How many switches there are: kicks to the right, to the left, contacts, and N of a rail."""
        return 2 * len(self.kicks) + len(self.form.contacts) + self.form.presses

    @cached_property
    def _functions_of_values(self) -> list[list[Any]]:
        """Of floats and of arrays, each where a contact may stick and where all slide."""
        return [[self.function(name, target) for name in ("values", "clear")] for target in ("floats", "arrays")]

    @cached_property
    def _changing(self) -> Any:
        return _changing_of(self.module, self.places)

    def source(self) -> str:
        """The functions of `changing` as a text for numba, which has the decorator `part`."""
        return compiled_source(self.places, _scalars_of(self.module))

    def _refuse(self, state: Sequence[float]) -> None:
        if self.places.J and state[self.places.K] != state[self.places.K]:
            raise ComputationError(JAMMED)


@lru_cache(maxsize=64)
def _scalars_of(module: Module) -> dict[str, str]:
    """The texts of `TEXTS`."""
    names = {name: name for name in TEXTS if name in module.functions}
    return {name: module.scalar(names.get(name, "rates"), name) for name in (*names, "sticking")}


@lru_cache(maxsize=64)
def _changing_of(module: Module, places: Places) -> Any:
    return changing(places, {name: function_in(text, name) for name, text in _scalars_of(module).items()})


def kicks_of(system: System) -> tuple[Pairs, list[float]]:
    """The joints with escapements as pairs of coordinates, and their bent, angle and impulse (3 K)."""
    joints = escaping(system)
    return joints.pairs, np.concatenate((joints.joint_rest, joints.angle, joints.impulse)).tolist()


def numbers_of(system: System) -> tuple[float, ...]:
    """The numbers of the switches of a system, none without any."""
    contacts, (_, numbers) = contacts_of(system), kicks_of(system)
    limits = contacts.limit.tolist()
    if contacts.coefficient:
        limits[0] = contacts.coefficient
    all_numbers = (*numbers, *limits)
    return (*all_numbers, float(system.rate)) if all_numbers else ()


def switches_of(system: System, *, has_load: bool = False, works: bool | None = None) -> Switches:
    """The switches of a system, under a load if `has_load`, with the work counted or not."""
    form, (kicks, _) = with_contacts(form_of(system, has_load=has_load, works=works)), kicks_of(system)
    constants = switching_of(form, kicks).constants(form.numbers_of(system))
    return Switches(form, kicks, constants, numbers_of(system))


Phase = tuple[list[float], int]
"""The state of switches, and how much had happened when it began."""


@dataclass(eq=False)
class Switched(Written, Arranged):
    """The equations `free` with switches: a phase lasts until `change`, `contact_inputs` being those in it.

    `met_switch` is the one at which the last step ended, until its change; `look` are the values of all at the present
    y.
    """

    free: Generated
    system: System = field(init=False)
    load: Load | None = field(init=False)
    counts_work: bool = field(init=False)
    state: list[float] = field(init=False, default_factory=list)
    contact_inputs: list[float] = field(init=False, default_factory=list)
    met_switch: int | None = field(init=False, default=None)
    look: Any = field(init=False, default=None)
    rests: bool = field(init=False, default=False)
    phase: Phase = field(init=False, default=([], 0))

    def __post_init__(self) -> None:
        self.system, self.load, self.counts_work = self.free.system, self.free.load, self.free.counts_work

    @cached_property
    def inputs(self) -> Inputs:
        """The inputs that depend on time, with the samples of loops."""
        return self.free.inputs

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
        return lambda time, y: [*(time_inputs(time, y) if time_inputs else ()), *self.contact_inputs]

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
