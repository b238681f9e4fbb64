"""What the tests of the live page share: one browser, with the page's modules in it or the page itself."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from shutil import which
from typing import Any

import chromium
import numpy as np
import pytest

from modal.modes import Modes
from modal.scene import Scene
from multipendula.page import joined, page, scene_data
from multipendula.page.document import PHYSICS

BROWSER = pytest.mark.skipif(chromium.executable() is None, reason="no Chromium is installed here")
NODE = which("node")
NEEDS_NODE = pytest.mark.skipif(NODE is None, reason="no Node is installed here")


def said_by_node(script: str) -> Any:
    """What a script of JavaScript writes to standard output, as JSON."""
    assert NODE is not None
    done = subprocess.run([NODE, "-"], input=script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def physics(browser: chromium.Chromium, folder: Path) -> None:
    """Show an empty page in which `$system`, `$modes` and the other modules of the physics can be called."""
    empty = folder / "empty.html"
    empty.write_text("<!DOCTYPE html><title>Physics</title>")
    browser.open(empty)
    browser.run(joined(PHYSICS) + "\n;0")


def asked(browser: chromium.Chromium, question: str, argument: Any) -> Any:
    """The value of a function of JavaScript for this argument."""
    return browser.run(f"({question})({json.dumps(argument)})")


def written(scene: Scene, folder: Path, recording: dict[str, Any] | None = None) -> Path:
    """The page of a scene as a file."""
    path = folder / "page.html"
    path.write_text(page(scene_data(scene), recording), encoding="utf-8")
    return path


def assert_rows(rows: Sequence[dict[str, Any]], modes: Modes, close: float = 1e-9, *, words: bool = True) -> None:
    """The page's rows are those of the table, under its numbers: |λ|, ζ, multiplicity, words, κ and stars.

    On structures the page shows κ only where it is that of a support at rest, and no star.
    """
    assert len(rows) == len(modes)
    for row, mode in zip(rows, modes, strict=True):
        assert row["omega"] == pytest.approx(mode.omega, rel=close)
        assert row["ratio"] == pytest.approx(mode.damping_ratio, abs=close)
        assert row["multiplicity"] == mode.multiplicity
        assert row["words"] == mode.family or not words
        if modes.is_expanded:
            assert row["kappa"] is None or row["kappa"] == pytest.approx(mode.kappa, rel=1e-7)
            continue
        assert row["resonant"] == bool(mode.resonances), mode
        if mode.kappa and np.isfinite(mode.kappa):
            assert row["kappa"] == pytest.approx(mode.kappa, rel=close)
            assert row["onePercent"] == pytest.approx(mode.linear_to_1_percent_deg, rel=close)
        else:
            assert row["kappa"] is None


@cache
def axe() -> str | None:
    """The text of axe-core, from AXE_CORE in the environment or from npm's folders; None where it is not installed."""
    folders = [os.environ.get("AXE_CORE", "")]
    if which("npm"):
        for where in ([], ["-g"]):
            asked_npm = subprocess.run(["npm", "root", *where], capture_output=True, text=True, check=False)
            folders.append(f"{asked_npm.stdout.strip()}/axe-core")
    for folder in filter(None, folders):
        path = Path(folder) / "axe.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    return None
