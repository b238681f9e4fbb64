"""Where a fit begins: states from the first samples of every segment, numbers from the lines of the spectrum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.identification import Parameter, numbers_at, scene_with, starts_of
from modal.modes import natural_modes
from modal.scene import Scene
from modal.types import Floats
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.records import Recording

PERIOD_PART = 0.75
"""Cost: periods of sqrt(l/g) in which no motion loses step with its record, the first part that is fitted."""
START_DURATION = 0.4
"""Cost: of sqrt(l/g), the samples that a state is read from, by a parabola."""
SPECTRUM_PADDING = 8
"""Tolerance: length of a spectrum over that of its segment: a peak is within a sixteenth of a bin of its line."""
PEAK_POWER_MIN = 0.02
"""Tolerance: part of the highest peak's power that counts as a line: less may be a harmonic."""
START_FREQUENCY_ERROR_MAX = 0.08
"""Cost: relative error of a frequency beyond which the numbers are first fitted to the lines."""


def initial_states(problem: FitProblem) -> Floats:
    """The states (S, width) at the beginning of every segment, by a parabola through each sensor's first samples."""
    coordinates = problem.coordinates
    picks, back = problem.picks, np.linalg.pinv(problem.picks)
    rest = np.concatenate((np.zeros(problem.system.first), problem.system.rest))
    states = np.zeros((len(problem.recording.segments), 2 * coordinates))
    duration = START_DURATION / problem.system.rate
    for s, segment in enumerate(problem.recording.segments):
        values, rates = [], []
        for readings in segment.values.T:
            is_present = np.isfinite(readings)
            times, numbers = segment.times[is_present] - segment.times[0] + problem.late, readings[is_present]
            last = max(duration + problem.late, times[min(5, len(times) - 1)]) if len(times) else 0.0
            is_early = times <= last
            order = min(2, int(np.count_nonzero(is_early)) - 1)
            curve = np.polynomial.Polynomial.fit(times[is_early], numbers[is_early], order) if order >= 0 else None
            values.append(float(curve(0.0)) if curve else 0.0)
            rates.append(float(curve.deriv()(0.0)) if curve and order else 0.0)
        states[s, :coordinates] = rest + back @ (np.array(values) - picks @ rest)
        states[s, coordinates:] = back @ np.array(rates)
    return states


def spectral_lines(recording: Recording) -> Floats:
    """Angular frequencies (rad/s) of the lines in a recording, ascending."""
    longest = max(segment.times[-1] - segment.times[0] for segment in recording.segments)
    step = min(float(np.median(np.diff(segment.times))) for segment in recording.segments)
    count = int(2 ** np.ceil(np.log2(SPECTRUM_PADDING * longest / step)))
    frequency = 2 * np.pi * np.fft.rfftfreq(count, step)
    power = np.zeros(len(frequency))
    for segment in recording.segments:
        grid = np.arange(segment.times[0], segment.times[-1], step)
        for readings in segment.values.T:
            is_present = np.isfinite(readings)
            if np.count_nonzero(is_present) > 3:
                even_values = np.interp(grid, segment.times[is_present], readings[is_present])
                window = np.hanning(len(grid))
                spectrum = np.fft.rfft((even_values - even_values.mean()) * window, count)
                power += np.abs(spectrum) ** 2
    peaks, _ = scipy.signal.find_peaks(
        power, height=PEAK_POWER_MIN * power.max(), prominence=PEAK_POWER_MIN * power.max()
    )
    is_line = frequency[peaks] > 2 * np.pi / longest
    return np.asarray(frequency[peaks][is_line])


def starting_numbers(scene: Scene, parameters: Sequence[Parameter], recording: Recording) -> Floats:
    """The z of numbers whose frequencies are those of the spectrum; the scene's own where these are near already."""
    z0, lines = starts_of(parameters), spectral_lines(recording)
    movable = [k for k, parameter in enumerate(parameters) if parameter.log]
    omega = _frequencies(scene)
    pairs = min(len(lines), len(omega))
    if not movable or not pairs:
        return z0
    chosen = lines[:pairs] if len(lines) <= len(omega) else lines[: len(omega)]
    if len(lines) < len(omega):
        rows = [int(np.argmin(np.abs(np.log(omega / line)))) for line in chosen]
        if len(set(rows)) < len(rows):
            return z0
    else:
        rows = [*range(pairs)]
    if np.all(np.abs(np.log(omega[rows] / chosen)) < START_FREQUENCY_ERROR_MAX):
        return z0

    def residuals(numbers: Floats) -> Floats:
        z = z0.copy()
        z[movable] = numbers
        try:
            now = _frequencies(scene_with(scene, numbers_at(parameters, z)))
        except (SceneError, ComputationError):
            return np.full(len(chosen) + len(movable), 1e3)
        if len(now) < len(omega):
            return np.full(len(chosen) + len(movable), 1e3)
        return np.concatenate((np.log(now[rows] / chosen) / 0.02, 2 * (numbers - z0[movable])))

    solution = scipy.optimize.least_squares(residuals, z0[movable], x_scale=0.1, diff_step=1e-4, max_nfev=40)
    numbers = z0.copy()
    numbers[movable] = solution.x
    return numbers


def _frequencies(scene: Scene) -> Floats:
    """The natural frequencies that are not zero (rad/s), ascending, each as often as it occurs."""
    modes = natural_modes(scene)
    omega = np.repeat(modes.omega, modes.multiplicity)
    return np.asarray(np.sort(omega[omega > 0]))
