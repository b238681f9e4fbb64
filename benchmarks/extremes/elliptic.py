"""The simple pendulum released from rest, exactly: sin(θ/2) = k cd(ω t | k²), k = sin(a/2), by Jacobi's functions.

It is the reference for whatever moves as one pendulum: equal pendula in antiphase on a cart, a chain stiffened by
dampers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpmath import mp, mpf

DIGITS = 60


def angles(amplitude: float, square: object, times: Sequence[float]) -> np.ndarray:
    """θ (T,) in rad at these times (s), released at the float `amplitude` (rad); `square` is ω² at small angles."""
    with mp.workdps(DIGITS):
        k = mp.sin(mpf(amplitude) / 2)
        omega = mp.sqrt(mpf(square))
        theta = [2 * mp.asin(k * _cd(omega * mpf(float(time)), k * k)) for time in times]
    return np.array(theta, dtype=float)


def _cd(u: mpf, m: mpf) -> mpf:
    """The function cn/dn, with u first reduced to one period."""
    period = 4 * mp.ellipk(m)
    u -= period * mp.nint(u / period)
    return mp.ellipfun("cd", u, m=m)


def creeping(start: float, rate: float, time: float) -> float:
    """θ (rad) of a pendulum whose damper makes inertia negligible: θ' = −rate sin θ."""
    return float(2 * np.arctan(np.tan(start / 2) * np.exp(-rate * time)))
