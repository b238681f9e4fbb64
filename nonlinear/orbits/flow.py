"""The flow of the equations of motion with its derivative by the start: DOP853 for y and the variational equations.

    y' = f(y),   V' = J(y) V

Both take the same steps, whose length the error of y controls.  A kick of an escapement comes where a joint passes its
angle, g(y) = 0, and is met by a step that ends there.  It carries y to G(y), and V by the saltation matrix

    S = DG + (f₊ − DG f₋) nᵀ / (nᵀ f₋),   n = ∇g

(Leine & Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as File

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Floats, Ints
from nonlinear.dynamics.variational import Variational
from nonlinear.integration import Escaping, escaping
from nonlinear.integration.costs import cached
from nonlinear.orbits.steps import (
    ERRORS,
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
MANY = 6  # links from which on the kernel is worth compiling
KERNELS = File(__file__).parent / "compiled.py"
Force = Callable[[float], Floats]


@dataclass(frozen=True, eq=False, repr=False)
class Flow(Displayed):
    """The flow of a system with this tolerance; `force` (n,) of the time acts from outside, in every coordinate."""

    system: System
    tolerance: float = 1e-12
    force: Force | None = None
    fast: bool | None = None
    equations: Variational = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "equations", Variational(self.system))

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

    @cached_property
    def compiled(self) -> bool:
        """Whether steps are compiled, unless `fast` says so.

        They are where numba is installed and either has the kernel in its cache or there are so many links that
        compiling it, which takes some twenty seconds once, is worth it.
        """
        if self.force is not None or self.fast is False:
            return False
        from modal.eigen.compiling import available

        return available() and bool(self.fast or self.system.n_links >= MANY or cached(KERNELS, "_flow"))

    def __call__(self, y: Floats, V: Floats, time: float, side: Floats | None = None, start: float = 0.0) -> Passed:
        """The end of a motion from y, with V carried along; `side` (J,) as in `Escapements`."""
        if self.compiled:
            from nonlinear.orbits.compiled import passed

            side = self.sides(y) if side is None and self.joints else side
            return passed(self.equations, y, V, time, self.tolerance, self.scale, self.joints, side)
        return self._plain(y, V, time, side, start)

    def _plain(self, y: Floats, V: Floats, whole: float, side: Floats | None, start: float) -> Passed:
        Z, time, length = np.column_stack((y, V)), 0.0, whole * FIRST
        K = np.empty((STAGES + 1, *Z.shape))
        K[0] = self._rate(start, Z)
        side = self.sides(y) if side is None and self.joints else side
        kept = [(0.0, Z[:, 0], K[0, :, 0])]
        for _ in range(MOST):
            length = min(length, whole - time)
            if length <= LEAST * whole:
                times, states, rates = map(np.array, zip(*kept, strict=True))
                return Passed(Z[:, 0], Z[:, 1:], side if side is not None else np.empty(0), Path(times, states, rates))
            new, error = self._attempt(start + time, Z, K, length)
            if not error < 1:
                length *= max(SHRINKS, SAFETY * error ** (-1 / 8)) if np.isfinite(error) else SHRINKS
                continue
            grown = length * (min(GROWS, SAFETY * error ** (-1 / 8)) if error else GROWS)
            if side is not None and (met := self._met(start + time, Z, K, length, new, side)):
                length, new, joint = met
                time, Z = time + length, new
                kept.append((time, Z[:, 0], self._rate(start + time, Z)[:, 0]))
                Z, side = self._kicked(start + time, Z, joint, side)
                K[0] = self._rate(start + time, Z)
            else:
                time, Z, K[0] = time + length, new, K[STAGES].copy()
            kept.append((time, Z[:, 0], K[0, :, 0].copy()))
            length = grown
        raise ComputationError("the motion takes too many steps to be followed over a period")

    def _rate(self, time: float, Z: Floats) -> Floats:
        rate, slope = self.equations.linearized(Z[:, 0], self.force(time) if self.force else None)
        return np.column_stack((rate, slope @ Z[:, 1:]))

    def _attempt(self, time: float, Z: Floats, K: Floats, length: float) -> tuple[Floats, float]:
        """The end of one step and its error over the tolerance."""
        flat = K.reshape(STAGES + 1, -1)
        for stage in range(1, STAGES):
            K[stage] = self._rate(
                time + length * DOP853.C[stage], Z + length * (SHARES[stage] @ flat[:stage]).reshape(Z.shape)
            )
        new = Z + length * (WEIGHTS @ flat[:STAGES]).reshape(Z.shape)
        K[STAGES] = self._rate(time + length, new)
        allowed = self.tolerance * (self.scale + np.maximum(np.abs(Z[:, 0]), np.abs(new[:, 0])))
        fifth, third = np.sum((np.tensordot(ERRORS, K[:, :, 0], 1) / allowed) ** 2, axis=1)
        both = fifth + 0.01 * third
        return new, float(length * fifth / np.sqrt(both * len(Z))) if both else 0.0

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
        self, time: float, Z: Floats, K: Floats, length: float, new: Floats, side: Floats
    ) -> tuple[float, Floats, int] | None:
        """The first kick within a step: the length of the step to it, Z there and the joint."""
        before, after = self._over(Z[:, 0], side), self._over(new[:, 0], side)
        due = np.flatnonzero((before >= -TOGETHER) & (side * self._gamma(Z[:, 0], rate=True) > 0))
        if len(due):
            return 0.0, Z, int(due[0])
        crossed = np.flatnonzero(after > 0)
        if not len(crossed):
            return None
        part, joint = self._root(time, Z, K, length, new, side, crossed)
        return part, self._attempt(time, Z, K, part)[0], joint

    def _root(
        self, time: float, Z: Floats, K: Floats, length: float, new: Floats, side: Floats, crossed: Ints
    ) -> tuple[float, int]:
        """The length of the step to the first of these crossings, and its joint: Newton's method, else bisection."""
        y, work = Z[:, :1], np.ascontiguousarray(K[:, :, :1])

        def at(part: float) -> Floats:
            return self._attempt(time, y, work, part)[0][:, 0] if part else y[:, 0]

        before, after = (self._over(row[:, 0], side)[crossed] for row in (Z, new))
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

    def _kicked(self, time: float, Z: Floats, joint: int, side: Floats) -> tuple[Floats, Floats]:
        """Z after a kick, and the sides of the next ones."""
        joints, layout = self.joints, self.equations.layout
        assert joints is not None
        first, impulse, n = int(layout.on_cart), np.zeros(layout.half), np.zeros(layout.size)
        for link, sign in ((joints.below[joint], 1.0), (joints.above[joint], -1.0)):
            if link >= 0:
                impulse[first + link], n[first + link] = sign * side[joint] * joints.impulse[joint], sign
        jump, slope = self.equations.struck(Z[:, 0], impulse)
        after, G = Z[:, 0] + jump, np.eye(layout.size) + slope
        outside = self.force(time) if self.force else None
        f, f_after = (self.equations.linearized(y, outside)[0] for y in (Z[:, 0], after))
        S = G + np.outer(f_after - G @ f, n) / (n @ f)
        turned = side.copy()
        turned[joint] = -side[joint]
        return np.column_stack((after, S @ Z[:, 1:])), turned
