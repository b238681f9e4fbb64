"""The matrices of one component of a rig on a structure as sums of squares, and its form as a tree if it has one.

    M = Σ m b bᵀ,      K = Σ k a aᵀ,      D = Σ d c cᵀ

over the component's η and the angles of its combinations of pendula (`modal.eigen.components`): rows and sizes, none of
which is the difference of two numbers of the scene, so that `modal.eigen.product` finds modes to all digits. Free
motions are found from the rows alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.assembly import WAYS, Block, Element, null_space
from modal.eigen.components import Component, Heavy, PartedRig
from modal.eigen.recursion import joints, kinetic
from modal.report import deferred
from modal.types import EPS, NOISE_OF_TERMS, Floats, Ints

if TYPE_CHECKING:
    from modal.eigen.trees import HungChains, Tree

LARGEST_WIDE = 200
"""Cost: coordinates up to which triangular factors are computed in the widest floats of the machine."""
BEYOND = "the ratios in this scene are beyond double precision on its product form"
Numbers = NDArray[Any]


class SquareSum(NamedTuple):
    """The sum of `size` (E,) times the squares of `rows` (E, n)."""

    rows: Floats
    size: Floats

    @property
    def matrix(self) -> Floats:
        """The sum, (n, n), symmetric to the last digit, which stiff dampers need."""
        S: Floats = (self.rows.T * self.size) @ self.rows
        return (S + S.T) / 2


def is_wide(size: int) -> bool:
    """Whether triangular factors of this many coordinates are computed in extended precision."""
    return size <= LARGEST_WIDE and bool(np.finfo(np.longdouble).eps < EPS)


@dataclass(frozen=True, eq=False)
class ComponentMatrices:
    """M, K and D of one component as sums of squares, over its η and the angles of its combinations."""

    parted_rig: PartedRig
    component: Component

    @cached_property
    def places(self) -> Ints:
        """The first angle of each combination, and the number of coordinates."""
        sizes = [self.parted_rig.rig.blocks[heavy.block].n for heavy in self.component.heavies]
        return len(self.component.eta) + np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.places[-1])

    @cached_property
    def _place_of_coordinate(self) -> dict[int, int]:
        """Where coordinates of the whole scene stand here, those of links of pendula by themselves."""
        places = {int(place): k for k, place in enumerate(self.component.eta)}
        first, d = self.parted_rig.hanging.first, self.parted_rig.size
        for heavy, at in zip(self.component.heavies, self.places.tolist(), strict=False):
            if heavy.is_alone:
                link = d + int(first[heavy.shares[0].first])
                places |= {link + i: at + i for i in range(self.parted_rig.rig.blocks[heavy.block].n)}
        return places

    @cached_property
    def factors(self) -> tuple[SquareSum, SquareSum, SquareSum]:
        """The factors of M, K and D; sizes in that of K may be negative."""
        return self._factor(0), self._factor(1), self._factor(2)

    def _factor(self, which: int) -> SquareSum:
        elements, d = self.squares[which], len(self.component.eta)
        rows, sizes = [np.zeros((len(elements), self.size))], [np.array([element.size for element in elements])]
        for row, element in zip(rows[0], elements, strict=True):
            row[:] = element.over(self.size)
        for heavy, at in zip(self.component.heavies, self.places.tolist(), strict=False):
            pivots, p = (heavy.pivot_row, 0 * heavy.pivot_row, heavy.turning_row), heavy.column
            for square in self.parted_rig.chains[heavy.block][which]:
                nonzero, local = np.flatnonzero(square.size[p]), square.at[p]
                part = np.zeros((len(nonzero), self.size))
                entries = np.eye(len(local))[nonzero] if square.row_source is None else square.row_source[p, nonzero]
                part[:, at + local] = entries[:, -len(local) :]
                if square.kind in WAYS:
                    part[:, :d] = entries[:, :1] * pivots[WAYS[square.kind]][self.component.eta]
                rows.append(part)
                sizes.append(heavy.weight * square.size[p, nonzero])
        return SquareSum(np.concatenate(rows), np.concatenate(sizes))

    @cached_property
    def squares(self) -> tuple[tuple[Element, ...], ...]:
        """The elements of M, K and D except those of the chains, in the coordinates of the component."""
        place_of = self._place_of_coordinate
        part_elements = self.parted_rig.elements_of_parts.get(self.component.group, ([], [], []))
        squares = [
            [element._replace(at=tuple(place_of[place] for place in element.at)) for element in elements]
            for elements in part_elements
        ]
        for start, matrices in self.modal:
            for elements, S in zip(squares, matrices, strict=True):
                root, signs = deferred("modal.eigen.dense:square_root")(S)
                at = tuple(range(start, start + len(S)))
                rows = zip(root.tolist(), signs.tolist(), strict=True)
                elements += [Element(at, tuple(row), sign) for row, sign in rows]
        return tuple(map(tuple, squares))

    @property
    def modal(self) -> Iterator[tuple[int, tuple[Floats, Floats, Floats]]]:
        """M, K and D of every modal support of the component, with the place of its coordinates."""
        structure = self.parted_rig.hanging.structure
        for carrier, start in zip(structure.carriers, structure.offsets, strict=False):
            if start in self._place_of_coordinate and (matrices := carrier.matrices):
                yield self._place_of_coordinate[start], matrices

    @cached_property
    def momentum(self) -> Floats:
        """The momentum along the rail (n,) per unit of each rate; NaN if a modal support is part of the component."""
        momentum = np.zeros(self.size)
        momentum[: len(self.component.eta)] = self.parted_rig.momenta[self.component.eta]
        for (block, heavy), at in zip(self._chains, self.places.tolist(), strict=False):
            several = sum(share.copies * share.amplitude for share in heavy.shares)
            momentum[at : at + block.n] = several * block.across[:, heavy.column] * block.b[:, heavy.column]
        return momentum

    @cached_property
    def is_damped(self) -> bool:
        """Whether there are dampers or drag."""
        if not self.parted_rig.rig.is_damped:
            return False
        return bool(self.squares[2]) or any(
            block.damping[:, heavy.column].any() or block.drag[:, heavy.column].any() for block, heavy in self._chains
        )

    @property
    def is_massless(self) -> bool:
        """Whether a coordinate has no mass of its own."""
        return len({element.at for element in self.squares[0]}) < len(self.component.eta)

    @property
    def _chains(self) -> Iterator[tuple[Block, Heavy]]:
        return ((self.parted_rig.rig.blocks[heavy.block], heavy) for heavy in self.component.heavies)

    @property
    def has_rotors(self) -> bool:
        """Whether any joint has a rotor."""
        return any(block.rotor[:, heavy.column].any() for block, heavy in self._chains)

    @property
    def _has_negative_joints(self) -> bool:
        """Whether a law pushes any joint away from its equilibrium."""
        return any((block.stiffness[:, heavy.column] < 0).any() for block, heavy in self._chains)

    @cached_property
    def is_positive(self) -> bool:
        """Whether all springs are positive."""
        hang = all(block.rest is None and (block.sigma[:, heavy.column] > 0).all() for block, heavy in self._chains)
        hang = hang and not self._has_negative_joints
        return hang and all(element.size > 0 for element in self.squares[1])

    @cached_property
    def terms(self) -> Floats:
        """The sums of the absolute terms of K's diagonal, (n,)."""
        K = self.factors[1]
        terms: Floats = (K.rows**2).T @ np.abs(K.size)
        terms[: len(self.component.eta)] += self.hidden
        for heavy, at in zip(self.component.heavies, self.places.tolist(), strict=False):
            block = self.parted_rig.rig.blocks[heavy.block]
            if block.rest:
                pull, held = (part[:, heavy.column] for part in (block.rest.pull, block.rest.stiffness))
                terms[at : at + block.n] += heavy.weight * (pull - np.abs(held))
        return terms

    @cached_property
    def hidden(self) -> Floats:
        """The excess of the sum of absolute terms over the remaining stiffness of each η, (nη,)."""
        elements, eta = self.parted_rig.hanging.elements, self.component.eta
        remainder = np.zeros(self.parted_rig.size)
        for element in elements.stiffness:
            if len(element.at) == 1 and element.row == (1.0,) and element.at[0] < remainder.size:
                remainder[element.at[0]] += abs(element.size)
        return np.maximum(elements.terms - remainder, 0.0)[eta]

    @property
    def cancelling(self) -> float:
        """The largest ratio of the sum of absolute terms to the remaining stiffness of an η."""
        stiffness = np.zeros(len(self.component.eta))
        for element in self.squares[1]:
            for place, value in zip(element.at, element.row, strict=True):
                if place < len(stiffness):
                    stiffness[place] += element.size * value**2
        is_sprung = stiffness > 0
        return float(1 + (self.hidden[is_sprung] / stiffness[is_sprung]).max(initial=0.0))

    @cached_property
    def free(self) -> Floats:
        """Motions (n, f) without any spring, orthonormal in M and orthogonal in D, least damped first.

        They involve no angles.
        """
        eta = self.component.eta
        d = len(eta)
        if self.parted_rig.is_plain:
            cart = self.parted_rig.rig.cart
            number = int(cart is not None and cart.stiffness == 0)
            return np.asarray(np.eye(self.size, number) / np.sqrt(self.parted_rig.rig.total_mass))
        joints = [heavy.turning_row[eta] * (block.stiffness[0, heavy.column] != 0) for block, heavy in self._chains]
        rows, M = [element.over(d) for element in self.squares[1]], np.zeros((d, d))
        for element in self.squares[0]:
            M += element.size * np.multiply.outer(element.over(d), element.over(d))
        for block, heavy in self._chains:
            mass = heavy.weight * block.mass[:, heavy.column].sum()
            M += mass * np.multiply.outer(heavy.pivot_row[eta], heavy.pivot_row[eta])
        basis = null_space(np.array([*rows, *joints]).reshape(len(rows) + len(joints), d))
        motions = np.zeros((self.size, basis.shape[1]))
        for k in range(basis.shape[1]):
            earlier_motions = motions[:d, :k]
            motion = basis[:, k] - earlier_motions @ (earlier_motions.T @ (M @ basis[:, k]))
            motions[:d, k] = motion / np.sqrt(motion @ M @ motion)
        if not self.is_damped:
            return motions
        stretches = self.factors[2].rows @ motions
        damping = (stretches.T * self.factors[2].size) @ stretches
        if np.count_nonzero(damping - np.diag(np.diag(damping))):
            return np.asarray(motions @ np.linalg.eigh(damping)[1])
        return motions[:, np.argsort(np.diag(damping), kind="stable")]

    @cached_property
    def coasting(self) -> Floats:
        """Free motions (n, f) without damping."""
        if not self.is_damped:
            return self.free
        rows, free = self.factors[2].rows, self.free
        stretches, terms = rows @ free, np.abs(rows) @ np.abs(free)
        nonzero_stretches = np.where(np.abs(stretches) > NOISE_OF_TERMS * terms, stretches, 0.0)
        return free @ null_space(nonzero_stretches) if nonzero_stretches.any() else free

    @cached_property
    def tree(self) -> Tree | None:
        """The component as a tree of coordinates with chains; None for any other, as with rotors: κ − x J cancels."""
        if self._has_negative_joints or self.has_rotors:
            return None
        place_of, d, chain_places = self._place_of_coordinate, len(self.component.eta), list[tuple[Heavy, int]]()
        for block, heavy in self._chains:
            at = np.flatnonzero(heavy.pivot_row)
            if len(at) != min(d, 1) or heavy.turning_row.any() or block.rest:
                return None
            chain_places.append((heavy, place_of[int(at[0])] if d else 0))
        mass, stiffness, springs = np.zeros(d), np.zeros(d), dict[tuple[int, int], tuple[float, float, float]]()
        for diagonal, elements in zip((mass, stiffness), self.squares, strict=False):
            for element in elements:
                if element.size < 0 or len(element.at) > (1 if diagonal is mass else 2) or element.at[-1] >= d:
                    return None
                if len(element.at) == 1:
                    diagonal[element.at[0]] += element.size * element.row[0] ** 2
                elif (pair := (element.at[0], element.at[1])) in springs:
                    return None
                else:
                    springs[pair] = (element.size, element.row[0], element.row[1])
        if len(springs) != max(d - 1, 0):
            return None
        return _tree(mass, stiffness, springs, self._hanging_chains(chain_places))

    def _hanging_chains(self, chain_places: list[tuple[Heavy, int]]) -> list[HungChains]:
        """The chains of every block, h² times as heavy, whose angles are h times as large."""
        chains: list[HungChains] = []
        hung_chains = deferred("modal.eigen.trees:HungChains")
        for number in sorted({heavy.block for heavy, _ in chain_places}):
            members = [(k, heavy, at) for k, (heavy, at) in enumerate(chain_places) if heavy.block == number]
            block = self.parted_rig.rig.blocks[number].take(np.array([heavy.column for _, heavy, _ in members]))
            has_coordinates = len(self.component.eta) > 0
            h = np.array([float(heavy.pivot_row.sum()) if has_coordinates else 1.0 for _, heavy, _ in members])
            heavier = block.heavier(np.array([heavy.weight for _, heavy, _ in members]) * h**2)
            places = np.array([at for *_, at in members])
            chains.append(hung_chains(heavier, places, h, self.places[[k for k, *_ in members]]))
        return chains


@dataclass(frozen=True, eq=False)
class StructureShapes:
    """R shapes of one component: every η (d, R) of the structure, and the angles (n, P, R) of every block."""

    parted_rig: PartedRig
    eta: Numbers
    angles: tuple[Numbers, ...]

    @property
    def energies(self) -> tuple[Floats, ...]:
        """Twice the energy of each link of one copy, with its rotor, over ω², (n, P, R); a mean if pivots move down."""
        energies = []
        for number, (block, angle) in enumerate(zip(self.parted_rig.rig.blocks, self.angles, strict=True)):
            pivot_displacement = self.parted_rig.pivots[number] @ self.eta
            turn = angle * (block.across * block.length)[:, :, None]
            parts = [(pivot_displacement.real, turn.real)] + [(pivot_displacement.imag, turn.imag)] * np.iscomplexobj(
                angle
            )
            if block.sinking is not None:
                descent = angle * (block.sinking * block.length)[:, :, None]
                parts += [(0 * pivot_displacement.real, descent.real), (0 * pivot_displacement.real, descent.imag)]
            energy = sum((kinetic(block, joints(y, a), a) for y, a in parts), start=np.zeros(angle.shape))
            if block.rotor.any():
                bends = np.diff(angle, axis=0, prepend=(self.parted_rig.turning(number) @ self.eta)[None])
                energy += block.rotor[:, :, None] * np.abs(bends) ** 2
            sunk = self.parted_rig.sinking[number]
            if sunk is not None:
                energy += block.mass[:, :, None] * np.abs(np.einsum("pij,ir,jr->pr", sunk, self.eta, self.eta.conj()))
            energies.append(energy)
        return tuple(energies)


def shapes_in_scene(matrices: ComponentMatrices, shape: Numbers) -> StructureShapes:
    """The shapes (n, R) of a component over the whole scene."""
    parted_rig, component = matrices.parted_rig, matrices.component
    eta = np.zeros((parted_rig.size, shape.shape[1]), shape.dtype)
    eta[component.eta] = shape[: len(component.eta)]
    angles = tuple(np.zeros((*block.mass.shape, shape.shape[1]), shape.dtype) for block in parted_rig.rig.blocks)
    for heavy, at in zip(component.heavies, matrices.places.tolist(), strict=False):
        angle = shape[at : at + parted_rig.rig.blocks[heavy.block].n]
        for share in heavy.shares:
            angles[heavy.block][:, share.column] += share.amplitude * angle
    return StructureShapes(parted_rig, eta, angles)


def _tree(
    mass: Floats,
    stiffness: Floats,
    springs: dict[tuple[int, int], tuple[float, float, float]],
    hanging_chains: list[HungChains],
) -> Tree | None:
    """The tree of coordinates in the order in which they are reached from the first; None if there is a loop."""
    neighbours: list[list[tuple[int, float, float, float]]] = [[] for _ in mass]
    for (first, second), (size, alpha, beta) in springs.items():
        neighbours[first].append((second, size, alpha, beta))
        neighbours[second].append((first, size, beta, alpha))
    order, parents = [0][: len(mass)], {0: (-1, 0.0, 0.0, 0.0)}
    for i in order:
        for neighbour, size, alpha, beta in neighbours[i]:
            if neighbour not in parents:
                order.append(neighbour)
                parents[neighbour] = (i, size, alpha, beta)
    if len(order) < len(mass):
        return None
    at = {place: k for k, place in enumerate(order)}
    spring, near_end, far_end = np.reshape([parents[place][1:] for place in order], (-1, 3)).T
    tree: Tree = deferred("modal.eigen.trees:Tree")(
        np.array(order, dtype=np.int64),
        np.array([at.get(parents[place][0], -1) for place in order], dtype=np.int64),
        stiffness[order],
        mass[order],
        spring,
        near_end,
        far_end,
        tuple(
            hanging._replace(places=np.array([at.get(place, 0) for place in hanging.places.tolist()]))
            for hanging in hanging_chains
        ),
    )
    return tree
