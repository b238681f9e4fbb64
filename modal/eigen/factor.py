"""Symmetric matrices as sums of squares, of which `modal.eigen.product` finds modes with every digit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modal.types import Floats

WIDE = 200
"""Coordinates up to which the triangular factors are computed in the widest floats of the machine."""
BEYOND = "the ratios in this scene are beyond double precision on its product form"


class SquareSum(NamedTuple):
    """The sum of `size` (E,) times the squares of `rows` (E, n)."""

    rows: Floats
    size: Floats

    @property
    def matrix(self) -> Floats:
        """The sum, (n, n), symmetric to the last digit: else stiff dampers would feel it."""
        S: Floats = (self.rows.T * self.size) @ self.rows
        return (S + S.T) / 2


def is_wide(size: int) -> bool:
    """Whether the triangular factors of so many coordinates are computed in wider floats."""
    return size <= WIDE and bool(np.finfo(np.longdouble).eps < np.finfo(float).eps)
