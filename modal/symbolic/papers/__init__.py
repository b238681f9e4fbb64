"""The equations of the three source papers as data: what each prints, what is right, and when the two agree.

modal.papers.cart     paper 000, n double pendula on a cart
modal.papers.planar   paper 001, chains in a vertical plane
modal.papers.spatial  paper 002, chains in space
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

PRINTED, CORRECTED = "as the paper prints it", "as it should read"
RIGHT, BEYOND = "as the paper prints it, and right", "where the paper stops"


@dataclass(frozen=True)
class Equation:
    """One equation of a paper; where the paper is right, `printed` and `corrected` are the same object.

    Where the paper stops and the pattern of its equations goes on, `printed` is None.
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
        """Whether the paper prints it as it should read."""
        return self.printed is self.corrected

    def forms(self) -> list[tuple[str, Any]]:
        """Every form with what it is."""
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
    beyond: bool = False,
    holds_when: Any = sp.true,
) -> Equation:
    """An equation that the paper prints as it should read, or would have `beyond` the point where it stops."""
    return Equation(paper, number, title, None if beyond else form, form, condition, holds_when)


def equal(left: Any, right: Any) -> Any:
    """The equation left = right as written, never evaluated to true or false."""
    return sp.Eq(left, right, evaluate=False)


def residual(form: Any) -> Any:
    """Left side minus right side of an equation."""
    return form.lhs - form.rhs
