"""Kinematics of points of a support with the coordinates η: positions, Jacobians and bias, exact at any angle.

A support has the pose (x, z, φ)(η) of its origin, x along the rail, z down, φ as angles of links; a point (s, h) of it

    r = (x, z) + (s cos φ + h sin φ, h cos φ − s sin φ),    r'' = J η'' + J' η'

Its kind defines the motion of the origin (`modal.extend.Support`); points of a modal support move by its array
`points`.

Every line is plain arithmetic: it accepts floats, arrays of any one shape, complex numbers, recorded symbols and
SymPy's expressions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.extend import Support, cos, sin
from modal.extend.scalars import plus
from modal.scene import ModalSupport
from modal.scene.carriers import CartMotion, HeaveMotion, PlatformMotion, SwingMotion, TiltMotion
from modal.scene.supports import law_values
from modal.types import Floats

PLATFORM = tuple(coordinate.way for coordinate in PlatformMotion.coordinates)
COMPILED = (CartMotion, SwingMotion, TiltMotion, HeaveMotion, PlatformMotion)
Slope = tuple[Any, Any]


class Moving(NamedTuple):
    """A moving point: its position (x, z) in m, ∂(x, z)/∂η of every coordinate, and J' η' (m/s²)."""

    place: tuple[Any, Any]
    slopes: tuple[tuple[Any, Any], ...]
    bias: tuple[Any, Any]

    def velocity(self, rates: Sequence[Any]) -> tuple[Any, Any]:
        """J η' (m/s)."""
        x: Any = 0.0
        z: Any = 0.0
        for (dx, dz), rate in zip(self.slopes, rates, strict=True):
            x, z = plus(x, dx, rate), plus(z, dz, rate)
        return x, z


def inner(slope: tuple[Any, Any], x: Any, z: Any) -> Any:
    """Return the product of a slope with the vector (x, z)."""
    return plus(plus(0.0, slope[0], x), slope[1], z)


def turn_point(s: Any, h: Any, S: Any, C: Any, rate: Any) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
    """Return position, slope and bias of a point (s, h) of a rotated body, from the sine and cosine of its angle."""
    ww = rate * rate
    arm = s * C + h * S, h * C - s * S
    return arm, (h * C - s * S, -h * S - s * C), (-(arm[0] * ww), -(arm[1] * ww))


@dataclass(frozen=True, eq=False)
class CarrierNumbers:
    """A support as numbers: `position` and `centre` (m), mass (kg), inertia about its centre (kg m²).

    `path` defines the motion of its origin, None if it has none; `parameters` are the numbers of its kind, `stiffness`
    and `damping` have an entry for each coordinate; it `stores` the energy of its path. A modal support has the arrays
    M, K, D (d, d) and `points` (P, 2, d) instead.
    """

    kind: str
    name: str
    position: tuple[Any, Any]
    mass: Any = 0.0
    inertia: Any = 0.0
    centre: tuple[Any, Any] = (0.0, 0.0)
    stiffness: tuple[Any, ...] = ()
    damping: tuple[Any, ...] = ()
    path: Support | None = None
    parameters: tuple[Any, ...] = ()
    stores: bool = True
    M: Floats | None = None
    K: Floats | None = None
    D: Floats | None = None
    points: Floats | None = None

    @property
    def matrices(self) -> tuple[Floats, Floats, Floats] | None:
        """M, K and D of a modal support."""
        return None if self.M is None or self.K is None or self.D is None else (self.M, self.K, self.D)

    @cached_property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.stiffness) if self.M is None else len(self.M)

    @cached_property
    def turning(self) -> int | None:
        """Which of its coordinates is its rotation angle; None if it does not turn."""
        return self.path.turning if self.path else None

    @cached_property
    def bends(self) -> bool:
        """Whether its points move on curved paths."""
        return self.path is not None and (self.path.bends or self.turning is not None)

    @property
    def is_compiled(self) -> bool:
        """Whether compiled loops support its motion; others need code generated for their scene."""
        return self.M is None and (self.path is None or type(self.path) in COMPILED)

    @cached_property
    def sliding(self) -> int | None:
        """Which of its coordinates is a pure displacement along the rail; None if there is none."""
        if self.path is None or self.path.bends:
            return None
        return self._straight.index((1.0, 0.0)) if (1.0, 0.0) in self._straight else None

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The suffixes of its name in the names of its coordinates."""
        if self.M is not None:
            return tuple(str(k) for k in range(1, self.size + 1))
        return tuple(coordinate.suffix for coordinate in self.path.coordinates) if self.path else ()

    def way(self, k: int) -> str:
        """Return the direction of one of several coordinates: sway, heave or roll of a platform."""
        return self.path.coordinates[k].way if self.path else ""

    def verb(self, k: int) -> str:
        """Return the verb for a motion of coordinate k."""
        return self.path.coordinates[k].verb if self.path else "moves"

    @cached_property
    def values(self) -> Mapping[str, Any]:
        """The numbers of its kind by name."""
        names = [parameter.name for parameter in self.path.parameters] if self.path else []
        return dict(zip(names, self.parameters, strict=True))

    def displacement(self, where: tuple[Any, Any] | int, eta: Sequence[Any]) -> tuple[Any, Any]:
        """Return the displacement (m) of its point (s, h), or of a numbered one, from the drawn position."""
        if self.points is not None:
            slopes = self.points[where].T.tolist()
            return tuple(sum((s[k] * value for s, value in zip(slopes, eta, strict=True)), 0.0) for k in (0, 1))  # type: ignore[return-value]
        x, z = self.path.place(eta, self.values) if self.path else (0.0, 0.0)
        if self.turning is None:
            return x, z
        assert not isinstance(where, int)
        phi = eta[self.turning]
        half = sin(phi / 2)
        right, down = turn_displacement(*where, sin(phi), 2 * (half * half))
        return x + right, z + down

    def moving(self, where: tuple[Any, Any] | int, eta: Sequence[Any], rates: Sequence[Any]) -> Moving:
        """Return the kinematics of its point (s, h), or of the numbered point of a modal support."""
        if self.points is not None:
            return _combine_slopes(self.position, self.points[where], eta)
        assert not isinstance(where, int)
        s, h = where
        x, z = self.position[0] + s, self.position[1] + h
        if self.path is None:
            return Moving((x, z), (), (0.0, 0.0))
        pose, slopes, bias = self._origin(eta, rates)
        turning = self.turning
        if turning is None:
            return Moving((x + pose[0], z + pose[1]), slopes, bias)
        arm, turn, thrown = turn_point(s, h, sin(eta[turning]), cos(eta[turning]), rates[turning])
        place = self.position[0] + pose[0] + arm[0], self.position[1] + pose[1] + arm[1]
        both = plus(slopes[turning][0], 1.0, turn[0]), plus(slopes[turning][1], 1.0, turn[1])
        slopes = (*slopes[:turning], both, *slopes[turning + 1 :])
        return Moving(place, slopes, (bias[0] + thrown[0], bias[1] + thrown[1]))

    def _origin(self, eta: Sequence[Any], rates: Sequence[Any]) -> tuple[Slope, tuple[Slope, ...], Slope]:
        """Displacement of the origin, its slopes and its bias."""
        assert self.path is not None
        if self.path.bends:
            return self.path.motion(eta, rates, self.values)
        return self.path.place(eta, self.values), self._straight, (0.0, 0.0)

    @cached_property
    def _straight(self) -> tuple[Slope, ...]:
        """The slopes of an origin that moves on straight lines."""
        zeros = [0.0] * self.size
        assert self.path is not None
        return self.path.motion(zeros, zeros, self.values)[1]


def turn_displacement(s: Any, h: Any, sine: Any, versine: Any) -> tuple[Any, Any]:
    """Return the displacement (m) of a point (s, h) of a rotating body from the drawn position."""
    return h * sine - s * versine, -(s * sine + h * versine)


def _combine_slopes(position: tuple[Any, Any], point: Floats, eta: Sequence[Any]) -> Moving:
    """A point (2, d) of a modal support."""
    slopes = tuple((x, z) for x, z in point.T.tolist())
    x, z = (sum((slope[k] * value for slope, value in zip(slopes, eta, strict=True)), position[k]) for k in (0, 1))
    return Moving((x, z), slopes, (0.0, 0.0))


def carrier_numbers(support: Any) -> CarrierNumbers:
    """The numbers of a support of a scene."""
    name, position = getattr(support, "name", "") or support.kind, getattr(support, "position", (0.0, 0.0))
    if isinstance(support, ModalSupport):
        M, K = np.array(support.M), np.array(support.K)
        D = np.zeros_like(M) if support.D is None else np.array(support.D)
        return CarrierNumbers("modal", name, position, M=M, K=K, D=D, points=np.array(support.points))
    path = getattr(support, "path", None)
    if path is None:
        return CarrierNumbers(support.kind, name, position)
    return CarrierNumbers(
        support.kind,
        name,
        position,
        support.mass,
        getattr(support, "inertia", 0.0),
        getattr(support, "centre", (0.0, 0.0)),
        law_values(support.stiffness),
        law_values(support.damping),
        path,
        tuple(getattr(support, parameter.name) for parameter in path.parameters),
    )
