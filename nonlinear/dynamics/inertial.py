"""The inertial forces −m a in the frame of a moved support, as a load.

They are those of a uniform field f = −a that varies with time, so that with b as in `modal.pair` the generalized force
on the unit vector u of a link is b f: b (f_x cos θ − f_z sin θ) on its angle, the moment b u × f in space.  Their power
is that by which the energy in the support's frame changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.types import Floats
from nonlinear.system import AppliedForces, Load, State, System


@dataclass(frozen=True, eq=False)
class Inertial:
    """The load of a moved support, and any load from `outside` besides."""

    system: System
    outside: Load | None = None

    @cached_property
    def b(self) -> Floats:
        """First moments (kg m), (L,)."""
        return self.system.by_link("b")

    def acceleration(self, time: float) -> tuple[float, float]:
        """The support's acceleration (m/s²) along the rail and down."""
        return self.system.support.acceleration(time) if self.system.support else (0.0, 0.0)

    def given(self, time: float, state: State) -> AppliedForces:
        """The load from outside."""
        return self.outside(time, state) if self.outside else AppliedForces()

    def __call__(self, time: float, state: State) -> AppliedForces:
        """Moments of the inertial forces and of the load from outside."""
        (along, down), push = self.acceleration(time), self.given(time, state)
        if self.system.spatial:
            x, y, z = np.moveaxis(state.links, -1, 0)
            found = self.b[:, None] * np.stack((-y * down, x * down - z * along, y * along), axis=-1)
        else:
            found = self.b * (down * np.sin(state.links) - along * np.cos(state.links))
        return push._replace(moments=found if push.moments is None else found + push.moments)


def with_inertial_forces(system: System, load: Load | None) -> Load | None:
    """The load on a system, with the inertial forces of its support where that moves."""
    return load if system.support is None or isinstance(load, Inertial) else Inertial(system, load)


def applied(load: Load | None) -> Load | None:
    """The load from outside alone."""
    return load.outside if isinstance(load, Inertial) else load
