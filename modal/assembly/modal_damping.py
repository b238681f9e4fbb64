"""Modal damping: dampers given by the damping ratio ζ of each undamped mode.

With the shapes φ of the scene without dampers, φᵀMφ = 1 and ω² > 0,

    D_modal = Σ_k 2 ζ_k ω_k (Mφ_k)(Mφ_k)ᵀ,       eigenvalues −ζω ± iω√(1−ζ²) without other dampers

[Caughey1965]. A mode without restoring force, such as the translation of a free cart, and a growing mode have none. N
equal pendula split exactly into one N times as heavy and N − 1 in antiphase, so that the size of every eigenproblem is
that of the different pendula.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.assembly.arrays import Rig
from modal.assembly.structure import Hanging, assemble_pendula
from modal.errors import ComputationError, SceneError
from modal.types import EPS, Floats, Ints

MODAL_DAMPERS_MAX = 2500
"""Limit: coordinates of different pendula up to which D_modal, a dense matrix, is computed."""
BEYOND = "damping_ratio: the ratios in this scene are beyond double precision on the dense route of modal dampers"
Ratios = float | tuple[float, ...]
RatioAt = Callable[[Floats], Floats]


def ratio_at(rig: Rig) -> RatioAt:
    """Return the damping ratio as a function of ω (in the rig's unit of rate).

    Ratios in a list belong to the modes of the table without dampers, by number; all further modes have none. Raise
    SceneError if a list has more ratios than there are modes.
    """
    ratios = rig.damping_ratio
    if not isinstance(ratios, tuple):
        return lambda omega: np.full(np.shape(omega), ratios)
    omega = frequencies(rig)
    if len(ratios) > len(omega):
        raise SceneError([f"damping_ratio: has {len(ratios)} values for {len(omega)} modes of different frequency"])
    by_mode = np.append(np.array(ratios), np.zeros(len(omega) - len(ratios)))
    return lambda rates: np.asarray(by_mode[np.abs(np.subtract.outer(rates, omega)).argmin(-1)])


def frequencies(rig: Rig) -> Floats:
    """Return the different |λ| of the rig without dampers, ascending: 0 for a free cart, growth rates if unstable."""
    rates = [_eigen(*system[:3])[0] for system in _systems(rig)]
    if rig.leading:
        rates.append(np.zeros(Hanging(rig).free.shape[1]))
    sizes = np.sort(np.abs(np.concatenate(rates)))
    sizes = sizes[np.isfinite(sizes)]
    return np.asarray(sizes[np.append(True, np.diff(sizes) > EPS**0.5 * sizes[1:])])


def modal_factor(M: Floats, K: Floats, free: Floats | bool, ratio: RatioAt) -> Floats:
    """Return C (R, n) with D_modal = CᵀC of a system M, K, given its `free` motions or whether row 0 is a free cart.

    Raise ComputationError beyond double precision.
    """
    loose = np.eye(len(M), int(free)) if isinstance(free, bool) else free
    rate, momentum = _eigen(M, K, loose)
    swings = (rate > 0) & np.isfinite(rate)
    omega = rate[swings]
    return np.asarray(np.sqrt(2 * ratio(omega) * omega)[:, None] * momentum.T[swings])


def modal_dampers(rig: Rig) -> Floats:
    """Return D_modal (n, n) of a rig in the coordinates of its matrices."""
    ratio = ratio_at(rig)
    size = rig.leading + sum(rig.blocks[block].n * copies for block, _, copies in rig.members)
    D = np.zeros((size, size))
    for M, K, free, places, keeps_balance in _systems(rig):
        C = modal_factor(M, K, free, ratio)
        if not keeps_balance:
            shares = np.zeros((len(C), size))
            for column, index in zip(C.T, places, strict=True):
                shares[:, index] = column[:, None] / len(index)
            D += shares.T @ shares
            continue
        product, index, count = C.T @ C, np.array(places).T, len(places[0])
        D[index[:, :, None], index[:, None, :]] += product
        if rig.leading:
            D[index[:, None, :, None], index[None, :, None, :]] -= product / count
    return D


class _System(NamedTuple):
    """M and K, the motions (n, f) that nothing holds, and the `places` in the whole of all copies of each coordinate.

    These move alike, or exert no net force on their supports.
    """

    M: Floats
    K: Floats
    free: Floats
    places: Sequence[Ints]
    keeps_balance: bool


def _systems(rig: Rig) -> Iterator[_System]:
    """What carries pendula with one heavy one of each kind, and those of one kind with this at rest.

    On a structure every pendulum is one of its own.
    """
    places_of_kinds, heavy_rig, d = _places(rig), rig, rig.leading
    if not rig.structure:
        for kind, index in places_of_kinds.items():
            if not d or rig.spatial or len(index) > 1:
                _refuse_large(index.shape[1])
                M, K = assemble_pendula([(rig.blocks[kind[0]], kind[1])], None, rig.gravity)
                yield _System(M, K, np.zeros((len(M), 0)), list(index.T), keeps_balance=True)
        blocks = tuple(block.heavier(block.count) for block in rig.blocks)
        heavy_rig = replace(rig, blocks=blocks, members=tuple((*kind, 1) for kind in rig.names))
        if not d:
            return
    hanging, places = Hanging(heavy_rig), [np.array([k]) for k in range(d)]
    places += [copies for index in places_of_kinds.values() for copies in index.T]
    _refuse_large(len(places))
    M, K, _ = hanging.squares().matrices
    free = np.concatenate((hanging.free, np.zeros((len(places) - d, hanging.free.shape[1]))))
    yield _System(M, K, free, places, keeps_balance=False)


def _places(rig: Rig) -> dict[tuple[int, ...], Ints]:
    """The rows (copies, n) of every kind's angles, in the order of `Rig.names`; on a structure of every pendulum's."""
    places: dict[tuple[int, ...], list[Ints]] = {} if rig.structure else {kind: [] for kind in rig.names}
    at = rig.leading
    for block, column, copies in rig.members:
        for _ in range(copies):
            kind = (at,) if rig.structure else (block, column)
            places.setdefault(kind, []).append(np.arange(at, at := at + rig.blocks[block].n))
    return {kind: np.array(rows) for kind, rows in places.items()}


def _refuse_large(size: int) -> None:
    if size > MODAL_DAMPERS_MAX:
        raise ComputationError(
            f"damping_ratio: the modal dampers of {size} coordinates of different pendula need a dense matrix: at most "
            f"{MODAL_DAMPERS_MAX} are allowed"
        )


def _eigen(M: Floats, K: Floats, free: Floats) -> tuple[Floats, Floats]:
    """ω (R,), negative of growing modes and infinite of massless ones, and Mφ (n, R) with φᵀMφ = 1.

    Of every `free` motion (n, f) one coordinate that no other moves is omitted: its momentum balances the others'.
    """
    is_single = np.count_nonzero(free, axis=1) == 1
    loose = [int(np.flatnonzero(is_single & (motion == 1))[0]) for motion in free.T]
    remaining = np.setdiff1d(np.arange(len(M)), loose)
    push = (M @ free)[remaining]
    inertia = M[np.ix_(remaining, remaining)] - push @ np.linalg.solve(free.T @ M @ free, push.T)
    stiffness = K[np.ix_(remaining, remaining)]
    scale = 1 / np.sqrt(np.diag(inertia) if np.any(np.diag(stiffness) <= 0) else np.diag(stiffness))
    inertia, stiffness = (part * scale * scale[:, None] for part in (inertia, stiffness))
    try:
        L = np.asarray(np.linalg.cholesky(stiffness), dtype=np.float64)
        square, v = np.linalg.eigh(in_factors(L, inertia))
        square = np.where(square > 4 * EPS * square[-1], square, 0.0)
        with np.errstate(divide="ignore"):
            rate, momentum = 1 / np.sqrt(square), L @ v * np.sqrt(square) / scale[:, None]
    except np.linalg.LinAlgError:
        try:
            L = np.asarray(np.linalg.cholesky(inertia), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise ComputationError(BEYOND) from None
        square, v = np.linalg.eigh(in_factors(L, stiffness))
        rate, momentum = np.sign(square) * np.sqrt(np.abs(square)), L @ v / scale[:, None]
    momenta = np.zeros((len(M), len(rate)))
    momenta[remaining], momenta[loose] = momentum, -free[remaining].T @ momentum
    return rate, momenta


def in_factors(L: Floats, S: Floats) -> Floats:
    """L⁻¹ S L⁻ᵀ of a symmetric S."""
    return np.asarray(np.linalg.solve(L, np.linalg.solve(L, S).T), dtype=np.float64)
