"""Dry friction and escapements: where they act, and the laws that they obey.

At each of J contacts the velocity of sliding is γ' = (J v)_j, a difference of two neighbouring rates or the cart's
velocity.  The torque or force τ_j of friction opposes it and is at most the limit M_j,

    γ' ≠ 0:  τ = −M sign γ',        γ' = 0:  |τ| ≤ M,  and τ = −M sign γ'' where sliding begins

(Coulomb; Glocker, Set-Valued Force Laws, 2001, §2).  It adds Jᵀτ to the generalized forces, so that γ'' = a + Gτ with
the accelerations a without friction and G = J M⁻¹ Jᵀ, symmetric and positive definite.  Which contacts at rest begin to
slide is a linear complementarity problem with bounds, which has one solution (`complementarity`).  The friction of
those that stick leaves them at rest, Ja + Gτ = 0 (`sticking`).

An escapement's kick P at a joint is an impulse +P on the link below and −P on the one above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats, Ints
from nonlinear.system import System

JAM = 1e4  # friction on the rail over that of all weights and centrifugal forces, beyond which it has no bound
JAMMED = "the rail's friction has no consistent value: its coefficient is too large for these links"


@dataclass(frozen=True, eq=False)
class Contacts:
    """The J contacts of a system from the cart down each pendulum, all arrays (J,).

    `below` and `above` are the coordinates of v whose difference is γ', −1 standing for the support; `limit` is in
    N m, or N on the rail, which comes first where `rail` is true; its limit is 0 where there is a `coefficient` μ.
    """

    below: Ints
    above: Ints
    limit: Floats
    rail: bool
    coefficient: float

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The coordinates below and above every contact."""
        return tuple(zip(self.below.tolist(), self.above.tolist(), strict=True))

    def relative(self, values: Floats) -> Floats:
        """The value at every contact (..., J) from those of the coordinates (..., half)."""
        padded = np.concatenate((values, np.zeros_like(values[..., :1])), axis=-1)
        return np.asarray(padded[..., self.below] - padded[..., self.above])


def contacts_of(system: System) -> Contacts:
    """The contacts of a system with dry friction."""
    first = system.first
    below, above, limit = np.zeros((3, 0))
    for group in system.groups:
        if group.friction is not None:
            over = np.vstack((np.full_like(group.index[:1], -1), group.index[:-1] + first))
            rubbing = group.friction > 0
            below = np.append(below, group.index[rubbing] + first)
            above, limit = np.append(above, over[rubbing]), np.append(limit, group.friction[rubbing])
    if system.rail:
        below, above, limit = np.append(below, 0), np.append(above, -1), np.append(limit, system.rail.friction)
    order = np.argsort(below, kind="stable")
    coefficient = system.rail.coefficient if system.rail else 0.0
    places = below[order].astype(np.int64), above[order].astype(np.int64)
    return Contacts(*places, limit[order], system.rail is not None, coefficient)


def links_of_contacts(system: System) -> Ints:
    """The link below each contact (J,), −1 for the rail."""
    return np.asarray(contacts_of(system).below - system.first)


def jams(system: System, rates: Sequence[float], normal: float) -> bool:
    """Whether N of a rail with a coefficient is beyond all weights and inertial forces (N), at `rates` of links (L,).

    Before its friction has no value it grows as 1/(1 + s μ e n₀), and no integrator's steps, however short, reach
    that end.
    """
    if abs(normal) <= JAM * system.gravity * system.total_mass:
        return False
    w = np.asarray(rates)
    thrown = sum(float(group.block.b.ravel() @ w[group.index].ravel() ** 2) for group in system.groups)
    return abs(normal) > JAM * (system.gravity * system.total_mass + thrown)


@dataclass(frozen=True, eq=False)
class Escaping:
    """The J joints with escapements of a system, all arrays (J,): the links below and above (−1: support).

    `bent` is the equilibrium angle (rad); `impulse` (N m s) and `angle` (rad) are those of the kicks.
    """

    system: System
    below: Ints
    above: Ints
    bent: Floats
    impulse: Floats
    angle: Floats

    def gamma(self, values: Floats, rest: Floats | float = 0.0) -> Floats:
        """The value at every joint (..., J) from the values of all coordinates (..., half)."""
        padded = np.concatenate((values, np.zeros_like(values[..., :1])), axis=-1)
        below, above = np.array(self.pairs, dtype=np.int64).reshape(-1, 2).T
        return np.asarray(padded[..., below] - padded[..., above] - rest)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The coordinates of v below and above every joint, −1 standing for a support that does not turn."""
        system, first = self.system, self.system.first
        above = np.where(self.above < 0, -1, self.above + first)
        if system.structure is not None:
            for joint in np.flatnonzero(self.above < 0):
                pivot = system.structure.pivots[system.pendulum[self.below[joint]]]
                angle = system.structure.angle_of(pivot.carrier)
                above[joint] = -1 if angle is None else angle
        return tuple(zip((self.below + first).tolist(), above.tolist(), strict=True))


def escaping(system: System) -> Escaping:
    """The joints with escapements, in the order of the groups."""
    parts: list[Floats] = []
    for group in system.groups:
        if group.kicked and group.excitation:
            above = np.vstack((np.full_like(group.index[:1], -1), group.index[:-1]))
            drive = group.excitation
            columns = (group.index, above, group.bent, drive.impulse, drive.angle)
            parts.append(np.stack([part[drive.impulse > 0] for part in columns]))
    below, above, *rest = np.hstack(parts) if parts else np.empty((5, 0))
    return Escaping(system, below.astype(np.int64), above.astype(np.int64), *rest)


class Rubbed(NamedTuple):
    """Accelerations (half,) under friction, the friction τ (J,) found, and N of a rail with a coefficient.

    τ is that of contacts that stick and of one that slides on such a rail, 0 elsewhere.
    """

    accelerations: Any
    tau: Sequence[Any]
    normal: Any = None


class Gripping(NamedTuple):
    """Contacts with the coordinates `pairs` (below, above), of which those whose `sticks` (J,) is 1, not 0, stick.

    Where friction on the rail, contact 0, has a coefficient μ, it is `pressed` N = −s μ |N| as it slides to the side s.
    """

    pairs: Sequence[tuple[int, int]]
    sticks: Sequence[Any]
    pressed: Any = None

    def forces(self, half: int) -> Any:
        """Jᵀ, the generalized forces (half, J) of a unit of friction at every contact."""
        columns = np.zeros((half, len(self.pairs)))
        for column, (below, above) in zip(columns.T, self.pairs, strict=True):
            column[below] = 1.0
            if above >= 0:
                column[above] = -1.0
        return columns
