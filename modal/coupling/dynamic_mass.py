"""The dynamic mass for a force on the cart, over frequency: the cart is still at its poles and moves at its zeros.

    m_dyn(ω) = m_c − k_c/ω² + m_res + Σ_r μ_r ω_r²/(ω_r² − ω²)

over the fixed-base frequencies ω_r of all pendula, μ_r the total modal effective mass at ω_r and m_res the residual
mass, which the pivots feel from inertia alone; a force F on the cart accelerates it by F/m_dyn.
Near a pole ω_r² − ω² is evaluated as (ω_r − ω)(ω_r + ω), and a zero is stored as an offset from the nearest pole
(`modal.eigen.secular`), so that neither loses digits however close the two are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modal.eigen import LIGHTEST, Poles, solve
from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Booleans, Floats, Ints

CHUNK = 2_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Zeros(Displayed):
    """Z frequencies at which the cart moves freely, ascending, zero j above pole j of `square` (rad²/s²).

    A spring to the ground is one more pole, at 0, before the others.  x_j = square[anchor[j]] + offset[j].
    """

    square: Floats
    weight: Floats
    anchor: Ints
    offset: Floats

    @cached_property
    def omega(self) -> Floats:
        """ω (Z,) in rad/s."""
        return np.sqrt(self.square[self.anchor] + self.offset)

    def above(self, zero: int, pole: int) -> float:
        """ω_zero − ω_pole (rad/s), to full relative accuracy."""
        apart = (self.square[self.anchor[zero]] - self.square[pole]) + self.offset[zero]
        return float(apart / (self.omega[zero] + np.sqrt(self.square[pole])))

    @cached_property
    def modal_mass(self) -> Floats:
        """φᵀMφ (Z,) in kg of the modes in which the cart moves by 1: ω² dm_dyn/d(ω²); infinite if it hardly does."""
        mass = np.empty(len(self.anchor))
        size = max(1, CHUNK // len(self.square))
        for start in range(0, len(mass), size):
            part = slice(start, start + size)
            apart = (self.square - self.square[self.anchor[part], None]) - self.offset[part, None]
            with np.errstate(over="ignore", divide="ignore"):
                mass[part] = (self.weight / apart / apart).sum(1) * self.omega[part] ** 2
        return mass


@dataclass(frozen=True, eq=False, repr=False)
class DynamicMass(Displayed):
    """Distinct poles `omega` (C,) in rad/s, ascending, with modal effective masses `mass` (C,) in kg.

    `cart` and `residual` are masses in kg, `spring` the cart's in N/m.
    """

    omega: Floats
    mass: Floats
    cart: float
    residual: float
    spring: float

    @property
    def at_infinity(self) -> float:
        """The limit at high frequency (kg): the cart, and the mass that the pivots feel from inertia alone."""
        return self.cart + self.residual

    @property
    def at_rest(self) -> float:
        """The total mass (kg), the limit at ω = 0 where no spring holds the cart."""
        return self.at_infinity + float(self.mass.sum())

    def __call__(self, omega: ArrayLike, left_out: Booleans | None = None) -> Floats:
        """m_dyn (W,) in kg at ω (W,) in rad/s, infinite on a pole; without the poles marked in `left_out` (W, C)."""
        at = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        felt, size = np.empty(len(at)), max(1, CHUNK // len(self.omega))
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            for start in range(0, len(at), size):
                part = slice(start, start + size)
                w = at[part, None]
                terms = self.mass * (self.omega / (self.omega - w)) * (self.omega / (self.omega + w))
                none = self.mass == 0 if left_out is None else left_out[part] | (self.mass == 0)
                felt[part] = np.where(none, 0.0, terms).sum(1)
            held = self.spring / at / at if self.spring else 0.0
        return self.at_infinity - held + felt

    def with_cart(self, mass: float) -> DynamicMass:
        """The dynamic mass for a cart of another mass (kg)."""
        return replace(self, cart=mass)

    @cached_property
    def zeros(self) -> Zeros:
        """The modes that move the cart, except a free cart's rigid translation at ω = 0."""
        square, weight = self.omega**2, np.maximum(self.mass * self.omega**2, LIGHTEST)
        if self.spring > 0:
            square, weight = np.append(0.0, square), np.append(self.spring, weight)
        if len(square) == 1 and self.at_infinity == 0:
            return Zeros(square, weight, np.zeros(0, dtype=np.int64), np.zeros(0))
        with np.errstate(all="ignore"):
            roots = solve(Poles(square, weight, self.at_infinity))
        if not np.all(np.isfinite(roots.offset)):
            raise ComputationError("the modes that move this cart are beyond double precision")
        return Zeros(square, weight, roots.anchor, roots.offset)
