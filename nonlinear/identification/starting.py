"""Where a fit begins: states from the first samples of every segment, numbers from the lines of the spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.identification import Parameter, numbers_at, scene_with, starts_of
from modal.modes import all_shapes, natural_modes
from modal.scene import Scene
from modal.types import Floats
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.records import Recording
from nonlinear.system import system_of

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
START_AMPLITUDES = (0.1, 0.3, 0.6, 1.0, 1.6, 2.4)
START_PHASES = 12
"""Cost: swings that are tried at once where sensors read no angles, 72 of each mode."""
START_TOLERANCE = 1e-4
"""Cost: of motions of which the nearest is taken as a start."""
DIRECTION_MIN = 1e-3
"""Tolerance: of a linear response, the least part of the best determined direction that moves a state."""


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
    return _states_by_response(problem, states) if problem.is_read_by_motion else states


def _states_by_response(problem: FitProblem, states: Floats) -> Floats:
    """The states (S, width) from which the scene moves most like the first readings, of those that are tried.

    Candidates are the given ones, the linear responses from these and from rest, and swings in single modes, by which
    sensors are read that do not respond to first order at rest.
    """
    part = problem.recording.until(PERIOD_PART * 2 * np.pi / problem.system.rate)
    rest = np.zeros(2 * problem.coordinates)
    rest[problem.system.first : problem.coordinates] = problem.system.rest
    swings, chosen = [rest + swing for swing in _modal_swings(problem.scene)], []
    for state, segment in zip(states, part.segments, strict=True):
        beginning = replace(part, segments=(replace(segment, continued=False),))
        alone = replace(problem, recording=beginning, tolerance=START_TOLERANCE)
        nearest = _nearest(alone, [state, *_responses(alone, state), *_responses(alone, rest), *swings])
        chosen.append(_nearest(alone, [nearest, *_responses(alone, nearest)]))
    return np.array(chosen)


def _nearest(problem: FitProblem, attempts: Sequence[Floats]) -> Floats:
    """The state among the attempts whose readings differ least from those of a single segment, offsets aside."""
    (segment,) = problem.recording.segments
    many = replace(problem, recording=replace(problem.recording, segments=(segment,) * len(attempts)))
    u = np.concatenate((_unknowns(problem)[: problem.layout.delays.stop], *attempts))
    try:
        misses = [miss / problem.noise for miss in many.misses(u)]
    except ComputationError:
        return attempts[0]
    has_offset = problem.free[problem.layout.offsets]
    sizes = [np.nansum((miss - np.where(has_offset, np.nanmean(miss, axis=0), 0.0)) ** 2) for miss in misses]
    return attempts[int(np.argmin(sizes))]


def _responses(problem: FitProblem, state: Floats) -> list[Floats]:
    """The state of a single segment from which the readings continue, linear about the motion from `state`."""
    layout, u = problem.layout, _unknowns(problem)
    u[layout.state(0)] = state
    is_free = problem.free.copy()
    is_free[: layout.numbers] = is_free[layout.scales] = is_free[layout.delays] = False
    columns = np.flatnonzero(is_free)
    try:
        residuals, J = problem.residuals(u, with_derivatives=True), problem.jacobian(u)[:, columns]
    except ComputationError:
        return []
    size = np.linalg.norm(J, axis=0)
    size[size == 0] = np.inf
    u[columns] -= np.linalg.lstsq(J / size, residuals, rcond=DIRECTION_MIN)[0] / size
    return [u[layout.state(0)]]


def _unknowns(problem: FitProblem) -> Floats:
    u = np.zeros(problem.layout.size)
    u[: problem.layout.numbers] = starts_of(problem.parameters)
    return u


def _modal_swings(scene: Scene) -> list[Floats]:
    """States, less that of rest, of swings in one mode each, of several amplitudes (rad, m) and phases."""
    modes, swings = natural_modes(scene.conservative), []
    carried = system_of(scene).first
    for omega, copies in zip(modes.omega.tolist(), all_shapes(modes), strict=True):
        for shape in copies if np.isfinite(omega) and omega > 0 else []:
            carriers = shape.supports if len(shape.supports) else [shape.cart]
            q = np.real([*[*carriers][:carried], *shape.angles])
            q = q / np.abs(q).max()
            swings += [
                amplitude * np.concatenate((np.cos(phase) * q, -omega * np.sin(phase) * q))
                for amplitude in START_AMPLITUDES
                for phase in np.linspace(0, 2 * np.pi, START_PHASES, endpoint=False)
            ]
    return swings


def spectral_lines(recording: Recording) -> Floats:
    """Angular frequencies (rad/s) of the lines in a recording, ascending; none of sensors that read twice those."""
    longest = max(segment.times[-1] - segment.times[0] for segment in recording.segments)
    step = min(float(np.median(np.diff(segment.times))) for segment in recording.segments)
    count = int(2 ** np.ceil(np.log2(SPECTRUM_PADDING * longest / step)))
    frequency = 2 * np.pi * np.fft.rfftfreq(count, step)
    power = np.zeros(len(frequency))
    for segment in recording.segments:
        grid = np.arange(segment.times[0], segment.times[-1], step)
        for sensor, readings in zip(recording.sensors, segment.values.T, strict=True):
            is_present = np.isfinite(readings)
            if np.count_nonzero(is_present) > 3 and not sensor.is_even:
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
