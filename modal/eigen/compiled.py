"""The recursion compiled by numba (extra `fast`): Sturm counts and Rayleigh quotient steps at the pivot.

Parallel lanes are trial values of one chain, or one trial value for each of many supports.  The arithmetic is that
of `modal.eigen.sturm` and `modal.eigen.rayleigh`, operation by operation.
"""

from __future__ import annotations

import numpy as np

from modal.eigen.compiling import compiled
from modal.eigen.floats import passed, passed_with_energy
from modal.types import Floats, Ints

LANES = 16

_passed, _passed_with_energy = compiled(passed), compiled(passed_with_energy)


def count_and_mass(constants: tuple[Floats, ...], x: Floats, nudge: float) -> tuple[Ints, Floats]:
    """Pivots D < 0 and the mass at the pivot, (P, R, S), of chains (1/k, r, p, m, m J) at trial values (R, S)."""
    lanes = _side_by_side(constants, x)
    shape = (constants[0].shape[1], *lanes.shape)
    below, mass = np.empty(shape, dtype=np.int64), np.empty(shape)
    for chain, negative, felt in zip(_apart(constants), below, mass, strict=True):
        _count(*chain, lanes, nudge, negative, felt)
    return below.reshape(-1, *x.shape), mass.reshape(-1, *x.shape)


def mass_and_energy(constants: tuple[Floats, ...], x: Floats) -> tuple[Floats, Floats]:
    """Mass and energy at the pivot, (P, R, S), of chains (1/k, r, p, m, m J, q) at trial values (R, S)."""
    lanes = _side_by_side(constants, x)
    shape = (constants[0].shape[1], *lanes.shape)
    mass, energy = np.empty(shape), np.empty(shape)
    for chain, felt, whole in zip(_apart(constants), mass, energy, strict=True):
        _accumulate(*chain, lanes, felt, whole)
    return mass.reshape(-1, *x.shape), energy.reshape(-1, *x.shape)


def _side_by_side(constants: tuple[Floats, ...], x: Floats) -> Floats:
    """The trial values as rows of lanes."""
    return np.ascontiguousarray(x.reshape(1, -1) if constants[0].shape[-1] == 1 else x)


def _apart(constants: tuple[Floats, ...]) -> list[list[Floats]]:
    """The constants (n, S) of each of the P chains."""
    return [[np.ascontiguousarray(values[:, p, 0]) for values in constants] for p in range(constants[0].shape[1])]


@compiled
def _count(k, r, p, m, mJ, x, nudge, below, mass):  # type: ignore[no-untyped-def]
    n, S = k.shape
    y, mu, negative = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for row in range(x.shape[0]):
        for start in range(0, x.shape[1], LANES):
            lanes = min(LANES, x.shape[1] - start)
            y[:lanes] = x[row, start : start + lanes]
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
                below[row, start + c], mass[row, start + c] = int(negative[c]), mu[c]


@compiled
def _accumulate(k, r, p, m, mJ, q, x, mass, energy):  # type: ignore[no-untyped-def]
    n, S = k.shape
    y, mu, whole = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for row in range(x.shape[0]):
        for start in range(0, x.shape[1], LANES):
            lanes = min(LANES, x.shape[1] - start)
            y[:lanes] = x[row, start : start + lanes]
            mu[:], whole[:] = 0.0, 0.0
            for i in range(n - 1, -1, -1):
                if S == 1:
                    ki, ri, pi, mi, Ji, qi = k[i, 0], r[i, 0], p[i, 0], m[i, 0], mJ[i, 0], q[i, 0]
                    for c in range(LANES):
                        mu[c], whole[c] = _passed_with_energy(ki, ri, pi, mi, Ji, qi, y[c], mu[c], whole[c])
                else:
                    for c in range(lanes):
                        s = start + c
                        numbers = k[i, s], r[i, s], p[i, s], m[i, s], mJ[i, s], q[i, s]
                        mu[c], whole[c] = _passed_with_energy(*numbers, y[c], mu[c], whole[c])
            mass[row, start : start + lanes] = mu[:lanes]
            energy[row, start : start + lanes] = whole[:lanes]
