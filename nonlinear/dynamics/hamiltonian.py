"""Hamilton's equations in the plane, the comparison suggested at the end of paper 002, from T and V alone.

    p = ∂T/∂q'        q' = M⁻¹ p        p' = ∂T/∂q − ∂V/∂q + Q        H = T + V

T and V are recorded from `nonlinear.dynamics.energies` and differentiated backwards on the tape; M⁻¹ p is a pass of
`nonlinear.dynamics.recursion` without gravity or rates, with p in place of the forces; Q are the forces that act, of
dampers, drives, drag, loads, and of the inertia of all masses where the support moves.  No accelerations are needed
for any, so that a comparison with Lagrange's form tells something.  The p_x of a free cart is constant to the last
digit.  Vectors p are ordered like q, (x, links) or (η, links).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.energies import energies
from nonlinear.dynamics.forms import Form, TapedEquations
from nonlinear.dynamics.generated import Generated, Listed, Rate
from nonlinear.dynamics.minimal import Minimal, inverted
from nonlinear.dynamics.structure import Carriers, CarriersAt, displacement
from nonlinear.dynamics.tape import gradient
from nonlinear.dynamics.text import Module
from nonlinear.system import Motion, State, System, entries_of, prescribed_of


class Hamiltonian(Generated):
    """Hamilton's equations of a plane scene with y = (q, p, work), written out."""

    @cached_property
    def constants(self) -> list[float]:
        """What stands in the text for this scene."""
        numbers = entries_of(self.system), prescribed_of(self.system)
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
        """The same of many y side by side."""
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
    def listed(self) -> Listed | None:
        """The inputs u at a time (s) and a y, whose velocities a load sees; None where there are none."""
        given, half = super().listed, self.layout.half
        if given is None or self.load is None:
            return given
        velocities = self.function("velocities")
        return lambda time, y: given(time, [*y[:half], *velocities(y), *y[2 * half :]])

    def momenta(self, q: Any, v: Any) -> Any:
        """The momenta p = ∂T/∂q' (half, S) at coordinates q and rates v (half, S)."""
        return self._turned("momenta", q, v)

    def velocities(self, q: Any, p: Any) -> Any:
        """The rates q' = M⁻¹ p (half, S) that belong to momenta p (half, S)."""
        return self._turned("velocities", q, p)

    def hamiltonian(self, q: Any, p: Any) -> Any:
        """H = T + V (J), (S,), V from the scene's rest."""
        return self._turned("energy", q, self.velocities(q, p))[0]

    def _turned(self, name: str, q: Any, other: Any) -> Any:
        y = [*q, *other, *[0.0] * self.layout.works]
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
    stored = parts.stored
    if system.support:
        stored = stored + inertial_energy(system, q, v, equations.instant.support)
    acting = Minimal(without_springs(system), equations.bodies, minimal.load, counts_work=form.works)
    Q, power = acting.forces(y, equations.instant)
    thrown, kept = gradient(tape, parts.moving, q), gradient(tape, stored, q)
    slopes = [a - b + each for a, b, each in zip(thrown, kept, Q, strict=True)]
    solvers = list(zip(system.groups, equations.bodies, strict=True))
    return Module(
        tape,
        {
            "velocities": inverted(system, solvers, q, v).tolist(),
            "momenta": gradient(tape, parts.moving, v),
            "slopes": [*slopes, power] if form.works else slopes,
            "energy": [parts.total],
        },
    )


def without_springs(system: System) -> System:
    """The same system, none of whose springs pulls."""
    groups, structure = [], system.structure
    for group in system.groups:
        groups.append(replace(group, block=replace(group.block, stiffness=0.0 * group.block.stiffness)))
    if structure is not None:
        carriers = [
            replace(each, stiffness=(0.0,) * len(each.stiffness), K=None if each.K is None else 0.0 * each.K)
            for each in structure.carriers
        ]
        springs = [spring._replace(stiffness=0.0) for spring in structure.springs]
        structure = replace(structure, carriers=tuple(carriers), springs=tuple(springs))
    cart = system.cart and system.cart._replace(stiffness=0.0)
    return replace(system, groups=tuple(groups), cart=cart, structure=structure)


def inertial_energy(system: System, q: Any, v: Any, support: tuple[Any, Any]) -> Any:
    """Σ m a·r (J) of all masses at their places r, where a `support` accelerates with a: −∂/∂q are inertial forces."""
    (along, down), first, energy = support, system.first, 0.0
    bearing = None if system.structure is None else CarriersAt(Carriers(system), q, v, bare=True)
    for number, group in enumerate(system.groups):
        angles, b = q[first:][group.index], group.block.b
        energy = energy + (b * (along * np.sin(angles) + down * np.cos(angles))).sum()
        if bearing is not None:
            (x, z), _ = bearing.pivots(number)
            energy = energy + (group.block.mass.sum(0) * (along * x + down * z)).sum()
    if bearing is not None:
        for number, carrier in enumerate(bearing.structure.carriers):
            x, z = displacement(carrier, carrier.centre, bearing.structure.part(number, bearing.eta))
            energy = energy + carrier.mass * (along * x + down * z)
    return energy
