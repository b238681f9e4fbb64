"""Scripts of users are right for the type checkers at their strictest: the tour, and the Python of the first pages."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import tour
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]
WRONG = """from modal import Bob, Pendulum

pendulum = Pendulum(links=[Bob(mass="1", length=2.0)], equilibrium=["sideways"])
"""
MISTAKES = 2


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scripts in a folder, and one that is wrong."""
    folder = tmp_path_factory.mktemp("scripts")
    shutil.copy(tour.__file__, folder / "tour.py")
    for page in PAGES:
        blocks = [part.content for part in MarkdownIt().parse(page.read_text("utf-8")) if part.info == "python"]
        if blocks:
            (folder / f"page_{page.stem}.py").write_text("\n".join(blocks), "utf-8")
    (folder / "wrong.py").write_text(WRONG, "utf-8")
    return folder


def told(command: list[str], here: Path) -> dict[str, int]:
    """How many mistakes a checker finds in each script that has any."""
    ran = subprocess.run(command, cwd=here, capture_output=True, text=True, check=False)
    assert ran.returncode in {0, 1}, ran.stdout + ran.stderr
    lines = [line.strip() for line in ran.stdout.splitlines() if " error: " in line]
    names = [Path(line.partition(".py:")[0]).name for line in lines]
    assert set(names) <= {"wrong"}, ran.stdout
    return {name: names.count(name) for name in names}


def test_scripts_pass_mypy(scripts: Path) -> None:
    pytest.importorskip("mypy")
    paths = sorted(map(str, scripts.glob("*.py")))  # checked from here, where the packages have been checked before
    assert told([sys.executable, "-m", "mypy", "--strict", *paths], ROOT) == {"wrong": MISTAKES}


def test_scripts_pass_pyright(scripts: Path) -> None:
    here = str(Path(sys.executable).parent)
    programs = [shutil.which(name, path=path) for name in ("pyright", "basedpyright") for path in (None, here)]
    checker = next(filter(None, programs), None)
    if checker is None:
        pytest.skip("no pyright here: pip install basedpyright, or npm install -g pyright")
    settings = {"typeCheckingMode": "strict", "include": ["*.py"], "reportUnknownMemberType": False}
    (scripts / "pyrightconfig.json").write_text(json.dumps(settings), "utf-8")  # matplotlib's stubs are partly unknown
    assert told([checker, "--pythonpath", sys.executable], scripts) == {"wrong": MISTAKES}


def test_the_tour_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tour.tour(tmp_path)
    assert "mass = -1.0: must be positive" in capsys.readouterr().out
