"""Loops of feedback as a scene file has them: read, written, varied, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from modal.errors import SceneError
from modal.scene import dump, left_out, load, number_label, refusals, scene_from
from modal.scene.files import schema
from multipendula.cli import main

CRANE = """
gravity = 9.81
support = { kind = "cart", mass = 4.0 }
[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 2.0 }]
"""
MISTAKES = {
    'output = "theta_1_1"\ngain = 1.0': ("feedback[0].input: is required",),
    'input = "cart_forc"\noutput = "theta_9_1"\ngain = 1.0': (
        'feedback[0].input = "cart_forc": must be one of cart_force',
        "did you mean cart_force?",
        'feedback[0].output = "theta_9_1": must be one of x, x_dot, theta_1_1',
    ),
    'input = "cart_acceleration"\noutput = "x"\ngain = 1.0': ("is prescribed: feedback acts by a force or a torque",),
    'input = "cart_force"': ("feedback[0]: needs either output and gain, or gains",),
    'input = "cart_force"\noutput = "x"': ("feedback[0].gain: is required with output",),
    'input = "cart_force"\ngain = 0.0': ("feedback[0].output: is required with gain",),
    'input = "cart_force"\noutput = "x"\ngain = 1.0\nlimit = 0.0': ("feedback[0].limit = 0.0: must be positive",),
    'input = "cart_force"\noutput = "x"\ngain = 1.0\ndelay = 0.1': ("delay = 0.1: needs a sample_time",),
    'input = "cart_force"\noutput = "x"\ngain = 1.0\ndelay = 0.15\nsample_time = 0.1': (
        "delay = 0.15: must be a multiple of sample_time = 0.1",
    ),
    'input = "cart_force"\ngains = "none.csv"': ('feedback[0].gains = "none.csv":',),
    'input = "cart_force"\ngains = "K.csv"\ngain = 1.0': ("cannot be combined with gain",),
    'input = "joint_torques"\ngains = "K.csv"\nreference = 1.0': ("reference = 1.0: needs an output",),
    'input = ["cart_force", "torque_1_1"]\ngains = "K.csv"': ("feedback[0].gains: has 1 rows for 2 inputs",),
    'input = "cart_force"\ngains = { states = ["x", "x"], rows = [[1.0]] }': (
        "feedback[0].gains.rows[0]: must have a number for each of the 2 states, not 1",
        "feedback[0].gains.states: has x twice",
    ),
}


@pytest.mark.parametrize("text", MISTAKES)
def test_every_mistake_is_told_with_its_place(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "K.csv").write_text("x,theta_dot_1_1\n1.0,2.0\n")
    file = tmp_path / "scene.toml"
    file.write_text(f"{CRANE}\n[[feedback]]\n{text}\n")
    assert main(["table", str(file)]) == 2
    told = " ".join(capsys.readouterr().err.replace("multipendula: ", "").split())
    assert [words for words in MISTAKES[text] if words not in told] == []


@pytest.mark.parametrize("text", ["", "x\n", "x,y\n1,2,3\n", "x\nnan\n", "x\none\n", "\0\1"])
def test_files_that_hold_no_gains_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "K.csv").write_text(text)
    file = tmp_path / "scene.toml"
    file.write_text(f'{CRANE}\n[[feedback]]\ninput = "cart_force"\ngains = "K.csv"\n')
    with pytest.raises(SceneError, match=r"feedback\[0\].gains"):
        load(file)


def test_gains_of_a_file_are_held_by_the_scene_and_written_with_it(tmp_path: Path) -> None:
    (tmp_path / "K.csv").write_text("theta_dot_1_1,x\n2.0,1.0\n")
    file = tmp_path / "scene.toml"
    file.write_text(f'{CRANE}\n[[feedback]]\ninput = "cart_force"\ngains = "K.csv"\nsample_time = 0.1\ndelay = 0.3\n')
    scene = load(file)
    loop = scene.feedback[0]
    assert (loop.gains.states, loop.gains.rows) == (("theta_dot_1_1", "x"), ((2.0, 1.0),))
    assert loop.delayed_samples == 3
    dump(scene, tmp_path / "again.toml")
    assert load(tmp_path / "again.toml") == scene
    assert number_label(scene, "feedback[0].delay") == "delay of loop 1 of feedback (s)"
    assert left_out(scene) == ()
    assert "Samples and delays" in " ".join(left_out(scene, "a frequency response"))
    assert "form maximal" in refusals(scene, "form maximal")[0]


def test_units_of_gains_follow_from_both_signals() -> None:
    described = {"gravity": 9.81, "pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}]}
    loop = {"input": "joint_torques", "output": "theta_dot_1_1", "gain": 2.0, "limit": 3.0}
    scene = scene_from({**described, "feedback": [loop]})
    assert number_label(scene, "feedback[0].gain") == "gain of loop 1 of feedback (N m per rad/s)"
    assert number_label(scene, "feedback[0].limit") == "limit of loop 1 of feedback (N m)"


def test_editors_know_the_keys_of_feedback() -> None:
    document = schema()
    assert set(document["$defs"]["Feedback"]["properties"]) >= {"input", "output", "gain", "gains", "limit", "delay"}
    assert document["properties"]["feedback"]["items"]["$ref"] == "#/$defs/Feedback"
