"""Polynomials as bare lists of coefficients, and intervals that provably contain the roots of real-rooted ones.

Sums, products and quotients accept integers, fractions or symbols, lowest power first. For roots (highest power first,
integer arithmetic only) Descartes' rule is exact if all are real: the number of those above a, with their
multiplicities, is that of the sign changes in the coefficients of p(a + y). Once a simple root is isolated, the sign of
p halves its interval. Endpoints are dyadic, and every interval is half-open: low < root ≤ high.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import pairwise, zip_longest
from math import gcd, lcm
from typing import Any, NamedTuple

from modal.errors import ComputationError


def total(p: Sequence[Any], q: Sequence[Any]) -> list[Any]:
    """Coefficients of p + q."""
    return [a + b for a, b in zip_longest(p, q, fillvalue=0)]


def product(p: Sequence[Any], q: Sequence[Any]) -> list[Any]:
    """Coefficients of p q."""
    coefficients = [0 * p[0]] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            coefficients[i + j] += a * b
    return coefficients


def multiple(factor: Any, p: Sequence[Any]) -> list[Any]:
    """A number times p."""
    return [factor * c for c in p]


def integers(values: Iterable[Fraction]) -> list[int]:
    """Fractions times their least common denominator."""
    exactly = list(values)
    unit = lcm(*(value.denominator for value in exactly))
    return [value.numerator * (unit // value.denominator) for value in exactly]


def primitive(p: Sequence[int]) -> list[int]:
    """The polynomial without leading zeros and content, the highest coefficient positive."""
    size = max(power for power, c in enumerate(p) if c) + 1
    content = gcd(*p) * (1 if p[size - 1] > 0 else -1)
    return [c // content for c in p[:size]]


def quotient(p: Sequence[Any], q: Sequence[Any]) -> list[Fraction]:
    """Coefficients of p/q, where q divides p."""
    size = max(power for power, c in enumerate(q) if c) + 1
    rest, coefficients = list(map(Fraction, p)), [Fraction(0)] * (len(p) - size + 1)
    for power in reversed(range(len(coefficients))):
        coefficients[power] = rest[power + size - 1] / q[size - 1]
        for k, c in enumerate(q[:size], power):
            rest[k] -= coefficients[power] * c
    return coefficients


Narrow = Callable[[Fraction, Fraction], bool]


class Interval(NamedTuple):
    """low < root ≤ high, and the number of roots: more than one only if they are closer than the width."""

    low: Fraction
    high: Fraction
    multiplicity: int


def isolate(coefficients: Sequence[int], width: Fraction, *, relative: bool = False) -> list[Interval]:
    """Ascending intervals, none wider than `width`, of all roots of a real-rooted polynomial, highest power first.

    With `relative`, none is wider than `width` times its smaller end, for a polynomial without the root 0.
    The caller guarantees that all roots are real (K and M are symmetric, M positive): ComputationError if Newton's
    inequalities disprove it. Intervals that are all simple prove it.
    """
    if width <= 0:
        raise ValueError(f"width = {width}: must be positive")
    if not _newton(coefficients):
        raise ComputationError(f"the polynomial with coefficients {list(coefficients)} has roots that are not real")
    if relative and coefficients[-1] == 0:
        raise ValueError("the root 0 has no relative width")
    narrow = _relative(width) if relative else lambda low, high: high - low <= width
    bound = max(map(abs, coefficients)) // abs(coefficients[0]) + 2  # 1 + max |c_i/c_0| (Cauchy) is above all roots
    radius, degree = Fraction(1 << int(bound).bit_length()), len(coefficients) - 1
    return list(_split(coefficients, narrow, (-radius, degree), (radius, 0)))


def _relative(width: Fraction) -> Narrow:
    return lambda low, high: low * high > 0 and high - low <= width * min(abs(low), abs(high))


def count_above(coefficients: Sequence[int], a: Fraction) -> int:
    """Number of roots > a, with multiplicity, of a real-rooted polynomial."""
    signs = [c > 0 for c in _shift(coefficients, a) if c]
    return sum(before != after for before, after in pairwise(signs))


def _split(
    p: Sequence[int], narrow: Narrow, low: tuple[Fraction, int], high: tuple[Fraction, int]
) -> Iterator[Interval]:
    """The roots between two points, each given with the number of roots above it."""
    count = low[1] - high[1]
    if count == 1:
        yield _bisect(p, narrow, low[0], *high)
    elif count and narrow(low[0], high[0]):
        yield Interval(low[0], high[0], count)
    elif count:
        middle = (low[0] + high[0]) / 2
        between = (middle, count_above(p, middle))
        yield from _split(p, narrow, low, between)
        yield from _split(p, narrow, between, high)


def _bisect(p: Sequence[int], narrow: Narrow, low: Fraction, high: Fraction, above_high: int) -> Interval:
    """A simple root narrowed by signs: just above it p has the sign of (−1)^(roots above high) times the first."""
    sign_above = (-1) ** above_high * p[0] > 0
    while not narrow(low, high):
        middle = (low + high) / 2
        value = _scaled_value(p, middle)
        if value == 0 or (value > 0) == sign_above:
            high = middle
        else:
            low = middle
    return Interval(low, high, 1)


def _scaled_value(p: Sequence[int], a: Fraction) -> int:
    """p(a) times the denominator of a to the degree: an integer of the same sign."""
    value, power = 0, 1
    for c in p:
        value = value * a.numerator + c * power
        power *= a.denominator
    return value


def _shift(p: Sequence[int], a: Fraction) -> list[int]:
    """Coefficients of p((u + y)/v), a = u/v, times v^degree."""
    c = [value * a.denominator**i for i, value in enumerate(p)]
    for end in range(len(c), 1, -1):
        for i in range(1, end):
            c[i] += a.numerator * c[i - 1]
    return c


def _newton(p: Sequence[int]) -> bool:
    """Newton's inequalities, necessary for real roots: c_k² ≥ c_{k−1} c_{k+1} (k + 1)(n − k + 1)/(k (n − k))."""
    n = len(p) - 1
    return all(p[k] ** 2 * k * (n - k) >= p[k - 1] * p[k + 1] * (k + 1) * (n - k + 1) for k in range(1, n))
