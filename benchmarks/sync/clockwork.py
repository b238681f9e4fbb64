"""Equations of clocks and metronomes of one link each on a cart, with kicks, that share nothing with the package.

A state is y = (θ_1 … θ_N, θ_1' … θ_N', x, x').
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

G = 9.81


class Clocks(NamedTuple):
    """Numbers of the equations: arrays (N,) of the pendula, with mass × centre `first` and `moment` about the pivot.

    Kicks of an `impulse` (N m s) act where an angle leaves ±`limit` (rad), if they are not 0.
    """

    mass: np.ndarray
    first: np.ndarray
    moment: np.ndarray
    damper: np.ndarray
    strength: np.ndarray
    limit: np.ndarray
    impulse: np.ndarray
    base: float
    base_damper: float
    base_spring: float

    @property
    def period(self) -> float:
        """The period of small swings of the first pendulum (s)."""
        return 2 * pi / sqrt(G * self.first[0] / self.moment[0])


@njit(cache=True)
def coupled(p, y, rates):
    """Add the cart's acceleration to rates, whose entries n : 2n are those of pendula on a cart at rest."""
    n = len(p.mass)
    mass = p.base
    for i in range(n):
        mass += p.mass[i] - (p.first[i] * cos(y[i])) ** 2 / p.moment[i]
        rates[2 * n + 1] -= p.first[i] * cos(y[i]) * rates[n + i]
    rates[2 * n + 1] /= mass
    for i in range(n):
        rates[n + i] -= p.first[i] * cos(y[i]) * rates[2 * n + 1] / p.moment[i]


@njit(cache=True)
def rate(p, y, rates):
    """The time derivative of a state."""
    n = len(p.mass)
    rates[2 * n] = y[2 * n + 1]
    rates[2 * n + 1] = -p.base_damper * y[2 * n + 1] - p.base_spring * y[2 * n]
    for i in range(n):
        s, w = sin(y[i]), y[n + i]
        torque = (p.strength[i] * (1 - (y[i] / p.limit[i]) ** 2) - p.damper[i]) * w - G * p.first[i] * s
        rates[i], rates[n + i] = w, torque / p.moment[i]
        rates[2 * n + 1] += p.first[i] * s * w * w
    coupled(p, y, rates)


@njit(cache=True)
def stepped(p, y, h):
    """The state after a step of the classical Runge–Kutta method."""
    a, b, c, d = np.empty((4, len(y)))
    rate(p, y, a)
    rate(p, y + h / 2 * a, b)
    rate(p, y + h / 2 * b, c)
    rate(p, y + h * c, d)
    return y + h / 6 * (a + 2 * (b + c) + d)


@njit(cache=True)
def kicked(p, y, h, sides):
    """The state after a step of clocks that are kicked where they pass `sides` times the limit, then on the other."""
    n = len(p.mass)
    while True:
        after, earliest, clock = stepped(p, y, h), h, -1
        for i in range(n):
            if p.impulse[i] == 0.0:
                continue
            # a clock that is kicked together with another may be at its limit but for rounding
            before, over = min(sides[i] * y[i] - p.limit[i], 0.0), sides[i] * after[i] - p.limit[i]
            if over >= 0 and h * before / (before - over - 1e-300) < earliest:
                earliest, clock = h * before / (before - over - 1e-300), i
        if clock < 0:
            return after
        part = earliest
        for _ in range(6):  # Newton's method for the time of passing
            y_then = stepped(p, y, part)
            part -= (sides[clock] * y_then[clock] - p.limit[clock]) / (sides[clock] * y_then[n + clock])
        y, jump = stepped(p, y, part), np.zeros(len(y))
        jump[n + clock] = sides[clock] * p.impulse[clock] / p.moment[clock]
        coupled(p, y, jump)
        y[n:] += jump[n:]
        y[clock] = sides[clock] * p.limit[clock]
        sides[clock] *= -1
        h -= part
