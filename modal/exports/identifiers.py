"""Identifiers that C, Modelica and FMI accept, made from titles and signal names."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from zlib import crc32

LONGEST = 32


def identifier(text: str, fallback: str = "pendula") -> str:
    """ASCII letters, digits and underscores, no digit first, at most LONGEST characters; `fallback` for no text.

    A non-ASCII text of which no letter remains becomes `fallback` and a checksum, so that names stay distinct; so
    does one of symbols alone.

    >>> identifier("Größe 2: ein Kran"), identifier("2"), identifier("振り子"), identifier("")
    ('Gro_e_2_ein_Kran', 'n_2', 'pendula_87cf40f7', 'pendula')
    """
    ascii_text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    word = re.sub(r"[^A-Za-z0-9]+", "_", ascii_text)[:LONGEST].strip("_")
    if not re.search("[A-Za-z0-9]" if text.isascii() else "[A-Za-z]", word):
        return f"{fallback}_{crc32(text.encode()):08x}" if text else fallback
    return f"n_{word}"[:LONGEST] if word[0].isdigit() else word


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> tuple[str, ...]:
    """One identifier a name, in order, all different and none of them in `taken`.

    >>> identifiers(["x", "x", "end"], taken=["end"])
    ('x', 'x_2', 'end_2')
    """
    used, words = set(taken), []
    for name in names:
        base = word = identifier(name, "signal")
        number = 2
        while word in used:
            word, number = f"{base}_{number}", number + 1
        used.add(word)
        words.append(word)
    return tuple(words)
