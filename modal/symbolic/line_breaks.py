"""LaTeX formulas broken into lines that fit a page.

A formula of SymPy's may be broken before a sign and, if necessary, between factors, at any depth of parentheses and
outside of everything that LaTeX keeps together: fractions, roots, matrices.  Widths are estimated in letters.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

LINE = 54.0
"""Letters on a line of the article class, 345 pt, with a margin for the error of the estimate."""
SHORTEST = 0.55
"""Fraction of a line that must be filled for a break at smaller depth to be preferred."""
_TOKEN = re.compile(r"\\(?:begin|end)\{[a-z*]+\}|\\[a-zA-Z]+|\\.|.", re.DOTALL)
_SIGNS = {"=": 3.2, "+": 2.4, "-": 2.4, r"\cdot": 1.6, ",": 0.8, "(": 0.8, ")": 0.8, "[": 0.6, "]": 0.6, "m": 1.7}
_NAMES = {rf"\{name}": 3.2 for name in ("sin", "cos", "cot", "tan", "log")}
_SILENT = {r"\left", r"\right", r"\bigl", r"\bigr", r"\,", r"\displaystyle", " ", "{", "}", "&"}
_ACCENTS = {r"\dot", r"\ddot", r"\hat", r"\bar"}
_SCRIPT = 0.75
UNPARTED = (r"\right", "}", "^", "_", " ", ",")
"""Tokens before which a line must not end."""
FACTOR = 1.5
"""The cost of a break between factors, in depths of parentheses."""


def fits(latex: str) -> bool:
    """Whether a formula fits one line."""
    return width(latex) <= LINE


def lines(latex: str, room: float = LINE) -> list[str]:
    """The formula over several lines, each of which fits `room` letters as far as it can be broken."""
    written, start, pieces = [], 0, list(_pieces(latex))
    while start < len(pieces):
        end = _end(pieces, start, room)
        written.append("".join(piece.text for piece in pieces[start:end]).strip())
        start = end
    return written


def width(latex: str) -> float:
    r"""How many letters wide a formula is set, about.

    >>> width("xx") == 2 * width("x") < width(r"\frac{xx}{x}")
    True
    """
    return _Reader(latex).width()


@dataclass(frozen=True)
class _Unbroken:
    """A part between two possible breaks: its text and width, and the cost of a break before it."""

    text: str
    width: float
    cost: float


def _end(pieces: list[_Unbroken], start: int, room: float) -> int:
    """Where the line that begins at a piece ends: at the cheapest break in its last part, the last of these."""
    filled, choices, last = 0.0, [], start + 1
    for place in range(start, len(pieces)):
        if filled + pieces[place].width > room and place > start:
            break
        filled += pieces[place].width
        last = place + 1
        if last < len(pieces) and filled > SHORTEST * room:
            choices.append((pieces[last].cost, -last))
    else:
        return len(pieces)
    return -min(choices)[1] if choices else last


def _pieces(latex: str) -> Iterator[_Unbroken]:
    """The formula cut at all places where it may be broken; parentheses grow no more, so that lines may part them."""
    text, cost, depth, parentheses = "", 0.0, 0, 0
    for token in _TOKEN.findall(latex):
        if depth == 0 and text.endswith(" ") and text.strip()[-1:] not in "+-=" and token not in UNPARTED:
            yield _Unbroken(text, width(text), cost)
            text, cost = "", parentheses + (0.0 if token in "+-=" else FACTOR)
        if token in (r"\left", r"\right") and depth == 0:
            parentheses += 1 if token == r"\left" else -1
            text += r"\bigl" if token == r"\left" else r"\bigr"
            continue
        depth += (token == "{" or token.startswith(r"\begin")) - (token == "}" or token.startswith(r"\end"))
        text += token
    yield _Unbroken(text, width(text), cost)


class _Reader:
    """Reads widths off a formula from left to right."""

    def __init__(self, latex: str) -> None:
        self.tokens = [token for token in _TOKEN.findall(latex) if token != " "]
        self.at = 0

    def width(self, end: str = "") -> float:
        """Up to a token `end`, or of all the rest."""
        total, scripts = 0.0, [0.0]
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            self.at += 1
            if token == end:
                break
            if token in "^_":
                scripts.append(_SCRIPT * self._group())
                continue
            total, scripts = total + max(scripts), [0.0]
            total += self._one(token)
        return total + max(scripts)

    def _one(self, token: str) -> float:
        if token == "{":
            return self.width("}")
        if token == r"\frac":
            return max(self._group(), self._group()) + 0.5
        if token.startswith(r"\begin"):
            return self._matrix()
        if token in _ACCENTS:
            return self._group()
        return _NAMES.get(token, _SIGNS.get(token, 0.0 if token in _SILENT else 1.0))

    def _group(self) -> float:
        """A group in braces, or one token."""
        self.at += 1
        token = self.tokens[self.at - 1] if self.at <= len(self.tokens) else ""
        return self._one(token) if token else 0.0

    def _matrix(self) -> float:
        """Columns as wide as their widest cells, two letters apart."""
        columns: list[float] = []
        cell, column = "", 0
        depth = 1
        while depth and self.at < len(self.tokens):
            token = self.tokens[self.at]
            self.at += 1
            depth += token.startswith(r"\begin") - token.startswith(r"\end")
            if (depth == 1 and token in ("&", r"\\")) or not depth:
                columns += [0.0] * (column + 1 - len(columns))
                columns[column] = max(columns[column], width(cell))
                cell, column = "", 0 if token == r"\\" else column + 1
            else:
                cell += token + (" " if token[:1] == "\\" else "")
        return sum(columns) + 1.8 * len(columns)
