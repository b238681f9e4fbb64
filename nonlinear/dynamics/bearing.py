"""The supports of the first joints of pendula at one instant: a structure, a fixed support or a cart.

Equations of motion ask a `Bearing` how the first joints move, hand over the pendula there group by group, and are given
back accelerations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modal.extend.scalars import plus
from modal.structure import CarrierEnd, CarrierNumbers, Moving
from modal.types import Ints
from nonlinear.dynamics.forces import Base, External
from nonlinear.dynamics.inputs import QUIET, Instant
from nonlinear.dynamics.structure import (
    Bundle,
    Carriers,
    Strained,
    Tension,
    Vector,
    carriers_of,
    elastic_forces,
    inertia,
    mounting_forces,
    solve_block,
    stored,
    thrown,
)
from nonlinear.system import Group, System


class Bearing:
    """Carriers with η and η' at an instant.

    `torques` are the generalized forces (L, ...) on the links of springs between points; None without any.
    """

    def __init__(
        self,
        carriers: Carriers,
        q: Any,
        v: Any,
        instant: Instant = QUIET,
        *,
        bare: bool = False,
        massless: bool = False,
    ) -> None:
        """Without weights, springs and all that acts, if `bare`: then it answers generalized forces alone.

        If `massless`, without the effects of their own mass: then only forces act here.
        """
        self.carriers, self.structure, system = carriers, carriers.structure, carriers.system
        size = self.structure.size
        self.instant, self.bare, self.massless, self.system = instant, bare, massless, system
        self.eta, self.rates = list(q[:size]), list(v[:size])
        self.moves = [
            [carriers.moving(part.carrier, carriers.where(part, self.eta), self.eta, self.rates) for part in bundles]
            for bundles in carriers.bundles
        ]
        self.right: list[Any] = [0.0] * size
        self.working: list[Any] = [0.0] * size
        self.blocks: list[list[list[Any]]] = []
        self.power: Any = 0.0
        self.taken: list[Any] = []
        self.solution: list[Any] = []
        along, down = instant.support
        self.felt: Vector = (0.0, 0.0) if bare else (along, down - system.gravity)
        self.links = q[size:]
        self.torques: Any = None
        self.strained: Strained | None = None
        for number, carrier in enumerate(self.structure.carriers):
            self._begin(number, carrier)
        if not bare and carriers.springs:
            self.strained = carriers.springs.forces(q, v, self)
            self.torques, self.power = self.strained.torques, self.power + self.strained.power

    def _begin(self, number: int, carrier: CarrierNumbers) -> None:
        """A support's own inertia, its springs, dampers and weight."""
        if not carrier.size:
            self.blocks.append([])
            return
        first, end = self.structure.offsets[number : number + 2]
        eta, rates = self.eta[first:end], self.rates[first:end]
        centre: Any = None if carrier.M is not None else self.carriers.centre(number, self.eta, self.rates)
        self.blocks.append(inertia(carrier, centre))
        if self.bare:
            return
        self.right[first:end], self.working[first:end] = mounting_forces(carrier, eta, rates)
        if not self.massless:
            for k, force in enumerate(thrown(carrier, centre, self.felt), first):
                self.right[k] = plus(self.right[k], 1.0, force - self.carriers.weights[k])
        if self.system.support and centre is not None:
            vx, vz = centre.velocity(rates)
            along, down = self.instant.support
            self.power = self.power - carrier.mass * (along * vx + down * vz)

    @property
    def kinetic(self) -> Any:
        """Return the kinetic energy (J) of the supports."""
        energy: Any = 0.0
        for number, block in enumerate(self.blocks):
            rates = self.structure.part(number, self.rates)
            for k, row in enumerate(block):
                for j, entry in enumerate(row):
                    share = entry * (rates[k] * rates[j])
                    energy = energy + (share / 2 if j == k else share)
        return energy

    @property
    def potential(self) -> Any:
        """Potential energy (J) of the supports' weights and own springs.

        It is 0 as drawn; that of the pendula is in the heights of their pivots, that of springs in `tensions`.
        """
        energy: Any = 0.0
        for number, carrier in enumerate(self.structure.carriers):
            eta = self.structure.part(number, self.eta)
            for k, (value, force) in enumerate(zip(eta, elastic_forces(carrier, eta), strict=True)):
                weight = self.carriers.weights[self.structure.offsets[number] + k]
                energy = energy + (weight * value - value * force / 2)
            jets, as_drawn = stored(carrier, eta), stored(carrier, [0.0] * len(eta))
            if jets is not None and as_drawn is not None:
                energy = energy + jets[0].value - as_drawn[0].value
            if carrier.M is None:
                _, down = carrier.displacement(carrier.centre, eta)
                energy = energy - carrier.mass * self.system.gravity * down
        return energy

    @property
    def momentum(self) -> Any:
        """Momentum (kg m/s) of the supports along the rail, modal ones excepted."""
        momentum: Any = 0.0
        for number, carrier in enumerate(self.structure.carriers):
            if carrier.M is None and carrier.size:
                moving = self.carriers.centre(number, self.eta, self.rates)
                momentum = momentum + carrier.mass * moving.velocity(self.structure.part(number, self.rates))[0]
        return momentum

    def tensions(self, q: Any, v: Any) -> list[tuple[Ints, Tension]]:
        """Return extensions, forces and energies of springs between points, with their numbers, kind by kind."""
        springs = self.carriers.springs
        return springs.tensions(q, v, self) if springs else []

    def forces_on_links(self, q: Any, v: Any) -> Any:
        """The force (2, L, ...) of springs between points on every link; None without any."""
        springs = self.carriers.springs
        return springs.forces(q, v, Bearing(self.carriers, q, v, bare=True)).on_links if springs else None

    def push(self, number: int, moving: Moving, force: Vector) -> None:
        """Apply a force (N), along the rail and down, to a point of a support with this motion."""
        first = self.structure.offsets[number]
        for k, (x, z) in enumerate(moving.slopes):
            self.right[first + k] = self.right[first + k] + (x * force[0] + z * force[1])

    def turn(self, number: int, torque: Any) -> None:
        """Apply a torque (N m) to a support; it has no effect on one that does not turn."""
        if (angle := self.structure.angle_of(number)) is not None:
            self.right[angle] = self.right[angle] + torque

    def angle(self, number: int, values: Sequence[Any] | None = None) -> Any:
        """The angle (rad) of a support, or of other `values` of its coordinates; 0.0 if it does not turn."""
        angle = self.structure.angle_of(number)
        return 0.0 if angle is None else (self.eta if values is None else values)[angle]

    def pivots(self, group: int) -> tuple[Vector, Vector]:
        """Return displacements (m) of the first joints of a group from the drawn positions, and their velocities."""
        structure, places = self.structure, []
        for bundle in self.carriers.bundles[group]:
            where = self.carriers.where(bundle, self.eta)
            places.append(
                structure.carriers[bundle.carrier].displacement(where, structure.part(bundle.carrier, self.eta))
            )
        return tuple(self._join(group, [place[k] for place in places]) for k in (0, 1)), self.velocity(group)

    def point(self, end: CarrierEnd) -> tuple[Vector, Moving, Vector]:
        """The displacement of a point of a support, how it moves, and its velocity."""
        eta, rates = (self.structure.part(end.carrier, values) for values in (self.eta, self.rates))
        moving = self.carriers.moving(end.carrier, end.where, self.eta, self.rates)
        return self.structure.carriers[end.carrier].displacement(end.where, eta), moving, moving.velocity(rates)

    def base(self, group: int) -> Base | None:
        """Angles and rates of the body that carries the first joints of a group; None if nothing there turns."""
        bundles = self.carriers.bundles[group]
        if all(self.structure.carriers[bundle.carrier].turning is None for bundle in bundles):
            return None
        angles, rates = ([self.angle(bundle.carrier, values) for bundle in bundles] for values in (None, self.rates))
        return self._join(group, angles), self._join(group, rates)

    def velocity(self, group: int) -> Vector:
        """The velocity of the first joints of a group (m/s), along the rail and down."""
        velocities = [
            moving.velocity(self.structure.part(bundle.carrier, self.rates))
            for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True)
        ]
        return tuple(self._join(group, [velocity[k] for velocity in velocities]) for k in (0, 1))

    def _join(self, group: int, values: Sequence[Any]) -> Any:
        """Values of the bundles of a group, (P, ...), or the one of all that move alike."""
        if len(values) == 1 and self.carriers.bundles[group][0].move_alike:
            return values[0]
        step = 3 if self.system.spatial else 1
        values_by_pendulum = np.zeros_like(self.links[step * self.system.groups[group].index[0]])
        for bundle, value in zip(self.carriers.bundles[group], values, strict=True):
            values_by_pendulum[bundle.columns] = value
        return values_by_pendulum

    def take(
        self, group: int, body: Any, links: Any, rates: Any, forces: Any, external: External | None, reaction: Any
    ) -> None:
        """Add the reaction of a group, projected on the coordinates of its supports."""
        response = body.response(links, rates, forces)
        pulls = [external.at_joints] if external is not None else []
        if external is not None:
            reaction = reaction + external.at_base
        if self.strained is not None and self.strained.at_joints[group] is not None:
            pulls.append(self.strained.at_joints[group])
        has_frame_power = self.system.support and self.structure.size and not self.bare
        mass = self.system.groups[group].block.mass if has_frame_power else None
        for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True):
            bias = moving.bias[0] + self.felt[0], moving.bias[1] + self.felt[1]
            slopes: Any = moving.slopes
            if self.system.groups[group].has_rotors:
                angle, first = self.structure.angle_of(bundle.carrier), self.structure.offsets[bundle.carrier]
                slopes = [(*slope, float(first + k == angle)) for k, slope in enumerate(slopes)]
            block, force = response.project_on_carrier(bundle.columns, slopes, bias, bundle.move_alike)
            self._add(bundle, moving, block, force, pulls)
            self._react(bundle, reaction, external)
            if mass is not None:
                vx, vz = moving.velocity(self.structure.part(bundle.carrier, self.rates))
                along, down = self.instant.support
                frame_power = mass[:, bundle.columns].sum(0) * (along * vx + down * vz)
                self.power = self.power - frame_power.sum(0)
        self.taken.append(response)

    def _add(self, bundle: Bundle, moving: Moving, block: Any, force: Any, pulls: Sequence[Any]) -> None:
        """The inertia and the force of a bundle, and forces on its first joints."""
        lower, first = self.blocks[bundle.carrier], self.structure.offsets[bundle.carrier]
        self.blocks[bundle.carrier] = [
            [a + b for a, b in zip(*rows, strict=True)] for rows in zip(lower, block, strict=True)
        ]
        for k, (x, z) in enumerate(moving.slopes):
            self.right[first + k] = self.right[first + k] - force[k]
            for pull in pulls:
                fx, fz = pull[0][bundle.columns], pull[-1][bundle.columns]
                push = x * fx.sum(0) + z * fz.sum(0) if bundle.move_alike else (x * fx + z * fz).sum(0)
                self.right[first + k] = self.right[first + k] + push

    def _react(self, bundle: Bundle, reaction: Any, external: External | None) -> None:
        """The torques of first joints on a support that turns."""
        angle = self.structure.angle_of(bundle.carrier)
        if angle is None or np.ndim(reaction) == 0:
            return
        self.right[angle] = self.right[angle] - reaction[bundle.columns].sum(0)
        if external is not None and np.ndim(external.at_base):
            self.power = self.power - external.at_base[bundle.columns].sum(0) * self.rates[angle]

    def add_outside_forces(self, drag: Any) -> tuple[Any, Any]:
        """The generalized forces (first, ...) and the power (W) of the loads here; `drag` is that of damping ratios."""
        push, size = self.instant.push, self.structure.size
        outside = push.supports if self.system.is_structured else [push.cart] * size
        for forces in (drag, outside):
            for k, value in enumerate([] if forces is None else forces[:size]):
                self.working[k] = plus(self.working[k], 1.0, value)
        for loop, strength in zip(self.system.loops, self.instant.forces[len(self.system.forces) :], strict=False):
            if loop.coordinate is not None:
                self.working[loop.coordinate] = plus(self.working[loop.coordinate], 1.0, strength)
        for force, strength in zip(self.system.acting, self.instant.forces, strict=False):
            if isinstance(force.carrier, CarrierEnd):
                self._act(force.carrier, force.direction, strength)
        for k, (value, rate) in enumerate(zip(self.working, self.rates, strict=True)):
            self.right[k], self.power = plus(self.right[k], 1.0, value), plus(self.power, value, rate)
        return self.right, self.power

    def solve(self, drag: Any) -> tuple[Any, Any]:
        """η'' (first, ...) of all supports, and the power."""
        self.add_outside_forces(drag)
        self.solution = self.solve_blocks()
        return self.solution, self.power

    def _act(self, end: CarrierEnd, direction: Any, size: Any) -> None:
        """A force of the scene on a support."""
        first = self.structure.offsets[end.carrier]
        if direction is None:
            if (angle := self.structure.angle_of(end.carrier)) is not None:
                self.working[angle] = self.working[angle] + size
            return
        moving = self.carriers.moving(end.carrier, end.where, self.eta, self.rates)
        for k, (x, z) in enumerate(moving.slopes, first):
            self.working[k] = self.working[k] + (x * direction[0] + z * direction[1]) * size

    def solve_blocks(self) -> list[Any]:
        """The solution of the supports' equations, block by block."""
        solution: list[Any] = []
        for number, block in enumerate(self.blocks):
            solution += solve_block(block, list(self.structure.part(number, self.right)))
        return solution

    def fall(self, group: int) -> Any:
        """The second derivatives of the links of a group, once this is solved."""
        pushes = [self.structure.part(bundle.carrier, self.solution) for bundle in self.carriers.bundles[group]]
        return self.taken[group].fall(pushes, self._accelerations(group, self.felt))

    def start(self, group: int, gravity: Any) -> tuple[Any, Any]:
        """The acceleration (m/s²) of a group's first joints along the rail and down in their frame, less gravity."""
        return self._accelerations(group, (0.0, -gravity))

    def _accelerations(self, group: int, bias: Vector) -> tuple[Any, Any]:
        accelerations = []
        for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True):
            ax, az = moving.velocity(self.structure.part(bundle.carrier, self.solution))
            accelerations.append((ax + (moving.bias[0] + bias[0]), az + (moving.bias[1] + bias[1])))
        return self._join(group, [pair[0] for pair in accelerations]), self._join(
            group, [pair[1] for pair in accelerations]
        )


def apply_inverse_mass(
    system: System, solvers: Sequence[tuple[Group, Any]], q: Any, p: Any, places: Sequence[Ints] | None = None
) -> Any:
    """M⁻¹ p (half, ...), the accelerations by generalized forces p alone, at the coordinates q (half, ...).

    `places` are the positions of each group's numbers among those of all links, by default one of every link.
    """
    size, rates = system.first, np.zeros(np.shape(p), dtype=np.result_type(q, p))
    where = [group.index for group, _ in solvers] if places is None else places
    bearing = Bearing(carriers_of(system), q, 0 * q, bare=True)
    bearing.right = list(p[:size])
    for k, (place, (_, body)) in enumerate(zip(where, solvers, strict=True)):
        links = q[size:][place]
        bearing.take(k, body, links, 0 * links, p[size:][place], None, 0.0)
    bearing.solution = bearing.solve_blocks()
    for k, acceleration in enumerate(bearing.solution):
        rates[k] = acceleration
    for k, place in enumerate(where):
        rates[size:][place] = bearing.fall(k)
    return rates
