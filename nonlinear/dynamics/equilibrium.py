"""Whether a start is an unstable equilibrium of the full equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.contacts import contacts_of
from nonlinear.dynamics.joints import link_torques
from nonlinear.dynamics.minimal import Minimal, Recursion
from nonlinear.system import Group, State, System

ROUNDING = 16 * float(np.finfo(float).eps)  # of moments that are in balance, relative to their parts
TINY = float(np.finfo(float).tiny)
STEP = 1e-100
AT_REST, GROWS = 1e-12, 1e-9  # acceleration in natural units, and growth over the largest, beyond rounding


def is_unstable_equilibrium(system: System, start: State) -> bool:
    """Whether a start is an unstable equilibrium to within rounding, or on a fixed support any one of its pendula is.

    Nothing moves, the moments of gravity and springs balance, and V has no minimum there.  Where dry friction holds
    every coordinate nothing is unstable.  On a structure all of it is at rest.
    """
    if system.structure is not None:
        return _on_structure(system, start)
    if system.rubs and len(contacts_of(system).below) == system.n_links + system.first:
        return False
    angles = np.arctan2(np.hypot(*start.links.T[:2]), start.links[:, 2]) if system.spatial else start.links
    still = ~np.any(start.link_rates.reshape(system.n_links, -1), axis=1)
    judged = []
    for group in system.groups:
        weight, bent = system.gravity * group.block.b, angles[group.index]
        left = np.abs(link_torques(group, bent, 0.0 * bent) - weight * np.sin(bent))
        balanced = left <= ROUNDING * (weight + group.block.stiffness) * (1 + np.abs(bent))
        judged.append((np.all(balanced & still[group.index], axis=0), _falls(group, weight * np.cos(bent))))
    resting, falling = (np.concatenate(part) for part in zip(*judged, strict=True))
    if system.cart is None:
        return bool(np.any(resting & falling))
    pulled = start.cart * system.cart.stiffness or start.cart_rate * system.cart.damping
    return bool(np.all(resting) and np.any(falling) and not pulled)


def _on_structure(system: System, start: State) -> bool:
    """Whether everything rests, no coordinate is accelerated, and one of ∂q''/∂q = −M⁻¹K grows."""
    if np.any(start.link_rates) or np.any(start.support_rates):
        return False
    quiet = replace(system, forces=(), support=None, hoisting=None)
    equations = Minimal(quiet, tuple(Recursion(group, tail=1) for group in quiet.groups), counts_work=False)
    y, half = equations.layout.begin(start), equations.layout.half
    units = equations.scale[half:] * system.rate
    if np.any(np.abs(equations.derivative(0.0, y[:, None])[half:, 0]) > AT_REST * units * (1 + np.abs(y).max())):
        return False
    pushed = np.repeat(y[:, None], half, axis=1) + 1j * STEP * np.eye(len(y))[:, :half]
    growing = np.linalg.eigvals(equations.derivative(0.0, pushed)[half:].imag / STEP)
    return bool(growing.real.max() > GROWS * np.abs(growing).max())


def _falls(group: Group, weight: Floats) -> Any:
    """Whether V'' of each chain, with `weight` (n, P) and the joint springs, has a negative pivot, (P,)."""
    stiffness = group.block.stiffness
    pivot, falling = np.inf * weight[0], np.zeros(weight.shape[1], dtype=bool)
    for at in range(group.n - 1, -1, -1):
        below = stiffness[at + 1] if at + 1 < group.n else 0.0 * stiffness[0]
        pivot = weight[at] + stiffness[at] + below - below**2 / pivot
        falling |= pivot < 0
        pivot = np.where(pivot == 0, TINY, pivot)
    return falling
