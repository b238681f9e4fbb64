"""The prescribed motion of a support as functions of time: displacement, velocity and acceleration.

A record is joined by an interpolating spline of degree 5 (3 where it has fewer than 6 samples) of the recorded
quantity, and by straight lines where that leaves the samples (`modal.scene.hoist`), or where displacements are
recorded by cubics within them, as velocities cannot jump; the others are its derivatives and integrals, exactly.  The
integral of an acceleration begins at zero velocity, every integral at zero displacement.  Outside the record the
acceleration is zero.

A random process of the PSD S (one-sided, per hertz) is the sum of sines √(2 S(f_k) Δf) cos(2π f_k t + φ_k) at all
multiples f_k of Δf = 1/duration within the PSD, with independent uniform phases φ_k ([Shinozuka1972, equation (17)]
with equal amplitudes a line): its PSD over one duration is S.  Between two points a PSD is a straight line over
logarithmic axes, S = S₁ (f/f₁)^p, as test specifications draw it, and a straight line over linear axes where an end or
its frequency is zero; outside its points it is zero.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from math import ceil, factorial, isnan, nan, pi, tau
from typing import Any

import numpy as np
import scipy

from modal.assembly import on_lines
from modal.scene import (
    ConstantForce,
    Force,
    RandomForce,
    RandomMotion,
    RecordForce,
    RecordMotion,
    SineForce,
    SineMotion,
    SupportMotion,
    SweepForce,
    SweepMotion,
)
from modal.scene.length_laws import monotone_slopes, splined_stretches, unsplined_intervals, unsplined_words
from modal.scene.records import Spectrum
from modal.types import NUMBERS_IN_CHUNK, Booleans, Floats
from modal.vibration.courses import Constant, PiecewiseMotion, Polynomials, PrescribedMotion, Sine, SweptSine

POWERS = {"acceleration": 0, "velocity": 2, "displacement": 4}
"""Powers of ω that make the PSD of an acceleration of each quantity's."""


SPLINE_DEGREE = 5
"""Format: degree of the spline through a record of more samples than that: its acceleration is a cubic."""
ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
BAND_ERROR = 0.01
"""Physics: relative error of the support's acceleration at the end of the band that is reported for a record."""
IMAGES = np.arange(1, 200)[:, None] * [1, -1]
DRIFT_MIN = 1e-3
"""Tolerance: velocity at the end, over the largest in the record, from which on the record is said to drift."""
PHASE_OF_PIECE = 0.2
"""Tolerance: phase (rad) of the fastest sine between two instants about which a sum of sines is expanded."""
TAYLOR_TERMS = 11
"""Tolerance: terms about each: the remainder, (PHASE_OF_PIECE/2)¹¹/11! = 2.5e-19, is below rounding."""


def psd_at(frequencies: Floats, psd: Floats, f: Floats) -> Floats:
    """The PSD given at ascending `frequencies` (Hz), at the frequencies `f`."""
    inside = (f >= frequencies[0]) & (f <= frequencies[-1])
    return np.where(inside, on_lines(frequencies, psd, f), 0.0)


def acceleration_psd(spectrum: Spectrum, f: Floats) -> Floats:
    """The PSD of the acceleration, in (m/s²)²/Hz, at the frequencies `f` (Hz)."""
    psd = psd_at(np.array(spectrum.frequency_hz), np.array(spectrum.psd), f)
    return np.asarray(psd * (tau * f) ** POWERS[spectrum.of])


class Record(PiecewiseMotion):
    """A record joined by a spline."""

    def __init__(self, motion: RecordMotion | RecordForce) -> None:
        of, values = motion.samples if isinstance(motion, RecordMotion) else ("acceleration", motion.samples)
        times = np.array(motion.time_s)
        self.first, self.last, self.of = float(times[0]), float(times[-1]), ORDERS[of]
        self.degree = SPLINE_DEGREE if len(times) > SPLINE_DEGREE and motion.interpolation != "cubic" else 3
        curve, is_straight = _join_samples(times, np.array(values), self.degree, self.of, motion.interpolation)
        splines = {self.of: curve}
        for order in range(self.of + 1, 3):
            splines[order] = splines[order - 1].derivative()
        for order in reversed(range(self.of)):
            splines[order] = splines[order + 1].antiderivative()
        self._splines = [splines[order] for order in range(3)]
        start, end = (float(splines[1](at)) for at in (self.first, self.last))
        drifts = isinstance(motion, RecordMotion) and motion.baseline == "velocity"
        self.steady = (end - start) / (self.last - self.first) if drifts else 0.0
        spacing = float(np.diff(times).max())
        kinks = np.flatnonzero(is_straight)
        self.breaks = tuple(
            np.unique([self.first, *times[kinks].tolist(), *times[kinks + 1].tolist(), self.last]).tolist()
        )
        self.shortest = 4 * spacing
        self.band_hz = nan if is_straight.all() else band(self.degree, 2 - self.of) / spacing
        self._joined_words = (
            "straight lines join the samples"
            if motion.interpolation == "linear"
            else unsplined_words(times, is_straight, "straight lines" if self.of else "cubics")
        )
        self.left = float(self.derivative(self.last, 1))
        self.words = self._words(times) if isinstance(motion, RecordMotion) else self._band_words

    @property
    def _band_words(self) -> str:
        spline = f"the spline through the record is within {BAND_ERROR:.0%} of a sine up to {self.band_hz:.4g} Hz"
        return "; ".join(filter(None, ("" if isnan(self.band_hz) else spline, self._joined_words)))

    def _words(self, times: Floats) -> str:
        band_words = self._band_words
        if abs(self.left) <= DRIFT_MIN * float(np.abs(self.velocity(times)).max()):
            return band_words
        drift = f"the record ends at {self.left:.4g} m/s, and the support moves on at that velocity"
        return f'{band_words}; {drift} (baseline = "velocity" takes such a drift out)'

    @cached_property
    def pieces(self) -> tuple[Floats, Floats]:
        """Times (J + 1,) between which the acceleration is a polynomial, and all its derivatives after each (K, J)."""
        spline = self._splines[2]
        if not isinstance(spline, scipy.interpolate.PPoly):
            spline = scipy.interpolate.PPoly.from_spline(spline)
        has_length = np.diff(spline.x) > 0
        has_length &= (spline.x[:-1] >= self.first) & (spline.x[1:] <= self.last)
        derivatives = spline.c[::-1, has_length] * np.array([factorial(k) for k in range(len(spline.c))])[:, None]
        derivatives[0] -= self.steady
        return np.append(spline.x[:-1][has_length], self.last), derivatives

    def polynomials(self, order: int) -> Polynomials:
        """The polynomials of the spline; outside the record none, at constant velocity."""
        return self._polynomials[order - 1]

    @cached_property
    def _polynomials(self) -> tuple[Polynomials, Polynomials]:
        """Velocity and acceleration."""
        knots, derivatives = self.pieces
        speeds = np.asarray(self.derivative(knots, 1))
        powers = np.array([factorial(k) for k in range(len(derivatives) + 1)])[:, None]
        inside = np.vstack((speeds[:-1], derivatives)) / powers
        polynomials = []
        for first, last, terms in (
            (speeds[0], speeds[-1], inside),
            (0.0, 0.0, inside[1:] * np.arange(1, len(inside))[:, None]),
        ):
            ends = np.zeros((2, len(terms)))
            ends[:, 0] = first, last
            origins = np.concatenate((knots[:1], knots))
            polynomials.append(Polynomials(knots, origins, np.concatenate((ends[:1], terms.T, ends[1:]))))
        return polynomials[0], polynomials[1]

    def derivative(self, time: Any, order: int) -> Any:
        """The derivative of the spline less its baseline; at constant velocity outside the record."""
        within = np.clip(time, self.first, self.last)
        value = self._without_drift(within, order)
        if order == 0:
            return value + self._without_drift(within, 1) * (time - within)
        return value if order == 1 else np.where(within == time, value, 0.0)

    def _without_drift(self, within: Any, order: int) -> Any:
        elapsed = within - self.first
        drift = self.steady * (elapsed**2 / 2, elapsed, 1.0)[order] if self.steady else 0.0
        return self._splines[order](within) - drift


def _join_samples(
    times: Floats, values: Floats, degree: int, of: int, interpolation: str = "auto"
) -> tuple[Any, Booleans]:
    """The curve through samples (T,) of a derivative of the order `of`, and its intervals (T - 1,) without a spline."""
    slopes = monotone_slopes(times, values)

    def spline(first: int, last: int) -> Any:
        """Where displacements are joined, its slopes at ends within the record are those of the cubics next to."""
        x, y = times[first : last + 1], values[first : last + 1]
        has_left, has_right = (of == 0 and k not in (0, len(times) - 1) for k in (first, last))
        ends = [
            [(1, slopes[k]), (2, 0.0)] if is_fastened else None
            for k, is_fastened in ((first, has_left), (last, has_right))
        ]
        inner = x[1 if has_left else (degree + 1) // 2 : -1 if has_right else -((degree + 1) // 2)]
        knots = np.concatenate((np.repeat(x[:1], degree + 1), inner, np.repeat(x[-1:], degree + 1)))
        return scipy.interpolate.make_interp_spline(x, y, k=degree, t=knots, bc_type=tuple(ends))

    is_straight = unsplined_intervals(times, values, spline, interpolation)
    if not is_straight.any():
        return scipy.interpolate.make_interp_spline(times, values, k=degree), is_straight
    coefficients = np.zeros((degree + 1, len(times) - 1))
    coefficients[0] = values[:-1]
    h = np.diff(times)
    coefficients[1] = np.diff(values) / h
    if of == 0:
        bend = (slopes[:-1] + slopes[1:] - 2 * coefficients[1]) / h
        coefficients[1:4] = slopes[:-1], (coefficients[1] - slopes[:-1]) / h - bend, bend / h
    for first, last in splined_stretches(is_straight):
        curve = spline(first, last)
        for k in range(degree + 1):
            coefficients[k, first:last] = curve.derivative(k)(times[first:last]) / factorial(k)
    return scipy.interpolate.PPoly(coefficients[::-1], times), is_straight


class RandomProcess(PiecewiseMotion):
    """One realization of a random process, a sum of sines."""

    def __init__(self, motion: RandomMotion | RandomForce) -> None:
        order = ORDERS[motion.of] if isinstance(motion, RandomMotion) else self.force
        grid = np.array(motion.frequency_hz)
        first, last = np.ceil(grid[0] * motion.duration), np.floor(grid[-1] * motion.duration)
        f = np.arange(max(first, 1.0), last + 1) / motion.duration
        psd = psd_at(grid, np.array(motion.psd), f)
        phases = np.random.default_rng(motion.seed).uniform(0.0, tau, len(f))
        self.omega = tau * f
        size = np.sqrt(2 * psd / motion.duration) / self.omega**order
        self.lines = size * np.exp(1j * (phases + {0: 0.0, 1: -pi / 2, 2: pi}[order]))
        self.shortest, self.duration = 0.5 / float(f[-1]), motion.duration
        self.words = (
            f"a sum of {len(f)} sines from {f[0]:.4g} to {f[-1]:.4g} Hz that repeats after {motion.duration:g} s"
        )

    @cached_property
    def _orders(self) -> list[Any]:
        return [self.lines * (1j * self.omega) ** order for order in range(3)]

    def derivative(self, time: Any, order: int) -> Any:
        """Re Σ (iω)ⁿ c e^{iωt}."""
        times, lines = np.asarray(time, dtype=float), self._orders[order]
        if times.size == 1:
            angles = self.omega * times.item()
            return np.full(times.shape, lines.real @ np.cos(angles) - lines.imag @ np.sin(angles))
        rows = max(1, NUMBERS_IN_CHUNK // len(lines))
        flat = times.ravel()
        parts = [self._sum_lines(lines, flat[at : at + rows]) for at in range(0, len(flat), rows)]
        return np.concatenate(parts).reshape(times.shape)

    def polynomials(self, order: int) -> Polynomials:
        """Taylor's, about equal parts of the duration."""
        if order not in self._polynomials:
            self._polynomials[order] = self._taylor_pieces(order)
        return self._polynomials[order]

    @cached_property
    def _polynomials(self) -> dict[int, Polynomials]:
        return {}

    @cached_property
    def _places(self) -> tuple[Floats, Floats]:
        """Where pieces end, and the instants (s) about which they are expanded."""
        count = 2 * ceil(self.duration * self.omega[-1] / PHASE_OF_PIECE / 2)
        places = np.arange(count + 1) * (self.duration / count)
        return (places[:-1] + places[1:]) / 2, places

    def _taylor_pieces(self, order: int) -> Polynomials:
        numbers, count = np.rint(self.omega * self.duration / tau).astype(np.int64), len(self._places[0])
        coefficients = np.empty((count + 1, TAYLOR_TERMS))
        for term in range(TAYLOR_TERMS):
            bins = np.zeros(count // 2 + 1, dtype=complex)
            bins[numbers] = self.lines * (1j * self.omega) ** (order + term) * (count / 2 / factorial(term))
            coefficients[:-1, term] = np.fft.irfft(bins, count)
        coefficients[-1] = coefficients[0]
        return Polynomials(*self._places, coefficients, self.duration)

    def _sum_lines(self, lines: Any, times: Floats) -> Floats:
        angles = np.multiply.outer(times, self.omega)
        return np.asarray(np.cos(angles) @ lines.real - np.sin(angles) @ lines.imag)


FUNCTIONS_OF_TIME: dict[type, Callable[[Any], PrescribedMotion]] = {
    **dict.fromkeys((SineMotion, SineForce), Sine),
    **dict.fromkeys((SweepMotion, SweepForce), SweptSine),
    **dict.fromkeys((RecordMotion, RecordForce), Record),
    **dict.fromkeys((RandomMotion, RandomForce), RandomProcess),
    ConstantForce: Constant,
}


@lru_cache(maxsize=32)
def prescribed_motion(motion: SupportMotion | Force) -> PrescribedMotion:
    """A support's motion as functions of time; of a force the function whose derivative of the order `force` it is."""
    return FUNCTIONS_OF_TIME[type(motion)](motion)


def band(degree: int, derivatives: int) -> float:
    """Return up to which frequency, per sample, a spline gives a derivative of a sine within BAND_ERROR, with images.

    The spline of degree n through evenly spaced samples of e^{2πift} consists of e^{2πi(f−k)t} for all whole k, with
    the weights (f−k)^{−n−1} / Σ_k (f−k)^{−n−1} [Schoenberg1973, lecture 4].
    """

    def excess(f: float) -> float:
        weights = (f / (f - IMAGES)) ** (degree + 1)
        main = 1 / (1 + weights.sum())
        images = main * weights * ((f - IMAGES) / f) ** derivatives
        return float(np.sqrt((main - 1) ** 2 + np.sum(images**2))) - BAND_ERROR

    return float(scipy.optimize.brentq(excess, 1e-3, 0.49))
