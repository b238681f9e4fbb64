"""Closed-form responses against python-control, closed forms of a single crane, and the pictures."""

from __future__ import annotations

import csv
import io
import json

import control
import numpy as np
import pytest
from control_scenes import DRIVES, SCENES, at, crane, hanging, mixed, of_control

from modal import Bob, ComputationError, Pendulum, Scene, load, natural_modes
from modal.modes import all_shapes
from modal.plotting import bode_figure, impulse_figure, save
from modal.statespace import ModalForm, StateSpace, frequency_response, impulse_response, state_space, to_modal_form
from modal.statespace.response import response_table, terms
from multipendula.cli import main

OMEGA = np.array([0.05, 0.31, 0.9, 1.7, 3.3, 8.0, 25.0])


def form_of(scene: Scene, *inputs: str, outputs: tuple[str, ...] = ()) -> ModalForm:
    return to_modal_form(natural_modes(scene), state_space(scene, inputs, outputs))


def close(values: np.ndarray, expected: np.ndarray, tolerance: float = 1e-9) -> bool:
    return bool(np.abs(values - expected).max() <= tolerance * np.abs(expected).max())


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", SCENES)
def test_frequency_responses_are_those_of_python_control(name: str, drive: str) -> None:
    outputs = ("cart_position", "cart_velocity", "angles", "rates", "relative_angles", "tip_positions")
    outputs += () if drive == "cart_velocity" else ("pivot_forces",)
    form = form_of(SCENES[name], drive, "link_forces", outputs=outputs)
    response, expected = frequency_response(form, OMEGA), at(form.model, OMEGA)
    for k in range(response.shape[0]):
        assert close(response[k], expected[k]), form.model.outputs[k]
    assert not close(response * (1 + 1e-8), expected)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", SCENES)
def test_impulse_responses_are_those_of_python_control(name: str, drive: str) -> None:
    form = form_of(SCENES[name], drive)
    times = np.linspace(0.0, 4.0, 41)
    expected = control.impulse_response(of_control(form.model), times, squeeze=False).outputs
    assert close(impulse_response(form, times), expected)


@pytest.mark.parametrize("name", ["cart-upright", "chain-spatial", "metronomes", "crane-hook"])
def test_shipped_scenes_come_apart(name: str) -> None:
    """Standing links, space, torsion springs."""
    form = form_of(load(name))
    assert form.residual() < 1e-10
    assert close(frequency_response(form, OMEGA), at(form.model, OMEGA))


def test_the_residual_bites() -> None:
    form = form_of(crane())
    block = form.blocks[1]._replace(right=form.blocks[1].right * (1 + 1e-6))
    assert ModalForm(form.modes, form.model, (form.blocks[0], block, *form.blocks[2:])).residual() > 1e-7


def test_one_load_on_a_trolley_by_hand() -> None:
    """G_x = (g − lω²)/(−ω²(M g + m g − M l ω²)) and G_θ = 1/(M l ω² − (M + m) g)."""
    M, m, l, g = 1000.0, 100.0, 20.0, 9.81
    scene = crane().model_copy(update={"pendulum": (Pendulum(links=[Bob(mass=m, length=l)]),)})
    response = frequency_response(form_of(scene), OMEGA)[:, 0]
    stiff = (M + m) * g - M * l * OMEGA**2
    assert np.allclose(response[0], (g - l * OMEGA**2) / (-(OMEGA**2) * stiff), rtol=1e-12)
    assert np.allclose(response[1], -1 / stiff, rtol=1e-12)


def test_poles_are_infinite_only_where_seen() -> None:
    form = form_of(crane(20.0, 20.0))
    antiphase = form.modes.omega[1]
    assert np.all(np.isfinite(frequency_response(form, [0.5, 2.0])))
    assert np.isinf(frequency_response(form, 0.0)[0]).all()
    assert np.isfinite(frequency_response(form, 0.0)[1:]).all()
    assert len(list(terms(form))) == 3
    assert np.abs(frequency_response(form, antiphase * (1 + 1e-9))).max() < 1.0


def test_shapes_at_once_are_the_shapes_one_by_one() -> None:
    modes = natural_modes(mixed(joint=0.3))
    for number, copies in enumerate(all_shapes(modes)):
        assert len(copies) == modes.multiplicity[number]
        for copy, shape in enumerate(copies):
            alone = modes.shape(number, copy, "mass")
            assert shape.cart == pytest.approx(alone.cart, rel=1e-15, abs=0)
            assert np.allclose(shape.angles, alone.angles, rtol=1e-15, atol=0)


def test_what_cannot_be_taken_apart_is_refused() -> None:
    model = state_space(crane())
    with pytest.raises(ValueError, match="does not belong to this scene"):
        to_modal_form(natural_modes(mixed()), model)
    discrete = StateSpace(model.A, model.B, model.C, model.D, model.states, model.inputs, model.outputs, dt=0.1)
    with pytest.raises(ComputationError, match="continuous"):
        to_modal_form(natural_modes(crane()), discrete)


def test_a_critically_damped_mode_is_refused_or_close() -> None:
    """c = 2 m l² √(g/l): the two eigenvalues are one, and no two modes distinguish them."""
    link = Bob(mass=1.0, length=1.0, damping=2.0)
    scene = Scene(gravity=1.0, pendulum=[Pendulum(links=[link])])
    with pytest.raises(ComputationError, match="critically damped"):
        form_of(scene)


@pytest.mark.parametrize("scene", [crane(), hanging(), mixed(joint=0.3)])
def test_pictures_are_drawn(scene: Scene) -> None:
    form = form_of(scene)
    for draw in (bode_figure, impulse_figure):
        stream = io.BytesIO()
        save(draw(form, outputs=[0, 1]), stream, "png")
        assert stream.getvalue().startswith(b"\x89PNG")
        assert len(stream.getvalue()) > 20_000
    with pytest.raises(ComputationError, match="do not fit"):
        bode_figure(form, outputs=[0] * 19)


@pytest.mark.parametrize("to", ["csv", "json"])
def test_the_table_of_a_response_is_that_of_python_control(to: str) -> None:
    scene, hertz = crane(), [0.01, 0.08, 0.3, 2.0]
    form = form_of(scene, "cart_force", outputs=("angles",))
    table = response_table(form, hertz, 0, [0, 1], to)
    expected = np.squeeze(control.frequency_response(of_control(form.model), 2 * np.pi * np.array(hertz)).complex[:2])
    if to == "json":
        whole = json.loads(table)
        assert whole["frequency_hz"] == hertz
        assert whole["unit"]["theta_1_1"] == "rad per N"
        size, phase = (np.array(list(whole[name].values())) for name in ("magnitude", "phase_deg"))
    else:
        rows = list(csv.DictReader(table.splitlines()))
        assert [float(row["frequency_hz"]) for row in rows] == 2 * hertz
        size, phase, decibel = (
            np.reshape([float(row[name]) for row in rows], (2, 4))
            for name in ("magnitude", "phase_deg", "magnitude_db")
        )
        assert decibel == pytest.approx(20 * np.log10(size), rel=1e-12)
    assert size * np.exp(1j * np.radians(phase)) == pytest.approx(expected, rel=1e-9)


def test_the_table_has_no_number_at_an_undamped_pole() -> None:
    form = form_of(load("chain-1"), "joint_torques")
    whole = json.loads(response_table(form, [float(form.modes.omega[0] / (2 * np.pi)), 1.0], 0, [0], "json"))
    (size,), (phase,) = whole["magnitude"].values(), whole["phase_deg"].values()
    assert size[1] > 0
    assert (size[0] is None) == (phase[0] is None)
    assert size[0] is None or size[0] > 1e10


def test_frequencies_are_printed_without_a_picture(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["response", "crane-hook", "--at", "0.1,0.3,1", "--of", "x", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["frequency_hz"] == [0.1, 0.3, 1.0]
    assert main(["response", "crane-hook"]) == 0
    assert "peaks of the response" in capsys.readouterr().out
