"""Modes of sums of springs and masses, to all digits: K = Σ k a aᵀ and M = Σ m b bᵀ with k, m > 0.

Changing every k and m by a relative ε changes every ω² by 2ε at most: no subtraction is in the data.  To keep that,

1. F₁ = √k Aᵀ, F₂ = √m Bᵀ; columns of both are divided by the lengths of those of F₂;
2. F₂ = Q R by rows sorted by size, columns pivoted; G = F₁ R⁻¹, so that ω are the singular values of G
   [Drmac1998], rows sorted by size;
3. G = L D U by complete pivoting, a rank-revealing decomposition with L and U well conditioned;
4. L D = Q' R' with pivoting, W = R' P' U, one-sided Jacobi on W ([Demmel1999, algorithm 3.1]; LAPACK's dgejsv).

Steps 2 and 3 use the widest floats of the machine unless there are too many coordinates: in plain ones they lose two or
three digits in some scenes whose masses and springs each range over 24 orders.

Free motions, without any spring, have exactly ω = 0: their number is known, and they are never computed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from modal.eigen.component_matrices import BEYOND, SquareSum, is_wide
from modal.errors import ComputationError
from modal.types import Floats, Ints

"""LAPACK's joba "C": no singular value is set to zero, as "A" does below n ε of the largest."""


def product_modes(stiffness: SquareSum, inertia: SquareSum, free: int = 0) -> tuple[Floats, Floats]:
    """ω (n − free,), ascending, and shapes (n, n − free) with φᵀMφ = 1, of which `free` motions have no spring.

    Raise ComputationError if M is singular, or double precision does not suffice.
    """
    number_type: Any = np.longdouble if is_wide(inertia.rows.shape[1]) else np.float64
    F1, F2 = (np.sqrt(factor.size.astype(number_type))[:, None] * factor.rows for factor in (stiffness, inertia))
    n = F2.shape[1]
    if n == free:
        return np.zeros(0), np.zeros((n, 0))
    size = np.sqrt((F2**2).sum(0))
    if not (size > 0).all():
        raise ComputationError(BEYOND)
    F1, F2 = F1 / size, F2 / size
    R, order = _triangular(_sort_rows(F2))
    G = np.empty_like(F1)
    for j, column in enumerate(order):
        G[:, j] = (F1[:, column] - G[:, :j] @ R[:j, j]) / R[j, j]
    L, d, U = _complete_pivoting(_sort_rows(G), n - free)
    _, R2, order2 = scipy.linalg.qr((L * d).astype(float), mode="economic", pivoting=True)
    omega, u = _jacobi((R2 @ U.astype(float)[order2]).T)
    shapes = np.empty((n, n - free))
    for j in reversed(range(n)):  # quicker than LAPACK's threads where n is small
        shapes[order[j]] = u[j] = (u[j] - R[j, j + 1 :].astype(float) @ u[j + 1 :]) / float(R[j, j])
    return omega, shapes / size[:, None].astype(float)


def _triangular(F: Any) -> tuple[Any, Ints]:
    """R (n, n) and the order of columns with FᵀF = RᵀR, by Householder's reflections, the largest column first."""
    A, n = F.copy(), F.shape[1]
    order = np.arange(n)
    for j in range(n):
        c = j + int((A[j:, j:] ** 2).sum(0).argmax())
        A[:, [j, c]], order[[j, c]] = A[:, [c, j]], order[[c, j]]
        v = A[j:, j].copy()
        length = np.sqrt((v**2).sum())
        if not length or len(A) < n:
            raise ComputationError(BEYOND)
        v[0] += np.copysign(length, v[0])
        A[j:, j:] -= np.multiply.outer(v * (2 / (v**2).sum()), v @ A[j:, j:])
        A[j + 1 :, j] = 0
    return A[:n], order


def _sort_rows(F: Any) -> Any:
    """The rows by their largest entries, the largest first."""
    return F[np.argsort(-np.abs(F).max(1), kind="stable")]


def _jacobi(W: Floats) -> tuple[Floats, Floats]:
    """Singular values of W (n, r), ascending, and its left singular vectors (n, r)."""
    gejsv: Any = scipy.linalg.lapack.dgejsv
    sva, u, _, work, _, failure = gejsv(np.asfortranarray(W), joba=0, jobu=0, jobv=3, jobr=0, jobt=0, jobp=0)
    omega = sva * (work[0] / work[1])
    if failure or not (omega > 0).all():
        raise ComputationError(BEYOND)
    up = np.argsort(omega, kind="stable")
    return omega[up], u[:, up]


def _complete_pivoting(G: Any, rank: int) -> tuple[Any, Any, Any]:
    """L (E, r), d (r,), U (r, n) with G = L diag(d) U, rows and columns in the order of G."""
    A = G.copy()
    rows, columns = np.arange(A.shape[0]), np.arange(A.shape[1])
    for j in range(rank):
        block = np.abs(A[j:, j:])
        i, c = divmod(int(block.argmax()), block.shape[1])
        A[[j, j + i]], rows[[j, j + i]] = A[[j + i, j]], rows[[j + i, j]]
        A[:, [j, j + c]], columns[[j, j + c]] = A[:, [j + c, j]], columns[[j + c, j]]
        if not A[j, j]:
            raise ComputationError(BEYOND)
        A[j + 1 :, j] /= A[j, j]
        A[j + 1 :, j + 1 :] -= np.multiply.outer(A[j + 1 :, j], A[j, j + 1 :])
    d = A.diagonal()[:rank].copy()
    L, U = np.zeros((A.shape[0], rank), A.dtype), np.zeros((rank, A.shape[1]), A.dtype)
    L[rows] = np.tril(A[:, :rank], -1) + np.eye(A.shape[0], rank)
    U[:, columns] = np.triu(A[:rank] / d[:, None], 1) + np.eye(rank, A.shape[1])
    return L, d, U
