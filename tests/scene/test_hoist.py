"""The prescribed length of a rope: its laws, its records and its mistakes."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from modal import load, natural_modes
from modal.errors import SceneError
from modal.scene import Bob, Hoist, Rod, Scene, dumps, parse
from modal.scene.length_laws import spline
from modal.scene.parameters import vary
from nonlinear import load as load_run
from nonlinear import save, simulate
from nonlinear.system import system_of

LAWS = (
    Hoist(to=6.0, duration=8.0),
    Hoist(to=3.0, begin=1.0, duration=2.0, profile="trapezoidal"),
    Hoist(to=3.0, begin=-1.0, duration=2.0, profile="trapezoidal", ramp=0.5),
)


@pytest.mark.parametrize("hoist", LAWS)
def test_laws_lead_from_one_rest_to_another_and_know_their_derivatives(hoist: Hoist) -> None:
    law = hoist.law(5.0)
    begin, end = law.breaks[0], law.breaks[-1]
    assert (begin, end) == (hoist.begin, hoist.begin + hoist.duration)
    assert np.allclose(law([begin - 1, begin, end, end + 1])[0], [5.0, 5.0, hoist.to, hoist.to], rtol=1e-14)
    assert np.array_equal(law([begin - 1, begin, end, end + 1])[1], np.zeros(4))
    inner = np.linspace(begin, end, 41)[1:-1]
    inner, step = inner[~np.isin(inner.round(9), np.round(law.breaks, 9))], 1e-6
    for order in (0, 1):
        slope = (law(inner + step)[order] - law(inner - step)[order]) / (2 * step)
        assert np.allclose(slope, law(inner)[order + 1], rtol=0, atol=1e-8)


def test_a_trapezoid_spends_its_ramps_and_its_speed() -> None:
    law = Hoist(to=1.0, duration=10.0, profile="trapezoidal", ramp=0.1).law(10.0)
    assert law(5.0)[1] == pytest.approx(-1.0)
    assert law(0.5)[2] == pytest.approx(-1.0)
    assert law.breaks == pytest.approx((0.0, 1.0, 9.0, 10.0))


def test_records_are_scipys_clamped_spline() -> None:
    times, lengths = np.array([0.0, 1.0, 2.5, 3.0, 4.7]), np.array([5.0, 4.5, 4.8, 6.0, 3.0])
    curve, other, at = spline(times, lengths), CubicSpline(times, lengths, bc_type="clamped"), np.linspace(0, 4.69, 50)
    for order, values in enumerate(curve(at)):
        assert np.allclose(values, other(at, order), rtol=1e-12, atol=1e-12)
    fine = other(np.linspace(0, 4.7, 100_001))
    assert curve.extremes == pytest.approx((fine.min(), fine.max()), rel=1e-8)
    two = spline(np.array([0.0, 2.0]), np.array([1.0, 3.0]))
    assert two(1.0) == pytest.approx((2.0, 1.5, 0.0), abs=1e-15)


def written(folder: Path, rows: str, length: float = 5.0) -> Path:
    (folder / "record.csv").write_text(rows, encoding="utf-8")
    hoist = '{ file = "record.csv" }'
    text = (
        f'gravity = 9.81\n[[pendulum]]\nlinks = [{{ kind = "bob", mass = 1.0, length = {length}, hoist = {hoist} }}]\n'
        "start = { angles_deg = [5.0] }\n"
    )
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return folder / "scene.toml"


def test_a_record_is_found_beside_its_scene(tmp_path: Path) -> None:
    scene = load(written(tmp_path, "time_s,length_m\n0,5\n1,4\n3,2.5\n"))
    assert scene.at(1.0).pendulum[0].links[0].length == pytest.approx(4.0)
    assert scene.at(9.0).pendulum[0].links[0].length == 2.5
    assert parse(dumps(scene).encode()) == scene


def test_a_scene_holds_its_record_and_the_changed_file_is_another_scene(tmp_path: Path) -> None:
    """A scene is what was read: runs, saved ones too, and what is kept under the scene never see another record."""
    path = written(tmp_path, "time_s,length_m\n0,5\n2,3\n")
    scene = load(path)
    run = simulate(scene, 3.0, output=4)
    save(run, tmp_path / "run.npz")
    written(tmp_path, "time_s,length_m\n0,5\n2,4\n")
    again = load(path)
    assert [version.at(2.0).pendulum[0].links[0].length for version in (scene, again)] == [3.0, 4.0]
    assert [system_of(version).hoisting.at(2.0)[0].item() for version in (scene, again)] == [3.0, 4.0]
    other = simulate(again, 3.0, output=4)
    assert abs(other.motion.links[-1, 0] - run.motion.links[-1, 0]) > 1e-3
    (tmp_path / "record.csv").unlink()
    saved = load_run(tmp_path / "run.npz")
    assert saved.scene == scene
    assert str(tmp_path) not in repr(saved.scene.model_dump())
    assert np.array_equal(simulate(saved.scene, 3.0, output=4).motion.links, run.motion.links)


def test_extremes_of_many_pieces_are_those_of_a_fine_grid() -> None:
    times = np.linspace(0.0, 6.0, 61)
    law = spline(times, 3 + np.sin(5 * times) * np.exp(-0.2 * times))
    fine = law(np.linspace(0.0, 6.0, 200_001))[0]
    assert law.extremes == pytest.approx((fine.min(), fine.max()), rel=1e-9)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("t,l\n0,5\n", r"file = \"record.csv\": needs the columns time_s and length_m$"),
        (
            "time_s,length_1_1_m,length_1_2_m\n0,5,1\n1,4,1\n",
            r'.*of length_1_1_m, length_1_2_m choose one, such as columns = \{ length_1_1_m = "length_m" \}',
        ),
        ("time_s,displacement_m\n0,0\n1,2\n", r".*length_m, that of a rope: this is the travel of a cart"),
        ("time_s,length_m\n0,5\n", "time_s: has 1 samples: at least 2 are needed"),
        ("time_s,length_m\n0,5\n0,4\n", "time_s: must be strictly ascending"),
        ("time_s,length_m\n0,5\n1,a\n", "file = .record.csv.: line 3, length_m: must be a finite number"),
        ("time_s,length_m\n0,4\n1,3\n", r"length_m: begins at 4 m, and its link has length = 5"),
        ("time_s,length_m\n0,5\n1,-1\n", r"length_m\[1\] = -1.0: must be positive"),
        (
            "time_s,length_m\n0,5\n1,0.1\n2,0.1\n3,5\n4,5\n",
            "length_m: the spline through it reaches a length of -.* m: must be positive",
        ),
        ("time_s,length_m\n0,5\n1e-80,6\n", "length_m: a record that begins at 5 m changes too fast or too slowly"),
    ],
)
def test_wrong_records_are_named(tmp_path: Path, rows: str, words: str) -> None:
    with pytest.raises(SceneError, match=rf"scene.toml: pendulum\[0\].links\[0\].hoist.{words}"):
        load(written(tmp_path, rows))


def test_a_missing_record_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, "")
    (tmp_path / "record.csv").unlink()
    with pytest.raises(SceneError, match=r'hoist.file = "record.csv": cannot be read: No such file'):
        load(path)


@pytest.mark.parametrize(
    ("hoist", "words"),
    [
        ({}, "hoist.to: is required\nhoist.duration: is required"),
        ({"to": 3.0}, "hoist.duration: is required"),
        ({"to": 3.0, "duration": 1.0, "file": "a.csv"}, "hoist.to: does not belong to a record"),
        ({"file": "a.csv"}, "hoist.file: is read with the scene file that names it"),
        ({"time_s": [0.0, 1.0]}, "hoist.length_m: is required in a record"),
        ({"length_m": [2.0, 1.0]}, "hoist.time_s: is required in a record"),
        ({"time_s": [0.0, 1.0], "length_m": [2.0]}, "hoist.length_m: has 1 values for 2 times"),
        ({"to": 3.0, "duration": 1e100}, "hoist.to: it changes too fast or too slowly for double precision"),
        ({"to": 3.0, "duration": 1e-100}, "hoist.to: it changes too fast or too slowly for double precision"),
        ({"to": 3.0, "duration": 1.0, "begin": 1e100}, "hoist.to: it changes too fast or too slowly"),
        ({"to": -1.0, "duration": 0.0}, "hoist.to = -1.0: must be positive\nhoist.duration = 0.0: must be positive"),
        ({"to": 3.0, "duration": 1.0, "ramp": 0.1}, 'hoist.ramp = 0.1: needs profile = "trapezoidal"'),
        ({"to": 3.0, "duration": 1.0, "profile": "fast"}, 'hoist.profile = "fast": must be one of'),
    ],
)
def test_mistakes_are_named_with_their_places(hoist: dict[str, object], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        Bob(mass=1.0, length=2.0, hoist=hoist)
    assert words in str(caught.value)


def test_only_bobs_are_hoisted_and_not_with_damping_ratios() -> None:
    with pytest.raises(SceneError, match=r'hoist: only the massless rope of a bob.*kind = "bob"'):
        Rod(mass=1.0, length=1.0, hoist={"to": 2.0, "duration": 1.0})
    with pytest.raises(SceneError, match="damping_ratio: belongs to modes of constant lengths"):
        load("hoisting-crane").replace(damping_ratio=0.01)


def test_the_example_is_the_shipped_scene_and_the_table_says_what_it_shows() -> None:
    example = load("hoisting-crane")
    assert example == load("hoisting-crane")
    modes, still = natural_modes(example), natural_modes(load("crane-hook"))
    assert any("hoist" in note for note in modes.notes)
    assert not any("hoist" in note for note in still.notes)
    assert np.array_equal(modes.omega, still.omega)
    assert vary(example, {"pendulum[0].links[0].hoist.to": 7.0}).at(9.0).pendulum[0].links[0].length == 7.0
    assert isinstance(parse(dumps(example).encode()), Scene)


def test_the_course_that_hoist_writes_is_a_record(tmp_path: Path) -> None:
    load(written(tmp_path, "time_s,length_1_1_m,omega_1_rad_per_s\n0,5,1.4\n1,4.5,1.5\n2,4,1.6\n"))
    hoist = load(tmp_path / "scene.toml").pendulum[0].links[0].hoist
    assert (hoist.time_s, hoist.length_m) == ((0.0, 1.0, 2.0), (5.0, 4.5, 4.0))
