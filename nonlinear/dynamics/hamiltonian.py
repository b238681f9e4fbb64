"""Hamilton's equations, the comparison suggested at the end of paper 002; in the plane from T and V alone.

    p = ∂T/∂q'        q' = M⁻¹ p        p' = ∂T/∂q − ∂V/∂q + Q        H = T + V

T and V are recorded from `nonlinear.dynamics.mechanics` and differentiated backwards on the tape; M⁻¹ p is a pass of
`nonlinear.dynamics.recursion` without gravity or rates, with p in place of the forces; Q are the forces that act, of
dampers, drives, drag and loads; where the support moves V has the work against its acceleration too.  No q'' is needed
for any, so that a comparison with Lagrange's form is meaningful.  The p_x of a free cart is constant to the last
digit.  Vectors p are ordered like q, (x, links) or (η, links).

In space they are on unit vectors u and their momenta π, y = (x, u, p_x, π, work).  With the kinetic
energy T = ½ M x'² + x' e_x·Σ b_i u_i' + ½ Σ A_ij u_i'·u_j' of the pair, let

    P_i = ∂T/∂u_i' = Σ_j A_ij u_j' + b_i x' e_x        π_i = P_i − (u_i·P_i) u_i        p_x = ∂T/∂x'

P_i is the derivative as if every component of u_i' were free, and π_i its part tangent to the sphere |u_i| = 1, so
that u_i·π_i = 0.  As u_i·u_i' = 0, p_x x' + Σ π_i·u_i' = 2T, and H(x, u, p_x, π) = ½ (p_x x' + Σ π_i·u_i') + V with the
rates that solve

    u_i·u_i' = 0        (1 − u_i u_iᵀ)(Σ_j A_ij u_j' + b_i x' e_x) = π_i        M x' + e_x·Σ b_i u_i' = p_x.

They are ∂H/∂π and ∂H/∂p_x; a pass of `nonlinear.dynamics.spatial`, with (p_x, π) in place of the forces, gives them
without a matrix, and P is a derivative of T on the tape as before.  Lagrange's equations on the sphere are
P_i' = g b_i e_z + Q_i + λ_i u_i, with forces Q_i across the link and λ_i along it, so

    π_i' = P_i' − (u_i'·P_i + u_i·P_i') u_i − (u_i·P_i) u_i'
         = (1 − u_i u_iᵀ)(g b_i e_z + Q_i) − (u_i'·π_i) u_i − (u_i·P_i) u_i'        p_x' = −k_c x − c_c x' + F

without λ_i, since u_i'·P_i = u_i'·π_i; and u_i·π_i' + u_i'·π_i = 0 keeps π_i across u_i.  Without Q and F these are the
equations of H by Dirac's brackets for the constraints |u_i| = 1 and u_i·π_i = 0 [Dirac1964, ch. 1],

    {u_a, u_b} = 0        {u_a, π_b} = δ_ab − u_a u_b        {π_a, π_b} = π_a u_b − u_a π_b,

as tests confirm by differences of H.  In the plane of the rail π = p_θ n, and they are the equations
above.  Between steps `project` normalizes u and takes π across it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.bearing import Bearing, apply_inverse_mass
from nonlinear.dynamics.forms import Form, TapedEquations
from nonlinear.dynamics.generated import Generated, InputFunction, Rate
from nonlinear.dynamics.mechanics import energies
from nonlinear.dynamics.minimal import Suspended
from nonlinear.dynamics.spatial import dot
from nonlinear.dynamics.structure import carriers_of
from nonlinear.dynamics.tape import gradient
from nonlinear.dynamics.text import Module
from nonlinear.system import Motion, State, System


class Hamiltonian(Generated):
    """Hamilton's equations of a scene with y = (q, p, work), in space (x, u, p_x, π, work), written out."""

    @cached_property
    def constants(self) -> list[float]:
        """The numbers in the text for this scene."""
        return hamilton_of(self.form).constants(self.numbers)

    def function(self, name: str, target: str = "floats") -> Callable[..., Any]:
        """A function of `hamilton_of`."""
        return hamilton_of(self.form).function(name, self.constants, target)

    @cached_property
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""
        return self._rate("floats")

    @cached_property
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y at once, as columns."""
        return self._rate("arrays")

    def _rate(self, target: str) -> Callable[..., Any]:
        velocities, slopes = (self.function(name, target) for name in ("velocities", "slopes"))
        half = self.layout.half

        def rate(y: Any, u: Any = ()) -> list[Any]:
            v = velocities(y)
            return [*v, *slopes([*y[:half], *v, *y[2 * half :]], u)]

        return rate

    @cached_property
    def inputs_at(self) -> InputFunction | None:
        """The inputs u at a time (s) and a y, whose velocities a load sees; None if there are none."""
        inputs, half = super().inputs_at, self.layout.half
        if inputs is None or self.load is None:
            return inputs
        velocities = self.function("velocities")
        return lambda time, y: inputs(time, [*y[:half], *velocities(y), *y[2 * half :]])

    def momenta(self, q: Any, v: Any) -> Any:
        """The momenta p = ∂T/∂q' (half, S) at coordinates q and rates v (half, S)."""
        return self._evaluate("momenta", q, v)

    def velocities(self, q: Any, p: Any) -> Any:
        """The rates q' = M⁻¹ p (half, S) that belong to momenta p (half, S)."""
        return self._evaluate("velocities", q, p)

    def hamiltonian(self, q: Any, p: Any) -> Any:
        """H = T + V (J), (S,), V from the scene's rest."""
        return self._evaluate("energy", q, self.velocities(q, p))[0]

    def _evaluate(self, name: str, q: Any, rates: Any) -> Any:
        y = [*q, *rates, *[0.0] * self.layout.works]
        return np.array([value + 0 * q[0] for value in self.function(name, "arrays")(y)])

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        y, half = self.layout.begin(state), self.layout.half
        y[half : 2 * half] = self.momenta(y[:half, None], y[half : 2 * half, None])[:, 0]
        return y

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size), momenta converted to velocities."""
        half, states = self.layout.half, np.array(rows)
        states[:, half : 2 * half] = self.velocities(rows[:, :half].T, rows[:, half : 2 * half].T).T
        return self.layout.read(states)

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): for momenta the diagonal of M at rest, in space its largest entry of a link."""
        units, half, first = self.layout.natural(self.system), self.layout.half, self.layout.first
        inertia = np.diag(self.momenta(np.tile(self.system.coordinates_at_rest[:, None], half), np.eye(half))).copy()
        links = inertia[first:].reshape(-1, self.width)
        links[:] = links.max(axis=1, keepdims=True)
        units[half : 2 * half] *= inertia
        return units

    @property
    def tangent_units(self) -> Floats:
        """The natural size of the momenta of links (kg m²/s), (L,)."""
        return self.system.by_link("diagonal") * super().tangent_units


@lru_cache(maxsize=64)
def hamilton_of(form: Form) -> Module:
    """The functions "velocities" of (q, p) and, of (q, q'), "momenta", "energy", and "slopes", p' and the power."""
    equations = TapedEquations(form)
    tape, system, minimal = equations.tape, equations.system, equations.minimal
    half = minimal.layout.half
    y, q, v = equations.y, equations.y[:half], equations.y[half : 2 * half]
    parts = energies(system, q, v)
    potential = parts.potential_energy
    if system.support:
        potential = potential + inertial_energy(system, q, v, equations.instant.support)
    acting = type(minimal)(without_springs(system), equations.bodies, minimal.load, counts_work=form.works)
    Q, power = acting.forces(y, equations.instant)
    thrown, restoring = gradient(tape, parts.moving, q), gradient(tape, potential, q)
    momenta: Any = gradient(tape, parts.moving, v)
    slopes: Any = [a - b + force for a, b, force in zip(thrown, restoring, Q, strict=True)]
    if form.spatial:
        momenta, slopes = _across_links(minimal, q, v, momenta, slopes)
    solvers = list(zip(system.groups, equations.bodies, strict=True))
    functions = {"velocities": apply_inverse_mass(system, solvers, q, v, minimal.places).tolist()}
    functions |= {"momenta": momenta, "slopes": [*slopes, power] if form.works else slopes, "energy": [parts.total]}
    return Module(tape, functions)


def without_springs(system: System) -> System:
    """Return the same system with unstressed springs."""
    groups, structure = [], system.suspension
    for group in system.groups:
        laws = tuple(replace(term, pulls=False) for term in group.laws)
        groups.append(replace(group, block=replace(group.block, stiffness=0.0 * group.block.stiffness), laws=laws))
    carriers = []
    for carrier in structure.carriers:
        K = None if carrier.K is None else 0.0 * carrier.K
        carriers.append(replace(carrier, stiffness=(0.0,) * len(carrier.stiffness), K=K, stores=False))
    springs = [spring._replace(stiffness=0.0) for spring in structure.springs]
    suspension = replace(structure, carriers=tuple(carriers), springs=tuple(springs))
    return replace(system, groups=tuple(groups), suspension=suspension)


def inertial_energy(system: System, q: Any, v: Any, support: tuple[Any, Any]) -> Any:
    """Σ m a·r (J) of all masses at their places r, where a `support` accelerates with a: −∂/∂q are inertial forces."""
    (along, down), first, energy = support, system.first, 0.0
    bearing = Bearing(carriers_of(system), q, v, bare=True)
    for number, group in enumerate(system.groups):
        if system.spatial:
            across, _, lower = q[first:][3 * group.index + np.arange(3)[:, None, None]]
        else:
            across, lower = np.sin(q[first:][group.index]), np.cos(q[first:][group.index])
        energy = energy + (group.block.b * (along * across + down * lower)).sum()
        (x, z), _ = bearing.pivots(number)
        energy = energy + (group.block.mass.sum(0) * (along * x + down * z)).sum()
    for number, carrier in enumerate(bearing.structure.carriers):
        x, z = carrier.displacement(carrier.centre, bearing.structure.part(number, bearing.eta))
        energy = energy + carrier.mass * (along * x + down * z)
    return energy


def _across_links(minimal: Suspended, q: Any, v: Any, free: Sequence[Any], forces: Sequence[Any]) -> tuple[Any, Any]:
    """The momenta (p_x, π) and their slopes, from (p_x, P) and the forces as if components of u' were free."""
    first, momenta, slopes = minimal.layout.first, np.array(free, dtype=object), np.array(forces, dtype=object)
    for place in minimal.places:
        u, w, P, force = (part[first:][place] for part in (q, v, momenta, slopes))
        u = u / np.sqrt(dot(u, u))
        pi = _tangent(u, P)
        momenta[first:][place] = pi
        slopes[first:][place] = _tangent(u, force) - dot(w, pi) * u - dot(u, P) * w
    return momenta, slopes


def _tangent(u: Any, vector: Any) -> Any:
    """The part of a vector (3, ...) across the unit vector u."""
    return vector - dot(u, vector) * u
