"""The pages that walk through the three papers: no formula is missing, each has its command or the reason why not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from modal.symbolic.papers import catalogue

PAGES = Path(__file__).parents[2] / "docs" / "papers"
FORMULAS = {"000": 31, "001": 16, "002": 15}
"""The displayed formulas of 000, which numbers none, and the last equation number of 001 and of 002."""
FIGURES = {"000": 7, "001": 0, "002": 0}
HEADING = re.compile(r"^### (?:Formulas?|Equations?) (?P<numbers>[\d() and,to]+): .+$", flags=re.MULTILINE)
COMMAND = re.compile(r"^multipendula \S+ |^from modal\S* import |cart_dae\.", flags=re.MULTILINE)
WHY_NOT = "No command"


def sections(page: str) -> dict[int, str]:
    """The text of the section in which each formula stands, in the order of the page."""
    placed: dict[int, str] = {}
    for heading in HEADING.finditer(page):
        text = re.split(r"^##", page[heading.end() :], maxsplit=1, flags=re.MULTILINE)[0]
        ends = [int(number) for number in re.findall(r"\d+", heading["numbers"])]
        for number in range(ends[0], ends[-1] + 1):
            assert number not in placed, f"formula {number} stands twice"
            placed[number] = text
    return placed


@pytest.mark.parametrize("paper", FORMULAS)
def test_every_formula_stands_on_its_page_with_a_command_or_a_reason(paper: str) -> None:
    page = (PAGES / f"{paper}.md").read_text(encoding="utf-8")
    placed = sections(page)
    assert list(placed) == list(range(1, FORMULAS[paper] + 1))
    for number, text in placed.items():
        assert "$$\n" in text, f"formula {number} is not typeset"
        assert re.search(r"\*\*(Correct|Wrong|Misprint)|is \*\*correct", text), f"formula {number} is not judged"
        code = "\n".join(re.findall(r"^```(?:sh|python)\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL))
        assert COMMAND.search(code) or WHY_NOT in text, f"formula {number} has neither a command nor a reason"
    assert {int(number) for number in re.findall(r"\*?\*?[Ff]igure (\d+)", page)} == set(range(1, FIGURES[paper] + 1))


@pytest.mark.parametrize("paper", ["001", "002"])
def test_the_command_of_an_equation_shows_it(paper: str) -> None:
    """`derive paper:… --show …` in the section of a number names that number."""
    for number, text in sections((PAGES / f"{paper}.md").read_text(encoding="utf-8")).items():
        shown = re.search(rf"^multipendula derive paper:{paper} --show ([\d,-]+)$", text, flags=re.MULTILINE)
        assert shown
        assert str(number) in shown[1].split(",")


@pytest.mark.parametrize("paper", FORMULAS)
def test_every_equation_of_the_catalogue_is_shown_by_its_page(paper: str) -> None:
    page = (PAGES / f"{paper}.md").read_text(encoding="utf-8")
    shown = {place for words in re.findall(rf"paper:{paper} --show (\S+)", page) for place in words.split(",")}
    for equation in catalogue._equations(paper):
        assert catalogue.places(equation).keys() & shown, equation.number


def test_a_missing_formula_is_found_out() -> None:
    page = "### Equations (1) to (3): three\ntext\n## 2\n### Equation (5): one\n"
    assert list(sections(page)) == [1, 2, 3, 5]
    assert sections(page)[1] == "\ntext\n"


@pytest.mark.parametrize("paper", FORMULAS)
def test_every_wrong_equation_is_among_the_errata(paper: str) -> None:
    """The page of errors lists each equation that the catalogue corrects, by the number that `--show` takes."""
    page = (PAGES.parent / "explanation" / "papers.md").read_text(encoding="utf-8")
    rows = page.partition(f"## Paper {paper}")[2].partition("\n## ")[0]
    listed = {place for words in re.findall(r"^\| `(\S+)` ", rows, flags=re.MULTILINE) for place in words.split(",")}
    for equation in catalogue._equations(paper):
        assert equation.right or catalogue.places(equation).keys() & listed, equation.number
    for place in listed:
        assert catalogue.paper(paper, (place,))[1]
