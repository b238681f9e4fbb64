"""Tables of words and numbers as text or Markdown, records as CSV or JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log10
from typing import Any

from modal.report.escaping import csv_rows, json_text, markdown, visible

FORMATS = {"text": "simple", "markdown": "github"}
LEFT = {"description", "lines", "method", "pendula", "stability"}
"""Headings of columns of words."""
NOTHING = "–"
"""What stands where a quantity has no meaning."""


def titled(scene: str, what: str, parts: Sequence[str], form: str) -> str:
    """The parts that are not empty under one title, that of a scene and what is told of it."""
    title = f"{scene or 'Modes'}: {what}"
    head = f"**{markdown(title)}**" if form == "markdown" else visible(title)
    return "\n\n".join([head, *(part for part in parts if part)]) + "\n"


def grid(cells: Sequence[Sequence[str]], headings: Sequence[str], form: str) -> str:
    """Cells under headings, words to the left and numbers to the right; nothing where there are no cells."""
    from tabulate import tabulate

    align = ["left" if heading in LEFT else "right" for heading in headings]
    return tabulate(cells, headings, tablefmt=FORMATS[form], colalign=align, disable_numparse=True) if cells else ""


def as_csv(records: Sequence[dict[str, Any]]) -> str:
    """One line a record."""
    return csv_rows([list(records[0]) if records else [], *(record.values() for record in records)])


def as_json(whole: dict[str, Any]) -> str:
    """Readable JSON."""
    return json_text(whole) + "\n"


def digits(value: float, relative_error: float, most: int) -> str:
    """At most so many significant digits, and no more than are certain."""
    if not isfinite(value) or not relative_error < 1:
        return NOTHING
    return f"{value:#.{min(most, max(1, int(-log10(max(relative_error, 1e-17)))))}g}".rstrip(".") if value else "0"


def finite(value: float) -> float | None:
    """None for what has no meaning."""
    return value if isfinite(value) else None
