"""Combination of the peaks of modes, which do not occur at the same time.

    SRSS   √(Σ_r y_r²)                 modes far apart (Rosenblueth, 1951)
    CQC    √(Σ_rs ρ_rs y_r y_s)        with the signs of the y_r (Wilson, Der Kiureghian & Bayo, 1981)

    ρ_rs = 8 √(ζ_r ζ_s) (ζ_r + q ζ_s) q^{3/2} / [(1 − q²)² + 4 ζ_r ζ_s q (1 + q²) + 4 (ζ_r² + ζ_s²) q²],   q = ω_s/ω_r

is the correlation of two oscillators under white noise (Der Kiureghian, Earthquake Eng. Struct. Dyn. 9, 419 (1981),
equation (8)).
"""

from __future__ import annotations

import numpy as np

from modal.types import Floats


def srss(peaks: Floats) -> Floats:
    """The square root of the sum of squares over modes, of peaks (R, ...)."""
    return np.asarray(np.sqrt(np.sum(np.square(peaks), axis=0)))


def correlation(omega: Floats, damping: Floats) -> Floats:
    """ρ (R, R) of modes of frequencies ω (R,) in rad/s and damping ratios ζ (R,); 1 for equal frequencies."""
    q = omega[None, :] / omega[:, None]
    r, s = damping[:, None], damping[None, :]
    above = 8 * np.sqrt(r * s) * (r + q * s) * q**1.5
    below = (1 - q**2) ** 2 + 4 * r * s * q * (1 + q**2) + 4 * (r**2 + s**2) * q**2
    with np.errstate(invalid="ignore"):
        rho = above / below
    return np.asarray(np.where((below == 0) | (q == 1) & (r == s), 1.0, rho))


def cqc(peaks: Floats, omega: Floats, damping: Floats) -> Floats:
    """The complete quadratic combination of signed peaks (R, ...)."""
    rho = correlation(omega, damping)
    return np.asarray(np.sqrt(np.maximum(np.einsum("r...,rs,s...->...", peaks, rho, peaks), 0.0)))
