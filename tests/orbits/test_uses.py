"""Where periodic orbits are compared with the table, a check and a run."""

from __future__ import annotations

import csv
import io
from math import degrees, inf, radians
from pathlib import Path

import numpy as np
import pytest

from modal import Pendulum, Rod, Scene, dump, load, natural_modes
from modal.errors import ComputationError
from multipendula.cli import main
from nonlinear.orbits import at_amplitude, mode_orbit, nonlinear_mode, orbit_where_off
from nonlinear.simulation import simulate
from nonlinear.system import State
from nonlinear.verification import check


def rods(lower: float) -> Scene:
    return Scene(gravity=9.81, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0), Rod(mass=1.0, length=lower))),))


def angles(text: str) -> dict[str, float]:
    return {row["mode"]: float(row["linear_to_1_percent_deg"] or inf) for row in csv.DictReader(io.StringIO(text))}


@pytest.mark.parametrize(("lower", "truth"), [(0.596761, 31.07), (0.674588, 26.40)])
def test_the_table_replaces_the_angle_of_1_percent_of_starred_modes_alone(
    lower: float, truth: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rods.toml"
    dump(rods(lower), path)
    assert main(["table", str(path), "--format", "csv"]) == 0
    guide = angles(capsys.readouterr().out)
    assert main(["table", str(path), "--format", "csv", "--orbits"]) == 0
    exact = angles(capsys.readouterr().out)
    assert exact["1"] == pytest.approx(truth, abs=0.01)
    assert guide["1"] != pytest.approx(truth, abs=0.5)
    assert exact["2"] == guide["2"]


def test_the_orbit_that_is_1_percent_off_is_so() -> None:
    orbit = orbit_where_off(load("chain-2"), 1)
    assert orbit is not None
    assert abs(orbit.omega / natural_modes(load("chain-2")).omega[0] - 1) == pytest.approx(0.01, abs=1e-9)


def test_a_check_has_the_backbone_beside_the_runs() -> None:
    (row,) = check(load("chain-2"), [0], (2.0, 20.0), periods=20).rows
    branch = nonlinear_mode(load("chain-2"), 1, radians(25), locate=False)
    for run in row.measurements:
        orbit = at_amplitude(branch, run.effective)
        assert orbit is not None
        assert row.exact(run) == pytest.approx(orbit.omega / natural_modes(load("chain-2")).omega[0] - 1, rel=1e-7)
    small, large = row.measurements
    assert small.shift == pytest.approx(row.exact(small), rel=1e-3)
    assert large.shift == pytest.approx(row.exact(large), rel=0.05)
    assert large.shift != pytest.approx(row.exact(large), rel=1e-3)


@pytest.mark.parametrize(("name", "number", "angle"), [("chain-2", 2, 60.0), ("paper-cart-2", 3, -40.0)])
def test_a_start_on_an_orbit_returns_and_reaches_its_angle(
    name: str, number: int, angle: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.csv"
    orbit = mode_orbit(load(name), number, radians(abs(angle)))
    words = ["--start", f"orbit:{number}:{angle:g}", "--duration", repr(3 * orbit.period), "--samples", "601"]
    assert main(["simulate", name, *words, "--tolerance", "1e-11", "-o", str(path)]) == 0
    capsys.readouterr()
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    turned = np.array(
        [[float(value) for key, value in row.items() if key.startswith("theta_") and "dot" not in key] for row in rows]
    )
    assert turned[0] == pytest.approx(turned[-1], abs=1e-7)
    assert degrees(np.abs(turned).max()) == pytest.approx(abs(angle), rel=1e-3)
    assert np.sign(turned[0]) == pytest.approx(np.sign(angle) * np.sign(orbit.state.links))


def test_a_start_beyond_the_branch_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "chain-2", "--start", "orbit:3:20"]) == 2
    assert main(["simulate", "chain-2", "--start", "orbit:1:200"]) == 2
    assert main(["simulate", "chain-2", "--start", "orbit:1"]) == 2
    assert capsys.readouterr().out == ""


def test_an_orbit_of_a_mode_is_more_periodic_than_the_mode() -> None:
    scene, orbit = load("chain-2"), mode_orbit(load("chain-2"), 1, radians(60))
    shape = np.real(natural_modes(scene).shape(0).angles)
    start = State(radians(60) * shape / np.abs(shape).max(), np.zeros(2))
    away = []
    for state in (orbit.state, start):
        run = simulate(scene, orbit.period, start=state, output=[0.0, orbit.period], tolerance=1e-11)
        away.append(np.abs(run.motion.links[-1] - state.links).max())
    assert away[0] < 1e-8 < 1e-2 < away[1]


def test_an_angle_that_no_orbit_has_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonlinear.orbits.modes.DENSE_BRANCH_ORBITS_MAX", 3)
    with pytest.raises(ComputationError, match="do not reach"):
        mode_orbit(load("chain-2"), 1, radians(100))
