"""`nonlinear.orbits.flow` compiled by numba (extra `fast`), for scenes without kicks and external forces.

The lines are those of `nonlinear.dynamics.variational` and of `flow`, where they are explained: M is factored by
Cholesky's method, and y' and J V come from one solution with all right-hand sides.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from modal.eigen.compiling import compiled
from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import undisturbed
from nonlinear.dynamics.variational import Variational
from nonlinear.orbits.steps import ERRORS, FIRST, GROWS, LEAST, MOST, SAFETY, SHRINKS, STAGES, Passed, Path

TABLE = np.zeros((STAGES + 1, STAGES))
TABLE[:STAGES] = DOP853.A[:STAGES, :STAGES]
TABLE[STAGES] = DOP853.B


@compiled
def _forces(y, first, A, b, gravity, cart, rows, M, by_q, by_v, force, total):  # type: ignore[no-untyped-def]
    """M, the forces without inertia of the accelerations, and the parts of ∂r that need no accelerations."""
    links = len(b)
    half = first + links
    by_q[:] = 0.0
    by_v[:] = 0.0
    for i in range(links):
        t, w = y[first + i], y[half + first + i]
        s, c = np.sin(t), np.cos(t)
        load = -gravity * b[i] * s
        by_q[first + i, first + i] += gravity * b[i] * c
        for j in range(links):
            if A[i, j] == 0.0:
                M[first + i, first + j] = 0.0
                continue
            other, rate = y[first + j], y[half + first + j]
            C, S = A[i, j] * np.cos(t - other), A[i, j] * np.sin(t - other)
            M[first + i, first + j] = C
            load -= S * rate * rate
            by_v[first + i, first + j] += 2 * S * rate
            by_q[first + i, first + j] -= C * rate * rate
            by_q[first + i, first + i] += C * rate * rate
        force[first + i] = load
        if first:
            M[0, 1 + i] = M[1 + i, 0] = b[i] * c
            by_v[0, 1 + i] = -2 * b[i] * s * w
            by_q[0, 1 + i] = -b[i] * c * w * w
    if first:
        M[0, 0], push = total, -cart[0] * y[0] - cart[1] * y[half]
        for i in range(links):
            push += b[i] * np.sin(y[1 + i]) * y[half + 1 + i] ** 2
        force[0] = push
        by_q[0, 0], by_v[0, 0] = cart[0], cart[1]
    for i in range(len(rows[0]) if len(rows) else 0):
        at, above = first + i, first + i - 1
        turned, speed, top = y[at], y[half + at], rows[5, i] == 1.0
        if not top:
            turned, speed = turned - y[above], speed - y[half + above]
        turned -= rows[4, i]
        resistance = rows[2, i] - rows[1, i] - rows[3, i] * turned * turned
        torque = -rows[0, i] * turned + resistance * speed
        by_angle = -rows[0, i] - 2 * rows[3, i] * turned * speed
        force[at] += torque
        by_q[at, at] -= by_angle
        by_v[at, at] -= resistance
        if not top:
            force[above] -= torque
            for D, slope in ((by_q, by_angle), (by_v, resistance)):
                D[at, above] += slope
                D[above, at] += slope
                D[above, above] -= slope


@compiled
def _factored(M):  # type: ignore[no-untyped-def]
    """Cholesky's factor in the lower half of M; whether there is one."""
    for k in range(len(M)):
        for j in range(k):
            M[k, k] -= M[k, j] * M[k, j]
        if not M[k, k] > 0.0:
            return False
        M[k, k] = np.sqrt(M[k, k])
        for i in range(k + 1, len(M)):
            for j in range(k):
                M[i, k] -= M[i, j] * M[k, j]
            M[i, k] /= M[k, k]
    return True


@compiled
def _solved(L, X):  # type: ignore[no-untyped-def]
    """X becomes M⁻¹ X by the factor L."""
    for k in range(len(L)):
        for j in range(k):
            X[k] -= L[k, j] * X[j]
        X[k] /= L[k, k]
    for k in range(len(L) - 1, -1, -1):
        for j in range(k + 1, len(L)):
            X[k] -= L[j, k] * X[j]
        X[k] /= L[k, k]


@compiled
def rate(Z, first, scene, M, by_q, by_v, force, found):  # type: ignore[no-untyped-def]
    """The derivative of (y, V) into `found`; whether the mass matrix is positive definite."""
    A, b, gravity, total, cart, rows = scene
    links = len(b)
    half = first + links
    _forces(Z[:, 0].copy(), first, A, b, gravity, cart, rows, M, by_q, by_v, force, total)
    if not _factored(M):
        return False
    found[:half] = Z[half:]
    a = force.reshape(half, 1).copy()
    _solved(M, a)
    for i in range(links):
        t = Z[first + i, 0]
        for j in range(links):
            if A[i, j] != 0.0 and i != j:
                inner = A[i, j] * np.sin(t - Z[first + j, 0]) * a[first + j, 0]
                by_q[first + i, first + j] += inner
                by_q[first + i, first + i] -= inner
        if first:
            by_q[1 + i, 1 + i] -= b[i] * np.sin(t) * a[0, 0]
            by_q[0, 1 + i] -= b[i] * np.sin(t) * a[1 + i, 0]
    found[half:, 0] = a[:, 0]
    if Z.shape[1] > 1:
        right = found[half:, 1:]
        right[:] = 0.0
        for i in range(half):
            for j in range(half):
                if by_q[i, j] != 0.0:
                    right[i] -= by_q[i, j] * Z[j, 1:]
                if by_v[i, j] != 0.0:
                    right[i] -= by_v[i, j] * Z[half + j, 1:]
        _solved(M, right)
    return True


@compiled
def _flow(Z, first, scene, whole, tolerance, scale, table, errors, times, states, rates):  # type: ignore[no-untyped-def]
    """Z becomes the end of the flow; the number of ends of steps that were kept, 0 where it fails."""
    size, width = Z.shape
    half, stages = size // 2, len(table) - 1
    M, by_q, by_v = np.zeros((half, half)), np.zeros((half, half)), np.zeros((half, half))
    force, K, z = np.zeros(half), np.zeros((stages + 1, size, width)), np.empty_like(Z)
    if not rate(Z, first, scene, M, by_q, by_v, force, K[0]):
        return 0
    times[0], states[0], rates[0] = 0.0, Z[:, 0], K[0, :, 0]
    time, length, kept = 0.0, whole * FIRST, 1
    for _ in range(MOST):
        length = min(length, whole - time)
        if length <= LEAST * whole:
            return kept
        good = True
        for stage in range(1, stages + 1):
            z[:] = 0.0
            for k in range(stage):
                if table[stage, k] != 0.0:
                    z += table[stage, k] * K[k]
            z *= length
            z += Z
            good = good and rate(z, first, scene, M, by_q, by_v, force, K[stage])
        fifth = third = 0.0
        for i in range(size):
            one = other = 0.0
            for k in range(stages + 1):
                one += errors[0, k] * K[k, i, 0]
                other += errors[1, k] * K[k, i, 0]
            allowed = tolerance * (scale[i] + max(abs(Z[i, 0]), abs(z[i, 0])))
            fifth += (one / allowed) ** 2
            third += (other / allowed) ** 2
        both = fifth + 0.01 * third
        error = length * fifth / np.sqrt(both * size) if both != 0.0 else 0.0
        if not good or not error < 1:
            length *= max(SHRINKS, SAFETY * error ** (-1 / 8)) if good and np.isfinite(error) else SHRINKS
            if length <= LEAST * whole:
                return 0
            continue
        time += length
        length *= min(GROWS, SAFETY * error ** (-1 / 8)) if error != 0.0 else GROWS
        Z[:] = z
        K[0] = K[stages]
        if kept == len(times):
            return 0
        times[kept], states[kept], rates[kept] = time, Z[:, 0], K[0, :, 0]
        kept += 1
    return 0


def passed(
    equations: Variational, y: Floats, V: Floats, time: float, tolerance: float, scale: Floats, most: int = 2000
) -> Passed:
    """The same as `Flow` in compiled steps."""
    Z, size = np.column_stack((y, V)), len(y)
    times, states, rates = np.empty(most), np.empty((most, size)), np.empty((most, size))
    first = int(equations.layout.on_cart)
    with undisturbed():
        kept = _flow(Z, first, equations.constants, time, tolerance, scale, TABLE, ERRORS, times, states, rates)
    if not kept:
        raise ComputationError("the motion takes too many steps to be followed over a period")
    return Passed(Z[:, 0], Z[:, 1:], np.empty(0), Path(times[:kept], states[:kept], rates[:kept]))
