"""The exact (d, N) of a chain with joint springs, which break the recursion: determinants at integer points."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

from modal import pair
from modal.integer_polynomials import integers, interpolated, leading_minors, scaled


def sampled(
    parameters: Sequence[Sequence[Fraction]], stiffness: Sequence[Fraction], gravity: Fraction
) -> tuple[list[int], list[int]]:
    """(d, N) of a chain with joint springs: d = det B, N = det [[B, −b], [x bᵀ, Σm]] with B = K − x A.

    At x = −1, −2, … the larger matrix has positive leading minors, so its elimination never stops.
    """
    mass, length, centre, _ = parameters
    b, A = pair.first_moments(mass, length, centre), pair.inertia_matrix(*parameters)
    K = _stiffness_matrix([gravity * moment for moment in b], stiffness)
    unit = lcm(*(value.denominator for row in (*A, *K, b, mass) for value in row))
    minors = []
    for x in range(-1, -len(b) - 2, -1):
        B = [[k - x * a for k, a in zip(*rows, strict=True)] for rows in zip(K, A, strict=True)]
        bordered = [[*row, -moment] for row, moment in zip(B, b, strict=True)] + [[*scaled(x, b), sum(mass)]]
        minors.append(leading_minors([[int(unit * value) for value in row] for row in bordered])[-2:])
    d = interpolated([Fraction(below) for below, _ in minors])
    N = interpolated([Fraction(force, unit) for _, force in minors])
    whole = integers(d + N)
    return whole[: len(d)], whole[len(d) :]


def _stiffness_matrix(weights: Sequence[Fraction], stiffness: Sequence[Fraction]) -> list[list[Fraction]]:
    """K = g diag b + Σ k_i (e_i − e_{i−1})(e_i − e_{i−1})ᵀ: spring i holds link i to the link above it."""
    K = [[weight if i == j else Fraction(0) for j in range(len(weights))] for i, weight in enumerate(weights)]
    for i, spring in enumerate(stiffness):
        K[i][i] += spring
        if i:
            K[i - 1][i - 1] += spring
            K[i - 1][i] -= spring
            K[i][i - 1] -= spring
    return K
