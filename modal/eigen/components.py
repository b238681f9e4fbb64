"""Pendula on a structure, divided into components that move together, with equal pendula combined.

N equal pendula on coordinates η hang from pivots Φ η (N, d), and first joints with a rotor, a spring or a damper act
relative to the angles Ω η. With (Φ, Ω) = U diag(σ) Vᵀ the combinations U_kᵀ of the pendula hang from pivots σ_k V_kᵀ η,
and all orthogonal ones leave the structure at rest, with the pendulum's fixed-base frequencies. The rank is that of the
rows with columns divided by √inertia of the structure; if it is full, as on carts, the pendula are not combined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.assembly import ARRAYS, Block, Element, Hanging, Rig, SquareRows, chain_squares
from modal.eigen.recursion import at_infinity
from modal.structure import slopes
from modal.types import EPS, NOISE_OF_TERMS, Floats, Ints

ElementLists = tuple[list[Element], list[Element], list[Element]]
"""Elements of M, K and D."""


class Share(NamedTuple):
    """The amplitudes in a combination of `copies` equal pendula of a column of its block, from its first pendulum."""

    column: int
    copies: int
    amplitude: float
    first: int


class Heavy(NamedTuple):
    """A combination of equal pendula: a chain `weight` times as heavy on a pivot `pivot_row` η, (d,).

    Its first joint acts relative to the angle `turning_row` η, (d,).
    """

    block: int
    column: int
    weight: float
    pivot_row: Floats
    turning_row: Floats
    shares: tuple[Share, ...]

    @property
    def is_alone(self) -> bool:
        """Whether it is a single pendulum, to whose links springs may be attached."""
        return len(self.shares) == 1 and self.shares[0].copies == 1


class StillGroup(NamedTuple):
    """Combinations of a group of equal pendula, in `columns` (C,) of a block, that leave the structure at rest.

    Each of `counts` (C,) pendula of a column moves by the combination's entry over √count.  All are orthogonal to the
    columns of `moving` (C, r); only the first exerts a force along the rail, if any `pushes`.
    """

    block: int
    columns: Ints
    counts: Ints
    moving: Floats
    pushes: bool

    @classmethod
    def of(cls, block: int, columns: Ints, counts: Ints, moving: Floats) -> StillGroup:
        """The combinations orthogonal to `moving`, orthonormal itself."""
        push = np.sqrt(counts)
        for _ in range(2):
            push = push - moving @ (moving.T @ push)
        size = np.linalg.norm(push)
        if size <= NOISE_OF_TERMS * np.sqrt(counts.sum()):
            return cls(block, columns, counts, moving, False)
        return cls(block, columns, counts, np.column_stack((moving, push / size)), True)

    @property
    def number(self) -> int:
        """The number of combinations."""
        return len(self.columns) - int(self.moving.shape[1]) + self.pushes

    def vectors(self, which: Ints) -> Floats:
        """Those with these numbers, (K, C): columns of the reflections that triangularize `moving`."""
        vectors = np.zeros((len(which), len(self.columns)))
        reflectors, tau = np.linalg.qr(self.moving, mode="raw")
        later = which - self.pushes >= 0
        vectors[np.flatnonzero(later), which[later] - self.pushes + self.moving.shape[1]] = 1.0
        for i in reversed(range(len(tau))):
            v = reflectors[i].copy()
            v[:i], v[i] = 0.0, 1.0
            vectors -= tau[i] * np.multiply.outer(vectors @ v, v)
        vectors[~later] = self.moving[:, -1]
        return vectors


class Component(NamedTuple):
    """Coordinates of the structure, in ascending order, and combinations of pendula that move together."""

    group: int
    eta: Ints
    heavies: tuple[Heavy, ...]


@dataclass(frozen=True, eq=False)
class PartedRig:
    """A rig, divided into components that move together."""

    rig: Rig

    @property
    def is_plain(self) -> bool:
        """Whether its only support is one cart or a fixed support."""
        return self.rig.structure is None

    @cached_property
    def hanging(self) -> Hanging:
        """Its pendula and elements, with one pendulum for all equal ones on a cart or a fixed support."""
        rig = self.rig
        return Hanging(
            replace(rig, members=tuple((*kind, 1) for kind in rig.names)).on_structure if self.is_plain else rig
        )

    @cached_property
    def chains(self) -> list[list[list[SquareRows]]]:
        """The squares of M, K and D of every block except rigid vertical motions, which the elements have."""
        squares_of_blocks = [chain_squares(block, self.rig.gravity) for block in self.rig.blocks]
        moving = ((filter(lambda square: square.at.size, part) for part in parts) for parts in squares_of_blocks)
        return [[[square._replace(row_source=square.rows) for square in part] for part in parts] for parts in moving]

    @property
    def size(self) -> int:
        """The number of coordinates of the structure."""
        return self.rig.leading

    @cached_property
    def _columns(self) -> dict[tuple[int, int], int]:
        """The first pendulum of every (block, column)."""
        pendula: dict[tuple[int, int], int] = {}
        for (block, column, _), first in zip(self.hanging.rig.members, self.hanging.starts.tolist(), strict=True):
            pendula.setdefault((block, column), first)
        return pendula

    def _rows(self, block: int, column: int) -> tuple[Floats, Floats]:
        """Φ and Ω (d,) of a column."""
        first, chains = self._columns[block, column], self.rig.blocks[block]
        feels = any(getattr(chains, name)[0, column] for name in ("rotor", "stiffness", "damping"))
        return self.hanging.phi.rail[first], self.hanging.phi.turning[first] * feels

    # ------------------------------------------------------------------------------------------- what moves together

    @cached_property
    def _nodes(self) -> dict[int, int]:
        """The places after the coordinates of the pendula that springs join."""
        return {p: self.size + k for k, p in enumerate(sorted(self.hanging.tied))}

    def _node_of(self, place: int) -> int:
        """The coordinate or the pendulum at a place of an element."""
        return place if place < self.size else self._nodes[self.hanging.owner(place - self.size)]

    @cached_property
    def groups(self) -> Ints:
        """The number of the part that each coordinate belongs to, then each pendulum that springs join, (d + T,)."""
        if self.is_plain:
            return np.zeros(self.size, dtype=np.int64)
        leader = np.arange(self.size + len(self._nodes))

        def join(places: Sequence[int]) -> None:
            for place in places[1:]:
                first, second = (_leader(leader, k) for k in (places[0], place))
                leader[max(first, second)] = min(first, second)

        for element in (element for part in self.hanging.elements[:3] for element in part):
            join([self._node_of(place) for place in element.at])
        for carrier, start in zip(self.hanging.structure.carriers, self.hanging.structure.offsets, strict=False):
            if carrier.M is not None:
                join(range(start, start + carrier.size))
        for block, column in self.rig.names:
            pendulum = self._columns[block, column]
            moving_coordinates = np.flatnonzero(np.abs(self._rows(block, column)).sum(0)).tolist()
            join([*([self._nodes[pendulum]] if pendulum in self._nodes else []), *moving_coordinates])
        return np.array([_leader(leader, k) for k in range(len(leader))], dtype=np.int64)

    @cached_property
    def elements_of_parts(self) -> dict[int, ElementLists]:
        """The elements of M, K and D by the number of their part."""
        elements: dict[int, ElementLists] = {int(k): ([], [], []) for k in self.groups}
        for which, part in enumerate(self.hanging.elements[:3]):
            for element in part:
                elements[int(self.groups[self._node_of(element.at[0])])][which].append(element)
        return elements

    @cached_property
    def partition(self) -> tuple[tuple[Component, ...], tuple[StillGroup, ...]]:
        """The components, and the combinations of pendula in different columns that leave the structure at rest."""
        if self.is_plain:
            return ((self.all_pendula,) if self.size else ()), ()
        tied = self._nodes
        heavies_of_part: dict[int, list[Heavy]] = {int(k): [] for k in self.groups}
        alike: dict[tuple[int, int, bytes], list[int]] = {}
        for block, column in self.rig.names:
            pendulum, rows = self._columns[block, column], self._rows(block, column)
            count = int(self.rig.blocks[block].count[column])
            if pendulum in tied:
                heavy = Heavy(block, column, 1.0, *rows, (Share(column, 1, 1.0, pendulum),))
                heavies_of_part[int(self.groups[tied[pendulum]])].append(heavy)
            elif (coordinates := np.flatnonzero(np.abs(rows).sum(0))).size and count:
                key = int(self.groups[coordinates[0]]), block, _data(self.rig.blocks[block], column)
                alike.setdefault(key, []).append(column)
        still_groups = []
        for (group, block, _), columns in alike.items():
            heavies, idle_groups = self._combine(block, columns)
            heavies_of_part[group] += heavies
            still_groups += idle_groups
        eta = np.arange(self.size)
        components = [
            Component(g, eta[self.groups[: self.size] == g], tuple(heavy)) for g, heavy in heavies_of_part.items()
        ]
        return tuple(components), tuple(still_groups)

    @cached_property
    def all_pendula(self) -> Component:
        """All kinds of pendula and the one coordinate of a cart, or none."""
        ones, zeros, heavies = np.ones(self.size), np.zeros(self.size), list[Heavy]()
        for number, block in enumerate(self.rig.blocks):
            for column, count in enumerate(block.count.tolist()):
                shares = (Share(column, count, 1.0, len(heavies)),)
                heavies.append(Heavy(number, column, float(count), ones, zeros, shares))
        return Component(0, np.arange(self.size), tuple(heavies))

    @cached_property
    def carrying(self) -> tuple[Ints, ...]:
        """The number of combinations of the copies of every column of each block that move with their supports."""
        if self.is_plain:
            return tuple(np.full(block.size, self.size) for block in self.rig.blocks)
        moving = [np.zeros(block.size, dtype=np.int64) for block in self.rig.blocks]
        for heavy in (heavy for component in self.partition[0] for heavy in component.heavies):
            moving[heavy.block][[share.column for share in heavy.shares]] = 1
        return tuple(moving)

    def _single_heavy(self, block: int, column: int) -> Heavy:
        count, rows = int(self.rig.blocks[block].count[column]), self._rows(block, column)
        return Heavy(block, column, float(count), *rows, (Share(column, count, 1.0, self._columns[block, column]),))

    def _combine(self, block: int, columns: list[int]) -> tuple[list[Heavy], list[StillGroup]]:
        """The combinations of equal pendula in these columns that move the structure, and those that do not."""
        if len(columns) == 1:
            return [self._single_heavy(block, columns[0])], []
        counts = self.rig.blocks[block].count[columns]
        rows = np.array([np.concatenate(self._rows(block, column)) for column in columns])
        weighted_rows = np.sqrt(counts)[:, None] * rows
        scale = np.tile(1 / np.sqrt(self.inertia), 2)
        U, sigma, _ = np.linalg.svd(weighted_rows * scale, full_matrices=False)
        rank = int((sigma > sigma[0] * EPS * max(rows.shape)).sum())
        first = [self._columns[block, column] for column in columns]
        if rank == len(columns):
            return [self._single_heavy(block, column) for column in columns], []
        heavies = []
        for combination in U.T[:rank]:
            amplitude = (combination / np.sqrt(counts)).tolist()
            shares = tuple(map(Share, columns, counts.tolist(), amplitude, first))
            row = combination @ weighted_rows
            heavies.append(Heavy(block, columns[0], 1.0, row[: self.size], row[self.size :], shares))
        return heavies, [StillGroup.of(block, np.array(columns), counts, U[:, :rank])]

    @cached_property
    def inertia(self) -> Floats:
        """The diagonal of the structure's mass matrix, including the pendula, (d,)."""
        return self.hanging.inertia.diagonal()

    @cached_property
    def pivots(self) -> tuple[Floats, ...]:
        """Φ (P, d) of every column of each block."""
        if self.is_plain:
            return tuple(np.ones((block.size, self.size)) for block in self.rig.blocks)
        first = self._columns
        return tuple(
            self.hanging.phi.rail[[first[number, p] for p in range(block.size)]]
            for number, block in enumerate(self.rig.blocks)
        )

    def turning(self, number: int) -> Floats:
        """Ω (P, d) of every column of a block, whether its first joint depends on it or not."""
        first = [self._columns[number, column] for column in range(self.rig.blocks[number].size)]
        return self.hanging.phi.turning[first]

    @cached_property
    def sinking(self) -> tuple[Floats | None, ...]:
        """The mean of ψ ψᵀ (P, d, d) over the copies of every column of each block; None if no pivot moves down."""
        down = None if self.is_plain else self.hanging.phi.down
        if down is None or not down.any():
            return (None,) * len(self.rig.blocks)
        means = [np.zeros((block.size, self.size, self.size)) for block in self.rig.blocks]
        for (block, column, copies), first in zip(self.rig.members, self.hanging.starts.tolist(), strict=True):
            share = copies / int(self.rig.blocks[block].count[column])
            means[block][column] += share * np.multiply.outer(down[first], down[first])
        return tuple(means)

    @cached_property
    def accelerances(self) -> Floats:
        """Σ φ_η² over all modes (d,), φᵀMφ = 1: the initial acceleration of each coordinate per unit of force on it."""
        if any(block.rotor.any() for block in self.rig.blocks):
            return np.diag(np.linalg.inv(self.hanging.squares().matrices[0]))[: self.size]
        M = self.hanging.supporting[0].copy()
        for number, block in enumerate(self.rig.blocks):
            pivot_mass = at_infinity(block)[0].ravel() * block.count
            M += (self.pivots[number].T * pivot_mass) @ self.pivots[number]
        return np.diag(np.linalg.inv(M))

    @cached_property
    def momenta(self) -> Floats:
        """The momentum along the rail per unit of each rate of the structure, (d,)."""
        if self.is_plain:
            return np.full(self.size, self.rig.total_mass)
        structure, momentum = self.hanging.structure, np.zeros(self.size)
        for carrier, body in enumerate(structure.carriers):
            span = slice(structure.offsets[carrier], structure.offsets[carrier + 1])
            if body.M is not None:
                momentum[span] += np.nan
            elif body.size:
                for place, value in slopes(structure, carrier, body.centre)[0].items():
                    momentum[place] += float(body.mass) * value
        for number, block in enumerate(self.rig.blocks):
            momentum += (block.count * block.mass.sum(0)) @ self.pivots[number]
        return momentum


def _leader(leader: Ints, k: int) -> int:
    while leader[k] != k:
        leader[k] = leader[leader[k]]
        k = int(leader[k])
    return k


def _data(block: Block, column: int) -> bytes:
    return b"".join(getattr(block, name)[:, column].tobytes() for name in ARRAYS)
