"""The command as people and pipes meet it."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from compare import with_spectrum

from modal import example_names, load, matrices, natural_modes
from modal.exports import FORMATS
from modal.modes import tables
from modal.scene import parse
from modal.scene.files import example_text
from modal.structure import structure_of

KEYS = {
    *("omega_rad_per_s", "frequency_hz", "period_s", "damping_ratio", "multiplicity", "family"),
    *("effective_mass_kg", "linear_to_1_percent_deg", "relative_error_bound"),
}


def run(*words: str, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "multipendula", *words]
    return subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False, **options)


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    from multipendula.cli import main

    assert main(words) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> str:
    from multipendula.cli import main

    assert main(words) == code
    streams = capsys.readouterr()
    assert streams.out == ""
    assert "Traceback" not in streams.err
    return streams.err


def strict(text: str) -> dict:
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


@pytest.mark.parametrize("name", [name for name in example_names() if name not in {"rope", "thousand-pendula"}])
def test_json_table(capsys: pytest.CaptureFixture[str], name: str) -> None:
    record = strict(printed(capsys, "table", name, "--format", "json"))
    assert parse(json_as_toml(record["scene"])) == load(name)
    rows = record["modes"]
    structure = structure_of(load(name)) if load(name).is_structured else None
    support = {"cart_participation"} if structure is None else set(structure.names)
    assert all(row.keys() >= KEYS | support for row in rows)
    omega = [row["omega_rad_per_s"] for row in rows]
    assert omega == sorted(set(omega))
    assert omega == pytest.approx(natural_modes(load(name)).omega.tolist(), rel=1e-14)
    for row in rows:
        if row["omega_rad_per_s"] == 0:
            assert row["period_s"] is None
        if abs(row["damping_ratio"]) == 1:
            assert row["frequency_hz"] is None
        else:
            assert row["frequency_hz"] == pytest.approx(row["omega_rad_per_s"] / (2 * np.pi))


def json_as_toml(scene: dict) -> bytes:
    import tomli_w

    return tomli_w.dumps(scene).encode()


def test_json_shapes(capsys: pytest.CaptureFixture[str]) -> None:
    rows = strict(printed(capsys, "table", "chain-spatial", "--format", "json", "--shapes"))["modes"]
    assert [shape["direction"] for shape in rows[0]["shapes"]] == ["along the rail", "across the rail"]
    assert max(rows[2]["shapes"][0]["angles_rad"], key=abs) == pytest.approx(1.0)


def test_csv_table_has_every_digit(capsys: pytest.CaptureFixture[str]) -> None:
    rows = list(csv.DictReader(io.StringIO(printed(capsys, "table", "paper-cart-2", "--format", "csv"))))
    assert [float(row["omega_rad_per_s"]) for row in rows] == natural_modes(load("paper-cart-2")).omega.tolist()


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.seen.append(tag)


def test_other_formats(capsys: pytest.CaptureFixture[str]) -> None:
    html = Tags(printed(capsys, "table", "chain-3", "--format", "html")).seen
    assert (html.count("table"), html.count("tr"), html.count("caption")) == (1, 4, 1)
    latex = printed(capsys, "table", "paper-cart-2", "--format", "latex")
    assert latex.count(r"\\") == 6
    assert r"$\omega$ (rad/s)" in latex
    markdown = printed(capsys, "table", "chain-3", "--format", "markdown").splitlines()
    assert [line.count("|") for line in markdown if line.startswith("|")] == [10] * 5
    notes = printed(capsys, "table", "paper-cart-2", "--format", "markdown").splitlines()
    assert any(line.startswith(r"\* near a 1:1") for line in notes)
    assert "ω (rad/s)" in printed(capsys, "table", "chain-3")


def test_the_name_of_a_file_chooses_the_format(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for ending, form in {"tex": "latex", "md": "markdown", "html": "html", "csv": "csv", "json": "json"}.items():
        path = tmp_path / f"table.{ending}"
        assert printed(capsys, "table", "chain-3", "-o", str(path)) == ""
        assert path.read_text() == printed(capsys, "table", "chain-3", "--format", form)
    assert "-0.0," not in printed(capsys, "table", "chain-unequal", "--format", "json", "--shapes")
    path = tmp_path / "table.txt"
    printed(capsys, "table", "chain-3", "-o", str(path), "--format", "csv")
    assert path.read_text().startswith("mode,omega_rad_per_s")
    for words in (("--format", "text"), ("--format=text",)):
        assert "--format text: cannot be" in refused(
            capsys, 2, "table", "chain-3", "-o", str(tmp_path / "t.csv"), *words
        )
    printed(capsys, "derive", "chain:1", "-o", str(tmp_path / "chain.tex"))
    assert "\n\\section*{" in (tmp_path / "chain.tex").read_text()
    assert "the name must end in .html\n" in refused(capsys, 2, "play", "chain-3", "-o", str(tmp_path / "page.htm"))


@pytest.mark.parametrize(
    ("modes", "numbers"), [("2", [2]), ("2:3", [2, 3]), (":2", [1, 2]), ("4:", [4, 5]), ("4:99", [4, 5])]
)
def test_some_modes(capsys: pytest.CaptureFixture[str], modes: str, numbers: list[int]) -> None:
    rows = strict(printed(capsys, "table", "paper-cart-2", "--format", "json", "--modes", modes))["modes"]
    assert [row["mode"] for row in rows] == numbers


@pytest.mark.parametrize("modes", ["0", "6", "3:2", "x", "1:2:3", "-1:2", ""])
def test_wrong_modes(capsys: pytest.CaptureFixture[str], modes: str) -> None:
    assert "--modes" in refused(capsys, 2, "table", "paper-cart-2", f"--modes={modes}")


def test_bad_scene_is_told_line_by_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text('gravity = 0.0\n[[pendulum]]\nlinks = [{ kind = "rod", mass = -1.0, length = 1.0 }]\n')
    lines = refused(capsys, 2, "table", str(path), "-o", str(tmp_path / "out.txt")).splitlines()
    assert lines == [
        f"multipendula: {path}: gravity = 0.0: must be positive",
        f"multipendula: {path}: pendulum[0].links[0].mass = -1.0: must be positive",
    ]
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_computed_is_1(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "beyond.toml"
    links = '{ kind = "bob", mass = 1e-100, length = 1e100 }, { kind = "rod", mass = 1e100, length = 1e-100 }'
    path.write_text(f"gravity = 1e-100\n[[pendulum]]\nlinks = [{links}]\n")
    assert "beyond double precision" in refused(capsys, 1, "table", str(path))


def test_frequencies_without_a_certain_digit_are_marked() -> None:
    modes = natural_modes(load("chain-2"))
    uncertain = with_spectrum(modes, replace(modes.spectrum, error=np.array([0.2, 1e-15])))
    lines = tables.table(uncertain, list(uncertain), "text").splitlines()
    assert lines[4].split()[0] == "1!"
    assert lines[4].split()[1:4] == ["–", "–", "–"]
    assert "beyond double precision" in lines[4]
    assert lines[5].split()[0] == "2"
    assert lines[-1].startswith("! beyond double precision")


@pytest.mark.parametrize("damping", ["1e10", "1e30"])
def test_stiff_dampers_keep_their_digits(capsys: pytest.CaptureFixture[str], tmp_path: Path, damping: str) -> None:
    from multipendula.cli import main

    path = tmp_path / "stiff.toml"
    links = f'{{ kind = "bob", mass = 1, length = 1, damping = {damping} }}, {{ kind = "rod", mass = 1, length = 1 }}'
    path.write_text(f"gravity = 1.0\n[[pendulum]]\nlinks = [{links}]\n")
    assert main(["table", str(path), "--format", "json"]) == 0
    slow, swings, fast = json.loads(capsys.readouterr().out)["modes"]
    assert slow["omega_rad_per_s"] * float(damping) == pytest.approx(2, rel=1e-12)
    assert swings["omega_rad_per_s"] == pytest.approx(1.5**0.5, rel=1e-12)
    assert fast["omega_rad_per_s"] / float(damping) == pytest.approx(1 / 1.25, rel=1e-12)


def test_no_more_digits_are_shown_than_the_bound_leaves(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    modes = natural_modes(load("chain-2"))
    rough = with_spectrum(modes, replace(modes.spectrum, error=np.array([2e-4, 1e-15])))
    cells = [line.split()[1] for line in tables.table(rough, list(rough), "text").splitlines()[4:6]]
    assert cells == [f"{modes.omega[0]:#.3g}", f"{modes.omega[1]:#.9g}"]


@pytest.mark.skipif(os.name == "nt", reason="POSIX shell")
@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("table chain-1 >&-", 1, "standard output is closed"),
        ("table - <&-", 2, "-: standard input is closed"),
        ("table chain-1 --shapes", 2, "--shapes: needs --format json"),
        ("shapes chain-1 -o a.png --amplitude abc", 2, "abc: must be a number of degrees above 0 and at most 90"),
    ],
)
def test_one_clear_message_of_a_process(words: str, code: int, message: str) -> None:
    line = f"'{sys.executable}' -m multipendula {words}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (f"table {'x' * 5000}", "cannot be read"),
        ("table chain-1 -o /no/such/place/t.txt", "cannot write /no/such/place/t.txt: No such file or directory"),
        ("table chain-3 --modes 3:2", "--modes 3:2: begins after its end"),
    ],
)
def test_one_clear_message(words: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert message in refused(capsys, 2, *words.split())


def test_a_terminal_that_knows_only_ascii() -> None:
    done = run("table", "-", input=example_text("chain-1"), env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "(rad/s)" in done.stdout


@pytest.mark.parametrize("words", [["--no"], ["table"], ["table", "chain-1", "--format", "yaml"], ["dance"]])
def test_usage_errors_are_2(words: list[str]) -> None:
    from multipendula.cli import main

    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 2


def test_output_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert printed(capsys, "table", "chain-3", "-o", str(tmp_path / "t.txt")) == ""
    assert (tmp_path / "t.txt").read_text(encoding="utf-8") == printed(capsys, "table", "chain-3")
    assert "cannot write" in refused(capsys, 2, "table", "chain-3", "-o", str(tmp_path / "no" / "t.txt"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "multipendula", "table", "chain-1"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_closed_pipe_is_quiet() -> None:
    command = f"'{sys.executable}' -m multipendula table rope --modes 1:400 | head -n 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout == "Hanging rope of 1000 links\n"


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_pictures(capsys: pytest.CaptureFixture[str], tmp_path: Path, form: str) -> None:
    path = tmp_path / f"shapes.{form}"
    assert printed(capsys, "shapes", "chain-2", "-o", str(path)) == f"{path}: modes 1 to 2\n"
    assert path.stat().st_size > 10_000


@pytest.mark.parametrize("name", ["paper-cart-2", "rope", "thousand-pendula", "metronomes", "chain-spatial"])
def test_no_panel_is_empty_and_nothing_touches_the_edge(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str
) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.image import imread

    from modal.plotting.style import colour, theme

    with theme("light"):
        front = np.array(to_rgb(colour(0)))
    path = tmp_path / "shapes.png"
    printed(capsys, "shapes", name, "-o", str(path), "--modes", "2:3")
    picture = imread(path)[:, :, :3]
    ink = (picture < 0.95).any(2)
    assert not ink[[0, -1]].any()
    for half in np.array_split(picture, 2, axis=1):
        assert (np.abs(half - front).max(2) < 0.02).sum() > 100


def test_pictures_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    endings = ".png, .svg, .pdf, .gif, .mp4 or .html"
    assert endings in refused(capsys, 2, "shapes", "chain-1", "-o", str(tmp_path / "a.avi"))
    for name in ("a.png", "a.gif"):
        assert "do not fit" in refused(capsys, 1, "shapes", "rope", "--modes", "1:25", "-o", str(tmp_path / name))
    assert list(tmp_path.iterdir()) == []


def test_matrices_say_once_what_they_leave_out(capsys: pytest.CaptureFixture[str]) -> None:
    from multipendula.cli import main

    assert main(["matrices", "hoisting-crane"]) == 0
    assert capsys.readouterr().err.count("Lengths change") == 1


def test_matrices(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    record = strict(printed(capsys, "matrices", "metronomes", "--format", "json"))
    exact = matrices(load("metronomes"))
    assert record["coordinates"] == ["x", "theta[1,1]", "theta[2,1]"]
    assert all(record[name] == getattr(exact, name).tolist() for name in "MKD")
    assert "D = 0" in printed(capsys, "matrices", "chain-3")
    long = tmp_path / "long.toml"
    long.write_text('gravity = 1\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1, length = 1, count = 4001 }]')
    assert "at most 4000 coordinates" in refused(capsys, 1, "matrices", str(long))


def test_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    listed = printed(capsys, "scenes").splitlines()
    assert [line.split()[0] for line in listed] == example_names()
    assert parse(printed(capsys, "scenes", "crane-hook").encode()) == load("crane-hook")
    said = refused(capsys, 2, "scenes", "crane-hok")
    assert said.startswith("multipendula: crane-hok: no such shipped scene (did you mean crane-hook")


def test_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert strict(printed(capsys, "scenes", "--schema"))["title"] == "Scene"


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    from multipendula.cli import main

    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out.startswith("multipendula 0.")


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_interrupted(tmp_path: Path) -> None:
    path, out = tmp_path / "long.toml", tmp_path / "out.txt"
    path.write_text(
        'gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "rod", mass = 1.0, length = 1.0, count = 20000 }]\n'
    )
    begins = "import sys; from multipendula.cli import main; print('.', flush=True); sys.exit(main())"
    command = [sys.executable, "-c", begins, "table", str(path), "-o", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stdout.readline() == ".\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=600)[1]
    assert process.returncode == 130
    assert errors == "multipendula: interrupted\n"
    assert not out.exists()


@pytest.mark.skipif(os.name == "nt", reason="POSIX files")
def test_links_are_followed_and_pipes_are_written_to(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    real, link, pipe = (tmp_path / name for name in ("real.txt", "link.txt", "pipe"))
    real.write_text("old")
    link.symlink_to(real)
    printed(capsys, "table", "chain-1", "-o", str(link))
    assert link.is_symlink()
    assert "ω (rad/s)" in real.read_text(encoding="utf-8")
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True) as reader:
        printed(capsys, "table", "chain-1", "-o", str(pipe))
        assert "ω" in reader.communicate(timeout=600)[0]
    assert pipe.is_fifo()
    printed(capsys, "table", "chain-1", "-o", os.devnull)
    assert not Path(os.devnull).is_file()


def test_any_title_can_be_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path, title = tmp_path / "scene.toml", "a $x_{$ b, 振り子 for $5 and $6"
    path.write_text(f'title = "{title}"\n' + (example_text("chain-1").partition("\n")[2]), encoding="utf-8")
    assert printed(capsys, "shapes", str(path), "-o", str(tmp_path / "s.png")).endswith("s.png: mode 1\n")
    assert printed(capsys, "response", str(path), "-o", str(tmp_path / "r.png")).endswith(
        "r.png: Bode plot of theta_1_1 for torque_1_1\n"
    )


@pytest.mark.parametrize(
    "links",
    [
        '{kind="body",mass=1e-100,length=1e-100,centre=1e-100,inertia=1e100}',
        '{kind="bob",mass=1e100,length=1e-100},{kind="bob",mass=1e-100,length=1e100}',
    ],
)
@pytest.mark.parametrize("support", ['kind="fixed"', 'kind="cart"\nmass=0.0\nstiffness=1e100'])
def test_overflow_ends_in_a_message(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, links: str, support: str
) -> None:
    from multipendula.cli import main

    path = tmp_path / "beyond.toml"
    path.write_text(f"gravity = 1.0\n[support]\n{support}\n[[pendulum]]\nlinks = [{links}]\n")
    code = main(["table", str(path)])
    assert code in (0, 1)
    assert code == 0 or "beyond double precision" in capsys.readouterr().err


@pytest.mark.parametrize("form", sorted({*FORMATS} - {"tf"}))
def test_export(capsys: pytest.CaptureFixture[str], tmp_path: Path, form: str) -> None:
    path = tmp_path / f"crane{FORMATS[form].extension}"
    words = ("--input", "cart_acceleration", "--signals", "angles,tip_positions", "--discrete", "0.01")
    told = "6 states; input cart_acceleration (m/s^2); output theta_1_1 (rad), theta_1_2 (rad), tip_1 (m)"
    assert printed(capsys, "export", "crane-hook", *words, "-o", str(path)) == f"{path}: {told}\n"
    assert path.stat().st_size > 500


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--to", "c"), "needs --discrete"),
        (("--to", "doc"), "--to doc: must be one of"),
        (("--to", "json", "--input", "wind"), "--input wind: must be one of"),
        (("--to", "json", "--signals", "angles,angles"), "--signals angles: named twice"),
    ],
)
def test_refused_exports(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    name = tmp_path / ("x.h" if "c" in words else f"x.{words[1]}")
    assert message in refused(capsys, 2, "export", "crane-hook", *words, "-o", str(name))
    assert list(tmp_path.iterdir()) == []


def test_smaller_exports(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    sizes = []
    for words in ((), ("--minimal",), ("--dominant", "1")):
        path = tmp_path / "model.json"
        printed(capsys, "export", "paper-cart-3", *words, "-o", str(path))
        sizes.append(len(strict(path.read_text(encoding="utf-8"))["states"]))
    assert sizes == [14, 6, 4]


def test_gains(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "response", "paper-cart-2", "--input", "cart_force", "--gains")
    assert text.count("not controllable") == 2
    assert "force on the cart" in text


@pytest.mark.parametrize(
    "words", [("--impulse",), ("--input", "cart_force,joint_torques", "--from", "torque_1_2"), ()][: usually(1, 3)]
)
def test_responses_are_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...]) -> None:
    path = tmp_path / "response.png"
    what = "impulse response" if words == ("--impulse",) else "Bode plot"
    line = printed(capsys, "response", "crane-hook", *words, "-o", str(path))
    assert f"{path}: {what} of x, theta_1_1, theta_1_2 for " in line


def test_refused_responses(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert ".csv, .json or .mat" in refused(capsys, 2, "response", "crane-hook", "-o", str(tmp_path / "a.gif"))
    wrong = refused(capsys, 2, "response", "crane-hook", "--from", "wind", "-o", str(tmp_path / "a.png"))
    assert "--from wind: must be one of cart_acceleration" in wrong
    assert list(tmp_path.iterdir()) == []


def test_a_shaper_sums_to_one(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(capsys, "shaper", "crane-hook", "--kind", "zvd", "--count", "2").splitlines()
    rows = [line.split(",") for line in lines[lines.index("time_s,amplitude") + 1 :]]
    assert len(rows) == 9
    assert sum(float(amplitude) for _, amplitude in rows) == pytest.approx(1, rel=1e-14)
    assert "excites 2 modes" in refused(capsys, 1, "shaper", "crane-hook", "--count", "3")


@pytest.mark.parametrize(
    "command", [["response", "-", "--gains"], ["shaper", "-"], ["table", "-"], ["derive", "-", "--show", "modes"]]
)
def test_every_command_reads_standard_input(
    command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from multipendula.cli import main

    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(example_text("crane-hook").encode())))
    assert main(command) == 0
    assert capsys.readouterr().err == ""


def test_single_outputs_are_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    told = f"{path}: Bode plot of theta_1_2, x for cart_acceleration\n"
    assert printed(capsys, "response", "crane-hook", "--of", "theta_1_2,x", "-o", str(path)) == told
    assert "--of tip: must be one of" in refused(capsys, 2, "response", "crane-hook", "--of", "tip", "-o", str(path))


def test_a_model_without_a_swing_can_be_truncated(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "cart.json"
    words = ("--input", "cart_acceleration", "--signals", "cart_position", "--dominant", "1")
    printed(capsys, "export", "crane-hook", "--to", "json", *words, "-o", str(path))
    assert len(strict(path.read_text(encoding="utf-8"))["states"]) == 2


def test_an_unseen_position_leaves_the_minimal_model(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "speed.json"
    for drive, states in (("cart_force", 5), ("cart_acceleration", 1)):
        words = ("--minimal", "--input", drive, "--signals", "cart_velocity")
        printed(capsys, "export", "crane-two-loads", "--to", "json", *words, "-o", str(path))
        assert len(strict(path.read_text(encoding="utf-8"))["states"]) == states


def test_gains_say_what_grows(capsys: pytest.CaptureFixture[str]) -> None:
    upright = printed(capsys, "response", "cart-upright", "--input", "cart_force", "--gains")
    assert "grows 4.81261 1/s" in upright
    assert "decays" not in upright
    assert [line.split()[2] for line in printed(capsys, "response", "chain-spatial", "--gains").splitlines()[2:5]] == [
        "1"
    ] * 3


LINE = "support.mass=90:110:3"


@pytest.mark.parametrize(
    ("words", "begins"),
    [
        (("table", "paper-cart-2", "-o", "-"), b"Two double"),
        (("matrices", "paper-cart-2", "-o", "-"), b"coordinates"),
        (("derive", "chain:2", "--show", "polynomial", "--output", "-"), b"2 bobs"),
        (("shapes", "chain-1", "-o", "-"), b"\x89PNG"),
        (("explain", "paper-cart-2", "-o", "-"), b"\x89PNG"),
        (("export", "crane-hook", "--to", "npz", "-o", "-"), b"PK"),
        (("export", "crane-hook", "--to", "json", "-o", "-"), b"{"),
        (("response", "crane-hook", "-o", "-"), b"\x89PNG"),
        (("simulate", "chain-1", "--duration", "1", "-o", "-"), b"PK"),
        (("simulate", "chain-1", "--start", "mode:1:5", "--accuracy", "1e-2", "--duration", "1", "-o", "-"), b"PK"),
        (("plot", "chain-1", "--duration", "1", "-o", "-"), b"\x89PNG"),
        (("animate", "chain-1", "--duration", "0.2", "--fps", "10", "-o", "-"), b"GIF8"),
        (("check", "chain-1", "--amplitudes", "5", "-o", "-"), b"\x89PNG"),
        (("sweep", "paper-cart-2", "--vary", LINE, "--output", "-"), b"PK"),
        (("sweep", "paper-cart-2", "--vary", LINE, "--picture", "-"), b"\x89PNG"),
        (("sweep", "paper-cart-2", "--vary", LINE, "--loci", "--output", "-"), b"support.mass_kg,"),
    ],
    ids=lambda value: " ".join(value[:1] + value[-2:]) if isinstance(value, tuple) else "",
)
def test_a_dash_is_standard_output(
    words: tuple[str, ...],
    begins: bytes,
    capfdbinary: pytest.CaptureFixture[bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from multipendula.cli import main

    monkeypatch.chdir(tmp_path)
    stream = open(os.dup(1), "w", encoding="utf-8")  # noqa: SIM115
    monkeypatch.setattr(sys, "stdout", stream)
    assert main(words) == 0
    stream.close()
    streams = capfdbinary.readouterr()
    assert streams.out.startswith(begins)
    if begins == b"PK":
        assert zipfile.ZipFile(io.BytesIO(streams.out)).testzip() is None
    if begins == b"\x89PNG":
        assert streams.out.endswith(b"IEND\xaeB`\x82")
    assert list(tmp_path.iterdir()) == []


def test_two_things_do_not_fit_into_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("sweep", "paper-cart-2", "--vary", LINE, "--output", "-", "--picture", "-")
    assert "--output, --picture: " in refused(capsys, 2, *words)


def test_a_terminal_gets_no_bytes(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert "is a terminal" in refused(capsys, 2, "export", "chain-1", "--to", "npz", "-o", "-")
    assert "title" in printed(capsys, "export", "chain-1", "--to", "json", "-o", "-")


def test_more_modes_than_there_are_cannot_be_kept(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ("export", "chain-3", "--to", "json", "-o", str(tmp_path / "m.json"))
    assert "--dominant 99: the model has 3" in refused(capsys, 2, *words, "--dominant", "99")
    assert list(tmp_path.iterdir()) == []
    printed(capsys, *words, "--dominant", "3")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("response", "crane-hook", "--gains", "--input", "wind"), "--input wind: must be one of"),
        (("export", "crane-hook", "--to", "jsn", "-o", "m"), "--to jsn: must be one of"),
        (("export", "crane-hook", "--to", "c", "-o", "m.h"), "--to c needs --discrete SECONDS"),
        (("shapes", "rope", "--modes", "1:100", "-o", "m.png"), "choose at most 24 modes with --modes"),
        (("derive", "chain:50"), "choose --show polynomial,modes"),
        (("derive", "chain-3", "--links", "rod"), "--links and --equilibrium are for chain:"),
    ],
)
def test_errors_name_the_options_that_the_packages_do_not_know(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], told: str
) -> None:
    from multipendula.cli import main

    assert main(words) in {1, 2}
    assert told in capsys.readouterr().err


def test_table_to_an_accuracy(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("table", "rope", "--format", "json", "--modes", "1:3")
    exact, approximate = (json.loads(printed(capsys, *asked, *more)) for more in ((), ("--relative-error", "1e-8")))
    for mode, other in zip(exact["modes"], approximate["modes"], strict=True):
        assert other["omega_rad_per_s"] == pytest.approx(mode["omega_rad_per_s"], rel=1e-8)
        assert 0 < other["relative_error_bound"] <= 1e-8
    assert exact["route"] == "effective mass"


def test_the_first_modes_of_a_very_long_chain(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "long.toml"
    link = '{ kind = "rod", mass = 1.0, length = 1.0, count = 1500 }'
    path.write_text(f"gravity = 9.81\n[[pendulum]]\nlinks = [{link}]\n")
    record = json.loads(printed(capsys, "table", str(path), "--modes", "2:3", "--format", "json"))
    assert [mode["mode"] for mode in record["modes"]] == [2, 3]
    assert "modes 1 to 1500" in refused(capsys, 2, "table", str(path), "--modes", "1501")


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (["response", "crane-hook", "--at", "{}", "--of", "x"], ("0.1", "0.2")),
        (["response", "crane-hook", "--at", "0.1", "--of", "{}"], ("x", "theta_1_1")),
        (["response", "crane-hook", "--gains", "--signals", "{}"], ("angles", "tip_positions")),
        (["table", "crane-hook", "--columns", "{}"], ("+participation", "cumulative")),
        (["derive", "chain:1", "--show", "{}"], ("polynomial", "modes")),
    ],
)
def test_an_option_given_again_adds_to_its_list(
    words: list[str], options: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    at = words.index("{}")
    again = [*words[: at - 1], *(word for value in options for word in (words[at - 1], value)), *words[at + 1 :]]
    texts = []
    for arguments in ([",".join(options) if word == "{}" else word for word in words], again):
        texts.append(printed(capsys, *arguments))
    assert texts[0] == texts[1]
