"""Forces other than gravity and pivot forces: springs, dampers and drives of joints, drag, external loads.

At a joint, or between cart and rail, they depend on the displacement γ from the relaxed position and on its rate:

    −k γ − d γ' + τ(γ, γ')

with any laws τ of joints (`modal.extend`).  The first term is conservative, the second does work; γ of a joint is the
angle between two neighbouring links less its equilibrium value.  A load is a force on the cart and a moment on every
link; dry friction acts as one (`contacts`).
The damping ratios of modes are dampers on all coordinates together, a force −D_modal q' that is linear in the rates of
x and of the angles θ, however large these are.

Against still air the force on the centre of mass of a link, with the absolute velocity v, is

    F = −(drag + quadratic_drag |v|) v

[Landau1987, §§20 and 45].  Over the cart's x and the links' directions u_i
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

from modal.extend.laws import DragLaw
from modal.types import Floats
from nonlinear.dynamics.inputs import input_of
from nonlinear.system import ActingForce, Group, System
from nonlinear.system.system import spread


class External(NamedTuple):
    """External forces on a group: generalized ones on u (d, n, P, ...) or torques on angles (n, P, ...), and the rest.

    The power (W) is (...), the force (N) on every centre is (d, n, P, ...), that which every pendulum hands on to its
    first joint (d, P, ...), as are torques (N m) that act reversed on the part that carries it.
    """

    generalized_forces: Any
    power: Any
    forces: Any
    at_joints: Any
    at_base: Any = 0.0

    @property
    def along_rail(self) -> Any:
        """The force (N) along the rail on the support of the group, (...)."""
        return self.at_joints[0].sum(0)

    def plus(self, other: External) -> External:
        """Return the sum of both."""
        return External(*(mine + its for mine, its in zip(self, other, strict=True)))


def drag_law(velocity: Any, drag: Any, quadratic: Any = None) -> Any:
    """The force (N), (d, ...) like the velocity (m/s) of a centre in the air."""
    parameters = {"drag": drag, "quadratic_drag": 0.0 if quadratic is None else quadratic}
    return np.array(DragLaw().force([*velocity], parameters))


def drag_forces(group: Group, velocities: Any) -> Any:
    """The force (N) on every link's centre, (d, n, P, ...) like its velocity (m/s)."""
    quadratic = None if group.quadratic_drag is None else spread(group.quadratic_drag, velocities[0])
    forces = drag_law(velocities, spread(group.block.drag, velocities[0]), quadratic)
    for term in group.point_forces:
        at = slice(None), term.rows, term.columns
        forces[at] = forces[at] + term.forces(velocities[at])
    return forces


def drag(group: Group, rates: Any, pivot: tuple[Any, Any], support: Any = None, winding: Any = None) -> External:
    """The drag of a group of links.

    `rates` (d, n, P, ...) are the rates u'; the first component is along the rail.  The first joints move at a `pivot`
    velocity (m/s) along it and down, (P, ...) each or one of all.  The air stands still
    while a `support` moves, with the velocity (m/s) along the rail and down; the power is that in its frame.  `winding`
    (d, n, P, ...) are the velocities l' u of bobs at the end of ropes that change their length.
    """
    length, centre = (spread(part, rates[0]) for part in (group.block.length, group.block.centre))
    steps = length * rates
    velocities = np.cumsum(steps, axis=1) - steps + centre * rates
    if winding is not None:
        velocities = velocities + np.cumsum(winding, axis=1)
    velocities[0], velocities[-1] = velocities[0] + pivot[0], velocities[-1] + pivot[1]
    wind = velocities
    if support is not None:
        wind = velocities.copy()
        wind[0], wind[-1] = wind[0] + support[0], wind[-1] + support[1]
    forces = drag_forces(group, wind)
    through = np.cumsum(forces[:, ::-1], axis=1)[:, ::-1]
    on_links = length * (through - forces) + centre * forces
    return External(on_links, (forces * velocities).sum((0, 1, 2)), forces, through[:, 0])


def plane_drag(
    group: Group, angles: Any, rates: Any, pivot: tuple[Any, Any], support: Any = None, speed: Any = None
) -> External:
    """The drag of a group in the plane; `speed` (n, P, ...) is that at which ropes become longer."""
    sin, cos = np.sin(angles), np.cos(angles)
    winding = None if speed is None else np.stack((speed * sin, speed * cos))
    external = drag(group, np.stack((rates * cos, -(rates * sin))), pivot, support, winding)
    return external._replace(
        generalized_forces=external.generalized_forces[0] * cos - external.generalized_forces[1] * sin
    )


def forces_of(system: System, speeds: Floats) -> Floats:
    """The drag (N) on every link at T times, (T, L, d) like the velocities of the centres."""
    forces = np.zeros_like(speeds)
    for group in system.groups:
        if group.has_drag:
            velocities = np.moveaxis(speeds[:, group.index], (0, -1), (-1, 0))
            forces[:, group.index] = np.moveaxis(drag_forces(group, velocities), (0, -1), (-1, 0))
    return forces


def external_of_forces(
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
                component = along * np.cos(theta) if along else -down * np.sin(theta)
                arm = spread(reach, theta) if np.ndim(reach) else reach
                torques[k, columns] = torques[k, columns] + arm * (size * component)
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


def resultants(system: System, angles: Floats, time: float, y: Any = ()) -> tuple[Floats, Floats, float]:
    """Of all forces on every link the resultant (N), (L, 2), and the moment about its centre (N m), (L,); on the cart.

    Written for links that are free of each other, as maximal coordinates have them; loops see y = (q, q').
    """
    forces, moments = np.zeros((system.n_links, 2)), np.zeros(system.n_links)
    centre, normals = system.by_link("centre"), np.column_stack((np.cos(angles), -np.sin(angles)))
    sizes = sizes_at(system, time) + [input_of(loop, y) for loop in system.loops]
    for force, size in zip(system.acting, sizes, strict=True):
        for link, above, below in force.places:
            if force.direction is None:
                moments[link] += size
                if below is None and above >= 0:
                    moments[above] -= size
                continue
            push = size * np.array(force.direction)
            forces[link] += push
            if below is not None:
                moments[link] += (below - centre[link]) * float(normals[link] @ push)
    return forces, moments, float(on_cart(system, sizes))


def joint_law(gamma: Any, rate: Any, stiffness: Any, damping: Any) -> Any:
    """The conservative and the dissipative part of the force: N at the rail, N m at a joint."""
    return -stiffness * gamma, -damping * rate


def cart_force(system: System, x: Any, rate: Any) -> Any:
    """Force (N) of the rail's spring and of its damper, as in `joint_law`; 0 on a fixed support."""
    cart = system.cart
    return joint_law(x, rate, cart.stiffness, cart.damping) if cart else (0.0, 0.0)


Base = tuple[Any, Any]
"""The angles (rad) and rates (rad/s) of the parts that carry the first joints, (P, ...) each."""


def joint_torques(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any]:
    """Generalized forces (N m) on the absolute angles, (n, P, ...) like these, and the power of dampers and drives.

    The power (...) is that dissipated by dampers and supplied by van der Pol torques (W). First joints may be on a
    rotating `base`.
    """
    torques, power = bending_torques(group, angles, rates, base)
    return _on_links(torques), power


def link_torques(group: Group, angles: Any, rates: Any) -> Any:
    """The generalized forces (N m) of `joint_torques` alone, where only the support carries first joints."""
    elastic, working, _ = _bending(group, angles, rates)
    return _on_links(elastic + working)


def _on_links(torques: Any) -> Any:
    """The sum on every link, from torques of joints (n, P, ...), which are overwritten."""
    if len(torques) > 1:
        torques[:-1] -= torques[1:].copy()
    return torques


def bending_torques(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any]:
    """The torque (N m) of every joint on the link below it, (n, P, ...), and the power as in `joint_torques`."""
    elastic, working, speed = _bending(group, angles, rates, base)
    return elastic + working, np.sum(working * speed, axis=(0, 1))


def _bending(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any, Any]:
    """Both parts of the torque of every joint, (n, P, ...), and the rate (rad/s) at which it bends."""
    base_angle, turning = base or (None, None)
    gamma, speed = bend(group, angles, base_angle), relative(rates, turning)
    constants = (spread(constant, angles) for constant in (group.block.stiffness, group.block.damping))
    elastic, working = joint_law(gamma, speed, *constants)
    for term in group.laws:
        at = term.rows, term.columns
        parts = term.torques(gamma[at], speed[at])
        elastic[at], working[at] = elastic[at] + parts[0], working[at] + parts[1]
    return elastic, working, speed


def modal_drag(system: System, rates: Any) -> Any:
    """The generalized forces −D_modal q' (half, ...) of damping ratios, from the rates of the cart and the links."""
    D = np.asarray(system.modal_damping)
    return -np.tensordot(D, rates, 1) if D.ndim == 2 else -(D * rates).sum(1)


def inertial_torques(group: Group, angles: Any, support: Any) -> Any:
    """Torques (n, P, ...) of the inertial forces −m a in the frame of a support, a along the rail and down (m/s²).

    They are those of a uniform field: with b as in `modal.pair`, b (a_down sin θ − a_along cos θ).
    """
    return inertial_law(spread(group.block.b, angles), np.sin(angles), np.cos(angles), support)


def inertial_law(b: Any, sin: Any, cos: Any, support: Any) -> Any:
    """Return the torque (N m) of the inertial forces of one link and everything below it."""
    along, down = support
    return b * (down * sin - along * cos)


def spring_energy(group: Group, angles: Floats, base: Any = None) -> Floats:
    """Energy (J) of every joint spring and of laws with a potential, (n, P, ...)."""
    gamma = bend(group, angles, base)
    energy = np.asarray(spread(group.block.stiffness, angles) * gamma**2 / 2)
    for term in group.laws:
        energy[term.rows, term.columns] += term.energy(gamma[term.rows, term.columns])
    return energy


def relative(values: Any, base: Any = None) -> Any:
    """The value of every link relative to the one above, the support's being zero, or that of a `base` (P, ...)."""
    differences = values.copy()
    if len(values) > 1:
        differences[1:] -= values[:-1]
    if base is not None:
        differences[0] = differences[0] - base
    return differences


def bend(group: Group, angles: Any, base: Any = None) -> Any:
    """The angle (rad) of every link relative to the one above, less its equilibrium value, (n, P, ...)."""
    return relative(angles, base) - spread(group.joint_rest, angles)
