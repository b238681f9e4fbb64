"""Forces and torques on points of a scene, whose sizes time brings: their generalized forces, power and resultants.

A force F on the point at the distance s from the upper joint of link i has on its angle and on those above it (k < i)

    Q_i = s F·n_i,    Q_k = l_k F·n_k,    n = (cos θ, −sin θ) across a link as (along the rail, down),

and F·e_x on the cart.  A torque on a link acts on its angle; one on a joint acts, reversed, on the link above, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.drag import External
from nonlinear.system import ActingForce, Group, System


def applied(
    group: Group,
    forces: Sequence[ActingForce],
    sizes: Sequence[Any],
    angles: Any,
    rates: Any,
    cart_rate: Any,
    speed: Any = None,
) -> External:
    """The forces of these sizes (N or N m) on a group, whose angles and rates are (n, P, ...).

    `speed` (n, P, ...) is that at which ropes become longer; `cart_rate` is as in `nonlinear.dynamics.drag.drag`.
    """
    torques, resultants = np.zeros_like(angles), np.zeros_like(np.stack((angles, angles)))
    on_cart, power, at_base, length, centre = 0.0, 0.0, np.zeros_like(angles[0]), group.block.length, group.block.centre
    for force, size in zip(forces, sizes, strict=True):
        for row, columns, below in force.spots(group.index):
            if force.direction is None:
                torques[row, columns] = torques[row, columns] + size
                if below is None and row:
                    torques[row - 1, columns] = torques[row - 1, columns] - size
                elif below is None:
                    at_base[columns] = at_base[columns] + size
                continue
            along, down = force.direction
            for k in range(row + 1):
                reach = length[k, columns] if k < row else centre[k, columns] if below is None else below
                theta = angles[k, columns]
                across = along * np.cos(theta) if along else -down * np.sin(theta)
                torques[k, columns] = torques[k, columns] + _spread(reach, theta) * (size * across)
                if speed is not None:
                    axial = along * np.sin(theta) if along else down * np.cos(theta)
                    power = power + (speed[k, columns] * (size * axial)).sum(0)
            way = 0 if along else 1
            push = size * (along or down)
            resultants[way, row, columns] = resultants[way, row, columns] + push
            if along:
                on_cart = on_cart + len(columns) * push
    at_joints, power = resultants.sum(1), power + (torques * rates).sum((0, 1))
    if isinstance(cart_rate, tuple):
        power = power + (at_joints[0] * cart_rate[0] + at_joints[1] * cart_rate[1]).sum(0)
    else:
        power = power + on_cart * cart_rate
    return External(torques, on_cart, power, resultants, at_joints, at_base)


def on_cart(system: System, sizes: Sequence[Any]) -> Any:
    """The force (N) of those that act on the cart itself."""
    return sum((size for force, size in zip(system.forces, sizes, strict=False) if not force.places), 0.0)


def sizes_at(system: System, time: float) -> list[float]:
    """The sizes (N or N m) of all forces at a time (s)."""
    return [force.course.at(time) for force in system.forces]


def resultants(system: System, angles: Floats, time: float) -> tuple[Floats, Floats, float]:
    """Of all forces on every link the resultant (N), (L, 2), and the moment about its centre (N m), (L,); on the cart.

    Written for links that are free of each other, as maximal coordinates have them.
    """
    forces, moments = np.zeros((system.n_links, 2)), np.zeros(system.n_links)
    centre, across = system.by_link("centre"), np.column_stack((np.cos(angles), -np.sin(angles)))
    sizes = sizes_at(system, time)
    for force, size in zip(system.forces, sizes, strict=True):
        for link, above, below in force.places:
            if force.direction is None:
                moments[link] += size
                if below is None and above >= 0:
                    moments[above] -= size
                continue
            push = size * np.array(force.direction)
            forces[link] += push
            if below is not None:
                moments[link] += (below - centre[link]) * float(across[link] @ push)
    return forces, moments, float(on_cart(system, sizes))


def _spread(constant: Any, like: Any) -> Any:
    return constant if np.ndim(constant) == 0 else constant.reshape(-1, *[1] * (like.ndim - 1))
