"""Trajectories on disk: what is read is what was saved, and everything else is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forged import forged, with_record

import modal
from modal import Scene, SceneError
from modal.errors import ComputationError
from modal.scene.sealed import archive
from nonlinear import files as recordings
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import reaction_forces_of, summary
from nonlinear.simulation import resume, simulate
from nonlinear.system import AppliedForces, level_crossing, system_of


def short_run(name: str, **options: Any) -> Trajectory:
    return simulate(modal.load(name), 1.0, output=11, **options)


@pytest.mark.parametrize("name", ["paper-cart-3", "chain-spatial", "metronomes", "chain-1"])
@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_what_is_read_is_what_was_saved(name: str, kind: str, tmp_path: Path) -> None:
    saved, path = short_run(name), tmp_path / f"run.{kind}"
    recordings.save(saved, path)
    read = recordings.load(path)
    assert read.scene == saved.scene
    assert read.run == saved.run
    for part in recordings.PARTS:
        assert np.array_equal(getattr(read.motion, part), getattr(saved.motion, part))
    assert np.array_equal(read.times, saved.times)
    assert summary.text(read) == summary.text(saved)
    assert np.array_equal(reaction_forces_of(read).pivots, reaction_forces_of(saved).pivots)
    assert resume(read, 1.0).times[0] == 1.0


def test_events_are_saved(tmp_path: Path) -> None:
    scene = modal.load("chain-1")
    passing = level_crossing(system_of(scene), "theta[1,1]")
    saved = simulate(scene, 3.0, output=4, events=[passing])
    recordings.save(saved, tmp_path / "run.npz")
    read = recordings.load(tmp_path / "run.npz")
    assert [(h.name, h.time) for h in read.happenings] == [(h.name, h.time) for h in saved.happenings]
    assert read.happenings[0].state.links == saved.happenings[0].state.links


def test_csv_columns_carry_units(tmp_path: Path) -> None:
    recordings.save(short_run("paper-cart-1"), tmp_path / "run.csv")
    names, *rows = (tmp_path / "run.csv").read_text().splitlines()
    assert json.loads((tmp_path / "run.csv.json").read_text())["scene"]["gravity"] == 9.81
    assert names.split(",")[:3] == ["time_s", "theta_1_1_rad", "theta_1_2_rad"]
    assert names.endswith("theta_dot_1_2_rad_per_s,x_m,x_dot_m_per_s")
    assert len(rows) == 11


def test_forces_from_outside_are_not_saved(tmp_path: Path) -> None:
    driven = short_run("paper-cart-1", load=lambda time, state: AppliedForces(1.0))
    assert np.isfinite(reaction_forces_of(driven).normal).all()
    recordings.save(driven, tmp_path / "run.npz")
    with pytest.raises(ComputationError, match="applied forces"):
        reaction_forces_of(recordings.load(tmp_path / "run.npz"))


def broken(tmp_path: Path) -> dict[str, Path]:
    made = {kind: tmp_path / f"good.{kind}" for kind in ("npz", "csv")}
    for path in made.values():
        recordings.save(short_run("chain-2"), path)
    text, data = with_record(made["csv"]).decode(), dict(np.load(made["npz"]))
    files = {
        "missing.npz": None,
        "empty.npz": b"",
        "empty.csv": b"",
        "torn.npz": made["npz"].read_bytes()[:-200],
        "binary.csv": b"\xff\xfe\x00",
        "other.csv": b"a,b\n1,2\n",
        "short.csv": "\n".join(text.splitlines()[:2]).encode(),
        "ragged.csv": (text + "1,2,3\n").encode(),
        "nan.csv": text.replace(text.splitlines()[3].split(",")[1], "nan").encode(),
        "backwards.csv": "\n".join([*text.splitlines()[:2], *text.splitlines()[:1:-1]]).encode(),
        "tolerance.csv": text.replace('"tolerance": 1e-09', '"tolerance": "abc"').encode(),
        "stopped.csv": text.replace('"stopped": ""', '"stopped": 7').encode(),
        "method.csv": text.replace('"method": "DOP853"', '"method": "Euler"').encode(),
        "nested.csv": ("# " + "[" * 100_000 + "\n").encode(),
        "list.csv": b"# [1]\n",
        "words.csv": text.replace("theta_1_1", "angle").encode(),
    }
    for name, content in files.items():
        if content is not None:
            (tmp_path / name).write_bytes(forged(content))
    data["links"] = data["links"][:-1]
    (tmp_path / "shapes.npz").write_bytes(archive(data))
    np.savez(tmp_path / "foreign.npz", a=np.zeros(3))
    np.savez(tmp_path / "pickled.npz", header=np.array([{}], dtype=object))
    return {name: tmp_path / name for name in (*files, "shapes.npz", "foreign.npz", "pickled.npz", "run.txt")}


def test_anything_else_is_refused_in_one_line(tmp_path: Path) -> None:
    for name, path in broken(tmp_path).items():
        with pytest.raises(SceneError) as caught:
            recordings.load(path)
        assert len(caught.value.problems) == 1, name
        assert caught.value.problems[0].startswith(f"{path}: "), name


def test_a_bad_scene_in_the_header_is_named(tmp_path: Path) -> None:
    recordings.save(short_run("chain-2"), tmp_path / "run.csv")
    text = with_record(tmp_path / "run.csv").decode().replace('"gravity": 9.81', '"gravity": -1.0')
    (tmp_path / "run.csv").write_bytes(forged(text.encode()))
    with pytest.raises(SceneError, match=r"run.csv: gravity = -1.0: must be"):
        recordings.load(tmp_path / "run.csv")


def test_a_name_of_no_known_kind_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"the name must end in \.npz, \.csv or \.mat"):
        recordings.save(short_run("chain-2"), tmp_path / "run.json")
    assert not list(tmp_path.iterdir())


def test_no_scene_of_the_plane_is_read_as_one_of_space(tmp_path: Path) -> None:
    saved = short_run("chain-2")
    twin: Scene = saved.scene.model_copy(update={"space": "space"})
    lied = Trajectory(twin, system_of(twin), saved.times, saved.motion, saved.run)
    recordings.save(lied, tmp_path / "run.npz")
    with pytest.raises(SceneError, match="is not a trajectory"):
        recordings.load(tmp_path / "run.npz")


def test_a_csv_is_a_plain_table_with_its_record_beside_it(tmp_path: Path) -> None:
    """The first line names columns; files with the record on their first line are read too, a table alone is not."""
    for name in ("chain-1", "paper-cart-1", "tower"):
        saved, path = short_run(name), tmp_path / f"{name}.csv"
        recordings.save(saved, path)
        table = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
        assert list(table.dtype.names or ()) == list(saved.to_dict())
        assert all(np.any(table[column]) for column in saved.to_dict() if column != "work_J")
        (tmp_path / "before.csv").write_bytes(with_record(path))
        for written in (path, tmp_path / "before.csv"):
            read = recordings.load(written)
            assert all(np.array_equal(column, read.to_dict()[key]) for key, column in saved.to_dict().items())
        path.with_name(f"{path.name}.json").unlink()
        with pytest.raises(SceneError, match=rf"{name}\.csv: has no record: {name}\.csv\.json must be next to it"):
            recordings.load(path)


@pytest.mark.parametrize("name", ["run.csv", "cart.csv"])
def test_files_of_earlier_are_read(name: str) -> None:
    """Saved before, with the record on the first line and a column for a cart on every support."""
    read = recordings.load(Path(__file__).parent / "written" / name)
    assert read.to_dict()["theta_1_1_rad"][0] == pytest.approx(np.radians(read.scene.pendulum[0].start.angles_deg[0]))
    assert {"x_m"} & {*read.to_dict()} == ({"x_m"} if name == "cart.csv" else set())
