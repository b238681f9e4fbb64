"""Loops of feedback closed by hand: A − B K of the open plant, and the regulator against python-control's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modal import Bob, Cart, ModalSupport, Pendulum, load, natural_modes
from modal.errors import ComputationError, SceneError
from modal.modes.energies import mode_energies
from modal.modes.sensitivity import sensitivities
from modal.scene import Scene, dump, scene_from
from modal.scene.feedback import Feedback
from modal.statespace import frequency_response, minimal, modal_gains, state_space, to_modal_form
from modal.statespace.regulator import regulator
from multipendula.cli import main

BOB = {"kind": "bob", "mass": 1.0, "length": 2.0}
ROD = {"kind": "rod", "mass": 2.0, "length": 0.8, "damping": 0.3}


def crane(*feedback: dict[str, Any], **more: Any) -> Scene:
    pendula = [{"links": [BOB, ROD]}, {"links": [ROD], "equilibrium": ["up"]}]
    support = {"kind": "cart", "mass": 4.0, "damping": 0.5}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": pendula, "feedback": [*feedback], **more})


def by_hand(scene: Scene, inputs: tuple[str, ...]) -> Any:
    """The open plant, and its A − B K with a K read signal by signal from the scene."""
    plant = state_space(
        scene.replace(feedback=()), inputs, ("coordinates" if scene.is_structured else "cart_position",)
    )
    names, K = [signal.name for signal in plant.states], np.zeros((len(plant.inputs), len(plant.states)))
    rows = {signal.name: k for k, signal in enumerate(plant.inputs)}
    for loop in scene.feedback:
        if loop.gains is None:
            K[rows[loop.inputs[0]], names.index(str(loop.output))] += loop.gain
        else:
            for name, gains in zip(loop.inputs, loop.gains.rows, strict=True):
                for state, gain in zip(loop.gains.states, gains, strict=True):
                    K[rows[name], names.index(state)] += gain
    return plant, plant.A - plant.B @ K


def upper(values: Any) -> Any:
    halves = np.array(values)[np.imag(values) >= 0]
    return halves[np.lexsort((halves.real, np.abs(halves)))]


LOOPS: dict[str, tuple[Scene, tuple[str, ...]]] = {
    "force on the cart": (
        crane(
            {"input": "cart_force", "output": "x", "gain": 30.0},
            {"input": "cart_force", "output": "theta_dot_2_1", "gain": -80.0},
        ),
        ("cart_force",),
    ),
    "torques by a matrix": (
        crane(
            {
                "input": ["torque_2_1", "torque_1_2"],
                "gains": {
                    "states": ["theta_2_1", "theta_dot_1_2", "x_dot"],
                    "rows": [[60.0, 1.0, -2.0], [3.0, 4.0, 0.5]],
                },
            }
        ),
        ("joint_torques",),
    ),
    "a wind on a point": (
        crane({"input": "force:pendulum[0].links[1]@0.5", "output": "theta_dot_1_1", "gain": 5.0}),
        ("force:pendulum[0].links[1]@0.5",),
    ),
    "a structure": (
        load("tower").replace(
            feedback=[{"input": "floor2_force", "output": "floor1_dot_m_per_s", "gain": 900.0}]
        ),
        ("floor2_force",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_poles_models_and_responses_are_those_of_matrices_closed_by_hand(name: str) -> None:
    scene, inputs = LOOPS[name]
    plant, A = by_hand(scene, inputs)
    closed = state_space(scene, inputs)
    assert pytest.approx(A, rel=1e-12, abs=1e-12 * np.abs(A).max()) == closed.A
    modes = natural_modes(scene)
    hand = upper(np.linalg.eigvals(A))
    assert np.all(np.abs(upper(modes.eigenvalue) - hand) <= 1e-9 * np.abs(hand).max())
    assert np.nanmax(modes.residual) < 1e-12
    form, omega = to_modal_form(modes, closed), np.array([0.3, 2.0, 50.0])
    assert form.residual() < 1e-9
    direct = [closed.C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, closed.B) + closed.D for w in omega]
    assert np.moveaxis(frequency_response(form, omega), -1, 0) == pytest.approx(np.array(direct), rel=1e-8, abs=1e-12)
    assert modal_gains(modes, closed).inputs.gain.shape == (len(modes), len(closed.inputs))
    assert len(plant.states) == len(closed.states)


def test_what_nothing_feels_has_exact_poles_at_zero() -> None:
    """A cart whose place and speed no loop measures, then one whose place alone none does."""
    free = crane({"input": "cart_force", "output": "theta_1_1", "gain": 3.0}).replace(
        support={"kind": "cart", "mass": 4.0}
    )
    modes = natural_modes(free)
    assert modes.eigenvalue[0] == 0
    assert np.count_nonzero(modes.eigenvalue == 0) == 1
    assert next(len(block.A) for block in to_modal_form(modes, state_space(free)).blocks) == 2
    drags = free.replace(feedback=[*free.feedback, {"input": "cart_force", "output": "x_dot", "gain": 2.0}])
    model = state_space(drags)
    assert natural_modes(drags).eigenvalue[0] == 0
    assert next(len(block.A) for block in to_modal_form(natural_modes(drags), model).blocks) == 1
    assert np.sum(np.abs(np.linalg.eigvals(model.A)) < 1e-9) == 1


def test_equal_pendula_that_one_loop_tells_apart_are_not_merged() -> None:
    pair = {"gravity": 9.81, "support": {"kind": "cart", "mass": 10.0}, "pendulum": [{"links": [BOB], "count": 2}]}
    scene = scene_from({**pair, "feedback": [{"input": "torque_1_1", "output": "theta_dot_1_1", "gain": 1.0}]})
    assert len(natural_modes(scene)) == 3
    assert len(minimal(scene).states) == 6
    assert upper(natural_modes(scene).eigenvalue[1:]) == pytest.approx(
        upper(np.linalg.eigvals(by_hand(scene, ("joint_torques",))[1]))[-2:], rel=1e-9
    )


@pytest.mark.parametrize("name", ["crane-hook", "cart-upright"])
def test_the_regulator_is_that_of_python_control(name: str, tmp_path: Path) -> None:
    control = pytest.importorskip("control")
    scene, plant = load(name), state_space(load(name))
    design = regulator(scene)
    K, _, poles = control.lqr(plant.A, plant.B, design.Q, design.R)
    assert pytest.approx(K, rel=1e-9) == design.K
    assert upper(design.poles) == pytest.approx(upper(poles), rel=1e-6)
    file = tmp_path / "K.csv"
    assert main(["response", name, "--gains", "--lqr", "-o", str(file)]) == 0
    described = tmp_path / "loop.toml"
    described.write_text(
        (Path("modal/scene/shipped") / f"{name}.toml").read_text()
        + '\n[[feedback]]\ninput = "cart_force"\ngains = "K.csv"\n'
    )
    closed = natural_modes(load(described))
    assert upper(closed.eigenvalue) == pytest.approx(upper(design.poles), rel=1e-6)
    assert closed.eigenvalue.real.max() < 0


def test_default_weights_follow_bryson_with_the_scales_of_the_scene() -> None:
    """1 rad counts as the longest rope, its frequency and the weight of all; the loop damps place and swing well."""
    design = regulator(load("crane-hook"))
    rate, weight = np.sqrt(9.81 / 12.0), 1550.0 * 9.81
    assert np.diag(design.Q) == pytest.approx([1 / 144, 1, 1, 1 / (12 * rate) ** 2, rate**-2, rate**-2])
    assert design.R.tolist() == [[pytest.approx(weight**-2)]]
    slow = design.poles[np.abs(design.poles) < 3]
    assert (-slow.real / np.abs(slow)).min() > 0.4
    assert "Bryson's rule" in design.words()
    heavy = regulator(load("crane-hook").replace(gravity=4 * 9.81))
    assert np.abs(heavy.poles) == pytest.approx(2 * np.abs(design.poles))  # without a scale of its own
    assert regulator(load("crane-hook"), ("cart_acceleration",)).poles.real.max() < 0


def test_weights_are_read_by_their_headings(tmp_path: Path) -> None:
    control = pytest.importorskip("control")
    plant = state_space(load("chain-1"))
    Q, R = tmp_path / "Q.csv", tmp_path / "R.csv"
    Q.write_text("theta_dot_1_1,theta_1_1\n1.0,7.0\n")
    R.write_text("torque_1_1\n0.5\n")
    K, *_ = control.lqr(plant.A, plant.B, np.diag([7.0, 1.0]), [[0.5]])
    assert pytest.approx(K, rel=1e-9) == regulator(load("chain-1"), weights=(str(Q), str(R))).K
    Q.write_text("theta_dot_1_1,theta_1_1\n1.0,2.0\n0.0,1.0\n")
    R.write_text("torque_1_1\n-1.0\n")
    with pytest.raises(SceneError, match=r"Q.csv: must be symmetric(.|\n)*R.csv: must be positive definite"):
        regulator(load("chain-1"), weights=(str(Q), str(R)))
    with pytest.raises(ComputationError, match="no gains make this motion decay"):
        regulator(load("huygens").undriven, ("joint_torques",))


def test_motions_are_no_inputs_beside_feedback() -> None:
    with pytest.raises(SceneError, match="is a motion: beside feedback"):
        state_space(LOOPS["force on the cart"][0], ("cart_acceleration",))


def test_derivatives_of_closed_loops_are_refused() -> None:
    """They would need left vectors that are not the shapes."""
    with pytest.raises(SceneError, match="a derivative of modes does not close loops of feedback"):
        sensitivities(natural_modes(LOOPS["force on the cart"][0]), 1)


def test_a_loop_that_is_a_spring_neither_grows_nor_decays() -> None:
    """A gain of 3 N/m from the place of a cart is a spring of 3 N/m."""
    pendulum = (Pendulum(links=[Bob(mass=20.0, length=5.0)]),)
    sprung = natural_modes(Scene(gravity=9.81, support=Cart(mass=100.0, stiffness=3.0), pendulum=pendulum))
    loop = Feedback(input="cart_force", output="x", gain=3.0)
    held = natural_modes(Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=pendulum, feedback=[loop]))
    assert held.omega == pytest.approx(sprung.omega, rel=1e-13)
    assert held.damping_ratio.tolist() == [0.0, 0.0]
    with pytest.raises(SceneError, match="shares of energy do not support loops"):
        mode_energies(held)


def test_weights_may_leave_states_without_cost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only the place of the cart costs: zeros on the diagonal of Q."""
    scene = Scene(gravity=9.81, support=Cart(mass=4.0), pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.5)])])
    plant = state_space(scene)
    names = [signal.name for signal in plant.states]
    (tmp_path / "Q.csv").write_text(",".join(names) + "\n" + ",".join(str(int(name == "x")) for name in names) + "\n")
    (tmp_path / "R.csv").write_text("cart_force\n1\n")
    dump(scene, tmp_path / "cart.toml")
    weights = f"{tmp_path / 'Q.csv'},{tmp_path / 'R.csv'}"
    assert main(["response", str(tmp_path / "cart.toml"), "--gains", "--lqr", "--weights", weights]) == 0
    assert "poles of the loop" in capsys.readouterr().err
    design = regulator(scene, (), (str(tmp_path / "Q.csv"), str(tmp_path / "R.csv")))
    assert "Bryson" not in design.words()
    assert design.K[0, 0] == pytest.approx(1.0, rel=1e-9)
    # The poles are the stable roots of det(R + G(−s)ᵀ Q G(s)) = 0.
    Q, B = np.diag([float(name == "x") for name in names]), plant.B
    for pole in design.poles:
        there, mirrored = (np.linalg.solve(s * np.eye(len(names)) - plant.A, B) for s in (pole, -pole))
        assert abs(1 + (mirrored.T @ Q @ there)[0, 0]) < 1e-9


def test_the_scale_of_a_modal_coordinate_does_not_affect_the_default_loop() -> None:
    """A floor of 2 kg on 50 N/m in metres, and the same in units of 0.1 m, where M and K are 0.02 and 0.5."""
    poles, gains = [], []
    for unit in (1.0, 0.1):
        frame = ModalSupport(name="frame", M=((2.0 * unit**2,),), K=((50.0 * unit**2,),), points=(((unit,), (0.0,)),))
        hung = Pendulum(on="frame[0]", links=[Bob(mass=1.0, length=2.0)])
        design = regulator(Scene(gravity=9.81, support=frame, pendulum=[hung]))
        poles.append(design.poles)
        gains.append(design.K * [[1 / unit, 1.0, 1 / unit, 1.0]] / unit)
        assert "frame" in design.words()
    assert poles[0].real.max() < 0
    assert poles[1] == pytest.approx(poles[0], rel=1e-9)
    assert gains[1] == pytest.approx(gains[0], rel=1e-9)


def test_a_pole_without_a_certain_digit_is_not_called_level() -> None:
    """m x'' + 1e5 x' + 1e20 x = 0 of a cart of 4 kg under a stiff loop decays, whatever its bound is."""
    gains = {"states": ["x", "x_dot"], "rows": [[1e20, 1e5]]}
    support, hung = Cart(mass=4.0), Pendulum(links=[Bob(mass=2.0, length=1.5)])
    loop = ({"input": "cart_force", "gains": gains},)
    modes = natural_modes(Scene(gravity=9.81, support=support, pendulum=[hung], feedback=loop))
    assert np.isinf(modes.relative_error_bound[-1])
    assert modes.eigenvalue[-1] == pytest.approx(-1e5 / 8 + 5e9j, rel=1e-9)
    assert modes.eigenvalue[-1].real == pytest.approx(-1e5 / 8, rel=1e-3)
