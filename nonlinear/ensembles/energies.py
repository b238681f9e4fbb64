"""Energies of many members at once, and their drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.mechanics import Energies, energies
from nonlinear.integration.trajectory import ENERGY_NOISE
from nonlinear.system import Layout, Numbers


@dataclass(frozen=True, eq=False)
class Accounts:
    """The energies of members with these numbers, from y (size, S)."""

    numbers: Numbers
    layout: Layout

    def energies(self, y: Floats, coasting: Floats | float = 0.0, time: float = 0.0) -> Energies:
        """Of every pendulum, (N, S), and of the cart, seen from where its speed is less by `coasting` (m/s)."""
        half, system = self.layout.half, self.numbers.arrays
        q, v = y[:half], y[half : 2 * half]
        if np.any(coasting):
            v = np.concatenate((v[:1] - coasting, v[1:]))
        every, none = energies(system, q, v, time).by_pendulum(system), np.zeros(y.shape[1])
        return every._replace(cart_kinetic=every.cart_kinetic + none, cart_potential=every.cart_potential + none)

    def coasting(self, y: Floats) -> Floats | float:
        """The speed (m/s) with which the centre of mass of a free cart and all that hangs there moves forever."""
        system = self.numbers.arrays
        cart = system.cart
        if cart is None or not system.coasts:
            return 0.0
        half, (links, rates) = self.layout.half, (y[at + 1 : at + self.layout.half] for at in (0, self.layout.half))
        mass, momentum = cart.mass, cart.mass * y[half]
        for group in system.groups:
            block, speeds = group.block, np.cos(links[group.index]) * rates[group.index]
            mass = mass + block.mass.sum((0, 1))
            momentum = momentum + (block.mass.sum(0) * y[half]).sum(0) + (block.b * speeds).sum((0, 1))
        return np.asarray(momentum / mass)

    @property
    def lowest(self) -> Floats:
        """Potential energy (J) of links that all hang, springs omitted."""
        system = self.numbers.arrays
        standing = sum(np.where(group.block.sigma < 0, group.block.b, 0.0).sum((0, 1)) for group in system.groups)
        return np.asarray(-2 * system.gravity * standing)

    def drift(self, before: Floats, after: Floats, end: float, rubbed: Floats | float = 0.0) -> Floats:
        """(E after − E before − work)/range of the energies, (S,), from t = 0 to the `end` (s).

        `rubbed` is the work of dry friction.  The range is the largest of its known bounds.

        That is the energy above that of links that hang still, kinetic energy at either end, what potential energy has
        changed by, and the work.
        """
        coasting = self.coasting(before)
        first, two = self.energies(before, coasting), self.energies(after, coasting, end)
        work = (after[-1] if self.layout.works else 0.0 * first.total) + rubbed
        above = first.total - self.lowest
        ranges = [
            above,
            first.moving,
            two.moving,
            abs(two.potential_energy - first.potential_energy),
            abs(work),
            ENERGY_NOISE * abs(first.potential_energy),
        ]
        scale = np.max(np.broadcast_arrays(*ranges), axis=0)
        return np.asarray(np.abs(two.total - first.total - work) / np.where(scale > 0, scale, 1.0))
