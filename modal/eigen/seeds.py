"""Initial frequencies: eigenvalues of one dense matrix, with bounds on their rounding errors.

    1/ω² = eigenvalues of K^−½ M K^−½,

without a free cart, whose momentum stays zero: A − b bᵀ/M_tot replaces M.  Scaled by gravity, the entries are at most
of the size of the largest eigenvalue, so each is known to N ε of that one (Parlett, The Symmetric Eigenvalue Problem,
§10.3): slow modes to many digits, fast ones to fewer in proportion to their speed.
"""

from __future__ import annotations

import numpy as np

from modal.eigen.sturm import ROOM, Suspension
from modal.types import Floats

EPS = 2.0**-53
ROUNDINGS = 4
"""Rounding of an entry, in units in the last place."""
LARGEST = 1500
"""Links on a support up to which a dense matrix is used."""


def seeds(suspension: Suspension) -> tuple[Floats, Floats]:
    """ω² (N, S), ascending, and bounds on the relative errors (N, S), infinite where nothing is known."""
    matrix = _scaled(suspension)
    size = matrix.shape[-1]
    values = {1: _only, 2: _both}.get(size, np.linalg.eigvalsh)(matrix)
    largest = values[:, -1:]
    with np.errstate(all="ignore"):
        error = ROUNDINGS * size * EPS * largest / values
        error = np.where((values > 0) & np.isfinite(error), error, np.inf)
        return np.asarray((1.0 / values).T[::-1]), error.T[::-1]


def seed_matrices(links: int, supports: int) -> tuple[tuple[str, int, int], ...]:
    """The matrices behind the seeds of `supports` supports, as (name, order, count)."""
    return (("seeds", links, supports),) if 1 < links <= LARGEST else ()


def _only(matrix: Floats) -> Floats:
    return matrix[..., 0]


def _both(matrix: Floats) -> Floats:
    """The eigenvalues (S, 2) of matrices of two rows, ascending, sooner than by LAPACK."""
    first, last, beside = matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 1, 0]
    middle, half = (first + last) / 2, np.hypot((first - last) / 2, beside)
    return np.stack([middle - half, middle + half], axis=-1)


def _scaled(suspension: Suspension) -> Floats:
    """The lower triangle of each K^−½ M K^−½ (S, N, N)."""
    supports, links = suspension.supports, suspension.size
    spring = suspension.stiffness is not None and bool(suspension.stiffness[0] > 0)
    found = np.zeros((supports, links + spring, links + spring))
    root = np.empty((supports, links))
    at = 0
    for chains in suspension.chains:
        n = chains.n
        moment, length, diagonal = (values[:, :, 0].T for values in (np.sqrt(chains.b), chains.length, chains.diagonal))
        reach, diagonal = length / moment, diagonal / moment / moment
        for p in range(moment.shape[1]):
            own = slice(at + spring, at + spring + n)
            np.multiply(moment[:, p, :, None], reach[:, p, None, :], out=found[:, own, own])
            found[:, range(own.start, own.stop), range(own.start, own.stop)] = diagonal[:, p]
            root[:, at : at + n] = moment[:, p]
            at += n
    if suspension.stiffness is None:
        return found
    if spring:
        held = np.sqrt(suspension.stiffness)[:, None]
        found[:, 0, 0] = suspension.total_mass / held[:, 0] / held[:, 0]
        found[:, 1:, 0] = root / held
        return found
    root /= np.sqrt(suspension.total_mass)[:, None]
    step = max(1, ROOM // (supports * links))
    for at in range(0, links, step):
        found[:, at : at + step] -= root[:, at : at + step, None] * root[:, None]
    return found
