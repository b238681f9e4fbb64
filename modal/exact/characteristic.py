"""Characteristic polynomials with exact integer coefficients, and intervals that provably contain their roots.

With μ = N/d the effective mass of `modal.eigen.recursion`, numerator and denominator are propagated through a link
together, x = ω²:

    d' = k d − x (r d + N),    N' = (k − x p) N + (m k − x m J) d        (d = 1, N = 0 below the last link)

Only N/d has a meaning, so each step may clear its denominators; d becomes det(K − x A) of the chain up to a factor.
On a cart det(K − x M) = (x m_c − k_c + x Σ N_p/d_p) Π d_p.

Two conventions: x = ω² in a `unit`, and paper 001's λ = −unit/ω² = −1/x.  Lists of coefficients begin with the lowest
power; a `Polynomial` is written as usual, highest power first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from typing import Any, Literal, NamedTuple

from modal import pair
from modal.errors import ComputationError
from modal.exact.polynomials import Interval, integers, isolate, multiple, primitive, product, quotient, total
from modal.report import Displayed
from modal.scene import Cart, Pendulum, Scene, require, validate_scene

Variable = Literal["x", "lambda"]
Clear = Callable[[list[Any]], list[Any]]
Links = tuple[tuple[Fraction, ...], ...]
"""One row (mass, length, centre, inertia, stiffness, rotor, σ) per link, top first: a pendulum's exact parameters."""


@dataclass(frozen=True, repr=False)
class Polynomial(Displayed):
    """Integer coefficients, highest power first, of a polynomial in x = ω²/unit or in λ = −unit/ω²."""

    what = "Characteristic polynomial with integer coefficients, the highest power first"
    shows = "variable: variable; unit: unit; coefficients: coefficients"

    coefficients: tuple[int, ...]
    variable: Variable = "x"
    unit: str = "rad^2/s^2"

    @property
    def degree(self) -> int:
        """The highest power."""
        return len(self.coefficients) - 1

    def __call__(self, value: Any) -> Any:
        """Horner's rule: exact for ints and fractions, rounded for floats."""
        return reduce(lambda total, c: total * value + c, self.coefficients, 0 * value)

    def in_x(self) -> Polynomial:
        """The polynomial whose roots are x = ω²/unit."""
        return self if self.variable == "x" else self._with_reciprocal_roots("x")

    def in_lambda(self) -> Polynomial:
        """The polynomial whose roots are λ = −unit/ω²; ComputationError if ω = 0 is a root."""
        return self if self.variable == "lambda" else self._with_reciprocal_roots("lambda")

    def intervals(self, width: Fraction | float = 1e-15) -> list[Interval]:
        """Ascending dyadic intervals, none wider than `width`, that provably contain the roots (all real)."""
        return isolate(self.coefficients, Fraction(width))

    def text(self) -> str:
        """Plain text: 2 λ^2 + 4 λ + 1."""
        return self._format("λ" if self.variable == "lambda" else "x", "{}^{}")

    def latex(self) -> str:
        r"""For LaTeX: 2 \lambda^{2} + 4 \lambda + 1."""
        return self._format(r"\lambda" if self.variable == "lambda" else "x", "{}^{{{}}}")

    def _with_reciprocal_roots(self, variable: Variable) -> Polynomial:
        if self.coefficients[-1] == 0:
            raise ComputationError(f"{self.text()} has the root 0: its reciprocal −1/{self.variable} is infinite")
        coefficients = [c if power % 2 == 0 else -c for power, c in enumerate(reversed(self.coefficients))]
        sign = 1 if coefficients[0] > 0 else -1
        return Polynomial(tuple(sign * c for c in coefficients), variable, self.unit)

    def _format(self, symbol: str, power_format: str) -> str:
        terms = ""
        for power, c in zip(range(self.degree, -1, -1), self.coefficients, strict=True):
            factor = "" if power == 0 else symbol if power == 1 else power_format.format(symbol, power)
            size = str(abs(c)) if abs(c) != 1 or not factor else ""
            terms += f" {'-' if c < 0 else '+'} {' '.join(filter(None, (size, factor)))}" if c else ""
        return "-" + terms[3:] if terms.startswith(" - ") else terms.removeprefix(" + ")


def equal_bobs(n: int, variable: Variable = "lambda") -> Polynomial:
    """The polynomial of n equal bobs in units of g/l: Σ_k C(n,k) (n!/k!) λ^{n−k}, in x (−1)^n n! L_n(x).

    Equations (12) to (14) of paper 001 for n = 1, 2, 3.
    """
    c, coefficients = 1, [1]
    for k in range(n, 0, -1):
        c = c * k * k // (n - k + 1)
        coefficients.append(c)
    in_lambda = Polynomial(tuple(reversed(coefficients)), "lambda", "g/l")
    return in_lambda if variable == "lambda" else in_lambda.in_x()


class Factor(NamedTuple):
    """A factor of a scene's characteristic polynomial in x = ω² (rad²/s²), its multiplicity and a label."""

    polynomial: Polynomial
    multiplicity: int
    label: str


def of_scene(scene: Scene) -> list[Factor]:
    """det(K − x M) of any scene without dampers as primitive integer factors in x = ω² (rad²/s²).

    A number of the scene is read as the shortest decimal that gives its float, as written in the file: 0.1 is 1/10;
    a rod has c = l/2 and I = m l²/12 exactly.  Equal pendula factor, and a free cart's rigid translation is the
    factor x.  Raise SceneError for scenes with dampers.
    """
    validate_scene(scene)
    require(scene, "a polynomial in ω²")
    g, position = exact(scene.gravity), 0
    counts: dict[Links, int] = {}
    names: dict[Links, str] = {}
    for pendulum in scene.pendulum:
        links = exact_links(pendulum)
        counts[links] = counts.get(links, 0) + pendulum.count
        names.setdefault(links, f"pendulum {position + 1}")
        position += pendulum.count
    kinds = {links: _pivot(links, g) for links in counts}
    on_cart = scene.cart is not None
    where = "cart still" if on_cart else "fixed support"
    copies = {links: count * (1 + (scene.space == "space")) - on_cart for links, count in counts.items()}
    factors_at_rest = [
        Factor(_primitive(d), copies[links], f"{where}: {names[links]}")
        for links, (d, _) in kinds.items()
        if copies[links]
    ]
    if scene.cart is None:
        return factors_at_rest
    return _cart_factors(scene.cart, [(*kinds[links], counts[links]) for links in kinds]) + factors_at_rest


def exact(value: float) -> Fraction:
    """The shortest decimal that gives this float, as a fraction."""
    return Fraction(repr(float(value)))


def exact_links(pendulum: Pendulum) -> Links:
    """Every link's parameters as fractions, repeats expanded; σ is 1 for down and −1 for up."""
    rows = []
    for link in pendulum.links:
        m, l, stiffness = map(exact, (link.mass, link.length, link.linear_coefficients[0]))
        rotor = exact(link.rotor_inertia) * exact(link.gear_ratio) ** 2
        rows += [(m, l, *link.proportions(m, l, exact), stiffness, rotor)] * link.count
    sigma = (Fraction(1 if way == "down" else -1) for way in pendulum.ways)
    return tuple((*row, sign) for row, sign in zip(rows, sigma, strict=True))


def eliminate_links(links: Sequence[pair.Constants], clear: Clear) -> tuple[list[Any], list[Any]]:
    """(d, N), lowest power first, of a chain; `clear` removes the common denominator of each link's numbers."""
    d: list[Any] = [1]
    N: list[Any] = [0]
    for link in reversed(links):
        k, r, p, unit, mk, mJ = clear([link.k, link.r, link.p, link.k / link.k, link.m * link.k, link.mJ])
        rows = list(zip([*d, 0], [*N, 0], [0, *d], [0, *N], strict=True))
        d = [k * d0 - r * xd - unit * xN for d0, _, xd, xN in rows]
        N = [k * N0 - p * xN + mk * d0 - mJ * xd for d0, N0, xd, xN in rows]
    return d, N


def _pivot(links: Links, gravity: Fraction) -> tuple[list[int], list[int]]:
    """(d, N) of one pendulum on a moving joint; in the coordinates σ_i θ_i an inverted link has −k for k."""
    mass, length, centre, inertia, stiffness, rotor, sigma = zip(*links, strict=True)
    if any(stiffness) or any(rotor):
        joints = [[spring, -J] if J else [spring] for spring, J in zip(stiffness, rotor, strict=True)]
        return eliminate_sprung_links((mass, length, centre, inertia), joints, sigma, gravity)
    hanging = pair.constants(mass, length, centre, inertia, gravity)
    return eliminate_links(pair.standing(hanging, sigma), integers)


def _cart_factors(cart: Cart, kinds: list[tuple[list[int], list[int], int]]) -> list[Factor]:
    """The modes that move the cart: (x m_c − k_c + x Σ count N/d) Π d, with x as a separate factor without a spring."""
    d, N = [1], [0]
    for chain_d, chain_N, count in kinds:
        d, N = product(d, chain_d), total(product(N, chain_d), multiple(count, product(d, chain_N)))
    unit, mass, spring = integers([Fraction(1), exact(cart.mass), exact(cart.stiffness)])
    inertia = total(multiple(mass, d), multiple(unit, N))
    if spring:
        return [Factor(_primitive(total([0, *inertia], multiple(-spring, d))), 1, "cart moves")]
    moves = _primitive(inertia)
    return [Factor(Polynomial((1, 0)), 1, "rigid translation")] + [Factor(moves, 1, "cart moves")] * (moves.degree > 0)


def _primitive(ascending: Sequence[int]) -> Polynomial:
    return Polynomial(tuple(reversed(primitive(ascending))))


def eliminate_sprung_links(
    parameters: Sequence[Sequence[Fraction]],
    joints: Sequence[list[Fraction]],
    sigma: Sequence[Fraction],
    gravity: Fraction,
) -> tuple[list[int], list[int]]:
    """(d, N) of a chain with joint springs, whose links are eliminated from the free end.

    The part below a joint needs the force and the moment Z (u, φ) if the joint is displaced by u along the rail and the
    link above it turns by φ. With Z = [p, q; q, r]/d below a link and its b, in its own angle θ,

        S_uu = p/d − x m,    k = κ − x J of a spring and a rotor,    S_uθ = σ l p/d + q/d − x σ m c,
        S_θθ = k + g σ b − x (m c² + I) + (l² p + 2 σ l q + r)/d

    and θ is eliminated: d' = d S_θθ, p' = d' (S_uu − S_uθ²/S_θθ), q' = d' k S_uθ/S_θθ, r' = d' (k − k²/S_θθ), which are
    polynomials.  On a pivot N = −p/x.
    """
    mass, length, centre, _ = parameters
    b = pair.first_moments(mass, length, centre)
    d, p, q, r = [1], [0], [0], [0]
    for m, l, c, I, k, sign, moment in reversed(list(zip(*parameters, joints, sigma, b, strict=True))):
        S_uu = total(p, multiple(-m, [0, *d]))
        S_ut = total(total(multiple(sign * l, p), q), multiple(-sign * m * c, [0, *d]))
        load = total(total(multiple(l**2, p), multiple(2 * sign * l, q)), r)
        S_tt = total(product(total(k, [gravity * sign * moment, -(m * c**2 + I)]), d), load)
        next_p = quotient(total(product(S_uu, S_tt), multiple(-1, product(S_ut, S_ut))), d)
        next_r = total(product(k, S_tt), multiple(-1, product(product(k, k), d)))
        parts = S_tt, next_p, product(k, S_ut), next_r
        coefficients = iter(integers(value for part in parts for value in part))
        d, p, q, r = ([next(coefficients) for _ in part] for part in parts)
    return d, multiple(-1, p[1:])
