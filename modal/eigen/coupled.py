"""A cart with many different pendula: the fixed-base modes of each, coupled by the secular equation.

With the cart displaced by X, the fixed-base mode r of a pendulum follows with amplitude
x P_r X / (E_r (λ_r − x)), where P_r = φ_rᵀ b is its momentum, E_r = φ_rᵀ A φ_r and μ_r = P_r²/E_r its modal
effective mass.  Equal λ_r are one pole.  With α the residual mass of a pendulum, its momentum and twice its energy over
ω² are sums over its modes, X (α + Σ μ_r λ_r/(λ_r − x)) and X² (α + Σ μ_r λ_r²/(λ_r − x)²): nothing cancels where a
light cart moves under pendula that stay in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.assembly import Block, CartNumbers
from modal.eigen.chains import CartProblem, ChainShapes, bare_mass, fixed_shapes
from modal.eigen.counts import Built, counted
from modal.eigen.degenerate import DegenerateModes
from modal.eigen.recursion import at_infinity, joints, kinetic
from modal.eigen.secular import Poles, Roots, solve
from modal.eigen.seeds import seed_matrices
from modal.types import Floats, Ints

CHUNK = 100_000
LIGHTEST = 1e-290
"""Least weight of a pole: a lighter one changes no digit of any root, and its products underflow."""


@dataclass(frozen=True, eq=False)
class _Own:
    """A block's fixed-base modes: momenta and modal masses (n modes, P), turns (n links, n modes, P)."""

    momentum: Floats
    modal_mass: Floats
    turn: Floats


@dataclass(frozen=True, eq=False)
class CoupledPendula:
    """Chains that share a cart, counts folded into their masses, with their squares `fixed` (n, P)."""

    blocks: tuple[Block, ...]
    cart: CartNumbers
    fixed: tuple[Floats, ...]
    clusters: DegenerateModes
    route = "secular equation"
    slack = 4
    dense_error = 0.0

    @property
    def built(self) -> Built:
        """The distinct fixed-base modes of the pendula, and the cart."""
        poles = len(self.clusters.first)
        shapes = vars(self).get("modes", ())
        squares = tuple(("own shapes", b.n, b.size) for b, _ in zip(self.blocks, shapes, strict=False) if b.n > 1)
        return Built(f"cart and {counted(poles, 'pole')}", 1, poles + 1, squares)

    @cached_property
    def modes(self) -> tuple[_Own, ...]:
        """Fixed-base modes of every block."""
        return tuple(_own_modes(block, square) for block, square in zip(self.blocks, self.fixed, strict=True))

    @cached_property
    def poles(self) -> Poles:
        """One pole for each cluster, after that of the spring."""
        pairs = zip(self.modes, self.fixed, strict=True)
        weight = np.concatenate([(modes.momentum**2 / modes.modal_mass * x).ravel() for modes, x in pairs])
        weight = np.maximum(np.add.reduceat(weight[self.clusters.order], self.clusters.first), LIGHTEST)
        square, spring = self.clusters.square, self.cart.stiffness
        if spring > 0:
            square, weight = np.append(0.0, square), np.append(spring, weight)
        return Poles(square, weight, bare_mass(self.blocks, self.cart))

    @cached_property
    def roots(self) -> Roots:
        """The modes that move the cart, as offsets from the nearest pole."""
        return solve(self.poles)

    @cached_property
    def squares(self) -> Floats:
        """ω² of every mode that moves the cart, ascending."""
        return self.poles.square[self.roots.anchor] + self.roots.offset

    def shapes(self, rows: Ints) -> ChainShapes:
        """Shapes of these modes."""
        x = self.squares[rows]
        amplitudes = [
            (modes.momentum / modes.modal_mass)[..., None] * x / distance
            for modes, distance in zip(self.modes, self._distances(rows), strict=True)
        ]
        cart = 1.0 / np.maximum(1.0, np.max([np.abs(part).max((0, 1)) for part in amplitudes], axis=0))
        turns = tuple(
            np.einsum("imp,mpr->ipr", modes.turn, part * cart)
            for modes, part in zip(self.modes, amplitudes, strict=True)
        )
        felt, twice = (self._sums(rows, cart, power) for power in (1, 2))
        energies = tuple(
            _scaled_to(kinetic(block, joints(cart, a), a), whole)
            for block, a, whole in zip(self.blocks, turns, twice, strict=True)
        )
        modal_mass = self.cart.mass * cart**2 + sum(part.sum((0, 1)) for part in energies)
        held = self.cart.stiffness / x * cart
        push = self.cart.mass * cart + sum(part.sum(0) for part in felt) - held
        return ChainShapes(cart, turns, energies, modal_mass, held, np.abs(push * cart) / modal_mass)

    def _sums(self, rows: Ints, cart: Floats, power: int) -> list[Floats]:
        """Xᵖ (α + Σ μ_r (λ_r/(λ_r − x))ᵖ) of every pendulum for a power p, for each block (P, R); X is `cart` (R,)."""
        sums = []
        for block, modes, squares, distance in zip(
            self.blocks, self.modes, self.fixed, self._distances(rows), strict=True
        ):
            weight = (modes.momentum**2 / modes.modal_mass)[..., None]
            still, moved = at_infinity(block)[0][:, None], squares[..., None] * (cart / distance)
            sums.append(still * cart**power + (weight * moved**power).sum(0))
        return sums

    def _distances(self, rows: Ints) -> list[Floats]:
        """λ_r − x of every fixed-base mode, for each block (n modes, P, R), with full relative accuracy."""
        anchor, offset = self.roots.anchor[rows], self.roots.offset[rows]
        square = self.poles.square[len(self.poles.square) - len(self.clusters.first) :]
        apart = square[:, None] - self.poles.square[anchor] - offset
        distance = np.empty((len(self.clusters.order), len(rows)))
        distance[self.clusters.order] = np.repeat(apart, self.clusters.size, axis=0)
        ends = np.cumsum([squares.size for squares in self.fixed])[:-1]
        parts = zip(np.split(distance, ends), self.fixed, strict=True)
        return [part.reshape(*squares.shape, len(rows)) for part, squares in parts]


class Counted(CoupledPendula):
    """`CoupledPendula` with few links, its frequencies found by the effective mass."""

    route = "effective mass"
    slack = 1

    @property
    def built(self) -> Built:
        """The same modes and cart, and the matrix of the whole scene."""
        built, links = super().built, sum(block.mass.size for block in self.blocks)
        return built._replace(matrices=(*seed_matrices(links, 1), *built.matrices))

    @cached_property
    def squares(self) -> Floats:
        """ω² of every mode that moves the cart, ascending."""
        held = 1 if self.cart.stiffness > 0 else 0
        return CartProblem(self.blocks, self.cart, self.clusters.inside + held).squares


def _own_modes(block: Block, square: Floats) -> _Own:
    """The fixed-base modes, computed with a bounded amount of memory in addition to the results."""
    column, x = np.broadcast_to(np.arange(block.size), square.shape).ravel(), square.ravel()
    step = max(1, CHUNK // block.n)

    def kept(part: slice) -> tuple[Floats, Floats, Floats]:
        motion = fixed_shapes(block.take(column[part]), x[part])
        return motion.momentum, motion.modal_mass, motion.turns[0][:, 0]

    pieces = [kept(slice(start, start + step)) for start in range(0, x.size, step)]
    momentum, modal_mass, turn = (np.concatenate(parts, axis=-1) for parts in zip(*pieces, strict=True))
    shape = square.shape
    return _Own(momentum.reshape(shape), modal_mass.reshape(shape), turn.reshape(block.n, *shape))


def _scaled_to(energies: Floats, whole: Floats) -> Floats:
    """A chain's energies link by link (n, P, R), rescaled to their known sum (P, R)."""
    total = energies.sum(0)
    return energies * np.where(total > 0, whole / np.where(total > 0, total, 1.0), 0.0)
