"""Equations of motion of everything that hangs from one support, solved group by group.

Each group answers the cart's acceleration x'' with a pull along the rail, mass · x'' + force; the cart's own equation

    (m_c + Σ mass) x'' = F − c_c x' − k_c x − Σ force

closes the loop (the Schur complement of the cart), and each group then turns its links under x''.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from modal.types import Floats, Ints
from nonlinear.system import AppliedForces, Group, Layout, Load, Motion, State, System

NOTHING = AppliedForces()


class Body(Protocol):
    """One group of pendula, solved: what it pulls the cart with, then how it turns once the cart's motion is known."""

    def pull(self, links: Any, rates: Any, torques: Any, gravity: float) -> tuple[Any, Any, Any]:
        """Mass (kg) and force (N) of its pull along the rail, and what it must remember."""
        ...

    def turn(self, memory: Any, push: Any) -> Any:
        """Second derivatives of its links under the cart's acceleration `push` (m/s²)."""
        ...


@dataclass(frozen=True, eq=False)
class Suspended(ABC):
    """The equations of a scene; `bodies` solve its groups, `load` acts from outside."""

    system: System
    bodies: tuple[Body, ...]
    load: Load | None = None

    width: ClassVar[int]

    @cached_property
    def layout(self) -> Layout:
        """The parts of y."""
        works = self.system.works or self.load is not None
        return Layout(self.system.n_links, self.width, self.system.cart is not None, works)

    @cached_property
    @abstractmethod
    def places(self) -> tuple[Ints, ...]:
        """Where every group's numbers stand among those of all links."""

    @abstractmethod
    def acting(self, group: Group, links: Any, rates: Any, moments: Any | None) -> tuple[Any, Any]:
        """Generalized forces of joints and of `moments` from outside, and the power (W) of dampers and moments."""

    def derivative(self, time: float, y: Any) -> Any:
        """The rate of y, (size, ...): further axes of y are so many trajectories side by side."""
        layout, cart = self.layout, self.system.cart
        first, half = int(layout.on_cart), layout.half
        q, v = y[:half], y[half : 2 * half]
        push = self.load(time, layout.state(y)) if self.load else NOTHING
        found = np.empty_like(y)
        found[:half] = v
        mass, force, power, solved = self._pulls(q[first:], v[first:], push)
        x2 = 0.0
        if cart:
            outside = push.cart - cart.damping * v[0]
            x2 = found[half] = (outside - cart.stiffness * q[0] - force) / (cart.mass + mass)
            power = power + v[0] * outside
        turned = found[half + first : 2 * half]
        for place, body, memory in solved:
            turned[place] = body.turn(memory, x2)
        if layout.works:
            found[-1] = power
        return found

    def _pulls(self, links: Any, rates: Any, push: AppliedForces) -> tuple[Any, Any, Any, list[tuple[Ints, Body, Any]]]:
        mass, force, power, solved = 0.0, 0.0, 0.0, []
        given = None if push.moments is None else np.ravel(push.moments)
        for group, place, body in zip(self.system.groups, self.places, self.bodies, strict=True):
            own, speed = links[place], rates[place]
            torques, work = self.acting(group, own, speed, None if given is None else given[place])
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
        """Without constraints there is nothing to mend."""
        return y, 0.0
