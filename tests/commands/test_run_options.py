"""The options of a motion are one record: whoever simulates one takes the same, and does the same with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modal import load
from modal.errors import SceneError
from multipendula.cli import main
from multipendula.commands.runs import MOTION, RunOptions
from multipendula.parser import Page
from nonlinear import files
from nonlinear.accuracy import advice_table
from nonlinear.integration import modes_of
from nonlinear.postprocessing import summary
from nonlinear.reduction import start_in_mode
from nonlinear.simulation import advise, simulate
from nonlinear.system import State


def offered(pages: dict[str, Page], command: str) -> set[str]:
    return {flag for action in pages[command]._actions for flag in action.option_strings}


def test_every_motion_takes_the_same_options() -> None:
    from multipendula.cli import _parser

    pages = next(action.choices for action in _parser()._actions if isinstance(action.choices, dict))
    flags = {f"--{name.replace('_', '-')}" for name in ("duration", *MOTION)}
    for command in ("simulate", "plot", "animate"):
        assert flags <= offered(pages, command), command
    assert flags - {"--keep-modes"} <= offered(pages, "check")


def test_a_figure_is_of_the_run_that_simulate_makes(tmp_path: Path) -> None:
    arguments = {"start": "mode:1:20", "samples": 50, "keep_modes": 2}
    run = RunOptions("chain-3", 2.0, arguments).run()
    shown = RunOptions("chain-3", 2.0, arguments).shown()
    np.testing.assert_array_equal(run.motion.links, shown.motion.links)
    assert main(["plot", "chain-3", "--keep-modes", "2", "--duration", "1", "-o", str(tmp_path / "few.png")]) == 0
    assert (tmp_path / "few.png").read_bytes().startswith(b"\x89PNG")


def test_a_saved_run_is_shown_as_it_is(tmp_path: Path) -> None:
    name = str(tmp_path / "run.npz")
    files.save(simulate(load("chain-2"), 1.0, output=5), name)
    assert len(RunOptions(name, 9.0, {}).shown().times) == 5
    with pytest.raises(SceneError, match="--keep-modes: cannot change a saved run"):
        RunOptions(name, 9.0, {"keep_modes": 2}).shown()
    with pytest.raises(SceneError, match="is a saved run, and --keep-modes needs a scene"):
        RunOptions(name, 9.0, {"keep_modes": 2}).run()
    assert RunOptions(name, 1.0, {"samples": 3}).run().times.tolist() == [1.0, 1.5, 2.0]


@pytest.mark.parametrize(
    ("name", "degrees", "accuracy"), [("paper-cart-2", 2.0, 1e-3), ("chain-2", 30.0, 1e-6), ("huygens", 5.0, 1e-4)]
)
def test_advice_is_what_simulate_does(name: str, degrees: float, accuracy: float) -> None:
    """The same settings, chosen by one function; and both reports name them."""
    scene = load(name)
    modes = modes_of(scene)
    row = int(np.flatnonzero(modes.omega > 0)[0])
    start: State = start_in_mode(scene, modes, row, 0, np.radians(degrees))
    advice, run = advise(scene, 3.0, accuracy, start=start), simulate(scene, 3.0, accuracy=accuracy, start=start)
    line, other = advice.trajectory.run, run.run
    settings = ("form", "method", "reason", "tolerance", "steps", "error")
    assert [getattr(line, setting) for setting in settings] == [getattr(other, setting) for setting in settings]
    np.testing.assert_array_equal(advice.trajectory.motion.links, run.motion.links)
    assert f"no angle is off by more than {other.error:.2g} rad" in advice_table(advice, "text")
    assert f"no angle is off by more than {other.error:.2g} rad" in summary.text(run)
