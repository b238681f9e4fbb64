"""A rival: the textbook's full matrix under the classical Runge–Kutta method, all of it compiled by numba."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def rate(M, weight, on, y):
    half = len(M)
    angle, squared, full, sides = y[on:half], y[half + on :] ** 2, M.copy(), np.zeros(half)
    sin, cos = np.sin(angle), np.cos(angle)
    for i in range(len(angle)):
        sides[on + i] -= weight[i] * sin[i]
        for j in range(len(angle)):
            full[on + i, on + j] *= cos[i] * cos[j] + sin[i] * sin[j]
            sides[on + i] -= M[on + i, on + j] * (sin[i] * cos[j] - cos[i] * sin[j]) * squared[j]
        if on:
            full[0, 1 + i] = full[1 + i, 0] = M[0, 1 + i] * cos[i]
            sides[0] += M[0, 1 + i] * sin[i] * squared[i]
    return np.concatenate((y[half:], np.linalg.solve(full, sides)))


@njit(cache=True)
def integrated(M, weight, on, y, step, steps):
    """The y after this many steps."""
    for _ in range(steps):
        a = rate(M, weight, on, y)
        b = rate(M, weight, on, y + step / 2 * a)
        c = rate(M, weight, on, y + step / 2 * b)
        y = y + step / 6 * (a + 2 * (b + c) + rate(M, weight, on, y + step * c))
    return y
