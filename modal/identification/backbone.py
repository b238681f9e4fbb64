"""The backbone of a free decay: frequency of one link as a function of amplitude, from windows of the record.

In each window of a period or more, an angle is fitted by an offset and three harmonics, whose first has an amplitude A
and a phase φ.  Of one link in its plane, with the nome q of its swing [Whittaker1927, §22.6],

    A = 8 √q/(1 + q),        ω/ω₀ = θ₃(q)^{−2},        A₃ = 8 √q³/(3 (1 + q³)),

which is ω/ω₀ ≈ 1 − a²/16 for a small amplitude a; and viscous damping takes 2σ of its action a second, for its power
is 2σ times the mean of the momentum times the rate.  So over the windows

    φ = φ₀ + ω₀ t − r ω₀ ∫ (1 − θ₃^{−2}) dt,        ln J = ln J₀ − 2σ t + c ∫ (1 − θ₃^{−2}) dt

are straight, with r = 1 for one link and r = 0 for a frequency that does not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from modal.identification.decays import AMPLITUDE_SIGNIFICANCE, FOURTH_POWERS, autocorrelation, covariance, influence
from modal.types import Complexes, Floats

HARMONICS = 3
"""Physics: harmonics of a window: that of a swing of 90° is a thousandth of it beyond the third."""
WINDOW_SAMPLES_MIN = 14
"""Tolerance: samples of a window: twice its offset and three harmonics, so that residuals show their noise."""
WINDOWS_MIN = 8
"""Limit: windows of a record, twice the numbers of its line: fewer say nothing of a change of frequency."""
DEVIATION_MAX = 3.0
"""Tolerance: standard deviations that a change may be off that of one link: a chance of 0.3 %."""
GAIN_ERROR = 0.05
"""Physics: relative, the possible error of a sensor's gain; a change of frequency goes with its square."""
DEGREE_MAX = 6
"""Cost: of polynomials of logarithms of amplitudes, whose degree is the one of least BIC."""
CURVE_ERROR = 1e-3
"""Physics: relative, error of a change of frequency by harmonics beyond those of a window, at 90°."""
PASSES = 4
"""Cost: times that windows are fitted, with the frequency that those before have shown."""
LARGEST_HARMONIC = 3.0
"""Physics: rad, of the first harmonic: that of a swing of 170° is 3.5 % less than this, and 180° never return."""
OTHER_AMPLITUDE = 0.01
"""Tolerance: of the amplitude, the least of another mode: weaker poles are ignored."""


@dataclass(frozen=True)
class Harmonic:
    """A multiple `order` of a mode's frequency (Hz, at the largest swing), with its share of the mode's amplitude."""

    order: int
    frequency: float
    share: float
    share_std: float


@dataclass(frozen=True, eq=False)
class Backbone:
    """The pole λ (1/s) of small swings, with the covariance (2, 2) of its parts, and the change with amplitude.

    `ratio` is r, the change over that of one link, `amplitude` (rad) the largest swing, `shift` (1/s) the change there;
    `other` is the largest amplitude, over that of the swing, of the remainder without the mode and its harmonics.
    """

    pole: complex
    cov: Floats
    ratio: float
    ratio_std: float
    amplitude: float
    smallest: float
    shift: float
    harmonics: tuple[Harmonic, ...]
    other: float

    @property
    def changes(self) -> bool:
        """Whether the frequency changes significantly with amplitude."""
        return abs(self.ratio) > AMPLITUDE_SIGNIFICANCE * self.ratio_std

    @property
    def of_one_link(self) -> bool:
        """Whether it changes like that of a single link, and nothing else swings."""
        tolerance = np.hypot(DEVIATION_MAX * self.ratio_std, 2 * GAIN_ERROR)
        return bool(self.changes and abs(self.ratio - 1) < tolerance and self.other < OTHER_AMPLITUDE)


def softening(amplitudes: Floats) -> Floats:
    """1 − ω/ω₀ of one link whose first harmonic has these amplitudes (rad), which is a²/16 of small ones."""
    return np.asarray(1 - _thetas(amplitudes)[1] ** -2)


def action(amplitudes: Floats) -> Floats:
    """The action over m l² ω₀, which is a²/2 of small amplitudes of the first harmonic (rad)."""
    theta_2, theta_3 = _thetas(amplitudes)
    m = (theta_2 / theta_3) ** 4
    E, K = scipy.special.ellipe(m), scipy.special.ellipk(m)
    return np.asarray(8 / np.pi * (E - (1 - m) * K))


def swing_angle(amplitude: float) -> float:
    """The largest angle (rad) of one link whose first harmonic has this amplitude (rad)."""
    theta_2, theta_3 = _thetas(np.array([amplitude]))
    return float(2 * np.arcsin((theta_2 / theta_3) ** 2)[0])


def _thetas(amplitudes: Floats) -> tuple[Floats, Floats]:
    """θ₂ and θ₃ at 0 of the nome of A = 8 √q/(1 + q), by their series up to q⁶: q is 0.14 at 170°."""
    A = np.minimum(np.abs(amplitudes), LARGEST_HARMONIC)
    q = (A / (4 + np.sqrt(16 - A**2))) ** 2
    return np.asarray(2 * q**0.25 * (1 + q**2 + q**6)), np.asarray(1 + 2 * q + 2 * q**4)


@dataclass(frozen=True, eq=False)
class Windows:
    """Of the windows of a segment: centres (W,) in s, harmonics (W, H) times e^{ihφ}, phases φ (W,), and their noise.

    `noise` (W,) is the standard deviation of a part of a harmonic; the segment begins at `start` (s).
    """

    centres: Floats
    phases: Floats
    harmonics: Complexes
    noise: Floats
    start: float

    @property
    def amplitudes(self) -> Floats:
        """The amplitudes of the first harmonic (W,)."""
        return np.abs(self.harmonics[:, 0])

    @property
    def noise_of_phases(self) -> Floats:
        """Standard deviations (W,) of phases, and of logarithms of amplitudes."""
        return np.maximum(self.noise / self.amplitudes, np.finfo(float).eps)

    def smooth_amplitudes(self) -> tuple[Floats, Floats]:
        """Logarithms of amplitudes (W,) by a polynomial in time, and its directions of one standard deviation (P, W).

        The degree is that of the least BIC: noise of single windows would add up in the phase.
        """
        logs, std = np.log(self.amplitudes), self.noise_of_phases
        x = 2 * (self.centres - self.centres[0]) / np.ptp(self.centres) - 1
        fits = []
        for degree in range(1, min(DEGREE_MAX, len(x) - 2) + 1):
            basis = np.polynomial.legendre.legvander(x, degree)
            Q, _ = np.linalg.qr(basis / std[:, None])
            fit = Q @ (Q.T @ (logs / std))
            square = float(np.sum((logs / std - fit) ** 2))
            fits.append((square + (degree + 1) * np.log(len(x)), fit * std, Q.T * std))
        _, smooth, directions = min(fits, key=lambda trial: trial[0])
        return np.asarray(smooth), np.asarray(directions)


def backbone(segments: Sequence[tuple[Floats, Floats]]) -> Backbone | None:
    """The backbone of segments of times (K,) in s and angles (K,) in rad; None where windows are too few or too noisy.

    Anything but the decay of one mode has a `ratio` other than 1, or a large `other`.
    """
    strongest = max(segments, key=lambda segment: float(np.std(segment[1])))
    rate = 2 * np.pi * _line_frequency(*strongest)
    rates = [(times[[0, -1]], np.full(2, rate), np.zeros(2)) for times, _ in segments]
    line = None
    for _ in range(PASSES):
        windows = [_fit_windows(t, y, rate, *local) for (t, y), local in zip(segments, rates, strict=True)]
        if min(len(part.centres) for part in windows) < WINDOWS_MIN:
            return None
        line = _straight_lines(windows)
        rates = []
        for part in windows:
            local = line.pole.imag * (1 - line.ratio * softening(part.amplitudes))
            if local.min() < rate / 2 or local.max() > 2 * rate:
                return None
            logs, _ = part.smooth_amplitudes()
            rates.append((part.centres, local, -np.gradient(logs, part.centres)))
    assert line is not None
    other = max(_other_amplitude(t, y, part) for (t, y), part in zip(segments, windows, strict=True))
    largest = max(windows, key=lambda part: float(part.amplitudes[0]))
    return replace(line, other=other, harmonics=_harmonics(largest, line))


def _line_frequency(times: Floats, values: Floats) -> float:
    """The strongest line in Hz."""
    step = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], step)
    even_values = np.interp(grid, times, values)
    spectrum = np.abs(np.fft.rfft((even_values - even_values.mean()) * np.hanning(len(grid)), 8 * len(grid)))
    return float(np.fft.rfftfreq(8 * len(grid), step)[int(np.argmax(spectrum))])


def _fit_windows(times: Floats, values: Floats, rate: float, knots: Floats, rates: Floats, losses: Floats) -> Windows:
    """The windows of a segment up to the first whose amplitude is lost in noise; rates and losses (1/s) at `knots`."""
    step = float(np.median(np.diff(times)))
    periods = np.ceil(WINDOW_SAMPLES_MIN * step * rate / (2 * np.pi))
    length = 2 * np.pi * max(1.0, periods) / rate
    edges = np.arange(times[0], times[-1] + step, length)
    starts = np.searchsorted(times, edges - step / 2)
    orders = np.arange(1, HARMONICS + 1)
    drifts = np.gradient(rates, knots)
    rows: list[tuple[float, Complexes, float]] = []
    for first, last in pairwise(starts.tolist()):
        t, y = times[first:last], values[first:last]
        if len(t) < WINDOW_SAMPLES_MIN:
            continue
        centre = float(t.mean())
        omega, drift, sigma = (float(np.interp(centre, knots, part)) for part in (rates, drifts, losses))
        tau = t - centre
        turns = np.exp(np.outer(1j * (omega + drift / 2 * tau) * tau - sigma * tau, orders))
        basis = np.hstack((turns.real, -turns.imag, np.ones((len(t), 1))))
        inverse = np.linalg.pinv(basis)
        numbers = inverse @ y
        miss = y - basis @ numbers
        std = float(np.sqrt(miss @ miss / (len(t) - basis.shape[1]))) * float(np.sqrt(np.sum(inverse[0] ** 2)))
        harmonics = np.asarray(numbers[:HARMONICS] + 1j * numbers[HARMONICS:-1])
        if abs(harmonics[0]) < AMPLITUDE_SIGNIFICANCE * std:
            break
        rows.append((centre, harmonics, std))
    if not rows:
        empty = np.zeros(0)
        return Windows(empty, empty, np.zeros((0, HARMONICS), dtype=np.complex128), empty, 0.0)
    centres, harmonics, noise = (np.array(part) for part in zip(*rows, strict=True))
    # the phase that the rates predict is subtracted before unwrapping
    fine = np.union1d(centres, np.linspace(times[0], times[-1], len(times)))
    turned = scipy.integrate.cumulative_trapezoid(np.interp(fine, knots, rates), fine, initial=0.0)
    expected = np.interp(centres, fine, turned)
    phases = expected + np.unwrap(np.angle(harmonics[:, 0]) - expected)
    return Windows(centres, phases, harmonics, noise, float(times[0]))


def _straight_lines(windows: Sequence[Windows]) -> Backbone:
    """The lines through the phases and the actions of all windows."""
    smooth = [part.smooth_amplitudes() for part in windows]
    sizes = [_sizes(part.centres, logs) for part, (logs, _) in zip(windows, smooth, strict=True)]
    phases = [part.phases for part in windows]
    numbers, cov = _line(windows, sizes, phases)
    for k, (logs, directions) in enumerate(smooth):
        for direction in directions:
            others = [*sizes[:k], _sizes(windows[k].centres, logs + direction), *sizes[k + 1 :]]
            change = _line(windows, others, phases)[0] - numbers
            cov = cov + np.outer(change, change)
    actions = [np.log(action(part.amplitudes)) / 2 for part in windows]
    losses, cov_of_losses = _line(windows, sizes, actions)
    omega, ratio = float(numbers[0]), -float(numbers[1] / numbers[0])
    slope = np.array([ratio / omega, 1 / omega])
    largest = max(_first_amplitude(part, logs) for part, (logs, _) in zip(windows, smooth, strict=True))
    smallest = min(float(np.exp(logs[-1])) for logs, _ in smooth)
    shift = -omega * ratio * float(softening(np.array([largest]))[0])
    doubt_of_loss = FOURTH_POWERS * float(losses[0]) * shift / omega
    pole, swings = complex(losses[0], omega), (swing_angle(largest), swing_angle(smallest))
    variances = np.diag([cov_of_losses[0, 0] + doubt_of_loss**2, cov[0, 0] + (CURVE_ERROR * shift) ** 2])
    return Backbone(pole, variances, ratio, float(np.sqrt(slope @ cov @ slope)), *swings, shift, (), 0.0)


def _first_amplitude(windows: Windows, logs: Floats) -> float:
    """The amplitude at the start of a segment, from these logarithms of the windows'."""
    slope = (logs[1] - logs[0]) / (windows.centres[1] - windows.centres[0])
    return float(np.exp(logs[0] - slope * (windows.centres[0] - windows.start)))


def _sizes(times: Floats, logs: Floats) -> Floats:
    """The integral of the decrease of one link's frequency, (W,), from the first of these times on."""
    return np.asarray(scipy.interpolate.CubicSpline(times, softening(np.exp(logs))).antiderivative()(times))


def _line(windows: Sequence[Windows], sizes: Sequence[Floats], values: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Slopes (2,) of values by time and size with their covariance (2, 2); each segment has a start."""
    count = len(windows)
    blocks, rights = [], []
    for k, (part, size, value) in enumerate(zip(windows, sizes, values, strict=True)):
        starts = np.zeros((len(value), count))
        starts[:, k] = 1.0
        weights = 1 / part.noise_of_phases
        blocks.append(np.column_stack((part.centres, size, starts)) * weights[:, None])
        rights.append(value * weights)
    J = np.vstack(blocks)
    scale = np.linalg.norm(J, axis=0)
    G = influence(J / scale)
    numbers = G.T @ np.concatenate(rights)
    misses = np.split(np.concatenate(rights) - J / scale @ numbers, np.cumsum([len(part) for part in rights])[:-1])
    variance = sum(float(miss @ miss) for miss in misses) / max(1, len(J) - J.shape[1])
    ends = np.cumsum([0, *map(len, misses)])
    rho = autocorrelation(misses)
    rows = [(slice(int(first), int(last)), variance, rho) for first, last in pairwise(ends)]
    cov = covariance(G, rows) / np.outer(scale, scale)
    return np.asarray((numbers / scale)[:2]), np.asarray(cov[:2, :2])


def _other_amplitude(times: Floats, values: Floats, windows: Windows) -> float:
    """The largest amplitude, over that of the swing, of the remainder of a segment without one mode and its harmonics.

    Also in the first quarter, for remainders that decay faster.
    """
    centres = windows.centres
    is_inside = (times >= centres[0]) & (times <= centres[-1])
    t, y = times[is_inside], values[is_inside]
    logs = scipy.interpolate.CubicSpline(centres, windows.smooth_amplitudes()[0])(t)
    phases = scipy.interpolate.CubicSpline(centres, windows.phases)(t)
    waves = np.exp(np.outer(logs - logs[0] + 1j * phases, np.arange(1, HARMONICS + 1)))
    basis = np.hstack((waves.real, -waves.imag, np.ones((len(t), 1))))
    misses = y - basis @ (np.linalg.pinv(basis) @ y)
    largest = 0.0
    for count in (len(t), max(WINDOW_SAMPLES_MIN, len(t) // 4)):
        spectrum = np.fft.rfft(misses[:count] * np.hanning(count), 4 * count)
        largest = max(largest, float(np.abs(spectrum).max()) * 4 / count)
    return largest / float(windows.amplitudes[0])


def _harmonics(windows: Windows, line: Backbone) -> tuple[Harmonic, ...]:
    """The multiples of the frequency that stand out of noise in the first window."""
    frequency = (line.pole.imag + line.shift) / (2 * np.pi)
    first, noise = windows.harmonics[0], float(windows.noise[0])
    size = abs(first[0])
    return tuple(
        Harmonic(order, order * frequency, float(abs(first[order - 1])) / size, noise / size)
        for order in range(2, HARMONICS + 1)
        if abs(first[order - 1]) > AMPLITUDE_SIGNIFICANCE * noise
    )
