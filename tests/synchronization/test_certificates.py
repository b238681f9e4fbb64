"""Stability of configurations and critical values by periodic orbits of the full equations."""

from __future__ import annotations

import json
from functools import cache

import floquet
import numpy as np
import pytest

from modal import load
from modal.scene import scene_from
from modal.scene.parameters import parse_variations, vary
from nonlinear.averaging import average, predict, relative_equilibria
from nonlinear.integration import Trajectory
from nonlinear.orbits import follow_cycles, last_swing
from nonlinear.simulation import resume, simulate
from nonlinear.synchronization import (
    agreement,
    averaged_thresholds,
    branches_text,
    find_survival,
    follow_branches,
    sync_record,
    sync_text,
)
from nonlinear.synchronization.branch_report import branches_json
from nonlinear.synchronization.certificates import certified_orbit, orbit_at_the_end
from nonlinear.synchronization.study import Theory, joined, study_synchronization
from nonlinear.system import State

DETUNED = "pendulum[1].links[0].inertia"


BESIDE = State(np.array([0.1, 0.09]), np.zeros(2))


@cache
def theory(pair: floquet.Pair) -> Theory:
    prediction = predict(pair.scene, BESIDE)
    return Theory(relative_equilibria(prediction.averaged), prediction)


@pytest.mark.parametrize(("angle", "told"), [(9.0, 0.00396)])
def test_the_stability_told_is_that_of_the_multipliers(angle: float, told: float) -> None:
    pair = floquet.metronomes(angle)
    study = study_synchronization(pair.scene, 1.0, start=BESIDE)
    record = next(
        configuration
        for configuration in sync_record(study)["configurations"]
        if configuration["pendula"] == "antiphase"
    )
    assert record["lasts"] is (told < 0)
    assert record["growth_rate_per_s"] == pytest.approx(told, abs=1e-5)
    assert record["averaged_growth_rate_per_s"] == pytest.approx(told, abs=6e-4)
    assert record["averaged_growth_rate_per_s"] != pytest.approx(told, abs=1e-5)
    assert record["orbit"]["residual"] < 1e-10
    assert "(averaged)" not in sync_text(study)


def test_a_stable_orbit_takes_the_place_of_doubts_about_averaging() -> None:
    """Strong drives: averaging doubts itself, the orbit does not; doubts about the way from the start remain."""
    predicted = theory(floquet.metronomes(9.0))
    assert predicted.prediction.ending is not None
    assert predicted.ending is not None
    assert predicted.ending.is_stable
    assert set(predicted.doubts) <= set(predicted.prediction.doubts)
    wide = theory(floquet.metronomes(40.0))
    assert wide.prediction.doubts
    assert wide.ending is not None
    assert len(wide.doubts) < len(wide.prediction.doubts)


def test_an_orbit_far_from_a_configuration_is_no_certificate(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = floquet.metronomes(9.0)
    scene, configuration = pair.scene, theory(pair).configurations[0]
    assert certified_orbit(scene, configuration) is not None
    monkeypatch.setattr("nonlinear.synchronization.certificates.AVERAGED_FREQUENCY_ERROR", 1e-9)
    assert certified_orbit(scene, configuration) is None


def test_critical_values_are_located_on_the_full_equations() -> None:
    scene = floquet.metronomes(10.0, 3.0, 6e-5).scene
    (variation,) = parse_variations([f"{DETUNED}=1e-5:1.01e-5:2"])
    branches = follow_branches(scene, variation)
    branch = next(branch for branch in branches.branches if agreement(branch.states[0]) == "in phase")
    at = next(k for k, (_, number) in enumerate(branches.changes) if branches.branches[number] is branch)
    special = branches.special_points[at]
    assert special is not None
    exact = next(
        fold for branch in follow_cycles(scene, variation) for fold in branch.special if fold.kind == "fold"
    ).orbit.value
    assert exact is not None
    assert special.kind == "fold"
    assert special.orbit.value == pytest.approx(exact, rel=1e-8)
    averaged = branches.changes[at][0].value - 1e-5
    assert averaged != pytest.approx(exact - 1e-5, rel=1e-4)
    assert averaged == pytest.approx(exact - 1e-5, rel=0.2)
    assert f"{exact:.7g}" in branches_text(branches)


def test_what_averages_deny_and_multipliers_confirm_is_said_with_its_border() -> None:
    """Antiphase of metronomes lasts up to 8.549° by own equations, by averaged ones nowhere in this range."""
    variation = "pendulum[*].links[*].drive.angle_deg=8.53:8.6:2"
    branches = follow_branches(floquet.metronomes(8.53).scene, variation)
    number = next(k for k, branch in enumerate(branches.branches) if branch.words == "antiphase")
    branch, ((low, high),) = branches.branches[number], branches.exact[number].intervals
    assert (branch.intervals, low) == ((), 8.53)
    for angle, lasts in ((high - 1e-3, True), (high + 1e-3, False)):
        pair = floquet.metronomes(angle)
        states = relative_equilibria(average(pair.scene))
        antiphase = next(state for state in states if agreement(state) == "antiphase")
        assert (floquet.near(pair, antiphase).growth < 0) is lasts
    words = f"antiphase, from 8.53 to {high:.6g} °: unstable by averaged equations, but its orbit is stable."
    assert words in branches_text(branches)
    (change,) = json.loads(branches_json(branches))["changes"]
    assert change["event"] == "loses stability"
    assert (change["averaged"], change["exact"]) == (None, high)


LOW = State(np.radians([2.0, 7.0]), np.zeros(2))
"""One clock starts below the 3° of its escapement."""


@cache
def clocks(seconds: float) -> Trajectory:
    return simulate(floquet.huygens(3.0, 10.0).scene, seconds, start=LOW)


def test_the_orbit_at_the_end_is_that_in_which_a_long_run_repeats() -> None:
    """Newton's method finds it from a run that is not there yet; the continued run has its period and its angles."""
    assert orbit_at_the_end(clocks(3.0)) is None
    run = clocks(10.0)
    orbit = orbit_at_the_end(run)
    assert orbit is not None
    assert orbit_at_the_end(run, within=1e-9) is None
    late = resume(run, 100.0, output=20001)
    assert orbit.period == pytest.approx(last_swing(late.times, late.motion), rel=1e-4)
    widest = np.abs(late.motion.links[-2000:]).max(axis=0)
    assert widest == pytest.approx(orbit.amplitudes, rel=1e-2)


def test_a_run_may_end_on_one_of_a_family_of_orbits() -> None:
    """Of two pairs of clocks in antiphase each keeps its pace: with the second pair at another phase both go on."""
    drive = {"kind": "escapement", "impulse": 0.00154, "angle_deg": 2.0}
    link = {"kind": "bob", "mass": 1.45, "length": 0.25, "damping": 0.0065, "drive": drive}
    starts = [{"angles_deg": [angle]} for angle in (8.4, -8.0, 3.0, -3.4)]
    support = {"kind": "cart", "mass": 10.3, "damping": 0.11, "stiffness": 0.73}
    pendula = [{"links": [link], "start": start} for start in starts]
    run = simulate(scene_from({"gravity": 9.81, "support": support, "pendulum": pendula}), 150.0)
    orbit = orbit_at_the_end(run)
    assert orbit is not None
    assert orbit.floquet.is_of_family
    assert np.abs(orbit.floquet.others).max() == pytest.approx(1.0, abs=1e-9)
    first = simulate(run.scene, 0.3 * orbit.period, start=orbit.state).final
    links, rates = orbit.state.links.copy(), orbit.state.link_rates.copy()
    links[2:], rates[2:] = first.links[2:], first.link_rates[2:]
    other = State(links, rates)
    end = simulate(run.scene, orbit.period, start=other, tolerance=1e-11).final
    assert end.links == pytest.approx(links, abs=1e-8)
    assert end.link_rates == pytest.approx(rates, abs=1e-7)
    assert abs(end.cart) < 1e-8


def test_an_undecided_run_goes_on_as_long_as_the_slow_flow_took(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonlinear.synchronization.study.usual_duration", lambda *_: 0.5)
    clock = study_synchronization(clocks(0.5).scene, start=LOW)
    assert clock.verdict == "settles"
    assert clock.theory is not None
    assert 4 * 0.5 < clock.trajectory.times[-1] <= clock.theory.prediction.motion.times[-1]
    assert np.all(np.diff(clock.trajectory.times) > 0)


def test_where_the_run_ends_on_its_orbit_a_start_below_the_kicks_is_no_doubt() -> None:
    study = study_synchronization(clocks(10.0).scene, start=LOW)
    assert study.theory is not None
    assert study.theory.doubts
    assert study.agrees
    assert not study.doubts
    record = sync_record(study)
    assert record["prediction"]["certain"]
    assert record["simulation"]["verdict"] == "settles"
    assert record["simulation"]["orbit"]["stable"]
    assert "is not certain" not in sync_text(study)


def test_a_run_that_goes_on_is_that_of_one_call() -> None:
    first = clocks(10.0)
    whole = joined(first, resume(first, 10.0, output=len(first.times)))
    other = simulate(first.scene, 20.0, start=LOW, output=2 * len(first.times) - 1)
    assert whole.times == pytest.approx(other.times)
    assert whole.motion.links == pytest.approx(other.motion.links, abs=1e-6)
    assert whole.motion.work == pytest.approx(other.motion.work, abs=1e-6 * abs(other.motion.work).max())
    assert whole.kicks.time == pytest.approx(other.kicks.time, abs=1e-5)


def test_thresholds_of_averaged_equations_name_who_drains() -> None:
    """The value is that of the branches; a run near the motion beyond it ends in the mode named."""
    (loses,) = averaged_thresholds(load("huygens"), "support.mass=20:30:2")
    assert loses.value == pytest.approx(26.6726, rel=1e-3)
    assert loses.words == "in phase loses stability"
    assert "mode 3" in loses.reason
    beyond = vary(load("huygens"), {"support.mass": 50.0})
    run = simulate(beyond, 500.0, start=State(np.radians([7.0, 4.0]), np.zeros(2)))
    assert find_survival(run).number == 3
