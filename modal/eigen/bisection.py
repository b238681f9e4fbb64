"""Zeros of a monotone count, to the last bit: bisection on the floats themselves, all of them at once.

Positive floats are ordered like the integers that share their bits, so halving the integers finds exponent
and mantissa alike and ends at two neighbouring floats after at most 62 steps.
"""

from collections.abc import Callable

import numpy as np

from modal.errors import ComputationError
from modal.types import Booleans, Floats, Ints

STRIDE = 2.0**24
BEYOND = "the ratios in this scene are beyond double precision: a frequency overflows"


def smallest_where(reached: Callable[[Floats], Booleans], low: Floats, high: Floats) -> Floats:
    """The smallest float x in (low, high] with reached(x), elementwise; `reached` turns from False to True once."""
    lo, hi = low.view(np.int64).copy(), high.view(np.int64).copy()
    while np.any(hi - lo > 1):
        middle = lo + (hi - lo) // 2
        inside = reached(middle.view(np.float64))
        hi = np.where(inside, middle, hi)
        lo = np.where(inside, lo, middle)
    return hi.view(np.float64)


def above_all(count: Callable[[Floats], Ints], start: Floats, wanted: Ints) -> Floats:
    """Powers of STRIDE times `start` until `count` has reached `wanted` everywhere."""
    high = start * STRIDE
    if not np.all((start > 0) & np.isfinite(start)):
        raise ComputationError(BEYOND)
    while np.any(count(high) < wanted):
        high = high * STRIDE
        if not np.all(high < 1e280):
            raise ComputationError(BEYOND)
    return high
