"""ω² of chains to the last digits: seeds, one Rayleigh quotient step from each, and counts to confirm or search.

Zeros of a monotone count are found on the floats themselves, all of them at once.  Positive floats are ordered like the
integers that share their bits, so bisecting these integers finds exponent and mantissa alike and ends at two
neighbouring floats, after at most 62 counts. If few zeros are sought, each count tries several points in the same
interval, which costs little more than one.

A guess is used if the count confirms it: for one support x is the float at which the count steps, within
PLACES_OF_GUESS units in the last place of the guess, or PLACES_OF_SECOND_GUESS if few are sought or few were missed;
for many supports it is the guess itself, if the count steps within two units of it. The others are sought in brackets
about their guesses, which are widened until the count steps inside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from modal.eigen.recursion import Suspension
from modal.eigen.seeds import LARGEST_SEEDED, at_pivot, seeds, slow_seeds
from modal.errors import ComputationError
from modal.types import EPS, NUMBERS_IN_CHUNK, Booleans, Floats, Ints

BEYOND = "the ratios in this scene are beyond double precision: a frequency overflows"
SEEDS = "dense seeds"
PLACES_OF_GUESS = 2
"""Cost: distance from a guess in units in the last place, confirmed by counts at all floats (benchmarks/modes.py)."""
PLACES_OF_SECOND_GUESS = 16
"""Cost: the same where few are left: three of 20,000 rods take 0.3 s with it and 4.5 s without."""
WIDENING = 2**8
"""Cost: by which a bracket grows until the count steps inside."""
TRIALS_OF_COUNT = 800
"""Cost: number of trial values that cost hardly more than one (benchmarks/modes.py)."""
LINKS_OF_LONG_CHAIN = 100
"""Cost: links above which seeds of all modes cost more than those of a few (benchmarks/modes.py)."""
LINKS_PER_MODE = 20
"""Cost: links above those for each mode that is sought, where these are a few (benchmarks/modes.py)."""
CLOSE = 1e-8
"""Tolerance: relative gap of squares below which shapes need their differences, or are orthogonal by construction."""


class Limits(NamedTuple):
    """Requirements on a spectrum: a relative accuracy of ω (0: every digit), and a number of the lowest modes.

    The oscillatory `squares` (R,) of a single chain may be known already.
    """

    accuracy: float = 0.0
    lowest: int | None = None
    squares: Floats | None = None


EVERYTHING: Limits = Limits()


def smallest_where(condition: Callable[[Floats], Booleans], low: Floats, high: Floats) -> Floats:
    """The smallest float x in (low, high] with reached(x), elementwise; `condition` turns from False to True once."""
    lo, hi = low.view(np.int64).copy(), high.view(np.int64).copy()
    while np.any(hi - lo > 1):
        middle = lo + (hi - lo) // 2
        inside = condition(middle.view(np.float64))
        hi = np.where(inside, middle, hi)
        lo = np.where(inside, lo, middle)
    return hi.view(np.float64)


def upper_bounds(count: Callable[[Floats], Ints], start: Floats, target: Ints) -> Floats:
    """Return a power of 2²⁶ times `start` at which `count` has reached `target` everywhere."""
    high: Floats = start / np.sqrt(EPS)
    if not np.all((start > 0) & np.isfinite(start)):
        raise ComputationError(BEYOND)
    while np.any(count(high) < target):
        high = high / np.sqrt(EPS)
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


def locate(problem: Counting, indices: Ints, modes: int) -> Floats:
    """The eigenvalues with these indices (R,), from 0, of each problem with `modes` eigenvalues, (R, S)."""
    low = problem.low[None].view(np.int64)
    high = upper_bounds(problem.count, problem.low[None], np.array(modes)).view(np.int64)
    parts = max(2, len(indices))
    inner = np.arange(1, parts)[:, None]
    points = low + (high - low) // parts * inner + (high - low) % parts * inner // parts  # as many as are sought
    counts = problem.count(points.view(np.float64))
    first = np.stack([np.searchsorted(column, indices, side="right") for column in counts.T], axis=1)
    ends = np.concatenate([low, points, high])
    return _bisect_between(problem, indices, *(np.take_along_axis(ends, first + step, 0) for step in (0, 1)))


def confirm(
    problem: Counting, indices: Ints, guess: Floats, distance: int = PLACES_OF_GUESS
) -> tuple[Floats, Booleans]:
    """The eigenvalues confirmed within `distance` last places of guesses (R, S), and a mask of the others."""
    bits = np.where(guess > 0, guess, 1.0).view(np.int64)
    steps = np.arange(-distance, distance + 1)
    is_past = _is_past(problem, indices, bits + steps[:, None, None])
    squares = (bits + steps[is_past.argmax(0)]).view(np.float64)
    return squares, is_past[0] | ~is_past[-1]


def lies_within(problem: Counting, indices: Ints, guess: Floats, error: Floats | float) -> Booleans:
    """Whether each eigenvalue lies within a relative error of its guess (R, S)."""
    ends = np.stack([guess * (1 - error), guess * (1 + error)])
    is_past = _is_past(problem, indices, ends.view(np.int64))
    return np.asarray(~is_past[0] & is_past[1])


def search(problem: Counting, indices: Ints, guess: Floats, error: Floats, modes: int) -> Floats:
    """The eigenvalues from guesses (R, S) with relative errors (R, S), infinite if there is no guess."""
    lowest = problem.low[None].view(np.int64)
    highest = upper_bounds(problem.count, problem.low[None], np.array(modes)).view(np.int64)
    bits = np.clip(np.where(np.isfinite(error), guess, 1.0).view(np.int64), lowest, highest)
    width = (np.minimum(error, 1.0) * 2 / EPS).astype(np.int64) + WIDENING
    while True:
        lo, hi = bits - np.minimum(width, bits - lowest), bits + np.minimum(width, highest - bits)
        is_past = _is_past(problem, indices, np.stack([lo, hi]))
        is_outside = (is_past[0] & (lo > lowest)) | (~is_past[1] & (hi < highest))
        if not is_outside.any():
            return _bisect_between(problem, indices, lo, hi)
        width = np.where(is_outside, np.where(width < 2**62 // WIDENING, width * WIDENING, 2**62), width)


def _bisect_between(problem: Counting, indices: Ints, lo: Ints, hi: Ints) -> Floats:
    """The floats at which the count passes each index, between these bit patterns."""
    parts = max(2, TRIALS_OF_COUNT // max(1, lo.size))
    inner = np.arange(1, parts)[:, None, None]
    while np.any((gap := hi - lo) > 1):
        points = lo + (gap // parts) * inner + (gap % parts) * inner // parts
        is_past = _is_past(problem, indices, points)
        first = np.where(is_past.any(0), is_past.argmax(0), parts - 1)[None]
        ends = np.concatenate([lo[None], points, hi[None]])
        lo, hi = (np.take_along_axis(ends, first + step, 0)[0] for step in (0, 1))
    return hi.view(np.float64)


def _is_past(problem: Counting, indices: Ints, points: Ints) -> Booleans:
    """Whether the count at points (K, R, S) has passed the indices (R,), or (R, S)."""
    x = np.ascontiguousarray(points).view(np.float64)
    counts = problem.count(x.reshape(-1, points.shape[-1])).reshape(points.shape)
    return np.asarray(counts > (indices[:, None] if indices.ndim == 1 else indices))


class Squares(NamedTuple):
    """ω² and bounds on their relative errors beyond rounding, in one array shape."""

    x: Floats
    error: Floats

    @classmethod
    def exact(cls, x: Floats) -> Squares:
        """Squares that are exact to rounding."""
        return cls(x, np.zeros(x.shape))

    @property
    def route(self) -> str:
        """The method in words."""
        dense = self.error > 0
        routes = [SEEDS] * bool(dense.any()) + ["effective mass"] * (not dense.all() or not dense.size)
        return ", ".join(routes)


def squares_of(suspension: Suspension, indices: Ints, modes: int, accuracy: float = 0.0) -> Squares:
    """ω² (R, S) with these indices (R,), from 0, among the oscillatory modes of each support.

    Dense eigenvalues within `accuracy`, relative in ω, are used unchanged.
    """
    if not indices.size:
        return Squares.exact(np.zeros((0, suspension.supports)))
    is_sprung = suspension.stiffness is not None and bool(suspension.stiffness[0] > 0)
    are_lowest = bool(indices[-1] == len(indices) - 1)
    if _are_few(suspension, indices) and suspension.supports == 1 and are_lowest and not is_sprung:
        guess, error = slow_seeds(suspension, len(indices))
        guesses = guess, np.maximum(error, 3 * accuracy)  # only a count shows that none was missed
        return _settle(suspension, indices, _try_seeds(suspension, indices, accuracy, guesses), modes)
    if suspension.size > LARGEST_SEEDED or _are_few(suspension, indices):
        return Squares.exact(locate(suspension, indices, modes))
    step = max(1, NUMBERS_IN_CHUNK // suspension.size**2)
    starts = range(0, suspension.supports, step)
    pieces = [suspension.take(slice(at, at + step)) for at in starts] if len(starts) > 1 else [suspension]
    trials = [_try_seeds(piece, indices, accuracy, seeds(piece)) for piece in pieces]
    trial = Trial(*(np.concatenate(parts, axis=1) for parts in zip(*trials, strict=True)))
    return _settle(suspension, indices, trial, modes)


def _are_few(suspension: Suspension, indices: Ints) -> bool:
    return LINKS_PER_MODE * len(indices) < suspension.size - LINKS_OF_LONG_CHAIN


class Trial(NamedTuple):
    """ω² of a first way, bounds on their errors beyond rounding, where counts refute it, the seeds and their errors."""

    x: Floats
    error: Floats
    is_wrong: Booleans
    guess: Floats
    seed_error: Floats


def _settle(suspension: Suspension, indices: Ints, trial: Trial, modes: int) -> Squares:
    """All ω², those that were missed found mode by mode another way."""
    x, error, is_wrong, guess, seed_error = trial
    rows, supports = np.nonzero(is_wrong)
    if not rows.size:
        return Squares(x, error)
    if suspension.supports == 1:
        x[rows] = search(suspension, indices[rows, None], guess[rows], seed_error[rows], modes)
        return Squares(x, error)
    squares, step = [], max(1, NUMBERS_IN_CHUNK // suspension.size)
    for at in range(0, len(rows), step):
        row, support = rows[at : at + step], supports[at : at + step]
        arguments = indices[None, row], guess[None, row, support], seed_error[None, row, support]
        squares.append(search(suspension.take(support), *arguments, modes)[0])
    x[is_wrong] = np.concatenate(squares)
    return Squares(x, error)


def _try_seeds(suspension: Suspension, indices: Ints, accuracy: float, guesses: tuple[Floats, Floats]) -> Trial:
    """Seeds `guesses` all modes where they are known to be accurate enough, else a Rayleigh quotient step from each."""
    guess, seed_error = (values[indices] for values in guesses)
    x, error, is_wrong = guess.copy(), seed_error.copy(), np.zeros(guess.shape, dtype=np.bool_)
    rows = np.flatnonzero((seed_error > 2 * accuracy).any(1))
    if accuracy and rows.size:
        inside = lies_within(suspension, indices[rows], guess[rows], 2 * accuracy)
        error[rows] = np.where(inside, 2 * accuracy, error[rows])
        rows = np.flatnonzero((error > 2 * accuracy).any(1))
    if rows.size:
        x[rows], is_wrong[rows] = _improve(suspension, indices[rows], guess[rows])
        error[rows] = 0.0
    return Trial(x, error, is_wrong, guess, seed_error)


def _improve(suspension: Suspension, indices: Ints, guess: Floats) -> tuple[Floats, Booleans]:
    """A Rayleigh quotient step at the pivot, and where the count does not confirm it.

    Of one support the float at which the count steps, of many a float within two last places of it.
    """
    squares = at_pivot(suspension, guess)
    if suspension.supports == 1:
        distance = PLACES_OF_SECOND_GUESS if _are_few(suspension, indices) else PLACES_OF_GUESS
        steps, is_wrong = confirm(suspension, indices, squares, distance)
        rows = np.flatnonzero(is_wrong)
        # So few are missed by rounding alone that counts further off are cheaper than another guess.
        if 0 < LINKS_PER_MODE * rows.size < len(indices):
            steps[rows], is_wrong[rows] = confirm(suspension, indices[rows], squares[rows], PLACES_OF_SECOND_GUESS)
        return steps, is_wrong
    return squares, ~lies_within(suspension, indices, squares, 2 * EPS)
