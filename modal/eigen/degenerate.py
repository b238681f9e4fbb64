"""Equal frequencies of different pendula on a cart: all of their modes but one leave the cart still.

Take d fixed-base modes of one frequency, with momenta P_i and modal masses E_i, moving with amplitudes a_i/√E_i.
They push the cart with Σ a_i p_i, p_i = P_i/√E_i; the combinations orthogonal to p,

    a^(k) = (p_1 p_{k+1}, …, p_k p_{k+1}, −s_k, 0, …)/√(s_k s_{k+1}),    s_k = p_1² + … + p_k²,    k = 1 … d − 1,

leave it still, are orthonormal, and for equal pendula become (1, −1, 0, …)/√2, (1, 1, −2, 0, …)/√6, …  The one mode
that moves the cart sees a single pole of weight Σ p_i².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.assembly import Block
from modal.eigen.chains import ChainShapes, fixed_shapes
from modal.eigen.counts import Built
from modal.types import Floats, Ints

TOLERANCE = 16 * 2.0**-52
"""Squares this close are taken as equal: the largest difference of equal ones by rounding."""


@dataclass(frozen=True, eq=False)
class DegenerateModes:
    """The fixed-base modes of all kinds, clustered where their frequencies are equal.

    `order` (K,) sorts the modes, counted block by block, mode by mode, column by column; cluster c consists of
    `size[c]` of them from `first[c]` on and has the square `square[c]`, that of its lowest member; all (C,).  `rounded`
    tells whether the members of any differ in their last digits.
    """

    order: Ints
    first: Ints
    size: Ints
    square: Floats
    rounded: bool

    @property
    def inside(self) -> Ints:
        """Gaps inside clusters, as indices into the gaps between all K modes; each has a mode of that square."""
        inner = np.ones(len(self.order), dtype=np.bool_)
        inner[self.first] = False
        return np.flatnonzero(inner) - 1

    @property
    def closest(self) -> float:
        """The smallest relative gap between two different squares."""
        return float((np.diff(self.square) / self.square[1:]).min(initial=1.0))

    @property
    def shared(self) -> Ints:
        """Clusters with more than one member."""
        return np.flatnonzero(self.size > 1)


def degenerate_modes(squares: tuple[Floats, ...]) -> DegenerateModes:
    """Clusters of the squares (n, P) of every block."""
    flat = np.concatenate([square.ravel() for square in squares])
    order = np.argsort(flat, kind="stable")
    ascending = flat[order]
    far = np.diff(ascending, prepend=-1.0) > TOLERANCE * ascending
    starts = np.append(np.flatnonzero(far), len(flat))
    for run in np.flatnonzero(np.diff(starts) > 2):
        first, last = (int(end) for end in starts[run : run + 2])
        while (first := int(np.searchsorted(ascending[:last], ascending[first] * (1 + TOLERANCE), "right"))) < last:
            far[first] = True
    starts = np.flatnonzero(far)
    sizes = np.diff(starts, append=len(flat))
    rounded = bool(np.any(ascending[starts] != ascending[starts + sizes - 1]))
    return DegenerateModes(order, starts, sizes, ascending[starts], rounded)


@dataclass(frozen=True, eq=False)
class Still:
    """The modes of different pendula that together hold the cart still; a row is a cluster and a vector in it.

    `blocks` have their counts folded into their masses.
    """

    blocks: tuple[Block, ...]
    clusters: DegenerateModes
    route = "effective mass"
    slack = 1
    dense_error = 0.0
    built = Built("equal frequencies of different pendula", 1, 0)

    @cached_property
    def folds(self) -> Ints:
        """The number of vectors of each shared cluster."""
        return self.clusters.size[self.clusters.shared] - 1

    @property
    def squares(self) -> Floats:
        """ω² of every row."""
        return np.repeat(self.clusters.square[self.clusters.shared], self.folds)

    def shapes(self, rows: Ints) -> ChainShapes:
        """Shapes of these rows."""
        turns, energies = ([np.zeros((*b.mass.shape, len(rows))) for b in self.blocks] for _ in range(2))
        residual = np.zeros(len(rows))
        ends = np.cumsum(self.folds)
        for at, row in enumerate(rows):
            group = int(np.searchsorted(ends, row, side="right"))
            members = self._members(int(self.clusters.shared[group]))
            number = int(row - ends[group] + self.folds[group])
            for member, amplitude in zip(members, _combination(members, number), strict=False):
                turns[member.block][:, member.column, at] = amplitude * member.turn
                energies[member.block][:, member.column, at] = amplitude**2 * member.energy
                residual[at] = max(residual[at], member.residual)
        return ChainShapes(
            cart=np.zeros(len(rows)),
            turns=tuple(turns),
            energies=tuple(energies),
            modal_mass=np.ones(len(rows)),
            momentum=np.zeros(len(rows)),
            residual=residual,
        )

    def _members(self, cluster: int) -> list[_Member]:
        """The modes in a cluster, each of modal mass 1, the one with the largest momentum first."""
        first, size = int(self.clusters.first[cluster]), int(self.clusters.size[cluster])
        places = np.sort(self.clusters.order[first : first + size])
        members, offset = [], 0
        for index, block in enumerate(self.blocks):
            here = places[(places >= offset) & (places < offset + block.mass.size)] - offset
            columns = here % block.size
            motion = fixed_shapes(block.take(columns), np.full(len(here), self.clusters.square[cluster]))
            scale = 1 / np.sqrt(motion.modal_mass)
            members += [
                _Member(
                    block=index,
                    column=int(column),
                    momentum=float(motion.momentum[k] * scale[k]),
                    turn=motion.turns[0][:, 0, k] * scale[k],
                    energy=motion.energies[0][:, 0, k] * scale[k] ** 2,
                    residual=float(motion.residual[k]),
                )
                for k, column in enumerate(columns)
            ]
            offset += block.mass.size
        return sorted(members, key=lambda member: -abs(member.momentum))


@dataclass(frozen=True, eq=False)
class _Member:
    """A pendulum's fixed-base mode of modal mass 1: its momentum p, turns and energies (n,)."""

    block: int
    column: int
    momentum: float
    turn: Floats
    energy: Floats
    residual: float


def _combination(members: list[_Member], number: int) -> Floats:
    """The amplitudes a^(number + 1) of the first number + 2 members."""
    p = np.array([member.momentum for member in members[: number + 2]])
    p = p / abs(p[0]) if p[0] else np.ones_like(p)
    s = np.cumsum(p * p)
    amplitudes: Floats = np.append(p[:-1] * p[-1], -s[-2]) / np.sqrt(s[-2]) / np.sqrt(s[-1])
    return amplitudes
