"""Helpers of all text formats: numbers that read back bit for bit, the header of a file, and identifiers.

Identifiers are those that C, Modelica and FMI accept, made from titles and signal names.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING
from zlib import crc32

from modal.report import one_line
from modal.statespace import Signal, StateSpace
from modal.types import Floats

if TYPE_CHECKING:
    from modal.statespace.sampling import VaryingModel

UNTITLED = "Pendula"
IDENTIFIER_LETTERS = 63
"""Format: significant characters of an identifier in C99 and MATLAB."""


def heading(model: StateSpace | VaryingModel) -> str:
    """The title on one line."""
    return one_line(model.title) or UNTITLED


def meaning(signal: Signal) -> str:
    """Unit and meaning of a signal for a comment."""
    return one_line(f"{signal.unit}, {signal.meaning}")


def law(model: StateSpace) -> str:
    """The equations of a model on one line."""
    if model.dt:
        return f"z[k+1] = A z[k] + B u[k], y[k] = C z[k] + D u[k], one step every {model.dt!r} s"
    return "z' = A z + B u, y = C z + D u"


def rest(model: StateSpace | VaryingModel) -> list[str]:
    """The operating point, one line per coordinate, in motion with its rate and its acceleration."""
    where = "in motion" if is_moving(model) else "at equilibrium"
    return [one_line(f"{name} = {value!r} {unit_of(name)} {where}") for name, value in model.operating_point]


def is_moving(model: StateSpace | VaryingModel) -> bool:
    """Whether the operating point has rates and accelerations: the deviations are then those from a motion."""
    return any("_dot" in name for name, _ in model.operating_point)


def datum(model: StateSpace | VaryingModel) -> str:
    """Return the point from which states, inputs and outputs deviate."""
    return "the motion through the operating point" if is_moving(model) else "the equilibrium"


def unit_of(name: str) -> str:
    """The unit of a coordinate of the operating point, of its rate or of its acceleration.

    >>> unit_of("x"), unit_of("theta_dot_1_1"), unit_of("deck_ddot_m_per_s2")
    ('m', 'rad/s', 'm/s^2')
    """
    stem, _, per = name.partition("_per_s")
    unit = "rad" if stem.startswith("theta_") or stem.endswith("_rad") else "m"
    return unit + ("/s^2" if "_ddot" in name or per == "2" else "/s" if "_dot" in name or per else "")


def preamble(model: StateSpace) -> list[str]:
    """The header of a file: title, equations, operating point."""
    return [heading(model), f"{law(model)}, in SI units, deviations from {datum(model)}", *rest(model)]


def matrices(model: StateSpace) -> tuple[tuple[str, Floats], ...]:
    """The four matrices by name."""
    return ("A", model.A), ("B", model.B), ("C", model.C), ("D", model.D)


def digits(values: Floats, number: Callable[[float], str] = repr) -> Iterator[list[str]]:
    """Row by row, the shortest decimals that read back as equal doubles; −0 is written as 0."""
    return (list(map(number, row)) for row in (values + 0.0).tolist())


def text_file(lines: Iterable[str]) -> bytes:
    """Lines as a UTF-8 file."""
    return ("\n".join(lines) + "\n").encode()


def identifier(text: str, fallback: str = "pendula") -> str:
    """ASCII letters, digits and underscores, no digit first, too many cut after a word; `fallback` for no text.

    A non-ASCII text of which no letter remains becomes `fallback` and a checksum, so that names stay distinct; so
    does one of symbols alone.

    >>> identifier("Größe 2: ein Kran"), identifier("2"), identifier("振り子"), identifier("")
    ('Gro_e_2_ein_Kran', 'n_2', 'pendula_87cf40f7', 'pendula')
    """
    ascii_text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    word = _whole_words(re.sub(r"[^A-Za-z0-9]+", "_", ascii_text).strip("_"))
    if not re.search("[A-Za-z0-9]" if text.isascii() else "[A-Za-z]", word):
        return f"{fallback}_{crc32(text.encode()):08x}" if text else fallback
    return _whole_words(f"n_{word}") if word[0].isdigit() else word


def _whole_words(text: str) -> str:
    """As many whole words as an identifier takes, of one longer word its beginning."""
    if len(text) <= IDENTIFIER_LETTERS:
        return text
    return text[: IDENTIFIER_LETTERS + 1].rpartition("_")[0] or text[:IDENTIFIER_LETTERS]


def identifiers(names: Iterable[str], keywords: Iterable[str] = ()) -> tuple[str, ...]:
    """One identifier a name, in order, all different and none of them in `keywords`.

    >>> identifiers(["x", "x", "end"], keywords=["end"])
    ('x', 'x_2', 'end_2')
    """
    used, words = set(keywords), []
    for name in names:
        base = word = identifier(name, "signal")
        number = 2
        while word in used:
            word, number = f"{base}_{number}", number + 1
        used.add(word)
        words.append(word)
    return tuple(words)
