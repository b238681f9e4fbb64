"""Location of an event within a step, where a value passes from below to above 0: run by Python, compiled by numba.

V and R (looks, J) are the values and their rates at the parts `looks` of one step.  A passing that was seen within a
step is met by another, shorter one, whose length Newton's method finds, kept within a bracket.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from math import sqrt
from sys import float_info
from typing import Any

STANDS, AGAIN, MET = range(3)
"""Outcomes of a step: accepted; to be repeated with another length; ends at a switch."""
PASSING_SHARE = 1e-9
"""Tolerance: of a step, the rest before a passing that is corrected to first order, with an error of its square."""
BRACKET_SHARE = float_info.epsilon
"""Of a step: how close the ends of a bracket come, whatever the time, since lengths are finer than its floats."""
CUBIC_END_SHARE = 1e-2
"""Tolerance: of an interval, a cubic that is highest so close to one of its ends says for sure whether it passes."""


def rises(a: float, da: float, b: float) -> bool:
    """Whether a value a of rate da, then b, passes from below to above 0, or leaves it upwards."""
    return b >= 0 and (a < 0 or (a == 0 and (da < 0 or b > 0)))


def swells(a: float, da: float, b: float, db: float, width: float) -> bool:
    """Whether a value that is below 0 at both ends, so far apart, may be above in between."""
    return a < 0 and b < 0 and da > 0 and db < 0 and max(a, b) + 0.25 * width * (da - db) > 0


def may_pass(h: float, V: Any, R: Any, looks: Any) -> bool:
    """Whether any value may pass within a step of length h."""
    for j in range(len(V[0])):
        if V[0][j] > 0 and R[0][j] > 0:
            return True
        for k in range(len(looks) - 1):
            a, b, da, db = V[k][j], V[k + 1][j], R[k][j], R[k + 1][j]
            if rises(a, da, b) or swells(a, da, b, db, (looks[k + 1] - looks[k]) * h):
                return True
    return False


def cubic_at(x: float, a: float, b: float, da: float, db: float) -> float:
    """At a part x of an interval the cubic through two values and slopes."""
    return a + x * (da + x * ((3 * (b - a) - 2 * da - db) + x * (da + db - 2 * (b - a))))


def highest(a: float, b: float, da: float, db: float) -> float:
    """Where the cubic through two values is highest, as a part of the interval, if it rises first and falls at last."""
    bend, twist = 3 * (b - a) - 2 * da - db, da + db - 2 * (b - a)
    return da / (sqrt(max(bend * bend - 3 * twist * da, 0.0)) - bend)


def cubic(a: float, b: float, da: float, db: float) -> float:
    """Where the cubic through a value below 0 and one above, with their slopes, passes 0, as a part of the interval."""
    x = a / (a - b) if a < 0 and a != b else 0.5
    low, high = 0.0, 1.0
    for _ in range(30):
        value = cubic_at(x, a, b, da, db)
        if value < 0:
            low = x
        else:
            high = x
        slope = da + x * (2 * (3 * (b - a) - 2 * da - db) + 3 * x * (da + db - 2 * (b - a)))
        new = x - value / slope if slope != 0 else (low + high) / 2
        if not low < new < high:
            new = (low + high) / 2
        if abs(new - x) < 1e-9:
            return new
        x = new
    return x


def passing(j: int, h: float, V: Any, R: Any, looks: Any) -> float:
    """The part of the step at which value j first passes, 2 where it does not."""
    if V[0][j] > 0 and R[0][j] > 0:  # passed within rounding of the switch before
        return 0.0
    for k in range(len(looks) - 1):
        width = looks[k + 1] - looks[k]
        a, b, da, db = V[k][j], V[k + 1][j], R[k][j] * width * h, R[k + 1][j] * width * h
        if rises(a, da, b):
            return float(looks[k] + width * cubic(a, b, da, db))
        if swells(a, da, b, db, 1.0):
            at = highest(a, b, da, db)
            top = cubic_at(at, a, b, da, db)
            if top > 0:
                return float(looks[k] + width * at * cubic(a, top, da * at, 0.0))
            if top > -0.02 * max(-a, -b) and CUBIC_END_SHARE < at < 1 - CUBIC_END_SHARE:
                return float(looks[k] + width * at)
    return 2.0


def meet(
    i: int, h: Any, V: Any, R: Any, looks: Any, which: Any, low: Any, high: Any, next_length: Any, usual: Any
) -> int:
    """Decide on an accepted step of segment i, of length h (s), whose next length would be `next_length`.

    `which` value it seeks to meet, -1 for none, lies between `low` and `high` (s); `usual` is the length to resume with
    afterwards.  All of these are lists or arrays by segment, and changed in place.
    """
    first, j = 2.0, -1
    for n in range(len(V[0])):
        x = passing(n, h[i], V, R, looks)
        if x < first:
            first, j = x, n
    aim = which[i]
    if aim < 0:
        usual[i] = next_length[i]
        if j < 0:
            return STANDS
        which[i], low[i], high[i] = j, 0.0, h[i]
        next_length[i] = max(first, PASSING_SHARE) * h[i]
        return AGAIN
    value, rate = V[len(V) - 1][aim], R[len(R) - 1][aim]
    remaining = -value / rate if rate > 0 else 1e300
    earlier = j >= 0 and j != aim and first < 1 - 1e-6
    if not earlier and abs(remaining) <= PASSING_SHARE * max(h[i], 1e-3 * usual[i]):
        return MET
    if j >= 0:
        high[i] = h[i]
        new = h[i] + remaining if j == aim and low[i] < h[i] + remaining < h[i] else first * h[i]
        if not low[i] < new < h[i]:
            new = (low[i] + h[i]) / 2
        if min(h[i] - low[i], new) <= BRACKET_SHARE * (h[i] + usual[i]):
            return MET
        which[i], next_length[i] = j, new
        return AGAIN
    if value < 0 and h[i] + remaining < high[i]:
        low[i], next_length[i] = h[i], h[i] + remaining
        return AGAIN
    if value >= 0:
        return MET
    which[i], low[i], high[i], next_length[i] = -1, 0.0, 1e300, usual[i]
    return STANDS


def meeting_source() -> str:
    """The functions of this module, but this one, as a text of Python; their globals are in `MEETING`."""
    functions: list[Callable[..., Any]] = [rises, swells, may_pass, cubic_at, highest, cubic, passing, meet]
    return "\n".join(inspect.getsource(function) for function in functions)


MEETING = {
    "STANDS": STANDS,
    "AGAIN": AGAIN,
    "MET": MET,
    "PASSING_SHARE": PASSING_SHARE,
    "BRACKET_SHARE": BRACKET_SHARE,
    "CUBIC_END_SHARE": CUBIC_END_SHARE,
}
"""The constants of `meeting_source`."""
