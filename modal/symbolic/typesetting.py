"""A derivation as titled sections of formulas, printed as plain text, LaTeX or Markdown that can be pasted.

Words between two dollars are mathematics in plain letters, as in "in $x = ω²$": text shows them as they are, LaTeX and
Markdown set them, with units upright and numbers of many digits rounded to DIGITS_SHOWN.

A formula of SymPy's that is longer than a line is broken before a sign and, if necessary, between factors, at any depth
of parentheses and outside of everything that LaTeX keeps together: fractions, roots, matrices.  Widths are estimated in
letters.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from sys import float_info
from typing import Any, NamedTuple

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from modal.report import LETTERS, breadth, capital, fits, latex, markdown, visible

LINE = 54.0
"""Format: letters on a line of the article class, 345 pt, with a margin for the error of the estimate."""
SHORTEST_LINE = 0.25
"""Format: fraction of a line that must be filled for a break at smaller depth to be preferred."""
_TOKEN = re.compile(r"\\(?:begin|end)\{[a-z*]+\}|\\[a-zA-Z]+|\\.|.", re.DOTALL)
_SIGNS = {"=": 3.2, "+": 2.4, "-": 2.4, r"\cdot": 1.6, ",": 0.8, "(": 0.8, ")": 0.8, "[": 0.6, "]": 0.6, "m": 1.7}
_NAMES = {rf"\{name}": 3.2 for name in ("sin", "cos", "cot", "tan", "log")}
_SILENT = {r"\left", r"\right", r"\bigl", r"\bigr", r"\,", r"\displaystyle", " ", "{", "}", "&"}
_ACCENTS = {r"\dot", r"\ddot", r"\hat", r"\bar"}
WIDTH_OF_SCRIPT = 0.75
"""Format: width of a letter in an index or exponent over that of one on the line."""
SIGNS = ("+", "-", "=", r"\pm")
UNPARTED = (r"\right", "}", "^", "_", " ", ",")
"""Tokens before which a line must not end."""
COST_OF_FACTORS = 1.5
"""Format: the cost of a break between factors, in depths of parentheses."""


def is_short(latex: str) -> bool:
    """Whether a formula fits one line."""
    return letters(latex) <= LINE


def broken_lines(latex: str, room: float = LINE) -> list[str]:
    """The formula over several lines, each of which fits `room` letters as far as it can be broken."""
    lines, start, pieces = [], 0, list(_pieces(latex))
    while start < len(pieces):
        end = _end(pieces, start, room)
        lines.append("".join(piece.text for piece in pieces[start:end]).strip())
        start = end
    return lines


def letters(latex: str) -> float:
    r"""How many letters wide a formula is set, about.

    >>> letters("xx") == 2 * letters("x") < letters(r"\frac{xx}{x}")
    True
    """
    return _Reader(latex).letters()


@dataclass(frozen=True)
class _Unbroken:
    """A part between two possible breaks: its text and width, and the cost of a break before it."""

    text: str
    width: float
    cost: float


def _end(pieces: list[_Unbroken], start: int, room: float) -> int:
    """Where the line that begins at a piece ends: at the cheapest break in its last part, the last of these."""
    width, choices, last = 0.0, [], start + 1
    for place in range(start, len(pieces)):
        if width + pieces[place].width > room and place > start:
            break
        width += pieces[place].width
        last = place + 1
        if last < len(pieces) and width > SHORTEST_LINE * room:
            choices.append((pieces[last].cost, -last))
    else:
        return len(pieces)
    return -min(choices)[1] if choices else last


def _pieces(latex: str) -> Iterator[_Unbroken]:
    """The formula cut at all places where it may be broken; parentheses grow no more, so that lines may part them."""
    text, cost, depth, parentheses = "", 0.0, 0, 0
    for token in _TOKEN.findall(latex):
        is_behind_sign = not text.strip() or text.strip().endswith(SIGNS)
        if depth == 0 and text.endswith(" ") and not is_behind_sign and token not in UNPARTED:
            yield _Unbroken(text, letters(text), cost)
            text, cost = "", parentheses + (0.0 if token in SIGNS else COST_OF_FACTORS)
        if token in (r"\left", r"\right") and depth == 0:
            parentheses += 1 if token == r"\left" else -1
            text += r"\bigl" if token == r"\left" else r"\bigr"
            continue
        depth += (token == "{" or token.startswith(r"\begin")) - (token == "}" or token.startswith(r"\end"))
        text += token
    yield _Unbroken(text, letters(text), cost)


class _Reader:
    """Reads widths off a formula from left to right."""

    def __init__(self, latex: str) -> None:
        self.tokens = [token for token in _TOKEN.findall(latex) if token != " "]
        self.at = 0

    def letters(self, end: str = "") -> float:
        """Up to a token `end`, or of all the rest."""
        total, scripts = 0.0, [0.0]
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            self.at += 1
            if token == end:
                break
            if token in "^_":
                scripts.append(WIDTH_OF_SCRIPT * self._group())
                continue
            total, scripts = total + max(scripts), [0.0]
            total += self._one(token)
        return total + max(scripts)

    def _one(self, token: str) -> float:
        if token == "{":
            return self.letters("}")
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
                columns[column] = max(columns[column], letters(cell))
                cell, column = "", 0 if token == r"\\" else column + 1
            else:
                cell += token + (" " if token[:1] == "\\" else "")
        return sum(columns) + 1.8 * len(columns)


GREEK = {"theta": "θ", "phi": "φ", "pi": "π", "lambda": "λ", "omega": "ω", "sigma": "σ", "eta": "η", "ell": "ℓ"}
_NAME = re.compile(r"\b(theta|phi|pi|lambda|omega|sigma|eta|ell|[psxyzu])(ddot|dot)?((?:_[0-9]+)*|_[0-9A-Za-z]\w*)\b")
_CALLED = re.compile(r"(theta|phi|eta|[A-Za-z])(ddot|dot)?_(\w*[A-Za-z]\w+|\w+[A-Za-z]\w*)")
_DOTTED = {"dot": r"\dot{%s}", "ddot": r"\ddot{%s}", None: "%s"}
_INDEXED = re.compile(r"(?<![\w$])([A-Za-zθφλωσΔ])_(\w)\b(?!\w)")
DIGITS_SHOWN = 6
"""Format: digits of a computed number in LaTeX and Markdown; text has them all."""
UNITS = {"rad²/s²": r"\mathrm{rad^2\,s^{-2}}", "rad/s": r"\mathrm{rad\,s^{-1}}", "1/s": r"\mathrm{s^{-1}}"}
"""Units behind a number or in parentheses."""
_UNIT = re.compile(rf"(?<=[\d.] )({'|'.join(UNITS)}|s²)$|\(({'|'.join(UNITS)}|s²)\)$")
_NUMBER = re.compile(rf"\d+\.\d{{{DIGITS_SHOWN},}}(?:e[+-]?\d+)?")
_MATHEMATICS = re.compile(r"\$([^$]*)\$")
_SUPERSCRIPTS = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True))
_LETTERS = {**{sign: f"\\{name}" for name, sign in GREEK.items()}, "ζ": r"\zeta", "κ": r"\kappa", "−": "-", "±": r"\pm"}


class Line(NamedTuple):
    """A description and a formula; a remark has no formula."""

    words: str
    formula: Any = None


class Section(NamedTuple):
    """A title and its lines."""

    title: str
    lines: list[Line]

    def _repr_latex_(self) -> str:
        blocks = [_inline(self.title)]
        for words, formula in self.lines:
            blocks.append(capital(_inline(words)) + ("." if formula is None else f": {in_display(formula)}"))
        return "\n\n".join(blocks)


def typeset(title: str, sections: Iterable[Section], form: str) -> str:
    """The document; `form` is text, latex, markdown or beamer."""
    return _WRITERS[form](title, list(sections))


FACTORS = "mIkdglLac"
"""Letters in the order of a product as books write it: m g l, k a²."""
_RANKED = re.compile(r"\b[A-J]0(?=[a-zA-Z])")


def _by_rank(formula: Any) -> dict[Any, Any]:
    """Every symbol of FACTORS with a name by which SymPy sorts it there, before all others."""
    ranks = {name: FACTORS.find(name.name[:1]) for name in formula.free_symbols if len(name.name.split("_")[0]) == 1}
    return {
        name: sp.Symbol(f"{'ABCDEFGHIJ'[rank]}0{name.name}", positive=True) for name, rank in ranks.items() if rank >= 0
    }


class _PositiveFirst:
    """A sum begins with a term without a minus sign, where it has one."""

    def _as_ordered_terms(self, sum_of_terms: Any, order: Any = None) -> list[Any]:
        terms: list[Any] = super()._as_ordered_terms(sum_of_terms, order)  # type: ignore[misc]
        first = next((term for term in terms if not term.could_extract_minus_sign()), terms[0])
        return [first, *(term for term in terms if term is not first)]


class _TextPrinter(_PositiveFirst, StrPrinter):  # type: ignore[misc]
    pass


class _LatexPrinter(_PositiveFirst, LatexPrinter):  # type: ignore[misc]
    def _print_Mul(self, product: Any) -> str:
        """With `long_frac_ratio`, where lines are broken, a numeric fraction alone stands before its factors."""
        coefficient, factors = product.as_coeff_Mul()
        is_fraction = coefficient.is_Rational and not coefficient.is_Integer and sp.denom(factors) == 1
        if not (self._settings["long_frac_ratio"] and is_fraction) or factors.is_Add:
            return str(super()._print_Mul(product))
        return f"{self._print(coefficient)} {self._print(factors)}"


def plain(formula: Any) -> str:
    """One line in ordinary notation: θ1'' for thetaddot_1, ^ for a power, a space for a product."""
    if isinstance(formula, sp.Equality):
        return f"{plain(formula.lhs)} = {plain(formula.rhs)}"
    if isinstance(formula, sp.MatrixBase):
        return _grid(formula)
    text = _RANKED.sub("", _TextPrinter().doprint(formula.xreplace(_by_rank(formula))))
    return _NAME.sub(_symbol, text).replace("**", "^").replace("*", " ")


def _symbol(match: re.Match[str]) -> str:
    name, dots, index = match.groups()
    marks = {"dot": "'", "ddot": "''", None: ""}[dots]
    commas = index.removeprefix("_").replace("_", ",")
    return GREEK.get(name, name) + (commas if commas.replace(",", "").isdigit() else index) + marks


def _grid(matrix: Any) -> str:
    cells = [[plain(value) for value in matrix.row(i)] for i in range(matrix.rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rows = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]
    lines = [f"      [ {row} ]" for row in rows]
    if fits(max(map(breadth, lines), default=0)):
        return "\n" + "\n".join(lines)
    entries = (f"      [{i + 1},{j + 1}]  {cell}" for i, row in enumerate(cells) for j, cell in enumerate(row))
    return "\n" + "\n".join(entries)


class PlusMinus(sp.Function):  # type: ignore[misc]
    """Two roots, given by their common part and the distance of each from it."""

    nargs = 2
    unit, unit_in_latex = "", ""

    def _sympystr(self, printer: Any) -> str:
        middle, distance = map(printer.doprint, self.args)
        return f"{middle} ± {distance}{self.unit}"

    def _latex(self, printer: Any) -> str:
        middle, distance = map(printer.doprint, self.args)
        return rf"{middle} \pm {distance}{self.unit_in_latex}"


class Conjugates(PlusMinus):
    """Two conjugate numbers, given by real and imaginary part."""

    unit, unit_in_latex = " i", r"\, i"


def in_latex(words: str) -> str:
    r"""Mathematics in plain letters as LaTeX.

    >>> print(in_latex("ω = 2.71754911798158 rad/s"))
    \omega = 2.71755\,\mathrm{rad\,s^{-1}}
    >>> print(in_latex("M q'' + D q' + K q = 0"), in_latex("λ = −g/(l ω²)"), in_latex("√(g/l)"))
    M \ddot{q} + D \dot{q} + K q = 0 \lambda = -g/(l \omega^{2}) \sqrt{g/l}
    """
    unit = _UNIT.search(words)
    if unit:
        words = words[: unit.start()].rstrip()
    text = _NUMBER.sub(lambda number: f"{float(number[0]):.{DIGITS_SHOWN}g}", words)
    text = re.sub(r"([a-z])('{1,2})", lambda m: _DOTTED["dot" if len(m[2]) == 1 else "ddot"] % m[1], text)
    text = re.sub(r"√\(([^()]*)\)", r"\\sqrt{\1}", text)
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: f"^{{{''.join(map(_SUPERSCRIPTS.__getitem__, m[0]))}}}", text)
    text = re.sub("|".join(_LETTERS), lambda m: _LETTERS[m[0]] + " ", text)
    text = re.sub(r"(\\[a-z]+) (?=[\^_/),])|- ", lambda m: m[1] or "-", re.sub(" +", " ", text))
    text = text.replace("det(", r"\det(").strip()
    if not unit:
        return text
    name = unit[1] or unit[2]
    upright = UNITS.get(name, r"\mathrm{s^2}")
    return rf"{text}\,{upright}" if unit[1] else rf"{text}\;({upright})"


def _text(title: str, sections: list[Section]) -> str:
    lines = [visible(title), ""]
    for section in sections:
        heading = _readable(section.title)
        lines += [heading, "-" * breadth(heading)]
        for words, formula in section.lines:
            lines.append(f"  {_readable(words)}" + (f":  {plain(formula)}" if formula is not None else ""))
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _readable(words: str) -> str:
    return _NAME.sub(_symbol, _MATHEMATICS.sub(r"\1", words))


def _latex(title: str, sections: list[Section]) -> str:
    lines = ["% needs the package amsmath", rf"\section*{{{latex(title)}}}"]
    for section in sections:
        lines += [rf"\subsection*{{{_escape(section.title)}}}"]
        for words, formula in section.lines:
            lines.append(capital(_escape(words)) + ("." if formula is None else ":"))
            lines += [] if formula is None else [_display(formula)]
    return "\n".join(lines) + "\n"


def _markdown(title: str, sections: list[Section]) -> str:
    blocks = [f"# {markdown(title)}"]
    for section in sections:
        blocks.append(f"## {_inline(section.title)}")
        for words, formula in section.lines:
            blocks.append(capital(_inline(words)) + ("." if formula is None else ":"))
            if formula is not None:
                blocks.append(in_display(formula))
    return "\n\n".join(blocks) + "\n"


def _beamer(title: str, sections: list[Section]) -> str:
    """Slides of the class beamer, a document by itself; remarks are the speaker's notes."""
    lines = [
        r"\documentclass{beamer}",
        r"\usepackage{amsmath}",
        r"\setbeamertemplate{navigation symbols}{}\setbeamertemplate{frametitle continuation}[from second]",
        r"% \setbeameroption{show notes} prints the speaker's notes",
        r"\newenvironment{labelled}{\begin{minipage}{\textwidth}\raggedright",
        r"\abovedisplayskip=3pt \abovedisplayshortskip=3pt \belowdisplayskip=3pt \belowdisplayshortskip=3pt}",
        r"{\end{minipage}\par\medskip}",
        rf"\title{{{latex(title)}}}",
        r"\date{}",
        r"\begin{document}",
        r"\begin{frame}\titlepage\end{frame}",
    ]
    for section in sections:
        lines.append(rf"\begin{{frame}}[allowframebreaks=0.8]{{{_escape(section.title)}}}")
        for words, formula in section.lines:
            if formula is not None:
                block = f"{capital(_escape(words))}:\n{_display(formula, 0.8 * LINE)}"
                lines.append(f"\\begin{{labelled}}\n{block}\n\\end{{labelled}}")
        notes = [f"{capital(_escape(words))}." for words, formula in section.lines if formula is None]
        lines += [*(notes if len(notes) == len(section.lines) else ()), r"\end{frame}"]
        lines += [rf"\note{{{' '.join(notes)}}}"] if 0 < len(notes) < len(section.lines) else []
    return "\n".join([*lines, r"\end{document}"]) + "\n"


def in_display(formula: Any) -> str:
    """A displayed formula between double dollars, as Markdown and notebooks take it."""
    body = _display(formula).replace(r"\begin{equation*}", "").replace(r"\end{equation*}", "")
    return f"$$\n{body.strip().replace('align*', 'aligned')}\n$$"


def _display(formula: Any, line: float = LINE) -> str:
    """A displayed formula, broken into lines if it is too long for one of this many letters."""
    text = _tex(formula)
    if letters(text) <= line:
        return f"\\begin{{equation*}}\n{text}\n\\end{{equation*}}"
    head, right = "", formula
    if isinstance(formula, sp.Equality):
        sides = formula.args if formula.rhs != 0 else (formula.rhs, formula.lhs)
        head, right = f"{_tex(sides[0])} ={{}}", sides[1]
    if letters(head) > line / 3:
        head, right = "", formula
    room = line - letters(head)
    body = " \\\\\n& ".join(broken_lines(_tex(right, long_frac_ratio=2), room))
    return f"\\begin{{align*}}\n{head}& {body}\n\\end{{align*}}"


def _inline(words: str) -> str:
    """Words, with mathematics in them between dollars."""
    pieces = _MATHEMATICS.split(words)
    return "".join(f"${in_latex(piece)}$" if at % 2 else _with_mathematics(piece) for at, piece in enumerate(pieces))


def _with_mathematics(words: str) -> str:
    """Coordinates, other named symbols and letters with an index in words, as mathematics."""
    words = _NAME.sub(lambda match: f"${_tex(sp.Symbol(match[0]))}$" if match[0] not in "psxyzu" else match[0], words)
    words = re.sub(r"\b(of|for) ([psxyzu])$", r"\1 $\2$", words)
    words = _INDEXED.sub(lambda match: f"${LETTERS.get(match[1], match[1])}_{{{match[2]}}}$", words)
    return words.replace("q''", r"$\ddot{q}$").replace("q'", r"$\dot{q}$")


def _tex(formula: Any, **settings: Any) -> str:
    if isinstance(formula, sp.Equality):
        return f"{_tex(formula.lhs, **settings)} = {_tex(formula.rhs, **settings)}"
    names = {name: name_in_latex for name in formula.free_symbols if (name_in_latex := _by_name(name.name))}
    computed = (
        number for number in formula.atoms(sp.Float) if number._prec <= float_info.mant_dig
    )  # others are proved
    rounded_numbers = {number: sp.Float(number, DIGITS_SHOWN) for number in computed}
    settings = {"symbol_names": names, "mat_str": "bmatrix", "mat_delim": "", "inv_trig_style": "full", **settings}
    ranks = _by_rank(formula)
    settings["symbol_names"] = names | {rank: names.get(name, sp.latex(name)) for name, rank in ranks.items()}
    text = str(_LatexPrinter(settings).doprint(formula.xreplace({**rounded_numbers, **ranks})))
    return re.sub(r"_\{(\d+) (\d+)\}", r"_{\1,\2}", text)


def _by_name(name: str) -> str:
    r"""The LaTeX of a symbol that a word follows, such as \dot{\phi}_{\mathrm{board}}; "" for any other symbol."""
    match = _CALLED.fullmatch(name)
    if match is None or all(part in GREEK or part.isdigit() for part in match[3].split("_")):
        return ""
    letter, dots, word = match.groups()
    letter = rf"\{letter}" if letter in GREEK else letter
    parts = word.split("_")
    count = next((k for k, part in enumerate(reversed(parts)) if not part.isdigit()), 0)
    index_word, numbers = (
        r"\_".join(parts[: len(parts) - count]),
        "".join(f",{part}" for part in parts[len(parts) - count :]),
    )
    return _DOTTED[dots] % letter + rf"_{{\mathrm{{{index_word}}}{numbers}}}"


def _escape(words: str) -> str:
    """For LaTeX text: named symbols as mathematics, everything else letter by letter."""
    parts = re.split(r"(\$[^$]*\$)", _inline(words))
    return "".join(part if part.startswith("$") else latex(part) for part in parts)


_WRITERS: dict[str, Callable[[str, list[Section]], str]] = {
    "text": _text,
    "latex": _latex,
    "markdown": _markdown,
    "beamer": _beamer,
}
