"""Where modes come from: each source holds one family of equal structure and gives shapes for any of its rows.

    rigid          a free cart's translation, ω = 0, exact
    alone          pendula on a support that does not move for them: a fixed one, across the rail, or because equal
                   pendula in antiphase hold the cart still
    together       one pendulum of each kind, as heavy as all its copies, and the cart
These are the structured forms; `modal.matrix_source` is for joint springs and dampers.  All in natural units.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log2
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from modal.amplitude import coefficient, quartic
from modal.chain import at_infinity
from modal.crowd import Crowd
from modal.effective import CartProblem, fixed_shapes, fixed_squares
from modal.rig import Block, Floats, Ints

ROUNDOFF = 2.0**-53


@dataclass(frozen=True, eq=False)
class Details:
    """What a table says about R modes, per unit of modal mass where that applies; NaN where it has no meaning.

    `angles` and `shares` hold, for every block of kinds (n, P), angles and kinetic energy shares (n, P, R) of one copy.
    """

    modal_mass: Floats
    effective_mass: Floats
    cart: NDArray[np.inexact]
    mobility: Floats
    kappa: Floats
    residual: Floats
    angles: tuple[NDArray[np.inexact], ...]
    shares: tuple[Floats, ...]


class Source(Protocol):
    """One family of modes: complex eigenvalues (iω when undamped) and relative error bounds, both (R,)."""

    @property
    def route(self) -> str:
        """The route in words."""

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """Eigenvalues."""

    @property
    def error(self) -> Floats:
        """Relative error bounds."""

    def details(self, rows: Ints) -> Details:
        """What a table says about these rows."""


def _structured_error(links: int, chains: int) -> float:
    """Bound on the relative error of ω: each step of a count perturbs the scene's data by a few roundings."""
    return (12 + 6 * links + log2(chains + 1)) * ROUNDOFF


@dataclass(frozen=True, eq=False)
class Rigid:
    """The rigid translation of everything on a free cart."""

    blocks: tuple[Block, ...]
    total_mass: float
    bare_mobility: float
    route = "exact"
    eigenvalue = np.zeros(1, dtype=complex)
    error = np.zeros(1)

    def details(self, rows: Ints) -> Details:
        """The one shape there is: the cart alone is displaced, every angle is zero."""
        zero = np.zeros(len(rows))
        whole = np.full(len(rows), self.total_mass)
        return Details(
            modal_mass=whole,
            effective_mass=whole,
            cart=zero + 1.0,
            mobility=1.0 / whole / self.bare_mobility,
            kappa=zero,
            residual=zero,
            angles=tuple(np.zeros((*b.mass.shape, len(rows))) for b in self.blocks),
            shares=tuple((b.mass / self.total_mass)[:, :, None] + np.zeros(len(rows)) for b in self.blocks),
        )


@dataclass(frozen=True, eq=False)
class Alone:
    """Every mode (row r, column p) of the chains of one block on a support that stands still for them."""

    block: Block
    route = "effective mass"

    @cached_property
    def squares(self) -> Floats:
        """ω², mode by mode and chain by chain: (n P,), row r n_columns + p."""
        return fixed_squares(self.block).ravel()

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """iω."""
        return 1j * np.sqrt(self.squares)

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return np.full(self.squares.shape, _structured_error(self.block.n, 1))

    def details(self, rows: Ints) -> Details:
        """One copy's shape; its own effective mass."""
        chains, x = self.block.take(rows % self.block.size), self.squares[rows]
        motion = fixed_shapes(chains, x)
        top = chains.constants[0]
        momentum = motion.turns[0][0, 0] * (top.k / x + top.q)
        energy = motion.energies[0].sum((0, 1))
        angle = motion.turns[0] / chains.length[:, None, :]
        gamma = quartic(chains, x[:, None], np.zeros(1), angle.swapaxes(1, 2))[:, 0]
        return Details(
            modal_mass=energy,
            effective_mass=momentum**2 / energy,
            cart=motion.cart,
            mobility=np.zeros(len(x)),
            kappa=coefficient(gamma, energy, x, largest_angle((angle,))),
            residual=motion.residual,
            angles=(angle,),
            shares=(motion.energies[0] / energy,),
        )


@dataclass(frozen=True, eq=False)
class Together:
    """One heavy pendulum of each kind and the cart, by effective mass or, for many kinds, by the secular equation."""

    blocks: tuple[Block, ...]
    counts: tuple[Ints, ...]
    problem: CartProblem | Crowd
    bare_mobility: float

    @property
    def route(self) -> str:
        """Which of the two it is."""
        return "effective mass" if isinstance(self.problem, CartProblem) else "secular equation"

    @cached_property
    def squares(self) -> Floats:
        """ω², ascending."""
        return self.problem.squares()

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """iω."""
        return 1j * np.sqrt(self.squares)

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        deepest, chains = max(block.n for block in self.blocks), sum(block.size for block in self.blocks)
        factor = 1 if isinstance(self.problem, CartProblem) else 4
        return np.full(self.squares.shape, factor * _structured_error(deepest, chains))

    def details(self, rows: Ints) -> Details:
        """Shapes in which all copies of a kind move alike."""
        x = self.squares[rows]
        motion = self.problem.shapes(rows) if isinstance(self.problem, Crowd) else self.problem.shapes(x)
        energy = self.problem.mass * motion.cart**2 + sum(part.sum((0, 1)) for part in motion.energies)
        angles = tuple(a / b.length[:, :, None] for a, b in zip(motion.turns, self.blocks, strict=True))
        gamma = sum(
            quartic(block, x, motion.cart, angle).sum(0) for block, angle in zip(self.blocks, angles, strict=True)
        )
        return Details(
            modal_mass=energy,
            effective_mass=(self.problem.stiffness * motion.cart / x) ** 2 / energy,
            cart=motion.cart,
            mobility=motion.cart**2 / energy / self.bare_mobility,
            kappa=coefficient(gamma, energy, x, largest_angle(angles)),
            residual=motion.residual,
            angles=angles,
            shares=per_copy(motion.energies, energy, self.counts),
        )


def bare_mobility(blocks: tuple[Block, ...], cart: tuple[float, float, float]) -> float:
    """Σ φ_x² over all finite modes (1/kg): (M⁻¹)_xx = 1/α, or γ/β² where M is singular (see `at_infinity`)."""
    alpha, beta, gamma = (float(sum(map(np.sum, parts))) for parts in zip(*map(at_infinity, blocks), strict=True))
    return 1.0 / (cart[0] + alpha) if cart[0] + alpha > 0 else gamma / (cart[2] + beta) ** 2


def largest_angle(angles: tuple[NDArray[np.inexact], ...]) -> Floats:
    """Max |θ| (R,) over all links."""
    found: Floats = np.max([np.abs(angle).max((0, 1)) for angle in angles], axis=0)
    return found


def per_copy(energies: tuple[Floats, ...], total: Floats, counts: tuple[Ints, ...]) -> tuple[Floats, ...]:
    """Energy shares of one copy, from the energies of `counts` copies folded together."""
    return tuple(part / total / count[:, None] for part, count in zip(energies, counts, strict=True))
