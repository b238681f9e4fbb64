"""Supports and chains in symbols; positions and velocities of points, from the drawing, not from `modal.structure`.

The origin as drawn is at (x₀, z₀), x along the rail and z down; a point (s, h) of a support lies at

    cart        (x₀ + x + s,  z₀ + h)
    swing       (x₀ + L sin(s_a/L) + s,  z₀ + L cos(s_a/L) − L + h)         s_a along the arc
    tilt        (x₀ + s cos φ + h sin φ,  z₀ + h cos φ − s sin φ)
    heave       (x₀ + s,  z₀ − y + h)                                       y up
    platform    (x₀ + x + s cos φ + h sin φ,  z₀ − y + h cos φ − s sin φ)
    modal       (x₀ + Σ P_k η_k,  z₀ + Σ Q_k η_k)                           by its array `points`

Speeds are written a second time, as they read best; a derivation checks that they are the rates of the places.

A coordinate q and its rates q', q'' are three plain symbols.  Time derivatives follow the chain rule, R is the
dissipation function:

    df/dt = Σ (∂f/∂q) q' + (∂f/∂q') q'',      Lagrange: d/dt ∂L/∂q' − ∂L/∂q + ∂R/∂q' = 0
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import sympy as sp
from sympy.simplify.fu import TR10i

from modal.extend import Support
from modal.scene.points import Where


class Coordinate(NamedTuple):
    """A coordinate q with its velocity v = q' and acceleration a = q'', as independent symbols."""

    q: Any
    v: Any
    a: Any


def coordinate(name: str, *index: int | str) -> Coordinate:
    r"""Symbols such as theta_1_2, thetadot_1_2 and thetaddot_1_2, which LaTeX shows with dots.

    >>> coordinate("theta", 1, 2).v, sp.latex(coordinate("phi", 3).a)
    (thetadot_1_2, '\\ddot{\\phi}_{3}')
    """
    tail = "".join(f"_{i}" for i in index)
    return Coordinate(*(sp.Symbol(f"{name}{dots}{tail}") for dots in ("", "dot", "ddot")))


def time_derivative(f: Any, coordinates: Iterable[Coordinate]) -> Any:
    """df/dt = Σ (∂f/∂q) q' + (∂f/∂q') q''."""
    return sp.Add(*(sp.diff(f, c.q) * c.v + sp.diff(f, c.v) * c.a for c in coordinates))


def lagrange_equations(L: Any, coordinates: Sequence[Coordinate], R: Any = 0) -> list[Any]:
    """d/dt ∂L/∂q' − ∂L/∂q + ∂R/∂q' of every coordinate: linear in the accelerations, zero in motion."""
    return [time_derivative(sp.diff(L, c.v), coordinates) - sp.diff(L, c.q) + sp.diff(R, c.v) for c in coordinates]


class Chain(NamedTuple):
    """A pendulum's parameters in SymPy numbers or symbols, top link first, and σ = ±1 for a link down or up."""

    mass: tuple[Any, ...]
    length: tuple[Any, ...]
    centre: tuple[Any, ...]
    inertia: tuple[Any, ...]
    rotor: tuple[Any, ...]
    damping: tuple[Any, ...]
    stiffness: tuple[Any, ...]
    sigma: tuple[int, ...]

    @property
    def geometry(self) -> tuple[tuple[Any, ...], ...]:
        """Mass, length, centre and inertia, from which the pair follows."""
        return self.mass, self.length, self.centre, self.inertia

    @property
    def is_of_bobs(self) -> bool:
        """Whether every mass is at the end of its link."""
        return self.centre == self.length and not any(self.inertia)


@dataclass(frozen=True, eq=False)
class SymbolicCarrier:
    """A support: its kind and name, the origin as drawn, and its numbers or symbols in SymPy.

    `index` is what follows the letters of its coordinates: its name, or nothing for one cart alone.
    `stiffness` and `damping` are matrices (d, d), diagonal but for a modal support, whose masses are `masses` (d, d)
    and whose `points` (P, 2, d) move with its coordinates.  `carries` says for each coordinate whether the own spring
    carries the weight as drawn.  Of a kind that others wrote the `path` says how it moves, by its `values`.
    """

    kind: str
    name: str
    index: tuple[str, ...]
    position: tuple[Any, Any]
    stiffness: Any
    damping: Any
    carries: tuple[bool, ...]
    mass: Any = sp.S.Zero
    inertia: Any = sp.S.Zero
    centre: tuple[Any, Any] = (sp.S.Zero, sp.S.Zero)
    masses: Any = None
    points: tuple[Any, ...] = ()
    path: Support | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Its coordinates, such as x_left, s_left, phi_board, or eta_frame_1 of a modal one."""
        if self.kind == "modal":
            return tuple(coordinate("eta", *self.index, k + 1) for k in range(self.masses.rows))
        motions = self.path.coordinates if self.path else ()
        return tuple(coordinate(motion.letter, *self.index) for motion in motions)

    @property
    def angle(self) -> Coordinate | None:
        """Its coordinate φ; None if it does not turn."""
        turning = self.path.turning if self.path else None
        return None if turning is None else self.coordinates[turning]

    def place(self, where: Where) -> tuple[Any, Any]:
        """(along, down) of a point in m."""
        x, z = self.position
        dx, dz = self._displacement()
        if isinstance(where, int):
            eta = [c.q for c in self.coordinates]
            x_parts, z_parts = ([a * q for a, q in zip(row, eta, strict=True)] for row in self.points[where])
            return x + sp.Add(*x_parts), z + sp.Add(*z_parts)
        s, h = where
        if self.angle is None:
            return x + dx + s, z + dz + h
        S, C = sp.sin(self.angle.q), sp.cos(self.angle.q)
        return x + dx + s * C + h * S, z + dz + h * C - s * S

    def _displacement(self) -> tuple[Any, Any]:
        """How far its origin is from where it is drawn."""
        if self.path is None:
            return ORIGIN
        along, down = map(_without_halves, self.path.place([c.q for c in self.coordinates], self.values))
        return along, down

    def speed_square(self, where: Where) -> Any:
        """|v|² of a point, in the rates of the coordinates."""
        vx, vz = self._velocity(where)
        if isinstance(where, int) or self.angle is None:
            return _sum_of_squares(vx, vz)
        s, h = where
        S, C, rate = sp.sin(self.angle.q), sp.cos(self.angle.q), self.angle.v
        cross_rate = vx * (h * C - s * S) - vz * (h * S + s * C)
        return _sum_of_squares(vx, vz) + (s**2 + h**2) * rate**2 + 2 * rate * cross_rate

    def speed_across(self, where: Where, theta: Any) -> Any:
        """The velocity of a point along (cos θ, −sin θ), by which the angle θ of a link below it grows."""
        vx, vz = self._velocity(where)
        across = TR10i(sp.expand(vx * sp.cos(theta) - vz * sp.sin(theta)))
        if isinstance(where, int) or self.angle is None:
            return across
        difference = theta - self.angle.q
        return across + self.angle.v * (where[1] * sp.cos(difference) + where[0] * sp.sin(difference))

    def _velocity(self, where: Where) -> tuple[Any, Any]:
        """(along, down) of its origin in m/s, of a modal support of a point."""
        place = self.place(where) if isinstance(where, int) else self._displacement()
        along, down = (time_derivative(part, self.coordinates) for part in place)
        return along, down

    @property
    def stored(self) -> Any:
        """The energy other than that of springs and weight."""
        return sp.sympify(self.path.potential([c.q for c in self.coordinates], self.values)) if self.path else sp.S.Zero

    @property
    def kinetic(self) -> Any:
        """½ M |v|² + ½ I φ'² of the centre of mass, or ½ η'ᵀ M η'."""
        v = sp.Matrix([c.v for c in self.coordinates])
        if self.masses is not None:
            return sp.expand((v.T * self.masses * v)[0]) / 2
        turning = self.angle.v if self.angle is not None else 0
        return sp.expand(self.mass * self.speed_square(self.centre) + self.inertia * turning**2) / 2

    def symbols(self) -> Iterator[Any]:
        """All numbers of it."""
        yield from (self.mass, self.inertia, *self.stiffness, *self.damping, *self.values.values())
        yield from self.masses or ()


def _without_halves(part: Any) -> Any:
    """A place with cosines of whole angles instead of squares of sines of half ones; exactly 0 where it is 0."""
    angle = sp.Wild("angle")
    replaced_part = sp.sympify(part).replace(sp.sin(angle) ** 2, (1 - sp.cos(2 * angle)) / 2)
    if replaced_part == part:
        return replaced_part or sp.S.Zero
    number, form = sp.factor(sp.expand(replaced_part)).as_coeff_Mul()
    return number * form


def _sum_of_squares(*parts: Any) -> Any:
    """The sum of their squares, with sin² = 1 − cos²."""
    total = sp.expand(sp.Add(*(part**2 for part in parts)))
    return sp.expand(total.subs({sine**2: 1 - sp.cos(sine.args[0]) ** 2 for sine in total.atoms(sp.sin)}))


ORIGIN = (sp.S.Zero, sp.S.Zero)
STILL = SymbolicCarrier("fixed", "fixed", (), ORIGIN, sp.zeros(0), sp.zeros(0), ())
"""A fixed support."""
