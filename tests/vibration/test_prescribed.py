"""A support's motion as functions of time: derivatives that fit each other, bands, drifts, spectra."""

from __future__ import annotations

from math import pi, tau

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from modal import SceneError
from modal.scene import RandomMotion, RecordMotion, SineMotion, SupportMotion, SweepMotion
from modal.vibration import Record, prescribed_motion
from modal.vibration.prescribed import band, psd_at

TIMES = np.linspace(0.0, 4.0, 81)
WAVE = np.sin(2.1 * TIMES) + 0.3 * np.cos(4.7 * TIMES)


def record(of: str = "acceleration_m_per_s2", values: np.ndarray = WAVE, **more: str) -> RecordMotion:
    return RecordMotion(time_s=tuple(TIMES.tolist()), **{of: tuple(values.tolist())}, **more)


MOTIONS: list[SupportMotion] = [
    SineMotion(amplitude=0.2, frequency_hz=1.3, phase_deg=25.0),
    SweepMotion(amplitude=0.1, from_hz=0.4, to_hz=2.0, duration=3.0),
    SweepMotion(amplitude=0.1, from_hz=3.0, to_hz=1.0, duration=2.0),
    record(),
    record(baseline="velocity"),
    record("velocity_m_per_s"),
    record("displacement_m"),
    RandomMotion(psd=(1.0, 3.0), frequency_hz=(0.5, 4.0), seed=5, duration=10.0),
    RandomMotion(psd=(1.0, 3.0), frequency_hz=(0.5, 4.0), seed=5, duration=10.0, of="displacement"),
]


@pytest.mark.parametrize("motion", MOTIONS)
def test_velocity_and_acceleration_are_the_derivatives(motion: SupportMotion) -> None:
    law = prescribed_motion(motion)
    t = np.concatenate([np.linspace(-0.5, 5.5, 61) + 0.0137, [1.0]])
    h = 1e-4
    for low, high in ((law.displacement, law.velocity), (law.velocity, law.acceleration)):
        slope = (low(t - 2 * h) - 8 * low(t - h) + 8 * low(t + h) - low(t + 2 * h)) / (12 * h)
        assert slope == pytest.approx(high(t), rel=1e-7, abs=1e-7 * np.abs(high(t)).max())
    assert law.acceleration_at(1.0) == pytest.approx(float(law.acceleration([1.0])[0]), rel=1e-12)


def test_a_sweep_reaches_its_frequencies() -> None:
    motion = prescribed_motion(SweepMotion(amplitude=1.0, from_hz=1.0, to_hz=3.0, duration=8.0))
    t = np.linspace(0.0, 8.0, 400_001)
    crossings = t[:-1][np.diff(np.sign(motion.displacement(t))) != 0]
    assert len(crossings[crossings > 0]) == pytest.approx(2 * 2.0 * 8.0, abs=1)
    after = np.linspace(8.0, 9.0, 100_001)
    assert np.sum(np.diff(np.sign(motion.displacement(after))) != 0) == 6


@pytest.mark.parametrize("of", ["displacement_m", "velocity_m_per_s", "acceleration_m_per_s2"])
def test_a_record_is_met_at_its_samples_and_is_smooth_between(of: str) -> None:
    motion = prescribed_motion(record(of))
    read = {"displacement_m": motion.displacement, "velocity_m_per_s": motion.velocity}.get(of, motion.acceleration)
    assert read(TIMES) == pytest.approx(WAVE, abs=1e-12)
    between = TIMES[10:-10] + 0.023
    exact = np.sin(2.1 * between) + 0.3 * np.cos(4.7 * between)
    assert read(between) == pytest.approx(exact, abs=1e-5)


def test_the_band_is_where_a_sine_is_a_percent_off() -> None:
    """Against the acceleration of splines through sampled sines, its mean square error over many periods."""
    for of, derivatives in (("acceleration_m_per_s2", 0), ("displacement_m", 2)):
        limit = band(5, derivatives)
        t = np.arange(400.0)
        for share, low, high in ((1.0, 0.005, 0.015), (0.7, 0.0, 0.005)):
            omega = tau * limit * share
            values = tuple(np.sin(omega * t + 0.3).tolist())
            motion = prescribed_motion(RecordMotion(time_s=tuple(t.tolist()), **{of: values}))
            fine = np.linspace(100, 300, 20_001)
            wanted = np.sin(omega * fine + 0.3) * (-(omega**2) if derivatives else 1.0)
            error = np.sqrt(np.mean((motion.acceleration(fine) - wanted) ** 2) / np.mean(wanted**2))
            assert low <= error <= high


def test_a_drift_is_told_and_taken_out() -> None:
    pushed = WAVE + 0.4
    kept, taken = (prescribed_motion(record(values=pushed, baseline=way)) for way in ("keep", "velocity"))
    assert isinstance(kept, Record)
    assert "moves on at that velocity" in kept.words
    assert "moves on" not in taken.words
    assert "Hz" in taken.words
    assert taken.velocity(4.0) == pytest.approx(0.0, abs=1e-12)
    end = cumulative_simpson(pushed, x=TIMES)[-1]
    assert kept.velocity([4.0, 9.0]) == pytest.approx([end, end], rel=1e-4)
    assert kept.displacement(9.0) - kept.displacement(4.0) == pytest.approx(5 * end, rel=1e-4)
    assert kept.acceleration([-0.1, 4.1]).tolist() == [0.0, 0.0]


def test_a_random_process_has_its_psd() -> None:
    """The periodogram over one duration is the PSD, line by line, whatever the seed; seeds differ, one repeats."""
    motions = [
        RandomMotion(psd=(2.0, 2.0, 0.5), frequency_hz=(1.0, 3.0, 9.0), seed=seed, duration=20.0) for seed in (1, 1, 2)
    ]
    t = np.arange(1000) * 0.02
    rows = [prescribed_motion(motion).acceleration(t) for motion in motions]
    assert np.array_equal(rows[0], rows[1])
    assert np.abs(rows[0] - rows[2]).max() > 0.1
    for row in rows[1:]:
        lines = 2 * np.abs(np.fft.rfft(row)) ** 2 * 0.02 / 1000
        f = np.fft.rfftfreq(1000, 0.02)
        assert lines == pytest.approx(psd_at(np.array([1.0, 3.0, 9.0]), np.array([2.0, 2.0, 0.5]), f), abs=1e-9)


def test_a_psd_is_straight_over_logarithms() -> None:
    f, S = np.array([0.0, 1.0, 10.0, 20.0]), np.array([1.0, 2.0, 2e-4, 0.0])
    assert psd_at(f, S, np.array([0.5, 1.0, 10**0.5, 10.0, 15.0, 20.0, 21.0])) == pytest.approx(
        [1.5, 2.0, 2e-2, 2e-4, 1e-4, 0.0, 0.0]
    )


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: RecordMotion(time_s=(0.0, 1.0, 2.0, 3.0)), "needs a file, or time_s and one of"),
        (lambda: RecordMotion(file="x.csv"), "is read with the scene file"),
        (lambda: RecordMotion(time_s=(0.0, 1.0, 1.0, 3.0), displacement_m=(0.0,) * 4), "strictly ascending"),
        (lambda: RecordMotion(time_s=(0.0, 1.0, 2.0), displacement_m=(0.0,) * 3), "at least 4"),
        (lambda: RecordMotion(time_s=(0.0, 1.0, 2.0, 3.0), displacement_m=(0.0,) * 3), "3 values for 4 times"),
        (lambda: RandomMotion(psd=(1.0, 1.0), seed=0, duration=1.0), "frequency_hz: is required"),
        (lambda: RandomMotion(psd=(1.0, 1.0), frequency_hz=(1.2, 1.8), seed=0, duration=1.0), "no whole period"),
        (lambda: RandomMotion(psd=(1.0, 1.0), frequency_hz=(1.0, 1e4), seed=0, duration=1e3), "at most 20000"),
        (lambda: RandomMotion(psd=(-1.0, 1.0), frequency_hz=(1.0, 2.0), seed=0, duration=9.0), "not be negative"),
        (lambda: SineMotion(amplitude=-1.0, frequency_hz=1.0), "amplitude = -1.0: must not be negative"),
    ],
)
def test_impossible_motions_are_refused(made: object, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        made()  # type: ignore[operator]


def test_a_sine_is_the_formula() -> None:
    motion = prescribed_motion(MOTIONS[0])
    t = np.linspace(-2, 2, 9)
    assert motion.displacement(t) == pytest.approx(0.2 * np.sin(tau * 1.3 * t + 25 * pi / 180), rel=1e-12)
