"""Structures: carriers that move with their coordinates η, at any angle, and the pendula that hang from them.

The pivots r_p(η) have J_p = ∂r_p/∂η.  A chain answers an acceleration a of its pivot with the force R (a − g e_z) + p,
found by one pass from its tip (`nonlinear.dynamics.recursion`), so that

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

with a block for each carrier, which elimination solves; then one pass goes down each chain.  Q_s has the carriers'
springs and dampers, their weights, and the terms of M_s'(η).  Where a carrier has a spring this carries the weight at
the drawn rest: its potential is ½ k η² + W η with W = g Σ m ∂z/∂η there.  The torque of a first joint on a carrier that
turns acts on the angle of the link relative to it, and reversed on the carrier.

Every line is plain arithmetic: it accepts floats, arrays with further axes, complex numbers and recorded symbols.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.structure import CarrierEnd, CarrierNumbers, Moving, Structure, carried
from modal.types import Ints
from nonlinear.dynamics.bearing import Bearing, Joints
from nonlinear.dynamics.external import External
from nonlinear.dynamics.inputs import QUIET, Instant
from nonlinear.dynamics.springs import Springs, Strained, Tension, filled, versed
from nonlinear.system import Group, System

Vector = tuple[Any, Any]


class Bundle(NamedTuple):
    """Pendula of one group that hang from one carrier: their `columns`, and the points `where` they hang.

    They are `together` where all hang from one point, or the carrier does not turn: then they move alike.
    """

    carrier: int
    columns: slice | Ints
    where: Any
    together: bool


def bundles_of(structure: Structure, group: Group) -> list[Bundle]:
    """The bundles of a group."""
    members: dict[Any, list[tuple[int, Any]]] = {}
    for column, number in enumerate(group.pendula.tolist()):
        pivot = structure.pivots[number]
        key = pivot if isinstance(pivot.where, int) else (pivot.carrier,)
        members.setdefault(key, []).append((column, pivot))
    return [_bundle(structure, key[0], each) for key, each in members.items()]


def _bundle(structure: Structure, carrier: int, members: Sequence[tuple[int, Any]]) -> Bundle:
    columns, pivots = zip(*members, strict=True)
    first = pivots[0]
    together = structure.carriers[carrier].turning is None or all(pivot is first for pivot in pivots)
    where = first.where
    if not together:
        where = tuple(filled([pivot.where[k] for pivot in pivots]) for k in (0, 1))
    low, high = columns[0], columns[-1] + 1
    contiguous = columns == tuple(range(low, high))
    return Bundle(carrier, slice(low, high) if contiguous else np.array(columns), where, together)


# ---------------------------------------------------------------------------------------------------- one carrier


def displacement(carrier: CarrierNumbers, where: Any, eta: Sequence[Any]) -> Vector:
    """How far (m) a point of a carrier is from where it is drawn, along the rail and down, with all digits."""
    if carrier.points is not None:
        slopes = carrier.points[where].T.tolist()
        return tuple(sum((s[k] * value for s, value in zip(slopes, eta, strict=True)), 0.0) for k in (0, 1))  # type: ignore[return-value]
    x: Any = 0.0
    z: Any = 0.0
    if carrier.kind == "cart":
        x = eta[0]
    elif carrier.kind == "heave":
        z = -eta[0]
    elif carrier.kind == "platform":
        x, z = eta[0], -eta[1]
    elif carrier.kind == "swing":
        x, z = along_arc(carrier.length, np.sin(eta[0] / carrier.length), versed(eta[0] / carrier.length))
    if carrier.turning is None:
        return x, z
    phi, (s, h) = eta[carrier.turning], where
    right, down = swayed(s, h, np.sin(phi), versed(phi))
    return x + right, z + down


def along_arc(length: Any, sine: Any, versine: Any) -> Vector:
    """How far (m) the end of a rod of this length is from where it hangs still."""
    return length * sine, -(length * versine)


def swayed(s: Any, h: Any, sine: Any, versine: Any) -> Vector:
    """How far (m) a point (s, h) of what turns is from where it is drawn."""
    return h * sine - s * versine, -(s * sine + h * versine)


def inertia(carrier: CarrierNumbers, centre: Moving) -> list[list[Any]]:
    """The lower half of the carrier's own mass matrix; its centre of mass moves like this."""
    if carrier.M is not None:
        return [list(row[: k + 1]) for k, row in enumerate(carrier.M.tolist())]
    if carrier.turning is None:
        return [[carrier.mass]] * carrier.size
    s, h = carrier.centre
    about = carrier.inertia + carrier.mass * (s * s + h * h)
    if carrier.turning == 0:
        return [[about]]
    x, z = centre.slopes[carrier.turning]
    return [[carrier.mass], [0.0, carrier.mass], [carrier.mass * x, -(carrier.mass * z), about]]


def thrown(carrier: CarrierNumbers, centre: Moving, felt: Vector) -> Iterator[Any]:
    """The generalized forces of the carrier's own mass under −`felt`, the frame's acceleration less gravity, and η'."""
    if carrier.M is not None:
        yield from [0.0] * carrier.size
        return
    for k, (x, z) in enumerate(centre.slopes):
        straight = carrier.kind == "swing" or k == carrier.turning  # η' throws it across these
        ax, az = felt if straight else (centre.bias[0] + felt[0], centre.bias[1] + felt[1])
        yield -(carrier.mass * (x * ax + z * az))


def held(carrier: CarrierNumbers, eta: Sequence[Any], rates: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """The forces of the carrier's own springs, and those of its dampers."""
    if carrier.K is not None and carrier.D is not None:
        return tuple(
            [-_product(row, value) for row in A.tolist()] for A, value in ((carrier.K, eta), (carrier.D, rates))
        )  # type: ignore[return-value]
    kept = [-(k * value) for k, value in zip(carrier.stiffness, eta, strict=True)]
    return kept, [-(c * value) for c, value in zip(carrier.damping, rates, strict=True)]


def _product(row: Sequence[Any], values: Sequence[Any]) -> Any:
    return sum((each * value for each, value in zip(row, values, strict=True)), 0.0)


# ------------------------------------------------------------------------------------------------ all carriers


@dataclass(frozen=True, eq=False)
class Carriers:
    """The structure of a system, its pendula in bundles."""

    system: System

    @cached_property
    def structure(self) -> Structure:
        """The carriers and the springs between points."""
        assert self.system.structure is not None
        return self.system.structure

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
        """W (first,), N or N m: the weights at the drawn rest where carriers' own springs carry them, else 0."""
        hung: list[Any] = [0.0] * len(self.structure.pivots)
        for group in self.system.groups:
            for column, pendulum in enumerate(group.pendula.tolist()):
                hung[pendulum] = group.block.mass[:, column].sum(0)
        return carried(self.structure, hung, self.system.gravity)

    def _moved(self, eta: Sequence[Any], rates: Sequence[Any]) -> list[list[Moving]]:
        """How the pivots of all bundles move."""
        return [
            [self.moving(bundle.carrier, self.where(bundle, eta), eta, rates) for bundle in bundles]
            for bundles in self.bundles
        ]

    def moving(self, number: int, where: Any, eta: Sequence[Any], rates: Sequence[Any]) -> Moving:
        """How a point of a carrier moves."""
        structure = self.structure
        carrier, place, speeds = structure.carriers[number], structure.part(number, eta), structure.part(number, rates)
        return carrier.moving(where, place, speeds)

    def where(self, bundle: Bundle, eta: Sequence[Any]) -> Any:
        """Where the pendula of a bundle hang: points (P,) as (P, 1) where coordinates are arrays."""
        if bundle.together or bundle.where[0].ndim > 1 or not np.ndim(eta[0]):
            return bundle.where
        return tuple(part[:, None] for part in bundle.where)

    def centre(self, number: int, eta: Sequence[Any], rates: Sequence[Any]) -> Moving:
        """How the centre of mass of a carrier moves."""
        return self.moving(number, self.structure.carriers[number].centre, eta, rates)


class CarriersAt(Bearing):
    """Carriers with η and η' at an instant."""

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

        Without what their own mass does, if `massless`: then what acts here are forces alone.
        """
        self.carriers, self.structure, system = carriers, carriers.structure, carriers.system
        size = self.structure.size
        self.instant, self.bare, self.massless, self.system = instant, bare, massless, system
        self.eta, self.rates = list(q[:size]), list(v[:size])
        self.moves = carriers._moved(self.eta, self.rates)
        self.right: list[Any] = [0.0] * size
        self.blocks: list[list[list[Any]]] = []
        self.power: Any = 0.0
        self.taken: list[Any] = []
        self.solution: list[Any] = []
        along, down = instant.support
        self.felt: Vector = (0.0, 0.0) if bare else (along, down - system.gravity)
        self.like = q[size:]
        self.strained: Strained | None = None
        for number, carrier in enumerate(self.structure.carriers):
            self._begin(number, carrier)
        if not bare and carriers.springs:
            self.strained = carriers.springs.forces(q, v, self)
            self.torques, self.power = self.strained.torques, self.power + self.strained.power

    def _begin(self, number: int, carrier: CarrierNumbers) -> None:
        """A carrier's own inertia, its springs, dampers and weight."""
        eta, rates = self.structure.part(number, self.eta), self.structure.part(number, self.rates)
        centre = None if carrier.M is not None else self.carriers.centre(number, self.eta, self.rates)
        self.blocks.append(inertia(carrier, centre))  # type: ignore[arg-type]
        if self.bare:
            return
        first = self.structure.offsets[number]
        kept, working = held(carrier, eta, rates)
        forces: Any = [0.0] * carrier.size
        if not self.massless:
            each = thrown(carrier, centre, self.felt)  # type: ignore[arg-type]
            forces = [force - self.carriers.weights[first + k] for k, force in enumerate(each)]
        for k, (spring, damper, force) in enumerate(zip(kept, working, forces, strict=True)):
            self.right[first + k] = spring + damper + force
            self.power = self.power + damper * rates[k]
        if self.system.support and centre is not None:
            vx, vz = centre.velocity(rates)
            along, down = self.instant.support
            self.power = self.power - carrier.mass * (along * vx + down * vz)

    @property
    def kinetic(self) -> Any:
        """Kinetic energy (J) of the carriers, before anything has been taken."""
        energy: Any = 0.0
        for number, block in enumerate(self.blocks):
            rates = self.structure.part(number, self.rates)
            for k, row in enumerate(block):
                for j, inertia in enumerate(row):
                    share = inertia * (rates[k] * rates[j])
                    energy = energy + (share / 2 if j == k else share)
        return energy

    @property
    def potential(self) -> Any:
        """Potential energy (J) of the carriers' weights and own springs.

        It is 0 as drawn; that of the pendula is in the heights of their pivots, that of springs in `tensions`.
        """
        energy: Any = 0.0
        for number, carrier in enumerate(self.structure.carriers):
            eta = self.structure.part(number, self.eta)
            kept, _ = held(carrier, eta, eta)
            for k, (value, force) in enumerate(zip(eta, kept, strict=True)):
                weight = self.carriers.weights[self.structure.offsets[number] + k]
                energy = energy + (weight * value - value * force / 2)
            if carrier.M is None:
                _, down = displacement(carrier, carrier.centre, eta)
                energy = energy - carrier.mass * self.system.gravity * down
        return energy

    @property
    def momentum(self) -> Any:
        """Momentum (kg m/s) of the carriers along the rail, modal ones excepted."""
        momentum: Any = 0.0
        for number, carrier in enumerate(self.structure.carriers):
            if carrier.M is None and carrier.size:
                moving = self.carriers.centre(number, self.eta, self.rates)
                momentum = momentum + carrier.mass * moving.velocity(self.structure.part(number, self.rates))[0]
        return momentum

    def tensions(self, q: Any, v: Any) -> list[tuple[Ints, Tension]]:
        """What springs between points do, with their numbers, kind by kind."""
        springs = self.carriers.springs
        return springs.tensions(q, v, self) if springs else []

    def pulled(self, q: Any, v: Any) -> Any:
        """The force (2, L, ...) of springs between points on every link."""
        springs = self.carriers.springs
        none = np.zeros((2, *np.shape(q[self.structure.size :])))
        return springs.forces(q, v, CarriersAt(self.carriers, q, v, bare=True)).on_links if springs else none

    def push(self, number: int, moving: Moving, force: Vector) -> None:
        """A force (N), along the rail and down, on a point of a carrier that moves like this."""
        first = self.structure.offsets[number]
        for k, (x, z) in enumerate(moving.slopes):
            self.right[first + k] = self.right[first + k] + (x * force[0] + z * force[1])

    def turn(self, number: int, torque: Any) -> None:
        """A torque (N m) on a carrier; nothing on one that does not turn."""
        if (angle := self.structure.angle_of(number)) is not None:
            self.right[angle] = self.right[angle] + torque

    def angle(self, number: int, values: Sequence[Any] | None = None) -> Any:
        """The angle (rad) of a carrier, or of other `values` of its coordinates; 0.0 if it does not turn."""
        angle = self.structure.angle_of(number)
        return 0.0 if angle is None else (self.eta if values is None else values)[angle]

    def pivots(self, group: int) -> tuple[Vector, Vector]:
        """How far the first joints of a group are from where they are drawn, and their velocities."""
        structure, places = self.structure, []
        for bundle in self.carriers.bundles[group]:
            where = self.carriers.where(bundle, self.eta)
            places.append(
                displacement(structure.carriers[bundle.carrier], where, structure.part(bundle.carrier, self.eta))
            )
        return tuple(self._joined(group, [each[k] for each in places]) for k in (0, 1)), self._velocities(group)

    def point(self, end: CarrierEnd) -> tuple[Vector, Moving, Vector]:
        """The displacement of a point of a carrier, how it moves, and its velocity."""
        eta, rates = (self.structure.part(end.carrier, values) for values in (self.eta, self.rates))
        moving = self.carriers.moving(end.carrier, end.where, self.eta, self.rates)
        return displacement(self.structure.carriers[end.carrier], end.where, eta), moving, moving.velocity(rates)

    def joints(self, group: int) -> Joints:
        """Their base, if any turns, and their velocities."""
        bundles = self.carriers.bundles[group]
        base = None
        if any(self.structure.carriers[bundle.carrier].turning is not None for bundle in bundles):
            base = (
                self._joined(group, [self.angle(bundle.carrier) for bundle in bundles]),
                self._joined(group, [self.angle(bundle.carrier, self.rates) for bundle in bundles]),
            )
        return Joints(base, self._velocities(group))

    def _velocities(self, group: int) -> Vector:
        velocities = [
            moving.velocity(self.structure.part(bundle.carrier, self.rates))
            for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True)
        ]
        return tuple(self._joined(group, [each[k] for each in velocities]) for k in (0, 1))

    def _joined(self, group: int, values: Sequence[Any]) -> Any:
        """Values of the bundles of a group, (P, ...)."""
        joined = np.zeros_like(self.like[self.system.groups[group].index[0]])
        for bundle, value in zip(self.carriers.bundles[group], values, strict=True):
            joined[bundle.columns] = value
        return joined

    def take(
        self, group: int, body: Any, links: Any, rates: Any, forces: Any, external: External | None, reaction: Any
    ) -> None:
        """What a group answers, projected on the coordinates of its carriers."""
        response = body.response(links, rates, forces)
        pulled = [external.at_joints] if external is not None else []
        if external is not None:
            reaction = reaction + external.at_base
        if self.strained is not None and self.strained.at_joints[group] is not None:
            pulled.append(self.strained.at_joints[group])
        mass = self.system.groups[group].block.mass if self.system.support and not self.bare else None
        for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True):
            felt = moving.bias[0] + self.felt[0], moving.bias[1] + self.felt[1]
            block, force = response.projected(bundle.columns, moving.slopes, felt, _summed)
            self._add(bundle, moving, block, force, pulled)
            self._react(bundle, reaction, external)
            if mass is not None:
                vx, vz = moving.velocity(self.structure.part(bundle.carrier, self.rates))
                along, down = self.instant.support
                dragged = mass[:, bundle.columns].sum(0) * (along * vx + down * vz)
                self.power = self.power - dragged.sum(0)
        self.taken.append(response)

    def _add(self, bundle: Bundle, moving: Moving, block: Any, force: Any, pulled: Sequence[Any]) -> None:
        """The inertia and the force of a bundle, and forces on its first joints."""
        lower, first = self.blocks[bundle.carrier], self.structure.offsets[bundle.carrier]
        self.blocks[bundle.carrier] = [
            [a + b for a, b in zip(*rows, strict=True)] for rows in zip(lower, block, strict=True)
        ]
        for k, (x, z) in enumerate(moving.slopes):
            self.right[first + k] = self.right[first + k] - force[k]
            for each in pulled:
                fx, fz = each[0][bundle.columns], each[1][bundle.columns]
                pushed = x * fx.sum(0) + z * fz.sum(0) if bundle.together else (x * fx + z * fz).sum(0)
                self.right[first + k] = self.right[first + k] + pushed

    def _react(self, bundle: Bundle, reaction: Any, external: External | None) -> None:
        """The torques of first joints on a carrier that turns."""
        angle = self.structure.angle_of(bundle.carrier)
        if angle is None or np.ndim(reaction) == 0:
            return
        self.right[angle] = self.right[angle] - reaction[bundle.columns].sum(0)
        if external is not None and np.ndim(external.at_base):
            self.power = self.power - external.at_base[bundle.columns].sum(0) * self.rates[angle]

    def pushed(self, drag: Any) -> tuple[Any, Any]:
        """All that acts on the carriers."""
        structure, instant = self.structure, self.instant
        pushes = [] if drag is None else [drag[: structure.size]]
        if instant.push.supports is not None:
            pushes.append(instant.push.supports)
        for each in pushes:
            for k, value in enumerate(each):
                self.right[k] = self.right[k] + value
                self.power = self.power + value * self.rates[k]
        for force, size in zip(self.system.forces, instant.forces, strict=False):
            if isinstance(force.carrier, CarrierEnd):
                self._act(force.carrier, force.direction, size)
        return self.right, self.power

    def solved(self, drag: Any) -> tuple[Any, Any]:
        """η'' of all carriers."""
        self.pushed(drag)
        self.solution = self.answered()
        return self.solution, self.power

    def _act(self, end: CarrierEnd, direction: Any, size: Any) -> None:
        """A force of the scene on a carrier."""
        if direction is None:
            self.turn(end.carrier, size)
            self.power = self.power + size * self.angle(end.carrier, self.rates)
            return
        moving = self.carriers.moving(end.carrier, end.where, self.eta, self.rates)
        force = direction[0] * size, direction[1] * size
        self.push(end.carrier, moving, force)
        vx, vz = moving.velocity(self.structure.part(end.carrier, self.rates))
        self.power = self.power + (force[0] * vx + force[1] * vz)

    def answered(self) -> list[Any]:
        """The solution of the carriers' equations, block by block."""
        solution: list[Any] = []
        for number, block in enumerate(self.blocks):
            solution += eliminated(block, list(self.structure.part(number, self.right)))
        return solution

    def fall(self, group: int) -> Any:
        """Under the accelerations of its pivots."""
        pushes = [self.structure.part(bundle.carrier, self.solution) for bundle in self.carriers.bundles[group]]
        return self.taken[group].fall(pushes, self._accelerations(group, self.felt))

    def start(self, group: int, gravity: Any) -> tuple[Any, Any]:
        """Those of its pivots in their frame."""
        return self._accelerations(group, (0.0, -gravity))

    def _accelerations(self, group: int, felt: Vector) -> tuple[Any, Any]:
        accelerations = []
        for bundle, moving in zip(self.carriers.bundles[group], self.moves[group], strict=True):
            ax, az = moving.velocity(self.structure.part(bundle.carrier, self.solution))
            accelerations.append((ax + (moving.bias[0] + felt[0]), az + (moving.bias[1] + felt[1])))
        return self._joined(group, [each[0] for each in accelerations]), self._joined(
            group, [each[1] for each in accelerations]
        )


def _summed(values: Any) -> Any:
    return values.sum(0)


def eliminated(block: Sequence[Sequence[Any]], right: list[Any]) -> list[Any]:
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


def inverted_on_carriers(carriers: Carriers, solvers: Sequence[Any], q: Any, p: Any) -> Any:
    """M⁻¹ p (half, ...) on a structure, at the coordinates q (half, ...)."""
    size, rates = carriers.structure.size, np.zeros(np.shape(p), dtype=np.result_type(q, p))
    bearing = CarriersAt(carriers, q, 0 * q, bare=True)
    bearing.right = list(p[:size])
    for k, (group, body) in enumerate(solvers):
        links = q[size:][group.index]
        bearing.take(k, body, links, 0 * links, p[size:][group.index], None, 0.0)
    rates[:size] = bearing.solution = bearing.answered()
    for k, (group, _) in enumerate(solvers):
        rates[size:][group.index] = bearing.fall(k)
    return rates
