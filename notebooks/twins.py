"""Rebuild every notebook from its MyST source, which is the file that people edit: `python notebooks/twins.py`.

The notebooks have no outputs, and cells numbered by their order, so that diffs stay line by line.  Cells with the tag
`hide-cell`, answers and the numbers at the end, are collapsed in Jupyter, Lab and VS Code too.
A lesson sketches its system (`sketch_figure`), imports from the doors of rooms (`from modal.coupling import …`), and
writes formulas as `docs/explanation/conventions.md` says.  `show_both_themes()` in its first cell is all that light and
dark figures need; `show_film` shows a motion.

`python notebooks/twins.py --nbgrader COURSE` writes the lessons as assignments of nbgrader, COURSE/source/NN_name/:
each answer in words and each answer in code is a solution cell with a point, and the numbers at the end are left out.
"""

import argparse
import re
from pathlib import Path

import jupytext
import nbformat

HERE = Path(__file__).parent
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
HIDDEN = "hide-cell"
ANSWER = re.compile(r"<details>\s*<summary>Answer</summary>(.*?)</details>", re.S)
NUMBERS = "## The numbers of this lesson"


def lessons() -> list[Path]:
    """The sources, in order."""
    return sorted(HERE.glob("[0-9][0-9]_*.md"))


def notebook(twin: Path) -> str:
    """The notebook made from a source."""
    lesson = jupytext.read(twin, fmt="md:myst")
    for cell in lesson.cells:
        if HIDDEN in cell.metadata.get("tags", []):
            cell.metadata["jupyter"] = {"source_hidden": True, "outputs_hidden": True}
    return _written(lesson)


def assignment(twin: Path) -> str:
    """The same lesson with the cells of nbgrader, whose `generate_assignment` takes the solutions out."""
    lesson = jupytext.read(twin, fmt="md:myst")
    cells: list[nbformat.NotebookNode] = []
    answers = 0
    for cell in lesson.cells:
        if cell.cell_type == "markdown":
            text, *ending = cell.source.split(NUMBERS)
            for place, piece in enumerate(ANSWER.split(text)):  # text and answers take turns
                if place % 2:
                    answers += 1
                    cells.append(_solution(nbformat.v4.new_markdown_cell(piece.strip()), f"answer-{answers}"))
                elif piece.strip():
                    cells.append(nbformat.v4.new_markdown_cell(piece.strip()))
            if ending:
                break
        elif answers and HIDDEN in cell.metadata.get("tags", []):
            cells.append(_solution(nbformat.v4.new_code_cell(cell.source), f"code-{answers}"))
        else:
            cells.append(cell)
    lesson.cells = cells
    return _written(lesson)


def _solution(cell: nbformat.NotebookNode, name: str) -> nbformat.NotebookNode:
    cell.source = f"### BEGIN SOLUTION\n{cell.source}\n### END SOLUTION"
    cell.metadata["nbgrader"] = {
        "grade": True,
        "grade_id": name,
        "locked": False,
        "points": 1,
        "schema_version": 3,
        "solution": True,
        "task": False,
    }
    return cell


def _written(lesson: nbformat.NotebookNode) -> str:
    lesson.metadata = nbformat.from_dict({"kernelspec": KERNEL, "language_info": {"name": "python"}})
    for number, cell in enumerate(lesson.cells):
        cell["id"] = f"cell-{number}"
    nbformat.validate(lesson)
    return nbformat.writes(lesson, version=4) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="Rebuild the notebooks, or write assignments.")
    parser.add_argument("--nbgrader", metavar="COURSE", type=Path, help="folder of a course, for its assignments")
    course = parser.parse_args().nbgrader
    for twin in lessons():
        if course is None:
            twin.with_suffix(".ipynb").write_text(notebook(twin), encoding="utf-8")
            continue
        folder = course / "source" / twin.stem
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{twin.stem}.ipynb").write_text(assignment(twin), encoding="utf-8")


if __name__ == "__main__":
    main()
