"""Which pendula exchange energy through the cart: detuning against coupling, two modes at a time.

Modes a and b of different pendula, of fixed-support frequencies ω_a, ω_b and modal effective masses μ_a, μ_b, share a
cart that resists them with m, the dynamic mass of all else halfway between them.  To first order in μ/m their slow
amplitudes obey i a' = H a with

    H_aa = ω_a (1 + μ_a/2m),    H_ab = g = √(μ_a μ_b ω_a ω_b)/2m,    δ = H_aa − H_bb,

so that of the energy given to one the other gets at most 4g²/(4g² + δ²), once in every 2π/√(4g² + δ²)
(two coupled oscillators: Landau & Lifshitz, Mechanics, §23).  More than half passes over where |δ| < 2|g|.  All of
this takes m for a constant: where it changes between ω_a and ω_b, something else takes part in the exchange.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import hypot, inf, pi, sqrt

import numpy as np

from modal.dynamic_mass import DynamicMass
from modal.own_modes import OwnModes
from modal.rig import Booleans, Floats, Ints

MOST_MODES = 40
"""Modes up to which pairs say anything: among more, so many lie within reach of each other that no two are alone."""
STRONG = 0.5
"""Coupling strength μ/m from which first order says nothing."""
STEADY = 0.2
"""The share of m that may change over the frequencies of a pair that is alone."""


@dataclass(frozen=True)
class Talk:
    """Modes `first` and `second`, indices into `OwnModes`, all copies of each kind swinging alike.

    `detuning` δ and `coupling` g in rad/s, `cart_mass` the m (kg) between them; `alone` if no other mode takes
    part and g is small enough for all this.
    """

    first: int
    second: int
    detuning: float
    coupling: float
    cart_mass: float
    alone: bool

    @property
    def beat(self) -> float:
        """√(4g² + δ²) in rad/s."""
        return hypot(2 * self.coupling, self.detuning)

    @property
    def period(self) -> float:
        """Seconds from one pendulum to the other and back."""
        return 2 * pi / self.beat if self.beat else inf

    @property
    def share(self) -> float:
        """The most of one's energy that the other gets, 0 … 1."""
        return (2 * self.coupling / self.beat) ** 2 if self.beat else 0.0


def talks(own: OwnModes, dynamic: DynamicMass, pole: Ints) -> tuple[Talk, ...]:
    """Pairs of modes of different kinds, those that share most first; `pole` (K,) is the pole that each mode stands in.

    A pair with nothing between them, m = 0, is tied together, and left out: it does not exchange anything.  None of
    more than MOST_MODES modes.
    """
    places = range(len(own.omega)) if len(own.omega) <= MOST_MODES else ()
    pairs = [(a, b) for a, b in combinations(places, 2) if own.kind[a] != own.kind[b]]
    chosen = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    masses = _between(dynamic, pole[chosen])
    alone = _alone(own, dynamic, pole, chosen, masses)
    every = zip(pairs, masses.tolist(), alone.tolist(), strict=True)
    found = [_talk(own, a, b, m, by_itself) for (a, b), m, by_itself in every if m]
    return tuple(sorted(found, key=lambda talk: -talk.share))


def _between(dynamic: DynamicMass, poles: Ints) -> Floats:
    """M (pairs,) in kg: the dynamic mass without the two poles of each pair, halfway between them."""
    return _without(dynamic, poles, np.sqrt(dynamic.omega[poles].prod(1)))


def _without(dynamic: DynamicMass, poles: Ints, omega: Floats) -> Floats:
    """The dynamic mass (pairs,) in kg without the two poles of each pair, at these frequencies (pairs,)."""
    index = np.arange(len(dynamic.omega))
    return dynamic(omega, left_out=(index == poles[:, :1]) | (index == poles[:, 1:]))


def _alone(own: OwnModes, dynamic: DynamicMass, pole: Ints, pairs: Ints, m: Floats) -> Booleans:
    """Whether a pair has its poles for itself, is not coupled strongly, and m is steady over all frequencies of its."""
    mass = (own.mass * own.count)[pairs]
    omega, company = own.omega[pairs], np.bincount(pole)[pole[pairs]]
    with np.errstate(all="ignore"):
        shift = omega * mass / (2 * m[:, None])
        middle, detuning = (omega + shift).mean(1), np.diff(omega + shift)[:, 0]
        swing = np.hypot(detuning / 2, np.sqrt(np.abs(shift.prod(1))))
        ends = np.column_stack((omega, middle - swing, middle + swing))
        found = [_without(dynamic, pole[pairs], np.maximum(end, 0.0)) for end in (ends.min(1), ends.max(1))]
        steady = np.all(np.abs(found - m) <= STEADY * np.abs(m), axis=0) & (mass.max(1) <= STRONG * np.abs(m))
    alone: Booleans = np.isfinite(m) & steady & (company.sum(1) == np.where(np.ptp(pole[pairs], axis=1), 2, 4))
    return alone


def _talk(own: OwnModes, a: int, b: int, m: float, alone: bool) -> Talk:
    """Pair (a, b) on a cart that resists with m."""
    wa, wb = float(own.omega[a]), float(own.omega[b])
    ma, mb = (float(own.mass[k] * own.count[k]) for k in (a, b))
    detuning = (wa - wb) + (wa * ma - wb * mb) / (2 * m)
    return Talk(a, b, detuning, sqrt(ma * mb * wa * wb) / (2 * abs(m)), m, alone)
