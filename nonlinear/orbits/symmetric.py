"""Symmetric orbits of conservative scenes: nonlinear normal modes by a quarter of their period.

A motion released from rest whose links are all at their equilibrium angles, and the cart in the middle, a time τ later
repeats itself with the period 4τ: the equations are odd in the coordinates and the same backwards.  Unknown are the
release q and τ,

    q(τ; q) = q_rest,

a family of one parameter [Rosenberg1966].  Along a number of the scene, the energy is fixed.

On structures left and right differ: springs between points pull along lines that turn, boards lift the pendula next to
their axis. There the equations are still the same backwards, so that a motion released from rest that comes to rest
again a time τ later repeats itself with the period 2τ: q'(τ; q) = 0 (`Half`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from modal.assembly import matrices
from modal.eigen import is_singular
from modal.errors import ComputationError
from modal.scene import Scene, require
from modal.types import Floats
from nonlinear.orbits.floquet import of_symmetric, scaled_translations
from nonlinear.orbits.flow import Flow
from nonlinear.orbits.orbit import Orbit
from nonlinear.system import system_of, translations

UNMOVED = (
    "a massless cart has no equation of motion where all that pulls it hangs straight down, and the orbits of a mode "
    "pass there: give it a mass"
)


@dataclass(frozen=True, eq=False)
class Quarter:
    """The equations of symmetric orbits of a scene, u = (q − rest in natural units, τ sqrt(g/l))."""

    scene: Scene
    flow: Flow
    parts: ClassVar[int] = 4
    """How many times the period has τ in it."""

    @cached_property
    def half(self) -> int:
        """Number of coordinates."""
        return self.flow.equations.layout.half

    @property
    def clock(self) -> float:
        """Natural rate (rad/s)."""
        return self.flow.system.rate

    def start(self, u: Floats) -> Floats:
        """The vector y of a release."""
        n = self.half
        return np.concatenate((self.flow.rest + u[:n] * self.flow.scale[:n], np.zeros(n)))

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """The coordinates a quarter of a period later, and their derivatives."""
        return self._residuals(u, slice(self.half), self.flow.rest)

    def _residuals(self, u: Floats, rows: slice, target: Floats | float) -> tuple[Floats, Floats]:
        """The residuals of the conditions on these rows of y at the time τ, and their derivatives by u."""
        n, scale = self.half, self.flow.scale
        arrival = self.flow(self.start(u), np.eye(2 * n)[:, :n] * scale[:n], u[n] / self.clock)
        rates = arrival.path.rates[-1]
        r = (arrival.y[rows] - target) / scale[rows]
        return r, np.column_stack((arrival.V[rows], rates[rows] / self.clock)) / scale[rows, None]

    def orbit(self, u: Floats) -> Orbit:
        """The orbit with its multipliers."""
        n, scale, y = self.half, self.flow.scale, self.start(u)
        part = float(u[n]) / self.clock
        arrival = self.flow(y, np.diag(scale), part)
        Q = arrival.V / scale[:, None]
        P = np.concatenate((-np.ones(n), np.ones(n)))
        H = P[:, None] * np.linalg.solve(Q, P[:, None] * Q)
        force = self.flow.equations.energy_slope(y)[:n] * scale[:n]
        floquet = of_symmetric(H, force, self.translates, halves=self.parts // 2)
        residual, symmetric = self._residual(arrival.y), self.parts == 4
        return Orbit(self.scene, self.flow, y, self.parts * part, floquet, residual, arrival.path, symmetric)

    def _residual(self, y: Floats) -> float:
        """By how much the end misses rest, in natural units."""
        n = self.half
        return float(np.abs((y[:n] - self.flow.rest) / self.flow.scale[:n]).max())

    @cached_property
    def translates(self) -> Floats:
        """The effect of translations of free parts on the coordinates, (k, n)."""
        return scaled_translations(translations(self.flow.system), self.flow.scale[: self.half])

    def energy_slope(self, u: Floats, tangent: Floats) -> float:
        """The derivative of the energy (J) along the branch."""
        n = self.half
        return float(self.flow.equations.energy_slope(self.start(u))[:n] @ (tangent[:n] * self.flow.scale[:n]))


class Half(Quarter):
    """The equations of orbits that come to rest twice, u = (q − rest in natural units, τ sqrt(g/l)), 2τ the period."""

    parts: ClassVar[int] = 2

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """The velocities half a period later, and where free supports start; and their derivatives."""
        r, J = self._residuals(u, slice(self.half, None), 0.0)
        translation_rows = np.pad(self.translates, ((0, 0), (0, 1)))
        return np.append(r, translation_rows @ u), np.vstack((J, translation_rows))

    def _residual(self, y: Floats) -> float:
        n = self.half
        return float(np.abs(y[n:] / self.flow.scale[n:]).max())


def quarter_of(scene: Scene, tolerance: float) -> Quarter:
    """The equations of a conservative scene in the plane, on a structure those of `Half`.

    Raise ComputationError if it has none at the equilibrium.
    """
    require(scene, "a periodic orbit of a mode")
    if is_singular(matrices(scene).M):
        raise ComputationError(UNMOVED)
    return (Half if scene.is_structured else Quarter)(scene, Flow(system_of(scene), tolerance))
