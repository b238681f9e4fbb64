"""Energies of many members at once, and how far they are from being kept.

As in `nonlinear.dynamics.mechanics` potential energy is counted from the scene's rest, with σ − cos θ = 2 σ sin² ((θ −
rest)/2), so that small motions keep their digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.energies import kinetic_energy, potential_energy
from nonlinear.dynamics.inputs import lengthened
from nonlinear.dynamics.structure import Carriers, CarriersAt
from nonlinear.integration.trajectory import NOISE
from nonlinear.system import Group, Layout, Numbers


class MemberEnergies(NamedTuple):
    """Kinetic and potential energy (J) of every pendulum, (N, S), and of the cart, (S,).

    On a structure the latter are those of the carriers and of all springs between points.
    """

    kinetic: Floats
    potential: Floats
    cart_kinetic: Floats
    cart_potential: Floats

    @property
    def total(self) -> Floats:
        """Of everything, (S,)."""
        return np.asarray((self.kinetic + self.potential).sum(0) + self.cart_kinetic + self.cart_potential)

    @property
    def moving(self) -> Floats:
        """Kinetic energy of everything, (S,)."""
        return np.asarray(self.kinetic.sum(0) + self.cart_kinetic)

    @property
    def stored(self) -> Floats:
        """Potential energy of everything, (S,)."""
        return np.asarray(self.potential.sum(0) + self.cart_potential)


@dataclass(frozen=True, eq=False)
class Accounts:
    """The energies of members with these numbers, from y (size, S)."""

    numbers: Numbers
    layout: Layout

    def _parts(self, y: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Angles, their rates, and the cart's place and speed."""
        first, half, none = self.layout.first, self.layout.half, np.zeros(y.shape[1])
        cart = (y[0], y[half]) if first and not self.layout.is_structured else (none, none)
        return y[first:half], y[half + first : 2 * half], *cart

    def energies(self, y: Floats, coasting: Floats | float = 0.0, time: float = 0.0) -> MemberEnergies:
        """Seen from where the cart's speed is less by `coasting` (m/s), with the lengths of this time (s)."""
        angles, rates, x, speed = self._parts(y)
        system, speed = self.numbers.arrays, speed - coasting
        kinetic, potential = np.empty((2, system.n_pendula, y.shape[1]))
        half, bearing = self.layout.half, None
        if system.structure is not None:
            bearing = CarriersAt(Carriers(system), y[:half], y[half : 2 * half], bare=True)
        for number, group in enumerate(system.groups):
            turned, turning, down, base = angles[group.index], rates[group.index], 0.0, None
            velocity: Any = speed
            if bearing is not None:
                (_, down), velocity = bearing.pivots(number)
                base = bearing.joints(number).base
            kinetic[group.pendula] = kinetic_energy(*self._hung(group, time), turned, turning, velocity)
            potential[group.pendula] = potential_energy(
                self._hung(group, time)[0], group, turned, system.gravity, down, base and base[0]
            )
        if bearing is not None:
            stored = sum((spring.energy.sum(0) for _, spring in bearing.tensions(y[:half], y[half : 2 * half])), 0.0)
            carried = bearing.kinetic, bearing.potential + stored
            return MemberEnergies(kinetic, potential, *(np.asarray(part + 0.0 * x) for part in carried))
        mass, _, stiffness = system.cart or (0.0, 0.0, 0.0)
        return MemberEnergies(kinetic, potential, np.asarray(mass * speed**2 / 2), np.asarray(stiffness * x**2 / 2))

    def _hung(self, group: Group, time: float) -> tuple[Group, Any]:
        """A group with the lengths of a time, and their speeds (n, P, 1)."""
        if (hoisting := self.numbers.system.hoisting) is None:
            return group, 0.0
        length, speed, _ = (part[group.index][..., None] for part in hoisting.at(time))
        moving = hoisting.moving[group.index][..., None]
        return lengthened(group, hoisting.moving, np.where(moving, length, group.block.length)), speed

    def coasting(self, y: Floats) -> Floats | float:
        """The speed (m/s) with which the centre of mass of a free cart and all that hangs there goes on for ever."""
        system = self.numbers.arrays
        cart = system.cart
        if cart is None or not system.coasts:
            return 0.0
        angles, rates, _, speed = self._parts(y)
        mass, momentum = cart.mass, cart.mass * speed
        for group in system.groups:
            block, speeds = group.block, np.cos(angles[group.index]) * rates[group.index]
            mass = mass + block.mass.sum((0, 1))
            momentum = momentum + (block.mass.sum(0) * speed).sum(0) + (block.b * speeds).sum((0, 1))
        return np.asarray(momentum / mass)

    @property
    def lowest(self) -> Floats:
        """Potential energy (J) of links that all hang, springs left out."""
        system = self.numbers.arrays
        standing = sum(np.where(group.block.sigma < 0, group.block.b, 0.0).sum((0, 1)) for group in system.groups)
        return np.asarray(-2 * system.gravity * standing)

    def drift(self, before: Floats, after: Floats, end: float, rubbed: Floats | float = 0.0) -> Floats:
        """(E after − E before − work)/range of the energies, (S,), from t = 0 to the `end` (s).

        `rubbed` is the work of dry friction.  The range is the largest of what is known of it.

        That is the energy above that of links that hang still, kinetic energy at either end, what potential energy has
        changed by, and the work.
        """
        coasting = self.coasting(before)
        first, two = self.energies(before, coasting), self.energies(after, coasting, end)
        work = (after[-1] if self.layout.works else 0.0 * first.total) + rubbed
        above = first.total - self.lowest
        ranges = [above, first.moving, two.moving, abs(two.stored - first.stored), abs(work), NOISE * abs(first.stored)]
        scale = np.max(np.broadcast_arrays(*ranges), axis=0)
        return np.asarray(np.abs(two.total - first.total - work) / np.where(scale > 0, scale, 1.0))
