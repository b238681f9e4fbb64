"""Polynomials as bare lists, lowest power first, of integers, fractions or symbols: sums, products, determinants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import pairwise, zip_longest
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


def leading_minors(matrix: Sequence[Sequence[int]]) -> list[int]:
    """All leading principal minors of an integer matrix, none of them 0 (Bareiss 1968: division is exact)."""
    A, before = [list(row) for row in matrix], 1
    for k, top in enumerate(A):
        for row in A[k + 1 :]:
            lead = row[k]
            row[k:] = [(a * top[k] - lead * t) // before for a, t in zip(row[k:], top[k:], strict=True)]
        before = top[k]
    return [A[k][k] for k in range(len(A))]


def interpolated(values: Sequence[Fraction]) -> list[Fraction]:
    """The polynomial with these values at −1, −2, … (Newton's divided differences in −x)."""
    c = list(values)
    for order in range(1, len(c)):
        c[order:] = [(after - before) / order for before, after in pairwise(c[order - 1 :])]
    coefficients = [c[-1]]
    for node in reversed(range(1, len(c))):
        coefficients = total(product(coefficients, [-node, -1]), [c[node - 1]])
    return coefficients


def shifted(p: Sequence[Any], step: Any) -> list[Any]:
    """Coefficients of p(x + step) (repeated Horner)."""
    c = list(p)
    for first in range(len(c) - 1):
        for power in range(len(c) - 2, first - 1, -1):
            c[power] += step * c[power + 1]
    return c
