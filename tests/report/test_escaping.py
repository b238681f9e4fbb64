"""Text from scenes, files and arguments: every format that is written reads it as text and nothing else."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from unicodedata import category, normalize
from xml.etree import ElementTree as ET

import pytest
from matplotlib.figure import Figure

from modal import SceneError, load, natural_modes
from modal.coupling import coupling_report, explain
from modal.exports import find_format
from modal.exports.data import read_json, write_json
from modal.exports.fmu import description
from modal.modes import tables
from modal.plotting import slide
from modal.report import escaping
from modal.report import titled as headed
from modal.scene import Scene, describe, dumps, scene_from
from modal.scene.parameters import parse_variations
from modal.statespace import Signal, StateSpace, state_space
from modal.statespace.sampling import sample
from modal.symbolic import typeset
from multipendula.cli import main
from nonlinear import files as recordings
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, Sweep, parse_measures, sweep_text
from nonlinear.sweeps import files as sweep_files
from nonlinear.sweeps.study import Row

PWNED = 'coding: unicode_escape \\u000aimport os;os.system("touch PWNED") # x'
ENDS = """x' " */ ]]> %} --> \\ #} </caption> "); system('touch PWNED') // ' ; end"""
MARKUP = "<script>alert(1)</script> **a** `b` [c](javascript:d) | e_f $x$ & ~g~ #"
FORMULA = '=HYPERLINK("http://x",1) a,=cmd|x,+1,-1+cmd,;@SUM(1) "b"'
HIDDEN = "a\u202eb\u200fc\ufeffd\ufffee\ue000\U000e0041f"
LETTERS = 'é ß Å ő ą ð 日本 振り子 Ελ ℏ ‽ 🙂 Persian\u200c آ\u200cب <>|" ^~\\{}'
TITLES = [PWNED, ENDS, MARKUP, FORMULA, HIDDEN, LETTERS, "\ufffe", "=1", "{", "-"]
EVERY_TITLE = pytest.mark.parametrize("title", TITLES, ids=range(len(TITLES)))
RAW = "a\x1b[2J\x07\x9b31m\x7f\nb\u202e\r\u2028"


def titled(title: str, name: str = "paper-cart-2") -> Scene:
    return scene_from({**describe(load(name)), "title": title})


def hidden(text: str) -> list[str]:
    """What a terminal would not show: controls, formats, what is private or unassigned, and separators of lines."""
    shown = {"\n", "\u200c", "\u200d"}
    kinds = [(letter, category(letter)) for letter in text if letter not in shown]
    return [letter for letter, kind in kinds if kind.startswith("C") or kind in {"Zl", "Zp"}]


def written(title: str, name: str, model: StateSpace | None = None) -> bytes:
    """A model in the format of this name."""
    model = model or state_space(titled(title, "chain-1"), [], ["angles"])
    return find_format(name).write(sample(model, 0.1) if name == "c" else model)


# ------------------------------------------------------------------------------------------------------ exports


@EVERY_TITLE
def test_a_title_is_never_code_in_python(title: str, tmp_path: Path) -> None:
    (tmp_path / "ev.py").write_bytes(written(title, "control"))
    (tmp_path / "control.py").write_text("StateSpace = lambda *_, **__: None\n")
    show = "import ev, sys; sys.stdout.buffer.write(ev.title.encode()); assert ev.A.shape == (2, 2)"
    ran = subprocess.run([sys.executable, "-c", show], cwd=tmp_path, capture_output=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.decode() == escaping.one_line(title)
    assert not (tmp_path / "PWNED").exists()


def test_signals_of_a_model_that_was_read_are_never_code(tmp_path: Path) -> None:
    model = state_space(load("paper-cart-2"), ["cart_force"], ["angles"])
    evil = 'x"\nimport os; os.system("touch PWNED")\r\n*/ system("touch PWNED") %}\x85\u2028b'
    names = tuple(Signal(f"{evil}{k}", evil, evil) for k in range(len(model.states)))
    forged = replace(model, title=evil, states=names, operating_point=((evil, 0.5),))
    assert read_json(write_json(forged)).states == names
    for name in ("control", "m", "c", "modelica"):
        (tmp_path / name).write_bytes(written("", name, forged))
        lines = (tmp_path / name).read_text(encoding="utf-8").splitlines()
        assert not [line for line in lines if line.lstrip().startswith(("import os", "*/ system", "system("))], name
    (tmp_path / "control.py").write_text("StateSpace = lambda *_, **__: None\n")
    ran = subprocess.run([sys.executable, "control"], cwd=tmp_path, capture_output=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert not (tmp_path / "PWNED").exists()


@EVERY_TITLE
def test_a_title_is_never_code_in_c(title: str, tmp_path: Path) -> None:
    header = tmp_path / "model.h"
    header.write_bytes(written(title, "c"))
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    flags = ("-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-Wno-unused-function", "-Wno-unused-const-variable")
    ran = subprocess.run([compiler, *flags, "-x", "c", str(header)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


@EVERY_TITLE
def test_a_title_is_one_comment_in_matlab_and_one_string_in_modelica(title: str) -> None:
    script, plain = (written(text, "m").decode().split("\n") for text in (title, "x"))
    assert script[1:] == plain[1:]
    assert script[0] == f"% {escaping.one_line(title)}"
    block, plain = (written(text, "modelica").decode().split("\n") for text in (title, "x"))
    assert block[1:-2] == plain[1:-2]
    said = re.fullmatch(r'block (\w+) "((?:[^"\\]|\\.)*)"', block[0])
    assert said
    assert re.sub(r"\\(.)", r"\1", said[2]) == escaping.one_line(title)


@EVERY_TITLE
def test_the_description_of_an_fmu_is_xml_that_says_the_title(title: str) -> None:
    model = state_space(titled(title, "chain-1"), [], ["angles"])
    root = ET.fromstring(description(model, 0.01, "{guid}", "model.c"))
    assert root.get("modelName") == escaping.one_line(title)


def cells_of(text: str, delimiter: str) -> list[str]:
    return [cell for row in csv.reader(io.StringIO(text, newline=""), delimiter=delimiter) for cell in row]


@EVERY_TITLE
def test_no_cell_of_a_csv_file_begins_a_formula(title: str, tmp_path: Path) -> None:
    run = simulate(titled(title, "chain-1"), 0.1)
    recordings.save(run, tmp_path / "run.csv")
    assert recordings.load(tmp_path / "run.csv").scene.title == title
    swept = failing_sweep(titled(title, "chain-1"))
    sweep_files.save(swept, tmp_path / "sweep.csv")
    assert sweep_files.load(tmp_path / "sweep.csv").study.scene.title == title
    texts = [(tmp_path / name).read_text(encoding="utf-8") for name in ("run.csv", "sweep.csv")]
    texts.append(written(title, "csv").decode())
    for cell in (cell for mark in ",;\t|" for text in texts for cell in cells_of(text, mark)):
        begins = normalize("NFKC", cell.lstrip())[:1]
        assert begins not in {*"=+-@"} or re.fullmatch(r"\s*-[\d.e+-]+[\]}]*,?.*", cell), cell


def failing_sweep(scene: Scene) -> Sweep:
    axes = parse_variations(["pendulum[0].links[0].length=1:2:2"])
    study = Study(scene, axes, parse_measures(["frequencies"]))
    return Sweep(study, (Row(0, {}, "=cmd|' /C calc'!A0"), Row(1, {"omega_1_rad_per_s": 1.0})))


# ---------------------------------------------------------------------------------------- tables and pages


class Tags(HTMLParser):
    """The tags of a page and the words between them."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.words = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.words += data


@EVERY_TITLE
def test_pages_in_html_have_the_tags_of_any_other_title(title: str) -> None:
    modes, plain = natural_modes(titled(title)), natural_modes(titled("x"))
    tags, expected = (Tags(tables.table(listed, list(listed), "html")) for listed in (modes, plain))
    assert tags.tags == expected.tags
    assert escaping.visible(title) in tags.words
    slider = Tags(slide(lambda value: Figure(), [1.0], label=title).html())
    assert "script" not in slider.tags


@EVERY_TITLE
def test_markdown_shows_a_title_as_it_is(title: str) -> None:
    markdown_it = pytest.importorskip("markdown_it")
    scene = titled(title)
    modes = natural_modes(scene)
    for page in (
        tables.table(modes, list(modes), "markdown"),
        coupling_report(explain(scene), "markdown"),
        typeset(title, [], "markdown"),
        headed(scene.title, "words", ["part"], "markdown"),
    ):
        assert not hidden(page)
        first = page.split("\n")[0]
        seen = Tags(markdown_it.MarkdownIt("commonmark", {"html": True}).render(first))
        assert set(seen.tags) <= {"p", "strong", "h1"}
        assert escaping.visible(title).strip() in seen.words


@EVERY_TITLE
@pytest.mark.parametrize("form", ["text", "json", "csv", "latex"])
def test_nothing_hidden_reaches_a_terminal(title: str, form: str) -> None:
    modes = natural_modes(titled(title))
    page = tables.table(modes, list(modes), form)
    assert not hidden(page)
    if form == "json":
        assert json.loads(page)["scene"]["title"] == title
    if form in {"text", "latex"}:
        assert page.split("\n")[0].endswith(escaping.one_line(title).split(" ")[-1])


def test_titles_keep_the_joiners_that_spelling_needs() -> None:
    assert escaping.visible("آونگ\u200cها 👩\u200d🔬") == "آونگ\u200cها 👩\u200d🔬"
    assert escaping.visible("ma\u200dss") == r"ma\u200dss"


@pytest.mark.parametrize(
    ("title", "form"), [*((title, "svg") for title in (HIDDEN, MARKUP, ENDS)), (HIDDEN, "pdf"), (LETTERS, "png")]
)
def test_figures_hold_any_title(title: str, form: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(dumps(titled(title, "chain-1")), encoding="utf-8")
    assert main(["shapes", str(path), "-o", str(tmp_path / f"s.{form}")]) == 0
    if form == "svg":
        ET.parse(tmp_path / "s.svg")


def test_a_film_on_a_page_runs_no_title(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(dumps(titled(MARKUP.replace("**a**", '" onload="x'), "chain-1")), encoding="utf-8")
    assert main(["animate", str(path), "--duration", "0.2", "--fps", "5", "-o", str(tmp_path / "f.html")]) == 0
    page = (tmp_path / "f.html").read_text(encoding="utf-8")
    assert Tags(page).tags.count("script") == 1
    assert "alert(1)</script>" not in page


# --------------------------------------------------------------------------------------------------- messages


def test_messages_show_what_a_terminal_would_obey(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    quoted = json.dumps(RAW)
    files = {
        "key": f"gravity = 9.81\n{quoted} = 1\n",
        "value": f"gravity = {quoted}\n",
        "kind": f"gravity = 9.81\nsupport = {{ kind = {quoted} }}\n",
        "deep": f"gravity = 9.81\n[[pendulum]]\nlinks = [{{ {quoted} = {quoted} }}]\n",
        "title": f"title = {quoted}\ngravity = 9.81\n",
        "broken": f"gravity = 9.81\n{RAW} = 1\n",
    }
    for name, text in files.items():
        (tmp_path / name).with_suffix(".toml").write_text(text, encoding="utf-8", newline="")
        assert main(["table", str(tmp_path / f"{name}.toml")]) == 2
        told = capsys.readouterr().err
        assert not hidden(told), name
        assert all(line.startswith("multipendula: ") for line in told.splitlines()), name
    with pytest.raises(SceneError) as error:
        scene_from({"gravity": RAW, RAW: 1})
    assert not hidden(str(error.value))
    assert len(str(error.value).splitlines()) == len(error.value.problems)


def test_arguments_and_file_names_are_shown_as_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "a\x1b[31m\nb\u202e"
    for arguments in (
        ["table", name],
        ["table", f"./{name}.toml"],
        ["table", "chain-1", "--format", name],
        ["table", "chain-1", f"--{name}"],
        ["table", "chain-1", "--modes", name],
        [name],
        ["table", "chain-1", "-o", f"{tmp_path}/none/{name}"],
        ["export", "crane-hook", "--to", name, "-o", "x"],
        ["sweep", "chain-1", "--vary", f"{name}=1:2:3"],
        ["simulate", "chain-1", "--start", name],
        ["derive", name],
    ):
        try:
            code = main(arguments)
        except SystemExit as stopped:
            code = stopped.code
        streams = capsys.readouterr()
        assert code == 2, arguments
        assert not hidden(streams.err + streams.out), arguments
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "chain-1", "--duration", "0.1", "-o", f"{name}.npz"]) == 0
    assert not hidden(capsys.readouterr().out)


def test_a_saved_sweep_says_its_reasons_harmlessly() -> None:
    swept = failing_sweep(load("chain-1"))
    forged = replace(swept, rows=(Row(0, {}, RAW), swept.rows[1]))
    assert not hidden(sweep_text(forged))


def test_a_key_is_quoted_as_a_scene_file_quotes_it() -> None:
    with pytest.raises(SceneError, match=r'^"mass = 1: fine": is not a known key'):
        scene_from({**describe(load("chain-1")), "mass = 1: fine": 2})


def test_lone_surrogates_never_stop_a_message() -> None:
    assert str(SceneError(["\udcff"])) == r"\udcff"
    assert escaping.html("\udcff") == r"\udcff"
    assert json.loads(escaping.json_text({"a": "\udcff😀\U000e0041"})) == {"a": "\udcff😀\U000e0041"}
