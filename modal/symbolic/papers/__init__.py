"""The equations of the three source papers as data: as printed, as corrected, and when the two agree.

modal.papers.cart     paper 000, n double pendula on a cart
modal.papers.planar   paper 001, chains in a vertical plane
modal.papers.spatial  paper 002, chains in space
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

PRINTED, CORRECTED = "as printed", "corrected"
RIGHT, BEYOND = "as printed, and correct", "missing in the paper"


@dataclass(frozen=True)
class Equation:
    """One equation of a paper; if the paper is right, `printed` and `corrected` are the same object.

    `printed` is None for an equation that continues the pattern of the paper beyond its last one.
    `condition` says in words when the printed form holds and `holds_when` in SymPy (true: always, false: never).
    """

    paper: str
    number: str
    title: str
    printed: Any
    corrected: Any
    condition: str = ""
    holds_when: Any = sp.true
    note: str = ""

    @property
    def right(self) -> bool:
        """Whether the printed form is correct."""
        return self.printed is self.corrected

    def forms(self) -> list[tuple[str, Any]]:
        """Every form with a heading."""
        if self.printed is None:
            return [(BEYOND, self.corrected)]
        return [(RIGHT, self.printed)] if self.right else [(PRINTED, self.printed), (CORRECTED, self.corrected)]


def correct(
    paper: str,
    number: str,
    title: str,
    form: Any,
    condition: str = "",
    *,
    is_continuation: bool = False,
    holds_when: Any = sp.true,
) -> Equation:
    """An equation that the paper prints correctly, or one `is_continuation` its last that continues the pattern."""
    return Equation(paper, number, title, None if is_continuation else form, form, condition, holds_when)


def equal(left: Any, right: Any) -> Any:
    """The equation left = right as written, never evaluated to true or false."""
    return sp.Eq(left, right, evaluate=False)


def residual(form: Any) -> Any:
    """Left side minus right side of an equation."""
    return form.lhs - form.rhs
