"""Springs and dampers between points of links, supports and the ground, and between their angles.

With Δ the vector from one end to the other, Δ₀ as drawn and δ = Δ − Δ₀ the contribution of displacements,

    F = (k e + d u·Δ') u,   u = Δ/|Δ|,   e = |Δ| − |Δ₀| = (2 Δ₀·δ + δ·δ)/(|Δ| + |Δ₀|)

acts on the one end and −F on the other; where a spring has no length as drawn, F = k Δ + d Δ' exactly.  Displacements
are found without the places themselves, so that small motions keep their digits.  A force F on the point at the
distance s from the upper joint of a link acts on its angle by s n·F, on those above it by l n·F, n = (cos θ, −sin θ),
and on what carries the first joint; forces on one link are added up before they are handed on, as those of drag are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.structure import CarrierEnd, End, LinkEnd, SpringNumbers, Structure
from modal.types import Booleans, Ints
from nonlinear.system import Group, System, drawn_place, place_of
from nonlinear.system.system import spread

Vector = tuple[Any, Any]


class Tension(NamedTuple):
    """Of this many springs the extension e (m, or rad), the pull (N, or N m) and the energy (J), (E, ...) each.

    `force` (2, E, ...) is that on their first ends (N), of those between angles the torque (E, ...), and `power` (...)
    the power (W) of their dampers.
    """

    extension: Any
    pull: Any
    energy: Any
    force: Any
    power: Any


class Strained(NamedTuple):
    """The forces of springs: generalized forces on the angles of links (L, ...), and on first joints of every group.

    The latter are (2, P, ...) along the rail and down, None if no spring ends in a group; those `on_links` are (2, L,
    ...), and `power` is in W.
    """

    torques: Any
    at_joints: list[Any]
    power: Any
    on_links: Any


def stretch_law(k: Any, d: Any, ax: Any, az: Any, rest: Any, x: Any, z: Any, vx: Any, vz: Any) -> tuple[Any, ...]:
    """Extension, pull, force on the first end along the rail and down, power of one with Δ₀ = (ax, az), |Δ₀| = rest.

    δ = (x, z) and Δ' = (vx, vz).
    """
    bx, bz = ax + x, az + z
    length = np.sqrt(bx * bx + bz * bz)
    extension = (2 * (ax * x + az * z) + (x * x + z * z)) / (length + rest)
    ux, uz = bx / length, bz / length
    rate = ux * vx + uz * vz
    pull = k * extension + d * rate
    return extension, pull, ux * pull, uz * pull, -(d * (rate * rate))


def slack(k: Any, d: Any, x: Any, z: Any, vx: Any, vz: Any) -> tuple[Any, ...]:
    """The same of one without a length as drawn: δ = Δ."""
    length = np.sqrt(x * x + z * z)
    return length, k * length, k * x + d * vx, k * z + d * vz, -(d * (vx * vx + vz * vz))


def twist_law(stiffness: Any, damping: Any, angle: Any, turning: Any) -> Tension:
    """Springs between angles."""
    torque, power = stiffness * angle + damping * turning, -(damping * (turning * turning)).sum(0)
    return Tension(angle, torque, stiffness * (angle * angle) / 2, torque, power)


def _tension(stiffness: Any, stretch: tuple[Any, ...]) -> Tension:
    extension, pull, fx, fz, power = stretch
    return Tension(extension, pull, stiffness * (extension * extension) / 2, np.stack((fx, fz)), power.sum(0))


class Nodes(NamedTuple):
    """The points at which springs end: those of links, `link` (N,) and `below` (N, ...), then those of supports."""

    link: Ints
    below: Any
    carriers: tuple[CarrierEnd, ...]


@dataclass(frozen=True, eq=False)
class Springs:
    """The springs between points of a system."""

    system: System

    @property
    def structure(self) -> Structure:
        """The parts that they belong to."""
        return self.system.suspension

    @cached_property
    def kinds(self) -> tuple[Ints, Ints, Ints]:
        """The numbers of those with a length as drawn, of those without, and of those between angles."""
        torsion: Booleans = np.array([spring.torsion for spring in self.structure.springs])
        loose: Booleans = np.array(self.system.slack)
        return np.flatnonzero(~torsion & ~loose), np.flatnonzero(~torsion & loose), np.flatnonzero(torsion)

    @cached_property
    def nodes(self) -> tuple[Nodes, Ints]:
        """The points, and the two of every spring (2, E), −1 for the ground; those between angles have none."""
        links: list[tuple[int, int, LinkEnd]] = []
        carriers: list[tuple[int, int, CarrierEnd]] = []
        for k in np.concatenate(self.kinds[:2]).tolist():
            for side, end in enumerate(self.structure.springs[k].ends):
                if isinstance(end, LinkEnd):
                    links.append((side, k, end))
                elif isinstance(end, CarrierEnd):
                    carriers.append((side, k, end))
        pairs = np.full((2, len(self.structure.springs)), -1)
        for number, (side, k, _) in enumerate([*links, *carriers]):
            pairs[side, k] = number
        link = np.array([end.link for *_, end in links], dtype=np.int64)
        below = array_of([self.below(end) for *_, end in links])
        return Nodes(link, below, tuple(end for *_, end in carriers)), pairs

    def below(self, end: LinkEnd) -> Any:
        """The distance (m) of an end from the upper joint of its link."""
        if end.below is not None:
            return end.below
        group, row, column = place_of(self.system, end.link)
        return group.block.centre[row, column]

    @cached_property
    def numbers(self) -> tuple[Any, Any]:
        """Stiffness and damping, (E, ...) each."""
        springs = self.structure.springs
        return array_of([spring.stiffness for spring in springs]), array_of([spring.damping for spring in springs])

    @cached_property
    def drawn_vectors(self) -> tuple[Any, Any]:
        """Δ₀ (2, E, ...) and |Δ₀| (E, ...) of those with a length as drawn."""
        pairs = [self.structure.springs[k].ends for k in self.kinds[0]]
        places = [tuple(drawn_place(self.system, end) for end in ends) for ends in pairs]
        vectors = [tuple(b[k] - a[k] if a and b else 0.0 for k in (0, 1)) for a, b in places]
        rest = [np.sqrt(x * x + z * z) for x, z in vectors]
        components = array_of([vector[k] for k in (0, 1) for vector in vectors])
        return components.reshape(2, len(vectors), *components.shape[1:]), array_of(rest)

    def tensions(self, q: Any, v: Any, carrying: Any) -> list[tuple[Ints, Tension]]:
        """The forces of springs of each kind, with their numbers, at coordinates q and rates v (half, ...)."""
        tight, loose, torsion = self.kinds
        stiffness, damping = (spread(part, q) for part in self.numbers)
        tensions = []
        if len(tight) or len(loose):
            places, speeds = self._node_motion(q, v, carrying)
            _, (first_nodes, second_nodes) = self.nodes
            stretch, speed = (part[:, second_nodes] - part[:, first_nodes] for part in (places, speeds))
            if len(tight):
                vector, rest = spread(self.drawn_vectors[0], stretch), spread(self.drawn_vectors[1], q)
                part = stretch[:, tight], speed[:, tight]
                law = stiffness[tight], damping[tight], *vector, rest
                tensions.append((tight, _tension(stiffness[tight], stretch_law(*law, *part[0], *part[1]))))
            if len(loose):
                law = stiffness[loose], damping[loose]
                tension = _tension(law[0], slack(*law, *stretch[:, loose], *speed[:, loose]))
                x, z = stretch[:, loose]
                tensions.append((loose, tension._replace(energy=law[0] * (x * x + z * z) / 2)))
        if len(torsion):
            angles = [
                np.stack([self._angle_between(self.structure.springs[k], values, carrying) for k in torsion])
                for values in (q, v)
            ]
            tensions.append((torsion, twist_law(stiffness[torsion], damping[torsion], *angles)))
        return tensions

    def _angle_between(self, spring: SpringNumbers, values: Any, carrying: Any) -> Any:
        first, second = (self._angle(end, values, carrying) for end in spring.ends)
        return second - first

    def _angle(self, end: End, values: Any, carrying: Any) -> Any:
        if isinstance(end, LinkEnd):
            return values[self.structure.size + end.link]
        return carrying.angle(end.carrier, values) if isinstance(end, CarrierEnd) else 0.0

    def _node_motion(self, q: Any, v: Any, carrying: Any) -> tuple[Any, Any]:
        """Displacements and velocities (2, N + 1, ...) of all points, the ground last."""
        size, (nodes, _) = self.structure.size, self.nodes
        count = len(nodes.link)
        links = q[size:]
        shape = (2, count + len(nodes.carriers) + 1, *links.shape[1:])
        places, speeds = (np.full(shape, 0.0, dtype=links.dtype) for _ in range(2))
        if count:
            upper = [np.full((2, *links.shape), 0.0, dtype=links.dtype) for _ in range(2)]
            for number, group in enumerate(self.system.groups):
                steps_below = _upper(group, links[group.index], v[size:][group.index])
                for upper_part, steps, pivot in zip(upper, steps_below, carrying.pivots(number), strict=True):
                    for k in (0, 1):
                        upper_part[k][group.index] = steps[k] + pivot[k]
            theta, omega, below = links[nodes.link], v[size:][nodes.link], spread(nodes.below, links)
            S, C = np.sin(theta), np.cos(theta)
            offset = below * S, -(below * versine(theta))
            turning = below * (C * omega), -(below * (S * omega))
            for k in (0, 1):
                places[k, :count] = upper[0][k][nodes.link] + offset[k]
                speeds[k, :count] = upper[1][k][nodes.link] + turning[k]
        for number, end in enumerate(nodes.carriers, count):
            place, _, speed = carrying.point(end)
            for k in (0, 1):
                places[k, number], speeds[k, number] = place[k], speed[k]
        return places, speeds

    def forces(self, q: Any, v: Any, carrying: Any) -> Strained:
        """Their forces; those on supports at which they end are added at once."""
        size, (nodes, pairs) = self.structure.size, self.nodes
        links, count = q[size:], len(nodes.link)
        torques, power = np.full(links.shape, 0.0, dtype=links.dtype), 0.0
        pushes = np.full((2, count + len(nodes.carriers) + 1, *links.shape[1:]), 0.0, dtype=links.dtype)
        for numbers, part in self.tensions(q, v, carrying):
            power = power + part.power
            if numbers is self.kinds[2]:
                for number, torque in zip(numbers, part.force, strict=True):
                    for end, sign in zip(self.structure.springs[number].ends, (1.0, -1.0), strict=True):
                        if isinstance(end, LinkEnd):
                            torques[end.link] = torques[end.link] + sign * torque
                        elif isinstance(end, CarrierEnd):
                            carrying.turn(end.carrier, sign * torque)
                continue
            for k in (0, 1):
                np.add.at(pushes[k], pairs[0, numbers], part.force[k])
                np.subtract.at(pushes[k], pairs[1, numbers], part.force[k])
        for number, end in enumerate(nodes.carriers, count):
            carrying.push(end.carrier, carrying.point(end)[1], (pushes[0, number], pushes[1, number]))
        at_joints: list[Any] = [None] * len(self.system.groups)
        on, moment = np.full((2, 2, *links.shape), 0.0, dtype=links.dtype)
        if count:
            below = spread(nodes.below, links)
            for k in (0, 1):
                np.add.at(on[k], nodes.link, pushes[k, :count])
                np.add.at(moment[k], nodes.link, below * pushes[k, :count])
            for number, group in enumerate(self.system.groups):
                part, theta = on[:, group.index], links[group.index]
                through = np.cumsum(part[:, ::-1], axis=1)[:, ::-1]
                arms = spread(group.block.length, theta) * (through - part) + moment[:, group.index]
                torques[group.index] = torques[group.index] + (np.cos(theta) * arms[0] - np.sin(theta) * arms[1])
                at_joints[number] = through[:, 0]
        return Strained(torques, at_joints, power, on)


def _upper(group: Group, angles: Any, rates: Any) -> tuple[Any, Any]:
    """Displacements and velocities (2, n, P, ...) of upper joints, as if the first were at rest."""
    length = spread(group.block.length, angles)
    steps = np.stack((length * np.sin(angles), -(length * versine(angles))))
    moves = np.stack((length * (np.cos(angles) * rates), -(length * (np.sin(angles) * rates))))
    return np.cumsum(steps, axis=1) - steps, np.cumsum(moves, axis=1) - moves


def versine(angle: Any) -> Any:
    """1 − cos, with all digits."""
    half = np.sin(angle / 2)
    return 2 * (half * half)


def array_of(values: Sequence[Any]) -> Any:
    """An array (N, ...) of numbers, arrays or symbols."""
    if any(isinstance(value, np.ndarray) for value in values):
        return np.stack(np.broadcast_arrays(*values))
    plain = all(isinstance(value, float | int) for value in values)
    array = np.empty(len(values), dtype=float if plain else object)
    array[:] = values
    return array
