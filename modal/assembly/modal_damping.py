"""Modal damping: dampers given by the damping ratio ζ of each undamped mode.

With the shapes φ of the scene without dampers, φᵀMφ = 1 and ω² > 0,

    D_modal = Σ_k 2 ζ_k ω_k (Mφ_k)(Mφ_k)ᵀ,       eigenvalues −ζω ± iω√(1−ζ²) where there are no other dampers

(Caughey & O'Kelly, J. Appl. Mech. 32, 583 (1965)).  A mode without restoring force, as the translation of a free cart,
and a growing one have none.  N equal pendula split exactly into one N times as heavy and N − 1 in antiphase, so that
the size of every eigenproblem is that of the different pendula.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modal.assembly.arrays import Rig
from modal.assembly.squares import Columns
from modal.assembly.structure import Hanging, assembled, scene_squares
from modal.errors import ComputationError, SceneError
from modal.types import Floats, Ints

SAME = 1e-9
"""Relative difference below which frequencies count as one mode of the table."""
LARGEST = 2500
"""Coordinates of different pendula up to which D_modal is computed."""
BEYOND = "damping_ratio: the ratios in this scene are beyond double precision on the dense route of modal dampers"
NOISE = 4 * float(np.finfo(float).eps)
Kind = tuple[int, int]
Ratios = float | tuple[float, ...]
RatioAt = Callable[[Floats], Floats]


def ratio_at(rig: Rig) -> RatioAt:
    """The damping ratio as a function of ω (rad/s in the units of the rig).

    Ratios in a list belong to the modes of the table without dampers, by number; all further modes have none.  Raises
    SceneError for a list of more ratios than there are modes.
    """
    ratios = rig.damping_ratio
    if not isinstance(ratios, tuple):
        return lambda omega: np.full(np.shape(omega), ratios)
    omega = frequencies(rig)
    if len(ratios) > len(omega):
        raise SceneError([f"damping_ratio: has {len(ratios)} values for {len(omega)} modes of different frequency"])
    by_mode = np.append(np.array(ratios), np.zeros(len(omega) - len(ratios)))
    return lambda each: np.asarray(by_mode[np.abs(np.subtract.outer(each, omega)).argmin(-1)])


def frequencies(rig: Rig) -> Floats:
    """The different |λ| of the rig without dampers, ascending: 0 of a free cart, growth rates where it is unstable."""
    if rig.structure:
        return _different(_on_structure(rig)[0])
    rates = [np.zeros(int(rig.cart is not None and rig.cart.stiffness == 0))]
    for block, column in rig.names:
        if rig.cart is None or rig.spatial or rig.blocks[block].count[column] > 1:
            rates.append(_eigen(*_chain(rig, (block, column)))[0])
    if rig.cart:
        rates.append(_eigen(*_heavy(rig))[0])
    return _different(np.concatenate(rates))


def _different(rates: Floats) -> Floats:
    """The finite ones of these rates by size, those that agree once."""
    each = np.sort(np.abs(rates))
    each = each[np.isfinite(each)]
    return np.asarray(each[np.append(True, np.diff(each) > SAME * each[1:])])


def modal_factor(M: Floats, K: Floats, free: bool, ratio: RatioAt) -> Floats:
    """C (R, n) with D_modal = CᵀC of a system M, K; `free` if nothing holds the cart in row 0.

    ComputationError for more than LARGEST coordinates and beyond double precision.
    """
    rate, momentum = _eigen(M, K, free)
    swings = (rate > 0) & np.isfinite(rate)
    omega = rate[swings]
    factor: Floats = np.sqrt(2 * ratio(omega) * omega)[:, None] * momentum.T[swings]
    return np.hstack([np.zeros((len(factor), int(free))), factor])


def modal_dampers(rig: Rig) -> Floats:
    """D_modal (n, n) of a whole rig, in the coordinates of its matrices."""
    ratio, first = ratio_at(rig), int(rig.cart is not None)
    if rig.structure:
        rate, momentum = _on_structure(rig)
        C = np.sqrt(2 * ratio(rate[rate > 0]) * rate[rate > 0])[:, None] * momentum.T[rate > 0]
        return np.asarray(C.T @ C)
    places = _places(rig, first)
    D = np.zeros((first + sum(index.size for index in places.values()),) * 2)
    for kind, index in places.items():
        count = len(index)
        if rig.cart is None or count > 1:
            C = modal_factor(*_chain(rig, kind), ratio)
            alone = C.T @ C
            if rig.cart:
                D[index[:, None, :, None], index[None, :, None, :]] -= alone / count
            D[index[:, :, None], index[:, None, :]] += alone
    if rig.cart:
        C = modal_factor(*_heavy(rig), ratio)
        common, at = np.zeros((len(C), len(D))), 1
        common[:, 0] = C[:, 0]
        for index in places.values():
            size = index.shape[1]
            common[:, index] = C[:, None, at : at + size] / len(index)
            at += size
        D += common.T @ common
    return D


def _on_structure(rig: Rig) -> tuple[Floats, Floats]:
    """ω (n,), 0 of free motions and negative of growing ones, and Mφ (n, n) with φᵀMφ = 1 of a rig on a structure."""
    hanging = Hanging(rig)
    _refuse_large(hanging.structure.size + int(hanging.first[-1]))
    M, K, _ = scene_squares(rig).matrices
    scale = 1 / np.sqrt(np.diag(M))
    try:
        L = np.asarray(np.linalg.cholesky(M * scale * scale[:, None]), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ComputationError(BEYOND) from None
    square, v = np.linalg.eigh(_in_factors(L, K * scale * scale[:, None]))
    square[np.argsort(np.abs(square))[: hanging.free]] = 0.0
    return np.sign(square) * np.sqrt(np.abs(square)), L @ v / scale[:, None]


def _places(rig: Rig, first: int) -> dict[Kind, Ints]:
    """The rows (copies, n) of every kind's angles, in the order of `Rig.names`, after those of the cart."""
    places: dict[Kind, list[Ints]] = {kind: [] for kind in rig.names}
    at = first
    for block, column, copies in rig.members:
        n = rig.blocks[block].n
        places[block, column].append(at + np.arange(copies * n).reshape(copies, n))
        at += copies * n
    return {kind: np.concatenate(rows) for kind, rows in places.items()}


def _chain(rig: Rig, kind: Kind) -> tuple[Floats, Floats, bool]:
    """M and K of one pendulum on a fixed support, which has no free cart."""
    _refuse_large(rig.blocks[kind[0]].n)
    return (*assembled([(rig.blocks[kind[0]], kind[1])], None, rig.gravity), False)


def _heavy(rig: Rig) -> tuple[Floats, Floats, bool]:
    """M and K of the cart and one heavy pendulum of each kind, and whether nothing holds the cart."""
    heavy = [block.heavier(block.count) for block in rig.blocks]
    columns: Columns = [(heavy[block], column) for block, column in rig.names]
    _refuse_large(1 + sum(block.n for block, _ in columns))
    return (*assembled(columns, rig.cart, rig.gravity), rig.cart is not None and rig.cart.stiffness == 0)


def _refuse_large(size: int) -> None:
    if size > LARGEST:
        raise ComputationError(
            f"damping_ratio: the modal dampers of {size} coordinates of different pendula need a dense matrix: at most "
            f"{LARGEST} are allowed"
        )


def _eigen(M: Floats, K: Floats, free: bool) -> tuple[Floats, Floats]:
    """ω (R,), negative of growing modes and infinite of massless ones, and Mφ (n − free, R) with φᵀMφ = 1.

    Of a `free` cart the rows of the pendula alone: as the total momentum is 0, so is the cart's row of Mφ.
    """
    if free:
        M, K = M[1:, 1:] - np.outer(M[1:, 0], M[0, 1:]) / M[0, 0], K[1:, 1:]
    scale = 1 / np.sqrt(np.diag(M) if np.any(np.diag(K) <= 0) else np.diag(K))
    inertia, stiffness = (part * scale * scale[:, None] for part in (M, K))
    L: Floats
    try:
        L = np.asarray(np.linalg.cholesky(stiffness), dtype=np.float64)
        square, v = np.linalg.eigh(_in_factors(L, inertia))
        square = np.where(square > NOISE * square[-1], square, 0.0)
        with np.errstate(divide="ignore"):
            return 1 / np.sqrt(square), L @ v * np.sqrt(square) / scale[:, None]
    except np.linalg.LinAlgError:
        pass
    try:
        L = np.asarray(np.linalg.cholesky(inertia), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise ComputationError(BEYOND) from None
    square, v = np.linalg.eigh(_in_factors(L, stiffness))
    return np.sign(square) * np.sqrt(np.abs(square)), L @ v / scale[:, None]


def _in_factors(L: Floats, S: Floats) -> Floats:
    """L⁻¹ S L⁻ᵀ of a symmetric S."""
    return np.asarray(np.linalg.solve(L, np.linalg.solve(L, S).T), dtype=np.float64)
