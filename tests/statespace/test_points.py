"""Inputs at points: against the nonlinear equations under constant forces, and against a run that a sine drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modal import SceneError, matrices, natural_modes
from modal.exports import FORMATS
from modal.scene import Scene, scene_from
from modal.scene.records import Spectrum
from modal.statespace import frequency_response, minimal, modal_gains, state_space, to_modal_form
from modal.vibration import random_response
from multipendula import cli
from nonlinear import simulate
from nonlinear.dynamics.minimal import Minimal, Recursion
from nonlinear.system import State, system_of

ROD = {"kind": "rod", "mass": 1.0, "length": 1.0, "damping": 0.4}
BOB = {"kind": "bob", "mass": 0.5, "length": 0.8, "drag": 0.2}
CART = {"kind": "cart", "mass": 2.0, "stiffness": 15.0, "damping": 0.3}
WIND = {"kind": "constant", "on": "pendulum[0].links[1]@0.3", "amplitude": 3.0}
POINTS = (
    "force:pendulum[0].links[1]@0.5",
    "force:pendulum[0].copies[1].links[0]",
    "lift:pendulum[0].links[1]",
    "torque:pendulum[0].links[1]",
    "torque:pendulum[0].links[1]@0.2",
    "force:cart",
    "force[0]",
)
WAYS = {"force": "horizontal", "lift": "vertical", "torque": "torque"}


def scene_with(*forces: dict[str, Any], support: dict[str, Any] = CART, **more: Any) -> Scene:
    pendulum = {"count": 2, "links": [ROD, BOB]} | more
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [pendulum], "force": [*forces]})


STRAIGHT, STANDING = (
    scene_with(WIND | {"amplitude": 0.0}),
    scene_with(WIND | {"amplitude": 0.0}, equilibrium=["up", "down"]),
)
LEANING = scene_with(WIND)


@pytest.mark.parametrize("scene", [STRAIGHT, STANDING, LEANING], ids=["straight", "standing", "leaning"])
def test_columns_of_B_are_slopes_of_the_nonlinear_accelerations(scene: Scene) -> None:
    """Central differences by a constant force there."""
    model = state_space(scene, POINTS)
    rest, first = dict(model.operating_point), len(model.A) // 2
    angles = np.array([value for name, value in rest.items() if name.startswith("theta")])
    step = 1e-4
    for column, name in enumerate(POINTS):
        kind, _, on = name.partition(":")
        force = scene.force[0] if not on else None
        way = {"direction": WAYS[kind], "on": on} if force is None else {"on": force.on, "direction": force.direction}
        accelerations = []
        for sign in (1, -1):
            more = scene_with({"kind": "constant", "amplitude": sign * step} | way).force
            system = system_of(scene.replace(force=(*scene.force, *more)))
            equations = Minimal(system, tuple(map(Recursion, system.groups)))
            y = equations.begin(State(angles, 0 * angles, rest.get("x", 0.0), 0.0))
            order = np.array([equations.begin(_unit(k, len(angles))) for k in range(2 * first)]).T
            accelerations.append(np.linalg.pinv(order) @ equations.derivative(0.0, y))
        slope = (accelerations[0] - accelerations[1]) / (2 * step)
        assert model.B[:, column] == pytest.approx(slope, abs=1e-8)


def _unit(k: int, links: int) -> State:
    z = np.eye(2 * links + 2)[k]
    return State(z[1 : links + 1], z[links + 2 :], z[0], z[links + 1])


@pytest.mark.parametrize("name", [*POINTS[:5], "force[1]"])
def test_a_response_is_that_of_a_long_forced_run(name: str) -> None:
    """The steady amplitude and phase of the nonlinear motion under a small sine."""
    kind, _, on = name.partition(":")
    hz, amplitude = 0.45, 1e-3
    way = {"on": on, "direction": WAYS[kind]} if on else {"on": "pendulum[0].links[0]@0.9", "direction": "horizontal"}
    sine = {"kind": "sine", "amplitude": amplitude, "frequency_hz": hz} | way
    scene = scene_with(WIND, sine, links=[ROD | {"damping": 2.0}, BOB | {"damping": 0.5}], support={"kind": "fixed"})
    form = to_modal_form(natural_modes(scene), state_space(scene, (name,), ("angles",)))
    response = frequency_response(form, 2 * np.pi * hz)[:, 0, 0]
    rest = np.array([value for _, value in form.model.operating_point])
    last = np.linspace(80.0, 80.0 + 4 / hz, 129)
    run = simulate(scene, last[-1], output=np.append(0.0, last), start=State(rest, 0 * rest), tolerance=1e-12)
    swing = run.motion.links[1:-1] - rest
    measured = 2 * np.exp(-2j * np.pi * hz * last[:-1]) @ swing / len(swing) / amplitude * 1j
    assert measured == pytest.approx(response, abs=2e-3 * np.abs(response).max())


@pytest.mark.parametrize("scene", [STRAIGHT, LEANING, LEANING.replace(damping_ratio=0.02)])
def test_elimination_and_the_model_give_one_response(scene: Scene) -> None:
    outputs = ("angles", "cart_position", "tip_accelerations", "pivot_forces")
    model = state_space(scene, (*POINTS, "joint_torques", "link_forces"), outputs)
    form = to_modal_form(natural_modes(scene), model)
    omega = np.array([0.7, 3.0, 20.0])
    eye = np.eye(len(model.A))
    exact = np.stack([model.C @ np.linalg.solve(1j * w * eye - model.A, model.B) + model.D for w in omega], axis=-1)
    assert frequency_response(form, omega) == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())
    assert form.residual() < 1e-12
    assert "force[0]" in modal_gains(natural_modes(scene), model).text()


def test_points_agree_with_the_groups_of_links() -> None:
    model = state_space(STRAIGHT, ("force:pendulum[0].links[1]", "link_forces", "joint_torques"))
    column = {signal.name: model.B[:, k] for k, signal in enumerate(model.inputs)}
    assert column["force:pendulum[0].links[1]"] == pytest.approx(column["force_1_2"] + column["force_2_2"])
    torque = state_space(STRAIGHT, ("torque:pendulum[0].copies[0].links[1]",)).B[:, 0]
    assert torque == pytest.approx(column["torque_1_2"])
    assert not state_space(STRAIGHT, ("lift:pendulum[0].links[1]",)).B.any()


def test_what_is_wrong_with_a_point_is_told() -> None:
    with pytest.raises(SceneError) as error:
        state_space(
            LEANING,
            ("force[3]", "force:pendulum[4].links[0]", "lift:cart", "torque:roof", "force:pendulum[0].links[1]@2"),
        )
    message = str(error.value)
    for words in (
        "input force[3]: the scene has 1 entries of force",
        "input force:pendulum[4].links[0]: the scene has 1 entries of pendulum",
        "input lift:cart: the cart runs on a horizontal rail",
        'input torque:roof: there is no support "roof"',
        "the link reaches 0.8 m",
    ):
        assert words in message
    with pytest.raises(SceneError, match="must be one of cart_force"):
        state_space(LEANING, ("forces",))
    with pytest.raises(SceneError, match=r"force\[0\]: named twice"):
        state_space(LEANING, ("force[0]", "force[0]"))


def test_models_without_what_does_not_contribute() -> None:
    scene = scene_with(WIND, count=1)
    whole, small = (make(scene, ("force[0]",), ("angles",)) for make in (state_space, minimal))
    w = 1.3j
    for model in (whole, small):
        assert model.inputs[0].name == "force[0]"
    response, other = (m.C @ np.linalg.solve(w * np.eye(len(m.A)) - m.A, m.B) for m in (whole, small))
    assert response == pytest.approx(other)
    with pytest.raises(SceneError, match="acts differently on equal pendula"):
        minimal(STRAIGHT, ("force:pendulum[0].links[1]",))
    with pytest.raises(SceneError, match="copies under constant forces are not merged"):
        minimal(LEANING)


def test_random_forces_by_the_integral_over_the_model() -> None:
    """RMS² = ∫ |H|² S df over a flat PSD, by a fine sum."""
    response = random_response(LEANING, Spectrum((0.05, 3.0), (2.0, 2.0), "acceleration"), ("angles",), "force[0]")
    f = np.linspace(0.05, 3.0, 60_001)
    H = frequency_response(response.form, 2 * np.pi * f[::30], tolerance=1e-6)[:, 0]
    model = response.form.model
    values, vectors = np.linalg.eig(model.A)
    reached = np.linalg.solve(vectors, model.B[:, 0])
    every = (model.C @ vectors) @ (reached[:, None] / (2j * np.pi * f - values[:, None]))
    assert every[:, ::30] == pytest.approx(H, abs=1e-9)
    exact = np.sqrt(np.trapezoid(2.0 * np.abs(every) ** 2, f, axis=1))
    assert response.rms == pytest.approx(exact, rel=1e-5)
    assert response.source.unit == "N"
    with pytest.raises(SceneError, match="input joint_torques: must be support_acceleration"):
        random_response(LEANING, response.spectrum, ("angles",), "joint_torques")


@pytest.mark.parametrize("form", [*FORMATS])
def test_every_format_takes_points(form: str, tmp_path: Any) -> None:
    (tmp_path / "scene.toml").write_text(
        'gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1.0, length = 1.0, damping = 0.1 }]\n'
        '[[force]]\nkind = "constant"\non = "pendulum[0].links[0]"\namplitude = 2.0\n'
    )
    out = tmp_path / f"out{FORMATS[form].extension}"
    words = ["export", str(tmp_path / "scene.toml"), "-o", str(out)]
    words += ["--input", "force:pendulum[0].links[0]@0.5,force[0]", *(["--discrete", "0.01"] if form == "c" else [])]
    assert cli.main(words) == 0
    assert out.stat().st_size > 100


def test_the_model_is_about_the_equilibrium() -> None:
    model = state_space(LEANING)
    assert dict(model.operating_point)["x"] == pytest.approx(2 * 3.0 / 15.0)
    n = len(model.A) // 2
    assert model.A[n:, :n] == pytest.approx(-np.linalg.solve(matrices(LEANING).M, matrices(LEANING).K))
