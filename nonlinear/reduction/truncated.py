"""Motion in the plane restricted to the span of a few shapes: the reduced equations of a truncated set of modes.

With q = (x, θ − rest) = Φ η the shapes Φ are a holonomic constraint, so the reduced motion is Lagrangian, with the T
and V of the scene at q = Φ η, and its energy balance is exact.  Link i turns by F_i η, n = (cos θ, −sin θ) lies
across it and u = (sin θ, cos θ) along it.  From the joint above it, by running sums from the cart down each chain,

    p_i = φ_x e_x + Σ_{k above i} l_k n_k F_k        velocity p_i η',
    a_i = −Σ_{k above i} l_k u_k θ_k'²               acceleration at η'' = 0,

and with the pair (A, b) the equations of R unknowns, at a cost of O(n R²) and without any n × n matrix, are

    ΦᵀMΦ = M φ_xᵀφ_x + Σ_i [A_ii F_iᵀF_i + b_i (F_iᵀ n_i·p_i + p_iᵀ·n_i F_i)]
    ΦᵀMΦ η'' = Φᵀ Q − Σ_i b_i [F_iᵀ (n_i·a_i + g sin θ_i) − θ_i'² p_iᵀ·u_i],

Q being the forces of springs, dampers and loads on q [Kane1985, §4.11].
On a structure x becomes its coordinates; with the accelerations a of the whole scene's equations at q = Φ η, q' = Φ η',

    ΦᵀMΦ η'' = (MΦ)ᵀ a.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import Generated, Minimal
from nonlinear.dynamics.variational import Variational
from nonlinear.system import Group, Layout, Load, Motion, State, System


@dataclass(frozen=True, eq=False)
class Turning:
    """One group of P chains of n links: `F` (R, P, n) of the links, and the constant part of ΦᵀMΦ."""

    group: Group
    F: Floats

    @cached_property
    def constant(self) -> Floats:
        """Σ A_ii F_iᵀ F_i, and of rotors Σ J (F_i − F_{i−1})ᵀ (F_i − F_{i−1}), (R, R)."""
        block, bends = self.group.block, np.diff(self.F, axis=-1, prepend=0.0)
        parts = ((self.F, block.diagonal), (bends, block.rotor))
        rows = ((part.reshape(len(part), -1), size.T.ravel()) for part, size in parts)
        return np.asarray(sum((row * size) @ row.T for row, size in rows))

    @cached_property
    def b(self) -> Floats:
        """First moments (kg m), (P, n)."""
        return np.ascontiguousarray(self.group.block.b.T)

    @cached_property
    def length(self) -> Floats:
        """Lengths (m), (P, n)."""
        return np.ascontiguousarray(self.group.block.length.T)

    def equations(self, cart: Floats, angles: Floats, rates: Floats, gravity: float) -> tuple[Floats, Floats]:
        """The group's contribution to ΦᵀMΦ (R, R), without its mass on the cart, and to the force on η (R,).

        `cart` (R,) is φ_x; angles and rates are (P, n).
        """
        sin, cos = np.sin(angles), np.cos(angles)
        n, u = np.stack((cos, -sin)), np.stack((sin, cos))
        normals = n * self.F[:, None]
        p = sums_above(self.length * normals)
        p[:, 0] += cart[:, None, None]
        cross = _rows(self.b * normals) @ _rows(p).T
        thrown = self.b * rates**2 * u
        a = sums_above(-self.length * u * rates**2)
        moments = self.b * ((n * a).sum(0) + gravity * sin)
        return self.constant + cross + cross.T, _rows(p) @ thrown.ravel() - _rows(self.F) @ moments.ravel()


def sums_above(values: Floats) -> Floats:
    """The sum over all links above each one, along the last axis."""
    sums = np.empty_like(values)
    sums[..., 0] = 0.0
    np.cumsum(values[..., :-1], axis=-1, out=sums[..., 1:])
    return sums


def _rows(values: Floats) -> Floats:
    return values.reshape(len(values), -1)


@dataclass(frozen=True, eq=False)
class Truncated:
    """The reduced equations of a plane scene, y = (η, η', work).

    `rest` (L,) are the angles at η = 0, `shapes` (half, R) the columns of Φ over (x or a structure, then links), and
    `dual` (half, R) with dualᵀΦ = 1 maps a start to its η.
    """

    system: System
    rest: Floats
    shapes: Floats
    dual: Floats
    load: Load | None = None

    @property
    def size(self) -> int:
        """The number R of shapes."""
        return int(self.shapes.shape[1])

    @cached_property
    def links(self) -> Floats:
        """The links' part of the shapes, (L, R)."""
        return self.shapes[-self.system.n_links :]

    @cached_property
    def cart(self) -> Floats:
        """The cart's part of the shapes, (R,), 0 on a fixed support."""
        return self.shapes[0] if self.system.cart else np.zeros(self.size)

    @cached_property
    def layout(self) -> Layout:
        """The arrangement of the y of the whole scene."""
        return Layout.of(self.system, works=self.works)

    @cached_property
    def works(self) -> bool:
        """Whether the work is the last component of y."""
        return self.system.works or self.load is not None

    @cached_property
    def turnings(self) -> tuple[Turning, ...]:
        """The groups with their shapes."""
        rows = self.links.T
        return tuple(Turning(group, np.ascontiguousarray(rows[:, group.index.T])) for group in self.system.groups)

    @cached_property
    def _constant(self) -> Floats:
        return self.system.total_mass * np.outer(self.cart, self.cart)

    @cached_property
    def acting(self) -> Minimal:
        """The loads on the whole scene."""
        return Minimal(self.system, (None,) * len(self.system.groups), self.load)

    @cached_property
    def full_equations(self) -> tuple[Generated, Variational]:
        """The equations of the whole scene on a structure."""
        return Generated(self.system, self.load), Variational(self.system)

    def _on_structure(self, time: float, y: Floats) -> Floats:
        R, (equations, momenta) = self.size, self.full_equations
        half, rates = equations.layout.half, equations.derivative(time, equations.begin(self.state(y)))
        q = self.rest + y[:R] @ self.shapes.T
        p = momenta.momenta(np.broadcast_to(q[:, None], (half, R)), self.shapes)
        accelerations = np.linalg.solve(self.shapes.T @ p, p.T @ rates[half : 2 * half])
        return np.concatenate((y[R : 2 * R], accelerations, rates[2 * half :]))

    def derivative(self, time: float, y: Floats) -> Floats:
        """The derivative y', (size,)."""
        if self.system.structure is not None:
            return self._on_structure(time, y)
        state, R = self.state(y), self.size
        M, z, first = self._constant.copy(), self.acting.layout.begin(state), self.system.first
        Q, power = self.acting.forces(z, self.acting.inputs.at(time, z, self.acting.layout))
        force = Q[first:] @ self.links + (Q[0] * self.cart if first else 0.0)
        for turning in self.turnings:
            place = turning.group.index.T
            mass, pull = turning.equations(self.cart, state.links[place], state.link_rates[place], self.system.gravity)
            M, force = M + mass, force + pull
        try:
            accelerations = np.linalg.solve(M, force)
        except np.linalg.LinAlgError:
            raise ComputationError("the reduced mass matrix is singular: keep fewer modes") from None
        return np.concatenate((y[R : 2 * R], accelerations, [power] * self.works))

    def state(self, y: Floats) -> State:
        """The state of one vector y."""
        return self.read(y[None])[0]

    def begin(self, state: State) -> Floats:
        """The vector y of the closest state in the mass metric, with zero work."""
        y, half = self.layout.begin(state), self.layout.half
        return np.concatenate(((y[:half] - self.rest) @ self.dual, y[half : 2 * half] @ self.dual, y[2 * half :]))

    def read(self, rows: Floats) -> Motion:
        """The motion of every link in vectors (T, size)."""
        R = self.size
        q, v = self.rest + rows[:, :R] @ self.shapes.T, rows[:, R : 2 * R] @ self.shapes.T
        return self.layout.read(np.hstack((q, v, rows[:, 2 * R :])))

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): those that move some coordinate by its natural unit."""
        units, size = self.layout.natural(self.system), self.layout.half
        half = 1 / (np.abs(self.shapes) / units[:size, None]).max(axis=0)
        return np.concatenate((half, half * self.system.rate, units[2 * size :]))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The shapes are the coordinates: there are no constraints."""
        return y, 0.0
