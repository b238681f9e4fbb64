"""Poles and shapes from free responses by the eigensystem realization algorithm (ERA).

From samples y_k (C,) of free responses, as columns, the block Hankel matrices

    H₀ = [y_{i+j}],   H₁ = [y_{i+j+1}],     H₀ = U S Vᵀ,    A = S^{-1/2} Uᵀ H₁ V S^{-1/2}

give the poles λ = ln μ / Δt of order n by the eigenvalues μ of A (n, n), and shapes by the first block of U S^{1/2}.
[Juang1985]  Correlations of the responses to random excitation are free
responses themselves: [James1995].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.types import Complexes, Floats

SINGULAR_VALUE_MIN = 1e-4
"""Tolerance: of the largest singular value: below it are harmonics of swings that are not small."""
NOISE_THRESHOLD = 2.858
"""Physics: singular values below this many medians are noise [Gavish2014]."""
HANKEL_ROWS = 240
"""Cost: most rows of a Hankel matrix; the time goes with their square."""
HANKEL_COLUMNS = 4000
"""Cost: most columns of a Hankel matrix; the time goes with their number."""


@dataclass(frozen=True, eq=False)
class Realization:
    """The singular vectors of H₀ with H₁ between them, for C sensors sampled every `step` (s)."""

    U: Floats
    singular: Floats
    between: Floats
    sensors: int
    step: float

    @cached_property
    def rank(self) -> int:
        """The number of singular values that stand out of noise and are not faint."""
        floor = max(SINGULAR_VALUE_MIN * self.singular[0], NOISE_THRESHOLD * float(np.median(self.singular)))
        return int(np.count_nonzero(self.singular > floor))

    def poles(self, order: int) -> tuple[Complexes, Complexes]:
        """Oscillating poles λ (R,) with Im λ > 0 (1/s) and their shapes (C, R), by a model of this order."""
        order = min(order, len(self.singular))
        root = np.sqrt(self.singular[:order])
        A = self.between[:order, :order] / root[:, None] / root
        values, vectors = np.linalg.eig(A)
        with np.errstate(all="ignore"):
            poles = np.asarray(np.log(values + 0j) / self.step)
        shapes = (self.U[: self.sensors, :order] * root) @ vectors
        rows = np.flatnonzero((poles.imag > 0) & (poles.imag < 0.98 * np.pi / self.step) & np.isfinite(poles))
        rows = rows[np.argsort(np.abs(poles[rows]))]
        return np.asarray(poles[rows]), np.asarray(shapes[:, rows], dtype=np.complex128)


def realize(responses: Sequence[Floats], step: float, stride: int = 1) -> Realization:
    """The realization of free responses (K, C) sampled every `step` (s), each from a state of its own.

    Rows of the Hankel matrix are `stride` samples apart.
    """
    sensors = responses[0].shape[1]
    shortest = min(len(response) for response in responses)
    blocks = max(2, min(HANKEL_ROWS // sensors, shortest // (2 * stride)))
    columns = max(1, HANKEL_COLUMNS // len(responses))
    first, second = [], []
    for response in responses:
        count = min(len(response) - blocks * stride, columns)
        starts = np.linspace(0, len(response) - blocks * stride - 1, count).astype(np.int64)
        samples = response[starts[:, None] + stride * np.arange(blocks + 1)]
        first.append(samples[:, :-1].reshape(count, -1).T)
        second.append(samples[:, 1:].reshape(count, -1).T)
    H0, H1 = np.hstack(first), np.hstack(second)
    U, singular, V = np.linalg.svd(H0, full_matrices=False)
    return Realization(U, singular, U.T @ H1 @ V.T, sensors, stride * step)


def modal_assurance(shapes: Complexes, other: Complexes) -> Floats:
    """MAC (R, S) between columns of (C, R) and (C, S): |φᴴψ|²/((φᴴφ)(ψᴴψ)), 0 for a column of zeros.

    [Allemang1982]
    """
    inner = np.abs(shapes.conj().T @ other) ** 2
    sizes = np.outer(np.sum(np.abs(shapes) ** 2, axis=0), np.sum(np.abs(other) ** 2, axis=0))
    return np.asarray(np.divide(inner, sizes, out=np.zeros_like(inner), where=sizes > 0))
