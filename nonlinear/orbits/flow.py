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
from math import ceil, inf, isfinite
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Floats, Ints
from nonlinear.dynamics.dense import SINGULAR
from nonlinear.dynamics.generated import UNDEFINED, Listed
from nonlinear.dynamics.variational import Variational
from nonlinear.integration import Escaping, escaping
from nonlinear.integration.floats import Numbers, attempt_of
from nonlinear.integration.method import (
    FIFTH,
    NODES,
    POWER,
    ROWS,
    SAFETY,
    SHRINKS,
    STAGES,
    THIRD,
    Shares,
    controlled,
    steered,
)
from nonlinear.system import System

FIRST = 1 / 24  # the first step over the whole time
LEAST = 1e-12  # shortest step over the whole time
MOST = 20_000  # steps
SHARP = 1e-12  # last step to the time of a kick over the whole one
TOGETHER = 1e-11  # rad by which a kick may come early to coincide with another
STILL = 1e-3  # way of y in natural units, in a step in which it hardly moves
LOOSE = 100  # tolerances by which such a step may err in V
NEWTON = 8  # steps to the time of a kick
AT_ONCE = 1_000_000  # entries of J at the stages of steps that are taken together
Force = Callable[[float], Floats]


class Path(NamedTuple):
    """The ends of K steps: times (s), y and y' there, (K,) and (K, d); after a kick the same time once more."""

    times: Floats
    states: Floats
    rates: Floats


class Passed(NamedTuple):
    """The end of a flow: y (d,), V (d, m), the side of every escapement's next kick, and the path."""

    y: Floats
    V: Floats
    side: Floats
    path: Path


def _dense(rows: Sequence[Shares]) -> Floats:
    """Shares of the rates at the stages, row by row, (rows, STAGES)."""
    found = np.zeros((len(rows), STAGES))
    for own, row in zip(found, rows, strict=True):
        for stage, share in row:
            if stage < STAGES:
                own[stage] = share
    return found


SHARES = _dense(ROWS)
ERRORS = _dense((FIFTH, THIRD))


class Step(NamedTuple):
    """A step: its time (s) and length, y at its beginning and y' at every stage."""

    time: float
    length: float
    y: Numbers
    stages: Sequence[Numbers]


@dataclass(frozen=True, eq=False, repr=False)
class Flow(Displayed):
    """The flow of a system with this tolerance; `force` (n,) of the time acts from outside, in every coordinate.

    With a `change` δp of the numbers of its equations, (P,), V has a last column, the change of y with them.
    """

    system: System
    tolerance: float = 1e-12
    force: Force | None = None
    change: Floats | None = None
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
            new, stages, error, factor = self._attempt(start + time, here, rate, length)
            if not error < 1:
                length *= factor
                if length <= LEAST * whole:
                    break
                continue
            grown = length * factor
            met = None if side is None else self._met(start + time, here, rate, length, new, side)
            if met:
                length, joint = met
                if length:
                    new, stages, _, _ = self._attempt(start + time, here, rate, length)
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
        force, moved = self.force, self.equations.listed
        if force is None:
            return moved
        return lambda time, y: [*(moved(time, y) if moved else ()), *np.asarray(force(time), dtype=float).tolist()]

    @cached_property
    def _attempted(self) -> Callable[..., Any]:
        return attempt_of(self.equations.size, ", inputs(t + {} * h, z)" if self._listed else "")

    @cached_property
    def _smallest(self) -> list[float]:
        return [float(one) for one in self.tolerance * self.scale]

    def _attempt(
        self, time: float, y: Numbers, rate: Numbers, length: float
    ) -> tuple[Numbers, Sequence[Numbers], float, float]:
        """The end of one step, its stages, its error over the tolerance, and the next length over this one."""
        given = (self.equations.rate, length, y, rate, self.tolerance, self._smallest, time, self._listed)
        try:
            fifth, third, new, stages, _ = self._attempted(*given)
        except UNDEFINED:
            fifth, third, new, stages = inf, inf, y, ()
        if not isfinite(fifth + third):
            return y, (), inf, SHRINKS
        return new, stages, *controlled(fifth, third, length, len(y), False)

    def _carried(self, V: Floats, parts: Sequence[Step | Floats]) -> Floats:
        """V at the end of these steps and of the saltation matrices between them."""
        steps, size = [part for part in parts if isinstance(part, Step)], len(V)
        few = max(1, AT_ONCE // (STAGES * size**2))
        maps = (one for k in range(0, len(steps), few) for one in self._mapped(steps[k : k + few]))
        if self.change is not None:
            V = block_diag(V, 1.0)
        for part in parts:
            V = (next(maps) if isinstance(part, Step) else part) @ V
        return V[:size]

    def _mapped(self, steps: Sequence[Step]) -> Floats:
        """What each of these steps does to V, (N, d, d).

        Where y hardly moves, as at an unstable equilibrium, its error says nothing of V: a step that errs in V is
        divided.
        """
        maps, errors = self._maps(steps)
        for k, error in errors.items():
            if error <= LOOSE:
                continue
            parts = ceil(min(error / LOOSE, 1e8) ** -POWER / SAFETY) + 1
            whole = np.eye(maps.shape[-1])
            for one in self._mapped(self._divided(steps[k], parts)):
                whole = one @ whole
            maps[k] = whole
        return maps

    def _divided(self, step: Step, parts: int) -> list[Step]:
        """The same step in equal parts."""
        found, y, length = list[Step](), step.y, step.length / parts
        if step.time + length == step.time:
            raise ComputationError("the derivatives of the motion cannot be followed over a period")
        for k in range(parts):
            time = step.time + k * length
            end, stages, _, _ = self._attempt(time, y, self._rate(time, y), length)
            found.append(Step(time, length, y, stages))
            y = end
        return found

    def _maps(self, steps: Sequence[Step]) -> tuple[Floats, dict[int, float]]:
        """What each of these steps does to V, (N, d, d), and the errors over the tolerance of those where y is still.

        With y of every stage known, J of all of them is computed at once.
        """
        times, lengths = (np.array([getattr(step, name) for step in steps]) for name in ("time", "length"))
        begun, stages = np.array([step.y for step in steps]).T, np.array([step.stages for step in steps])
        many, size = len(steps), len(begun)
        inner = lengths[:, None] * np.tensordot(SHARES[:STAGES], stages[:, :STAGES], (1, 1)).transpose(2, 1, 0)
        y, u = (begun[..., None] + inner).reshape(size, -1), np.empty((0, many * STAGES))
        if self._listed:
            at = times[:, None] + lengths[:, None] * np.array(NODES[:STAGES])
            u = np.array([self._listed(time, ()) for time in at.ravel().tolist()]).T
        J = self.equations.linearized(y, u)[1]
        if self.change is not None:
            size += 1
            J = np.pad(J, ((0, 0), (0, 1), (0, 1)))
            J[:, :-1, -1] = self.equations.moved_by(self.change, y, u).T
        J = J.reshape(many, STAGES, size, size) * lengths[:, None, None, None]
        K, own = np.empty((STAGES, many, size, size)), np.eye(size)
        flat = K.reshape(STAGES, -1)
        for stage in range(STAGES):
            K[stage] = J[:, stage] @ (own + (SHARES[stage, :stage] @ flat[:stage]).reshape(many, size, size))
        ends = own + (SHARES[STAGES] @ flat).reshape(many, size, size)
        ways = lengths * (np.abs(stages).max(1) / self.scale).max(1)
        still = np.flatnonzero(ways < STILL)
        return np.asarray(ends), dict(zip(still.tolist(), self._missed(K[:, still]).tolist(), strict=True))

    def _missed(self, K: Floats) -> Floats:
        """The errors (N,) over the tolerance, in natural units, of steps with these changes at the stages."""
        size = len(self.scale)
        K = K[..., :size, :size]
        stages, many = K.shape[:2]
        errors = (ERRORS @ K.reshape(stages, -1)).reshape(2, many, size, size) * (self.scale / self.scale[:, None])
        fifth, third = (errors**2).sum((2, 3)) / (size * self.tolerance**2)
        return steered(fifth, third, np.ones(many), size, False)[0]

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
