"""The lessons as files: each notebook is what its twin in text says, and each is a whole lesson."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import nbformat
import pytest
import twins

LESSONS = twins.lessons()
NUMBERED = pytest.mark.parametrize("twin", LESSONS, ids=lambda twin: twin.stem)
ROOMS = Path(twins.__file__).parents[1] / "docs/reference/rooms.md"
HEAD = re.compile(
    r"\*You need: (?P<needs>.+); (?P<mathematics>.+)\. "
    r"Reading time (?P<reading>\d+) minutes; runs in (?P<runs>\d+) s\.\*"
)
NUMBERS = "## The numbers of this lesson"
LONGEST = 30
"""Seconds that a lesson may run on two cores, by its own head."""
PRIME = re.compile(r"['′]|\\prime")
"""What would be a derivative in a formula."""
PACKAGES = {"modal", "nonlinear", "numpy", "scipy", "sympy", "mpmath", "matplotlib", "control", "IPython"}
STANDARD = {"collections", "contextlib", "dataclasses", "fractions", "functools", "importlib", "io", "itertools"}
STANDARD |= {"json", "math", "operator", "os", "pathlib", "random", "shutil", "subprocess", "sys", "tempfile"}
STANDARD |= {"textwrap", "time", "warnings"}


def cells(twin: Path, kind: str) -> list[str]:
    notebook = nbformat.read(twin.with_suffix(".ipynb"), as_version=4)
    return [cell.source for cell in notebook.cells if cell.cell_type == kind]


def imported(code: str) -> set[str]:
    """The packages that a piece of Python imports."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            modules |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules.add(node.module or "")
    return {name.partition(".")[0] for name in modules}


def test_each_has_a_number_of_its_own() -> None:
    numbers = [twin.stem[:2] for twin in LESSONS]
    assert len(numbers) == len(set(numbers)) >= 13
    assert sorted(path.stem for path in twins.HERE.glob("*.ipynb")) == [twin.stem for twin in LESSONS]


@NUMBERED
def test_a_notebook_is_its_twin(twin: Path) -> None:
    """`python notebooks/twins.py` makes them so; there are no outputs in it."""
    assert twin.with_suffix(".ipynb").read_text(encoding="utf-8") == twins.notebook(twin)


@NUMBERED
def test_a_lesson_is_whole(twin: Path) -> None:
    """One question in the title, exercises with hidden answers, a number asserted at the end."""
    prose, code = cells(twin, "markdown"), cells(twin, "code")
    assert re.match(rf"# {int(twin.stem[:2])}\. .*\?$", prose[0].splitlines()[0])
    text = "\n".join(prose)
    assert text.count("<details>") == text.count("</details>") >= 2
    assert len(re.findall(r"\*\*Exercise \d", text)) == text.count("<details>")
    assert "$" in text
    assert re.search(r"figure|plt|slide\(", "\n".join(code))


@NUMBERED
def test_a_lesson_needs_no_extra(twin: Path) -> None:
    used = set().union(*(imported(code) for code in cells(twin, "code")))
    assert used <= PACKAGES | STANDARD


def test_an_extra_would_be_seen() -> None:
    assert imported("def f():\n    import numba.core as n\n    from os import path") == {"numba", "os"}


def named_rooms() -> set[str]:
    """The doors of both packages: themselves, their rooms as the manual lists them, and that of the papers."""
    rooms = re.findall(r"^\| `((?:modal|nonlinear)\.\w+)` \|", ROOMS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {"modal", "nonlinear", "modal.symbolic.papers", *rooms}


def entered(code: str) -> set[str]:
    """The modules of this project from which a piece of Python imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
    return {name for name in names if name.partition(".")[0] in {"modal", "nonlinear"}}


@NUMBERED
def test_a_lesson_imports_from_doors(twin: Path) -> None:
    used = set().union(*(entered(code) for code in cells(twin, "code")))
    assert "modal" in used
    assert used <= named_rooms()


def test_a_deep_import_would_be_seen() -> None:
    assert entered("from modal.modes.tables import table\nimport numpy") == {"modal.modes.tables"}
    assert "modal.modes.tables" not in named_rooms()
    assert {"modal.modes", "nonlinear.plotting"} <= named_rooms()


@NUMBERED
def test_the_head_says_what_a_lesson_needs_and_takes(twin: Path) -> None:
    """Prerequisites are earlier lessons; reading is counted by words, running was measured."""
    prose = cells(twin, "markdown")
    head = HEAD.fullmatch(prose[0].split("\n\n")[1].replace("\n", " "))
    assert head, prose[0][:300]
    needed = [int(number) for number in re.findall(r"\d+", head["needs"])]
    assert head["needs"] == "no other lesson" or re.match(r"lessons? \d", head["needs"])
    assert all(number < int(twin.stem[:2]) for number in needed)
    assert int(head["runs"]) <= LONGEST
    words = sum(len(text.split()) for text in prose) + 0.5 * sum(len(code.split()) for code in cells(twin, "code"))
    assert 0.6 < int(head["reading"]) / (words / 110) < 1.5


@NUMBERED
def test_all_assertions_are_at_the_end(twin: Path) -> None:
    *before, last = cells(twin, "code")
    assert not [code for code in before if asserted(code)]
    assert asserted(last) >= 3
    assert NUMBERS in cells(twin, "markdown")[-1].splitlines()
    assert twins.HIDDEN in nbformat.read(twin.with_suffix(".ipynb"), as_version=4).cells[-1].metadata.tags


@NUMBERED
def test_what_is_hidden_is_hidden_in_jupyter_too(twin: Path) -> None:
    notebook = nbformat.read(twin.with_suffix(".ipynb"), as_version=4)
    hidden = [cell for cell in notebook.cells if twins.HIDDEN in cell.metadata.get("tags", [])]
    assert hidden
    assert all(cell.metadata.jupyter == {"source_hidden": True, "outputs_hidden": True} for cell in hidden)


@NUMBERED
def test_an_assignment_has_a_solution_for_each_answer_and_no_assertion(twin: Path) -> None:
    """Every answer of a lesson is a solution cell of nbgrader, with a name of its own, and everything else stays."""
    assignment = nbformat.reads(twins.assignment(twin), as_version=4)
    solutions = {cell.metadata.nbgrader.grade_id: cell for cell in assignment.cells if "nbgrader" in cell.metadata}
    prose = "\n".join(cells(twin, "markdown"))
    assert sum(name.startswith("answer") for name in solutions) == prose.count("<details>")
    assert sum("nbgrader" in cell.metadata for cell in assignment.cells) == len(solutions)
    for cell in solutions.values():
        assert cell.source.startswith("### BEGIN SOLUTION\n")
        assert cell.source.endswith("\n### END SOLUTION")
    rest = [cell.source for cell in assignment.cells if "nbgrader" not in cell.metadata]
    assert not [text for text in rest if "<details>" in text or NUMBERS in text]
    code = [cell.source for cell in assignment.cells if cell.cell_type == "code"]
    assert [asserted(text) for text in code] == [0] * len(cells(twin, "code")[:-1])


BAD_NAMES = {"one", "own", "alike", "told", "kept", "beside"}


@NUMBERED
def test_variables_are_named_for_what_they_are(twin: Path) -> None:
    trees = [ast.parse(code) for code in cells(twin, "code")]
    names = {node.id for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert not names & BAD_NAMES


def asserted(code: str) -> int:
    """How many assertions are anywhere in a piece of Python."""
    return sum(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(code)))


def test_a_nested_assertion_would_be_seen() -> None:
    assert asserted("for x in range(3):\n    assert x < 3") == 1


@NUMBERED
def test_rates_have_dots_and_never_primes(twin: Path) -> None:
    """docs/explanation/conventions.md; a formula in print as in code."""
    formulas = [
        part for text in cells(twin, "markdown") for part in re.findall(r"\$\$?(.+?)\$\$?", text, flags=re.DOTALL)
    ]
    assert formulas
    assert not [formula for formula in formulas if PRIME.search(formula)]
    text = "\n".join(cells(twin, "markdown"))
    assert not re.search(r"[A-Za-zθφωψ]′", text)


@pytest.mark.parametrize("formula", [r"\theta'", "y''", r"\mu_i'", "q′", r"x^{\prime}", "s'"])
def test_a_prime_would_be_seen(formula: str) -> None:
    assert PRIME.search(formula)


@pytest.mark.parametrize("formula", [r"\dot\theta^2", r"\ddot x", r"\dot y_i", "u_i"])
def test_dots_are_no_primes(formula: str) -> None:
    assert not PRIME.search(formula)


@NUMBERED
def test_transposes_are_written_alike(twin: Path) -> None:
    assert not re.search(r"(?<!_0)\^T|\^\{T\}|\^\\top", "\n".join(cells(twin, "markdown")))


@NUMBERED
def test_a_lesson_sketches_its_system_in_both_themes(twin: Path) -> None:
    code = "\n".join(cells(twin, "code"))
    assert "sketch_figure(" in code
    assert "show_both_themes()" in cells(twin, "code")[0]
    assert "style.use" not in code


def test_films_play_in_the_lesson_on_synchronization() -> None:
    (lesson,) = (twin for twin in LESSONS if twin.stem.startswith("07"))
    assert "\n".join(cells(lesson, "code")).count("show_film(") == 2


@NUMBERED
def test_no_cell_shows_what_a_setter_returns(twin: Path) -> None:
    """A semicolon after the last line of a cell that only sets something about a figure."""
    for code in cells(twin, "code"):
        assert not re.search(
            r"^\w*axi?s\w*(\[\d\])?\.(set|legend|plot|axvline|annotate)\w*\(.*\)$", code.splitlines()[-1]
        ), code
