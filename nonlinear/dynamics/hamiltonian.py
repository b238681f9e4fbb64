"""Hamilton's equations in the plane, the comparison suggested at the end of paper 002, by O(links) passes.

With n = (cos θ, −sin θ) across a link, u = (sin θ, cos θ) along it, v the velocity of its centre and P the momentum of
all that hangs below it,

    w = m c v + l P       p_θ = I θ' + n·w       p_x = m_c x' + Σ m v_x                 momenta without a matrix
    q' = ∂H/∂p = M⁻¹ p          `nonlinear.dynamics.recursion` without gravity or rates, with p in place of the forces
    p_θ' = −∂H/∂θ = −θ' u·w − g b sin θ + springs        p_x' = −k_c x                 H = ½ pᵀM⁻¹p + V

and dampers and loads add their generalized forces to p'.  The p_x of a free cart is constant to the last digit.
Vectors p are ordered like q, (x, links); further axes of angles and momenta are independent states side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.applied import sizes_at
from nonlinear.dynamics.joints import acting, frame_of, spring_energy
from nonlinear.dynamics.minimal import Recursion, inverted
from nonlinear.system import AppliedForces, Group, Layout, Load, Motion, State, System


class Carried(NamedTuple):
    """n·w and u·w (kg m²/s) of every link, (n, P), and the momentum of the pendula along the rail (kg m/s), (P,)."""

    across: Floats
    along: Floats
    rail: Floats


def carried(group: Group, angles: Floats, rates: Floats, cart_rate: float) -> Carried:
    """The momentum that each link of a group carries: velocities from the top down, momenta from the tip up."""
    block, sin, cos = group.block, np.sin(angles), np.cos(angles)
    n, u = np.stack((cos, -sin)), np.stack((sin, cos))
    ends = np.cumsum(block.length * rates * n, axis=1)
    ends[0] += cart_rate
    momentum = block.mass * (ends - (block.length - block.centre) * rates * n)
    through = np.cumsum(momentum[:, ::-1], axis=1)[:, ::-1]
    w = block.centre * momentum + block.length * (through - momentum)
    return Carried((n * w).sum(0), (u * w).sum(0), through[0, 0])


def momenta(system: System, state: State) -> Floats:
    """The momenta ∂T/∂q' (half,): p_x (kg m/s) of a cart, then p_θ (kg m²/s) of every link."""
    on_links, rail = np.empty_like(state.links), 0.0
    for group in system.groups:
        rates = state.link_rates[group.index]
        shares = carried(group, state.links[group.index], rates, state.cart_rate)
        on_links[group.index] = group.block.inertia * rates + shares.across
        rail = rail + shares.rail.sum()
    return np.concatenate(([rail + system.cart.mass * state.cart_rate], on_links)) if system.cart else on_links


def velocities(system: System, q: Any, p: Any) -> Any:
    """The velocities q' = M⁻¹ p (half, ...) at the coordinates (half, ...)."""
    return inverted(system, [(group, Recursion(group, p.ndim - 1)) for group in system.groups], q, p)


def potential(system: System, cart: Any, links: Any) -> Any:
    """V (J) of gravity and of every spring: −g Σ b with all links hanging and all springs relaxed."""
    energy = system.cart.stiffness * cart**2 / 2 if system.cart else 0.0
    for group in system.groups:
        angles = links[group.index]
        b = group.block.b.reshape(*group.block.b.shape, *[1] * (angles.ndim - 2))
        energy = energy - (system.gravity * b * np.cos(angles)).sum((0, 1))
        energy = energy + spring_energy(group, angles).sum((0, 1))
    return energy


def hamiltonian(system: System, cart: Any, links: Any, p: Any) -> Any:
    """H = ½ pᵀM⁻¹p + V (J)."""
    q = np.concatenate((0 * links[:1], links)) if system.cart else links
    return (p * velocities(system, q, p)).sum(0) / 2 + potential(system, cart, links)


@dataclass(frozen=True, eq=False)
class Hamiltonian:
    """Hamilton's equations of a plane scene with y = (q, p, work)."""

    system: System
    load: Load | None = None

    @cached_property
    def layout(self) -> Layout:
        """The arrangement of y, with momenta in place of velocities."""
        system, works = self.system, self.system.works or self.load is not None
        return Layout.of(system, works=works)

    def derivative(self, time: float, y: Floats) -> Floats:
        """The derivative y' (size,): q', then p' = −∂H/∂q plus the forces of dampers and loads."""
        state = self.read(y[None])[0]
        push = self.load(time, state) if self.load else AppliedForces()
        rates = self.layout.begin(state)[self.layout.half : 2 * self.layout.half]
        on_cart, on_links, power = acting(
            self.system, state, push, frame_of(self.system, time), sizes_at(self.system, time)
        )
        for group in self.system.groups:
            angles, turning = state.links[group.index], state.link_rates[group.index]
            thrown = turning * carried(group, angles, turning, state.cart_rate).along
            on_links[group.index] -= thrown + self.system.gravity * group.block.b * np.sin(angles)
        return np.concatenate((rates, [on_cart] if self.system.cart else [], on_links, [power] * self.layout.works))

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        y = self.layout.begin(state)
        y[self.layout.half : 2 * self.layout.half] = momenta(self.system, state)
        return y

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size), momenta converted to velocities."""
        half, states = self.layout.half, np.array(rows)
        states[:, half : 2 * half] = velocities(self.system, rows[:, :half].T, rows[:, half : 2 * half].T).T
        return self.layout.read(states)

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): for momenta the largest entry of each diagonal of M times that of rates."""
        system, layout = self.system, self.layout
        units, inertia = layout.natural(system), np.empty(system.n_links)
        for group in system.groups:
            inertia[group.index] = group.block.diagonal
        mass = [system.cart.mass + float(system.mass.sum())] if system.cart else []
        units[layout.half : 2 * layout.half] *= np.concatenate((mass, inertia))
        return units

    def project(self, y: Floats) -> tuple[Floats, float]:
        """Minimal coordinates have no constraints."""
        return y, 0.0
