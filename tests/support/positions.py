"""The Lagrangian of pendula on one support in the plane, from the positions of all masses alone, as an oracle.

A link with upper joint at P and direction u = (sin θ, cos θ) has its centre at P + c u and its lower joint at P + l u:

    T = ½ m_c x'² + Σ ½ m |d/dt (P + c u)|² + ½ I θ'²,    V = −Σ m g (P + c u)·e_z + springs
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.symbolic import SymbolicStructure, lagrange_equations, time_derivative


class Positions:
    """T, V and R over the coordinates of a system, with nothing of it but its numbers."""

    def __init__(self, system: SymbolicStructure) -> None:
        (support,) = system.carriers
        self.coordinates, self.angles, self.sigma = system.coordinates, system.angles, system.sigma
        first = self.coordinates[: len(self.coordinates) - len(self.angles)]
        self.T, self.V, self.R = (
            sp.Add(*(number * getattr(x, part) ** 2 / 2 for x in first))
            for number, part in ((support.mass, "v"), *zip(_numbers(support), "qv", strict=True))
        )
        angle = iter(self.angles)
        for chain in system.chains:
            x, z = sp.Add(*(c.q for c in first)), sp.S.Zero
            above, turning = sp.S.Zero, sp.S.Zero
            for m, l, c, I, rotor, damping, stiffness, sign in zip(*chain, strict=True):
                theta = next(angle)
                centre = (x + c * sp.sin(theta.q), z + c * sp.cos(theta.q))
                rates = (time_derivative(part, self.coordinates) for part in centre)
                self.T += m * sp.Add(*(rate**2 for rate in rates)) / 2 + I * theta.v**2 / 2
                self.T += rotor * (theta.v - turning) ** 2 / 2
                straight = theta.q - (sp.pi if sign < 0 else 0)
                self.V += stiffness * (straight - above) ** 2 / 2 - m * system.gravity * centre[1]
                self.R += damping * (theta.v - turning) ** 2 / 2
                above, turning = straight, theta.v
                x, z = x + l * sp.sin(theta.q), z + l * sp.cos(theta.q)

    @property
    def equations(self) -> list[Any]:
        """Lagrange's, which vanish in motion."""
        return lagrange_equations(self.T - self.V, self.coordinates, self.R)

    def linearized(self) -> tuple[Any, Any, Any]:
        """M, K and D: second derivatives of T, V and R at rest."""
        upright = {angle.q for angle, sign in zip(self.angles, self.sigma, strict=True) if sign < 0}
        rest = {c.q: sp.pi if c.q in upright else 0 for c in self.coordinates}
        q, v = ([getattr(c, part) for c in self.coordinates] for part in "qv")
        M, K, D = (sp.hessian(f, by).subs(rest) for f, by in ((self.T, v), (self.V, q), (self.R, v)))
        return M, K, D


def _numbers(support: Any) -> tuple[Any, Any]:
    """The spring and the damper of a cart, 0 of a fixed support."""
    stiffness, damping = (sp.Add(*matrix) for matrix in (support.stiffness, support.damping))
    return stiffness, damping
