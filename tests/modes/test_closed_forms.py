"""Closed forms against the toolkit's own modes, exact polynomials and symbols."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import pi, sqrt

import closed_forms
import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.special import jn_zeros

from modal import Bob, Cart, Pendulum, Rod, Scene, natural_modes
from modal.exact import characteristic as polynomials
from modal.modes import Modes, rope
from modal.symbolic import symbolic

G = 9.81
LONG = np.array([50, 100, 200, 400, 800])


def equal_chain(n: int, link: type[Bob] | type[Rod], mass: float = 1.0, length: float = 1.0) -> Modes:
    links = (link(mass=mass, length=length, count=n),)
    return natural_modes(Scene(gravity=G, pendulum=[Pendulum(links=links)]))


@pytest.mark.parametrize("n", range(1, 31))
def test_equal_bobs_lie_in_the_exact_intervals(n: int) -> None:
    intervals = polynomials.equal_bobs(n, "x").intervals(Fraction(1, 10**20))
    for x, interval in zip(closed_forms.equal_bobs(n).tolist(), intervals, strict=True):
        assert interval.low * (1 - Fraction(2, 10**15)) <= Fraction(x) <= interval.high * (1 + Fraction(2, 10**15))


@pytest.mark.parametrize("n", [1, 2, 5, 30, 100])
def test_equal_bobs_are_zeros_in_many_digits(n: int) -> None:
    """One step of Newton's in 60 digits moves none of them."""
    with mp.workdps(60):
        for x in map(mp.mpf, closed_forms.equal_bobs(n).tolist()):
            before, here = mp.mpf(0), mp.mpf(1)
            for j in range(n):
                before, here = here, ((2 * j + 1 - x) * here - j * before) / (j + 1)
            assert abs(here / (n * (here - before))) < 1e-14


@pytest.mark.parametrize("n", [1, 2, 3, 10, 100, 300])
def test_equal_bobs_and_the_toolkit_agree(n: int) -> None:
    np.testing.assert_allclose(
        equal_chain(n, Bob, length=0.3).omega ** 2 * 0.3 / G, closed_forms.equal_bobs(n), rtol=1e-14
    )


@pytest.mark.parametrize("n", range(1, 31))
def test_effective_masses_of_equal_bobs(n: int) -> None:
    masses = [mode.effective_mass for mode in equal_chain(n, Bob, mass=0.7)]
    expected = closed_forms.equal_bob_effective_masses(n)
    np.testing.assert_allclose(np.array(masses) / 0.7, expected, rtol=1e-12)
    assert expected.sum() == pytest.approx(n, rel=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 10, 25])
def test_shapes_of_equal_bobs(n: int) -> None:
    """By the angles (y_j − y_{j+1})/l, the largest 1: displacements far from it would cancel."""
    modes, y = equal_chain(n, Bob), closed_forms.equal_bob_shapes(n)
    assert y.shape == (n, n)
    angles = -np.diff(y, axis=0, append=0.0)[::-1]
    for number, shape in enumerate(angles.T):
        expected = modes.shape(number).angles
        np.testing.assert_allclose(shape / shape[np.argmax(np.abs(expected))], expected, atol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 10])
def test_sums_of_laguerre_polynomials(n: int) -> None:
    """The two sums behind the effective masses: Σ L_j² = x (Σ L_j)² at a zero."""
    y = closed_forms.equal_bob_shapes(n)
    np.testing.assert_allclose((y**2).sum(0), closed_forms.equal_bobs(n) * y.sum(0) ** 2, rtol=1e-11)


def test_rods() -> None:
    assert equal_chain(1, Rod, length=0.4).omega[0] ** 2 * 0.4 / G == pytest.approx(closed_forms.SINGLE_ROD, rel=1e-15)
    two = equal_chain(2, Rod, mass=3.0, length=0.4).omega ** 2 * 0.4 / G
    np.testing.assert_allclose(two, closed_forms.TWO_EQUAL_RODS, rtol=4e-15)


def test_two_equal_rods_in_symbols() -> None:
    P, x = symbolic(2, "rod"), sp.Symbol("x")
    units = dict.fromkeys(P.free_symbols - {x}, 1)
    roots = sorted(sp.roots(P.subs(units), x))
    assert [sp.simplify(a - b) for a, b in zip(roots, (3 - 6 / sp.sqrt(7), 3 + 6 / sp.sqrt(7)), strict=True)] == [0, 0]
    np.testing.assert_allclose([float(root) for root in roots], closed_forms.TWO_EQUAL_RODS, rtol=1e-15)


@pytest.mark.parametrize("count", [1, 2, 5, 1000])
def test_simple_pendula_on_a_cart(count: int) -> None:
    expected = closed_forms.simple_pendula_on_cart(count, mass=0.2, length=2.0, cart_mass=3.0, gravity=G)
    pendulum = Pendulum(links=(Bob(mass=0.2, length=2.0),), count=count)
    modes = natural_modes(Scene(gravity=G, support=Cart(mass=3.0), pendulum=[pendulum]))
    folds = {expected.translation: 1, expected.antiphase: count - 1, expected.in_phase: 1}
    assert modes.multiplicity.tolist() == [fold for fold in folds.values() if fold]
    np.testing.assert_allclose(modes.omega, [omega for omega, fold in folds.items() if fold], rtol=2e-15)


def test_simple_pendula_on_a_cart_in_symbols() -> None:
    N, x = sp.Symbol("N", positive=True), sp.Symbol("x")
    P = symbolic(1, cart=True, count=N)
    g, l, m, m_c = (sp.Symbol(name, positive=True) for name in ("g", "l_1", "m_1", "m_c"))
    (root,) = sp.solve(P, x)
    assert sp.simplify(root - g / l * (1 + N * m / m_c)) == 0


def test_beat_period() -> None:
    """Of two light pendula on a heavy cart: about 2π/(ω_0 m/m_c); and of the paper's cart, 167.8 s."""
    light = closed_forms.simple_pendula_on_cart(2, mass=1e-6, length=1.0, cart_mass=1.0, gravity=G)
    period = closed_forms.beat_period(light.antiphase, light.in_phase)
    assert period == pytest.approx(4 * pi / (sqrt(G) * 2e-6), rel=1e-6)
    assert closed_forms.beat_period(2.680114012253376, 2.7175491179815836) == pytest.approx(167.8, abs=0.05)


def test_bessel_zeros() -> None:
    np.testing.assert_allclose(rope.bessel_zeros(1000), jn_zeros(0, 1000), rtol=1e-15)


def test_the_rope_is_the_limit() -> None:
    limit = rope.hanging_rope(3) * sqrt(G)
    assert limit[0] == pytest.approx(2.40482555769577 / 2 * sqrt(G), rel=1e-14)
    np.testing.assert_allclose(equal_chain(1000, Rod, length=1e-3).omega[:3], limit, rtol=5e-6)


@cache
def errors(link: type[Bob] | type[Rod], count: int) -> np.ndarray:
    """ω/ω_rope − 1 of the lowest `count` modes for n in LONG, (len(LONG), count)."""
    limit = rope.hanging_rope(count) * sqrt(G)
    return np.array([equal_chain(int(n), link, length=1 / n).omega[:count] / limit - 1 for n in LONG])


def order(values: np.ndarray) -> float:
    """The slope of log |error| over log n between the last two refinements."""
    return float(np.diff(np.log(np.abs(values)))[-1] / np.diff(np.log(LONG))[-1])


@pytest.mark.parametrize("mode", [0, 1])
def test_bobs_approach_the_rope_as_1_over_4n(mode: int) -> None:
    gaps = errors(Bob, 4)[:, mode]
    assert order(gaps) == pytest.approx(-1, abs=0.1)
    extrapolated = 2 * gaps[-1] * LONG[-1] - gaps[-2] * LONG[-2]
    assert extrapolated == pytest.approx(-1 / 4, rel=1e-3)
    predicted = np.array([rope.rope_error_of_bobs(int(n)) for n in LONG])
    assert gaps[-1] / predicted[-1] == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("mode", range(4))
def test_rods_approach_the_rope_as_1_over_n_squared(mode: int) -> None:
    gaps = errors(Rod, 4)[:, mode]
    predicted = np.array([rope.rope_error_of_rods(int(n), 4)[mode] for n in LONG])
    assert order(gaps) == pytest.approx(-2, abs=0.1)
    ratio = gaps / predicted
    assert ratio[-1] == pytest.approx(1, abs=1e-3)
    assert np.all(np.diff(np.abs(ratio - 1)) < 0)


def test_the_rates_differ() -> None:
    """Neither slope test would pass with the other's links."""
    assert abs(order(errors(Bob, 4)[:, 0]) + 2) > 0.9
    assert abs(order(errors(Rod, 4)[:, 0]) + 1) > 0.9
