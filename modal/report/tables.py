"""Tables of words and numbers as text or Markdown, records as CSV or JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log10
from typing import Any, TypeVar

from modal.report.escaping import csv_rows, json_text, markdown, visible

T = TypeVar("T")

FORMATS = {"text": "simple", "markdown": "github"}
LEFT = {"at", "description", "event", "lines", "loci", "meeting", "method", "number", "pendula", "stability"}
"""Headings of columns of text."""
NOTHING = "–"
"""Printed in place of an undefined quantity."""


def titled(scene: str, what: str, parts: Sequence[str], form: str) -> str:
    """The parts that are not empty, under a title made of the scene's and of `what` is reported."""
    title = f"{scene or 'Modes'}: {what}"
    head = f"**{markdown(title)}**" if form == "markdown" else visible(title)
    return "\n\n".join([head, *(part for part in parts if part)]) + "\n"


def grid(cells: Sequence[Sequence[str]], headings: Sequence[str], form: str = "text") -> str:
    """Cells under headings, text aligned left and numbers right; the empty string if there are no cells."""
    from tabulate import tabulate

    align = ["left" if heading in LEFT else "right" for heading in headings]
    return tabulate(cells, headings, tablefmt=FORMATS[form], colalign=align, disable_numparse=True) if cells else ""


def as_csv(records: Sequence[dict[str, Any]]) -> str:
    """One line per record, under the keys of the first."""
    return csv_rows([list(records[0]) if records else [], *(record.values() for record in records)])


def as_json(whole: dict[str, Any]) -> str:
    """Readable JSON."""
    return json_text(whole) + "\n"


def digits(value: float, relative_error: float, most: int) -> str:
    """The value to at most `most` significant digits, and only those that the error leaves certain."""
    if not isfinite(value) or not relative_error < 1:
        return NOTHING
    return f"{value:#.{min(most, max(1, int(-log10(max(relative_error, 1e-17)))))}g}".rstrip(".") if value else "0"


def finite(value: T) -> T | None:
    """The value itself, or None for NaN and infinity, which JSON lacks."""
    return None if isinstance(value, float) and not isfinite(value) else value
