"""What the numbers of a scene are called: in words, each its own, with units that other routes give, too."""

from __future__ import annotations

import numpy as np
import pytest
from seen import UNIT

from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import SceneError
from modal.loci import follow_loci
from modal.plotting.loci import loci_figure
from modal.plotting.style import theme
from modal.scene import ConstantForce, example_names, number_label, number_unit, number_words
from modal.scene.parameters import Variation, _numbers, with_numbers

SCENES = example_names()


@pytest.mark.parametrize(
    ("name", "path", "label"),
    [
        ("crane-two-loads", "pendulum[0].links[0].length", "length of link 1 of pendulum 1 (m)"),
        ("paper-cart-2", "support.mass", "mass of the cart (kg)"),
        ("paper-cart-2", "gravity", "gravity (m/s²)"),
        ("paper-cart-2", "pendulum[*].links[*].damping", "damping of links 1–2 of pendula 1–2 (N m s/rad)"),
        ("rope", "pendulum[0].links[0].mass", "mass of links 1–1000 of pendulum 1 (kg)"),
        ("two-swings", "pendulum[1].links[0].drive.angle_deg", "angle of the drive of link 1 of pendula 16–30 (°)"),
        ("two-swings", "spring[0].stiffness", "stiffness of spring 1 (N/m)"),
        ("two-swings", "support.left.mass", "mass of the swing left (kg)"),
        ("ship-crane", "support.stiffness.roll", "stiffness in roll of the platform ship (N m/rad)"),
        ("ship-crane", "support.start.roll_rate_deg", "rate of roll of the platform ship at the start (°/s)"),
        (
            "hoisting-crane",
            "pendulum[0].links[0].hoist.to",
            "length at the end of the hoist of link 1 of pendulum 1 (m)",
        ),
        ("suspension", "pendulum[0].links[3].loss", "loss angle of link 4 of pendulum 1 (rad)"),
        ("chain-unequal", "pendulum[0].start.angles_deg[2]", "angle of link 3 of pendulum 1 at the start (°)"),
    ],
)
def test_a_number_has_a_name_and_a_unit(name: str, path: str, label: str) -> None:
    scene = load(name)
    assert number_label(scene, path) == label
    assert number_label(scene, path) == f"{number_words(scene, path)} ({number_unit(scene, path)})"


def test_no_two_numbers_of_a_scene_have_one_name_and_none_is_a_path() -> None:
    for name in SCENES:
        scene = load(name)
        if scene.n_pendula > 100:
            continue
        paths = [with_numbers(place) for place in _numbers(scene)]
        labels = [number_label(scene, path) for path in paths]
        assert len(set(labels)) == len(labels), name
        assert not [label for label in labels if set("[]_") & set(label) or not UNIT.search(label)], name


def test_forces_and_torques_have_their_units() -> None:
    def pushed(direction: str) -> Scene:
        force = ConstantForce(on="pendulum[0].links[0]", direction=direction, amplitude=1.0)
        return Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])], force=[force])

    assert number_label(pushed("horizontal"), "force[0].amplitude") == "amplitude of force 1 (N)"
    assert number_label(pushed("torque"), "force[0].amplitude") == "amplitude of torque 1 (N m)"


def test_a_place_that_is_none_is_refused() -> None:
    with pytest.raises(SceneError, match="is not a number of this scene"):
        number_label(load("chain-1"), "pendulum[0].links[0].lenght")


def test_an_axis_is_called_by_the_name() -> None:
    links = [Bob(mass=1.0, length=1.0), Bob(mass=1.0, length=0.5)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=links)])
    values = tuple(np.linspace(0.4, 0.6, 5).tolist())
    with theme("light"):
        axis = loci_figure(follow_loci(scene, Variation("pendulum[0].links[1].length", values))).axes[0]
    assert axis.get_xlabel() == "length of link 2 of pendulum 1 (m)"
