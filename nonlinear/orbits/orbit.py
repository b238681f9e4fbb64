"""A periodic orbit: its start, period and multipliers, and derived quantities."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from modal.report import Displayed, Summary
from modal.scene import Scene, name_of, sines_of
from modal.types import Floats
from nonlinear.dynamics import Mechanics
from nonlinear.dynamics.minimal import drained_power
from nonlinear.integration.within import between_samples, quintic
from nonlinear.orbits.floquet import Floquet
from nonlinear.orbits.flow import Flow, Path
from nonlinear.system import Motion, State

CYCLE_SAMPLES = 128
"""Cost: samples of a cycle of the drives, whose means converge faster than any power of it; benchmarks/orbits.py."""
STEP_SAMPLES = 8
"""Cost: points in every step among which the largest angle is searched; benchmarks/orbits.py."""
PEAK_RATIO = 0.99
"""Tolerance: of the largest sample, from which on a step may hold the largest angle: samples miss less than 1 %."""
FUNDAMENTAL_RATIO_MIN = 1e-2
"""Tolerance: of the largest angle, below which a fundamental is taken for none, so that its phase says nothing."""
ORBIT_RESIDUAL_MAX = 1e-9
"""Tolerance: how far an orbit may miss its start, in natural units, and a largest angle (rad) that is none:
integration leaves 1e-11, a wrong solution 1."""
MIRROR_GAP_MAX = 1e-4
"""Tolerance: of the largest angle, by which a symmetric motion may miss its mirror image: by interpolation in steps."""


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Displayed):
    """A motion of `scene` that begins at y and closes after `period` (s) up to `residual` in natural units.

    `value` is that of the number along which it was continued, if any; `path` covers the period, or where `symmetric`
    its first quarter, or its first half where it comes to rest at both ends of that. A forced motion has so many
    `cycles` of its drives in it, and links gain `turns` full turns.
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
    cycles: int = 0
    turns: tuple[int, ...] = ()

    @property
    def omega(self) -> float:
        """Frequency (rad/s)."""
        return 2 * np.pi / self.period

    @property
    def is_stable(self) -> bool:
        """Whether perturbations do not grow."""
        return self.floquet.is_stable

    @property
    def state(self) -> State:
        """The start."""
        return self.flow.equations.layout.state(self.y)

    @cached_property
    def energy(self) -> float:
        """Energy (J) at the start, above that of vertical links; without that of constant forces."""
        return float(Mechanics(self.flow.system, self.motion(self.y[None])).energy[0])

    @cached_property
    def amplitude(self) -> float:
        """The largest angle (rad) of any link over the period, from where it hangs or stands straight."""
        return float(self.amplitudes.max())

    @cached_property
    def amplitudes(self) -> Floats:
        """The largest angle (rad) of every link over the period, (L,)."""
        half, first = self.flow.equations.layout.half, self.flow.equations.layout.first
        times, states, rates = self.path
        at = slice(first, half)
        fast = slice(half + first, 2 * half)
        angles = states[:, at] - self.flow.system.rest
        return largest(times, angles, states[:, fast], rates[:, fast])

    @cached_property
    def phases(self) -> Floats:
        """By how much the fundamental of every link is ahead of the first drive (rad), (L,), in −π to π.

        The fundamental of an angle θ of a forced motion is the part of θ at the frequency ω of the drive: with c = 2/T
        ∫ θ e^(−iωt) dt it is |c| cos(ωt + arg c), and the drive's A sin(ωt + φ) is ahead by nothing of itself. NaN if
        it is less than 1 % of the largest angle, as in a motion of twice the drive's period.
        """
        drive = next(iter(sines_of(self.scene).values()))
        times, q, _ = self._samples
        angles = q[:, self.flow.equations.layout.first :]
        if any(self.turns):
            angles = angles - 2 * np.pi * np.outer(times / self.period, self.turns)
        c = np.exp(-2j * np.pi * drive.frequency_hz * times) @ angles
        heard = 2 * np.abs(c) / len(times) > np.maximum(FUNDAMENTAL_RATIO_MIN * self.amplitudes, ORBIT_RESIDUAL_MAX)
        return np.where(heard, np.angle(1j * c * np.exp(-1j * np.radians(drive.phase_deg))), np.nan)

    @property
    def phase(self) -> float:
        """The phase of the link with the largest angle (rad)."""
        return float(self.phases[self.amplitudes.argmax()])

    @cached_property
    def fed(self) -> float:
        """The energy (J) that the drives of a forced motion feed in a period, which dampers and drag take."""
        times, q, v = self._samples
        moving = self.flow.system.support
        support = (0.0, 0.0) if moving is None else tuple(moving.velocities(times, 2).T)
        return 0.0 - float(drained_power(self.flow.system, q.T, v.T, (support[0], support[1])).mean()) * self.period

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether a forced motion is its own mirror image half a cycle of the drives later."""
        angles = self._samples[1][:, self.flow.equations.layout.first :] - self.flow.system.rest
        later = np.roll(angles, CYCLE_SAMPLES // 2, axis=0)
        return not any(self.turns) and bool(np.abs(angles + later).max() < MIRROR_GAP_MAX * np.abs(angles).max())

    @property
    def coordinates(self) -> Floats:
        """The coordinates q (N, n) at even times of a period, CYCLE_SAMPLES a cycle of the drives."""
        return self._samples[1]

    @cached_property
    def _samples(self) -> tuple[Floats, Floats, Floats]:
        """Times (N,) of a period, CYCLE_SAMPLES a cycle of the drives, with q and v there, (N, n)."""
        half, count = self.flow.equations.layout.half, CYCLE_SAMPLES * max(self.cycles, 1)
        times = np.asarray(np.arange(count) * (self.period / count), dtype=float)
        ends, states, rates = self.path
        return times, *between_samples(ends, states[:, :half], states[:, half:], rates[:, half:], times)

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

    def states_at(self, times: Floats) -> Floats:
        """The vectors y (T, d) at ascending times (s), none of them negative."""
        rows, y, now = [], self.y, 0.0
        state: list[float] | None = None
        for time in times.tolist():
            if time > now:
                y, _, state, _ = self.flow(y, np.zeros((len(y), 0)), time - now, state, now)
                now = time
            rows.append(y)
        return np.array(rows)


def largest(times: Floats, x: Floats, v: Floats, a: Floats) -> Floats:
    """The largest |x| (L,) of curves through x with slopes v and curvatures a, (K, L), quintic between the times."""
    h = np.diff(times)[:, None]
    has_length = h[:, 0] > 0
    h = h[has_length]
    powers = quintic(h, *(part[has_length] for values in (x, v, a) for part in (values[:-1], values[1:])))
    looks = np.linspace(0, 1, STEP_SAMPLES + 1)[:, None] ** np.arange(6)
    samples = np.abs(np.tensordot(looks, powers, 1))
    angles = samples.max(axis=(0, 1))
    tall = samples.max(axis=0)
    for step, link in zip(*np.nonzero(tall >= PEAK_RATIO * angles), strict=True):
        curve = np.polynomial.Polynomial(powers[:, step, link])
        turns = curve.deriv().roots()
        turns = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0) & (turns.real < 1)]
        angles[link] = max([angles[link], *np.abs(curve(turns))])
    return np.asarray(angles)
