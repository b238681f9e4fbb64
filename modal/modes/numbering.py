"""One number for every mode: its number in the table of the scene with dampers.

A scene without its dampers, or with its cart fixed, has different modes.  Each of them gets the number of the most
similar mode of the table.  The similarity of rows r and s, of shapes φ and ψ, is

    w_rs = Σ |φᴴMψ|² / ((φᴴMφ)(ψᴴMψ))        over all pairs of their shapes along the rail,

and rows are paired one to one, the most similar first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from modal.modes.modes import Modes, natural_modes
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Complexes, Floats, Ints

DIGITS = 9
"""Decimals to which similarities are compared; the earlier of two equally similar rows is taken."""
MOST_COMPARED = 1000
"""Links of a scene up to which its shapes are compared where the numbers are optional."""


@lru_cache(maxsize=4)
def table_numbers(scene: Scene, still: Modes | None = None) -> Ints:
    """The number in the table of a scene for every row (R,) of `natural_modes(scene.conservative)`, `still`.

    >>> from modal import load
    >>> table_numbers(load("huygens")).tolist()  # the cart's creeping on its damper is mode 2 of the table
    [1, 3, 4]
    """
    still = still or natural_modes(scene.conservative)
    numbers = 1 + counterparts(still, natural_modes(scene)) if scene.has_damping else np.arange(1, len(still) + 1)
    numbers.flags.writeable = False
    return numbers


@checked
def counterparts(modes: Modes, others: Modes, among: Sequence[int] | None = None) -> Ints:
    """For every row (R,) of `modes` the index of the most similar row of `others` (one of `among`)."""
    chosen = np.arange(len(others)) if among is None else np.asarray(among, dtype=np.intp)
    alike = np.round(likeness(modes, others)[:, chosen], DIGITS)
    partners = paired(alike, np.ones(len(chosen), dtype=np.int64))
    return np.asarray(chosen[np.where(partners < 0, alike.argmax(axis=1), partners)])


def paired(alike: Floats, room: Ints) -> Ints:
    """A column for every row, the largest entries first, each column for at most `room` rows; −1 without one."""
    partners, left = np.full(len(alike), -1), room.copy()
    missing = min(len(alike), int(room.sum()))
    for place in np.argsort(-alike, axis=None, kind="stable").tolist():
        row, column = divmod(place, alike.shape[1])
        if not missing:
            break
        if partners[row] < 0 and left[column]:
            partners[row], left[column], missing = column, left[column] - 1, missing - 1
    return partners


def labelled(numbers: Iterable[int]) -> tuple[str, ...]:
    """A name for each of these numbers of the table: the number, followed by b, c, … where it is repeated.

    >>> labelled([2, 2, 3, 2])
    ('2', '2b', '3', '2c')
    """
    before: Counter[int] = Counter()
    names = []
    for number in numbers:
        names.append(f"{number}{lettered(before[number]) if before[number] else ''}")
        before[number] += 1
    return tuple(names)


def lettered(index: int) -> str:
    """a, b, … z, aa, ab, … of indices from 0."""
    before, last = divmod(index, 26)
    return (lettered(before - 1) if before else "") + chr(ord("a") + last)


def likeness(modes: Modes, others: Modes) -> Floats:
    """The similarity w (R, S) of rows, over all coordinates where both have them, else over the links."""
    left_out = max(modes.rig.leading - others.rig.leading, 0)
    M = modes.matrices.M[left_out:, left_out:]
    left, owners = _stacked(modes, M)
    other, whose = _stacked(others, M)
    similarity = np.zeros((len(modes), len(others)))
    np.add.at(similarity, np.ix_(owners, whose), np.abs(left.conj().T @ M @ other) ** 2)
    return similarity


def _stacked(modes: Modes, M: Floats) -> tuple[Complexes, Ints]:
    """All shapes along the rail (n, C), n the size of M, with φᴴMφ = 1, and the row (C,) of each."""
    along = modes.matrix.take(~modes.matrix.across)
    phi = along.shapes[-len(M) :].astype(np.complex128)
    size = np.sqrt(np.einsum("ic,ij,jc->c", phi.conj(), M, phi).real)
    return phi / np.where(size > 0, size, 1.0), along.row
