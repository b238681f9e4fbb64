"""The command hoist, and what other commands say of a scene with a hoist."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from amounts import usually

from modal import load
from modal.statespace.hoisting import Travel, frequencies_along, travel_residuals
from multipendula.cli import main

CRANE = "hoisting-crane"


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(words) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(words) in {1, 2}
    streams = capsys.readouterr()
    assert streams.out == ""
    assert "Traceback" not in streams.err
    return streams.err


def test_csv_and_json_are_the_numbers_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    curve = frequencies_along(load(CRANE), 3)
    rows = list(csv.DictReader(io.StringIO(printed(capsys, "hoist", CRANE, "--samples", "3", "--format", "csv"))))
    assert [float(row["omega_2_rad_per_s"]) for row in rows] == curve.omega[:, 0].tolist()
    assert [float(row["length_1_1_m"]) for row in rows] == curve.lengths[:, 0].tolist()
    assert [float(row["swing_3"]) for row in rows] == curve.swing[:, 1].tolist()
    whole = json.loads(printed(capsys, "hoist", CRANE, "--samples", "3", "--format", "json"))
    assert whole["omega_rad_per_s"] == curve.omega.tolist()
    assert whole["modes"] == ["2", "3"]
    assert whole["links"] == [{"pendulum": 1, "link": 1}]
    assert whole["residual"] == []


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A short hoist."""
    path = tmp_path / "small.toml"
    hoist = "{ to = 1.0, duration = 2.0 }"
    link = f'{{ kind = "bob", mass = 1.0, length = 2.0, hoist = {hoist} }}'
    text = f'gravity = 9.81\n[support]\nkind = "cart"\nmass = 1.0\n[[pendulum]]\nlinks = [{link}]\n'
    path.write_text(text, encoding="utf-8")
    return path


def test_travel_is_that_of_the_package(capsys: pytest.CaptureFixture[str], small: Path) -> None:
    words = ("hoist", str(small), "--travel", "0.5", "--over", "1.5", "--samples", "2", "--format")
    left = travel_residuals(load(small), Travel(0.5, 0.0, 1.5))
    whole = json.loads(printed(capsys, *words, "json"))
    assert [residual["angle_deg"] for residual in whole["residual"]] == [
        np.degrees(residual.angle) for residual in left
    ]
    comments = [line for line in printed(capsys, *words, "csv").splitlines() if line.startswith("# residual swing")]
    assert len(comments) == 4
    target = small.with_name("along.csv")
    assert main([*words[:-1], "-o", str(target)]) == 0
    streams = capsys.readouterr()
    assert streams.out == ""
    assert f"along.csv: ω_1 {np.sqrt(9.81 / 2):.4g} to {np.sqrt(9.81):.4g} rad/s" in streams.err
    assert streams.err.count("residual swing") == 4
    notes = json.loads(target.with_name("along.csv.json").read_text(encoding="utf-8"))["notes"]
    assert target.read_text(encoding="utf-8").startswith("time_s,")
    assert [f"# {note}" for note in notes] == comments


def test_the_table_beside_a_travel_is_that_of_the_cart_that_it_prescribes(
    capsys: pytest.CaptureFixture[str], small: Path
) -> None:
    """√(g/l) of a pendulum on a fixed support; with the cart free ω is larger."""
    words = ("hoist", str(small), "--samples", "2")
    whole = json.loads(printed(capsys, *words, "--travel", "0.5", "--format", "json"))
    assert whole["drive"] == "cart_acceleration"
    assert np.ravel(whole["omega_rad_per_s"]) == pytest.approx(np.sqrt(9.81 / np.array([2.0, 1.0])))
    free = json.loads(printed(capsys, *words, "--format", "json"))
    assert np.ravel(free["omega_rad_per_s"]) == pytest.approx(np.sqrt(2 * 9.81 / np.array([2.0, 1.0])))
    assert "the cart's motion is prescribed" in printed(capsys, *words, "--travel", "0.5")
    assert "the cart is free" in printed(capsys, *words)
    told = refused(capsys, *words, "--travel", "0.5", "--drive", "cart_force")
    assert "--drive cart_force: a travel prescribes the motion of its cart" in told


def test_pictures_are_written_in_both_themes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for theme in usually(("dark",), ("light", "dark")):
        target = tmp_path / f"{theme}.svg"
        printed(capsys, "hoist", CRANE, "--samples", "2", "-o", str(target), "--theme", theme)
        assert "angular frequency" in target.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("hoist", "crane-hook"), "write hoist = { to = 6, duration = 10.0 } in pendulum[0].links[0]"),
        (("hoist", CRANE, "--over", "3"), "--over: needs --travel METRES"),
        (("hoist", CRANE, "-o", "a.doc"), "the name must end in"),
        (("export", CRANE, "--to", "json", "-o", "-"), "--to json: holds a constant model"),
        (("export", CRANE, "--to", "npz", "--minimal", "-o", "-"), "--minimal: needs constant lengths"),
        (("response", CRANE, "--gains"), "constant linear model"),
        (("response", CRANE, "--at", "1"), "a frequency response needs constant lengths"),
        (("simulate", CRANE, "--form", "hamiltonian"), "form hamiltonian"),
        (("simulate", CRANE, "--keep-modes", "1"), "needs constant lengths"),
        (("section", CRANE), "constant lengths"),
        (("sync", CRANE), "constant lengths"),
    ],
)
def test_mistakes_are_refused_in_a_sentence(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    told = refused(capsys, *words)
    assert message in told


def test_the_shaper_says_what_the_hoist_leaves_and_matrices_whose_they_are(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, small: Path
) -> None:
    assert "# along the hoist it leaves" in printed(capsys, "shaper", str(small))
    assert main(("matrices", CRANE)) == 0
    assert "lengths before it" in capsys.readouterr().err
    target = tmp_path / "model.npz"
    printed(capsys, "export", CRANE, "--to", "npz", "-o", str(target))
    with np.load(target) as read:
        assert read["A"].shape == (201, 6, 6)
        assert read["B"].shape == (201, 6, 1)
        assert read["time_s"][[0, -1]].tolist() == [0.0, 8.0]
