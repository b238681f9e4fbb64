r"""Text of scenes, files and arguments, escaped so that each format reads it as plain text.

Numbers and the program's own text do not need this.  Invisible characters (controls, direction marks, unassigned code
points) are shown as escapes, `\x1b` or `\u202e`, in every format.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable
from typing import Any
from unicodedata import category, normalize

HIDDEN = {"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"}
JOINERS = re.compile("(?<=[^\x00-\x7f])[\u200c\u200d](?=[^\x00-\x7f])")
"""Between letters of Persian or parts of an emoji they belong to the spelling."""

FORMULA = re.compile(r"\s*[=+\-@＝＋－＠]")
"""The beginning of a formula for spreadsheets."""


def visible(text: str) -> str:
    r"""The text on one line with every character visible, for terminals and figures.

    >>> print(visible("a\nb\x1b[2J\x9b\u202e"))
    a\nb\x1b[2J\x9b\u202e
    """
    if text.isascii() and text.isprintable():
        return text
    joined = {joiner.start() for joiner in JOINERS.finditer(text)}
    return "".join(
        ascii(letter)[1:-1] if category(letter) in HIDDEN and place not in joined else letter
        for place, letter in enumerate(text)
    )


def one_line(text: str) -> str:
    """The same with one space for all white space between words, for comments."""
    return visible(" ".join(text.split()))


def html(text: str) -> str:
    """For HTML, in elements and in attributes.

    >>> html("<b title='a'>")
    '&lt;b title=&#x27;a&#x27;&gt;'
    """
    from html import escape

    return escape(visible(text))


def markdown(text: str) -> str:
    r"""For Markdown, within a line: no markup, no HTML, no mathematics.

    >>> print(markdown("<b> & a_1*"))
    &lt;b&gt; &amp; a\_1\*
    """
    marked = re.sub(r"([\\`*_\[\]#~|$])", r"\\\1", visible(text))
    return marked.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def json_text(whole: Any, indent: int | None = 2) -> str:
    r"""JSON with letters as they are and invisible characters as escapes, without NaN.

    >>> print(json_text({"title": "ω\u202e"}, indent=None))
    {"title": "ω\u202e"}
    """
    written = json.dumps(whole, indent=indent, ensure_ascii=False, allow_nan=False)
    hidden = {letter for letter in set(written) - {"\n"} if category(letter) in HIDDEN}
    return written.translate({ord(letter): unicode_escape(letter) for letter in hidden})


def csv_cell(value: Any) -> Any:
    """A cell that no spreadsheet treats as a formula: text that begins like one gets an apostrophe before it.

    So does text after a semicolon or a bar, where some spreadsheets split a line.

    >>> csv_cell("=1+1"), csv_cell("-1.5"), csv_cell(-1.5), csv_cell("a = b")
    ("'=1+1", '-1.5', -1.5, 'a = b')
    """
    if not isinstance(value, str):
        return value
    shown = visible(value)
    return shown if _is_number(shown) else re.sub(rf"(?:^|(?<=[;|]))(?={FORMULA.pattern})", "'", shown)


def csv_rows(rows: Iterable[Iterable[Any]]) -> str:
    """Rows of such cells as the text of a CSV file."""
    from csv import writer

    stream = io.StringIO()
    writer(stream, lineterminator="\n").writerows(map(csv_cell, row) for row in rows)
    return stream.getvalue()


def csv_comment(header: str) -> str:
    """JSON as the first line of a CSV file, the same when read as JSON.

    A spreadsheet splits the line at its separators; within a text, those before the beginning of a formula are escaped.
    """
    text, separator = re.compile(r'"(?:[^"\\]|\\.)*"'), re.compile(rf"[,;|](?={FORMULA.pattern})")
    return text.sub(lambda quoted: separator.sub(lambda mark: unicode_escape(mark[0]), quoted[0]), header)


def unicode_escape(letter: str) -> str:
    """A letter as JSON escapes it, by one or two numbers of UTF-16."""
    code = letter.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{code[k : k + 4]}" for k in range(0, len(code), 4))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# ------------------------------------------------------------------------------------------------------- code


def python_text(text: str) -> str:
    """A string of Python."""
    return repr(text)


def c_comment(text: str) -> str:
    """A comment in C that ends where it should and holds no other.

    >>> c_comment("a */ b")
    '/* a * / b */'
    """
    return f"/* {one_line(text).replace('*/', '* /').replace('/*', '/ *')} */"


def matlab_text(text: str) -> str:
    """A string of MATLAB and Octave."""
    return "'" + one_line(text).replace("'", "''") + "'"


def modelica_text(text: str) -> str:
    """A string of Modelica."""
    return '"' + one_line(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


# ------------------------------------------------------------------------------------------------------ LaTeX

LETTERS = {"θ": r"\theta", "φ": r"\phi", "λ": r"\lambda", "ω": r"\omega", "σ": r"\sigma", "Δ": r"\Delta"}
_SIGNS = {
    **LETTERS,
    **{"∂": r"\partial", "π": r"\pi", "√": r"\surd", "Σ": r"\Sigma", "½": r"\frac{1}{2}", "¼": r"\frac{1}{4}"},
    **{"×": r"\times", "·": r"\cdot", "−": "-", "≠": r"\neq", "≤": r"\leq", "≥": r"\geq", "→": r"\to", "∈": r"\in"},
    **{"²": "^2", "³": "^3", "⁴": "^4", "₁": "_1", "₂": "_2", "°": r"^\circ"},
    **{"Γ": r"\Gamma", "Θ": r"\Theta", "Λ": r"\Lambda", "Ξ": r"\Xi", "Π": r"\Pi", "Φ": r"\Phi", "Ψ": r"\Psi"},
    **{"Ω": r"\Omega", "α": r"\alpha", "β": r"\beta", "γ": r"\gamma", "δ": r"\delta", "ε": r"\epsilon", "η": r"\eta"},
    **{"ν": r"\nu", "ξ": r"\xi", "ρ": r"\rho", "τ": r"\tau", "χ": r"\chi", "∞": r"\infty", "≈": r"\approx"},
    **{"±": r"\pm", "≡": r"\equiv", "…": r"\ldots", "ζ": r"\zeta", "ψ": r"\psi", "κ": r"\kappa", "μ": r"\mu"},
    **{"ĵ": r"\hat{\jmath}", "î": r"\hat{\imath}", "ẍ": r"\ddot{x}", "ÿ": r"\ddot{y}", "⅓": r"\frac{1}{3}", "′": "'"},
}
_SPECIAL = {
    **{letter: "\\" + letter for letter in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "—": "---"},
    **{"<": "$<$", ">": "$>$", "|": "$|$", '"': "''", "‘": "`", "’": "'", "“": "``", "”": "''", "\xa0": "~"},
    **{"ß": r"\ss{}", "æ": r"\ae{}", "œ": r"\oe{}", "ø": r"\o{}", "ł": r"\l{}", "å": r"\aa{}", "ı": r"\i{}"},
    **{"Æ": r"\AE{}", "Œ": r"\OE{}", "Ø": r"\O{}", "Ł": r"\L{}", "Å": r"\AA{}", "¡": "!`", "¿": "?`"},
    **{letter: f"${sign}$" for letter, sign in _SIGNS.items()},
}
_ACCENTS = {
    **{"\u0300": "`", "\u0301": "'", "\u0302": "^", "\u0303": "~", "\u0304": "=", "\u0306": "u", "\u0307": "."},
    **{"\u0308": '"', "\u030a": "r", "\u030b": "H", "\u030c": "v", "\u0323": "d", "\u0327": "c", "\u0331": "b"},
}
DOTLESS = {"i": r"\i", "j": r"\j"}


def latex(text: str) -> str:
    r"""For LaTeX text.  Letters beyond the fonts of pdfLaTeX are set by XeLaTeX and LuaLaTeX, elsewhere as [U+65E5].

    >>> print(latex("50 % é"))
    50 \% \'{e}
    """
    return "".join(map(_latex_letter, visible(text)))


def _latex_letter(letter: str) -> str:
    if letter in _SPECIAL:
        return _SPECIAL[letter]
    if letter.isascii():
        return letter
    base, *marks = list(normalize("NFD", letter))
    if len(marks) == 1 and marks[0] in _ACCENTS and base.isascii():
        return f"\\{_ACCENTS[marks[0]]}{{{DOTLESS.get(base, base)}}}"
    return rf"\ifdefined\Umathchar {letter}\else[U+{ord(letter):04X}]\fi{{}}"
