"""Escapements: the joints that have them, when the next kick comes, and its effect.

`Escapements` is for integrators that know of no switches: all but DOP853, and scenes whose equations are not written
out.  Others end their steps at the switches of `switches`.

A kick P at a joint applies an impulse +P to the link below and −P to the one above.  No finite force acts in an
instant, so with the generalized impulse J of all simultaneous kicks

    M(q) (v₊ − v₋) = J,        energy supplied = Σ P (γ'₋ + γ'₊)/2 = ½ v₊ᵀMv₊ − ½ v₋ᵀMv₋  exactly.

M⁻¹J is the response of the recursion along the chains, as that to friction at a joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import ulp
from typing import NamedTuple

import numpy as np
import scipy

from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics import Recursion
from nonlinear.dynamics.minimal import inverted
from nonlinear.integration.steppers import Stepper
from nonlinear.system import NO_KICKS, Kicks, Layout, System

LOOKS = 6  # points searched within every step
TOGETHER = 1e-12  # rad by which a kick may come early to coincide with another
SHARP, TURNS = 1e-15, 1e-9  # of an interval, to which a root and a turning point are sought
EPSILON = float(np.finfo(float).eps)
BUMP = 0.25  # a curve of one curvature rises above its ends by at most this times its change of slope


@dataclass(frozen=True, eq=False)
class Escaping:
    """The J joints with escapements of a system, all arrays (J,): the links below and above (−1: support).

    `bent` is the equilibrium angle (rad); `impulse` (N m s) and `angle` (rad) are those of the kicks.
    """

    system: System
    below: Ints
    above: Ints
    bent: Floats
    impulse: Floats
    angle: Floats

    def gamma(self, values: Floats, rest: Floats | float = 0.0) -> Floats:
        """The value at every joint (..., J) from the values of all coordinates (..., half)."""
        padded = np.concatenate((values, np.zeros_like(values[..., :1])), axis=-1)
        below, above = np.array(self.pairs, dtype=np.int64).reshape(-1, 2).T
        return np.asarray(padded[..., below] - padded[..., above] - rest)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The coordinates of v below and above every joint, −1 standing for a support that does not turn."""
        system, first = self.system, self.system.first
        above = np.where(self.above < 0, -1, self.above + first)
        if system.structure is not None:
            for joint in np.flatnonzero(self.above < 0):
                pivot = system.structure.pivots[system.pendulum[self.below[joint]]]
                angle = system.structure.angle_of(pivot.carrier)
                above[joint] = -1 if angle is None else angle
        return tuple(zip((self.below + first).tolist(), above.tolist(), strict=True))

    def jump(self, q: Floats, kicked: Floats) -> Floats:
        """The change of the velocities (half of y) at q when joints are kicked by impulses (J,) in N m s."""
        pushes = np.zeros(len(q) + 1)
        for (below, above), impulse in zip(self.pairs, kicked.tolist(), strict=True):
            pushes[below] += impulse
            pushes[above] -= impulse
        solvers = [(group, Recursion(group)) for group in self.system.groups]
        return np.asarray(inverted(self.system, solvers, q, pushes[:-1]))


def escaping(system: System) -> Escaping:
    """The joints with escapements, in the order of the groups."""
    parts: list[Floats] = []
    for group in system.groups:
        if group.kicked and group.excitation:
            above = np.vstack((np.full_like(group.index[:1], -1), group.index[:-1]))
            drive = group.excitation
            columns = (group.index, above, group.bent, drive.impulse, drive.angle)
            parts.append(np.stack([part[drive.impulse > 0] for part in columns]))
    below, above, *rest = np.hstack(parts) if parts else np.empty((5, 0))
    return Escaping(system, below.astype(np.int64), above.astype(np.int64), *rest)


class Due(NamedTuple):
    """The next kick: its time (s), and its side and joint as an index (side, joint)."""

    time: float
    place: tuple[int, int]


@dataclass(eq=False)
class Escapements:
    """The kicks of a run: `side` (J,) is the side of each joint's next kick, 0 where either is possible."""

    joints: Escaping
    layout: Layout
    side: Floats
    records: list[Kicks] = field(default_factory=list)

    @property
    def kicks(self) -> Kicks:
        """The kicks so far."""
        return Kicks(*map(np.concatenate, zip(*self.records, strict=True))) if self.records else NO_KICKS

    def next(self, stepper: Stepper, before: float) -> Due | None:
        """The first kick within the last step, None where there is none."""
        looks = np.linspace(before, stepper.time, LOOKS + 1)
        over, speed = self._out(np.vstack((stepper.inside(looks[:-1]), stepper.y)))
        for k, (start, end) in enumerate(pairwise(looks.tolist())):
            low, high, rise, fall = over[:, k], over[:, k + 1], speed[:, k], speed[:, k + 1]
            leaving = (low >= 0) & ((rise > 0) | ((rise == 0) & (high > 0)))
            if leaving.any():
                return Due(start, _largest(leaving))
            bump = np.maximum(low, high) + BUMP * (end - start) * (rise - fall)
            back = (low < 0) & (high < 0) & (rise > 0) & (fall < 0) & (bump >= 0)
            beyond = [*self._peaks(stepper, start, end, back), *[end] * bool(np.any((low < 0) & (high >= 0)))]
            if beyond:
                return self._first(stepper, start, min(beyond), low < 0)
        return None

    def kicked(self, due: Due, y: Floats) -> Floats:
        """The y after all kicks at that time."""
        layout, joints = self.layout, self.joints
        over, speed = (values[:, 0] for values in self._out(y[None]))
        now = (over > -TOGETHER) & (speed > 0)
        now[due.place] = True
        side = now[0].astype(float) - now[1]
        kick = side * joints.impulse
        self.side = np.where(side, -side, self.side)
        after = y.copy()
        after[layout.half : 2 * layout.half] += joints.jump(y[: layout.half], kick)
        fed = kick * joints.gamma((y + after)[self._rates]) / 2
        after[-1] += fed.sum()
        which = np.flatnonzero(side)
        self.records.append(Kicks(np.full(len(which), due.time), joints.below[which], kick[which], fed[which]))
        return after

    @property
    def _rates(self) -> slice:
        return slice(self.layout.half, 2 * self.layout.half)

    def _out(self, rows: Floats) -> tuple[Floats, Floats]:
        """How far (rad) every joint is beyond the angle of its next kick, −inf on an inactive side, and its rate.

        Both (2, T, J): to the right and to the left.
        """
        gamma = self.joints.gamma(rows[:, : self.layout.half], self.joints.bent)
        sides = np.array([1.0, -1.0])[:, None, None]
        over = np.where(self.side * sides < 0, -np.inf, sides * gamma - self.joints.angle)
        return over, sides * self.joints.gamma(rows[:, self._rates])

    def _at(self, stepper: Stepper, time: float) -> tuple[Floats, Floats]:
        """Both results of `_out` at one time within the last step, (2, J)."""
        over, speed = self._out(stepper.inside(np.array([time])))
        return over[:, 0], speed[:, 0]

    def _peaks(self, stepper: Stepper, start: float, end: float, back: Booleans) -> Iterator[float]:
        """Times at which joints that turn back beyond their angle do so, each once between start and end."""
        for s, j in zip(*np.nonzero(back), strict=True):
            time = root(lambda time, s=s, j=j: float(self._at(stepper, time)[1][s, j]), start, end)  # type: ignore[misc]
            if self._at(stepper, time)[0][s, j] >= 0:
                yield time

    def _first(self, stepper: Stepper, start: float, end: float, among: Booleans) -> Due:
        """The first joint and side of these to pass its angle; all are within at the start, one beyond at the end."""

        def over(time: float) -> Floats:
            return np.where(among, self._at(stepper, time)[0], -np.inf)

        time = root(lambda time: float(over(time).max()), start, end)
        return Due(time, _largest(over(time)))


def escapements(system: System, layout: Layout, y: Floats, before: Kicks = NO_KICKS) -> Escapements:
    """The escapements of a run that begins at y, after the kicks `before`.

    A joint that starts beyond its angle, or that was kicked before, has already had the kick on that side.
    """
    joints = escaping(system)
    gamma = joints.gamma(y[: layout.half], joints.bent)
    last = np.zeros(system.n_links)
    last[before.link] = before.impulse
    aside = np.where(np.abs(gamma) > joints.angle + TOGETHER, gamma, last[joints.below])
    return Escapements(joints, layout, -np.sign(aside))


def root(value: Callable[[float], float], start: float, end: float) -> float:
    """Where a value between two times of either sign is zero, to the last digits of the interval or of the time."""
    close = max(SHARP * (end - start), ulp(max(abs(start), abs(end))))
    return float(scipy.optimize.brentq(value, start, end, xtol=close, rtol=4 * EPSILON))


def lowest(value: Callable[[float], float], start: float, end: float) -> tuple[float, float]:
    """Where a value between two times is lowest, and that value.

    It is sought in parts of the interval: SciPy's own tolerance is 1.5e-8 of what varies, of a late time whole steps.
    """

    def inside(part: float) -> float:
        return value(start + part * (end - start))

    least = scipy.optimize.minimize_scalar(inside, bounds=(0.0, 1.0), method="bounded", options={"xatol": TURNS})
    return float(start + least.x * (end - start)), float(least.fun)


def _largest(values: Floats | Booleans) -> tuple[int, int]:
    side, joint = np.unravel_index(np.argmax(values), values.shape)
    return int(side), int(joint)
