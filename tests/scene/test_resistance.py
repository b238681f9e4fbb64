"""Dry friction and drag in a scene file: what is refused, and what the scene knows of itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modal.errors import SceneError
from modal.modes import natural_modes
from modal.scene import Scene, left_out, scene_from
from modal.scene.parameters import Variation, vary
from nonlinear import simulate
from nonlinear.averaging import average
from nonlinear.reduction import simulate_truncated, superpose
from nonlinear.system import initial_state


def data(cart: dict[str, Any] | None = None, **link: Any) -> dict[str, Any]:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, **link}
    entries = {"gravity": 9.81, "pendulum": [{"links": [link], "start": {"angles_deg": [5.0]}}]}
    return entries | ({"support": {"kind": "cart", "mass": 1.0, **cart}} if cart is not None else {})


RUBBING = scene_from(data(friction=0.1))
AIRY = scene_from(data(quadratic_drag=0.1))


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        (data(friction=-1.0), "pendulum[0].links[0].friction = -1.0: must not be negative"),
        (data(drag=-1.0), "pendulum[0].links[0].drag = -1.0: must not be negative"),
        (data(quadratic_drag="x"), "pendulum[0].links[0].quadratic_drag"),
        (
            data({"friction": 1.0, "friction_coefficient": 0.1}),
            "support.friction_coefficient = 0.1: cannot be combined",
        ),
        (data(friction=1.0) | {"space": "space"}, 'pendulum[0].links[0].friction = 1.0: needs space = "plane"'),
        (data({"friction": 1.0}) | {"space": "space"}, 'support.friction = 1.0: needs space = "plane"'),
        (
            data({"friction_coefficient": 0.1}, drive={"kind": "escapement", "impulse": 0.1}),
            "support.friction_coefficient = 0.1: cannot be combined with escapements",
        ),
    ],
)
def test_mistakes_are_named(numbers: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as raised:
        scene_from(numbers)
    assert words in str(raised.value)


def test_a_scene_without_them_is_the_same_object_of_numbers() -> None:
    bare = scene_from(data({}))
    same = scene_from(data({"friction": 0.3}, friction=0.1, drag=0.2, quadratic_drag=0.3)).conservative
    assert same == bare
    assert not bare.has_friction
    assert not bare.has_drag


def test_units_and_paths() -> None:
    scene = scene_from(data({"friction": 0.3}, friction=0.1, drag=0.2, quadratic_drag=0.3))
    assert vary(scene, {"support.friction": 2.0, "pendulum[0].links[0].drag": 3.0}).support.friction == 2.0
    units = {
        "support.friction": "N",
        "support.friction_coefficient": "",
        "pendulum[0].links[0].friction": "N m",
        "pendulum[0].links[0].drag": "N s/m",
        "pendulum[0].links[0].quadratic_drag": "N s²/m²",
    }
    assert {path: Variation(path, (1.0,)).unit for path in units} == units
    assert Variation("pendulum[0].links[0].quadratic_drag", (1.0,)).column.endswith("_N_s2_per_m2")


def test_links_that_count_as_one_have_the_friction_of_all() -> None:
    heavy = RUBBING.pendulum[0].links[0].heavier(3)
    assert (heavy.friction, heavy.mass) == (pytest.approx(0.3), 3.0)


def test_the_linear_model_says_what_it_leaves_out() -> None:
    assert "Dry friction" in left_out(RUBBING)[0]
    assert "Quadratic drag" in left_out(AIRY)[0]
    assert left_out(scene_from(data(drag=1.0))) == ()
    assert natural_modes(RUBBING).omega == pytest.approx(natural_modes(RUBBING.frictionless).omega)
    assert natural_modes(RUBBING).notes[0] == left_out(RUBBING)[0]


@pytest.mark.parametrize("scene", [RUBBING, AIRY, scene_from(data(drag=0.1))], ids=["friction", "quadratic", "linear"])
def test_who_has_no_place_for_them_says_so(scene: Scene) -> None:
    name = "friction" if scene is RUBBING else "drag"
    if scene.features.isdisjoint({"linear_drag"}):
        with pytest.raises(SceneError, match=rf"{name}.* method taylor"):
            simulate(scene, 1.0, method="taylor")


def test_closed_forms_and_averages_refuse_what_they_cannot_take() -> None:
    for scene in (RUBBING, AIRY):
        with pytest.raises(SceneError, match="motion in closed form"):
            superpose(scene, initial_state(scene), corrected=False)
    with pytest.raises(SceneError, match=r"support\.friction"):
        average(scene_from(data({"friction": 0.1})))
    with pytest.raises(SceneError, match="quadratic_drag"):
        average(AIRY)
    with pytest.raises(SceneError, match="few modes"):
        simulate_truncated(RUBBING, 1.0, modes=1)


def test_an_accuracy_is_kept_with_friction_and_drag() -> None:
    scene = scene_from(data(friction=0.02, drag=0.02, quadratic_drag=0.1))
    fine = simulate(scene, 8.0, tolerance=1e-12, output=81)
    asked = simulate(scene, 8.0, accuracy=1e-6, output=81)
    assert np.abs(asked.motion.links - fine.motion.links).max() < 1e-6
    assert asked.run.form == "minimal"
