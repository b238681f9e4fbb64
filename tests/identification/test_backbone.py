"""One link at swings that are not small, by SciPy's integrator: one mode, its small-swing frequency by √(g/l)/2π."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy
from amounts import usually

from modal.identification import Identified, identify, poles_table
from modal.identification.backbone import action, backbone, softening, swing_angle

FREQUENCY = 1.66
OMEGA = 2 * np.pi * FREQUENCY
NAME = ("theta_1_1_rad",)


@cache
def swing(degrees: float, damping: float, duration: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """θ'' = −ω₀² sin θ − 2 ζ ω₀ θ' from rest, 50 times a second."""
    times = np.arange(0, duration, 0.02)
    run = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], -(OMEGA**2) * np.sin(y[0]) - 2 * damping * OMEGA * y[1]],
        (0, duration),
        [np.radians(degrees), 0.0],
        method="DOP853",
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    )
    return times, run.y[0]


def noisy(degrees: float, damping: float, seed: int, noise: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    times, values = swing(degrees, damping)
    return times, values + noise * np.random.default_rng(seed).standard_normal(len(times))


def poles(degrees: float, damping: float, method: str = "era") -> Identified:
    times, values = noisy(degrees, damping, 0)
    return identify([(times, values[:, None])], NAME, method=method)


@pytest.mark.parametrize("degrees", [5.0, 58.0, 90.0, 150.0])
def test_the_first_harmonic_of_one_link_tells_its_angle_period_and_action(degrees: float) -> None:
    """By elliptic integrals, and ∮ p dθ/2π by quadrature."""
    angle = np.radians(degrees)
    m = np.sin(angle / 2) ** 2
    q = np.exp(-np.pi * scipy.special.ellipk(1 - m) / scipy.special.ellipk(m))
    amplitude = np.array([8 * np.sqrt(q) / (1 + q)])
    assert swing_angle(float(amplitude[0])) == pytest.approx(angle, rel=1e-5)
    assert softening(amplitude)[0] == pytest.approx(1 - np.pi / 2 / scipy.special.ellipk(m), rel=1e-5)
    phi, weights = np.polynomial.legendre.leggauss(60)
    phi, weights = (phi + 1) * np.pi / 4, weights * np.pi / 4
    theta = 2 * np.arcsin(np.sqrt(m) * np.sin(phi))
    momenta = np.sqrt(2 * (np.cos(theta) - np.cos(angle)))
    slopes = 2 * np.sqrt(m) * np.cos(phi) / np.cos(theta / 2)
    assert action(amplitude)[0] == pytest.approx(4 * weights @ (momenta * slopes) / (2 * np.pi), rel=1e-4)


@pytest.mark.parametrize("method", ["era", "decrement"])
@pytest.mark.parametrize(
    ("degrees", "damping"), [(58.0, 0.002), (20.0, 0.002), (20.0, 0.01), (58.0, 0.01), (90.0, 0.002), (90.0, 0.01)]
)
def test_one_link_has_one_mode_whose_small_frequency_is_given(degrees: float, damping: float, method: str) -> None:
    identified = poles(degrees, damping, method)
    (mode,) = identified.modes
    assert abs(mode.frequency - FREQUENCY) < 2.5 * mode.frequency_std < 2e-3
    assert abs(mode.damping_ratio - damping) < 3 * mode.damping_ratio_std < 0.1 * damping
    assert mode.frequency_of == "small swings"
    assert mode.amplitude_dependence is not None
    ratio, std = mode.amplitude_dependence
    assert abs(ratio - 1) < 4 * std < 0.1
    assert mode.frequency_shift is not None
    assert -mode.frequency_shift / FREQUENCY == pytest.approx(np.radians(degrees) ** 2 / 16, rel=0.15)
    assert any("as that of one link" in note for note in identified.notes)


def test_the_third_harmonic_is_named_as_one() -> None:
    """a²/192 of the amplitude a (Landau & Lifshitz, Mechanics, §28, for the cubic term of the sine)."""
    identified = poles(58.0, 0.002)
    ((harmonic,), (word,)) = identified.modes[0].harmonics, [note for note in identified.notes if "harmonic" in note]
    assert harmonic.order == 3
    assert harmonic.share == pytest.approx(np.radians(58.0) ** 2 / 192, rel=0.1)
    assert "third harmonic of mode 1" in word
    table = poles_table(identified, "json")
    assert '"frequency_of": "small swings"' in table
    assert '"order": 3' in table


def test_a_change_that_the_record_does_not_show_is_said_to_be_of_its_swing() -> None:
    for method in ("era", "decrement"):
        identified = poles(5.0, 0.002, method)
        (mode,) = identified.modes
        assert mode.frequency_of == "large swings"
        assert 0 < FREQUENCY - mode.frequency < FREQUENCY * np.radians(5.0) ** 2 / 16
        assert any("of up to 5°" in note for note in identified.notes)
    times, values = noisy(17.0, 0.0005, 0, 1e-2)
    (mode,) = identify([(times, OMEGA * values[:, None])], ("theta_dot_1_1",)).modes
    assert mode.frequency_of == "large swings"
    assert 0 < FREQUENCY - mode.frequency < FREQUENCY * np.radians(17.5) ** 2 / 16


def test_intervals_hold_over_seeds() -> None:
    deviations = []
    for degrees, damping in ((20.0, 0.002), (58.0, 0.002), (90.0, 0.002)):
        for seed in range(usually(6, 20)):
            curve = backbone([noisy(degrees, damping, seed)])
            assert curve is not None
            assert curve.of_one_link
            deviations.append((abs(curve.pole) - OMEGA) / np.sqrt(curve.cov[1, 1]))
    assert np.mean(np.abs(deviations) < 1.96) >= 0.9


def test_a_linear_decay_is_never_said_to_change() -> None:
    """Amplitudes of large and small swings, several seeds each: no false alarm."""
    times = swing(5.0, 0.002)[0]
    for size in (0.03, 0.3, 1.0):
        values = size * np.exp(-0.002 * OMEGA * times) * np.cos(OMEGA * times)
        for seed in range(usually(6, 20)):
            curve = backbone([(times, values + 1e-3 * np.random.default_rng(seed).standard_normal(len(times)))])
            assert curve is not None
            assert not curve.changes


def test_two_modes_are_no_backbone() -> None:
    times, values = noisy(58.0, 0.002, 1)
    curve = backbone([(times, values + 0.05 * np.exp(-0.05 * times) * np.cos(26.0 * times))])
    assert curve is None or not curve.of_one_link
    assert backbone([(times[:100], values[:100])]) is None
