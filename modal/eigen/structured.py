"""The source of modes of pendula that move with a structure, without free motions.

The frequencies of a component (`modal.eigen.components`) are found by counts if its springs form a tree
(`modal.eigen.trees`), from the factors of K and M if all springs are positive (`modal.eigen.product`), and from dense
matrices with dampers or a negative stiffness, as of pivots above an axis. All in natural units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modal.assembly import RatioAt, modal_factor
from modal.eigen import dense
from modal.eigen.amplitude import LIGHT, coefficient, quartic
from modal.eigen.component_matrices import (
    BEYOND,
    ComponentMatrices,
    Numbers,
    SquareSum,
    is_wide,
    shapes_in_scene,
)
from modal.eigen.coupled import MOST_LINKS_TOGETHER
from modal.eigen.free_motions import details_of, significant_product
from modal.eigen.sources import (
    MOST_COORDINATES,
    Details,
    ProblemSize,
    largest_angle,
    noun_count,
    oscillating,
    structured_error,
)
from modal.eigen.squares import EVERYTHING, Limits
from modal.errors import ComputationError
from modal.report import deferred
from modal.types import EPS, Complexes, Floats, Ints

ERROR_OF_NARROW = 64.0
"""Tolerance: factor on the error where triangular factors are in floats no wider than the results."""


@dataclass(frozen=True, eq=False)
class OnStructure:
    """The modes of one component without its free motions: of a structure, a cart, or a chain on a fixed support."""

    matrices: ComponentMatrices
    ratio: RatioAt | None = None
    limits: Limits = EVERYTHING

    @cached_property
    def is_damped(self) -> bool:
        """Whether there are dampers other than those of a damping ratio."""
        return self.matrices.is_damped

    @cached_property
    def _is_counted(self) -> bool:
        is_cart = self._is_plain and len(self.matrices.component.eta) > 0
        if self.is_damped or (is_cart and self.matrices.size - 1 > MOST_LINKS_TOGETHER):
            return False
        if (tree := self.matrices.tree) is None:
            return False
        return not self.is_singular if self._is_plain else self.matrices.is_positive and tree.is_plain

    @property
    def _is_plain(self) -> bool:
        return self.matrices.parted_rig.is_plain

    @property
    def _is_product(self) -> bool:
        has_factors = self.matrices.has_rotors or not self._is_plain
        return (
            has_factors and self.matrices.is_positive and not (self.is_damped or self._is_counted or self.is_singular)
        )

    @cached_property
    def is_singular(self) -> bool:
        """Whether M is known to be singular, by a massless cart over bobs."""
        if self.matrices.has_rotors:
            is_held = any(_inertial_mass(block).any() for block in self.matrices.parted_rig.rig.blocks)
            return self._is_plain and self.matrices.is_massless and not is_held
        tree = self.matrices.tree if self._is_plain and self.matrices.is_massless else None
        return tree is not None and not tree.bare.all()

    @property
    def route(self) -> str:
        """Counts, factors or dense matrices, about the equilibrium under constant forces if there are any."""
        if self._is_counted:
            return "effective mass" if self.matrices.tree and self.matrices.tree.is_plain else "mass and moment"
        leaning = ", about the equilibrium under constant forces" * self.matrices.parted_rig.rig.leans
        return "product form" if self._is_product else f"dense{leaning}"

    @property
    def problem_size(self) -> ProblemSize:
        """The unknowns of the component, and matrices if there are any."""
        eta, n = len(self.matrices.component.eta), self.matrices.size
        links = noun_count(n - eta, "link")
        what = f"{noun_count(eta, 'coordinate')} of the structure and {links}"
        if self._is_plain:
            what = f"cart and {links}" if eta else f"chain of {links}, support still"
        if self._is_counted:
            return ProblemSize(what, 1, n)
        if self._is_product:
            return ProblemSize(what, 1, n, (("factors", n, 2),))
        sizes = [("M", n, 1), ("K", n, 1), *([("D", n, 1)] if self.is_damped else [])]
        kind = "state" if self.is_damped else "symmetric"
        return ProblemSize(what, 1, n, (*sizes, (kind, self._dense.order, self._dense.number)), self.is_damped)

    @cached_property
    def squares(self) -> Floats:
        """ω² (R,) by counts."""
        assert self.matrices.tree is not None
        return self.matrices.tree.squares(self.limits.lowest)

    @cached_property
    def eigenvalue(self) -> Complexes:
        """iω, growth rates, and with dampers −ζω + iω√(1−ζ²)."""
        if self._is_counted:
            return oscillating(self.squares)
        return np.asarray(self._product[0] * 1j) if self._is_product else self._dense.eigenvalue

    @cached_property
    def error(self) -> Floats:
        """Relative error bounds."""
        matrices, loss_error = self.matrices, 0.0
        if not (self._is_counted or self._is_product):
            return self._dense.error
        if matrices.hidden.any():
            loss_error = EPS * matrices.cancelling
        for _, modal_matrices in matrices.modal:
            loss_error += sum(len(S) * EPS / 2 * _condition(S) for S in modal_matrices[:2])
        if self._is_counted:
            blocks = [matrices.parted_rig.rig.blocks[heavy.block] for heavy in matrices.component.heavies]
            deepest = max((block.n for block in blocks), default=0)
            deepest += 0 if self._is_plain else 2 * len(matrices.component.eta)
            assert matrices.tree is not None
            return matrices.tree.slack(self.squares) * structured_error(deepest, len(blocks)) + loss_error
        narrow = ERROR_OF_NARROW if not is_wide(matrices.size) else 1.0
        squares = matrices.size * (1 + matrices.has_rotors)
        return np.full(len(self._product[0]), narrow * (32 + 12 * squares) * EPS / 2 + loss_error)

    @cached_property
    def _product(self) -> tuple[Floats, Floats]:
        """ω (R,) and shapes (n, R) from the factors."""
        dense.refuse_beyond(MOST_COORDINATES, self.matrices.size, "shapes on a structure")
        M, K, _ = self.matrices.factors
        modes: tuple[Floats, Floats] = _product_modes(K, M, self.matrices.free.shape[1])
        return modes

    @cached_property
    def _dense(self) -> dense.Eigen:
        """Of dense matrices, free motions without dampers omitted with their momentum."""
        leans, positive = self.matrices.parted_rig.rig.leans, self.matrices.is_positive
        cause = "constant forces" if leans else "inverted links" if not positive else "joint springs"
        cause = cause if self._is_plain else "falling coordinates"
        largest = dense.LARGEST_DAMPED if self.is_damped else dense.LARGEST_UNDAMPED
        dense.refuse_beyond(largest, self.matrices.size, "dampers" if self.is_damped else cause)
        is_conservative = self._is_plain and positive and not self.is_damped
        if self.is_singular and not is_conservative:
            raise ComputationError(dense.SINGULAR)
        M, K = (factor.matrix for factor in self.matrices.factors[:2])
        if not is_conservative and dense.is_singular(M):
            raise ComputationError(dense.SINGULAR if self._is_plain else BEYOND)
        coasting = self.matrices.coasting
        coordinates, back, inertia, loss_factor = _eliminate_free_motions(coasting, M)
        stiffness, terms, selection = K[np.ix_(coordinates, coordinates)], self.matrices.terms[coordinates], slice(None)
        grown = len(M) / max(len(coordinates), 1)
        if is_conservative:
            modes = dense.undamped_modes(
                inertia, stiffness, M[np.ix_(coordinates, coordinates)], singular=self.is_singular
            )
            modes = replace(modes, error=modes.error * grown)
        elif not self.is_damped:
            modes = dense.indefinite_modes(inertia, stiffness, terms=terms, loss_factor=loss_factor * grown)
        else:
            roots, modal = self._dampers
            dampers = dense.Dampers(
                roots.strength[coordinates],
                _parents_among(roots.parents, coordinates),
                _rows(roots.roots, coordinates),
                roots.signs,
            )
            modes = dense.damped_modes(inertia, stiffness, terms, dampers, _rows(modal, coordinates), loss_factor)
            selection = slice(self.matrices.free.shape[1] - coasting.shape[1], None)
        turn_error = self._turn_by_rounding(K) if leans else 0.0
        return replace(
            modes,
            eigenvalue=modes.eigenvalue[selection],
            shape=back @ modes.shape[:, selection],
            error=modes.error[selection] + turn_error,
        )

    def _turn_by_rounding(self, K: Floats) -> float:
        """How far rounding may turn links (rad) whose equilibrium constant forces move, as near the balance of forces.

        M and K change with the cosines of their angles.
        """
        first = len(self.matrices.component.eta)
        compliance = np.abs(np.linalg.inv(K[first:, first:]))
        return float(8 * EPS * (compliance @ self.matrices.terms[first:]).max())

    @cached_property
    def _losses(self) -> SquareSum:
        """D with the contribution of the damping ratio."""
        D, modal = self.matrices.factors[2], self._dampers[1]
        if modal is None:
            return D
        return SquareSum(np.concatenate([D.rows, modal]), np.concatenate([D.size, np.ones(len(modal))]))

    @cached_property
    def _dampers(self) -> tuple[dense.Dampers, Floats | None]:
        """Dampers of joints below the first by their links, all others by their rows; and C with D_modal = CᵀC."""
        matrices, D = self.matrices, self.matrices.factors[2]
        strength, parents = np.zeros(matrices.size), np.full(matrices.size, -1)
        by_rows = np.ones(len(D.size), dtype=bool)
        for k, (row, size) in enumerate(zip(*D, strict=True)):
            at = np.flatnonzero(row)
            is_joint = at.size == 2 and at[0] >= len(matrices.component.eta) and row[at[1]] == -row[at[0]] == 1
            if (at.size == 1 and abs(row[at[0]]) == 1 and not strength[at[0]]) or is_joint:
                strength[at[-1]], by_rows[k] = size, False
                parents[at[-1]] = at[0] if is_joint else -1
        roots = np.sqrt(np.abs(D.size))[by_rows, None] * D.rows[by_rows]
        modal = None
        if self.ratio is not None:
            M, K, _ = matrices.factors
            if self._is_plain:
                modal = modal_factor(M.matrix, K.matrix, bool(matrices.free.size), self.ratio)
            elif not matrices.is_positive:
                raise ComputationError("damping_ratio: is not computed with dampers where a coordinate falls")
            else:
                omega, shapes = _product_modes(K, M, matrices.free.shape[1])
                modal = np.sqrt(2 * self.ratio(omega) * omega)[:, None] * (M.matrix @ shapes).T
        signs = np.sign(D.size[by_rows])
        return dense.Dampers(strength, parents, roots if len(roots) else None, signs), modal

    def details(self, rows: Ints) -> Details:
        """Shapes over the whole structure and every kind of pendulum."""
        if self._is_counted:
            return self._tree_details(rows)
        matrices, value, shape = self.matrices, self.eigenvalue[rows], self._shapes(rows)
        M, K, _ = matrices.factors
        shapes = shapes_in_scene(matrices, shape)
        modal_mass = (M.size[:, None] * np.abs(M.rows @ shape) ** 2).sum(0)
        momentum = np.full(len(rows), np.nan)
        if not self.is_damped:
            momentum = significant_product(matrices.momentum, shape)
            potential = (K.size[:, None] * (K.rows @ shape) ** 2).sum(0)
            residual = np.abs(1 + potential / modal_mass / (value**2).real)
        else:
            terms = [(K, 0), (self._losses, 1), (M, 2)]
            push = sum(part.rows.T @ (part.size[:, None] * (part.rows @ shape)) * value**p for part, p in terms)
            size = sum(
                np.abs(part.rows.T)
                @ (np.abs(part.size)[:, None] * (np.abs(part.rows) @ np.abs(shape)))
                * np.abs(value) ** p
                for part, p in terms
            )
            unit = np.sqrt(M.size @ M.rows**2)[:, None]
            residual = np.linalg.norm(push / unit, axis=0) / np.linalg.norm(size / unit, axis=0)
        details = details_of(shapes, modal_mass, momentum, residual, shapes.energies)
        return self._of_cart(details, value, shape) if self._is_plain else details

    def _tree_details(self, rows: Ints) -> Details:
        """Shapes of a tree."""
        tree, value = self.matrices.tree, self.eigenvalue[rows]
        assert tree is not None
        shape, works, push, residual = tree.shapes(self.squares, rows)
        shapes, unit = shapes_in_scene(self.matrices, shape), np.ones(len(rows))
        if not self._is_plain:
            momentum = significant_product(self.matrices.momentum, shape)
            return details_of(shapes, unit, momentum, residual, shapes.energies)
        counts = (block.count[:, None] for block in self.matrices.parted_rig.rig.blocks)
        energies = tuple(work / count for work, count in zip(works, counts, strict=True))
        return self._of_cart(details_of(shapes, unit, push, residual, energies), value, shape)

    def _of_cart(self, details: Details, value: Complexes, shape: Numbers) -> Details:
        """The properties of these modes with κ and, on a cart, its motion."""
        momentum, participation = details.momentum, np.zeros(len(value))
        if details.eta:
            participation = self._participation(details.modal_mass, value, shape)
        if details.eta and not self.is_damped:
            (spring,) = self.matrices.parted_rig.hanging.structure.carriers[0].stiffness
            momentum = spring * details.cart.real / -(value**2).real
        kappa = self._kappa(details, value, shape)
        return replace(details, momentum=momentum, participation=participation, kappa=kappa)

    def _participation(self, modal_mass: Floats, value: Complexes, shape: Numbers) -> Floats:
        """The share of each mode in the cart's response to a sudden push (`modal.modes.mode`).

        It is x'(0+) = Σ λ φ_x²/(φᵀ(2λM + D)φ) over all eigenvalues, a conjugate pair giving twice the real part.
        """
        if not self.is_damped:
            return np.asarray(shape[0].real ** 2 / modal_mass / self.accelerance)
        M, _, D = *self.matrices.factors[:2], self._losses
        inertia, losses = ((S.size[:, None] * (S.rows @ shape) ** 2).sum(0) for S in (M, D))
        residue: Floats = (value * shape[0] ** 2 / (2 * value * inertia + losses)).real / self.accelerance
        return np.where(value.imag > 0, 2 * residue, residue)

    @cached_property
    def accelerance(self) -> float:
        """Σ φ_x² over all finite modes of a cart (1/kg): (M⁻¹)_xx, or from the modes if M is singular."""
        if (tree := self.matrices.tree) is None:
            return float(np.linalg.inv(self.matrices.factors[0].matrix)[0, 0])
        if not self.is_singular:
            return 1.0 / float(tree.bare[0])
        M, shape = self.matrices.factors[0], self._dense.shape.real
        finite = float(np.sum(shape[0] ** 2 / (M.size[:, None] * (M.rows @ shape) ** 2).sum(0)))
        return finite + (1.0 / float(M.matrix[0, 0]) if self.matrices.free.size else 0.0)

    def _kappa(self, details: Details, value: Complexes, shape: Numbers) -> Floats:
        """κ of the in-phase part of each shape: exact without dampers, to first order in light ones.

        About an equilibrium that constant forces have moved there are forces of odd order, too: NaN.
        """
        rig, omega = self.matrices.parted_rig.rig, np.abs(value)
        if rig.leans:
            return np.full(len(value), np.nan)
        angles = tuple(angle.real for angle in details.angles)
        parts = zip(rig.blocks, angles, strict=True)
        gamma = np.sum(
            [(quartic(b, omega**2, details.cart.real, a) * b.count[:, None]).sum(0) for b, a in parts], axis=0
        )
        modal_mass = details.modal_mass
        if self.is_damped:
            M = self.matrices.factors[0]
            modal_mass = (M.size[:, None] * (M.rows @ shape.real) ** 2).sum(0)
        kappa = coefficient(gamma, modal_mass, omega**2, largest_angle(angles))
        quiet = np.abs(shape.imag).max(0) < LIGHT * np.abs(shape.real).max(0)
        light = (np.abs(value.real) < LIGHT * omega) & quiet
        return np.where(light, kappa, np.nan)

    def _shapes(self, rows: Ints) -> Numbers:
        """(n, R), real without dampers; motions within rounding, by their share of the energy, are set to 0."""
        all_shapes = self._product[1] if self._is_product else self._dense.shape
        first, M = len(self.matrices.component.eta), self.matrices.factors[0]
        shape = all_shapes[:, rows]
        shape = dense.in_phase(shape, first if self.matrices.size > first else 0) if self.is_damped else shape.real
        weight = np.sqrt((M.size[:, None] * M.rows**2).sum(0))[:, None]
        sizes = np.abs(shape) * weight
        return np.where(sizes > 4 * len(shape) * EPS * sizes.max(0), shape, 0.0)


_inertial_mass = deferred("modal.eigen.trees:inertial_mass")
_product_modes = deferred("modal.eigen.product:product_modes")


def _condition(S: Floats) -> float:
    """How much roundings of a matrix with a unit diagonal count, 1 for a diagonal one."""
    if not (S - np.diag(np.diag(S))).any():
        return 1.0
    scale = 1 / np.sqrt(np.abs(np.diag(S)) + np.finfo(float).tiny)
    values = np.abs(np.linalg.eigvalsh(S * scale * scale[:, None]))
    significant = values[values > 4 * len(S) * EPS * values.max()]
    return float(values.max() / significant.min())


def _eliminate_free_motions(free: Floats, M: Floats) -> tuple[Ints, Floats, Floats, float]:
    """The system without free motions (n, f): coordinates, shapes from them, inertia, and its loss of digits.

    In each motion one coordinate rests and the momentum is 0, as on a free cart.
    """
    n, f = free.shape
    if not f:
        return np.arange(n), np.eye(n), M, 1.0
    resting = list[int]()
    A = free.copy()
    for k in range(f):
        at = int(np.abs(A[:, k:] if k else A).max(1).argmax())
        c = k + int(np.abs(A[at, k:]).argmax())
        A[:, [k, c]] = A[:, [c, k]]
        A[:, k] /= A[at, k]
        others = np.arange(f) != k
        A[:, others] -= np.multiply.outer(A[:, k], A[at, others])
        resting.append(at)
    coordinates = np.setdiff1d(np.arange(n), resting)
    momentum = A.T @ M
    follow = np.linalg.solve(momentum @ A, momentum[:, coordinates])
    part = M[np.ix_(coordinates, coordinates)]
    inertia = part - momentum[:, coordinates].T @ follow
    loss_factor = float((np.diag(part) / np.diag(inertia)).max(initial=1.0))
    return coordinates, np.eye(n)[:, coordinates] - A @ follow, (inertia + inertia.T) / 2, loss_factor


def _parents_among(parents: Ints, coordinates: Ints) -> Ints:
    """The indices of coordinates among those retained."""
    at = {int(k): i for i, k in enumerate(coordinates)}
    return np.array([at.get(int(parents[k]), -1) for k in coordinates])


def _rows(roots: Floats | None, coordinates: Ints) -> Floats | None:
    return None if roots is None else roots[:, coordinates]
