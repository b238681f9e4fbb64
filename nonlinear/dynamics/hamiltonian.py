"""Hamilton's equations, the comparison suggested at the end of paper 002; in the plane from T and V alone.

    p = ∂T/∂q'        q' = M⁻¹ p        p' = ∂T/∂q − ∂V/∂q + Q        H = T + V

T and V are recorded from `nonlinear.dynamics.mechanics` and differentiated backwards on the tape; M⁻¹ p is a pass of
`nonlinear.dynamics.recursion` without gravity or rates, with p in place of the forces; Q are the forces that act, of
dampers, drives, drag and loads; where the support moves V has the work against its acceleration too.  No q'' is needed
for any, so that a comparison with Lagrange's form is meaningful.  The p_x of a free cart is constant to the last
digit.  Vectors p are ordered like q, (x, links) or (η, links).

In space they are on unit vectors u and their momenta π, y = (x, u, p_x, π, work), by O(links) passes.  With the kinetic
energy T = ½ M x'² + x' e_x·Σ b_i u_i' + ½ Σ A_ij u_i'·u_j' of the pair, let

    P_i = ∂T/∂u_i' = Σ_j A_ij u_j' + b_i x' e_x        π_i = P_i − (u_i·P_i) u_i        p_x = ∂T/∂x'

P_i is the derivative as if every component of u_i' were free, and π_i its part tangent to the sphere |u_i| = 1, so
that u_i·π_i = 0.  As u_i·u_i' = 0, p_x x' + Σ π_i·u_i' = 2T, and H(x, u, p_x, π) = ½ (p_x x' + Σ π_i·u_i') + V with the
rates that solve

    u_i·u_i' = 0        (1 − u_i u_iᵀ)(Σ_j A_ij u_j' + b_i x' e_x) = π_i        M x' + e_x·Σ b_i u_i' = p_x.

They are ∂H/∂π and ∂H/∂p_x; a pass of `nonlinear.dynamics.spatial` without gravity and rates, with (p_x, π) in place of
the forces, gives them without a matrix.  Lagrange's equations on the sphere are P_i' = g b_i e_z + Q_i + λ_i u_i, with
forces Q_i across the link and λ_i along it, so

    π_i' = P_i' − (u_i'·P_i + u_i·P_i') u_i − (u_i·P_i) u_i'
         = (1 − u_i u_iᵀ)(g b_i e_z + Q_i) − (u_i'·π_i) u_i − (u_i·P_i) u_i'        p_x' = −k_c x − c_c x' + F

without λ_i, since u_i'·P_i = u_i'·π_i; and u_i·π_i' + u_i'·π_i = 0 keeps π_i across u_i.  Without Q and F these are the
equations of H by Dirac's brackets for the constraints |u_i| = 1 and u_i·π_i = 0 [Dirac1964, ch. 1],

    {u_a, u_b} = 0        {u_a, π_b} = δ_ab − u_a u_b        {π_a, π_b} = π_a u_b − u_a π_b,

as tests confirm by differences of H.  In the plane of the rail π = p_θ n, and they are the equations
above.  One pass gives P: with v the velocity of a link's centre and S the sum of m v of all
below it, P = I u' + m c v + l S.  Between steps `project` normalizes u and takes π across it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.bearing import Bearing, apply_inverse_mass
from nonlinear.dynamics.forces import cart_force
from nonlinear.dynamics.forms import Form, TapedEquations
from nonlinear.dynamics.generated import Generated, InputFunction, Rate
from nonlinear.dynamics.mechanics import energies
from nonlinear.dynamics.minimal import Arranged, Minimal
from nonlinear.dynamics.spatial import Spatial, SpatialRecursion, dot
from nonlinear.dynamics.structure import carriers_of
from nonlinear.dynamics.tape import gradient
from nonlinear.dynamics.text import Module
from nonlinear.system import Group, Load, Motion, State, System, constants_of, entries_of


class Hamiltonian(Generated):
    """Hamilton's equations of a plane scene with y = (q, p, work), written out."""

    @cached_property
    def constants(self) -> list[float]:
        """The numbers in the text for this scene."""
        numbers = entries_of(self.system), constants_of(self.system)
        return hamilton_of(self.form).constants(self.form.numbers(*numbers))

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
        velocities, slopes, half = (
            self.function("velocities", target),
            self.function("slopes", target),
            self.layout.half,
        )

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
        """Natural units of y, (size,): for momenta the diagonal of M at rest times that of rates."""
        units, half = self.layout.natural(self.system), self.layout.half
        rest = np.concatenate((np.zeros(self.layout.first), self.system.rest))
        units[half : 2 * half] *= np.diag(self.momenta(np.tile(rest[:, None], half), np.eye(half)))
        return units


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
    acting = Minimal(without_springs(system), equations.bodies, minimal.load, counts_work=form.works)
    Q, power = acting.forces(y, equations.instant)
    thrown, restoring = gradient(tape, parts.moving, q), gradient(tape, potential, q)
    slopes = [a - b + force for a, b, force in zip(thrown, restoring, Q, strict=True)]
    solvers = list(zip(system.groups, equations.bodies, strict=True))
    return Module(
        tape,
        {
            "velocities": apply_inverse_mass(system, solvers, q, v).tolist(),
            "momenta": gradient(tape, parts.moving, v),
            "slopes": [*slopes, power] if form.works else slopes,
            "energy": [parts.total],
        },
    )


def without_springs(system: System) -> System:
    """Return the same system with unstressed springs."""
    groups, structure = [], system.suspension
    for group in system.groups:
        laws = tuple(replace(term, pulls=False) for term in group.laws)
        groups.append(replace(group, block=replace(group.block, stiffness=0.0 * group.block.stiffness), laws=laws))
    carriers = [
        replace(
            carrier,
            stiffness=(0.0,) * len(carrier.stiffness),
            K=None if carrier.K is None else 0.0 * carrier.K,
            stores=False,
        )
        for carrier in structure.carriers
    ]
    springs = [spring._replace(stiffness=0.0) for spring in structure.springs]
    suspension = replace(structure, carriers=tuple(carriers), springs=tuple(springs))
    return replace(system, groups=tuple(groups), suspension=suspension)


def inertial_energy(system: System, q: Any, v: Any, support: tuple[Any, Any]) -> Any:
    """Σ m a·r (J) of all masses at their places r, where a `support` accelerates with a: −∂/∂q are inertial forces."""
    (along, down), first, energy = support, system.first, 0.0
    bearing = Bearing(carriers_of(system), q, v, bare=True)
    for number, group in enumerate(system.groups):
        angles, b = q[first:][group.index], group.block.b
        energy = energy + (b * (along * np.sin(angles) + down * np.cos(angles))).sum()
        (x, z), _ = bearing.pivots(number)
        energy = energy + (group.block.mass.sum(0) * (along * x + down * z)).sum()
    for number, carrier in enumerate(bearing.structure.carriers):
        x, z = carrier.displacement(carrier.centre, bearing.structure.part(number, bearing.eta))
        energy = energy + carrier.mass * (along * x + down * z)
    return energy


class FreeMomentum(NamedTuple):
    """P = ∂T/∂u' (kg m²/s) of every link, (3, n, P, ...), and the momentum along the rail (kg m/s), (P, ...)."""

    links: Any
    rail: Any


def free_momentum(group: Group, rates: Any, cart_rate: Any) -> FreeMomentum:
    """The momenta of a group at the rates u' (3, n, P, ...): velocities from the top down, momenta from the tip up."""
    block = group.block
    mass, length, centre, inertia = (
        constant.reshape(*constant.shape, *[1] * (rates.ndim - 3))
        for constant in (block.mass, block.length, block.centre, block.inertia)
    )
    ends = np.cumsum(length * rates, axis=1)
    ends[0] += cart_rate
    momentum = mass * (ends - (length - centre) * rates)
    through = np.cumsum(momentum[:, ::-1], axis=1)[:, ::-1]
    return FreeMomentum(inertia * rates + centre * momentum + length * (through - momentum), through[0, 0])


def tangent(u: Any, vector: Any) -> Any:
    """The part of a vector (3, ...) across the unit vector u."""
    return vector - dot(u, vector) * u


def upon_sphere(vector: Any) -> Any:
    """A vector (3, ...) of length 1."""
    return vector / np.sqrt(dot(vector, vector))


@dataclass(frozen=True, eq=False)
class SpatialHamiltonian(Arranged):
    """Hamilton's equations of a scene in space with y = (x, u, p_x, π, work)."""

    system: System
    load: Load | None = None
    counts_work: bool = True

    @cached_property
    def lagrangian(self) -> Spatial:
        """Lagrange's equations, whose forces these share."""
        return Spatial(self.system, (), self.load, self.counts_work)

    def momenta(self, q: Any, v: Any) -> Any:
        """The momenta (p_x, π), (half, ...), from coordinates (x, u) and their rates."""
        first, system = self.system.first, self.system
        p, rail = np.zeros_like(v), 0.0
        for place, group in self._groups:
            P = free_momentum(group, v[first:][place], v[0] if first else 0.0)
            p[first:][place] = tangent(upon_sphere(q[first:][place]), P.links)
            rail = rail + P.rail.sum(0)
        if system.cart:
            p[0] = rail + system.cart.mass * v[0]
        return p

    def velocities(self, q: Any, p: Any) -> Any:
        """The rates (x', u'), (half, ...), that belong to the momenta (p_x, π)."""
        solvers = [(group, SpatialRecursion(group, p.ndim - 1)) for group in self.system.groups]
        return apply_inverse_mass(self.system, solvers, q, p, self.lagrangian.places)

    def hamiltonian(self, q: Any, p: Any) -> Any:
        """H = ½ (p_x x' + Σ π·u') + V (J), V from the scene's rest."""
        v = self.velocities(q, p)
        return (p * v).sum(0) / 2 + energies(self.system, q, v).potential_energy

    def derivative(self, time: Any, y: Any) -> Any:
        """The derivative y' (size, ...): (x', u'), then (p_x', π'), then the power."""
        layout, system, lagrangian = self.layout, self.system, self.lagrangian
        first, half = layout.first, layout.half
        rates = np.empty_like(y)
        rates[:half] = v = self.velocities(y[:half], y[half : 2 * half])
        instant = self.inputs.at(time, np.concatenate((y[:half], v, y[2 * half :])), layout)
        frame = instant.support if system.support else None
        moments = None if instant.push.moments is None else np.ravel(instant.push.moments)
        cart_rate, rail_force, power = (v[0] if first else 0.0), 0.0, 0.0
        for place, group in self._groups:
            u, w = upon_sphere(y[first:half][place]), v[first:][place]
            force, work, _ = lagrangian.acting(group, u, w, None if moments is None else moments[place], frame)
            power = power + work
            external = lagrangian.external(group, u, w, (cart_rate, 0.0), instant)
            if external is not None:
                force, power = force + external.generalized_forces, power + external.power
                rail_force = rail_force + external.along_rail
            force = force + self._weight(group, u, instant.support)
            pi, P = tangent(u, y[half + first : 2 * half][place]), free_momentum(group, w, cart_rate).links
            rates[half + first : 2 * half][place] = tangent(u, force) - dot(w, pi) * u - dot(u, P) * w
        if first:
            elastic, working = cart_force(system, y[0], v[0])
            rates[half] = instant.push.cart + working + elastic + rail_force
            power = power + v[0] * (instant.push.cart + working)
        if layout.works:
            rates[-1] = power
        return rates

    def _weight(self, group: Group, u: Any, frame: Sequence[Any]) -> Any:
        """First moments times g − a, (3, n, P, ...), of a support with the acceleration a along the rail and down."""
        along, down = frame
        b = group.block.b.reshape(*group.block.b.shape, *[1] * (u.ndim - 3)) + 0 * u[0]
        return np.stack((-along * b, 0 * b, (self.system.gravity - down) * b))

    @property
    def _groups(self) -> list[tuple[Any, Group]]:
        return list(zip(self.lagrangian.places, self.system.groups, strict=True))

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        y, half = self.layout.begin(state), self.layout.half
        y[half : 2 * half] = self.momenta(y[:half], y[half : 2 * half])
        return y

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size), momenta converted to velocities."""
        half, states = self.layout.half, np.array(rows)
        states[:, half : 2 * half] = self.velocities(rows[:, :half].T, rows[:, half : 2 * half].T).T
        return self.layout.read(states)

    @cached_property
    def inertia(self) -> Floats:
        """The diagonal of A (kg m²), (L,)."""
        inertia = np.empty(self.system.n_links)
        for group in self.system.groups:
            inertia[group.index] = group.block.diagonal
        return inertia

    @property
    def tangent_units(self) -> Floats:
        """The natural size of the momenta of links (kg m²/s), (L,)."""
        return self.inertia * super().tangent_units

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): for momenta the largest entry of each diagonal of M times that of rates."""
        system, layout = self.system, self.layout
        units = layout.natural(system)
        mass = [system.cart.mass + float(system.mass.sum())] if system.cart else []
        units[layout.half : 2 * layout.half] *= np.concatenate((mass, np.repeat(self.inertia, 3)))
        return units
