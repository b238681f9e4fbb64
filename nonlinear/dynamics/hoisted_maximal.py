"""Maximal coordinates with ropes of prescribed length: constraints that depend on time.

The centre of a bob is at c_i = l_i(t) from its upper pivot, so that with the notation of `nonlinear.dynamics.maximal`

    G q' = −c_i' u_i,      γ_i gains −c_i'' u_i − 2 c_i' θ_i' n_i,

and the winch does the work ∫ Σ c_i' u_i·λ_i dt of the pivot forces.  Since `project` must know the lengths, the time is
a component of y, before the work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.joints import acting
from nonlinear.dynamics.maximal import Maximal, Pivots, Saddle
from nonlinear.system import AppliedForces, State, System


def frozen(system: System, time: float) -> tuple[System, Floats, Floats]:
    """The system with the lengths of a time (s), and their speeds and accelerations (L,)."""
    hoisting = system.hoisting
    assert hoisting is not None
    length, speed, acceleration = hoisting.at(time)
    groups = []
    for group in system.groups:
        lengths = length[group.index]
        centre = np.where(hoisting.moving[group.index], lengths, group.block.centre)
        groups.append(replace(group, block=replace(group.block, length=lengths, centre=centre)))
    return replace(system, groups=tuple(groups), hoisting=None), speed, acceleration


@dataclass(frozen=True, eq=False)
class HoistedMaximal(Maximal):
    """The equations of `Maximal` with the lengths of `system.hoisting`, y = (q, q', time, work)."""

    def derivative(self, time: float, y: Floats) -> Floats:
        """The derivative y', (size,)."""
        size, state = self.pivots.size, self._state(y)
        push = self._push(time, state)
        unknowns, power = self._found(time, state, push)
        return np.concatenate((y[size : 2 * size], unknowns[:size], [1.0, power]))

    def _found(self, time: float, state: State, push: AppliedForces) -> tuple[Floats, float]:
        """The unknowns, and the power (W) of dampers, drives, the load and the winches."""
        system, speed, acceleration = frozen(self.system, time)
        pivots, forces = Pivots(system), np.zeros(self.pivots.size)
        support, links = pivots.parts(forces)
        on_cart, on_links, power = acting(system, state, push, None)
        support += on_cart, system.gravity * system.cart.mass if system.cart else 0.0
        links[:, 1] = system.gravity * system.mass
        links[:, 2] = on_links
        cart, moving = pivots.parts(pivots.placed(state)[1] + self._winding(state.links, speed))
        power += replace(self, system=system)._outside(time, state, moving, cart, support, links)
        u, n = directions(state.links)
        gamma = pivots.gamma(state.links, state.link_rates)
        gamma[-2 * system.n_links :] -= (acceleration * u + 2 * speed * state.link_rates * n).T.ravel()
        unknowns = Saddle(pivots).solve(state.links, forces, gamma)
        held = unknowns[-2 * system.n_links :].reshape(-1, 2)
        return unknowns, power + float(np.sum(speed * np.sum(u.T * held, axis=1)))

    def begin(self, state: State) -> Floats:
        """The vector y of a state at time 0."""
        return self.begin_at(state, 0.0)

    def begin_at(self, state: State, time: float) -> Floats:
        """The vector y of a state at a time (s), with closed pivots and zero work."""
        system, speed, _ = frozen(self.system, time)
        q, v = Pivots(system).placed(state)
        return np.concatenate((q, v + self._winding(state.links, speed), [time, 0.0]))

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        units = super().scale
        return np.concatenate((units[:-1], [1 / self.system.rate], units[-1:]))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that satisfies every constraint, and the largest violation removed."""
        size = self.pivots.size
        system, speed, _ = frozen(self.system, float(y[2 * size]))
        still = Maximal(system, controlled=self.controlled)
        moved = y.copy()
        moved[size : 2 * size] -= self._winding(self._state(y).links, speed)
        projected, drift = still.project(moved)
        if not self.controlled:
            return y, drift
        projected[size : 2 * size] += self._winding(self._state(projected).links, speed)
        return projected, drift

    def _winding(self, angles: Floats, speed: Floats) -> Floats:
        """Velocities that the ropes' speeds (L,) alone give to everything below them."""
        forces = np.zeros(self.pivots.size)
        links = self.pivots.parts(forces)[1]
        along = speed * directions(angles)[0]
        for group in self.system.groups:
            links[group.index, :2] = np.moveaxis(np.cumsum(along[:, group.index], axis=1), 0, -1)
        return forces


def directions(angles: Floats) -> tuple[Floats, Floats]:
    """The unit vectors u along and n across every link, (2, ...): along the rail, down."""
    sin, cos = np.sin(angles), np.cos(angles)
    return np.stack((sin, cos)), np.stack((cos, -sin))
