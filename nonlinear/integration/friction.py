"""Stick and slip as events: when a contact stops sliding or breaks loose, and what follows.

For integrators that know of no switches: all but DOP853, and scenes whose equations are not written out.  Others end
their steps at the switches of `switches`.

Every contact has a value that stays negative while its state lasts: −s γ' while it slides in the direction s, |τ| − M
while it sticks.  Within each step the first value to pass zero is sought on the integrator's interpolant.  A contact
that stops sliding loses the remainder of its velocity by an impulse of friction, so that those already sticking stay
at rest and the energy is kept to second order in that remainder; then `Frictional.settled` decides which contacts stick
and which way the others slide, and the integrator restarts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import nan, ulp
from typing import NamedTuple, cast

import numpy as np

from modal.types import Booleans, Floats
from nonlinear.dynamics import Frictional, links_of_contacts, refuse_jam
from nonlinear.integration.changes import BRIEF, FIRM, OFTEN, TOGETHER
from nonlinear.integration.escapements import lowest, root
from nonlinear.integration.steppers import BESIDE, SciPyStepper, Stepper
from nonlinear.integration.switches import NODES, WEIGHTS
from nonlinear.system import Friction

LOOKS = 8  # intervals of every step that are searched
CLEAR = 0.5  # least velocity of a contact over the change of it in a step that needs no search
NEARER = 0.5 ** np.arange(1, 21, 3)  # of an interval, where a phase that has just begun is sought


class Transition(NamedTuple):
    """The next change: its time (s), and which contacts stop sliding or break loose, (J,)."""

    time: float
    which: Booleans


@dataclass(eq=False)
class StickSlip:
    """The changes of a run from y at a time on, and the record of its phases."""

    equations: Frictional
    time: float
    y: Floats
    rest: float = nan
    _since: Floats = field(init=False)
    _turned: Floats = field(init=False)
    _work: Floats = field(init=False)
    _phases: list[tuple[int, float, float]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        count, self._pairs = len(self.equations.sign), self.equations.contacts.pairs
        self._since, self._work, self._turned = np.full(count, nan), np.zeros(count), self.equations.place(self.y)
        self._changed, self._brief, self._firm = np.full(count, -np.inf), np.zeros(count, int), np.zeros(count)
        self._settle(self.time, self.y, np.sign(self.equations.sliding(self.y)))

    # -------------------------------------------------------------------------------------------------- the search

    def next(self, stepper: Stepper, before: float) -> Transition | None:
        """The first change within the last step, None where there is none."""
        self.equations.refused = ""
        if self.equations.rests:
            return None
        looks = np.linspace(before, stepper.time, LOOKS + 1)
        rows = np.vstack((stepper.inside(looks[:-1]), stepper.y))
        if self.equations.sign.all():
            values = -self.equations.sign * self.equations.sliding(rows)
        else:
            times = map(cast("SciPyStepper", stepper).clear_of_breaks, looks.tolist())
            values = np.array([self._values(time, row) for time, row in zip(times, rows, strict=True)])
        low, high = values[:-1], values[1:]
        passing, near = (low <= 0) & (high > 0), np.zeros(low.shape, dtype=bool)
        passing[0] |= (self._changed >= before) & (low[0] >= 0) & (high[0] > low[0]) & (high[0] > 0)
        near[1:] = _near(values)
        for k in np.flatnonzero((passing | near).any(1)).tolist():
            if passing[k].any():
                return self._first(stepper, looks[k], looks[k + 1], passing[k])
            if peak := self._peak(stepper, looks, near[k], k):
                return self._first(stepper, *peak)
        return None

    def _values(self, time: float, row: Floats) -> Floats:
        """The value of every contact, negative while its state lasts, (J,)."""
        equations, sign = self.equations, self.equations.sign
        values = -sign * equations.sliding(row)
        stuck = sign == 0
        if stuck.any():
            rubbing = equations.rubbing(time, row)
            values[stuck] = (np.abs(rubbing.tau) - rubbing.limit * (1 + self._firm))[stuck]
        return values

    def _value(self, stepper: Stepper, j: int, time: float) -> float:
        clear = cast("SciPyStepper", stepper).clear_of_breaks(time)
        return float(self._values(clear, stepper.inside(np.array([time]))[0])[j])

    def _peak(self, stepper: Stepper, looks: Floats, near: Booleans, k: int) -> tuple[float, float, Booleans] | None:
        """The look before a positive maximum near look k, its time, and which of those `near` has it; None without."""
        for j in np.flatnonzero(near).tolist():
            value = partial(self._value, stepper, j)
            time, least = lowest(partial(_negative, value), float(looks[k - 1]), float(looks[k + 1]))
            if least < 0:
                return float(looks[k - 1]), time, np.arange(len(near)) == j
        return None

    def _first(self, stepper: Stepper, start: float, end: float, among: Booleans) -> Transition:
        """The first of these contacts to pass zero; one whose value is zero at the start may be negative at first."""
        times = np.full(len(among), np.inf)
        for j in np.flatnonzero(among).tolist():
            value = partial(self._value, stepper, j)
            early = start + (end - start) * np.append(0.0, NEARER)
            low = next((time for time in early.tolist() if value(time) < 0), None)
            times[j] = start if low is None else root(value, low, end)
        first = float(times.min())
        return Transition(first, times <= first)

    # -------------------------------------------------------------------------------------------------- the change

    def changed(self, change: Transition, y: Floats) -> Floats:
        """The y after a change, from which the contacts go on in their new states."""
        equations, sign = self.equations, self.equations.sign
        sliding, unit = equations.sliding(y), equations.system.rate * TOGETHER
        stopping = (sign != 0) & (change.which | (sliding * sign <= unit) & self._slowing(change.time, y))
        loose = (sign == 0) & change.which
        after = self._stopped(change.time, y, stopping | ((sign == 0) & ~loose) | loose)
        begun = np.where(stopping, 0.0, sign)
        for j in np.flatnonzero(loose):
            begun[j] = -np.sign(equations.rubbing(change.time, after).tau[j])
        self._count(change.time, stopping | loose)
        self._settle(change.time, after, begun, held=(stopping | loose) & (self._firm > 0))
        return equations.project(after)[0]

    def land(self, time: float, y: Floats) -> None:
        """Inputs have jumped at this time: which contacts stick is decided anew."""
        self._settle(time + BESIDE * ulp(time), y, self.equations.sign)

    def struck(self, time: float, y: Floats) -> None:
        """A kick made velocities jump to those of y: every contact that moves slides."""
        self._brief[:], self._firm[:] = 0, 0.0
        self._settle(time, y, np.sign(self.equations.sliding(y)))

    def _slowing(self, time: float, y: Floats) -> Booleans:
        slope = self.equations.derivative(time, y)
        return np.asarray(self.equations.sliding(slope) * self.equations.sign < 0)

    def _stopped(self, time: float, y: Floats, still: Booleans) -> Floats:
        """The same y after an impulse of friction that takes all velocity from these contacts."""
        equations, half = self.equations, self.equations.layout.half
        response, speed = equations.responding(time, y).columns[:, still], equations.sliding(y)[still]
        if not speed.any():
            return y.copy()
        after = y.copy()
        G = (equations.contacts.jacobian(half) @ response)[still]
        after[half : 2 * half] -= response @ np.linalg.solve(G, speed)
        return after

    def _count(self, time: float, which: Booleans) -> None:
        """Notice chatter: contacts whose states are too brief to resolve are held more firmly."""
        brief = (time - self._changed) * self.equations.system.rate < BRIEF
        self._brief = np.where(which, np.where(brief, self._brief + 1, 0), self._brief)
        firm = FIRM * 10.0 ** (self._brief - OFTEN)
        self._firm = np.where(self._brief >= OFTEN, firm, np.where(which, 0.0, self._firm))
        self._changed = np.where(which, time, self._changed)

    def _settle(self, time: float, y: Floats, sign: Floats, held: Booleans | None = None) -> None:
        """Decide the state of every contact at rest but those `held`, and record what ends and begins."""
        equations, before = self.equations, self.equations.sign
        self._account(y)
        settled = equations.settled(time, y, sign).sign
        if held is not None:
            settled = np.where(held, 0.0, settled)
        for j in np.flatnonzero((before == 0) & (settled != 0) & ~np.isnan(self._since)).tolist():
            self._phases.append((j, float(self._since[j]), time))
            self._since[j] = nan
        begun = (settled == 0) & np.isnan(self._since)
        self._since[begun] = time
        self._changed[begun | (before != settled)] = time
        equations.set_sign(settled)
        equations.placed = np.where(begun, equations.place(y), equations.placed)
        if equations.rests:
            self.rest = time

    def _account(self, y: Floats) -> None:
        """The work of constant friction since the last change, M times the angle slid: no contact turns back before."""
        place = self.equations.place(y)
        self._work -= self.equations.contacts.limit * np.abs(place - self._turned)
        self._turned = place

    def passed(self, stepper: Stepper, before: float, now: float) -> None:
        """The work within a step of friction on the rail whose limit varies, by Gauss's quadrature."""
        if not self.equations.contacts.coefficient or not self.equations.sign[0] or now <= before:
            return
        times = (before + now) / 2 + (now - before) / 2 * NODES
        rows = stepper.inside(times)
        speeds = self.equations.sliding(rows)[:, 0]
        forces = [self.equations.rubbing(time, row).tau[0] for time, row in zip(times.tolist(), rows, strict=True)]
        layout = self.equations.layout
        refuse_jam(self.equations.system, rows[-1, layout.half + layout.first : 2 * layout.half], forces[-1])
        self._work[0] += (now - before) / 2 * float(WEIGHTS @ (np.array(forces) * speeds))

    def record(self, time: float, y: Floats) -> Friction:
        """What friction did until this time."""
        self._account(y)
        lasting = [(j, float(self._since[j]), time) for j in np.flatnonzero(~np.isnan(self._since)).tolist()]
        phases = sorted([*self._phases, *lasting], key=lambda phase: phase[1])
        places = links_of_contacts(self.equations.system)
        which = np.array([phase[0] for phase in phases], dtype=np.int64)
        begin, end = (np.array([phase[k] for phase in phases], dtype=float) for k in (1, 2))
        return Friction(places[which], begin, end, places, self._work.copy(), self.rest)


def _negative(value: Callable[[float], float], time: float) -> float:
    return -value(time)


def _near(values: Floats) -> Booleans:
    """Which values (K, J) have a negative maximum at an inner look, (K − 2, J), that may be positive beside it."""
    left, middle, right = values[:-2], values[1:-1], values[2:]
    bend = left - 2 * middle + right
    with np.errstate(all="ignore"):
        top = middle - (right - left) ** 2 / (8 * bend)
    return np.asarray((middle < 0) & (middle >= left) & (middle >= right) & (bend < 0) & (top > middle / 2))
