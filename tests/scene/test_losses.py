"""Loss angles in a scene: numbers and tables, what is wrong with them, and who takes them."""

from __future__ import annotations

from math import tau
from typing import Any

import numpy as np
import pytest

from modal import Bob, Pendulum, Scene, SceneError, dumps, load
from modal.assembly import loss_at
from modal.scene import LossTable, Spring, left_out, parse, refusals, scene_from
from modal.scene.parameters import vary

TABLE = LossTable(frequency_hz=[0.0, 1.0, 100.0, 200.0], loss=[0.0, 1e-4, 1e-2, 0.0])


def hung(**numbers: Any) -> Scene:
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, **numbers)])])


def test_a_table_is_straight_over_logarithms_and_constant_beyond_its_ends() -> None:
    losses = loss_at(TABLE, tau * np.array([0.5, 1.0, 10.0, 100.0, 150.0, 200.0, 1e4]))
    np.testing.assert_allclose(losses, [5e-5, 1e-4, 1e-3, 1e-2, 5e-3, 0.0, 0.0], rtol=1e-12)
    assert loss_at(LossTable(frequency_hz=[3.0], loss=[0.2]), np.array([1.0, 50.0])).tolist() == [0.2, 0.2]


def test_losses_are_written_and_read_back_and_varied() -> None:
    scene = hung(stiffness=1.0, loss=0.1, wire_loss=TABLE)
    assert parse(dumps(scene).encode()) == scene
    assert scene.has_losses
    assert not scene.lossless.has_losses
    assert not scene.conservative.has_losses
    other = vary(scene, {"pendulum[0].links[0].wire_loss.loss[1]": 2e-4, "pendulum[0].links[0].loss": 0.2})
    assert (other.pendulum[0].links[0].loss, other.pendulum[0].links[0].wire_loss.loss[1]) == (0.2, 2e-4)
    assert not hung(wire_loss=LossTable(frequency_hz=[1.0, 2.0], loss=[0.0, 0.0])).has_losses


@pytest.mark.parametrize(
    ("numbers", "problem"),
    [
        ({"wire_loss": -1.0}, "pendulum[0].links[0].wire_loss = -1.0: must not be negative"),
        ({"wire_loss": "low"}, 'pendulum[0].links[0].wire_loss = "low": must be a number'),
        ({"loss": 0.1}, "pendulum[0].links[0].loss: is that of the joint's stiffness, which is 0: give a stiffness"),
        (
            {"wire_loss": {"frequency_hz": [2.0, 1.0], "loss": [0.1, 0.1]}},
            "pendulum[0].links[0].wire_loss.frequency_hz: must be strictly ascending",
        ),
        (
            {"wire_loss": {"frequency_hz": [1.0], "loss": [0.1, 0.2]}},
            "pendulum[0].links[0].wire_loss.loss: has 2 values for 1 frequencies",
        ),
        ({"wire_loss": {"frequency_hz": [], "loss": []}}, "pendulum[0].links[0].wire_loss.loss: must not be empty"),
        (
            {"wire_loss": {"frequency_hz": [1.0], "loss": [-0.1]}},
            "pendulum[0].links[0].wire_loss.loss[0] = -0.1: must not be negative",
        ),
        ({"kind": "rod", "wire_loss": 0.1}, "pendulum[0].links[0].wire_loss: only a bob hangs on a wire"),
    ],
)
def test_mistakes_are_named_with_their_places(numbers: dict[str, Any], problem: str) -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, **numbers}
    with pytest.raises(SceneError) as caught:
        scene_from({"gravity": 9.81, "pendulum": [{"links": [link]}]})
    assert [words.startswith(problem) for words in caught.value.problems] == [True]


def test_a_wire_hangs_and_a_spring_with_a_loss_has_a_stiffness() -> None:
    with pytest.raises(SceneError, match=r'equilibrium\[1\] = "up": this link has a wire_loss, and a wire hangs'):
        Pendulum(links=[Bob(mass=1.0, length=1.0, wire_loss=0.1, count=2)], equilibrium=["down", "up"])
    with pytest.raises(SceneError, match="loss: is that of the stiffness, which is 0"):
        Spring(between=["ground", "floor"], damping=1.0, loss=0.1)


def test_what_is_in_time_refuses_them_and_linear_models_say_that_they_are_left_out() -> None:
    scene = load("suspension")
    for capability in ("form minimal", "an ensemble", "a shock", "an impulse response", "synchronization"):
        (words,) = refusals(scene, capability)
        assert "loss angles, which are defined at a frequency" in words
    assert "Loss angles are omitted" in left_out(scene, "a constant linear model")[0]
    for capability in ("the table of modes", "a frequency response", "random vibration", "thermal noise"):
        assert not left_out(scene, capability)
        assert not refusals(scene, capability)
