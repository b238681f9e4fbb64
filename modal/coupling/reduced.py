"""A structure and its pendula in few coordinates: η, and the modes of every pendulum alone while all else is held.

A mode φ of one pendulum alone, φᵀAφ = 1, pushes its pivot with Γ = φᵀb; on a carrier that turns by Ω η a
spring at the first joint pulls with k_1 φ_1.  Copies on pivots that move alike count as one, √N φ, their N − 1 other
combinations leave everything else still.  Over η and the amplitudes of these modes

    M = [[M_s + Σ m (ΦᵀΦ + ΨᵀΨ), h], [hᵀ, 1]],    K = [[K_s, g], [gᵀ, diag ω² + C]],

h = √N Γ Φ, g = −√N k_1 φ_1 Ω, C from springs between pendula.  What remains of it for η is, at
x = ω², the dynamic stiffness

    S(x) = K_s − x (M_s + Σ Φᵀ diag(m_dyn(x), m) Φ)        (without springs at those joints and C)

(Craig & Bampton, AIAA J. 6, 1313 (1968), with modes of the pendula by the recursion).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from modal.assembly import Element, Hanging, Rig, assembled, centres, modal_supports
from modal.coupling.fixed_base import FixedBaseModes, places_within, without_damping
from modal.eigen import find_spectrum
from modal.errors import ComputationError
from modal.types import Floats, Ints

MOST_COORDINATES = 1200
Kind = tuple[int, int]


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """M and K over the d coordinates η and the amplitudes of the modes `fixed_base`, with their `shapes` φ (n,)."""

    hanging: Hanging
    fixed_base: FixedBaseModes
    shapes: tuple[Floats, ...]
    M: Floats
    K: Floats

    @property
    def d(self) -> int:
        """How many coordinates the structure has."""
        return self.hanging.structure.size

    @cached_property
    def kinds(self) -> tuple[Kind, ...]:
        """The kinds of pendula, as `own.kind` counts them."""
        return tuple(self.hanging.rig.names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words, with what they hang from where there are several carriers."""
        names = tuple(self.hanging.rig.names.values())
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
    def turning(self) -> Floats:
        """Ω (kinds, d)."""
        return self.hanging.phi.turning[list(self.pivots)]

    def columns(self, kind: int) -> list[int]:
        """The coordinates of a kind."""
        return (self.d + np.flatnonzero(self.fixed_base.kind == kind)).tolist()

    def vector(self, element: Element) -> Floats:
        """The row of an element in these coordinates."""
        vector, hanging = np.zeros(len(self.M)), self.hanging
        for at, value in zip(element.at, element.row, strict=True):
            if at < self.d:
                vector[at] += value
                continue
            pendulum = hanging.owner(at - self.d)
            kind = self.kinds.index((int(hanging.kinds[pendulum, 0]), int(hanging.kinds[pendulum, 1])))
            for column in self.columns(kind):
                vector[column] += value * self.shapes[column - self.d][at - self.d - int(hanging.first[pendulum])]
        return vector

    def joined(self, strengths: Callable[[Kind], Floats]) -> Floats:
        """Σ s (θ_i − θ_{i−1})² of numbers s (n,) at all joints of every kind as a matrix; θ − φ at the first."""
        matrix, d = np.zeros_like(self.M), self.d
        for k, kind in enumerate(self.kinds):
            strength, columns = strengths(kind), self.columns(k)
            copies = float(self.hanging.rig.blocks[kind[0]].count[kind[1]])
            turns = np.array([np.diff(self.shapes[column - d], prepend=0.0) for column in columns]).T
            matrix[np.ix_(columns, columns)] += (turns.T * strength) @ turns
            matrix[np.ix_(range(d), columns)] -= np.sqrt(copies) * strength[0] * np.outer(self.turning[k], turns[0])
            matrix[:d, :d] += copies * strength[0] * np.outer(self.turning[k], self.turning[k])
        matrix[d:, :d] = matrix[:d, d:].T
        return matrix

    @cached_property
    def carried(self) -> Floats:
        """The dampers of carriers and of springs, and drag down."""
        matrix, d = np.zeros_like(self.M), self.d
        matrix[:d, :d] = modal_supports(self.hanging.structure)[2]
        for element in self.hanging.elements.damping:
            vector = self.vector(element)
            matrix += element.size * np.outer(vector, vector)
        return matrix

    @cached_property
    def dragged(self) -> Floats:
        """The linear drag of all links along the rail; that of pendula that move down is in `carried`."""
        matrix, d = np.zeros_like(self.M), self.d
        for k, (number, column) in enumerate(self.kinds):
            block = self.hanging.rig.blocks[number]
            drag, copies, columns = block.drag[:, column], float(block.count[column]), self.columns(k)
            if not drag.any():
                continue
            moved = centres(block, column) @ np.array([self.shapes[at - d] for at in columns]).T
            matrix[np.ix_(columns, columns)] += (moved.T * drag) @ moved
            matrix[np.ix_(range(d), columns)] += np.sqrt(copies) * np.outer(self.along[k], drag @ moved)
            matrix[:d, :d] += copies * drag.sum() * np.outer(self.along[k], self.along[k])
        matrix[d:, :d] = matrix[:d, d:].T
        return matrix

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

    @cached_property
    def _untied(self) -> bool:
        """Whether no spring joins a pendulum to another, so that only the structure couples their modes."""
        inner = self.K[self.d :, self.d :]
        return not np.any(inner - np.diag(np.diag(inner)))

    def _schur(self, S: Any, kept: Sequence[int]) -> Any:
        """What elimination of all others from a symmetric S adds to those that are kept."""
        poles, rest = np.asarray(kept, dtype=np.intp), np.setdiff1d(np.arange(len(S)), kept)
        if not np.iscomplexobj(S):  # what nothing joins to them may swing by itself at this frequency
            rest = rest[np.isin(self.parts[rest], self.parts[poles])]
        shifts = np.zeros((len(poles),) * 2, S.dtype)
        more = np.zeros((len(poles) + len(rest),) * 2, S.dtype)
        if self._untied and not np.iscomplexobj(S):  # the modes that only the structure couples first, each by itself
            local, rest = rest[rest >= self.d], rest[rest < self.d]
            square = np.diag(S)[local]
            if not square.all():
                raise np.linalg.LinAlgError("a pendulum swings by itself at this frequency")
            beside = S[np.ix_(np.concatenate((poles, rest)), local)]
            more = -(beside / square) @ beside.T
            shifts += more[: len(poles), : len(poles)]
        if len(rest):
            count = len(poles)
            cross = S[np.ix_(poles, rest)] + more[:count, count : count + len(rest)]
            inner = S[np.ix_(rest, rest)] + more[count : count + len(rest), count : count + len(rest)]
            shifts -= cross @ np.linalg.solve(inner, cross.T)
        return shifts


def reduced(rig: Rig) -> ReducedStructure:
    """A rig on a structure, in SI units, in these coordinates.

    ComputationError for more than MOST_COORDINATES of them.
    """
    hanging = Hanging(rig)
    if (size := hanging.structure.size + sum(block.mass.size for block in rig.blocks)) > MOST_COORDINATES:
        raise ComputationError(
            f"the structure and different pendula have {size} coordinates: at most {MOST_COORDINATES}"
        )
    held = _held(hanging)
    modes, shapes, push = _own_modes(hanging, held)
    count, d = len(modes.omega), hanging.structure.size
    empty = np.zeros((d + count,) * 2)
    structure = ReducedStructure(hanging, modes, shapes, empty, empty)
    joints = structure.joined(lambda kind: rig.blocks[kind[0]].stiffness[:, kind[1]])
    K = np.zeros_like(empty)
    K[:d, :] += joints[:d, :]
    for element in hanging.elements.stiffness:
        vector = structure.vector(element)
        K += element.size * np.outer(vector, vector)
    for k in range(len(structure.kinds)):
        columns = structure.columns(k)
        K[np.ix_(columns, columns)] = np.diag(modes.omega[np.array(columns) - d] ** 2)
    K[d:, :d] = K[:d, d:].T
    M = np.eye(d + count)
    M[:d, :d] = hanging.inertia
    M[:d, d:] = (structure.along[modes.kind] * (np.sqrt(modes.count) * push)[:, None]).T
    M[d:, :d] = M[:d, d:].T
    K[:d, :d] += modal_supports(hanging.structure)[1]
    return replace(structure, M=M, K=K)


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


def _own_modes(hanging: Hanging, held: dict[Kind, Floats]) -> tuple[FixedBaseModes, tuple[Floats, ...], Floats]:
    """The modes of every kind of pendulum alone, ascending, their shapes, and Γ (K,) in √kg."""
    rig = hanging.rig
    names = list(rig.names)
    modes = [*_free_modes(rig, frozenset(held)), *_tied_modes(rig, held)]
    modes.sort(key=lambda mode: (mode[0], names.index(mode[1])))
    omega, kinds, shapes = zip(*modes, strict=True)
    kind = np.array([names.index(parts) for parts in kinds])
    push = np.array(
        [float(shape @ rig.blocks[b].b[:, column]) for (b, column), shape in zip(kinds, shapes, strict=True)]
    )
    rate = [_rate(rig, parts, shape) for parts, shape in zip(kinds, shapes, strict=True)]
    count = np.array([int(rig.blocks[b].count[column]) for b, column in kinds])
    parts = FixedBaseModes(np.array(omega), push**2, kind, places_within(kind), count, np.array(rate))
    return parts, tuple(shapes), push


def _free_modes(rig: Rig, tied: frozenset[Kind]) -> Iterator[tuple[float, Kind, Floats]]:
    """ω, kind and shape of pendula that no spring joins to anything, by the recursion."""
    natural, units = replace(without_damping(rig), cart=None, structure=None).natural()
    spectrum = find_spectrum(natural)
    for value, group in zip(spectrum.eigenvalue, spectrum.groups, strict=True):
        for part in group:
            if part.kind is not None and part.kind not in tied:
                details = spectrum.details(part.source, [part.row])
                size = np.sqrt(details.modal_mass[0] * units.mass) * units.length
                yield float(abs(value)) * units.rate, part.kind, details.angles[0][:, 0, 0].real / size


def _tied_modes(rig: Rig, held: dict[Kind, Floats]) -> Iterator[tuple[float, Kind, Floats]]:
    """The same of pendula that springs join to something, which is held."""
    for (number, column), more in held.items():
        A, K = assembled([(rig.blocks[number], column)], None, rig.gravity)
        squares, shapes = pencil(K + more, A)
        for square, shape in zip(squares, shapes.T, strict=True):
            yield float(np.sqrt(square)), (number, column), shape


def pencil(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Squares ascending and vectors with vᵀMv = 1 of K v = ω² M v, by a Cholesky factor of M.

    ComputationError where rounding leaves M none.
    """
    size = np.sqrt(np.diag(M))
    try:
        factor = np.linalg.cholesky(M / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise ComputationError(
            "the masses lie so far apart that in double precision the light ones are lost beside the heavy ones; "
            "the table of modes keeps them"
        ) from None
    inverse = np.linalg.inv(factor) / size
    squares, vectors = np.linalg.eigh(inverse @ K @ inverse.T)
    return squares, inverse.T @ vectors


def _rate(rig: Rig, kind: Kind, shape: Floats) -> float:
    """φᵀDφ/2 of the joints and the drag of one pendulum."""
    block, column = rig.blocks[kind[0]], kind[1]
    turns, moved = np.diff(shape, prepend=0.0), centres(block, column) @ shape
    return float(block.damping[:, column] @ turns**2 + block.drag[:, column] @ moved**2) / 2
