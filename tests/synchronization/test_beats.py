"""Clocks that beat for ever where averaged equations let one mode win, and joints with dry friction."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

from modal.modes import natural_modes
from modal.scene import Scene, scene_from
from modal.scene.parameters import parse_variations
from nonlinear.averaging import average, predict, relative_equilibria
from nonlinear.averaging.prediction import AVERAGED_RATE_MAX, fastest
from nonlinear.synchronization import (
    Survival,
    SynchronizationStudy,
    branches_text,
    follow_branches,
    study_synchronization,
    sync_record,
)
from nonlinear.synchronization.certificates import certificate_refusal, certified_orbit


def clocks(*angles: float) -> Scene:
    """Two clocks, of which one starts below the angle of its escapement, 2°, or not."""
    numbers = ((0.250137, 0.008013, 0.001757), (0.250379, 0.006071, 0.001332))
    pendula = [
        {
            "links": [
                {
                    "kind": "bob",
                    "mass": 1.59,
                    "length": length,
                    "damping": damping,
                    "drive": {"kind": "escapement", "impulse": impulse, "angle_deg": 2.0},
                }
            ],
            "start": {"angles_deg": [angle]},
        }
        for angle, (length, damping, impulse) in zip(angles, numbers, strict=True)
    ]
    return scene_from({"gravity": 9.81, "support": {"kind": "cart", "mass": 7.4556}, "pendulum": pendula})


def rubbing(**numbers: float) -> Scene:
    """A metronome with dry friction in its joint."""
    drive = {"kind": "van-der-pol", "strength": 0.03, "angle_deg": 5.0}
    link = {"kind": "bob", "mass": 1.0, "length": 0.5, "damping": 0.005, "drive": drive, **numbers}
    return scene_from({"gravity": 9.81, "pendulum": [{"links": [link], "start": {"angles_deg": [6.0]}}]})


@cache
def beat() -> SynchronizationStudy:
    return study_synchronization(clocks(-1.54, -8.81), 160.0, output=6401)


def test_a_clock_below_its_angle_is_a_doubt() -> None:
    """The reach at the start is the smaller angle over that of the escapement, and a beat passes below it."""
    theory = beat().theory
    assert theory
    low = theory.prediction
    assert low.motion.reach <= 1.54 / 2 * (1 + 1e-12)
    assert low.doubts_of_start
    high = predict(clocks(8.0, 8.81))
    assert high.motion.reach > 3
    assert high.certain


def test_the_reach_is_the_least_envelope_of_a_beat() -> None:
    """Two free modes whose sum is small at times, against the sum itself at many times."""
    averaged = average(clocks(8.0, 2.0))
    turns = averaged.link_shapes.T[:, :, None] * np.array([0.03, 0.025])[:, None, None]
    beats = np.exp(1j * np.subtract.outer(averaged.omega, averaged.omega[:1])[:, :1] * np.linspace(0, 20.0, 4001))
    envelope = np.abs(np.einsum("cjt,ct->jt", turns * np.ones(4001), beats)).min(axis=0) / np.deg2rad(2.0)
    z = np.array([0.03, 0.025])[:, None] * beats
    assert averaged.reach(z) == pytest.approx(envelope, rel=1e-12)


def test_agreement_asks_for_the_share() -> None:
    study = beat()
    assert study.theory is not None
    assert study.survival is not None
    assert study.leads
    assert study.theory.prediction.share > 0.99
    assert study.survival.survivor_share < 0.7
    assert study.agrees is False
    assert study.theory.prediction.doubts_of_start


@pytest.mark.parametrize(("share", "is_won", "agrees"), [(0.6, False, True), (0.6, True, False), (0.9, False, False)])
def test_a_beat_is_predicted_where_the_predicted_share_occurs_in_it(share: float, is_won: bool, agrees: bool) -> None:
    """The share of the second mode goes from 30 to 70 %, whichever mode has most at the last moment."""
    survived = survival(6.2, 7.4)
    theory = SimpleNamespace(prediction=SimpleNamespace(motion=SimpleNamespace(dies=False), row=1))
    theory.prediction.share, theory.prediction.is_won = share, is_won
    for phase in (0.0, 3.0):
        others = 0.5 + 0.2 * np.cos(2 * np.pi * (survived.times - survived.times[-1]) / 8.5 + phase)
        beating = replace(survived, energy=np.stack((1 - others, others), axis=1))
        assert replace(beat(), theory=theory, survival=beating).agrees is agrees


def test_a_beat_is_named_with_the_two_lines_of_its_spectrum() -> None:
    study = beat()
    assert study.survival is not None
    places = list(study.survival.beating)
    assert study.survival.row[places].tolist() == [3, 2]
    assert study.survival.late_share[places].sum() == pytest.approx(1.0, abs=1e-3)
    times, angles = study.trajectory.times, study.trajectory.motion.links
    late = times > 60
    spectrum = np.abs(np.fft.rfft(angles[late, 0] * np.hanning(late.sum())))
    lines = 2 * pi * np.fft.rfftfreq(late.sum(), times[1] - times[0])
    peaks = np.flatnonzero((spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:])) + 1
    strongest = sorted(lines[peaks[np.argsort(-spectrum[peaks])[:2]]])
    assert sorted(study.survival.omega[places]) == pytest.approx(strongest, abs=0.05)


def survival(*frequencies: float, drift: float = 0.0) -> Survival:
    """Modes with equal energies at these frequencies, that of the first growing or falling."""
    scene = clocks(1.0, 1.0).conservative
    count = len(frequencies)
    energy = np.ones((400, count))
    energy[:, 0] += drift * np.linspace(0, 8, 400)
    rows = np.arange(1, count + 1)
    return Survival(scene, np.linspace(0, 100, 400), natural_modes(scene), rows, energy, np.array(frequencies))


def test_a_beat_has_frequencies_of_its_own_and_lasts() -> None:
    assert survival(6.2, 7.4).beating
    assert not survival(6.2, 6.2).beating
    assert not survival(2.0, 6.0).beating
    assert not survival(6.2, 7.4, drift=-0.1).beating
    survived = survival(6.2, 7.4)
    assert not replace(survived, energy=survived.energy * [1.0, 0.01]).beating


def test_friction_is_predicted_as_energy_and_the_exact_orbit_say() -> None:
    """The amplitude by the energy of a swing, (e − d) a/2 − e a³/8 γ² = 2 M/πω."""
    scene = rubbing(friction=0.001)
    (equilibrium,) = relative_equilibria(average(scene))
    a, omega = average(scene).largest(equilibrium.z), equilibrium.omega
    fed = (0.03 - 0.005) * a / 2 - 0.03 / np.deg2rad(5.0) ** 2 * a**3 / 8
    assert fed == pytest.approx(2 * 0.001 / (pi * omega), rel=0.02)
    orbit = certified_orbit(scene, equilibrium)
    assert orbit
    assert orbit.amplitude == pytest.approx(a, rel=0.01)
    assert orbit.is_stable
    assert not certificate_refusal(scene)


def test_slow_drives_with_friction_are_slow() -> None:
    """The rate of small swings is that of drive and damper, (e − d)/2ml²; friction has none."""
    averaged = average(rubbing(friction=0.001))
    assert fastest(averaged) == pytest.approx((0.03 - 0.005) / (2 * 0.25) / averaged.omega[0], rel=1e-3)
    assert fastest(averaged) < AVERAGED_RATE_MAX


@pytest.mark.parametrize("force", [{"friction": 0.001}, {"drag": 0.001}, {"quadratic_drag": 0.001}])
def test_a_study_takes_every_force(force: dict[str, float]) -> None:
    study = study_synchronization(rubbing(**force), 3.0)
    assert (study.theory is None) == ("quadratic_drag" in force)
    assert bool(study.silent) == (study.theory is None)
    if study.theory:
        assert None not in study.theory.orbits
        assert not study.theory.certificate_refusal
    assert sync_record(study)["simulation"]["duration_s"] == 3.0


def test_a_swing_that_friction_stops_dies_out() -> None:
    """A drive too weak for the friction at any amplitude; the swing ends after a finite time, not exponentially."""
    scene = rubbing(friction=0.002)
    link = scene.pendulum[0].links[0]
    weak = scene.replace(
        pendulum=(scene.pendulum[0].replace(links=[link.replace(drive=link.drive.replace(strength=0.01))]),)
    )
    assert predict(weak).motion.dies
    assert not relative_equilibria(average(weak))


def test_branches_with_friction_have_exact_values() -> None:
    """The swing dies out where the drive is too weak for the friction: at a fold, where its orbit meets another."""
    variation = parse_variations(["pendulum[0].links[0].drive.strength=0.008:0.02:3"])[0]
    branches = follow_branches(rubbing(friction=0.001), variation)
    assert branches.changes
    for (change, _), exact in zip(branches.changes, branches.special_points, strict=True):
        assert exact
        assert exact.orbit.value == pytest.approx(change.value, rel=1e-3)
        assert f"{exact.orbit.value:.7g}" in branches_text(branches)


def test_the_quiet_part_of_a_beat_is_no_lock_and_the_beat_is_measured() -> None:
    """The others' share rises to 11 % once in every 8.5 s, as sin^8, and the run stops in a quiet part."""
    survived = survival(6.2, 7.4)
    times = np.linspace(0.0, 80.0, len(survived.times) * 4)
    others = 0.001 + 0.11 * np.sin(np.pi * times / 8.5 + 1.7) ** 8
    beats = replace(survived, times=times, energy=np.stack((1 - others, others), axis=1))
    assert others[-1] < 0.01
    assert beats.locking_time() is None
    assert beats.beat is not None
    assert beats.beat.period == pytest.approx(8.5, rel=0.02)
    assert (beats.beat.low, beats.beat.high) == pytest.approx((0.889, 0.999), abs=2e-3)
    rippled = others + 0.01 * np.cos(2 * np.pi * times / 0.3)
    assert (np.diff(np.sign(rippled - 0.06)) > 0).sum() > 1.5 * 80 / 8.5
    rippling = replace(beats, energy=np.stack((1 - rippled, rippled), axis=1)).beat
    assert rippling is not None
    assert rippling.period == pytest.approx(8.5, rel=0.02)
    fades = replace(beats, energy=np.stack((1 - others * np.exp(-times / 8), others * np.exp(-times / 8)), axis=1))
    assert fades.beat is None
    assert fades.is_settled
    assert fades.locking_time() is not None
