"""A mode in words: what the cart does, which pendula agree, and where it stands within the chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEGLIGIBLE = 0.01


def family(*, on_cart: bool, still: bool, along: int, across: int, omega: float, ratio: float, motion: str) -> str:
    """Words for one distinct frequency: so many-fold `along` the rail and `across` it.

    `still` says that the support does not move; `ratio` is −Re λ/|λ|, `motion` comes from `motion_words`.
    """
    if omega == 0:
        return "rigid translation"
    folds = along + across
    where = ("cart still" if on_cart else "fixed support") if still else "cart moves"
    where += f", {folds}-fold" if folds > 1 else ""
    kinds = []
    if still and on_cart:
        kinds += ["antiphase"] if along else []
        kinds += ["across the rail"] if across else []
        if along and across:
            kinds = [f"antiphase {along}, across the rail {across}"]
    words = ", ".join(word for word in (*kinds, motion, _decay(ratio)) if word)
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
) -> str:
    """Which pendula agree and how the links of the busiest one do, in mode `at` of angles and shares (n, P, R).

    `names` are those of all P kinds; `several` says that one column stands for several pendula moving alike.
    """
    energy = np.concatenate([share[:, :, at].sum(0) for share in shares])
    busiest = int(energy.argmax())
    sizes = np.cumsum([share.shape[1] for share in shares])
    block = int(np.searchsorted(sizes, busiest, side="right"))
    column = busiest - int(sizes[block]) + shares[block].shape[1]
    chain = _in_phase_with_largest(angles[block][:, column, at])
    top = np.concatenate([angle[0, :, at] for angle in angles])
    return ", ".join(word for word in (_agreement(top, energy, names, several), _order(chain)) if word)


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
    """Slow and fast for two links; else the number of neighbours that swing against each other."""
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
