"""What carries the first joints of pendula, at one instant: a fixed support, a moved one, or a cart on its rail.

`Bearing` is the interface of these and of structures (`nonlinear.dynamics.structure`): equations of motion ask how the
first joints move, hand over what hangs there group by group, and are given back accelerations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

from nonlinear.dynamics.external import External, on_cart
from nonlinear.dynamics.inputs import Instant
from nonlinear.dynamics.joints import Base, cart_force
from nonlinear.system import System


class Joints(NamedTuple):
    """How the first joints of a group move: a `base` that turns, None for none, and their velocity (m/s).

    The velocity is that along the rail of all, or two of each, (P, ...), along the rail and down.
    """

    base: Base | None
    velocity: Any


class Bearing(ABC):
    """What carries the first joints at an instant."""

    torques: Any = None
    """Generalized forces (L, ...) on the links of springs between points; None without any."""

    @abstractmethod
    def joints(self, group: int) -> Joints:
        """How the first joints of a group, by its number, move."""

    @abstractmethod
    def take(
        self, group: int, body: Any, links: Any, rates: Any, forces: Any, external: External | None, reaction: Any
    ) -> None:
        """A group's solver with all that acts on it; `reaction` are the torques (P, ...) of its first joints."""

    @abstractmethod
    def pushed(self, drag: Any) -> tuple[Any, Any]:
        """The generalized forces (first, ...) and the power (W) of what acts here; `drag` is that of damping ratios."""

    @abstractmethod
    def solved(self, drag: Any) -> tuple[Any, Any]:
        """The accelerations (first, ...) that these make, and the power."""

    @abstractmethod
    def fall(self, group: int) -> Any:
        """The second derivatives of the links of a group, once this is solved."""

    @abstractmethod
    def start(self, group: int, gravity: Any) -> tuple[Any, Any]:
        """The acceleration (m/s²) of a group's first joints along the rail and down, less gravity."""


class RailAt(Bearing):
    """A fixed support, a moved one or a cart, with x and x' where there is a cart."""

    def __init__(self, system: System, x: Any, rate: Any, instant: Instant) -> None:
        self.system, self.x, self.instant, self.rate = system, x, instant, rate
        along, down = instant.support
        self.gravity, self.acceleration = system.gravity - down, along
        self.mass: Any = 0.0
        self.force: Any = 0.0
        self.taken: list[Any] = []

    def joints(self, group: int) -> Joints:
        """They move as the cart."""
        return Joints(None, self.rate)

    def take(
        self, group: int, body: Any, links: Any, rates: Any, forces: Any, external: External | None, reaction: Any
    ) -> None:
        """Its pull on the cart."""
        if external is not None:
            self.force = self.force - external.on_cart
        mass, force, memory = body.pull(links, rates, forces, self.gravity)
        self.mass, self.force = self.mass + mass, self.force + force
        self.taken.append((body, memory))

    def pushed(self, drag: Any) -> tuple[Any, Any]:
        """The force on the cart, if there is one."""
        if not self.system.cart:
            return [], 0.0
        kept, working = cart_force(self.system, self.x, self.rate)
        outside = self.instant.push.cart + working + (0.0 if drag is None else drag[0])
        if self.instant.forces:
            outside = outside + on_cart(self.system, self.instant.forces)
        return [outside + kept - self.force], self.rate * outside

    def solved(self, drag: Any) -> tuple[Any, Any]:
        """The cart's acceleration, if there is one."""
        forces, power = self.pushed(drag)
        if self.system.cart:
            self.acceleration = forces[0] / (self.system.cart.mass + self.mass)
            forces = [self.acceleration]
        return forces, power

    def fall(self, group: int) -> Any:
        """Under the acceleration of the cart."""
        body, memory = self.taken[group]
        return body.turn(memory, self.acceleration)

    def start(self, group: int, gravity: Any) -> tuple[Any, Any]:
        """That of the cart; a support has none in its own frame."""
        return (self.acceleration if self.system.cart else 0.0), -gravity
