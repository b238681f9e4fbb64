"""What an engine is asked for, and what it finds of some members."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modal.types import Floats, Ints


@dataclass(frozen=True)
class Passing:
    """Where a component of y, by its row, passes a `level`, an angle at any turn: upwards (1), downwards (−1), both."""

    row: int
    level: float
    direction: int


@dataclass(frozen=True)
class Wanted:
    """What to find of members until `duration` (s) at a tolerance: y at `times` (s), and what else happens."""

    duration: float
    tolerance: float
    times: tuple[float, ...] = ()
    first_turns: bool = False
    largest: bool = False
    stretching: bool = False
    section: Passing | None = None


Crossed = tuple[Ints, Floats, Floats]
"""Of crossings: members (C,), times (C,) in s, y (C, size)."""


@dataclass(eq=False)
class MemberResults:
    """Of S members: y (size, S) at the end, estimated errors (rad) and horizons (s), (S,), why some failed, by member.

    `rows` (S, K, size) at the times asked for, `first_turns` (L, S) in s, `largest` (S,) in rad, `stretching` (S,) of
    ln |v|, and the crossings, where they are wanted; `rubbed` is the work (J) of dry friction on each.
    """

    y: Floats
    error: Floats
    horizon: Floats
    reasons: dict[int, str] = field(default_factory=dict)
    rows: Floats | None = None
    first_turns: Floats | None = None
    largest: Floats | None = None
    stretching: Floats | None = None
    crossed: Crossed | None = None
    rubbed: Floats | float = 0.0


AXES = {"y": 1, "error": 0, "horizon": 0, "rows": 0, "first_turns": 1, "largest": 0, "stretching": 0}
"""Along which members stand in each array."""


def merged(parts: Sequence[tuple[Ints, MemberResults]]) -> MemberResults:
    """What was found of groups of members, each with their numbers among all."""
    order = np.argsort(np.concatenate([members for members, _ in parts]))
    arrays: dict[str, Any] = {
        name: np.take(np.concatenate([getattr(some, name) for _, some in parts], axis=axis), order, axis=axis)
        for name, axis in AXES.items()
        if getattr(parts[0][1], name) is not None
    }
    reasons = {int(members[k]): reason for members, some in parts for k, reason in some.reasons.items()}
    crossed = [(members[some.crossed[0]], *some.crossed[1:]) for members, some in parts if some.crossed is not None]
    whole = MemberResults(**arrays, reasons=reasons)
    if crossed:
        members, times, rows = (np.concatenate(column) for column in zip(*crossed, strict=True))
        by_member = np.lexsort((times, members))
        whole.crossed = members[by_member], times[by_member], rows[by_member]
    return whole
