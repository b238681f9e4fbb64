"""Forces at points of a scene: how they are written, what is wrong with them, and the files they are read from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from modal import SceneError, load
from modal.scene import ConstantForce, SineForce, drive_period, dumps, parse, places_of, scene_from
from modal.scene.parameters import vary
from modal.scene.points import PendulumPoint, parse_point

LINK = {"kind": "bob", "mass": 1.0, "length": 1.0}
SINE = {"kind": "sine", "amplitude": 1.0, "frequency_hz": 0.5}


def scene_with(*forces: dict[str, Any], **more: Any) -> Any:
    links = [LINK, LINK | {"count": 2}]
    return scene_from(
        {"gravity": 9.81, "pendulum": [{"links": [LINK]}, {"count": 3, "links": links}]} | more | {"force": [*forces]}
    )


def test_points_are_read() -> None:
    assert parse_point("cart") is None
    assert parse_point("pendulum[2].copies[1].links[0]@1.5e-1") == PendulumPoint(2, 0, 1, 0.15)
    for text in (
        "",
        "left right",
        "pendulum[0]",
        "pendulum[0].links[0]@",
        "pendulum[0].links[0]@-1",
        "pendulum[0].links[0]@nan",
    ):
        with pytest.raises(ValueError, match="is not a point such as"):
            parse_point(text)


def test_a_point_is_at_every_copy_and_every_link_of_a_run() -> None:
    scene = scene_with()
    assert [place.link for place in places_of(scene, "pendulum[0].links[0]")] == [0]
    assert [place.link for place in places_of(scene, "pendulum[1].links[1]@0.5")] == [2, 3, 5, 6, 8, 9]
    assert [(place.link, place.above) for place in places_of(scene, "pendulum[1].copies[2].links[0]")] == [(7, -1)]
    assert [place.above for place in places_of(scene, "pendulum[1].copies[0].links[1]")] == [1, 2]


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ({"on": "roof top"}, 'force[0].on: is not a point such as "cart", "NAME@0.2,0.1" of a support or "pendulum'),
        ({"on": "roof"}, 'force[0].on = "roof": there is no support "roof"'),
        ({"on": "cart"}, 'force[0].on = "cart": the support is fixed, and there is no cart'),
        ({"on": "pendulum[2].links[0]"}, "the scene has 2 entries of pendulum, numbered from 0"),
        ({"on": "pendulum[1].copies[3].links[0]"}, "pendulum[1] has count = 3, and its copies are numbered from 0"),
        ({"on": "pendulum[1].links[2]"}, "pendulum[1] has 2 entries of links, numbered from 0"),
        ({"on": "pendulum[0].links[0]@1.25"}, "the link reaches 1 m below its upper joint"),
        ({"on": "pendulum[0].links[0]", "direction": "up"}, 'force[0].direction = "up": must be one of'),
        ({"on": "pendulum[0].links[0]", "kind": "kick"}, 'force[0].kind = "kick": must be one of'),
        ({"on": "pendulum[0].links[0]", "amplitude": -1.0}, "force[0].amplitude = -1.0: must not be negative"),
        ({"on": "pendulum[0].links[0]", "frequency": 1.0}, "force[0].frequency: is not a known key"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(force: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError) as error:
        scene_with(SINE | force)
    assert message in str(error.value)


def test_a_force_on_the_cart_is_horizontal_and_forces_act_in_the_plane() -> None:
    cart = {"kind": "cart", "mass": 1.0}
    with pytest.raises(SceneError, match='direction = "torque": a force on the cart is horizontal'):
        scene_with(SINE | {"on": "cart", "direction": "torque"}, support=cart)
    with pytest.raises(SceneError, match=r'force\[0\]: needs space = "plane"'):
        scene_with(SINE | {"on": "pendulum[0].links[0]"}, space="space")


def test_a_hoisted_rope_has_no_fixed_points() -> None:
    rope = LINK | {"hoist": {"to": 2.0, "duration": 1.0}}
    with pytest.raises(SceneError, match="the length of this rope changes: leave out @"):
        scene_with(SINE | {"on": "pendulum[0].links[0]@0.5"}, pendulum=[{"links": [rope]}])


def test_records_and_spectra_are_read_beside_the_scene(tmp_path: Path) -> None:
    (tmp_path / "push.csv").write_text("time_s,force_n\n0,0\n1,2\n2,1\n3,0\n")
    (tmp_path / "turn.csv").write_text("time_s,moment_nm\n0,0\n1,2\n2,1\n3,0\n")
    (tmp_path / "wind.csv").write_text("frequency_hz,force_psd\n0.1,1\n2,1\n")
    text = """
gravity = 9.81
[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 1.0 }]
[[force]]
on = "pendulum[0].links[0]"
kind = "record"
file = "push.csv"
[[force]]
on = "pendulum[0].links[0]"
direction = "torque"
kind = "record"
file = "turn.csv"
[[force]]
on = "pendulum[0].links[0]@0.25"
kind = "random"
psd = "wind.csv"
seed = 1
duration = 20.0
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = load(tmp_path / "scene.toml")
    assert scene.force[0].force_n == (0.0, 2.0, 1.0, 0.0)  # type: ignore[union-attr]
    assert scene.force[1].moment_nm == (0.0, 2.0, 1.0, 0.0)  # type: ignore[union-attr]
    assert scene.force[2].psd == (1.0, 1.0)  # type: ignore[union-attr]
    assert parse(dumps(scene).encode()) == scene
    (tmp_path / "scene.toml").write_text(text.replace("push.csv", "turn.csv"))
    with pytest.raises(SceneError, match=r'force\[0\].moment_nm: with direction = "horizontal" a record holds force_n'):
        load(tmp_path / "scene.toml")
    (tmp_path / "scene.toml").write_text(text.replace("push.csv", "wind.csv"))
    with pytest.raises(SceneError, match=r'force\[0\].file = "wind.csv": needs the columns time_s and one of force_n'):
        load(tmp_path / "scene.toml")


def test_numbers_of_forces_have_places() -> None:
    scene = scene_with(
        SINE | {"on": "pendulum[0].links[0]"}, {"on": "pendulum[1].links[0]", "kind": "constant", "amplitude": -2.0}
    )
    assert isinstance(scene.force[0], SineForce)
    assert isinstance(scene.force[1], ConstantForce)
    assert vary(scene, {"force[0].amplitude": 3.0, "force[1].amplitude": 1.0}).force[1].amplitude == 1.0  # type: ignore[union-attr]
    assert scene.features >= {"force", "constant_force"}
    assert scene.unforced.features.isdisjoint({"force"})
    with pytest.raises(SceneError, match=r"force\[0\].frequency"):
        vary(scene, {"force[0].frequency": 1.0})


def test_a_support_may_move_both_ways_but_not_twice_one_way() -> None:
    motion = {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0}
    both = {"kind": "moved", "motion": [motion, motion | {"direction": "vertical"}]}
    scene = scene_with(support=both)
    assert [each.direction for each in scene.support.motions] == ["horizontal", "vertical"]
    assert parse(dumps(scene).encode()) == scene
    assert vary(scene, {"support.motion[1].amplitude": 0.2}).support.motions[1].amplitude == 0.2
    with pytest.raises(SceneError, match='motion: has 2 motions with direction = "horizontal"'):
        scene_with(support={"kind": "moved", "motion": [motion, motion]})


def test_drives_have_the_common_period_of_their_frequencies() -> None:
    on = {"on": "pendulum[0].links[0]"}
    motion = {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.6}
    scene = scene_with(SINE | on | {"frequency_hz": 0.9}, support={"kind": "moved", "motion": motion})
    period = drive_period(scene)
    assert period.seconds == pytest.approx(1 / 0.3)
    assert (period.places, period.cycles) == (("support.motion.frequency_hz", "force[0].frequency_hz"), (2, 3))
    with pytest.raises(
        SceneError, match=r"force\[1\].frequency_hz = 0.7071: is not a ratio p/q of force\[0\].frequency_hz = 0.5"
    ):
        drive_period(scene_with(SINE | on, SINE | on | {"frequency_hz": 0.7071}))
    with pytest.raises(SceneError, match="nothing drives this scene"):
        drive_period(scene_with(on | {"kind": "constant", "amplitude": 1.0}))
    with pytest.raises(SceneError, match=r'force\[0\].kind = "sweep": is not periodic'):
        drive_period(
            scene_with(on | {"kind": "sweep", "amplitude": 1.0, "from_hz": 0.1, "to_hz": 1.0, "duration": 5.0})
        )
