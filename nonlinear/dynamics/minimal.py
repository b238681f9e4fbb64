"""Equations of motion in minimal coordinates, solved group by group: in the plane the cart and one angle per link.

Each group responds to the cart's acceleration x'' with a pull along the rail, mass · x'' + force; the cart's equation

    (m_c + Σ mass) x'' = F − c_c x' − k_c x − Σ force

gives x'' (the Schur complement of the cart), from which each group computes the accelerations of its links.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from modal.types import Floats, Ints
from nonlinear.dynamics.drag import plane_drag
from nonlinear.dynamics.joints import cart_force, joint_torques, modal_drag
from nonlinear.dynamics.recursion import downward, links_of, upward
from nonlinear.system import AppliedForces, Group, Layout, Load, Motion, State, System

NOTHING = AppliedForces()


class Body(Protocol):
    """Solver of one group of pendula: first its pull on the cart, then the accelerations of its links under x''."""

    def pull(self, links: Any, rates: Any, torques: Any, gravity: float) -> tuple[Any, Any, Any]:
        """Mass (kg) and force (N) of its pull along the rail, and intermediate results for `turn`."""
        ...

    def turn(self, memory: Any, push: Any) -> Any:
        """Second derivatives of its links under the cart's acceleration `push` (m/s²)."""
        ...


@dataclass(frozen=True, eq=False)
class Suspended(ABC):
    """The equations of a scene: `bodies` solve its groups, `load` acts from outside, y may include the work."""

    system: System
    bodies: tuple[Body, ...]
    load: Load | None = None
    counts_work: bool = True

    width: ClassVar[int]

    @cached_property
    def layout(self) -> Layout:
        """The arrangement of y."""
        works = self.counts_work and (self.system.works or self.load is not None)
        return Layout(self.system.n_links, self.width, self.system.cart is not None, works)

    @cached_property
    @abstractmethod
    def places(self) -> tuple[Ints, ...]:
        """Positions of every group's numbers among those of all links."""

    @abstractmethod
    def acting(self, group: Group, links: Any, rates: Any, moments: Any | None) -> tuple[Any, Any]:
        """Generalized forces of joints and of external `moments`, and the power (W) of dampers and moments."""

    def derivative(self, time: float, y: Any) -> Any:
        """The time derivative of y, (size, ...): further axes of y are independent trajectories side by side."""
        layout, cart = self.layout, self.system.cart
        first, half = int(layout.on_cart), layout.half
        q, v = y[:half], y[half : 2 * half]
        push = self.applied(time, y)
        found = np.empty_like(y)
        found[:half] = v
        drag = None if self.system.modal_damping is None else modal_drag(self.system, v)
        own, rate = None if drag is None else drag[first:], v[0] if cart else 0.0
        mass, force, power, solved = self._pulls(self.bodies_at(time), q[first:], v[first:], push, own, rate)
        x2 = 0.0
        if cart:
            kept, working = cart_force(self.system, q[0], v[0])
            outside = push.cart + working + (0.0 if drag is None else drag[0])
            x2 = found[half] = (outside + kept - force) / (cart.mass + mass)
            power = power + v[0] * outside
        turned = found[half + first : 2 * half]
        for place, body, memory in solved:
            turned[place] = body.turn(memory, x2)
        if layout.works:
            found[-1] = power
        return found

    def applied(self, time: float, y: Any) -> AppliedForces:
        """What acts from outside."""
        return self.load(time, self.layout.state(y)) if self.load else NOTHING

    def bodies_at(self, time: float) -> tuple[Body, ...]:
        """The solvers of the groups at a time (s)."""
        return self.bodies

    @abstractmethod
    def dragged(self, group: Group, links: Any, rates: Any, cart_rate: Any) -> tuple[Any, Any, Any]:
        """Generalized forces of drag like those of `acting`, its force on the cart (N), and its power (W)."""

    def _pulls(
        self,
        bodies: tuple[Body, ...],
        links: Any,
        rates: Any,
        push: AppliedForces,
        drag: Any | None,
        cart_rate: Any,
    ) -> tuple[Any, Any, Any, list[tuple[Ints, Body, Any]]]:
        mass, force, power, solved = 0.0, 0.0, 0.0, []
        given = push.moments if push.moments is None or links.ndim > 1 else np.ravel(push.moments)
        for group, place, body in zip(self.system.groups, self.places, bodies, strict=True):
            own, speed = links[place], rates[place]
            torques, work = self.acting(group, own, speed, None if given is None else given[place])
            if drag is not None:
                torques, work = torques + drag[place], work + np.sum(drag[place] * speed, axis=(0, 1))
            if group.dragged:
                resisting, braking, lost = self.dragged(group, own, speed, cart_rate)
                torques, force, work = torques + resisting, force - braking, work + lost
            one_mass, one_force, memory = body.pull(own, speed, torques, self.system.gravity)
            mass, force, power = mass + one_mass, force + one_force, power + work
            solved.append((place, body, memory))
        return mass, force, power, solved

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        return self.layout.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        return self.layout.read(rows)

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.layout.natural(self.system)

    def project(self, y: Floats) -> tuple[Floats, float]:
        """No constraints: y is unchanged."""
        return y, 0.0


class Recursion:
    """One pass up and one down in NumPy, for arrays (n, P, ...) of any type that `sine` and `cosine` accept."""

    def __init__(self, group: Group, tail: int = 0, sine: Any = np.sin, cosine: Any = np.cos) -> None:
        self.sine, self.cosine = sine, cosine
        self.links = [type(link)(*(value.reshape(-1, *[1] * tail) for value in link)) for link in links_of(group)]

    def pull(self, angles: Any, rates: Any, torques: Any, gravity: float) -> tuple[Any, Any, Any]:
        """Mass (kg) and force (N) of the pull along the rail, summed over the pendula."""
        answer, turns = upward(self.links, self.sine(angles), self.cosine(angles), rates, torques)
        return answer.xx.sum(0), (answer.px - gravity * answer.xz).sum(0), (turns, gravity)

    def turn(self, memory: Any, push: Any) -> Any:
        """θ'' (n, P, ...)."""
        turns, gravity = memory
        return np.array(downward(self.links, turns, push, -gravity))


class Minimal(Suspended):
    """The equations of motion of a plane scene, y = (x, θ, x', θ', work)."""

    width = 1

    @cached_property
    def places(self) -> tuple[Ints, ...]:
        """Positions of every group's angles (n, P) among those of all links."""
        return tuple(group.index for group in self.system.groups)

    def acting(self, group: Group, links: Any, rates: Any, moments: Any | None) -> tuple[Any, Any]:
        """Torques (n, P, ...) on the absolute angles, and the power of joints and moments."""
        torques, power = moments, 0.0
        if moments is not None:
            power = np.sum(moments * rates)
        if group.hinged:
            hinges, drained = joint_torques(group, links, rates)
            torques = hinges if torques is None else torques + hinges
            power = power + drained
        return np.zeros_like(links) if torques is None else torques, power

    def dragged(self, group: Group, links: Any, rates: Any, cart_rate: Any) -> tuple[Any, Any, Any]:
        """Torques (n, P, ...) on the absolute angles, the force on the cart, and the power."""
        return plane_drag(group, links, rates, cart_rate)
