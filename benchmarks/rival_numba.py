"""Rivals compiled by numba: the textbook under the classical Runge–Kutta method, DOP853 of equations by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import cos, sin, sqrt
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import DOP853


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


# --------------------------------------------------------------------------------- equations of one scene, by hand


@njit
def doubles(y, p, out):
    """Equal double pendula on a cart, each solved in closed form; p is g, the mass, A11, A12, A22, b1, b2."""
    g, mass, A11, A12, A22, b1, b2 = p
    half, force = len(y) // 2, 0.0
    for i in range(1, half, 2):
        s1, c1, s2, c2 = sin(y[i]), cos(y[i]), sin(y[i + 1]), cos(y[i + 1])
        w1, w2 = y[half + i] ** 2, y[half + i + 1] ** 2
        M12, s = A12 * (c1 * c2 + s1 * s2), A12 * (s1 * c2 - c1 * s2)
        r1, r2 = -g * b1 * s1 - s * w2, -g * b2 * s2 + s * w1
        q1, q2, d = b1 * c1, b2 * c2, 1 / (A11 * A22 - M12 * M12)
        f1, f2 = (A22 * r1 - M12 * r2) * d, (A11 * r2 - M12 * r1) * d
        out[i], out[i + 1] = (A22 * q1 - M12 * q2) * d, (A11 * q2 - M12 * q1) * d
        force += b1 * s1 * w1 + b2 * s2 * w2 - q1 * f1 - q2 * f2
        mass -= q1 * out[i] + q2 * out[i + 1]
        out[half + i], out[half + i + 1] = f1, f2
    out[0], out[half] = y[half], force / mass
    for i in range(1, half):
        out[half + i] -= out[i] * out[half]
        out[i] = y[half + i]


@njit
def bobs(y, p, out):
    """A chain of bobs by articulated bodies, of which a bob leaves the pull along its rope; p is g, masses, lengths."""
    g, m, l, hx, hz, pull, sines, cosines = p
    n = len(m)
    xx = xz = zz = px = pz = 0.0
    for i in range(n - 1, -1, -1):
        s, c, ww = sin(y[i]), cos(y[i]), y[n + i] ** 2
        cc, ss, sc = c * c, s * s, s * c
        nn, uu = cc * xx - 2 * sc * xz + ss * zz, ss * xx + 2 * sc * xz + cc * zz
        nu, pn, pu = sc * (xx - zz) + (cc - ss) * xz, c * px - s * pz, s * px + c * pz
        D, side = m[i] + nn, pn - l[i] * ww * nu
        along, force = m[i] + uu - nu * nu / D, pu - ww * l[i] * (m[i] + uu) - nu * side / D
        xx, xz, zz, px, pz = ss * along, sc * along, cc * along, s * force, c * force
        hx[i], hz[i], pull[i] = c + s * nu / D, c * nu / D - s, side / D
        sines[i], cosines[i] = s, c
    ax, az = 0.0, -g
    for i in range(n):
        turned, ww = -(hx[i] * ax + hz[i] * az + pull[i]), l[i] * y[n + i] ** 2
        ax, az = ax + turned * cosines[i] - ww * sines[i], az - turned * sines[i] - ww * cosines[i]
        out[i], out[n + i] = y[n + i], turned / l[i]


# ----------------------------------------------------------------------------------- DOP853, its sums written out


@cache
def stepping(rates: Any) -> Callable[..., Any]:
    """A function of y, p, the end (s), tolerances, ascending times and rows y for these; returns steps and calls."""
    n = DOP853.n_stages
    K = "K[{}, i]"
    lines = ["def run(y, p, end, rtol, atol, times, rows):", " t, at, calls, steps, refused = 0.0, 0, 1, 0, False"]
    lines += [f" K, z, w = np.empty(({n + 4}, len(y))), np.empty(len(y)), np.empty(len(y))"]
    lines += [" F = np.empty((7, len(y)))", " rates(y, p, K[0])", " h = 0.01 / (1 + np.max(np.abs(K[0])))"]
    lines += [" while t < end:", "  h = min(h, end - t)"]
    for stage in range(1, n + 1):
        lines += _stage(DOP853.B if stage == n else DOP853.A[stage][:stage], "z", stage, "  ")
    lines += [f"  calls, e5, e3 = calls + {n}, 0.0, 0.0", "  for i in range(len(y)):"]
    lines += ["   scale = 1 / (atol + rtol * max(abs(y[i]), abs(z[i])))"]
    lines += [f"   a, b = ({_sum(DOP853.E5, K)}) * scale, ({_sum(DOP853.E3, K)}) * scale"]
    lines += ["   e5 += a * a", "   e3 += b * b", "  both = e5 + 0.01 * e3"]
    lines += ["  error = h * e5 / sqrt(both * len(y)) if both > 0 else 0.0"]
    lines += ["  if not error < 1:", "   h, refused = h * max(0.2, 0.9 * error ** -0.125), True", "   continue"]
    lines += ["  factor = min(10.0, 0.9 * error ** -0.125) if error > 0 else 10.0"]
    lines += ["  factor, refused, steps = min(1.0, factor) if refused else factor, False, steps + 1"]
    lines += ["  if at < len(times) and times[at] <= t + h:"]
    for stage, row in enumerate(DOP853.A_EXTRA, n + 1):
        lines += _stage(row, "w", stage, "   ")
    lines += [
        "   calls += 3",
        "   for i in range(len(y)):",
        "    F[0, i], F[1, i] = z[i] - y[i], h * K[0, i] - z[i] + y[i]",
    ]
    lines += [f"    F[2, i] = 2 * F[0, i] - h * (K[{n}, i] + K[0, i])"]
    lines += [f"    F[{k}, i] = h * ({_sum(row, K)})" for k, row in enumerate(DOP853.D, 3)]
    within = "F[6, i]"
    for k in range(5, -1, -1):
        within = f"(F[{k}, i] + {'(1 - x)' if k % 2 == 0 else 'x'} * {within})"
    lines += ["   while at < len(times) and times[at] <= t + h:", "    x = (times[at] - t) / h"]
    lines += ["    for i in range(len(y)):", f"     rows[at, i] = y[i] + x * {within}", "    at += 1"]
    lines += ["  t += h", "  h *= factor", "  for i in range(len(y)):", f"   y[i], K[0, i] = z[i], K[{n}, i]"]
    space: dict[str, Any] = {"np": np, "sqrt": sqrt, "rates": rates}
    exec("\n".join((*lines, " return steps, calls")), space)
    return njit(space["run"])  # type: ignore[no-any-return]


def _sum(row: Sequence[float], name: str) -> str:
    return " + ".join(f"{float(share)!r} * {name.format(stage)}" for stage, share in enumerate(row) if share)


def _stage(row: Sequence[float], z: str, stage: int, before: str) -> list[str]:
    loop = f"for i in range(len(y)): {z}[i] = y[i] + h * ({_sum(row, 'K[{}, i]')})"
    return [before + loop, f"{before}rates({z}, p, K[{stage}])"]
