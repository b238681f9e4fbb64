"""Identifiers that C, Modelica and FMI accept, made from titles and signal names."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

LONGEST = 32


def identifier(text: str, fallback: str = "pendula") -> str:
    """ASCII letters, digits and underscores, no digit first, at most LONGEST characters; `fallback` for no text.

    >>> identifier("Größe 2: ein Kran"), identifier("2 loads"), identifier("∀")
    ('Gro_e_2_ein_Kran', 'n_2_loads', 'pendula')
    """
    ascii_text = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    word = re.sub(r"[^A-Za-z0-9_]+", "_", ascii_text)[:LONGEST].strip("_")
    if not word:
        return fallback
    return f"n_{word}"[:LONGEST] if word[0].isdigit() else word


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> tuple[str, ...]:
    """One identifier a name, in order, all different and none of them in `taken`.

    >>> identifiers(["x", "x", "end"], taken=["end"])
    ('x', 'x_2', 'end_2')
    """
    used, found = set(taken), []
    for name in names:
        base = word = identifier(name, "signal")
        number = 2
        while word in used:
            word, number = f"{base}_{number}", number + 1
        used.add(word)
        found.append(word)
    return tuple(found)
