"""A derivation as titled sections of formulas, printed as plain text, LaTeX or Markdown that can be pasted.

Words between two dollars are mathematics in plain letters, as in "in $x = ω²$": text shows them as they are, LaTeX and
Markdown set them, with units upright and numbers of many digits rounded to SHOWN.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import sympy as sp

from modal.report import LETTERS, breadth, fits, latex, markdown, visible
from modal.symbolic import line_breaks

GREEK = {"theta": "θ", "phi": "φ", "pi": "π", "lambda": "λ", "omega": "ω", "sigma": "σ", "eta": "η", "ell": "ℓ"}
_NAME = re.compile(r"\b(theta|phi|pi|lambda|omega|sigma|eta|ell|[psxyzu])(ddot|dot)?((?:_[0-9]+)*|_[0-9A-Za-z]\w*)\b")
_CALLED = re.compile(r"(theta|phi|eta|[A-Za-z])(ddot|dot)?_(\w*[A-Za-z]\w+|\w+[A-Za-z]\w*)")
_DOTTED = {"dot": r"\dot{%s}", "ddot": r"\ddot{%s}", None: "%s"}
_INDEXED = re.compile(r"(?<![\w$])([A-Za-zθφλωσΔ])_(\w)\b(?!\w)")
SHOWN = 6
"""Digits of a computed number in LaTeX and Markdown; text has them all."""
DOUBLE = 53
"""Bits of a computed number; one of more is proved, and shown with all its digits."""
UNITS = {"rad²/s²": r"\mathrm{rad^2\,s^{-2}}", "rad/s": r"\mathrm{rad\,s^{-1}}", "1/s": r"\mathrm{s^{-1}}"}
"""Units behind a number or in parentheses."""
_UNIT = re.compile(rf"(?<=[\d.] )({'|'.join(UNITS)}|s²)$|\(({'|'.join(UNITS)}|s²)\)$")
_NUMBER = re.compile(rf"\d+\.\d{{{SHOWN},}}(?:e[+-]?\d+)?")
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


def typeset(title: str, sections: Iterable[Section], form: str) -> str:
    """The document; `form` is text, latex or markdown."""
    return _WRITERS[form](title, list(sections))


def plain(formula: Any) -> str:
    """One line in ordinary notation: θ1'' for thetaddot_1, ^ for a power, a space for a product."""
    if isinstance(formula, sp.Equality):
        return f"{plain(formula.lhs)} = {plain(formula.rhs)}"
    if isinstance(formula, sp.MatrixBase):
        return _grid(formula)
    written = _NAME.sub(_symbol, sp.sstr(formula))
    return written.replace("**", "^").replace("*", " ")


def _symbol(matched: re.Match[str]) -> str:
    name, dots, index = matched.groups()
    marks = {"dot": "'", "ddot": "''", None: ""}[dots]
    numbered = index.removeprefix("_").replace("_", ",")
    return GREEK.get(name, name) + (numbered if numbered.replace(",", "").isdigit() else index) + marks


def _grid(matrix: Any) -> str:
    cells = [[plain(value) for value in matrix.row(i)] for i in range(matrix.rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rows = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]
    lines = [f"      [ {row} ]" for row in rows]
    if fits(max(map(breadth, lines), default=0)):
        return "\n" + "\n".join(lines)
    entries = (f"      [{i + 1},{j + 1}]  {cell}" for i, row in enumerate(cells) for j, cell in enumerate(row))
    return "\n" + "\n".join(entries)


class Conjugates(sp.Function):  # type: ignore[misc]
    """Two conjugate numbers, given by real and imaginary part."""

    nargs = 2

    def _sympystr(self, printer: Any) -> str:
        real, imaginary = map(printer.doprint, self.args)
        return f"{real} ± {imaginary} i"

    def _latex(self, printer: Any) -> str:
        real, imaginary = map(printer.doprint, self.args)
        return rf"{real} \pm {imaginary}\, i"


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
    written = _NUMBER.sub(lambda number: f"{float(number[0]):.{SHOWN}g}", words)
    written = re.sub(r"([a-z])('{1,2})", lambda m: _DOTTED["dot" if len(m[2]) == 1 else "ddot"] % m[1], written)
    written = re.sub(r"√\(([^()]*)\)", r"\\sqrt{\1}", written)
    written = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: f"^{{{''.join(map(_SUPERSCRIPTS.__getitem__, m[0]))}}}", written)
    written = re.sub("|".join(_LETTERS), lambda m: _LETTERS[m[0]] + " ", written)
    written = re.sub(r"(\\[a-z]+) (?=[\^_/),])|- ", lambda m: m[1] or "-", re.sub(" +", " ", written))
    written = written.replace("det(", r"\det(").strip()
    if not unit:
        return written
    name = unit[1] or unit[2]
    upright = UNITS.get(name, r"\mathrm{s^2}")
    return rf"{written}\,{upright}" if unit[1] else rf"{written}\;({upright})"


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
    lines = [rf"\section*{{{latex(title)}}}"]
    for section in sections:
        lines += [rf"\subsection*{{{_escaped(section.title)}}}"]
        for words, formula in section.lines:
            lines.append(_sentence(_escaped(words)) + ("." if formula is None else ":"))
            lines += [] if formula is None else [_display(formula)]
    return "\n".join(lines) + "\n"


def _markdown(title: str, sections: list[Section]) -> str:
    blocks = [f"# {markdown(title)}"]
    for section in sections:
        blocks.append(f"## {_inline(section.title)}")
        for words, formula in section.lines:
            blocks.append(_sentence(_inline(words)) + ("." if formula is None else ":"))
            if formula is not None:
                body = _display(formula).replace(r"\begin{equation*}", "").replace(r"\end{equation*}", "")
                blocks.append(f"$$\n{body.strip().replace('align*', 'aligned')}\n$$")
    return "\n\n".join(blocks) + "\n"


def _display(formula: Any) -> str:
    """A displayed formula, broken into lines if it is too long for one."""
    whole = _tex(formula)
    if line_breaks.fits(whole):
        return f"\\begin{{equation*}}\n{whole}\n\\end{{equation*}}"
    left, right = "", formula
    if isinstance(formula, sp.Equality):
        sides = formula.args if formula.rhs != 0 else (formula.rhs, formula.lhs)
        left, right = f"{_tex(sides[0])} ={{}}", sides[1]
    if line_breaks.width(left) > line_breaks.LINE / 3:
        left, right = "", formula
    room = line_breaks.LINE - line_breaks.width(left)
    body = " \\\\\n& ".join(line_breaks.lines(_tex(right, long_frac_ratio=2), room))
    return f"\\begin{{align*}}\n{left}& {body}\n\\end{{align*}}"


def _sentence(words: str) -> str:
    """Words that begin as a sentence does."""
    return words[:1].upper() + words[1:]


def _inline(words: str) -> str:
    """Words with what is mathematics in them between dollars."""
    pieces = _MATHEMATICS.split(words)
    return "".join(f"${in_latex(piece)}$" if at % 2 else _named(piece) for at, piece in enumerate(pieces))


def _named(words: str) -> str:
    """Coordinates, other named symbols and letters with an index in words, as mathematics."""
    words = _NAME.sub(
        lambda matched: f"${_tex(sp.Symbol(matched[0]))}$" if matched[0] not in "psxyzu" else matched[0], words
    )
    words = re.sub(r"\bof ([psxyzu])$", r"of $\1$", words)
    words = _INDEXED.sub(lambda matched: f"${LETTERS.get(matched[1], matched[1])}_{{{matched[2]}}}$", words)
    return words.replace("q''", r"$\ddot{q}$").replace("q'", r"$\dot{q}$")


def _tex(formula: Any, **settings: Any) -> str:
    called = {name: written for name in formula.free_symbols if (written := _by_name(name.name))}
    computed = {number: sp.Float(number, SHOWN) for number in formula.atoms(sp.Float) if number._prec <= DOUBLE}
    settings = {"symbol_names": called, "mat_str": "bmatrix", "mat_delim": "", "inv_trig_style": "full", **settings}
    return _with_commas(str(sp.latex(formula.xreplace(computed), **settings)))


def _by_name(name: str) -> str:
    r"""The LaTeX of a symbol that a word follows, such as \dot{\phi}_{\mathrm{board}}; "" for any other symbol."""
    called = _CALLED.fullmatch(name)
    if called is None or all(part in GREEK or part.isdigit() for part in called[3].split("_")):
        return ""
    letter, dots, word = called.groups()
    letter = rf"\{letter}" if letter in GREEK else letter
    parts = word.split("_")
    count = next((k for k, part in enumerate(reversed(parts)) if not part.isdigit()), 0)
    named, numbers = (
        r"\_".join(parts[: len(parts) - count]),
        "".join(f",{part}" for part in parts[len(parts) - count :]),
    )
    return _DOTTED[dots] % letter + rf"_{{\mathrm{{{named}}}{numbers}}}"


def _with_commas(formula: str) -> str:
    """SymPy's LaTeX with commas between the two numbers of an index."""
    return re.sub(r"_\{(\d+) (\d+)\}", r"_{\1,\2}", formula)


def _escaped(words: str) -> str:
    """For LaTeX text: named symbols as mathematics, everything else letter by letter."""
    parts = re.split(r"(\$[^$]*\$)", _inline(words))
    return "".join(part if part.startswith("$") else latex(part) for part in parts)


_WRITERS: dict[str, Callable[[str, list[Section]], str]] = {"text": _text, "latex": _latex, "markdown": _markdown}
