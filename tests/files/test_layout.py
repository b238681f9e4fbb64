"""A scene is written back with the comments and the layout of its file."""

from __future__ import annotations

from pathlib import Path

from modal import load
from modal.scene.files import dumps, dumps_like, example_text, parse

TEXT = """# A crane of the yard
gravity = 9.81  # m/s²

[support]   # the trolley
kind = "cart"
mass = 20.0 # with the motor

[[pendulum]]
links = [
    { kind = "bob", mass = 3, length = 4.5 },  # the hook
    { kind = "bob", mass = 1.5, length = 0.5, damping = 0.0 },
]
"""


def test_numbers_change_and_comments_stay(tmp_path: Path) -> None:
    (tmp_path / "crane.toml").write_text(TEXT)
    scene = load(tmp_path / "crane.toml")
    assert dumps_like(scene, tmp_path / "crane.toml") == TEXT
    links = scene.pendulum[0].links
    pendulum = scene.pendulum[0].replace(links=[links[0].replace(length=4.25), links[1].replace(damping=0.125)])
    changed = scene.replace(support=scene.support.replace(mass=21.5), pendulum=[pendulum])
    lines = TEXT.replace("mass = 20.0", "mass = 21.5").replace("length = 4.5", "length = 4.25")
    assert dumps_like(changed, tmp_path / "crane.toml") == lines.replace("damping = 0.0", "damping = 0.125")


def test_what_cannot_keep_its_layout_is_written_anew(tmp_path: Path) -> None:
    scene = load("chain-2")
    assert dumps_like(scene, "chain-2") == example_text("chain-2")
    assert dumps_like(scene, scene) == dumps_like(scene, "-") == dumps(scene)
    longer = scene.replace(pendulum=[*scene.pendulum, *scene.pendulum])
    assert parse(dumps_like(longer, "chain-2").encode()) == longer


def test_a_record_beside_the_scene_is_named_only_where_it_is_found(tmp_path: Path) -> None:
    (tmp_path / "quake.csv").write_text("time_s,displacement_m\n0,0\n1,1\n2,0\n3,0\n")
    text = TEXT + '\n[support.motion]  # of the yard\nkind = "record"\nfile = "quake.csv"\n'
    (tmp_path / "crane.toml").write_text(
        text.replace('kind = "cart"\nmass = 20.0 # with the motor\n', 'kind = "moved"\n')
    )
    scene = load(tmp_path / "crane.toml").replace(gravity=9.8)
    assert "# of the yard" in dumps_like(scene, tmp_path / "crane.toml", tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert dumps_like(scene, tmp_path / "crane.toml", elsewhere) == dumps(scene)
