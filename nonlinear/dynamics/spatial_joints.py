"""Springs and dampers at the joints of chains in space: moments, energy and power.

Vectors are (3, n, P, ...), components first.  A link rotates at Ω = u × w without spin about its axis.  A damper acts
on the rotation of a link relative to the one above (the support's being zero), a spring on the angle γ between the two
directions that coincide at equilibrium, σ_i u_i and σ_{i−1} u_{i−1} (e_z above the first link):

    V = ½ Σ k γ²        moment on the link below = −k (γ / sin γ) a × b − d (Ω_i − Ω_{i−1}),  a above, b below,

and the opposite on the link above; τ on a link is the generalized force Q = τ × u on u.  With 4 z = |a − b|² and 4 z̄ =
|a + b|², γ = 2 arctan √(z/z̄) and γ / sin γ = arctan √(z/z̄) / √(z z̄): analytic except where the spring is bent right
back (γ = π), where the moment has no direction and is taken as zero.  γ never exceeds π: a joint in space does not wind
up, as one in the plane does.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.spatial_recursion import DOWN, cross, dot
from nonlinear.dynamics.tape import where
from nonlinear.system import Group

STRAIGHT = 1e-300  # z of a joint without a bend, or bent right back


def generalized(moments: Any, u: Any) -> Any:
    """The generalized forces (N m) of moments on links."""
    return cross(moments, u)


def moments(group: Group, u: Any, w: Any) -> Any:
    """The moments (N m) of springs and dampers on the links."""
    hinge = np.zeros_like(u)
    if group.sprung:
        above, below, z, rest = _bend(group, u)
        hinge -= _spread(group.block.stiffness, u) * _per_sine(z, rest) * cross(above, below)
    if group.damped:
        hinge -= _spread(group.block.damping, u) * _relative(cross(u, w))
    hinge[:, :-1] -= hinge[:, 1:].copy()
    return hinge


def damper_power(group: Group, u: Any, w: Any) -> Any:
    """Power (W) of the joint dampers, never positive, (...)."""
    apart = _relative(cross(u, w))
    return -np.sum(_spread(group.block.damping, u) * dot(apart, apart), axis=(0, 1))


def spring_energy(group: Group, u: Floats) -> Floats:
    """Energy (J) of every joint spring, (n, P, ...)."""
    _, _, z, rest = _bend(group, u)
    return np.asarray(2 * _spread(group.block.stiffness, u) * np.arctan2(np.sqrt(z), np.sqrt(rest)) ** 2)


def _bend(group: Group, u: Any) -> tuple[Any, Any, Any, Any]:
    below = _spread(group.block.sigma, u) * u
    above = np.empty_like(below)
    above[:, 0] = DOWN.reshape(3, *[1] * (u.ndim - 2))
    above[:, 1:] = below[:, :-1]
    apart, along = above - below, above + below
    return above, below, dot(apart, apart) / 4, dot(along, along) / 4


def _per_sine(z: Any, rest: Any) -> Any:
    bent = z * rest
    root, other = np.sqrt(where(bent, z, STRAIGHT)), np.sqrt(where(bent, rest, 1.0))
    return np.arctan(root / other) / (root * other)


def _relative(values: Any) -> Any:
    return np.diff(values, axis=1, prepend=0.0)


def _spread(constant: Floats, u: Any) -> Floats:
    return constant.reshape(*constant.shape, *[1] * (u.ndim - 3))
