"""The lessons that need no installation: `python docs/browser.py FOLDER` builds a site that runs them in a browser.

JupyterLite brings the notebooks; this project comes as a wheel next to them. Pyodide, Python compiled for the browser,
comes from its own server: every page asks for it first, and where there is no answer it says so and what to do instead.
A browser has no compiled extras, no processes and no threads.
"""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat

ROOT = Path(__file__).parent.parent
LESSONS = ("01_first_table", "02_simple_chain", "04_the_cart")
INSTALL = "%pip install -q multipendula"
PATIENCE = 20
"""Seconds in which Pyodide's server has to answer."""
GUARD = """<script>
(() => {
  const pyodide = PYODIDE, lessons = LESSONS;
  const element = (name, words, ...children) => {
    const made = document.createElement(name);
    made.append(words, ...children);
    return made;
  };
  const link = (words, href, properties) => Object.assign(element("a", words), { href, ...properties });
  function say() {
    const wanted = (new URLSearchParams(location.search).get("path") || "").replace(/[.]ipynb$/, "");
    const lesson = lessons.includes(wanted) ? wanted : lessons[0];
    const style = { position: "fixed", inset: "0 0 auto 0", zIndex: "100000", padding: "1em 1.5em", margin: "0",
      background: "#fff3cd", color: "#22303c", borderBottom: "3px solid #b83c00", font: "16px/1.5 sans-serif" };
    const server = new URL(pyodide).host;
    const file = `${lesson}.ipynb`;
    const steps = element("ul", "",
      element("li", "Go online, or allow the page to load from that server, and reload."),
      element("li", "Or run it on your computer: ",
        link("download the notebook", `../files/${file}`, { download: file }), ", then ",
        element("code", `pip install . jupyterlab && jupyter lab ${file}`), " in a clone of multipendula"),
      element("li", "Or ", link("read the lesson with its results", `../../tutorial/lessons/${lesson}.html`), "."));
    const box = element("div", "", element("strong", "Python could not be loaded, so this lesson does not run here."),
      element("div", `It comes from ${server}, which does not answer: the network is off, or something blocks it.`),
      steps, Object.assign(element("button", "Close"), { onclick: () => box.remove() }));
    box.id = "pyodide-unreachable";
    box.setAttribute("role", "alert");
    Object.assign(box.style, style);
    for (const a of box.querySelectorAll("a")) a.style.color = "#005f9e";
    document.body.append(box);
  }
  function ask() {
    fetch(pyodide, { signal: AbortSignal.timeout(1000 * PATIENCE) })
      .then((answer) => { if (!answer.ok) say(); }, say);
  }
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", ask);
  else ask();
})();
</script>
"""


def in_browser(lesson: str) -> str:
    """A notebook that begins by installing this project into the page."""
    notebook = nbformat.read(ROOT / "notebooks" / f"{lesson}.ipynb", as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(INSTALL, id="install"))
    return nbformat.writes(notebook) + "\n"


def guarded(page: str, pyodide: str) -> str:
    """A page that says so where `pyodide` cannot be reached."""
    words = {"PYODIDE": json.dumps(pyodide), "LESSONS": json.dumps(LESSONS), "PATIENCE": str(PATIENCE)}
    guard = re.sub("|".join(words), lambda placeholder: words[placeholder[0]], GUARD)
    return page.replace("</head>", f"{guard}</head>", 1)


def pyodide_of_kernel() -> str:
    """Where the kernel of the lessons gets Pyodide."""
    from jupyterlite_pyodide_kernel.constants import PYODIDE_CDN_URL, PYODIDE_MJS

    return f"{PYODIDE_CDN_URL}/{PYODIDE_MJS}"


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
        for page in (work / "site").glob("*/index.html"):
            page.write_text(guarded(page.read_text(encoding="utf-8"), pyodide_of_kernel()), encoding="utf-8")
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
