"""Frequency responses by elimination of the whole (`modal.statespace.structural`), and D of scenes with damping ratios.

The modes in D_modal = Σ 2ζω (Mφ)(Mφ)ᵀ are computed in DIGITS digits by Jacobi's method (Golub & Van Loan, Matrix
Computations, §8.5), since K + iωD − ω²M passes on above the modes what D does and the other two do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Context, Decimal, localcontext
from functools import lru_cache
from typing import Any

import numpy as np

from modal.assembly import Dissipator, losses_of, ratio_at, rig_of, scene_squares
from modal.eigen import Arithmetic, Digits
from modal.scene import Scene
from modal.statespace.geometry import geometry_of_rig
from modal.statespace.model import fixed
from modal.statespace.signals import Signal
from modal.statespace.structural import (
    Given,
    Reading,
    inputs_named,
    outputs_named,
    structural_response,
)

DIGITS, MOST = 80, 40
"""Digits of D_modal, and most coordinates for which they are computed."""
SWEEPS = 40


def whole_response(
    scene: Scene, inputs: Sequence[Signal | Dissipator], outputs: Sequence[Signal]
) -> tuple[Callable[[Arithmetic], Any], list[Given], list[Reading]]:
    """The evaluation (p, m, W) of a whole scene, with what its inputs and outputs are."""
    rig = rig_of(scene).carried
    geometry = geometry_of_rig(rig)
    driven, read = inputs_named(scene, geometry, inputs), outputs_named(geometry, outputs)
    dampers: Any = None
    if scene.has_modal_damping:
        held = any(push.moves == "cart" for push in driven)
        dampers = _below(in_digits(fixed(scene)), 1) if held else in_digits(scene)
    losses = losses_of(scene) if scene.has_losses else []
    return structural_response(geometry, rig, driven, read, dampers, losses), driven, read


def is_small(scene: Scene) -> bool:
    """Whether D_modal of this scene can be computed in decimals in seconds."""
    return scene.n_links + rig_of(scene).leading <= MOST


# ------------------------------------------------------------------------------------------------------- D_modal


@lru_cache(maxsize=8)
def in_digits(scene: Scene) -> Any:
    """D_modal (n, n) in decimals."""
    rig = rig_of(scene)
    with localcontext(Context(prec=DIGITS)):
        numbers = Digits(np.ones(1), DIGITS, is_real=True)
        M, K, _ = scene_squares(rig, numbers.number).matrices
        free = int(rig.cart is not None and rig.cart.stiffness == 0)
        if free:
            M, K = M[1:, 1:] - M[1:, :1] * M[:1, 1:] / M[0, 0], K[1:, 1:]
        square, momentum = _modes(M, K)
        least = max(square).scaleb(-DIGITS // 2)
        swings = [k for k, value in enumerate(square) if value > (least if rig.structure else 0)]
        omega = [square[k].sqrt() for k in swings]
        ratios = ratio_at(rig)(np.array(omega, dtype=np.float64))
        strength = [2 * Decimal(ratio) * value for ratio, value in zip(ratios.tolist(), omega, strict=True)]
        C = momentum[:, swings]
        return _below((C * np.array(strength, dtype=object)) @ C.T, free)


def _below(D: Any, rows: int) -> Any:
    """A square matrix with as many rows and columns of zeros before it."""
    padded = np.full((len(D) + rows,) * 2, Decimal(0), dtype=object)
    padded[rows:, rows:] = D
    return padded


def _modes(M: Any, K: Any) -> tuple[list[Decimal], Any]:
    """ω² of every mode with a mass and Mφ (n, R), φᵀMφ = 1; of a singular M from the factors of K."""
    L = _cholesky(M)
    if L is not None:
        square, V = _jacobi(_in_factors(L, K))
        return square, L @ V
    L = _cholesky(K)
    assert L is not None
    inverse, V = _jacobi(_in_factors(L, M))
    kept = [k for k, value in enumerate(inverse) if value > max(inverse).scaleb(-DIGITS // 2)]
    roots = np.array([inverse[k].sqrt() for k in kept], dtype=object)
    return [1 / inverse[k] for k in kept], (L @ V[:, kept]) * roots


def _cholesky(S: Any) -> Any:
    """L with LLᵀ = S; None where S is singular to half the digits."""
    L = np.array(S)
    for k in range(len(L)):
        L[k, k + 1 :] = Decimal(0)
        square = L[k, k] - (L[k, :k] * L[k, :k]).sum()
        if square <= abs(S[k, k]).scaleb(-DIGITS // 2):
            return None
        L[k, k] = square.sqrt()
        L[k + 1 :, k] = (L[k + 1 :, k] - (L[k + 1 :, :k] * L[k, :k]).sum(1)) / L[k, k]
    return L


def _in_factors(L: Any, S: Any) -> Any:
    """L⁻¹ S L⁻ᵀ."""
    return _forward(L, _forward(L, S).T)


def _forward(L: Any, S: Any) -> Any:
    solution = np.array(S)
    for k in range(len(L)):
        solution[k] = (solution[k] - (L[k, :k, None] * solution[:k]).sum(0)) / L[k, k]
    return solution


def _jacobi(S: Any) -> tuple[list[Decimal], Any]:
    """Eigenvalues and eigenvectors of a symmetric S."""
    S, size = (S + S.T) / 2, len(S)
    V: Any = np.frompyfunc(Decimal, 1, 1)(np.eye(size))
    for _ in range(SWEEPS):
        turned = False
        for i in range(size):
            for j in range(i + 1, size):
                if abs(S[i, j]) <= (abs(S[i, i] * S[j, j])).sqrt().scaleb(3 - DIGITS):
                    continue
                turned = True
                tau = (S[j, j] - S[i, i]) / (2 * S[i, j])
                t = (1 if tau >= 0 else -1) / (abs(tau) + (1 + tau * tau).sqrt())
                c = 1 / (1 + t * t).sqrt()
                s = c * t
                S[i], S[j] = c * S[i] - s * S[j], s * S[i] + c * S[j]
                S[:, i], S[:, j] = c * S[:, i] - s * S[:, j], s * S[:, i] + c * S[:, j]
                V[:, i], V[:, j] = c * V[:, i] - s * V[:, j], s * V[:, i] + c * V[:, j]
        if not turned:
            break
    return [S[k, k] for k in range(size)], V
