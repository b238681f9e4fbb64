"""Forces from outside: the drag of links against still air, and forces and torques on points, whose sizes time brings.

On the centre of mass of a link, with the absolute velocity v, acts the force

    F = −(drag + quadratic_drag |v|) v

(Landau and Lifshitz, Fluid Mechanics, §§20 and 45, for the two laws).  Over the cart's x and the links' directions u_i
it is the generalized force Σ_k F_k·e_x on x and, with l and c the lengths to the lower joint and to the centre,

    Q_i = l_i Σ_{k>i} F_k + c_i F_i

on u_i; on the angle of a link in the plane it is the component of Q_i across the link, n = (cos θ, −sin θ).
Every line is plain arithmetic: it accepts floats, arrays with further axes, complex numbers and recorded symbols.

A force F on the point at the distance s from the upper joint of link i has on its angle and on those above it (k < i)

    Q_i = s F·n_i,    Q_k = l_k F·n_k,    n = (cos θ, −sin θ) across a link as (along the rail, down),

and F·e_x on the cart.  A torque on a link acts on its angle; one on a joint acts, reversed, on the link above, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats
from nonlinear.system import ActingForce, Group, System


class External(NamedTuple):
    """External forces on a group: generalized ones on u (d, n, P, ...) or torques on angles (n, P, ...), and the rest.

    The power (W) is (...), the force (N) on every centre is (d, n, P, ...), that which every pendulum hands on to its
    first joint (d, P, ...), as are torques (N m) that act reversed on what carries it.
    """

    generalized: Any
    power: Any
    forces: Any
    at_joints: Any
    at_base: Any = 0.0

    @property
    def along_rail(self) -> Any:
        """The force (N) along the rail on what carries the group, (...)."""
        return self.at_joints[0].sum(0)

    def plus(self, other: External) -> External:
        """Both together."""
        return External(*(mine + its for mine, its in zip(self, other, strict=True)))


def drag_law(velocity: Any, drag: Any, quadratic: Any = None) -> Any:
    """The force (N), (d, ...) like the velocity (m/s) of a centre in the air."""
    strength = drag if quadratic is None else drag + quadratic * np.sqrt((velocity * velocity).sum(0))
    return -(strength * velocity)


def drag_forces(group: Group, velocities: Any) -> Any:
    """The force (N) on every link's centre, (d, n, P, ...) like its velocity (m/s)."""
    quadratic = None if group.quadratic_drag is None else _spread(group.quadratic_drag, velocities)
    return drag_law(velocities, _spread(group.block.drag, velocities), quadratic)


def drag(group: Group, along: Any, pivot: tuple[Any, Any], support: Any = None, winding: Any = None) -> External:
    """The drag of a group of links.

    `along` (d, n, P, ...) are the rates u'; the first component is along the rail.  The first joints move at a `pivot`
    velocity (m/s) along it and down, (P, ...) each or one of all.  The air stands still
    while a `support` moves, with the velocity (m/s) along the rail and down; the power is that in its frame.  `winding`
    (d, n, P, ...) are the velocities l' u of bobs at the end of ropes that change their length.
    """
    length, centre = (_spread(part, along) for part in (group.block.length, group.block.centre))
    steps = length * along
    velocities = np.cumsum(steps, axis=1) - steps + centre * along
    if winding is not None:
        velocities = velocities + np.cumsum(winding, axis=1)
    velocities[0], velocities[-1] = velocities[0] + pivot[0], velocities[-1] + pivot[1]
    wind = velocities
    if support is not None:
        wind = velocities.copy()
        wind[0], wind[-1] = wind[0] + support[0], wind[-1] + support[1]
    forces = drag_forces(group, wind)
    through = np.cumsum(forces[:, ::-1], axis=1)[:, ::-1]
    pushed = length * (through - forces) + centre * forces
    return External(pushed, (forces * velocities).sum((0, 1, 2)), forces, through[:, 0])


def plane_drag(
    group: Group, angles: Any, rates: Any, pivot: tuple[Any, Any], support: Any = None, speed: Any = None
) -> External:
    """The drag of a group in the plane; `speed` (n, P, ...) is that at which ropes become longer."""
    sin, cos = np.sin(angles), np.cos(angles)
    winding = None if speed is None else np.stack((speed * sin, speed * cos))
    external = drag(group, np.stack((rates * cos, -(rates * sin))), pivot, support, winding)
    return external._replace(generalized=external.generalized[0] * cos - external.generalized[1] * sin)


def forces_of(system: System, speeds: Floats) -> Floats:
    """The drag (N) on every link at T times, (T, L, d) like the velocities of the centres."""
    forces = np.zeros_like(speeds)
    for group in system.groups:
        if group.dragged:
            velocities = np.moveaxis(speeds[:, group.index], (0, -1), (-1, 0))
            forces[:, group.index] = np.moveaxis(drag_forces(group, velocities), (0, -1), (-1, 0))
    return forces


def _spread(constant: Any, like: Any) -> Any:
    return constant.reshape(*constant.shape, *[1] * (like.ndim - 1 - constant.ndim))


def applied(
    group: Group,
    forces: Sequence[ActingForce],
    sizes: Sequence[Any],
    angles: Any,
    rates: Any,
    pivot: tuple[Any, Any],
    speed: Any = None,
) -> External:
    """The forces of these sizes (N or N m) on a group, whose angles and rates are (n, P, ...).

    `speed` (n, P, ...) is that at which ropes become longer; `pivot` is as in `drag`.
    """
    torques, resultants = np.zeros_like(angles), np.zeros_like(np.stack((angles, angles)))
    power, at_base, length, centre = 0.0, np.zeros_like(angles[0]), group.block.length, group.block.centre
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
                torques[k, columns] = torques[k, columns] + _beside(reach, theta) * (size * across)
                if speed is not None:
                    axial = along * np.sin(theta) if along else down * np.cos(theta)
                    power = power + (speed[k, columns] * (size * axial)).sum(0)
            way = 0 if along else 1
            push = size * (along or down)
            resultants[way, row, columns] = resultants[way, row, columns] + push
    at_joints, power = resultants.sum(1), power + (torques * rates).sum((0, 1))
    power = power + (at_joints[0] * pivot[0] + at_joints[1] * pivot[1]).sum(0)
    return External(torques, power, resultants, at_joints, at_base)


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


def _beside(constant: Any, like: Any) -> Any:
    return constant if np.ndim(constant) == 0 else constant.reshape(-1, *[1] * (like.ndim - 1))
