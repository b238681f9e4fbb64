"""Springs and dampers at the joints of chains in the plane: moments, energy and power, all (n, P) or summed.

A spring acts on the angle between two neighbouring links less the one at which it is relaxed, a damper on its rate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.rig import Floats
from nonlinear.plant import Group


def relative(values: Any) -> Any:
    """Of every link to the one above, the support's being zero."""
    return np.diff(values, axis=0, prepend=0.0)


def moments(group: Group, angles: Any, rates: Any) -> Any:
    """Generalized forces (N m) of springs and dampers on the absolute angles, (n, P, ...) as the angles are."""
    hinge = np.zeros_like(angles)
    if group.sprung:
        hinge -= _spread(group.block.stiffness, angles) * (relative(angles) - _spread(group.bent, angles))
    if group.damped:
        hinge -= _spread(group.block.damping, rates) * relative(rates)
    hinge[:-1] -= hinge[1:].copy()
    return hinge


def damper_power(group: Group, rates: Any) -> Any:
    """Power (W) of the joint dampers, never positive, (...)."""
    return -np.sum(_spread(group.block.damping, rates) * relative(rates) ** 2, axis=(0, 1))


def spring_energy(group: Group, angles: Floats) -> Floats:
    """Energy (J) of every joint spring, (n, P, ...)."""
    bend = relative(angles) - _spread(group.bent, angles)
    return np.asarray(_spread(group.block.stiffness, angles) * bend**2 / 2)


def _spread(constant: Floats, like: Any) -> Floats:
    return constant.reshape(*constant.shape, *[1] * (like.ndim - 2))
