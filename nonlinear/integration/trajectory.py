"""The result of a run: states at sampled times, derived quantities, and the drifts that certify it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from modal._compatibility import former
from modal.scene import Scene
from modal.types import Floats
from nonlinear.dynamics import Mechanics
from nonlinear.system import NO_FRICTION, NO_KICKS, Equations, EventRecord, Friction, Kicks, Motion, State, System

NOISE = 1e-7
CLOSED = "closed form"  # the method where nothing is integrated
TRUNCATED = "truncated"  # the form with a few mode shapes


@dataclass(frozen=True)
class SolverInfo:
    """How a trajectory was computed: the form of the equations, the method, and the reason; counts; why it ended.

    `drift` is the largest constraint violation before projection, relative to the lengths of the scene; `reduced`
    describes what was integrated where that was less than the whole scene.  `error` is the estimated bound on the error
    of any angle (rad) where an accuracy was requested, inf where it is unknown.
    """

    form: str
    method: str
    reason: str
    tolerance: float
    steps: int = 0
    calls: int = 0
    drift: float = 0.0
    stopped: str = ""
    interrupted: bool = False
    reduced: str = ""
    error: float = inf


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A scene's motion at `times` (T,) in s, the events on the way, and how it was computed.

    `kicks` are those of escapements, `friction` tells what dry friction did; `driven` tells whether anything acted from
    outside, `equations` holds the equations of a run made in this process.
    """

    scene: Scene
    system: System
    times: Floats
    motion: Motion
    run: SolverInfo
    happenings: tuple[EventRecord, ...] = ()
    kicks: Kicks = NO_KICKS
    friction: Friction = NO_FRICTION
    driven: bool = False
    equations: Equations | None = field(default=None, repr=False)

    plant = former("Trajectory", "plant", "system")

    @cached_property
    def mechanics(self) -> Mechanics:
        """Positions, energies and momenta."""
        support = self.system.support
        moved = support.displacements(self.times, 3 if self.system.spatial else 2) if support else None
        return Mechanics(self.system, self.motion, self.times, moved)

    def at(self, rows: Any) -> Trajectory:
        """The trajectory at some of its times: a slice, indices or a mask."""
        return replace(self, times=self.times[rows], motion=self.motion.at(rows))

    @property
    def final(self) -> State:
        """The last state, from which another run can continue."""
        return self.motion[-1]

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return not self.run.stopped

    @cached_property
    def _steady(self) -> Mechanics:
        """The motion in a frame without coasting: rounding would dominate the energy of a fast free cart."""
        if not self.keeps_momentum:
            return self.mechanics
        coasting = self.mechanics.momentum / self.system.total_mass
        return Mechanics(self.system, replace(self.motion, cart_rate=self.motion.cart_rate - coasting), self.times)

    @cached_property
    def energy_scale(self) -> float:
        """The reference of an energy drift (J): the range of the energies over the run, or its work.

        Where hardly anything moves it is NOISE of the potential energy, so that the drift is not all rounding.
        """
        kinetic, potential = self._steady.energies
        ranges = kinetic.max(), np.ptp(potential), abs(self.motion.work).max(), NOISE * abs(potential).max()
        return float(max(ranges)) or 1.0

    @cached_property
    def energy_error(self) -> Floats:
        """(E(t) − E(0) − work done by dampers and applied forces) / `energy_scale`, (T,)."""
        energy = self._steady.energy
        return np.asarray((energy - energy[0] - self.motion.work) / self.energy_scale)

    def energy_drift(self) -> float:
        """The largest |energy_error|."""
        return float(np.max(np.abs(self.energy_error)))

    @property
    def keeps_momentum(self) -> bool:
        """Whether momentum along the rail is conserved: a cart without spring, damper or drive."""
        cart = self.system.cart
        outside = self.system.rail is not None or self.system.dragged
        return cart is not None and not (cart.damping or cart.stiffness or outside or self.driven)

    @property
    def keeps_spin(self) -> bool:
        """Whether angular momentum about the vertical is conserved: in space, each pendulum on a fixed support."""
        return self.system.spatial and self.system.cart is None and not (self.system.works or self.driven)

    def momentum_drift(self) -> float:
        """The largest change of a conserved momentum over Σ m |v| without coasting, or Σ m r |v|; else NaN."""
        mechanics, mass = self.mechanics, self.system.mass
        speed = np.linalg.norm(mechanics.speeds, axis=-1)
        if self.keeps_momentum:
            along = mechanics.speeds[..., 0] - mechanics.momentum[:, None] / self.system.total_mass
            kept, scale = mechanics.momentum, (np.hypot(along, mechanics.speeds[..., -1]) @ mass).max()
        elif self.keeps_spin:
            kept, scale = mechanics.spin, ((speed * np.linalg.norm(mechanics.centres, axis=-1)) @ mass).max()
        else:
            return float("nan")
        return float(np.max(np.abs(kept - kept[0])) / (scale or 1.0))

    def constraint_drift(self) -> float:
        """The largest constraint violation before projection; 0 in minimal coordinates."""
        return self.run.drift
