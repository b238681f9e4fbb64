"""Energies of many members at once, and how far they are from being kept.

As in `nonlinear.dynamics.mechanics` potential energy is counted from the scene's rest, with σ − cos θ = 2 σ sin² ((θ −
rest)/2), so that small motions keep their digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.inputs import lengthened
from nonlinear.dynamics.joints import spring_energy
from nonlinear.integration.trajectory import NOISE
from nonlinear.system import Group, Layout, Numbers


class Energies(NamedTuple):
    """Kinetic and potential energy (J) of every pendulum, (N, S), and of the cart, (S,)."""

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
        cart = (y[0], y[half]) if first else (none, none)
        return y[first:half], y[half + first : 2 * half], *cart

    def energies(self, y: Floats, coasting: Floats | float = 0.0, time: float = 0.0) -> Energies:
        """Seen from where the cart's speed is less by `coasting` (m/s), with the lengths of this time (s)."""
        angles, rates, x, speed = self._parts(y)
        system, speed = self.numbers.arrays, speed - coasting
        kinetic, potential = np.empty((2, system.n_pendula, y.shape[1]))
        for group in system.groups:
            own, turning = angles[group.index], rates[group.index]
            kinetic[group.pendula] = _kinetic(*self._hung(group, time), own, turning, speed)
            potential[group.pendula] = _potential(self._hung(group, time)[0], group, own, system.gravity)
        mass, _, stiffness = system.cart or (0.0, 0.0, 0.0)
        return Energies(kinetic, potential, np.asarray(mass * speed**2 / 2), np.asarray(stiffness * x**2 / 2))

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
        if cart is None or np.any(np.asarray(cart.damping) != 0) or np.any(np.asarray(cart.stiffness) != 0):
            return 0.0
        angles, rates, _, speed = self._parts(y)
        mass, momentum = cart.mass, cart.mass * speed
        for group in system.groups:
            block, own = group.block, np.cos(angles[group.index]) * rates[group.index]
            mass = mass + block.mass.sum((0, 1))
            momentum = momentum + (block.mass.sum(0) * speed).sum(0) + (block.b * own).sum((0, 1))
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
        one, two = self.energies(before, coasting), self.energies(after, coasting, end)
        work = (after[-1] if self.layout.works else 0.0 * one.total) + rubbed
        above = one.total - self.lowest
        ranges = [above, one.moving, two.moving, abs(two.stored - one.stored), abs(work), NOISE * abs(one.stored)]
        scale = np.max(np.broadcast_arrays(*ranges), axis=0)
        return np.asarray(np.abs(two.total - one.total - work) / np.where(scale > 0, scale, 1.0))


def _kinetic(group: Group, winding: Any, angles: Floats, rates: Floats, speed: Floats) -> Floats:
    """(P, S), where lengths change at speeds `winding` (m/s)."""
    block, short = group.block, group.block.centre - group.block.length
    found, sin, cos = block.inertia * rates**2, np.sin(angles), np.cos(angles)
    for direction, pivot, along in ((cos * rates, speed, sin), (sin * rates, 0.0, -cos)):
        joints = np.cumsum(block.length * direction + winding * along, axis=0)
        found = found + block.mass * (joints + short * direction + pivot) ** 2
    return np.asarray(found.sum(0) / 2)


def _potential(group: Group, first: Group, angles: Floats, gravity: Any) -> Floats:
    """(P, S), from the rest of a group with its `first` lengths."""
    block, sigma = group.block, group.block.sigma
    lifts = 2 * sigma * np.sin((angles - group.rest) / 2) ** 2
    heights = np.cumsum(block.length * lifts, axis=0) + (block.centre - block.length) * lifts
    if group is not first:
        heights = heights + np.cumsum(sigma * (first.block.length - block.length), axis=0)
    found = block.mass * gravity * heights
    if group.sprung:
        found = found + spring_energy(group, angles)
    return np.asarray(found.sum(0))
