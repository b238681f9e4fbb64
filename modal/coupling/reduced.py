"""What pendula hang from and its pendula in few coordinates: η, and the modes of every pendulum alone, all else held.

A mode φ of one pendulum alone, φᵀAφ = 1, pushes its pivot with Γ = φᵀb; on a carrier that turns by Ω η a
spring at the first joint pulls with k_1 φ_1.  Copies on pivots that move alike count as one, √N φ, their N − 1 other
combinations leave everything else still.  Over η and the amplitudes of these modes

    M = [[M_s + Σ m (ΦᵀΦ + ΨᵀΨ), h], [hᵀ, 1]],    K = [[K_s, g], [gᵀ, diag ω² + C]],

h = √N Γ Φ, g = −√N k_1 φ_1 Ω, C from springs between pendula.  A fixed support has no η, a cart one.  What remains of
it for η is, at x = ω², the dynamic stiffness

    S(x) = K_s − x (M_s + Σ Φᵀ diag(m_dyn(x), m) Φ)        (without springs at those joints and C)

(Craig & Bampton, AIAA J. 6, 1313 (1968), with modes of the pendula by the recursion).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal.assembly import Hanging, Rig, dissipators_of
from modal.coupling.fixed_base import FixedBaseModes, Kind, fixed_base_modes
from modal.errors import ComputationError
from modal.scene import Scene
from modal.types import Floats, Ints

MOST_COORDINATES = 1200


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """M and K over the d coordinates η and the amplitudes of the modes `fixed_base`."""

    hanging: Hanging
    fixed_base: FixedBaseModes

    @property
    def d(self) -> int:
        """How many coordinates what carries the pendula has."""
        return self.hanging.structure.size

    @property
    def rig(self) -> Rig:
        """The pendula, and what carries them."""
        return self.hanging.rig

    @cached_property
    def kinds(self) -> tuple[Kind, ...]:
        """The kinds of pendula, as `fixed_base.kind` counts them."""
        return tuple(self.rig.names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words, with what they hang from where there are several carriers."""
        names = tuple(self.rig.names.values())
        carriers = self.hanging.structure.carriers
        if len(carriers) == 1:
            return names
        places = [carriers[self.hanging.structure.pivots[pivot].carrier].name for pivot in self.pivots]
        return tuple(f"{name} on {place}" for name, place in zip(names, places, strict=True))

    @cached_property
    def pivots(self) -> tuple[int, ...]:
        """The first pendulum of every kind, as the structure counts them."""
        first = {kind: p for p, kind in reversed(list(enumerate(map(tuple, self.hanging.kinds.tolist()))))}
        return tuple(first[kind] for kind in self.kinds)

    @cached_property
    def along(self) -> Floats:
        """Φ (kinds, d)."""
        return self.hanging.phi.along[list(self.pivots)]

    @cached_property
    def joints(self) -> tuple[Floats, Floats]:
        """√k_1 Ω of the first joint's springs (kinds, d) of one copy, and √(N k_1) φ_1 (K,) of the modes."""
        turning, modes = self.hanging.phi.turning[list(self.pivots)], self.fixed_base
        root = np.sqrt([self.rig.blocks[block].stiffness[0, column] for block, column in self.kinds])
        first = np.array([shape[0] for shape in modes.shapes])
        return root[:, None] * turning, root[modes.kind] * np.sqrt(modes.count) * first

    @cached_property
    def own_inertia(self) -> Floats:
        """(d, d): M_s with what pendula weigh as they go down."""
        return self.hanging.supporting[0]

    @cached_property
    def own_stiffness(self) -> Floats:
        """K_s (d, d)."""
        copies = np.array([float(self.rig.blocks[block].count[column]) for block, column in self.kinds])
        return self.hanging.supporting[1] + (copies * self.joints[0].T) @ self.joints[0]

    @property
    def own_damping(self) -> Floats:
        """D_s (d, d), without joints and drag along the rail."""
        return self.hanging.supporting[2]

    @cached_property
    def push(self) -> Floats:
        """The momentum h (d, K) of every mode along η."""
        modes = self.fixed_base
        return np.asarray((self.along[modes.kind] * (np.sqrt(modes.count) * modes.push)[:, None]).T)

    @property
    def only_pushes(self) -> bool:
        """Whether pendula feel each other only as they push what carries them: no spring ends on one or turns one."""
        turned = self.hanging.phi.turning[list(self.pivots)]
        first = ((self.rig.blocks[block], column) for block, column in self.kinds)
        felt = [bool(block.stiffness[0, column] or block.damping[0, column]) for block, column in first]
        return not (self.hanging.tied or turned[felt].any())

    @cached_property
    def M(self) -> Floats:
        """Inertia (d + K, d + K)."""
        d = self.d
        M = np.eye(d + len(self.fixed_base.omega))
        M[:d, :d], M[:d, d:], M[d:, :d] = self.hanging.inertia, self.push, self.push.T
        return M

    @cached_property
    def K(self) -> Floats:
        """Stiffness (d + K, d + K)."""
        d, modes = self.d, self.fixed_base
        turned, first = self.joints
        K = np.zeros_like(self.M)
        for element in self.hanging.elements.stiffness:
            vector = self.vector(zip(element.at, element.row, strict=True))
            K += element.size * np.outer(vector, vector)
        for k in range(len(self.kinds)):
            columns = self.columns(k)
            K[np.ix_(columns, columns)] = np.diag(modes.omega[np.array(columns) - d] ** 2)
        K[:d, d:] -= turned[modes.kind].T * first
        K[d:, :d], K[:d, :d] = K[:d, d:].T, self.own_stiffness
        return K

    def columns(self, kind: int) -> list[int]:
        """The coordinates of a kind."""
        return (self.d + np.flatnonzero(self.fixed_base.kind == kind)).tolist()

    def vector(self, row: Iterable[tuple[int, float]]) -> Floats:
        """A row over η and the angles of all links in these coordinates, every copy with its share of what is alike."""
        vector, hanging, modes = np.zeros(len(self.M)), self.hanging, self.fixed_base
        for at, value in row:
            if at < self.d:
                vector[at] += value
                continue
            pendulum = hanging.owner(at - self.d)
            kind = self.kinds.index((int(hanging.kinds[pendulum, 0]), int(hanging.kinds[pendulum, 1])))
            for column in self.columns(kind):
                k = column - self.d
                moved = modes.shapes[k][at - self.d - int(hanging.first[pendulum])]
                vector[column] += value * moved / np.sqrt(modes.count[k])
        return vector

    def dampers(self, scene: Scene) -> Floats | None:
        """D of everything that drains its scene; None where nothing does."""
        if not scene.has_damping:
            return None
        D = np.zeros_like(self.M)
        for dissipator in dissipators_of(scene):
            vector = self.vector(dissipator.row.items())
            D += dissipator.damping * np.outer(vector, vector)
        return D

    def eliminated(self, kept: Sequence[int], x: float) -> Floats:
        """What the others make of K − xM for the coordinates `kept`, to be added to (K − xM) of these themselves.

        LinAlgError where the others swing by themselves at x.
        """
        return np.asarray(self._schur(self.K - x * self.M, kept))

    def pulled(self, modes: Sequence[int], x: float, D: Floats | None = None) -> Any:
        """F: the shifts of ω² of some own modes near x, by springs among them and by all else, which resists as at x.

        What resists is without the modes themselves: with η' alone, −x h hᵀ is moved from their poles
        x²/(ω² − x) = xω²/(ω² − x) − x to the structure.  With iωD of dampers, the own ones of the modes included.
        """
        kept, d = [self.d + k for k in modes], self.d
        S = self.K - x * self.M
        h, omega = self.M[:d, kept], self.fixed_base.omega[list(modes)]
        S[:d, :d] += x * (h @ h.T)
        S[:d, kept] = self.K[:d, kept] - np.sqrt(x) * omega * h
        S[kept, :d] = S[:d, kept].T
        S[kept, kept] = 0.0
        rate = np.full(len(S), np.sqrt(x))
        rate[kept] = omega
        damped: Any = S if D is None else S + 1j * np.sqrt(np.outer(rate, rate)) * D
        return damped[kept][:, kept] + self._schur(damped, kept)

    @cached_property
    def parts(self) -> Ints:
        """A number for every coordinate, equal where springs or inertia join them."""
        joined = (self.K != 0) | (self.M != 0)
        parts = np.arange(len(joined))
        for at in range(len(joined)):
            parts[np.isin(parts, parts[joined[at]])] = parts[at]
        return parts

    def _schur(self, S: Any, kept: Sequence[int]) -> Any:
        """What elimination of all others from a symmetric S adds to those that are kept."""
        poles, rest = np.asarray(kept, dtype=np.intp), np.setdiff1d(np.arange(len(S)), kept)
        if not np.iscomplexobj(S):  # what nothing joins to them may swing by itself at this frequency
            rest = rest[np.isin(self.parts[rest], self.parts[poles])]
        cross = S[np.ix_(poles, rest)]
        return -cross @ np.linalg.solve(S[np.ix_(rest, rest)], cross.T)


def reduced(rig: Rig) -> ReducedStructure:
    """A rig in SI units in these coordinates."""
    hanging = Hanging(rig)
    return ReducedStructure(hanging, fixed_base_modes(hanging.rig, _held(hanging)))


def refuse_beyond(structure: ReducedStructure) -> None:
    """ComputationError for more than MOST_COORDINATES of a structure and its pendula."""
    if (size := structure.d + sum(block.mass.size for block in structure.rig.blocks)) > MOST_COORDINATES:
        raise ComputationError(
            f"the structure and different pendula have {size} coordinates: at most {MOST_COORDINATES}"
        )


def _held(hanging: Hanging) -> dict[Kind, Floats]:
    """The stiffness that springs add to the pendula that they join to something, all else held, (n, n) by kind."""
    held: dict[Kind, Floats] = {}
    d = hanging.structure.size
    for element in hanging.elements.stiffness:
        rows: dict[int, Floats] = {}
        for at, value in zip(element.at, element.row, strict=True):
            if at >= d:
                pendulum = hanging.owner(at - d)
                n = int(hanging.first[pendulum + 1] - hanging.first[pendulum])
                rows.setdefault(pendulum, np.zeros(n))[at - d - int(hanging.first[pendulum])] = value
        for pendulum, row in rows.items():
            kind = int(hanging.kinds[pendulum, 0]), int(hanging.kinds[pendulum, 1])
            held[kind] = held.get(kind, np.zeros((len(row),) * 2)) + element.size * np.outer(row, row)
    return held
