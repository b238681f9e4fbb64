"""The built manual for tests: the one that MANUAL names, or a few of its pages, built here."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import mathematics
import pytest

ROOT = Path(__file__).parents[2]
PART = ("index", "play", "tutorial/index", "tutorial/lessons/05_small_angles", "explanation/modes", "reference/scene")
"""Pages of every kind: cards and a frame, tables, formulas and code."""


def manual(folder: Path) -> Path:
    """The built manual, in this folder if it is made here; skipped with a word where it cannot be."""
    if named := os.environ.get("MANUAL"):
        return Path(named)
    if find_spec("sphinx") is None or find_spec("furo") is None or find_spec("jupyterlite_core") is None:
        pytest.skip("the manual cannot be built: the extra docs is not installed, and MANUAL names no built one")
    files = [f"{page}.{'ipynb' if 'lessons' in page else 'md'}" for page in PART]
    part = ("-t", "part", "-D", f"include_patterns={','.join(files)}")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", *part, "-b", "html", str(ROOT / "docs"), str(folder)],
        env=os.environ | {"LESSONS": str(ROOT / "notebooks")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return folder


def mathjax(folder: Path) -> None:
    """Skip the test with a word where MathJax is not next to the pages."""
    if not (folder / "_static" / "mathjax" / "tex-svg.js").is_file():
        pytest.skip(f"MathJax {mathematics.VERSION} is not beside the pages: npm or the folder in MATHJAX has it")
