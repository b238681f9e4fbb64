"""Tables of words and numbers as text or Markdown, records as CSV or JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import isfinite, log10
from typing import Any, Literal, TypeVar

from modal.report.escaping import csv_rows, json_text, markdown, visible
from modal.report.fitting import breadth, broken, columns, folded, limit, padded

T = TypeVar("T")
Form = Literal["text", "csv", "json", "markdown"]
"""The formats of a report."""

LEFT = {
    *("action", "at", "description", "engine", "event", "lines", "loci", "meeting", "method", "moves", "number"),
    *("of", "part", "pendula", "place", "runs", "stability"),
}
"""Headings of columns of text."""
NOTHING = "–"
"""Printed in place of an undefined quantity."""
WORDS_COLUMNS = 12
"""Format: width of a column of words below which it is not made narrower."""
NAMES_MAX = 9
"""Format: columns that are omitted and named."""


def titled(scene: str, what: str, parts: Sequence[str], form: str) -> str:
    """The parts that are not empty, under a title made of the scene's and of `what` is reported."""
    title = entitled(scene or "Modes", what)
    if form == "markdown":
        return "\n\n".join([f"**{markdown(title)}**", *(part for part in parts if part)]) + "\n"
    return folded("\n\n".join([headed(title), *(part for part in parts if part)])) + "\n"


def entitled(scene: str, what: str) -> str:
    """A title made of the scene's and of what is shown, behind a dash where the scene's has a colon already."""
    return f"{scene}{' –' if ':' in scene else ':'} {what}"


def headed(title: str) -> str:
    """A title of text, within the columns in force, where even a single word is broken that is longer than these."""
    return "\n".join(broken(visible(title), columns()))


def grid(cells: Sequence[Sequence[str]], headings: Sequence[str], form: str = "text", spare: Sequence[str] = ()) -> str:
    """Cells under headings, text aligned left and numbers right; the empty string if there are no cells.

    In text as `layout` lays it out.
    """
    if not cells:
        return ""
    align = ["left" if heading in LEFT else "right" for heading in headings]
    if form == "markdown":
        from tabulate import tabulate

        return tabulate(cells, headings, tablefmt="github", colalign=align, disable_numparse=True)
    return aligned(cells, headings, align, spare)


def aligned(
    cells: Sequence[Sequence[str]], headings: Sequence[str], align: Sequence[str], spare: Sequence[str] = ()
) -> str:
    """Cells under headings as text, with omissions in lines below (`layout`)."""
    body, notes = layout(cells, headings, align, spare)
    return "\n".join([body, *map(folded, notes)])


def layout(
    cells: Sequence[Sequence[str]],
    headings: Sequence[str],
    align: Sequence[str],
    spare: Sequence[str] = (),
    elsewhere: str = "",
    *,
    whole: bool = False,
) -> tuple[str, list[str]]:
    """A table as text, and notes on what is omitted of it.  Imports nothing: commands start quickly.

    The headings of a table that is too wide for the columns in force (`fitted`) are broken between words, then the
    columns of the `spare` headings are omitted, one after the other, as far as it takes; then columns of words are made
    narrower. One that is still too wide is stacked: its columns follow in several parts below each other, each of which
    begins with the columns that name a row. Where there is a limit, its first part is all, and rows beyond the limit
    are omitted. `elsewhere`, or the limit, says where columns are that are omitted. The headings stay `whole` as long
    as there are spare ones.
    """
    most, rest = columns(), limit()
    total, shown, dropped = len(cells), list(range(len(headings))), list[int]()
    cells = cells[: rest.rows] if rest else cells
    order = [list(headings).index(name) for name in spare if name in headings]
    while (widths := _room(cells, headings, shown, most, (not whole) + 2 * (not order))) is None and order:
        dropped.append(order.pop(0))
        shown.remove(dropped[-1])
    parts = [shown]
    if widths is None and most is not None:
        every = widths_of([[row[k] for k in shown] for row in cells], [headings[k] for k in shown])
        keys = _keys([[row[k] for k in shown] for row in cells], every, most)
        limits = _limits(every, keys, most)
        parts = [[shown[k] for k in part] for part in _stacked(limits, keys, most)]
        widths = dict(zip(shown, limits, strict=True))
        if rest:
            dropped += [k for part in parts[1:] for k in part[keys:]]
            parts = parts[:1]
    lines = (_lines(*_of(part, cells, headings, align), [(widths or {})[k] for k in part]) for part in parts)
    notes = [f"… {total - len(cells)} more{rest.elsewhere if rest else ''}"] * (len(cells) < total)
    if dropped:
        names = ", ".join(headings[k] for k in dropped[:NAMES_MAX])
        names += f", … ({len(dropped)} in all)" * (len(dropped) > NAMES_MAX)
        place = f"; {elsewhere}" if elsewhere else rest.elsewhere if rest else ""
        notes.append(f"omitted to fit {most} columns: {names}{place}")
    return "\n\n".join(map("\n".join, lines)), notes


def _of(
    part: Sequence[int], cells: Sequence[Sequence[str]], headings: Sequence[str], align: Sequence[str]
) -> tuple[list[list[str]], list[str], list[str]]:
    """Some columns of a table."""
    return [[row[k] for k in part] for row in cells], [headings[k] for k in part], [align[k] for k in part]


def _room(
    cells: Sequence[Sequence[str]], headings: Sequence[str], shown: Sequence[int], most: int | None, means: int
) -> dict[int, int] | None:
    """The columns that each column of a table takes, by its place, where all fit; None if they do not.

    The `means` are none (0), headings broken between words (1), columns of words made narrower too (2 and more).
    """
    body, heads, _ = _of(shown, cells, headings, headings)
    widths: list[int] | None = widths_of(body, heads)
    if most is not None and full(widths or ()) > most:
        narrow = widths_of(body, [max(head.split(), key=breadth, default="") for head in heads])
        fits = means == 1 and full(narrow) <= most
        widths = _shrunk(body, narrow, most) if means > 1 else narrow if fits else None
    return None if widths is None else dict(zip(shown, widths, strict=True))


def _shrunk(cells: Sequence[Sequence[str]], widths: list[int], most: int) -> list[int] | None:
    """The widths, columns of words narrower where that makes them fit, the widest first; None if it does not."""
    narrow = list(widths)
    words = [k for k in range(len(widths)) if any(" " in row[k] for row in cells)]
    for k in sorted(words, key=lambda k: -widths[k]):
        narrow[k] -= min(max(full(narrow) - most, 0), max(narrow[k] - WORDS_COLUMNS, 0))
    return narrow if full(narrow) <= most else None


def widths_of(cells: Sequence[Sequence[str]], headings: Sequence[str]) -> list[int]:
    """The columns that each column of a table takes."""
    return [max(map(breadth, column)) for column in zip(headings, *cells, strict=True)]


def full(widths: Iterable[int]) -> int:
    """The columns that a whole table takes, with two blanks between its columns."""
    every = list(widths)
    return sum(every) + 2 * (len(every) - 1)


def _keys(cells: Sequence[Sequence[str]], widths: Sequence[int], most: int) -> int:
    """How many columns, up to three, it takes to name every row: 1 where none do, or no room is left next to them."""
    for count in range(1, min(3, len(widths) - 1) + 1):
        if full(widths[:count]) > most // 2:
            break
        if len({tuple(row[:count]) for row in cells}) == len(cells):
            return count
    return 1


def _limits(widths: Sequence[int], keys: int, most: int) -> list[int]:
    """The columns that each column may take: those that name a row leave room for any other, or take half of it."""
    room = max(most // 2, most - 2 - max(widths[keys:], default=0))
    first = [min(width, room) for width in widths[:keys]]
    return first + [min(width, max(most - sum(first) - 2 * keys, 1)) for width in widths[keys:]]


def _stacked(widths: Sequence[int], keys: int, most: int) -> Iterator[list[int]]:
    """The columns of each part."""
    shown = list(range(keys))
    for number in range(keys, len(widths)):
        if len(shown) > keys and full(widths[k] for k in [*shown, number]) > most:
            yield shown
            shown = list(range(keys))
        shown.append(number)
    yield shown


def _lines(
    cells: Sequence[Sequence[str]], headings: Sequence[str], align: Sequence[str], widths: Sequence[int]
) -> Iterator[str]:
    """Headings, rules and rows, every one of as many lines as its highest cell."""
    for row in (headings, ["-" * width for width in widths], *cells):
        pieces = [broken(cell, width) for cell, width in zip(row, widths, strict=True)]
        for number in range(max(map(len, pieces))):
            line = (piece[number] if number < len(piece) else "" for piece in pieces)
            whole = (padded(cell, width, side) for cell, width, side in zip(line, widths, align, strict=True))
            yield "  ".join(whole).rstrip()


def as_csv(records: Sequence[dict[str, Any]]) -> str:
    """One line per record, under the keys of the first."""
    return csv_rows([list(records[0]) if records else [], *(record.values() for record in records)])


def as_json(whole: dict[str, Any]) -> str:
    """Readable JSON."""
    return json_text(whole) + "\n"


def digits(value: float, relative_error: float, most: int) -> str:
    """Return the value to at most `most` significant digits, and only those that are certain within the error."""
    if not isfinite(value) or not relative_error < 1:
        return NOTHING
    return f"{value:#.{min(most, max(1, int(-log10(max(relative_error, 1e-17)))))}g}".rstrip(".") if value else "0"


def finite(value: T) -> T | None:
    """The value itself, or None for NaN and infinity, which JSON lacks."""
    return None if isinstance(value, float) and not isfinite(value) else value
