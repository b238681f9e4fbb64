"""The flow of the equations of motion with its derivative by the start: DOP853 for y and the variational equations.

    y' = f(y),   V' = J(y) V

Both take the same steps, whose length the error of y controls: y goes first, in floats, and what every step does to V
follows for many steps at once.  A kick of an escapement comes where a joint passes its
angle, g(y) = 0, and is met by a step that ends there.  It carries y to G(y), and V by the saltation matrix

    S = DG + (f₊ − DG f₋) nᵀ / (nᵀ f₋),   n = ∇g

(Leine & Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from math import isfinite, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Floats, Ints
from nonlinear.dynamics.dense import SINGULAR
from nonlinear.dynamics.generated import UNDEFINED, Listed
from nonlinear.dynamics.variational import Variational
from nonlinear.integration import Escaping, escaping
from nonlinear.integration.floats import Numbers, attempt_of
from nonlinear.orbits.steps import (
    FIRST,
    GROWS,
    LEAST,
    MOST,
    SAFETY,
    SHARES,
    SHARP,
    SHRINKS,
    STAGES,
    TOGETHER,
    WEIGHTS,
    Passed,
    Path,
)
from nonlinear.system import System

NEWTON = 8  # steps to the time of a kick
AT_ONCE = 1_000_000  # entries of J at the stages of steps that are taken together
Force = Callable[[float], Floats]


class Step(NamedTuple):
    """A step: its time (s) and length, y at its beginning and y' at every stage."""

    time: float
    length: float
    y: Numbers
    stages: Sequence[Numbers]


@dataclass(frozen=True, eq=False, repr=False)
class Flow(Displayed):
    """The flow of a system with this tolerance; `force` (n,) of the time acts from outside, in every coordinate."""

    system: System
    tolerance: float = 1e-12
    force: Force | None = None
    equations: Variational = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "equations", Variational(self.system, pushed=self.force is not None))

    def __getstate__(self) -> dict[str, Any]:
        """Without what has been derived: functions that are written cannot be pickled."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def scale(self) -> Floats:
        """Natural units of y, (d,)."""
        return self.equations.scale

    @cached_property
    def joints(self) -> Escaping | None:
        """The joints with escapements."""
        return escaping(self.system) if self.system.kicked else None

    @cached_property
    def rest(self) -> Floats:
        """The equilibrium, (n,)."""
        return np.concatenate((np.zeros(int(self.equations.layout.on_cart)), self.system.rest))

    def __call__(self, y: Floats, V: Floats, whole: float, side: Floats | None = None, start: float = 0.0) -> Passed:
        """The end of a motion from y, with V carried along; `side` (J,) as in `Escapements`."""
        here, time, length = y.tolist(), 0.0, whole * FIRST
        side = self.sides(y) if side is None and self.joints else side
        rate = self._rate(start, here)
        kept, carried = [(0.0, here, rate)], list[Step | Floats]()
        for _ in range(MOST):
            length = min(length, whole - time)
            if length <= LEAST * whole:
                times, states, rates = map(np.array, zip(*kept, strict=True))
                ended = self._carried(V, carried) if V.shape[1] else V
                return Passed(states[-1], ended, side if side is not None else np.empty(0), Path(times, states, rates))
            new, stages, error = self._attempt(start + time, here, rate, length)
            if not error < 1:
                length *= max(SHRINKS, SAFETY * error ** (-1 / 8)) if isfinite(error) else SHRINKS
                if length <= LEAST * whole:
                    break
                continue
            grown = length * (min(GROWS, SAFETY * error ** (-1 / 8)) if error else GROWS)
            met = None if side is None else self._met(start + time, here, rate, length, new, side)
            if met:
                length, joint = met
                if length:
                    new, stages, _ = self._attempt(start + time, here, rate, length)
                    carried.append(Step(start + time, length, here, stages))
                    time, here, rate = time + length, new, stages[-1]
                kept.append((time, here, rate))
                assert side is not None
                here, rate, S, side = self._kicked(start + time, here, rate, joint, side)
                carried.append(S)
            else:
                carried.append(Step(start + time, length, here, stages))
                time, here, rate = time + length, new, stages[-1]
            kept.append((time, here, rate))
            length = grown
        raise ComputationError("the motion takes too many steps to be followed over a period")

    def _rate(self, time: float, y: Numbers) -> Numbers:
        try:
            return self.equations.rate(y, self._listed(time, y) if self._listed else ())
        except UNDEFINED:
            raise ComputationError(SINGULAR) from None

    @cached_property
    def _listed(self) -> Listed | None:
        """The inputs u at a time (s)."""
        force = self.force
        return None if force is None else lambda time, y: np.asarray(force(time), dtype=float).tolist()

    @cached_property
    def _attempted(self) -> Callable[..., Any]:
        return attempt_of(self.equations.size, ", inputs(t + {} * h, z)" if self.force else "")

    @cached_property
    def _smallest(self) -> list[float]:
        return [float(one) for one in self.tolerance * self.scale]

    def _attempt(
        self, time: float, y: Numbers, rate: Numbers, length: float
    ) -> tuple[Numbers, Sequence[Numbers], float]:
        """The end of one step, its stages and its error over the tolerance."""
        given = (self.equations.rate, length, y, rate, self.tolerance, self._smallest, time, self._listed)
        try:
            fifth, third, new, stages = self._attempted(*given)
        except UNDEFINED:
            return y, (), nan
        both = fifth + 0.01 * third
        return new, stages, length * fifth / sqrt(both * len(y)) if both else 0.0

    def _carried(self, V: Floats, parts: Sequence[Step | Floats]) -> Floats:
        """V at the end of these steps and of the saltation matrices between them."""
        steps, size = [part for part in parts if isinstance(part, Step)], len(V)
        few = max(1, AT_ONCE // (STAGES * size**2))
        maps = (one for k in range(0, len(steps), few) for one in self._maps(steps[k : k + few]))
        for part in parts:
            V = (next(maps) if isinstance(part, Step) else part) @ V
        return V

    def _maps(self, steps: Sequence[Step]) -> Floats:
        """What each of these steps does to V, (N, d, d): with y of every stage known, J of all of them at once."""
        times, lengths = (np.array([getattr(step, name) for step in steps]) for name in ("time", "length"))
        begun, stages = np.array([step.y for step in steps]).T, np.array([step.stages for step in steps])
        many, size = len(steps), len(begun)
        inner = lengths[:, None] * np.tensordot(DOP853.A[:STAGES, :STAGES], stages[:, :STAGES], (1, 1)).transpose(
            2, 1, 0
        )
        y, u = (begun[..., None] + inner).reshape(size, -1), np.empty((0, many * STAGES))
        if self._listed:
            at = times[:, None] + lengths[:, None] * DOP853.C[:STAGES]
            u = np.array([self._listed(time, ()) for time in at.ravel().tolist()]).T
        J = self.equations.linearized(y, u)[1].reshape(many, STAGES, size, size) * lengths[:, None, None, None]
        K, own = np.empty((STAGES, many, size, size)), np.eye(size)
        flat = K.reshape(STAGES, -1)
        for stage in range(STAGES):
            K[stage] = J[:, stage] @ (own + (SHARES[stage] @ flat[:stage]).reshape(many, size, size))
        return np.asarray(own + (WEIGHTS @ flat).reshape(many, size, size))

    # ------------------------------------------------------------------------------------------------------- kicks

    def sides(self, y: Floats) -> Floats:
        """The side of every escapement's next kick, by which side its joint is on or moves to."""
        gamma, speed = self._gamma(y), self._gamma(y, rate=True)
        assert self.joints is not None
        beyond = np.abs(gamma) > self.joints.angle
        return np.where(beyond, -np.sign(gamma), np.where(speed, np.sign(speed), -np.sign(gamma)))

    def _gamma(self, y: Floats, *, rate: bool = False) -> Floats:
        layout, joints = self.equations.layout, self.joints
        assert joints is not None
        first = layout.half * rate + int(layout.on_cart)
        return joints.gamma(y[first : layout.half * (1 + rate)], 0.0 if rate else joints.bent)

    def _over(self, y: Floats, side: Floats) -> Floats:
        assert self.joints is not None
        return side * self._gamma(y) - self.joints.angle

    def _met(
        self, time: float, y: Numbers, rate: Numbers, length: float, new: Numbers, side: Floats
    ) -> tuple[float, int] | None:
        """The first kick within a step: the length of the step to it and the joint."""
        now = np.array(y)
        before, after = self._over(now, side), self._over(np.array(new), side)
        due = np.flatnonzero((before >= -TOGETHER) & (side * self._gamma(now, rate=True) > 0))
        if len(due):
            return 0.0, int(due[0])
        crossed = np.flatnonzero(after > 0)
        return self._root(time, y, rate, length, new, side, crossed) if len(crossed) else None

    def _root(
        self, time: float, y: Numbers, rate: Numbers, length: float, new: Numbers, side: Floats, crossed: Ints
    ) -> tuple[float, int]:
        """The length of the step to the first of these crossings, and its joint: Newton's method, else bisection."""

        def at(part: float) -> Floats:
            return np.array(self._attempt(time, y, rate, part)[0] if part else y)

        before, after = (self._over(np.array(row), side)[crossed] for row in (y, new))
        part = length * float(np.min(before / np.minimum(before - after, -1e-300)))
        for _ in range(NEWTON):
            if not 0 < part < length:
                break
            end = at(part)
            over = self._over(end, side)[crossed]
            first = int(over.argmax())
            step = over[first] / (side[crossed] * self._gamma(end, rate=True)[crossed])[first]
            part -= float(step)
            if abs(step) < SHARP * length:
                return part, int(crossed[first])
        part = float(brentq(lambda part: float(self._over(at(part), side)[crossed].max()), 0.0, length, xtol=1e-16))
        return part, int(crossed[self._over(at(part), side)[crossed].argmax()])

    def _kicked(
        self, time: float, y: Numbers, rate: Numbers, joint: int, side: Floats
    ) -> tuple[Numbers, Numbers, Floats, Floats]:
        """Y and y' after a kick, the saltation matrix, and the sides of the next kicks."""
        joints, layout = self.joints, self.equations.layout
        assert joints is not None
        first, impulse, n = int(layout.on_cart), np.zeros(layout.half), np.zeros(layout.size)
        for link, sign in ((joints.below[joint], 1.0), (joints.above[joint], -1.0)):
            if link >= 0:
                impulse[first + link], n[first + link] = sign * side[joint] * joints.impulse[joint], sign
        jump, slope = self.equations.struck(np.array(y), impulse)
        after = (y + jump).tolist()
        G, f, f_after = np.eye(layout.size) + slope, np.array(rate), self._rate(time, after)
        turned = side.copy()
        turned[joint] = -side[joint]
        return after, f_after, G + np.outer(f_after - G @ f, n) / (n @ f), turned
