"""The recursion compiled by numba (extra `fast`): Sturm counts and Rayleigh quotient steps at the pivot.

Lanes side by side are trial values of one chain, or one trial value for each of many supports.  The arithmetic is that
of `modal.eigen.sturm` and `modal.eigen.rayleigh`, operation by operation.
"""

from __future__ import annotations

import numpy as np

from modal.eigen.compiling import compiled
from modal.types import Floats, Ints

LANES = 16


def counted(constants: tuple[Floats, ...], x: Floats, nudge: float) -> tuple[Ints, Floats]:
    """Pivots D < 0 and the mass at the pivot, (P, R, S), of chains (1/k, r, p, m, m J) at trial values (R, S)."""
    shape = (constants[0].shape[1], *x.shape)
    below, mass = np.empty(shape, dtype=np.int64), np.empty(shape)
    for own, negative, felt in zip(_apart(constants), below, mass, strict=True):
        _count(*own, x, nudge, negative, felt)
    return below, mass


def felt(constants: tuple[Floats, ...], x: Floats) -> tuple[Floats, Floats]:
    """Mass and energy at the pivot, (P, R, S), of chains (1/k, r, p, m, m J, q) at trial values (R, S)."""
    shape = (constants[0].shape[1], *x.shape)
    mass, energy = np.empty(shape), np.empty(shape)
    for own, felt, whole in zip(_apart(constants), mass, energy, strict=True):
        _feel(*own, x, felt, whole)
    return mass, energy


def _apart(constants: tuple[Floats, ...]) -> list[list[Floats]]:
    """The constants (n, S) of each of the P chains."""
    return [[np.ascontiguousarray(values[:, p, 0]) for values in constants] for p in range(constants[0].shape[1])]


@compiled
def _passed(k, r, p, m, mJ, y, mu, nudge):  # type: ignore[no-untyped-def]
    """(D, μ') of one link."""
    t = y * k
    D = 1.0 - (mu + r) * t - nudge
    return D, (mu * (1.0 - p * t) + (m - mJ * t)) / D


@compiled
def _count(k, r, p, m, mJ, x, nudge, below, mass):  # type: ignore[no-untyped-def]
    n, S = k.shape
    y, mu, negative = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for row in range(0, len(x), LANES if S == 1 else 1):
        for start in range(0, S, LANES):
            lanes = min(LANES, (len(x) - row) if S == 1 else (S - start))
            for c in range(lanes):
                y[c] = x[row + c, 0] if S == 1 else x[row, start + c]
            mu[:], negative[:] = 0.0, 0.0
            for i in range(n - 1, -1, -1):
                if S == 1:
                    ki, ri, pi, mi, Ji = k[i, 0], r[i, 0], p[i, 0], m[i, 0], mJ[i, 0]
                    for c in range(LANES):
                        D, mu[c] = _passed(ki, ri, pi, mi, Ji, y[c], mu[c], nudge)
                        negative[c] += 1.0 if D < 0 else 0.0
                else:
                    for c in range(lanes):
                        s = start + c
                        D, mu[c] = _passed(k[i, s], r[i, s], p[i, s], m[i, s], mJ[i, s], y[c], mu[c], nudge)
                        negative[c] += 1.0 if D < 0 else 0.0
            for c in range(lanes):
                if S == 1:
                    below[row + c, 0], mass[row + c, 0] = int(negative[c]), mu[c]
                else:
                    below[row, start + c], mass[row, start + c] = int(negative[c]), mu[c]


@compiled
def _risen(k, r, p, m, mJ, q, y, mu, energy):  # type: ignore[no-untyped-def]
    """(μ', energy') of one link."""
    t = y * k
    D = 1.0 - r * t - t * mu
    carried = (1.0 + q * t) / D
    return (mu * (1.0 - p * t) + (m - mJ * t)) / D, ((energy + r) * carried + 2 * q) * carried + p


@compiled
def _feel(k, r, p, m, mJ, q, x, mass, energy):  # type: ignore[no-untyped-def]
    n, S = k.shape
    y, mu, whole = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for row in range(0, len(x), LANES if S == 1 else 1):
        for start in range(0, S, LANES):
            lanes = min(LANES, (len(x) - row) if S == 1 else (S - start))
            for c in range(lanes):
                y[c] = x[row + c, 0] if S == 1 else x[row, start + c]
            mu[:], whole[:] = 0.0, 0.0
            for i in range(n - 1, -1, -1):
                if S == 1:
                    ki, ri, pi, mi, Ji, qi = k[i, 0], r[i, 0], p[i, 0], m[i, 0], mJ[i, 0], q[i, 0]
                    for c in range(LANES):
                        mu[c], whole[c] = _risen(ki, ri, pi, mi, Ji, qi, y[c], mu[c], whole[c])
                else:
                    for c in range(lanes):
                        s = start + c
                        numbers = k[i, s], r[i, s], p[i, s], m[i, s], mJ[i, s], q[i, s]
                        mu[c], whole[c] = _risen(*numbers, y[c], mu[c], whole[c])
            for c in range(lanes):
                if S == 1:
                    mass[row + c, 0], energy[row + c, 0] = mu[c], whole[c]
                else:
                    mass[row, start + c], energy[row, start + c] = mu[c], whole[c]
