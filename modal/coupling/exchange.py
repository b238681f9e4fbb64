"""The exchange of energy between pendula through the cart: detuning against coupling, two modes at a time.

Modes a and b of different pendula, of fixed-base frequencies ω_a, ω_b and modal effective masses μ_a, μ_b, share a
cart that resists them with m, the dynamic mass of everything else halfway between them.  To first order in μ/m their
slow amplitudes obey i a' = H a with

    H_aa = ω_a (1 + μ_a/2m),    H_ab = g = √(μ_a μ_b ω_a ω_b)/2m,    δ = H_aa − H_bb,

so that of the energy given to one the other receives at most 4g²/(4g² + δ²), once in every 2π/√(4g² + δ²)
(two coupled oscillators: Landau & Lifshitz, Mechanics, §23).  More than half is transferred where |δ| < 2|g|.  All of
this assumes a constant m: where it varies between ω_a and ω_b, something else takes part in the exchange.

Dampers make H complex.  A damper c_c on the cart adds c_c/iω to m, those of the joints add iσ_a to H_aa.  With
Ω = √(g² + δ²/4) and h half the trace of H,

    a = e^{iht} (cos Ωt + iδ/2 sin Ωt / Ω),    b = ig e^{iht} sin Ωt / Ω,

the energy is on its way back after π/Re Ω; where Im Ω is larger than Re Ω it never comes back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import isfinite, pi, sqrt

import numpy as np

from modal.coupling.dynamic_mass import DynamicMass
from modal.coupling.fixed_base import FixedBaseModes
from modal.report import Displayed
from modal.types import Booleans, Floats, Ints

SAMPLES = 2001
MOST_MODES = 40
"""Modes up to which pairs are listed: among more, no two are isolated from the others."""
STRONG = 0.5
"""Coupling strength μ/m above which first order is meaningless."""
LEAST_SHARE_OF_BEATS = 0.01
"""Share of the energy of one pendulum that others must come to hold for a beat to be told."""
UNEVEN = 1e-3
"""Largest differences of decay rates within a family, over its splitting and over the largest rate."""
STEADY = 0.2
"""Largest relative change of m over the frequencies of an isolated pair."""


@dataclass(frozen=True)
class Transfer:
    """The later distribution of energy given to one of two coupled amplitudes, as fractions of it.

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
            most = float(abs(coupling / turn) ** 2) if turn else 0.0
            return Transfer(period, most, 1.0, beats=isfinite(period), lossless=True)
        rate = max(float(abs(turn)), decay)
        early, late = np.linspace(0.0, min(period, 100 / rate), SAMPLES), np.geomspace(1e-3, 1e6, SAMPLES) / rate
        other = _swung(np.concatenate((early, late)), turn, decay) * abs(coupling) ** 2
        left = float(max(_returned(sign * half, turn, decay, period) for sign in (1, -1))) if isfinite(period) else 0.0
    return Transfer(period, float(other.max()), left, beats=bool(abs(turn.real) > abs(turn.imag)), lossless=False)


def passes_energy(first: Floats, second: Floats) -> bool:
    """Whether two levels with these shares of each member (n,) pass energy of any to the others, 4 w_1 w_2 of it.

    >>> passes_energy(np.array([0.5]), np.array([0.5])), passes_energy(np.array([1.0]), np.array([1e-4]))
    (True, False)
    """
    return bool((4 * first * second).max() > LEAST_SHARE_OF_BEATS)


def most_of_the_others(weights: Sequence[float], levels: Sequence[complex]) -> float:
    """The most that all others ever hold of the energy given to one of several, over its levels, of that energy.

    The one has the weights w_l, Σ w_l = 1, in modes of frequency Re δ_l (rad/s, from any origin) and decay rate Im δ_l
    (1/s); the others hold Σ w_l |e_l|² − |Σ w_l e_l|² with e_l = exp(iδ_l t), over the slowest beat.

    >>> round(most_of_the_others([2 / 3, 1 / 3], [0.0, 0.1]), 12), round(4 * (3 - 1) / 3**2, 12)
    (0.888888888889, 0.888888888889)
    """
    share, level = np.asarray(weights), np.asarray(levels, dtype=np.complex128)
    gaps = np.abs(np.subtract.outer(level.real, level.real))
    times = np.linspace(0.0, 2 * pi / float(gaps[gaps > 0].min()), SAMPLES) if gaps.any() else np.zeros(1)
    amplitude = np.exp(1j * np.outer(times, level))
    return float(((np.abs(amplitude) ** 2) @ share - np.abs(amplitude @ share) ** 2).max())


def _swung(times: Floats, turn: np.complex128, decay: float) -> Floats:
    """|e^{iht} sin Ωt / Ω|² at these times, with separate exponentials, none of which grows."""
    grown = np.exp((1j * turn - decay) * times) - np.exp((-1j * turn - decay) * times)
    return np.abs(grown / (2 * turn) if turn else times * np.exp(-decay * times)) ** 2


def _returned(half: np.complex128, turn: np.complex128, decay: float, time: float) -> float:
    """|a|² at a time."""
    up, down = (np.exp((sign * 1j * turn - decay) * time) for sign in (1, -1))
    return float(np.abs((up + down) / 2 + half * (up - down) / (2 * turn)) ** 2)


@dataclass(frozen=True, repr=False)
class EnergyExchange(Displayed):
    """Modes `first` and `second`, indices into `FixedBaseModes`, all copies of each kind moving alike.

    `detuning` δ and `coupling` g in rad/s, `cart_mass` the m (kg) between them, all without dampers, and `exchange`
    the transfer with them; `alone` if no other mode takes part and g is small enough for the theory.
    """

    first: int
    second: int
    detuning: float
    coupling: float
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


def energy_exchanges(
    modes: FixedBaseModes, dynamic: DynamicMass, pole: Ints, damping: float = 0.0
) -> tuple[EnergyExchange, ...]:
    """Pairs of modes of different kinds, those that exchange most first.

    `pole` (K,) is the pole of each mode, `damping` (N s/m) the cart's.  A pair with nothing else on the cart, m = 0, is
    rigidly coupled and omitted: it exchanges nothing.  There are none for more than MOST_MODES modes.
    """
    places = range(len(modes.omega)) if len(modes.omega) <= MOST_MODES else ()
    pairs = [(a, b) for a, b in combinations(places, 2) if modes.kind[a] != modes.kind[b]]
    chosen = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    masses = _between(dynamic, pole[chosen])
    alone = _alone(modes, dynamic, pole, chosen, masses)
    every = zip(pairs, masses.tolist(), alone.tolist(), strict=True)
    exchanges = [_exchange(modes, a, b, m, damping, alone=by_itself) for (a, b), m, by_itself in every if m]
    return tuple(sorted(exchanges, key=lambda pair: -pair.share))


def _between(dynamic: DynamicMass, poles: Ints) -> Floats:
    """The m (pairs,) in kg: the dynamic mass without the two poles of each pair, halfway between them."""
    return _without(dynamic, poles, np.sqrt(dynamic.omega[poles].prod(1)))


def _without(dynamic: DynamicMass, poles: Ints, omega: Floats) -> Floats:
    """The dynamic mass (pairs,) in kg without the two poles of each pair, at these frequencies (pairs,)."""
    index = np.arange(len(dynamic.omega))
    return dynamic(omega, left_out=(index == poles[:, :1]) | (index == poles[:, 1:]))


def _alone(modes: FixedBaseModes, dynamic: DynamicMass, pole: Ints, pairs: Ints, m: Floats) -> Booleans:
    """Whether no other mode shares the poles of a pair, its coupling is weak, and m is steady over its frequencies."""
    mass = (modes.mass * modes.count)[pairs]
    omega, company = modes.omega[pairs], np.bincount(pole)[pole[pairs]]
    with np.errstate(all="ignore"):
        shift = omega * mass / (2 * m[:, None])
        middle, detuning = (omega + shift).mean(1), np.diff(omega + shift)[:, 0]
        swing = np.hypot(detuning / 2, np.sqrt(np.abs(shift.prod(1))))
        ends = np.column_stack((omega, middle - swing, middle + swing))
        beside = [_without(dynamic, pole[pairs], np.maximum(end, 0.0)) for end in (ends.min(1), ends.max(1))]
        steady = np.all(np.abs(beside - m) <= STEADY * np.abs(m), axis=0) & (mass.max(1) <= STRONG * np.abs(m))
    alone: Booleans = np.isfinite(m) & steady & (company.sum(1) == np.where(np.ptp(pole[pairs], axis=1), 2, 4))
    return alone


def _exchange(modes: FixedBaseModes, a: int, b: int, m: float, damping: float, *, alone: bool) -> EnergyExchange:
    """The pair (a, b) on a cart that resists with m and a damper."""
    wa, wb = float(modes.omega[a]), float(modes.omega[b])
    ma, mb = (float(modes.mass[k] * modes.count[k]) for k in (a, b))
    detuning = (wa - wb) + (wa * ma - wb * mb) / (2 * m)
    coupling, yielding = sqrt(ma * mb * wa * wb), 1 / (2 * m - 2j * damping / sqrt(wa * wb)) if isfinite(m) else 0.0
    first, second = (w * (1 + mu * yielding) + 1j * float(modes.rate[k]) for w, mu, k in ((wa, ma, a), (wb, mb, b)))
    passed = transfer(first, second, coupling * yielding)
    overdamped = float(modes.rate[a]) >= wa or float(modes.rate[b]) >= wb
    return EnergyExchange(
        a, b, detuning, coupling / (2 * abs(m)), m, alone, replace(passed, beats=passed.beats and not overdamped)
    )
