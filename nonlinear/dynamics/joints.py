"""Springs, dampers and drives at the joints of chains in the plane: moments, energy, power, all (n, P) or summed.

A spring acts on the angle γ between two neighbouring links less the one at which it is relaxed, a damper on its rate,
a van der Pol torque (e − curb γ²) γ' on both.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.system import Group


def relative(values: Any) -> Any:
    """Of every link to the one above, the support's being zero."""
    found = values.copy()
    found[1:] -= values[:-1]
    return found


def bend(group: Group, angles: Any) -> Any:
    """The angle (rad) of every link to the one above less that at rest, (n, P, ...)."""
    return relative(angles) - _spread(group.bent, angles)


def moments(group: Group, angles: Any, rates: Any) -> Any:
    """Generalized forces (N m) on the absolute angles, (n, P, ...) as the angles are."""
    hinge = np.zeros_like(angles)
    if group.sprung:
        hinge -= _spread(group.block.stiffness, angles) * bend(group, angles)
    if group.damped or group.excited:
        hinge += _gain(group, angles) * relative(rates)
    hinge[:-1] -= hinge[1:].copy()
    return hinge


def power(group: Group, angles: Any, rates: Any) -> Any:
    """Power (W) of the joint dampers, never positive, and of the van der Pol torques, (...)."""
    return np.sum(_gain(group, angles) * relative(rates) ** 2, axis=(0, 1))


def spring_energy(group: Group, angles: Floats) -> Floats:
    """Energy (J) of every joint spring, (n, P, ...)."""
    return np.asarray(_spread(group.block.stiffness, angles) * bend(group, angles) ** 2 / 2)


def _gain(group: Group, angles: Any) -> Any:
    """What dampers and van der Pol torques multiply γ' by (N m s/rad)."""
    if not group.excited:
        return -_spread(group.block.damping, angles)
    assert group.excitation is not None
    spare = group.excitation.strength - group.block.damping
    return _spread(spare, angles) - _spread(group.excitation.curb, angles) * bend(group, angles) ** 2


def _spread(constant: Floats, like: Any) -> Floats:
    return constant.reshape(*constant.shape, *[1] * (like.ndim - 2))
