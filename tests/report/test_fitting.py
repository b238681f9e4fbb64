"""Text in few columns: nothing is wider, and every word is still there."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modal.report import breadth, broken, fitted, folded, grid, titled
from modal.report.fitting import COLUMNS_MIN, columns

WORDS = st.lists(st.text("abω振e\u0301-=:", min_size=1, max_size=12), max_size=30).map(" ".join)
CELLS = st.lists(st.lists(st.text("ab1ω振 -", max_size=30), min_size=4, max_size=4), min_size=1, max_size=6)
HEADINGS = ["number", "ω (rad/s)", "description", "a long heading (kg m²)"]


@settings(max_examples=60, deadline=None)
@given(text=WORDS, width=st.integers(COLUMNS_MIN, 90))
def test_lines_are_folded_between_words(text: str, width: int) -> None:
    lines = folded(text, width).split("\n")
    assert "".join("".join(lines).split()) == "".join(text.split())
    assert all(breadth(line) <= width for line in lines)


@settings(max_examples=60, deadline=None)
@given(cells=CELLS, width=st.integers(COLUMNS_MIN, 90))
def test_tables_are_stacked_and_nothing_is_lost(cells: list[list[str]], width: int) -> None:
    with fitted(width):
        text = grid(cells, HEADINGS)
    assert all(breadth(line) <= width for line in text.split("\n"))
    letters = sorted("".join("".join(row) for row in cells).replace(" ", "").replace("-", ""))
    for letter in set(letters):
        assert text.count(letter) >= letters.count(letter)


def test_a_table_that_fits_is_as_ever() -> None:
    whole = grid([["1", "2.5", "words", "3"]], HEADINGS)
    with fitted(80):
        assert grid([["1", "2.5", "words", "3"]], HEADINGS) == whole
    assert whole.splitlines() == [
        "number  ω (rad/s)  description  a long heading (kg m²)",
        "------  ---------  -----------  ----------------------",
        "1             2.5  words                             3",
    ]


def test_the_columns_that_name_a_row_are_repeated() -> None:
    cells = [[m, a, "x" * 20, "y" * 20] for m in "12" for a in ("10", "30")]
    with fitted(40):
        text = grid(cells, ["mode", "angle", "first", "second"])
    heads = [line.split() for line in text.splitlines() if "mode" in line]
    assert heads == [["mode", "angle", "first"], ["mode", "angle", "second"]]


def test_text_hangs_under_its_own_beginning() -> None:
    assert folded("energy  one two three four", 20).split("\n") == ["energy  one two", "        three four"]
    assert folded("- one two three four five six", 20).split("\n") == ["- one two three four", "  five six"]
    assert folded("# one two three four five", 20, "# ").split("\n") == ["# one two three four", "# five"]
    assert folded("=" * 50, 20) == "=" * 20
    assert folded("x" * 50, 20) == "x" * 50


def test_wide_letters_count_twice_and_accents_not_at_all() -> None:
    assert [breadth(text) for text in ("abc", "振り子", "e\u0301", "ＡＢ", "")] == [3, 6, 1, 4, 0]
    assert folded("振" * 30, 20) == "\n".join(["振" * 10] * 3)


def test_the_width_ends_with_its_block_even_by_an_error() -> None:
    def fail() -> None:
        assert columns() == 40
        with fitted(None):
            assert columns() is None
        with fitted(3):
            assert columns() == COLUMNS_MIN
        raise ZeroDivisionError

    assert columns() is None
    with pytest.raises(ZeroDivisionError), fitted(40):
        fail()
    assert columns() is None


@settings(max_examples=40, deadline=None)
@given(text=st.text("abω振e\u0301 ", max_size=120), width=st.integers(2, 40))
def test_long_words_are_broken_where_nothing_else_helps(text: str, width: int) -> None:
    lines = broken(text, width)
    assert all(breadth(line) <= width for line in lines)
    assert "".join("".join(lines).split()) == "".join(text.split())
    assert broken(text, None) == [text]


def test_markdown_is_never_folded() -> None:
    with fitted(20):
        assert titled("a long title", "words and more words", ["x " * 30], "markdown").count("\n") == 3
