"""Rivals of ensembles: two scenes by hand, under the classical Runge–Kutta method by numba and in heyoka's batches.

A state is (θ1, θ2, θ1', θ2') of two bobs, of the cart (x, four angles, and their rates): closed formulas of two-link
pendula with the scenes' own numbers written in.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numba import njit

G = 9.81


@njit(error_model="numpy", fastmath=True)
def bobs(y, o):
    apart = y[0] - y[1]
    s, c = sin(apart), cos(apart)
    first, second = -(2 * G * sin(y[0]) + s * y[3] * y[3]), s * y[2] * y[2] - G * sin(y[1])
    share = 1 / (2 - c * c)
    o[0], o[1], o[2], o[3] = y[2], y[3], (first - c * second) * share, (2 * second - c * first) * share


@njit(error_model="numpy", fastmath=True)
def cart(y, o):
    force, mass = 0.0, 104.0
    for p in range(2):
        i = 1 + 2 * p
        s1, c1, s2, c2 = sin(y[i]), cos(y[i]), sin(y[i + 1]), cos(y[i + 1])
        w1, w2 = y[i + 5] * y[i + 5], y[i + 6] * y[i + 6]
        cd, sd = 0.5 * (c1 * c2 + s1 * s2), 0.5 * (s1 * c2 - c1 * s2)
        share = 1 / (4 / 9 - cd * cd)
        p1, p2, r1, r2 = 1.5 * c1, 0.5 * c2, -sd * w2 - 1.5 * G * s1, sd * w1 - 0.5 * G * s2
        u1, u2 = (r1 / 3 - cd * r2) * share, (4 / 3 * r2 - cd * r1) * share
        v1, v2 = (p1 / 3 - cd * p2) * share, (4 / 3 * p2 - cd * p1) * share
        force += 1.5 * s1 * w1 + 0.5 * s2 * w2 - p1 * u1 - p2 * u2
        mass -= p1 * v1 + p2 * v2
        o[i + 5], o[i + 6], o[i], o[i + 1] = u1, u2, v1, v2
    o[5] = force / mass
    for i in range(1, 5):
        o[5 + i] -= o[i] * o[5]
    for i in range(5):
        o[i] = y[5 + i]


def runge_kutta(rate: Any) -> Any:
    """Members (S, size), changed in place, over some time (s) by steps (s)."""

    @njit(error_model="numpy", fastmath=True)
    def run(members, duration, step):
        size = members.shape[1]
        a, b, c, d, z = np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)
        for y in members:
            for _ in range(round(duration / step)):
                rate(y, a)
                for i in range(size):
                    z[i] = y[i] + step / 2 * a[i]
                rate(z, b)
                for i in range(size):
                    z[i] = y[i] + step / 2 * b[i]
                rate(z, c)
                for i in range(size):
                    z[i] = y[i] + step * c[i]
                rate(z, d)
                for i in range(size):
                    y[i] += step / 6 * (a[i] + 2 * (b[i] + c[i]) + d[i])

    return run


def batches(name: str, tolerance: float) -> Any:
    """Heyoka's bare engine for "bobs" or "cart": members (S, size) over some time (s), and their ends."""
    import heyoka as hy

    size = {"bobs": 4, "cart": 10}[name]
    y = [hy.expression(f"y{i:02d}") for i in range(size)]
    rates: list[Any] = [0.0] * size
    {"bobs": _bobs, "cart": _cart}[name](y, rates, hy)
    width = hy.recommended_simd_size()
    equations = [(component, hy.expression(0.0) + its) for component, its in zip(y, rates, strict=True)]
    integrator = hy.taylor_adaptive_batch(
        equations, np.zeros((size, width)), tol=0.99 * tolerance, compact_mode=False, fast_math=True
    )

    def run(members: np.ndarray, duration: float) -> np.ndarray:
        ends = np.empty_like(members)
        for at in range(0, len(members), width):
            integrator.set_time(0.0)
            integrator.state[:] = members[at : at + width].T
            integrator.propagate_until(duration)
            ends[at : at + width] = integrator.state.T
        return ends

    return run


def _bobs(y: list[Any], o: list[Any], hy: Any) -> None:
    s, c = hy.sin(y[0] - y[1]), hy.cos(y[0] - y[1])
    first, second = -(2 * G * hy.sin(y[0]) + s * y[3] * y[3]), s * y[2] * y[2] - G * hy.sin(y[1])
    share = 1.0 / (2.0 - c * c)
    o[:] = [y[2], y[3], (first - c * second) * share, (2.0 * second - c * first) * share]


def _cart(y: list[Any], o: list[Any], hy: Any) -> None:
    force, mass, turned = hy.expression(0.0), hy.expression(104.0), {}
    for i in (1, 3):
        s1, c1, s2, c2 = hy.sin(y[i]), hy.cos(y[i]), hy.sin(y[i + 1]), hy.cos(y[i + 1])
        w1, w2 = y[i + 5] * y[i + 5], y[i + 6] * y[i + 6]
        cd, sd = 0.5 * (c1 * c2 + s1 * s2), 0.5 * (s1 * c2 - c1 * s2)
        share = 1.0 / (4 / 9 - cd * cd)
        p1, p2, r1, r2 = 1.5 * c1, 0.5 * c2, -(sd * w2) - 1.5 * G * s1, sd * w1 - 0.5 * G * s2
        u1, u2 = (r1 / 3.0 - cd * r2) * share, (4 / 3 * r2 - cd * r1) * share
        v1, v2 = (p1 / 3.0 - cd * p2) * share, (4 / 3 * p2 - cd * p1) * share
        force = force + 1.5 * s1 * w1 + 0.5 * s2 * w2 - p1 * u1 - p2 * u2
        mass = mass - p1 * v1 - p2 * v2
        turned[i] = ((u1, v1), (u2, v2))
    x2 = force / mass
    o[:5], o[5] = y[5:], x2
    for i, pairs in turned.items():
        for k, (u, v) in enumerate(pairs):
            o[5 + i + k] = u - v * x2
