"""Natural units, tolerances and first steps of many members, each as in an individual run.

The rules are those of `nonlinear.integration.steppers` and `nonlinear.integration.run`, for arrays of members.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.integration.lanes import LaneTask
from nonlinear.integration.run import FIRST_STEP_MAX, NEAR_ZERO
from nonlinear.integration.steppers import first_step_of, tolerance_factor
from nonlinear.integration.watches import tangent_direction
from nonlinear.system import Layout, Numbers


@dataclass(frozen=True, eq=False)
class MemberUnits:
    """Natural units of members: `length` (m) of the longest link, `rate` sqrt(g/l) (rad/s), `energy` g Σ b (J).

    Each is (S,), or (1,) where members do not differ in it.  `turning` are the coordinates of supports that are angles.
    """

    length: Floats
    rate: Floats
    energy: Floats
    turning: tuple[int, ...] = ()

    def scale(self, layout: Layout) -> Floats:
        """The natural units of y, (size, S or 1), as in `Layout.natural`."""
        length, rate, energy = np.broadcast_arrays(self.length, self.rate, self.energy)
        half = np.ones((layout.half, len(length)))
        half[: layout.first] = length
        half[list(self.turning)] = 1.0
        return np.concatenate((half, half * rate, energy[None][: int(layout.works)]))


def units_of(numbers: Numbers, of: Callable[..., Any] = np.max) -> MemberUnits:
    """Of members with these numbers; with `of` the least the length is that of the shortest link."""
    system = numbers.arrays
    length = of([of(group.block.length, (0, 1)) for group in system.groups], 0)
    weight = sum(group.block.b.sum((0, 1)) for group in system.groups)
    gravity = np.atleast_1d(system.gravity)
    structure = numbers.system.structure
    turning = () if structure is None else structure.turning
    return MemberUnits(np.asarray(length), np.sqrt(gravity / length), np.asarray(gravity * weight), turning)


def longest_first(rate: Floats, members: int) -> Floats:
    """The longest first steps (s) of this many members, (S,)."""
    return np.asarray(np.broadcast_to(FIRST_STEP_MAX / rate, members))


def stretched(numbers: Numbers, y: Floats, end: float, tolerance: float) -> tuple[LaneTask, Floats]:
    """The task of plane motions from y (size, S) without work and of a tangent vector each, and natural units of y.

    These are of the shortest link, and every vector begins with the length 1 in them, in the same direction drawn at
    random.
    """
    lanes, members = Lanes(numbers, tangent=True), y.shape[1]
    scale = units_of(numbers, np.min).scale(replace(lanes.layout, works=False))
    units = np.broadcast_to(scale, y.shape)
    both, absolute = np.concatenate((y, units * tangent_direction(len(y)))), tolerance * np.concatenate((units, units))
    first = longest_first(units_of(numbers).rate, members)
    return LaneTask(lanes, numbers, both, end, np.full(members, tolerance), absolute, first), scale


def tolerances(
    y: Floats, slope: Floats, scale: Floats, size: Floats, rate: Floats, tolerance: float
) -> tuple[Floats, Floats, Floats]:
    """Relative (S,) and absolute (size, S) tolerances and the first steps (S,) in s."""
    relative = tolerance * tolerance_factor(slope, scale)
    absolute = NEAR_ZERO * relative * size * scale
    longest = longest_first(rate, y.shape[1])
    return relative, absolute, first_step_of(y, slope, absolute + relative * np.abs(y), longest)
