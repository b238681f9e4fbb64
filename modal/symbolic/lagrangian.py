"""The Lagrangian and its equations in two ways: from the reduced inertia matrices A and b, and from all positions.

Pendula on one support, fixed or on a rail, in the plane:

    T = ½ M x'² + x' Σ b_i u_i'·e_x + ½ Σ_ij A_ij u_i'·u_j',    u_i'·u_j' = cos(θ_i − θ_j) θ_i'θ_j'
    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i cos θ_i x'' + g b_i sin θ_i + joints = 0
    M x'' + Σ b_i (cos θ_i θ_i'' − sin θ_i θ_i'²) + c_c x' + k_c x = 0

and in space, with the unit vectors u_i and with Δ = φ_i − φ_j, singular at θ = 0,

    u_i × [Σ_j A_ij u_j'' + b_i x'' e_x − g b_i e_z] = 0,    M x'' + e_x·Σ b_i u_i'' + c_c x' + k_c x = 0
    u_i'·u_j' = θ_i'θ_j'(cosθ_i cosθ_j cosΔ + sinθ_i sinθ_j) + φ_i'φ_j' sinθ_i sinθ_j cosΔ
                + (θ_i'φ_j' cosθ_i sinθ_j − φ_i'θ_j' sinθ_i cosθ_j) sinΔ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from modal.errors import SceneError
from modal.scene.doors import require_type
from modal.symbolic.carriers import Coordinate, coordinate, lagrange_equations, time_derivative
from modal.symbolic.structures import SymbolicStructure, indices

NOT_IN_SPACE = "joint springs and dampers in space: only the linearized equations are derived"


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """Energies over `coordinates`, and the dissipation function R."""

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


def derive_lagrangian(system: SymbolicStructure) -> Lagrangian:
    """The Lagrangian from the positions of all masses, in space in the angles θ and φ of every link.

    Raise SceneError for joint springs and dampers in space, which θ and φ do not describe.
    """
    require_type("system", system, "SymbolicStructure")
    if system.spatial and system.has_joint_forces:
        raise SceneError(["joint springs and dampers: not implemented in the angles θ and φ of a scene in space"])
    V, R = map(system.written_out, (system.potential, system.dissipation))
    return Lagrangian((*system.coordinates, *system.azimuths), system.cartesian(), V, R)


# ----------------------------------------------------------------------------------------------------- from the pair


def rail(system: SymbolicStructure) -> list[Coordinate]:
    """The coordinate of a cart; none of a fixed support."""
    return list(system.carriers[0].coordinates)


def in_plane(system: SymbolicStructure) -> Any:
    """T in the angles of a plane system."""
    angles = system.angles
    rail_rates = [sp.cos(chain.q) * chain.v for chain in angles]
    return _sum_energy(system, rail_rates, lambda i, j: sp.cos(angles[j].q - angles[i].q) * angles[i].v * angles[j].v)


def in_vectors(system: SymbolicStructure) -> Any:
    """T in unit vectors; a product of two is their dot product."""
    u = [coordinate("u", *indices(angle)).v for angle in system.angles]
    rail_rates = [chain * sp.Symbol("e_x") for chain in u]
    return _sum_energy(system, rail_rates, lambda i, j: u[i] * u[j])


def in_angles(system: SymbolicStructure) -> Any:
    """T in the zenith angles θ and azimuths φ of a system in space."""
    pairs = list(zip(system.angles, system.azimuths, strict=True))
    rail_rates = [t.v * sp.cos(t.q) * sp.cos(f.q) - f.v * sp.sin(t.q) * sp.sin(f.q) for t, f in pairs]
    return _sum_energy(system, rail_rates, lambda i, j: _product(*pairs[j], *pairs[i]))


def cart_forces(system: SymbolicStructure) -> list[Any]:
    """c_c x' + k_c x of a cart."""
    support = system.carriers[0]
    return [support.damping[0] * x.v + support.stiffness[0] * x.q for x in rail(system)]


def joint_moments(system: SymbolicStructure) -> list[Any]:
    """Minus the generalized forces (N m) of the springs and dampers of joints on each angle."""
    plain, chains = system.without_laws, range(len(system.chains))
    (V, R), (V_laws, R_laws) = (
        (sp.Add(*map(part.joint_energy, chains)), sp.Add(*map(part.joint_dissipation, chains)))
        for part in (plain, system)
    )
    V_laws, R_laws = V_laws - V, R_laws - R
    return [
        sp.expand(sp.diff(V, angle.q) + sp.diff(R, angle.v)) + sp.diff(V_laws, angle.q) + sp.diff(R_laws, angle.v)
        for angle in system.angles
    ]


def equations(system: SymbolicStructure) -> list[Any]:
    """Expressions that vanish in a plane motion, one for each coordinate."""
    angles, rotors = system.angles, system.rotor_energy
    joints = [
        moment + time_derivative(sp.expand(sp.diff(rotors, angle.v)), angles)
        for angle, moment in zip(angles, joint_moments(system), strict=True)
    ]
    forms = [
        sum(
            A * (sp.cos(theta.q - other_angle.q) * other_angle.a + sp.sin(theta.q - other_angle.q) * other_angle.v**2)
            for A, other_angle in zip(system.A.row(i), angles, strict=True)
        )
        + sum(b * sp.cos(theta.q) * x.a for x in rail(system))
        + system.gravity * b * sp.sin(theta.q)
        + joints[i]
        for i, (theta, b) in enumerate(zip(angles, system.b, strict=True))
    ]
    pulls = zip(system.b, angles, strict=True)
    inertial = sum(b * (sp.cos(theta.q) * theta.a - sp.sin(theta.q) * theta.v**2) for b, theta in pulls)
    cart_equations = [
        system.total_mass * x.a + inertial + force for x, force in zip(rail(system), cart_forces(system), strict=True)
    ]
    return [*cart_equations, *forms]


def vector_equations(system: SymbolicStructure) -> list[tuple[Any, Any]]:
    """(u_i, F_i) of a spatial motion, u_i × F_i = 0; on a cart (e_x, F) comes first, e_x·F = 0.

    Raise SceneError for joint springs and dampers, which are not implemented in unit vectors.
    """
    if system.has_joint_forces:
        raise SceneError(["joint springs and dampers in space: not implemented in unit vectors"])
    e_x, e_z = sp.symbols("e_x e_z")
    u = [coordinate("u", *indices(angle)) for angle in system.angles]
    inertial_force = sum(b * direction.a for b, direction in zip(system.b, u, strict=True))
    forms = [
        (e_x, e_x * (system.total_mass * x.a + force) + inertial_force)
        for x, force in zip(rail(system), cart_forces(system), strict=True)
    ]
    for i, (direction, b) in enumerate(zip(u, system.b, strict=True)):
        F = (
            sum(A * other_direction.a for A, other_direction in zip(system.A.row(i), u, strict=True))
            - system.gravity * b * e_z
        )
        forms.append((direction.q, F + sum(b * x.a * e_x for x in rail(system))))
    return forms


def _sum_energy(system: SymbolicStructure, rail_rates: list[Any], product: Callable[[int, int], Any]) -> Any:
    n, A = len(rail_rates), system.A
    T = sum((A[i, i] * product(i, i) / 2 for i in range(n)), start=sp.S.Zero)
    T += sum(A[i, j] * product(i, j) for i in range(n) for j in range(i)) + system.rotor_energy
    for x in rail(system):
        T += system.total_mass * x.v**2 / 2 + x.v * sum(b * rate for b, rate in zip(system.b, rail_rates, strict=True))
    return T


def _product(t1: Coordinate, f1: Coordinate, t2: Coordinate, f2: Coordinate) -> Any:
    if t1 == t2:
        return t1.v**2 + f1.v**2 * sp.sin(t1.q) ** 2
    (s1, c1), (s2, c2), gap = (sp.sin(t1.q), sp.cos(t1.q)), (sp.sin(t2.q), sp.cos(t2.q)), f1.q - f2.q
    zenith = t1.v * t2.v * (c1 * c2 * sp.cos(gap) + s1 * s2)
    return zenith + f1.v * f2.v * s1 * s2 * sp.cos(gap) + (t1.v * f2.v * c1 * s2 - f1.v * t2.v * s1 * c2) * sp.sin(gap)


# ------------------------------------------------------------------------------------------------------- readable


def vanishes(expression: Any) -> bool:
    """Whether a polynomial in sines, cosines and symbols is zero, by expansion and sin² = 1 − cos²."""
    spread = sp.expand(sp.expand_trig(expression))
    squares = {sp.sin(a.args[0]) ** 2: 1 - sp.cos(a.args[0]) ** 2 for a in spread.atoms(sp.sin)}
    return bool(sp.expand(spread.subs(squares)) == 0)


def gather_cosines(V: Any) -> Any:
    """A potential energy with one term for each cosine, its coefficient factored."""
    expansion = sp.expand(V)
    return sp.collect(expansion, sorted(expansion.atoms(sp.cos), key=str), sp.factor)
