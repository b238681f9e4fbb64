"""What a result shows at the prompt is how its command begins, on a terminal of as many columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest

import modal
from modal.coupling import explain
from modal.identification import compare_modes, fit_modes, read_modes
from modal.loci import follow_loci
from modal.modes import natural_modes
from modal.report import NOTHING, WIDTH, fitted
from modal.scene import Bob, Cart, Pendulum, RecordMotion, Scene
from modal.scene.parameters import parse_variations
from modal.scene.records import Spectrum
from modal.statespace import modal_gains, state_space
from modal.statespace.hoisting import frequencies_along
from modal.tuning import tune
from modal.vibration import random_response, shock_response, thermal_noise
from multipendula.cli import main
from nonlinear.accuracy import list_candidates, measure_frequencies, measure_work_precision
from nonlinear.chaos import lyapunov_exponent, study
from nonlinear.chaos.studies import Finding, level_starts
from nonlinear.ensembles import (
    Compilation,
    CompiledCode,
    find_basins,
    find_bifurcations,
    find_section,
    find_strobes,
)
from nonlinear.identification import Recording, Segment, Sensor, fit
from nonlinear.orbits import nonlinear_mode
from nonlinear.simulation import advise, simulate
from nonlinear.sweeps import Study, find_spread, parse_measures, sweep
from nonlinear.synchronization import SynchronizationStudy, follow_branches, phases_of
from nonlinear.verification import check, compare

FILES = {
    "modes.csv": "mode,frequency_hz,std_hz\n1,0.38,0.001\n2,0.92,0.002\n",
    "driven.toml": """gravity = 9.81
force = [{on = "pendulum[0].links[0]", kind = "sine", amplitude = 1.0, frequency_hz = 0.5}]
pendulum = [{links = [{kind = "bob", mass = 1.0, length = 1.0, damping = 2.0}], start = {angles_deg = [20.0]}}]
""",
    "psd.csv": "frequency_hz,psd\n0.1,1e-3\n10,1e-3\n",
    "record.csv": "time_s,acceleration_m_per_s2\n0,0\n0.1,1\n0.2,1\n0.3,0\n",
    "swing.csv": "time_s,theta_1_1_rad\n" + "".join(f"{k / 20},{0.1 * np.cos(3.13 * k / 20)}\n" for k in range(40)),
}
ALONE: dict[str, Any] = {"engine": "numpy", "workers": 1, "check": 0}
MASS = "support.mass=10:11:2"
LENGTH = "pendulum[0].links[0].length"


def swing() -> Any:
    times = np.arange(40) / 20
    segment = Segment("swing.csv", "", times, 0.1 * np.cos(3.13 * times)[:, None])
    return fit(modal.load("chain-1"), Recording((Sensor(1, 1),), (segment,)), ["gravity"])


def tuned() -> Any:
    bob = Bob(mass=0.5, length=2.0, damping=0.4)
    tower = Scene(gravity=9.81, support=Cart(mass=10.0, stiffness=40.0), pendulum=[Pendulum(links=[bob])])
    return tune(tower, ["pendulum[0].links[0].damping"], minimize=["settling"])


def undriven() -> SynchronizationStudy:
    run = simulate(modal.load("paper-cart-2"), 2.0)
    return SynchronizationStudy(run.scene, None, "nothing drives it", run, phases_of(run), None, "it is too short")


def finding() -> Finding:
    whole = study("001", quick=True)
    cases = whole.cases[:1]
    exponents = tuple(lyapunov_exponent(case.scene, 7.0, starts=level_starts(case.scene, 2)) for case in cases)
    return Finding(replace(whole, cases=cases), exponents)


SHOWN: dict[str, tuple[str, Callable[[], Any]]] = {
    "table paper-cart-2": ("modal.modes:natural_modes", lambda: natural_modes(modal.load("paper-cart-2"))),
    "table chain-2": ("modal.modes:natural_modes", lambda: natural_modes(modal.load("chain-2"))),
    "explain paper-cart-2": ("modal.coupling:explain", lambda: explain(modal.load("paper-cart-2"))),
    "explain two-swings": ("modal.coupling:explain", lambda: explain(modal.load("two-swings"))),
    f"sweep crane-two-loads --vary {LENGTH}=5:20:3 --loci": (
        "modal.loci:follow_loci",
        lambda: follow_loci(modal.load("crane-two-loads"), parse_variations([f"{LENGTH}=5:20:3"])[0]),
    ),
    "response crane-hook --gains": (
        "modal.statespace:modal_gains",
        lambda: modal_gains(natural_modes(modal.load("crane-hook")), state_space(modal.load("crane-hook"))),
    ),
    "hoist hoisting-crane --samples 3": (
        "modal.statespace.hoisting:frequencies_along",
        lambda: frequencies_along(modal.load("hoisting-crane"), 3),
    ),
    "vibration crane-hook --psd psd.csv": (
        "modal.vibration:random_response",
        lambda: random_response(modal.load("tower"), Spectrum((0.1, 10.0), (1e-3, 1e-3), "acceleration")),
    ),
    "vibration tower --temperature 290": (
        "modal.vibration:thermal_noise",
        lambda: thermal_noise(modal.load("tower"), 290.0, ("tip_positions",)),
    ),
    "vibration tower --record record.csv": (
        "modal.vibration:shock_response",
        lambda: shock_response(
            modal.load("tower"), RecordMotion(time_s=(0.0, 0.1, 0.2, 0.3), acceleration_m_per_s2=(0.0, 1.0, 1.0, 0.0))
        ),
    ),
    f"tune crane-hook --free {LENGTH} --minimize damping": ("modal.tuning:tune", tuned),
    "poles modes.csv --scene chain-2": (
        "modal.identification:compare_modes",
        lambda: compare_modes(natural_modes(modal.load("chain-2")), read_modes(modal.load("chain-2"), "modes.csv")),
    ),
    f"fit chain-2 modes.csv --free {LENGTH} -o fitted.toml": (
        "modal.identification:fit_modes",
        lambda: fit_modes(modal.load("chain-2"), read_modes(modal.load("chain-2"), "modes.csv"), [LENGTH]),
    ),
    "fit chain-1 swing.csv --free gravity -o fitted.toml": ("nonlinear.identification:fit", swing),
    "orbits chain-1 --mode 1": (
        "nonlinear.orbits:nonlinear_mode",
        lambda: nonlinear_mode(modal.load("chain-1"), 1, radians(10.0)),
    ),
    "check chain-1 --modes 1": (
        "nonlinear.verification:check",
        lambda: check(modal.load("chain-1"), [0], [5.0], periods=20),
    ),
    "check chain-1 --general --duration 1": (
        "nonlinear.verification:compare",
        lambda: compare(simulate(modal.load("chain-1"), 10.0, output=301)),
    ),
    "chaos chain-2": (
        "nonlinear.chaos:lyapunov_exponent",
        lambda: lyapunov_exponent(modal.load("chain-2"), 7.0, ensemble=2),
    ),
    "chaos paper:001": ("nonlinear.chaos:measure", finding),
    "simulate chain-2 --duration 2": (
        "nonlinear.simulation:simulate",
        lambda: simulate(modal.load("chain-2"), 2.0),
    ),
    "advise chain-1 --accuracy 1e-2 --duration 1": (
        "nonlinear.simulation:advise",
        lambda: advise(modal.load("chain-1"), 1.0, accuracy=1e-2),
    ),
    "tradeoff chain-1 --linear": (
        "nonlinear.accuracy:measure_frequencies",
        lambda: measure_frequencies(modal.load("chain-1")),
    ),
    "tradeoff chain-1": (
        "nonlinear.accuracy:measure_work_precision",
        lambda: measure_work_precision(
            modal.load("chain-1"), 0.05, candidates=list_candidates(modal.load("chain-1"))[:1]
        ),
    ),
    "basins chain-2": (
        "nonlinear.ensembles:find_basins",
        lambda: find_basins(
            modal.load("chain-2"),
            0.5,
            vary=[f"pendulum[0].start.angles_deg[{k}]=-90:90:2" for k in (0, 1)],
            **ALONE,
        ),
    ),
    "section chain-2": (
        "nonlinear.ensembles:find_section",
        lambda: find_section(modal.load("chain-2"), 2.0, orbits=2, **ALONE),
    ),
    "section driven.toml": (
        "nonlinear.ensembles:find_strobes",
        lambda: find_strobes(modal.load("driven.toml"), 8.0, orbits=2, **ALONE),
    ),
    "spread chain-2 --uncertain gravity=0.1": (
        "nonlinear.sweeps:find_spread",
        lambda: find_spread(modal.load("chain-2"), ["gravity=0.1"], members=5),
    ),
    "sweep chain-1 --vary gravity=9,10": (
        "nonlinear.sweeps:sweep",
        lambda: sweep(
            Study(modal.load("chain-1"), parse_variations(["gravity=9,10"]), parse_measures(["frequencies"])), workers=1
        ),
    ),
    "sweep driven.toml --strobe --vary force[0].amplitude=1,2": (
        "nonlinear.ensembles:find_bifurcations",
        lambda: find_bifurcations(modal.load("driven.toml"), "force[0].amplitude=1,2", settle=2.0, **ALONE),
    ),
    "simulate chain-2 --compile": (
        "nonlinear.ensembles:compile_engines",
        lambda: Compilation(
            modal.load("chain-2"),
            (CompiledCode("one motion", "numba", "was ready", 0.01, "cache"), CompiledCode("one motion", "heyoka")),
        ),
    ),
    "sync metronomes": (
        "nonlinear.synchronization:study_synchronization",
        undriven,
    ),
    f"sync huygens --vary {MASS}": (
        "nonlinear.synchronization:follow_branches",
        lambda: follow_branches(modal.load("huygens"), parse_variations([MASS])[0]),
    ),
}


def printed(command: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    assert main(command.split()) == 0
    return capsys.readouterr().out.rstrip("\n").split("\n")


def assert_begins(shown: str, lines: list[str]) -> None:
    """All lines that are shown are the first of those printed, but for a last one that says that more follow.

    A command may end with a sentence about its options, which no result has.
    """
    first = shown.split("\n")
    if first[-1].startswith("…"):
        first.pop()
        assert len(lines) > len(first)
    assert [line.rstrip() for line in first] == [line.rstrip() for line in lines[: len(first)]]


@pytest.mark.parametrize("command", SHOWN)
def test_a_result_shows_how_its_command_begins(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    door, make = SHOWN[command]
    result = make()
    monkeypatch.setattr(door.replace(":", "."), lambda *_, **__: result)
    monkeypatch.setattr("multipendula.cli._columns", lambda: WIDTH)
    assert_begins(repr(result), printed(command, capsys))


@pytest.mark.parametrize("name", ["paper-cart-2", "chain-3", "crane-two-loads"])
def test_a_mode_says_what_its_row_of_the_table_says(name: str) -> None:
    modes = natural_modes(modal.load(name))
    with fitted(WIDTH):
        _, _, _, rule, *rows = modes.table("text").split("\n")
    assert set(rule) == {"-", " "}
    for mode, row in zip(modes, rows, strict=False):
        cells = {cell.strip() for cell in row.split("  ")} - {"", "0", NOTHING}
        assert len(cells) > 2
        assert all(cell in repr(mode).replace("\n ", "") for cell in cells)


def test_the_comparison_bites() -> None:
    lines = ["a", "b", "c"]
    assert_begins("a\nb\n… 1 more", lines)
    for wrong in ("a\nc\n…", "b", "a\nb\nc\n…"):
        with pytest.raises(AssertionError):
            assert_begins(wrong, lines)
