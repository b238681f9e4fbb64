"""Initial frequencies: eigenvalues of one dense matrix, with bounds on their rounding errors.

    1/ω² = eigenvalues of K^−½ M K^−½,

without a free cart, whose momentum stays zero: A − b bᵀ/M_tot replaces M.  Scaled by gravity, each eigenvalue is known
to N ε of the largest of K^−½ A K^−½ (Parlett, The Symmetric Eigenvalue Problem, §10.3), the terms of that difference,
which exceeds the largest of the difference by Σ b/M_tot at most: slow modes to many digits, fast ones to fewer.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modal.eigen.sturm import Suspension
from modal.types import Floats

EPS = 2.0**-53
ROUNDINGS = 4
"""Rounding of an entry for each row, in units in the last place."""
EARLIER = 3
"""Rows whose rounding is as much as that of the terms before their difference is taken."""
EACH, MORE = 4, 24
"""Lanczos steps for each mode, and for all of them."""
LARGEST = 1500
"""Links on a support up to which a dense matrix is used."""


def seeds(suspension: Suspension) -> tuple[Floats, Floats]:
    """ω² (N, S), ascending, and bounds on the relative errors (N, S), infinite where nothing is known."""
    matrix, removed = _scaled(suspension)
    size = matrix.shape[-1]
    try:
        values = {1: _only, 2: _both}.get(size, np.linalg.eigvalsh)(matrix)
    except np.linalg.LinAlgError:
        values = np.full(matrix.shape[:2], np.nan)
    largest = values[:, -1:] + removed[:, None]
    with np.errstate(all="ignore"):
        error = ROUNDINGS * (size + EARLIER) * EPS * largest / values
        error = np.where((values > 0) & np.isfinite(error), error, np.inf)
        return np.asarray((1.0 / values).T[::-1]), error.T[::-1]


def slow_seeds(suspension: Suspension, number: int) -> tuple[Floats, Floats]:
    """The `number` lowest ω² (R, 1) of one support without a spring, and estimates of their relative errors (R, 1).

    They are the largest eigenvalues of the same matrix, by the Lanczos iteration with full orthogonalization (Parlett,
    §13): its product with a vector is two running sums along each chain.  It may miss a mode, which a count tells.
    """
    (product, removed), size = _product(suspension), suspension.size
    steps = min(size, EACH * number + MORE)
    basis, small, beta = np.zeros((steps + 1, size)), np.zeros((steps, steps)), 0.0
    start = np.random.default_rng(0).uniform(0.5, 1.0, size)
    basis[0] = start / np.linalg.norm(start)
    for k in range(steps):
        w = product(basis[k])
        small[k, k] = basis[k] @ w
        for _ in range(2):
            w -= (basis[: k + 1] @ w) @ basis[: k + 1]
        small[k + 1 : k + 2, k] = beta = float(np.linalg.norm(w))
        basis[k + 1] = w / beta if beta > 0 else w
    values, vectors = np.linalg.eigh(small)
    values, missed = values[: -number - 1 : -1, None], beta * np.abs(vectors[-1, : -number - 1 : -1, None])
    error = (missed + ROUNDINGS * (size + EARLIER) * EPS * (values[0] + removed)) / values
    return 1.0 / values, np.where((values > 0) & np.isfinite(error), error, np.inf)


def _product(suspension: Suspension) -> tuple[Callable[[Floats], Floats], float]:
    """The product of K^−½ M K^−½ and a vector (N,), for one support without a spring, and the norm Σ b/M_tot."""
    rows = [(chains, p) for chains in suspension.chains for p in range(chains.m.shape[1])]
    b, length, diagonal = (
        np.concatenate([getattr(chains, name)[:, p, 0, 0] for chains, p in rows])
        for name in ("b", "length", "diagonal")
    )
    moment = np.sqrt(b)
    reach, scale = length / moment, diagonal / b
    drawn = moment / suspension.total_mass[0] if suspension.mass is not None else np.zeros_like(moment)
    ends = np.cumsum([chains.n for chains, _ in rows]).tolist()
    pieces = [slice(end - chains.n, end) for end, (chains, _) in zip(ends, rows, strict=True)]

    def product(v: Floats) -> Floats:
        image: Floats = scale * v - drawn * (moment @ v)
        for piece in pieces:
            along, across = (reach * v)[piece], (moment * v)[piece]
            image[piece][1:] += moment[piece][1:] * np.cumsum(along[:-1])
            image[piece][:-1] += reach[piece][:-1] * np.cumsum(across[:0:-1])[::-1]
        return image

    return product, float(moment @ drawn)


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


def _scaled(suspension: Suspension) -> tuple[Floats, Floats]:
    """The lower triangle of each K^−½ M K^−½ (S, N, N), next to each other in memory, and the norms Σ b/M_tot (S,)."""
    supports, links = suspension.supports, suspension.size
    spring = suspension.stiffness is not None and bool(suspension.stiffness[0] > 0)
    free = suspension.stiffness is not None and not spring
    matrices = np.zeros((links + spring, links + spring, supports))
    moments = [np.sqrt(chains.b[:, :, 0]).swapaxes(0, 1).reshape(-1, supports) for chains in suspension.chains]
    every = np.concatenate(moments)
    drawn = every / suspension.total_mass if free else np.zeros((links, 1))
    if free and links > suspension.chains[0].n:
        np.multiply(every[:, None], -drawn, out=matrices)
    at = 0
    for chains in suspension.chains:
        for p in range(chains.m.shape[1]):
            span = slice(at, at + chains.n)
            moment, less = every[span], drawn[span]
            at += chains.n
            block = matrices[span.start + spring : at + spring, span.start + spring : at + spring]
            np.multiply(moment[:, None], chains.length[:, p, 0] / moment - less, out=block)
            np.einsum("iis->is", block)[:] = chains.diagonal[:, p, 0] / moment / moment - moment * less
    if spring and suspension.stiffness is not None:
        held = np.sqrt(suspension.stiffness)
        matrices[0, 0] = suspension.total_mass / held / held
        matrices[1:, 0] = every / held
    return matrices.transpose(2, 0, 1), np.broadcast_to((every * drawn).sum(0), (supports,))
