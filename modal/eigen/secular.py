"""The secular equation of many pendula on one cart, solved in O(N log N).

Fixed-base modes of effective mass μ_r and square ω_r² = λ_r enter the equation of the rail,

    f(x) = c + Σ W_r / (λ_r − x),    W_r = μ_r λ_r,    c = m_c + Σ residual masses,

and a spring k_c to the ground as one more pole, λ = 0 with W = k_c.  f rises from −∞ to +∞ between neighbouring
poles, so each gap contains one root, and one more lies beyond the last pole if c > 0.  Roots are stored as
(nearest pole, offset), which gives every difference λ_r − x full relative accuracy.

Distant poles vary smoothly over a short run of gaps: their sum is tabulated at Chebyshev points, run by run, while the
runs are divided until few enough neighbours remain to be summed directly, as in fast multipole methods [Gu1995].
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats, Ints

GAPS_OF_LEAF = 48
"""Cost: gaps whose poles are summed one by one, and runs into which more are divided (benchmarks/modes.py)."""
CHEBYSHEV_POINTS = 22
"""Tolerance: points of a table of poles at least a run's length away: their sum is known to rounding."""
SECULAR_STEPS_MAX = 200
"""Limit: steps to a root, two a bit; beyond, the equation is said not to converge."""

_NODES = np.polynomial.chebyshev.chebpts1(CHEBYSHEV_POINTS)[::-1]
_WEIGHTS = np.where(np.arange(CHEBYSHEV_POINTS) % 2, -1, 1) * np.sqrt((1 - _NODES) * (1 + _NODES))


@dataclass(frozen=True, eq=False)
class Poles:
    """Ascending λ (K,) without repetition, positive W (K,) and the constant c."""

    square: Floats
    weight: Floats
    constant: float


@dataclass(frozen=True, eq=False)
class Roots:
    """x = λ[anchor] + offset, both (R,)."""

    anchor: Ints
    offset: Floats


def solve(poles: Poles) -> Roots:
    """Every root of f, ascending."""
    gaps = _Run(poles, 0, len(poles.square) - 1, 0, len(poles.square), None)
    parts = [Roots(np.zeros(0, dtype=np.int64), np.zeros(0)), *gaps.roots()]
    if poles.constant > 0:
        parts.append(_last_root(poles))
    return Roots(np.concatenate([p.anchor for p in parts]), np.concatenate([p.offset for p in parts]))


@dataclass(frozen=True, eq=False)
class _Table:
    """A smooth function of x, tabulated at the Chebyshev points of [centre − half, centre + half]."""

    centre: float
    half: float
    values: Floats

    def __call__(self, x: Floats) -> Floats:
        """Barycentric interpolation [Berrut2004, eq. 4.2]."""
        distance = (x[:, None] - self.centre) / self.half - _NODES
        exact = distance == 0
        share = _WEIGHTS / np.where(exact, 1.0, distance)
        share = np.where(exact.any(1, keepdims=True), exact, share)
        values: Floats = (share @ self.values) / share.sum(1)
        return values


@dataclass(frozen=True, eq=False)
class _Run:
    """Gaps first … last − 1 (gap j lies above pole j), the poles near … far − 1, and the table of all others."""

    poles: Poles
    first: int
    last: int
    pole_start: int
    pole_stop: int
    others: _Table | None

    def roots(self) -> Iterator[Roots]:
        """The roots in these gaps, run by run."""
        gaps = self.last - self.first
        if gaps <= GAPS_OF_LEAF:
            if gaps:
                yield self._leaf()
            return
        edges = np.linspace(self.first, self.last, min(GAPS_OF_LEAF, 2 * gaps // GAPS_OF_LEAF) + 1).astype(int)
        for first, last in pairwise(edges.tolist()):
            yield from self._part(first, last).roots()

    def _part(self, first: int, last: int) -> _Run:
        square, weight = self.poles.square, self.poles.weight
        low, high = square[first], square[last]
        half = (high - low) / 2
        pole_start = max(self.pole_start, int(np.searchsorted(square, low - 2 * half)))
        pole_stop = min(self.pole_stop, int(np.searchsorted(square, high + 2 * half, side="right")))
        x = low + half * (1 + _NODES)
        values = np.zeros(CHEBYSHEV_POINTS) if self.others is None else self.others(x)
        for outer in (slice(self.pole_start, pole_start), slice(pole_stop, self.pole_stop)):
            values = values + (weight[outer] / (square[outer] - x[:, None])).sum(1)
        table = _Table(low + half, half, values)
        return replace(self, first=first, last=last, pole_start=pole_start, pole_stop=pole_stop, others=table)

    def _leaf(self) -> Roots:
        square, weight = self.poles.square, self.poles.weight
        gap_index = np.arange(self.first, self.last)
        gap = square[gap_index + 1] - square[gap_index]
        middle = self._value(gap_index, gap / 2)
        anchor = np.where(middle > 0, gap_index, gap_index + 1)
        sign = np.where(middle > 0, 1.0, -1.0)

        def deflated_value(size: Floats) -> Floats:
            return size * (1.0 - size / gap) * sign * self._value(anchor, sign * size)

        return Roots(anchor, sign * _rising_zero(deflated_value, gap / 2, -weight[anchor], gap / 4 * np.abs(middle)))

    def _value(self, anchor: Ints, offset: Floats) -> Floats:
        square, span = self.poles.square, slice(self.pole_start, self.pole_stop)
        distance = (square[span] - square[anchor][:, None]) - offset[:, None]
        value: Floats = self.poles.constant + (self.poles.weight[span] / distance).sum(1)
        if self.others is not None:
            value += self.others(square[anchor] + offset)
        return value


def _last_root(poles: Poles) -> Roots:
    """The root above the last pole, at most ΣW/c beyond it."""
    distance = poles.square[-1] - poles.square
    farthest = np.atleast_1d(2 * poles.weight.sum() / poles.constant)

    def deflated_value(size: Floats) -> Floats:
        value: Floats = size * poles.constant - (poles.weight * (size / (distance + size))).sum(keepdims=True)
        return value

    size = _rising_zero(deflated_value, farthest, -poles.weight[-1:], deflated_value(farthest))
    return Roots(np.array([len(distance) - 1]), size)


def _rising_zero(function: Callable[[Floats], Floats], high: Floats, at_low: Floats, at_high: Floats) -> Floats:
    """Zeros in (0, high] of functions that increase through them, given the values at both ends.

    The Illinois rule [Dowell1971]; ComputationError if it does not converge.
    """
    low, last = np.zeros_like(high), np.zeros_like(high)
    for _ in range(SECULAR_STEPS_MAX):
        from_low, from_high = ((high - low) * (end / (at_low - at_high)) for end in (at_low, at_high))
        trial = np.clip(np.where(at_high > -at_low, low + from_low, high + from_high), low, high)
        if np.all(np.abs(trial - last) <= 4e-16 * trial):
            return trial
        value = function(trial)
        is_above = value >= 0
        at_low = np.where(is_above, np.where(trial < last, at_low / 2, at_low), value)
        at_high = np.where(is_above, value, np.where(trial > last, at_high / 2, at_high))
        low, high = np.where(is_above, low, trial), np.where(is_above, trial, high)
        last = trial
    raise ComputationError("the secular equation of this cart did not converge in double precision")
