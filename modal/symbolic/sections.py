"""What a derivation is made of: titled sections of lines, each a few words and perhaps a formula."""

from __future__ import annotations

from typing import Any, NamedTuple


class Line(NamedTuple):
    """What a formula is, and the formula; a remark has no formula."""

    words: str
    formula: Any = None


class Section(NamedTuple):
    """A title and its lines."""

    title: str
    lines: list[Line]
