"""The lessons that need no installation: `python docs/browser.py FOLDER` builds a site that runs them in a browser.

JupyterLite brings the notebooks and Pyodide, Python compiled for the browser; this project comes as a wheel beside
them. A browser has no compiled extras, no processes and no threads.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat

ROOT = Path(__file__).parent.parent
LESSONS = ("01_first_table", "02_simple_chain", "04_the_cart")
INSTALL = "%pip install -q multipendula"


def in_browser(lesson: str) -> str:
    """A notebook that begins by installing this project into the page."""
    notebook = nbformat.read(ROOT / "notebooks" / f"{lesson}.ipynb", as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(INSTALL, id="install"))
    return nbformat.writes(notebook) + "\n"


def build(folder: Path) -> None:
    """Write the site, replacing what was there."""
    with TemporaryDirectory() as name:
        work = Path(name)
        (work / "contents").mkdir()
        for lesson in LESSONS:
            (work / "contents" / f"{lesson}.ipynb").write_text(in_browser(lesson), encoding="utf-8")
        run("hatchling", "build", "-t", "wheel", "-d", str(work / "wheels"), cwd=ROOT)
        settings = {
            "LiteBuildConfig": {"contents": ["contents"], "output_dir": "site"},
            "PipliteAddon": {"piplite_urls": ["wheels"]},
        }
        (work / "jupyter_lite_config.json").write_text(json.dumps(settings), encoding="utf-8")
        run("jupyterlite_core", "build", cwd=work)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(work / "site", folder)


def run(module: str, *arguments: str, cwd: Path) -> None:
    """Run a module of this Python, its output seen only if it fails."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{module}: {done.stdout}{done.stderr}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("which folder? python docs/browser.py FOLDER")
    build(Path(sys.argv[1]))
