"""Energies of pendula and of what carries them, as plain arithmetic: of many states at once, or recorded.

As in `nonlinear.dynamics.mechanics` potential energy is counted from the scene's rest, with σ − cos θ = 2 σ sin² ((θ −
rest)/2), so that small motions keep their digits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nonlinear.dynamics.joints import spring_energy
from nonlinear.dynamics.structure import Carriers, CarriersAt
from nonlinear.system import Group, System


def kinetic_energy(group: Group, winding: Any, angles: Any, rates: Any, velocity: Any) -> Any:
    """That of every pendulum (J), (P, ...), of angles and rates (n, P, ...), where lengths change at speeds `winding`.

    `velocity` (m/s) is that of the first joints along the rail, or on a structure two of each, along it and down.
    """
    block, short = group.block, group.block.centre - group.block.length
    along, down = velocity if isinstance(velocity, tuple) else (velocity, 0.0)
    energy, sin, cos = block.inertia * rates**2, np.sin(angles), np.cos(angles)
    for direction, pivot, rope in ((cos * rates, along, sin), (sin * rates, -down, -cos)):
        joints = np.cumsum(block.length * direction + winding * rope, axis=0)
        energy = energy + block.mass * (joints + short * direction + pivot) ** 2
    return energy.sum(0) / 2


def potential_energy(group: Group, first: Group, angles: Any, gravity: Any, down: Any = 0.0, base: Any = None) -> Any:
    """That of every pendulum (J), (P, ...), from the rest of a group with its `first` lengths.

    Its first joints are so far `down` (m) from where they are drawn, and a `base` (rad) that turns carries them.
    """
    block, sigma = group.block, group.block.sigma
    lifts = 2 * sigma * np.sin((angles - group.rest) / 2) ** 2
    heights = np.cumsum(block.length * lifts, axis=0) + (block.centre - block.length) * lifts
    if group is not first:
        heights = heights + np.cumsum(sigma * (first.block.length - block.length), axis=0)
    if not (isinstance(down, float) and down == 0.0):
        heights = heights - down
    energy = block.mass * gravity * heights
    if group.sprung:
        energy = energy + spring_energy(group, angles, base)
    return energy.sum(0)


def energy_on_carriers(system: System, q: Any, v: Any) -> Any:
    """The energy (J) of a scene on a structure, of constant lengths, at coordinates q and rates v (half, ...)."""
    kinetic, potential = energies_on_carriers(system, q, v)
    return kinetic + potential


def energies_on_carriers(system: System, q: Any, v: Any) -> tuple[Any, Any]:
    """The kinetic and the potential part of it."""
    bearing, first = CarriersAt(Carriers(system), q, v, bare=True), system.first
    kinetic, potential = bearing.kinetic, bearing.potential
    for _, tension in bearing.tensions(q, v):
        potential = potential + tension.energy.sum(0)
    for number, group in enumerate(system.groups):
        angles, rates = q[first:][group.index], v[first:][group.index]
        (_, down), velocity = bearing.pivots(number)
        base = bearing.joints(number).base
        kinetic = kinetic + kinetic_energy(group, 0.0, angles, rates, velocity).sum(0)
        turned = None if base is None else base[0]
        potential = potential + potential_energy(group, group, angles, system.gravity, down, turned).sum(0)
    return kinetic, potential
