"""The equations of motion in the plane with their exact derivatives by the state, for variational equations.

With a = (x'', θ'') and everything on one side, r(q, v, a) = M(q) a − f(q, v) = 0, the derivatives at fixed a are

    ∂r_i/∂v_j = 2 A_ij sin(θ_i − θ_j) v_j − ∂Q_i/∂v_j
    ∂r_i/∂θ_j = A_ij [sin(θ_i − θ_j) a_j − cos(θ_i − θ_j) v_j²]  (j ≠ i)
    ∂r_i/∂θ_i = −Σ_{j≠i} ∂r_i/∂θ_j + g b_i cos θ_i − b_i sin θ_i x'' − ∂Q_i/∂θ_i

and those of a are −M⁻¹ ∂r.  The laws of joints and rail are differentiated by complex steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.dense import SINGULAR, Small
from nonlinear.dynamics.joints import joint_law
from nonlinear.system import System

STEP = 1e-200
STEPS = np.array([[STEP * 1j], [0.0]])


@dataclass(frozen=True, eq=False)
class Joints:
    """Every joint in the order of the links: spring, damper, drive and relaxed angle, each (L,).

    `above` (L, L) takes values of links to those relative to the link above.
    """

    stiffness: Floats
    damping: Floats
    strength: Floats
    curb: Floats
    bent: Floats
    above: Floats

    def torques(self, angles: Floats, rates: Floats) -> tuple[Floats, Floats, Floats]:
        """Generalized forces (L,) and their derivatives by angles and rates, (L, L)."""
        gamma, speed = self.above @ angles - self.bent, self.above @ rates
        by_angle, by_rate = self._law(gamma + STEPS, speed + STEPS[::-1])
        one, other = ((self.above.T * (part.imag / STEP)) @ self.above for part in (by_angle, by_rate))
        return self.above.T @ by_angle.real, one, other

    def _law(self, gamma: Any, speed: Any) -> Any:
        kept, working = joint_law(gamma, speed, self.stiffness, self.damping, self.strength, self.curb)
        return kept + working


def joints_of(system: System) -> Joints | None:
    """The joints of a system, None where they exert no torques between kicks."""
    if not any(group.hinged for group in system.groups):
        return None
    size = system.n_links
    rows, above = np.zeros((5, size)), np.eye(size)
    for group in system.groups:
        drive, none = group.excitation, np.zeros_like(group.bent)
        driven = (drive.strength, drive.curb) if drive else (none, none)
        rows[:, group.index] = (group.block.stiffness, group.block.damping, *driven, group.bent)
        above[group.index[1:], group.index[:-1]] = -1.0
    stiffness, damping, strength, curb, bent = rows
    return Joints(stiffness, damping, strength, curb, bent, above)


@dataclass(frozen=True, eq=False)
class Variational(Small):
    """The equations of `Small` without work, y = (x, θ, x', θ'), with their derivatives."""

    counts_work: bool = False

    @cached_property
    def joints(self) -> Joints | None:
        """The joints that exert torques."""
        return joints_of(self.system)

    @cached_property
    def size(self) -> int:
        """Length of y."""
        return self.layout.size

    @property
    def constants(self) -> tuple[Floats, Floats, float, float, Floats, Floats]:
        """A, b, gravity, total mass, cart (stiffness, damping; empty without a cart), and the rows of the joints."""
        (A, b), cart, joints = self._pair, self.system.cart, self.joints
        on_cart = np.array([cart.stiffness, cart.damping]) if cart else np.empty(0)
        size = self.system.n_links
        rows = np.empty((0, size))
        if joints:
            top = (joints.above.sum(axis=1) > 0).astype(float)
            rows = np.array([joints.stiffness, joints.damping, joints.strength, joints.curb, joints.bent, top])
        return A, b, self.system.gravity, self._total, on_cart, rows

    def linearized(self, y: Floats, outside: Floats | None = None) -> tuple[Floats, Floats]:
        """The derivative y' (d,) and its Jacobian by y (d, d); `outside` (n,) are further generalized forces."""
        half, first = self.layout.half, int(self.layout.on_cart)
        (A, b), g, cart = self._pair, self.system.gravity, self.system.cart
        angles, rates = y[first:half], y[half + first :]
        sin, cos, squared = np.sin(angles), np.cos(angles), rates**2
        apart = angles[:, None] - angles
        C, S = A * np.cos(apart), A * np.sin(apart)
        along, across = b * sin, b * cos
        M, force, by_q, by_v = np.empty((half, half)), np.empty(half), np.zeros((half, half)), np.zeros((half, half))
        M[first:, first:], force[first:] = C, -g * along - S @ squared
        by_v[first:, first:] = 2 * S * rates
        if self.joints:
            torques, by_angle, by_rate = self.joints.torques(angles, rates)
            force[first:] += torques
            by_v[first:, first:] -= by_rate
            by_q[first:, first:] -= by_angle
        if cart:
            M[0, 0], M[0, 1:], M[1:, 0] = self._total, across, across
            force[0] = along @ squared - cart.stiffness * y[0] - cart.damping * y[half]
            by_q[0, 0], by_v[0, 0], by_v[0, 1:] = cart.stiffness, cart.damping, -2 * along * rates
        if outside is not None:
            force += outside
        inverse = inverted(M)
        a = inverse @ force
        turned, inner = a[first:], S * a[first:] - C * squared
        by_q[first:, first:] += inner
        diagonal = by_q.reshape(-1)[first * (half + 1) :: half + 1]
        diagonal += g * across - inner.sum(axis=1)
        if cart:
            diagonal -= along * a[0]
            by_q[0, 1:] = -along * turned - across * squared
        slope = np.zeros((2 * half, 2 * half))
        slope.reshape(-1)[half :: 2 * half + 1][:half] = 1.0
        slope[half:, :half], slope[half:, half:] = -inverse @ by_q, -inverse @ by_v
        return np.concatenate((y[half:], a)), slope

    def masses(self, links: Floats) -> Floats:
        """The mass matrix M(q) (n, n)."""
        first, half = int(self.layout.on_cart), self.layout.half
        A, b = self._pair
        M = np.empty((half, half))
        M[first:, first:] = A * np.cos(links[:, None] - links)
        if first:
            M[0, 0], M[0, 1:] = self._total, b * np.cos(links)
            M[1:, 0] = M[0, 1:]
        return M

    def energy_slope(self, y: Floats) -> Floats:
        """The derivative of the energy (J) by y, (d,)."""
        half, first = self.layout.half, int(self.layout.on_cart)
        (A, b), g, cart = self._pair, self.system.gravity, self.system.cart
        angles, v = y[first:half], y[half:]
        rates, sin = v[first:], np.sin(y[first:half])
        by_q = np.zeros(half)
        by_q[first:] = g * b * sin - rates * ((A * np.sin(angles[:, None] - angles)) @ rates)
        if cart:
            by_q[0] = cart.stiffness * y[0]
            by_q[1:] -= b * sin * rates * v[0]
        if joints := self.joints:
            by_q[first:] += joints.above.T @ (joints.stiffness * (joints.above @ angles - joints.bent))
        return np.concatenate((by_q, self.masses(angles) @ v))

    def momentum_slope(self, y: Floats) -> Floats:
        """The derivative of M x' + Σ b cos θ θ' + c x, which a cart without a spring conserves, by y, (d,)."""
        half, (_, b), cart = self.layout.half, self._pair, self.system.cart
        assert cart is not None
        angles, rates = y[1:half], y[half + 1 :]
        return np.concatenate(([cart.damping], -b * np.sin(angles) * rates, [self._total], b * np.cos(angles)))

    def struck(self, y: Floats, impulse: Floats) -> tuple[Floats, Floats]:
        """The change of y by a generalized impulse (n,), (d,), and its Jacobian by y (d, d)."""
        half, first = self.layout.half, int(self.layout.on_cart)
        (A, b), angles = self._pair, y[first:half]
        inverse = inverted(self.masses(angles))
        u = inverse @ impulse
        inner = A * np.sin(angles[:, None] - angles) * u[first:]
        by_q, place = np.zeros((half, half)), np.arange(first, half)
        by_q[first:, first:] = inner
        by_q[place, place] -= inner.sum(axis=1)
        if first:
            by_q[place, place] -= b * np.sin(angles) * u[0]
            by_q[0, 1:] = -b * np.sin(angles) * u[1:]
        slope = np.zeros((2 * half, 2 * half))
        slope[half:, :half] = -inverse @ by_q
        return np.concatenate((np.zeros(half), u)), slope


def inverted(M: Floats) -> Floats:
    """The inverse of a mass matrix; ComputationError where there is none."""
    try:
        return np.asarray(np.linalg.inv(M))
    except np.linalg.LinAlgError:
        raise ComputationError(SINGULAR) from None
