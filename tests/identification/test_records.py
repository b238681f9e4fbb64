"""CSV files of measured motions: what is read, and one clear message for everything that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modal import load
from modal.errors import SceneError
from nonlinear.identification import parse_where, read_recording

GOOD = "time_s,theta_1_1_rad\n0,0.1\n0.1,0.05\n0.2,-0.02\n0.3,-0.1\n"
BAD = {
    "": "has no column time_s",
    "x,theta_1_1_rad\n0,1\n": "has no column time_s",
    "time_s,angle\n0,1\n": "has no column of a sensor",
    "time_s,theta_1_1\n0,1\n": "column theta_1_1: must be",
    "time_s,theta_1_1_mm\n0,1\n": "column theta_1_1_mm: must be",
    "time_s,theta_1_1_rad,theta_1_1_rad\n": "appears twice",
    "time_s,theta_1_1_rad,theta_1_1_deg\n0,1,1\n": "one sensor in two units",
    "time_s,theta_1_1_rad\n": "has no rows",
    "time_s,theta_1_1_rad\n0,1\n1,2,3\n": "line 3: must have 2 cells",
    "time_s,theta_1_1_rad\n0,a\n1,2\n": "line 2, theta_1_1_rad = 'a': must be a finite number",
    "time_s,theta_1_1_rad\n0,inf\n1,2\n": "must be a finite number",
    "time_s,theta_1_1_rad\n0,1\n,2\n1,1\n2,0\n": "a time is missing",
    "time_s,theta_1_1_rad\n0,1\n1,2\n1,3\n2,1\n": "the time does not increase after 1 s",
    "time_s,theta_1_1_rad\n0,1\n1,2\n": "has 2 rows, at least 4",
    GOOD.replace("-0.02", "180"): "if these are degrees, name it theta_1_1_deg",
    "time_s,theta_1_1_rad\n0,1\n1,1\n2,1\n3,1\n": "is constant, 1 rad",
    "time_s,theta_1_1_rad\n0,\n1,\n2,nan\n3,\n": "has no values",
    GOOD.replace("theta_1_1", "theta_2_1"): "the scene has 1 pendulum",
    GOOD.replace("theta_1_1", "theta_1_9"): "the pendulum has 2 links",
    GOOD.replace("theta_1_1_rad", "cart_m"): "column cart_m: the scene has no cart",
}


def read(path: Path, text: str | bytes, **more: object) -> object:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_recording(load("chain-2"), [path], **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", BAD)
def test_what_cannot_be_read_is_said(text: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path / "run.csv", text)
    assert BAD[text] in str(caught.value)


def test_files_that_are_none_and_bytes_that_are_no_text(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.csv: cannot be read: No such file"):
        read_recording(load("chain-2"), [tmp_path / "none.csv"])
    with pytest.raises(SceneError, match="UTF-8"):
        read(tmp_path / "run.csv", b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="not a file"):
        read_recording(load("chain-2"), [tmp_path])
    with pytest.raises(SceneError, match="no file"):
        read_recording(load("chain-2"), [])


def test_every_mistake_of_all_files_is_told_at_once(tmp_path: Path) -> None:
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    paths[0].write_text("t\n1\n")
    paths[1].write_text("time_s\n1\n")
    with pytest.raises(SceneError) as caught:
        read_recording(load("chain-2"), paths)
    assert len(caught.value.problems) >= 2
    assert {str(path) for path in paths} == {problem.split(":")[0] for problem in caught.value.problems}


def test_units_gaps_segments_and_rows_to_use(tmp_path: Path) -> None:
    rows = [
        f"{seg},{'yes' if seg != 'c' else 'no'},{k / 10},{k * k},{'' if k == 2 else k}"
        for seg in "abc"
        for k in range(5)
    ]
    text = "\n".join(["segment,use,time_s,theta_1_2_deg,theta_1_1_rad", *rows])
    recording = read(tmp_path / "run.csv", text, where=parse_where(["use=yes"]), angles="relative")
    assert [segment.name for segment in recording.segments] == ["a", "b"]  # type: ignore[attr-defined]
    assert [sensor.name for sensor in recording.sensors] == ["theta_1_1", "theta_1_2"]  # type: ignore[attr-defined]
    values = recording.segments[0].values  # type: ignore[attr-defined]
    assert values[:, 1] == pytest.approx(np.radians([0, 1, 4, 9, 16]))
    assert np.isnan(values[2, 0])
    assert recording.relative  # type: ignore[attr-defined]
    with pytest.raises(SceneError, match="column used: is missing"):
        read(tmp_path / "run.csv", text, where={"used": "yes"})
    with pytest.raises(SceneError, match="no rows with the requested values"):
        read(tmp_path / "run.csv", text, where={"use": "maybe"})
    with pytest.raises(SceneError, match="COLUMN=VALUE"):
        parse_where(["use"])
    with pytest.raises(SceneError, match="absolute or relative"):
        read(tmp_path / "run.csv", text, angles="bent")


def test_a_segment_stands_in_one_piece(tmp_path: Path) -> None:
    rows = [f"{seg},{k},{k % 3}" for seg in "aba" for k in range(5)]
    with pytest.raises(SceneError, match="segment a: its rows are not contiguous"):
        read(tmp_path / "run.csv", "\n".join(["segment,time_s,theta_1_1_rad", *rows]))
