"""Which combinations data determine, and error bars of residuals that are not white."""

from __future__ import annotations

import numpy as np
import pytest

from modal import load
from modal.errors import SceneError
from modal.identification import (
    autocorrelation,
    covariance,
    find_combinations,
    find_determined,
    find_parameters,
    influence,
)
from modal.scene.parameters import vary

MASSES = ["pendulum[0].links[0].mass", "pendulum[0].links[1].mass", "pendulum[0].links[2].mass"]
SCENE = vary(load("chain-unequal"), {"gravity": 9.81})


def test_a_common_factor_is_named_and_one_number_held() -> None:
    """J without the direction (1, 1, 1): only ratios of the three are determined."""
    parameters = find_parameters(SCENE, MASSES)
    rng = np.random.default_rng(1)
    J = rng.normal(0, 100, (50, 3)) @ (np.eye(3) - np.ones((3, 3)) / 3)
    determined = find_determined(J, parameters, np.zeros(3))
    (direction,) = determined.directions
    assert {direction.held, *direction.changes} == set(MASSES)
    assert [*direction.changes.values()] == pytest.approx([1.0, 1.0])
    assert "only ratios of" in direction.words
    assert len(determined.kept) == 2
    combos = find_combinations(determined, parameters, np.zeros(3), np.array([0.01, 0.02, 0.03]))
    held = next(parameter.value for parameter in parameters if parameter.path == direction.held)
    for k, combo in zip(determined.kept, combos, strict=True):
        assert combo.words == f"{parameters[k].path} / {direction.held}"
        assert combo.value == pytest.approx(parameters[k].value / held)
        assert combo.std == pytest.approx([0.01, 0.02, 0.03][k] / held)


def test_two_directions_and_a_number_without_effect() -> None:
    parameters = find_parameters(SCENE, [*MASSES, "gravity", "pendulum[0].links[0].length"])
    rng = np.random.default_rng(2)
    along = np.array([[1.0, -0.5, 0, 0, 0], [0, 0, 0, 0, 1.0]])
    Q = np.linalg.qr(along.T)[0]
    J = rng.normal(0, 1000, (80, 5)) @ (np.eye(5) - Q @ Q.T)
    determined = find_determined(J, parameters, np.zeros(5))
    assert len(determined.kept) == 3
    words = {direction.held: direction for direction in determined.directions}
    assert words["pendulum[0].links[0].length"].changes == {}
    assert "hardly any effect" in words["pendulum[0].links[0].length"].words
    (other,) = (direction for direction in determined.directions if direction.changes)
    (partner,) = other.changes
    assert {other.held, partner} == set(MASSES[:2])
    assert other.changes[partner] in (pytest.approx(-0.5), pytest.approx(-2.0))


def test_noise_that_is_too_large_determines_nothing_and_held_ones_stay() -> None:
    parameters = find_parameters(SCENE, MASSES)
    J = np.diag([100.0, 10.0, 0.1])
    determined = find_determined(J, parameters, np.zeros(3))
    assert determined.held.tolist() == [2]
    assert find_determined(J, parameters, np.zeros(3), held=[0]).held.tolist() == [0, 2]
    assert find_determined(J, parameters, np.zeros(3), vague=np.inf).held.tolist() == []


def test_standard_deviations_hold_for_correlated_noise() -> None:
    """AR(1) residuals: the sandwich has the spread of 4000 estimates; white formulas are off by over 2."""
    rng = np.random.default_rng(5)
    count, phi, turns = 600, 0.8, 4000
    times = np.linspace(0, 12, count)
    J = np.column_stack((np.sin(3 * times), np.cos(3 * times), np.ones(count)))
    noise = np.zeros((count, turns))
    for k in range(1, count):
        noise[k] = phi * noise[k - 1] + rng.normal(0, 1, turns)
    true = (np.linalg.pinv(J) @ noise).std(axis=1)
    column = noise[:, 0]
    rho = autocorrelation([column])
    assert 5 < len(rho) < 60
    stds = np.sqrt(np.diag(covariance(influence(J), [(slice(0, count), float(np.mean(column**2)), rho)])))
    assert stds == pytest.approx(true, rel=0.35)
    white = np.sqrt(np.diag(covariance(influence(J), [(slice(0, count), float(np.mean(column**2)), np.ones(1))])))
    assert np.all(white[2] < true[2] / 2)


def test_white_residuals_have_no_correlation_and_the_usual_covariance() -> None:
    rng = np.random.default_rng(6)
    J = rng.normal(size=(500, 4))
    r = rng.normal(size=500)
    rho = autocorrelation([r[:250], r[250:]])
    assert rho.tolist() == [1.0]
    covariances = covariance(influence(J), [(slice(0, 250), 2.0, rho), (slice(250, 500), 2.0, rho)])
    assert covariances == pytest.approx(2.0 * np.linalg.inv(J.T @ J), rel=1e-10)


@pytest.mark.parametrize(
    ("free", "priors", "words"),
    [
        (["pendulum[0].start.angles_deg[0]"], [], "the start is always fitted"),
        (["pendulum[0].links[0].count"], [], "is not a number that a fit can change"),
        (["support.weight"], [], "is not a number of this scene"),
        (["gravity", "gravity"], [], "is freed twice"),
        (["gravity"], ["pendulum[0].links[0].mass=1±1"], "has a prior but is not free"),
        (["gravity"], ["gravity=9.8"], "must be PLACE=VALUE±STD"),
        (["gravity"], ["gravity=a±b"], "must be numbers"),
        (["gravity"], ["gravity=9.8±0"], "positive standard deviation"),
        (["gravity"], ["gravity=0±1"], "a prior of a positive number is positive"),
    ],
)
def test_places_and_priors_that_cannot_be(free: list[str], priors: list[str], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        find_parameters(SCENE, free, priors)
    assert words in str(caught.value)


def test_none_frees_nothing() -> None:
    assert find_parameters(SCENE, ["none"]) == ()
