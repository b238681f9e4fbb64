"""Supports that move with coordinates η, at any angle; a fixed support has none, a cart one.

The pivots r_p(η) have J_p = ∂r_p/∂η.  A chain answers an acceleration a of its pivot with the force R (a − g e_z) + p,
found by one pass from its tip (`nonlinear.dynamics.recursion`), so that

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

with a block for each support, which elimination solves; then one pass goes down each chain.  Q_s has the supports'
springs and dampers, their weights, and the terms of M_s'(η).  Where a support has a spring this carries the weight at
the drawn rest: its potential is ½ k η² + W η with W = g Σ m ∂z/∂η there.  The torque of a first joint on a support that
turns acts on the angle of the link relative to it, and reversed on the support.

Every line is plain arithmetic: it accepts floats, arrays with further axes, complex numbers and recorded symbols.

Springs and dampers between points of links, supports and the ground, and between their angles.

With Δ the vector from one end to the other, Δ₀ as drawn and δ = Δ − Δ₀ the contribution of displacements,

    F = (k e + d u·Δ') u,   u = Δ/|Δ|,   e = |Δ| − |Δ₀| = (2 Δ₀·δ + δ·δ)/(|Δ| + |Δ₀|)

acts on the one end and −F on the other; where a spring has no length as drawn, F = k Δ + d Δ' exactly.  Displacements
are found without the places themselves, so that small motions keep their digits.  A force F on the point at the
distance s from the upper joint of a link acts on its angle by s n·F, on those above it by l n·F, n = (cos θ, −sin θ),
and on what carries the first joint; forces on one link are added up before they are handed on, as those of drag are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from modal.extend.scalars import plus
from modal.structure import CarrierEnd, CarrierNumbers, End, LinkEnd, Moving, Structure, carried_weights
from modal.structure.carriers import inner
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
            pairs = [self.structure.springs[k].ends for k in torsion]
            angles = [
                np.stack([self._angle(b, values, carrying) - self._angle(a, values, carrying) for a, b in pairs])
                for values in (q, v)
            ]
            tensions.append((torsion, twist_law(stiffness[torsion], damping[torsion], *angles)))
        return tensions

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


class Bundle(NamedTuple):
    """Pendula of one group that hang from one support: their `columns`, and the points `where` they hang.

    They `move_alike` where all hang from one point, or the support does not turn.
    """

    carrier: int
    columns: slice | Ints
    where: Any
    move_alike: bool


def bundles_of(structure: Structure, group: Group) -> list[Bundle]:
    """The bundles of a group."""
    members: dict[Any, list[tuple[int, Any]]] = {}
    for column, number in enumerate(group.pendula.tolist()):
        pivot = structure.pivots[number]
        key = pivot if isinstance(pivot.where, int) else (pivot.carrier,)
        members.setdefault(key, []).append((column, pivot))
    return [_bundle(structure, key[0], pendula) for key, pendula in members.items()]


def _bundle(structure: Structure, carrier: int, members: Sequence[tuple[int, Any]]) -> Bundle:
    columns, pivots = zip(*members, strict=True)
    first = pivots[0]
    move_alike = structure.carriers[carrier].turning is None or all(pivot is first for pivot in pivots)
    where = first.where
    if not move_alike:
        where = tuple(array_of([pivot.where[k] for pivot in pivots]) for k in (0, 1))
    low, high = columns[0], columns[-1] + 1
    contiguous = columns == tuple(range(low, high))
    return Bundle(carrier, slice(low, high) if contiguous else np.array(columns), where, move_alike)


# ---------------------------------------------------------------------------------------------------- one support


def inertia(carrier: CarrierNumbers, centre: Moving) -> list[list[Any]]:
    """The lower half of the support's own mass matrix; its centre of mass moves like this."""
    if carrier.M is not None:
        return [list(row[: k + 1]) for k, row in enumerate(carrier.M.tolist())]
    if carrier.path is None:
        return []
    slopes, rows = centre.slopes, list[list[Any]]()
    for k, (x, z) in enumerate(slopes):
        rows.append([plus(0.0, carrier.mass, inner(slopes[j], x, z)) for j in range(k)])
        if k != carrier.turning:
            rows[k].append(carrier.mass if carrier.path.keeps_speeds else carrier.mass * inner((x, z), x, z))
            continue
        s, h = carrier.centre
        arm = s * s + h * h if carrier.path.keeps_speeds else inner((x, z), x, z)
        rows[k].append(carrier.inertia + carrier.mass * arm)
    return rows


def thrown(carrier: CarrierNumbers, centre: Moving, bias: Vector) -> Iterator[Any]:
    """The generalized forces of the support's own mass under −`bias`, the frame's acceleration less gravity, and η'."""
    if carrier.M is not None:
        yield from [0.0] * carrier.size
        return
    keeps_speeds = carrier.path is not None and carrier.path.keeps_speeds
    for k, (x, z) in enumerate(centre.slopes):
        is_across = keeps_speeds and (carrier.size == 1 or k == carrier.turning)  # η' throws it across these
        ax, az = bias if is_across else (centre.bias[0] + bias[0], centre.bias[1] + bias[1])
        yield -(carrier.mass * (x * ax + z * az))


def elastic_forces(carrier: CarrierNumbers, eta: Sequence[Any]) -> list[Any]:
    """The forces of the support's own springs."""
    if carrier.K is not None:
        return [-_product(row, eta) for row in carrier.K.tolist()]
    return [-plus(0.0, k, value) for k, value in zip(carrier.stiffness, eta, strict=True)]


def mounting_forces(carrier: CarrierNumbers, eta: Sequence[Any], rates: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """The forces of the support's own springs and of its potential, and those of its dampers."""
    elastic, jets = elastic_forces(carrier, eta), stored(carrier, eta)
    if jets is not None:
        elastic = [force - jet.first for force, jet in zip(elastic, jets, strict=True)]
    if carrier.D is not None:
        return elastic, [-_product(row, rates) for row in carrier.D.tolist()]
    return elastic, [-plus(0.0, c, value) for c, value in zip(carrier.damping, rates, strict=True)]


def stored(carrier: CarrierNumbers, eta: Sequence[Any]) -> Any:
    """The support's energy (J) next to springs and weight, as a jet along each coordinate; None without any."""
    return carrier.path.forces(eta, carrier.values) if carrier.path and carrier.stores else None


def _product(row: Sequence[Any], values: Sequence[Any]) -> Any:
    return sum((entry * value for entry, value in zip(row, values, strict=True)), 0.0)


# ------------------------------------------------------------------------------------------------ all supports


@lru_cache(maxsize=16)
def carriers_of(system: System) -> Carriers:
    """Return the supports of a system, valid for all instants."""
    return Carriers(system)


@dataclass(frozen=True, eq=False)
class Carriers:
    """The supports of a system with its pendula in bundles."""

    system: System

    @property
    def structure(self) -> Structure:
        """The supports and the springs between points."""
        return self.system.suspension

    @cached_property
    def bundles(self) -> list[list[Bundle]]:
        """Those of every group."""
        return [bundles_of(self.structure, group) for group in self.system.groups]

    @cached_property
    def springs(self) -> Springs | None:
        """The springs between points."""
        return Springs(self.system) if self.structure.springs else None

    @cached_property
    def weights(self) -> list[Any]:
        """W (first,), N or N m: the weights at the drawn rest where supports' own springs carry them, else 0."""
        hanging_masses: list[Any] = [0.0] * len(self.structure.pivots)
        for group in self.system.groups:
            for column, pendulum in enumerate(group.pendula.tolist()):
                hanging_masses[pendulum] = group.block.mass[:, column].sum(0)
        return carried_weights(self.structure, hanging_masses, self.system.gravity)

    @cached_property
    def drawn_places(self) -> list[Any]:
        """Where the first joints of every group are drawn (m), (2, P)."""
        places = [drawn_place(self.system, pivot) for pivot in self.structure.pivots]
        return [np.array([places[pendulum] for pendulum in group.pendula.tolist()]).T for group in self.system.groups]

    @cached_property
    def _alike(self) -> list[Moving | None]:
        """How every point of a support moves where all move alike at all times; their place is of no use."""
        zeros = [0.0] * self.structure.size
        return [
            None if part.bends or part.M is not None else part.moving(part.centre, zeros, zeros)
            for part in self.structure.carriers
        ]

    def moving(self, number: int, where: Any, eta: Sequence[Any], rates: Sequence[Any]) -> Moving:
        """How a point of a support moves, its place excepted."""
        if (alike := self._alike[number]) is not None:
            return alike
        structure = self.structure
        carrier, place, speeds = structure.carriers[number], structure.part(number, eta), structure.part(number, rates)
        return carrier.moving(where, place, speeds)

    def where(self, bundle: Bundle, eta: Sequence[Any]) -> Any:
        """Where the pendula of a bundle hang: points (P,) as (P, 1) where coordinates are arrays."""
        if bundle.move_alike or bundle.where[0].ndim > 1 or not np.ndim(eta[0]):
            return bundle.where
        return tuple(part[:, None] for part in bundle.where)

    def centre(self, number: int, eta: Sequence[Any], rates: Sequence[Any]) -> Moving:
        """How the centre of mass of a support moves."""
        return self.moving(number, self.structure.carriers[number].centre, eta, rates)


def solve_block(block: Sequence[Sequence[Any]], right: list[Any]) -> list[Any]:
    """The x of A x = right, A positive definite, given by its lower half."""
    eliminate([list(row) for row in block], right, 0, len(right))
    return right


def eliminate(A: Any, right: Any, first: int, end: int) -> None:
    """Turn `right` into the solution of a block of A, from row `first` to before `end`, whose lower half is changed."""
    for k in range(first, end):
        for i in range(k + 1, end):
            share = A[i][k] / A[k][k]
            for j in range(k + 1, i + 1):
                A[i][j] = A[i][j] - share * A[j][k]
            right[i] = right[i] - share * right[k]
    for back in range(first, end):
        k = end - 1 - (back - first)
        for i in range(k + 1, end):
            right[k] = right[k] - A[i][k] * right[i]
        right[k] = right[k] / A[k][k]
