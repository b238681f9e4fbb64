"""Words that the sections of a report on coupling share: modes by their numbers, fractions, and how many are listed."""

from __future__ import annotations

import numpy as np

from modal.coupling.analysis import Coupling
from modal.coupling.exchange import MOST_MODES
from modal.coupling.structures import StructureCoupling
from modal.report import percent

AnyCoupling = Coupling | StructureCoupling
MOST_LISTED, FEW = 8, 3
ROUGH = 0.1
"""Coupling strength above which first order is only a guide."""
GUIDE = " (approximate: the coupling is strong)"
SLIGHT = 1e-4
"""Smallest fraction of an energy that is given as a number."""
ELSEWHERE = "in the JSON form"


def shown(coupling: AnyCoupling) -> int:
    """How many entries of each kind are listed, fewer where there are many."""
    return MOST_LISTED if len(coupling.fixed_base.omega) <= MOST_MODES else FEW


def member(coupling: AnyCoupling, k: int) -> str:
    """A fixed-base mode by its pendulum, and by its number where the pendulum has several."""
    modes = coupling.fixed_base
    name = coupling.names[modes.kind[k]]
    several = int(np.sum(modes.kind == modes.kind[k])) > 1
    return f"fixed-base mode {modes.number[k]} of {name}" if several else name


def numbered(coupling: AnyCoupling, omega: float) -> str:
    """The number of a frequency's mode in the table, in parentheses, where it is known."""
    number = coupling.number(omega)
    return "" if number is None else f" (mode {number})"


def left(share: float) -> str:
    """A fraction of an energy in words."""
    return percent(share) if share >= SLIGHT else f"less than {percent(SLIGHT)}"
