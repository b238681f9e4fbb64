"""Families of modes: their coupling, its strength, their beats, and the energy that pendula exchange.

Coupled pendula with one fixed-base frequency ω_r form family r. Those of their combinations that move nothing else stay
at ω_r; each other one, a branch, has a coupling strength ε and a mode of the scene near ω_r (1 + ε/2).

Modes a and b of different pendula, of fixed-base frequencies ω_a, ω_b and modal effective masses μ_a, μ_b, share a cart
with the dynamic mass m, the dynamic mass of everything else halfway between them. To first order in μ/m their slow
amplitudes obey i a' = H a with

    H_aa = ω_a (1 + μ_a/2m),    H_ab = g = √(μ_a μ_b ω_a ω_b)/2m,    δ = H_aa − H_bb,

so that of the energy given to one the other receives at most 4g²/(4g² + δ²), once in every 2π/√(4g² + δ²)
(two coupled oscillators: [Landau1976, §23]). More than half is transferred where |δ| < 2|g|. This assumes a constant m:
if it varies between ω_a and ω_b, something else takes part in the exchange.

Dampers make H complex.  A damper c_c on the cart adds c_c/iω to m, those of the joints add iσ_a to H_aa.  With
Ω = √(g² + δ²/4) and h half the trace of H,

    a = e^{iht} (cos Ωt + iδ/2 sin Ωt / Ω),    b = ig e^{iht} sin Ωt / Ω,

the energy returns from π/Re Ω on; if Im Ω is larger than Re Ω it never comes back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf, isfinite, pi, sqrt
from typing import Any

import numpy as np

from modal.modes import letters
from modal.report import NOTHING, Displayed, ReportColumn, ReportTable, short
from modal.types import Complexes, Floats, Ints

SAMPLES_OF_EXCHANGE = 2001
"""Tolerance: times among which the most energy that the others ever hold is found: a beat's top to 1e-6 of it."""
MOST_PAIRED_MODES = 40
"""Limit: modes up to which pairs are listed: among more, no two are isolated from the others."""
STRONG_COUPLING = 0.5
"""Physics: coupling strength μ/m above which first order is meaningless."""
WEAK_COUPLING = 0.1
"""Physics: coupling strength, or deviation of a rate, up to which first order is no mere guide, a splitting small."""
CHANGE_OF_FIRST_ORDER = 0.2
"""Physics: relative difference from first order, or change of F, above which other families take part."""
LEAST_SHARE_OF_BEATS = 0.01
"""Physics: share of the energy of one pendulum that others must receive for a beat to be reported."""
UNEVEN_DECAY_MIN = 1e-3
"""Tolerance: differences of decay rates within a family, over its splitting and the largest rate, that are reported."""


@dataclass(frozen=True)
class Transfer:
    """The later distribution of energy given to one of two coupled amplitudes, as fractions.

    `most` is the maximum that the other ever has; after `period` seconds, from one to the other and back, `left` is the
    maximum that the first has again.  `beats` if any of it comes back, which dampers can prevent.  `lossless` without
    dampers.
    """

    period: float
    most: float
    left: float
    beats: bool
    lossless: bool


def transfer(first: complex, second: complex, coupling: complex) -> Transfer:
    """The transfer between the amplitudes a' = iHa, H = [[first, coupling], [coupling, second]] in rad/s."""
    half, decay = np.complex128(first - second) / 2, (first.imag + second.imag) / 2
    with np.errstate(all="ignore"):
        turn = np.sqrt(np.complex128(coupling) ** 2 + half**2)
        period = float(pi / abs(turn.real))
        if not (first.imag or second.imag or coupling.imag):
            maximum = float(abs(coupling / turn) ** 2) if turn else 0.0
            return Transfer(period, maximum, 1.0, beats=isfinite(period), lossless=True)
        rate = max(float(abs(turn)), decay)
        early = np.linspace(0.0, min(period, 100 / rate), SAMPLES_OF_EXCHANGE)
        late = np.geomspace(1e-3, 1e6, SAMPLES_OF_EXCHANGE) / rate
        other_energy = _swung(np.concatenate((early, late)), turn, decay) * abs(coupling) ** 2
        remainder, beats = 0.0, bool(abs(turn.real) > abs(turn.imag))
        if isfinite(period):
            remainder = float(max(_energy_at(sign * half, turn, decay, period) for sign in (1, -1)))
    return Transfer(period, float(other_energy.max()), remainder, beats, lossless=False)


def passes_energy(first: Floats, second: Floats) -> bool:
    """Whether two levels with these shares of each member (n,) pass energy of any to the others, 4 w_1 w_2 of it.

    >>> passes_energy(np.array([0.5]), np.array([0.5])), passes_energy(np.array([1.0]), np.array([1e-4]))
    (True, False)
    """
    return bool((4 * first * second).max() > LEAST_SHARE_OF_BEATS)


def beats_of(weights: Floats, levels: Complexes) -> tuple[float, ...]:
    """2π/|Δω| (s), the slowest first, of two levels that pass energy of a member (levels, members) and have it back."""
    gaps = [b - a for (a, u), (b, v) in combinations(zip(levels, weights, strict=True), 2) if passes_energy(u, v)]
    coming = [2 * pi / float(abs(gap.real)) for gap in gaps if abs(gap.real) > abs(gap.imag)]
    return tuple(sorted(coming, reverse=True))


def exchange_among(weights: Floats, levels: Complexes) -> Transfer:
    """Return the largest fraction of the energy given to any one of several that all others ever have.

    A member has the weights w_l, Σ w_l = 1, (levels, members), in modes of frequency Re δ_l (rad/s, from any origin)
    and decay rate Im δ_l (1/s); the others hold Σ w_l |e_l|² − |Σ w_l e_l|² with e_l = exp(iδ_l t).

    >>> passed = exchange_among(np.array([[2 / 3], [1 / 3]]), np.array([0.0, 0.1 + 0.0j]))
    >>> round(passed.most, 12), round(4 * (3 - 1) / 3**2, 12), round(passed.period, 6)
    (0.888888888889, 0.888888888889, 62.831853)
    """
    beats = beats_of(weights, levels)
    gaps = np.subtract.outer(levels, levels)
    gap_sizes = np.abs(gaps.real)[np.abs(gaps.real) > 0]
    period = beats[0] if beats else 2 * pi / float(gap_sizes.min()) if gap_sizes.size else inf
    lossless = not levels.imag.any()
    rate = max(float(np.abs(gaps).max()) / 2, float(levels.imag.max()))
    span = period if isfinite(period) and lossless else min(period, 100 / rate) if rate else 0.0
    times = np.linspace(0.0, span, SAMPLES_OF_EXCHANGE)
    if not lossless:
        times = np.concatenate((times, np.geomspace(1e-3, 1e6, SAMPLES_OF_EXCHANGE) / rate))
        times = times[times * levels.imag.min() < 300]  # numbers below 1e-130 would be slow, and nothing is left then
    amplitude = np.exp(1j * np.outer(times, levels))
    energies, amplitudes = (np.einsum("tl,lm->tm", part, weights) for part in (np.abs(amplitude) ** 2, amplitude))
    others = energies - np.abs(amplitudes) ** 2
    back = np.abs(np.exp(1j * levels * period) @ weights) ** 2 if isfinite(period) else np.zeros(1)
    remainder = 1.0 if lossless and len(levels) == 2 else float(back.max())
    return Transfer(period, float(others.max()), remainder, bool(beats), lossless)


def _swung(times: Floats, turn: np.complex128, decay: float) -> Floats:
    """|e^{iht} sin Ωt / Ω|² at these times, with separate exponentials, none of which grows."""
    grown = np.exp((1j * turn - decay) * times) - np.exp((-1j * turn - decay) * times)
    return np.abs(grown / (2 * turn) if turn else times * np.exp(-decay * times)) ** 2


def _energy_at(half: np.complex128, turn: np.complex128, decay: float, time: float) -> float:
    """|a|² at a time."""
    up, down = (np.exp((sign * 1j * turn - decay) * time) for sign in (1, -1))
    return float(np.abs((up + down) / 2 + half * (up - down) / (2 * turn)) ** 2)


@dataclass(frozen=True, repr=False)
class EnergyExchange(Displayed):
    """Modes `first` and `second`, indices into `FixedBaseModes`, with all copies of each kind moving alike.

    `detuning` δ and `coupling` g in rad/s, `strength` the larger of their own shifts over ω, `cart_mass` the m (kg) of
    one coordinate between them, all without dampers, and `exchange` the transfer with them.  `alone` if no third mode
    of that frequency takes part, and with one coordinate if m is steady and g small enough for the theory.
    """

    first: int
    second: int
    detuning: float
    coupling: float
    strength: float
    cart_mass: float
    alone: bool
    exchange: Transfer

    @property
    def period(self) -> float:
        """Seconds from one pendulum to the other and back."""
        return self.exchange.period

    @property
    def share(self) -> float:
        """The largest fraction of one's energy that the other ever has, 0 … 1."""
        return self.exchange.most


def pair_exchange(omega: Floats, rate: Floats, free: Any, lossy: Any) -> tuple[float, float, float, Transfer]:
    """Detuning, coupling, strength and transfer of two modes at `omega` (2,), their pull F without and with dampers.

    `rate` (2,) are their own decay rates: if one is overdamped, nothing comes back.
    """
    (wa, wb), x = omega.tolist(), float(omega.prod())
    first, second = wa + free[0, 0] / (2 * wa), wb + free[1, 1] / (2 * wb)
    shifts = [complex(lossy[k, k]) / (2 * w) for k, w in enumerate((wa, wb))]
    exchange = transfer(wa + shifts[0], wb + shifts[1], complex(lossy[0, 1]) / (2 * sqrt(x)))
    strength = max(abs(free[0, 0]) / wa**2, abs(free[1, 1]) / wb**2, abs(free[0, 1]) / x)
    exchange = replace(exchange, beats=exchange.beats and bool(np.all(rate < omega)))
    return float(first - second), float(free[0, 1]) / (2 * sqrt(x)), float(strength), exchange


CHANGE_OF_REST_MAX = 0.02
"""Physics: relative difference of a splitting from that by F at its pole: beyond, another family is near."""


@dataclass(frozen=True, eq=False, repr=False)
class FamilyBranch(Displayed):
    """One mode of a family that moves other things: its ε, and its `omega` (rad/s), `splitting` ω − ω_r.

    ε is negative just above another pole or a spring of the moving part, infinite without other inertia. A mode lost by
    a massless cart is at infinity. `motion` (d,) is that of the structure in its own modes, `pattern` (√kg m) the
    amplitudes of the members. `still` if the structure is at rest, and only springs between pendula split the family.
    `damping_factor` is the complex factor by which dampers outside the family change ε, `cart_mode` the index of the
    mode among those that move a cart.
    """

    what = "Mode of a family that moves something else"
    shows = (
        "omega: ω, rad/s; splitting: Δω, rad/s; strength: coupling strength; motion: moves; still: the structure is "
        "still"
    )

    strength: float
    omega: float
    splitting: float
    motion: Floats
    pattern: Floats
    still: bool
    damping_factor: complex = 1.0
    cart_mode: int | None = None

    @property
    def is_finite(self) -> bool:
        """Whether the mode has a frequency."""
        return isfinite(self.omega)

    def is_first_order(self, omega: float) -> bool:
        """Whether ½ ε ω_r of a family at ω_r is near its splitting, and the coupling weak."""
        is_near = abs(self.strength * omega / 2 - self.splitting) <= CHANGE_OF_FIRST_ORDER * abs(self.splitting)
        return self.is_finite and abs(self.strength) <= STRONG_COUPLING and is_near

    def is_rough(self, omega: float) -> bool:
        """Whether another family is near: F varies from ω_r to the mode, but not too much for first order."""
        steady = omega * (sqrt(max(0.0, 1 + self.strength)) - 1)
        return abs(steady - self.splitting) > CHANGE_OF_REST_MAX * abs(self.splitting)


@dataclass(frozen=True, eq=False, repr=False)
class Family(Displayed):
    """Modes of single pendula of one frequency `omega` (rad/s): `members` are indices into `FixedBaseModes`.

    There are `fold` in all, counting copies, of which `still` combinations move nothing else.  `mass` is their modal
    effective mass μ_r along the rail (kg), `masses` (d,) that along each mode of the structure, Σ N (Γ Φ u)².
    `exchange` describes the energy of any one pendulum released alone; None if there is only one, if first order does
    not hold, and if the joints damp some of the pendula faster than others; `beats` are its 2π/|Δω| (s), the slowest
    first, of every two levels between which energy is exchanged.
    """

    what = "Family of modes"
    shows = (
        "omega: ω with all else held, rad/s; fold: modes of single pendula; mass: effective mass, kg; still: "
        "combinations that move nothing else; beats: beats, s"
    )

    omega: float
    members: tuple[int, ...]
    fold: int
    still: int
    mass: float
    masses: Floats
    branches: tuple[FamilyBranch, ...]
    exchange: Transfer | None = None
    beats: tuple[float, ...] = ()

    @property
    def cart_mode(self) -> int | None:
        """The index of the mode that moves the cart; None if there is none."""
        return self.branches[0].cart_mode if self.branches else None

    @property
    def strength(self) -> float:
        """The largest ε; ε_r = μ_r/m_r for one coordinate, 0 without coupling."""
        return max((branch.strength for branch in self.branches), key=abs, default=0.0)

    @property
    def rest(self) -> float:
        """The dynamic mass m_r of everything else at ω_r (kg) for one coordinate; infinite on a fixed support."""
        mass = float(self.masses[0]) if len(self.masses) else self.mass
        return mass / self.strength if self.strength else inf

    @property
    def splitting(self) -> float | None:
        """Δω (rad/s) of the only mode that moves other things; None if there is none, or several."""
        moving = [branch.splitting for branch in self.branches if branch.is_finite]
        return moving[0] if len(moving) == 1 else None

    @property
    def is_first_order(self) -> bool:
        """Whether there are modes that move other things, all near ω_r + ½ ε ω_r."""
        return bool(self.branches) and all(branch.is_first_order(self.omega) for branch in self.branches)

    @property
    def is_rough(self) -> bool:
        """Whether a nearby family interferes with one of its modes."""
        return any(branch.is_rough(self.omega) for branch in self.branches)

    @property
    def beat(self) -> float | None:
        """The slowest beat (s), of energy passing from one pendulum of the family to the others and back."""
        return self.beats[0] if self.beats else None

    def levels(self, copies: Ints, decay_rate: float) -> tuple[Floats, Complexes]:
        """For every branch, then for members at rest: its share of each member released (levels, members), and Δω + iσ.

        `copies` (members,) there are of each, `decay_rate` is the decay rate (1/s) of one pendulum alone.
        """
        levels = [1j * decay_rate + branch.splitting * branch.damping_factor for branch in self.branches]
        patterns = [branch.pattern**2 / (branch.pattern @ branch.pattern) / copies for branch in self.branches]
        weights = np.reshape(patterns, (len(levels), len(copies)))
        if not self.still:
            return weights / weights.sum(0), np.array(levels)
        return np.vstack([weights, np.maximum(1 - weights.sum(0), 0.0)]), np.array([*levels, 1j * decay_rate])


def _cell(value: float | str | None) -> str:
    return NOTHING if value is None else value if isinstance(value, str) else short(value)


COLUMNS = (
    ReportColumn("family", None, "family"),
    ReportColumn("omega", None, "ω (rad/s)", _cell),
    ReportColumn("mass", None, "effective mass (kg)", _cell),
    ReportColumn(
        "strength", None, "coupling strength", lambda x: NOTHING if x is None else f"{x:.4g}".replace("inf", "∞")
    ),
    ReportColumn("splitting", None, "Δω (rad/s)", _cell),
    ReportColumn("beat", None, "beat (s)", _cell),
    ReportColumn("share", None, "share halfway (%)", lambda share: NOTHING if share is None else f"{100 * share:.3g}"),
    ReportColumn("modes", None, "modes"),
    ReportColumn(lambda row: row.moves or None, None, "moves"),
)


@dataclass(frozen=True, repr=False)
class FamilyRow(Displayed):
    """A row of the table, None if a quantity is undefined.

    `omega` ω_r (rad/s) with all else fixed, `mass` the modal effective mass (kg), `strength` ε, `splitting` Δω (rad/s),
    `beat` (s), and `share`, the energy of a released pendulum that the others of the family have halfway through a
    beat, or at most with dampers. `modes` are numbers in the table, `moves` the moving parts of a structure, `fold` the
    number of modes of single pendula in the family.
    """

    what = "Row of the table of families"
    shows = (
        "family: family; omega: ω with all else held, rad/s; mass: effective mass, kg; strength: coupling strength; "
        "splitting: Δω, rad/s; beat: beat, s; share: share halfway; modes: modes; moves: moves"
    )

    family: str
    omega: float
    mass: float | None
    strength: float | None
    splitting: float | None
    beat: float | None
    share: float | None
    modes: str
    moves: str = ""
    fold: int = 1


def family_name(index: int) -> str:
    """A, B, … of families from 0: numbers are for modes."""
    return letters(index).upper()


def mode_words(still_number: int | None, moving: int | None, copies: int = 1) -> str:
    """The modes of a family by their numbers: of these `copies` that move nothing else, and the one that does.

    >>> mode_words(3, 4), mode_words(3, 4, 28), mode_words(None, 2)
    ('3 still, 4', '3 still ×28, 4', '2')
    """
    several = f" ×{copies}" if copies > 1 else ""
    parts = [f"{still_number} still{several}"] * (still_number is not None) + [str(moving)] * (moving is not None)
    return ", ".join(parts) or NOTHING


def family_table(rows: Sequence[FamilyRow]) -> ReportTable:
    """Return the columns that contain anything."""
    table = ReportTable.of((column for column in COLUMNS if any(column.of(row) is not None for row in rows)), rows)
    return table._replace(spare=("effective mass (kg)", "Δω (rad/s)", "share halfway (%)"))
