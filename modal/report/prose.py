"""Numbers and lists in running text; progress reports of long computations."""

from __future__ import annotations

from collections.abc import Sequence
from math import isinf

from modal.report.fitting import columns

WIDTH = 110
"""Format: characters per line of a report that no terminal limits."""


def line_width() -> int:
    """Characters per line of a report."""
    return min(WIDTH, columns() or WIDTH)


def short(value: float) -> str:
    """Six significant digits."""
    return "∞" if isinf(value) else f"{value:.6g}"


def percent(share: float) -> str:
    """Three significant digits."""
    return f"{100 * share:.3g} %"


def rad(omega: float) -> str:
    """An angular frequency, nine significant digits."""
    return "∞" if isinf(omega) else f"{omega:.9g} rad/s"


def counted(number: int, noun: str, plural: str) -> str:
    """A number and its noun."""
    return f"{number} {noun if number == 1 else plural}"


def listed(shown: Sequence[str], total: int) -> str:
    """`a, b and c`, or `a, b, … (1000 in all)` if only some are shown."""
    if len(shown) < total:
        return f"{', '.join(shown)}, … ({total} in all)"
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1]))) if shown else "none"


def with_unit(heading: str, unit: str) -> str:
    """A heading with its unit in parentheses, if there is one."""
    return f"{heading} ({unit})" if unit else heading


def capital(words: str) -> str:
    """The text with its first letter capitalized."""
    return words[:1].upper() + words[1:]


class Silence:
    """A progress callback that does nothing. Signatures show it by its name, `silent`."""

    def __call__(self, *progress: object) -> None:
        """Say nothing."""

    def __repr__(self) -> str:
        return "silent"

    def __reduce__(self) -> str:
        return "silent"


silent = Silence()
