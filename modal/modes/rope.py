"""The hanging rope in closed form, with which chains of many links are compared.

The rope of Bernoulli and Euler, (s y')' + ω² y/g = 0 with s from the free end, has y = J_0(2ω√(s/g)).
"""

from __future__ import annotations

from math import pi

import numpy as np

from modal.types import Floats


def bessel_zeros(count: int) -> Floats:
    """The first zeros j_{0,k} (count,) of J_0, by Newton's iteration from McMahon's expansion.

    J_m(z) = (1/π) ∫_0^π cos(mt − z sin t) dt, the trapezoidal rule being exact to rounding once it has more nodes
    than z (Abramowitz & Stegun, 9.1.21 and 9.5.12).
    """
    beta = (np.arange(1, count + 1) - 0.25) * pi
    z = beta + 1 / (8 * beta) - 124 / (3 * (8 * beta) ** 3)
    for _ in range(3):
        z = z + _bessel(0, z) / _bessel(1, z)
    return np.asarray(z)


def hanging_rope(count: int) -> Floats:
    """ω √(L/g) (count,) of the lowest modes of a uniform rope of length L: j_{0,k}/2."""
    return bessel_zeros(count) / 2


def rope_error_of_bobs(n: int) -> float:
    """The error of n equal bobs a distance L/n apart: ω/ω_rope − 1 → −1/(4n), the same for every mode.

    From x_r = j²/(4n+2) (1 + O(j²/n²)) (Abramowitz & Stegun, 22.16.8): ω/ω_rope → √(n/(n+½)), as if the rope were
    half a spacing longer.
    """
    return -1 / (4 * n)


def rope_error_of_rods(n: int, count: int) -> Floats:
    """The error of n equal rods of length L/n: ω_k/ω_rope − 1 → (j²/J_1(j)² − 2j² − 4)/(192 n²), (count,), j = j_{0,k}.

    Rods are linear finite elements of the rope with exact kinetic and potential energies, so frequencies converge from
    above with the energy of the interpolation error: ω²_n − ω² → (L²/12n²) ∫ g s y''² ds/∫ y² ds (Strang & Fix, An
    Analysis of the Finite Element Method, chapter 6).  With s from the free end, L = g = 1 and z = 2ω√s:
    y'' = (j⁴/4) J_2(z)/z², so ∫ s y''² ds = (j⁴/8) ∫_0^j J_2²/z dz = (j⁴/32)(1 − 2J_1² − J_2²), as the derivative
    J_2²/z of ¼(1 − J_0² − 2J_1² − J_2²) shows; ∫ y² ds = J_1², and J_2 = 2J_1/j at j.
    """
    j = bessel_zeros(count)
    return np.asarray((j**2 / _bessel(1, j) ** 2 - 2 * j**2 - 4) / (192 * n**2))


def _bessel(order: int, z: Floats) -> Floats:
    """J_order(z) by the mean over a half-period."""
    nodes = 4 * (int(z.max()) + 4)  # beyond z the integrals gain a digit or more a node
    t = (np.arange(nodes) + 0.5) * pi / nodes
    return np.asarray(np.cos(order * t - z[:, None] * np.sin(t)).mean(axis=1))
