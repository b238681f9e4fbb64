"""Dry friction at joints and on the rail: Coulomb's law without smoothing.

At each of J contacts the velocity of sliding is γ' = (J v)_j, a difference of two neighbouring rates or the cart's
velocity.  The torque or force τ_j of friction opposes it and is at most the limit M_j,

    γ' ≠ 0:  τ = −M sign γ',        γ' = 0:  |τ| ≤ M,  and τ = −M sign γ'' where sliding begins

(Coulomb; Glocker, Set-Valued Force Laws, 2001, §2).  It enters the equations of motion as M(q) v' = f + Jᵀτ, so that
γ'' = a + Gτ with the accelerations a without friction and G = J M⁻¹ Jᵀ, symmetric and positive definite.  Contacts at
rest solve a linear complementarity problem with bounds, which has one solution (`hold`).

On the rail the limit may be μ|N|, N = N₀ + nᵀτ being the reaction of the rail, which depends on friction itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nan
from typing import Any, NamedTuple, cast

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.contacts import Contacts
from nonlinear.dynamics.minimal import Arranged, Minimal, Recursion, inverted
from nonlinear.system import Layout, Load, Motion, State, System

EXCESS = 1e-12  # rounding of a torque relative to its limit, and of an acceleration relative to its parts
JAM = 1e4  # friction on the rail over that of all weights and centrifugal forces, beyond which it has no bound
JAMMED = "the rail's friction has no consistent value: its coefficient is too large for these links"


def hold(a: Floats, G: Floats, limit: Floats) -> tuple[Floats, Floats]:
    """The friction τ (J,) of contacts at rest, and the sign (J,) of the sliding that begins, 0 where they stick.

    Of γ'' = a + Gτ and |τ| ≤ limit: γ'' = 0 inside the limit, else γ'' away from τ.  The first contact that violates
    this changes its state until none does: finite for a positive definite G (Murty, Linear Algebra Appl. 7, 65 (1974);
    with bounds Júdice and Pires, Computers Ops Res. 21, 587 (1994)).  ComputationError where none is found.
    """
    sign = np.zeros(len(a))
    size = np.abs(G) @ np.where(np.isfinite(limit), limit, 0.0) + np.abs(a)
    for _ in range(64 * (1 + len(a)) + 3 ** min(len(a), 12)):
        tau = friction_of(a, G, limit, sign)
        stuck = sign == 0
        wrong = np.where(stuck, np.abs(tau) > limit * (1 + EXCESS), (a + G @ tau) * sign < -EXCESS * size)
        if not wrong.any():
            return np.clip(tau, -limit, limit), sign
        j = int(np.argmax(wrong))
        sign[j] = -np.sign(tau[j]) if stuck[j] else 0.0
    raise ComputationError("dry friction: no consistent set of sticking joints was found")


def friction_of(a: Floats, G: Floats, limit: Floats, sign: Floats) -> Floats:
    """The friction τ (J,) where contacts with a `sign` slide and all others stick."""
    stuck = sign == 0
    tau = -sign * np.where(stuck, 0.0, limit)
    if len(a) == 1 and stuck[0]:
        return np.array([-a[0] / G[0, 0]])
    if stuck.any():
        tau[stuck] = np.linalg.solve(G[np.ix_(stuck, stuck)], -(a + G @ tau)[stuck])
    return tau


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
        found = responding.rates
        try:
            rubbing = self._solved(responding, self.sign)
        except ComputationError as error:
            self.refused = str(error)
            found[half : 2 * half] = nan
            return found
        found[half : 2 * half] += responding.columns @ rubbing.tau
        found[-1] += rubbing.tau @ (self.sliding(y) * self._slides)
        for below, above in self._held:
            for part in (found[:half], found[half : 2 * half]):
                part[below] = part[above] if above >= 0 else 0.0
        return found

    def responding(self, time: float, y: Floats) -> Responding:
        """The derivative without friction, and the responses to it."""
        free = cast("Minimal", self.free)
        instant = free.inputs.at(time, y, self.layout)
        links, forces = y[int(self.layout.on_cart) : self.layout.half], self._jacobian.T
        solvers = [(group, Recursion(group, 1)) for group in free.lengthened(instant)]
        columns = inverted(self.system, solvers, np.repeat(links[:, None], forces.shape[1], 1), forces)
        rates = free.derivative(time, y)
        if not self.contacts.coefficient:
            return Responding(rates, columns)
        push = free.reaction(y, instant, rates[self.layout.half : 2 * self.layout.half])
        return Responding(rates, columns, push, np.array([free.reaction(y, instant, own, False) for own in columns.T]))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The same y without the rounding by which sticking contacts move."""
        if self.sign.all():
            return y, 0.0
        found, half = y.copy(), self.layout.half
        stuck = self.placed[self.sign == 0].tolist()
        for (below, above), placed in zip(self._held, stuck, strict=True):
            found[below] = placed + (found[above] if above >= 0 else 0.0)
            found[half + below] = found[half + above] if above >= 0 else 0.0
        return found, 0.0

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

    def refuse_jam(self, y: Floats, force: float) -> None:
        """ComputationError where this friction (N) of the rail at one y is beyond all weights and inertial forces.

        Before it has no value it grows as 1/(1 + s μ e n₀), and no integrator's steps, however short, reach that end.
        """
        rates = y[self.layout.half + int(self.layout.on_cart) : 2 * self.layout.half]
        thrown = sum(float(group.block.b.ravel() @ rates[group.index].ravel() ** 2) for group in self.system.groups)
        if abs(force) > JAM * self.contacts.coefficient * (self.system.gravity * self.system.total_mass + thrown):
            raise ComputationError(JAMMED)

    def _solved(self, found: Responding, sign: Floats, *, deciding: bool = False) -> Rubbing:
        half = self.layout.half
        a, G = self._jacobian @ found.rates[half : 2 * half], self._jacobian @ found.columns
        if not self.contacts.coefficient:
            return _consistent(a, G, self.contacts.limit, sign, deciding)
        return _on_rail(a, G, self.contacts, sign, (found.push, found.slopes), deciding)


def _consistent(a: Floats, G: Floats, limit: Floats, sign: Floats, deciding: bool) -> Rubbing:
    """Friction with known limits: with the given signs, or for contacts of sign 0 as `hold` finds it."""
    resting = sign == 0
    if not (deciding and resting.any()):
        return Rubbing(friction_of(a, G, limit, sign), limit, sign)
    tau, begun = -sign * np.where(resting, 0.0, limit), sign.copy()
    tau[resting], begun[resting] = hold((a + G @ tau)[resting], G[np.ix_(resting, resting)], limit[resting])
    return Rubbing(tau, limit, begun)


def _on_rail(
    a: Floats, G: Floats, contacts: Contacts, sign: Floats, reaction: tuple[float, Floats], deciding: bool
) -> Rubbing:
    """Friction with the limit μ|N| on the rail, contact 0: every state of the rail is tried with either sign of N.

    With τ₀ = −s μ |N| and N = N₀ + nᵀτ, τ₀ = −s μ e (N₀ + Σ_j n_j τ_j)/(1 + s μ e n₀), e = sign N: friction at the
    joints then sees a + G₀ τ₀ as one more response to its own torques.
    """
    base, n = reaction
    limit = contacts.limit.copy()
    if sign[0] == 0:
        limit[0] = inf
        found = _consistent(a, G, limit, sign, deciding)
        limit[0] = contacts.coefficient * abs(base + float(n @ found.tau))
        if not deciding or abs(found.tau[0]) <= limit[0] * (1 + EXCESS):
            return Rubbing(found.tau, limit, found.sign)
    for s in [sign[0]] if sign[0] else [1.0, -1.0]:
        for e in (1.0, -1.0):
            pressed = s * e * contacts.coefficient
            share = -pressed / (1 + pressed * n[0])
            rest = _consistent(
                a[1:] + G[1:, 0] * share * base,
                G[1:, 1:] + np.outer(G[1:, 0], share * n[1:]),
                limit[1:],
                sign[1:],
                deciding,
            )
            rail = share * (base + float(n[1:] @ rest.tau))
            tau, begun = np.append(rail, rest.tau), np.append(s, rest.sign)
            push = base + float(n @ tau)
            starts = sign[0] != 0 or (a[0] + float(G[0] @ tau)) * s >= 0
            if push * e >= 0 and starts:
                limit[0] = contacts.coefficient * abs(push)
                return Rubbing(tau, limit, begun)
    raise ComputationError(JAMMED)
