"""The lessons that run in a browser, run where there is no more than a browser has."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import requires
from pathlib import Path
from threading import Thread

import browser
import pytest
from amounts import usually
from chromium import Chromium
from live import BROWSER

NOTEBOOKS = Path(browser.__file__).parent.parent / "notebooks"
IN_PYODIDE = {"numpy", "scipy", "sympy", "matplotlib", "pillow", "pydantic", "tqdm", "tomli-w"}
"""What this project needs and Pyodide 314.0 brings compiled or whole (its pyodide-lock.json)."""
PURE = {"control", "tabulate", "argcomplete", "tomlkit"}
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


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder, and says nothing."""

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder and where it is served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path))
    Thread(target=server.serve_forever, daemon=True).start()
    yield tmp_path, f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def shown(page: str, seconds: float) -> str:
    """What a page says about Pyodide within so many seconds; nothing if it says nothing."""
    with Chromium(clockwork=False) as window:
        window.call("Page.navigate", url=page)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            words = window.run("document.getElementById('pyodide-unreachable')?.innerText ?? ''")
            if words:
                links = window.run(
                    "[...document.querySelectorAll('#pyodide-unreachable a')].map((a) => a.href).join(' ')"
                )
                return f"{words} {links}"
            time.sleep(0.1)
        return ""


@BROWSER
def test_a_lesson_says_where_pyodide_cannot_be_reached_and_what_to_do(served: tuple[Path, str]) -> None:
    folder, address = served
    (folder / "browser" / "lab").mkdir(parents=True)
    page = "<!doctype html><html><head><title>lab</title></head><body></body></html>"
    path = "/browser/lab/index.html?path=02_simple_chain.ipynb"
    (folder / "browser" / "lab" / "index.html").write_text(browser.guarded(page, f"{address}/missing.mjs"))
    said = shown(address + path, 600)
    assert "does not run here" in said
    assert address.removeprefix("http://") in said
    assert "pip install . jupyterlab && jupyter lab 02_simple_chain.ipynb" in said
    assert f"{address}/browser/files/02_simple_chain.ipynb" in said
    assert f"{address}/tutorial/lessons/02_simple_chain.html" in said
    (folder / "browser" / "lab" / "index.html").write_text(browser.guarded(page, "http://127.0.0.1:9/pyodide.mjs"))
    assert "127.0.0.1:9" in shown(address + path, 600)


@BROWSER
def test_a_lesson_says_nothing_where_pyodide_answers(served: tuple[Path, str]) -> None:
    folder, address = served
    (folder / "pyodide.mjs").write_text("export {};")
    page = "<!doctype html><html><head></head><body>lab</body></html>"
    (folder / "index.html").write_text(browser.guarded(page, f"{address}/pyodide.mjs"))
    assert shown(f"{address}/index.html", 2) == ""


def test_a_page_asks_for_the_pyodide_of_its_kernel() -> None:
    pytest.importorskip("jupyterlite_pyodide_kernel", reason="the extra docs is not installed")
    page = browser.guarded("<html><head></head><body></body></html>", browser.pyodide_of_kernel())
    assert "/full/pyodide.mjs" in page
    assert page.index("<script>") < page.index("</head>")
