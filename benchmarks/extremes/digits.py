"""The textbook equations in many digits: the reference for every other route.

With q = (x, θ) the equations A cos(θ_i − θ_j) are assembled from the scene's own floats and solved by mpmath, and the
motion is found by the extrapolated midpoint rule (Gragg, SIAM J. Numer. Anal. 2, 1965; Hairer, Nørsett & Wanner,
Solving Ordinary Differential Equations I, 1993, §II.9): steps of 2, 4, …, 2k substeps, extrapolated to order 2k.  It
shares with the toolkit neither the recursion nor an integrator, only the pair (A, b), which is plain arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpmath import mp, mpf

from modal import pair
from modal.scene import Cart, Scene
from nonlinear.system import State

COLUMNS = 12
SAFETY, GROW, SHRINK = 0.9, 3.0, 0.2
Vector = list[mpf]
Derivative = Callable[[Vector], Vector]


def textbook(scene: Scene) -> Derivative:
    """(q', q'') of (q, q') with springs and dampers; q = (x, θ) on a cart, else θ."""
    chains = [_chain(pendulum.links) for pendulum in scene.pendulum for _ in range(pendulum.count)]
    cart = scene.support if isinstance(scene.support, Cart) else None
    size = sum(len(b) for _, b, *_ in chains) + (cart is not None)

    def derivative(y: Vector) -> Vector:
        q, v = y[:size], y[size:]
        M, f = mp.zeros(size), mp.zeros(size, 1)
        at = int(cart is not None)
        if cart:
            M[0, 0] = mpf(cart.mass) + sum(mass for *_, mass in chains)
            f[0] = -mpf(cart.damping) * v[0] - mpf(cart.stiffness) * q[0]
        for A, b, dampers, springs, _ in chains:
            _filled(M, f, q, v, at, (A, b, dampers, springs), mpf(scene.gravity), cart is not None)
            at += len(b)
        return v + list(mp.lu_solve(M, f))

    return derivative


def _chain(links) -> tuple:  # type: ignore[no-untyped-def]
    rows = [link for link in links for _ in range(link.count)]
    m, l, c, I = ([mpf(getattr(row, name)) for row in rows] for name in ("mass", "length", "centre", "inertia"))
    dampers, springs = ([mpf(getattr(row, name)) for row in rows] for name in ("damping", "stiffness"))
    return pair.inertia_matrix(m, l, c, I), pair.first_moments(m, l, c), dampers, springs, sum(m)


def _filled(M, f, q, v, at, chain, g, on_cart) -> None:  # type: ignore[no-untyped-def]
    A, b, dampers, springs = chain
    n = len(b)
    for i in range(n):
        angle, rate = q[at + i], v[at + i]
        sine, cosine = mp.sin(angle), mp.cos(angle)
        f[at + i] -= g * b[i] * sine
        if on_cart:
            M[0, at + i] = M[at + i, 0] = b[i] * cosine
            f[0] += b[i] * sine * rate**2
        for j in range(n):
            apart = angle - q[at + j]
            M[at + i, at + j] = A[i][j] * mp.cos(apart)
            f[at + i] -= A[i][j] * mp.sin(apart) * v[at + j] ** 2
        bend, speed = (angle - q[at + i - 1], rate - v[at + i - 1]) if i else (angle, rate)
        moment = dampers[i] * speed + springs[i] * bend
        f[at + i] -= moment
        if i:
            f[at + i - 1] += moment


def motion(scene: Scene, start: State, times, digits: int = 40, tolerance: float = 1e-22):  # type: ignore[no-untyped-def]
    """Angles (T, L) in rad at these times (s), ascending from 0, as floats."""
    return np.array([row[-start.links.size :] for row in states(scene, start, times, digits, tolerance)[0]], float)


def states(scene: Scene, start: State, times, digits: int = 40, tolerance: float = 1e-22):  # type: ignore[no-untyped-def]
    """Positions (x, θ) and rates at these times, as lists of mpf."""
    with mp.workdps(digits):
        head, rate = ([start.cart], [start.cart_rate]) if isinstance(scene.support, Cart) else ([], [])
        y = [mpf(float(value)) for value in (*head, *start.links, *rate, *start.link_rates)]
        derivative, size = textbook(scene), len(y) // 2
        rows, now, step = [], mpf(0), None
        for time in times:
            y, now, step = _until(derivative, y, now, mpf(float(time)), step, mpf(tolerance))
            rows.append(y)
        return [row[:size] for row in rows], [row[size:] for row in rows]


def _until(f: Derivative, y: Vector, now: mpf, end: mpf, step: mpf | None, tolerance: mpf):  # type: ignore[no-untyped-def]
    while now < end:
        wished = step or _first(f, y, end - now)
        length = min(wished, end - now)
        after, error = _extrapolated(f, y, length)
        factor = SAFETY * (tolerance / error) ** (mpf(1) / (2 * COLUMNS - 1)) if error else mpf(GROW)
        if error <= tolerance:
            now, y = now + length, after
            if length < wished:
                factor = max(factor, wished / length)
        step = length * min(max(factor, mpf(SHRINK)), max(mpf(GROW), wished / length))
    return y, now, step


def _first(f: Derivative, y: Vector, most: mpf) -> mpf:
    size = max(map(abs, f(y)[len(y) // 2 :]))
    return min(most, 1 / mp.sqrt(size)) if size else most


def _extrapolated(f: Derivative, y: Vector, length: mpf) -> tuple[Vector, mpf]:
    """The state after one step, and what the last column changed, over the largest position and rate."""
    counts, table = [2 * (k + 1) for k in range(COLUMNS)], []
    begun = f(y)
    for k, count in enumerate(counts):
        row = [_midpoint(f, y, begun, length, count)]
        for j in range(k):
            ratio = mpf(count) ** 2 / counts[k - j - 1] ** 2 - 1
            row.append([a + (a - b) / ratio for a, b in zip(row[j], table[-1][j], strict=True)])
        table.append(row)
    best, other = table[-1][-1], table[-1][-2]
    half = len(y) // 2
    parts = [slice(0, half), slice(half, None)]
    return best, max(_over(best[part], other[part]) for part in parts)


def _over(best: Vector, other: Vector) -> mpf:
    size = max(map(abs, best))
    gone = max(abs(a - b) for a, b in zip(best, other, strict=True))
    return gone / size if size else gone


def _midpoint(f: Derivative, y: Vector, begun: Vector, length: mpf, count: int) -> Vector:
    h = length / count
    before, now = y, [a + h * b for a, b in zip(y, begun, strict=True)]
    for _ in range(count - 1):
        before, now = now, [a + 2 * h * b for a, b in zip(before, f(now), strict=True)]
    return now
