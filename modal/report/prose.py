"""Numbers and lists in running text."""

from __future__ import annotations

from collections.abc import Sequence
from math import isinf

WIDTH = 110  # letters in a line of a page for a terminal


def short(value: float) -> str:
    """Six significant digits."""
    return "∞" if isinf(value) else f"{value:.6g}"


def percent(share: float) -> str:
    """Three significant digits."""
    return f"{100 * share:.3g} %"


def rad(omega: float) -> str:
    """An angular frequency, nine significant digits."""
    return "∞" if isinf(omega) else f"{omega:.9g} rad/s"


def counted(number: int, one: str, many: str) -> str:
    """A number and its noun."""
    return f"{number} {one if number == 1 else many}"


def listed(shown: Sequence[str], total: int) -> str:
    """`a, b and c`, or `a, b, … (1000 in all)` where only some are shown."""
    if len(shown) < total:
        return f"{', '.join(shown)}, … ({total} in all)"
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1]))) if shown else "none"


def capital(words: str) -> str:
    """The same with a capital."""
    return words[:1].upper() + words[1:]
