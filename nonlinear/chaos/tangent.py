"""The growth of a small perturbation of a motion in the plane: tangent (variational) equations.

    y' = f(y),        v' = J(y) v

Both are written from one tape (`nonlinear.dynamics.forms`); here are the units in which v is measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.variational import Variational
from nonlinear.system import System


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent equations of a plane scene for E trajectories side by side: y and v are (size, E)."""

    system: System

    @cached_property
    def equations(self) -> Variational:
        """The equations of motion without the work, which affects nothing and would lengthen y."""
        return Variational(self.system)

    @cached_property
    def scale(self) -> Floats:
        """Natural units of y, (size, 1): 1 for angles, l for the cart, sqrt(g/l) and l sqrt(g/l) for their rates.

        l is the shortest link, the unit of all that moves in m.
        """
        length = float(self.system.by_link("length").min())
        half = np.ones(self.equations.layout.half)
        half[: self.equations.layout.first] = length
        if self.system.structure is not None:
            half[list(self.system.structure.turning)] = 1.0
        return np.concatenate((half, half * np.sqrt(self.system.gravity / length)))[:, None]

    def product(self, y: Floats, v: Floats) -> tuple[Floats, Floats]:
        """f(y) and J(y) v, each (size, E)."""
        rates = np.array(np.broadcast_arrays(*self.equations.tangent([*y, *v])))
        return rates[: len(y)], rates[len(y) :]

    def norm(self, v: Floats) -> Floats:
        """|v| in natural units, (E,)."""
        return np.asarray(np.linalg.norm(v / self.scale, axis=0))
