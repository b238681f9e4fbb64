"""A mode in words: what the cart does, which pendula agree, and where it stands within the chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEGLIGIBLE = 0.01
FIXED, CART_STILL, CART_MOVES = "fixed support", "cart still", "cart moves"


def family(*, where: str, along: int, across: int, antiphase: bool, ratio: float, motion: str) -> str:
    """Words for one distinct frequency: so many-fold `along` the rail and `across` it.

    `where` is what the support does, `antiphase` whether pendula on a cart balance each other along the rail,
    `ratio` −Re λ/|λ|; `motion` comes from `motion_words`.
    """
    folds = along + across
    kinds = ["antiphase"] if antiphase else []
    kinds += ["across the rail"] if across and where == CART_STILL else []
    if len(kinds) == 2:
        kinds = [f"antiphase {along}, across the rail {across}"]
    words = ", ".join(word for word in (*kinds, motion, _decay(ratio)) if word)
    where += f", {folds}-fold" if folds > 1 else ""
    return f"{where}: {words}" if words else where


def _decay(ratio: float) -> str:
    if ratio < -1e-12:
        return "unstable"
    return "overdamped" if ratio >= 1.0 else ""


def motion_words(
    angles: tuple[NDArray[np.inexact], ...],
    shares: tuple[NDArray[np.float64], ...],
    at: int,
    names: list[str],
    *,
    several: bool,
    balanced: bool,
) -> str:
    """Which pendula agree and how the links of the busiest one do, in mode `at` of angles and shares (n, P, R).

    `names` are those of all P kinds; `several` says that one column stands for several pendula moving alike,
    `balanced` that they hold the support still, so that nothing is left to say about their phases.
    """
    energy = np.concatenate([share[:, :, at].sum(0) for share in shares])
    busiest = int(energy.argmax())
    sizes = np.cumsum([share.shape[1] for share in shares])
    block = int(np.searchsorted(sizes, busiest, side="right"))
    column = busiest - int(sizes[block]) + shares[block].shape[1]
    chain = _in_phase_with_largest(angles[block][:, column, at])
    top = np.concatenate([angle[0, :, at] for angle in angles])
    agreement = "" if balanced else _agreement(top, energy, names, several)
    return ", ".join(word for word in (agreement, _order(chain)) if word)


def _agreement(top: NDArray[np.inexact], energy: NDArray[np.float64], names: list[str], several: bool) -> str:
    """In phase or not, by the top links of all pendula that hold a fair share of the energy."""
    if len(top) == 1:
        return "in phase" if several else ""
    busy = energy >= NEGLIGIBLE * energy.max()
    if busy.sum() == 1:
        return f"mostly {names[int(energy.argmax())]}"
    signs = np.sign(_in_phase_with_largest(top[busy]))
    return "in phase" if np.all(signs > 0) or np.all(signs < 0) else "mixed phases"


def _order(chain: NDArray[np.float64]) -> str:
    """Slow and fast for two links; else how many neighbours, among the links that move, swing against each other."""
    if len(chain) == 1:
        return ""
    signs = np.sign(chain[chain != 0])
    opposed = int(np.sum(signs[1:] != signs[:-1]))
    if len(chain) == 2:
        return "fast" if opposed else "slow"
    if opposed in (0, len(chain) - 1):
        return "fastest (neighbours opposed)" if opposed else "slowest (all links agree)"
    return f"{opposed} of {len(chain) - 1} joints opposed"


def _in_phase_with_largest(values: NDArray[np.inexact]) -> NDArray[np.float64]:
    largest = values[np.abs(values).argmax()]
    aligned = values * (np.conj(largest) / abs(largest)) if largest != 0 else values
    found: NDArray[np.float64] = aligned.real
    return found
