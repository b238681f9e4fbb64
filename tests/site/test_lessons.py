"""The lessons as files: each notebook is what its twin in text says, and each is a whole lesson."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import nbformat
import pytest
import twins

pytestmark = pytest.mark.site

LESSONS = twins.lessons()
NUMBERED = pytest.mark.parametrize("twin", LESSONS, ids=lambda twin: twin.stem)
PACKAGES = {"modal", "nonlinear", "numpy", "scipy", "sympy", "mpmath", "matplotlib", "control", "IPython"}
STANDARD = {"collections", "contextlib", "dataclasses", "fractions", "functools", "io", "itertools", "math", "operator"}
STANDARD |= {"os", "pathlib", "random", "tempfile", "textwrap", "time", "warnings"}


def cells(twin: Path, kind: str) -> list[str]:
    notebook = nbformat.read(twin.with_suffix(".ipynb"), as_version=4)
    return [cell.source for cell in notebook.cells if cell.cell_type == kind]


def imported(code: str) -> set[str]:
    """The packages that a piece of Python imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return {name.partition(".")[0] for name in found}


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
    assert re.search(r"^assert ", code[-1], flags=re.MULTILINE)
    assert "$" in text
    assert re.search(r"figure|plt|slide\(", "\n".join(code))


@NUMBERED
def test_a_lesson_needs_no_extra(twin: Path) -> None:
    used = set().union(*(imported(code) for code in cells(twin, "code")))
    assert used <= PACKAGES | STANDARD


def test_an_extra_would_be_seen() -> None:
    assert imported("def f():\n    import numba.core as n\n    from os import path") == {"numba", "os"}
