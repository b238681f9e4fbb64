"""Equations of motion in minimal coordinates, solved group by group: in the plane one angle per link.

Each group reacts to the acceleration of its support by a force on each of its coordinates: on a cart's
mass · x'' + force, whose equation

    (m_c + Σ mass) x'' = F − c_c x' − k_c x − Σ force

gives x'' (the Schur complement of the cart), from which each group computes the accelerations of its links.  A fixed
support has no coordinate, a structure any number (`nonlinear.dynamics.structure`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, Protocol, cast

import numpy as np

from modal.structure.carriers import inner
from modal.types import Floats, Ints
from nonlinear.dynamics.bearing import Bearing, apply_inverse_mass
from nonlinear.dynamics.contacts import Rubbed, Sticking
from nonlinear.dynamics.forces import (
    Base,
    External,
    bending_torques,
    external_of_forces,
    inertial_torques,
    modal_drag,
    plane_drag,
)
from nonlinear.dynamics.inputs import Inputs, Instant, Lengths, input_of, with_lengths
from nonlinear.dynamics.recursion import (
    Answer,
    Bias,
    Geared,
    downward,
    geared_downward,
    geared_upward,
    lift_force,
    links_of,
    tensions,
    upward,
)
from nonlinear.dynamics.structure import carriers_of
from nonlinear.system import Group, Layout, Load, Motion, State, System


class GroupBody(Protocol):
    """Solver of one group of pendula."""

    def response(self, links: Any, rates: Any, torques: Any) -> Projection:
        """Return their reaction to motions of their first joints, under generalized forces on the links."""


class Projection(Protocol):
    """The reaction of a group of pendula on its supports, bundle by bundle in their order."""

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """The inertia (lower half) and the force on each coordinate of the support of the pendula in these columns.

        First joints move by these slopes (m, or m/rad, along the rail and down), all by the same where they
        `move_alike`, and `bias` is their acceleration, less gravity, without that of the coordinates.  Of a group with
        rotors each slope has a third entry, 1 for the coordinate that turns the support, else 0.
        """

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P, ...) by second derivatives of each bundle's coordinates, under these accelerations of joints."""


class Arranged(ABC):
    """Equations of a `system` under a `load`, with `width` numbers a link in y, which may include the work."""

    system: System
    load: Load | None
    counts_work: bool

    @property
    def width(self) -> int:
        """Numbers a link."""
        return 3 if self.system.spatial else 1

    @cached_property
    def layout(self) -> Layout:
        """The arrangement of y."""
        works = self.counts_work and (self.system.works or self.load is not None)
        return Layout.of(self.system, works=works, width=self.width)

    @cached_property
    def inputs(self) -> Inputs:
        """The inputs that depend on time."""
        return Inputs(self.system, self.load)

    @abstractmethod
    def derivative(self, time: Any, y: Any) -> Any:
        """The time derivative of y, (size, ...): further axes of y are independent trajectories."""

    def __getstate__(self) -> dict[str, Any]:
        """Without derived attributes: generated functions cannot be pickled."""
        return {part.name: getattr(self, part.name) for part in fields(cast("Any", self))}

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        return self.layout.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        return self.layout.read(rows)

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.layout.natural(self.system)

    @property
    def tangent_units(self) -> Floats:
        """The natural size of components across every unit vector in space, (L,): of rates (1/s) sqrt(g/l)."""
        return np.asarray(np.sqrt(self.system.gravity / self.system.by_link("length")))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """No constraints in the plane: y (..., size) is unchanged.

        In space normalized u and w across it, and the largest of ||u| − 1| and |u·w| / (|w| + `tangent_units`) removed.
        """
        if self.width == 1:
            return y, 0.0
        first, half, result = self.layout.first, self.layout.half, y.copy()
        places = slice(first, half), slice(half + first, 2 * half)
        u, w = (y[..., place].reshape(*y.shape[:-1], -1, 3) for place in places)
        length = np.sqrt((u * u).sum(-1))
        u = u / length[..., None]
        radial = (u * w).sum(-1)
        size = np.sqrt((w * w).sum(-1)) + self.tangent_units
        for place, part in zip(places, (u, w - radial[..., None] * u), strict=True):
            result[..., place] = part.reshape(*y.shape[:-1], -1)
        return result, float(max(np.max(abs(length - 1)), np.max(abs(radial) / size)))


@dataclass(frozen=True, eq=False)
class Suspended(Arranged):
    """The equations of a scene: `bodies` solve its groups, `load` acts from outside, y may include the work.

    A group without a body, or with its class alone, has ropes that change their length.
    """

    system: System
    bodies: tuple[Any, ...]
    load: Load | None = None
    counts_work: bool = True

    @cached_property
    @abstractmethod
    def places(self) -> tuple[Ints, ...]:
        """Positions of every group's numbers among those of all links."""

    @abstractmethod
    def acting(
        self, group: Group, links: Any, rates: Any, moments: Any | None, support: Any, base: Base | None = None
    ) -> tuple[Any, Any, Any]:
        """Generalized forces of joints, of external `moments` and of the acceleration of a `support`; their power (W).

        Conservative forces do not count in the power.  Last are the torques (N m) of the first joints on links below a
        `base` that turns, (P, ...), else 0.
        """

    @abstractmethod
    def drag_of(self, group: Group, links: Any, rates: Any, pivot: Any, support: Any, speed: Any) -> External:
        """The drag of a group's links."""

    def solvers(self, instant: Instant) -> list[tuple[Group, GroupBody]]:
        """Every group and its solver at an instant."""
        return [(group, body) for group, body in zip(self.system.groups, self.bodies, strict=True) if body]

    def derivative(self, time: Any, y: Any) -> Any:
        """The time derivative of y, (size, ...): further axes of y are independent trajectories."""
        return self.rates(y, self.inputs.at(time, y, self.layout))

    def groups_at(self, instant: Instant) -> list[Group]:
        """The groups with the lengths of an instant."""
        groups = self.system.groups
        return [self._group_with(group, instant.lengths) if instant.lengths else group for group in groups]

    def _group_with(self, group: Group, lengths: Lengths) -> Group:
        assert self.system.hoisting is not None
        return with_lengths(group, self.system.hoisting.moving, lengths.length[group.index])

    def rates(self, y: Any, instant: Instant) -> Any:
        """The time derivative of y, (size, ...), from the inputs at this instant."""
        return self.rates_and_friction(y, instant)[0]

    def bearing(self, q: Any, v: Any, instant: Instant, *, massless: bool = False) -> Bearing:
        """The part that carries the first joints, at this instant."""
        return Bearing(carriers_of(self.system), q, v, instant, massless=massless)

    def close_loops(self, y: Any, instant: Instant) -> Instant:
        """The instant with the inputs of loops, which see y, after the forces of the scene."""
        loops = self.system.loops
        if not loops or len(instant.forces) == len(self.system.acting):
            return instant
        held = iter(instant.held)
        inputs = (next(held) if loop.sample_time else input_of(loop, y) for loop in loops)
        return instant._replace(forces=(*instant.forces, *inputs))

    def rates_and_friction(self, y: Any, instant: Instant, response: Any = None) -> tuple[Any, Rubbed]:
        """The same, with the effects of dry friction.

        Where all contacts slide on a rail with a coefficient, the `response` (half,) to a unit of friction on it may
        be given.
        """
        system, layout, instant = self.system, self.layout, self.close_loops(y, instant)
        first, half = layout.first, layout.half
        q, v = y[:half], y[half : 2 * half]
        slopes = np.empty_like(y)
        slopes[:half] = v
        links, rates, bearing = q[first:], v[first:], self.bearing(q, v, instant)
        drag = self.modal_drag(v)
        _, externals, power = self.load_bearing(y, instant, bearing, self.solvers(instant))
        carrier_accelerations, working = bearing.solve(drag)
        for k, acceleration in enumerate(carrier_accelerations):
            slopes[half + k] = acceleration
        power = power + working
        accelerations = slopes[half : 2 * half]
        link_accelerations = accelerations[first:]
        for k, place in enumerate(self.places):
            link_accelerations[place] = bearing.fall(k)
        friction = Rubbed(accelerations, ())
        if instant.gripping is not None:
            gripping, normal = instant.gripping, partial(self.reaction, y, instant)
            if response is None:
                friction = Sticking(system, self.groups_at(instant), gripping, q, accelerations).apply_friction(normal)
            else:
                rail, reaction = gripping.on_rail(accelerations, response, normal)
                friction = Rubbed(accelerations + response * rail, (rail,), reaction)
            accelerations[:] = friction.accelerations
            bearing.solution = list(accelerations[:first])
            if friction.normal is not None:
                power = power + v[0] * (gripping.rail_coefficient * friction.normal)
        if instant.lengths is not None:
            power = self._power_with_winding(power, links, rates, link_accelerations, instant, bearing, externals)
        if layout.works:
            slopes[-1] = power
        return slopes, friction

    def forces(self, y: Any, instant: Instant) -> tuple[Any, Any]:
        """The generalized forces Q (half, ...) of all that acts, weights omitted, and the power (W)."""
        half, first = self.layout.half, self.layout.first
        v, groups, instant = y[half : 2 * half], self.system.groups, self.close_loops(y, instant)
        bearing, Q = self.bearing(y[:half], v, instant, massless=True), np.zeros_like(v)
        forces, _, power = self.load_bearing(y, instant, bearing, [(group, Unanswering()) for group in groups])
        carrier_forces, working = bearing.add_outside_forces(self.modal_drag(v))
        for place, force in zip(self.places, forces, strict=True):
            Q[first:][place] = force
        for k, value in enumerate(carrier_forces):
            Q[k] = value
        return Q, power + working

    def modal_drag(self, v: Any) -> Any:
        """The generalized forces of damping ratios; None without any."""
        return None if self.system.modal_damping is None else modal_drag(self.system, v)

    def load_bearing(
        self, y: Any, instant: Instant, bearing: Bearing, solvers: Sequence[tuple[Group, Any]]
    ) -> tuple[list[Any], list[External | None], Any]:
        """The generalized forces on the links of every group, those from outside, and the power (W).

        The bearing has taken them, with the groups.
        """
        system, first, half, push = self.system, self.layout.first, self.layout.half, instant.push
        links, rates, drag = y[first:half], y[half + first : 2 * half], self.modal_drag(y[half : 2 * half])
        moments = push.moments if push.moments is None or links.ndim > 1 else np.ravel(push.moments)
        power, forces_of_groups, externals = 0.0, [], []
        for k, (place, (group, body)) in enumerate(zip(self.places, solvers, strict=True)):
            directions, speed, moment = links[place], rates[place], None if moments is None else moments[place]
            frame = instant.support if system.support else None
            forces, work, reaction = self.acting(group, directions, speed, moment, frame, bearing.base(k))
            if bearing.torques is not None:
                forces = forces + bearing.torques[place]
            if drag is not None:
                resisting = drag[first:][place]
                forces, work = forces + resisting, work + np.sum(resisting * speed, axis=(0, 1))
            external = None
            if group.has_drag or instant.forces:
                external = self.external(group, directions, speed, bearing.velocity(k), instant)
            if external is not None:
                forces, work = forces + external.generalized_forces, work + external.power
            bearing.take(k, body, directions, speed, forces, external, reaction)
            power = power + work
            externals.append(external)
            forces_of_groups.append(forces)
        return forces_of_groups, externals, power

    def _power_with_winding(
        self,
        power: Any,
        links: Any,
        rates: Any,
        accelerations: Any,
        instant: Instant,
        bearing: Bearing,
        externals: Sequence[Any],
    ) -> Any:
        """The `power` (W) with that of the hoists."""
        lengths, gravity = instant.lengths, self.system.gravity
        assert lengths is not None
        for k, (place, group, external) in enumerate(zip(self.places, self.groups_at(instant), externals, strict=True)):
            winding = [part[group.index] for part in lengths[1:]]
            motion = links[place], rates[place], accelerations[place]
            # without the support's acceleration: with the work of its inertial forces on hoisted masses
            pulls = tensions(group, winding, *motion, bearing.start(k, gravity), external)
            power = power + (winding[0] * pulls).sum((0, 1))
        return power

    def external(self, group: Group, links: Any, rates: Any, pivot: Any, instant: Instant) -> External | None:
        """Drag and applied forces on a group; None without any."""
        winding = None if instant.lengths is None else instant.lengths.speed[group.index]
        drag = None
        if group.has_drag:
            velocity = instant.velocity if self.system.support else None
            drag = self.drag_of(group, links, rates, pivot, velocity, winding)
        if not instant.forces:
            return drag
        push = external_of_forces(group, self.system.acting, instant.forces, links, rates, pivot, winding)
        return push if drag is None else drag.plus(push)

    def responses(self, q: Any, instant: Instant) -> Any:
        """M⁻¹Jᵀ, the accelerations (half, J) by a unit of friction at every contact, at the lengths of an instant."""
        gripping = instant.gripping
        assert gripping is not None
        if instant.lengths is not None:
            zeros = np.zeros_like(instant.lengths.speed)
            instant = instant._replace(lengths=instant.lengths._replace(speed=zeros, acceleration=zeros))
        solvers = self.solvers(instant)
        forces = gripping.forces(self.layout.half).T
        return np.stack([apply_inverse_mass(self.system, solvers, q, force) for force in forces], axis=1)

    def reaction(self, y: Any, instant: Instant, accelerations: Any, is_full: bool = True) -> Any:
        """The rail's push N up on the cart (N), or if not `is_full` its part that is linear in the accelerations."""
        system, first, half = self.system, self.layout.first, self.layout.half
        instant = self.close_loops(y, instant)
        links, rates, link_accelerations = y[first:half], y[half + first : 2 * half], accelerations[first:]
        push, gravity = 0.0, 0.0
        if is_full and system.cart:
            gravity = system.gravity - instant.support[1]
            push = system.cart.mass * gravity
        for place, group in zip(self.places, self.groups_at(instant), strict=True):
            if not is_full:
                push = push + lift_force(group, links[place], 0.0, link_accelerations[place])
                continue
            speed, winding = rates[place], None
            if instant.lengths is not None:
                winding = [part[group.index] for part in instant.lengths[1:]]
            push = push + gravity * group.block.mass.sum((0, 1))
            push = push + lift_force(group, links[place], speed, link_accelerations[place], winding)
            external = self.external(group, links[place], speed, (y[half], 0.0), instant)
            if external is not None:
                push = push + external.forces[1].sum((0, 1))
        return push


class Unanswering:
    """A body without mass: forces on a group act only on its supports."""

    def response(self, angles: Any, rates: Any, torques: Any) -> Unanswering:
        """None."""
        return self

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """Nothing on any coordinate."""
        return [[0.0] * (k + 1) for k in range(len(slopes))], [0.0] * len(slopes)


class Recursion:
    """One pass up and one down in NumPy, for arrays (n, P, ...) of any type.

    Where lengths change, `winding` are their speeds and accelerations, (n, P) each.
    """

    def __init__(self, group: Group, tail: int = 0, winding: Any = None) -> None:
        self.winding, links, rotor = winding, links_of(group), group.block.rotor
        self.links = [type(link)(*(v.reshape(-1, *[1] * tail) for v in link)) for link in links] if tail else links
        self.rotors: Any = rotor.reshape(*rotor.shape, *[1] * tail) if group.has_rotors else None

    def response(self, angles: Any, rates: Any, torques: Any) -> Projection:
        """The reactions of the pendula to motions of their first joints."""
        bias = self._bias(rates)
        at = np.sin(angles), np.cos(angles), rates, torques, bias
        if self.rotors is not None:
            return RecursedWithRotors(self, *geared_upward(self.links, self.rotors, *at), bias)
        return Recursed(self, *upward(self.links, *at), bias)

    def _bias(self, rates: Any) -> list[Bias] | None:
        if self.winding is None:
            return None
        speed, acceleration = self.winding
        return [Bias(*pair) for pair in zip(2 * speed * rates, acceleration, strict=True)]


class Recursed:
    """Pendula on supports, by their reaction f = M ã + p at the first joint."""

    def __init__(self, body: Recursion, answer: Answer, turns: Any, bias: Any) -> None:
        self.body, self.answer, self.turns, self.bias = body, answer, turns, bias

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """J^T M J, its lower half, and J^T (M ã + p) of the pendula in these columns, summed."""
        if not slopes:
            return [], []
        parts = np.array(self.answer)[:, columns]
        answer = Answer(*(np.add.reduce(parts, 1) if move_alike else parts))
        fx, fz = answer.to(*bias)
        block, force = [], []
        for k, slope in enumerate(slopes):
            mx, mz = inner(slope, answer.xx, answer.xz), inner(slope, answer.xz, answer.zz)
            block.append([inner(earlier, mx, mz) for earlier in slopes[: k + 1]])
            force.append(inner(slope, fx, fz))
        if not move_alike:
            block, force = [[part.sum(0) for part in row] for row in block], [part.sum(0) for part in force]
        return block, force

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P, ...) under accelerations (m/s²) of first joints along the rail and down, less gravity."""
        ax, az = accelerations
        return np.array(downward(self.body.links, self.turns, ax, az, self.bias))


class RecursedWithRotors:
    """The same with rotors at joints, by f = M ã + r α + p and the moment r·ã + s α + q, α of the support."""

    def __init__(self, body: Recursion, answer: Geared, turns: Any, bias: Any) -> None:
        self.body, self.answer, self.turns, self.bias = body, answer, turns, bias
        self.turning: list[tuple[Any, list[float]]] = []

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """The lower half of the inertia, and the forces, of the pendula in these columns, summed."""
        self.turning.append((columns, [turn for *_, turn in slopes]))
        parts = [part + 0.0 * self.turns[0].sin for part in self.answer]
        answer = Geared(*(np.add.reduce(part[columns], 0) if move_alike else part[columns] for part in parts))
        fx, fz, moment = answer.to(*bias)
        block, force = [], []
        for k, (*slope, turn) in enumerate(slopes):
            mx = inner(slope, answer.xx, answer.xz) + turn * answer.rx
            mz = inner(slope, answer.xz, answer.zz) + turn * answer.rz
            twist = inner(slope, answer.rx, answer.rz) + turn * answer.s
            block.append([inner((x, z), mx, mz) + also * twist for x, z, also in slopes[: k + 1]])
            force.append(inner(slope, fx, fz) + turn * moment)
        if not move_alike:
            block, force = [[part.sum(0) for part in row] for row in block], [part.sum(0) for part in force]
        return block, force

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P, ...) under accelerations (m/s²) of first joints along the rail and down, less gravity."""
        alpha = np.zeros_like(self.turns[0].e)
        for (columns, turns), push in zip(self.turning, pushes, strict=True):
            for turn, acceleration in zip(turns, push, strict=True):
                alpha[columns] = alpha[columns] + turn * acceleration
        base = (*accelerations, alpha)
        return np.array(geared_downward(self.body.links, self.body.rotors, self.turns, base, self.bias))


class Minimal(Suspended):
    """The equations of motion of a plane scene, y = (x, θ, x', θ', work)."""

    @cached_property
    def places(self) -> tuple[Ints, ...]:
        """Positions of every group's angles (n, P) among those of all links."""
        return tuple(group.index for group in self.system.groups)

    def solvers(self, instant: Instant) -> list[tuple[Group, GroupBody]]:
        """Every group and its solver, those whose ropes change their length with the lengths of this instant."""
        groups = zip(self.system.groups, self.bodies or [None] * len(self.system.groups), strict=True)
        return [
            self._strung(group, body or Recursion, instant) if body is None or isinstance(body, type) else (group, body)
            for group, body in groups
        ]

    def _strung(self, group: Group, kind: Callable[..., GroupBody], instant: Instant) -> tuple[Group, GroupBody]:
        assert instant.lengths is not None
        current = self._group_with(group, instant.lengths)
        return current, kind(current, winding=[part[group.index] for part in instant.lengths[1:]])

    def acting(
        self, group: Group, links: Any, rates: Any, moments: Any | None, support: Any, base: Base | None = None
    ) -> tuple[Any, Any, Any]:
        """Torques (n, P, ...) on the absolute angles, the power of joints, moments and inertial forces, reactions."""
        torques, power, reaction = moments, 0.0, 0.0
        if moments is not None:
            power = np.sum(moments * rates)
        if support is not None:
            power = power + (inertial_torques(group, links, support) * rates).sum((0, 1))
        if group.has_joint_torques:
            hinges, joint_power = bending_torques(group, links, rates, base)
            if base is not None:
                reaction = hinges[0].copy()
            hinges[:-1] -= hinges[1:].copy()
            torques = hinges if torques is None else torques + hinges
            power = power + joint_power
        return np.zeros_like(links) if torques is None else torques, power, reaction

    def drag_of(self, group: Group, links: Any, rates: Any, pivot: Any, support: Any, speed: Any) -> External:
        """Torques (n, P, ...) on the absolute angles, the force on the cart, and the power."""
        return plane_drag(group, links, rates, pivot, support, speed)


def drained_power(system: System, q: Floats, v: Floats, support: tuple[Any, Any] = (0.0, 0.0)) -> Floats:
    """Return the power (W), (S,), of dampers, joint drives and drag at states q and v (half, S).

    Drag is that in the laboratory, where the `support` moves at these velocities (m/s) along the rail and down.
    """
    equations, first = Minimal(system, (None,) * len(system.groups), counts_work=False), system.first
    y, instant = np.concatenate((q, v)), Instant(velocity=support)
    _, power = equations.forces(y, instant)
    bearing = equations.bearing(q, v, instant)
    for k, group in enumerate(system.groups):
        if group.has_drag:
            links, rates = q[first:][group.index], v[first:][group.index]
            external = equations.external(group, links, rates, bearing.velocity(k), instant)
            assert external is not None
            along, down = external.forces.sum((1, 2))
            power = power + along * support[0] + down * support[1]
    return np.asarray(power + 0.0 * q[0])
