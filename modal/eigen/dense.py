"""The dense route, for small scenes that have no structured one.

Undamped: the symmetric pencil K φ = ω² M φ, also with inverted links and an indefinite K.  (`modal.eigen.quadratic` is
for dampers.)  A free cart's position is eliminated first, and its momentum with it, so that its rigid translation is
exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.types import Complexes, Floats

LARGEST_DAMPED = 500
LARGEST_UNDAMPED = 2000
EPS = float(np.finfo(float).eps)
SINGULAR = (
    "the mass matrix is singular to double precision (as with a massless cart over bobs): with dampers or "
    "inverted links this scene has no state-space form; give the cart or the links some inertia"
)


@dataclass(frozen=True, eq=False)
class Eigen:
    """Eigenvalues λ (R,), one of each conjugate pair, with shapes (size, R) and relative error bounds (R,).

    `order` is the order of the matrix whose eigenvalues they are, `number` how many such matrices were solved.
    """

    eigenvalue: Complexes
    shape: NDArray[np.inexact]
    error: Floats
    order: int
    number: int = 1


def undamped(M: Floats, K: Floats, *, free: bool, singular: bool) -> Eigen:
    """Modes of K φ = ω² M φ, K positive definite except for a `free` cart in row 0.

    Where M is known to be `singular`, by one dimension, the mode at infinite frequency is omitted.
    """
    inertia, stiffness, _ = without_cart(M, K) if free else (M, K, 1.0)
    scale, L, sensitivity = _factored(stiffness)
    inverse_square, v = np.linalg.eigh(_in_factors(L, inertia * scale * scale[:, None]))
    inverse_square, v = inverse_square[singular:], v[:, singular:]
    if inverse_square.size and inverse_square[0] <= 4 * len(M) * EPS * inverse_square[-1]:
        raise ComputationError("the frequencies spread too far for the dense route that this scene needs")
    inverse_square, v = inverse_square[::-1], v[:, ::-1]
    shape = scale[:, None] * np.linalg.solve(L.T, v)
    rounded = M[1:, 1:] if free else M
    largest = np.trace(_in_factors(L, rounded * scale * scale[:, None]))
    error = 2 * len(M) * EPS * (sensitivity + largest / inverse_square)
    return Eigen(1j / np.sqrt(inverse_square), with_cart(M, shape, free), error, len(L))


def indefinite(M: Floats, K: Floats, *, free: bool, terms: Floats) -> Eigen:
    """Modes of K φ = x M φ about an equilibrium that may be unstable: λ = i√x, and for x < 0 the growth rate √−x > 0.

    `terms` (size,) are the sums of the absolute terms of K's diagonal, where springs and gravity may cancel.
    The decaying counterpart −√−x of a growing mode has the same shape and is not listed.
    """
    refuse_singular(M)
    inertia, stiffness, lost = without_cart(M, K) if free else (M, K, 1.0)
    scale, L, sensitivity = _factored(inertia)
    x, v = np.linalg.eigh(_in_factors(L, stiffness * scale * scale[:, None]))
    shape = scale[:, None] * np.linalg.solve(L.T, v)
    x = np.where(x == 0, np.finfo(float).tiny, x)
    largest = max(np.abs(x).max(initial=0.0), (terms[len(M) - len(inertia) :] * scale**2).max(initial=0.0))
    error = 2 * len(M) * EPS * sensitivity * lost * largest / np.abs(x)
    value = np.sqrt(np.abs(x)) * np.where(x < 0, 1.0, 1j)
    return Eigen(value, with_cart(M, shape, free), error, len(L))


def in_phase(shape: NDArray[np.inexact], first: int) -> NDArray[np.inexact]:
    """Each column rotated in the complex plane until its largest entry in rows `first` … is real and positive."""
    entries = shape[first:]
    leading = np.take_along_axis(entries, np.abs(entries).argmax(0)[None], 0)[0]
    size = np.abs(leading)
    return shape * np.where(size > 0, leading.conj() / np.where(size > 0, size, 1.0), 1.0)


def _factored(S: Floats) -> tuple[Floats, Floats, float]:
    """Scale to a unit diagonal, Cholesky factor, and sensitivity ‖L⁻¹‖² of a positive definite matrix.

    Roundings of the scaled entries change its quadratic form by at most this factor times their sum.
    """
    scale = 1 / np.sqrt(np.diag(S))
    L = np.asarray(np.linalg.cholesky(S * scale * scale[:, None]), dtype=np.float64)
    return scale, L, float(np.linalg.norm(np.linalg.inv(L), 2) ** 2) if len(S) else 1.0


def _in_factors(L: Floats, S: Floats) -> Floats:
    """L⁻¹ S L⁻ᵀ of a symmetric S."""
    reduced: Floats = np.linalg.solve(L, np.linalg.solve(L, S).T)
    return reduced


def without_cart(M: Floats, K: Floats) -> tuple[Floats, Floats, float]:
    """The pendula with a free cart that keeps the total momentum zero, A − b bᵀ/M_tot, and its loss of digits."""
    A = M[1:, 1:]
    reduced = A - np.outer(M[1:, 0], M[0, 1:]) / M[0, 0]
    lost = float((np.diag(A) / np.diag(reduced)).max(initial=1.0))
    return reduced, K[1:, 1:], lost


def with_cart(M: Floats, shape: NDArray[np.inexact], free: bool) -> NDArray[np.inexact]:
    """The shapes with the displacement of a free cart that keeps the total momentum zero."""
    return np.vstack([-(M[0, 1:] @ shape) / M[0, 0], shape]) if free else shape


def is_singular(M: Floats) -> bool:
    """Whether a positive semidefinite matrix, scaled to a unit diagonal, has lost a dimension to rounding."""
    if np.any(np.diag(M) <= 0):
        return True
    scale = 1 / np.sqrt(np.diag(M))
    spectrum = np.linalg.eigvalsh(M * scale * scale[:, None])
    return bool(spectrum[0] <= 4 * EPS * spectrum[-1])


def refuse_singular(M: Floats) -> None:
    """ComputationError if `is_singular`."""
    if is_singular(M):
        raise ComputationError(SINGULAR)


def refuse_beyond(largest: int, size: int, cause: str) -> None:
    """ComputationError for more coordinates than this route allows."""
    if size > largest:
        raise ComputationError(
            f"{cause} need the dense route: {size} coordinates, at most {largest} "
            "(equal pendula count once; without them any size works)"
        )
