"""Damped oscillators driven by a record, exactly: the record's acceleration is a polynomial between two of its knots.

For α' = λ α + a(t) and a with the derivatives a⁽ᵐ⁾ at the beginning of an interval h,

    α(t + h) = e^{λh} α(t) + Σ_m a⁽ᵐ⁾ h^{m+1} φ_{m+1}(λh),     φ_k(z) = ∫₀¹ e^{(1−θ)z} θ^{k−1}/(k−1)! dθ

(the exact solution of an exponential integrator; Hochbruck & Ostermann, Acta Numerica 19, 209 (2010), §2.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from modal.errors import ComputationError
from modal.types import Complexes, Floats, Ints
from modal.vibration.prescribed import Record

PER_PERIOD, BETWEEN = 100, 4  # steps in a period, and at least between two samples of the record
MOST_STEPS = 1_000_000
JUMP = 1e-9  # of the acceleration, over its largest value: beyond the rounding of a piece's end
SERIES, NEAR = 18, 1.0  # terms of the series of φ, and |z| up to which it is used


@dataclass(frozen=True, eq=False)
class Grid:
    """Times (T,) in s, ascending, and the derivatives of a record's acceleration after each (K, T).

    Between the samples `first` and `last` (J,) of a piece, evenly spaced and at least five, everything driven by the
    record is smooth.  Neighbouring pieces share a sample, except where the acceleration jumps, as at the record's end:
    there the last sample of a piece is followed by one at the next number, of what is there afterwards.
    """

    times: Floats
    derivatives: Floats
    first: Ints
    last: Ints


def fine_times(record: Record, period: float, until: float) -> Grid:
    """The grid from the record's beginning to `until` (s), a time after its end.

    A step is at most one part in PER_PERIOD of `period` (s) and in BETWEEN of the interval between two knots.
    ComputationError where there would be too many.
    """
    knots, derivatives = record.pieces
    powers = np.array([factorial(k) for k in range(len(derivatives))])[:, None]
    ended = np.sum(derivatives * np.diff(knots) ** np.arange(len(powers))[:, None] / powers, axis=0)
    jumps = np.abs(derivatives[0, 1:] - ended[:-1]) > JUMP * np.abs(derivatives[0]).max()
    begins, ends = knots.copy(), np.append(knots[1:], until)
    derivatives = np.hstack([derivatives, np.zeros((len(derivatives), 1))])
    apart = np.append(jumps, True)  # the acceleration drops to zero at the end
    begins[1:][apart] = np.nextafter(begins[1:][apart], np.inf)
    counts = np.maximum(np.ceil((ends - begins) * PER_PERIOD / period), BETWEEN)
    if counts.sum() > MOST_STEPS:
        raise ComputationError(
            f"the record takes {counts.sum():.3g} steps of a hundredth of the fastest period, {period:.3g} s: at most "
            f"{MOST_STEPS} are followed"
        )
    number = counts.astype(np.int64)
    sizes = number.copy()
    sizes[:-1][apart] += 1
    sizes[-1] += 1
    first = np.cumsum(sizes) - sizes
    piece = np.repeat(np.arange(len(sizes)), sizes)
    offset = (np.arange(len(piece)) - first[piece]) * ((ends - begins) / counts)[piece]
    moved = np.zeros((len(derivatives), len(piece)))
    with np.errstate(over="ignore", invalid="ignore"):
        for m in range(len(derivatives)):
            for k in range(m, len(derivatives)):
                moved[m] += derivatives[k, piece] * offset ** (k - m) / factorial(k - m)
    times = begins[piece] + offset
    times[first[1:][apart] - 1], times[-1] = ends[:-1][apart], until
    return Grid(times, moved, first, first + number)


def phi(z: Complexes, most: int) -> list[Complexes]:
    """φ_1 … φ_most."""
    small = np.abs(z) < NEAR
    near = np.where(small, z, 0.0)
    series = [sum(near**j / factorial(j + k) for j in range(SERIES)) for k in range(1, most + 1)]
    far = np.where(small, 1.0, z)
    values, last = [], np.exp(far)
    for k in range(1, most + 1):
        last = (last - 1 / factorial(k - 1)) / far
        values.append(np.where(small, series[k - 1], last))
    return values


def driven(poles: Complexes, grid: Grid) -> Complexes:
    """α (R, T) of the poles λ (R,), zero at the first of the times (T,); inf or NaN beyond double precision."""
    steps, derivatives = np.diff(grid.times), grid.derivatives
    z = np.multiply.outer(poles, steps)
    forced = np.zeros_like(z, dtype=np.complex128)
    with np.errstate(over="ignore", invalid="ignore"):
        for m, weight in enumerate(phi(z, len(derivatives))):
            forced += derivatives[m, :-1] * steps ** (m + 1) * weight
    grown, alphas = np.exp(z), np.zeros((len(poles), len(grid.times)), dtype=np.complex128)
    alpha = alphas[:, 0]
    for at in range(len(steps)):
        alpha = grown[:, at] * alpha + forced[:, at]
        alphas[:, at + 1] = alpha
    return alphas


def response_spectrum(record: Record, frequencies: Floats, damping: float) -> Floats:
    """The largest displacement (m) relative to the support of oscillators of these frequencies (Hz), (F,).

    `damping` is the ratio ζ below 1 of all of them; each is followed for one period beyond the record.
    """
    peaks = []
    for frequency in np.asarray(frequencies, dtype=float).tolist():
        omega = 2 * np.pi * frequency
        pole = omega * complex(-damping, np.sqrt(1 - damping**2))
        grid = fine_times(record, 1 / frequency, record.last + 1 / frequency)
        peaks.append(peak(grid, -driven(np.array([pole]), grid)[0].imag / pole.imag)[0])
    return np.array(peaks)


def peak(grid: Grid, values: Floats) -> tuple[float, float]:
    """The largest |value| (T,) and its time (s).

    Of all samples that may be next to it, by the polynomial through five samples in a row, never across a jump or kink.
    """
    sizes = np.abs(values)
    largest = float(sizes.max())
    if not largest:
        return 0.0, float(grid.times[0])
    highest = largest, float(grid.times[sizes.argmax()])
    near = np.flatnonzero(sizes >= NEARLY * largest)
    begun, ending = np.searchsorted(grid.first, near, side="right") - 1, np.searchsorted(grid.last, near)
    centre = np.concatenate((near, near[begun != ending]))  # a sample that two pieces share is judged in both
    piece = np.concatenate((begun, ending[begun != ending]))
    left, right = np.maximum(centre - 1, grid.first[piece]), np.minimum(centre + 1, grid.last[piece])
    top = (sizes[centre] >= sizes[left]) & (sizes[centre] >= sizes[right])
    centre, piece, left, right = centre[top], piece[top], left[top], right[top]
    start = np.clip(centre - 2, grid.first[piece], grid.last[piece] - 4)
    window = values[start[:, None] + np.arange(5)] * np.sign(values[centre])[:, None]
    coefficients = window @ THROUGH_FIVE.T
    places = np.linspace(left - start - 2.0, right - start - 2.0, FINE, axis=1)
    heights = _polynomial(coefficients, places)
    best = heights.argmax(1)[:, None]
    place = np.take_along_axis(places, best, 1)
    slope, bend = (_polynomial(_derivative(coefficients, order), place) for order in (1, 2))
    with np.errstate(all="ignore"):
        step = np.where(bend < 0, -slope / bend, 0.0)
    place = np.clip(place + step, places[:, :1], places[:, -1:])
    height = np.maximum(_polynomial(coefficients, place), np.take_along_axis(heights, best, 1))[:, 0]
    if len(height) and height.max() > largest:
        at = int(height.argmax())
        pace = float(grid.times[start[at] + 3] - grid.times[start[at] + 2])
        highest = float(height[at]), float(grid.times[start[at] + 2] + place[at, 0] * pace)
    return highest


NEARLY = 0.8
"""Share of the largest sample from which on a sample may be next to the largest value."""
FINE = 33
"""Points between two neighbours of a sample, from the best of which one step of Newton leads to the top."""
THROUGH_FIVE = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
"""From five values at −2, …, 2 to the coefficients of their polynomial."""


def _polynomial(coefficients: Floats, places: Floats) -> Floats:
    """Σ c_k x^k of polynomials (N, d) at places (N, P)."""
    values = np.zeros_like(places)
    for coefficient in coefficients.T[::-1]:
        values = values * places + coefficient[:, None]
    return values


def _derivative(coefficients: Floats, order: int) -> Floats:
    for _ in range(order):
        coefficients = coefficients[:, 1:] * np.arange(1.0, coefficients.shape[1])
    return coefficients
