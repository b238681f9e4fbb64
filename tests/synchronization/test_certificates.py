"""Stability of configurations and critical values by periodic orbits of the full equations."""

from __future__ import annotations

from functools import cache

import floquet
import numpy as np
import pytest

from modal.scene.parameters import parse_variations
from nonlinear.averaging import predict, relative_equilibria
from nonlinear.orbits import follow_cycles
from nonlinear.synchronization import agreement, branches_text, follow_branches, sync_record, sync_text
from nonlinear.synchronization.certificates import certified_orbit
from nonlinear.synchronization.study import Theory, study_synchronization
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
