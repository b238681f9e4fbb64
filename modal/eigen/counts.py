"""The sizes of the problems solved by a source of modes, reported by the source itself."""

from __future__ import annotations

from typing import NamedTuple


class Built(NamedTuple):
    """A number of `problems` of one form, each with `unknowns`; square `matrices` as (name, order, count).

    `is_complex` tells whether eigenvalues were sought in the complex plane.
    """

    what: str
    problems: int
    unknowns: int
    matrices: tuple[tuple[str, int, int], ...] = ()
    is_complex: bool = False


def counted(number: int, noun: str, several: str = "") -> str:
    """A number and its noun: 1 link, 3 links."""
    return f"{number} {noun if number == 1 else several or noun + 's'}"
