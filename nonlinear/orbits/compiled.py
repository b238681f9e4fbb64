"""`nonlinear.orbits.flow` compiled by numba (extra `fast`), for scenes without external forces.

The lines are those of `nonlinear.dynamics.variational` and of `flow`, where they are explained: M is factored by
Cholesky's method, and y' and J V come from one solution with all right-hand sides.  numba's cache depends on the date
of this file alone: whoever changes the constants in `steps` must touch this file as well.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from modal.eigen.compiling import compiled
from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import undisturbed
from nonlinear.dynamics.variational import Variational
from nonlinear.integration import Escaping
from nonlinear.orbits.steps import (
    ERRORS,
    FIRST,
    GROWS,
    LEAST,
    MOST,
    SAFETY,
    SHARP,
    SHRINKS,
    STAGES,
    TOGETHER,
    Passed,
    Path,
)

BISECTIONS = 60

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
def _add_mass_slope(by_q, Z, u, first, A, b):  # type: ignore[no-untyped-def]
    """Add ∂(M u)/∂q at constant u to `by_q`."""
    links = len(b)
    for i in range(links):
        t = Z[first + i, 0]
        for j in range(links):
            if A[i, j] != 0.0 and i != j:
                inner = A[i, j] * np.sin(t - Z[first + j, 0]) * u[first + j, 0]
                by_q[first + i, first + j] += inner
                by_q[first + i, first + i] -= inner
        if first:
            by_q[1 + i, 1 + i] -= b[i] * np.sin(t) * u[0, 0]
            by_q[0, 1 + i] -= b[i] * np.sin(t) * u[1 + i, 0]


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
    _add_mass_slope(by_q, Z, a, first, A, b)
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
def _attempt(Z, K, z, length, first, scene, room, table):  # type: ignore[no-untyped-def]
    """The end z of a step and all its stages K, from the first one; whether mass matrices were positive definite."""
    good, stages = True, len(table) - 1
    for stage in range(1, stages + 1):
        z[:] = 0.0
        for k in range(stage):
            if table[stage, k] != 0.0:
                z += table[stage, k] * K[k]
        z *= length
        z += Z
        good = good and rate(z, first, scene, room[0], room[1], room[2], room[3], K[stage])
    return good


@compiled
def _error(Z, z, K, length, tolerance, scale, errors):  # type: ignore[no-untyped-def]
    """The error of y in a step over the tolerance."""
    size, fifth, third = len(scale), 0.0, 0.0
    for i in range(size):
        one = other = 0.0
        for k in range(len(K)):
            one += errors[0, k] * K[k, i, 0]
            other += errors[1, k] * K[k, i, 0]
        allowed = tolerance * (scale[i] + max(abs(Z[i, 0]), abs(z[i, 0])))
        fifth += (one / allowed) ** 2
        third += (other / allowed) ** 2
    both = fifth + 0.01 * third
    return length * fifth / np.sqrt(both * size) if both != 0.0 else 0.0


@compiled
def _turned(Z, start, joints, j):  # type: ignore[no-untyped-def]
    """The value at a joint from those of its links, which begin at this place of y."""
    below, above = joints[0], joints[1]
    value = Z[start + below[j], 0]
    return value - Z[start + above[j], 0] if above[j] >= 0 else value


@compiled
def _foremost(Z, first, joints, side, least):  # type: ignore[no-untyped-def]
    """The joint that is furthest beyond the angle of its next kick (−1: none beyond `least`), how far, and its rate."""
    found, furthest, speed = -1, least, 0.0
    for j in range(len(side)):
        over = side[j] * (_turned(Z, first, joints, j) - joints[2][j]) - joints[4][j]
        if over > furthest:
            found, furthest = j, over
            speed = side[j] * _turned(Z, len(Z) // 2 + first, joints, j)
    return found, furthest, speed


@compiled
def _met(Z, K, z, length, first, scene, room, table, joints, side):  # type: ignore[no-untyped-def]
    """The length of the step to the first kick in a step that ends at z, and its joint; −1 without a kick."""
    for j in range(len(side)):
        over = side[j] * (_turned(Z, first, joints, j) - joints[2][j]) - joints[4][j]
        if over >= -TOGETHER and side[j] * _turned(Z, len(Z) // 2 + first, joints, j) > 0:
            return 0.0, j
    joint, over, _ = _foremost(z, first, joints, side, 0.0)
    if joint < 0:
        return 0.0, -1
    y, stages, end = Z[:, :1].copy(), K[:, :, :1].copy(), np.empty((len(Z), 1))
    low, high = 0.0, length
    before = side[joint] * (_turned(Z, first, joints, joint) - joints[2][joint]) - joints[4][joint]
    part = length * before / (before - over)
    for _ in range(BISECTIONS):
        if not low < part < high:
            part = (low + high) / 2
        _attempt(y, stages, end, part, first, scene, room, table)
        joint, over, speed = _foremost(end, first, joints, side, -np.inf)
        if over > 0:
            high = part
        else:
            low = part
        step = over / speed if speed > 0 else np.inf
        part -= step
        if abs(step) < SHARP * length:
            break
    return part, joint


@compiled
def _kicked(Z, f, joint, first, scene, room, joints, side):  # type: ignore[no-untyped-def]
    """Z becomes what it is after a kick, V by the saltation matrix; f is y' before it."""
    A, b = scene[0], scene[1]
    M, by_q = room[0], room[1]
    half, width = len(Z) // 2, Z.shape[1]
    _forces(Z[:, 0].copy(), first, A, b, scene[2], scene[4], scene[5], M, by_q, room[2], room[3], scene[3])
    _factored(M)
    u, n = np.zeros((half, 1)), np.zeros(half)
    impulse = side[joint] * joints[3][joint]
    u[first + joints[0][joint], 0] += impulse
    n[first + joints[0][joint]] = 1.0
    if joints[1][joint] >= 0:
        u[first + joints[1][joint], 0] -= impulse
        n[first + joints[1][joint]] = -1.0
    _solved(M, u)
    by_q[:] = 0.0
    _add_mass_slope(by_q, Z, u, first, A, b)
    columns = np.zeros((half, width))
    columns[:, 0] = f[:half]
    columns[:, 1:] = Z[:half, 1:]
    turned = -(by_q @ columns)
    _solved(M, turned)
    hit = np.zeros(width)
    for i in range(half):
        for k in range(width):
            hit[k] += n[i] * columns[i, k]
    carried = f.copy()
    carried[half:] += turned[:, 0]
    Z[half:, 0] += u[:, 0]
    Z[half:, 1:] += turned[:, 1:]
    after = np.empty_like(Z)
    rate(Z, first, scene, room[0], room[1], room[2], room[3], after)
    for k in range(1, width):
        for i in range(len(Z)):
            Z[i, k] += (after[i, 0] - carried[i]) * hit[k] / hit[0]
    side[joint] = -side[joint]


@compiled
def _flow(Z, first, scene, whole, tolerance, scale, table, errors, joints, side, path):  # type: ignore[no-untyped-def]
    """Z becomes the end of the flow; the number of ends of steps that were kept in `path`, 0 where it fails."""
    size, width = Z.shape
    half, stages = size // 2, len(table) - 1
    room = (np.zeros((half, half)), np.zeros((half, half)), np.zeros((half, half)), np.zeros(half))
    K, z = np.zeros((stages + 1, size, width)), np.empty_like(Z)
    times, states, rates = path
    if not rate(Z, first, scene, room[0], room[1], room[2], room[3], K[0]):
        return 0
    times[0], states[0], rates[0] = 0.0, Z[:, 0], K[0, :, 0]
    time, length, kept = 0.0, whole * FIRST, 1
    for _ in range(MOST):
        length = min(length, whole - time)
        if length <= LEAST * whole:
            return kept
        good = _attempt(Z, K, z, length, first, scene, room, table)
        error = _error(Z, z, K, length, tolerance, scale, errors)
        if not good or not error < 1:
            length *= max(SHRINKS, SAFETY * error ** (-1 / 8)) if good and np.isfinite(error) else SHRINKS
            if length <= LEAST * whole:
                return 0
            continue
        grown = length * (min(GROWS, SAFETY * error ** (-1 / 8)) if error != 0.0 else GROWS)
        part, joint = _met(Z, K, z, length, first, scene, room, table, joints, side) if len(side) else (0.0, -1)
        if kept + 2 > len(times):
            return 0
        if joint >= 0:
            if part > 0.0:
                _attempt(Z, K, z, part, first, scene, room, table)
                Z[:] = z
                time += part
                K[0] = K[stages]
            times[kept], states[kept], rates[kept] = time, Z[:, 0], K[0, :, 0]
            kept += 1
            _kicked(Z, K[0, :, 0].copy(), joint, first, scene, room, joints, side)
            rate(Z, first, scene, room[0], room[1], room[2], room[3], K[0])
        else:
            time += length
            Z[:] = z
            K[0] = K[stages]
        length = grown
        times[kept], states[kept], rates[kept] = time, Z[:, 0], K[0, :, 0]
        kept += 1
    return 0


def passed(
    equations: Variational,
    y: Floats,
    V: Floats,
    time: float,
    tolerance: float,
    scale: Floats,
    joints: Escaping | None = None,
    side: Floats | None = None,
    most: int = 2000,
) -> Passed:
    """The same as `Flow` in compiled steps; `side` (J,) of the `joints` with escapements as there."""
    Z, size = np.column_stack((y, V)), len(y)
    path = (np.empty(most), np.empty((most, size)), np.empty((most, size)))
    none, nowhere = np.empty(0), np.empty(0, dtype=np.int64)
    watched = (joints.below, joints.above, joints.bent, joints.impulse, joints.angle) if joints else None
    watched = watched or (nowhere, nowhere, none, none, none)
    turned = side.copy() if side is not None else none
    first = int(equations.layout.on_cart)
    with undisturbed():
        kept = _flow(Z, first, equations.constants, time, tolerance, scale, TABLE, ERRORS, watched, turned, path)
    if not kept:
        raise ComputationError("the motion takes too many steps to be followed over a period")
    times, states, rates = (part[:kept] for part in path)
    return Passed(Z[:, 0], Z[:, 1:], turned, Path(times, states, rates))
