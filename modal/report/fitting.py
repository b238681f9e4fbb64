"""Numbers and lists in running text, and text within the columns of a terminal.

Nothing is folded unless a width is in force, which `fitted` sets for the text made inside it: the packages make tables
and sentences as wide as they are, and the command line sets the width of the terminal that they are printed on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import isinf
from typing import NamedTuple
from unicodedata import category, east_asian_width


class TableLimit(NamedTuple):
    """A limit on a table: its rows, and the columns that fit; `elsewhere` says where the rest is."""

    rows: int
    elsewhere: str = ""


TABLE_ROWS = 12
"""Format: rows of a table on a terminal."""
COLUMNS_MIN = 20
"""Format: columns below which text is as wide as it would be here."""
_COLUMNS: ContextVar[int | None] = ContextVar("columns", default=None)
_CHARSET: ContextVar[str | None] = ContextVar("charset", default=None)
_LIMIT: ContextVar[TableLimit | None] = ContextVar("limit", default=None)
_RULE = re.compile(r"\s*([-=])\1+")
_WORD = re.compile(r"\d\S* %[.,;:)]*(?=\s|$)|\S+")  # a number keeps its sign for per cent
_HANGING = re.compile(r"\s*(?:[-*] |\S+ {2,})?")
"""The prefix of a line: blanks, a bullet, or a name in a column of names."""


def charset() -> str | None:
    """The encoding for which text is laid out; None for one that has every letter."""
    return _CHARSET.get()


def columns() -> int | None:
    """The columns that a line may take; None for any number."""
    return _COLUMNS.get()


def limit() -> TableLimit | None:
    """How much of a table is shown; None for all of it."""
    return _LIMIT.get()


def fits(width: int) -> bool:
    """Whether this many columns are no more than those in force."""
    most = columns()
    return most is None or width <= most


@contextmanager
def fitted(to: int | None, encoding: str | None = None, most: TableLimit | None = None) -> Iterator[None]:
    """Make text inside this block fit into this many columns, any number for None.

    With an encoding, letters that it lacks take the columns of their spelling (`modal.report.spelling`).  Tables are
    shown as far as `most` says, whole without it.

    >>> with fitted(24):
    ...     print(folded("a line of more than twenty columns"))
    a line of more than
    twenty columns
    """
    tokens = _COLUMNS.set(to and max(to, COLUMNS_MIN)), _CHARSET.set(encoding), _LIMIT.set(most if to else None)
    try:
        yield
    finally:
        _COLUMNS.reset(tokens[0])
        _CHARSET.reset(tokens[1])
        _LIMIT.reset(tokens[2])


def breadth(text: str) -> int:
    """The columns that a terminal gives to a text: two to a wide letter, none to an accent that joins the one before.

    >>> breadth("ω"), breadth("振り子"), breadth("e\u0301")
    (1, 6, 1)
    """
    if text.isascii():
        return len(text)
    encoding = charset()
    if encoding:
        from modal.report.spelling import spelled

        text = spelled(text, encoding)
    return sum(map(_letter, text))


def _letter(letter: str) -> int:
    if category(letter) in {"Mn", "Me", "Cf"}:
        return 0
    return 2 if east_asian_width(letter) in {"W", "F"} else 1


def padded(text: str, width: int, align: str = "left") -> str:
    """The text with blanks up to a width."""
    blanks = " " * (width - breadth(text))
    return text + blanks if align == "left" else blanks + text


def folded(text: str, within: int | None = None, mark: str = "") -> str:
    """The text with every longer line folded between words, what follows under the text of the line.

    `within` columns, by default those in force.  A word is broken only between wide letters, which need no blanks; any
    other stays whole, however long, so that it can be copied (`broken` breaks it).  A rule of equal signs is cut.
    Lines that follow begin with the comment's `mark`, if there is one.
    """
    most = within or columns()
    return text if most is None else "\n".join(part for line in text.split("\n") for part in _fold(line, most, mark))


def _fold(line: str, most: int, mark: str) -> Iterator[str]:
    """The lines of one line."""
    if breadth(line) <= most:
        yield line
        return
    if _RULE.fullmatch(line):
        yield line[:most]
        return
    start = _HANGING.match(line.removeprefix(mark))
    hanging = len(start[0]) if start else 0
    indent = mark + " " * (hanging if hanging <= most // 2 else 2)
    at = len(mark) + hanging if hanging <= most // 2 else 0
    yield from filled(line[at:], most, line[:at], indent)


def broken(text: str, most: int | None) -> list[str]:
    """The lines of a text of at most this many columns, None for any number: a word longer than a line is broken.

    >>> broken("a longest word", 5)
    ['a', 'longe', 'st', 'word']
    """
    if most is None or breadth(text) <= most:
        return [text]
    return [piece for line in filled(text, most) for piece in cut(line, most)]


def cut(line: str, most: int) -> Iterator[str]:
    """A line in pieces of at most this many columns, between any letters."""
    start = used = 0
    for at, letter in enumerate(line):
        wide = breadth(letter)
        if used + wide > most and at > start:
            yield line[start:at]
            start, used = at, 0
        used += wide
    yield line[start:]


def filled(text: str, most: int, first: str = "", then: str = "") -> Iterator[str]:
    """Lines of at most this many columns, the first after `first`, all others after `then`."""
    line, empty = first, True
    for word in _WORD.findall(text):
        for piece, joined in _pieces(word, most - breadth(then)):
            gap = "" if joined or empty else " "
            if not empty and breadth(line) + len(gap) + breadth(piece) > most:
                yield line
                line, gap = then, ""
            line, empty = line + gap + piece, False
    yield line


def _pieces(word: str, most: int) -> Iterator[tuple[str, bool]]:
    """A word, or where it is too wide its wide letters one by one; and whether each joins the one before it."""
    if word.isascii() or breadth(word) <= most:
        yield word, False
        return
    for number, run in enumerate(re.finditer(r"[\x00-\x7f]+|[^\x00-\x7f]", word)):
        yield run[0], number > 0


WIDTH = 110
"""Format: characters per line of a report that no terminal limits."""


def line_width() -> int:
    """Characters per line of a report."""
    return min(WIDTH, columns() or WIDTH)


def short(value: float) -> str:
    """Six significant digits."""
    return "∞" if isinf(value) else f"{value:.6g}"


def percent(share: float) -> str:
    """Three significant digits."""
    return f"{100 * share:.3g} %"


def rad(omega: float) -> str:
    """An angular frequency, nine significant digits."""
    return "∞" if isinf(omega) else f"{omega:.9g} rad/s"


def counted(number: int, noun: str, plural: str) -> str:
    """A number and its noun."""
    return f"{number} {noun if number == 1 else plural}"


def listed(shown: Sequence[str], total: int) -> str:
    """`a, b and c`, or `a, b, … (1000 in all)` if only some are shown."""
    if len(shown) < total:
        return f"{', '.join(shown)}, … ({total} in all)"
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1]))) if shown else "none"


def with_unit(heading: str, unit: str) -> str:
    """A heading with its unit in parentheses, if there is one."""
    return f"{heading} ({unit})" if unit else heading


def capital(words: str) -> str:
    """The text with its first letter capitalized."""
    return words[:1].upper() + words[1:]


class Silence:
    """A progress callback that does nothing. Signatures show it by its name, `silent`."""

    def __call__(self, *progress: object) -> None:
        """Say nothing."""

    def __repr__(self) -> str:
        return "silent"

    def __reduce__(self) -> str:
        return "silent"


silent = Silence()
