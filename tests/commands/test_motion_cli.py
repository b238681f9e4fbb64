"""The commands about motion, as a user runs them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from multipendula.cli import main
from multipendula.commands import motion as motions
from multipendula.commands import runs
from multipendula.commands import verification as checks
from nonlinear import files as recordings


def run(*words: str) -> int:
    return main([str(word) for word in words])


def test_simulate_says_what_it_did_and_keeps_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = tmp_path / "run.npz"
    assert run("simulate", "paper-cart-3", "--duration", "5", "--method", "DOP853", "-o", str(kept)) == 0
    printed = capsys.readouterr().out
    for words in (
        "Three double pendula on a cart",
        "minimal coordinates",
        "DOP853",
        "energy",
        "momentum",
        "computed in",
    ):
        assert words in printed
    assert recordings.load(kept).times[-1] == 5


def test_a_proved_motion_is_printed_saved_and_judges_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("flint")
    monkeypatch.chdir(tmp_path)
    words = ("simulate", "chain-2", "--proved", "--duration", "0.5", "--samples", "3")
    assert run(*words, "--accuracy", "1e-30", "--format", "json") == 0
    last = json.loads(capsys.readouterr().out)["rows"][-1]
    assert float(last["theta_1_1_rad"]["radius"]) < 1e-30
    assert run(*words, "-o", "run.csv") == 0
    assert "proved: " in capsys.readouterr().out
    saved = recordings.load("run.csv")
    assert saved.motion.links[-1, 0] == pytest.approx(float(last["theta_1_1_rad"]["mid"]), abs=1e-15)
    assert run("simulate", "run.csv", "--duration", "0.5", "-o", "more.npz") == 0
    capsys.readouterr()
    assert run("simulate", "chain-1", "--proved", "--samples", "2", "--format", "json") == 0
    assert json.loads(capsys.readouterr().out)["rows"][-1]["time_s"] == 10.0
    assert run("simulate", "run.csv", "--proved") == 2
    assert run("simulate", "huygens", "--proved") == 2
    assert run(*words, "--tolerance", "1e-6", "--keep-modes", "1") == 2
    told = capsys.readouterr().err
    for problem in ("is a saved run", "a proved motion", "--tolerance: cannot be", "--keep-modes: cannot be"):
        assert problem in told
    assert run("check", "chain-2", "--general", "--proved", "--duration", "5", "--tolerance", "1e-6") == 0
    told = capsys.readouterr().err.rpartition("is off by more than ")[2]
    assert 1e-8 < float(told.split()[0]) < 1e-3
    assert run("check", "chain-2", "--proved") == 2


def test_a_saved_run_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "run.npz", tmp_path / "more.csv"
    assert run("simulate", "chain-spatial", "--duration", "1", "-o", str(first)) == 0
    assert run("simulate", str(first), "--duration", "1", "-o", str(second), "--samples", "11") == 0
    assert "1 to 2 s in 11 samples" in capsys.readouterr().out
    assert np.array_equal(recordings.load(second).motion.links[0], recordings.load(first).motion.links[-1])


@pytest.mark.parametrize(
    ("words", "largest"), [("mode:2:10", 10.0), ("angles:5,-7,3", 7.0), ("angles:0,0,30", 30.0), ("scene", 10.0)]
)
def test_starts(words: str, largest: float, tmp_path: Path) -> None:
    kept = tmp_path / "run.npz"
    assert run("simulate", "chain-3", "--duration", "0.1", "--start", words, "-o", str(kept)) == 0
    first = np.rad2deg(recordings.load(kept).motion.links[0])
    assert abs(first).max() == pytest.approx(largest, rel=1e-12)


@pytest.mark.parametrize(("lengths", "mode"), [((1.0, 1.4), 3), ((1.0, 1.0), 2)])
def test_a_scene_in_space_without_a_start_begins_along_the_rail(
    lengths: tuple[float, float], mode: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first mode that swings, or the first shape of it, may move across the rail."""
    pendula = [f'[[pendulum]]\nlinks = [{{ kind = "bob", mass = {1 + k}, length = {lengths[k]} }}]' for k in range(2)]
    support = '[support]\nkind = "cart"\nmass = 2'
    scene, kept = tmp_path / "scene.toml", tmp_path / "run.npz"
    scene.write_text("\n".join(['gravity = 9.81\nspace = "space"', support, *pendula]), encoding="utf-8")
    assert run("simulate", str(scene), "--duration", "0.1", "-o", str(kept)) == 0
    assert f"begins in the shape of mode {mode}, its largest angle 5°" in capsys.readouterr().err
    first = recordings.load(kept).motion.links[0]
    assert np.degrees(np.arcsin(np.abs(first[:, 0]))).max() == pytest.approx(5.0)
    assert np.abs(first[:, 1]).max() == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["simulate", "rope", "--start", "scene"], "no pendulum has a start"),
        (["simulate", "chain-3", "--start", "mode:9:10"], "--start mode:9: the scene has modes 1 to 3"),
        (["simulate", "chain-3", "--start", "mode:1.5:10"], "must be scene, mode:R:DEG"),
        (["simulate", "chain-3", "--start", "angles:1,2"], "--start: has 2 angles: this scene needs 3"),
        (["simulate", "chain-3", "--start", "angles:1,nan,3"], "--start: has nan: must be a finite number"),
        (["simulate", "chain-3", "--start", "sideways"], "--start sideways: must be scene"),
        (["simulate", "paper-cart-2", "--start", "mode:1:10"], "no angle"),
        (["simulate", "chain-3", "--method", "Euler", "--form", "polar"], "form polar: must be one of"),
        (["simulate", "chain-3", "-o", "run.txt"], "-o run.txt: the name must end in .npz, .csv or .mat"),
        (["simulate", "missing.npz"], "missing.npz: cannot be read: No such file"),
        (["simulate", "run.npz", "--start", "scene"], "--start: a saved run"),
        (["simulate", "chain-2", "--start", "mode:nan:1"], "--start mode:nan:1: must be scene"),
        (["simulate", "chain-2", "--start", "mode:1:inf"], "--start mode:1:inf: the largest angle must be"),
        (["plot", "run.npz", "--method", "RK45", "-o", "a.png"], "--method: "),
        (["check", "chain-2", "--duration", "3"], "--duration: needs --general"),
        (["check", "chain-2", "--general", "--modes", "1"], "--modes: "),
        (["chaos", "chain-2", "--quick"], "--quick: "),
        (["chaos", "paper:000", "--duration", "3"], "paper:000: has its own --duration"),
        (["tradeoff", "cart-upright", "--start", "scene"], "no pendulum has a start"),
        (["tradeoff", "chain-3", "-o", "film.avi"], "-o film.avi: the name must end in .png, .svg, .pdf, .txt"),
        (["tradeoff", "chain-3", "--linear", "--duration", "3"], "--duration: applies to motions: omit --linear"),
        (["tradeoff", "chain-3", "--relative-error", "1e-3"], "--relative-error: needs --linear"),
        (["chaos", "chain-spatial"], "a Lyapunov exponent is computed in the plane"),
        (["simulate", "chain-2", "-o", "nowhere/run.npz"], "-o nowhere/run.npz: there is no folder nowhere"),
        (["check", "chain-2", "-o", "nowhere/a.png"], "-o nowhere/a.png: there is no folder nowhere"),
        (["tradeoff", "thousand-pendula", "--start", "mode:2:5"], "links: methods are compared for at most 400"),
        (["chaos", "run.npz"], "run.npz: is a saved run"),
        (["check", "RUN.NPZ"], "RUN.NPZ: is a saved run"),
        (["check", "chain-spatial", "--general"], "a comparison with modes is computed in the plane"),
        (["plot", "run.npz", "--duration", "3", "-o", "a.png"], "--duration: "),
        (["animate", "chain-2", "-o", "film.avi"], "-o film.avi: the name must end in .gif, .mp4 or .html"),
    ],
)
def test_bad_input_gets_one_clear_message(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(*words) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert "Traceback" not in printed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words", [["--duration", "nan"], ["--duration", "0"], ["--tolerance", "1"], ["--samples", "0"]]
)
def test_numbers_out_of_range_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        run("simulate", "chain-3", *words)
    assert left.value.code == 2
    assert words[1] in capsys.readouterr().err


def test_a_run_that_cannot_go_on_keeps_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "light.toml"
    scene.write_text(
        'gravity = 9.81\n[support]\nkind = "cart"\nmass = 0.0\n[[pendulum]]\n'
        'links = [{ kind = "bob", mass = 1.0, length = 1.0 }]\nstart = { angles_deg = [60] }\n'
    )
    kept = tmp_path / "run.npz"
    assert run("simulate", str(scene), "--duration", "10", "-o", str(kept)) == 1
    assert "stopped at" in capsys.readouterr().err
    assert recordings.load(kept).run.stopped


def test_every_mistake_is_named_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    words = "simulate chain-2 --start mode:9:1 --method Euler --form polar -o run.txt"
    assert run(*words.split()) == 2
    printed = capsys.readouterr().err
    for words in ("run.txt: the name", "--start mode:9", "method Euler", "form polar"):
        assert words in printed


def test_check_and_chaos_print_tables_and_draw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = {
        "check chain-2 --modes 1 --amplitudes 5": "the table of modes against the full motion",
        "check chain-2 --general --duration 20": "the motion in modal coordinates",
    }
    for words, title in told.items():
        assert run(*words.split(), "-o", str(tmp_path / "a.png")) == 0
        assert title in capsys.readouterr().out
    assert run("chaos", "paper-cart-1", "--duration", "7", "--members", "4", "-o", str(tmp_path / "b.png")) == 0
    assert "4 starts over" in capsys.readouterr().out
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("a.png", "b.png"))
    path = tmp_path / "still.toml"
    path.write_text('gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1.0, length = 1.0, count = 2 }]\n')
    assert run("chaos", str(path), "--duration", "7", "--members", "4") == 0
    note = capsys.readouterr().err
    assert "start = { angles_deg = [...] }" in note
    assert "--start" not in note


@contextmanager
def interrupting(total: float, unit: str = "s") -> Iterator[Callable[[float], object]]:
    """A progress bar under which somebody presses Ctrl-C halfway."""

    def report(done: float) -> None:
        if done > total / 2:
            raise KeyboardInterrupt

    yield report


@pytest.mark.parametrize(
    ("words", "left", "printed"),
    [
        ("simulate paper-cart-3 --duration 10 -o run.npz", ["run.npz"], "interrupted at 5."),
        ("plot paper-cart-3 --duration 10 -o run.png", [], ""),
        ("animate chain-2 --duration 2 -o run.gif", [], ""),
        ("check chain-3 --amplitudes 1 -o check.png", [], "mode 3 was skipped: interrupted"),
        ("check chain-2 --general --duration 60", [], ""),
        ("tradeoff chain-2 --duration 1 -o t.png", [], "was omitted: interrupted"),
        ("chaos chain-2 --duration 30 -o chaos.png", [], "starts over"),
    ],
)
def test_ctrl_c_ends_cleanly(
    words: str,
    left: list[str],
    printed: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What is certain by then is kept and printed; pictures of a part are not drawn."""
    monkeypatch.chdir(tmp_path)
    for module in (runs, motions, checks):
        monkeypatch.setattr(module, "bar", interrupting)
    assert run(*words.split()) == 130
    told = capsys.readouterr()
    assert printed in told.out
    assert "Traceback" not in told.err
    assert sorted(path.name for path in tmp_path.iterdir()) == left
    if left == ["run.npz"]:
        assert recordings.load("run.npz").run.interrupted
        Path("run.npz").write_bytes(b"whole")
        assert run(*words.split()) == 130
        assert Path("run.npz").read_bytes() == b"whole"
        assert recordings.load("run.part.npz").run.interrupted
        assert "run.part.npz" in capsys.readouterr().out
