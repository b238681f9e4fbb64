"""The measured frequency of one mode in the nonlinear motion.

A run starts in the shape of a mode with a largest angle a; the strongest line of the mode's own coordinate η
(`nonlinear.reduction.modal_coordinates`) is its frequency ω(a).

A lightly damped mode is measured on η exp(−Re λ t) and compared with Im λ.  Its amplitude decays during the run and its
frequency changes with it, so it is sampled evenly on a clock u that changes likewise, as far as κ describes it,

    du/dt = 1 + κ a² exp(2 Re λ t),

and the line belongs to the mean of a² exp(2 Re λ t), weighted as in `lines.attention`: the *effective* amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan, pi, sqrt

import numpy as np

from modal.errors import ComputationError
from modal.modes import Modes
from modal.types import Floats
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import PushingLink, attention, line, pushing_links
from nonlinear.reduction import along_rail, modal_motion, start_in_mode
from nonlinear.simulation import simulate

PERIODS = 40
SAMPLES = 16  # per period of the fastest mode, so that its overtones are not aliased
MOST_SAMPLES = 200_000
PRECISION = 1e-8  # tolerance of a run over its amplitude
TIGHTEST, LOOSEST = 1e-15, 1e-10  # limits of that tolerance
IRREGULAR = 1e-3  # relative error of a frequency beyond which the motion is irregular
NEWTON = 8


@dataclass(frozen=True)
class Measurement:
    """One run: the largest angle at release and its effective value (rad), and the measured frequency.

    `omega` in rad/s with its relative `error`, `shift` ω(a)/ω − 1 from the table, `outside` the largest fraction of
    the energy found in other modes; `pushing` are the links of bobs that push, where that can be told.
    """

    amplitude: float
    effective: float
    omega: float
    error: float
    shift: float
    outside: float
    pushing: tuple[PushingLink, ...] = ()

    @property
    def irregular(self) -> bool:
        """Whether the motion has no steady frequency."""
        return not self.error <= IRREGULAR


def measure_mode(
    modes: Modes, number: int, amplitude: float, periods: float = PERIODS, method: str = "auto"
) -> Measurement:
    """One run from rest in the shape of the mode with this index (from 0), its largest angle `amplitude` rad."""
    scene, value, copy = modes.scene, complex(modes.eigenvalue[number]), along_rail(modes, number)[0][0]
    count = min(MOST_SAMPLES, int(SAMPLES * periods * max(2.0, modes.omega.max() / value.imag)) + 1)
    kappa = modes[number].kappa
    bend = max(kappa * amplitude**2, -0.5) if isfinite(kappa) else 0.0
    times, clock = sampled(2 * pi * periods / value.imag, count, bend, 2 * value.real)
    trajectory = simulate(
        scene.in_plane,
        float(times[-1]),
        method=method,
        tolerance=float(np.clip(PRECISION * amplitude, TIGHTEST, LOOSEST)),
        output=times,
        start=start_in_mode(scene, modes, number, copy, amplitude),
    )
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    motion = modal_motion(trajectory.motion, modes, [number])
    at = motion.copy.tolist().index(copy)
    outside = float(np.clip(motion.share_outside(at).max(), 0.0, 1.0))
    pushing = pushing_in(trajectory)
    left = float(attention(count) @ np.exp(2 * value.real * times))
    try:
        fitted = line(clock, motion.coordinate[:, at] * np.exp(-value.real * times))
    except ComputationError:
        return Measurement(amplitude, amplitude * sqrt(left), nan, inf, nan, outside, pushing)
    omega = fitted.omega * (1 + bend * left if value.real else 1.0)
    error = fitted.relative_error + PRECISION
    return Measurement(amplitude, amplitude * sqrt(left), omega, error, omega / value.imag - 1, outside, pushing)


def pushing_in(trajectory: Trajectory) -> tuple[PushingLink, ...]:
    """The links of bobs that push in a run; none where that cannot be told."""
    try:
        return pushing_links(trajectory)
    except ComputationError:
        return ()


def sampled(duration: float, count: int, bend: float, rate: float) -> tuple[Floats, Floats]:
    """Times (count,) evenly spaced on the clock u = t + bend (exp(rate t) − 1)/rate, and u there; u = t for rate 0."""
    if not rate:
        return (even := np.linspace(0.0, duration, count)), even
    clock = np.linspace(0.0, duration + bend * np.expm1(rate * duration) / rate, count)
    times = clock * (duration / clock[-1])
    for _ in range(NEWTON):
        slow = times + bend * np.expm1(rate * times) / rate - clock
        times = np.clip(times - slow / (1 + bend * np.exp(rate * times)), 0.0, duration)
    times[[0, -1]] = 0.0, duration
    return times, clock
