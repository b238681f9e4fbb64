"""Exact derivatives of M, K and D, of eigenvalues and of shapes by any number of a scene.

Those of the matrices are difference quotients with large steps (`modal.assembly.linearization`).
With Q = λ²M + λD + K, Q_p = λ²M_p + λD_p + K_p and Q_λ = 2λM + D a simple
eigenvalue and its shape follow from

    [ Q    Q_λ φ ] [ φ_p ]     [ −Q_p φ ]
    [ φᴴ     0   ] [ λ_p ]  =  [   0    ]

[Andrew1993, §2], of which λ_p = −φᵀQ_pφ/φᵀQ_λφ.  An eigenvalue
shared by the shapes Φ keeps one derivative where ΦᵀQ_pΦ is a multiple of ΦᵀQ_λΦ, and splits where it is not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modal.assembly import Arrays, matrices, shared_differences
from modal.modes import UNCERTAIN, Modes
from modal.scene import Scene, require
from modal.scene.parameters import Place
from modal.types import Complexes, Floats

DERIVATIVE_ROUNDING = 8 * np.sqrt(np.finfo(float).eps)
"""Tolerance: relative, of derivatives: shapes that are hardly different have half of the digits."""


def require_polynomial(scene: Scene) -> None:
    """Raise SceneError if M, K or D are no polynomials in the numbers of a scene."""
    require(scene, "a derivative of modes")


def matrix_derivatives(
    scene: Scene, shared: Sequence[Sequence[Place]], units: Sequence[float]
) -> tuple[Floats, Floats, Floats]:
    """M, K and D (p, n, n) differentiated by numbers, each at the places that share it."""
    require_polynomial(scene)

    def of(varied: Scene) -> Arrays:
        linear = matrices(varied)
        return linear.M, linear.K, linear.D

    parts = [shared_differences(scene, places, unit, of) for places, unit in zip(shared, units, strict=True)]
    M, K, D = (np.array(rows) for rows in zip(*parts, strict=True))
    return M, K, D


class ModeDerivatives:
    """Derivatives of the modes of a scene by p numbers, from those of its matrices, each (p, n, n)."""

    def __init__(self, modes: Modes, dM: Floats, dK: Floats, dD: Floats) -> None:
        self.modes, self.dM, self.dK, self.dD = modes, dM, dK, dD
        self.M, self.K, self.D = modes.matrices.M, modes.matrices.K, modes.matrices.D
        self.shapes = modes.matrix

    def eigenvalue(self, row: int) -> Complexes:
        """∂λ/∂p (p,) of the mode with index `row`; NaN if it splits, and where no digit of it is certain."""
        value = complex(self.modes.eigenvalue[row])
        if not self.modes.error[row] < UNCERTAIN:
            return np.full(len(self.dM), np.nan + 0j)
        if value == 0:
            return np.zeros(len(self.dM), dtype=np.complex128)
        slopes = []
        for across in (False, True):
            phi = self.shapes.shapes[:, (self.shapes.row == row) & (self.shapes.across == across)]
            if phi.shape[1]:
                slopes.append(self._of_group(value, phi.astype(np.complex128)))
        by_shape = np.concatenate(slopes, axis=1)
        first = by_shape[:, :1]
        size = np.maximum(np.abs(by_shape).max(axis=1, keepdims=True), 1e-12 * abs(value))
        splits = np.any(np.abs(by_shape - first) > DERIVATIVE_ROUNDING * size, axis=1)
        return np.asarray(np.where(splits, np.nan, first[:, 0]))

    def _of_group(self, value: complex, phi: Complexes) -> Complexes:
        """Derivatives (p, copies) by each of the shapes; NaN if they are coupled."""
        pencil = phi.T @ (2 * value * self.M + self.D) @ phi
        Q_p = value**2 * self.dM + value * self.dD + self.dK
        change = np.einsum("ia,pij,jb->pab", phi, Q_p, phi, optimize=True)
        slope = -np.linalg.solve(pencil, change)
        slopes = np.einsum("paa->pa", slope).copy()
        off = np.abs(slope - np.einsum("pa,ab->pab", slopes, np.eye(phi.shape[1]))).max(axis=(1, 2))
        slopes[off > DERIVATIVE_ROUNDING * np.abs(slope).max(axis=(1, 2))] = np.nan
        return np.asarray(slopes)

    def shape(self, row: int) -> tuple[Complexes, Complexes, Complexes]:
        """φ (n,), ∂φ/∂p (n, p) and ∂λ/∂p (p,) of a mode that is alone with its frequency; φᴴφ_p = 0."""
        value = complex(self.modes.eigenvalue[row])
        phi = self.shapes.shapes[:, self.shapes.row == row][:, 0].astype(np.complex128)
        n = len(phi)
        unit = np.sqrt(np.abs(np.diag(value**2 * self.M)) + np.abs(np.diag(self.K)))
        Q = value**2 * self.M + value * self.D + self.K
        border = (2 * value * self.M + self.D) @ phi
        right = -np.einsum("pij,j->ip", value**2 * self.dM + value * self.dD + self.dK, phi)
        bordered = np.zeros((n + 1, n + 1), dtype=np.complex128)
        bordered[:n, :n] = Q / unit[:, None] / unit
        size = np.linalg.norm(border / unit)
        bordered[:n, n] = border / unit / size
        bordered[n, :n] = phi.conj() / unit / np.linalg.norm(phi / unit)
        solution = np.linalg.solve(bordered, np.vstack((right / unit[:, None], np.zeros((1, right.shape[1])))))
        return phi, solution[:n] / unit[:, None], solution[n] / size


def polar(value: complex, slope: Complexes) -> tuple[Floats, Floats]:
    """∂ω/∂p and ∂ζ/∂p (p,) of ω = |λ| and ζ = −Re λ/|λ| from λ and ∂λ/∂p."""
    omega = abs(value)
    if omega == 0:
        return np.zeros(len(slope)), np.zeros(len(slope))
    rate = (np.conj(value) * slope).real / omega
    if value.imag == 0:
        return np.asarray(rate), np.zeros(len(slope))
    return np.asarray(rate), np.asarray(-slope.real / omega + value.real * rate / omega**2)
