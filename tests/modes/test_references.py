"""Numbers from elsewhere: exact results and published tables, each next to its source."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.special import ellipk, jn_zeros

from modal import Bob, Cart, Pendulum, Rod, Scene, load, natural_modes
from modal.modes import Modes

LAGUERRE = {  # zeros of L_n (Abramowitz & Stegun, table 25.9)
    1: [1.0],
    2: [2 - sqrt(2), 2 + sqrt(2)],
    3: [0.415774556783479, 2.29428036027904, 6.28994508293748],
    4: [0.322547689619392, 1.74576110115835, 4.53662029692113, 9.39507091230113],
    5: [0.263560319718141, 1.41340305910652, 3.59642577104072, 7.08581000585884, 12.6408008442758],
}


def modes_of(*links: Bob | Rod, gravity: float = 9.81, **scene: object) -> Modes:
    return natural_modes(Scene(gravity=gravity, pendulum=[Pendulum(links=links)], **scene))


@pytest.mark.parametrize("n", LAGUERRE)
def test_equal_bobs_are_the_zeros_of_laguerre_polynomials(n: int) -> None:
    modes = natural_modes(load(f"chain-{n}"))
    np.testing.assert_allclose(modes.omega**2 / 9.81, LAGUERRE[n], rtol=3e-15)


def test_single_rod() -> None:
    assert modes_of(Rod(mass=3.0, length=0.7)).omega[0] ** 2 == pytest.approx(1.5 * 9.81 / 0.7, rel=1e-15)


def test_two_equal_rods() -> None:
    modes = modes_of(Rod(mass=0.4, length=0.7, count=2))
    np.testing.assert_allclose(modes.omega**2 * 0.7 / 9.81, [3 - 6 / sqrt(7), 3 + 6 / sqrt(7)], rtol=2e-15)


@pytest.mark.parametrize("n", [1, 2, 7, 1000])
def test_simple_pendula_on_a_free_cart(n: int) -> None:
    scene = Scene(
        gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=(Bob(mass=0.2, length=2.0),), count=n)]
    )
    modes = natural_modes(scene)
    expected = {0.0: 1, 9.81 / 2: n - 1, 9.81 / 2 * (1 + n * 0.2 / 3.0): 1}
    assert modes.multiplicity.tolist() == [fold for fold in expected.values() if fold]
    np.testing.assert_allclose(modes.omega**2, [square for square, fold in expected.items() if fold], rtol=2e-15)


def test_paper_cart_with_two_double_pendula() -> None:
    modes = natural_modes(load("paper-cart-2"))
    reference = [0, 2.680114012253376, 2.7175491179815836, 7.188670870287715, 7.209478103068923]
    np.testing.assert_allclose(modes.omega, reference, rtol=1e-15)
    np.testing.assert_allclose(
        [mode.kappa for mode in modes[1:]], [-0.038802, -0.042729, -0.857142, -0.867200], atol=5e-7
    )
    angles = [mode.linear_to_1_percent_deg for mode in modes[1:]]
    np.testing.assert_allclose(angles, [29.09, 27.72, 6.19, 6.15], atol=0.005)
    beats = 2 * pi / (modes.omega[2] - modes.omega[1]), 2 * pi / (modes.omega[4] - modes.omega[3])
    assert beats == pytest.approx((167.8, 302.0), abs=0.05)


def test_rope_limit_and_its_rate() -> None:
    """ω_k → (j_0k/2) √(g/L); for bobs the relative error is −1/(4n)."""
    exact = jn_zeros(0, 2) / 2 * sqrt(9.81)
    rope = natural_modes(load("rope"))
    np.testing.assert_allclose(rope.omega[:2], exact, rtol=2e-6)
    for n in (50, 100, 200):
        omega = modes_of(Bob(mass=1.0, length=1.0 / n, count=n)).omega[0]
        assert (omega / exact[0] - 1) * 4 * n == pytest.approx(-1, abs=3 / n)


def test_simple_pendulum_amplitude_coefficient_is_that_of_the_elliptic_integral() -> None:
    kappa = modes_of(Bob(mass=1.0, length=1.0))[0].kappa
    assert kappa == pytest.approx(-1 / 16, rel=1e-14)
    a = 1e-3
    slope = (pi / 2 / ellipk(np.sin(a / 2) ** 2) - 1) / a**2
    assert kappa == pytest.approx(slope, rel=1e-5)


def test_crane_with_two_loads() -> None:
    """Both zeros of 1 + Σ μ_r x/(m_c (λ_r − x)), from the quadratic they satisfy."""
    modes = natural_modes(load("crane-two-loads"))
    a, b, q = 9.81 / 20, 9.81 / 10, 0.1
    roots = np.sort(np.roots([1.0, -(a + b) - q * (a + b), a * b * (1 + 2 * q)]))
    np.testing.assert_allclose(modes.omega[1:] ** 2, roots, rtol=1e-14)
