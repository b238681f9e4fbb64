"""The coupling of pendula through the cart: families of modes, splitting and beats, and limits of the cart's mass.

Pendula with a common fixed-base frequency ω_r form family r: their combinations that do not push the cart
stay at ω_r, and one more moves it, at a zero of the dynamic mass (`modal.coupling.dynamic_mass`),

    Δω = ω_zero − ω_r,    beat period 2π/Δω.

With m_r the dynamic mass at ω_r of everything but the family itself and μ_r the family's modal effective mass, the
coupling strength ε_r = μ_r/m_r gives Δω ≈ ½ ε_r ω_r to first order; for N equal simple pendula on a free cart of mass
m_c it is N m/m_c, and ω_zero = ω_r √(1 + ε_r) is exact.  With a heavy cart every mode approaches its pole, with a light
one the zeros of m_dyn − m_c.  In space all of this is the motion along the rail; across it there is no coupling.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, sqrt

import numpy as np

from modal.assembly import Rig, rig_of
from modal.coupling.damping import Damped, damped_modes, negative_damping
from modal.coupling.dynamic_mass import DynamicMass
from modal.coupling.exchange import (
    LEAST_SHARE_OF_BEATS,
    STRONG,
    UNEVEN,
    EnergyExchange,
    Transfer,
    energy_exchanges,
    transfer,
)
from modal.coupling.families import FamilyRow, family_cells, family_name, mode_words
from modal.coupling.fixed_base import FixedBaseModes, fixed_base_modes
from modal.coupling.numbering import Numbered
from modal.coupling.reduced import reduced
from modal.coupling.structures import StructureCoupling
from modal.eigen import at_infinity, degenerate_modes
from modal.errors import ComputationError
from modal.report import HTML_ROWS, Displayed, Summary, counted
from modal.scene import Scene, name_of, require
from modal.scene.doors import checked
from modal.types import Floats, Ints

MOST_POLES = 10_000
MISSED = 1e-6
"""Largest relative error of the sum rule."""
FAR = 0.2
"""Relative difference of first order from the splitting above which m_r must vary."""
ROUGH = 0.02
"""Relative difference of a splitting from that with a constant m_r above which both are only a guide."""


@dataclass(frozen=True)
class CartMode:
    """A mode that moves the cart: `omega` (rad/s), and its limits for extreme cart masses.

    `light` is ω as m_c → 0, infinite where the mode is lost, `heavy` as m_c → ∞ (rad/s), `participation` the share in
    the cart's velocity just after a push.  `family` counts from 0; None for the cart oscillating on its own spring.
    """

    omega: float
    participation: float
    light: float
    heavy: float
    family: int | None


@dataclass(frozen=True, repr=False)
class Family(Displayed):
    """Fixed-base modes of one frequency `omega` (rad/s): `members` are indices into `FixedBaseModes`.

    There are `fold` of them in all, so that fold − 1 combinations leave the cart still; `mass` is their modal effective
    mass μ_r, `rest` the dynamic mass m_r of everything else at ω_r (kg), infinite on a fixed support.  `cart_mode` is
    the index of the mode that moves the cart and `splitting` its Δω (rad/s); None where there is none.  `exchange`
    describes the energy of one pendulum released alone; None where there is only one, where first order does not hold,
    and where the joints damp some of the pendula faster than others.
    """

    omega: float
    members: tuple[int, ...]
    fold: int
    mass: float
    rest: float
    cart_mode: int | None
    splitting: float | None
    exchange: Transfer | None = None

    @property
    def strength(self) -> float:
        """ε_r = μ_r/m_r, negative just above another pole or the cart's spring, infinite where nothing else resists."""
        return self.mass / self.rest if self.rest else inf

    @property
    def first_order(self) -> float:
        """Δω (rad/s) where m_r changes little from ω_r to the zero, ½ ε_r ω_r."""
        return self.strength * self.omega / 2

    @property
    def is_first_order(self) -> bool:
        """Whether the coupling is weak enough and m_r nearly constant from the pole to the zero."""
        split = self.splitting or 0.0
        return abs(self.strength) <= STRONG and abs(self.first_order - split) <= FAR * abs(split)

    @property
    def is_rough(self) -> bool:
        """Whether a nearby family interferes: m_r varies from the pole to the zero, not too much for first order."""
        steady, split = self.omega * (sqrt(max(0.0, 1 + self.strength)) - 1), self.splitting or 0.0
        return abs(steady - split) > ROUGH * abs(split)

    @property
    def beat(self) -> float | None:
        """2π/|Δω| (s), in which energy passes from one pendulum of the family to the others and back; None if none."""
        passes = self.exchange and self.exchange.beats and self.exchange.most > LEAST_SHARE_OF_BEATS
        return self.exchange.period if self.exchange and passes else None


@dataclass(frozen=True, eq=False, repr=False)
class Coupling(Numbered, Displayed):
    """The coupling of a scene's pendula by its cart; for a fixed support (no coupling) `dynamic` has cart mass 0."""

    scene: Scene
    rig: Rig
    fixed_base: FixedBaseModes
    pole: Ints
    dynamic: DynamicMass

    def _summary(self) -> Summary:
        where = "" if self.on_cart else ", without a cart"
        title = (
            f"Coupling of {name_of(self.scene)}: {counted(len(self.families), 'family', 'families')} of modes{where}"
        )
        facts = [("mass felt by a slow push", f"{self.dynamic.at_rest:.6g} kg")]
        facts += [("by a fast one", f"{self.dynamic.at_infinity:.6g} kg")] if self.on_cart else []
        headings, cells = family_cells(self.rows(HTML_ROWS))
        return Summary(title, facts, headings, cells, len(self.families), words=frozenset({0, len(headings) - 1}))

    @property
    def on_cart(self) -> bool:
        """Whether there is a cart."""
        return self.rig.cart is not None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words."""
        return tuple(self.rig.names.values())

    @cached_property
    def families(self) -> tuple[Family, ...]:
        """The families, one for each distinct fixed-base frequency, ascending."""
        fold = np.bincount(self.pole, weights=self.fixed_base.count).astype(int)
        order = np.argsort(self.pole, kind="stable")
        members = np.split(order, np.cumsum(np.bincount(self.pole))[:-1])
        resting = self._rest()
        moved = {mode.family: number for number, mode in enumerate(self.cart_modes) if mode.family is not None}
        families = (
            Family(
                omega=float(omega),
                members=tuple(members[r].tolist()),
                fold=int(fold[r]),
                mass=float(self.dynamic.mass[r]),
                rest=float(resting[r]),
                cart_mode=moved.get(r),
                splitting=self.dynamic.zeros.above(moved[r], r + self._held) if r in moved else None,
            )
            for r, omega in enumerate(self.dynamic.omega)
        )
        return tuple(replace(family, exchange=self._exchange(family)) for family in families)

    def _exchange(self, family: Family) -> Transfer | None:
        """Two levels: one pendulum of the first kind, and all others of the family moving alike."""
        members, modes = list(family.members), self.fixed_base
        rate = modes.rate[members]
        uneven = np.ptp(rate) > UNEVEN * (abs(family.splitting or 0.0) + rate.max())
        if not (family.splitting and family.fold > 1 and family.is_first_order) or uneven:
            return None
        share = float(modes.mass[members[0]]) / family.mass
        drag = self.rig.cart.damping / family.omega if self.rig.cart else 0.0
        moved = family.splitting * family.rest / (family.rest - 1j * drag)
        lost = 1j * float(rate.mean())
        passed = transfer(lost + moved * share, lost + moved * (1 - share), moved * sqrt(share * (1 - share)))
        return replace(passed, beats=passed.beats and lost.imag < family.omega)

    @cached_property
    def cart_modes(self) -> tuple[CartMode, ...]:
        """The modes that move the cart, ascending, except a free cart's rigid translation; none on a fixed support."""
        if not self.on_cart:
            return ()
        zeros = self.dynamic.zeros
        with np.errstate(divide="ignore"):
            push = 1 / zeros.modal_mass
        if not np.all(np.isfinite(push)):
            raise ComputationError("the modes that move this cart are beyond double precision")
        whole = float(push.sum()) + (0.0 if self._held else 1 / self.dynamic.at_rest)
        light = self.dynamic.with_cart(0.0).zeros.omega.tolist()
        heavy = np.sqrt(zeros.square).tolist()
        # The mode with most of its potential energy in the cart's spring, k x²/(φᵀMφ ω²), is the cart's own.
        leading = int((push / zeros.omega**2).argmax()) if self._held else -1
        return tuple(
            CartMode(
                omega=float(omega),
                participation=float(push[j]) / whole,
                light=light[j] if j < len(light) else inf,
                heavy=heavy[j],
                family=None if j == leading else j - (self._held and j > leading),
            )
            for j, omega in enumerate(zeros.omega)
        )

    @cached_property
    def pairs(self) -> tuple[EnergyExchange, ...]:
        """Pairs of modes of different pendula, those that exchange most energy first."""
        return (
            energy_exchanges(self.fixed_base, self.dynamic, self.pole, self.rig.cart.damping) if self.rig.cart else ()
        )

    @cached_property
    def damped(self) -> tuple[Damped, ...]:
        """The damping and excitation of each mode."""
        return damped_modes(self.rig, negative_damping(self.scene, self.rig))

    def rows(self, most: int | None = None) -> list[FamilyRow]:
        """The table of families, or its first lines."""
        return [self._row(index, family) for index, family in enumerate(self.families[:most])]

    def _row(self, index: int, family: Family) -> FamilyRow:
        moving = None if family.cart_mode is None else self.cart_modes[family.cart_mode].omega
        if not self.on_cart:
            modes = mode_words(None, self.number(family.omega))
        else:
            still = self.number(family.omega) if family.fold > 1 else None
            modes = mode_words(still, None if moving is None else self.number(moving), family.fold - 1)
        return FamilyRow(
            family=family_name(index),
            omega=family.omega,
            mass=family.mass,
            strength=family.strength if self.on_cart else None,
            splitting=family.splitting,
            beat=family.beat,
            share=family.exchange.most if family.exchange else None,
            modes=modes,
            fold=family.fold,
        )

    def residual(self) -> float:
        """Relative error of the total mass from modal effective and residual masses, two independent routes."""
        hanging = sum(float(np.sum(block.mass.sum(0) * block.count)) for block in self.rig.blocks)
        return abs(self.dynamic.residual + float(self.dynamic.mass.sum()) - hanging) / hanging

    def swept(self, masses: Floats) -> Floats:
        """ω (len(masses), Z) in rad/s of the modes that move the cart, for carts of these masses (kg) above 0."""
        return np.array([self.dynamic.with_cart(float(mass)).zeros.omega for mass in masses])

    @property
    def _held(self) -> int:
        """1 if a spring holds the cart, which adds a pole at 0."""
        return int(self.dynamic.spring > 0)

    def _rest(self) -> Floats:
        """m_r (C,)."""
        if not self.on_cart:
            return np.full(len(self.dynamic.omega), np.inf)
        omega, index = self.dynamic.omega, np.arange(len(self.dynamic.omega))
        parts = np.array_split(index, 1 + len(omega) ** 2 // 1_000_000)
        return np.concatenate([self.dynamic(omega[p], left_out=index == p[:, None]) for p in parts])


@checked
def explain(scene: Scene) -> Coupling | StructureCoupling:
    """The coupling of the pendula of a scene through its cart, or through the structure that they hang from.

    Raises SceneError for inverted links and hoists, ComputationError beyond MOST_POLES distinct frequencies and where
    double precision misses the modal effective masses.
    """
    require(scene, "the explanation of the coupling")
    rig = rig_of(scene)
    if rig.structure:
        return StructureCoupling(scene, reduced(rig))
    if (size := sum(block.mass.size for block in rig.blocks)) > MOST_POLES:
        raise ComputationError(f"different pendula have {size} links: at most {MOST_POLES} are explained")
    with np.errstate(all="ignore"):
        modes = fixed_base_modes(rig)
        gathered = degenerate_modes((modes.omega**2,))
        pole = np.repeat(np.arange(len(gathered.first)), gathered.size)
        dynamic = DynamicMass(
            omega=modes.omega[gathered.first],
            mass=np.add.reduceat(modes.mass * modes.count, gathered.first),
            cart=rig.cart.mass if rig.cart else 0.0,
            residual=_residual(rig),
            spring=rig.cart.stiffness if rig.cart else 0.0,
        )
        coupling = Coupling(scene, rig, modes, pole, dynamic)
        if not np.all(np.isfinite(modes.rate**2)):
            raise ComputationError("the rates at which joint dampers drain these modes are beyond double precision")
    if not (missed := coupling.residual()) <= MISSED:
        raise ComputationError(f"modal effective masses are beyond double precision: their sum is off by {missed:.1e}")
    return coupling


def _residual(rig: Rig) -> float:
    """The mass of all pendula felt from inertia alone at the pivots (kg)."""
    natural, units = rig.natural()
    return units.mass * float(sum((at_infinity(block)[0] * block.count).sum() for block in natural.blocks))
