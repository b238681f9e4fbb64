"""Rebuild every notebook from its MyST source, which is the file that people edit: `python notebooks/twins.py`.

The notebooks have no outputs, and cells numbered by their order, so that diffs stay line by line.
A lesson sketches its system (`sketch_figure`), imports from the doors of rooms (`from modal.coupling import …`), and
writes formulas as `docs/explanation/conventions.md` says.  `show_both_themes()` in its first cell is all that light and
dark figures need; `show_film` shows a motion.
"""

from pathlib import Path

import jupytext
import nbformat

HERE = Path(__file__).parent
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def lessons() -> list[Path]:
    """The sources, in order."""
    return sorted(HERE.glob("[0-9][0-9]_*.md"))


def notebook(twin: Path) -> str:
    """The notebook made from a source."""
    made = jupytext.read(twin, fmt="md:myst")
    made.metadata = nbformat.from_dict({"kernelspec": KERNEL, "language_info": {"name": "python"}})
    for number, cell in enumerate(made.cells):
        cell["id"] = f"cell-{number}"
    nbformat.validate(made)
    return nbformat.writes(made, version=4) + "\n"


if __name__ == "__main__":
    for twin in lessons():
        twin.with_suffix(".ipynb").write_text(notebook(twin), encoding="utf-8")
