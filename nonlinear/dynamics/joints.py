"""Forces on a plane scene besides gravity and the pivot forces: springs, dampers, drives, drag and external loads.

At a joint, or between cart and rail, they depend on the displacement γ from the relaxed position and on its rate:

    −k γ + (e − curb γ² − d) γ'

The first term is conservative, the second does work; γ of a joint is the angle between two neighbouring links less its
equilibrium value.  A load is a force on the cart and a moment on every link; dry friction acts as one (`contacts`).
The damping ratios of modes are dampers on all coordinates together, a force −D_modal q' that is linear in the rates of
x and of the angles θ, however large these are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.system import Group, System


def joint_law(gamma: Any, rate: Any, stiffness: Any, damping: Any, strength: Any = 0.0, curb: Any = 0.0) -> Any:
    """The conservative and the dissipative (or driving) part of the force: N at the rail, N m at a joint."""
    return -stiffness * gamma, (strength - damping - curb * gamma**2) * rate


def cart_force(system: System, x: Any, rate: Any) -> Any:
    """Force (N) of the rail's spring and of its damper, as in `joint_law`; 0 on a fixed support."""
    cart = system.cart
    return joint_law(x, rate, cart.stiffness, cart.damping) if cart else (0.0, 0.0)


Base = tuple[Any, Any]
"""The angles (rad) and rates (rad/s) of what carries the first joints, (P, ...) each."""


def joint_torques(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any]:
    """Generalized forces (N m) on the absolute angles, (n, P, ...) like these, and the power of dampers and drives.

    The power (...) is what dampers drain and van der Pol torques supply (W).  A `base` that turns carries the first
    joints.
    """
    torques, power = bending_torques(group, angles, rates, base)
    return _on_links(torques), power


def link_torques(group: Group, angles: Any, rates: Any) -> Any:
    """The generalized forces (N m) of `joint_torques` alone, where only the support carries first joints."""
    kept, working, _ = _bending(group, angles, rates)
    return _on_links(kept + working)


def _on_links(torques: Any) -> Any:
    """The sum on every link, from torques of joints (n, P, ...), which are overwritten."""
    if len(torques) > 1:
        torques[:-1] -= torques[1:].copy()
    return torques


def bending_torques(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any]:
    """The torque (N m) of every joint on the link below it, (n, P, ...), and the power as in `joint_torques`."""
    kept, working, speed = _bending(group, angles, rates, base)
    return kept + working, np.sum(working * speed, axis=(0, 1))


def _bending(group: Group, angles: Any, rates: Any, base: Base | None = None) -> tuple[Any, Any, Any]:
    """Both parts of the torque of every joint, (n, P, ...), and the rate (rad/s) at which it bends."""
    turned, turning = base or (None, None)
    block, drive, speed = group.block, group.excitation, relative(rates, turning)
    curbed = (drive.strength, drive.curb) if group.excited and drive else ()
    constants = (_spread(constant, angles) for constant in (block.stiffness, block.damping, *curbed))
    return *joint_law(bend(group, angles, turned), speed, *constants), speed


def modal_drag(system: System, rates: Any) -> Any:
    """The generalized forces −D_modal q' (half, ...) of damping ratios, from the rates of the cart and the links."""
    D = np.asarray(system.modal_damping)
    return -np.tensordot(D, rates, 1) if D.ndim == 2 else -(D * rates).sum(1)


def inertial_torques(group: Group, angles: Any, support: Any) -> Any:
    """Torques (n, P, ...) of the inertial forces −m a in the frame of a support, a along the rail and down (m/s²).

    They are those of a uniform field: with b as in `modal.pair`, b (a_down sin θ − a_along cos θ).
    """
    return inertial_law(_spread(group.block.b, angles), np.sin(angles), np.cos(angles), support)


def inertial_law(b: Any, sin: Any, cos: Any, support: Any) -> Any:
    """The torque (N m) of those of one link and all that hangs below it."""
    along, down = support
    return b * (down * sin - along * cos)


def spring_energy(group: Group, angles: Floats, base: Any = None) -> Floats:
    """Energy (J) of every joint spring, (n, P, ...)."""
    return np.asarray(_spread(group.block.stiffness, angles) * bend(group, angles, base) ** 2 / 2)


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
    return relative(angles, base) - _spread(group.bent, angles)


def _spread(constant: Floats, like: Any) -> Floats:
    return constant.reshape(*constant.shape, *[1] * (like.ndim - constant.ndim))
