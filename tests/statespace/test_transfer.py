"""Transfer functions against the state space itself, closed forms of a crane, and poles of pendula alone as zeros."""

from __future__ import annotations

import json

import numpy as np
import pytest
from control_scenes import DRIVES, SCENES, crane

from modal import Bob, ComputationError, Fixed, Pendulum, Scene, load, natural_modes
from modal.statespace import ModalForm, state_space, to_modal_form
from modal.statespace.transfer import transfer_functions
from multipendula.cli import main


def form_of(scene: Scene, *inputs: str, outputs: tuple[str, ...] = ()) -> ModalForm:
    return to_modal_form(natural_modes(scene), state_space(scene, inputs, outputs))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", SCENES)
def test_poles_zeros_and_gain_are_the_state_space(name: str, drive: str) -> None:
    outputs = ("cart_position", "cart_velocity", "angles", "tip_positions", "pivot_forces")
    form = form_of(SCENES[name], drive, outputs=outputs if drive != "cart_velocity" else outputs[:-1])
    model, s = form.model, np.array([0.3 + 0.2j, 1.7j + 0.01, 2.2 - 0.5j])
    whole = np.array([model.C @ np.linalg.solve(x * np.eye(len(model.A)) - model.A, model.B) + model.D for x in s])
    for row, functions in enumerate(transfer_functions(form)):
        for column, function in enumerate(functions):
            expected = whole[:, row, column]
            assert function.at(s) == pytest.approx(expected, rel=1e-7, abs=1e-11 * np.abs(whole).max())
            powers = np.polyval(function.numerator, s) / np.polyval(function.denominator, s)
            assert powers == pytest.approx(function.at(s), rel=1e-7, abs=1e-11 * np.abs(whole).max())


def test_a_crane_by_hand() -> None:
    """M x'' = u + …: with μ = m/M, x/u = (s² + g/l)/(M s² (s² + (1 + μ) g/l)), θ/u = −1/(M l (s² + (1 + μ) g/l))."""
    scene = load("crane-hook")
    simple = scene.replace(
        pendulum=(scene.pendulum[0].replace(links=(crane().pendulum[0].links[0],), start=None),),
        support=scene.support.replace(mass=1000.0),
    )
    g, l, m, M = scene.gravity, 20.0, 100.0, 1000.0
    (x,), (theta,) = transfer_functions(form_of(simple, "cart_force", outputs=("cart_position", "angles")))
    assert x.gain == pytest.approx(1 / M, rel=1e-12)
    assert np.abs(x.zeros) == pytest.approx(np.full(2, np.sqrt(g / l)), rel=1e-10)
    pole = np.sqrt((1 + m / M) * g / l)
    assert np.abs(x.poles) == pytest.approx([0, 0, pole, pole], abs=1e-7)
    assert theta.gain == pytest.approx(-1 / (M * l), rel=1e-12)
    assert theta.zeros.size == 0
    assert theta.poles.imag == pytest.approx([-pole, pole], rel=1e-10)


@pytest.mark.parametrize("name", SCENES)
def test_the_cart_stands_still_at_the_poles_of_the_pendula_alone(name: str) -> None:
    """Zeros of x/F: the fixed-base modes, each once, however many pendula share it."""
    ((function,),) = transfer_functions(form_of(SCENES[name], "cart_force", outputs=("cart_position",)))
    alone = natural_modes(SCENES[name].replace(support=Fixed())).eigenvalue
    expected = {complex(value) for pole in alone for value in {pole, pole.conjugate()}}
    for zero in expected:
        assert np.abs(function.zeros - zero).min() < 1e-7 * abs(zero)
    assert len(function.zeros) == len(expected)


def test_what_an_input_does_not_reach_has_no_poles() -> None:
    form = form_of(SCENES["equal loads"], "cart_force", outputs=("cart_position",))
    ((function,),) = transfer_functions(form)
    assert len(function.poles) == 4
    assert len(function.zeros) == 2


@pytest.mark.parametrize("more", [["--discrete", "0.1"], ["--dominant", "1"]])
def test_other_models_have_no_modes_to_take_poles_from(more: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "crane-hook", "--to", "tf", "-o", "-", *more]) in {1, 2}
    assert "transfer functions need a whole model in continuous time" in capsys.readouterr().err


def test_a_long_chain_has_no_polynomials() -> None:
    with pytest.raises(ComputationError, match="transfer functions of 120 poles: at most 100"):
        transfer_functions(
            form_of(load("chain-2").replace(pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, count=60),)),)))
        )


def test_the_exported_file(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "g.json"
    assert main(["export", "crane-hook", "--input", "cart_force", "--to", "tf", "-o", str(path)]) == 0
    whole = json.loads(path.read_text())
    functions = transfer_functions(form_of(load("crane-hook")))
    assert len(whole["transfer_functions"]) == 3
    for entry, (function,) in zip(whole["transfer_functions"], functions, strict=True):
        assert entry["input"] == "cart_force"
        assert entry["output"] == function.output.name
        assert entry["gain"] == function.gain
        assert [complex(*pole) for pole in entry["poles"]] == function.poles.tolist()
        assert [complex(*zero) for zero in entry["zeros"]] == function.zeros.tolist()
        assert entry["numerator"] == function.numerator.tolist()
        assert entry["denominator"] == function.denominator.tolist()
