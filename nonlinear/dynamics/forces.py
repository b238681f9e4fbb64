"""The forces that hold a scene together, whatever they were found by."""

from __future__ import annotations

from dataclasses import dataclass

from modal.types import Booleans, Floats


@dataclass(frozen=True, eq=False)
class Reactions:
    """Forces (N) at T times.

    `normal` (T,): the rail's push up on the cart, or a fixed support's on everything (R in paper 000, section IV.A).
    `pivots` (T, L, d): what each link gets from above at its upper joint, along the rail and down (across in between,
    in space).  `tops` (L,) says which links hang from the support.
    """

    normal: Floats
    pivots: Floats
    tops: Booleans

    @property
    def R_B(self) -> Floats:
        """Of the support on the first link of every pendulum, as in paper 000."""
        return self.pivots[:, self.tops]

    @property
    def R_P(self) -> Floats:
        """Of every further link on the one above it: paper 000 draws it on the upper link."""
        return -self.pivots[:, ~self.tops]
