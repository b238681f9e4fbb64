"""A periodic orbit: its start, period and multipliers, and what is read off it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from modal.report import Displayed, Summary
from modal.scene import Scene, name_of
from modal.types import Floats
from nonlinear.dynamics import Mechanics
from nonlinear.orbits.floquet import Floquet
from nonlinear.orbits.flow import Flow, Path
from nonlinear.system import Motion, State

LOOKS = 8  # points in every step among which the largest angle is searched
NEARLY = 0.99  # of the largest sample, from which on a step may hold the largest angle


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Displayed):
    """A motion of `scene` that begins at y and closes after `period` (s), but for `residual` in natural units.

    `value` is that of the number along which it was continued, if any; `path` covers the period, or where `symmetric`
    its first quarter.
    """

    scene: Scene = field(repr=False)
    flow: Flow = field(repr=False)
    y: Floats
    period: float
    floquet: Floquet
    residual: float
    path: Path = field(repr=False)
    symmetric: bool
    value: float | None = None

    @property
    def omega(self) -> float:
        """Frequency (rad/s)."""
        return 2 * np.pi / self.period

    @property
    def is_stable(self) -> bool:
        """Whether disturbances do not grow."""
        return self.floquet.is_stable

    @property
    def state(self) -> State:
        """The start."""
        return self.flow.equations.layout.state(self.y)

    @cached_property
    def energy(self) -> float:
        """Energy (J) at the start, from that of the equilibrium."""
        return float(Mechanics(self.flow.system, self.motion(self.y[None])).energy[0])

    @cached_property
    def amplitude(self) -> float:
        """The largest angle (rad) of any link from its equilibrium over the period."""
        return float(self.amplitudes.max())

    @cached_property
    def amplitudes(self) -> Floats:
        """The largest angle (rad) of every link from its equilibrium over the period, (L,)."""
        half, first = self.flow.equations.layout.half, int(self.flow.equations.layout.on_cart)
        times, states, rates = self.path
        at = slice(first, half)
        fast = slice(half + first, 2 * half)
        turned = states[:, at] - self.flow.system.rest
        return largest(times, turned, states[:, fast], rates[:, fast])

    def _summary(self) -> Summary:
        facts = [
            ("largest angle", f"{np.degrees(self.amplitude):.5g}°"),
            ("period", f"{self.period:.6g} s"),
            ("energy", f"{self.energy:.6g} J"),
            ("closes to", f"{self.residual:.0e}"),
        ]
        stable = "stable" if self.is_stable else "unstable"
        return Summary(f"Periodic orbit of {name_of(self.scene)}: {self.omega:.6g} rad/s, {stable}", facts)

    def motion(self, rows: Floats) -> Motion:
        """The motion in vectors y (T, d)."""
        return self.flow.equations.layout.read(rows)

    def sampled(self, times: Floats) -> Floats:
        """The vectors y (T, d) at ascending times (s), none of them negative."""
        found, y, now = [], self.y, 0.0
        state: list[float] | None = None
        for time in times.tolist():
            if time > now:
                y, _, state, _ = self.flow(y, np.zeros((len(y), 0)), time - now, state, now)
                now = time
            found.append(y)
        return np.array(found)


def largest(times: Floats, x: Floats, v: Floats, a: Floats) -> Floats:
    """The largest |x| (L,) of curves through x with slopes v and curvatures a, (K, L), quintic between the times."""
    h = np.diff(times)[:, None]
    kept = h[:, 0] > 0
    h = h[kept]
    x0, x1, v0, v1 = x[:-1][kept], x[1:][kept], v[:-1][kept] * h, v[1:][kept] * h
    a0, a1 = a[:-1][kept] * h**2, a[1:][kept] * h**2
    d, m, e = x1 - x0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    powers = np.array([x0, v0, a0 / 2, 10 * d - 4 * m + e / 2, -15 * d + 7 * m - e, 6 * d - 3 * m + e / 2])
    looks = np.linspace(0, 1, LOOKS + 1)[:, None] ** np.arange(6)
    samples = np.abs(np.tensordot(looks, powers, 1))
    found = samples.max(axis=(0, 1))
    tall = samples.max(axis=0)
    for step, link in zip(*np.nonzero(tall >= NEARLY * found), strict=True):
        curve = np.polynomial.Polynomial(powers[:, step, link])
        turns = curve.deriv().roots()
        turns = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0) & (turns.real < 1)]
        found[link] = max([found[link], *np.abs(curve(turns))])
    return np.asarray(found)
