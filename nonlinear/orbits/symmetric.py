"""Symmetric orbits of conservative scenes: nonlinear normal modes by a quarter of their period.

A motion released from rest whose links are all at their equilibrium angles, and the cart in the middle, a time τ later
repeats itself with the period 4τ: the equations are odd in the coordinates and the same backwards.  Unknown are the
release q and τ,

    q(τ; q) = q_rest,

a family of one parameter (Rosenberg, Adv. Appl. Mech. 9, 155 (1966)).  Along a number of the scene, the energy is held.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.assembly import matrices
from modal.eigen import is_singular
from modal.errors import ComputationError
from modal.scene import Scene, require
from modal.types import Floats
from nonlinear.orbits.floquet import of_symmetric
from nonlinear.orbits.flow import Flow
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import require_held
from nonlinear.system import system_of

UNMOVED = (
    "a massless cart has no equation of motion where all that pulls it hangs straight down, and the orbits of a mode "
    "pass there: give it a mass"
)
UNEVEN = (
    "the orbits of a mode are followed where a motion is its own mirror image half a period later, and this structure "
    "has supports or springs that answer one way otherwise than the other"
)
SEED, TRIALS, WIDE = 5, 3, 0.3  # motions at which that is asked, and how wide they are in natural units
EVEN = 1e-9  # of the accelerations, a part that may be even by rounding


@dataclass(frozen=True, eq=False)
class Quarter:
    """The equations of symmetric orbits of a scene, u = (q − rest in natural units, τ sqrt(g/l))."""

    scene: Scene
    flow: Flow

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
        n, scale = self.half, self.flow.scale
        passed = self.flow(self.start(u), np.eye(2 * n)[:, :n] * scale[:n], u[n] / self.clock)
        r = (passed.y[:n] - self.flow.rest) / scale[:n]
        J = np.column_stack((passed.V[:n], passed.y[n:] / self.clock)) / scale[:n, None]
        return r, J

    def orbit(self, u: Floats) -> Orbit:
        """The orbit with its multipliers."""
        n, scale, y = self.half, self.flow.scale, self.start(u)
        quarter = float(u[n]) / self.clock
        passed = self.flow(y, np.diag(scale), quarter)
        Q = passed.V / scale[:, None]
        P = np.concatenate((-np.ones(n), np.ones(n)))
        H = P[:, None] * np.linalg.solve(Q, P[:, None] * Q)
        cart, force = self.flow.system.cart, self.flow.equations.energy_slope(y)[:n] * scale[:n]
        translates = np.eye(n)[0] if cart and not cart.stiffness else None
        residual = float(np.abs((passed.y[:n] - self.flow.rest) / scale[:n]).max())
        floquet = of_symmetric(H, force, translates)
        return Orbit(self.scene, self.flow, y, 4 * quarter, floquet, residual, passed.path, symmetric=True)

    def energy_slope(self, u: Floats, tangent: Floats) -> float:
        """The derivative of the energy (J) along the branch."""
        n = self.half
        return float(self.flow.equations.energy_slope(self.start(u))[:n] @ (tangent[:n] * self.flow.scale[:n]))


def quarter_of(scene: Scene, tolerance: float) -> Quarter:
    """The equations of a conservative scene in the plane; ComputationError where it has none at the equilibrium."""
    require(scene, "a periodic orbit of a mode")
    if is_singular(matrices(scene).M):
        raise ComputationError(UNMOVED)
    require_held(scene)
    flow = Flow(system_of(scene), tolerance)
    if scene.is_structured and not _is_odd(flow):
        raise ComputationError(UNEVEN)
    return Quarter(scene, flow)


def _is_odd(flow: Flow) -> bool:
    """Whether the equations of motion are odd in the coordinates, as this method needs."""
    random, half, scale = np.random.default_rng(SEED), len(flow.rest), flow.scale
    for _ in range(TRIALS):
        aside = scale * random.uniform(-WIDE, WIDE, len(scale))
        rest = np.concatenate((flow.rest, np.zeros(half)))
        there, back = (flow.equations.derivative(0.0, rest + way * aside)[half:] for way in (1, -1))
        if np.abs((there + back) / scale[half:]).max() > EVEN * np.abs((there - back) / scale[half:]).max():
            return False
    return True
