"""The coupling of pendula through a structure: families, what of the structure each of them moves, and exchange.

The structure alone, its pendula as if they were stiff, has the modes K_s u = ω² (M_s + Σ m (ΦᵀΦ + ΨᵀΨ)) u; along them
the dynamic mass is the matrix −UᵀS(ω²)U/ω² (`modal.coupling.reduced`).  Pendula with a common own frequency ω_r form
family r.  Those of its combinations that do not move the structure stay at ω_r; with a from the amplitudes of a family
and everything else eliminated at x = ω_r²,

    F a = (x − ω_r²) a,    F = C_rr − (K − xM)_r· (K − xM')··⁻¹ (K − xM)·r,    M' without the family's h hᵀ,

has the eigenvalues ε ω_r²: to first order mode (r, ε) is shifted by Δω = ½ ε ω_r.  For one cart ε = μ_r/m_r, as in
`modal.coupling.analysis`.  The modes themselves are those of the reduced pencil (K, M).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi, sqrt

import numpy as np

from modal.assembly import ratio_at
from modal.coupling.damping import Damped
from modal.coupling.exchange import (
    MOST_MODES,
    STRONG,
    UNEVEN,
    Transfer,
    most_of_the_others,
    passes_energy,
    transfer,
)
from modal.coupling.families import FamilyRow, family_cells, family_name, mode_words
from modal.coupling.fixed_base import FixedBaseModes
from modal.coupling.numbering import Numbered
from modal.coupling.reduced import ReducedStructure, pencil
from modal.coupling.structure_damping import STILL, StructureDamping
from modal.eigen import degenerate_modes
from modal.errors import ComputationError
from modal.modes import moving_words, paired
from modal.report import HTML_ROWS, Displayed, Summary, counted
from modal.scene import Scene, name_of
from modal.structure import Structure, slopes
from modal.types import Floats, Ints

RANK = 1e-10
"""Smallest motion of the structure by a combination of equal pendula, over the largest, that is one."""
NOTHING_HOLDS = 256 * 2.0**-52
"""A stiffness this small over the sum of the sizes of its terms is 0."""
WEAK = 0.1
"""Coupling strength below which a splitting is computed as such, not as a difference."""
FAR = 0.2
"""Relative difference of first order from the splitting above which it is not told."""


@dataclass(frozen=True, eq=False, repr=False)
class StructureMode(Displayed):
    """A mode of the structure alone, its pendula stiff: `omega` (rad/s) and η by coordinates (d,).

    η is such that the point that moves most, of all pivots and centres of mass, moves by 1 m; `mass` (kg) is then its
    uᵀMu.  Where no such point moves, the largest of η is 1, and the mass in its unit.
    """

    omega: float
    shape: Floats
    mass: float


@dataclass(frozen=True, eq=False, repr=False)
class FamilyBranch(Displayed):
    """One mode of a family that moves other things: its ε, and its `omega` (rad/s), `splitting` ω − ω_r.

    `motion` (d,) is what the structure does, in its own modes, `pattern` (√kg m) the amplitudes of the members.
    `still` where the structure stands, and only springs between pendula split the family.
    """

    strength: float
    omega: float
    splitting: float
    motion: Floats
    pattern: Floats
    still: bool

    def is_first_order(self, omega: float) -> bool:
        """Whether ½ ε ω_r of a family at ω_r is near its splitting, and the coupling weak."""
        near = abs(self.strength * omega / 2 - self.splitting) <= FAR * abs(self.splitting)
        return abs(self.strength) <= STRONG and near


@dataclass(frozen=True, repr=False)
class PendulumFamily(Displayed):
    """Modes of single pendula of one frequency `omega` (rad/s): `members` are indices into the own modes.

    There are `fold` in all, counting copies, of which `still` combinations move nothing else.  `mass` (d,) in kg is the
    modal effective mass along each mode of the structure, Σ N (Γ Φ u)².
    """

    omega: float
    members: tuple[int, ...]
    fold: int
    still: int
    mass: Floats
    branches: tuple[FamilyBranch, ...]


@dataclass(frozen=True, repr=False)
class Exchanged(Displayed):
    """Own modes `first` and `second`, all copies moving alike: detuning δ and coupling g (rad/s), and the `exchange`.

    `strength` is the larger of their own shifts over ω, `alone` tells that no third mode of that frequency takes part.
    """

    first: int
    second: int
    detuning: float
    coupling: float
    strength: float
    alone: bool
    exchange: Transfer


@dataclass(frozen=True, eq=False, repr=False)
class StructureCoupling(Numbered, Displayed):
    """The coupling of a scene's pendula by the structure that they hang from, and by springs.

    >>> from modal import load
    >>> from modal.coupling import explain
    >>> found = explain(load("two-swings"))
    >>> found.words(found.modes[1].shape), found.families[0].still
    ('two swings in antiphase', 28)
    >>> [round(branch.omega, 6) for branch in found.families[0].branches]
    [9.944274, 10.028201]
    """

    scene: Scene
    reduced: ReducedStructure

    def _summary(self) -> Summary:
        families = counted(len(self.families), "family", "families")
        title = f"Coupling of {name_of(self.scene)}: {families} of modes on a structure"
        facts = [("coordinates of the structure", ", ".join(self.structure.names) or "none")]
        headings, cells = family_cells(self.rows(HTML_ROWS))
        words = frozenset(k for k, heading in enumerate(headings) if heading in ("family", "modes", "moves"))
        return Summary(title, facts, headings, cells, len(self.families), words=words)

    def rows(self, most: int | None = None) -> list[FamilyRow]:
        """The table of families, or of the first of them: a line for each mode that moves other things."""
        return [
            row for index, family in enumerate(self.families[:most]) for row in self._rows(family_name(index), family)
        ]

    def _rows(self, name: str, family: PendulumFamily) -> Iterator[FamilyRow]:
        share = self.share(family)
        still = self.number(family.omega) if family.still else None
        if not family.branches:
            modes = mode_words(still, None, family.still)
            yield FamilyRow(name, family.omega, None, None, None, None, share, modes, "nothing else")
        for k, branch in enumerate(family.branches):
            yield FamilyRow(
                family=name,
                omega=family.omega,
                mass=self.effective_mass(family, branch),
                strength=branch.strength,
                splitting=branch.splitting,
                beat=self.beat(family, branch),
                share=None if k else share,
                modes=mode_words(None if k else still, self.number(branch.omega), family.still),
                moves=self.moved(branch),
                fold=family.fold,
            )

    @property
    def structure(self) -> Structure:
        """The structure."""
        return self.reduced.hanging.structure

    @property
    def fixed_base(self) -> FixedBaseModes:
        """The modes of every kind of pendulum alone, all else held."""
        return self.reduced.fixed_base

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words, with what they hang from where there are several carriers."""
        return self.reduced.names

    # ------------------------------------------------------------------------------------------- the structure

    @cached_property
    def modes(self) -> tuple[StructureMode, ...]:
        """The structure's own modes, ascending, its pendula as if they were stiff."""
        d = self.reduced.d
        if not d:
            return ()
        square, shapes = _pencil(self.reduced.K[:d, :d], self.reduced.M[:d, :d])
        modes = []
        for value, shape in zip(square.tolist(), shapes.T, strict=True):
            largest = shape[np.abs(shape).argmax()]
            scale = (self._farthest(shape) or abs(largest)) * np.sign(largest)
            modes.append(StructureMode(sqrt(value), shape / scale, 1 / float(scale) ** 2))
        return tuple(modes)

    def _farthest(self, shape: Floats) -> float:
        """How far the point of the structure goes that goes farthest."""
        phi, structure = self.reduced.hanging.phi, self.structure
        ways = [np.hypot(phi.along @ shape, phi.down @ shape).max()]
        for k, carrier in enumerate(structure.carriers):
            if carrier.size and carrier.M is None:
                rows = [
                    sum(shape[at] * value for at, value in row.items()) for row in slopes(structure, k, carrier.centre)
                ]
                ways.append(np.hypot(*rows))
        return float(max(ways))

    @cached_property
    def basis(self) -> Floats:
        """U (d, d), the structure's own modes as columns over η."""
        d = self.reduced.d
        return np.column_stack([mode.shape for mode in self.modes]) if d else np.zeros((0, 0))

    def words(self, eta: Floats) -> str:
        """What of the structure moves in a motion η (d,): two carts in antiphase, board tilts."""
        return moving_words(self.structure, eta, np.diag(self.reduced.M)[: self.reduced.d])

    def stiffness(self, omega: float) -> Floats:
        """S (d, d) at ω (rad/s) over η: what a slow or fast push on the structure feels, N/m for coordinates in m."""
        d, x = self.reduced.d, omega**2
        direct = self.reduced.K[:d, :d] - x * self.reduced.M[:d, :d]
        return np.asarray(direct + self.reduced.eliminated(range(d), x))

    def dynamic(self, omega: float) -> Floats:
        """The dynamic mass matrix −UᵀSU/ω² (d, d) in kg along the structure's own modes, at ω (rad/s)."""
        return np.asarray(-self.basis.T @ self.stiffness(omega) @ self.basis / omega**2)

    @property
    def fast(self) -> Floats:
        """The mass (d,) in kg that a fast push along each own mode feels: all but the modal effective masses."""
        d = self.reduced.d
        pushes = self.reduced.M[d:, :d] @ self.basis
        return np.asarray(np.array([mode.mass for mode in self.modes]) - (pushes**2).sum(0))

    def felt(self, omega: Floats) -> Floats:
        """The mass (W, d) in kg that a push along each own mode feels at ω (W,), the others free to move: 1/(m⁻¹)_ss.

        Its zeros are modes of the scene, its poles where all that is free holds this motion still.
        """
        masses = np.full((len(omega), self.reduced.d), np.nan)
        for row, value in zip(masses, omega.tolist(), strict=True):
            try:
                row[:] = 1 / np.diag(np.linalg.inv(self.dynamic(value)))
            except np.linalg.LinAlgError:
                continue
        return masses

    # -------------------------------------------------------------------------------------------- the families

    @cached_property
    def _members(self) -> tuple[Ints, ...]:
        """The own modes of every family, ascending: those of one frequency and of one connected part of the scene."""
        gathered = degenerate_modes((self.fixed_base.omega**2,))
        members = []
        for first, size in zip(gathered.first, gathered.size, strict=True):
            alike = gathered.order[first : first + size]
            parts = self.reduced.parts[self.reduced.d + alike]
            members += [alike[parts == part] for part in dict.fromkeys(parts.tolist())]
        return tuple(members)

    @property
    def joins_pendula(self) -> bool:
        """Whether anything joins one pendulum to another: copies on one pivot are joined by what it moves."""
        d, kind = self.reduced.d, self.fixed_base.kind
        parts = self.reduced.parts[d:]
        moves = ((self.reduced.K[d:, :d] != 0) | (self.reduced.M[d:, :d] != 0)).any(1)
        several = np.any(moves & (self.fixed_base.count > 1))
        return bool(several) or any(np.ptp(kind[parts == part]) > 0 for part in set(parts.tolist()))

    @cached_property
    def _combinations(self) -> tuple[tuple[Floats, Floats], ...]:
        """Of every family the combinations of its members that move other things, and those that do not, as columns."""
        d, K, M = self.reduced.d, self.reduced.K, self.reduced.M
        size = np.sqrt(np.diag(M)[:d])
        combinations = []
        for members in self._members:
            at, whole = d + members, np.eye(len(members))
            if K[np.ix_(at, np.setdiff1d(np.arange(d, len(K)), at))].any() or np.any(
                K[np.ix_(at, at)] - np.diag(np.diag(K)[at])
            ):
                combinations.append((whole, whole[:, :0]))
                continue
            omega = self.fixed_base.omega[members[0]]
            rows = np.hstack([K[at, :d] / (omega * size), M[at, :d] * omega / size])
            left, sizes, _ = np.linalg.svd(rows)
            rank = int(np.sum(sizes > RANK * omega))
            combinations.append((left[:, :rank], left[:, rank:]))
        return tuple(combinations)

    @cached_property
    def _moving(self) -> tuple[Floats, Floats]:
        """ω² ascending and vectors (N, R) of all modes but those that leave everything but one family still."""
        d, K, M = self.reduced.d, self.reduced.K, self.reduced.M
        columns = [np.eye(len(K))[:, :d]]
        for members, (moving, _) in zip(self._members, self._combinations, strict=True):
            columns.append(np.zeros((len(K), moving.shape[1])))
            columns[-1][d + members] = moving
        T = np.hstack(columns)
        square, shapes = _pencil(T.T @ K @ T, T.T @ M @ T)
        return square, T @ shapes

    @cached_property
    def omega(self) -> Floats:
        """All different natural frequencies (rad/s), ascending."""
        still = [family.omega for family in self.families if family.still]
        return np.unique(np.concatenate([np.sqrt(self._moving[0]), still]))

    @cached_property
    def families(self) -> tuple[PendulumFamily, ...]:
        """The families, one for each distinct frequency of pendula alone, ascending."""
        branches = self._branches
        families = []
        for r, (members, (_, still)) in enumerate(zip(self._members, self._combinations, strict=True)):
            pushes = self.reduced.M[: self.reduced.d, self.reduced.d + members].T @ self.basis
            fold = int(self.fixed_base.count[members].sum())
            left = fold - len(members) + still.shape[1]
            omega = float(self.fixed_base.omega[members[0]])
            families.append(
                PendulumFamily(omega, tuple(members.tolist()), fold, left, (pushes**2).sum(0), tuple(branches[r]))
            )
        return tuple(families)

    @cached_property
    def _branches(self) -> list[list[FamilyBranch]]:
        """Of every family the modes that move other things; each mode belongs to one family or to the structure."""
        d, (square, vectors) = self.reduced.d, self._moving
        eigen = [self._shifts(r) for r in range(len(self._members))]
        columns = [self.reduced.M[:, :d] @ self.basis / np.sqrt([mode.mass for mode in self.modes])] if d else []
        places: list[tuple[int, int]] = [(-1, s) for s in range(d)]
        for r, (members, (_, patterns)) in enumerate(zip(self._members, eigen, strict=True)):
            columns.append(np.zeros((len(vectors), patterns.shape[1])))
            columns[-1][d + members] = patterns
            places += [(r, k) for k in range(patterns.shape[1])]
        shares = (np.hstack(columns).T @ vectors) ** 2
        taken = paired(shares, np.ones(shares.shape[1], dtype=np.int64))
        branches: list[list[FamilyBranch]] = [[] for _ in self._members]
        for row, mode in enumerate(taken.tolist()):
            r, k = places[row]
            if r >= 0:
                branches[r].append(self._branch(r, k, eigen[r], float(square[mode]), vectors[:, mode]))
        return [sorted(group, key=lambda branch: branch.omega) for group in branches]

    def _shifts(self, r: int) -> tuple[Floats, Floats]:
        """ε ω_r² ascending and patterns (members, R) of a family, by first order; infinite where nothing resists."""
        members, moving = self._members[r], self._combinations[r][0]
        if not moving.shape[1]:
            return np.zeros(0), moving
        square = float(self.fixed_base.omega[members[0]]) ** 2
        try:
            shift, patterns = np.linalg.eigh(moving.T @ self.reduced.pulled(members.tolist(), square) @ moving)
        except np.linalg.LinAlgError:
            return np.full(moving.shape[1], inf), moving
        return shift, moving @ patterns

    def _apart(self, members: Ints, x: float) -> Floats:
        """The exact shifts of ω² of some own modes by all else at x."""
        at = (self.reduced.d + members).tolist()
        stiffness = self.reduced.K[np.ix_(at, at)]
        return np.asarray(stiffness - np.diag(np.diag(stiffness)) + self.reduced.eliminated(at, x))

    def _branch(self, r: int, k: int, eigen: tuple[Floats, Floats], square: float, vector: Floats) -> FamilyBranch:
        members, (shift, patterns), d = self._members[r], eigen, self.reduced.d
        pole = float(self.fixed_base.omega[members[0]])
        moved = vector[:d]
        share = float(moved @ self.reduced.M[:d, :d] @ moved)
        strength = float(shift[k]) / pole**2
        apart = square - pole**2
        if abs(strength) < WEAK:
            beside = np.linalg.eigvalsh(patterns.T @ self._apart(members, square) @ patterns)
            near = float(beside[np.abs(beside - apart).argmin()])
            apart = near if abs(near - apart) <= 1e-6 * pole**2 else apart
        motion: Floats = np.asarray(np.linalg.solve(self.basis, moved) if d else moved, dtype=np.float64)
        pattern = vector[d + members]
        turn = np.sign(pattern[np.abs(pattern).argmax()]) or 1.0
        omega = sqrt(square)
        return FamilyBranch(
            strength, omega, apart / (omega + pole), turn * motion, turn * pattern, still=share <= STILL
        )

    @cached_property
    def structure_modes(self) -> tuple[tuple[float, Floats], ...]:
        """ω (rad/s) of the modes that belong to the structure rather than to a family, with η in its own modes."""
        taken = [branch.omega for family in self.families for branch in family.branches]
        left = np.sqrt(self._moving[0]).tolist()
        for omega in taken:
            left.pop(int(np.abs(np.array(left) - omega).argmin()))
        every = np.sqrt(self._moving[0])
        rows = [int(np.abs(every - omega).argmin()) for omega in left]
        vectors = self._moving[1][: self.reduced.d]
        inverse = np.asarray(np.linalg.inv(self.basis), dtype=np.float64)
        return tuple((omega, inverse @ vectors[:, k]) for omega, k in zip(left, rows, strict=True))

    def beats(self, family: PendulumFamily) -> tuple[float, ...]:
        """2π/|Δω| (s) of every two levels of a family that is weakly coupled, where energy goes over between them."""
        if not all(branch.is_first_order(family.omega) for branch in family.branches):
            return ()
        levels, weights = self._levels(family)
        gaps = [
            abs(levels[k] - levels[j])
            for k in range(len(levels))
            for j in range(k)
            if passes_energy(weights[k], weights[j])
        ]
        return tuple(sorted((2 * pi / gap for gap in gaps if gap > 0), reverse=True))

    def _levels(self, family: PendulumFamily) -> tuple[list[float], Floats]:
        """Of every mode of a family that moves, then of those that are still, Δω and its share of each member released.

        The shares are (levels, members), of one copy of each.
        """
        count = self.fixed_base.count[list(family.members)]
        levels = [branch.splitting for branch in family.branches]
        patterns = [branch.pattern**2 / (branch.pattern @ branch.pattern) / count for branch in family.branches]
        weights = np.reshape(patterns, (len(levels), len(count)))
        if family.still:
            return [*levels, 0.0], np.vstack([weights, np.maximum(1 - weights.sum(0), 0.0)])
        return levels, weights / weights.sum(0)

    def moved(self, branch: FamilyBranch) -> str:
        """What of the structure moves in a mode, in words; empty where there is no structure."""
        if branch.still:
            return "structure still" if self.reduced.d else ""
        return self.words(self.basis @ branch.motion)

    def effective_mass(self, family: PendulumFamily, branch: FamilyBranch) -> float | None:
        """Σ N (Γ Φ u)² (kg) of a family along the motion u of the structure in one of its modes.

        u is scaled as the structure's own modes are, by the point that moves most; None where the structure is still.
        """
        if branch.still:
            return None
        motion = self.basis @ branch.motion
        scale = self._farthest(motion) or float(np.abs(motion).max())
        pushes = self.reduced.M[: self.reduced.d, self.reduced.d + np.array(family.members)].T @ motion / scale
        return float(pushes @ pushes)

    def beat(self, family: PendulumFamily, branch: FamilyBranch) -> float | None:
        """2π/|Δω| (s) between a mode of a family and the nearest other one; None where first order does not hold."""
        if not self.beats(family):
            return None
        levels, weights = self._levels(family)
        place = family.branches.index(branch)
        gaps = [
            abs(branch.splitting - level)
            for level, weight in zip(levels, weights, strict=True)
            if level != branch.splitting and passes_energy(weights[place], weight)
        ]
        return 2 * pi / min(gaps) if gaps else None

    def share(self, family: PendulumFamily) -> float | None:
        """The most that the others of a family hold of the energy of any that is released, within its slowest beat.

        Of two levels without dampers that is halfway.  None where the family does not beat, and where joints damp some
        of its pendula faster than others.
        """
        members = list(family.members)
        rates = self.fixed_base.rate[members]
        beats = self.beats(family)
        if not beats or np.ptp(rates) > UNEVEN * (2 * pi / beats[0] + rates.max()):
            return None
        splittings, weights = self._levels(family)
        decays = [self._decay(branch.omega) for branch in family.branches]
        if family.still:
            decays.append(float(rates[0]) + self._lost(family.omega))
        levels = [complex(splitting, decay) for splitting, decay in zip(splittings, decays, strict=True)]
        return max(most_of_the_others(each.tolist(), levels) for each in (weights / weights.sum(0)).T)

    def _decay(self, omega: float) -> float:
        """The decay rate (1/s) of the mode of the scene at ω."""
        together = [mode for mode in self.damped if mode.kind is None]
        return min(together, key=lambda mode: abs(mode.omega - omega)).decay

    def _lost(self, omega: float) -> float:
        """ζω (1/s) by the damping ratio of the scene."""
        return float(ratio_at(self.reduced.hanging.rig)(np.array([omega]))[0]) * omega

    # ---------------------------------------------------------------------------------------------- exchange

    @cached_property
    def pairs(self) -> tuple[Exchanged, ...]:
        """Pairs of own modes of different kinds, those that exchange most first; none of more than MOST_MODES modes."""
        count = len(self.fixed_base.omega)
        if count > MOST_MODES:
            return ()
        kinds = self.fixed_base.kind
        pairs = [(a, b) for a in range(count) for b in range(a + 1, count) if kinds[a] != kinds[b]]
        exchanges = [pair for a, b in pairs if (pair := self._exchanged(a, b))]
        return tuple(sorted(exchanges, key=lambda pair: -pair.exchange.most))

    def _exchanged(self, a: int, b: int) -> Exchanged | None:
        wa, wb = float(self.fixed_base.omega[a]), float(self.fixed_base.omega[b])
        x = wa * wb
        try:
            free = self.reduced.pulled((a, b), x)
            lossy = free if self.damping.matrix is None else self.reduced.pulled((a, b), x, self.damping.matrix)
        except np.linalg.LinAlgError:
            return None
        first, second = wa + free[0, 0] / (2 * wa), wb + free[1, 1] / (2 * wb)
        coupling = float(free[0, 1]) / (2 * sqrt(x))
        shifts = [complex(lossy[k, k]) / (2 * w) for k, w in enumerate((wa, wb))]
        passed = transfer(wa + shifts[0], wb + shifts[1], complex(lossy[0, 1]) / (2 * sqrt(x)))
        strength = max(abs(free[0, 0]) / wa**2, abs(free[1, 1]) / wb**2, abs(free[0, 1]) / x)
        families = [members for members in self._members if a in members or b in members]
        alone = sum(map(len, families)) == 2
        return Exchanged(a, b, float(first - second), coupling, float(strength), alone, passed)

    # ------------------------------------------------------------------------------------------------ dampers

    @cached_property
    def damping(self) -> StructureDamping:
        """What dampers and drives do to its modes."""
        return StructureDamping(self.scene, self.reduced, *self._every)

    @property
    def damped(self) -> tuple[Damped, ...]:
        """The damping and excitation of each mode that oscillates, ascending; `from_cart` is that of the structure."""
        return self.damping.modes

    @cached_property
    def _every(self) -> tuple[Floats, Floats]:
        """ω² and vectors of all modes in the reduced coordinates, those that are still among them."""
        square, vectors = self._moving
        squares, columns = [square], [vectors]
        for members, (_, still) in zip(self._members, self._combinations, strict=True):
            squares.append(np.full(still.shape[1], self.fixed_base.omega[members[0]] ** 2))
            columns.append(np.zeros((len(vectors), still.shape[1])))
            columns[-1][self.reduced.d + members] = still
        return np.concatenate(squares), np.hstack(columns)


def _pencil(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Squares ascending, 0 where nothing holds a mode, and vectors with vᵀMv = 1.

    ComputationError for a structure that falls over.
    """
    square, vectors = pencil(K, M)
    terms = np.einsum("ik,ij,jk->k", np.abs(vectors), np.abs(K), np.abs(vectors))
    square = np.where(np.abs(square) <= NOTHING_HOLDS * terms, 0.0, square)
    if np.any(square < 0):
        raise ComputationError(
            "the structure does not stand by itself: at rest it falls over, and nothing swings about it"
        )
    return square, vectors
