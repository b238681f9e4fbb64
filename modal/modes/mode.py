"""One row of the table of modes, its resonances, and the second order of supports.

A small nonlinearity can move energy between modes whose frequencies are near 1:1 or 1:3.  Modes within WIDTH of the
ratio are near, whatever the amplitude; others if their responses at the angle of 1 % together change this angle by more
than 3 %, less a margin for terms that the estimate omits (`modal.eigen.amplitude.distortion`, which follows the drift
of both frequencies). A mode that shakes its structure at twice its frequency is near 1:2 if the response of the
structure changes this angle by more than 3 % from |κ|a² = 1 %.

Such modes leave the structure at rest to first order. A pivot that a coordinate η moves down by Ψ η gives the
Lagrangian −η' Ψᵀ σb θθ', so that q = a φ cos ωt pushes η with a² f cos 2ωt, f = −ω² Σ Ψ σ b φ². With D(2ω) = K + 2iωD −
4ω²M of the whole scene the averaged Lagrangian changes by a⁴ fᵀ D(2ω)⁻¹ f/4, and κ by

    κ₂(ω) = −fᵀ D(2ω)⁻¹ f/(φᵀMφ ω²).

Near 2:1 this depends on the frequency itself, ω(a)²/ω² − 1 = 2a² (κ₀ + κ₂(ω(a))), κ₀ that of a fixed support.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from modal.eigen import UNCERTAIN
from modal.report import Displayed, Summary, deferred
from modal.types import Floats, Ints

DISTANCE_OF_RESONANCE = 0.02
"""Physics: distance from 1:1 or 1:3, relative to the frequency, within which two modes are reported as resonant."""
MOST_REFINED = 120
"""Limit: coordinates up to which a mode takes work of its own: terms that cancel are refined, motion is expanded."""
PROMISED_ERROR = 0.03
"""Tolerance: relative error of an angle of 1 % without a star, as docs and tables say; a star stands beyond."""
ERROR_UNSEEN = 0.002
"""Tolerance: how far the estimate of that error may be too small."""
DISTANCE_OF_DOUBT = 0.1
"""Tolerance: distance from a ratio within which a response may be wrong by all of itself."""
DOUBT_ELSEWHERE = 0.05
"""Tolerance: share by which a response further from a ratio may be wrong."""
RATIOS = (("1:1", 1.0), ("1:3", 3.0), ("3:1", 1 / 3))
DRIVEN = (1, 3)
"""The harmonics in which a mode drives other modes."""


@dataclass(frozen=True, repr=False)
class Mode(Displayed):
    """One distinct natural frequency of a scene, with the properties of the modes that share it.

    number              from 1, in ascending order
    omega               natural frequency |λ| of the eigenvalue λ (rad/s)
    damping_ratio       −Re λ/|λ|: 0 undamped, 1 overdamped, below 0 unstable
    multiplicity        number of independent modes with this frequency; a scene in space counts both directions
    family              description of the motion
    cart_participation  share of the cart's velocity just after a sudden push, φ_x²/Σφ_x² with φᵀMφ = 1; over all
                        modes it sums to 1.  With dampers it is the residue 2 Re[λφ_x²/(φᵀ(2λM + D)φ)]
                        [Tisseur2001, §3.5], which may be negative
    effective_mass      modal effective mass Γ²φᵀMφ (kg) of the support's motion along the rail, Γ the participation
                        factor φᵀMe/φᵀMφ (Clough & Penzien, Dynamics of Structures, §26-4)
    effective_mass_share   the same over the total mass of the scene, the cart included
    effective_mass_across  across the rail (kg), in space
    kappa               κ in ω(a) = ω(1 + κa²), a the largest angle (1/rad²), see `modal.eigen.amplitude`
    linear_to_1_percent_deg  the largest angle (deg) of any link over the period at which ω is 1 % off: |κ|a² = 1 %
    resonances          modes near 1:1, 1:2 or 1:3 that make this angle a guide, in words, see `resonances`
    residual            misfit of frequency and shape: without dampers |1 − ρ/ω²| of the shape's Rayleigh
                        quotient ρ, with dampers the norm of the unbalanced forces (λ²M + λD + K)φ over that of the
                        sums of their terms' sizes, each force over the root of its coordinate's inertia
    relative_error_bound  bound on the relative error of omega
    indistinct          whether a neighbour is closer than the sum of both bounds

    NaN if a quantity is undefined: effective mass of a mode whose shape dampers change (with light ones it is that of
    the mode without, see `modal.modes.numbering`), κ above a damping ratio of 0.1 or where the parts of a shape are far
    out of phase, everything but `residual` in a row that is uncertain.

    >>> from modal import load, natural_modes
    >>> mode = natural_modes(load("paper-cart-2"))[2]
    >>> mode.number, mode.family, round(mode.linear_to_1_percent_deg, 1)
    (3, 'cart moves: in phase, slow', 27.7)
    """

    number: int
    omega: float
    damping_ratio: float
    multiplicity: int
    family: str
    cart_participation: float
    effective_mass: float
    effective_mass_share: float
    effective_mass_across: float
    kappa: float
    linear_to_1_percent_deg: float
    resonances: tuple[str, ...]
    residual: float
    relative_error_bound: float
    indistinct: bool

    @property
    def is_uncertain(self) -> bool:
        """Whether no digit of `omega` is certain: double precision does not suffice with the method used."""
        return not self.relative_error_bound < UNCERTAIN

    @property
    def oscillates(self) -> bool:
        """Whether the mode oscillates: not if ω = 0, or it is overdamped or uncertain."""
        return bool(oscillating(self.omega, self.damping_ratio))

    @property
    def is_overdamped(self) -> bool:
        """Whether the mode returns to equilibrium without oscillating: its eigenvalue is real and negative."""
        return self.omega > 0 and self.damping_ratio >= 1

    @property
    def growth_rate(self) -> float | None:
        """Re λ (1/s) of an unstable mode, which grows like exp(Re λ t); None for all others."""
        return -self.damping_ratio * self.omega if self.damping_ratio < 0 else None

    @property
    def frequency(self) -> float | None:
        """Natural frequency |λ|/2π in Hz; 0 for a rigid translation, None for a mode that does not oscillate."""
        return hertz(self.omega) if self.oscillates or self.omega == 0 else None

    @property
    def period(self) -> float | None:
        """Period 2π/|Im λ| (s); None if the mode does not oscillate."""
        return float(swing_period(self.omega, self.damping_ratio)) if self.oscillates else None

    @property
    def description(self) -> str:
        """The description of the motion in words: the `family`."""
        return self.family

    def to_dict(self) -> dict[str, Any]:
        """The row by the keys of CSV and JSON, with their units; None if there is no value.

        Only `fixed_base_effective_mass_kg` is missing, which needs the other modes too: `Modes.to_dict` has it.

        >>> from modal import load, natural_modes
        >>> natural_modes(load("paper-cart-2"))[2].to_dict()["omega_rad_per_s"]
        2.7175491179815823
        """
        record: dict[str, Any] = deferred("modal.modes.tables:record_of")(self)
        return record

    def _summary(self) -> Summary:
        summary: Summary = deferred("modal.modes.tables:summarize_mode")(self)
        return summary


def oscillating(omega: Any, ratio: Any) -> Any:
    """Whether modes of these frequencies and damping ratios oscillate; false if the ratio is NaN."""
    return (omega > 0) & (abs(ratio) < 1)


def hertz(omega: Any) -> Any:
    """Convert a frequency from rad/s to Hz."""
    return omega / (2 * pi)


def swing_period(omega: Any, ratio: Any) -> Any:
    """2π/|Im λ| (s) of modes that oscillate."""
    return 2 * pi / (omega * np.sqrt((1 - ratio) * (1 + ratio)))


def resonances(omega: Floats, number: int, partners: Ints, first: int = 0) -> tuple[str, ...]:
    """Resonances of mode `number` with `partners`, in words; both ascending indices from 0 into `omega` (R,).

    `first` is the index of ω[0] among all modes of the scene.
    """
    frequency, others = omega[number], omega[partners]
    if frequency == 0:
        return ()
    words: list[str] = []
    for ratio, factor in RATIOS:
        low, high = np.searchsorted(
            others, frequency * factor * np.array([1 - DISTANCE_OF_RESONANCE, 1 + DISTANCE_OF_RESONANCE])
        )
        neighbours = [int(k) for k in partners[low : min(high, low + 4 + 1)] if k != number][:4]
        itself = low <= np.searchsorted(partners, number) < high
        words += [f"{ratio} with mode {first + k + 1}" for k in neighbours]
        remainder = int(high - low - itself) - len(neighbours)
        words += [f"{ratio} with {remainder} more"] if remainder > 0 else []
    return tuple(words)


def is_guide(angle: float, error: float, doubt: float) -> bool:
    """Whether a 1 % angle (rad) is only approximate by the uncertain estimate of its relative error.

    The estimate omits terms of the next order, which make the angle larger, by up to 3 % of a² in 400 modes of
    random scenes.
    """
    return not ERROR_UNSEEN - PROMISED_ERROR + doubt <= error <= PROMISED_ERROR * (1 - angle**2) - doubt


def answering(omega: Floats, number: int, partners: Ints) -> list[tuple[int, int]]:
    """(harmonic, partner) of modes that may respond to this mode; indices as in `resonances`."""
    pairs, others = [], partners[partners != number]
    for harmonic in DRIVEN if omega[number] else ():
        at = int(np.searchsorted(omega[others], harmonic * omega[number]))
        neighbours = others[max(at - 3, 0) : at + 3]  # those further from the ratio respond less
        pairs += [(harmonic, k) for k in neighbours.tolist() if omega[k]]
    return pairs
