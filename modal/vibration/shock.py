"""The response of a scene to a record of its support's motion along the rail, at small angles, mode by mode.

The history of each mode is exact, and so is their sum: the record's acceleration is a polynomial between two of its
knots, and for α' = λ α + a(t) and a with the derivatives a⁽ᵐ⁾ at the beginning of an interval h,

    α(t + h) = e^{λh} α(t) + Σ_m a⁽ᵐ⁾ h^{m+1} φ_{m+1}(λh),     φ_k(z) = ∫₀¹ e^{(1−θ)z} θ^{k−1}/(k−1)! dθ

(the exact solution of an exponential integrator; [Hochbruck2010, §2.1]). The effective masses add up to the whole mass;
the modes needed for 90 % of it are those that building codes ask for ([Chopra2012, §13.2]; Eurocode 8, §4.3.3.3.1).
Peaks of modes, which do not occur at the same time, are combined next to it:

    SRSS   √(Σ_r y_r²)                 modes far apart [Rosenblueth1951]
    CQC    √(Σ_rs ρ_rs y_r y_s)        with the signs of the y_r [Wilson1981]

    ρ_rs = 8 √(ζ_r ζ_s) (ζ_r + q ζ_s) q^{3/2} / [(1 − q²)² + 4 ζ_r ζ_s q (1 + q²) + 4 (ζ_r² + ζ_s²) q²],   q = ω_s/ω_r

is the correlation of two oscillators under white noise [DerKiureghian1981, equation (8)].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial, pi

import numpy as np

from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.scene import RecordMotion, Scene, require
from modal.scene.doors import checked
from modal.statespace import ModalForm, state_space, to_modal_form
from modal.statespace.response import Term
from modal.statespace.sampling import MOST_NUMBERS
from modal.types import Booleans, Complexes, Floats, Ints
from modal.vibration.prescribed import Record, prescribed_motion
from modal.vibration.random import INPUT, USUAL, ModalResponse, exact_terms

STEPS_OF_PERIOD = 100
"""Tolerance: steps in the fastest period, between which polynomials find peaks; as many of a decay."""
MOST_STEPS = 1_000_000
"""Limit: steps of a record, refused beyond."""
ROUNDING_OF_HISTORY = 1e-9
"""Tolerance: share of the largest value, of an acceleration or a history, up to which a difference is rounding."""
TERMS_OF_PHI = 18
"""Tolerance: terms of the series of φ where |z| < 1: the next is a rounding."""


SHARE_OF_PEAK_MIN = 0.8
"""Tolerance: share of the largest sample from which on a sample may be next to the largest value."""
POINTS_OF_TOP = 33
"""Tolerance: points between two neighbours of a sample, from the best of which one step of Newton leads to the top."""
THROUGH_FIVE = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
"""From five values at −2, …, 2 to the coefficients of their polynomial."""
MASS_SHARE_ENOUGH = 0.9
"""Physics: share of the mass that the modes considered must have, as codes of earthquake engineering ask."""


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

    A step is at most one part in STEPS_OF_PERIOD of `period` (s) and in four of the interval between two knots. Raise
    ComputationError if there would be too many.
    """
    knots, derivatives = record.pieces
    powers = np.array([factorial(k) for k in range(len(derivatives))])[:, None]
    ends_of_pieces = np.sum(derivatives * np.diff(knots) ** np.arange(len(powers))[:, None] / powers, axis=0)
    jumps = np.abs(derivatives[0, 1:] - ends_of_pieces[:-1]) > ROUNDING_OF_HISTORY * np.abs(derivatives[0]).max()
    begins, ends = knots.copy(), np.append(knots[1:], until)
    derivatives = np.hstack([derivatives, np.zeros((len(derivatives), 1))])
    is_jump = np.append(jumps, True)  # the acceleration drops to zero at the end
    begins[1:][is_jump] = np.nextafter(begins[1:][is_jump], np.inf)
    counts = np.maximum(np.ceil((ends - begins) * STEPS_OF_PERIOD / period), 4)
    if counts.sum() > MOST_STEPS:
        raise ComputationError(
            f"the record takes {counts.sum():.3g} steps of a hundredth of the fastest period, {period:.3g} s: at most "
            f"{MOST_STEPS} are followed"
        )
    number = counts.astype(np.int64)
    sizes = number.copy()
    sizes[:-1][is_jump] += 1
    sizes[-1] += 1
    first = np.cumsum(sizes) - sizes
    piece = np.repeat(np.arange(len(sizes)), sizes)
    offset = (np.arange(len(piece)) - first[piece]) * ((ends - begins) / counts)[piece]
    local_derivatives = np.zeros((len(derivatives), len(piece)))
    with np.errstate(over="ignore", invalid="ignore"):
        for m in range(len(derivatives)):
            for k in range(m, len(derivatives)):
                local_derivatives[m] += derivatives[k, piece] * offset ** (k - m) / factorial(k - m)
    times = begins[piece] + offset
    times[first[1:][is_jump] - 1], times[-1] = ends[:-1][is_jump], until
    return Grid(times, local_derivatives, first, first + number)


def phi(z: Complexes, highest: int) -> list[Complexes]:
    """φ_1 … φ_most."""
    small = np.abs(z) < 1
    small_z = np.where(small, z, 0.0)
    series = [sum(small_z**j / factorial(j + k) for j in range(TERMS_OF_PHI)) for k in range(1, highest + 1)]
    large_z = np.where(small, 1.0, z)
    values, last = [], np.exp(large_z)
    for k in range(1, highest + 1):
        last = (last - 1 / factorial(k - 1)) / large_z
        values.append(np.where(small, series[k - 1], last))
    return values


def driven(poles: Complexes, grid: Grid) -> Complexes:
    """α (R, T) of the poles λ (R,), zero at the first of the times (T,); inf or NaN beyond double precision."""
    steps, derivatives = np.diff(grid.times), grid.derivatives
    z = np.multiply.outer(poles, steps)
    forcing = np.zeros_like(z, dtype=np.complex128)
    with np.errstate(over="ignore", invalid="ignore"):
        for m, weight in enumerate(phi(z, len(derivatives))):
            forcing += derivatives[m, :-1] * steps ** (m + 1) * weight
    grown, alphas = np.exp(z), np.zeros((len(poles), len(grid.times)), dtype=np.complex128)
    alpha = alphas[:, 0]
    for at in range(len(steps)):
        alpha = grown[:, at] * alpha + forcing[:, at]
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
    large_samples = np.flatnonzero(sizes >= SHARE_OF_PEAK_MIN * largest)
    first_piece, last_piece = (
        np.searchsorted(grid.first, large_samples, side="right") - 1,
        np.searchsorted(grid.last, large_samples),
    )
    centre = np.concatenate(
        (large_samples, large_samples[first_piece != last_piece])
    )  # a sample that two pieces share is judged in both
    piece = np.concatenate((first_piece, last_piece[first_piece != last_piece]))
    left_neighbour, right_neighbour = (
        np.maximum(centre - 1, grid.first[piece]),
        np.minimum(centre + 1, grid.last[piece]),
    )
    top = (sizes[centre] >= sizes[left_neighbour]) & (sizes[centre] >= sizes[right_neighbour])
    centre, piece, left_neighbour, right_neighbour = centre[top], piece[top], left_neighbour[top], right_neighbour[top]
    start = np.clip(centre - 2, grid.first[piece], grid.last[piece] - 4)
    window = values[start[:, None] + np.arange(5)] * np.sign(values[centre])[:, None]
    coefficients = window @ THROUGH_FIVE.T
    places = np.linspace(left_neighbour - start - 2.0, right_neighbour - start - 2.0, POINTS_OF_TOP, axis=1)
    heights = _polynomial(coefficients, places)
    best = heights.argmax(1)[:, None]
    place = np.take_along_axis(places, best, 1)
    powers = np.arange(1.0, coefficients.shape[1])
    slopes = coefficients[:, 1:] * powers
    slope, bend = _polynomial(slopes, place), _polynomial(slopes[:, 1:] * powers[:-1], place)
    with np.errstate(all="ignore"):
        step = np.where(bend < 0, -slope / bend, 0.0)
    place = np.clip(place + step, places[:, :1], places[:, -1:])
    height = np.maximum(_polynomial(coefficients, place), np.take_along_axis(heights, best, 1))[:, 0]
    if len(height) and height.max() > largest:
        at = int(height.argmax())
        pace = float(grid.times[start[at] + 3] - grid.times[start[at] + 2])
        highest = float(height[at]), float(grid.times[start[at] + 2] + place[at, 0] * pace)
    return highest


def _polynomial(coefficients: Floats, places: Floats) -> Floats:
    """Σ c_k x^k of polynomials (N, d) at places (N, P)."""
    values = np.zeros_like(places)
    for coefficient in coefficients.T[::-1]:
        values = values * places + coefficient[:, None]
    return values


def srss(peaks: Floats) -> Floats:
    """The square root of the sum of squares over modes, of peaks (R, ...)."""
    return np.asarray(np.sqrt(np.sum(np.square(peaks), axis=0)))


def correlation(omega: Floats, damping: Floats) -> Floats:
    """ρ (R, R) of modes of frequencies ω (R,) in rad/s and damping ratios ζ (R,); 1 for equal frequencies."""
    q = omega[None, :] / omega[:, None]
    r, s = damping[:, None], damping[None, :]
    numerator = 8 * np.sqrt(r * s) * (r + q * s) * q**1.5
    denominator = (1 - q**2) ** 2 + 4 * r * s * q * (1 + q**2) + 4 * (r**2 + s**2) * q**2
    with np.errstate(invalid="ignore"):
        rho = numerator / denominator
    return np.asarray(np.where((denominator == 0) | (q == 1) & (r == s), 1.0, rho))


def cqc(peaks: Floats, omega: Floats, damping: Floats) -> Floats:
    """The complete quadratic combination of signed peaks (R, ...)."""
    rho = correlation(omega, damping)
    return np.asarray(np.sqrt(np.maximum(np.einsum("r...,rs,s...->...", peaks, rho, peaks), 0.0)))


@dataclass(frozen=True, eq=False, repr=False)
class ShockResponse(ModalResponse):
    """The response of p outputs to a record: `history` (p, T) and that of each mode (R, p, T) at the times of `grid`.

    The acceleration drops to zero at the record's end, and what contains it jumps: the last sample of the record is
    followed by another at the next number.
    """

    record: Record
    grid: Grid
    history: Floats
    by_mode: Floats
    writer = "modal.vibration.report:shock_report"

    @property
    def times(self) -> Floats:
        """The times (T,) in s, ascending."""
        return self.grid.times

    @cached_property
    def peaks(self) -> Floats:
        """The largest |value| of every output, (p,), and its time (s): (p, 2)."""
        return np.array([peak(self.grid, values) for values in self.history])

    @cached_property
    def mode_peaks(self) -> Floats:
        """The largest |value| of every mode alone, (R, p), with the sign of the mode in that output."""
        signs = np.ones(self.by_mode.shape[:2])
        for term in exact_terms(self.form):
            if term.mode is not None:
                leading = term.N0[:, 0] if np.any(term.N0) else term.N1[:, 0]
                signs[term.mode] = np.where(leading < 0, -1.0, 1.0)
        sizes = [[peak(self.grid, values)[0] for values in histories] for histories in self.by_mode]
        return np.asarray(signs * np.array(sizes) + 0.0)

    @cached_property
    def follows_support(self) -> Booleans:
        """Which outputs contain the support's motion in addition to that of the modes, (p,)."""
        total = self.by_mode.sum(0)
        rest = np.abs(self.history - total).max(1)
        return np.asarray(rest > ROUNDING_OF_HISTORY * np.abs(self.history).max(1))

    @cached_property
    def srss(self) -> Floats:
        """The peaks of the modes combined by SRSS, (p,): NaN if the support's own motion adds to theirs."""
        return np.where(self.follows_support, np.nan, srss(self.mode_peaks))

    @cached_property
    def cqc(self) -> Floats:
        """The same by CQC."""
        omega, zeta = self.modes.omega, np.array([mode.damping_ratio for mode in self.modes])
        swing = omega > 0
        with np.errstate(all="ignore"):
            result = cqc(self.mode_peaks[swing], omega[swing], np.clip(np.nan_to_num(zeta[swing]), 0.0, 1.0))
            result = np.sqrt(result**2 + np.sum(self.mode_peaks[~swing] ** 2, axis=0))
        return np.where(self.follows_support, np.nan, result)

    @cached_property
    def mass_shares(self) -> Floats:
        """The effective mass of every mode along the rail over the whole mass, (R,), on a support at rest."""
        undamped_modes = natural_modes(self.modes.scene.conservative)
        shares = np.array([mode.effective_mass_share for mode in undamped_modes])
        return shares if len(shares) == len(self.modes) else np.full(len(self.modes), np.nan)

    @property
    def enough(self) -> int | None:
        """The number of lowest modes that cover 90 % of the mass; None if that is unknown."""
        numbers = np.flatnonzero(np.cumsum(self.mass_shares) >= MASS_SHARE_ENOUGH)
        return int(numbers[0]) + 1 if len(numbers) else None


@checked
def shock_response(scene: Scene, motion: RecordMotion, outputs: tuple[str, ...] = USUAL) -> ShockResponse:
    """Compute the response of a scene, at rest on its support, to a record of the support's motion along the rail.

    `outputs` are groups of `modal.statespace.signals.OUTPUTS`. The history begins with the record and continues for two
    of the slowest periods beyond it. Raise ComputationError if it would take too many steps, and the errors of
    `state_space` and `to_modal_form`.
    """
    require(scene, "a shock")
    record, modes = prescribed_motion(motion), natural_modes(scene)
    assert isinstance(record, Record)
    form = to_modal_form(modes, state_space(scene, (INPUT,), tuple(outputs)))
    grid = fine_times(record, *_steps(modes.eigenvalue, record))
    size = len(modes) * len(form.model.outputs) * len(grid.times)
    if size > MOST_NUMBERS:
        raise ComputationError(
            f"{len(modes)} modes, {len(form.model.outputs)} outputs and {len(grid.times)} times: their product may be "
            f"at most {MOST_NUMBERS:g}; choose fewer outputs with `outputs`"
        )
    by_mode = np.zeros((len(modes), len(form.model.outputs), len(grid.times)))
    history = form.model.D[:, :1] * grid.derivatives[0] + _carried_along(form, record, grid.times)
    for term in exact_terms(form):
        values = _history(term, record, grid)
        history = history + values
        if term.mode is not None:
            by_mode[term.mode] += values
    if not np.all(np.isfinite(history)):
        raise ComputationError("the response to this record overflows")
    return ShockResponse(form, record, grid, history, by_mode)


def _carried_along(form: ModalForm, record: Record, times: Floats) -> Floats:
    """The outputs (p, T) of a support that keeps its initial velocity, with everything on it at rest."""
    start, speed = float(record.displacement(record.first)), float(record.velocity(record.first))
    return np.asarray(form.outputs[0] @ np.stack([start + speed * (times - record.first), np.full(len(times), speed)]))


def _steps(eigenvalues: Complexes, record: Record) -> tuple[float, float]:
    """The period (s) to be resolved, and until when (s).

    That of the fastest oscillation; of faster decays, too, as far as they cost no more than STEPS_OF_PERIOD periods.
    """
    rates = eigenvalues.imag[eigenvalues.imag > 0]
    if not len(rates):
        rates = np.array([2 * pi / (record.last - record.first)])
    until = record.last + 4 * pi / float(rates.min())
    decay = min(float(np.abs(eigenvalues).max()), STEPS_OF_PERIOD * 2 * pi / (until - record.first))
    return 2 * pi / max(float(rates.max()), decay), until


def _history(term: Term, record: Record, grid: Grid) -> Floats:
    """The contribution of one term to each output, (p, T), for the support's acceleration."""
    N1, N0, times = term.N1[:, :1], term.N0[:, :1], grid.times
    c2, c1, c0 = term.c
    if not c2:
        return np.asarray(N0 * driven(np.array([complex(-c0)]), grid)[0].real)
    a = -c1 / 2
    nu = np.sqrt(complex(c0 - a * a))
    if not nu:
        elapsed = times - record.first
        velocity = record.velocity(times) - float(record.velocity(record.first))
        place = record.displacement(times) - float(record.displacement(record.first))
        place = place - float(record.velocity(record.first)) * elapsed
        return np.asarray(N1 * velocity + N0 * place)
    poles = np.array([a + 1j * nu, a - 1j * nu])
    if nu.imag:
        alpha = driven(poles, grid)
        sizes = [(N1 * pole + N0) / (pole - other_pole) for pole, other_pole in zip(poles, poles[::-1], strict=True)]
        return np.asarray((sizes[0] * alpha[0] + sizes[1] * alpha[1]).real)
    alpha = driven(poles[:1], grid)[0]
    return np.asarray(2 * (((N1 * poles[0] + N0) / (2j * nu)) * alpha).real)
