"""Families of pendula on several coordinates, or joined by springs, from the reduced matrices.

With a from the amplitudes of a family and everything else eliminated at x = ω_r²,

    F a = (x − ω_r²) a,    F = C_rr − (K − xM)_r· (K − xM')··⁻¹ (K − xM)·r,    M' without the family's h hᵀ,

has the eigenvalues ε ω_r²: to first order mode (r, ε) is shifted by Δω = ½ ε ω_r. For one cart ε = μ_r/m_r, as in
`modal.coupling.dynamic_mass`. The modes themselves are those of the reduced eigenvalue problem (K, M).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, sqrt
from typing import Any

import numpy as np

from modal.coupling.damping import STILL_SHARE_MAX
from modal.coupling.dynamic_mass import FALLS, CartMode, Other
from modal.coupling.families import WEAK_COUPLING, FamilyBranch
from modal.coupling.reduced import ReducedStructure, pencil
from modal.eigen import degenerate_modes
from modal.errors import ComputationError
from modal.modes import pair_rows
from modal.types import NOISE_OF_SUM, Floats, Ints

STRUCTURE_MOTION_MIN = 1e-10
"""Tolerance: smallest motion of the structure by a combination of equal pendula, over the largest, that is one."""


@dataclass(frozen=True, eq=False)
class ReducedPencil:
    """Modes of the reduced matrices, with own modes `basis` (d, d) of the structure over η, and D of dampers."""

    reduced: ReducedStructure
    basis: Floats
    D: Floats | None

    @cached_property
    def members(self) -> tuple[Ints, ...]:
        """The own modes of every family, ascending: those of one frequency and of one connected part of the scene."""
        groups = degenerate_modes((self.reduced.fixed_base.omega**2,))
        members = []
        for first, size in zip(groups.first, groups.size, strict=True):
            alike = groups.order[first : first + size]
            parts = self.reduced.parts[self.reduced.d + alike]
            members += [alike[parts == part] for part in dict.fromkeys(parts.tolist())]
        return tuple(members)

    def still(self, r: int) -> int:
        """How many combinations of different members of a family move nothing else."""
        return len(self.members[r]) - int(self.combinations[r].shape[1])

    @cached_property
    def combinations(self) -> tuple[Floats, ...]:
        """Of every family the combinations of its members that move other things, as columns."""
        d, K, M = self.reduced.d, self.reduced.K, self.reduced.M
        size = np.sqrt(np.diag(M)[:d])
        combinations = []
        for members in self.members:
            at, basis = d + members, np.eye(len(members))
            if K[np.ix_(at, np.setdiff1d(np.arange(d, len(K)), at))].any() or np.any(
                K[np.ix_(at, at)] - np.diag(np.diag(K)[at])
            ):
                combinations.append(basis)
                continue
            omega = self.reduced.fixed_base.omega[members[0]]
            rows = np.hstack([K[at, :d] / (omega * size), M[at, :d] * omega / size])
            left_vectors, sizes, _ = np.linalg.svd(rows)
            combinations.append(left_vectors[:, : int(np.sum(sizes > STRUCTURE_MOTION_MIN * omega))])
        return tuple(combinations)

    @cached_property
    def moving(self) -> tuple[Floats, Floats]:
        """ω² ascending and vectors (N, R) of all modes except those in which only one family moves."""
        d, K, M = self.reduced.d, self.reduced.K, self.reduced.M
        T = np.hstack([np.eye(len(K))[:, :d], *map(self._spread, range(len(self.members)), self.combinations)])
        square, shapes = stable_pencil(T.T @ K @ T, T.T @ M @ T)
        return square, T @ shapes

    def _spread(self, r: int, columns: Floats) -> Floats:
        """Columns over the members of a family over all coordinates."""
        spread = np.zeros((len(self.reduced.M), columns.shape[1]))
        spread[self.reduced.d + self.members[r]] = columns
        return spread

    @cached_property
    def branches(self) -> list[list[FamilyBranch]]:
        """Of every family the modes that move other things; each mode belongs to one family or to the structure."""
        square, vectors = self.moving
        branches: list[list[FamilyBranch]] = [[] for _ in self.members]
        for (r, k), mode in zip(self._places, self._owners.tolist(), strict=True):
            if r >= 0:
                branches[r].append(self._branch(r, k, float(square[mode]), vectors[:, mode]))
        return [sorted(group, key=lambda branch: branch.omega) for group in branches]

    @cached_property
    def _shifts(self) -> list[tuple[Floats, Floats]]:
        """Of every family ε ω_r² ascending and patterns (members, R), to first order; infinite if nothing resists."""
        return [self._shift(r) for r in range(len(self.members))]

    def _shift(self, r: int) -> tuple[Floats, Floats]:
        members, moving = self.members[r], self.combinations[r]
        if not moving.shape[1]:
            return np.zeros(0), moving
        square = float(self.reduced.fixed_base.omega[members[0]]) ** 2
        try:
            shift, patterns = np.linalg.eigh(moving.T @ self.reduced.pulled(members.tolist(), square) @ moving)
        except np.linalg.LinAlgError:
            return np.full(moving.shape[1], inf), moving
        return shift, moving @ patterns

    @property
    def _places(self) -> list[tuple[int, int]]:
        """What modes may belong to: the structure's own modes (−1, s), and the patterns k of every family r."""
        patterns = [
            (r, k) for r, (_, patterns_of_family) in enumerate(self._shifts) for k in range(patterns_of_family.shape[1])
        ]
        return [(-1, s) for s in range(self.reduced.d)] + patterns

    @cached_property
    def _owners(self) -> Ints:
        """The mode of every one of these places, by the share in its potential energy; of drifts in the kinetic."""
        d, (square, vectors) = self.reduced.d, self.moving
        carriers = np.vstack([self.basis, np.zeros((len(vectors) - d, d))])
        columns = np.hstack([carriers, *(self._spread(r, patterns) for r, (_, patterns) in enumerate(self._shifts))])
        shares = np.zeros((columns.shape[1], len(square)))
        for S, modes, size in ((self.reduced.K, square > 0, square), (self.reduced.M, square == 0, 1 + square)):
            energies = np.einsum("ik,ij,jk->k", columns, S, columns)[:, None] * size[modes]
            products = (columns.T @ S @ vectors[:, modes]) ** 2
            shares[:, modes] = np.divide(products, energies, out=np.zeros_like(products), where=energies > 0)
        return pair_rows(shares, np.ones(len(square), dtype=np.int64))

    @cached_property
    def others(self) -> tuple[Other, ...]:
        """ω, and η in its own modes, of the modes that belong to the structure rather than to a family."""
        square, vectors = self.moving
        d = self.reduced.d
        return tuple((sqrt(square[k]), self._in_own_modes(vectors[:d, k])) for k in sorted(self._owners[:d].tolist()))

    def _in_own_modes(self, eta: Floats) -> Floats:
        """A motion η in the structure's own modes."""
        return np.asarray(np.linalg.solve(self.basis, eta) if len(eta) else eta, dtype=np.float64)

    def _branch(self, r: int, k: int, square: float, vector: Floats) -> FamilyBranch:
        members, (shift, patterns), d = self.members[r], self._shifts[r], self.reduced.d
        pole = float(self.reduced.fixed_base.omega[members[0]])
        motion, strength, difference = vector[:d], float(shift[k]) / pole**2, square - pole**2
        share = float(motion @ self.reduced.M[:d, :d] @ motion)
        if abs(strength) < WEAK_COUPLING:
            exact_shifts = np.linalg.eigvalsh(patterns.T @ self._exact_shifts(members, square) @ patterns)
            closest = float(exact_shifts[np.abs(exact_shifts - difference).argmin()])
            difference = closest if abs(closest - difference) <= 1e-6 * pole**2 else difference
        pattern, omega = vector[d + members], sqrt(square)
        turn = np.sign(pattern[np.abs(pattern).argmax()]) or 1.0
        return FamilyBranch(
            strength,
            omega,
            difference / (omega + pole),
            turn * self._in_own_modes(motion),
            turn * pattern,
            still=share <= STILL_SHARE_MAX,
            damping_factor=self._damping_factor(r, patterns[:, k], float(shift[k])),
        )

    def _damping_factor(self, r: int, pattern: Floats, shift: float) -> complex:
        """The factor by which dampers other than those of the members change the shift of a pattern."""
        if self.D is None or not shift or not np.isfinite(shift):
            return 1.0
        members, at = self.members[r].tolist(), self.reduced.d + self.members[r]
        omega = float(self.reduced.fixed_base.omega[members[0]])
        own_part = 1j * omega * (pattern @ self.D[np.ix_(at, at)] @ pattern)
        return complex(pattern @ self.reduced.pulled(members, omega**2, self.D) @ pattern - own_part) / shift

    def _exact_shifts(self, members: Ints, x: float) -> Floats:
        """The exact shifts of ω² of some own modes by all else at x."""
        at = (self.reduced.d + members).tolist()
        stiffness = self.reduced.K[np.ix_(at, at)]
        return np.asarray(stiffness - np.diag(np.diag(stiffness)) + self.reduced.elimination(at, x))

    @property
    def cart_modes(self) -> tuple[CartMode, ...]:
        """None: there is no single cart."""
        return ()

    def between(self, modes: tuple[int, int]) -> tuple[float, bool]:
        """No one mass that two modes push, and that nothing is known to take part with them."""
        return inf, True

    def pulled(self, modes: tuple[int, int], *, with_dampers: bool = False) -> Any:
        """F of two own modes halfway between their frequencies, with dampers or without.

        It fails with a LinAlgError if nothing else resists.
        """
        x = float(self.reduced.fixed_base.omega[list(modes)].prod())
        return self.reduced.pulled(modes, x, self.D if with_dampers else None)


def stable_pencil(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Squares ascending, 0 for free modes, and vectors with vᵀMv = 1.

    Raise ComputationError for an unstable structure.
    """
    square, vectors = pencil(K, M)
    terms = NOISE_OF_SUM * np.einsum("ik,ij,jk->k", np.abs(vectors), np.abs(K), np.abs(vectors))
    rounding = len(square) * np.finfo(float).eps * square.max(initial=0.0)
    square = np.where((np.abs(square) <= terms) | ((square < 0) & (square >= -rounding)), 0.0, square)
    if np.any(square < 0):
        raise ComputationError(FALLS)
    return square, vectors
