"""How points of a carrier move with its coordinates η: places, Jacobians and bias, exactly and at any angle.

A carrier has the pose (x, z, φ)(η) of its origin, x along the rail, z down, φ as angles of links; a point (s, h) of it

    r = (x, z) + (s cos φ + h sin φ, h cos φ − s sin φ),    r'' = J η'' + J' η'

Poses from the drawn rest, by kind: cart (η, 0, 0);  swing (L sin η/L, L cos η/L − L, 0);  tilt (0, 0, η);
heave (0, −η, 0);  platform (sway, −heave, roll).  Points of a modal support move by its array `points`.

Every line is plain arithmetic: it accepts floats, arrays of any one shape, complex numbers and recorded symbols; for
SymPy's expressions the sine and the cosine are handed in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.scene import ModalSupport, Platform, Swing, Tilt
from modal.types import Floats

PLATFORM = ("sway", "heave", "roll")
COORDINATES: dict[str, tuple[str, ...]] = {
    "fixed": (),
    "moved": (),
    "cart": ("m",),
    "swing": ("m",),
    "tilt": ("rad",),
    "heave": ("m",),
    "platform": ("sway_m", "heave_m", "roll_rad"),
}
"""The coordinates of every kind but "modal", as they follow the name of a carrier: what they are, with the unit."""
Function = Callable[[Any], Any]


class Moving(NamedTuple):
    """A point that moves: its place (x, z) in m, ∂(x, z)/∂η of every coordinate, and J' η' (m/s²)."""

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


def plus(total: Any, factor: Any, value: Any) -> Any:
    """The sum total + factor · value, without operations on arrays that would only add a 0 or multiply by 1.

    Constants are plain floats; what is computed may be a float of NumPy, and 0 by chance.
    """
    if (type(factor) is float and factor == 0.0) or (type(value) is float and value == 0.0):
        return total
    product = value if type(factor) is float and factor == 1.0 else factor * value
    return product if type(total) is float and total == 0.0 else total + product


def inner(slope: tuple[Any, Any], x: Any, z: Any) -> Any:
    """The product of a slope with the vector (x, z)."""
    return plus(plus(0.0, slope[0], x), slope[1], z)


def swing_path(S: Any, C: Any, length: Any, rate: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Slope and bias of a swing whose rods stand at an angle of this sine and cosine."""
    ww = rate * rate / length
    return (C, -S), (-S * ww, -C * ww)


def turn_point(s: Any, h: Any, S: Any, C: Any, rate: Any) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
    """Place from the origin, slope and bias of a point (s, h) of what has turned, by sine and cosine of its angle."""
    ww = rate * rate
    arm = s * C + h * S, h * C - s * S
    return arm, (h * C - s * S, -h * S - s * C), (-(arm[0] * ww), -(arm[1] * ww))


@dataclass(frozen=True, eq=False)
class CarrierNumbers:
    """A support as numbers: `position` and `centre` (m), mass (kg), inertia about its centre (kg m²), rods' length (m).

    `stiffness` and `damping` have an entry for each coordinate.  A modal support has the arrays M, K, D (d, d) and
    `points` (P, 2, d) in their stead.
    """

    kind: str
    name: str
    position: tuple[Any, Any]
    mass: Any = 0.0
    inertia: Any = 0.0
    length: Any = 0.0
    centre: tuple[Any, Any] = (0.0, 0.0)
    stiffness: tuple[Any, ...] = ()
    damping: tuple[Any, ...] = ()
    M: Floats | None = None
    K: Floats | None = None
    D: Floats | None = None
    points: Floats | None = None

    @cached_property
    def size(self) -> int:
        """How many coordinates it has."""
        return len(self.stiffness) if self.M is None else len(self.M)

    @cached_property
    def turning(self) -> int | None:
        """Which of its coordinates is the angle by which it turns; None if it does not."""
        return {"tilt": 0, "platform": 2}.get(self.kind)

    @property
    def bends(self) -> bool:
        """Whether its points move on bent paths."""
        return self.kind in {"swing", "tilt", "platform"}

    @property
    def suffixes(self) -> tuple[str, ...]:
        """What follows its name in the name of every coordinate."""
        return COORDINATES[self.kind] if self.M is None else tuple(str(k) for k in range(1, self.size + 1))

    def moving(
        self,
        where: tuple[Any, Any] | int,
        eta: Sequence[Any],
        rates: Sequence[Any],
        sine: Function = np.sin,
        cosine: Function = np.cos,
    ) -> Moving:
        """How its point (s, h), or the numbered point of a modal one, moves."""
        if self.points is not None:
            return _combine_slopes(self.position, self.points[where], eta)
        assert not isinstance(where, int)
        pose, slopes, bias = self._pose(eta, rates, sine, cosine)
        turning = self.turning
        s, h = where
        if turning is None:
            x, z = self.position[0] + s, self.position[1] + h
            return Moving((x + pose[0], z + pose[1]), slopes, bias)
        S, C, w = sine(eta[turning]), cosine(eta[turning]), rates[turning]
        arm, turn, thrown = turn_point(s, h, S, C, w)
        slopes = (*slopes[:turning], turn)
        place = self.position[0] + pose[0] + arm[0], self.position[1] + pose[1] + arm[1]
        return Moving(place, slopes, (bias[0] + thrown[0], bias[1] + thrown[1]))

    def _pose(self, eta: Sequence[Any], rates: Sequence[Any], sine: Function, cosine: Function) -> Any:
        """Displacement of the origin, its slopes and its bias."""
        if self.kind == "cart":
            return (eta[0], 0.0), ((1.0, 0.0),), (0.0, 0.0)
        if self.kind == "swing":
            S, C = sine(eta[0] / self.length), cosine(eta[0] / self.length)
            slope, bias = swing_path(S, C, self.length, rates[0])
            return (self.length * S, self.length * (C - 1)), (slope,), bias
        if self.kind == "tilt":
            return (0.0, 0.0), (), (0.0, 0.0)
        if self.kind == "heave":
            return (0.0, -eta[0]), ((0.0, -1.0),), (0.0, 0.0)
        if self.kind == "platform":
            return (eta[0], -eta[1]), ((1.0, 0.0), (0.0, -1.0)), (0.0, 0.0)
        return (0.0, 0.0), (), (0.0, 0.0)


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
    if not COORDINATES[support.kind]:
        return CarrierNumbers(support.kind, name, position)
    stiffness, damping = (
        tuple(getattr(part, way) for way in PLATFORM) if isinstance(support, Platform) else (part,)
        for part in (support.stiffness, support.damping)
    )
    return CarrierNumbers(
        support.kind,
        name,
        position,
        support.mass,
        support.inertia if isinstance(support, Tilt | Platform) else 0.0,
        support.length if isinstance(support, Swing) else 0.0,
        support.centre if isinstance(support, Tilt | Platform) else (0.0, 0.0),
        stiffness,
        damping,
    )
