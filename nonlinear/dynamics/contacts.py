"""The contacts of dry friction: where they are, and accelerations that leave those that stick at rest.

At each of J contacts the velocity of sliding is γ' = (J v)_j, a difference of two neighbouring rates or the cart's
velocity, and a torque or force τ_j of friction adds Jᵀτ to the generalized forces.  Where accelerations without the
friction of the contacts that stick are a, those with it are

    a + M⁻¹Jᵀτ,   (J M⁻¹ Jᵀ τ)_j = −(J a)_j,   j among the contacts that stick,

and on a rail with a coefficient, where N₀ and the response c₀ are those with the others held,

    τ₀ = k N,   N = N₀ + n₀ τ₀,   k = −s μ sign N        so that   τ₀ = k N₀/(1 − k n₀),  n₀ = ∂N/∂a · c₀.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats, Ints
from nonlinear.system import System


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

    def jacobian(self, half: int) -> Floats:
        """J, (J, half)."""
        return self.relative(np.eye(half)).T.copy()


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

    def rubbed(self, a: Any, columns: Any, reaction: Callable[[Any, bool], Any]) -> Rubbed:
        """What friction makes of accelerations a (half,) without it, from M⁻¹Jᵀ (half, J).

        `reaction` is N at accelerations, or, if False comes with them, its part that is linear in them.
        """
        accelerations, tau = self._held(a, columns)
        if self.pressed is None:
            return Rubbed(accelerations, tau)
        response, others = self._held(columns[:, 0], columns)
        base, slope = reaction(accelerations, True), reaction(response, False)
        rail = self.pressed * base / (1.0 - self.pressed * slope)
        others[0] = others[0] + 1.0
        return Rubbed(
            accelerations + response * rail,
            [t + o * rail for t, o in zip(tau, others, strict=True)],
            base + slope * rail,
        )

    def _held(self, a: Any, columns: Any) -> tuple[Any, list[Any]]:
        """The accelerations under the friction of those that stick, which move exactly like what is above; and τ."""
        accelerations, tau = a.copy(), self._friction(a, columns)
        for j, each in enumerate(tau):
            accelerations = accelerations + columns[:, j] * each
        for (below, above), s in zip(self.pairs, self.sticks, strict=True):
            accelerations[below] = (1.0 - s) * accelerations[below] + (s * accelerations[above] if above >= 0 else 0.0)
        return accelerations, tau

    def _friction(self, a: Any, columns: Any) -> list[Any]:
        """The friction τ (J,) of those that stick.

        Of a contact that slides the equation is τ = 0, so that one elimination serves every set of sticking contacts.
        """
        s, each = self.sticks, range(len(self.pairs))
        G = [[s[i] * s[j] * self._relative(columns[:, j], i) for j in range(i + 1)] for i in each]
        right = [-(s[i] * self._relative(a, i)) for i in each]
        for i in each:
            G[i][i] = G[i][i] + (1.0 - s[i])
        for k in each:
            for i in each[k + 1 :]:
                share = G[i][k] / G[k][k]
                for j in range(k + 1, i + 1):
                    G[i][j] = G[i][j] - share * G[j][k]
                right[i] = right[i] - share * right[k]
        for k in reversed(each):
            for i in each[k + 1 :]:
                right[k] = right[k] - G[i][k] * right[i]
            right[k] = right[k] / G[k][k]
        return right

    def _relative(self, values: Any, j: int) -> Any:
        below, above = self.pairs[j]
        return values[below] - values[above] if above >= 0 else values[below]
