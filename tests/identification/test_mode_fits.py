"""Fits to measured modes: exact ones come back, noise lies within its error bars, what is not determined is named."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from amounts import usually

from modal import load
from modal.errors import ComputationError, SceneError
from modal.identification import MeasuredMode, MeasuredModes, estimate_of, fit_modes, has_modes, read_modes
from modal.identification.measured import component_rows, turned
from modal.identification.mode_fitting import _ModeFitProblem
from modal.identification.parameters import find_parameters, starts_of
from modal.modes import natural_modes
from modal.scene import Bob, Pendulum, Scene
from modal.scene.parameters import vary

COMPONENTS = ((0, 0), (1, 1), (1, 2))
LENGTHS = "pendulum[0].links[*].length"
TRUE = {
    "pendulum[0].links[0].length": 11.5,
    "pendulum[0].links[1].length": 2.7,
    "pendulum[0].links[1].mass": 450.0,
    "pendulum[0].links[0].damping": 2000.0,
}


@cache
def damped_crane() -> Scene:
    return vary(load("crane-hook"), {"pendulum[0].links[0].damping": 1000.0})


def measured(scene: Scene, std: float = 1e-5, *, shapes: bool = True, shape_std: float | None = 1e-4) -> MeasuredModes:
    modes = natural_modes(scene)
    rows, measured_modes = component_rows(scene, COMPONENTS), []
    for row in np.flatnonzero(modes.eigenvalue.imag > 0).tolist():
        shape = turned(modes.matrix.shapes[rows, row].astype(complex)).real * -3.7
        mode = modes[row]
        columns = (shape, shape_std) if shapes else (None, None)
        measured_modes.append(
            MeasuredMode(mode.number, mode.omega / (2 * np.pi), std, mode.damping_ratio, std, *columns)
        )
    return MeasuredModes("modes.csv", tuple(measured_modes), COMPONENTS)


def test_exact_modes_give_the_numbers_back() -> None:
    for shape_std in usually((None,), (1e-4, None)):
        fitted = fit_modes(damped_crane(), measured(vary(damped_crane(), TRUE), shape_std=shape_std), list(TRUE))
        assert np.allclose(fitted.values, list(TRUE.values()), rtol=1e-9)
        assert fitted.chi_square < 1e-6
        assert not len(fitted.held)
        assert fitted.freedom == 4
        assert all(mode.mac == pytest.approx(1, abs=1e-12) for mode in fitted.modes)


LINKS = ["pendulum[0].links[0].length", "pendulum[0].links[1].length"]


def two_bobs(*lengths: float) -> Scene:
    links = tuple(Bob(mass=1.0, length=length) for length in lengths)
    return Scene(gravity=9.81, pendulum=(Pendulum(links=links),))


def frequencies(length: float, other: float) -> np.ndarray:
    """In Hz, of two equal bobs: l l' ω⁴ − 2 g (l + l') ω² + 2 g² = 0."""
    g = 9.81
    return np.sqrt(np.sort(np.roots([length * other, -2 * g * (length + other), 2 * g * g]).real)) / (2 * np.pi)


def of_frequencies(lengths: tuple[float, float], std: float) -> MeasuredModes:
    values = frequencies(*lengths)
    return MeasuredModes("m.csv", tuple(MeasuredMode(k, f, std * f) for k, f in enumerate(values.tolist(), 1)))


@pytest.mark.parametrize("start", [(0.63, 0.52), (0.6, 0.6)])
def test_lengths_that_change_places_are_a_second_solution(start: tuple[float, float]) -> None:
    """From equal lengths too, where both have the same derivatives and neither seems determined."""
    fitted = fit_modes(two_bobs(*start), of_frequencies((0.55, 0.6), 1e-4), LINKS)
    assert not len(fitted.held)
    (other,) = fitted.others
    solutions = sorted([fitted, other], key=lambda solution: float(solution.values[0]))
    assert np.allclose([solution.values for solution in solutions], [(0.55, 0.6), (0.6, 0.55)], rtol=1e-6)
    assert np.allclose(fitted.stds, other.stds[::-1], rtol=1e-3)
    assert any("another solution fits as well" in words for words in fitted.verdict)
    (record,) = fitted.whole()["other_solutions"]
    assert [parameter["value"] for parameter in record["parameters"]] == other.values.tolist()


def test_a_shape_tells_which_length_is_which() -> None:
    truth, start = two_bobs(0.55, 0.6), two_bobs(0.63, 0.52)
    shape = natural_modes(truth).matrix.shapes[:, 0].real
    measurement = of_frequencies((0.55, 0.6), 1e-4)
    modes = (replace(measurement.modes[0], shape=shape, shape_std=1e-3), measurement.modes[1])
    fitted = fit_modes(start, replace(measurement, modes=modes, components=((1, 1), (1, 2))), LINKS)
    assert np.allclose(fitted.values, (0.55, 0.6), rtol=1e-6)
    assert not fitted.others


def test_the_interval_of_equal_lengths_is_that_of_chi_square() -> None:
    """Where derivatives do not distinguish the two: by the chi-square of the closed form on a grid."""
    std, span = 1e-3, np.linspace(-0.08, 0.08, 81)
    exact = frequencies(0.5, 0.5)
    square = [[np.sum(((frequencies(0.5 + a, 0.5 + b) / exact - 1) / std) ** 2) for b in span] for a in span]
    within = np.min(square, axis=1) < 3.84
    fitted = fit_modes(two_bobs(0.52, 0.47), of_frequencies((0.5, 0.5), std), LINKS)
    assert np.allclose(fitted.values, 0.5, rtol=1e-3)
    assert 1.96 * fitted.stds == pytest.approx(np.full(2, np.abs(span[within]).max()), rel=0.15)


def test_derivatives_are_those_of_the_residuals() -> None:
    problem = _ModeFitProblem(
        damped_crane(), find_parameters(damped_crane(), list(TRUE)), measured(vary(damped_crane(), TRUE))
    )
    z = starts_of(problem.parameters) + np.array([0.01, -0.02, 0.03, 1e-4])
    h = 1e-5
    steps = [[problem.residuals(z + n * h * unit) for unit in np.eye(4)] for n in (-2, -1, 1, 2)]
    expected = (np.array(steps[0]) - 8 * np.array(steps[1]) + 8 * np.array(steps[2]) - np.array(steps[3])).T / (12 * h)
    jacobian = problem.jacobian(z)
    assert np.abs(jacobian - expected).max(axis=0) == pytest.approx(np.zeros(4), abs=1e-7 * np.abs(jacobian).max())


def test_standard_deviations_are_those_of_noise_drawn_anew() -> None:
    truth, rng = measured(vary(damped_crane(), TRUE), 1e-4, shape_std=1e-3), np.random.default_rng(5)
    pulls, squares = [], []
    for _ in range(9):
        noisy = []
        for mode in truth.modes:
            assert mode.shape is not None
            assert mode.damping_ratio is not None
            shape = mode.shape + 1e-3 * np.abs(mode.shape).max() * rng.standard_normal(3)
            frequency = mode.frequency + mode.std * rng.standard_normal()
            ratio = mode.damping_ratio + mode.std * rng.standard_normal()
            noisy.append(replace(mode, frequency=frequency, damping_ratio=ratio, shape=shape))
        fitted = fit_modes(damped_crane(), replace(truth, modes=tuple(noisy)), list(TRUE))
        pulls.append((fitted.values - list(TRUE.values())) / fitted.stds)
        squares.append(fitted.chi_square)
    assert np.all(np.abs(np.std(pulls, axis=0) - 1) < 0.4)
    assert np.mean(np.abs(pulls) < 1.96) > 0.88
    assert np.mean(squares) == pytest.approx(fitted.freedom, rel=0.3)


def test_a_single_bob_determines_its_length_over_gravity_but_not_its_mass() -> None:
    scene = load("chain-1")
    modes = natural_modes(vary(scene, {"pendulum[0].links[0].length": 1.3}))
    measurement = MeasuredModes("m.csv", (MeasuredMode(1, float(modes.omega[0]) / (2 * np.pi), 1e-5),))
    fitted = fit_modes(scene, measurement, ["pendulum[0].links[0].mass", "pendulum[0].links[0].length", "gravity"])
    held = {fitted.parameters[k].path for k in fitted.held}
    assert "pendulum[0].links[0].mass" in held
    assert len(held) == 2
    assert np.sqrt(fitted.scene.gravity / fitted.scene.pendulum[0].links[0].length) == pytest.approx(
        modes.omega[0], rel=1e-9
    )
    report = fitted.whole()
    words = " ".join(direction["words"] for direction in report["unidentifiable"])
    assert "effect on these data" in words
    assert "only ratios" in words
    assert report["segments"] == []
    assert len(report["combinations"]) == 1
    assert "Not determined" in fitted.report()
    assert estimate_of(fitted.scene, report).stds[0] > 0


def test_a_relative_standard_deviation_of_frequency_is_half_that_of_length() -> None:
    """ω² = g/l: dl/l = −2 dω/ω."""
    scene = load("chain-1")
    frequency = float(natural_modes(scene).omega[0]) / (2 * np.pi)
    measurement = MeasuredModes("m.csv", (MeasuredMode(1, frequency, 1e-3 * frequency),))
    fitted = fit_modes(scene, measurement, ["pendulum[0].links[0].length"])
    assert fitted.stds[0] / fitted.values[0] == pytest.approx(2e-3, rel=1e-9)
    known = fit_modes(scene, measurement, ["gravity"], priors=["gravity=9.81±0.01"])
    assert known.stds[0] == pytest.approx(1 / np.hypot(1 / 0.01, 1 / (2e-3 * 9.81)), rel=1e-6)


def test_what_the_model_lacks_is_said_by_chi_square() -> None:
    truth = measured(vary(damped_crane(), TRUE | {"gravity": 9.0}), 1e-6)
    fitted = fit_modes(damped_crane(), truth, ["pendulum[0].links[0].length"])
    assert any("too small or the model lacks" in words for words in fitted.verdict)
    judged = fit_modes(damped_crane(), truth, ["none"])
    assert judged.chi_square > fitted.chi_square > 100
    assert judged.covariance.shape == (0, 0)


def test_a_frequency_that_a_number_splits_is_refused() -> None:
    pendulum = load("chain-2").pendulum[0]
    scene = load("chain-2").replace(pendulum=(pendulum, pendulum))
    measurement = MeasuredModes("m.csv", (MeasuredMode(1, 0.4, 1e-3),))
    with pytest.raises(ComputationError, match=r"mode 1 shares its frequency .*links\[0\].length splits it"):
        fit_modes(scene, measurement, ["pendulum[0].links[0].length"])


HEADER = "mode,frequency_hz,std_hz,damping_ratio,damping_ratio_std,cart,theta_1_1,theta_1_2,remark\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "modes.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, f"# by hand\n{HEADER}2,0.16,1e-3,0.01,,1,2,,a\n3,1.06,2e-3,,,,,,b\n")
    assert has_modes(path)
    measurement = read_modes(damped_crane(), path)
    assert [mode.number for mode in measurement.modes] == [2, 3]
    assert measurement.components == COMPONENTS
    assert measurement.labels == ["cart", "theta_1_1", "theta_1_2"]
    assert measurement.unused == ("remark",)
    first, second = measurement.modes
    assert first.shape is not None
    assert np.array_equal(first.shape, [1, 2, np.nan], equal_nan=True)
    assert (second.shape, second.damping_ratio) == (None, None)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no column mode"),
        ("mode,frequency,std_hz\n1,2,3\n", "has no column frequency_hz (did you mean frequency?)"),
        ("mode,frequency_hz,std_hz\n", "has no modes"),
        ("mode,frequency_hz,std_hz\n1,2\n", "line 2: must have 3 cells"),
        ("mode,frequency_hz,std_hz\n0,2,0.1\n", "mode = 0: must be a whole number from 1"),
        ("mode,frequency_hz,std_hz\n1,x,0.1\n", "frequency_hz = x: must be a number above 0"),
        ("mode,frequency_hz,std_hz\n1,2,0\n", "std_hz = 0: must be a number above 0"),
        ("mode,frequency_hz,std_hz\n1,2,\n", "std_hz: is missing"),
        ("mode,frequency_hz,std_hz\n1,2,1\n1,3,1\n", "mode 1: appears twice"),
        ("mode,frequency_hz,std_hz,theta_2_1\n1,2,1,1\n", "column theta_2_1: the scene has 1 pendulum"),
        ("mode,frequency_hz,std_hz,theta_1_9\n1,2,1,1\n", "column theta_1_9: the pendulum has 2 links"),
        ("mode,frequency_hz,std_hz,theta_1\n1,2,1,1\n", "column theta_1: must be one of"),
        ("mode,frequency_hz,std_hz,damping_ratio_std\n1,2,1,1\n", "needs damping_ratio"),
        ("mode,frequency_hz,std_hz,damping_ratio\n1,2,1,1.5\n", "must be below 1"),
        ("mode,frequency_hz,std_hz,theta_1_1,theta_1_2\n1,2,1,0,0\n", "its shape is zero"),
    ],
)
def test_every_mistake_in_a_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        read_modes(damped_crane(), written(tmp_path, text))
    assert words in str(caught.value)


@pytest.mark.parametrize(("number", "words"), [(9, "the scene has modes 1 to 3"), (1, "does not oscillate")])
def test_modes_that_the_scene_has_not_are_named(number: int, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        fit_modes(damped_crane(), MeasuredModes("m.csv", (MeasuredMode(number, 1.0, 0.1),)), ["gravity"])
