"""Polynomials as bare lists, lowest power first, of integers, fractions or symbols: sums, products, quotients."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import zip_longest
from math import gcd, lcm
from typing import Any


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


def scaled(factor: Any, p: Sequence[Any]) -> list[Any]:
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
    shared = gcd(*p) * (1 if p[size - 1] > 0 else -1)
    return [c // shared for c in p[:size]]


def quotient(p: Sequence[Any], q: Sequence[Any]) -> list[Fraction]:
    """Coefficients of p/q, where q divides p."""
    size = max(power for power, c in enumerate(q) if c) + 1
    rest, coefficients = list(map(Fraction, p)), [Fraction(0)] * (len(p) - size + 1)
    for power in reversed(range(len(coefficients))):
        coefficients[power] = rest[power + size - 1] / q[size - 1]
        for k, c in enumerate(q[:size], power):
            rest[k] -= coefficients[power] * c
    return coefficients
