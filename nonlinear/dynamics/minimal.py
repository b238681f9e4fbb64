"""Motion in the plane in minimal coordinates: the cart and one absolute angle a link."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from modal.types import Ints
from nonlinear.dynamics import joints
from nonlinear.dynamics.recursion import downward, links_of, upward
from nonlinear.dynamics.suspended import Suspended
from nonlinear.system import Group


class Recursion:
    """The plain body: one pass up and one down, for any numbers behind (n, P) that `sine` and `cosine` take."""

    def __init__(self, group: Group, tail: int = 0, sine: Any = np.sin, cosine: Any = np.cos) -> None:
        self.sine, self.cosine = sine, cosine
        self.links = [type(link)(*(value.reshape(-1, *[1] * tail) for value in link)) for link in links_of(group)]

    def pull(self, angles: Any, rates: Any, torques: Any, gravity: float) -> tuple[Any, Any, Any]:
        """Mass (kg) and force (N) of the pull along the rail, summed over the pendula."""
        answer, turns = upward(self.links, self.sine(angles), self.cosine(angles), rates, torques)
        return answer.xx.sum(0), (answer.px - gravity * answer.xz).sum(0), (turns, gravity)

    def turn(self, memory: Any, push: Any) -> Any:
        """θ'' (n, P, ...)."""
        turns, gravity = memory
        return np.array(downward(self.links, turns, push, -gravity))


class Minimal(Suspended):
    """The equations of motion of a plane scene, y = (x, θ, x', θ', work)."""

    width = 1

    @cached_property
    def places(self) -> tuple[Ints, ...]:
        """Where every group's angles (n, P) stand among all."""
        return tuple(group.index for group in self.system.groups)

    def acting(self, group: Group, links: Any, rates: Any, moments: Any | None) -> tuple[Any, Any]:
        """Torques (n, P, ...) on the absolute angles, and the power of joints and moments."""
        torques, power = moments, 0.0
        if moments is not None:
            power = np.sum(moments * rates)
        if group.hinged:
            hinges = joints.moments(group, links, rates)
            torques = hinges if torques is None else torques + hinges
        if group.damped or group.excited:
            power = power + joints.power(group, links, rates)
        return np.zeros_like(links) if torques is None else torques, power
