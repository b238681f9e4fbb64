"""The lessons that run in a browser, run where there is no more than a browser has."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import requires
from pathlib import Path

import browser
import pytest
from amounts import usually

pytestmark = [pytest.mark.site, pytest.mark.slow]

NOTEBOOKS = Path(browser.__file__).parent.parent / "notebooks"
IN_PYODIDE = {"numpy", "scipy", "sympy", "matplotlib", "pillow", "pydantic", "tqdm", "tomli-w"}
"""What this project needs and Pyodide 314.0 brings compiled or whole (its pyodide-lock.json)."""
PURE = {"control", "tabulate", "argcomplete"}
"""What it needs and the package index has as a wheel for every platform."""

LIMITS = """
import os, socket, subprocess, sys, threading

MISSING = {"numba", "heyoka", "flint", "gmpy2", "distributed", "imageio_ffmpeg", "_multiprocessing", "fcntl"}

class Confined:
    def __init__(self, finder):
        self.finder = finder

    def __getattr__(self, name):
        return getattr(self.finder, name)

    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in MISSING else self.finder.find_spec(name, path, target)

def refused(*args, **kwargs):
    raise RuntimeError("a browser has none of these")

sys.meta_path[:] = [Confined(finder) for finder in sys.meta_path]
threading.Thread.start = subprocess.Popen.__init__ = os.fork = socket.socket.connect = refused
"""


def confined(code: str) -> subprocess.CompletedProcess[str]:
    """Run Python where extras, threads, processes and connections are missing."""
    return subprocess.run([sys.executable, "-c", LIMITS + code], capture_output=True, text=True, check=False)


def code_of(lesson: str) -> str:
    cells = json.loads((NOTEBOOKS / f"{lesson}.ipynb").read_text(encoding="utf-8"))["cells"]
    pieces = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return "import matplotlib\nmatplotlib.use('agg')\nfrom IPython.display import display\n" + "\n".join(pieces)


@pytest.mark.parametrize("lesson", usually(browser.LESSONS[:1], browser.LESSONS))
def test_a_lesson_runs_where_a_browser_would_run_it(lesson: str) -> None:
    done = confined(code_of(lesson))
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize(
    "code", ["import numba", "import threading; threading.Thread(target=print).start()", "import os; os.fork()"]
)
def test_what_a_browser_has_not_is_missed(code: str) -> None:
    assert confined(code).returncode == 1


def test_every_dependency_is_to_be_had_in_a_browser() -> None:
    needed = {line.split(">")[0].strip() for line in requires("multipendula") or [] if "extra ==" not in line}
    assert needed <= IN_PYODIDE | PURE


def test_a_notebook_in_the_browser_installs_this_project_first() -> None:
    cells = json.loads(browser.in_browser(browser.LESSONS[0]))["cells"]
    shipped = json.loads((NOTEBOOKS / f"{browser.LESSONS[0]}.ipynb").read_text(encoding="utf-8"))["cells"]
    assert cells[0]["source"] == [browser.INSTALL]
    assert cells[1:] == shipped
