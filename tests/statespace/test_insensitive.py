"""Shapers with more zeros and humps against their published tables, and the shortest ones over a range."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from modal import Bob, Cart, ComputationError, Pendulum, Scene, SceneError, load
from modal.statespace import residual_vibration, swings_of
from modal.statespace.insensitive import shaper_over, shortest
from modal.statespace.shapers import DampedSwing, insensitivity, shaper

ZETA_POWERS = np.array([1.0, 0.05, 0.05**2, 0.05**3])
TABLES = {
    "ei2": (
        [
            [0, 0, 0, 0],
            [0.4989, 0.1627, -0.54262, 6.1618],
            [0.99748, 0.18382, -1.5827, 8.1712],
            [1.4992, -0.09297, -0.28338, 1.8571],
        ],
        [
            [0.16054, 0.76699, 2.2656, -1.2275],
            [0.33911, 0.45081, -2.5808, 1.7365],
            [0.34089, -0.61533, -0.68765, 0.42261],
            [0.15997, -0.60246, 1.0028, -0.93145],
        ],
    ),
    "ei3": (
        [
            [0, 0, 0, 0],
            [0.49974, 0.23834, 0.44559, 12.472],
            [0.99849, 0.29808, -2.3646, 23.399],
            [1.4987, 0.10306, -2.0139, 17.032],
            [1.9996, -0.28231, 0.61536, 5.4045],
        ],
        [
            [0.11275, 0.76632, 3.2916, -1.4438],
            [0.23698, 0.61164, -2.5785, 4.8522],
            [0.30008, -0.19062, -2.1456, 0.13744],
            [0.23775, -0.73297, 0.46885, -2.0865],
            [0.11244, -0.45439, 0.96382, -1.46],
        ],
    ),
}
"""Singhose, Seering & Singer's fits for 5 %: times in periods and amplitudes as cubics of the damping ratio."""


@pytest.mark.parametrize("kind", ["ei2", "ei3"])
def test_humps_are_those_of_the_published_fits(kind: str) -> None:
    times, amplitudes = (np.array(table) for table in TABLES[kind])
    made = shaper([DampedSwing(2 * np.pi)], kind)
    assert made.times == pytest.approx(times[:, 0], abs=3e-3)
    assert made.amplitudes == pytest.approx(amplitudes[:, 0], abs=1.5e-3)
    damped = shaper([DampedSwing(2 * np.pi, 0.05)], kind)
    assert damped.times == pytest.approx(times @ ZETA_POWERS, abs=0.015)
    assert damped.amplitudes == pytest.approx(amplitudes @ ZETA_POWERS, abs=0.0085)


@pytest.mark.parametrize(
    ("kind", "width"), [("zvdd", 0.480), ("zvddd", 0.627), ("ei", 0.399), ("ei2", 0.726), ("ei3", 0.964)]
)
def test_published_insensitivities_at_five_percent(kind: str, width: float) -> None:
    low, high = insensitivity(shaper([DampedSwing(1.0)], kind), DampedSwing(1.0), 0.05 * (1 + 1e-6))
    assert high - low == pytest.approx(width, abs=2e-3)


@pytest.mark.parametrize(("zeta", "step"), [(0.0, 0.0), (0.1, 0.0), (0.1, 0.05)])
def test_more_zeros_are_convolutions_and_mzv_is_its_printed_formula(zeta: float, step: float) -> None:
    swing = DampedSwing(2 * np.pi, zeta)
    zv = shaper([swing], "zv", step)
    for kind, power in (("zvdd", zv * zv * zv), ("zvddd", zv * zv * zv * zv)):
        made = shaper([swing], kind, step)
        offsets = np.linspace(0.6, 1.4, 9) * swing.omega
        assert residual_vibration(made, offsets, zeta) == pytest.approx(
            residual_vibration(power, offsets, zeta), abs=1e-12
        )
    made = shaper([swing], "mzv", step)
    assert residual_vibration(made, *swing) < 1e-13
    if not step:
        damped = np.sqrt(1 - zeta**2)
        K = np.exp(-0.75 * zeta * np.pi / damped)
        amplitudes = np.array([1 - 1 / np.sqrt(2), (np.sqrt(2) - 1) * K, (1 - 1 / np.sqrt(2)) * K**2])
        assert made.times == pytest.approx(np.array([0.0, 0.375, 0.75]) / damped, rel=1e-12)
        assert made.amplitudes == pytest.approx(amplitudes / amplitudes.sum(), rel=1e-12)


@pytest.mark.parametrize(("kind", "step"), [("ei2", 0.0), ("ei2", 0.02), ("ei3", 0.0), ("ei3", 0.02)])
def test_no_hump_exceeds_the_tolerance(kind: str, step: float) -> None:
    made = shaper([DampedSwing(3.0, 0.08)], kind, step, 0.03)
    low, high = insensitivity(made, DampedSwing(3.0, 0.08), 0.03 * (1 + 1e-6))
    left = residual_vibration(made, np.linspace(low, high, 4001), 0.08)
    assert 0.03 * (1 - 1e-4) < left[1:-1].max() < 0.03 * (1 + 1e-5)
    narrow = insensitivity(
        shaper([DampedSwing(3.0, 0.08)], "ei", step, 0.03), DampedSwing(3.0, 0.08), 0.03 * (1 + 1e-6)
    )
    assert low < narrow[0] < narrow[1] < high


def test_humps_that_damping_takes_away_are_told() -> None:
    with pytest.raises(ComputationError, match="has no EI shaper with so many humps"):
        shaper([DampedSwing(1.0, 0.2)], "ei3")


def test_over_its_own_range_an_extra_insensitive_shaper_is_the_shortest() -> None:
    made = shaper([DampedSwing(1.0)], "ei")
    low, high = insensitivity(made, DampedSwing(1.0), 0.05 * (1 + 1e-9))
    short = shortest([DampedSwing(omega) for omega in np.linspace(low, high, 101).tolist()], 0.05)
    assert short.duration == pytest.approx(made.duration, rel=2e-5)
    assert residual_vibration(short, np.linspace(low, high, 3001)).max() < 0.05 * (1 + 1e-4)


def test_no_three_impulses_are_shorter() -> None:
    """Every train of three on a grid of places and shares is tried: none within the tolerance is shorter."""
    omega = np.linspace(0.93, 1.07, 29)
    short = shortest([DampedSwing(value) for value in omega.tolist()], 0.1)
    least = np.inf
    for last in np.linspace(0.9, 1.02, 13) * short.duration:
        for at, first, third in product(
            np.linspace(0.4, 0.6, 11), np.linspace(0.2, 0.4, 41), np.linspace(0.2, 0.4, 41)
        ):
            left = first + (1 - first - third) * np.exp(1j * omega * at * last) + third * np.exp(1j * omega * last)
            if abs(left[0]) <= 0.1 and np.abs(left).max() <= 0.1:
                least = min(least, last)
                break
    assert least == pytest.approx(short.duration, rel=0.03)
    assert least >= short.duration * (1 - 1e-6)


def test_no_length_of_the_range_leaves_more_than_asked() -> None:
    """One bob: ω = √(g/l) by hand, at lengths that the design has not seen; damped, with a second mode, and sampled."""
    scene = Scene(gravity=9.81, support=Cart(mass=9.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=10.0)])])
    made, most = shaper_over(scene, "pendulum[0].links[0].length=8:14", samples=33)
    left = residual_vibration(made, np.sqrt(9.81 / np.linspace(8, 14, 1001)))
    assert left.max() <= 0.05 * (1 + 2e-5)
    assert most == pytest.approx(0.05, rel=1e-4)
    crane = load("crane-hook")
    for changes, count in (({"step": 0.05}, 1), ({}, 2)):
        made, _ = shaper_over(crane, "pendulum[0].links[0].length=11:13", count, samples=17, **changes)
        for length in (11.0, 11.37, 12.61, 13.0):
            links = (crane.pendulum[0].links[0].replace(length=length), crane.pendulum[0].links[1])
            swings = swings_of(crane.replace(pendulum=[crane.pendulum[0].replace(links=links)]))[:count]
            assert max(float(residual_vibration(made, *swing)) for swing in swings) <= 0.05 * (1 + 1e-4)
        assert (made.amplitudes > 0).all()
        assert made.amplitudes.sum() == pytest.approx(1.0, rel=1e-14)


def test_a_damped_range_has_a_shorter_shaper_than_two_periods() -> None:
    swings = [DampedSwing(omega, 0.08) for omega in np.linspace(0.8, 1.2, 41).tolist()]
    made = shortest(swings, 0.05)
    left = residual_vibration(made, np.linspace(0.8, 1.2, 1001), 0.08)
    assert 0.05 * (1 - 1e-4) < left.max() < 0.05 * (1 + 5e-4)
    assert made.duration < 2 * np.pi * 1.05


@pytest.mark.parametrize(
    "span", ["pendulum[0].links[0].length", "gravity=1", "gravity=1:2:3", "nothing=1:2", "gravity=2:1"]
)
def test_other_spans_are_refused(span: str) -> None:
    with pytest.raises(SceneError):
        shaper_over(load("crane-hook"), span)


def test_what_does_not_oscillate_and_what_is_too_much_is_refused() -> None:
    with pytest.raises(ComputationError, match="does not oscillate at all points"):
        shortest([DampedSwing(1.0), DampedSwing(1.0, 1.0)], 0.05)
    with pytest.raises(ComputationError, match="leaves so little over all"):
        shortest([DampedSwing(omega) for omega in np.geomspace(1e-3, 1, 40).tolist()], 1e-9)
