"""Moved supports in scene files: the files that they name, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from modal import Scene, SceneError, dumps, load, matrices, natural_modes
from modal.scene import Moved, RandomMotion, RecordMotion, describe, parse, scene_from
from modal.scene.files import schema
from modal.scene.parameters import vary
from modal.scene.records import read_record, read_spectrum

ROOT = Path(__file__).parents[2]
TEXT = """gravity = 9.81
[support]
kind = "moved"
motion = {{ {motion} }}
[[pendulum]]
links = [{{ kind = "bob", mass = 1.0, length = 1.0 }}]
"""


def written(folder: Path, motion: str, **files: str) -> Path:
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    (folder / "scene.toml").write_text(TEXT.format(motion=motion))
    return folder / "scene.toml"


def motion_of(scene: Scene) -> object:
    assert isinstance(scene.support, Moved)
    return scene.support.motion


@pytest.mark.parametrize(
    ("head", "key"),
    [
        ("time_s,displacement_m", "displacement_m"),
        ("time_s,velocity", "velocity_m_per_s"),
        ("time_s,other,acceleration", "acceleration_m_per_s2"),
    ],
)
def test_a_record_is_read_beside_the_scene_and_travels_in_it(tmp_path: Path, head: str, key: str) -> None:
    rows = [(k / 10, (-1) ** k * k) for k in range(5)]
    wide = "other" in head
    text = "# a comment\n" + head + "\n" + "\n".join(f"{t},x,{v}" if wide else f"{t}, {v}" for t, v in rows) + "\n"
    scene = load(written(tmp_path, 'kind = "record", file = "quake.csv", direction = "vertical"', quake=text))
    motion = motion_of(scene)
    assert isinstance(motion, RecordMotion)
    assert motion.time_s == (0.0, 0.1, 0.2, 0.3, 0.4)
    assert getattr(motion, key) == (0.0, -1.0, 2.0, -3.0, 4.0)
    assert motion.direction == "vertical"
    (tmp_path / "quake.csv").unlink()
    assert scene_from(describe(scene)) == parse(dumps(scene).encode()) == scene


def test_a_psd_is_read_or_given(tmp_path: Path) -> None:
    text = "frequency_hz,displacement_psd_m2_per_hz\n1,2\n3,4\n"
    random = 'kind = "random", seed = 1, duration = 10.0'
    read = motion_of(load(written(tmp_path, f'{random}, psd = "ground.csv"', ground=text)))
    inline = f'{random}, psd = [2.0, 4.0], frequency_hz = [1.0, 3.0], of = "displacement"'
    assert isinstance(read, RandomMotion)
    assert read == motion_of(load(written(tmp_path, inline)))


GOOD = "time_s,displacement\n0,0\n1,1\n2,2\n3,4\n"


@pytest.mark.parametrize(
    ("motion", "text", "said"),
    [
        ('kind = "record", file = "no.csv"', GOOD, r'support.motion.file = "no.csv": cannot be read'),
        ('kind = "record", file = "quake.csv", time_s = [1.0]', GOOD, "cannot be combined with time_s"),
        ('kind = "record", file = "quake.csv"', "a,b\n1,2\n", r"needs the columns time_s and .*acceleration_m_per_s2$"),
        ('kind = "record", file = "quake.csv"', GOOD + "4,x\n", "line 6, displacement: must be a finite number"),
        ('kind = "record", file = "quake.csv"', GOOD + "4,inf\n", "must be a finite number"),
        ('kind = "record", file = "quake.csv"', GOOD + "2,1\n", "time_s: must be strictly ascending"),
        ('kind = "record", file = "quake.csv"', "", "is empty"),
        ('kind = "random", psd = "quake.csv", seed = 1, duration = 9.0', GOOD, "needs the columns frequency_hz"),
        ('kind = "random", psd = [1.0], seed = 1, duration = 9.0', "", "frequency_hz: is required"),
        ('kind = "wave"', "", 'support.motion.kind = "wave": must be one of "sine", "sweep", "record", "random"'),
        ('kind = "sine", amplitude = 1.0, frequency_hz = 1.0, file = "x"', "", "file: does not belong here"),
        (
            'kind = "sine", amplitude = 1.0, frequency_hz = 1.0, direction = "up"',
            "",
            'direction = "up": must be one of',
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, motion: str, text: str, said: str) -> None:
    with pytest.raises(SceneError, match=said) as caught:
        load(written(tmp_path, motion, quake=text))
    assert str(caught.value).startswith(str(tmp_path / "scene.toml"))


def test_a_psd_file_is_checked(tmp_path: Path) -> None:
    for text, said in (
        ("frequency_hz,psd\n1,2\n", "at least 2"),
        ("frequency_hz,psd\n1,2\n1,3\n", "strictly ascending"),
        ("frequency_hz,psd\n1,2\n2,-3\n", "must not be negative"),
        ("frequency,psd\n1,2\n2,3\n", r"did you mean|needs the columns"),
    ):
        (tmp_path / "p.csv").write_text(text)
        with pytest.raises(SceneError, match=said):
            read_spectrum(tmp_path / "p.csv")


def test_a_device_is_no_record() -> None:
    for read in (read_record, read_spectrum):
        with pytest.raises(SceneError, match="/dev/zero: not a file"):
            read("/dev/zero")


def test_linear_results_are_those_at_rest() -> None:
    moved = load("damped-suspension")
    assert natural_modes(moved).omega == pytest.approx(natural_modes(moved.still).omega, rel=0)
    assert pytest.approx(matrices(moved.still).K) == matrices(moved).K
    assert any("support's motion is omitted" in note for note in natural_modes(moved).notes)
    assert not any("support's motion" in note for note in natural_modes(moved.still).notes)


def test_numbers_of_a_motion_are_varied() -> None:
    kapitza = load("kapitza")
    assert motion_of(vary(kapitza, {"support.motion.frequency_hz": 50.0})).frequency_hz == 50.0  # type: ignore[attr-defined]


def test_the_examples_are_whole_and_the_schema_knows_them() -> None:
    for name in ("damped-suspension", "kapitza"):
        assert load(name).is_moved
    assert len(read_record("quake.csv")["time_s"]) > 500
    assert read_spectrum("ground.csv").of == "displacement"
    parts = schema()["$defs"]
    assert {"Moved", "RecordMotion", "RandomMotion"} <= parts.keys()
    assert {"type": "string"} in parts["RandomMotion"]["properties"]["psd"]["anyOf"]
