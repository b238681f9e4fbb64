"""Supports that move with coordinates η, at any angle; a fixed support has none, a cart one.

The pivots r_p(η) have J_p = ∂r_p/∂η.  A chain answers an acceleration a of its pivot with the force R (a − g e_z) + p,
found by one pass from its tip (`nonlinear.dynamics.recursion`), so that

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

with a block for each support, which elimination solves; then one pass goes down each chain.  Q_s has the supports'
springs and dampers, their weights, and the terms of M_s'(η).  Where a support has a spring this carries the weight at
the drawn rest: its potential is ½ k η² + W η with W = g Σ m ∂z/∂η there.  The torque of a first joint on a support that
turns acts on the angle of the link relative to it, and reversed on the support.

Every line is plain arithmetic: it accepts floats, arrays with further axes, complex numbers and recorded symbols.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from modal.extend.scalars import plus
from modal.structure import CarrierNumbers, Moving, Structure, carried_weights
from modal.structure.carriers import inner
from modal.types import Ints
from nonlinear.dynamics.springs import Springs, array_of
from nonlinear.system import Group, System, drawn_place

Vector = tuple[Any, Any]


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

    def _pivot_motions(self, eta: Sequence[Any], rates: Sequence[Any]) -> list[list[Moving]]:
        """How the pivots of all bundles move."""
        return [
            [self.moving(bundle.carrier, self.where(bundle, eta), eta, rates) for bundle in bundles]
            for bundles in self.bundles
        ]

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
