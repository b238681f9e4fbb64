"""The covariance of fitted numbers: read, checked, drawn from, and carried on to modes, responses and shapers."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal import Cart, load
from modal.errors import SceneError
from modal.identification import Estimate, estimate_of, magnitude_std, mode_stds, read_estimate, shaped_modes
from modal.identification.estimate import response_slopes
from modal.modes import natural_modes
from modal.scene import Scene
from modal.scene.parameters import find_places, number_at, vary
from modal.statespace import frequency_response, residual_vibration, shaper_for, state_space, swings_of, to_modal_form
from nonlinear.sweeps import find_spread

PLACES = ("pendulum[0].links[0].length", "pendulum[0].links[1].mass", "pendulum[0].links[0].damping")
CORRELATIONS = np.array([[1.0, 0.6, -0.2], [0.6, 1.0, 0.1], [-0.2, 0.1, 1.0]])


@cache
def scene() -> Scene:
    return vary(load("crane-hook"), {PLACES[2]: 900.0})


def record(part: float = 0.003) -> dict[str, Any]:
    values = np.array([number_at(scene(), find_places(scene(), path)[0]) for path in PLACES])
    covariance = np.outer(part * values, part * values) * CORRELATIONS
    parameters = [
        {"place": path, "value": float(value), "std": float(part * value)}
        for path, value in zip(PLACES, values, strict=True)
    ]
    return {"parameters": parameters, "covariance": covariance.tolist()}


def estimate(part: float = 0.003) -> Estimate:
    return estimate_of(scene(), record(part))


def test_members_have_the_covariance_they_are_drawn_by() -> None:
    drawn = estimate().drawn(40_000, np.random.default_rng(3))
    covariance = np.cov(np.array([drawn[path] for path in PLACES]))
    wanted = np.array(record()["covariance"])
    size = np.sqrt(np.diag(wanted))
    assert np.abs((covariance - wanted) / np.outer(size, size)).max() < 0.03


def test_a_singular_covariance_draws_on_its_line() -> None:
    singular = record()
    stds = [parameter["std"] for parameter in singular["parameters"]]
    singular["covariance"] = np.outer(stds, stds).tolist()
    drawn = estimate_of(scene(), singular).drawn(50, np.random.default_rng(0))
    steps = [
        (drawn[parameter["place"]] - parameter["value"]) / parameter["std"] for parameter in singular["parameters"]
    ]
    assert np.allclose(steps[0], steps[1], atol=1e-6)
    assert np.std(steps[0]) > 0.5


def test_standard_deviations_of_modes_are_those_of_monte_carlo() -> None:
    modes, estimated = natural_modes(scene()), estimate()
    rows = [row for row in range(len(modes)) if modes.eigenvalue[row].imag > 0]
    members = usually(400, 600)
    drawn = estimated.drawn(members, np.random.default_rng(1))
    eigenvalues = np.empty((members, len(rows)), dtype=complex)
    for k in range(members):
        values = natural_modes(vary(scene(), {path: drawn[path][k] for path in PLACES})).eigenvalue
        eigenvalues[k] = values[values.imag > 0]
    stds = mode_stds(modes, estimated, rows)
    assert np.allclose([std.omega for std in stds], np.abs(eigenvalues).std(axis=0), rtol=0.1)
    assert np.allclose([std.zeta for std in stds], (-eigenvalues.real / np.abs(eigenvalues)).std(axis=0), rtol=0.1)
    assert stds[0].frequency == pytest.approx(stds[0].omega / (2 * np.pi))


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        (("cart_force",), ("cart_position", "angles", "pivot_forces")),
        (("cart_acceleration", "joint_torques"), ("tip_positions", "pivot_forces", "relative_rates")),
        (("cart_velocity",), ("cart_velocity", "rates")),
        (("link_forces",), ("joint_positions", "pivot_forces")),
        (("support_acceleration",), ("angles", "tip_accelerations")),
    ],
)
def test_responses_have_the_derivatives_of_their_differences(inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    omega = np.array([0.4, 1.7, 6.0])
    shaken = "support_acceleration" in inputs  # without effect on a cart without a spring
    plant = scene().replace(support=Cart(mass=1000.0, stiffness=900.0)) if shaken else scene()

    def response(scene: Scene) -> np.ndarray:
        return frequency_response(to_modal_form(natural_modes(scene), state_space(scene, inputs, outputs)), omega)

    estimated = replace(estimate(), scene=plant)
    G, slopes = response_slopes(state_space(plant, inputs, outputs), estimated, omega)
    assert np.allclose(G, response(plant), rtol=1e-9, atol=1e-13 * np.abs(G).max())
    for k, path in enumerate(PLACES):
        h = 1e-4 * estimated.values[k]
        steps = [response(vary(plant, {path: estimated.values[k] + n * h})) for n in (-2, -1, 1, 2)]
        expected = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * h)
        assert np.abs(slopes[..., k] - expected).max() < 1e-7 * np.abs(expected).max() + 1e-16


def test_standard_deviations_of_magnitudes_are_those_of_monte_carlo() -> None:
    omega, estimated = np.array([0.5, 3.0]), estimate()
    members = usually(100, 250)
    drawn = estimated.drawn(members, np.random.default_rng(2))
    magnitudes = []
    for k in range(members):
        member = vary(scene(), {path: drawn[path][k] for path in PLACES})
        magnitudes.append(np.abs(frequency_response(to_modal_form(natural_modes(member), state_space(member)), omega)))
    std = magnitude_std(state_space(scene()), estimated, omega)
    assert np.allclose(std, np.std(magnitudes, axis=0), rtol=0.16)


def test_a_shaped_command_retains_what_monte_carlo_says() -> None:
    estimated = estimate(0.01)
    shaper = shaper_for(scene(), kind="zvd")
    left = shaped_modes(shaper, estimated, "cart_acceleration", 1)[0]
    members = 250
    drawn = estimated.drawn(members, np.random.default_rng(4))
    retained = []
    for k in range(members):
        swing = swings_of(vary(scene(), {path: drawn[path][k] for path in PLACES}))[0]
        retained.append(float(residual_vibration(shaper, *swing)))
    assert left.rms == pytest.approx(np.sqrt(np.mean(np.square(retained))), rel=0.2)
    assert left.worst > left.rms
    assert "residual vibration" in left.words(1)


def test_numbers_that_split_a_shared_frequency_leave_no_standard_deviation() -> None:
    scene = load("chain-2")
    pair = scene.replace(pendulum=(scene.pendulum[0], scene.pendulum[0]))
    value = scene.pendulum[0].links[0].length
    numbers = {"parameters": [{"place": "pendulum[1].links[0].length", "value": value}], "covariance": [[1e-6]]}
    assert np.isnan(mode_stds(natural_modes(pair), estimate_of(pair, numbers), [0])[0].omega)


def test_members_of_a_spread_are_drawn_from_the_joint_distribution() -> None:
    estimated = estimate()
    spread = find_spread(scene(), (), members=usually(300, 800), covariance=estimated)
    assert set(spread.values) == set(PLACES)
    assert np.corrcoef(spread.values[PLACES[0]], spread.values[PLACES[1]])[0, 1] == pytest.approx(0.6, abs=0.08)
    modes = natural_modes(scene())
    std = mode_stds(modes, estimated, [len(modes) - 1])[0]
    last = spread.frequencies[-1]
    assert last["omega_rad_per_s"] == pytest.approx(modes.omega[-1])
    assert last["standard_deviation_rad_per_s"] == pytest.approx(std.omega, rel=0.1)
    with pytest.raises(SceneError, match="has a tolerance and is among the fitted numbers"):
        find_spread(scene(), [f"{PLACES[0]}=1%"], members=5, covariance=estimated)


def spoiled(**changes: Any) -> dict[str, Any]:
    return record() | changes


def place(k: int, **changes: Any) -> dict[str, Any]:
    changed = record()
    changed["parameters"][k] |= changes
    return changed


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([], "must be the report of a fit"),
        ({"parameters": []}, "must be the report of a fit"),
        ({"parameters": [], "covariance": []}, "has no fitted numbers"),
        (spoiled(covariance=[[1.0]]), "must be 3 rows of 3 finite numbers"),
        (spoiled(covariance=[[1.0, None, 0], [0, 1, 0], [0, 0, 1]]), "must be 3 rows of 3 finite numbers"),
        (spoiled(covariance=[[1, 0.5, 0], [0.1, 1, 0], [0, 0, 1]]), "must be symmetric"),
        (spoiled(covariance=[[-1, 0, 0], [0, 1, 0], [0, 0, 1]]), "a variance must not be negative"),
        (spoiled(covariance=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "must be positive semidefinite"),
        (place(0, place="pendulum[0].links[7].length"), "is not a number of this scene"),
        (place(0, place="pendulum[0].links[*].length"), "means several numbers"),
        (place(0, value=11.0), "pendulum[0].links[0].length = 11: the scene has 12"),
        (place(0, value=True), "must have a"),
        (place(1, place="pendulum[0].links[0].length", value=12.0), "appears twice"),
    ],
)
def test_every_mistake_is_named(entries: Any, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        estimate_of(scene(), entries)
    assert words in str(caught.value)


def test_a_file_that_is_none_is_told_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "b.json").write_text(json.dumps(spoiled(covariance=[])))
    for name, words in (("a.json", "is not JSON"), ("b.json", "must be 3 rows"), ("c.json", "No such file")):
        with pytest.raises(SceneError, match=words) as caught:
            read_estimate(scene(), tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name))


def test_what_is_no_polynomial_in_its_numbers_is_refused() -> None:
    plain = scene()
    ratios = estimate_of(plain.replace(damping_ratio=0.01), record())
    with pytest.raises(SceneError, match="damping_ratio"):
        mode_stds(natural_modes(ratios.scene), ratios, [1])
