"""T and V of a scene, as plain arithmetic: of many states at once, or recorded, in the plane and in space.

Potential energy is counted from the scene's rest, by σ − cos θ = 2 σ sin² ((θ − rest)/2) and, in space, σ − u·e_z =
σ |u − σ e_z|²/2, with σ = 1 for a link that hangs there and −1 for an inverted one: small motions keep their digits.
On a support that moves velocities are those in its frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from nonlinear.dynamics.bearing import Bearing
from nonlinear.dynamics.inputs import lengthened
from nonlinear.dynamics.joints import spring_energy
from nonlinear.dynamics.spatial import joint_energy
from nonlinear.dynamics.structure import carriers_of
from nonlinear.system import Group, System


class Energies(NamedTuple):
    """Kinetic and potential energy (J) of every link, (L, ...), and of the carriers, such as a cart, (...).

    The latter is that of their springs and of all between points.  A joint's spring belongs to the link below it.
    """

    kinetic: Any
    potential: Any
    cart_kinetic: Any
    cart_potential: Any

    @property
    def moving(self) -> Any:
        """Kinetic energy of everything, (...)."""
        return self.kinetic.sum(0) + self.cart_kinetic

    @property
    def stored(self) -> Any:
        """Potential energy of everything, (...)."""
        return self.potential.sum(0) + self.cart_potential

    @property
    def total(self) -> Any:
        """Of everything, (...)."""
        return self.moving + self.stored

    def by_pendulum(self, system: System) -> Energies:
        """The same of every pendulum, (N, ...), in place of every link."""
        sums = np.zeros((2, system.n_pendula, *self.kinetic.shape[1:]))
        for whole, part in zip(sums, self[:2], strict=True):
            for group in system.groups:
                whole[group.pendula] = part[group.index].sum(0)
        return self._replace(kinetic=sums[0], potential=sums[1])


class LinkMotion(NamedTuple):
    """How the links of a group move, (n, P, ...), as if the first joints were at rest.

    Along each axis `rates` are those of their directions and `ropes` these themselves; `spin` are the squares of all
    rates, `lifts` how far a metre of link is above its rest, `bent` the energies (J) of joint springs.
    """

    rates: Sequence[Any]
    ropes: Sequence[Any]
    spin: Any
    lifts: Any
    bent: Any


def energies(system: System, q: Any, v: Any, times: Any = 0.0) -> Energies:
    """The energies at coordinates q and rates v (half, ...), with the lengths of one time or a time each (s)."""
    first, kind = system.first, np.result_type(q, v)
    links, rates = q[first:], v[first:]
    kinetic, potential = (np.empty((system.n_links, *q.shape[1:]), dtype=kind) for _ in range(2))
    bearing = Bearing(carriers_of(system), q, v, bare=True)
    for number, group in enumerate(system.groups):
        (_, down), speed = bearing.pivots(number)
        base = bearing.base(number)
        place = 3 * group.index + np.arange(3)[:, None, None] if system.spatial else group.index
        hung, winding = _hung(system, group, times, links[place])
        swing = (_in_space if system.spatial else _in_plane)(hung, links[place], rates[place], base)
        kinetic[group.index] = kinetic_energy(hung, swing, speed, winding)
        heights = along_chain(hung, swing.lifts) - down
        if hung is not group:
            sigma, longer = _spread(group.block.sigma, swing.spin), _spread(group.block.length, swing.spin)
            heights = heights + np.cumsum(sigma * (longer - hung.block.length), axis=0)
        potential[group.index] = _spread(hung.block.mass, swing.spin) * system.gravity * heights + swing.bent
    springs = sum((spring.energy.sum(0) for _, spring in bearing.tensions(q, v)), 0.0)
    return Energies(kinetic, potential, bearing.kinetic, bearing.potential + springs)


def kinetic_energy(group: Group, swing: LinkMotion, speed: tuple[Any, Any], winding: Any) -> Any:
    """That of every link (J), (n, P, ...), whose first joints have this speed (m/s), along the rail and down.

    Their lengths change at speeds `winding`.
    """
    energy, mass = _spread(group.block.inertia, swing.spin) * swing.spin, _spread(group.block.mass, swing.spin)
    across = [0.0] * (len(swing.rates) - 2)
    for rates, ropes, pivot in zip(swing.rates, swing.ropes, (speed[0], *across, speed[1]), strict=True):
        energy = energy + mass * (along_chain(group, rates, winding * ropes) + pivot) ** 2
    return energy / 2


def along_chain(group: Group, values: Any, more: Any = 0.0) -> Any:
    """What `values` (n, P, ...) of a metre of link add up to at centres, and `more` of each rope that is wound."""
    length, centre = (_spread(part, values) for part in (group.block.length, group.block.centre))
    return np.cumsum(length * values + more, axis=0) + (centre - length) * values


def _in_plane(group: Group, angles: Any, rates: Any, base: Any) -> LinkMotion:
    s, c = np.sin(angles), np.cos(angles)
    half = np.sin((angles - _spread(group.rest, angles)) / 2)
    bent = spring_energy(group, angles, base and base[0]) if group.sprung else 0.0
    lifts = 2 * _spread(group.block.sigma, angles) * (half * half)
    return LinkMotion((c * rates, -(s * rates)), (s, c), rates * rates, lifts, bent)


def _in_space(group: Group, u: Any, w: Any, base: Any) -> LinkMotion:
    sigma = _spread(group.block.sigma, u[0])
    lifts = sigma * (u[0] * u[0] + u[1] * u[1] + (u[2] - sigma) ** 2) / 2
    return LinkMotion(w, u, (w * w).sum(0), lifts, joint_energy(group, u) if group.sprung else 0.0)


def _hung(system: System, group: Group, times: Any, like: Any) -> tuple[Group, Any]:
    """A group with the lengths of these times, and their speeds (n, P, ...)."""
    if (hoisting := system.hoisting) is None:
        return group, 0.0
    length, speed, _ = (_spread(np.moveaxis(part, -1, 0)[group.index], like) for part in hoisting.at(times))
    moving = _spread(hoisting.moving[group.index], like)
    return lengthened(group, hoisting.moving, np.where(moving, length, _spread(group.block.length, like))), speed


def _spread(constant: Any, like: Any) -> Any:
    return constant.reshape(*constant.shape, *[1] * (like.ndim - constant.ndim))
