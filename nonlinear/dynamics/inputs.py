"""What time brings to the equations of motion, beside the state: a support's motion, lengths, applied forces.

At one instant these are an `Instant`; as inputs u of what is written they are a list, in this order, each only where a
scene has it:

    the time (s) where the support moves in a sine, else its acceleration (m/s²) and, where links have drag, its
    velocity (m/s), in its direction
    of every law of a hoist the length (m), its speed and its acceleration
    the force on the cart (N), and the moment on every link (N m; in space its three components), of a load
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from nonlinear.system import AppliedForces, Layout, Load, System

NOTHING = AppliedForces()


class Lengths(NamedTuple):
    """Lengths (L, ...) of all links at an instant (m), their speeds and accelerations."""

    length: Any
    speed: Any
    acceleration: Any


class Instant(NamedTuple):
    """Accelerations (m/s²) and velocities (m/s) of a moved support along the rail and down, lengths, applied forces."""

    support: tuple[Any, Any] = (0.0, 0.0)
    velocity: tuple[Any, Any] = (0.0, 0.0)
    lengths: Lengths | None = None
    push: AppliedForces = NOTHING


QUIET = Instant()


@dataclass(frozen=True, eq=False)
class Inputs:
    """What time brings to a system under a load."""

    system: System
    load: Load | None = None

    @cached_property
    def laws(self) -> tuple[Any, ...]:
        """The places (k,) of links that follow a law, and the law."""
        return self.system.hoisting.laws if self.system.hoisting else ()

    @property
    def count(self) -> int:
        """How many inputs u there are."""
        acting = 0 if self.load is None else self._moments + (self.system.cart is not None)
        return self._moved + 3 * len(self.laws) + acting

    @property
    def _moments(self) -> int:
        return self.system.n_links * (3 if self.system.spatial else 1)

    @property
    def _moved(self) -> int:
        return 0 if self.system.support is None else 1 if self.is_analytic else 1 + self.system.dragged

    @property
    def is_analytic(self) -> bool:
        """Whether the support's motion is written out, of its constants and the time."""
        return self.system.support is not None and bool(self.system.support.motion.constants)

    def listed(self, time: float, y: Sequence[float], layout: Layout) -> list[Any]:
        """The inputs u at one time (s), where the load sees the state y."""
        found = self.of_time(time)
        if self.load is not None:
            push = self.load(time, layout.state(np.asarray(y)))
            found += [float(push.cart)] * (self.system.cart is not None)
            moments = push.moments
            found += [0.0] * self._moments if moments is None else np.ravel(moments).astype(float).tolist()
        return found

    @cached_property
    def of_time(self) -> Callable[[float], list[float]]:
        """The inputs of time alone at one time (s), in floats."""
        support, dragged, laws = self.system.support, self.system.dragged, [_scalar(law) for _, law in self.laws]
        motion = support.motion if support else None

        analytic = self.is_analytic

        def inputs(time: float) -> list[float]:
            if analytic:
                return [time]
            found = [motion.acceleration_at(time)] if motion else []
            if motion and dragged:
                found.append(motion.velocity_at(time))
            for law in laws:
                found += law(time)
            return found

        return inputs

    def instant(self, u: Sequence[Any]) -> Instant:
        """The instant of these inputs."""
        given = iter(u)
        support = velocity = (0.0, 0.0)
        if moving := self.system.support:
            first, motion = next(given), moving.motion
            support = _along(moving.direction, motion.derivative(first, 2) if self.is_analytic else first)
            if self.system.dragged:
                size = motion.derivative(first, 1) if self.is_analytic else next(given)
                velocity = _along(moving.direction, size)
        lengths = self._lengths([(next(given), next(given), next(given)) for _ in self.laws]) if self.laws else None
        acting = [*given]
        force = acting.pop(0) if acting and self.system.cart else 0.0
        push = AppliedForces(force, _filled(acting)) if acting else NOTHING
        return Instant(support, velocity, lengths, push)

    def _lengths(self, laws: Sequence[tuple[Any, Any, Any]]) -> Lengths:
        links = self.system.n_links
        parts = Lengths([0.0] * links, [0.0] * links, [0.0] * links)
        for group in self.system.groups:
            for place, length in zip(group.index.ravel().tolist(), group.block.length.ravel(), strict=True):
                parts.length[place] = length
        for (places, _), numbers in zip(self.laws, laws, strict=True):
            for part, number in zip(parts, numbers, strict=True):
                for place in places.tolist():
                    part[place] = number
        return Lengths(*(_filled(part) for part in parts))

    def at(self, time: Any, y: Any, layout: Layout) -> Instant:
        """The instant at one time (s) and state, or at many times side by side."""
        found = self.instant(self.of_time(time)) if self.system.support or self.laws else QUIET
        return found._replace(push=self.load(time, layout.state(y))) if self.load else found


def _along(direction: tuple[float, float], size: Any) -> tuple[Any, Any]:
    along, down = direction
    return (along * size if along else 0.0), (down * size if down else 0.0)


def _scalar(law: Any) -> Callable[[float], list[float]]:
    if hasattr(law, "at"):
        return law.at  # type: ignore[no-any-return]
    return lambda time: [float(part) for part in law(time)]


def _filled(values: Sequence[Any]) -> Any:
    """An array (L, ...) of numbers, arrays or symbols."""
    plain = all(isinstance(one, (float, int)) for one in values)
    if plain or any(isinstance(one, np.ndarray) for one in values):
        return np.array(np.broadcast_arrays(*values), dtype=float)
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found
