"""The commands poles, mac and fit with measured modes, and those that continue from a covariance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from multipendula.cli import main

ARMS = """
gravity = 9.81

[[pendulum]]
links = [
  { kind = "rod", mass = 0.2, length = 0.3, damping = 0.001 },
  { kind = "rod", mass = 0.1, length = 0.25, damping = 0.0005 },
]
start = { angles_deg = [0.3, 0.6] }
"""
CRANE = """
gravity = 9.81

[support]
kind = "cart"
mass = 2.0

[[pendulum]]
links = [{ kind = "bob", mass = 0.5, length = 0.4, damping = 0.002 }]
start = { angles_deg = [10] }
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arms.toml").write_text(ARMS)
    (tmp_path / "crane.toml").write_text(CRANE)
    places = {"pendulum[0].links[0].length": 0.4, "support.mass": 2.0}
    stds = np.array([0.002, 0.05])
    covariance = np.outer(stds, stds) * [[1.0, 0.3], [0.3, 1.0]]
    parameters = [
        {"place": path, "value": value, "std": std} for (path, value), std in zip(places.items(), stds, strict=True)
    ]
    (tmp_path / "fit.json").write_text(json.dumps({"parameters": parameters, "covariance": covariance.tolist()}))
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert main(words) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert main(words) == 2
    told = capsys.readouterr()
    assert told.out == ""
    return told.err


def test_a_record_becomes_modes_modes_become_numbers_and_these_a_table(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said(capsys, "simulate", "arms.toml", "--duration", "20", "-o", "run.csv")
    identified = json.loads(
        said(capsys, "poles", "run.csv", "--identified-modes", "modes.csv", "-o", "p.png", "--format", "json")
    )
    table = json.loads(said(capsys, "table", "arms.toml", "--format", "json"))["modes"]
    for mode, row in zip(identified["modes"], table, strict=True):
        assert mode["frequency_hz"] == pytest.approx(row["frequency_hz"], rel=1e-4)
        assert mode["damping_ratio"] == pytest.approx(row["damping_ratio"], rel=1e-2)
    compared = json.loads(said(capsys, "poles", "modes.csv", "--scene", "arms.toml", "-o", "m.svg", "--format", "json"))
    assert [(pair["measured"], pair["computed"]) for pair in compared["pairs"]] == [(1, 1), (2, 2)]
    assert min(pair["mac"] for pair in compared["pairs"]) > 0.9999
    assert json.loads(said(capsys, "poles", "run.csv", "--scene", "arms.toml", "--format", "json")) == compared
    longer = ARMS.replace("length = 0.3", "length = 0.33").replace("length = 0.25", "length = 0.23")
    (folder / "guess.toml").write_text(longer)
    report = json.loads(
        said(
            capsys,
            *("fit", "guess.toml", "modes.csv", "--free", "pendulum[0].links[*].length", "--format", "json"),
            *("-o", "fitted.toml", "--report", "r.json", "--picture", "f.pdf"),
        )
    )
    assert report == json.loads((folder / "r.json").read_text())
    keys = {"parameters", "fixed", "combinations", "unidentifiable", "segments", "covariance", "verdict", "modes"}
    assert keys <= report.keys()
    assert [parameter["value"] for parameter in report["parameters"]] == pytest.approx([0.3, 0.25], rel=1e-3)
    again = json.loads(said(capsys, "table", "fitted.toml", "--covariance", "r.json", "--format", "json"))["modes"]
    for row in again:
        assert row["omega_std_rad_per_s"] > 0
        assert row["frequency_std_hz"] == pytest.approx(row["omega_std_rad_per_s"] / (2 * np.pi))
        assert row["damping_ratio_std"] > 0
    assert {path.name for path in folder.iterdir()} >= {"p.png", "m.svg", "f.pdf"}


def test_without_a_covariance_a_table_has_no_such_columns(capsys: pytest.CaptureFixture[str]) -> None:
    plain, banded = (
        said(capsys, "table", "crane.toml", *more, "--format", "csv").splitlines()
        for more in ((), ("--covariance", "fit.json"))
    )
    assert "std" not in plain[0]
    assert {"omega_std_rad_per_s", "frequency_std_hz", "damping_ratio_std"} <= {*banded[0].split(",")}
    assert "± (rad/s)" in said(capsys, "table", "crane.toml", "--covariance", "fit.json")
    assert r"$\pm\zeta$" in said(capsys, "table", "crane.toml", "--covariance", "fit.json", "--format", "latex")


def test_a_growing_mode_has_a_standard_deviation_of_its_rate_but_of_no_frequency(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = {"parameters": [{"place": "gravity", "value": 9.81, "std": 0.01}], "covariance": [[1e-4]]}
    (folder / "g.json").write_text(json.dumps(record))
    rows = json.loads(said(capsys, "table", "cart-upright", "--covariance", "g.json", "--format", "json"))["modes"]
    for row in rows:
        assert (row["frequency_std_hz"] is None) == (row["frequency_hz"] is None)
        assert row["omega_std_rad_per_s"] == pytest.approx(row["omega_rad_per_s"] * 0.01 / 9.81 / 2, abs=1e-12)
    assert any(row["frequency_hz"] is None for row in rows)


def test_responses_and_shapers_have_a_band(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("response", "crane.toml", "--input", "cart_force", "--covariance", "fit.json", "--at", "0.3,1")
    words += ("-o", "b.png", "--format", "json")
    assert all(std > 0 for stds in json.loads(said(capsys, *words))["magnitude_std"].values() for std in stds)
    assert (folder / "b.png").read_bytes().startswith(b"\x89PNG")
    assert "residual vibration" in said(capsys, "shaper", "crane.toml", "--covariance", "fit.json")
    told = refused(capsys, "response", "crane.toml", "--covariance", "fit.json", "--impulse", "-o", "b.png")
    assert "not to --impulse" in told


def test_motions_have_a_band(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("crane.toml", "--covariance", "fit.json", "--duration", "0.5")
    assert "band of 200 members" in said(capsys, "simulate", *words, "--band", "band.png")
    assert (folder / "band.png").exists()
    record = json.loads(said(capsys, "spread", *words, "--members", "50", "--format", "json"))
    assert record["fitted"] == ["pendulum[0].links[0].length", "support.mass"]
    told = said(capsys, "simulate", *words, "--start", "angles:5")
    assert "band of 200 members" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("table", "crane.toml", "--covariance", "crane.toml"), "is a scene, not a JSON report of fit"),
        (("table", "arms.toml", "--covariance", "fit.json"), "is not a number of this scene"),
        (("simulate", "crane.toml", "--band", "b.png"), "--band: needs --covariance FIT.json"),
        (("simulate", "crane.toml", "--covariance", "fit.json", "--keep-modes", "1"), "cannot be combined"),
        (("simulate", "run.npz", "--covariance", "fit.json"), "is a saved run"),
        (("poles", "crane.toml"), "is a scene, not a CSV table: the scene comes first"),
        (("poles", "missing.csv"), "No such file"),
        (("poles", "fit.json", "--scene", "crane.toml"), "is JSON, not a CSV table"),
        (("fit", "crane.toml", "modes.csv", "--free", "gravity", "--scale"), "--scale: applies to measured motions"),
        (("fit", "crane.toml", "modes.csv", "modes.csv", "--free", "gravity"), "from a single file"),
    ],
)
def test_a_mistake_is_told_in_one_message(
    folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], told: str
) -> None:
    (folder / "modes.csv").write_text("mode,frequency_hz,std_hz\n2,0.9,0.01\n")
    printed = refused(capsys, *words)
    assert told in printed
    assert "Traceback" not in printed


def test_relative_angles_are_summed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = 0.02 * np.arange(600)
    upper = 0.1 * np.exp(-0.05 * times) * np.cos(5 * times)
    rows = np.column_stack((times, upper, 0.5 * upper))
    np.savetxt(folder / "r.csv", rows, delimiter=",", header="time_s,theta_1_1_rad,theta_1_2_rad", comments="")
    for angles, ratio in (("absolute", 0.5), ("relative", 1.5)):
        shape = json.loads(said(capsys, "poles", "r.csv", "--angles", angles, "--format", "json"))["modes"][0]["shape"]
        assert shape[1][0] / shape[0][0] == pytest.approx(ratio, rel=1e-6)
