"""The source of modes of pendula on structures: what moves with the structure, free motions aside.

The frequencies of a component (`modal.eigen.components`) are found by counts where its springs form a tree
(`modal.eigen.trees`), from the factors of K and M where all springs are positive (`modal.eigen.product`), and from
dense matrices with dampers and where a coordinate falls, as under pivots above an axis.  All in natural units.
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
    moved_of,
)
from modal.eigen.coupled import MOST_LINKS_TOGETHER
from modal.eigen.free_motions import cancelled, details_of
from modal.eigen.sources import ROUNDOFF, Built, Details, counted, largest_angle, oscillating, structured_error
from modal.eigen.squares import EVERYTHING, Limits
from modal.errors import ComputationError
from modal.report import deferred
from modal.types import Complexes, Floats, Ints

LARGEST = 1200
"""Coordinates of one component up to which shapes, and frequencies from factors, are computed."""
NARROW = 64.0
"""Factor on the error where the triangular factors are computed in floats no wider than the results."""


@dataclass(frozen=True, eq=False)
class OnStructure:
    """The modes of one component but its free motions: of a structure, a cart, or a chain on a support at rest."""

    reduced: ComponentMatrices
    ratio: RatioAt | None = None
    limits: Limits = EVERYTHING

    @cached_property
    def is_damped(self) -> bool:
        """Whether there are dampers besides those of a damping ratio."""
        return self.reduced.is_damped

    @cached_property
    def _is_counted(self) -> bool:
        is_cart = self._is_plain and len(self.reduced.component.eta) > 0
        if self.is_damped or (is_cart and self.reduced.size - 1 > MOST_LINKS_TOGETHER):
            return False
        if (tree := self.reduced.tree) is None:
            return False
        return not self.is_singular if self._is_plain else self.reduced.is_positive and tree.is_plain

    @property
    def _is_plain(self) -> bool:
        return self.reduced.carried.is_plain

    @property
    def _is_product(self) -> bool:
        return self.reduced.is_positive and not (self.is_damped or self._is_plain or self._is_counted)

    @cached_property
    def is_singular(self) -> bool:
        """Whether M is known to be singular, by a massless cart over bobs."""
        tree = self.reduced.tree if self._is_plain and self.reduced.is_massless else None
        return tree is not None and not tree.bare.all()

    @property
    def route(self) -> str:
        """Counts, factors or dense matrices, about the equilibrium under constant forces where there are any."""
        if self._is_counted:
            return "effective mass" if self.reduced.tree and self.reduced.tree.is_plain else "mass and moment"
        leaning = ", about the equilibrium under constant forces" * self.reduced.carried.rig.leans
        return "product form" if self._is_product else f"dense{leaning}"

    @property
    def built(self) -> Built:
        """The unknowns of the component, and matrices where there are any."""
        eta, n = len(self.reduced.component.eta), self.reduced.size
        links = counted(n - eta, "link")
        what = f"{counted(eta, 'coordinate')} of the structure and {links}"
        if self._is_plain:
            what = f"cart and {links}" if eta else f"chain of {links}, support still"
        if self._is_counted:
            return Built(what, 1, n)
        if self._is_product:
            return Built(what, 1, n, (("factors", n, 2),))
        sizes = [("M", n, 1), ("K", n, 1), *([("D", n, 1)] if self.is_damped else [])]
        kind = "state" if self.is_damped else "symmetric"
        return Built(what, 1, n, (*sizes, (kind, self._dense.order, self._dense.number)), self.is_damped)

    @cached_property
    def squares(self) -> Floats:
        """ω² (R,) by counts."""
        assert self.reduced.tree is not None
        return self.reduced.tree.squares(self.limits.lowest)

    @cached_property
    def eigenvalue(self) -> Complexes:
        """iω, growth rates, and with dampers −ζω + iω√(1−ζ²)."""
        if self._is_counted:
            return oscillating(self.squares)
        return np.asarray(self._product[0] * 1j) if self._is_product else self._dense.eigenvalue

    @cached_property
    def error(self) -> Floats:
        """Relative error bounds."""
        reduced, lost = self.reduced, 0.0
        if not (self._is_counted or self._is_product):
            return self._dense.error
        if reduced.hidden.any():
            lost = 2 * ROUNDOFF * reduced.cancelling
        for _, matrices in reduced.modal:
            lost += sum(len(S) * ROUNDOFF * _condition(S) for S in matrices[:2])
        if self._is_counted:
            blocks = [reduced.carried.rig.blocks[heavy.block] for heavy in reduced.component.heavies]
            deepest = max((block.n for block in blocks), default=0)
            deepest += 0 if self._is_plain else 2 * len(reduced.component.eta)
            assert reduced.tree is not None
            return reduced.tree.slack(self.squares) * structured_error(deepest, len(blocks)) + lost
        narrow = NARROW if not is_wide(reduced.size) else 1.0
        return np.full(len(self._product[0]), narrow * (32 + 12 * reduced.size) * ROUNDOFF + lost)

    @cached_property
    def _product(self) -> tuple[Floats, Floats]:
        """ω (R,) and shapes (n, R) from the factors."""
        dense.refuse_beyond(LARGEST, self.reduced.size, "shapes on a structure")
        M, K, _ = self.reduced.factors
        return _product_modes(K, M, self.reduced.free.shape[1])

    @cached_property
    def _dense(self) -> dense.Eigen:
        """Of dense matrices, free motions without dampers left out with their momentum."""
        leans, positive = self.reduced.carried.rig.leans, self.reduced.is_positive
        cause = "constant forces" if leans else "inverted links" if not positive else "joint springs"
        cause = cause if self._is_plain else "falling coordinates"
        largest = dense.LARGEST_DAMPED if self.is_damped else dense.LARGEST_UNDAMPED
        dense.refuse_beyond(largest, self.reduced.size, "dampers" if self.is_damped else cause)
        undamped = self._is_plain and positive and not self.is_damped
        if self.is_singular and not undamped:
            raise ComputationError(dense.SINGULAR)
        M, K = (factor.matrix for factor in self.reduced.factors[:2])
        if not undamped and dense.is_singular(M):
            raise ComputationError(dense.SINGULAR if self._is_plain else BEYOND)
        coasting = self.reduced.coasting
        kept, back, inertia, lost = _without(coasting, M)
        stiffness, terms, left = K[np.ix_(kept, kept)], self.reduced.terms[kept], slice(None)
        grown = len(M) / max(len(kept), 1)
        if undamped:
            modes = dense.undamped(inertia, stiffness, M[np.ix_(kept, kept)], singular=self.is_singular)
            modes = replace(modes, error=modes.error * grown)
        elif not self.is_damped:
            modes = dense.indefinite(inertia, stiffness, terms=terms, lost=lost * grown)
        else:
            roots, modal = self._dampers
            dampers = dense.Dampers(roots.strength[kept], _kept(roots.above, kept), _rows(roots.roots, kept))
            modes = dense.damped(inertia, stiffness, terms, dampers, _rows(modal, kept), lost)
            left = slice(self.reduced.free.shape[1] - coasting.shape[1], None)
        turned = self._turned_by_rounding(K) if leans else 0.0
        return replace(
            modes,
            eigenvalue=modes.eigenvalue[left],
            shape=back @ modes.shape[:, left],
            error=modes.error[left] + turned,
        )

    def _turned_by_rounding(self, K: Floats) -> float:
        """How far rounding may turn links (rad) whose equilibrium constant forces move, as near the balance of forces.

        M and K change with the cosines of their angles.
        """
        first = len(self.reduced.component.eta)
        held = np.abs(np.linalg.inv(K[first:, first:]))
        return float(8 * dense.EPS * (held @ self.reduced.terms[first:]).max())

    @cached_property
    def _losses(self) -> SquareSum:
        """D with what the damping ratio adds to it."""
        D, modal = self.reduced.factors[2], self._dampers[1]
        if modal is None:
            return D
        return SquareSum(np.concatenate([D.rows, modal]), np.concatenate([D.size, np.ones(len(modal))]))

    @cached_property
    def _dampers(self) -> tuple[dense.Dampers, Floats | None]:
        """Dampers of joints below the first by their links, all others by their rows; and C with D_modal = CᵀC."""
        reduced, D = self.reduced, self.reduced.factors[2]
        strength, above = np.zeros(reduced.size), np.full(reduced.size, -1)
        by_rows = np.ones(len(D.size), dtype=bool)
        for k, (row, size) in enumerate(zip(*D, strict=True)):
            at = np.flatnonzero(row)
            beside = at.size == 2 and at[0] >= len(reduced.component.eta) and row[at[1]] == -row[at[0]] == 1
            if (at.size == 1 and abs(row[at[0]]) == 1 and not strength[at[0]]) or beside:
                strength[at[-1]], by_rows[k] = size, False
                above[at[-1]] = at[0] if beside else -1
        roots = np.sqrt(D.size)[by_rows, None] * D.rows[by_rows]
        modal = None
        if self.ratio is not None:
            M, K, _ = reduced.factors
            if self._is_plain:
                modal = modal_factor(M.matrix, K.matrix, bool(reduced.free.size), self.ratio)
            elif not reduced.is_positive:
                raise ComputationError("damping_ratio: is not computed with dampers where a coordinate falls")
            else:
                omega, shapes = _product_modes(K, M, reduced.free.shape[1])
                modal = np.sqrt(2 * self.ratio(omega) * omega)[:, None] * (M.matrix @ shapes).T
        return dense.Dampers(strength, above, roots if len(roots) else None), modal

    def details(self, rows: Ints) -> Details:
        """Shapes over the whole structure and every kind of pendulum."""
        if self._is_counted:
            return self._counted(rows)
        reduced, value, shape = self.reduced, self.eigenvalue[rows], self._shapes(rows)
        M, K, _ = reduced.factors
        moved = moved_of(reduced, shape)
        modal_mass = (M.size[:, None] * np.abs(M.rows @ shape) ** 2).sum(0)
        momentum = np.full(len(rows), np.nan)
        if not self.is_damped:
            momentum = cancelled(reduced.momentum, shape)
            held = (K.size[:, None] * (K.rows @ shape) ** 2).sum(0)
            residual = np.abs(1 + held / modal_mass / (value**2).real)
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
        described = details_of(moved, modal_mass, momentum, residual, moved.energies)
        return self._of_cart(described, value, shape) if self._is_plain else described

    def _counted(self, rows: Ints) -> Details:
        """Shapes of a tree."""
        tree, value = self.reduced.tree, self.eigenvalue[rows]
        assert tree is not None
        shape, works, push, missed = tree.shapes(self.squares, rows)
        moved, unit = moved_of(self.reduced, shape), np.ones(len(rows))
        if not self._is_plain:
            momentum = cancelled(self.reduced.momentum, shape)
            return details_of(moved, unit, momentum, missed, moved.energies)
        counts = (block.count[:, None] for block in self.reduced.carried.rig.blocks)
        energies = tuple(work / count for work, count in zip(works, counts, strict=True))
        return self._of_cart(details_of(moved, unit, push, missed, energies), value, shape)

    def _of_cart(self, details: Details, value: Complexes, shape: Numbers) -> Details:
        """The properties of these modes with κ and, on a cart, what moves it."""
        is_cart = len(self.reduced.component.eta) > 0
        cart = shape[0] if is_cart else np.zeros(len(value))
        momentum = details.momentum
        if is_cart and not self.is_damped:
            (spring,) = self.reduced.carried.hanging.structure.carriers[0].stiffness
            momentum = spring * cart.real / -(value**2).real
        return replace(
            details,
            momentum=momentum,
            cart=cart,
            participation=self._participation(details.modal_mass, value, shape) if is_cart else cart.real,
            kappa=self._kappa(details, value, shape),
            eta=(),
        )

    def _participation(self, modal_mass: Floats, value: Complexes, shape: Numbers) -> Floats:
        """The share of each mode in the cart's response to a sudden push (`modal.modes.mode`).

        It is x'(0+) = Σ λ φ_x²/(φᵀ(2λM + D)φ) over all eigenvalues, a conjugate pair giving twice the real part.
        """
        if not self.is_damped:
            return np.asarray(shape[0].real ** 2 / modal_mass / self.accelerance)
        M, _, D = *self.reduced.factors[:2], self._losses
        inertia, losses = ((S.size[:, None] * (S.rows @ shape) ** 2).sum(0) for S in (M, D))
        residue: Floats = (value * shape[0] ** 2 / (2 * value * inertia + losses)).real / self.accelerance
        return np.where(value.imag > 0, 2 * residue, residue)

    @cached_property
    def accelerance(self) -> float:
        """Σ φ_x² over all finite modes of a cart (1/kg): (M⁻¹)_xx, where M is singular from the modes themselves."""
        if (tree := self.reduced.tree) is None:
            return float(np.linalg.inv(self.reduced.factors[0].matrix)[0, 0])
        if not self.is_singular:
            return 1.0 / float(tree.bare[0])
        M, shape = self.reduced.factors[0], self._dense.shape.real
        finite = float(np.sum(shape[0] ** 2 / (M.size[:, None] * (M.rows @ shape) ** 2).sum(0)))
        return finite + (1.0 / float(M.matrix[0, 0]) if self.reduced.free.size else 0.0)

    def _kappa(self, details: Details, value: Complexes, shape: Numbers) -> Floats:
        """κ of the in-phase part of each shape: exact without dampers, to first order in light ones.

        About an equilibrium that constant forces have moved there are forces of odd order, too: NaN.
        """
        rig, omega = self.reduced.carried.rig, np.abs(value)
        if rig.leans:
            return np.full(len(value), np.nan)
        cart = shape.real[0] if len(self.reduced.component.eta) else np.zeros(len(value))
        angles = tuple(angle.real for angle in details.angles)
        parts = zip(rig.blocks, angles, strict=True)
        gamma = np.sum([(quartic(b, omega**2, cart, a) * b.count[:, None]).sum(0) for b, a in parts], axis=0)
        modal_mass = details.modal_mass
        if self.is_damped:
            M = self.reduced.factors[0]
            modal_mass = (M.size[:, None] * (M.rows @ shape.real) ** 2).sum(0)
        kappa = coefficient(gamma, modal_mass, omega**2, largest_angle(angles))
        quiet = np.abs(shape.imag).max(0) < LIGHT * np.abs(shape.real).max(0)
        light = (np.abs(value.real) < LIGHT * omega) & quiet
        return np.where(light, kappa, np.nan)

    def _shapes(self, rows: Ints) -> Numbers:
        """(n, R), real without dampers; what moves no more than rounding, in its share of the energy, is still."""
        whole = self._product[1] if self._is_product else self._dense.shape
        first, M = len(self.reduced.component.eta), self.reduced.factors[0]
        shape = whole[:, rows]
        shape = dense.in_phase(shape, first if self.reduced.size > first else 0) if self.is_damped else shape.real
        weight = np.sqrt((M.size[:, None] * M.rows**2).sum(0))[:, None]
        sizes = np.abs(shape) * weight
        return np.where(sizes > 4 * len(shape) * dense.EPS * sizes.max(0), shape, 0.0)


def _product_modes(stiffness: SquareSum, inertia: SquareSum, free: int) -> tuple[Floats, Floats]:
    """ω and shapes by `modal.eigen.product`, which loads SciPy's linear algebra: scenes without structures do not."""
    modes: tuple[Floats, Floats] = deferred("modal.eigen.product:product_modes")(stiffness, inertia, free)
    return modes


def _condition(S: Floats) -> float:
    """How much roundings of a matrix with a unit diagonal count, 1 for a diagonal one."""
    if not (S - np.diag(np.diag(S))).any():
        return 1.0
    scale = 1 / np.sqrt(np.abs(np.diag(S)) + np.finfo(float).tiny)
    values = np.abs(np.linalg.eigvalsh(S * scale * scale[:, None]))
    kept = values[values > 4 * len(S) * dense.EPS * values.max()]
    return float(values.max() / kept.min())


def _without(free: Floats, M: Floats) -> tuple[Ints, Floats, Floats, float]:
    """What is left without free motions (n, f): coordinates, shapes from them, inertia, and its loss of digits.

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
    kept = np.setdiff1d(np.arange(n), resting)
    momentum = A.T @ M
    follow = np.linalg.solve(momentum @ A, momentum[:, kept])
    left = M[np.ix_(kept, kept)]
    inertia = left - momentum[:, kept].T @ follow
    lost = float((np.diag(left) / np.diag(inertia)).max(initial=1.0))
    return kept, np.eye(n)[:, kept] - A @ follow, (inertia + inertia.T) / 2, lost


def _kept(above: Ints, kept: Ints) -> Ints:
    """The places of coordinates among those that are kept."""
    at = {int(k): i for i, k in enumerate(kept)}
    return np.array([at.get(int(above[k]), -1) for k in kept])


def _rows(roots: Floats | None, kept: Ints) -> Floats | None:
    return None if roots is None else roots[:, kept]
