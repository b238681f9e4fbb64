"""Roots in closed form if there is one, and characteristic polynomials in symbols (SymPy).

Degrees 1 and 2 have radicals; an irreducible cubic with three real roots has none without complex numbers (casus
irreducibilis), but cosines: x_k = −c₁/(3 c₀) + 2 √(−p/3) cos(⅓ arccos(3q/(2p) √(−3/p)) − 2πk/3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from typing import Any, Literal, NamedTuple

import sympy as sp
from sympy.polys.fields import FracField

from modal import pair
from modal.exact import Polynomial, Variable, eliminate_links, isolate, multiple, product, total

MOST_FACTORED = 12
"""Limit: degree of polynomials that are searched for rational factors, or come from a determinant; not beyond."""


@dataclass(frozen=True)
class Root:
    """low < root ≤ high, its multiplicity, and the root itself in closed form (None without one of degree ≤ 3)."""

    exact: sp.Expr | None
    low: Fraction
    high: Fraction
    multiplicity: int


def polynomial_roots(polynomial: Polynomial, width: Fraction | float = 1e-15) -> list[Root]:
    """Ascending roots, each in closed form if there is one and in any case in an interval.

    No interval is wider than `width` times its smaller end; the root 0 is exact.
    """
    roots = [root for factor, count in _factors(polynomial) for root in _of_factor(factor, count, Fraction(width))]
    return sorted(roots, key=lambda root: root.low + root.high)


def closed_forms(coefficients: Sequence[Any]) -> list[sp.Expr] | None:
    """Ascending roots of a real-rooted polynomial of degree 1 to 3 in closed form, highest power first, else None.

    The coefficients may be symbols.
    """
    c = [sp.sympify(value) for value in coefficients]
    if len(c) == 2:
        return [sp.factor(-c[1] / c[0])]
    if len(c) == 3:
        middle, offset = -c[1] / (2 * c[0]), sp.sqrt(sp.factor(c[1] ** 2 - 4 * c[0] * c[2])) / (2 * c[0])
        return [middle - offset, middle + offset]
    return _cosines(*c) if len(c) == 4 else None


def symbolic(
    n: int,
    kind: Literal["bob", "rod"] = "bob",
    *,
    cart: bool = False,
    count: Any = 1,
    variable: Variable = "x",
) -> sp.Expr:
    """The polynomial of n unequal bobs or rods in symbols m_i, l_i, g, powers collected and coefficients factored.

    On a free cart of mass m_c, for `count` equal pendula (a number or a symbol): the factor of the modes that move the
    cart.  In x = ω² (rad²/s²), or in λ = −g/ω² (m), where g cancels: det(A + λ diag b), with equal lengths
    (12) to (14) of paper 001.
    """
    m, l = ([sp.Symbol(f"{name}_{i + 1}", positive=True) for i in range(n)] for name in "ml")
    centre, inertia = zip(*map(pair.proportions, [kind] * n, m, l), strict=True)
    kind_of_chain = Kind((m, l, centre, inertia), (1,) * n, count)
    mass = sp.Symbol("m_c", positive=True) if cart else None
    return of_kinds([kind_of_chain], sp.Symbol("g", positive=True), cart=mass, variable=variable)


class Kind(NamedTuple):
    """`count` equal chains: masses, lengths, centres, moments of inertia, and σ = ±1 for a link down or up."""

    geometry: Sequence[Sequence[Any]]
    sigma: Sequence[int]
    count: Any


def of_kinds(kinds: Sequence[Kind], gravity: Any, *, cart: Any = None, variable: Variable = "x") -> sp.Expr:
    """The polynomial for chains in any symbols and exact numbers: of one alone, or of those that move a free cart.

    `cart` is its mass; None means the first kind on a fixed support.
    """
    g, m_c = sp.sympify(gravity), sp.sympify(cart or 0)
    values = [v for kind in kinds for row in (*kind.geometry, [kind.count]) for v in row]
    names = {name for value in (g, m_c, *map(sp.sympify, values)) for name in value.free_symbols}
    field = FracField(sorted(names, key=str) or [sp.Symbol("x")], sp.ZZ)
    chains = [(_recursion(kind, field, field.from_expr(g)), field.from_expr(sp.sympify(kind.count))) for kind in kinds]
    if cart is None:
        return _collect(chains[0][0][0], g, variable)
    d, N = [field.one], [field.zero]
    for (denominator, force), count in chains:
        d, N = product(d, denominator), total(product(N, denominator), multiple(count, product(d, force)))
    moving = total(multiple(field.from_expr(m_c), d), N)
    return _collect(moving, g, variable)


def _recursion(kind: Kind, field: FracField, gravity: Any) -> tuple[list[Any], list[Any]]:
    mass, length, centre, inertia = ([field.from_expr(sp.sympify(v)) for v in row] for row in kind.geometry)
    hanging = pair.constants(mass, length, centre, inertia, gravity)
    d, N = eliminate_links(pair.standing(hanging, kind.sigma), _clear)
    return [field(c) for c in d], [field(c) for c in N]


def _clear(values: list[Any]) -> list[Any]:
    """Rational functions times their least common denominator, divided by their common content."""
    unit = reduce(lambda a, b: a.lcm(b), (value.denom for value in values))
    return _without_content([value.numer * unit.exquo(value.denom) for value in values])


def _without_content(values: list[Any]) -> list[Any]:
    common_factor = reduce(lambda a, b: a.gcd(b), values)
    return [value.exquo(common_factor) for value in values]


def _collect(ascending: list[Any], g: sp.Expr, variable: Variable) -> sp.Expr:
    """Σ c_k x^k with every c_k factored, or with x = −g/λ, times λ^n/g^n: Σ (−1)^k g^{k−n} c_k λ^{n−k}."""
    n = len(ascending) - 1
    coefficients = [c.as_expr() for c in _clear(ascending)]
    if variable == "x":
        return sp.Add(*((-1) ** n * sp.factor(c) * sp.Symbol("x") ** k for k, c in enumerate(coefficients)))
    return sp.Add(
        *((-1) ** k * sp.factor(c * g ** (k - n)) * sp.Symbol("lambda") ** (n - k) for k, c in enumerate(coefficients))
    )


def _factors(polynomial: Polynomial) -> Iterator[tuple[list[int], int]]:
    """Irreducible factors over the rationals and their multiplicities, where the degree is modest."""
    c = list(polynomial.coefficients)
    if polynomial.degree > MOST_FACTORED:
        return iter([(c, 1)])
    _, factors = sp.Poly(c, sp.Symbol("x")).factor_list()
    return ((list(map(int, factor.all_coeffs())), int(count)) for factor, count in factors)


def _of_factor(coefficients: list[int], count: int, width: Fraction) -> Iterator[Root]:
    if coefficients == [1, 0]:
        yield Root(sp.S.Zero, Fraction(0), Fraction(0), count)
        return
    intervals = isolate(coefficients, width, relative=coefficients[-1] != 0)
    exact = closed_forms(coefficients) or [None] * len(intervals)
    for form, interval in zip(exact, intervals, strict=True):
        yield Root(form, interval.low, interval.high, count * interval.multiplicity)


def _cosines(a: sp.Expr, b: sp.Expr, c: sp.Expr, d: sp.Expr) -> list[sp.Expr]:
    """Three distinct real roots of a x³ + b x² + c x + d, ascending (Viète)."""
    p = (3 * a * c - b**2) / (3 * a**2)
    q = (2 * b**3 - 9 * a * b * c + 27 * a**2 * d) / (27 * a**3)
    third = sp.acos(3 * q / (2 * p) * sp.sqrt(-3 / p)) / 3
    return [-b / (3 * a) + 2 * sp.sqrt(-p / 3) * sp.cos(third - 2 * sp.pi * k / 3) for k in (2, 1, 0)]
