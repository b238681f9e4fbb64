"""The namespace: every command as a function, with its options as keywords."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import multipendula as mp
from multipendula.cli import main
from multipendula.commands import COMMANDS, command_named
from multipendula.functions import Text, _options_of, keyword_of

MOST = 120
FUNCTIONS = [command.name for command in COMMANDS if command.name != "completion"]
LENGTH = "pendulum[0].links[0].length"


def test_the_namespace_has_every_command_and_names_that_load() -> None:
    assert set(FUNCTIONS) < set(dir(mp))
    assert len(dir(mp)) <= MOST
    assert all(getattr(mp, name) is not None for name in dir(mp))
    with pytest.raises(AttributeError, match="has no attribute 'completions'"):
        getattr(mp, "completions")  # noqa: B009
    everything: dict[str, Any] = {}
    exec("from multipendula import *", everything)
    assert set(dir(mp)) < set(everything)


def test_importing_it_loads_nothing() -> None:
    code = "import sys; before = {*sys.modules}; import multipendula; print(*({*sys.modules} - before))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["multipendula"]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_keywords_are_the_options(name: str) -> None:
    command = command_named(name)
    assert command
    actions = command.page()._actions
    flags = [flag for action in actions for flag in action.option_strings if flag.startswith("--")]
    options = {"source" if flag == "--from" else flag[2:].replace("-", "_") for flag in flags}
    places = {action.dest for action in actions if not action.option_strings}
    function = getattr(mp, name)
    assert set(inspect.signature(function).parameters) == (options | places) - {"help", "quiet"}
    assert command.summary.split()[0] in function.__doc__
    assert not re.search(r"--[a-z]", function.__doc__)


def read(name: str, **keywords: Any) -> Namespace:
    command = command_named(name)
    assert command
    options = {keyword_of(taken): taken for taken in command.options}
    return _options_of(command.page(), [(options[word], value) for word, value in keywords.items()])


@pytest.mark.parametrize(
    ("line", "keywords"),
    [
        ("sweep chain-2 --vary gravity=9.0,10.5", {"vary": {"gravity": np.array([9.0, 10.5])}}),
        (f"sweep chain-2 --vary gravity=9,10 --vary {LENGTH}=1:2:3", {"vary": ["gravity=9,10", f"{LENGTH}=1:2:3"]}),
        ("sweep chain-2 --vary gravity=9,10 --loci --workers 2", {"vary": "gravity=9,10", "loci": True, "workers": 2}),
        ("check chain-2 --amplitudes 1,5.5", {"amplitudes": (1, 5.5)}),
        ("table chain-2 --modes 2:4 --columns +mode,omega", {"modes": range(2, 5), "columns": ["+mode", "omega"]}),
        ("table chain-2 --relative-error 1e-08", {"relative_error": np.float64(1e-8), "sensitivities": False}),
        ("tune chain-2 --free gravity --mode 1 --mode 2", {"free": "gravity", "mode": [1, 2]}),
        ("tune chain-2 --free gravity --over-hz 0.1:2", {"free": ("gravity",), "over_hz": (0.1, 2)}),
        ("basins chain-2 --share 1/4 --folder f", {"share": (1, 4), "folder": Path("f")}),
        ("simulate chain-2 --start angles:-10,20", {"start": "angles:-10,20", "duration": None}),
        ("response chain-2 --from joint_torque_1_1 -o r.png", {"source": "joint_torque_1_1", "output": Path("r.png")}),
    ],
)  # fmt: skip
def test_values_are_read_as_the_words_of_the_command_line(line: str, keywords: dict[str, Any]) -> None:
    name, *words = line.split()
    command = command_named(name)
    assert command
    told, expected = (
        {word: value for word, value in vars(options).items() if word not in {"page", "run", "command"}}
        for options in (read(name, scene="chain-2", **keywords), command.page().parse_args(words))
    )
    assert told == expected


def test_scenes_runs_and_states_are_taken_as_they_are(tmp_path: Path) -> None:
    scene = mp.load("chain-1")
    assert isinstance(scene, mp.Scene)
    assert mp.table(scene).omega.tolist() == mp.natural_modes(scene).omega.tolist()
    run = mp.simulate(scene, 0.5, samples=6, start=mp.state_at_rest(scene, [20.0]))
    assert len(run.times) == 6
    assert run.motion.links[0, 0] == pytest.approx(np.radians(20.0), rel=1e-15)
    longer = mp.simulate(run, 0.5)
    assert longer.times[-1] == 1.0
    mp.save(run, tmp_path / "run.npz")
    again = mp.load(tmp_path / "run.npz")
    assert isinstance(again, mp.Trajectory)
    assert again.motion.links.tolist() == run.motion.links.tolist()
    mp.save(scene, tmp_path / "scene.toml")
    assert mp.load(tmp_path / "scene.toml") == scene
    with pytest.raises(mp.SceneError, match="thing: a Scene is required, not int"):
        mp.save(cast("Any", 3), tmp_path / "x")


def test_notes_name_keywords(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    mp.orbits("chain-1", largest_angle=2)
    assert "mode 1: mode R follows another" in capsys.readouterr().err
    assert main(["orbits", "chain-1", "--largest-angle", "2", "-o", str(tmp_path / "o.csv")]) == 0
    assert "--mode R follows another" in capsys.readouterr().err


def test_figures_are_returned_unless_a_file_is_named(tmp_path: Path) -> None:
    figure = mp.shapes("chain-1", theme="dark")
    assert figure.get_facecolor()[:3] == pytest.approx((0x12 / 255, 0x18 / 255, 0x1D / 255))
    assert len(mp.plot("chain-1", 1).axes) == 4
    assert mp.shapes("chain-1", output=tmp_path / "s.png") == f"{tmp_path / 's.png'}: mode 1\n"


def test_text_is_returned_where_it_is_asked_for(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    text = mp.table("chain-1", format="csv")
    assert isinstance(text, Text)
    assert repr(text).startswith("mode,omega")
    assert repr(mp.scenes("chain-1")).startswith("title")
    assert mp.table("chain-1", output=tmp_path / "t.md").omega.size == 1
    assert (tmp_path / "t.md").read_text("utf-8").startswith("**A single bob")
    assert mp.explain("paper-cart-2", output=tmp_path / "e.json").scene == mp.load("paper-cart-2")
    assert (tmp_path / "e.json").read_text("utf-8").startswith("{")
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda: mp.sweep("chain-1", "mass=1,2"), mp.SceneError, "mass: is not a number of this scene"),
        (lambda: mp.simulate("chain-1", -1), mp.SceneError, "^duration: -1: must be a number of seconds above 0$"),
        (lambda: mp.orbits("chain-1", 1, depth=2), mp.SceneError, "^depth: needs enter$"),
        (
            lambda: mp.table("chain-1", modes=cast("Any", object())),
            mp.SceneError,
            "^modes <object.*>: must be a number",
        ),
        (lambda: mp.table("chain-1", output="t.png"), mp.SceneError, "^output t.png: this command writes text"),
        (lambda: cast("Any", mp.simulate)("chain-1", t_end=3), TypeError, r"'t_end' \(did you mean `duration`\?\)"),
        (lambda: mp.sweep("chain-1"), mp.SceneError, "^vary: is required, such as vary 'pendulum"),
        (lambda: mp.fit(*["chain-1"]), TypeError, "^fit: missing a required argument: 'data'$"),
    ],
)
def test_mistakes_are_told_with_keywords(call: Any, kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        call()
