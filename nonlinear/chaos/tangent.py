"""The growth of a small perturbation of a motion in the plane: tangent (variational) equations by the complex step.

    y' = f(y),        v' = J(y) v,        J v = Im f(y + i h v) / h

The equations of motion are analytic plain arithmetic, so one evaluation with complex numbers gives y' and v' together;
nothing is subtracted, so h can be so small that h² is negligible against 1, and v' is exact but for
rounding (Squire and Trapp, SIAM Review 40, 110, 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.types import Floats
from nonlinear.dynamics import Arranged, Generated, Minimal, Recursion
from nonlinear.integration.costs import WRITTEN
from nonlinear.system import System

STEP = 1e-30


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent equations of a plane scene for E trajectories side by side: y and v are (size, E)."""

    system: System

    @cached_property
    def equations(self) -> Arranged:
        """The equations of motion without the work, which affects nothing and would lengthen y."""
        if self.system.n_links <= WRITTEN:
            return Generated(self.system, counts_work=False)
        return Minimal(self.system, tuple(Recursion(group, tail=1) for group in self.system.groups), counts_work=False)

    @cached_property
    def scale(self) -> Floats:
        """Natural units of y, (size, 1): 1 for angles, l for the cart, sqrt(g/l) and l sqrt(g/l) for their rates.

        l is the shortest link.
        """
        length = float(self.system.by_link("length").min())
        half = np.ones(self.equations.layout.half)
        half[: self.equations.layout.on_cart] = length
        return np.concatenate((half, half * np.sqrt(self.system.gravity / length)))[:, None]

    def product(self, y: Floats, v: Floats) -> tuple[Floats, Floats]:
        """f(y) and J(y) v, each (size, E)."""
        found = self.equations.derivative(0.0, y + (1j * STEP) * v)
        return found.real, found.imag / STEP

    def derivative(self, time: float, packed: Floats) -> Floats:
        """(y', v') for an integrator, as one vector."""
        return self.packed(*self.product(*self.parts(packed)))

    def packed(self, y: Floats, v: Floats) -> Floats:
        """Both in one vector, (2 size E,)."""
        return np.concatenate((y, v), axis=None)

    def parts(self, packed: Floats) -> Floats:
        """The y and v of one vector."""
        return packed.reshape(2, self.equations.layout.size, -1)

    def norm(self, v: Floats) -> Floats:
        """|v| in natural units, (E,)."""
        return np.asarray(np.linalg.norm(v / self.scale, axis=0))
