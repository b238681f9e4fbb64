"""Characteristic polynomials: closed form, recurrence, determinant, paper and double precision agree, exactly."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import pairwise
from math import comb, factorial, prod

import mpmath as mp
import numpy as np
import oracle
import pytest
import sympy as sp
from amounts import usually

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, SceneError, natural_modes, pair
from modal.exact import Polynomial, equal_bobs, exact, exact_links, isolate, of_scene
from modal.exact.characteristic import Factor
from modal.exact.polynomials import count_above
from modal.symbolic import polynomial_roots, symbolic
from modal.symbolic.eigen import closed_forms

X = sp.Symbol("x")
PAPER = {
    1: (1, 1),
    2: (2, 4, 1),
    3: (6, 18, 9, 1),
    4: (24, 96, 72, 16, 1),
    5: (120, 600, 600, 200, 25, 1),
}


# ---------------------------------------------------------------------------------------------------- equal bobs


def by_recurrence(n: int) -> list[int]:
    """p_{k+1} = ((2k + 1) λ + 1) p_k − k² λ² p_{k−1}, lowest power first."""
    before, now = [0], [1]
    for k in range(n):
        following = [(2 * k + 1) * a + b for a, b in zip([0, *now], [*now, 0], strict=True)]
        for power, c in enumerate(before):
            if k:
                following[power + 2] -= k * k * c
        before, now = now, following
    return now


@pytest.mark.parametrize("n", PAPER)
def test_the_paper_prints_these(n: int) -> None:
    assert equal_bobs(n).coefficients == PAPER[n]


@pytest.mark.parametrize("n", range(61))
def test_closed_form_and_recurrence(n: int) -> None:
    assert list(equal_bobs(n).coefficients) == by_recurrence(n)[::-1]


def test_a_thousand_bobs() -> None:
    c = equal_bobs(1000).coefficients
    assert len(c) == 1001
    for k in (0, 1, 7, 500, 999, 1000):
        assert c[k] == comb(1000, k) * (factorial(1000) // factorial(k))
    assert list(c) == by_recurrence(1000)[::-1]


@pytest.mark.parametrize("n", range(1, 7))
def test_determinant_of_equal_bobs(n: int) -> None:
    A = sp.Matrix(pair.inertia_matrix([1] * n, [1] * n, [1] * n, [0] * n))
    K = sp.diag(*pair.first_moments([1] * n, [1] * n, [1] * n))
    coefficients = sp.Poly((A + X * K).det(method="berkowitz"), X).all_coeffs()
    assert tuple(coefficients) == equal_bobs(n).coefficients
    laguerre = sp.Poly((-1) ** n * sp.factorial(n) * sp.laguerre(n, X), X).all_coeffs()
    assert tuple(laguerre) == equal_bobs(n, "x").coefficients


def test_conventions_turn_into_each_other() -> None:
    in_x = equal_bobs(7, "x")
    assert in_x == equal_bobs(7).in_x()
    assert in_x.in_lambda() == equal_bobs(7)
    assert in_x.in_x() is in_x
    assert (in_x.variable, in_x.unit, in_x.degree) == ("x", "g/l", 7)
    assert in_x(Fraction(2, 3)) == equal_bobs(7)(Fraction(-3, 2)) * Fraction(2, 3) ** 7
    with pytest.raises(ComputationError, match="root 0"):
        Polynomial((1, -1, 0)).in_lambda()


def test_written() -> None:
    assert equal_bobs(3).text() == "6 λ^3 + 18 λ^2 + 9 λ + 1"
    assert equal_bobs(2, "x").latex() == "x^{2} - 4 x + 2"
    assert equal_bobs(1).latex() == r"\lambda + 1"
    assert Polynomial((-1, 0, -1, 1)).text() == "-x^3 - x + 1"
    assert equal_bobs(2)(0.5) == 3.5


# -------------------------------------------------------------------------------------------------------- scenes


def decimal(rng: random.Random, most: int = 300) -> float:
    return rng.randint(1, most) / 100


def link(rng: random.Random, *, springs: bool) -> Bob | Rod | Body:
    stiffness = decimal(rng) if springs and rng.random() < 0.6 else 0.0
    common = {"mass": decimal(rng), "length": decimal(rng), "stiffness": stiffness}
    if stiffness > 2:
        common |= {"rotor_inertia": stiffness / 5, "gear_ratio": 0.5}
    kind = rng.choice([Bob, Rod, Body])
    return kind(**common) if kind is not Body else Body(**common, centre=decimal(rng), inertia=rng.choice([0.0, 0.7]))


def small_scene(seed: int) -> Scene:
    """At most six coordinates of every kind, all numbers with two decimals."""
    rng = random.Random(seed)
    springs = seed % 3 == 0
    pendula = tuple(
        Pendulum(links=tuple(link(rng, springs=springs) for _ in range(rng.randint(1, 2))), count=rng.randint(1, 2))
        for _ in range(rng.randint(1, 2))
    )
    cart = Cart(mass=rng.choice([0.0, decimal(rng)]), stiffness=rng.choice([0.0, decimal(rng)]))
    return Scene(gravity=decimal(rng, 2000), support=rng.choice([Fixed(), cart, cart]), pendulum=pendula)


def exact_determinant(scene: Scene) -> sp.Poly:
    """det(K − x M) over the rationals from kinetic energies of the centres, every copy written out."""
    cart = isinstance(scene.support, Cart)
    pendula = [exact_links(p) for p in scene.pendulum for _ in range(p.count)]
    size = cart + sum(map(len, pendula))
    M, K, at = sp.zeros(size), sp.zeros(size), int(cart)
    unit = [sp.eye(size)[:, i] for i in range(size)]
    rail = unit[0] if cart else sp.zeros(size, 1)
    if isinstance(scene.support, Cart):
        M[0, 0], K[0, 0] = rational(exact(scene.support.mass)), rational(exact(scene.support.stiffness))
    for links in pendula:
        pivot, upper = rail, sp.zeros(size, 1)
        for row in links:
            m, l, c, I, spring, rotor, _ = map(rational, row)
            here = unit[at]
            centre = pivot + c * here
            M += m * centre * centre.T + I * here * here.T + rotor * (here - upper) * (here - upper).T
            K += spring * (here - upper) * (here - upper).T
            for i in range(int(cart), size):
                K[i, i] += m * rational(exact(scene.gravity)) * centre[i]
            pivot, upper, at = pivot + l * here, here, at + 1
    return sp.Poly((K - X * M).det(method="berkowitz"), X, domain="QQ")


def rational(value: Fraction) -> sp.Rational:
    return sp.Rational(value.numerator, value.denominator)


def multiplied(factors: list[Factor]) -> sp.Poly:
    unit = sp.Poly(1, X, domain="QQ")
    return prod((sp.Poly(f.polynomial.coefficients, X, domain="QQ") ** f.multiplicity for f in factors), start=unit)


@pytest.mark.parametrize("seed", usually(range(20), range(60)))
def test_factors_multiply_to_the_determinant(seed: int) -> None:
    scene = small_scene(seed)
    factors = of_scene(scene)
    assert multiplied(factors).monic() == exact_determinant(scene).monic()
    for factor in factors:
        c = factor.polynomial.coefficients
        assert c[0] > 0
        assert np.gcd.reduce(np.array(c, dtype=object)) == 1


def test_the_comparison_with_the_determinant_bites() -> None:
    scene = small_scene(1)
    other = scene.model_copy(update={"gravity": scene.gravity + 0.01})
    assert multiplied(of_scene(other)).monic() != exact_determinant(scene).monic()


def test_the_small_scenes_are_of_every_kind() -> None:
    scenes = [small_scene(seed) for seed in range(60)]
    carts = [s.support for s in scenes if isinstance(s.support, Cart)]
    assert {(cart.mass > 0, cart.stiffness > 0) for cart in carts} == {(a, b) for a in (0, 1) for b in (0, 1)}
    assert len(carts) < len(scenes)
    assert {link.kind for s in scenes for link in s.links()} == {"bob", "rod", "body"}
    assert any(link.stiffness > 0 for s in scenes for link in s.links())
    assert any(p.count > 1 for s in scenes for p in s.pendulum)


def test_a_decimal_is_meant_as_written() -> None:
    assert exact(0.1) == Fraction(1, 10)
    assert exact(1e-7) == Fraction(1, 10**7)
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=0.3, length=0.1),)),))
    assert of_scene(scene) == [Factor(Polynomial((10, -981)), 1, "fixed support: pendulum 1")]


def test_pendula_on_a_cart_in_closed_form() -> None:
    three = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=3)
    scene = Scene(gravity=1.0, support=Cart(mass=2.0), pendulum=(three,))
    assert [(f.polynomial.text(), f.multiplicity, f.label) for f in of_scene(scene)] == [
        ("x", 1, "rigid translation"),
        ("2 x - 5", 1, "cart moves"),
        ("x - 1", 2, "cart still: pendulum 1"),
    ]
    across = of_scene(scene.model_copy(update={"space": "space"}))
    assert [f.multiplicity for f in across] == [1, 1, 5]
    massless = of_scene(scene.model_copy(update={"support": Cart(mass=0.0)}))
    assert [f.label for f in massless] == ["rigid translation", "cart still: pendulum 1"]


def test_equal_entries_are_one_kind() -> None:
    twice = Pendulum(links=(Bob(mass=1.0, length=1.0, count=2),))
    written = Pendulum(links=(Bob(mass=1.0, length=1.0), Bob(mass=1.0, length=1.0)))
    (factor,) = of_scene(Scene(gravity=1.0, pendulum=(twice, written)))
    assert factor == (Polynomial((1, -4, 2)), 2, "fixed support: pendulum 1")


def test_dampers_are_refused() -> None:
    scene = Scene(gravity=1.0, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, damping=0.1),)),))
    with pytest.raises(SceneError, match=r"damping = 0\.1"):
        of_scene(scene)


def long_rods(n: int) -> Scene:
    rng = random.Random(n)
    rods = tuple(Rod(mass=decimal(rng), length=decimal(rng)) for _ in range(n))
    return Scene(gravity=9.81, support=Cart(mass=3.7), pendulum=(Pendulum(links=rods),))


def test_intervals_of_many_rods_hold_the_computed_frequencies() -> None:
    n = usually(25, 50)
    scene = long_rods(n)
    moving = next(f.polynomial for f in of_scene(scene) if f.label == "cart moves")
    squares = natural_modes(scene).omega[1:] ** 2
    intervals = moving.intervals(1e-12)
    assert len(intervals) == moving.degree == len(squares) == n
    for interval, square in zip(intervals, squares, strict=True):
        slack = Fraction(float(square)) * Fraction(1, 10**13)
        assert interval.low - slack < Fraction(float(square)) < interval.high + slack


@pytest.mark.parametrize("seed", range(0, 60, 5))
def test_intervals_agree_with_the_oracle(seed: int) -> None:
    """Between the roots of all factors the many-digit determinant has the right number of negative pivots."""
    scene = small_scene(seed)
    held = sorted(
        (interval.low, interval.high, interval.multiplicity * factor.multiplicity)
        for factor in of_scene(scene)
        if factor.polynomial.coefficients != (1, 0)
        for interval in factor.polynomial.intervals(1e-9)
    )
    dense = oracle.dense(scene)
    for low, high, _ in held:
        for trial in (low - Fraction(1, 10**8), high + Fraction(1, 10**8)):
            x = mp.mpf(trial.numerator) / trial.denominator
            assert dense.below(x) == sum(count for _, top, count in held if top < trial)


# --------------------------------------------------------------------------------------------------------- roots


@pytest.mark.parametrize("n", [1, 5, 30])
def test_intervals_hold_the_zeros_of_laguerre(n: int) -> None:
    width = Fraction(1, 10**25)
    intervals = equal_bobs(n, "x").intervals(width)
    assert len(intervals) == n
    p = equal_bobs(n, "x")
    for low, high, multiplicity in intervals:
        assert multiplicity == 1
        assert 0 < high - low <= width
        assert p(low) * p(high) <= 0
    assert all(a.high <= b.low for a, b in pairwise(intervals))
    in_lambda = equal_bobs(n).intervals(width)
    assert [float(-1 / i.high) for i in in_lambda] == pytest.approx([float(i.low) for i in intervals], rel=1e-14)


def test_multiple_and_rational_roots() -> None:
    p = [int(c) for c in sp.Poly((X - 1) ** 3 * (X - 2) * X * (2 * X + 3), X).all_coeffs()]
    intervals = isolate(p, Fraction(1, 1000))
    assert [i.multiplicity for i in intervals] == [1, 1, 3, 1]
    for interval, root in zip(intervals, (Fraction(-3, 2), 0, 1, 2), strict=True):
        assert interval.low < root <= interval.high
        assert interval.high - interval.low <= Fraction(1, 1000)
    assert [count_above(p, Fraction(a)) for a in (-2, -1, 0, 1, 2)] == [6, 5, 4, 1, 0]


def test_roots_that_are_not_real_are_refused() -> None:
    with pytest.raises(ComputationError, match="not real"):
        isolate((1, 0, 1), Fraction(1, 10))
    with pytest.raises(ValueError, match="width"):
        isolate((1, -1), Fraction(0))


@pytest.mark.parametrize("n", range(1, 6))
def test_closed_forms_lie_in_their_intervals(n: int) -> None:
    roots = polynomial_roots(equal_bobs(n, "x"), Fraction(1, 10**20))
    assert [float(root.high) for root in roots] == pytest.approx(np.polynomial.laguerre.lagroots([0] * n + [1]))
    for root in roots:
        assert (root.exact is not None) == (n <= 3)
        if root.exact is not None:
            value = sp.N(root.exact, 40)
            assert root.low < value <= root.high or value == pytest.approx(root.high, abs=1e-35)


def test_radicals() -> None:
    assert [r.exact for r in polynomial_roots(equal_bobs(2, "x"))] == [2 - sp.sqrt(2), 2 + sp.sqrt(2)]
    rods = Scene(gravity=1.0, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),)),))
    exact_roots = [r.exact for r in polynomial_roots(of_scene(rods)[0].polynomial)]
    assert [sp.simplify(r - 3 - s * 6 / sp.sqrt(7)) for r, s in zip(exact_roots, (-1, 1), strict=True)] == [0, 0]
    assert closed_forms(PAPER[4]) is None


def test_rational_factors_are_found() -> None:
    p = Polynomial(tuple(int(c) for c in sp.Poly((X - 3) ** 2 * (X**2 - 4 * X + 2), X).all_coeffs()))
    assert [(r.exact, r.multiplicity) for r in polynomial_roots(p)] == [
        (2 - sp.sqrt(2), 1),
        (3, 2),
        (2 + sp.sqrt(2), 1),
    ]


# ------------------------------------------------------------------------------------------------------- symbols


def test_two_unequal_bobs() -> None:
    m1, m2, l1, l2, g = sp.symbols("m_1 m_2 l_1 l_2 g", positive=True)
    lam = sp.Symbol("lambda")
    assert symbolic(2) == m1 * l1 * l2 * X**2 - g * (m1 + m2) * (l1 + l2) * X + g**2 * (m1 + m2)
    assert symbolic(2, variable="lambda") == (m1 + m2) * lam**2 + (m1 + m2) * (l1 + l2) * lam + m1 * l1 * l2


def test_any_number_of_pendula_on_a_cart() -> None:
    m, l, g, m_c = sp.symbols("m_1 l_1 g m_c", positive=True)
    N = sp.Symbol("N")
    (square,) = closed_forms(sp.Poly(symbolic(1, cart=True, count=N), X).all_coeffs())
    assert sp.simplify(square - g / l * (1 + N * m / m_c)) == 0


@pytest.mark.parametrize("kind", ["bob", "rod"])
@pytest.mark.parametrize("cart", [False, True])
@pytest.mark.parametrize("n", usually([1, 2, 3], [1, 2, 3, 4]))
def test_symbols_give_the_numbers(n: int, cart: bool, kind: str) -> None:
    rng = random.Random(n)
    mass, length = ([rng.randint(1, 9) for _ in range(n)] for _ in range(2))
    part = {"bob": Bob, "rod": Rod}[kind]
    links = tuple(part(mass=float(m), length=float(l)) for m, l in zip(mass, length, strict=True))
    scene = Scene(gravity=7.0, support=Cart(mass=5.0) if cart else Fixed(), pendulum=(Pendulum(links=links, count=2),))
    values = {"g": 7, "m_c": 5}
    values |= {f"m_{i}": m for i, m in enumerate(mass, 1)} | {f"l_{i}": l for i, l in enumerate(length, 1)}
    expression = symbolic(n, kind, cart=cart, count=2)
    put = expression.subs({s: values[s.name] for s in expression.free_symbols if s.name != "x"})
    wanted = next(f.polynomial for f in of_scene(scene) if f.label in {"cart moves", "fixed support: pendulum 1"})
    assert sp.Poly(put, X).primitive()[1].all_coeffs() == list(wanted.coefficients)


def test_unequal_bobs_against_the_determinant() -> None:
    n = usually(4, 5)
    m, l = sp.symbols(f"m_1:{n + 1}", positive=True), sp.symbols(f"l_1:{n + 1}", positive=True)
    lam, put = sp.Symbol("lambda"), dict(zip((*m, *l), (2, 3, 5, 7, 11, 13, 17, 19, 23, 29), strict=False))
    mass, length = [put[s] for s in m], [put[s] for s in l]
    A, b = pair.inertia_matrix(mass, length, length, [0] * n), pair.first_moments(mass, length, length)
    polynomial = sp.Poly((sp.Matrix(A) + lam * sp.diag(*b)).det(method="berkowitz"), lam)
    assert sp.Poly(symbolic(n, variable="lambda").subs(put), lam).primitive()[1] == polynomial.primitive()[1]
