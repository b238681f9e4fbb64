"""Responses far above, far below and between the modes against whole matrices in 90 digits (`response_oracle`)."""

from __future__ import annotations

import csv

import far_from_modes
import numpy as np
import pytest
from response_oracle import Oracle
from scenes import geared
from scipy.integrate import trapezoid

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, dump, natural_modes
from modal.scene import Spring
from modal.scene.records import Spectrum
from modal.statespace import ModalForm, frequency_response, state_space, to_modal_form
from modal.statespace.response import ExactResponse
from modal.statespace.transfer import transfer_functions
from modal.vibration import random_response
from multipendula.cli import main

QUAD = ((22.1, 0.416), (21.8, 0.277), (39.6, 0.341), (39.6, 0.59))
HERTZ = {
    10: 1.00793783438e-7,
    30: 1.3160386505e-11,
    50: 2.18444266064e-13,
    100: 8.49068831864e-16,
    200: 3.31256485276e-18,
}
"""Transmissibility of QUAD from its support to its tip, in 60 digits."""


def stages(sizes: tuple[tuple[float, float], ...], **more: object) -> Scene:
    links = tuple(Bob(mass=m, length=l) for m, l in sizes)
    return Scene(gravity=9.80665, pendulum=(Pendulum(links=links),), **more)


def form_of(scene: Scene, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> ModalForm:
    return to_modal_form(natural_modes(scene), state_space(scene, inputs, outputs))


def apart(form: ModalForm, omega: float, tolerance: float = 1e-12) -> float:
    """The largest relative error of all entries at ω."""
    inputs, read = ([signal.name for signal in every] for every in (form.model.inputs, form.model.outputs))
    true = np.array(Oracle(form.modes.scene).response(inputs, read, omega).tolist(), dtype=np.complex128)
    return float(np.max(np.abs(frequency_response(form, omega, tolerance=tolerance)[..., 0] / true - 1)))


def test_responses_with_rotors_at_joints() -> None:
    """Of joints with dampers, springs and both, below the modes and far above."""
    links = [Bob(mass=1.0, length=0.7, damping=0.02), Rod(mass=0.4, length=0.3, stiffness=0.5, damping=0.01)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0, stiffness=40.0), pendulum=[Pendulum(links=links)])
    for each in (geared(scene, 3), geared(scene, 3).replace(pendulum=[Pendulum(links=links[1:])])):
        form = form_of(each, ("cart_force",), ("cart_position", "angles"))
        assert max(apart(form, omega) for omega in (0.5, 3.0, 40.0, 1e4)) < 1e-12


def test_four_stages_isolate(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    dump(stages(QUAD), tmp_path / "quad.toml")
    words = ["--input", "support_displacement", "--signals", "tip_positions", "--at", ",".join(map(str, HERTZ))]
    assert main(["response", str(tmp_path / "quad.toml"), *words, "--format", "csv"]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [float(row["magnitude"]) for row in rows] == pytest.approx(list(HERTZ.values()), rel=5e-12, abs=0)


@pytest.mark.parametrize("drive", ["support_displacement", "support_acceleration"])
def test_eight_stages_isolate(drive: str) -> None:
    form = form_of(stages(2 * QUAD), (drive,), ("tip_positions", "joint_positions"))
    for omega in (1e-4, 2.9, 2e4):
        assert apart(form, omega) < 1e-13
    assert abs(frequency_response(form, 2e3)[0, 0, 0]) < 1e-30


@pytest.mark.parametrize("damping_ratio", [0.02, (0.1, 0.0, 0.03)])
def test_dampers_of_modes_pass_on_what_springs_do_not(damping_ratio: float | tuple[float, ...]) -> None:
    form = form_of(stages(QUAD, damping_ratio=damping_ratio), ("support_velocity",), ("tip_positions", "angles"))
    for omega in (1e-4, 2.9, 2e4):
        assert apart(form, omega) < 1e-13
    assert abs(frequency_response(form, 2e3)[0, 0, 0]) > 1e-9


@pytest.mark.parametrize("seed", [1, 5, 7, 9, 10])
def test_every_response_of_random_scenes_keeps_its_digits(seed: int) -> None:
    for trial in far_from_modes.trials(seed):
        assert trial.error < 1e-2 * trial.promised, trial.about


def low() -> Scene:
    pendulum = Pendulum(links=(Rod(mass=1.19885, length=0.714675), Bob(mass=0.326798, length=1.12092)))
    other = Pendulum(links=(Rod(mass=1.9273, length=0.317374),))
    return Scene(gravity=9.81, support=Cart(mass=2.57491), pendulum=(pendulum, other))


def test_a_torque_does_not_push_the_translation() -> None:
    form = form_of(low(), ("joint_torques",), ("cart_position", "cart_velocity"))
    response = frequency_response(form, 2 * np.pi * np.array([0.0, 1e-15, 1e-9, 1e-3]))
    assert response[0, 0].real == pytest.approx([-0.0169109] * 3 + [-0.016911], rel=1e-5)
    assert response[1, 0, 0] == 0
    for omega in (1e-9, 1e-4):
        assert apart(form, omega) < 1e-13


def test_digits_are_those_of_floats() -> None:
    """A tolerance of 0 leaves every entry to decimals."""
    scene = low().replace(support=Cart(mass=2.0, stiffness=3.0, damping=0.4))
    form = form_of(scene, ("cart_force", "link_forces"), ("angles", "pivot_forces", "tip_accelerations"))
    omega = np.geomspace(0.1, 60.0, 7)
    floats, digits = (frequency_response(form, omega, tolerance=each) for each in (1e-9, 0.0))
    assert np.abs(floats / digits - 1).max() < 1e-12
    assert (floats != digits).any()


@pytest.mark.parametrize("omega", [1.0, 1e5, 1e6, 1e12])
def test_a_structure_isolates_as_the_cart_that_it_is(omega: float) -> None:
    """The oracle is of the cart: whole matrices in 90 digits; at 1e12 rad/s less than 1e-80 of the sum is left."""
    pendula = (Pendulum(links=tuple(Bob(mass=m, length=l) for m, l in ((0.7, 0.3), (1.1, 0.7), (0.9, 0.11)))),)
    tied = Spring(between=("c", "ground"), stiffness=17.0)
    cart = Scene(gravity=9.81, support=Cart(mass=3.3, stiffness=17.0), pendulum=pendula)
    scene = Scene(gravity=9.81, support=Cart(mass=3.3, name="c"), pendulum=pendula, spring=(tied,))
    model = state_space(scene, ("support_displacement",), ("tip_positions",))
    passed = ExactResponse(scene, model.inputs, model.outputs).response_at(np.array([omega]))[0, 0, 0]
    true = Oracle(cart, digits=200).response(["support_displacement"], [model.outputs[0].name], omega)[0, 0]
    assert abs(passed / complex(true) - 1) < 1e-12


def test_what_symmetry_cancels_is_zero_at_every_frequency() -> None:
    """Two equal pendula on a cart swing alike: a spring between their tips is never stretched."""
    pair = (Pendulum(count=2, links=(Bob(mass=0.3, length=0.7), Bob(mass=0.1, length=0.3))),)
    spring = Spring(between=("pendulum[0].copies[0].links[1]", "pendulum[0].copies[1].links[1]"), stiffness=3.0)
    scene = Scene(gravity=9.81, support=Cart(mass=1.0, name="c"), pendulum=pair, spring=(spring,))
    model = state_space(scene, ("support_displacement",), ("spring_extensions",))
    assert not ExactResponse(scene, model.inputs, model.outputs).response_at(np.array([0.3, 40.0, 1e5])).any()


def test_isolation_of_a_structure_keeps_its_digits() -> None:
    """A cart held by a spring between points, up to where 1.5e-42 of the ground's motion is left."""
    pendula = stages(((0.7, 0.3), (1.1, 0.7), (0.9, 0.11))).pendulum
    held = Scene(gravity=9.81, support=Cart(mass=3.3, stiffness=17.0), pendulum=pendula)
    spring = Spring(between=("c", "ground"), stiffness=17.0)
    scene = held.replace(support=Cart(mass=3.3, name="c"), spring=(spring,))
    assert scene.is_structured
    model, omega = state_space(scene, ("support_displacement",), ("tip_positions",)), np.logspace(0, 6, 4)
    computed = ExactResponse(scene, model.inputs, model.outputs).response_at(omega)[0, 0]
    oracle = Oracle(held)
    exact = [complex(oracle.response(["support_displacement"], ["tip_1"], w)[0, 0]) for w in omega]
    assert computed == pytest.approx(np.array(exact), rel=1e-12, abs=0)
    assert abs(computed[-1]) == pytest.approx(1.47649866e-42, rel=1e-8, abs=0)


def test_noise_far_above_the_modes_is_that_of_the_isolation() -> None:
    """∫ |T|² S df with T = Π k/(k − mω² + …), and not the rounding of a sum of modes."""
    response = random_response(
        stages(QUAD), Spectrum((50.0, 200.0), (1.0, 1.0), "acceleration"), ("tip_accelerations",)
    )
    f = np.geomspace(50.0, 200.0, 20_001)
    H, s = np.ones_like(f), np.zeros_like(f)
    below = 0.0
    for m, l in QUAD[::-1]:
        below += m
        k, s = 9.80665 * below / l, s - m * (2 * np.pi * f) ** 2
        H, s = H * k / (k + s), k * s / (k + s)
    assert response.rms[0] == pytest.approx(np.sqrt(trapezoid(H**2, f)), rel=1e-6, abs=0)
    assert response.psd(f[:1])[0, 0] == pytest.approx(H[0] ** 2, rel=1e-11, abs=0)


def test_a_transfer_function_with_a_far_zero() -> None:
    """A zero 400 times beyond the poles, whose rounding the leading coefficient has too."""
    links = (
        Body(mass=2.3493, length=0.5485, centre=0.4857, inertia=0.07258, damping=6.441),
        Bob(mass=4.0833, length=1.9863),
    )
    pendula = (Pendulum(links=links), Pendulum(links=(Bob(mass=4.1364, length=0.6393, damping=5.038),)))
    scene = Scene(gravity=1.62, support=Cart(mass=4.0, damping=0.7), pendulum=pendula)
    form, oracle = form_of(scene, ("cart_force",), ("angles", "pivot_forces")), Oracle(scene)
    for (function,) in transfer_functions(form):
        for omega in (1e-4, 0.7, 2e3):
            true = complex(oracle.response(["cart_force"], [function.output.name], omega)[0, 0])
            assert function.at(1j * omega)[0] == pytest.approx(true, rel=2e-12, abs=0)


def test_a_transfer_function_carries_an_isolation_that_matrices_cannot() -> None:
    form = form_of(stages(QUAD), ("support_displacement",), ("tip_positions",))
    ((function,),) = transfer_functions(form)
    assert (len(function.zeros), len(function.poles)) == (0, 8)
    s, model = 2j * np.pi * np.array(list(HERTZ)), form.model
    assert np.abs(function.at(s)) == pytest.approx(list(HERTZ.values()), rel=5e-12, abs=0)
    direct = [(model.C @ np.linalg.solve(x * np.eye(8) - model.A, model.B) + model.D)[0, 0] for x in s]
    assert abs(direct[3]) != pytest.approx(HERTZ[100], rel=1e-6, abs=0)  # how much is lost is a matter of the BLAS


@pytest.mark.parametrize("to", ["csv", "json", "text"])
def test_an_impulse_response_is_written_in_numbers(to: str, tmp_path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    assert main(["response", "crane-hook", "--impulse", "--of", "x", "--format", to]) == 0
    printed = capsys.readouterr().out
    ending = {"text": "txt"}.get(to, to)
    assert main(["response", "crane-hook", "--impulse", "--of", "x", "-o", str(tmp_path / f"h.{ending}")]) == 0
    assert (tmp_path / f"h.{ending}").read_text() == printed
    if to == "csv":
        rows = list(csv.DictReader(printed.splitlines()))
        assert len(rows) == 2000
        assert set(rows[0]) == {"time_s", "output", "unit", "response"}
        assert float(rows[0]["response"]) == 0.0


def test_a_fixed_support_has_the_pendula_apart() -> None:
    scene = low().replace(support=Fixed())
    response = frequency_response(form_of(scene, ("link_forces",), ("angles",)), 3.0)[..., 0]
    assert response[2, :2].tolist() == [0, 0]
    assert response[:2, 2].tolist() == [0, 0]
