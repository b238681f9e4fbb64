"""Supports and pendula in few coordinates: η, and the modes of every pendulum alone, all else fixed.

A mode φ of one pendulum alone, K φ = ω² A φ with φᵀAφ = 1, pushes its pivot with Γ = φᵀb; its modal effective mass

    μ_r = (φ_rᵀ b)² / (φ_rᵀ A φ_r),        Σ_r μ_r + residual mass = mass of the pendulum,

is its contribution to the dynamic mass at the support (Clough & Penzien, Dynamics of Structures, §26-4).  These are the
modes of the conservative scene, along the rail; to first order the dampers of its joints and the drag of its links damp
each at the rate σ = [Σ d_i (φ_i − φ_{i−1})² + Σ drag_k (h_kᵀφ)²] / 2φᵀAφ, h_kᵀφ the displacement of a link's centre.

On a support that turns by Ω η a spring at the first joint pulls with k_1 φ_1.  Copies on pivots that move alike count
as one, √N φ, their N − 1 other combinations leave everything else at rest.  Over η and the amplitudes of these modes

    M = [[M_s + Σ m (ΦᵀΦ + ΨᵀΨ), h], [hᵀ, 1]],    K = [[K_s, g], [gᵀ, diag ω² + C]],

h = √N Γ Φ, g = −√N k_1 φ_1 Ω, C from springs between pendula.  A fixed support has no η, a cart one.  What remains of
it for η is, at x = ω², the dynamic stiffness

    S(x) = K_s − x (M_s + Σ Φᵀ diag(m_dyn(x), m) Φ)        (without springs at those joints and C)

([Craig1968], with modes of the pendula by the recursion).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from modal.assembly import Hanging, Rig, assemble_pendula, centres, dissipators_of
from modal.eigen import MOST_COORDINATES, find_spectrum
from modal.errors import ComputationError
from modal.report import Displayed
from modal.scene import Scene
from modal.types import Floats, Ints

Kind = tuple[int, int]
FREE: Mapping[Kind, Floats] = MappingProxyType({})


@dataclass(frozen=True, eq=False, repr=False)
class FixedBaseModes(Displayed):
    """K fixed-base modes of single pendula, ascending, one entry for all copies of a kind; all (K,).

    `omega` (rad/s), `push` φᵀb of one copy (√kg), `kind` the index of its kind in `Rig.names`, `number` its number
    among the modes of that pendulum, from 1, `count` the number of copies, `rate` σ (1/s).  `shapes` are φ (n,) with
    φᵀAφ = 1.
    """

    omega: Floats
    push: Floats
    kind: Ints
    number: Ints
    count: Ints
    rate: Floats
    shapes: tuple[Floats, ...]

    @property
    def mass(self) -> Floats:
        """The modal effective mass of one copy (K,) in kg."""
        return self.push**2


def without_damping(rig: Rig) -> Rig:
    """The rig without dampers, drag and damping ratios, in the plane of the rail."""
    none = [np.zeros_like(block.damping) for block in rig.blocks]
    blocks = tuple(replace(block, damping=zeros, drag=zeros) for block, zeros in zip(rig.blocks, none, strict=True))
    cart = rig.cart and rig.cart._replace(damping=0.0)
    structure = rig.structure and replace(
        rig.structure,
        carriers=tuple(
            replace(carrier, damping=(0.0,) * len(carrier.damping), D=None if carrier.D is None else 0 * carrier.D)
            for carrier in rig.structure.carriers
        ),
        springs=tuple(spring._replace(damping=0.0) for spring in rig.structure.springs),
    )
    return replace(rig, blocks=blocks, cart=cart, structure=structure, spatial=False, damping_ratio=0.0)


def fixed_base_modes(rig: Rig, spring_stiffness: Mapping[Kind, Floats] = FREE) -> FixedBaseModes:
    """The fixed-base modes of every kind of pendulum of a rig in SI units, all of them hanging.

    Springs add the stiffness `spring_stiffness` (n, n) to the pendula to which they are attached.
    """
    places = {kind: place for place, kind in enumerate(rig.names)}
    modes = [*_free_modes(rig, spring_stiffness), *_tied_modes(rig, spring_stiffness)]
    modes.sort(key=lambda mode: (mode[0], places[mode[1]]))
    omega, kinds, push, shapes = zip(*modes, strict=True)
    kind = np.array([places[kind_of_mode] for kind_of_mode in kinds])
    count = np.array([int(rig.blocks[block].count[column]) for block, column in kinds])
    rate = np.array([_rate(rig, kind_of_mode, shape) for kind_of_mode, shape in zip(kinds, shapes, strict=True)])
    return FixedBaseModes(np.array(omega), np.array(push), kind, places_within(kind), count, rate, shapes)


def _free_modes(rig: Rig, spring_stiffness: Mapping[Kind, Floats]) -> Iterator[tuple[float, Kind, float, Floats]]:
    """ω, kind, push and shape of pendula that no spring joins to anything, by the recursion."""
    natural, units = replace(without_damping(rig), cart=None, structure=None).natural()
    spectrum = find_spectrum(natural)
    omega, length = np.abs(spectrum.eigenvalue) * units.rate, units.length * np.sqrt(units.mass)
    rows: dict[int, list[tuple[int, Kind, int]]] = {}
    for number, group in enumerate(spectrum.groups):
        for part in group:
            if part.kind is not None and part.kind not in spring_stiffness:
                rows.setdefault(part.source, []).append((part.row, part.kind, number))
    for source, rows_of_source in rows.items():
        details = spectrum.details(source, [row for row, *_ in rows_of_source])
        push = (details.momentum / np.sqrt(details.modal_mass) * np.sqrt(units.mass)).tolist()
        shapes = (details.angles[0][:, 0].real / np.sqrt(details.modal_mass) / length).T
        for k, (_, kind, number) in enumerate(rows_of_source):
            yield float(omega[number]), kind, push[k], shapes[k]


def _tied_modes(rig: Rig, spring_stiffness: Mapping[Kind, Floats]) -> Iterator[tuple[float, Kind, float, Floats]]:
    """The same of pendula that springs join to a body held fixed."""
    for (number, column), stiffness in spring_stiffness.items():
        A, K = assemble_pendula([(rig.blocks[number], column)], None, rig.gravity)
        squares, shapes = pencil(K + stiffness, A)
        for square, shape in zip(squares, shapes.T, strict=True):
            push = float(shape @ rig.blocks[number].b[:, column])
            yield float(np.sqrt(square)), (number, column), push, shape


def pencil(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Squares ascending and vectors with vᵀMv = 1 of K v = ω² M v, by a Cholesky factor of M.

    Raise ComputationError if rounding makes M indefinite.
    """
    size = np.sqrt(np.diag(M))
    try:
        factor = np.linalg.cholesky(M / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise ComputationError(
            "the masses lie so far apart that in double precision the light ones are lost next to the heavy ones; "
            "the table of modes keeps them"
        ) from None
    inverse = np.linalg.inv(factor) / size
    squares, vectors = np.linalg.eigh(inverse @ K @ inverse.T)
    return squares, inverse.T @ vectors


def _rate(rig: Rig, kind: Kind, shape: Floats) -> float:
    """φᵀDφ/2 of the joints and the drag of one pendulum."""
    block, column = rig.blocks[kind[0]], kind[1]
    dissipation = float(block.damping[:, column] @ np.diff(shape, prepend=0.0) ** 2)
    if block.drag[:, column].any():
        dissipation += float(block.drag[:, column] @ (centres(block, column) @ shape) ** 2)
    return dissipation / 2


def places_within(kind: Ints) -> Ints:
    """The running number of each entry within its kind, from 1, (K,)."""
    order = np.argsort(kind, kind="stable")
    first = np.searchsorted(kind[order], kind[order])
    numbers = np.empty_like(order)
    numbers[order] = np.arange(len(kind)) - first + 1
    return numbers


@dataclass(frozen=True, eq=False)
class ReducedStructure:
    """M and K over the d coordinates η and the amplitudes of the modes `fixed_base`."""

    hanging: Hanging
    fixed_base: FixedBaseModes

    @property
    def d(self) -> int:
        """The number of support coordinates."""
        return self.hanging.structure.size

    @property
    def rig(self) -> Rig:
        """The pendula, and their supports."""
        return self.hanging.rig

    @cached_property
    def kinds(self) -> tuple[Kind, ...]:
        """The kinds of pendula, as `fixed_base.kind` counts them."""
        return tuple(self.rig.names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words, with what they hang from if there are several supports."""
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
        return self.hanging.phi.rail[list(self.pivots)]

    def joints(self, name: str) -> tuple[Floats, Floats]:
        """√k_1 Ω of the first joints (kinds, d) of one copy, and √(N k_1) φ_1 (K,) of the modes.

        The `name` says whether k_1 are springs ("stiffness") or rotors.
        """
        turning, modes = self.hanging.phi.turning[list(self.pivots)], self.fixed_base
        root = np.sqrt([getattr(self.rig.blocks[block], name)[0, column] for block, column in self.kinds])
        first = np.array([shape[0] for shape in modes.shapes])
        return root[:, None] * turning, root[modes.kind] * np.sqrt(modes.count) * first

    @cached_property
    def own_inertia(self) -> Floats:
        """(d, d): M_s with the masses of the pendula for vertical motion."""
        return self.hanging.supporting[0]

    @cached_property
    def own_stiffness(self) -> Floats:
        """K_s (d, d)."""
        copies = np.array([float(self.rig.blocks[block].count[column]) for block, column in self.kinds])
        turns = self.joints("stiffness")[0]
        return self.hanging.supporting[1] + (copies * turns.T) @ turns

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
        """Whether pendula interact only through their supports: no spring ends on one or turns one."""
        rotations = self.hanging.phi.turning[list(self.pivots)]
        names = ("rotor", "stiffness", "damping")
        has_joint_forces = [
            any(getattr(self.rig.blocks[block], name)[0, column] for name in names) for block, column in self.kinds
        ]
        return not (self.hanging.tied or rotations[has_joint_forces].any())

    @cached_property
    def M(self) -> Floats:
        """Inertia (d + K, d + K)."""
        d = self.d
        M = np.eye(d + len(self.fixed_base.omega))
        rotations, first = self.joints("rotor")
        cross = self.push - rotations[self.fixed_base.kind].T * first
        M[:d, :d], M[:d, d:], M[d:, :d] = self.hanging.inertia, cross, cross.T
        return M

    @cached_property
    def K(self) -> Floats:
        """Stiffness (d + K, d + K)."""
        d, modes = self.d, self.fixed_base
        rotations, first = self.joints("stiffness")
        K = np.zeros_like(self.M)
        for element in self.hanging.elements.stiffness:
            vector = self.vector(zip(element.at, element.row, strict=True))
            K += element.size * np.outer(vector, vector)
        for k in range(len(self.kinds)):
            columns = self.columns(k)
            K[np.ix_(columns, columns)] = np.diag(modes.omega[np.array(columns) - d] ** 2)
        K[:d, d:] -= rotations[modes.kind].T * first
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
                motion = modes.shapes[k][at - self.d - int(hanging.first[pendulum])]
                vector[column] += value * motion / np.sqrt(modes.count[k])
        return vector

    def dampers(self, scene: Scene) -> Floats | None:
        """D of all dissipation in the scene; None if there is none."""
        if not scene.has_damping:
            return None
        D = np.zeros_like(self.M)
        for dissipator in dissipators_of(scene):
            vector = self.vector(dissipator.row.items())
            D += dissipator.damping * np.outer(vector, vector)
        return D

    def elimination(self, numbers: Sequence[int], x: float) -> Floats:
        """Return the contribution of the others to K − xM of the coordinates `numbers`.

        It fails with a LinAlgError if x is an eigenvalue of the others alone.
        """
        return np.asarray(self._schur(self.K - x * self.M, numbers))

    def pulled(self, modes: Sequence[int], x: float, D: Floats | None = None) -> Any:
        """F: the shifts of ω² of some own modes near x, by springs among them and by all else as it responds at x.

        F excludes the modes themselves: with η' alone, −x h hᵀ is moved from their poles
        x²/(ω² − x) = xω²/(ω² − x) − x to the structure.  With iωD of dampers, the own ones of the modes included.
        """
        numbers, d = [self.d + k for k in modes], self.d
        S = self.K - x * self.M
        h, omega = self.M[:d, numbers], self.fixed_base.omega[list(modes)]
        S[:d, :d] += x * (h @ h.T)
        S[:d, numbers] = self.K[:d, numbers] - np.sqrt(x) * omega * h
        S[numbers, :d] = S[:d, numbers].T
        S[numbers, numbers] = 0.0
        rate = np.full(len(S), np.sqrt(x))
        rate[numbers] = omega
        matrix: Any = S if D is None else S + 1j * np.sqrt(np.outer(rate, rate)) * D
        return matrix[numbers][:, numbers] + self._schur(matrix, numbers)

    @cached_property
    def parts(self) -> Ints:
        """A number for every coordinate, equal for coordinates coupled by springs or inertia."""
        is_linked = (self.K != 0) | (self.M != 0)
        parts = np.arange(len(is_linked))
        for at in range(len(is_linked)):
            parts[np.isin(parts, parts[is_linked[at]])] = parts[at]
        return parts

    def _schur(self, S: Any, numbers: Sequence[int]) -> Any:
        """The contribution of eliminating all others from a symmetric S to those retained."""
        poles, rest = np.asarray(numbers, dtype=np.intp), np.setdiff1d(np.arange(len(S)), numbers)
        if not np.iscomplexobj(S):  # what nothing joins to them may swing by itself at this frequency
            rest = rest[np.isin(self.parts[rest], self.parts[poles])]
        cross = S[np.ix_(poles, rest)]
        return -cross @ np.linalg.solve(S[np.ix_(rest, rest)], cross.T)


def reduced(rig: Rig) -> ReducedStructure:
    """Return a rig in SI units in these coordinates."""
    hanging = Hanging(rig)
    return ReducedStructure(hanging, fixed_base_modes(hanging.rig, _spring_stiffness(hanging)))


def refuse_beyond(structure: ReducedStructure) -> None:
    """Raise ComputationError for more than MOST_COORDINATES of a structure and its pendula."""
    if (size := structure.d + sum(block.mass.size for block in structure.rig.blocks)) > MOST_COORDINATES:
        raise ComputationError(
            f"the structure and different pendula have {size} coordinates: at most {MOST_COORDINATES}"
        )


def _spring_stiffness(hanging: Hanging) -> dict[Kind, Floats]:
    """The stiffness that springs add to the pendula that they join to something, all else fixed, (n, n) by kind."""
    stiffness: dict[Kind, Floats] = {}
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
            stiffness[kind] = stiffness.get(kind, np.zeros((len(row),) * 2)) + element.size * np.outer(row, row)
    return stiffness
