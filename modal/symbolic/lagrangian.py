"""T, V and L from Cartesian positions, and their consequences, without the pair.

A link with upper joint at P and direction u (e_z down) has its centre at P + c u and its lower joint at P + l u:

    T = ½ m_c x'² + Σ ½ m |d/dt (P + c u)|² + ½ I |u'|²,    V = −Σ m g (P + c u)·e_z + springs

In the plane u = (sin θ, 0, cos θ), in space u = (sin θ cos φ, sin θ sin φ, cos θ), singular at θ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from modal.errors import SceneError
from modal.scene.doors import require_type
from modal.symbolic.lagrange import Coordinate, coordinate, lagrange_equations, time_derivative
from modal.symbolic.system import SymbolicSystem

NOT_IN_SPACE = "joint springs and dampers in space: only the linearized equations are derived"


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """Energies of a system over its `coordinates`, and the dissipation function R."""

    system: SymbolicSystem
    coordinates: tuple[Coordinate, ...]
    T: Any
    V: Any
    R: Any

    @property
    def L(self) -> Any:
        """T − V."""
        return self.T - self.V

    @cached_property
    def equations(self) -> list[Any]:
        """Lagrange's equations: expressions that vanish in motion."""
        return lagrange_equations(self.L, self.coordinates, self.R)

    def linearized(self) -> tuple[Any, Any, Any]:
        """M, K and D: second derivatives of T, V and R at the system's equilibrium, plane systems only."""
        angles = {
            angle.q: 0 if sign > 0 else sp.pi for angle, sign in zip(self.system.angles, self.system.sigma, strict=True)
        }
        rest = {c.q: angles.get(c.q, 0) for c in self.coordinates}
        q, v = ([getattr(c, part) for c in self.coordinates] for part in "qv")
        M, K, D = (sp.hessian(f, by).subs(rest) for f, by in ((self.T, v), (self.V, q), (self.R, v)))
        return M, K, D


def derive_lagrangian(system: SymbolicSystem) -> Lagrangian:
    """The Lagrangian of a system in the plane, or in space in the angles θ and φ of every link.

    Raises SceneError for joint springs and dampers in space, which θ and φ do not describe.
    """
    require_type("system", system, "SymbolicSystem", "SymbolicStructure")
    return _in_space(system) if system.spatial else _in_plane(system)


def _in_plane(system: SymbolicSystem) -> Lagrangian:
    directions = [sp.Matrix([sp.sin(angle.q), 0, sp.cos(angle.q)]) for angle in system.angles]
    T, V = _energies(system, directions, system.coordinates)
    R = _on_cart(system, "damping", "v") + _at_joints(system, "damping", "v")
    return Lagrangian(system, tuple(system.coordinates), T, V + _at_joints(system, "stiffness", "q"), R)


def _in_space(system: SymbolicSystem) -> Lagrangian:
    if any(any(chain.stiffness) or any(chain.damping) for chain in system.chains):
        raise SceneError(["joint springs and dampers: not implemented in the angles θ and φ of a scene in space"])
    phi = azimuths(system)
    directions = [
        sp.Matrix([sp.sin(a.q) * sp.cos(f.q), sp.sin(a.q) * sp.sin(f.q), sp.cos(a.q)])
        for a, f in zip(system.angles, phi, strict=True)
    ]
    coordinates = (*system.coordinates, *phi)
    T, V = _energies(system, directions, coordinates)
    return Lagrangian(system, coordinates, T, V, _on_cart(system, "damping", "v"))


def azimuths(system: SymbolicSystem) -> list[Coordinate]:
    """φ of every link, numbered like θ."""
    return [coordinate("phi", *angle.q.name.split("_")[1:]) for angle in system.angles]


def _energies(system: SymbolicSystem, directions: list[Any], coordinates: Any) -> tuple[Any, Any]:
    T, V = _on_cart(system, "mass", "v"), _on_cart(system, "stiffness", "q")
    direction = iter(directions)
    for chain in system.chains:
        joint = sp.Matrix([system.coordinates[0].q if system.cart else 0, 0, 0])
        for m, l, c, I, *_ in zip(*chain, strict=True):
            u = next(direction)
            velocity, turning = (_rate(vector, coordinates) for vector in (joint + c * u, u))
            T += m * _square(velocity) / 2 + I * _square(turning) / 2
            V -= m * system.gravity * (joint + c * u)[2]
            joint += l * u
    return T, V


def _rate(vector: Any, coordinates: Any) -> Any:
    return vector.applyfunc(lambda part: time_derivative(part, coordinates))


def _square(vector: Any) -> Any:
    return sum(part**2 for part in vector)


def _on_cart(system: SymbolicSystem, name: str, part: str) -> Any:
    return getattr(system.cart, name) * getattr(system.coordinates[0], part) ** 2 / 2 if system.cart else sp.S.Zero


def _at_joints(system: SymbolicSystem, name: str, part: str) -> Any:
    """½ Σ s (θ_i − θ_{i−1} − their difference at equilibrium)², or of the rates."""
    energy, angle = sp.S.Zero, iter(system.angles)
    for chain in system.chains:
        above = sp.S.Zero
        for strength, sign in zip(getattr(chain, name), chain.sigma, strict=True):
            turned = getattr(next(angle), part) - (sp.pi if sign < 0 and part == "q" else 0)
            energy, above = energy + strength * (turned - above) ** 2 / 2, turned
    return energy


def vanishes(expression: Any) -> bool:
    """Whether a polynomial in sines, cosines and symbols is zero, by expansion and sin² = 1 − cos²."""
    spread = sp.expand(sp.expand_trig(expression))
    squares = {sp.sin(a.args[0]) ** 2: 1 - sp.cos(a.args[0]) ** 2 for a in spread.atoms(sp.sin)}
    return bool(sp.expand(spread.subs(squares)) == 0)


def gathered(V: Any) -> Any:
    """A potential energy with one term for each cosine, its coefficient factored."""
    expanded = sp.expand(V)
    return sp.collect(expanded, sorted(expanded.atoms(sp.cos), key=str), sp.factor)
