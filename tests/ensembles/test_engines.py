"""Which engine runs: what is loaded, kept on disk and spent so far decide; folders and shares do not depend on it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fresh import Process

from modal import Bob, Pendulum, Scene, load
from modal.errors import SceneError, installing
from modal.scene import refusals
from nonlinear.dynamics import compiled as single
from nonlinear.ensembles import (
    Members,
    compilation_table,
    compile_engines,
    compiled,
    costs,
    ensemble,
    members_of,
)
from nonlinear.ensembles.costs import ENGINES, choose_engine, code_of, first_numbers
from nonlinear.ensembles.store import HEADER, Parts, engine_of_folder
from nonlinear.integration import taylor
from nonlinear.integration.readiness import Code, lose

pytestmark = pytest.mark.usefixtures("any_engine")

CHAIN, HUYGENS = load("chain-2"), load("huygens")
RUBBING = CHAIN.replace(pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, friction=0.1)])])


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Process:
    return Process(monkeypatch, tmp_path)


def members(size: int) -> Members:
    return members_of(CHAIN, np.zeros((size, 2)), None)


def chosen(size: int, *measures: str, **more: object) -> str:
    return choose_engine("auto", "", members(size), 10.0, 1e-9, measures, **more).engine


def code(engine: str, *measures: str) -> Code:
    compiled = code_of(engine, first_numbers(members(1)), measures)
    assert compiled
    return compiled


def test_an_engine_is_chosen_by_its_cost(process: Process) -> None:
    """Compiling does not pay for few members, but does for many."""
    assert chosen(10) == "numpy"
    assert chosen(1_000_000) == "numba"
    many = members(1_000_000)
    assert choose_engine("auto", "the scene is in space", many, 10.0, 1e-9).engine == "simulate"
    with pytest.raises(SceneError, match="one by one"):
        choose_engine("numba", "the scene is in space", many, 10.0, 1e-9)
    process.install()
    assert chosen(1_000_000) == "numpy"
    assert set(ENGINES) == {"numpy", "numba", "simulate"}


def test_the_engine_that_is_ready_runs(process: Process) -> None:
    """4000 double pendulums: with numba alone waiting for compilation does not pay, but ready code is used."""
    process.install("numba")
    assert chosen(4000) == "numpy"
    kernel = code("numba")
    process.keep(kernel.name)
    assert code("numba") == replace(kernel, kept=True)
    assert chosen(4000) == "numba"
    assert chosen(4000, "lyapunov") == "numpy"
    process.load("numba")
    process.ready(kernel.name)
    assert code("numba").is_ready
    assert chosen(1) == "numba"


def test_ensembles_in_a_loop_come_to_be_compiled(process: Process) -> None:
    process.install("numba")
    decision = choose_engine("auto", "", members(1000), 10.0, 1e-9)
    assert decision.engine == "numpy"
    assert [name for name, _ in decision.forgone] == [code("numba").name]
    lose(decision.forgone, 2.0)
    assert chosen(1000) == "numpy"
    lose(decision.forgone, 10.0)
    assert chosen(1000) == "numba"
    assert chosen(1000, anew=True) == "numpy"


def test_what_an_ensemble_has_taken_is_recorded(process: Process) -> None:
    process.install("numba")
    runs = ensemble(CHAIN, 5.0, starts=np.zeros((3, 2)), workers=1, check=0)
    assert runs.engine == "numpy"
    assert code("numba").saved_seconds > 0.0
    assert code("numba", "lyapunov").saved_seconds == 0.0


def test_codes_are_those_of_the_form_of_the_members(process: Process) -> None:
    """A number that differs belongs to the form where the scene has none; switches make kernels of their own."""
    first = code("numba")
    damped = members_of(CHAIN, None, {"pendulum[0].links[0].damping": [0.1, 0.2]})
    other = code_of("numba", first_numbers(damped))
    assert other
    assert other.name != first.name
    clocks = code_of("numba", first_numbers(members_of(HUYGENS, np.zeros((2, 2)), None)))
    assert clocks
    assert clocks.compiling > first.compiling + 5.0
    assert code("numba").name != code("numba", "lyapunov").name
    assert code("numba", "order") == code("numba")


def test_a_folder_goes_on_by_the_engine_it_was_begun_by(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"starts": np.ones((6, 2)), "chunk": 2, "workers": 1, "check": 0}
    folder = tmp_path / "begun"
    ensemble(CHAIN, 0.2, folder=folder, engine="numpy", **options)
    (folder / "part-000001.npz").unlink()
    monkeypatch.setattr(costs, "best_of", lambda offers, **more: "numba")
    runs = ensemble(CHAIN, 0.2, folder=folder, **options)
    assert (runs.engine, runs.reason) == ("numpy", "by which this folder was begun")
    assert engine_of_folder(folder) == "numpy"
    assert engine_of_folder(tmp_path) == ""
    for text in ("", "[]", "{}"):
        (tmp_path / HEADER).write_text(text)
        assert engine_of_folder(tmp_path) == ""
    with pytest.raises(SceneError, match="another ensemble"):
        ensemble(HUYGENS, 0.2, folder=folder, engine="numpy", **options)


def test_a_folder_of_the_engine_that_is_gone_is_read_and_not_continued(tmp_path: Path) -> None:
    options = {"starts": np.ones((4, 2)), "chunk": 2, "workers": 1, "check": 0}
    kept = ensemble(CHAIN, 0.2, engine="numpy", **options)
    parts = Parts(tmp_path, replace(kept.question, engine="heyoka"))
    for number, chunk in enumerate(kept.chunks):
        parts.keep(number, chunk)
    runs = ensemble(CHAIN, 0.2, folder=tmp_path, **options)
    assert (runs.engine, runs.reason) == ("heyoka", "by which this folder was begun")
    np.testing.assert_array_equal(runs.final.links, kept.final.links)
    parts.path(1).unlink()
    asks: list[Callable[[], object]] = [
        lambda: ensemble(CHAIN, 0.2, folder=tmp_path, **options),
        lambda: ensemble(CHAIN, 0.2, engine="heyoka", **options),
    ]
    for ask in asks:
        with pytest.raises(SceneError, match=r"^engine heyoka: is no longer there.*method taylor.*take auto"):
            ask()


def test_shares_do_not_depend_on_what_is_ready(process: Process) -> None:
    process.load("numba")
    process.ready(code("numba").name)
    options = {"starts": np.ones((6, 2)), "chunk": 2, "workers": 1, "check": 0}
    assert chosen(6) == "numba"
    assert ensemble(CHAIN, 0.2, share=(0, 2), **options).engine == "numpy"


# -------------------------------------------------------------------------------------------- compiled ahead of time


def test_what_cannot_be_compiled_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extras each is named; a scene that an engine does not take keeps its sentence from the table."""
    monkeypatch.setattr(single, "available", lambda: False)
    monkeypatch.setattr(compiled, "available", lambda: False)
    monkeypatch.setitem(sys.modules, "heyoka", None)
    monkeypatch.setattr(taylor, "_COMPILED", taylor.Originals())
    chain = compile_engines(CHAIN)
    assert [code.engine for code in chain.codes] == ["numba", "heyoka", "numba"]
    assert [code.runs for code in chain.codes] == ["one motion"] * 2 + ["many motions"]
    for code, extra in zip(chain.codes, ["fast", "taylor", "fast"], strict=True):
        assert code.action == code.kept_in == ""
        assert installing(extra) in code.why_not
    long = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=33)])])
    assert "minutes" in compile_engines(long).codes[2].why_not
    clocks = compile_engines(HUYGENS)
    assert clocks.codes[0].why_not in "; ".join(refusals(HUYGENS, "compiled equations"))
    assert compile_engines(RUBBING).codes[1].why_not in "; ".join(refusals(RUBBING, "method taylor"))
    table = json.loads(compilation_table(clocks, "json"))
    assert [code["why_not"] for code in table["codes"]] == clocks.to_dict()["why_not"].tolist()
    with pytest.raises(SceneError, match="no such measure"):
        compile_engines(CHAIN, measures=["nothing"])
    every = compile_engines()
    assert [code.runs for code in every.codes] == ["one motion", "one motion on a structure"]
    assert json.loads(compilation_table(every, "json"))["scene"] is None
    assert "give one" in compilation_table(every, "text")


def test_a_long_chain_is_not_compiled_for_minutes(process: Process) -> None:
    rope = load("rope")
    many = members_of(rope, np.zeros((10**4, rope.n_links)), None)
    assert choose_engine("auto", "", many, 100.0, 1e-9).engine == "numpy"
