"""Coupling of pendula by their supports: families of modes, splitting and beats, and limits of a cart's mass.

Coupled pendula with a common fixed-base frequency ω_r form family r: combinations without net force stay at ω_r, and
the others move it. On a cart that is one mode, at a zero of the dynamic mass (`modal.coupling.dynamic_mass`),

    Δω = ω_zero − ω_r,    beat period 2π/Δω.

With m_r the dynamic mass at ω_r of everything except the family itself and μ_r the family's modal effective mass, the
coupling strength ε_r = μ_r/m_r gives Δω ≈ ½ ε_r ω_r to first order; for N equal simple pendula on a free cart of mass
m_c it is N m/m_c, and ω_zero = ω_r √(1 + ε_r) is exact.  With a heavy cart every mode approaches its pole, with a light
one the zeros of m_dyn − m_c.  In space all of this is the motion along the rail; across it there is no coupling.

A structure with locked pendula has the modes K_s u = ω² (M_s + Σ m (ΦᵀΦ + ΨᵀΨ)) u; along them the dynamic mass is the
matrix −UᵀS(ω²)U/ω² (`modal.coupling.reduced`). One coordinate is solved by the secular equation
(`modal.coupling.dynamic_mass`), several by matrices (`modal.coupling.matrices`). Every mode belongs to the structure's
own mode, or to the family, with the largest share in its potential energy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite, sqrt
from typing import Any

import numpy as np

from modal.assembly import Rig, ratio_at, rig_of
from modal.coupling.damping import Damped, damped_modes, negative_damping
from modal.coupling.dynamic_mass import CartMode, DynamicMass, SecularEquation, dynamic_mass
from modal.coupling.families import (
    LEAST_SHARE_OF_BEATS,
    MOST_PAIRED_MODES,
    UNEVEN_DECAY_MIN,
    EnergyExchange,
    Family,
    FamilyBranch,
    FamilyRow,
    beats_of,
    exchange_among,
    family_name,
    mode_words,
    pair_exchange,
    passes_energy,
)
from modal.coupling.matrices import ReducedPencil, stable_pencil
from modal.coupling.reduced import FixedBaseModes, ReducedStructure, reduced, refuse_beyond
from modal.errors import ComputationError
from modal.modes import MOST_COMPARED, Modes, counterparts, moving_words, natural_modes
from modal.report import Displayed, TextResult
from modal.scene import Scene, require
from modal.scene.doors import checked
from modal.structure import Structure, slopes
from modal.types import Floats, Ints

MOST_POLES = 10_000
"""Limit: links of different pendula, refused beyond."""
SUM_RULE_ERROR_MAX = 1e-6
"""Tolerance: largest relative error of the sum of modal effective masses, refused beyond."""


@dataclass(frozen=True, eq=False, repr=False)
class StructureMode(Displayed):
    """A mode of the structure with locked pendula: `omega` (rad/s) and η by coordinates (d,).

    η is such that the point that moves most, of all pivots and centres of mass, moves by 1 m; `mass` (kg) is then its
    uᵀMu.  If no such point moves, the largest of η is 1, and the mass in its unit.
    """

    what = "Mode of the structure alone"
    shows = "omega: ω, rad/s; shape: shape; mass: modal mass"

    omega: float
    shape: Floats
    mass: float


@dataclass(frozen=True, eq=False, repr=False)
class Coupling(TextResult):
    """The coupling of a scene's pendula by the cart or the structure that they hang from, and by springs.

    `secular` is the dynamic mass if pendula are coupled through at most one coordinate; on a fixed support that of a
    massless cart in its place.

    >>> from modal import load
    >>> from modal.coupling import explain
    >>> found = explain(load("two-swings"))
    >>> found.words(found.modes[1].shape), found.families[0].still
    ('two swings in antiphase', 28)
    >>> [round(branch.omega, 6) for branch in found.families[0].branches]
    [9.944274, 10.028201]
    """

    scene: Scene
    reduced: ReducedStructure
    secular: DynamicMass | None
    writer = "modal.coupling.report:coupling_report"

    # ------------------------------------------------------------------------------------------- what hangs where

    @property
    def rig(self) -> Rig:
        """The pendula with their supports as a structure."""
        return self.reduced.rig

    @property
    def structure(self) -> Structure:
        """The supports of the pendula."""
        return self.reduced.hanging.structure

    @property
    def on_cart(self) -> bool:
        """Whether there is a cart, and no other structure."""
        return self.scene.cart is not None

    @property
    def noun(self) -> str:
        """The noun for the (possible) support of the pendula."""
        return "structure" if self.scene.is_structured else "cart"

    @property
    def is_coupled(self) -> bool:
        """Whether anything could couple pendula."""
        return bool(self.reduced.d or self.structure.springs)

    @property
    def joins_pendula(self) -> bool:
        """Whether any pendula are coupled: copies on one pivot are coupled by its motion."""
        d, kind = self.reduced.d, self.fixed_base.kind
        if self.secular:
            pushing = np.unique(kind[self.reduced.push.any(0)], return_index=True)[1]
            return int(self.fixed_base.count[self.reduced.push.any(0)][pushing].sum()) > 1
        parts = self.reduced.parts[d:]
        moves = ((self.reduced.K[d:, :d] != 0) | (self.reduced.M[d:, :d] != 0)).any(1)
        several = np.any(moves & (self.fixed_base.count > 1))
        return bool(several) or any(np.ptp(kind[parts == part]) > 0 for part in set(parts.tolist()))

    @property
    def fixed_base(self) -> FixedBaseModes:
        """The modes of every kind of pendulum alone, all else fixed."""
        return self.reduced.fixed_base

    @property
    def names(self) -> tuple[str, ...]:
        """The kinds of pendula in words, with their supports if there are several."""
        return self.reduced.names

    @cached_property
    def _mode_tables(self) -> tuple[Modes, Modes] | None:
        """The modes without dampers, and those of the table; None if the table is not available."""
        has_damping = self.scene.has_damping
        if has_damping and self.scene.n_links > MOST_COMPARED:
            return None
        try:
            table = natural_modes(self.scene)
            return natural_modes(self.scene.conservative) if has_damping else table, table
        except ComputationError:
            return None

    @cached_property
    def _table(self) -> tuple[Floats, Ints] | None:
        """ω of the modes without dampers and their numbers in the table; None if the table is not available."""
        if self._mode_tables is None:
            return None
        undamped_modes, table = self._mode_tables
        try:
            is_same = undamped_modes is table
            numbers = undamped_modes.number if is_same else 1 + counterparts(undamped_modes, table)
            return undamped_modes.omega, numbers
        except ComputationError:
            return None

    def number(self, omega: float) -> int | None:
        """The number in the table of the undamped mode of this frequency (rad/s), None if unknown."""
        if self._table is None:
            return None
        frequencies, numbers = self._table
        return int(numbers[np.abs(frequencies - omega).argmin()])

    # ------------------------------------------------------------------------------------------- the structure

    @cached_property
    def modes(self) -> tuple[StructureMode, ...]:
        """The structure's own modes, ascending, with locked pendula."""
        if not self.reduced.d:
            return ()
        square, shapes = stable_pencil(self.reduced.own_stiffness, self.reduced.hanging.inertia)
        modes = []
        for value, shape in zip(square.tolist(), shapes.T, strict=True):
            largest = shape[np.abs(shape).argmax()]
            scale = (self._farthest(shape) or abs(largest)) * np.sign(largest)
            modes.append(StructureMode(sqrt(value), shape / scale, 1 / float(scale) ** 2))
        return tuple(modes)

    def _farthest(self, shape: Floats) -> float:
        """How far the point of the structure goes that goes farthest."""
        phi, structure = self.reduced.hanging.phi, self.structure
        ways = [np.hypot(phi.rail @ shape, phi.down @ shape).max()]
        for k, carrier in enumerate(structure.carriers):
            if carrier.size and carrier.M is None:
                rows = slopes(structure, k, carrier.centre)
                ways.append(np.hypot(*(sum(shape[at] * value for at, value in row.items()) for row in rows)))
        return float(max(ways))

    @cached_property
    def basis(self) -> Floats:
        """U (d, d), the structure's own modes as columns over η."""
        d = self.reduced.d
        return np.column_stack([mode.shape for mode in self.modes]) if d else np.zeros((0, 0))

    def words(self, eta: Floats) -> str:
        """Return the moving parts of the structure in a motion η (d,): two carts in antiphase, board tilts."""
        return moving_words(self.structure, eta, np.diag(self.reduced.hanging.inertia))

    def stiffness(self, omega: float) -> Floats:
        """S (d, d) at ω (rad/s) over η: the dynamic stiffness of the structure, N/m for coordinates in m."""
        d, x = self.reduced.d, omega**2
        if self.secular and d:
            return -x * self.secular(omega)[:, None]
        direct = self.reduced.K[:d, :d] - x * self.reduced.M[:d, :d]
        return np.asarray(direct + self.reduced.elimination(range(d), x))

    def dynamic_matrix(self, omega: float) -> Floats:
        """The dynamic mass matrix −UᵀSU/ω² (d, d) in kg along the structure's own modes, at ω (rad/s)."""
        return np.asarray(-self.basis.T @ self.stiffness(omega) @ self.basis / omega**2)

    @property
    def dynamic(self) -> Any:
        """The dynamic mass of a cart, over ω; for a structure `dynamic_matrix`."""
        return self.dynamic_matrix if self.scene.is_structured else self.secular

    @property
    def fast(self) -> Floats:
        """The dynamic mass (d,) in kg of each own mode at high frequency: all except the modal effective masses."""
        pushes = self.reduced.push.T @ self.basis
        return np.asarray(np.array([mode.mass for mode in self.modes]) - (pushes**2).sum(0))

    def felt_masses(self, omega: Floats) -> Floats:
        """Return the dynamic mass (W, d) in kg of each own mode at ω (W,), the others free to move: 1/(m⁻¹)_ss.

        Its zeros are modes of the scene, its poles antiresonances of this motion.
        """
        masses = np.full((len(omega), self.reduced.d), np.nan)
        for row, value in zip(masses, omega.tolist(), strict=True):
            try:
                row[:] = 1 / np.diag(np.linalg.inv(self.dynamic_matrix(value)))
            except np.linalg.LinAlgError:
                continue
        return masses

    # -------------------------------------------------------------------------------------------- the families

    @cached_property
    def solver(self) -> SecularEquation | ReducedPencil:
        """The secular equation for one coordinate, matrices for several."""
        if self.secular is None:
            return ReducedPencil(self.reduced, self.basis, self.reduced.dampers(self.scene))
        damping, unit = self.reduced.own_damping.sum(), float(self.basis.sum()) or 1.0
        decay_rates = self.fixed_base.rate + self._decay_rates(self.fixed_base.omega)
        return SecularEquation(self.reduced, self.secular, self.on_cart, unit, float(damping), decay_rates)

    @cached_property
    def families(self) -> tuple[Family, ...]:
        """The families, one for each distinct fixed-base frequency of coupled pendula, ascending."""
        modes, solver = self.fixed_base, self.solver
        families = []
        for r, (members, branches) in enumerate(zip(solver.members, solver.branches, strict=True)):
            fold = int(modes.count[members].sum())
            pushes = self.reduced.push[:, members].T @ self.basis
            family = Family(
                omega=float(modes.omega[members[0]]),
                members=tuple(members.tolist()),
                fold=fold,
                still=fold - len(members) + solver.still(r),
                mass=float((modes.mass * modes.count)[members].sum()),
                masses=(pushes**2).sum(0),
                branches=tuple(branches),
            )
            families.append(self._with_exchange(family))
        return tuple(families)

    def _with_exchange(self, family: Family) -> Family:
        """With the energy of any one of its pendula released alone, where they form levels near each other."""
        if family.fold < 2 or not family.is_first_order:
            return family
        modes, members = self.fixed_base, list(family.members)
        rates = modes.rate[members]
        largest_splitting = max((abs(branch.splitting) for branch in family.branches), default=0.0)
        uneven = np.ptp(rates) > UNEVEN_DECAY_MIN * (largest_splitting + rates.max())
        if not largest_splitting or uneven:
            return family
        decay_rate = float(rates.mean() + self._decay_rates(np.array([family.omega]))[0])
        weights, levels = family.levels(modes.count[members], decay_rate)
        exchange = exchange_among(weights, levels)
        passes = exchange.beats and exchange.most > LEAST_SHARE_OF_BEATS and decay_rate < family.omega
        exchange = replace(exchange, beats=exchange.beats and decay_rate < family.omega)
        return replace(family, exchange=exchange, beats=beats_of(weights, levels) if passes else ())

    def _decay_rates(self, omega: Floats) -> Floats:
        """ζω (1/s) by the damping ratio of the scene."""
        return np.asarray(ratio_at(self.rig)(omega) * omega) if self.scene.damping_ratio else 0.0 * omega

    def beat(self, family: Family, branch: FamilyBranch) -> float | None:
        """2π/|Δω| (s) between a mode of a family and the nearest other one; None if energy does not come back."""
        if not family.beats:
            return None
        weights, levels = family.levels(self.fixed_base.count[list(family.members)], 0.0)
        place = family.branches.index(branch)
        gaps = [
            abs((levels[place] - level).real)
            for level, weight in zip(levels, weights, strict=True)
            if level != levels[place] and passes_energy(weights[place], weight)
        ]
        return float(2 * np.pi / min(gaps)) if gaps else None

    @property
    def structure_modes(self) -> tuple[tuple[float, Floats], ...]:
        """ω (rad/s) of the modes that belong to the structure rather than to a family, with η in its own modes."""
        return self.solver.others

    @cached_property
    def omega(self) -> Floats:
        """All different natural frequencies (rad/s), ascending."""
        unmoved_omega = [family.omega for family in self.families if family.still]
        moving = [branch.omega for family in self.families for branch in family.branches if branch.is_finite]
        return np.unique([*unmoved_omega, *moving, *(omega for omega, _ in self.structure_modes)])

    @property
    def cart_modes(self) -> tuple[CartMode, ...]:
        """The modes that move the cart, ascending, except a free cart's rigid translation; none without a cart."""
        return self.solver.cart_modes

    def omega_of_carts(self, masses: Floats) -> Floats:
        """ω (len(masses), Z) in rad/s of the modes that move the cart, for carts of these masses (kg) above 0."""
        assert self.secular
        return np.array([self.secular.with_cart(float(mass)).zeros.omega for mass in masses])

    def residual(self) -> float:
        """Relative error of the total mass from modal effective and residual masses, two independent routes."""
        assert self.secular
        hanging = sum(float(np.sum(block.mass.sum(0) * block.count)) for block in self.rig.blocks)
        return abs(self.secular.residual + float(self.secular.mass.sum()) - hanging) / hanging

    # ------------------------------------------------------------------------------------------- exchange, dampers

    @cached_property
    def pairs(self) -> tuple[EnergyExchange, ...]:
        """Pairs of own modes of different kinds, those that exchange most first; none of too many modes.

        A pair with no other inertia is rigidly coupled and omitted: it exchanges nothing.
        """
        count, kinds = len(self.fixed_base.omega), self.fixed_base.kind
        if count > MOST_PAIRED_MODES or not self.is_coupled:
            return ()
        pairs = [(a, b) for a in range(count) for b in range(a + 1, count) if kinds[a] != kinds[b]]
        exchanges = [pair for a, b in pairs if (pair := self._pair(a, b))]
        return tuple(sorted(exchanges, key=lambda pair: -pair.exchange.most))

    def _pair(self, a: int, b: int) -> EnergyExchange | None:
        modes, at = self.fixed_base, [a, b]
        try:
            free = self.solver.pulled((a, b))
            lossy = self.solver.pulled((a, b), with_dampers=True) if self.scene.has_damping else free
        except np.linalg.LinAlgError:
            return None
        detuning, coupling, strength, transfer = pair_exchange(modes.omega[at], modes.rate[at], free, lossy)
        families = [family for family in self.families if {a, b} & set(family.members)]
        mass, steady = self.solver.between((a, b))
        is_alone = steady and sum(len(family.members) for family in families) == 2
        coupling = abs(coupling) if isfinite(mass) else coupling
        return EnergyExchange(a, b, detuning, coupling, strength, mass, is_alone, transfer)

    @cached_property
    def damped_modes(self) -> tuple[Damped, ...]:
        """The damping and excitation of each mode that oscillates, ascending; `from_cart` is that of any structure."""
        if self.scene.is_structured:
            stable_pencil(self.reduced.own_stiffness, self.reduced.hanging.inertia)
        rig = rig_of(self.scene)
        names = dict(zip(rig.names.values(), self.names, strict=True))
        tables = () if self._mode_tables is None or rig.spatial else self._mode_tables
        spectra = [modes.spectrum if modes.rig.members == rig.members else None for modes in tables]
        modes = damped_modes(rig, negative_damping(self.scene, rig), *spectra)
        return tuple(replace(mode, kind=mode.kind and names[mode.kind]) for mode in modes)

    # ------------------------------------------------------------------------------------------------- the table

    def rows(self, limit: int | None = None) -> list[FamilyRow]:
        """The table of families, or of the first of them: a line for each mode that moves other things."""
        return [row for index, family in enumerate(self.families[:limit]) for row in self._rows(index, family)]

    def _rows(self, index: int, family: Family) -> Iterator[FamilyRow]:
        name, share = family_name(index), family.exchange.most if family.exchange else None
        has_number = family.still and (self.is_coupled or self.scene.is_structured)
        number = self.number(family.omega) if has_number else None
        on_structure = self.scene.is_structured
        if not family.branches:
            modes = (
                mode_words(number, None, family.still) if on_structure else mode_words(None, self.number(family.omega))
            )
            mass, moves = (None, "nothing else") if on_structure else (family.mass, "")
            yield FamilyRow(name, family.omega, mass, None, None, None, share, modes, moves, family.fold)
        for k, branch in enumerate(family.branches):
            moving = self.number(branch.omega) if branch.is_finite else None
            yield FamilyRow(
                family=name,
                omega=family.omega,
                mass=self.effective_mass(family, branch) if on_structure else family.mass,
                strength=branch.strength,
                splitting=branch.splitting if branch.is_finite else None,
                beat=self.beat(family, branch),
                share=None if k else share,
                modes=mode_words(None if k else number, moving, family.still),
                moves=self.motion_words(branch) if on_structure else "",
                fold=family.fold,
            )

    def motion_words(self, branch: FamilyBranch) -> str:
        """Return the moving parts of the structure in a mode, in words; empty without a structure."""
        if branch.still:
            return "structure still" if self.reduced.d else ""
        return self.words(self.basis @ branch.motion)

    def effective_mass(self, family: Family, branch: FamilyBranch) -> float | None:
        """Σ N (Γ Φ u)² (kg) of a family along the motion u of the structure in one of its modes.

        u is scaled as the structure's own modes are, by the point that moves most; None if the structure is at rest.
        """
        if branch.still:
            return None
        motion = self.basis @ branch.motion
        scale = self._farthest(motion) or float(np.abs(motion).max())
        pushes = self.reduced.push[:, list(family.members)].T @ motion / scale
        return float(pushes @ pushes)


@checked
def explain(scene: Scene) -> Coupling:
    """Analyse the coupling of a scene's pendula through its cart or through the structure from which they hang.

    Raise SceneError for inverted links and hoists, ComputationError beyond MOST_POLES distinct frequencies, or
    MOST_COORDINATES of a structure, and if double precision does not resolve the modal effective masses.
    """
    require(scene, "the explanation of the coupling")
    rig = rig_of(scene)
    if (size := sum(block.mass.size for block in rig.blocks)) > MOST_POLES:
        raise ComputationError(f"different pendula have {size} links: at most {MOST_POLES} are explained")
    with np.errstate(all="ignore"):
        structure = reduced(rig)
        if not np.all(np.isfinite(structure.fixed_base.rate**2)):
            raise ComputationError("the rates at which joint dampers drain these modes are beyond double precision")
        on_one = structure.d <= 1 and structure.only_pushes
        if not on_one:
            refuse_beyond(structure)
        secular = dynamic_mass(structure, as_one_part=scene.cart is not None) if on_one else None
        coupling = Coupling(scene, structure, secular)
    if not scene.is_structured and not (discrepancy := coupling.residual()) <= SUM_RULE_ERROR_MAX:
        raise ComputationError(
            f"modal effective masses are beyond double precision: their sum is off by {discrepancy:.1e}"
        )
    return coupling
