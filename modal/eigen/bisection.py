"""Zeros of a monotone count, to the last bit: on the floats themselves, all of them at once.

Positive floats are ordered like the integers that share their bits, so bisecting these integers finds exponent and
mantissa alike and ends at two neighbouring floats, after at most 62 counts.  Where few zeros are sought each
count tries several points in the same interval, which costs little more than one.

A guess is used if the count confirms it: x is found where the count steps within two units in the last place of the
guess.  The others are sought in brackets about theirs, which are widened until the count steps inside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from modal.errors import ComputationError
from modal.types import Booleans, Floats, Ints

STRIDE = 2.0**24
BEYOND = "the ratios in this scene are beyond double precision: a frequency overflows"
NEAR = 2
"""Distance from a guess in units in the last place."""
WIDER, WIDEST = 2**8, 2**62
TRIALS = 800
"""Number of trial values that cost hardly more than one."""


def smallest_where(reached: Callable[[Floats], Booleans], low: Floats, high: Floats) -> Floats:
    """The smallest float x in (low, high] with reached(x), elementwise; `reached` turns from False to True once."""
    lo, hi = low.view(np.int64).copy(), high.view(np.int64).copy()
    while np.any(hi - lo > 1):
        middle = lo + (hi - lo) // 2
        inside = reached(middle.view(np.float64))
        hi = np.where(inside, middle, hi)
        lo = np.where(inside, lo, middle)
    return hi.view(np.float64)


def above_all(count: Callable[[Floats], Ints], start: Floats, wanted: Ints) -> Floats:
    """Powers of STRIDE times `start` until `count` has reached `wanted` everywhere."""
    high = start * STRIDE
    if not np.all((start > 0) & np.isfinite(start)):
        raise ComputationError(BEYOND)
    while np.any(count(high) < wanted):
        high = high * STRIDE
        if not np.all(high < 1e280):
            raise ComputationError(BEYOND)
    return high


class Counting(Protocol):
    """S problems of one form, whose eigenvalues below trial values (R, S) can be counted."""

    @property
    def low(self) -> Floats:
        """Lower bounds of all eigenvalues, (S,)."""

    def count(self, x: Floats) -> Ints:
        """The number of eigenvalues below each x (R, S)."""

    def take(self, supports: Ints | slice) -> Counting:
        """A subset of the problems."""


def located(problem: Counting, wanted: Ints, modes: int) -> Floats:
    """The eigenvalues with these indices (R,), from 0, of each problem with `modes` eigenvalues, (R, S)."""
    low = problem.low[None].view(np.int64)
    high = above_all(problem.count, problem.low[None], np.array(modes)).view(np.int64)
    parts = max(2, len(wanted))
    inner = np.arange(1, parts)[:, None]
    points = low + (high - low) // parts * inner + (high - low) % parts * inner // parts  # as many as are sought
    counts = problem.count(points.view(np.float64))
    first = np.stack([np.searchsorted(column, wanted, side="right") for column in counts.T], axis=1)
    ends = np.concatenate([low, points, high])
    return _between(problem, wanted, *(np.take_along_axis(ends, first + step, 0) for step in (0, 1)))


def confirmed(problem: Counting, wanted: Ints, guess: Floats, near: int = NEAR) -> tuple[Floats, Booleans]:
    """The eigenvalues confirmed within `near` units in the last place of guesses (R, S), and a mask of the others."""
    bits = np.where(guess > 0, guess, 1.0).view(np.int64)
    steps = np.arange(-near, near + 1)
    reached = _reached(problem, wanted, bits + steps[:, None, None])
    squares = (bits + steps[reached.argmax(0)]).view(np.float64)
    return squares, reached[0] | ~reached[-1]


def lies_within(problem: Counting, wanted: Ints, guess: Floats, error: Floats | float) -> Booleans:
    """Whether each eigenvalue lies within a relative error of its guess (R, S)."""
    ends = np.stack([guess * (1 - error), guess * (1 + error)])
    reached = _reached(problem, wanted, ends.view(np.int64))
    return np.asarray(~reached[0] & reached[1])


def searched(problem: Counting, wanted: Ints, guess: Floats, error: Floats, modes: int) -> Floats:
    """The eigenvalues from guesses (R, S) with relative errors (R, S), infinite where there is no guess."""
    least = problem.low[None].view(np.int64)
    most = above_all(problem.count, problem.low[None], np.array(modes)).view(np.int64)
    bits = np.clip(np.where(np.isfinite(error), guess, 1.0).view(np.int64), least, most)
    width = (np.minimum(error, 1.0) * 2.0**53).astype(np.int64) + WIDER
    while True:
        lo, hi = bits - np.minimum(width, bits - least), bits + np.minimum(width, most - bits)
        reached = _reached(problem, wanted, np.stack([lo, hi]))
        wrong = (reached[0] & (lo > least)) | (~reached[1] & (hi < most))
        if not wrong.any():
            return _between(problem, wanted, lo, hi)
        width = np.where(wrong, np.where(width < WIDEST // WIDER, width * WIDER, WIDEST), width)


def _between(problem: Counting, wanted: Ints, lo: Ints, hi: Ints) -> Floats:
    """The floats at which the count passes each index, between these bit patterns."""
    parts = max(2, TRIALS // max(1, lo.size))
    inner = np.arange(1, parts)[:, None, None]
    while np.any((gap := hi - lo) > 1):
        points = lo + (gap // parts) * inner + (gap % parts) * inner // parts
        reached = _reached(problem, wanted, points)
        first = np.where(reached.any(0), reached.argmax(0), parts - 1)[None]
        ends = np.concatenate([lo[None], points, hi[None]])
        lo, hi = (np.take_along_axis(ends, first + step, 0)[0] for step in (0, 1))
    return hi.view(np.float64)


def _reached(problem: Counting, wanted: Ints, points: Ints) -> Booleans:
    """Whether the count at points (K, R, S) has passed the indices (R,), or (R, S)."""
    x = np.ascontiguousarray(points).view(np.float64)
    counts = problem.count(x.reshape(-1, points.shape[-1])).reshape(points.shape)
    return np.asarray(counts > (wanted[:, None] if wanted.ndim == 1 else wanted))
