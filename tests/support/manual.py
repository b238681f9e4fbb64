"""The built manual for tests: the one that MANUAL names, or a few of its pages, built here."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from tempfile import mkdtemp

import mathematics
import pytest

ROOT = Path(__file__).parents[2]
PART = ("index", "play", "tutorial/index", "tutorial/lessons/05_small_angles", "reference/scene")
"""Pages of every kind: cards and a frame, tables, formulas and code."""


@cache
def manual() -> Path:
    """The folder of the built manual; the test is skipped with a word where it cannot be built."""
    if named := os.environ.get("MANUAL"):
        return Path(named)
    if find_spec("sphinx") is None or find_spec("furo") is None or find_spec("jupyterlite_core") is None:
        pytest.skip("the manual cannot be built: the extra docs is not installed, and MANUAL names no built one")
    folder = Path(mkdtemp(prefix="manual"))
    files = [f"{page}.{'ipynb' if 'lessons' in page else 'md'}" for page in PART]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-t", "part", "-D", f"include_patterns={','.join(files)}"]
        + ["-b", "html", str(ROOT / "docs"), str(folder)],
        env=os.environ | {"LESSONS": str(ROOT / "notebooks")}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    return folder


def mathjax(folder: Path) -> Path:
    """MathJax beside the pages; the test is skipped with a word where it is not."""
    script = folder / "_static" / "mathjax" / "tex-svg.js"
    if not script.is_file():
        pytest.skip(f"MathJax {mathematics.VERSION} is not beside the pages: npm or the folder in MATHJAX has it")
    return script
