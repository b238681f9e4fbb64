"""The exact (d, N) of a chain with joint springs, which break the recursion: determinants at integer points."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

from modal import pair
from modal.exact.polynomials import integers, interpolated, leading_minors, scaled, shifted


def sample_at_integers(
    parameters: Sequence[Sequence[Fraction]],
    stiffness: Sequence[Fraction],
    sigma: Sequence[Fraction],
    gravity: Fraction,
) -> tuple[list[int], list[int]]:
    """(d, N) of a chain with joint springs: d = det B, N = det [[B, −b], [x bᵀ, Σm]] with B = K − x A.

    Below the smallest root, which is negative only where links stand, B is positive definite, so its elimination never
    stops there.  In the coordinates σ_i θ_i, A and b are those of the hanging chain.
    """
    mass, length, centre, _ = parameters
    b, A = pair.first_moments(mass, length, centre), pair.inertia_matrix(*parameters)
    K = _stiffness_matrix([gravity * sign * moment for moment, sign in zip(b, sigma, strict=True)], stiffness, sigma)
    start = 0
    while not (minors := _minors(A, K, b, mass, start)):
        start = 2 * start + 1
    d = interpolated([Fraction(below) for below, _ in minors])
    N = interpolated([Fraction(force) for _, force in minors])
    whole = integers(shifted(d, start) + shifted(N, start))
    return whole[: len(d)], whole[len(d) :]


def _minors(
    A: Sequence[Sequence[Fraction]],
    K: Sequence[Sequence[Fraction]],
    b: Sequence[Fraction],
    mass: Sequence[Fraction],
    start: int,
) -> list[tuple[int, Fraction]]:
    """(d, N) at x = −start − 1, −start − 2, …, over a common unit; none where B is not definite there."""
    unit = lcm(*(value.denominator for row in (*A, *K, b, mass) for value in row))
    found = []
    for x in range(-start - 1, -start - len(b) - 2, -1):
        B = [[k - x * a for k, a in zip(*rows, strict=True)] for rows in zip(K, A, strict=True)]
        bordered = [[*row, -moment] for row, moment in zip(B, b, strict=True)] + [[*scaled(x, b), sum(mass)]]
        try:
            minors = leading_minors([[int(unit * value) for value in row] for row in bordered])
        except ZeroDivisionError:
            return []
        if min(minors[:-1]) <= 0:
            return []
        found.append((minors[-2], Fraction(minors[-1], unit)))
    return found


def _stiffness_matrix(
    weights: Sequence[Fraction], stiffness: Sequence[Fraction], sigma: Sequence[Fraction]
) -> list[list[Fraction]]:
    """K = g diag σb + Σ k_i (σ_i e_i − σ_{i−1} e_{i−1})(…)ᵀ: spring i holds link i to the link above it."""
    K = [[weight if i == j else Fraction(0) for j in range(len(weights))] for i, weight in enumerate(weights)]
    for i, spring in enumerate(stiffness):
        K[i][i] += spring
        if i:
            K[i - 1][i - 1] += spring
            K[i - 1][i] -= sigma[i - 1] * sigma[i] * spring
            K[i][i - 1] -= sigma[i - 1] * sigma[i] * spring
    return K
