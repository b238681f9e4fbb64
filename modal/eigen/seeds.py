"""Initial frequencies: eigenvalues of one dense matrix, with bounds on their rounding errors.

    1/ω² = eigenvalues of K^−½ M K^−½,

without a free cart, whose momentum stays zero: A − b bᵀ/M_tot replaces M.  Scaled by gravity, each eigenvalue is known
to N ε of the largest [Parlett1998, §10.3] and to a few ε of the largest of K^−½ A K^−½,
of whose entries, none negative, the terms of that difference are rounded; it exceeds the largest of the difference by
Σ b/M_tot at most.  Slow modes have many digits, fast ones fewer.

They are improved by one Rayleigh quotient step each.  Elimination leaves at the pivot, displaced by 1, an unbalanced
mass T and a shape of kinetic energy N, twice over ω². The Rayleigh quotient of that shape is x (1 − T/N), with an error
that is the square of that of x.  A mode that leaves the pivot at rest is found by a search.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modal.eigen.recursion import (
    NUMBERS_IN_CACHE,
    Chains,
    Suspension,
    mass_and_energy_in_floats,
    one_by_one,
)
from modal.types import EPS, Floats

LARGEST_SEEDED = 1500
"""Cost: links on a support up to which a dense matrix, not a search, seeds the counts (benchmarks/modes.py)."""


def seeds(suspension: Suspension) -> tuple[Floats, Floats]:
    """ω² (N, S), ascending, and bounds on the relative errors (N, S), infinite if nothing is known."""
    matrix, removed_norm = _scaled_matrices(suspension)
    size = matrix.shape[-1]
    try:
        values = {1: lambda rows: rows[..., 0], 2: _two_eigenvalues}.get(size, np.linalg.eigvalsh)(matrix)
    except np.linalg.LinAlgError:
        values = np.full(matrix.shape[:2], np.nan)
    largest = values[:, -1:]
    with np.errstate(all="ignore"):
        # two roundings of each row, and of three more for the terms before their difference is taken
        error = 2 * EPS * (size * largest + 3 * (largest + 2 * removed_norm[:, None])) / values
        error = np.where((values > 0) & np.isfinite(error), error, np.inf)
        return np.asarray((1.0 / values).T[::-1]), error.T[::-1]


def slow_seeds(suspension: Suspension, number: int) -> tuple[Floats, Floats]:
    """The `number` lowest ω² (R, 1) of one support without a spring, and estimates of their relative errors (R, 1).

    They are the largest eigenvalues of the same matrix, by the Lanczos iteration with full orthogonalization
    [Parlett1998, §13]: its product with a vector is two running sums along each chain. It may miss a mode, which a
    count detects.
    """
    (product, removed_norm), size = _product(suspension), suspension.size
    steps = min(size, 4 * (number + 4))
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
    values, residual = values[: -number - 1 : -1, None], beta * np.abs(vectors[-1, : -number - 1 : -1, None])
    error = (residual + 2 * EPS * (size + 3) * (values[0] + removed_norm)) / values
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
    cart_coupling = moment / suspension.total_mass[0] if suspension.mass is not None else np.zeros_like(moment)
    ends = np.cumsum([chains.n for chains, _ in rows]).tolist()
    pieces = [slice(end - chains.n, end) for end, (chains, _) in zip(ends, rows, strict=True)]

    def product(v: Floats) -> Floats:
        image: Floats = scale * v - cart_coupling * (moment @ v)
        for piece in pieces:
            reach_terms, moment_terms = (reach * v)[piece], (moment * v)[piece]
            image[piece][1:] += moment[piece][1:] * np.cumsum(reach_terms[:-1])
            image[piece][:-1] += reach[piece][:-1] * np.cumsum(moment_terms[:0:-1])[::-1]
        return image

    return product, float(moment @ cart_coupling)


def seed_matrices(links: int, supports: int) -> tuple[tuple[str, int, int], ...]:
    """The matrices behind the seeds of `supports` supports, as (name, order, count)."""
    return (("seeds", links, supports),) if 1 < links <= LARGEST_SEEDED else ()


def _two_eigenvalues(matrix: Floats) -> Floats:
    """The eigenvalues (S, 2) of matrices of two rows, ascending, sooner than by LAPACK."""
    first, last, off_diagonal = matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 1, 0]
    middle, half = (first + last) / 2, np.hypot((first - last) / 2, off_diagonal)
    return np.stack([middle - half, middle + half], axis=-1)


def _scaled_matrices(suspension: Suspension) -> tuple[Floats, Floats]:
    """The lower triangle of each K^−½ M K^−½ (S, N, N), next to each other in memory, and the norms Σ b/M_tot (S,)."""
    supports, links = suspension.supports, suspension.size
    spring = suspension.stiffness is not None and bool(suspension.stiffness[0] > 0)
    free = suspension.stiffness is not None and not spring
    matrices = np.zeros((links + spring, links + spring, supports))
    moments = [np.sqrt(chains.b[:, :, 0]).swapaxes(0, 1).reshape(-1, supports) for chains in suspension.chains]
    all_moments = np.concatenate(moments)
    cart_coupling = all_moments / suspension.total_mass if free else np.zeros((links, 1))
    if free and links > suspension.chains[0].n:
        np.multiply(all_moments[:, None], -cart_coupling, out=matrices)
    at = 0
    for chains in suspension.chains:
        for p in range(chains.m.shape[1]):
            span = slice(at, at + chains.n)
            moment, coupling = all_moments[span], cart_coupling[span]
            at += chains.n
            block = matrices[span.start + spring : at + spring, span.start + spring : at + spring]
            np.multiply(moment[:, None], chains.length[:, p, 0] / moment - coupling, out=block)
            np.einsum("iis->is", block)[:] = chains.diagonal[:, p, 0] / moment / moment - moment * coupling
    if spring and suspension.stiffness is not None:
        root_stiffness = np.sqrt(suspension.stiffness)
        matrices[0, 0] = suspension.total_mass / root_stiffness / root_stiffness
        matrices[1:, 0] = all_moments / root_stiffness
    return matrices.transpose(2, 0, 1), np.broadcast_to((all_moments * cart_coupling).sum(0), (supports,))


def at_pivot(suspension: Suspension, x: Floats) -> Floats:
    """The Rayleigh quotients (R, S) of the shapes at x (R, S) out of balance at the pivot; NaN if that is still."""
    with np.errstate(all="ignore"):
        if suspension.mass is None or suspension.stiffness is None:
            (chains,) = suspension.chains
            mass, energy = (rows[0] for rows in _mass_and_energy(chains.rest, x))
            first = chains.r[0, 0]
            imbalance = (mass + first - 1.0 / (chains.inverse[0, 0] * x)) / (energy + first)
        else:
            pairs = zip(*(_mass_and_energy(chains, x) for chains in suspension.chains), strict=True)
            mass, energy = (sum(values.sum(0) for values in arrays) for arrays in pairs)
            imbalance = (mass + suspension.mass - suspension.stiffness / x) / (energy + suspension.mass)
        quotients: Floats = x * (1.0 - imbalance)
        return quotients


def _mass_and_energy(chains: Chains, x: Floats) -> tuple[Floats, Floats]:
    """Mass, and twice the kinetic energy over ω², of chains whose pivots are displaced by 1, (P, R, S)."""
    m, J, top_inertia, tip_inertia, cross, r, p, q, inverse = chains[:9]
    if results := one_by_one(mass_and_energy_in_floats, (inverse, J, top_inertia, tip_inertia, m, cross, r, p, q), x):
        return results
    mass, energy = (np.zeros((chains.m.shape[1], *x.shape)) for _ in range(2))
    D = np.empty_like(mass)
    step = max(1, NUMBERS_IN_CACHE // max(1, mass.size))
    room = np.empty((5, min(step, chains.n), *mass.shape))
    for end in range(chains.n, 0, -step):
        span = slice(max(0, end - step), end)
        m, J, top_inertia, tip_inertia, cross, r, p, q = (values[span] for values in chains[:8])
        t, *products = room[:, : end - span.start]
        np.multiply(chains.inverse[span], x, out=t)
        for constant, product in zip((top_inertia, tip_inertia, J, cross), products, strict=True):
            np.multiply(constant, t, out=product)
        free, gains, masses, shares = products
        np.subtract(1.0, masses, out=masses)
        np.subtract(masses, free, out=free)
        np.subtract(masses, gains, out=gains)
        shares += masses
        masses *= m
        factors = t, r, p, 2 * q, free, gains, masses, shares
        for ratio, r, p, twice, free, gain, addend, energy_gain in zip(
            *(values[::-1] for values in factors), strict=True
        ):
            np.multiply(ratio, mass, out=D)
            np.subtract(free, D, out=D)
            mass *= gain
            mass += addend
            mass /= D
            np.divide(energy_gain, D, out=D)
            energy += r
            energy *= D
            energy += twice
            energy *= D
            energy += p
    return mass, energy
