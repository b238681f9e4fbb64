"""The kinetic energy of a system as a readable formula, from the pair: in the plane, in unit vectors, in θ and φ.

    T = ½ M x'² + x' Σ b_i u_i'·e_x + ½ Σ_ij A_ij u_i'·u_j'

with u_i'·u_j' = cos(θ_i − θ_j) θ_i'θ_j' in the plane, and in space with Δ = φ_i − φ_j

    u_i'·u_j' = θ_i'θ_j'(cosθ_i cosθ_j cosΔ + sinθ_i sinθ_j) + φ_i'φ_j' sinθ_i sinθ_j cosΔ
                + (θ_i'φ_j' cosθ_i sinθ_j − φ_i'θ_j' sinθ_i cosθ_j) sinΔ.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from modal.symbolic.lagrange import Coordinate, coordinate
from modal.symbolic.lagrangian import azimuths
from modal.symbolic.system import SymbolicSystem


def in_plane(system: SymbolicSystem) -> Any:
    """T in the angles of a plane system."""
    angles = system.angles
    along = [sp.cos(chain.q) * chain.v for chain in angles]
    return _summed(system, along, lambda i, j: sp.cos(angles[j].q - angles[i].q) * angles[i].v * angles[j].v)


def in_vectors(system: SymbolicSystem) -> Any:
    """T in unit vectors; a product of two is their dot product."""
    u = [coordinate("u", *angle.q.name.split("_")[1:]).v for angle in system.angles]
    along = [chain * sp.Symbol("e_x") for chain in u]
    return _summed(system, along, lambda i, j: u[i] * u[j])


def in_angles(system: SymbolicSystem) -> Any:
    """T in the zenith angles θ and azimuths φ of a system in space."""
    pairs = list(zip(system.angles, azimuths(system), strict=True))
    along = [t.v * sp.cos(t.q) * sp.cos(f.q) - f.v * sp.sin(t.q) * sp.sin(f.q) for t, f in pairs]
    return _summed(system, along, lambda i, j: _product(*pairs[j], *pairs[i]))


def _summed(system: SymbolicSystem, along: list[Any], product: Callable[[int, int], Any]) -> Any:
    n, A = len(along), system.A
    T = sum((A[i, i] * product(i, i) / 2 for i in range(n)), start=sp.S.Zero)
    T += sum(A[i, j] * product(i, j) for i in range(n) for j in range(i))
    if system.cart:
        v = system.coordinates[0].v
        T += system.total_mass * v**2 / 2 + v * sum(b * rate for b, rate in zip(system.b, along, strict=True))
    return T


def _product(t1: Coordinate, f1: Coordinate, t2: Coordinate, f2: Coordinate) -> Any:
    if t1 == t2:
        return t1.v**2 + f1.v**2 * sp.sin(t1.q) ** 2
    (s1, c1), (s2, c2), gap = (sp.sin(t1.q), sp.cos(t1.q)), (sp.sin(t2.q), sp.cos(t2.q)), f1.q - f2.q
    zenith = t1.v * t2.v * (c1 * c2 * sp.cos(gap) + s1 * s2)
    return zenith + f1.v * f2.v * s1 * s2 * sp.cos(gap) + (t1.v * f2.v * c1 * s2 - f1.v * t2.v * s1 * c2) * sp.sin(gap)
