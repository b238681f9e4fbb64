"""Dynamic mass for a force on the cart, over frequency, and the resulting families of pendula.

    m_dyn(ω) = m_c − k_c/ω² + m_res + Σ_r μ_r ω_r²/(ω_r² − ω²)

over the fixed-base frequencies ω_r of all pendula, μ_r the total modal effective mass at ω_r and m_res the residual
mass; a force F on the cart accelerates it by F/m_dyn. Its poles are the antiresonances of the cart, its zeros the modes
that move it. Near a pole ω_r² − ω² is evaluated as (ω_r − ω)(ω_r + ω), and a zero is stored as an offset from the
nearest pole (`modal.eigen.secular`), so that neither loses digits however close the two are. The same holds for any
structure of one coordinate on which pendula exert only forces.

A mode with square x moves the coordinate by 1 and the pendula of a family by a = x h/(ω_r² − x).  Its potential energy
is x = (k + Σ ω_r² a²)/φᵀMφ: it belongs to the family, or to the coordinate on its spring, with the largest share of
that.  On a fixed support, with uncoupled pendula, there are families without modes that move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign, inf, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modal.assembly import Block
from modal.coupling.families import CHANGE_OF_FIRST_ORDER, STRONG_COUPLING, FamilyBranch
from modal.coupling.reduced import ReducedStructure
from modal.eigen import LIGHTEST, MOST_COORDINATES, Poles, at_infinity, degenerate_modes, inertial_mass, solve
from modal.errors import ComputationError
from modal.modes import pair_rows
from modal.report import Displayed
from modal.types import NOISE_OF_SUM, NUMBERS_IN_CHUNK, Booleans, Floats, Ints

Other = tuple[float, Floats]
FALLS = "the structure does not stand on its own: it falls over, and nothing swings about it"


@dataclass(frozen=True, eq=False, repr=False)
class Zeros(Displayed):
    """Z natural frequencies of modes that move the cart, ascending, zero j above pole j of `square` (rad²/s²).

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

    def distance(self, zero: int, pole: int) -> float:
        """ω_zero − ω_pole (rad/s), to full relative accuracy."""
        difference = (self.square[self.anchor[zero]] - self.square[pole]) + self.offset[zero]
        return float(difference / (self.omega[zero] + np.sqrt(self.square[pole])))

    @cached_property
    def modal_mass(self) -> Floats:
        """φᵀMφ (Z,) in kg of the modes in which the cart moves by 1: ω² dm_dyn/d(ω²); infinite if it hardly does."""
        mass = np.empty(len(self.anchor))
        size = max(1, NUMBERS_IN_CHUNK // len(self.square))
        for start in range(0, len(mass), size):
            part = slice(start, start + size)
            differences = (self.square - self.square[self.anchor[part], None]) - self.offset[part, None]
            with np.errstate(over="ignore", divide="ignore"):
                mass[part] = (self.weight / differences / differences).sum(1) * self.omega[part] ** 2
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
        """The limit at high frequency (kg): the masses of the cart and of the residual."""
        return self.cart + self.residual

    @property
    def at_rest(self) -> float:
        """The total mass (kg), the limit at ω = 0 without a spring on the cart."""
        return self.at_infinity + float(self.mass.sum())

    def __call__(self, omega: ArrayLike, left_out: Booleans | None = None) -> Floats:
        """m_dyn (W,) in kg at ω (W,) in rad/s, infinite on a pole; without the poles marked in `left_out` (W, C)."""
        at = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        mass, size = np.empty(len(at)), max(1, NUMBERS_IN_CHUNK // max(1, len(self.omega)))
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            for start in range(0, len(at), size):
                part = slice(start, start + size)
                w = at[part, None]
                terms = self.mass * (self.omega / (self.omega - w)) * (self.omega / (self.omega + w))
                none = self.mass == 0 if left_out is None else left_out[part] | (self.mass == 0)
                mass[part] = np.where(none, 0.0, terms).sum(1)
            spring_part = self.spring / at / at if self.spring else 0.0
        return self.at_infinity - spring_part + mass

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


@dataclass(frozen=True)
class CartMode:
    """A mode that moves the cart: `omega` (rad/s), and its limits for extreme cart masses.

    `light` is ω as m_c → 0, infinite if the mode is lost, `heavy` as m_c → ∞ (rad/s), `participation` the share in
    the cart's velocity just after a push.  `family` counts from 0; None for the cart oscillating on its own spring.
    """

    omega: float
    participation: float
    light: float
    heavy: float
    family: int | None


@dataclass(frozen=True, eq=False)
class SecularEquation:
    """Modes of pendula on at most one coordinate, of own mode `unit` over it, with `damping` on it (N s/m).

    `as_one_part` says that all pendula belong to one part, including those that exert no force on it; `lost` (K,) are
    the decay rates (1/s) of pendula alone.
    """

    reduced: ReducedStructure
    dynamic: DynamicMass
    as_one_part: bool
    unit: float
    damping: float
    decay_rates: Floats

    @cached_property
    def members(self) -> tuple[Ints, ...]:
        """The fixed-base modes of every family, ascending: those of one frequency that the coordinate joins."""
        modes = self.reduced.fixed_base
        groups = degenerate_modes((modes.omega**2,))
        part_numbers = 1 + modes.kind
        part = np.zeros_like(part_numbers) if self.as_one_part else np.where(self._pushes, 0, part_numbers)
        members = []
        for first, size in zip(groups.first, groups.size, strict=True):
            alike = np.sort(groups.order[first : first + size])
            members += [alike[part[alike] == number] for number in dict.fromkeys(part[alike].tolist())]
        return tuple(members)

    @property
    def _pushes(self) -> Any:
        return self.reduced.push.any(0)

    def still(self, r: int) -> int:
        """The number of combinations of different members of a family that move nothing else."""
        return len(self.members[r]) - int(self.poles[r] >= 0)

    @cached_property
    def poles(self) -> Ints:
        """The pole of every family; −1 of those that do not move the coordinate."""
        pushes = np.array([self.as_one_part or bool(self._pushes[members[0]]) for members in self.members])
        pushes &= self.reduced.d > 0
        return np.where(pushes, np.cumsum(pushes) - 1, -1)

    @property
    def _spring_poles(self) -> int:
        """1 if a spring holds the coordinate, which adds a pole at 0."""
        return int(self.dynamic.spring > 0)

    @cached_property
    def rest(self) -> Floats:
        """m_r (C,): the dynamic mass at every pole of everything except that pole."""
        omega, index = self.dynamic.omega, np.arange(len(self.dynamic.omega))
        parts = np.array_split(index, 1 + len(omega) ** 2 // 1_000_000)
        return np.concatenate([self.dynamic(omega[p], left_out=index == p[:, None]) for p in parts])

    @cached_property
    def owner(self) -> Ints:
        """The pole to which each zero belongs, by its share in the potential energy; −1 for the coordinate's own mode.

        Beyond MOST_COORDINATES poles both are in order.
        """
        zeros, dynamic, spring_poles = self.dynamic.zeros, self.dynamic, self._spring_poles
        count, omega = len(zeros.anchor), zeros.omega
        with np.errstate(all="ignore"):
            energy = dynamic.spring / omega / omega / zeros.modal_mass
            if len(dynamic.omega) > MOST_COORDINATES:
                leading, order = int(energy.argmax()) if spring_poles else count, np.arange(count)
                return np.where(order == leading, -1, order - (order > leading) * spring_poles)
            distances = (zeros.square[spring_poles:, None] - zeros.square[zeros.anchor]) - zeros.offset
            amplitudes = dynamic.omega[:, None] * np.sqrt(dynamic.mass[:, None] / zeros.modal_mass)
            shares = np.vstack([energy, (omega / distances * amplitudes) ** 2])[1 - spring_poles :]
        owner = np.full(count, -1)
        zeros_of_rows = pair_rows(np.nan_to_num(shares, posinf=1.0), np.ones(count, dtype=np.int64))
        for row, zero in enumerate(zeros_of_rows.tolist()):
            if zero >= 0:
                owner[zero] = row - spring_poles
        return owner

    @cached_property
    def branches(self) -> list[list[FamilyBranch]]:
        """Of every family the mode that moves the coordinate."""
        if not self.reduced.d:
            return [[] for _ in self.members]
        zeros, dynamic = self.dynamic.zeros, self.dynamic
        zero_of = {int(pole): zero for zero, pole in enumerate(self.owner.tolist())}
        amplitudes, at = (1 / np.sqrt(zeros.modal_mass)).tolist(), zeros.omega.tolist()
        rests, masses, omegas = self.rest.tolist(), dynamic.mass.tolist(), dynamic.omega.tolist()
        branches: list[list[FamilyBranch]] = []
        for members, pole in zip(self.members, self.poles.tolist(), strict=True):
            if pole < 0:
                branches.append([])
                continue
            rest, omega, pattern = rests[pole], omegas[pole], self.reduced.push[0, members]
            strength = masses[pole] / rest if rest else inf
            damping_factor = rest / (rest - 1j * self.damping / omega) if self.damping else 1.0
            moving, splitting, eta, zero = inf, inf, 0.0, zero_of.get(pole)
            if zero is not None:
                moving, splitting = at[zero], zeros.distance(zero, pole + self._spring_poles)
                eta = -copysign(amplitudes[zero], splitting * pattern[np.abs(pattern).argmax()])
                pattern = -pattern * eta * moving / splitting * (moving / (moving + omega)) if splitting else pattern
            motion = np.array([eta / self.unit])
            branches.append([FamilyBranch(strength, moving, splitting, motion, pattern, False, damping_factor, zero)])
        return branches

    @cached_property
    def others(self) -> tuple[Other, ...]:
        """ω and own amplitude of the modes that belong to the coordinate rather than to a family."""
        if not self.reduced.d:
            return ()
        zeros = self.dynamic.zeros
        rows = np.flatnonzero(self.owner < 0)
        swinging = [(float(zeros.omega[k]), np.array([1 / sqrt(zeros.modal_mass[k]) / self.unit])) for k in rows]
        drift = (0.0, np.array([1 / sqrt(self.dynamic.at_rest) / self.unit]))
        return tuple(swinging) if self._spring_poles else (drift, *swinging)

    @cached_property
    def cart_modes(self) -> tuple[CartMode, ...]:
        """The modes that move a cart, ascending, except a free cart's rigid translation; none without a cart.

        Raise ComputationError if one of them moves it too little for double precision.
        """
        if not self.as_one_part:
            return ()
        dynamic, zeros = self.dynamic, self.dynamic.zeros
        with np.errstate(divide="ignore"):
            push = 1 / zeros.modal_mass
        if not np.all(np.isfinite(push)):
            raise ComputationError("the modes that move this cart are beyond double precision")
        total = float(push.sum()) + (0.0 if dynamic.spring else 1 / dynamic.at_rest)
        light = [*dynamic.with_cart(0.0).zeros.omega.tolist(), *[inf] * len(push)]
        columns = (push / total).tolist(), light, np.sqrt(zeros.square).tolist(), self.owner.tolist()
        return tuple(
            CartMode(omega, share, low, high, None if owner < 0 else owner)
            for omega, share, low, high, owner in zip(zeros.omega.tolist(), *columns, strict=False)
        )

    def pulled(self, modes: tuple[int, int], *, with_dampers: bool = False) -> Any:
        """F of some own modes halfway between their frequencies: how the coordinate, and dampers, shift their ω².

        It fails with a LinAlgError if there is no other inertia.
        """
        at = list(modes)
        omega = self.reduced.fixed_base.omega[at]
        x = float(omega.prod())
        resists = float(self._without(modes, [sqrt(x)])[0])
        if not resists:
            raise np.linalg.LinAlgError("nothing else resists these modes")
        pushes = omega * (self.reduced.push[0, at] if self.reduced.d and isfinite(resists) else 0.0)
        if not with_dampers:
            return np.outer(pushes, pushes) / resists
        yields = 1 / (resists - 1j * self.damping / sqrt(x)) if isfinite(resists) else 0.0
        return np.outer(pushes, pushes) * yields + np.diag(2j * omega * self.decay_rates[at])

    def _without(self, modes: tuple[int, int], omega: Sequence[float]) -> Floats:
        """The dynamic mass (W,) at ω (W,) without the poles of two modes."""
        pole_of = {int(k): int(self.poles[r]) for r, members in enumerate(self.members) for k in members}
        left_out = np.isin(np.arange(len(self.dynamic.omega)), [pole_of[k] for k in modes])
        return self.dynamic(omega, left_out=np.repeat(left_out[None], len(omega), axis=0))

    def between(self, modes: tuple[int, int]) -> tuple[float, bool]:
        """The m (kg) between two modes, and whether it is steady over their frequencies: if not, others take part.

        A coupling beyond STRONG_COUPLING is never steady; without a cart it is infinite and steady.
        """
        if not self.as_one_part:
            return inf, True
        own_modes, at = self.reduced.fixed_base, list(modes)
        omega, mass = own_modes.omega[at], (own_modes.mass * own_modes.count)[at]
        m = float(self._without(modes, [sqrt(float(omega.prod()))])[0])
        with np.errstate(all="ignore"):
            shift = omega * mass / (2 * m) if m else np.full(2, inf)
            middle, detuning = float((omega + shift).mean()), float(np.diff(omega + shift)[0])
            swing = np.hypot(detuning / 2, np.sqrt(np.abs(shift.prod())))
            ends = np.array([*omega, middle - swing, middle + swing])
            end_masses = self._without(modes, [max(ends.min(), 0.0), max(ends.max(), 0.0)])
            steady = bool(np.all(np.abs(end_masses - m) <= CHANGE_OF_FIRST_ORDER * abs(m)))
        return m, steady and isfinite(m) and bool(mass.max() <= STRONG_COUPLING * abs(m))


def _residual_mass(block: Block) -> Floats:
    """The residual mass (P,) of a block at its pivots."""
    return inertial_mass(block) if block.rotor.any() else at_infinity(block)[0]


def dynamic_mass(reduced: ReducedStructure, *, as_one_part: bool) -> DynamicMass:
    """The dynamic mass of at most one coordinate; of a fixed support that of a massless cart in its place.

    Raise ComputationError for a coordinate with negative stiffness.
    """
    modes, rig = reduced.fixed_base, reduced.rig
    moves = reduced.along[:, 0] ** 2 if reduced.d else np.ones(len(reduced.kinds))
    mass = modes.mass * modes.count * moves[modes.kind]
    chosen = np.arange(len(mass)) if as_one_part or not reduced.d else np.flatnonzero(reduced.push.any(0))
    groups = degenerate_modes((modes.omega[chosen] ** 2,))
    natural, units = rig.natural()
    residual = np.concatenate([_residual_mass(block) * block.count for block in natural.blocks])
    carrier, spring = (float(S[0, 0]) if reduced.d else 0.0 for S in (reduced.own_inertia, reduced.own_stiffness))
    terms = float(reduced.hanging.elements.terms.sum()) if reduced.d else 0.0
    if spring < -NOISE_OF_SUM * terms:
        raise ComputationError(FALLS)
    first = chosen[groups.order[groups.first]] if len(chosen) else chosen
    return DynamicMass(
        omega=modes.omega[first],
        mass=np.add.reduceat(mass[chosen[groups.order]], groups.first) if len(chosen) else np.zeros(0),
        cart=carrier,
        residual=units.mass * float((residual * moves).sum()),
        spring=spring if spring > NOISE_OF_SUM * terms else 0.0,
    )
