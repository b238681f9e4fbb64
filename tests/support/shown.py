"""What a result shows of itself, examined: short at the prompt, well-formed and without colours in a notebook."""

from __future__ import annotations

from html.parser import HTMLParser
from typing import Any

from modal.report import HTML_ROWS, WIDTH
from modal.report.results import PROMPT_LINES


class Elements(HTMLParser):
    """The elements of a page and whether each is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def parsed(page: str) -> Elements:
    elements = Elements()
    elements.feed(page)
    assert elements.open == []
    return elements


def assert_shown(thing: Any, *words: str) -> None:
    """Short at the prompt, and in a notebook well-formed, colourless and scrolling."""
    text = repr(thing)
    assert len(text.splitlines()) <= PROMPT_LINES
    assert max(map(len, text.splitlines())) <= WIDTH
    page = thing._repr_html_()
    assert "overflow-x: auto" in page
    assert "color" not in page
    assert parsed(page).seen.count("tr") <= 3 * HTML_ROWS
    for word in words:
        assert word in text
