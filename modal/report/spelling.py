"""Letters that an encoding lacks, spelled: ω as omega, ≤ as <=, ± as +-, 30° as 30 deg, s⁻² as s^-2.

    text.encode("cp1252", SPELLED)

`SPELLINGS` is the one table of signs. Greek letters are spelled by their names, raised and lowered letters after ^ and
_, accents are omitted, and what remains is written as JSON escapes it. No spelling has a quotation mark or a backslash,
so that JSON and CSV stay what they are.
"""

from __future__ import annotations

import codecs
from unicodedata import combining, decomposition, name, normalize

from modal.report.escaping import unicode_escape

SPELLED = "multipendula.spelled"
"""The name of the error handler of encodings."""
SPELLINGS = {
    **{"≤": "<=", "≥": ">=", "≠": "!=", "≈": "~", "≡": "==", "∝": "~", "±": "+-", "∓": "-+", "×": "x", "·": "*"},
    **{"−": "-", "–": "-", "—": "-", "‑": "-", "…": "...", "∞": "inf", "√": "sqrt", "∂": "d", "∫": "int", "∇": "grad"},
    **{"→": "->", "←": "<-", "↔": "<->", "↑": "^", "↓": "v", "∈": "in", "‖": "||", "⟨": "<", "⟩": ">", "ℓ": "l"},
    **{"½": "(1/2)", "¼": "(1/4)", "¾": "(3/4)", "⅓": "(1/3)", "⅔": "(2/3)", "°": "deg", "µ": "u", "§": "section "},
    **{"′": "'", "″": "''", "‘": "'", "’": "'", "“": "'", "”": "'", "„": "'", "«": "'", "»": "'"},
    **{"★": "*", "✓": "yes", "✗": "no", "○": "o", "●": "*", "•": "-", "█": "#", "▏": "|"},
    **{"ẍ": "x_ddot", "ÿ": "y_ddot", "ı": "i", "ß": "ss", "æ": "ae", "œ": "oe", "ø": "o", "ł": "l"},
    **{"Æ": "AE", "Œ": "OE", "Ø": "O", "Ł": "L", "\u0307": "_dot", "\u0308": "_ddot", "\u0304": "_bar"},
    **{"\u0302": "_hat", "\u0303": "_tilde", "\u200c": "", "\u200d": ""},
}
"""The ASCII spelling of each sign."""


def spelled(text: str, encoding: str = "ascii") -> str:
    """The text with all letters spelled that the encoding lacks.

    >>> print(spelled("ω² ≤ 4 (rad/s)², ζ ± 1 %, 30°, m·s⁻²"))
    omega^2 <= 4 (rad/s)^2, zeta +- 1 %, 30 deg, m*s^-2
    >>> spelled("Δω₁ ± 1°", "cp1252")
    'Delta omega_1 ± 1°'
    """
    return text.encode(encoding, SPELLED).decode(encoding)


def spell(error: UnicodeError) -> tuple[str, int]:
    """The spelling of characters that could not be encoded, and where to continue: the error handler SPELLED."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text, start, end = error.object, error.start, error.end
    if _shift(text[end - 1]):  # what is raised with it goes with it, also where it could be encoded
        while end < len(text) and _shift(text[end]) == _shift(text[end - 1]):
            end += 1
    return "".join(_apart(text, at) for at in range(start, end)), end


def _apart(text: str, at: int) -> str:
    """The spelling of a letter, apart from the letters on either side where it is a word."""
    letter, before, after = text[at], text[at - 1 : at], text[at + 1 : at + 2]
    word = _letter(letter, before)
    if letter.isascii() or len(word) < 2 or not word[-1].isalpha():
        return word
    begins = " " if before.isalpha() and word[0].isalpha() and not _is_accent(letter) else ""
    ends = " " if after.isascii() and after.isalpha() and not _is_accent(letter) else ""
    return f"{begins}{word}{ends}"


def _is_accent(letter: str) -> bool:
    """Whether a letter is one of the alphabet with an accent, or a mark, which leave words as they are."""
    if combining(letter) or letter in "ßæœÆŒ":
        return True
    return normalize("NFKD", letter)[0].isascii() and not _shift(letter)


def _letter(letter: str, before: str) -> str:
    """A letter after another, "" at the beginning."""
    if letter == "°" and before.isdigit():
        return " deg"
    if letter in SPELLINGS:
        return SPELLINGS[letter]
    if letter.isascii():
        return letter
    if shift := _shift(letter):
        base = _letter(normalize("NFKD", letter)[0], "")
        return base if before and _shift(before) == shift else shift + base
    words = name(letter, "").split()
    if words[:1] == ["GREEK"] and "LETTER" in words:
        greek = words[words.index("LETTER") + (2 if "FINAL" in words else 1)].lower().replace("lamda", "lambda")
        return greek.capitalize() if "CAPITAL" in words else greek
    plain = "".join(part for part in normalize("NFKD", letter) if not combining(part))
    if plain != letter and plain:
        return "".join(_letter(part, "") for part in plain)
    return unicode_escape(letter)


def _shift(letter: str) -> str:
    """The sign of a raised or lowered letter, "" of any other."""
    return {"<super>": "^", "<sub>": "_"}.get(decomposition(letter).partition(" ")[0], "")


codecs.register_error(SPELLED, spell)
