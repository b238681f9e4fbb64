"""Motion in the plane with ropes of prescribed length l(t).

Where a rope changes its length, the bob at its end has the accelerations l'' along the rope and 2 l' θ' across it in
addition to those of a link of constant length (`nonlinear.dynamics.recursion`); of one pendulum

    l θ'' + 2 l' θ' + g sin θ = 0.

The winch holds the rope with the force that the bob and everything below it need, f = Σ m (a − g e_z), and does the
work ∫ Σ l' u·f dt.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.minimal import Body, Minimal
from nonlinear.dynamics.recursion import Bias, downward, links_of, upward
from nonlinear.system import Group


class HoistedRecursion:
    """One pass up and one down at one time, for lengths, speeds and accelerations (n, P) of a group's links."""

    def __init__(self, group: Group, length: Floats, speed: Floats, acceleration: Floats, moving: Any) -> None:
        centre = np.where(moving, length, group.block.centre)
        self.links = links_of(replace(group, block=replace(group.block, length=length, centre=centre)))
        self.speed, self.acceleration = speed, acceleration

    def pull(self, angles: Any, rates: Any, torques: Any, gravity: float) -> tuple[Any, Any, Any]:
        """Mass (kg) and force (N) of the pull along the rail, summed over the pendula."""
        bias = [Bias(*own) for own in zip(2 * self.speed * rates, self.acceleration, strict=True)]
        answer, turns = upward(self.links, np.sin(angles), np.cos(angles), rates, torques, bias)
        return answer.xx.sum(0), (answer.px - gravity * answer.xz).sum(0), (turns, gravity, bias)

    def turn(self, memory: Any, push: Any) -> Any:
        """θ'' (n, P)."""
        turns, gravity, bias = memory
        return np.array(downward(self.links, turns, push, -gravity, bias))


@dataclass(frozen=True, eq=False)
class Hoisted(Minimal):
    """The equations of `Minimal` with the lengths of `system.hoisting`, for one y at a time."""

    bodies: tuple[()] = ()

    def bodies_at(self, time: float) -> tuple[Body, ...]:
        """The solvers of the groups with the lengths of this time."""
        (length, speed, acceleration), hoisting = self.lengths(time), self.system.hoisting
        assert hoisting is not None
        places = [(group, group.index) for group in self.system.groups]
        return tuple(
            HoistedRecursion(group, length[at], speed[at], acceleration[at], hoisting.moving[at])
            for group, at in places
        )

    def lengths(self, time: float) -> tuple[Floats, Floats, Floats]:
        """Lengths, speeds and accelerations (L,) at a time (s)."""
        assert self.system.hoisting is not None
        return self.system.hoisting.at(time)

    def derivative(self, time: float, y: Any) -> Any:
        """The time derivative of one y, (size,), its work that of the winches, too."""
        if y.ndim > 1:
            raise ComputationError("ropes of prescribed length have equations for one state at a time")
        found = super().derivative(time, y)
        if self.layout.works:
            found[-1] += self.power(time, y, found)
        return found

    def power(self, time: float, y: Floats, found: Floats) -> float:
        """The power (W) of the winches, from y and its derivative."""
        first, half = int(self.layout.on_cart), self.layout.half
        q, v, a = y[first:half], y[half + first : 2 * half], found[half + first : 2 * half]
        lengths, total, hoisting = self.lengths(time), 0.0, self.system.hoisting
        assert hoisting is not None
        for group in self.system.groups:
            index = group.index
            l, speed, acceleration = (part[index] for part in lengths)
            if speed.any():
                u, n, w, turn = *directions(q[index]), v[index], a[index]
                along, across = acceleration - l * w * w, l * turn + 2 * speed * w
                start = np.zeros((2, *index.shape[1:]))
                start[0], start[1] = (found[half] if first else 0.0), -self.system.gravity
                ends = start[:, None] + np.cumsum(along * u + across * n, axis=1)
                rest = np.where(hoisting.moving[index], 0.0, group.block.length - group.block.centre)
                needed = group.block.mass * (ends - rest * (turn * n - w * w * u))
                force = np.cumsum(needed[:, ::-1], axis=1)[:, ::-1]
                total += float(np.sum(speed * np.sum(u * force, axis=0)))
        return total


def directions(angles: Floats) -> tuple[Floats, Floats]:
    """The unit vectors u along and n across every link, (2, n, P): along the rail, down."""
    sin, cos = np.sin(angles), np.cos(angles)
    return np.stack((sin, cos)), np.stack((cos, -sin))
