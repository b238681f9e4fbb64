"""Averaged equations followed in time: which modes gain, which lose, and when one is left."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from scipy.integrate import solve_ivp

from modal.errors import ComputationError
from modal.rig import Booleans, Floats
from nonlinear.averaged import Averaged, Complexes

TOLERANCE, FAINTEST = 1e-7, 1e-11
PERIODS, LONGEST = 64, 200_000  # fast periods of the first part, and of all parts together
PER_PART = 400
CALM = 1e-3  # share of the energy that changes rows within half of the time where the motion has settled
DEAD = 1e-4  # of the first amplitude, where swinging dies out
LOCKED = 0.01  # share of the energy that all modes but one may hold


@dataclass(frozen=True, eq=False)
class SlowMotion:
    """Amplitudes z (C, T) at `times` (T,) in s, and whether nothing changes any more."""

    averaged: Averaged
    times: Floats
    z: Complexes
    settled: bool

    @cached_property
    def share(self) -> Floats:
        """Share of the energy in every row of the table, (R, T); all 0 where nothing moves."""
        energy = self.averaged.energies(self.z)
        whole = energy.sum(axis=0)
        return np.asarray(np.divide(energy, whole, out=np.zeros_like(energy), where=whole > 0))

    @property
    def dies(self) -> bool:
        """Whether no swing is left."""
        return bool(np.abs(self.z[:, -1]).max() <= DEAD * np.abs(self.z[:, 0]).max())

    @property
    def survivor(self) -> int:
        """The row that holds most at the end, from 0."""
        return int(self.share[:, -1].argmax())

    def locking_time(self, threshold: float = LOCKED) -> float | None:
        """When (s) all rows but the survivor fall below this share of the energy for good, None where they do not."""
        return below_for_good(self.times, 1 - self.share[self.survivor], threshold)


def below_for_good(times: Floats, values: Floats, threshold: float) -> float | None:
    """The last passage of values (T,) below the threshold, on the line between samples; None where they end above."""
    above = np.flatnonzero(values > threshold)
    if not len(above):
        return float(times[0])
    last = int(above[-1])
    if last == len(times) - 1:
        return None
    high, low = values[last], values[last + 1]
    return float(times[last] + (times[last + 1] - times[last]) * (high - threshold) / (high - low))


def settled(averaged: Averaged, starts: Complexes) -> tuple[SlowMotion, ...]:
    """From each of these amplitudes (C, S) until nothing changes anywhere, or for LONGEST periods."""
    period = 2 * pi / float(averaged.omega.min())
    times, z = _part(averaged, starts, 0.0, PERIODS * period)
    going = _going(averaged, z, starts)
    while going.any() and times[-1] < LONGEST * period:
        more, further = _part(averaged, z[..., -1], float(times[-1]), float(times[-1]))
        going = _going(averaged, further, starts)
        times, z = np.append(times, more[1:]), np.concatenate((z, further[..., 1:]), axis=-1)
    return tuple(SlowMotion(averaged, times, z[:, k], not going[k]) for k in range(starts.shape[1]))


def _part(averaged: Averaged, starts: Complexes, begin: float, duration: float) -> tuple[Floats, Complexes]:
    times = begin + np.linspace(0.0, duration, PER_PART + 1)
    shape, size = starts.shape, float(np.abs(starts).max()) or 1.0

    def rate(time: float, y: Floats) -> Floats:
        return averaged.flow(y.view(complex).reshape(shape)).ravel().view(float)

    y = np.ascontiguousarray(starts, dtype=complex).ravel().view(float)
    found = solve_ivp(rate, (times[0], times[-1]), y, "DOP853", times, rtol=TOLERANCE, atol=FAINTEST * size)
    if not found.success:
        raise ComputationError(f"averaged equations: {found.message}")
    return times, np.ascontiguousarray(found.y.T).view(complex).T.reshape(*shape, -1)


def _going(averaged: Averaged, z: Complexes, starts: Complexes) -> Booleans:
    """Which of the motions (C, S, T) still changes its energies in the last half and has not died out, (S,)."""
    energy = averaged.energies(z[..., z.shape[-1] // 2 :])
    changing = np.ptp(energy, axis=-1).max(axis=0) > CALM * energy.sum(axis=0).max(axis=-1)
    alive = np.abs(z[..., -1]).max(axis=0) > DEAD * np.abs(starts).max(axis=0)
    return np.asarray(changing & alive)
