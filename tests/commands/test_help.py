"""Help pages, the errors that point to them, and what shells complete."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from modal import example_names
from multipendula import completion
from multipendula.cli import _parser, main
from multipendula.command import Command
from multipendula.commands import COMMANDS, FIRST, GROUPS, NAMES
from multipendula.commands.scenes import SHELLS
from multipendula.flags import ASIDE, FORMER_COMMANDS
from multipendula.parser import PAGE_COLUMNS, SCREEN_LINES, Page, shown

TOPICS = (
    "look",
    ASIDE,
    "modes",
    "motion",
    "coupling and synchronization",
    "measurements",
    "control",
    "symbols and proof",
)
EXAMPLES = {command.name: command.examples for command in COMMANDS}
PAGES: dict[str, Page] = next(
    action for action in _parser()._actions if isinstance(action, argparse._SubParsersAction)
).choices


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    try:
        code = main(words)
    except SystemExit as left:
        code = left.code
    assert code == 2
    return capsys.readouterr().err.splitlines()


# -------------------------------------------------------------------------------------------------- pages


def test_every_command_has_a_page_and_a_topic() -> None:
    assert list(PAGES) == [command.name for command in COMMANDS]
    assert tuple(dict.fromkeys(command.topic for command in COMMANDS)) == TOPICS
    groups = [[command.name for command in group.COMMANDS] for group in GROUPS]
    assert groups == list(map(list, NAMES.values()))
    assert all(command.summary and command.details and 2 <= len(command.examples) <= 5 for command in COMMANDS)


@pytest.mark.parametrize("name", ["", *PAGES])
def test_a_page_shows_every_argument_and_example_within_its_width(name: str) -> None:
    page = PAGES[name] if name else _parser()
    text = page.format_help()
    assert all(len(line) <= PAGE_COLUMNS for line in text.splitlines())
    for action in page._actions:
        for option in action.option_strings:
            assert f"  {option}" in text or f", {option}" in text
    unfolded = " ".join(text.replace("\\\n", "").split())
    for command, words in EXAMPLES.get(name, FIRST):
        assert f"multipendula {command} {words}" in unfolded


def test_no_argument_is_without_a_title() -> None:
    for page in PAGES.values():
        titled = [action for group in page._action_groups[2:] for action in group._group_actions]
        assert sorted(map(id, titled)) == sorted(map(id, page._actions)), page.name
        assert [action.dest for action in page.more._group_actions] == ["help"], page.name
        numerics = {flag for action in page.numerics._group_actions for flag in action.option_strings}
        assert numerics == NUMERICS & page_flags(page), page.name
        assert [actions for _, actions in page._sections()][-1] == page.numerics._group_actions


NUMERICS = {"--engine", "--form", "--method", "--scheduler", "--tolerance", "--workers"}


def page_flags(page: Page) -> set[str]:
    return {flag for flag in page._option_string_actions if flag[:2] == "--"}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_the_most_important_fits_a_screen(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    """What it does, five options at most and three examples, all of which its parser takes."""
    page = PAGES[command.name]
    with pytest.raises(SystemExit) as left:
        main([command.name, "-h"])
    assert left.value.code == 0
    text = capsys.readouterr().out
    assert len(text.splitlines()) <= SCREEN_LINES
    assert max(map(len, text.splitlines())) <= PAGE_COLUMNS
    assert 1 <= len(command.main) <= 5
    assert set(command.main) <= page_flags(page)
    assert all(f"  {'-o' if flag == '--output' else flag}" in text for flag in command.main)
    assert " ".join(text.split()).startswith(f"usage: multipendula {command.name}")
    assert f"`multipendula {command.name} --help` has all {len(page_flags(page))} options" in text.splitlines()[-1]
    for example, words in command.examples[:3]:
        assert words in " ".join(text.split())
        name, *rest = shlex.split(example)
        PAGES[name].parse_args(rest)


def test_the_command_alone_prints_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    with pytest.raises(SystemExit):
        main(["-h"])
    assert capsys.readouterr().out.splitlines() == lines
    assert len(lines) < 40
    assert max(map(len, lines)) < 80
    shown = {word for line in lines for word in re.findall("[a-z]+", line)}
    assert {name for name in EXAMPLES if name not in shown} == {"completion"}
    assert len(EXAMPLES) == 29
    assert all(f"  multipendula {command}" in lines for command, _ in FIRST)


def test_every_file_to_write_may_be_standard_output() -> None:
    files = [action for page in PAGES.values() for action in page._actions if action.metavar == "FILE"]
    assert len(files) > 15
    assert [action.help for action in files if ", - for standard output" not in str(action.help)] == []


def test_a_long_example_is_folded_between_an_option_and_the_next() -> None:
    lines = shown(((f"sweep {'x' * 50} --vary a=1", "words"),)).splitlines()
    assert lines == [f"  multipendula sweep {'x' * 50} \\", "      --vary a=1", "      words"]


# -------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("words", "said", "page"),
    [
        ("tabel chain-3", "did you mean table?", "multipendula --help"),
        ("tabel chain-3", "scenes, completion, table, shapes", "multipendula --help"),
        ("table chain-3 --formt json", "--formt: no such option (did you mean --format?)", "multipendula table --help"),
        (
            "table chain-3 --format jsn",
            "--format jsn (did you mean json?): must be one of",
            "multipendula table --help",
        ),
        ("shapes chain-3 --outptu a.png", "(did you mean --output?)", "multipendula shapes --help"),
        (
            "simulate chain-3 --time 5",
            "--time: no such option (did you mean --duration?)",
            "multipendula simulate --help",
        ),
        ("table chain-3 --latex", "(did you mean --format latex?)", "multipendula table --help"),
        ("shaper crane-hook --type zvd", "(did you mean --kind?)", "multipendula shaper --help"),
        ("tabel chain-3", "tabel: no such command (did you mean table?)", "multipendula --help"),
        ("modes chain-3", "modes: no such command (did you mean table?)", "multipendula --help"),
        ("export chain-3 --format mat", "--format: no such option (did you mean --to?)", "multipendula export --help"),
        ("table chain-3 --co", "--co: may be --covariance or --columns", "multipendula table --help"),
        ("table chain-3 --modes", "--modes: needs a value, 1:10", "multipendula table --help"),
        ("chaos chain-2 --quick=3", "--quick: takes no value", "multipendula chaos --help"),
        ("table -x chain-2", "-x: no such option", "multipendula table --help"),
        (
            "export crane-hook --minimal --dominant 2",
            "--dominant: cannot be combined with --minimal",
            "multipendula export --help",
        ),
        (
            "simulate chain-2 --tolerance 5",
            "--tolerance 5: must be a number from 1e-15 to 0.01",
            "multipendula simulate --help",
        ),
        ("simulate chain-2 --duration 1e300", "--duration: takes an estimated", "multipendula simulate --help"),
        ("shaper crane-hook --over 3", "--over: needs --travel METRES", "multipendula shaper --help"),
        ("basins chain-2 --engine heyoka", "--engine heyoka: is no longer there", "multipendula basins --help"),
        ("table chain-3 --modes 9:1", "--modes 9:1: begins after its end", "multipendula table --help"),
        ("table chain-3 chain-4", "chain-4: unexpected argument", "multipendula table --help"),
        ("shapes chain-3 -o a.avi", "-o a.avi: the name must end in", "multipendula shapes --help"),
        ("simulate chain-3 --samples 0", "must be a whole number", "multipendula simulate --help"),
        ("sweep chain-3 --vary gravity=1,2 -o a.txt", "-o a.txt: the name must end in", "multipendula sweep --help"),
    ],
)
def test_errors_in_arguments_say_where_help_is(
    capsys: pytest.CaptureFixture[str], words: str, said: str, page: str
) -> None:
    lines = refused(capsys, *words.split())
    assert said in "\n".join(lines)
    assert lines[-1].endswith(f"see `{page}`")


def test_other_errors_do_not(capsys: pytest.CaptureFixture[str]) -> None:
    (line,) = refused(capsys, "table", "crane-hok")
    assert line.startswith("multipendula: crane-hok: no such file and no such shipped scene (did you mean crane-hook")


def test_a_place_that_an_option_gives_a_value_is_not_called_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    line, _ = refused(capsys, "spread", "chain-3", "--uncertain", "gravity=-1")
    assert line == "multipendula: --uncertain gravity=-1: a standard deviation must be above 0"


@pytest.mark.parametrize("name", FORMER_COMMANDS)
def test_what_a_command_did_by_itself_is_told_with_its_new_words(capsys: pytest.CaptureFixture[str], name: str) -> None:
    now = FORMER_COMMANDS[name]
    assert f"{name}: is now `multipendula {now}`" in "\n".join(refused(capsys, name, "crane-hook"))
    command, *words = now.split()
    assert {word for word in words if word.startswith("--")} <= PAGES[command]._option_string_actions.keys()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("response crane-hook --gains --at 1 --impulse", ["--at: cannot be", "--impulse: cannot be"]),
        ("response crane-hook --gains -o g.png", ["-o g.png: gains are text"]),
        ("response crane-hook --gains --format csv", ["--format: gains are text"]),
        ("vibration tower --record r.csv --psd p.csv --at 1", ["--psd: cannot be", "--at: cannot be"]),
        ("vibration tower --psd p.csv --baseline velocity", ["--baseline: needs --record CSV"]),
        ("simulate --compile --duration 3", ["--duration: cannot be combined with --compile"]),
        ("simulate chain-2 --compile -o run.npz", ["-o run.npz: the name must end in .txt or .json"]),
        ("simulate chain-2 --format json", ["--format: needs --accuracy RAD of a scene, --proved or --compile"]),
        ("simulate", ["SCENE: is required"]),
        ("scenes chain-2 --schema", ["chain-2: the schema is that of every scene"]),
        ("poles modes.csv", ["modes.csv: contains modes"]),
        ("poles modes.csv --scene chain-2 --order 3", ["--order: applies to measured motions"]),
    ],
)
def test_ways_that_do_not_go_together_are_refused(
    capsys: pytest.CaptureFixture[str], folder: Path, words: str, said: list[str]
) -> None:
    (folder / "modes.csv").write_text("mode,frequency_hz,std_hz\n1,0.38,0.001\n")
    lines = refused(capsys, *words.split())
    assert all(any(line.partition(": ")[2].startswith(part) or part in line for line in lines) for part in said)


def test_nothing_is_guessed_where_nothing_is_near(capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean" not in "\n".join(refused(capsys, "xyzzy"))
    assert "--qqqq: no such option" in refused(capsys, "table", "chain-3", "--qqqq")[-2]


@pytest.mark.parametrize("words", ["tabel chain-3 --format json", "table chain-3 chain-4 -- --format"])
def test_options_are_judged_by_the_page_they_belong_to(capsys: pytest.CaptureFixture[str], words: str) -> None:
    assert "no such option" not in "\n".join(refused(capsys, *words.split()))


# -------------------------------------------------------------------------------------------------- completion


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name in ("mine.toml", "run.npz", "note.txt", "picture.png", ".hidden.toml", "below/deep.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def completed(line: str) -> list[str]:
    """What argcomplete is told to a shell through its file, as in PowerShell."""
    told = Path("told")
    environment = {
        **os.environ,
        **{"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_SUPPRESS_SPACE": "1"},
        **{"_ARGCOMPLETE_STDOUT_FILENAME": str(told), "COMP_LINE": line, "COMP_POINT": str(len(line))},
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    subprocess.run([sys.executable, "-m", "multipendula"], env=environment, capture_output=True, check=False)
    return told.read_text(encoding="utf-8").split("\n")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("ta", ["table"]),
        ("table cha", [name for name in example_names() if name.startswith("cha")]),
        ("table ", [*example_names(), "below/", "mine.toml"]),
        ("plot ", [*example_names(), "below/", "mine.toml", "run.npz"]),
        ("table below/", ["below/deep.toml"]),
        ("table chain-3 --form", ["--format"]),
        ("table chain-3 --format m", ["markdown"]),
        ("table chain-3 --format=m", ["--format=markdown"]),
        ("shapes chain-3 -o p", ["picture.png"]),
        ("derive chain-3 --show polynomial,m", ["polynomial,matrices", "polynomial,modes"]),
        ("derive pap", ["paper:000", "paper:001", "paper:002", *(n for n in example_names() if n.startswith("pap"))]),
        ("response crane-hook --signals angles,t", ["angles,tip_accelerations", "angles,tip_positions"]),
        ("response crane-hook --input cart_f", ["cart_force"]),
        ("sweep chain-1 --measure o", ["order"]),
        ("sweep chain-1 --vary g", ["gravity="]),
        ("table chain-3 --modes ", ["1", "2", "3"]),
        ("table chain-3 --modes 2:", ["2:2", "2:3"]),
        ("simulate chain-3 --duration ", [""]),
        ("completion p", ["powershell"]),
    ],
)
def test_a_line_is_completed(folder: Path, line: str, words: list[str]) -> None:
    assert sorted(completed(f"multipendula {line}")) == sorted(words)


def test_options_come_where_nothing_else_may_stand(folder: Path) -> None:
    assert completed("multipendula matrices chain-3 ") == ["--help", "--format", "--output", "--quiet"]


def test_completing_loads_nothing_that_computes() -> None:
    code = """import sys
from multipendula.cli import _parser
from multipendula.completion import shipped
_parser()
shipped()
print(*sys.modules)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"modal.scene", "numpy", "pydantic"} & set(done.stdout.split())


def test_the_words_are_those_of_the_packages() -> None:
    from modal.exports import FORMATS
    from modal.extend.measures import taken_by
    from modal.statespace.signals import INPUTS, OF_SPRINGS, OF_STRUCTURES, OUTPUTS, PUSHES, WAYS
    from modal.symbolic.derivation import ASKED_FOR, SECTIONS, SYMBOLIC
    from nonlinear.integration import FORMS
    from nonlinear.integration.methods import METHODS

    def offered(command: str, option: str) -> list[str]:
        return list(PAGES[command]._option_string_actions[option].completer(""))

    assert completion.shipped() == example_names()
    assert offered("derive", "--show") == [*SECTIONS, *ASKED_FOR, "freebody"]
    assert offered("derive", "--symbolic") == list(SYMBOLIC)
    inputs = {*INPUTS, *PUSHES, *(f"{way}:" for way in WAYS), "force[0]"}
    assert sorted(offered("export", "--input")) == sorted(inputs)
    assert sorted(offered("export", "--signals")) == sorted({*OUTPUTS, *(OF_STRUCTURES - PUSHES.keys()), *OF_SPRINGS})
    assert offered("export", "--to") == list(FORMATS)
    assert offered("simulate", "--method") == list(METHODS)
    assert offered("simulate", "--form") == list(FORMS)
    for command in ("sweep", "basins", "spread"):
        page = PAGES[command].format_help()
        assert offered(command, "--measure") == list(taken_by(command))
        assert [name for name in taken_by(command) if not re.search(rf"\b{name}\b", page)] == []


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_gets_its_lines(capsys: pytest.CaptureFixture[str], shell: str) -> None:
    assert main(["completion", shell]) == 0
    assert "multipendula" in capsys.readouterr().out


BASH = """
eval "$(multipendula completion bash)"
COMP_LINE="multipendula table crane-" COMP_POINT=25 COMP_WORDS=(multipendula table crane-) COMP_CWORD=2
_python_argcomplete multipendula
echo "${COMPREPLY[@]}"
"""
ZSH = """
autoload -Uz compinit && compinit -D
eval "$(multipendula completion zsh)"
echo $_comps[multipendula]
"""
FISH = "multipendula completion fish | source; complete --do-complete 'multipendula table crane-'"


@pytest.mark.parametrize(
    ("shell", "script", "told"),
    [
        ("bash", BASH, ["crane-held", "crane-hook", "crane-two-loads"]),
        ("zsh", ZSH, ["_python_argcomplete"]),
        ("fish", FISH, ["crane-held", "crane-hook", "crane-two-loads"]),
    ],
)
def test_a_shell_completes(tmp_path: Path, shell: str, script: str, told: list[str]) -> None:
    if not shutil.which(shell):
        pytest.skip(f"{shell} is not installed")
    command = tmp_path / "multipendula"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m multipendula "$@"\n')
    command.chmod(0o755)
    places = {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [shell, "-c", script], env={**os.environ, **places}, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == told, done.stderr
