"""The command fit: its files, its JSON, its refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from seen import flaws

from modal import load
from modal.plotting.style import theme
from modal.scene import dump
from modal.scene.parameters import vary
from multipendula.cli import main
from nonlinear.identification import fit, read_recording
from nonlinear.plotting import fit_figure

DATA = Path(__file__).parents[2] / "notebooks" / "data"
SWING = str(DATA / "single_pendulum_free_swing.csv")
ARM = """gravity = 9.81
title = "One arm"
[[pendulum]]
[[pendulum.links]]
kind = "body"
mass = 0.1478
length = 0.3
centre = 0.1476
inertia = 7e-5
damping = 2e-4
friction = 5e-4
"""
KEYS = {
    "parameters",
    "fixed",
    "combinations",
    "unidentifiable",
    "segments",
    "rms_residual_rad",
    "covariance",
    "verdict",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.toml").write_text(ARM)
    return tmp_path


def test_a_fit_writes_a_scene_a_report_and_a_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "chain-2", "--duration", "3", "-o", "run.csv"]) == 0
    dump(vary(load("chain-2"), {"gravity": 9.5}), "wrong.toml")
    words = ["fit", "wrong.toml", "run.csv", "--free", "gravity", "-o", "fitted.toml", "--report", "fit.json"]
    assert main([*words, "--picture", "fit.png"]) == 0
    text = capsys.readouterr().out
    assert "gravity" in text
    assert load("fitted.toml").gravity == pytest.approx(9.81, abs=1e-6)
    report = json.loads((folder / "fit.json").read_text())
    assert report.keys() >= KEYS
    (parameter,) = report["parameters"]
    assert parameter["place"] == "gravity"
    assert parameter["value"] == load("fitted.toml").gravity
    assert report["covariance"] == [[pytest.approx(parameter["std"] ** 2)]]
    (segment,) = report["segments"]
    assert segment["initial"]["theta_1_1_rad"] == pytest.approx(np.radians(10), abs=2e-3)
    assert (folder / "fit.png").stat().st_size > 10_000


def test_a_scene_is_judged_on_new_data(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fit", "arm.toml", SWING, "--free", "none", "--format", "json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parameters"] == report["covariance"] == []
    assert report["rms_residual_rad"] == pytest.approx(report["segments"][0]["rms_residual_rad"])
    assert 1e-4 < report["rms_residual_rad"] < 1e-3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.csv", "--free", "gravity"], "none.csv: cannot be read: No such file"),
        ([SWING, "--free", "gravitas"], "did you mean gravity"),
        ([SWING, "--free", "gravity", "--where", "use"], "COLUMN=VALUE"),
        ([SWING, "--free", "gravity", "--where", "use=x"], "column use: is missing"),
        ([SWING, "--free", "gravity", "--prior", "gravity=9.8"], "PLACE=VALUE±STD"),
        ([SWING, "--free", "gravity", "--compare", "coulumb"], "did you mean coulomb"),
        ([SWING, "--free", "gravity", "-o", "nowhere/fitted.toml"], "there is no folder"),
        ([SWING, "--free", "gravity", "--picture", "fit.bmp"], "fit.bmp"),
    ],
)
def test_mistakes_are_one_message(
    words: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", "arm.toml", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert "Traceback" not in err
    assert sorted(path.name for path in folder.iterdir()) == ["arm.toml"]


@pytest.mark.parametrize("look", usually(["dark"], ["light", "dark"]))
def test_the_picture_has_no_flaws(look: str, folder: Path) -> None:
    scene = load("arm.toml")
    fitted = fit(scene, read_recording(scene, [SWING]))
    with theme(look):
        assert not flaws(fit_figure(fitted))
