"""Numbers that share an unknown: against least squares on closed forms, complex steps, and motions of their own."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy

from modal.errors import SceneError
from modal.identification import (
    MeasuredMode,
    MeasuredModes,
    ModeFit,
    estimate_of,
    find_parameters,
    fit_modes,
    mode_stds,
    numbers_at,
    scene_with,
)
from modal.identification.identifiability import ModeDerivatives, matrix_derivatives
from modal.modes import natural_modes
from modal.scene import Bob, Body, Pendulum, Scene, Spring
from modal.scene.unknowns import find_unknowns
from modal.types import Floats
from nonlinear.identification import Recording, Segment, Sensor, fit
from nonlinear.identification.problem import FitProblem

LENGTHS = np.array([0.3, 0.42, 0.55, 0.7, 0.86, 1.05, 1.3, 1.6])
GRAVITY, OFFSET, STD = 9.8123, 0.0147, 2e-4
SHIFT, SAME = "shift:pendulum[*].links[0].length", "same:pendulum[*].links[0].inertia"


def bobs(lengths: Floats = LENGTHS, gravity: float = 9.7) -> Scene:
    return Scene(
        gravity=gravity,
        pendulum=tuple(Pendulum(links=(Bob(mass=1.0 + k, length=l),)) for k, l in enumerate(lengths.tolist())),
    )


def frequencies(gravity: float, offset: float) -> Floats:
    """In Hz, from the longest string on."""
    return np.sqrt(gravity / (LENGTHS[::-1] + offset)) / (2 * np.pi)


@cache
def readings(seed: int = 3) -> Floats:
    return frequencies(GRAVITY, OFFSET) + STD * np.random.default_rng(seed).normal(size=len(LENGTHS))


def modes_of(values: Floats, std: float = STD) -> MeasuredModes:
    return MeasuredModes("m.csv", tuple(MeasuredMode(k, f, std) for k, f in enumerate(values.tolist(), 1)))


@cache
def fitted() -> ModeFit:
    return fit_modes(bobs(), modes_of(readings()), ["gravity", SHIFT])


def test_gravity_from_eight_strings_with_one_unknown_offset() -> None:
    direct = scipy.optimize.least_squares(
        lambda p: (frequencies(*p) - readings()) / STD, [9.7, 0.0], x_scale=[1.0, 0.01], xtol=1e-15, ftol=1e-15
    )
    cov = np.linalg.inv(direct.jac.T @ direct.jac)
    assert fitted().values == pytest.approx(direct.x, rel=1e-6)
    assert fitted().covariance == pytest.approx(cov, rel=1e-4)
    assert np.all(np.abs(fitted().values - [GRAVITY, OFFSET]) < 3 * fitted().stds)
    lengths = [pendulum.links[0].length for pendulum in fitted().scene.pendulum]
    assert lengths == pytest.approx(LENGTHS + direct.x[1], rel=1e-7)


def test_a_report_has_a_shared_unknown_once_and_goes_on_from_it() -> None:
    record = fitted().whole()
    assert [entry["place"] for entry in record["parameters"]] == ["gravity", SHIFT]
    assert fitted().to_dict()["unit"].tolist() == ["m/s²", "m"]
    estimate = estimate_of(fitted().scene, record)
    (slowest,) = mode_stds(natural_modes(fitted().scene), estimate, [0])
    gravity, offset = fitted().values
    length, omega = LENGTHS[-1] + offset, np.sqrt(gravity / (LENGTHS[-1] + offset))
    slope = np.array([omega / gravity, -omega / length]) / 2
    assert slowest.omega == pytest.approx(np.sqrt(slope @ fitted().covariance @ slope), rel=1e-6)
    drawn = estimate.drawn(2000, np.random.default_rng(1))
    assert abs(np.mean(drawn[SHIFT])) < 0.1 * fitted().stds[1]


def test_one_string_leaves_open_what_a_shift_and_gravity_do_together() -> None:
    scene = bobs(np.array([1.0, 1.0]))
    alike = fit_modes(scene, modes_of(np.array([0.5])), ["gravity", SHIFT])
    (direction,) = alike.undetermined
    assert (direction.held, [*direction.changes]) == ("gravity", [SHIFT])
    assert direction.changes[SHIFT] == pytest.approx(1.0, rel=1e-3)
    assert "of the mean of the numbers that it shifts" in direction.words
    assert not alike.combinations


def test_a_prior_of_a_shift_counts_as_a_reading() -> None:
    believed = fit_modes(bobs(), modes_of(readings()), ["gravity", SHIFT], priors=[f"{SHIFT}=-0.01±0.005"])

    def residuals(p: Floats) -> Floats:
        return np.append((frequencies(*p) - readings()) / STD, (p[1] + 0.01) / 0.005)

    direct = scipy.optimize.least_squares(residuals, [9.7, 0.0], x_scale=[1.0, 0.01], xtol=1e-15, ftol=1e-15)
    assert believed.values == pytest.approx(direct.x, rel=1e-6)


def pivots(*inertias: float) -> Scene:
    """Bodies of different masses that hang from pivots of one kind."""
    bodies = [Body(mass=0.2 * (k + 1), length=0.5, centre=0.25, inertia=J) for k, J in enumerate(inertias)]
    return Scene(gravity=9.81, pendulum=tuple(Pendulum(links=(body,)) for body in bodies))


def test_one_inertia_for_all_pivots_and_its_mean_at_the_start() -> None:
    rng = np.random.default_rng(5)
    true, m = 0.0031, 0.2 * np.arange(1, 5)

    def of(J: float) -> Floats:
        return np.sort(np.sqrt(m * 9.81 * 0.25 / (m * 0.25**2 + J))) / (2 * np.pi)

    values = of(true) + 1e-4 * rng.normal(size=4)
    result = fit_modes(pivots(0.002, 0.003, 0.004, 0.005), modes_of(values, 1e-4), [SAME])
    direct = scipy.optimize.least_squares(lambda p: (of(p[0]) - values) / 1e-4, [0.0035], x_scale=1e-3, xtol=1e-15)
    assert result.values == pytest.approx(direct.x, rel=1e-6)
    assert result.stds[0] == pytest.approx(1 / np.linalg.norm(direct.jac), rel=1e-3)
    assert {pendulum.links[0].inertia for pendulum in result.scene.pendulum} == {float(result.values[0])}
    assert any(
        "began at 0.0035, the mean of the scene's numbers from 0.002 to 0.005" in line for line in result.verdict
    )


def test_a_derivative_by_a_shared_unknown_is_that_of_a_complex_step() -> None:
    links = (Bob(mass=1.3, length=0.5), Bob(mass=0.7, length=0.8), Bob(mass=0.4, length=0.3))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=links),))
    (unknown,) = find_unknowns(scene, "shift:pendulum[0].links[*].length")
    derivatives = ModeDerivatives(natural_modes(scene), *matrix_derivatives(scene, [unknown.places], [1.0]))
    lengths, masses = np.array([0.5, 0.8, 0.3]) + 1e-30j, np.array([1.3, 0.7, 0.4])
    below = np.add.accumulate(masses[::-1])[::-1]
    M = np.array([[below[max(i, j)] * lengths[i] * lengths[j] for j in range(3)] for i in range(3)])
    K = np.diag(below * lengths * 9.81)
    for row in range(3):
        u = scipy.linalg.eigh(K.real, M.real)[1][:, row]
        square = (u @ K.real @ u) / (u @ M.real @ u)
        slope = (u @ (K - square * M) @ u).imag / 1e-30 / (u @ M.real @ u)
        rate = derivatives.eigenvalue(row)[0].imag
        assert rate == pytest.approx(slope / (2 * np.sqrt(square)), rel=1e-8)


def swinging(scene: Scene, seed: int) -> Recording:
    """Two pendula seen for 3 s, with noise, by SciPy's integrator: θ'' = −(g/l) sin θ."""
    times, rate = np.arange(0, 3, 0.02), scene.gravity / np.array([link.length for link in scene.links()])
    run = scipy.integrate.solve_ivp(
        lambda _, y: [*y[2:], *(-rate * np.sin(y[:2]))],
        (0, 3),
        [np.radians(20.0), np.radians(15.0), 0.0, 0.0],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    )
    angles = run.y[:2].T + 1e-3 * np.random.default_rng(seed).normal(size=(len(times), 2))
    return Recording((Sensor(1, 1), Sensor(2, 1)), (Segment("made", "0", times, angles),))


def test_motions_are_fitted_by_a_shift() -> None:
    true = bobs(np.array([0.45, 0.95]) + 0.03, 9.81)
    recording = swinging(true, 2)
    result = fit(bobs(np.array([0.45, 0.95]), 9.7), recording, ["gravity", SHIFT])
    assert np.all(np.abs(result.values - [9.81, 0.03]) < 3.5 * result.stds)
    assert [entry["place"] for entry in result.whole()["parameters"]] == ["gravity", SHIFT]


def test_residuals_of_motions_have_the_sum_of_the_derivatives() -> None:
    scene = bobs(np.array([0.45, 0.95]), 9.7)
    recording = swinging(scene, 4)
    apart, together = (
        FitProblem(scene, find_parameters(scene, free), recording, np.ones(2), tolerance=1e-9)
        for free in ([SHIFT.removeprefix("shift:")], [SHIFT])
    )
    states = np.array([np.radians(20.0), np.radians(15.0), 0.0, 0.0])
    u = np.concatenate(([0.0, 0.0], np.zeros(6), states))
    v = np.concatenate(([0.0], np.zeros(6), states))
    slopes = [parameter.slope(0.0) for parameter in (*apart.parameters, *together.parameters)]
    J = apart.jacobian(u)
    assert together.jacobian(v)[:, 0] / slopes[2] == pytest.approx(J[:, 0] / slopes[0] + J[:, 1] / slopes[1], abs=1e-7)


SPRINGS = Scene(
    gravity=9.81,
    pendulum=(
        Pendulum(position=(0.0, 0.0), links=(Bob(mass=1.0, length=1.0),)),
        Pendulum(position=(1.0, 0.0), links=(Bob(mass=1.0, length=1.0),)),
    ),
    spring=(
        Spring(between=["pendulum[0].links[0]", "pendulum[1].links[0]"], stiffness=3.0),
        Spring(kind="torsion", between=["pendulum[0].links[0]", "pendulum[1].links[0]"], stiffness=2.0),
    ),
)


PAGE = (Path(__file__).parents[2] / "docs/reference/values.md").read_text(encoding="utf-8").split("| refusal |")[-1]
ROWS = re.findall(r"^\| `([^`%]*)` \| (.*) \|$", PAGE, re.MULTILINE)


def test_the_manual_has_the_refusals() -> None:
    assert len(ROWS) == 5


@pytest.mark.parametrize(
    ("free", "words"),
    [
        *((text.split(","), words) for text, words in ROWS),
        ([SHIFT, "pendulum[1].links[0].length"], f"pendulum[1].links[0].length: is freed twice, in {SHIFT}"),
        ([SHIFT, SHIFT.replace("shift", "same")], "is freed twice"),
        (["same:pendulum[*].links[0].weight"], "is not a number of this scene"),
        (["shift:pendulum[*].links[0].count"], "is not a number that a fit can change"),
    ],
)
def test_places_that_cannot_share_an_unknown(free: list[str], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        find_parameters(SPRINGS, free)
    assert words in str(caught.value)


def test_a_shift_leaves_every_number_above_0() -> None:
    scene = bobs(np.array([0.4, 0.9]))
    (parameter,) = find_parameters(scene, [SHIFT])
    least = scene_with(scene, numbers_at([parameter], np.array([parameter.z_min])))
    assert [pendulum.links[0].length for pendulum in least.pendulum] == pytest.approx(
        [0.4 * np.exp(-12), 0.5], abs=1e-5
    )
