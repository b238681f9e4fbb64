"""The command orbits: its numbers are those of the library, its files whole, its refusals in one message."""

from __future__ import annotations

import csv
import io
import json
from math import radians
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from modal import load, natural_modes
from modal.scene.files import example_text
from multipendula.cli import main
from nonlinear.orbits import nonlinear_mode


def told(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["orbits", *words]) == 0
    return capsys.readouterr().out


def test_json_has_the_promised_keys_and_the_librarys_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    record = json.loads(told(capsys, "chain-2", "--mode", "2", "--largest-angle", "70", "--format", "json"))
    branch = nonlinear_mode(load("chain-2"), 2, radians(70))
    assert list(record) == ["branches", "special"]
    (entry,) = record["branches"]
    assert entry["from"] == "mode 2"
    keys = ["parameter", "amplitude_deg", "energy_J", "omega_rad_per_s", "stable", "floquet", "residual"]
    assert all(list(point) == keys for point in entry["points"])
    assert [point["omega_rad_per_s"] for point in entry["points"]] == pytest.approx(branch.omega.tolist(), rel=1e-12)
    assert entry["points"][-1]["amplitude_deg"] == pytest.approx(70, abs=1e-8)
    last = [complex(*pair) for pair in entry["points"][-1]["floquet"]]
    assert len(last) == 4
    assert np.prod(last).real == pytest.approx(1.0, abs=1e-7)
    assert [point["stable"] for point in entry["points"]] == list(branch.is_stable)
    (special,) = record["special"]
    assert special["kind"] == "branch point"
    assert special["amplitude_deg"] == pytest.approx(61.95, abs=0.01)


def test_csv_has_a_line_for_every_orbit_along_a_number(capsys: pytest.CaptureFixture[str]) -> None:
    text = told(capsys, "metronomes", "--vary", "support.mass=0.5:1:2", "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0])[:5] == ["support.mass_kg", "omega_rad_per_s", "stable", "largest_angle_deg", "growth_per_s"]
    values = {number: [float(row["support.mass_kg"]) for row in rows if row["branch"] == number] for number in "12"}
    assert all(min(column) == 0.5 and max(column) == pytest.approx(1.0) for column in values.values())
    assert {row["stable"] for row in rows} == {"0", "1"}


def test_a_run_may_be_the_beginning(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--vary", "support.mass=0.5:0.6:2", "--settled", "--start", "mode:4:40", "--duration", "60")
    record = json.loads(told(capsys, "metronomes", *words, "--format", "json"))
    (branch,) = record["branches"]
    assert branch["from"] == "start"
    assert all(point["stable"] for point in branch["points"])


def test_a_mode_of_one_amplitude_along_gravity_keeps_its_shape_and_scales_its_frequency(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ("--mode", "2", "--largest-angle", "40", "--vary", "gravity=5:20:2", "--format", "json")
    record = json.loads(told(capsys, "chain-2", *words))
    points = record["branches"][0]["points"]
    assert points[-1]["parameter"] == pytest.approx(20.0)
    assert [point["amplitude_deg"] for point in points] == pytest.approx([40.0] * len(points), abs=1e-6)
    scaled = [point["omega_rad_per_s"] / point["parameter"] ** 0.5 for point in points]
    assert scaled == pytest.approx([scaled[0]] * len(points), rel=1e-8)
    assert record["special"] == []


def test_the_text_names_special_points_and_entered_branches(capsys: pytest.CaptureFixture[str]) -> None:
    text = told(capsys, "chain-2", "--mode", "2", "--largest-angle", "66", "--enter")
    assert "branch point at 61.946°" in text
    assert "branch 2, from branch point of mode 2" in text
    linear = natural_modes(load("chain-2"))[1].omega
    assert f"{linear:.5f}"[:4] in text


def test_figure_and_film_are_written_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure, film = tmp_path / "a.png", tmp_path / "a.gif"
    told(capsys, "chain-1", "--mode", "1", "--largest-angle", "60", "-o", str(figure), "--film", str(film))
    with Image.open(figure) as shown, Image.open(film) as moving:
        assert shown.width > 500
        assert getattr(moving, "n_frames", 1) > 50


@pytest.mark.parametrize(
    "words",
    [
        ["chain-2", "--mode", "1", "--vary", "gravity=1:2:2", "--enter"],
        ["chain-2", "--mode", "1", "--vary", "gravity=1:2:2", "--settled"],
        ["chain-2", "--mode", "3"],
        ["chain-spatial", "--mode", "1"],
        ["chain-spatial", "--vary", "gravity=5:10:2", "--settled", "--start", "mode:1:5"],
        ["chain-2", "--mode", "1", "--start", "mode:1:5"],
        ["huygens", "--vary", "support.mass=3"],
        ["huygens", "--vary", "support.mas=1:3:2"],
        ["huygens", "--mode", "2"],
        ["chain-2", "--mode", "1", "-o", "a.doc"],
    ],
)
def test_bad_input_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["orbits", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("multipendula: ")


def test_what_the_orbits_of_a_mode_leave_out_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["orbits", "metronomes", "--mode", "4", "--largest-angle", "2"]) == 0
    said = capsys.readouterr().err
    assert "Dampers are omitted" in said
    assert "Drives are omitted" in said
    assert main(["orbits", "chain-2", "--mode", "1", "--largest-angle", "2"]) == 0
    assert not capsys.readouterr().err


SHAKEN = "shaken-pendulum"
KAPITZA = "kapitza"
GENTLE = ("--vary", "support.motion.amplitude=0.001:0.0012:2")


def test_motions_under_drives_have_columns_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    rows = list(csv.DictReader(io.StringIO(told(capsys, SHAKEN, *GENTLE, "--format", "csv"))))
    assert [float(rows[at]["support.motion.amplitude_m"]) for at in (0, -1)] == pytest.approx([0.001, 0.0012])
    for row in rows:
        assert (row["cycles"], row["whole_turns"], row["neutral"]) == ("1", "0", "0")
        assert float(row["period_s"]) == pytest.approx(1 / 0.475)
        assert -12 < float(row["phase_deg"]) < -6
        assert float(row["fed_J"]) > 0
    ((branch,), special) = json.loads(told(capsys, SHAKEN, *GENTLE, "--format", "json")).values()
    assert special == []
    assert [point["fed_J"] for point in branch["points"]] == [float(row["fed_J"]) for row in rows]
    assert branch["points"][0]["whole_turns"] == [0]


def test_a_run_that_settles_on_twice_the_period_begins_a_branch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "vertical.toml"
    text = example_text(SHAKEN).replace('"sine"', '"sine", direction = "vertical"').replace("0.475", "1.0")
    scene.write_text(text)
    begun = ("--settled", "--start", "angles:30", "--duration", "150", "--periods", "2", "--format", "json")
    record = json.loads(told(capsys, str(scene), "--vary", "support.motion.amplitude=0.05:0.051:2", *begun))
    first = record["branches"][0]["points"][0]
    assert (first["cycles"], first["stable"], first["phase_deg"]) == (2, True, None)
    assert first["period_s"] == pytest.approx(2.0)
    assert first["amplitude_deg"] > 10


def test_branches_that_leave_a_motion_under_drives_are_entered_and_told(capsys: pytest.CaptureFixture[str]) -> None:
    text = told(capsys, KAPITZA, "--vary", "support.motion.amplitude=0.01:0.0101:2", "--enter", "--depth", "2")
    assert [word.split()[1] for word in text.splitlines() if word.startswith("branch ")] == ["1,", "point", "2,"]
    assert "branch point" in text
    assert "0.010074551" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((SHAKEN, *GENTLE, "--depth", "2"), "--depth: needs --enter"),
        ((SHAKEN, "--mode", "1", "--periods", "2"), "--periods: needs --vary"),
        (("chain-2", "--vary", "gravity=9:10:2", "--periods", "2"), "--periods: needs a [[force]]"),
        (("metronomes", "--vary", "support.mass=1:2:2", "--start", "mode:4:5"), "--start: needs --settled"),
    ],
)
def test_options_of_drives_need_drives(words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["orbits", *words]) == 2
    assert said in capsys.readouterr().err


def test_a_film_begins_on_the_motion_that_repeats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.csv"
    words = ["simulate", SHAKEN, "--start", "orbit", "--duration", str(1 / 0.475), "--samples", "2", "-o", str(path)]
    assert main([*words, "--tolerance", "1e-11", "-q"]) == 0
    first, last = list(csv.DictReader(path.read_text().splitlines()))
    for name in ("theta_1_1_rad", "theta_dot_1_1_rad_per_s"):
        assert float(last[name]) == pytest.approx(float(first[name]), abs=1e-9)
    assert main(["simulate", "chain-2", "--start", "orbit", "--duration", "1"]) == 2
    assert "nothing drives this scene" in capsys.readouterr().err
