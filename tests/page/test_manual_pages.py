"""Pages of the built manual in Chromium: formulas without a network, nothing too wide, axe-core content, keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from amounts import usually
from chromium import Chromium
from live import BROWSER, axe
from manual import PART, manual, mathjax

pytestmark = BROWSER

LESSON = "tutorial/lessons/05_small_angles"
EXPLANATION = "explanation/modes"
LOOKS = usually([(360, True), (1280, False)], [(width, dark) for width in (360, 768, 1280) for dark in (False, True)])
DRAWN = "(window.MathJax?.startup?.promise ?? Promise.resolve()).then(() => new Promise((on) => setTimeout(on, 50)))"
WITHOUT = "{ exclude: [['mjx-container']] }"  # drawings, hidden from readers, next to MathML: thousands of elements
FORMULAS = """[...document.querySelectorAll('span.math, div.math')].map((formula) => {
  const drawn = formula.querySelector('mjx-container');
  const pieces = [...formula.querySelectorAll('mjx-container > svg')];
  const outer = (formula.closest('.math-wrapper') ?? document.querySelector('article')).getBoundingClientRect();
  return {
    tex: formula.textContent, drawn: pieces.length > 0 && pieces.every((one) => one.getBoundingClientRect().width > 1),
    wrong: formula.querySelectorAll('[data-mml-node=merror]').length, spoken: Boolean(drawn?.querySelector('math')),
    high: pieces.every((one) => {
      const box = one.getBoundingClientRect();
      return box.top >= outer.top - 0.5 && box.bottom <= outer.bottom + 0.5;
    }),
    wide: pieces.every((one) => one.getBoundingClientRect().right <= outer.right + 0.5)
      || getComputedStyle(formula.closest('.math-wrapper') ?? formula).overflowX === 'auto',
    clipped: pieces.some((svg) => {
      const box = svg.getBoundingClientRect(), slack = 0.25 * parseFloat(getComputedStyle(svg).fontSize);
      const all = [...svg.querySelectorAll('use, rect, path')];
      const signs = all.filter((one) => one.ownerSVGElement === svg && !one.closest('defs'));
      return signs.map((one) => one.getBoundingClientRect()).some((one) => one.left < box.left - slack
        || one.right > box.right + slack || one.top < box.top - slack || one.bottom > box.bottom + slack);
    }),
  };
})"""


@pytest.fixture(scope="module")
def offline() -> Iterator[Chromium]:
    """A browser that reaches no network."""
    with Chromium(clockwork=False) as browser:
        browser.call("Network.enable")
        browser.call("Network.setBlockedURLs", urls=["http://*", "https://*", "ws://*", "wss://*"])
        yield browser


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the built manual."""
    return manual(tmp_path_factory.mktemp("manual"))


def show(browser: Chromium, page: Path, width: int, dark: bool = False) -> None:
    """One page of the manual, with its formulas."""
    browser.size(width, 800, dark=dark)
    browser.errors.clear()
    browser.open(page)
    browser.run(DRAWN)


@pytest.mark.parametrize(("page", "width"), [(LESSON, 360), (LESSON, 1280), (EXPLANATION, 360)])
def test_formulas_are_drawn_without_a_network(offline: Chromium, built: Path, page: str, width: int) -> None:
    mathjax(built)
    show(offline, built / f"{page}.html", width)
    formulas: list[dict[str, Any]] = offline.run(FORMULAS)
    assert len(formulas) > 20
    for fault in ("drawn", "spoken", "high", "wide"):
        assert [formula["tex"] for formula in formulas if not formula[fault]] == [], fault
    assert [formula["tex"] for formula in formulas if formula["wrong"] or formula["clipped"]] == []
    assert offline.errors == []


def test_a_clipped_formula_would_be_seen(offline: Chromium, built: Path) -> None:
    mathjax(built)
    show(offline, built / f"{LESSON}.html", 1280)
    offline.run("document.querySelector('mjx-container > svg').setAttribute('viewBox', '0 0 300 300')")
    assert any(formula["clipped"] for formula in offline.run(FORMULAS))


@pytest.mark.parametrize(("width", "dark"), LOOKS)
@pytest.mark.parametrize("page", usually(["index", "search", LESSON], [*PART, "search", "genindex"]))
def test_a_page_of_the_manual_can_be_used_by_everyone(
    offline: Chromium, built: Path, page: str, width: int, dark: bool
) -> None:
    """axe-core's rules: contrast, names, order of headings, what scrolls can be reached by keys."""
    show(offline, built / f"{page}.html", width, dark)
    assert offline.run("document.documentElement.scrollWidth") == width
    assert offline.run("document.querySelectorAll('h1').length") == 1
    if (script := axe()) is None:
        pytest.skip("axe-core is not installed: npm install axe-core, and its folder in AXE_CORE")
    offline.run(script + "\n;0")
    result: dict[str, list[Any]] = offline.run(f"axe.run({WITHOUT}, {{ iframes: false }})")
    assert [
        (violation["id"], [node["html"] for node in violation["nodes"]]) for violation in result["violations"]
    ] == []
    assert len(result["passes"]) > 15


CUT = """[...document.querySelectorAll('article .highlight pre')].filter((one) => one.scrollWidth > one.clientWidth)
  .map((one) => one.innerText.slice(0, 200))"""


@pytest.mark.parametrize("page", [*PART])
def test_no_line_of_code_is_wider_than_its_column(offline: Chromium, built: Path, page: str) -> None:
    show(offline, built / f"{page}.html", 1280)
    assert offline.run(CUT) == []


def test_a_line_that_is_cut_off_would_be_seen(offline: Chromium, built: Path) -> None:
    show(offline, built / f"{LESSON}.html", 1280)
    offline.run("document.querySelectorAll('article .highlight pre').forEach((one) => (one.style.whiteSpace = 'pre'))")
    offline.run("document.querySelector('article .highlight pre').textContent = 'x'.repeat(200)")
    assert offline.run(CUT) != []


LONGEST = 15_000  # pixels of a page of the reference of names


def test_pages_of_names_are_short_enough_to_scroll(offline: Chromium, built: Path) -> None:
    if not (pages := sorted((built / "reference" / "api").glob("*.html"))):
        pytest.skip("only a part of the manual is built: MANUAL names a whole one")
    heights = {}
    for page in pages:
        show(offline, page, 1280)
        heights[page.stem] = offline.run("document.documentElement.scrollHeight")
    assert {name: height for name, height in heights.items() if height > LONGEST} == {}


@pytest.mark.parametrize("page", ["index", LESSON])
def test_keys_reach_a_page_of_the_manual(offline: Chromium, built: Path, page: str) -> None:
    """Tab goes to what can be pressed or scrolled, in order, and each place is seen."""
    show(offline, built / f"{page}.html", 1280)
    offline.run("document.querySelectorAll('iframe').forEach((frame) => frame.remove())")
    before = "document.activeElement.closest('a, button, summary, input, label, [tabindex]')"
    visited: list[str] = []
    for _ in range(30):
        offline.press("Tab")
        if not (here := offline.run(f"{before} ? {before}.outerHTML.slice(0, 160) : ''")):
            break
        visited.append(here)
        outline = "getComputedStyle(document.activeElement)"
        assert offline.run(f"{outline}.outlineStyle !== 'none' || {outline}.boxShadow !== 'none'"), here
    assert "Skip to content" in visited[0]
    assert len(visited) == len(set(visited)) > 8
