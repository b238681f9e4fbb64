"""Frequencies and mode shapes of few equal links and of equal pendula on a cart in closed form.

Squares of frequencies are given as ω²l/g, without units, if there is only one length.  For n equal bobs, counted
j = 0, 1, … from the free end, the tension (j+1) m g in the rod above bob j makes the displacements obey

    (j+1) y_{j+1} = (2j+1 − x) y_j − j y_{j−1},    x = ω²l/g,    y_0 = 1,    y_n = 0 at the support,

the recurrence of Laguerre's polynomials (Abramowitz & Stegun, 22.7.12): y_j = L_j(x_r) at the zeros x_r of L_n.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from modal.types import Floats

SINGLE_ROD = 3 / 2
"""ω²l/g of one uniform rod: m g (l/2) over m l²/3."""

TWO_EQUAL_RODS = (3 - 6 / sqrt(7), 3 + 6 / sqrt(7))
"""ω²l/g of two equal uniform rods: zeros of 7x² − 42x + 27."""


def equal_bobs(n: int) -> Floats:
    """ω²l/g (n,), ascending, of n equal bobs: the zeros x_r of L_n, to a few units in the last place.

    Their Jacobi matrix, k+1 + k on the diagonal and −k next to it (Golub & Welsch, Math. Comp. 23, 221 (1969)), is
    BᵀB with B bidiagonal, √1, …, √n on the diagonal and −√1, …, −√(n−1) above it.  Such a matrix determines its
    singular values √x_r to high relative accuracy (Demmel & Kahan, SIAM J. Sci. Stat. Comput. 11, 873 (1990)).
    """
    root = np.sqrt(np.arange(1.0, n + 1))
    B = np.diag(root) - np.diag(root[:-1], 1)
    return np.linalg.svd(B, compute_uv=False)[::-1] ** 2


def equal_bob_shapes(n: int) -> Floats:
    """Displacements (n, n) of n equal bobs, row j the j-th bob from the free end, column r the mode: L_j(x_r).

    The free end moves by 1; the angle of the rod above bob j is (y_j − y_{j+1})/l with y_n = 0.
    """
    x = equal_bobs(n)
    y = [np.ones(n), 1 - x]
    for j in range(1, n - 1):
        y.append(((2 * j + 1 - x) * y[j] - j * y[j - 1]) / (j + 1))
    return np.array(y[:n])


def equal_bob_effective_masses(n: int) -> Floats:
    """Modal effective masses (n,) of n equal bobs over the mass m of one: exactly 1/x_r = g/(l ω_r²).

    By definition (m Σ y_j)²/(m Σ y_j²) with y_j = L_j(x_r), j < n.  Here Σ L_j = −L_n', and at a zero of L_n, where
    x L_n' = −n L_{n−1} (Abramowitz & Stegun, 22.8.6), Christoffel and Darboux (22.12.1) give Σ L_j² = −n L_{n−1} L_n'
    = x_r L_n'².  Their sum is the total mass: Σ 1/x_r = n.
    """
    return 1 / equal_bobs(n)


class CartModes(NamedTuple):
    """The frequencies (rad/s) of N equal simple pendula on a free cart."""

    translation: float
    antiphase: float
    in_phase: float


def simple_pendula_on_cart(
    count: int, mass: float, length: float, cart_mass: float, gravity: float = 9.81
) -> CartModes:
    """0 once, ω² = g/l count − 1 times with the cart still, and ω² = (g/l)(1 + count m/m_c) once.

    `mass` of one bob and `cart_mass` in kg, `length` in m, `gravity` in m/s².
    """
    still = sqrt(gravity / length)
    return CartModes(0.0, still, still * sqrt(1 + count * mass / cart_mass))


def beat_period(slow: float, fast: float) -> float:
    """2π/(ω_fast − ω_slow) (s): the time in which two modes exchange their energy and return it.

    For light simple pendula on a heavy cart about 4π/(ω N m/m_c), ω² = g/l.
    """
    return 2 * pi / (fast - slow)
