"""Modes from matrices, for dampers, constant forces, and joint springs and inverted links beyond `sprung_chains`.

For one chain, or for one heavy pendulum of each kind and the cart. A damped mode φ of eigenvalue λ takes part in the
cart's response to a sudden push with its residue,

    x'(0+) = Σ λ φ_x²/(φᵀ(2λM + D)φ)    over all eigenvalues,

where a conjugate pair gives twice the real part; without dampers that is φ_x²/(φᵀMφ).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal.assembly import DRAG, DRAG_DOWN, Block, CartNumbers, Columns, RatioAt, assembled, modal_factor, on_rail
from modal.eigen import dense, quadratic
from modal.eigen.amplitude import coefficient, quartic
from modal.eigen.chains import bare_mass, is_singular
from modal.eigen.counts import Built, counted
from modal.eigen.recursion import joints, kinetic
from modal.eigen.sources import Details, largest_angle, per_copy
from modal.errors import ComputationError
from modal.types import Floats, Ints

LIGHT = 0.1
"""Damping ratio, and out-of-phase share of a shape, up to which a mode has an amplitude coefficient."""

Numbers = NDArray[Any]


@dataclass(frozen=True, eq=False)
class FromMatrices:
    """Modes of one chain (`cart` None) or of everything together.

    Damping ratios of the undamped modes, if any, are added to the dampers; without dampers they change no shape.
    """

    blocks: tuple[Block, ...]
    counts: tuple[Ints, ...]
    cart: CartNumbers | None
    ratio: RatioAt | None = None

    @property
    def route(self) -> str:
        """Dense, about the equilibrium under constant forces where there are any."""
        return "dense, about the equilibrium under constant forces" if self.leans else "dense"

    @property
    def built(self) -> Built:
        """The assembled matrices, and the one whose eigenvalues were found."""
        M, K = self.matrices
        sizes = [("M", len(M), 1), ("K", len(K), 1), *([("D", len(self.D), 1)] if self.is_damped else [])]
        links = counted(sum(block.mass.size for block in self.blocks), "link")
        what = f"cart and {links}" if self.cart else f"chain of {links}, support still"
        kind = "state" if self.is_damped else "symmetric"
        return Built(what, 1, len(M), (*sizes, (kind, self.modes.order, self.modes.number)), self.is_damped)

    @cached_property
    def matrices(self) -> tuple[Floats, Floats]:
        """(M, K) with copies folded into one heavy pendulum of each kind; ComputationError if they are too large."""
        if self.is_damped:
            dense.refuse_beyond(dense.LARGEST_DAMPED, self.size, "dampers")
        else:
            cause = "constant forces" if self.leans else "inverted links" if self.stands else "joint springs"
            dense.refuse_beyond(dense.LARGEST_UNDAMPED, self.size, cause)
        return assembled(self._columns, self.cart, gravity=1.0)

    @cached_property
    def D(self) -> Floats:
        """The damping matrix; only for damped scenes."""
        D = dampers(self._columns, self.cart)
        return D if self._modal is None else D + self._modal.T @ self._modal

    @cached_property
    def _modal(self) -> Floats | None:
        """C (R, size) with D_modal = CᵀC."""
        return None if self.ratio is None else modal_factor(*self.matrices, self.is_free, self.ratio)

    @property
    def _columns(self) -> Columns:
        return [(block, p) for block in self.blocks for p in range(block.size)]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return (1 if self.cart else 0) + sum(block.mass.size for block in self.blocks)

    @cached_property
    def is_damped(self) -> bool:
        """Whether the modes are complex."""
        return bool(self.cart and self.cart.damping > 0) or any(block.is_damped for block in self.blocks)

    @property
    def stands(self) -> bool:
        """Whether any link is inverted."""
        return any((block.sigma < 0).any() for block in self.blocks)

    @property
    def leans(self) -> bool:
        """Whether constant forces move the equilibrium."""
        return any(block.rest is not None for block in self.blocks)

    @cached_property
    def modes(self) -> dense.Eigen:
        """Eigenvalues, shapes, errors."""
        if self.is_singular and (self.stands or self.is_damped):
            raise ComputationError(dense.SINGULAR)
        modes = self._solved()
        return replace(modes, error=modes.error + self._turned_by_rounding) if self.leans else modes

    @property
    def _turned_by_rounding(self) -> float:
        """How far rounding may turn links (rad) whose equilibrium constant forces move, as near the balance of forces.

        M and K change with the cosines of their angles.
        """
        first = 1 if self.cart else 0
        held = np.abs(np.linalg.inv(self.matrices[1][first:, first:]))
        return float(8 * dense.EPS * (held @ self._terms[first:]).max())

    def _solved(self) -> dense.Eigen:
        M, K = self.matrices
        if self.is_damped:
            return quadratic.damped(M, K, self._terms, self._dampers, self._modal, free=self.is_free)
        if self.stands or self.leans:
            return dense.indefinite(M, K, free=self.is_free, terms=self._terms)
        return dense.undamped(M, K, free=self.is_free, singular=self.is_singular)

    @property
    def _terms(self) -> Floats:
        """Sums of the absolute terms of K's diagonal."""
        falling = [
            ((1 - block.sigma) * block.b if block.rest is None else block.rest.pull - block.rest.held).T.ravel()
            for block in self.blocks
        ]
        terms: Floats = np.diag(self.matrices[1]) + np.concatenate([np.zeros(1 if self.cart else 0), *falling])
        return terms

    @property
    def _dampers(self) -> quadratic.Dampers:
        """Cart to ground, link to the link above, and the drag of the links."""
        ground = [-1] if self.cart else []
        above = np.array(ground + [-1 if i == 0 else 0 for block, _ in self._columns for i in range(block.n)])
        above = np.where(above < 0, -1, np.arange(self.size) - 1)
        dashpot = [[self.cart.damping]] if self.cart else []
        strength = np.concatenate([*dashpot, *(b.damping[:, p] for b, p in self._columns)])
        if not any(block.drag.any() for block in self.blocks):
            return quadratic.Dampers(strength, above)
        drag, rows = drag_of(self._columns, self.cart)
        return quadratic.Dampers(strength, above, np.sqrt(drag)[:, None] * rows)

    @property
    def is_free(self) -> bool:
        """Whether nothing holds the cart."""
        return self.cart is not None and self.cart.stiffness == 0

    @cached_property
    def is_singular(self) -> bool:
        """Whether M is singular, by a massless cart over bobs."""
        return self.cart is not None and not self.leans and is_singular(self.blocks, self.cart)

    @cached_property
    def bare_accelerance(self) -> float:
        """Σ φ_x² over all finite modes (1/kg): (M⁻¹)_xx, where M is singular from the modes themselves."""
        if self.cart is None:
            return 1.0
        if self.leans:
            return float(np.linalg.inv(self.matrices[0])[0, 0])
        if not self.is_singular:
            return 1.0 / bare_mass(self.blocks, self.cart)
        M, shape = self.matrices[0], self.modes.shape.real
        accelerance = float(np.sum(shape[0] ** 2 / _form(shape, M, shape)))
        return accelerance + (1.0 / float(M[0, 0]) if self.is_free else 0.0)

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """−ζω + iω√(1−ζ²)."""
        return self.modes.eigenvalue

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return self.modes.error

    def details(self, rows: Ints) -> Details:
        """Shapes, rotated so that the largest angle is real; quantities undefined for damped modes are NaN."""
        value, shape = self.modes.eigenvalue[rows], self._shapes(rows)
        M, K = self.matrices
        cart, angles = self._split(shape)
        modal_mass = _form(shape.conj(), M, shape).real
        terms = [(K, 0), (M, 2), *([(self.D, 1)] if self.is_damped else [])]
        push = sum(part @ shape * value**power for part, power in terms)
        size = sum(np.abs(part) @ np.abs(shape) * np.abs(value) ** power for part, power in terms)
        energies = per_copy(self._energies(cart, angles), self.counts)
        return Details(
            modal_mass=modal_mass,
            momentum=np.full(len(rows), np.nan) if self.is_damped else self._momentum(cart, angles, -(value**2).real),
            cart=cart,
            participation=self._participation(shape, value),
            kappa=self._kappa(shape, value),
            residual=(np.abs(push) / np.where(size > 0, size, 1.0)).max(0),
            angles=angles,
            shares=tuple(part / modal_mass for part in energies),
        )

    def _shapes(self, rows: Ints) -> Numbers:
        """(size, R), real without dampers; a cart that moves no more than rounding is still."""
        first = 1 if self.cart else 0
        shape = dense.in_phase(self.modes.shape[:, rows], first)
        noise = 4 * len(shape) * dense.EPS * np.abs(shape).max(0)
        shape[:first] = np.where(np.abs(shape[:first]) > noise, shape[:first], 0.0)
        return shape if self.is_damped else shape.real

    def _participation(self, shape: Numbers, value: NDArray[np.complex128]) -> Floats:
        if not self.cart:
            return np.zeros(len(value))
        damping = _form(shape, self.D, shape) if self.is_damped else 0.0
        slope = 2 * value * _form(shape, self.matrices[0], shape) + damping
        residue: Floats = (value * shape[0] ** 2 / slope).real / self.bare_accelerance
        return np.where((value.imag > 0) | (not self.is_damped), 2 * residue, residue)

    def _kappa(self, shape: Numbers, value: NDArray[np.complex128]) -> Floats:
        """κ of the in-phase part of each shape: exact without dampers, to first order in light ones.

        About an equilibrium that constant forces have moved there are forces of odd order, too: NaN.
        """
        if self.leans:
            return np.full(len(value), np.nan)
        in_phase, omega = shape.real, np.abs(value)
        cart, angles = self._split(in_phase)
        modal_mass = _form(in_phase, self.matrices[0], in_phase)
        parts = [quartic(b, omega**2, cart, angle).sum(0) for b, angle in zip(self.blocks, angles, strict=True)]
        kappa = coefficient(np.sum(parts, axis=0), modal_mass, omega**2, largest_angle(angles))
        light = (np.abs(value.real) < LIGHT * omega) & (np.abs(shape.imag).max(0) < LIGHT * np.abs(in_phase).max(0))
        return np.where(light, kappa, np.nan)

    def _momentum(self, cart: Numbers, angles: tuple[Numbers, ...], x: Floats) -> Floats:
        if self.cart:
            held: Floats = self.cart.stiffness * cart.real / x
            return held
        whole: Floats = ((self.blocks[0].across * self.blocks[0].b)[:, :, None] * angles[0].real).sum((0, 1))
        return whole

    def _split(self, shape: Numbers) -> tuple[Numbers, tuple[Numbers, ...]]:
        """The cart (R,) and the angles (n, P, R) of each block."""
        first = 1 if self.cart else 0
        parts = np.split(shape[first:], np.cumsum([block.mass.size for block in self.blocks])[:-1])
        angles = tuple(
            part.reshape(block.size, block.n, -1).swapaxes(0, 1) for part, block in zip(parts, self.blocks, strict=True)
        )
        return (shape[0] if self.cart else np.zeros(shape.shape[1])), angles

    def _energies(self, cart: Numbers, angles: tuple[Numbers, ...]) -> tuple[Floats, ...]:
        """The energies of the real and of the imaginary part, added."""
        energies = []
        for block, angle in zip(self.blocks, angles, strict=True):
            turn = angle * (block.across * block.length)[:, :, None]
            parts = [(cart.real, turn.real), (cart.imag, turn.imag)]
            if block.sinking is not None:
                sunk = angle * (block.sinking * block.length)[:, :, None]
                parts += [(0 * cart.real, sunk.real), (0 * cart.real, sunk.imag)]
            energies.append(sum((kinetic(block, joints(y, a), a) for y, a in parts), start=np.zeros(turn.shape)))
        return tuple(energies)


def _form(left: Numbers, S: Floats, right: Numbers) -> Numbers:
    """φᵀ S ψ of columns φ and ψ, (R,)."""
    products: Numbers = np.einsum("ir,ir->r", left, S @ right)
    return products


def dampers(columns: Columns, cart: CartNumbers | None) -> Floats:
    """D of these pendula side by side."""
    _, _, D = on_rail(columns, cart).matrices
    return np.asarray(D)


def drag_of(columns: Columns, cart: CartNumbers | None) -> tuple[Floats, Floats]:
    """The linear drag (N s/m) of every link with any, (R,), and the displacement of its centre, rows (R, size).

    Of links that neither hang nor stand straight there is a second row for each, the displacement downwards.
    """
    squares = on_rail(columns, cart)
    dragged = [each for part in squares.damping if part.kind in (DRAG, DRAG_DOWN) for each in part.each]
    rows = np.zeros((len(dragged), squares.n))
    for entries, (_, row, _) in zip(rows, dragged, strict=True):
        entries[list(row)] = list(row.values())
    return np.array([size for *_, size in dragged]), rows
