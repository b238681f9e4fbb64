"""The modes of every pendulum on a fixed support, or all else held, and the force of each on it.

A mode φ of K φ = ω² A φ pushes the support with the momentum φᵀb; its modal effective mass

    μ_r = (φ_rᵀ b)² / (φ_rᵀ A φ_r),        Σ_r μ_r + residual mass = mass of the pendulum,

is its contribution to the mass felt at the support (Clough & Penzien, Dynamics of Structures, §26-4).  These are the
modes of the conservative scene, along the rail; to first order the dampers of its joints and the drag of its links damp
each at the rate σ = [Σ d_i (φ_i − φ_{i−1})² + Σ drag_k (h_kᵀφ)²] / 2φᵀAφ, h_kᵀφ the displacement of a link's centre.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from modal.assembly import Rig, assembled, centres
from modal.eigen import find_spectrum
from modal.errors import ComputationError
from modal.report import Displayed
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


def fixed_base_modes(rig: Rig, held: Mapping[Kind, Floats] = FREE) -> FixedBaseModes:
    """The fixed-base modes of every kind of pendulum of a rig in SI units, all of them hanging.

    Springs add the stiffness `held` (n, n) to the pendula that they join to something.
    """
    places = {kind: place for place, kind in enumerate(rig.names)}
    modes = [*_free_modes(rig, held), *_tied_modes(rig, held)]
    modes.sort(key=lambda mode: (mode[0], places[mode[1]]))
    omega, kinds, push, shapes = zip(*modes, strict=True)
    kind = np.array([places[each] for each in kinds])
    count = np.array([int(rig.blocks[block].count[column]) for block, column in kinds])
    rate = np.array([_rate(rig, each, shape) for each, shape in zip(kinds, shapes, strict=True)])
    return FixedBaseModes(np.array(omega), np.array(push), kind, places_within(kind), count, rate, shapes)


def _free_modes(rig: Rig, held: Mapping[Kind, Floats]) -> Iterator[tuple[float, Kind, float, Floats]]:
    """ω, kind, push and shape of pendula that no spring joins to anything, by the recursion."""
    natural, units = replace(without_damping(rig), cart=None, structure=None).natural()
    spectrum = find_spectrum(natural)
    omega, length = np.abs(spectrum.eigenvalue) * units.rate, units.length * np.sqrt(units.mass)
    rows: dict[int, list[tuple[int, Kind, int]]] = {}
    for number, group in enumerate(spectrum.groups):
        for part in group:
            if part.kind is not None and part.kind not in held:
                rows.setdefault(part.source, []).append((part.row, part.kind, number))
    for source, each in rows.items():
        details = spectrum.details(source, [row for row, *_ in each])
        push = (details.momentum / np.sqrt(details.modal_mass) * np.sqrt(units.mass)).tolist()
        shapes = (details.angles[0][:, 0].real / np.sqrt(details.modal_mass) / length).T
        for k, (_, kind, number) in enumerate(each):
            yield float(omega[number]), kind, push[k], shapes[k]


def _tied_modes(rig: Rig, held: Mapping[Kind, Floats]) -> Iterator[tuple[float, Kind, float, Floats]]:
    """The same of pendula that springs join to something, which is held."""
    for (number, column), more in held.items():
        A, K = assembled([(rig.blocks[number], column)], None, rig.gravity)
        squares, shapes = pencil(K + more, A)
        for square, shape in zip(squares, shapes.T, strict=True):
            push = float(shape @ rig.blocks[number].b[:, column])
            yield float(np.sqrt(square)), (number, column), push, shape


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
    lost = float(block.damping[:, column] @ np.diff(shape, prepend=0.0) ** 2)
    if block.drag[:, column].any():
        lost += float(block.drag[:, column] @ (centres(block, column) @ shape) ** 2)
    return lost / 2


def places_within(kind: Ints) -> Ints:
    """The running number of each entry within its kind, from 1, (K,)."""
    order = np.argsort(kind, kind="stable")
    first = np.searchsorted(kind[order], kind[order])
    numbers = np.empty_like(order)
    numbers[order] = np.arange(len(kind)) - first + 1
    return numbers
