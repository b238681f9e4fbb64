"""What commands print on a terminal: no line is wider than it, nothing is lost, and -q leaves the result alone."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hostility.options import BASES, prepare

from modal import load
from modal.report import breadth
from multipendula.cli import main
from multipendula.commands import shared
from nonlinear import ensemble

Printed = Callable[..., str]
SELDOM = {
    "derive": "chain:2 --show matrices",
    "table": "rope --modes 1:3",
    "matrices": "paper-cart-3",
    "response": "paper-cart-3 --gains",
}
"""Calls with more to print than those of BASES."""
UNTITLED = """gravity = 9.81
[support]
kind = "cart"
mass = 3.0
[[pendulum]]
count = 2
links = [{ kind = "bob", mass = 0.1, length = 0.1 }]
"""
RIGHT = {
    "chaos": "small.toml --duration 7 --members 2",
    "fit": "small.toml swing.csv --free none",
    "orbits": "small.toml --mode 2 --largest-angle 1",
}
"""Calls in place of those of BASES, which are refused."""
QUICK = ("scenes", "table", "matrices", "explain", "shaper", "enclose")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    prepare(tmp_path)
    (tmp_path / "swing.csv").write_text("mode,frequency_hz,std_hz\n2,0.5,0.1\n", encoding="utf-8")
    (tmp_path / "untitled.toml").write_text(UNTITLED, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def printed(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Printed:
    """What a command prints on a terminal of so many columns, None for a pipe."""

    def run(call: str, columns: int | None) -> str:
        monkeypatch.setenv("COLUMNS", str(columns or 30))
        monkeypatch.setattr(sys.stdout, "isatty", lambda: columns is not None, raising=False)
        assert main(call.split()) == 0
        return capsys.readouterr().out

    return run


def too_wide(text: str, columns: int) -> list[str]:
    """Lines beyond the columns, but for those that are one word after their indentation."""
    return [line for line in text.splitlines() if breadth(line) > columns and len(line.removeprefix("# ").split()) > 1]


@pytest.mark.parametrize("name", sorted(BASES.keys() - {"completion", *QUICK}))
def test_no_line_of_any_command_is_wider_than_its_terminal(
    name: str, printed: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nonlinear.accuracy import work_precision

    whole = work_precision.list_candidates
    monkeypatch.setattr(work_precision, "list_candidates", lambda scene: whole(scene)[:3])
    assert too_wide(printed(f"{name} {RIGHT.get(name, BASES[name])}", 80), 80) == []


@pytest.mark.parametrize("call", [*(f"{name} {BASES[name]}" for name in QUICK), *map(" ".join, SELDOM.items())])
@pytest.mark.parametrize("columns", [80, 40, 7])
def test_nor_of_the_quick_ones(call: str, columns: int, printed: Printed) -> None:
    assert too_wide(printed(call, columns), max(columns, 20)) == []


def test_a_table_drops_columns_in_their_order_and_names_them(printed: Printed) -> None:
    text = printed("table crane-hook --format text", 79)
    assert "omitted to fit 79 columns: rel. error ≤, fixed-base mass (kg), cart part.;" in " ".join(text.split())
    head = next(line for line in text.splitlines() if line.startswith("mode"))
    assert "1 % at (°)" in head
    assert "cart part." not in head
    narrow = " ".join(printed("table crane-hook", 40).split())
    assert narrow.index("rel. error ≤") < narrow.index("cart part.") < narrow.index("T (s)")
    assert "left out" not in printed("table crane-hook", 200)


def test_a_pipe_gets_the_whole_table(printed: Printed) -> None:
    whole = printed("table crane-hook", None)
    assert whole == printed("table crane-hook", 200)
    assert "rel. error ≤" in whole
    assert "left out" not in whole


def test_a_file_gets_the_whole_table(printed: Printed, folder: Path) -> None:
    assert printed("table crane-hook -o t.txt", 40) == ""
    assert (folder / "t.txt").read_text(encoding="utf-8") == printed("table crane-hook", None)
    assert printed("table crane-hook -o -", 40) == printed("table crane-hook", 40)


def test_chosen_columns_are_stacked_and_none_is_lost(printed: Printed) -> None:
    whole, narrow = (printed("table paper-cart-2 --columns all", columns) for columns in (None, 60))
    assert sorted(set(whole.split())) == sorted(set(narrow.split()))
    assert narrow.count("\nmode ") > 3


def test_a_terminal_shows_one_table_and_names_what_is_left_out(printed: Printed) -> None:
    whole, narrow = (printed("response paper-cart-3 --input cart_force --gains", columns) for columns in (None, 40))
    assert [text.count("ω (rad/s)") for text in (whole, narrow)] == [2, 2]
    assert "omitted to fit 40 columns: multiplicity, cart position, θ₁₁, θ₁₂" in " ".join(narrow.split())
    assert "left out" not in whole


def test_a_terminal_shows_twelve_rows_unless_more_are_asked_for(printed: Printed) -> None:
    def rows(call: str, columns: int | None = 80) -> int:
        text = printed(f"table thousand-pendula{call}", columns)
        return sum(line.lstrip()[:1].isdigit() for line in text.split("\n"))

    assert "\n… 989 more; --format text or a pipe shows all\n" in printed("table thousand-pendula", 80)
    assert rows("") == 12
    assert rows(" --modes 1:30") == 30
    assert rows(" --format text") == rows("", None) == 1001


def test_columns_that_are_added_stay(printed: Printed) -> None:
    text = printed("table chain-3 --columns +participation,cumulative_effective", 60)
    words = text.split()  # headings are broken over lines
    assert {"part.", "factor", "(1/m)", "cum.", "share"} <= set(words)
    assert too_wide(text, 60) == []


def test_json_and_csv_are_as_wide_as_they_are(printed: Printed) -> None:
    for form in ("json", "csv", "markdown", "latex", "html"):
        assert printed(f"table crane-hook --format {form}", 40) == printed(f"table crane-hook --format {form}", None)


@pytest.mark.parametrize("call", ["scenes crane-hook", "scenes --schema", "completion bash", "table chain-1"])
def test_every_text_goes_to_a_file_or_to_standard_output(call: str, printed: Printed, folder: Path) -> None:
    text = printed(call, None)
    assert printed(f"{call} -o out.txt", None) == ""
    assert (folder / "out.txt").read_text(encoding="utf-8") == text == printed(f"{call} --output -", None)


@pytest.mark.parametrize(
    ("call", "form", "ending"),
    [
        ("explain crane-hook", "text", "txt"),
        ("explain crane-hook", "markdown", "md"),
        ("explain crane-hook", "json", "json"),
        ("poles measured.csv --scene chain-2", "csv", "csv"),
        ("hoist hoisting-crane --samples 3", "csv", "csv"),
        ("table crane-hook", "csv", "csv"),
        ("table crane-hook", "latex", "tex"),
        ("matrices crane-hook", "json", "json"),
        ("vibration small.toml --psd psd.csv", "csv", "csv"),
    ],
)
def test_the_ending_of_a_file_chooses_text_or_figure(
    call: str, form: str, ending: str, printed: Printed, folder: Path
) -> None:
    (folder / "measured.csv").write_text("mode,frequency_hz,std_hz\n1,0.4,0.1\n", encoding="utf-8")
    text = printed(f"{call} --format {form}", None)
    assert printed(f"{call} -o r.{ending}", 40) == ""
    assert (folder / f"r.{ending}").read_text(encoding="utf-8") == text


def test_a_wrong_ending_is_told_with_all_that_are_right(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "crane-hook", "-o", "r.csv"]) == 2
    assert "-o r.csv: the name must end in .png, .svg, .pdf, .txt, .md or .json" in capsys.readouterr().err
    assert main(["explain", "crane-hook", "-o", "r.md", "--format", "json"]) == 2
    assert "--format json: cannot be combined with -o r.md" in capsys.readouterr().err
    assert main(["explain", "crane-hook", "-o", "nowhere/r.md"]) == 2
    assert "there is no folder nowhere" in capsys.readouterr().err
    assert main(["sync", "clock.toml", "-o", "r.csv"]) == 2
    assert "-o r.csv: needs --vary" in capsys.readouterr().err
    assert not list(folder.glob("r.*"))


def test_a_format_is_that_of_the_ending_of_its_file(
    printed: Printed, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    printed("table crane-hook --format latex -o t.txt", None)
    assert (folder / "t.txt").read_text(encoding="utf-8").startswith("%")
    assert main(["table", "crane-hook", "--format", "latex", "-o", "t.csv"]) == 2
    assert "--format latex: cannot be combined with -o t.csv" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["table", "scenes", "enclose"])
def test_text_goes_in_no_picture(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "crane-hook", "-o", "t.png"]) == 2
    assert "-o t.png: this command writes text" in capsys.readouterr().err
    assert not list(folder.glob("t.png"))


@pytest.mark.parametrize("command", BASES)
def test_a_file_has_a_name(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base = BASES[command].partition(" -o ")[0]
    before = set(folder.iterdir())
    assert main([command, *base.split(), "-o", ""]) == 2
    assert "--output: the name of the file is empty" in capsys.readouterr().err
    assert set(folder.iterdir()) == before


def test_a_folder_is_no_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "run.npz").mkdir()
    for call in ("simulate chain-2", "sweep chain-2 --vary gravity=1:2:2"):
        assert main([*call.split(), "-o", "run.npz"]) == 2
        assert "-o run.npz: is a folder" in capsys.readouterr().err
    assert not list(folder.glob("*.journal"))


# ------------------------------------------------------------------------------------------------ hostile titles


@pytest.mark.parametrize("title", ["振り子" * 60, "x" * 200, "\u202eabc \u200b", "e\u0301" * 90, "[31m; rm -rf"])
@pytest.mark.parametrize("columns", [80, 40])
def test_titles_fit_too(title: str, columns: int, printed: Printed, folder: Path) -> None:
    scene = UNTITLED.replace("gravity", f"title = {json.dumps(title, ensure_ascii=False)}\ngravity", 1)
    (folder / "titled.toml").write_text(scene, encoding="utf-8")
    for call in ("table titled.toml", "explain titled.toml", "response titled.toml --gains"):
        assert max(map(breadth, printed(call, columns).splitlines())) <= columns


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of their own")
def test_a_real_terminal_of_80_columns_that_knows_only_ascii(folder: Path) -> None:
    import fcntl
    import pty
    import struct
    import termios

    main_end, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    variables = {name: value for name, value in os.environ.items() if name not in {"COLUMNS", "LINES"}}
    variables |= {"PYTHONIOENCODING": "ascii", "NO_COLOR": "1", "TERM": "dumb"}
    words = [sys.executable, "-m", "multipendula", "table", "paper-cart-2"]
    done = subprocess.Popen(words, stdout=terminal, stderr=terminal, stdin=terminal, env=variables)
    os.close(terminal)
    output = b""
    try:
        while part := os.read(main_end, 65536):
            output += part
    except OSError:
        pass  # the terminal is closed
    assert done.wait() == 0
    lines = output.decode("ascii").splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("omitted to fit 80 columns") for line in lines)
    assert "\x1b" not in output.decode("ascii")


# ------------------------------------------------------------------------------------------------------- quiet


@pytest.mark.parametrize(
    ("call", "file"),
    [
        ("simulate chain-2 --duration 0.1 -o run.npz", "run.npz"),
        ("export crane-hook --to json -o m.json", "m.json"),
        ("play chain-2 -o p.html", "p.html"),
        ("table crane-hook -o t.txt", "t.txt"),
        ("simulate untitled.toml --duration 0.1 -o run.csv", "run.csv"),
    ],
)
def test_quiet_leaves_the_file_alone(call: str, file: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*call.split(), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert (folder / file).stat().st_size > 100


def test_quiet_without_a_file_leaves_the_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for call in (
        "table huygens",
        "explain crane-hook",
        "simulate untitled.toml --duration 0.1",
        "response crane-hook --gains",
    ):
        assert main([*call.split(), "-q"]) == 0
        told = capsys.readouterr()
        assert told.out
        assert told.err == ""


def test_quiet_still_says_what_is_wrong(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["table", "small.toml", "-q", "--modes", "9"]) == 2
    assert "--modes 9" in capsys.readouterr().err
    assert main(["table", "small.toml", "-q", "--explain"]) == 2
    assert "--quiet: cannot be combined" in capsys.readouterr().err


def test_every_command_can_be_quiet() -> None:
    from hostility.options import commands

    assert all("--quiet" in page._option_string_actions for page in commands().values())


def test_where_there_is_a_file_its_option_is_output() -> None:
    from hostility.options import commands

    for name, page in commands().items():
        action = page._option_string_actions["-o"]
        assert action is page._option_string_actions["--output"], name


# ------------------------------------------------------------------------------------------- scenes without a start


def test_a_scene_without_a_start_begins_in_the_first_mode_that_swings(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from nonlinear.files import load

    assert main(["simulate", "untitled.toml", "--duration", "0.5", "-o", "usual.npz"]) == 0
    assert "--start mode:2:5" in capsys.readouterr().err
    assert main(["simulate", "untitled.toml", "--duration", "0.5", "--start", "mode:2:5", "-o", "asked.npz"]) == 0
    assert capsys.readouterr().err == ""
    usual, asked = (load(f"{name}.npz") for name in ("usual", "asked"))
    assert (usual.motion.links == asked.motion.links).all()
    assert abs(abs(usual.motion.links[0]).max() * 180 / 3.141592653589793 - 5) < 1e-12


def test_the_scenes_own_start_is_asked_for_in_vain(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "untitled.toml", "--start", "scene"]) == 2
    assert "no pendulum has a start" in capsys.readouterr().err


def test_a_scene_in_which_nothing_swings_needs_a_start(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = 'gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1.0, length = 1.0, damping = 99.0 }]\n'
    (folder / "stiff.toml").write_text(text, encoding="utf-8")
    assert main(["simulate", "stiff.toml", "--duration", "1"]) == 2
    assert "no mode swings" in capsys.readouterr().err


@pytest.mark.parametrize(
    "call",
    [
        "check untitled.toml --general --duration 3",
        "chaos untitled.toml --duration 3 --members 2",
        "spread untitled.toml --uncertain gravity=0.1 --members 4 --duration 0.1",
    ],
)
def test_so_do_other_commands(call: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(call.split()) == 0
    assert "mode 2, its largest angle 5°" in capsys.readouterr().err


# ---------------------------------------------------------------------------------------------------- progress


class Watched(io.StringIO):
    """A terminal's standard error, 80 columns wide."""

    def isatty(self) -> bool:
        return True


def test_progress_is_per_cent_with_the_time_left_before_anything_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also at the first stage, and one bar at a time; none in a pipe."""
    monkeypatch.setattr(shared, "PROGRESS_SECONDS", 0.01)
    monkeypatch.setenv("COLUMNS", "80")
    for stream in (Watched(), io.StringIO()):
        monkeypatch.setattr(sys, "stderr", stream)
        with shared.stages("predicting", "simulating") as (predicting, simulating):
            time.sleep(0.05)
            early = stream.getvalue()
            predicting(0.5)
            time.sleep(0.05)
            simulating(0.25)
            time.sleep(0.05)
        assert (early != "") == stream.isatty()
        told = stream.getvalue()
        if stream.isatty():
            assert "predicting" in early
            assert "left" in early
            assert "simulating" not in early
            assert "predicting" not in told.rpartition("simulating")[2]
            assert " 25 %" in told
        else:
            assert told == ""


@pytest.mark.parametrize(("done", "words"), [(0, "branches: 0, 00:03 passed"), (1, "branches: 1, 00:03 passed")])
def test_what_is_counted_is_told_in_english(done: int, words: str) -> None:
    tqdm = pytest.importorskip("tqdm").tqdm
    assert tqdm.format_meter(done, None, 3.0, unit="branches", bar_format=shared.COUNTED) == words


def test_the_time_that_is_expected_is_told_while_nothing_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of an ensemble's first chunk; over an hour it is said beforehand, also in a pipe."""
    with shared.bar(9) as progress:
        ensemble(load("chain-2"), 0.1, starts=[[0.1, 0.2]] * 9, workers=1, engine="numpy", report=progress)
        assert 0 < progress.expected_seconds < 60
    with shared.bar(9) as progress:
        progress.expect(7000.0)
    assert capsys.readouterr().err == "multipendula: this takes an estimated 117 minutes; Ctrl-C ends it\n"
    monkeypatch.setattr(shared, "PROGRESS_SECONDS", 0.01)
    monkeypatch.setattr(sys, "stderr", stream := Watched())
    with shared.bar(9) as progress:
        progress.expect(90.0)
        time.sleep(0.1)
        early = stream.getvalue()
        progress(4)
        time.sleep(0.1)
    assert "about 01:" in early
    assert "about" not in stream.getvalue()[len(early) :].partition("44 %")[2]
