"""The description of a mode in words: the cart, the phases of the pendula, and the order within the chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from modal.structure import Structure

NEGLIGIBLE = 0.01
STRUCTURE_STILL, FREE = "supports still", "free"
VERBS = {"cart": "moves", "swing": "moves", "tilt": "tilts", "heave": "heaves", "modal": "moves"}
PLATFORM = ("sways", "heaves", "rolls")
UNNAMED = {"tilt": "board", "heave": "support", "modal": "structure"}
ALIKE = {"cart": "carts", "swing": "swings"}
COUNTED = ("", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
MOST_NAMED = 3
FIXED, CART_STILL, CART_MOVES = "fixed support", "cart still", "cart moves"


def family(*, where: str, folds: dict[str, int], motion: str, ratio: float) -> str:
    """The description of one distinct frequency.

    `where` describes the motion of the support; `folds` counts the shapes of each sort ("" needs no word), `motion`
    comes from `motion_words`, `ratio` is −Re λ/|λ|.
    """
    total = sum(folds.values())
    named = [(sort, count) for sort, count in folds.items() if count and sort]
    several = len([count for count in folds.values() if count]) > 1
    sorts = [", ".join(f"{sort} {count}" for sort, count in named)] if several else [sort for sort, _ in named]
    words = ", ".join(word for word in (*sorts, motion, _decay(ratio)) if word)
    where += f", {total}-fold" if total > 1 else ""
    return f"{where}: {words}" if words else where


def _decay(ratio: float) -> str:
    if ratio < -1e-12:
        return "unstable"
    return "overdamped" if ratio >= 1.0 else ""


def motion_words(
    angles: tuple[NDArray[np.inexact], ...], shares: tuple[NDArray[np.float64], ...], at: int, agreement: str
) -> str:
    """The given `agreement` of pendula, and the order of the most energetic one's links, in mode `at`."""
    energy = energies(shares, at)
    busiest = int(energy.argmax())
    sizes = np.cumsum([share.shape[1] for share in shares])
    block = int(np.searchsorted(sizes, busiest, side="right"))
    column = busiest - int(sizes[block]) + shares[block].shape[1]
    chain = _in_phase_with_largest(angles[block][:, column, at])
    return ", ".join(word for word in (agreement, _order(chain)) if word)


def energies(shares: tuple[NDArray[np.float64], ...], at: int) -> NDArray[np.float64]:
    """Each kind's share of the kinetic energy in mode `at`, (P,)."""
    return np.concatenate([share[:, :, at].sum(0) for share in shares])


def agreement(
    angles: tuple[NDArray[np.inexact], ...],
    shares: tuple[NDArray[np.float64], ...],
    at: int,
    names: list[str],
    *,
    several: bool,
    still: bool,
) -> str:
    """The phase agreement of the top links of all pendula with a fair share of the energy in mode `at`.

    `names` are those of all P kinds; `several` tells that one column represents several pendula moving alike, `still`
    that the cart does not move.
    """
    top, energy = np.concatenate([angle[0, :, at] for angle in angles]), energies(shares, at)
    if len(top) == 1:
        return "in phase" if several else ""
    busy = energy >= NEGLIGIBLE * energy.max()
    if busy.sum() == 1:
        return f"mostly {names[int(energy.argmax())]}"
    signs = np.sign(_in_phase_with_largest(top[busy]))
    if np.all(signs > 0) or np.all(signs < 0):
        return "in phase"
    return "antiphase" if still else "mixed phases"


def _order(chain: NDArray[np.float64]) -> str:
    """Slow and fast for two links; else the number of neighbouring links that move in opposite directions."""
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
    phased: NDArray[np.float64] = aligned.real
    return phased


def moving_words(structure: Structure, eta: NDArray[np.inexact], inertia: NDArray[np.float64]) -> str:
    """What moves of a structure, by its coordinates (d,): two carts in antiphase, board tilts."""
    weight = np.abs(eta) * np.sqrt(inertia)
    moved = np.flatnonzero(weight >= NEGLIGIBLE * weight.max()).tolist()
    owners = [int(np.searchsorted(structure.offsets, k, side="right")) - 1 for k in moved]
    kinds = {structure.carriers[owner].kind for owner in owners}
    if len(moved) > 1 and len(kinds) == 1 and (kind := kinds.pop()) in ALIKE:
        signs = np.sign(_in_phase_with_largest(eta[moved]))
        phase = "in phase" if (signs > 0).all() else "in antiphase" if len(moved) == 2 else "in mixed phases"
        every = len(moved) == sum(carrier.kind == kind for carrier in structure.carriers)
        if not every and len(moved) <= MOST_NAMED:
            return f"{_listed([_named(structure, owner) for owner in owners])} {phase}"
        count = COUNTED[len(moved)] if len(moved) < len(COUNTED) else str(len(moved))
        return f"{count} {ALIKE[kind]} {phase}"
    told: dict[int, list[str]] = {}
    for k, owner in zip(moved, owners, strict=True):
        moving = structure.carriers[owner]
        verb = PLATFORM[k - structure.offsets[owner]] if moving.kind == "platform" else VERBS[moving.kind]
        if verb not in told.setdefault(owner, []):
            told[owner].append(verb)
    if len(told) > MOST_NAMED:
        return f"{len(moved)} coordinates move"
    return ", ".join(f"{_named(structure, owner)} {_listed(verbs)}" for owner, verbs in told.items())


def following(
    angles: tuple[NDArray[np.inexact], ...],
    shares: tuple[NDArray[np.float64], ...],
    pivots: list[NDArray[np.inexact]],
    at: int,
    *,
    several: bool,
) -> str:
    """Whether all pendula with a fair share of the energy swing with their pivots (P,) or against; "" for neither.

    `several` tells that one column represents several pendula moving alike.
    """
    if not pivots:
        return ""
    energy = energies(shares, at)
    top = np.concatenate([angle[0, :, at] for angle in angles])
    signs = np.sign((top * np.conj(np.concatenate(pivots))).real)[energy >= NEGLIGIBLE * energy.max()]
    if not (signs > 0).all() and not (signs < 0).all():
        return ""
    many = several or len(top) > 1
    return (
        ("pendula follow" if many else "pendulum follows") if signs[0] > 0 else f"pendul{'a' if many else 'um'} opposed"
    )


def _named(structure: Structure, owner: int) -> str:
    carrier = structure.carriers[owner]
    return UNNAMED.get(carrier.kind, carrier.name) if carrier.name == carrier.kind else carrier.name


def _listed(words: list[str]) -> str:
    return " and ".join((", ".join(words[:-1]), words[-1])) if len(words) > 1 else words[0]
