"""The commands vibration and shock: their files, formats and refusals."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from seen import flaws

from modal import load
from modal.plotting.style import theme
from modal.plotting.vibration import random_figure, shock_figure
from modal.scene import RecordMotion
from modal.scene.records import read_record, read_spectrum
from modal.vibration import random_response, shock_response
from multipendula.cli import main

SUSPENSION, GROUND, QUAKE = "damped-suspension", "ground.csv", "quake.csv"


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    assert main(list(words)) == code
    captured = capsys.readouterr()
    return captured.err if code else captured.out


def test_vibration_in_every_format(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    response = random_response(load(SUSPENSION), read_spectrum(GROUND))
    text = said(capsys, "vibration", SUSPENSION, "--psd", GROUND)
    assert f"{response.rms[0]:.5g}" in text
    whole = json.loads(said(capsys, "vibration", SUSPENSION, "--psd", GROUND, "--format", "json"))
    assert [output["rms"] for output in whole["outputs"]] == pytest.approx(response.rms.tolist())
    psd = np.array([output["psd"] for output in whole["outputs"]])
    assert psd == pytest.approx(response.psd(np.array(whole["frequency_hz"])))
    assert np.trapezoid(psd[0], whole["frequency_hz"]) == pytest.approx(response.rms[0] ** 2, rel=0.2)
    to = tmp_path / "v.csv"
    said(capsys, "vibration", SUSPENSION, "--psd", GROUND, "--format", "csv", "-o", str(to))
    rows = list(csv.DictReader(io.StringIO(to.read_text())))
    rms = [float(row["value"]) for row in rows if row["quantity"] == "rms" and row["mode"] == "all"]
    assert rms == pytest.approx(response.rms.tolist())


def test_the_main_result_may_be_the_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words, picture = ("vibration", "suspension", "--temperature", "290", "--at", "1"), tmp_path / "p.svg"
    assert said(capsys, *words, "-o", str(picture)) == said(capsys, *words)
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    assert "as well as --picture" in said(capsys, *words, "-o", str(picture), "--picture", "a.png", code=2)
    assert "writes text or a figure" in said(capsys, *words, "-o", "a.gif", code=2)


def test_shock_in_every_format(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    response = shock_response(load(SUSPENSION), RecordMotion(**read_record(QUAKE)))
    text = said(capsys, "vibration", SUSPENSION, "--record", QUAKE)
    assert f"{response.peaks[0, 0]:.5g}" in text
    assert "account for 90 % of the mass" in text
    assert 'baseline = "velocity"' in text
    whole = json.loads(
        said(capsys, "vibration", SUSPENSION, "--record", QUAKE, "--format", "json", "--baseline", "velocity")
    )
    assert whole["modes"][-1]["cumulative_share"] == pytest.approx(1.0)
    assert len(whole["time_s"]) == len(whole["outputs"][0]["history"])
    rows = list(
        csv.DictReader(io.StringIO(said(capsys, "vibration", SUSPENSION, "--record", QUAKE, "--format", "csv")))
    )
    assert {row["quantity"] for row in rows} == {
        *("peak", "srss", "cqc", "effective_mass_share", "cumulative_share", "history")
    }


def test_undamped_modes_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, "vibration", "chain-2", "--psd", GROUND)
    assert "modes 1, 2 are undamped" in text
    assert "∞" in text
    whole = json.loads(said(capsys, "vibration", "chain-2", "--psd", GROUND, "--format", "json"))
    assert whole["outputs"][0]["rms"] is None
    assert whole["infinite"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("vibration", "chain-2", "--psd", QUAKE), "needs the columns frequency_hz"),
        (("vibration", "chain-2", "--psd", "no.csv"), "no.csv: cannot be read"),
        (("vibration", "chain-2", "--psd", "-1"), "--psd -1: must be a number of (m/s²)²/Hz above 0, or a file"),
        (("vibration", "chain-2", "--psd", "nan"), "--psd nan: must be a number of (m/s²)²/Hz above 0, or a file"),
        (("vibration", "chain-2", "--psd", "1", "--column", "x=y"), "--column: names columns of a file"),
        (("vibration", "chain-2", "--psd", GROUND, "--signals", "nothing"), "--signals nothing: must be one of"),
        (("vibration", "chain-2", "--psd", GROUND, "--signals", "cart_position"), "the support is fixed"),
        (("vibration", "chain-2", "--record", GROUND), "needs the columns time_s"),
        (("vibration", "chain-2", "--record", QUAKE, "--picture", "a.exe"), "--picture a.exe"),
    ],
)
def test_what_cannot_be_is_refused_in_a_word(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], expected: str
) -> None:
    error = said(capsys, *words, code=2)
    assert expected in error
    assert "Traceback" not in error


@pytest.mark.parametrize("colours", usually(["light"], ["light", "dark"]))
def test_the_pictures_are_whole(colours: str) -> None:
    scene = load(SUSPENSION)
    with theme(colours):
        assert flaws(random_figure(random_response(scene, read_spectrum(GROUND)))) == []
        record = RecordMotion(**read_record(QUAKE), baseline="velocity")
        assert flaws(shock_figure(shock_response(scene, record, ("angles", "tip_positions")))) == []


def test_a_film_shows_the_support_moving(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from nonlinear import simulate
    from nonlinear.plotting.scene import stage_of

    run = simulate(load("kapitza"), 0.2, output=41)
    at = np.linspace(0.0, 0.2, 5)
    stage = stage_of(run, at)
    support = run.system.support
    assert support is not None
    assert stage.actors[0].joints[:, 0, 1] == pytest.approx(support.motions[0][1].displacement(at))
    assert not said(capsys, "animate", "kapitza", "--duration", "0.2", "--seconds", "0.2",
                    "-o", str(tmp_path / "a.html")).startswith("multipendula")  # fmt: skip
    assert (tmp_path / "a.html").stat().st_size > 1000
