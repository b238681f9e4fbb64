"""Requests to engines, and their results for some members."""

from __future__ import annotations

from dataclasses import dataclass, field

from modal.types import Floats, Ints


@dataclass(frozen=True)
class Passing:
    """Where a component of y, by its row, passes a `level`, an angle at any turn: upwards (1), downwards (−1), both."""

    row: int
    level: float
    direction: int


@dataclass(frozen=True)
class Wanted:
    """Requested results of members until `duration` (s) at a tolerance: y at `times` (s), and events."""

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

    `rows` (S, K, size) at the times requested, `first_turns` (L, S) in s, `largest` (S,) in rad, `stretching` (S,) of
    ln |v|, and the crossings, where they are requested; `rubbed` is the work (J) of dry friction on each.
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
