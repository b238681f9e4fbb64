"""Modes measured in the full motion against the table, and motions taken apart into modes."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from math import degrees, inf, pi, radians

import numpy as np
import pytest
from scipy.special import ellipk

from modal import Bob, Body, Cart, ComputationError, Pendulum, Rod, Scene, load, matrices, natural_modes
from modal.plotting import save
from modal.report import digits
from nonlinear.plotting import check_figure, spectrum_figure
from nonlinear.reduction import modal_motion, rest_angles, start_in_mode
from nonlinear.simulation import simulate
from nonlinear.system import Motion, state_at_rest
from nonlinear.verification import AMPLITUDES_DEG, Check, check, check_table, compare, comparison_table
from nonlinear.verification.modes import Measurement, limit, measure_mode, one_percent, sample_times

PAPER = load("paper-cart-2")
KAPPA = {1: -0.038802, 2: -0.042729, 3: -0.857142, 4: -0.867200}
"""REFERENCES: paper 000's cart with two pendula, largest angle 1 rad, by index from 0."""
SIMPLE = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=2.0, length=0.7),)),))
DAMPED = Scene(
    gravity=9.81,
    support=Cart(mass=3.0, damping=0.4),
    pendulum=(Pendulum(links=(Rod(mass=1.0, length=0.8, damping=0.01), Bob(mass=0.5, length=0.3))),),
)


@pytest.fixture(scope="module")
def paper() -> Check:
    return check(PAPER, [0, 1, 4], (2.0, 4.0, 7.0), periods=20)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_tiny_swings_have_the_frequencies_of_the_table(number: int) -> None:
    modes = natural_modes(PAPER)
    measurement = measure_mode(modes, number, 1e-5, 20, "DOP853")
    assert abs(measurement.omega / modes.omega[number] - 1) < 1e-8
    assert measurement.outside < 1e-12


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_slope_is_the_published_kappa(number: int) -> None:
    modes, a = natural_modes(PAPER), radians(2.0)
    measurement = measure_mode(modes, number, a, 20)
    slope = measurement.shift / a**2
    assert slope == pytest.approx(KAPPA[number], rel=0.01)
    assert slope != pytest.approx(1.02 * KAPPA[number], rel=0.01)
    assert modes[number].kappa == pytest.approx(KAPPA[number], rel=1e-4)


def test_kappa_and_one_percent_are_extrapolated(paper: Check) -> None:
    assert paper.skipped == ((1, "a rigid translation does not oscillate"),)
    for row in paper.rows:
        kappa, error = row.kappa
        assert abs(kappa - row.mode.kappa) <= error < 1e-3 * abs(kappa)
        wrong = replace(row, mode=replace(row.mode, kappa=1.01 * row.mode.kappa))
        assert abs(kappa - wrong.mode.kappa) > error
        assert row.one_percent_deg == pytest.approx(row.mode.linear_to_1_percent_deg, rel=0.05)
        again = measure_mode(natural_modes(PAPER), row.mode.number - 1, radians(row.one_percent_deg), 20)
        assert abs(again.shift) == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("angle", [1.0, 30.0, 90.0, 150.0])
def test_a_simple_pendulum_is_measured_as_the_elliptic_integral_says(angle: float) -> None:
    modes = natural_modes(SIMPLE)
    measurement = measure_mode(modes, 0, radians(angle), 30)
    exact = pi / 2 / float(ellipk(np.sin(radians(angle) / 2) ** 2)) - 1
    assert abs(measurement.shift - exact) <= measurement.error < 1e-6
    assert measurement.outside < 1e-20


def test_one_percent_of_a_simple_pendulum() -> None:
    """Against a root of the elliptic integral, without a simulation."""

    def run(a: float) -> Measurement:
        shift = pi / 2 / float(ellipk(np.sin(a / 2) ** 2)) - 1
        return Measurement(a, a, 1 + shift, 1e-12, shift, 0.0)

    angle = one_percent(run, degrees(0.4))
    assert run(radians(angle)).shift == pytest.approx(-0.01, rel=1e-3)
    assert one_percent(run, inf) == inf
    assert np.isnan(one_percent(run, np.nan))
    assert np.isnan(one_percent(lambda a: replace(run(a), error=0.1), 20.0))
    kappa, error = limit([run(radians(a)) for a in AMPLITUDES_DEG])
    assert abs(kappa + 1 / 16) < error < 1e-4


@pytest.mark.parametrize("angles", [(20.0, 30.0), (25.0, 35.0)])
def test_the_uncertainty_of_kappa_counts_the_modes_that_swing_along(angles: tuple[float, float]) -> None:
    links = (Bob(mass=1.0, length=1.0), Bob(mass=0.6, length=0.7))
    modes = natural_modes(
        Scene(gravity=9.81, support=Cart(mass=2.0, stiffness=21.4), pendulum=(Pendulum(links=links),))
    )
    runs = [measure_mode(modes, 1, radians(angle)) for angle in angles]
    kappa, error = limit(runs)
    alone = limit([replace(run, outside=0.0) for run in runs])[1]
    assert abs(kappa - modes[1].kappa) < error < 0.05 * abs(kappa)
    assert alone < error


def test_a_damped_mode_keeps_its_kappa() -> None:
    modes = natural_modes(load("metronomes").undriven)
    measurement = measure_mode(modes, 3, radians(5.0), 20)
    assert measurement.effective < radians(4.9)
    assert measurement.shift == pytest.approx(modes[3].kappa * measurement.effective**2, rel=3e-3)
    assert measurement.shift != pytest.approx(modes[3].kappa * radians(5.0) ** 2, rel=0.1)


def test_the_clock_of_a_damped_run() -> None:
    times, clock = sample_times(50.0, 400, -0.3, -0.05)
    assert np.allclose(times - 0.3 * (np.exp(-0.05 * times) - 1) / -0.05, clock, atol=1e-12)
    assert (times[0], times[-1]) == (0.0, 50.0)
    assert np.ptp(np.diff(clock)) < 1e-12 < np.ptp(np.diff(times))


@pytest.mark.parametrize(
    ("name", "number", "words"),
    [("cart-upright", 1, "unstable"), ("metronomes", 1, "overdamped"), ("paper-cart-1", 0, "translation")],
)
def test_what_cannot_be_checked_says_why(name: str, number: int, words: str) -> None:
    checked = check(load(name), [number], (1.0,))
    assert checked.rows == ()
    assert words in checked.skipped[0][1]


@pytest.mark.parametrize("scene", [PAPER, DAMPED, load("cart-upright"), load("metronomes")])
def test_a_combination_of_modes_returns_its_weights(scene: Scene) -> None:
    """With dampers as Σ 2 Re φ z with complex z, which the projection does not see as such."""
    modes, rng = natural_modes(scene), np.random.default_rng(7)
    rows = [number for number in range(len(modes)) if modes.eigenvalue[number].imag]
    z = rng.normal(size=len(rows)) + 1j * rng.normal(size=len(rows))
    shapes = [modes.shape(number) for number in rows]
    phi = np.array([[*([shape.cart] if modes.on_cart else []), *shape.angles] for shape in shapes]).T
    q, v = (phi @ z).real, (phi @ (z * modes.eigenvalue[rows])).real
    if not scene.has_damping:
        assert np.allclose(v, phi @ (z * modes.eigenvalue[rows]).real)
    first = int(modes.on_cart)
    motion = Motion(q[None, first:] + rest_angles(scene), v[None, first:], q[:1], v[:1], np.zeros(1))
    projected = modal_motion(motion, modes, rows)
    assert np.allclose(projected.coordinate[0], z.real, atol=1e-9)
    assert np.allclose(projected.rate[0], (z * modes.eigenvalue[rows]).real, atol=1e-8)


def test_modal_energies_add_up() -> None:
    modes, rng = natural_modes(PAPER), np.random.default_rng(2)
    motion = Motion(*(0.1 * rng.normal(size=shape) for shape in ((6, 4), (6, 4), 6, 6, 6)))
    projected = modal_motion(motion, modes)
    M = matrices(PAPER).M
    mass = [phi.real @ M @ phi.real for phi in projected.shapes.T]
    by_hand = mass * (projected.rate**2 + modes.omega[projected.number] ** 2 * projected.coordinate**2) / 2
    assert np.allclose(projected.energy, by_hand, rtol=1e-10)
    assert np.allclose(projected.energy.sum(1), projected.total_energy, rtol=1e-10)
    assert np.allclose(projected.share_outside(2), 1 - projected.energy[:, 2] / projected.total_energy)


def test_a_damped_start_stays_in_its_mode() -> None:
    modes = natural_modes(DAMPED)
    number = next(k for k in range(len(modes)) if modes.eigenvalue[k].imag)
    run = simulate(
        DAMPED, 5.0, start=start_in_mode(DAMPED, modes, number, 0, 1e-6), tolerance=1e-14, output=50, method="DOP853"
    )
    projected = modal_motion(run.motion, modes)
    at = projected.number.tolist().index(number)
    expected = 1e-6 * np.exp(modes.eigenvalue[number] * run.times).real
    assert np.allclose(projected.coordinate[:, at], expected, atol=1e-12)
    others = np.delete(projected.coordinate, at, axis=1)
    assert np.abs(others).max() < 1e-11


def test_a_scene_in_space_is_checked_along_its_rail() -> None:
    scene = SIMPLE.model_copy(update={"space": "space"})
    measurement = measure_mode(natural_modes(scene), 0, radians(20.0), 12)
    assert measurement.shift == pytest.approx(measure_mode(natural_modes(SIMPLE), 0, radians(20.0), 12).shift, rel=1e-6)
    with pytest.raises(ComputationError, match="across"):
        start_in_mode(scene, natural_modes(scene), 0, 1)


def test_tables(paper: Check) -> None:
    text = check_table(paper, "text")
    assert "7.20947810" in text
    assert text.split("\n\n")[1].startswith("At 2")
    off = max(abs(run.shift) for row in paper.rows for run in row.measurements)
    assert f"from it by at most {100 * off:.3g} %" in text
    assert "rigid translation" in text
    markdown = check_table(paper, "markdown")
    assert markdown.startswith("**Two double pendula")
    assert "\n\n\\* near a 1:1" in markdown
    assert "\n\norbit: " in markdown
    rows = list(csv.DictReader(io.StringIO(check_table(paper, "csv"))))
    assert [row["mode"] for row in rows] == ["2"] * 3 + ["5"] * 3
    whole = json.loads(check_table(paper, "json"))
    assert whole["modes"][1]["kappa_measured_per_rad2"] == pytest.approx(KAPPA[4], rel=1e-3)
    irregular = replace(paper.rows[0].measurements[0], error=inf)
    shown = check_table(replace(paper, rows=(replace(paper.rows[0], measurements=(irregular,)),)), "text")
    assert "irregular" in shown
    assert f"{irregular.omega:.4g}" not in shown.split("irregular")[2]
    assert digits(2.68011, 1e-3, 9) == "2.68"


def test_a_general_motion_has_the_lines_of_the_table() -> None:
    run = simulate(PAPER, 300.0, output=4001, start=state_at_rest(PAPER, [0.02, 0.01, -0.015, 0.03]))
    comparison = compare(run)
    for row in comparison.rows[1:]:
        assert row.lines[0].omega == pytest.approx(row.mode.omega, rel=1e-6)
        assert comparison.nearest(row.lines[0])[0] == row.mode.number
    assert sum(row.share for row in comparison.rows) == pytest.approx(1.0, rel=1e-6)
    assert "mode 2" in comparison_table(comparison, "text")
    assert len(json.loads(comparison_table(comparison, "json"))["coordinates"]) == 5
    assert comparison_table(comparison, "csv").startswith("mode,copy")
    stream = io.BytesIO()
    save(spectrum_figure(comparison), stream, "png")
    assert stream.getvalue().startswith(b"\x89PNG")


def test_the_picture_of_a_check(paper: Check) -> None:
    stream = io.BytesIO()
    save(check_figure(paper), stream, "svg")
    assert b"<svg" in stream.getvalue()
    with pytest.raises(ComputationError, match="nothing"):
        save(check_figure(replace(paper, rows=())), stream, "png")


STEEP = Scene(
    gravity=3.7,
    support=Cart(mass=0.04921, stiffness=0.1725),
    pendulum=(
        Pendulum(
            links=(Bob(mass=3.0783, length=0.3133), Body(mass=1.6164, length=1.7736, centre=1.133, inertia=1.604))
        ),
    ),
)


@pytest.mark.parametrize("angles", [(3.0,), (2.0, 3.0), (1.0, 2.0, 3.0)])
def test_the_error_of_a_measured_kappa_is_a_bound(angles: tuple[float, ...]) -> None:
    """The κ of the table is that of the averaged Lagrangian in many digits, by `tests/eigen/test_amplitude.py`."""
    (row,) = check(STEEP, [2], angles, periods=15).rows
    kappa, error = row.kappa
    assert row.mode.kappa == pytest.approx(-23.974, abs=1e-3)
    assert abs(kappa - row.mode.kappa) <= 1.001 * error < 0.2 * abs(kappa)
    without, doubt = limit(row.measurements)
    assert without == pytest.approx(kappa)
    assert abs(without - row.mode.kappa) <= doubt


def test_a_translation_that_no_damper_brakes_keeps_its_place_and_its_speed() -> None:
    links = (Bob(mass=1.0, length=1.0, damping=0.05), Rod(mass=0.4, length=0.6, damping=0.02))
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=(Pendulum(links=links),))
    modes, rng = natural_modes(scene), np.random.default_rng(4)
    motion = Motion(*(0.1 * rng.normal(size=shape) for shape in ((5, 2), (5, 2), 5, 5, 5)))
    projected = modal_motion(motion, modes)
    whole = [sum(parts) for parts in zip(*(projected.part(at) for at in range(len(projected.number))), strict=True)]
    assert np.allclose(whole[0], projected.displacement, atol=1e-12)
    assert np.allclose(whole[1], projected.velocity, atol=1e-12)
    momentum = (matrices(scene).M @ projected.velocity.T)[0]
    assert np.allclose(projected.rate[:, 0] * projected.shapes[0, 0].real, momentum / 4.4, atol=1e-12)


def test_a_massless_cart_over_bobs_is_skipped_without_a_run() -> None:
    pendula = [Pendulum(links=(Bob(mass=m, length=l),)) for m, l in ((1.0, 1.0), (0.5, 0.8))]
    checked = check(Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=pendula))
    assert not checked.rows
    assert "no equation of motion" in checked.skipped[1][1]
    alike = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[pendula[0].replace(count=2)])
    (still,) = check(alike, [1], (5.0,), periods=8).rows
    assert still.backbone is None
    assert still.kappa[0] == pytest.approx(-1 / 16, rel=1e-2)
