"""Columns that are the same motion with imaginary parts: derivatives by numbers and starts, through switches too.

The equations are analytic, so that the imaginary part ε of a number makes ε times the derivative by it in the imaginary
part of the motion, to the last digit [Squire1998].  The real part takes the steps and
meets the switches; where a column would meet one earlier or later by δt = −Im(value)/value', it continues in the flow
before until then and in the flow after from then on: y₊ = G(y₋ + i f₋ δt) − i f₊ δt, which is the saltation matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.integration.crowds import Crowd, Some
from nonlinear.integration.switches import Switches
from nonlinear.system import Numbers


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
