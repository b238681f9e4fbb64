"""Motion in space: the cart along its rail and one unit vector per link, y = (x, u, x', w, work)."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from modal.types import Ints
from nonlinear.dynamics import spatial_joints as ball_joints
from nonlinear.dynamics.drag import External, drag
from nonlinear.dynamics.joints import Base
from nonlinear.dynamics.minimal import Suspended
from nonlinear.dynamics.recursion import links_of
from nonlinear.dynamics.spatial_joints import generalized
from nonlinear.dynamics.spatial_recursion import cross, dot, downward, facing, upward
from nonlinear.system import Group


class SpatialRecursion:
    """One pass up and one down in NumPy; u, u' and the torques on u are (3, n, P, ...)."""

    def __init__(self, group: Group, tail: int = 0) -> None:
        self.links = [type(link)(*(value.reshape(-1, *[1] * tail) for value in link)) for link in links_of(group)]

    def pull(self, u: Any, w: Any, torque: Any, gravity: float) -> tuple[Any, Any, Any]:
        """The effective mass (kg) and force (N) along the rail, summed over the pendula.

        The stages of an integrator's step leave the sphere, where the two reflections of `spatial_recursion` would give
        different results and y' would jump as a link passes the horizontal: so the directions are normalized first.
        """
        u = u / np.sqrt(dot(u, u))
        answer, turns = upward(self.links, u, w, torque, facing(u))
        force = answer.p[0] - gravity * answer.M[0, 2]
        return answer.M[0, 0].sum(0), force.sum(0), (turns, gravity, answer.p)

    def turn(self, memory: Any, push: Any) -> Any:
        """Second derivatives u'' (3, n, P, ...)."""
        turns, gravity, like = memory
        felt = np.zeros_like(like)
        felt[0], felt[2] = push, -gravity
        return np.stack(downward(self.links, turns, felt), axis=1)


class Spatial(Suspended):
    """The equations of motion of a scene in space, y = (x, u, x', w, work)."""

    @cached_property
    def places(self) -> tuple[Ints, ...]:
        """Positions of the components (3, n, P) of every group among those of all links."""
        return tuple(3 * group.index + np.arange(3)[:, None, None] for group in self.system.groups)

    def acting(
        self, group: Group, links: Any, rates: Any, moments: Any | None, support: Any, base: Base | None = None
    ) -> tuple[Any, Any, Any]:
        """Generalized forces (3, n, P, ...) on u, and the power of dampers, moments and inertial forces."""
        power = 0.0
        if moments is not None:
            power = np.sum(dot(moments, cross(links, rates)))
        if support is not None:
            along, down = support
            b = group.block.b.reshape(*group.block.b.shape, *[1] * (links.ndim - 3))
            power = power - (b * (along * rates[0] + down * rates[2])).sum((0, 1))
        if group.sprung or group.damped:
            hinges = ball_joints.moments(group, links, rates)
            moments = hinges if moments is None else moments + hinges
        if group.damped:
            power = power + ball_joints.damper_power(group, links, rates)
        return np.zeros_like(links) if moments is None else generalized(moments, links), power, 0.0

    def dragged(self, group: Group, links: Any, rates: Any, cart_rate: Any, support: Any, speed: Any) -> External:
        """The drag of a group, with generalized forces (3, n, P, ...) on u."""
        external = drag(group, rates, cart_rate, support)
        return external._replace(generalized=generalized(cross(links, external.generalized), links))
