"""Positions, energies, momenta and forces of a motion, by the same code in the plane and in space.

Vectors have the components (along the rail, down) in the plane and (along, across, down) in space.
On a support that moves as prescribed positions are those in the laboratory; velocities, energies and momenta are those
in the support's frame.

T and V are plain arithmetic: of many states at once, or recorded.  Potential energy is counted from the scene's rest,
by σ − cos θ = 2 σ sin² ((θ − rest)/2) and, in space, σ − u·e_z = σ |u − σ e_z|²/2, with σ = 1 for a link that hangs
there and −1 for an inverted one: small motions keep their digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Booleans, Floats
from nonlinear.dynamics.bearing import Bearing
from nonlinear.dynamics.forces import forces_of, relative, resultants, spring_energy
from nonlinear.dynamics.inputs import with_lengths
from nonlinear.dynamics.spatial import joint_energy
from nonlinear.dynamics.structure import carriers_of
from nonlinear.system import Group, Layout, Motion, System
from nonlinear.system.system import spread

Along = tuple[Any, Any]
"""Components of first joints along the rail and down, each combined with that of links (T, n, P)."""
NUMBERS_IN_CACHE = 16_000
"""Cost: links times instants in one block that fits a processor's cache."""


def vectors(motion: Motion) -> tuple[Floats, Floats]:
    """The unit vector along every link and its rate (1/s), each (T, L, 2) or (T, L, 3)."""
    if motion.links.ndim == 3:
        return motion.links, motion.link_rates
    sin, cos = np.sin(motion.links), np.cos(motion.links)
    rates = motion.link_rates[..., None]
    return np.stack((sin, cos), axis=-1), rates * np.stack((cos, -sin), axis=-1)


def chain_sums(
    system: System,
    pivots: Sequence[Along],
    per_metre: Floats,
    length: Floats | None = None,
    extra: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Sums along chains at lower joints and centres, each (T, L, d); a metre of link contributes `per_metre` (T, L, d).

    Gives positions from unit vectors, velocities from their first and accelerations from their second derivatives;
    `pivots` are the same quantity of first joints, group by group along the rail and down, (T, 1, P) each.  Where
    lengths change, `length` (T, L) are those and `extra` (T, L, d) the part due to their change, by which the bobs
    at their ends move as well.
    """
    ends, centres = np.empty_like(per_metre), np.empty_like(per_metre)
    for group, pivot in zip(system.groups, pivots, strict=True):
        directions = per_metre[:, group.index]
        reach, rest = group.block.length, group.block.centre - group.block.length
        if length is not None and system.hoisting is not None:
            reach, rest = length[:, group.index], np.where(system.hoisting.moving[group.index], 0.0, rest)
        steps = reach[..., None] * directions + (0.0 if extra is None else extra[:, group.index])
        lower = np.cumsum(steps, axis=1)
        for k, values in zip((0, -1), pivot, strict=True):
            lower[..., k] += values
        ends[:, group.index] = lower
        centres[:, group.index] = lower + rest[..., None] * directions
    return ends, centres


def _as_columns(values: Any) -> Any:
    """Values of first joints, (P, T) or of all alike (T,), next to those of links (T, n, P)."""
    values = np.asarray(values)
    return values.T.reshape(values.shape[-1], 1, -1) if values.ndim else values


@dataclass(frozen=True, eq=False, repr=False)
class Mechanics(Displayed):
    """Quantities of T states, computed on demand.

    Their `times` (T,) in s are needed where lengths change; `support` (T, d) are the places (m) of a moving support in
    the laboratory.
    """

    what = "Positions, energies and momenta, computed when asked for"
    shows = "system: system; times: times, s"

    system: System
    motion: Motion
    times: Floats | None = None
    support: Floats | None = None

    @cached_property
    def lengths(self) -> tuple[Floats, Floats, Floats] | None:
        """Lengths (m), their speeds and accelerations (T, L) where any change, else None."""
        if self.system.hoisting is None:
            return None
        if self.times is None:
            raise ComputationError("the lengths of this scene change: its positions and energies need times")
        return self.system.hoisting.at(self.times)

    def _chain_sums(
        self, pivots: Sequence[Along], per_metre: Floats, extra: Callable[..., Floats]
    ) -> tuple[Floats, Floats]:
        """`chain_sums` with the contribution of changing lengths, `extra` of length, speed, acceleration (T, L, 1)."""
        if self.lengths is None:
            return chain_sums(self.system, pivots, per_metre)
        return chain_sums(
            self.system, pivots, per_metre, self.lengths[0], extra(*(part[..., None] for part in self.lengths))
        )

    @cached_property
    def bearing(self) -> Bearing:
        """The supports of the pendula at all times, with arrays (T,)."""
        return Bearing(carriers_of(self.system), *self._coordinates, bare=True)

    @property
    def _coordinates(self) -> tuple[Floats, Floats]:
        """The coordinates and their rates, (half, T)."""
        layout = Layout.of(self.system, works=False, width=3 if self.system.spatial else 1)
        rows = layout.rows(self.motion).T
        return rows[: layout.half], rows[layout.half :]

    @cached_property
    def _pivots(self) -> tuple[list[Along], list[Along]]:
        """Places (m) and velocities (m/s) of first joints group by group."""
        places, speeds = [], []
        for number, rest in enumerate(carriers_of(self.system).drawn_places):
            displacement, speed = self.bearing.pivots(number)
            places.append((rest[0] + _as_columns(displacement[0]), rest[1] + _as_columns(displacement[1])))
            speeds.append((_as_columns(speed[0]), _as_columns(speed[1])))
        return places, speeds

    def pivot_accelerations(self, carrier_accelerations: Floats) -> list[Along]:
        """Those (m/s²) of first joints group by group, from η'' (T, d)."""
        self.bearing.solution = list(carrier_accelerations.T)
        starts = [self.bearing.start(number, 0.0) for number in range(len(self.system.groups))]
        return [(_as_columns(along), _as_columns(down)) for along, down in starts]

    @cached_property
    def springs(self) -> tuple[Floats, Floats, Floats]:
        """Of every spring between points extension (m or rad), pull (N or N m) and energy (J), (T, E) each."""
        tensions = np.zeros((3, len(self.motion.work), len(self.system.suspension.springs)))
        for numbers, tension in self.bearing.tensions(*self._coordinates):
            for part, values in zip(tensions, (tension.extension, tension.pull, tension.energy), strict=True):
                part[:, numbers] = values.T
        return tensions[0], tensions[1], tensions[2]

    @cached_property
    def vectors(self) -> tuple[Floats, Floats]:
        """Unit vectors along the links and their rates (1/s)."""
        return vectors(self.motion)

    @cached_property
    def joints(self) -> Floats:
        """Position (m) of every link's lower joint, (T, L, d)."""
        return self._positions[0]

    @cached_property
    def centres(self) -> Floats:
        """Position (m) of every link's centre of mass, (T, L, d)."""
        return self._positions[1]

    @cached_property
    def _positions(self) -> tuple[Floats, Floats]:
        u = self.vectors[0]
        ends, centres = self._chain_sums(self._pivots[0], u, lambda l, v, a: 0.0 * u)
        if self.support is not None:
            ends, centres = (values + self.support[:, None] for values in (ends, centres))
        return ends, centres

    @cached_property
    def speeds(self) -> Floats:
        """Velocity (m/s) of every centre of mass, (T, L, d)."""
        u, w = self.vectors
        return self._chain_sums(self._pivots[1], w, lambda l, v, a: v * u)[1]

    @cached_property
    def _parts(self) -> Energies:
        return energies(self.system, *self._coordinates, 0.0 if self.lengths is None else self.times)

    @property
    def kinetic(self) -> Floats:
        """Kinetic energy (J) of every link, (T, L)."""
        return np.asarray(self._parts.kinetic.T)

    @property
    def potential(self) -> Floats:
        """Potential energy (J) of every link relative to equilibrium, with its upper joint's spring, (T, L)."""
        return np.asarray(self._parts.potential.T)

    @property
    def cart_kinetic(self) -> Floats:
        """Kinetic energy (J) of the cart or the supports, (T,)."""
        return np.asarray(self._parts.cart_kinetic + 0.0 * self.motion.cart)

    @property
    def cart_potential(self) -> Floats:
        """Energy (J) of the cart's spring; that of supports and of all springs between points, (T,)."""
        return np.asarray(self._parts.cart_potential + 0.0 * self.motion.cart)

    @cached_property
    def energy(self) -> Floats:
        """Total energy (J), (T,)."""
        kinetic, potential = self.energies
        return np.asarray(kinetic + potential)

    @cached_property
    def energies(self) -> tuple[Floats, Floats]:
        """Kinetic and potential energy (J) of the scene, each (T,), in blocks that fit a processor's cache."""
        rows, times = max(1, NUMBERS_IN_CACHE // self.system.n_links), len(self.motion.cart)
        none = 0.0 * self.motion.cart
        if times <= rows:
            return np.asarray(self._parts.moving + none), np.asarray(self._parts.potential_energy + none)
        clauses = [slice(at, at + rows) for at in range(0, times, rows)]
        whens = [None if self.times is None else self.times[clause] for clause in clauses]
        pairs = zip(clauses, whens, strict=True)
        parts = [Mechanics(self.system, self.motion.at(clause), when).energies for clause, when in pairs]
        kinetic, potential = map(np.concatenate, zip(*parts, strict=True))
        return kinetic, potential

    def of_pendula(self, values: Floats) -> Floats:
        """Sums over each pendulum of values (T, L) of links, (T, N)."""
        sums = np.zeros((len(values), self.system.n_pendula))
        for group in self.system.groups:
            sums[:, group.pendula] = values[:, group.index].sum(1)
        return sums

    @cached_property
    def momentum(self) -> Floats:
        """Momentum (kg m/s) along the rail, (T,): conserved for a free cart."""
        return np.asarray(self.bearing.momentum + self.speeds[..., 0] @ self.system.mass)

    @cached_property
    def spin(self) -> Floats:
        """Angular momentum (kg m²/s) about the vertical through the support, (T,), in space."""
        (u, w), r, v = self.vectors, self.centres, self.speeds
        orbital = (r[..., 0] * v[..., 1] - r[..., 1] * v[..., 0]) @ self.system.mass
        turning = (u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]) @ self.system.by_link("inertia")
        return np.asarray(orbital + turning)

    def pivot_forces(
        self, accelerations: tuple[Sequence[Along], Floats], support: tuple[Floats, Floats] | None = None
    ) -> Floats:
        """Force (N) on every link from above at its upper joint, (T, L, d).

        `accelerations` are those of first joints (`pivot_accelerations`), and the second derivatives of the unit
        vectors (T, L, d), `support` the acceleration and the velocity of a moving support (T, d): Newton's second law
        for the link and all below it, on which their drag and springs act as well.
        """
        u, w = self.vectors
        bodily = self._chain_sums(*accelerations, lambda l, v, a: a * u + 2 * v * w)[1]
        if support is not None:
            bodily += support[0][:, None]
        bodily[..., -1] -= self.system.gravity
        forces = self.system.mass[:, None] * bodily
        if self.system.has_drag:
            forces -= forces_of(self.system, self.speeds if support is None else self.speeds + support[1][:, None])
        if self.system.acting:
            assert self.times is not None
            states = np.concatenate(self._coordinates).T
            rows = zip(self.motion.links, self.times, states, strict=True)
            forces -= [resultants(self.system, angles, t, y)[0] for angles, t, y in rows]
        spring_forces = self.bearing.forces_on_links(*self._coordinates)
        if spring_forces is not None:
            forces -= spring_forces.transpose(2, 1, 0)
        for group in self.system.groups:
            shares = forces[:, group.index]
            forces[:, group.index] = np.cumsum(shares[:, ::-1], axis=1)[:, ::-1]
        return forces


@dataclass(frozen=True, eq=False, repr=False)
class Reactions(Displayed):
    """Forces (N) at T times.

    `normal` (T,): the rail's push up on the cart, or a fixed support's on everything (R in paper 000, section IV.A).
    `pivots` (T, L, d): the force on each link from above at its upper joint, along the rail and down (in space along,
    across and down).  `tops` (L,) marks the links that hang from the support.
    """

    what = "Reaction forces (N)"
    shows = "normal: on the rail; pivots: at pivots; tops: at the tops of links"

    normal: Floats
    pivots: Floats
    tops: Booleans

    @property
    def R_B(self) -> Floats:
        """Force of the support on the first link of every pendulum, as in paper 000."""
        return self.pivots[:, self.tops]

    @property
    def R_P(self) -> Floats:
        """Force of every further link on the one above it: paper 000 draws it on the upper link."""
        return -self.pivots[:, ~self.tops]


class Energies(NamedTuple):
    """Kinetic and potential energy (J) of every link, (L, ...), and of the supports, such as a cart, (...).

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
    def potential_energy(self) -> Any:
        """Potential energy of everything, (...)."""
        return self.potential.sum(0) + self.cart_potential

    @property
    def total(self) -> Any:
        """Of everything, (...)."""
        return self.moving + self.potential_energy

    def by_pendulum(self, system: System) -> Energies:
        """The same of every pendulum, (N, ...), in place of every link."""
        sums = np.zeros((2, system.n_pendula, *self.kinetic.shape[1:]))
        for total, part in zip(sums, self[:2], strict=True):
            for group in system.groups:
                total[group.pendula] = part[group.index].sum(0)
        return self._replace(kinetic=sums[0], potential=sums[1])


class LinkMotion(NamedTuple):
    """How the links of a group move, (n, P, ...), as if the first joints were at rest.

    Along each axis `rates` are those of their directions and `ropes` these themselves; `spin` are the squares of all
    rates, `lifts` how far a metre of link is above its rest, `spring_energies` and `rotor_energies` those of joints
    (J).
    """

    rates: Sequence[Any]
    ropes: Sequence[Any]
    spin: Any
    lifts: Any
    spring_energies: Any
    rotor_energies: Any = 0.0


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
        current, winding = _group_at(system, group, times, links[place])
        swing = (_in_space if system.spatial else _in_plane)(current, links[place], rates[place], base)
        kinetic[group.index] = kinetic_energy(current, swing, speed, winding)
        heights = along_chain(current, swing.lifts) - down
        if current is not group:
            sigma, longer = spread(group.block.sigma, swing.spin), spread(group.block.length, swing.spin)
            heights = heights + np.cumsum(sigma * (longer - current.block.length), axis=0)
        potential[group.index] = (
            spread(current.block.mass, swing.spin) * system.gravity * heights + swing.spring_energies
        )
    springs = sum((spring.energy.sum(0) for _, spring in bearing.tensions(q, v)), 0.0)
    return Energies(kinetic, potential, bearing.kinetic, bearing.potential + springs)


def kinetic_energy(group: Group, swing: LinkMotion, speed: tuple[Any, Any], winding: Any) -> Any:
    """That of every link (J), (n, P, ...), whose first joints have this speed (m/s), along the rail and down.

    Their lengths change at speeds `winding`.
    """
    energy, mass = spread(group.block.inertia, swing.spin) * swing.spin, spread(group.block.mass, swing.spin)
    sideways = [0.0] * (len(swing.rates) - 2)
    for rates, ropes, pivot in zip(swing.rates, swing.ropes, (speed[0], *sideways, speed[1]), strict=True):
        energy = energy + mass * (along_chain(group, rates, winding * ropes) + pivot) ** 2
    return energy / 2 + swing.rotor_energies


def along_chain(group: Group, values: Any, extra: Any = 0.0) -> Any:
    """The sum at centres of `values` (n, P, ...) per metre of link, and `extra` of each rope that is wound."""
    length, centre = (spread(part, values) for part in (group.block.length, group.block.centre))
    return (length * values + extra).cumsum(0) + (centre - length) * values


def _in_plane(group: Group, angles: Any, rates: Any, base: Any) -> LinkMotion:
    s, c = np.sin(angles), np.cos(angles)
    half = np.sin((angles - spread(group.rest, angles)) / 2)
    spring_energies = spring_energy(group, angles, base and base[0]) if group.sprung else 0.0
    lifts = 2 * spread(group.block.sigma, angles) * (half * half)
    turn = relative(rates, base and base[1]) if group.has_rotors else 0.0
    rotor_energies = spread(group.block.rotor, rates) * (turn * turn) / 2
    return LinkMotion((c * rates, -(s * rates)), (s, c), rates * rates, lifts, spring_energies, rotor_energies)


def _in_space(group: Group, u: Any, w: Any, base: Any) -> LinkMotion:
    sigma = spread(group.block.sigma, u[0])
    lifts = sigma * (u[0] * u[0] + u[1] * u[1] + (u[2] - sigma) ** 2) / 2
    return LinkMotion(w, u, (w * w).sum(0), lifts, joint_energy(group, u) if group.sprung else 0.0)


def _group_at(system: System, group: Group, times: Any, like: Any) -> tuple[Group, Any]:
    """A group with the lengths of these times, and their speeds (n, P, ...)."""
    if (hoisting := system.hoisting) is None:
        return group, 0.0
    length, speed, _ = (spread(np.moveaxis(part, -1, 0)[group.index], like) for part in hoisting.at(times))
    moving = spread(hoisting.moving[group.index], like)
    return with_lengths(group, hoisting.moving, np.where(moving, length, spread(group.block.length, like))), speed
