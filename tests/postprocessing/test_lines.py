"""Lines of signals whose frequencies are known, and of a simple pendulum against the elliptic integral."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from modal.errors import ComputationError
from nonlinear.postprocessing import attention, line, lines


def several(rng: np.random.Generator, noise: float) -> tuple[np.ndarray, np.ndarray, list[float], list[float]]:
    """Times, values, frequencies and amplitudes of up to four lines, the first the strongest, none closer than 6/T."""
    T, N = rng.uniform(10, 300), int(rng.integers(500, 3000))
    t = rng.uniform(-5, 5) + np.linspace(0, T, N)
    omega = [rng.uniform(16 * np.pi / T, 0.4 * np.pi * (N - 1) / T)]
    for _ in range(rng.integers(0, 4)):
        other = rng.uniform(16 * np.pi / T, 0.9 * np.pi * (N - 1) / T)
        if min(abs(other - frequency) for frequency in omega) * T / 2 > 6 * np.pi:
            omega.append(other)
    size = [1.0, *(10 ** rng.uniform(-6, -0.1, len(omega) - 1))]
    phase = rng.uniform(0, 6, len(omega))
    f = rng.normal() + sum(a * np.cos(w * t + p) for a, w, p in zip(size, omega, phase, strict=True))
    return t, f + noise * rng.normal(size=N), omega, size


@pytest.mark.parametrize("noise", [0.0, 1e-8, 1e-4, 1e-2])
def test_the_error_that_is_claimed_holds_and_is_not_idle(noise: float) -> None:
    rng = np.random.default_rng(int(1 - np.log10(noise + 1e-16)))
    ratios = []
    for _ in range(30):
        t, f, omega, _ = several(rng, noise)
        estimate = line(t, f)
        error = abs(estimate.omega - omega[0])
        assert error <= estimate.error
        ratios.append(estimate.error / max(error, 4e-16 * omega[0]))
    assert np.median(ratios) < 100
    assert np.percentile(ratios, 90) < 1000


def test_every_line_of_an_exact_signal() -> None:
    rng = np.random.default_rng(4)
    for _ in range(30):
        t, f, omega, size = several(rng, 0.0)
        by_omega = {line.omega: line for line in lines(t, f, 4)}
        assert len(by_omega) == len(omega)
        for w, a in zip(omega, size, strict=True):
            nearest = by_omega[min(by_omega, key=lambda other: abs(other - w))]
            assert abs(nearest.omega - w) <= nearest.error < 1e-8 * w
            assert nearest.amplitude == pytest.approx(a, rel=1e-9, abs=1e-13)


def test_amplitude_and_phase_at_time_zero() -> None:
    t = np.linspace(3.0, 50.0, 1200)
    estimate = line(t, 0.7 * np.cos(5 * t - 2.1))
    assert (estimate.omega, estimate.amplitude, estimate.phase) == pytest.approx((5.0, 0.7, -2.1), rel=1e-12)


def test_a_neighbour_no_window_resolves_is_owned_up_to() -> None:
    """Two lines a third of 2π/T apart: the frequency between them is off by far more than rounding, and says so."""
    t = np.linspace(0, 120.0, 4000)
    estimate = line(t, np.cos(3 * t) + 0.3 * np.cos(3.02 * t + 1))
    assert 1e-4 < abs(estimate.omega - 3) <= estimate.error


@pytest.mark.parametrize("decay", [1e-4, 1e-3, 1e-2])
def test_a_decay_shifts_nothing(decay: float) -> None:
    t = np.linspace(0, 120.0, 4000)
    estimate = line(t, np.exp(-decay * t) * np.cos(3 * t + 0.4))
    assert abs(estimate.omega - 3) < min(estimate.error, 1e-10)


def test_the_line_near_a_frequency() -> None:
    t = np.linspace(0, 100.0, 3000)
    f = np.cos(7 * t) + 1e-3 * np.cos(2 * t + 1)
    assert line(t, f).omega == pytest.approx(7, rel=1e-13)
    assert line(t, f, near=2.1).omega == pytest.approx(2, rel=1e-11)


def test_a_slowly_changing_frequency_counts_as_attention_says() -> None:
    t = np.linspace(0, 100.0, 4001)
    change = 1e-5 * (t / 100) ** 3
    phase = 5 * t + 1e-5 * t**4 / 4e6
    assert line(t, np.cos(phase)).omega - 5 == pytest.approx(float(attention(len(t)) @ change), rel=1e-4)
    assert attention(501).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("degrees", [1, 45, 135, 170])
def test_the_simple_pendulum_and_the_elliptic_integral(degrees: float) -> None:
    """ω = (π/2) √(g/l) / K(sin²(θ₀/2))."""
    a, g, l = np.radians(degrees), 9.81, 0.7
    exact = np.pi / 2 * np.sqrt(g / l) / ellipk(np.sin(a / 2) ** 2)
    t = np.linspace(0, 12 * 2 * np.pi / exact, 1201)
    solution = solve_ivp(
        lambda t, y: [y[1], -g / l * np.sin(y[0])], (0, t[-1]), [a, 0], "DOP853", t, rtol=3e-14, atol=1e-14
    )
    assert line(t, solution.y[0]).omega == pytest.approx(exact, rel=1e-9)
    assert np.sqrt(g / l) != pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.cos(2 * np.pi * np.linspace(0, 2.5, 500)), "only"),
        (np.ones(500), "no line"),
        (np.full(500, np.nan), "finite"),
        (np.ones(7), "at least"),
    ],
)
def test_what_has_no_line_is_refused(values: np.ndarray, words: str) -> None:
    with pytest.raises(ComputationError, match=words):
        line(np.linspace(0, 1, len(values)), values)


def test_uneven_times_are_refused() -> None:
    t = np.linspace(0, 10, 500) ** 1.01
    with pytest.raises(ComputationError, match="evenly"):
        line(t, np.cos(9 * t))


def test_what_never_settles_is_refused() -> None:
    """A frequency that runs away through the whole spectrum."""
    t = np.linspace(0, 100, 4000)
    with pytest.raises(ComputationError, match="no steady spectral line"):
        line(t, np.cos(2 * t + 0.1 * t**2))


def test_lines_stand_out_of_noise_and_noise_does_not() -> None:
    """A line a hundred times as strong as the spectrum of the noise is one, no peak of that is."""
    t = np.linspace(0.0, 10.0, 2001)
    f = np.cos(40.0 * t) + 6e-4 * np.cos(95.0 * t + 1.0) + 1e-4 * np.random.default_rng(2).normal(size=t.size)
    assert [peak.omega for peak in lines(t, f, 5)] == pytest.approx([40.0, 95.0], rel=1e-3)
