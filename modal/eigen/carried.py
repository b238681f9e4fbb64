"""Pendula on a structure, parted into what moves together, with equal ones combined.

N equal pendula on coordinates η hang from pivots Φ η (N, d), and feel angles Ω η where a first joint has a spring or
damper.  With (Φ, Ω) = U diag(σ) Vᵀ the combinations U_kᵀ of the pendula hang from the pivots σ_k V_kᵀ η, and all
orthogonal ones leave the structure still, with the pendulum's fixed-base frequencies.  The rank is that of the rows
with columns divided by √inertia of the structure; where it is full, as on carts, every pendulum stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.assembly import ARRAYS, Block, Element, Hanging, Rig, add_modal, null_space
from modal.eigen.factor import Factor
from modal.eigen.recursion import at_infinity
from modal.eigen.trees import Hung, Tree
from modal.structure import slopes
from modal.types import Floats, Ints

ROUNDED = 2.0**-52
"""Singular values below this, times the number of rows and columns, of the largest one are 0."""
CANCELLED = 2.0**-48
"""A push along the rail below this fraction of its terms is 0."""


class Share(NamedTuple):
    """How a combination moves each of `copies` equal pendula of a column of its block, by its first pendulum."""

    column: int
    copies: int
    amplitude: float
    first: int


class Heavy(NamedTuple):
    """A combination of equal pendula: a chain `weight` times as heavy on a pivot `along` η, feeling `felt` η, (d,)."""

    block: int
    column: int
    weight: float
    along: Floats
    felt: Floats
    shares: tuple[Share, ...]

    @property
    def is_alone(self) -> bool:
        """Whether it is one pendulum, to whose links springs may be joined."""
        return len(self.shares) == 1 and self.shares[0].copies == 1


class Balanced(NamedTuple):
    """Combinations of a group of equal pendula, in `columns` (C,) of a block, that leave the structure still.

    Each of `counts` (C,) pendula of a column moves by the combination's entry over √count.  All are orthogonal to the
    columns of `moving` (C, r); the first alone pushes along the rail, if any `pushes`.
    """

    block: int
    columns: Ints
    counts: Ints
    moving: Floats
    pushes: bool

    @classmethod
    def of(cls, block: int, columns: Ints, counts: Ints, moving: Floats) -> Balanced:
        """The combinations orthogonal to `moving`, orthonormal itself."""
        push = np.sqrt(counts)
        for _ in range(2):
            push = push - moving @ (moving.T @ push)
        size = np.linalg.norm(push)
        if size <= CANCELLED * np.sqrt(counts.sum()):
            return cls(block, columns, counts, moving, False)
        return cls(block, columns, counts, np.column_stack((moving, push / size)), True)

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self.columns) - int(self.moving.shape[1]) + self.pushes

    def vectors(self, which: Ints) -> Floats:
        """Those with these numbers, (K, C): columns of the reflections that triangularize `moving`."""
        found = np.zeros((len(which), len(self.columns)))
        reflectors, tau = np.linalg.qr(self.moving, mode="raw")
        later = which - self.pushes >= 0
        found[np.flatnonzero(later), which[later] - self.pushes + self.moving.shape[1]] = 1.0
        for i in reversed(range(len(tau))):
            v = reflectors[i].copy()
            v[:i], v[i] = 0.0, 1.0
            found -= tau[i] * np.multiply.outer(found @ v, v)
        found[~later] = self.moving[:, -1]
        return found


class Component(NamedTuple):
    """Coordinates of the structure, in ascending order, and combinations of pendula that move together."""

    group: int
    eta: Ints
    heavies: tuple[Heavy, ...]


@dataclass(frozen=True, eq=False)
class Carried:
    """A rig on a structure, parted."""

    rig: Rig

    @cached_property
    def hanging(self) -> Hanging:
        """Its pendula and elements."""
        return Hanging(self.rig)

    @property
    def size(self) -> int:
        """How many coordinates the structure has."""
        return self.hanging.structure.size

    @cached_property
    def _columns(self) -> dict[tuple[int, int], int]:
        """The first pendulum of every (block, column)."""
        found: dict[tuple[int, int], int] = {}
        for (block, column, _), first in zip(self.rig.members, self.hanging.starts.tolist(), strict=True):
            found.setdefault((block, column), first)
        return found

    def _rows(self, block: int, column: int) -> tuple[Floats, Floats]:
        """Φ and Ω (d,) of a column."""
        first, own = self._columns[block, column], self.rig.blocks[block]
        feels = own.stiffness[0, column] > 0 or own.damping[0, column] > 0
        return self.hanging.phi.along[first], self.hanging.phi.turning[first] * feels

    # ------------------------------------------------------------------------------------------- what moves together

    @cached_property
    def groups(self) -> Ints:
        """The number of the part that each coordinate belongs to, then each pendulum that springs join, (d + T,)."""
        tied = sorted(self.hanging.tied)
        node = {p: self.size + k for k, p in enumerate(tied)}
        leader = np.arange(self.size + len(tied))

        def join(own: Sequence[int]) -> None:
            for other in own[1:]:
                one, two = (_leader(leader, k) for k in (own[0], other))
                leader[max(one, two)] = min(one, two)

        def of(place: int) -> int:
            return place if place < self.size else node[self.hanging.owner(place - self.size)]

        for own in (element.at for part in self.hanging.elements[:3] for element in part):
            join([of(place) for place in own])
        for carrier, start in zip(self.hanging.structure.carriers, self.hanging.structure.offsets, strict=False):
            if carrier.M is not None:
                join(range(start, start + carrier.size))
        for block, column in self.rig.names:
            pendulum = self._columns[block, column]
            moved = np.flatnonzero(np.abs(self._rows(block, column)).sum(0)).tolist()
            join([*([node[pendulum]] if pendulum in node else []), *moved])
        return np.array([_leader(leader, k) for k in range(len(leader))], dtype=np.int64)

    @cached_property
    def owned(self) -> dict[int, tuple[list[Element], list[Element], list[Element]]]:
        """The elements of M, K and D by the number of their part."""
        node = {p: self.size + k for k, p in enumerate(sorted(self.hanging.tied))}
        found: dict[int, tuple[list[Element], list[Element], list[Element]]] = {
            int(k): ([], [], []) for k in self.groups
        }
        for which, part in enumerate(self.hanging.elements[:3]):
            for element in part:
                at = element.at[0]
                at = at if at < self.size else node[self.hanging.owner(at - self.size)]
                found[int(self.groups[at])][which].append(element)
        return found

    @cached_property
    def parted(self) -> tuple[tuple[Component, ...], tuple[Balanced, ...]]:
        """The components, and the combinations of pendula in different columns that leave the structure still."""
        tied = {p: self.size + k for k, p in enumerate(sorted(self.hanging.tied))}
        owned: dict[int, list[Heavy]] = {int(k): [] for k in self.groups}
        alike: dict[tuple[int, int, bytes], list[int]] = {}
        for block, column in self.rig.names:
            pendulum, rows = self._columns[block, column], self._rows(block, column)
            count = int(self.rig.blocks[block].count[column])
            if pendulum in tied:
                own = Heavy(block, column, 1.0, *rows, (Share(column, 1, 1.0, pendulum),))
                owned[int(self.groups[tied[pendulum]])].append(own)
            elif (moved := np.flatnonzero(np.abs(rows).sum(0))).size and count:
                key = int(self.groups[moved[0]]), block, _data(self.rig.blocks[block], column)
                alike.setdefault(key, []).append(column)
        still = []
        for (group, block, _), columns in alike.items():
            heavies, balanced = self._combined(block, columns)
            owned[group] += heavies
            still += balanced
        eta = np.arange(self.size)
        components = [Component(g, eta[self.groups[: self.size] == g], tuple(own)) for g, own in owned.items()]
        return tuple(components), tuple(still)

    def _combined(self, block: int, columns: list[int]) -> tuple[list[Heavy], list[Balanced]]:
        """The combinations of equal pendula in these columns that move the structure, and those that do not."""
        counts = self.rig.blocks[block].count[columns]
        rows = np.array([np.concatenate(self._rows(block, column)) for column in columns])
        weighted = np.sqrt(counts)[:, None] * rows
        scale = np.tile(1 / np.sqrt(self.inertia), 2)
        U, sigma, _ = np.linalg.svd(weighted * scale, full_matrices=False)
        rank = int((sigma > sigma[0] * ROUNDED * max(rows.shape)).sum())
        first = [self._columns[block, column] for column in columns]
        if rank == len(columns):
            each = zip(columns, counts.tolist(), rows, first, strict=True)
            alone = [
                Heavy(block, c, float(n), row[: self.size], row[self.size :], (Share(c, n, 1.0, p),))
                for c, n, row, p in each
            ]
            return alone, []
        heavies = []
        for combination in U.T[:rank]:
            amplitude = (combination / np.sqrt(counts)).tolist()
            shares = tuple(map(Share, columns, counts.tolist(), amplitude, first))
            row = combination @ weighted
            heavies.append(Heavy(block, columns[0], 1.0, row[: self.size], row[self.size :], shares))
        return heavies, [Balanced.of(block, np.array(columns), counts, U[:, :rank])]

    @cached_property
    def inertia(self) -> Floats:
        """The diagonal of the structure's mass matrix with all that hangs, (d,)."""
        found = np.zeros(self.size)
        for element in self.hanging.elements.inertia:
            for place, value in zip(element.at, element.row, strict=True):
                found[place] += element.size * value**2
        for carrier, start in zip(self.hanging.structure.carriers, self.hanging.structure.offsets, strict=False):
            if carrier.M is not None:
                found[start : start + carrier.size] += np.diag(carrier.M)
        for block, column in self.rig.names:
            own, (along, _) = self.rig.blocks[block], self._rows(block, column)
            found += own.count[column] * own.mass[:, column].sum() * along**2
        return found

    @cached_property
    def pivots(self) -> tuple[Floats, ...]:
        """Φ (P, d) of every column of each block."""
        first = self._columns
        return tuple(
            self.hanging.phi.along[[first[number, p] for p in range(block.size)]]
            for number, block in enumerate(self.rig.blocks)
        )

    @cached_property
    def sinking(self) -> tuple[Floats | None, ...]:
        """The mean of ψ ψᵀ (P, d, d) over the copies of every column of each block; None where no pivot moves down."""
        down = self.hanging.phi.down
        if not down.any():
            return (None,) * len(self.rig.blocks)
        found = [np.zeros((block.size, self.size, self.size)) for block in self.rig.blocks]
        for (block, column, copies), first in zip(self.rig.members, self.hanging.starts.tolist(), strict=True):
            share = copies / int(self.rig.blocks[block].count[column])
            found[block][column] += share * np.multiply.outer(down[first], down[first])
        return tuple(found)

    @cached_property
    def accelerances(self) -> Floats:
        """Σ φ_η² over all modes (d,), φᵀMφ = 1: what a sudden force on each coordinate gives it, per unit of force."""
        M = np.zeros((self.size, self.size))
        add_modal(self.hanging.structure, M, M.copy(), M.copy())
        for element in self.hanging.elements.inertia:
            element.add_to(M)
        for number, block in enumerate(self.rig.blocks):
            felt = at_infinity(block)[0].ravel() * block.count
            M += (self.pivots[number].T * felt) @ self.pivots[number]
        return np.diag(np.linalg.inv(M))

    @cached_property
    def _pushed(self) -> Floats:
        """The momentum along the rail by each rate of the structure, (d,)."""
        structure, whole = self.hanging.structure, np.zeros(self.size)
        for carrier, own in enumerate(structure.carriers):
            span = slice(structure.offsets[carrier], structure.offsets[carrier + 1])
            if own.M is not None:
                whole[span] += np.nan
            elif own.size:
                for place, value in slopes(structure, carrier, own.centre)[0].items():
                    whole[place] += float(own.mass) * value
        for number, block in enumerate(self.rig.blocks):
            whole += (block.count * block.mass.sum(0)) @ self.pivots[number]
        return whole

    def momentum(self, reduced: Reduced) -> Floats:
        """The momentum along the rail (n,) by each rate of a component; NaN where a modal support is part of it."""
        component, found = reduced.component, np.zeros(reduced.size)
        found[: len(component.eta)] = self._pushed[component.eta]
        for heavy, at in zip(component.heavies, reduced.places.tolist(), strict=False):
            block = self.rig.blocks[heavy.block]
            several = sum(share.copies * share.amplitude for share in heavy.shares)
            found[at : at + block.n] = several * block.sigma[:, heavy.column] * block.b[:, heavy.column]
        return found


def _leader(leader: Ints, k: int) -> int:
    while leader[k] != k:
        leader[k] = leader[leader[k]]
        k = int(leader[k])
    return k


def _data(block: Block, column: int) -> bytes:
    return b"".join(getattr(block, name)[:, column].tobytes() for name in ARRAYS)


@dataclass(frozen=True, eq=False)
class Reduced:
    """M, K and D of one component as sums of squares, over its η and the angles of its combinations."""

    carried: Carried
    component: Component

    @cached_property
    def places(self) -> Ints:
        """Where the angles of each combination begin, and the number of coordinates."""
        sizes = [self.carried.rig.blocks[heavy.block].n for heavy in self.component.heavies]
        return len(self.component.eta) + np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.places[-1])

    @cached_property
    def _known(self) -> dict[int, int]:
        """Where coordinates of the whole scene stand here, those of links of pendula by themselves."""
        found = {int(place): k for k, place in enumerate(self.component.eta)}
        first, d = self.carried.hanging.first, self.carried.size
        for heavy, at in zip(self.component.heavies, self.places.tolist(), strict=False):
            if heavy.is_alone:
                link = d + int(first[heavy.shares[0].first])
                found |= {link + i: at + i for i in range(self.carried.rig.blocks[heavy.block].n)}
        return found

    @cached_property
    def factors(self) -> tuple[Factor, Factor, Factor]:
        """Those of M, K and D; sizes in that of K may be negative."""
        return self._factor(0), self._factor(1), self._factor(2)

    def _factor(self, which: int) -> Factor:
        own = self.squares[which]
        rows = np.zeros((len(own), self.size))
        for row, element in zip(rows, own, strict=True):
            row[list(element.at)] = element.row
        parts = [
            self._chain(heavy, at)[which] for heavy, at in zip(self.component.heavies, self.places[:-1], strict=True)
        ]
        return Factor(
            np.concatenate([rows, *(part.rows for part in parts)]),
            np.concatenate([[element.size for element in own], *(part.size for part in parts)]),
        )

    @cached_property
    def squares(self) -> tuple[tuple[Element, ...], ...]:
        """The elements of M, K and D but those of the chains themselves, in the coordinates of the component."""
        known, owned = self._known, self.carried.owned[self.component.group]
        found = [[one._replace(at=tuple(known[place] for place in one.at)) for one in own] for own in owned]
        for start, matrices in self.modal:
            for own, S in zip(found, matrices, strict=True):
                root, signs = square_root(S)
                at = tuple(range(start, start + len(S)))
                own += [Element(at, tuple(row), sign) for row, sign in zip(root.tolist(), signs.tolist(), strict=True)]
        return tuple(map(tuple, found))

    @property
    def modal(self) -> Iterator[tuple[int, tuple[Floats, Floats, Floats]]]:
        """M, K and D of every modal support of the component, with the place of its coordinates."""
        structure = self.carried.hanging.structure
        for own, start in zip(structure.carriers, structure.offsets, strict=False):
            if own.M is not None and own.K is not None and own.D is not None and start in self._known:
                yield self._known[start], (own.M, own.K, own.D)

    def _chain(self, heavy: Heavy, at: int) -> tuple[Factor, Factor, Factor]:
        """The squares of M, K and D of one combination."""
        block, p, w = self.carried.rig.blocks[heavy.block], heavy.column, heavy.weight
        eta, n, size = self.component.eta, block.n, self.size
        ways = block.sigma[:, p]
        angle = np.zeros((n, size))
        angle[np.arange(n), at + np.arange(n)] = 1.0
        centre = np.zeros((n, size))
        centre[:, : len(eta)] = heavy.along[eta]
        centre[:, at : at + n] = np.tril(np.tile(ways * block.length[:, p], (n, 1)), -1)
        centre[np.arange(n), at + np.arange(n)] = ways * block.centre[:, p]
        turn = angle.copy()
        turn[1:] -= angle[:-1]
        turn[0, : len(eta)] -= heavy.felt[eta]

        def factor(*parts: tuple[Floats, Floats]) -> Factor:
            rows, sizes = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            return Factor(rows[sizes != 0], w * sizes[sizes != 0])

        weight = block.sigma[:, p] * block.b[:, p] * self.carried.rig.gravity
        return (
            factor((centre, block.mass[:, p]), (angle, block.inertia[:, p])),
            factor((angle, weight), (turn, block.stiffness[:, p])),
            factor((turn, block.damping[:, p]), (centre, block.drag[:, p])),
        )

    @cached_property
    def is_damped(self) -> bool:
        """Whether there are dampers or drag."""
        return bool(self.squares[2]) or any(
            block.damping[:, heavy.column].any() or block.drag[:, heavy.column].any() for block, heavy in self._chains
        )

    @property
    def _chains(self) -> Iterator[tuple[Block, Heavy]]:
        return ((self.carried.rig.blocks[heavy.block], heavy) for heavy in self.component.heavies)

    @cached_property
    def is_positive(self) -> bool:
        """Whether all springs are positive."""
        hang = all((block.sigma[:, heavy.column] > 0).all() for block, heavy in self._chains)
        return hang and all(element.size > 0 for element in self.squares[1])

    @cached_property
    def terms(self) -> Floats:
        """The sums of the absolute terms of K's diagonal, (n,)."""
        K = self.factors[1]
        found: Floats = (K.rows**2).T @ np.abs(K.size)
        found[: len(self.component.eta)] += self.hidden
        return found

    @cached_property
    def hidden(self) -> Floats:
        """What the sums of terms of each η exceed the stiffness that is left of them, (nη,)."""
        elements, eta = self.carried.hanging.elements, self.component.eta
        left = np.zeros(self.carried.size)
        for element in elements.stiffness:
            if len(element.at) == 1 and element.row == (1.0,) and element.at[0] < left.size:
                left[element.at[0]] += abs(element.size)
        return np.maximum(elements.terms - left, 0.0)[eta]

    @property
    def cancelling(self) -> float:
        """The largest ratio of the sum of absolute terms of an η's stiffness to what is left of it."""
        left = np.zeros(len(self.component.eta))
        for element in self.squares[1]:
            for place, value in zip(element.at, element.row, strict=True):
                if place < len(left):
                    left[place] += element.size * value**2
        held = left > 0
        return float(1 + (self.hidden[held] / left[held]).max(initial=0.0))

    @cached_property
    def free(self) -> Floats:
        """Motions (n, f) without any spring, orthonormal in M; no angle takes part in them."""
        eta = self.component.eta
        d = len(eta)
        joints = [heavy.felt[eta] * (block.stiffness[0, heavy.column] > 0) for block, heavy in self._chains]
        rows = np.zeros((len(self.squares[1]), d))
        M = np.zeros((d, d))
        for row, element in zip(rows, self.squares[1], strict=True):
            row[[k for k in element.at if k < d]] = [value for k, value in zip(*element[:2], strict=True) if k < d]
        for element in self.squares[0]:
            element.add_to(M)
        for block, heavy in self._chains:
            mass = heavy.weight * block.mass[:, heavy.column].sum()
            M += mass * np.multiply.outer(heavy.along[eta], heavy.along[eta])
        basis = null_space(np.concatenate([rows, np.reshape(joints, (len(joints), d))]))
        found = np.zeros((self.size, basis.shape[1]))
        for k in range(basis.shape[1]):
            before = found[:d, :k]
            own = basis[:, k] - before @ (before.T @ (M @ basis[:, k]))
            found[:d, k] = own / np.sqrt(own @ M @ own)
        return found

    @cached_property
    def coasting(self) -> Floats:
        """Free motions (n, f) that no damper drags either."""
        D, free = self.factors[2], self.free
        return free @ null_space(D.rows @ free)

    @cached_property
    def tree(self) -> Tree | None:
        """The component as a tree of coordinates with plain chains; None for any other."""
        known, d, hung = self._known, len(self.component.eta), list[tuple[Heavy, int]]()
        for block, heavy in self._chains:
            at = np.flatnonzero(heavy.along)
            if len(at) != 1 or heavy.felt.any() or not block.is_plain[heavy.column]:
                return None
            hung.append((heavy, known[int(at[0])]))
        mass, stiffness, springs = np.zeros(d), np.zeros(d), dict[tuple[int, int], tuple[float, float, float]]()
        for own, elements in zip((mass, stiffness), self.squares, strict=False):
            for element in elements:
                if element.size < 0 or len(element.at) > (1 if own is mass else 2) or element.at[-1] >= d:
                    return None
                if len(element.at) == 1:
                    own[element.at[0]] += element.size * element.row[0] ** 2
                elif (pair := (element.at[0], element.at[1])) in springs:
                    return None
                else:
                    springs[pair] = (element.size, element.row[0], element.row[1])
        if not d or len(springs) != d - 1:
            return None
        return _tree(mass, stiffness, springs, self._hung(hung))

    def _hung(self, hung: list[tuple[Heavy, int]]) -> list[Hung]:
        """The chains of every block, h² times as heavy, whose angles are h times as large."""
        found = []
        for number in sorted({heavy.block for heavy, _ in hung}):
            own = [(k, heavy, at) for k, (heavy, at) in enumerate(hung) if heavy.block == number]
            block = self.carried.rig.blocks[number].take(np.array([heavy.column for _, heavy, _ in own]))
            h = np.array([float(heavy.along.sum()) for _, heavy, _ in own])
            heavier = block.heavier(np.array([heavy.weight for _, heavy, _ in own]) * h**2)
            places = np.array([at for *_, at in own])
            found.append(Hung(heavier, places, h, self.places[[k for k, *_ in own]]))
        return found


def _tree(
    mass: Floats, stiffness: Floats, springs: dict[tuple[int, int], tuple[float, float, float]], hung: list[Hung]
) -> Tree | None:
    """The tree of coordinates in the order in which they are reached from the first; None where there is a loop."""
    beside: list[list[tuple[int, float, float, float]]] = [[] for _ in mass]
    for (one, two), (size, near, far) in springs.items():
        beside[one].append((two, size, near, far))
        beside[two].append((one, size, far, near))
    order, above = [0], {0: (-1, 0.0, 0.0, 0.0)}
    for i in order:
        for other, size, near, far in beside[i]:
            if other not in above:
                order.append(other)
                above[other] = (i, size, near, far)
    if len(order) < len(mass):
        return None
    at = {place: k for k, place in enumerate(order)}
    spring, near_end, far_end = np.array([above[place][1:] for place in order]).T
    return Tree(
        np.array(order),
        np.array([at.get(above[place][0], -1) for place in order]),
        stiffness[order],
        mass[order],
        spring,
        near_end,
        far_end,
        tuple(own._replace(places=np.array([at[place] for place in own.places.tolist()])) for own in hung),
    )


def square_root(S: Floats) -> tuple[Floats, Floats]:
    """Rows F (R, d) and signs (R,) with S = Fᵀ diag(signs) F: Cholesky's factor where there is one."""
    if not (S - np.diag(np.diag(S))).any():
        held = np.diag(S) != 0
        return np.diag(np.sqrt(np.abs(np.diag(S))))[held], np.sign(np.diag(S))[held]
    diagonal = np.diag(S)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    try:
        L = np.linalg.cholesky(S * scale * scale[:, None])
        return np.asarray((L / scale[:, None]).T), np.ones(len(S))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(S * scale * scale[:, None])
        kept = np.abs(values) > 4 * len(S) * ROUNDED * np.abs(values).max(initial=0.0)
        rows = np.sqrt(np.abs(values[kept]))[:, None] * vectors.T[kept] / scale
        return rows, np.sign(values[kept])
