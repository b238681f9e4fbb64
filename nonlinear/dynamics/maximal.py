"""Motion in the plane in maximal coordinates: paper 000's DAE of cart and double pendula for any plane scene.

Every link moves freely under gravity, springs, dampers and loads f, held by pivot forces λ that are unknowns too:

    M q'' + Gᵀ λ = f,   G q'' = γ      5L unknowns, 5L + 3 on a cart: 10 n + 3 for n double pendula

The accelerations keep the constraints, round-off and integration errors do not: the system is of index 1, and positions
drift off (linearly in the velocities' error, quadratically in the accelerations').  So between steps `project` puts q
and q' back by the least change in the sense of the masses, min ½ δᵀM δ with G δ = −g, one linear system of the same
matrix a Newton step (Hairer, Lubich & Wanner, Geometric Numerical Integration, 2006, §IV.4).  It leaves the centre of
mass and the momentum along the rail as they are.  Source: paper 000, section IV, corrected
(`modal.symbolic.papers.cart_dae`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import efforts
from nonlinear.dynamics.constraints import Pivots
from nonlinear.dynamics.forces import Reactions
from nonlinear.dynamics.saddle import Saddle
from nonlinear.system import AppliedForces, Load, Motion, State, System

NEWTON = 6
CLOSED, OPEN = 4 * float(np.finfo(float).eps), 1e-9


class Drift(NamedTuple):
    """The widest pivot: open by `position` of the longest pendulum L, opening by `velocity` of sqrt(g L)."""

    position: float
    velocity: float


@dataclass(frozen=True, eq=False)
class Maximal:
    """The equations of a plane scene with y = (q, q', work).

    Without `controlled`, `project` reports the drift and leaves it, as the paper's method does.
    """

    system: System
    load: Load | None = None
    controlled: bool = True

    @cached_property
    def pivots(self) -> Pivots:
        """The constraints."""
        return Pivots(self.system)

    @cached_property
    def saddle(self) -> Saddle:
        """The matrix of accelerations and forces."""
        return Saddle(self.pivots)

    @property
    def works(self) -> bool:
        """Whether the work comes last in y."""
        return self.system.works or self.load is not None

    def unknowns(self, time: float, y: Floats) -> Floats:
        """The paper's u: q'' (m/s², rad/s²), then `normal` on a cart, then the force from above on every link (N)."""
        state = self._state(y)
        return self._unknowns(state, self._push(time, state))

    def derivative(self, time: float, y: Floats) -> Floats:
        """Y' of shape (size,)."""
        state, size = self._state(y), self.pivots.size
        push = self._push(time, state)
        work = [efforts.power(self.system, state, push)] if self.works else []
        return np.concatenate((y[size : 2 * size], self._unknowns(state, push)[:size], work))

    def _unknowns(self, state: State, push: AppliedForces) -> Floats:
        system, forces = self.system, np.zeros(self.pivots.size)
        support, links = self.pivots.parts(forces)
        support += efforts.on_cart(system, state, push), system.gravity * system.cart.mass if system.cart else 0.0
        links[:, 1] = system.gravity * system.mass
        links[:, 2] = efforts.on_links(system, state, push)
        return self.saddle.solve(state.links, forces, self.pivots.gamma(state.links, state.link_rates))

    def _push(self, time: float, state: State) -> AppliedForces:
        return self.load(time, state) if self.load else AppliedForces()

    def _state(self, y: Floats) -> State:
        return self.read(y[None])[0]

    def begin(self, state: State) -> Floats:
        """The vector y of a state given by its angles, all pivots closed, no work done yet."""
        return np.concatenate((*self.pivots.placed(state), np.zeros(int(self.works))))

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        first, size, none = self.pivots.first, self.pivots.size, np.zeros(len(rows))
        return Motion(
            links=rows[:, first + 2 : size : 3],
            link_rates=rows[:, size + first + 2 : 2 * size : 3],
            cart=rows[:, 0] if first else none,
            cart_rate=rows[:, size] if first else none,
            work=rows[:, -1] if self.works else none,
        )

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): l of positions, 1 of angles, and their rates."""
        half = np.full(self.pivots.size, self.system.length)
        self.pivots.parts(half)[1][:, 2] = 1.0
        return np.concatenate((half, half * self.system.rate, [self.system.energy] * self.works))

    def drift(self, y: Floats) -> Drift:
        """How far y is off its constraints."""
        q, v = self._halves(y)
        reach, gravity = self.pivots.reach, self.system.gravity
        return Drift(_widest(self.pivots.gaps(q)) / reach, _widest(self.pivots.opening(q, v)) / sqrt(gravity * reach))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that keeps every constraint, and the largest violation that it mends, as `drift` scales it.

        ComputationError where Newton's method does not close the pivots.
        """
        found = max(self.drift(y))
        return (self._closed(y) if self.controlled else y), found

    def _closed(self, y: Floats) -> Floats:
        q, v = self._halves(y)
        q = self._joined(q)
        v = v + self._step(q, self.pivots.opening(q, v))
        return np.concatenate((q, v, y[2 * self.pivots.size :]))

    def _joined(self, q: Floats) -> Floats:
        extent = self.pivots.reach + abs(q[0])
        for _ in range(NEWTON):
            gaps = self.pivots.gaps(q)
            if _widest(gaps) <= CLOSED * extent:
                return q
            q = q + self._step(q, gaps)
        left = _widest(self.pivots.gaps(q))
        if not left <= OPEN * extent:
            raise ComputationError(f"pivots still {left:.2g} m open after {NEWTON} steps: torn too far apart")
        return q

    def _step(self, q: Floats, gaps: Floats) -> Floats:
        angles = self.pivots.parts(q)[1][:, 2]
        return self.saddle.solve(angles, 0.0, -gaps)[: self.pivots.size]

    def _halves(self, y: Floats) -> tuple[Floats, Floats]:
        return y[: self.pivots.size], y[self.pivots.size : 2 * self.pivots.size]

    def reactions(self, motion: Motion, times: Floats | None = None) -> Reactions:
        """Every force of a motion, of this system or of any other; `times` (T,) in s are what a load depends on."""
        size, first = self.pivots.size, self.pivots.first
        moments = np.zeros(len(motion.cart)) if times is None else times
        states = [motion[at] for at in range(len(moments))]
        found = np.array(
            [self._unknowns(state, self._push(time, state))[size:] for time, state in zip(moments, states, strict=True)]
        )
        pivots, tops = found[:, first // 2 :].reshape(len(found), -1, 2), self.pivots.above < 0
        return Reactions(found[:, 0] if first else -pivots[:, tops, 1].sum(1), pivots, tops)


def _widest(gaps: Floats) -> float:
    return float(np.abs(gaps).max())
