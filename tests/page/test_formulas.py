"""Every formula of the manual's pages and of derivations, set by MathJax in Chromium at the width of a phone."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import mathematics
import pytest
from chromium import Chromium
from live import BROWSER

from modal.symbolic import derive, typeset
from modal.symbolic.derivation import target

pytestmark = BROWSER

DOCS = Path(__file__).parents[2] / "docs"
PHONE = 328
"""Pixels that a page of 360 has for its text; a number at the right of a formula takes 42 of them."""
NUMBERED = 42
CODE = re.compile(r"^ *(`{3,})[^\n]*\n.*?^ *\1 *$|(`+)(?!`)[^\n]*?(?<!`)\2(?!`)", re.DOTALL | re.MULTILINE)
DISPLAY = re.compile(r"\$\$(.*?)\$\$( \()?", re.DOTALL)
INLINE = re.compile(r"\$([^$]+)\$")
SET = """MathJax.startup.promise.then(() => [...document.querySelectorAll('div')].map((div) => ({
  tex: div.title, wrong: [...div.querySelectorAll('[data-mml-node=merror], [fill=red]')].map((one) => one.textContent),
  drawn: div.querySelectorAll('mjx-container > svg').length, over: div.scrollWidth - div.clientWidth,
})))"""
DAMPED = """gravity = 9.81
[support]
kind = "cart"
mass = 2.5
damping = 0.3
stiffness = 4.0
[[pendulum]]
links = [
  { kind = "bob", mass = 1.0, length = 1.0, damping = 0.05 },
  { kind = "rod", mass = 0.5, length = 0.7, stiffness = 0.3 },
]
"""


def formulas(text: str) -> Iterator[tuple[str, int]]:
    """The formulas of a page in Markdown, each with the pixels that it has."""
    text = CODE.sub("", text)
    for formula, number in DISPLAY.findall(text):
        body = formula.strip().removeprefix("{").strip()
        yield f"\\[{body}\\]", PHONE - NUMBERED * bool(number)
    for formula in INLINE.findall(DISPLAY.sub("", text)):
        yield f"\\({formula}\\)", PHONE


def seen(browser: Chromium, folder: Path, wanted: list[tuple[str, int]]) -> list[dict[str, Any]]:
    """What MathJax makes of formulas, each in a place so wide."""
    divs = [
        f'<div style="width:{width}px;overflow-x:auto" title="{escape(tex)}">{escape(tex)}</div>'
        for tex, width in wanted
    ]
    options = json.dumps(mathematics.SERVED)
    script = f"<script>MathJax = {options}</script><script src='mathjax/tex-svg.js'></script>"
    page = folder / "formulas.html"
    page.write_text(f"<!doctype html><meta charset=utf-8>{script}{''.join(divs)}", encoding="utf-8")
    browser.open(page)
    answer: list[dict[str, Any]] = browser.run(SET)
    return answer


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with MathJax next to pages."""
    if not (os.environ.get("MATHJAX") or mathematics.FETCHED.is_dir()):
        pytest.skip(f"MathJax {mathematics.VERSION} is not there: it is fetched when the manual is built")
    path = tmp_path_factory.mktemp("formulas")
    mathematics.serve(mathematics.packages_of(), path / "mathjax")
    return path


@pytest.fixture(scope="module")
def phone() -> Iterator[Chromium]:
    with Chromium(clockwork=False) as browser:
        browser.size(360, 780)
        yield browser


def test_no_formula_of_the_manual_is_wrong_or_wider_than_a_phone(phone: Chromium, folder: Path) -> None:
    pages = [page for page in DOCS.rglob("*.md") if not {"_build", "lessons"} & set(page.relative_to(DOCS).parts)]
    wanted = [formula for page in sorted(pages) for formula in formulas(page.read_text(encoding="utf-8"))]
    assert sum(tex.startswith("\\[") for tex, _ in wanted) > 80
    answers = seen(phone, folder, wanted)
    assert [(answer["tex"], answer["wrong"]) for answer in answers if answer["wrong"] or not answer["drawn"]] == []
    assert [(answer["tex"], answer["over"]) for answer in answers if answer["over"] > 1] == []


def test_what_is_wrong_or_too_wide_is_seen(phone: Chromium, folder: Path) -> None:
    wide = r"\mathrm{" + 80 * "x" + "}"
    page = f"$$\n{wide}\n$$\n\n$\\nosuch{{1}}$, `$`, $\\frac{{1$ and $\\left( 1$"
    over, undefined, open_brace, unclosed = seen(phone, folder, list(formulas(page)))
    assert over["over"] > 50
    assert undefined["wrong"]
    assert unclosed["wrong"]
    assert not open_brace["drawn"]


@pytest.mark.parametrize("name", ["chain:3", "cart:2", "damped", "chain-spatial", "beam"])
def test_derivations_are_right_for_mathjax(phone: Chromium, folder: Path, tmp_path: Path, name: str) -> None:
    """Plain, on a cart, damped, in space, and on a structure."""
    path = tmp_path / "damped.toml"
    path.write_text(DAMPED, encoding="utf-8")
    system, scene = target(str(path) if name == "damped" else name)
    document = typeset("A scene", derive(system, scene=scene), "latex")
    displays = re.findall(r"(\\begin\{(equation|align)\*\}.*?\\end\{\2\*\})", document, flags=re.DOTALL)
    inline = [f"\\({formula}\\)" for formula in INLINE.findall(document)]
    answers = seen(phone, folder, [(tex, 3 * PHONE) for tex in [*(formula for formula, _ in displays), *inline]])
    assert len(answers) > 10
    assert [(answer["tex"], answer["wrong"]) for answer in answers if answer["wrong"] or not answer["drawn"]] == []
