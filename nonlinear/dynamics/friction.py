"""Dry friction at joints and on the rail: Coulomb's law without smoothing.

At each of J contacts the velocity of sliding is γ' = (J v)_j, a difference of two neighbouring rates or the cart's
velocity.  The torque or force τ_j of friction opposes it and is at most the limit M_j,

    γ' ≠ 0:  τ = −M sign γ',        γ' = 0:  |τ| ≤ M,  and τ = −M sign γ'' where sliding begins

(Coulomb; Glocker, Set-Valued Force Laws, 2001, §2).  It enters the equations of motion as M(q) v' = f + Jᵀτ, so that
γ'' = a + Gτ with the accelerations a without friction and G = J M⁻¹ Jᵀ, symmetric and positive definite.  Contacts at
rest solve a linear complementarity problem with bounds, which has one solution (`complementarity`).

On the rail the limit may be μ|N|, N = N₀ + nᵀτ being the reaction of the rail, which depends on friction itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import nan
from typing import Any, NamedTuple, cast

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.complementarity import UNBOUNDED, consistent, on_rail
from nonlinear.dynamics.contacts import Contacts
from nonlinear.dynamics.minimal import Arranged, Minimal, Recursion, inverted
from nonlinear.system import Layout, Load, Motion, State, System

JAM = 1e4  # friction on the rail over that of all weights and centrifugal forces, beyond which it has no bound
JAMMED = "the rail's friction has no consistent value: its coefficient is too large for these links"


@dataclass(frozen=True)
class Rubbing:
    """What friction does at one instant: its torques or forces τ (J,), their limits, and the sign of sliding (J,)."""

    tau: Floats
    limit: Floats
    sign: Floats


class Responding(NamedTuple):
    """The derivative y' (size,) without friction and M⁻¹Jᵀ (half, J); with a coefficient, N₀ (N) and n (J,)."""

    rates: Floats
    columns: Floats
    push: float = nan
    slopes: Any = None


@dataclass(eq=False)
class Frictional:
    """The equations `free` with dry friction: contacts slide the way `sign` (J,) says, 0 sticking, until it is changed.

    `placed` (J,) are the angles or the position of contacts at rest, `refused` says why the last trial step found no
    friction.  Events decide when the sign changes.
    """

    free: Arranged
    contacts: Contacts
    sign: Floats = field(init=False)
    placed: Floats = field(init=False)
    refused: str = field(init=False, default="")

    def __post_init__(self) -> None:
        self.set_sign(np.zeros(len(self.contacts.below)))
        self.placed = self.sign.copy()

    def set_sign(self, sign: Floats) -> None:
        """Let the contacts slide or stick like this from now on."""
        self.sign = sign
        self._slides = np.asarray(sign != 0)
        stuck = np.flatnonzero(sign == 0).tolist()
        self._held = [(int(self.contacts.below[j]), int(self.contacts.above[j])) for j in stuck]

    @property
    def system(self) -> System:
        """The scene as arrays."""
        return self.free.system

    @property
    def load(self) -> Load | None:
        """The external load."""
        return self.free.load

    @property
    def layout(self) -> Layout:
        """The arrangement of y."""
        return self.free.layout

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.free.scale

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        return self.free.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        return self.free.read(rows)

    def sliding(self, rows: Floats) -> Floats:
        """The velocity γ' of every contact (..., J) in rows (..., size)."""
        half = self.layout.half
        return np.asarray(rows[..., half : 2 * half] @ self._jacobian.T)

    def place(self, rows: Floats) -> Floats:
        """The angle or position γ of every contact (..., J)."""
        return self.contacts.relative(rows[..., : self.layout.half])

    @property
    def rests(self) -> bool:
        """Whether every coordinate is held for good, as nothing from outside changes."""
        acted_on = self.load or self.system.prescribed or self.system.hoisting
        return not acted_on and len(self.sign) == self.layout.half and not self.sign.any()

    def derivative(self, time: float, y: Any) -> Any:
        """The derivative y' (size,), sticking contacts having no relative acceleration.

        Where friction has no value the accelerations are NaN, so that an integrator whose trial step leads there takes
        a shorter one, and `refused` is the reason.
        """
        half, responding = self.layout.half, self.responding(time, y)
        slopes = responding.rates
        try:
            rubbing = self._solved(responding, self.sign)
        except ComputationError as error:
            self.refused = str(error)
            slopes[half : 2 * half] = nan
            return slopes
        slopes[half : 2 * half] += responding.columns @ rubbing.tau
        slopes[-1] += rubbing.tau @ (self.sliding(y) * self._slides)
        for below, above in self._held:
            for part in (slopes[:half], slopes[half : 2 * half]):
                part[below] = part[above] if above >= 0 else 0.0
        return slopes

    def responding(self, time: float, y: Floats) -> Responding:
        """The derivative without friction, and the responses to it."""
        free = cast("Minimal", self.free)
        instant = free.inputs.at(time, y, self.layout)
        q, forces = y[: self.layout.half], self._jacobian.T
        solvers = [(group, Recursion(group, 1)) for group in free.lengthened(instant)]
        columns = inverted(self.system, solvers, np.repeat(q[:, None], forces.shape[1], 1), forces)
        rates = free.derivative(time, y)
        if not self.contacts.coefficient:
            return Responding(rates, columns)
        push = free.reaction(y, instant, rates[self.layout.half : 2 * self.layout.half])
        return Responding(
            rates, columns, push, np.array([free.reaction(y, instant, column, False) for column in columns.T])
        )

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The same y without the rounding by which sticking contacts move."""
        if self.sign.all():
            return y, 0.0
        projected, half = y.copy(), self.layout.half
        stuck = self.placed[self.sign == 0].tolist()
        for (below, above), placed in zip(self._held, stuck, strict=True):
            projected[below] = placed + (projected[above] if above >= 0 else 0.0)
            projected[half + below] = projected[half + above] if above >= 0 else 0.0
        return projected, 0.0

    # ------------------------------------------------------------------------------------------------- forces

    @cached_property
    def _jacobian(self) -> Floats:
        return self.contacts.jacobian(self.layout.half)

    def rubbing(self, time: float, y: Floats, sign: Floats | None = None) -> Rubbing:
        """Friction at one y, contacts sliding the way `sign` (J,) says (by default, the present one), 0 sticking."""
        return self._solved(self.responding(time, y), self.sign if sign is None else sign)

    def settled(self, time: float, y: Floats, sign: Floats) -> Rubbing:
        """Friction at one y, where contacts of sign 0 are at rest and may begin to slide: its `sign` has the result."""
        return self._solved(self.responding(time, y), sign, deciding=True)

    def release(self, time: float, y: Floats) -> None:
        """Set the state of every contact to what it is at this y."""
        self.set_sign(self.settled(time, y, np.sign(self.sliding(y))).sign)
        self.placed = self.place(y)

    def _solved(self, responding: Responding, sign: Floats, *, deciding: bool = False) -> Rubbing:
        half, count, mu = self.layout.half, len(sign), self.contacts.coefficient
        a = (self._jacobian @ responding.rates[half : 2 * half]).tolist()
        G = (self._jacobian @ responding.columns).ravel().tolist()
        limit = self.contacts.limit.copy()
        if mu:
            limit[0] = mu
        bound = limit.tolist() if deciding else np.where(sign == 0, UNBOUNDED, limit).tolist()
        if mu:
            normal = [responding.push, *responding.slopes.tolist()]
            tau, begun, _ = on_rail(a, G, bound, sign.tolist(), normal, count)
            limit[0] = mu * abs(normal[0] + float(responding.slopes[: len(tau)] @ tau))
        else:
            tau, begun = consistent(a, G, bound, sign.tolist(), count)
        if len(tau) < count:
            raise ComputationError(JAMMED if mu else "dry friction: no consistent set of sticking joints was found")
        return Rubbing(np.array(tau), limit, np.array(begun))


def refuse_jam(system: System, rates: Floats, force: float) -> None:
    """ComputationError where this friction (N) of the rail is beyond all weights and inertial forces.

    `rates` are those of the links (L,).  Before it has no value it grows as 1/(1 + s μ e n₀), and no integrator's
    steps, however short, reach that end.
    """
    thrown = sum(float(group.block.b.ravel() @ rates[group.index].ravel() ** 2) for group in system.groups)
    coefficient = system.rail.coefficient if system.rail else 0.0
    if abs(force) > JAM * coefficient * (system.gravity * system.total_mass + thrown):
        raise ComputationError(JAMMED)
