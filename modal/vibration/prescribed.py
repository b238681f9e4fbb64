"""The prescribed motions of supports, and forces, as functions of time with two derivatives.

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

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property, lru_cache
from math import ceil, cos, factorial, inf, isnan, nan, pi, radians, sin, tau
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

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


class Polynomials(NamedTuple):
    """A function of time t: Σ c_k (t − t_i)^k in K pieces, of which each ends at one of the `knots` (K − 1,) in s.

    The t_i are the `origins` (K,), c the `coefficients` (K, d). It repeats after the `period` (s), inf if it does not;
    the origins of one that does part the period evenly, from its beginning to its end.
    """

    knots: Floats
    origins: Floats
    coefficients: Floats
    period: float = inf

    def beside(self, times: Floats) -> Floats:
        """The function at times of any shape (s)."""
        if self.period == inf:
            piece = np.searchsorted(self.knots, times, side="right")
        else:
            times = times % self.period
            piece = (times * self.pace + 0.5).astype(np.int64)
        s, value = times - self.origins[piece], np.zeros(np.shape(times))
        for coefficient in self.coefficients.T[::-1]:
            value = value * s + coefficient[piece]
        return value

    @property
    def pace(self) -> float:
        """Pieces a second (1/s) of a function that repeats."""
        return len(self.knots) / self.period

    @property
    def kinks(self) -> Floats:
        """How far the polynomials on both sides of each knot are apart half a piece away from it, at most, (K − 1,)."""
        left_pieces, right_pieces = self.coefficients[:-1], self.coefficients[1:].copy()
        shifted_pieces, s = left_pieces.copy(), (self.knots - self.origins[:-1])[:, None]
        for lowest in range(shifted_pieces.shape[1] - 1):
            for k in reversed(range(lowest, shifted_pieces.shape[1] - 1)):
                shifted_pieces[:, k] += s[:, 0] * shifted_pieces[:, k + 1]
        widths = np.diff(self.knots, prepend=-inf, append=inf)
        widths = np.where(np.isfinite(widths), widths, 0.0)
        reach = np.maximum(widths[:-1], widths[1:])[:, None] / 2
        return np.asarray(
            np.sum(np.abs(right_pieces - shifted_pieces) * reach ** np.arange(shifted_pieces.shape[1]), axis=1)
        )


class FloatRows(dict[int, tuple[float, ...]]):
    """The rows of these arrays joined, in plain floats, made as they are requested, this many at once."""

    BLOCK = 512

    def __init__(self, columns: Sequence[Floats]) -> None:
        super().__init__()
        self.columns = columns

    def __missing__(self, row: int) -> tuple[float, ...]:
        first = row - row % self.BLOCK
        block = np.hstack([column[first : first + self.BLOCK] for column in self.columns])
        self.update(enumerate(map(tuple, block.tolist()), first))
        return self[row]


def in_floats(functions: Sequence[Polynomials]) -> Callable[..., tuple[float, ...]]:
    """The functions at one time (s) in plain floats, as one function that is written for them.

    Those with the same pieces are looked up together; a further argument is of no use.
    """
    alike: dict[tuple[int, int, float], list[int]] = {}
    for k, function in enumerate(functions):
        alike.setdefault((id(function.knots), id(function.origins), function.period), []).append(k)
    space: dict[str, Any] = {"bisect_right": bisect_right}
    lines, values = ["def at(time, y=None):"], dict[int, str]()
    for g, numbers in enumerate(alike.values()):
        first, t, names, columns = functions[numbers[0]], "time", [f"s{g}"], [functions[numbers[0]].origins[:, None]]
        for k in numbers:
            used = functions[k].coefficients
            used = used[:, : 1 + int(np.flatnonzero(used.any(axis=0)).max(initial=0))]
            coefficient_names = [f"c{k}_{power}" for power in range(used.shape[1])]
            values[k] = coefficient_names[-1]
            for name in coefficient_names[-2::-1]:
                values[k] = f"({values[k]} * s{g} + {name})"
            names, columns = names + coefficient_names, [*columns, used]
        space[f"R{g}"], piece = FloatRows(columns), f"bisect_right(K{g}, time)"
        if first.period == inf:
            space[f"K{g}"] = first.knots.tolist()
        else:
            t, piece = f"t{g}", f"int(t{g} * {first.pace!r} + 0.5)"
            lines.append(f" t{g} = time % {first.period!r}")
        lines += [f" {', '.join(names)} = R{g}[{piece}]", f" s{g} = {t} - s{g}"]
    lines.append(f" return ({' '.join(f'{values[k]},' for k in range(len(functions)))})")
    exec(compile("\n".join(lines), "<inputs>", "exec"), space)
    return space["at"]  # type: ignore[no-any-return]


class PrescribedMotion(ABC):
    """A support's displacement (m), velocity (m/s) and acceleration (m/s²) in its direction.

    `breaks` (s) are the times at which its acceleration has a kink or a jump, `shortest` (s) the time in which it may
    change substantially.
    """

    breaks: tuple[float, ...] = ()
    shortest: float = inf
    words: str = ""
    """Remarks for the user."""
    units: Mapping[str, float] = {}
    """The keys of a scene that its constants come from, and the units of these there."""
    force: int = 2
    """The derivative that is the force, where a force is prescribed: a record's ends with it."""

    @property
    def constants(self) -> tuple[Any, ...]:
        """The numbers of a motion that plain arithmetic of these and of the time gives; none of any other."""
        return ()

    def with_constants(self, constants: Sequence[Any]) -> PrescribedMotion:
        """The motion with other constants, of any type that takes plain arithmetic and a sine."""
        raise NotImplementedError

    def polynomials(self, order: int) -> Polynomials | None:
        """The velocity (order 1) or the acceleration (2) piece by piece; None if it is no polynomial."""
        return None

    @abstractmethod
    def derivative(self, time: Any, order: int) -> Any:
        """The derivative of the displacement of this order, 0 to 2, at times of any shape (s)."""

    def beside(self, times: Any, order: int) -> Floats:
        """The velocity (order 1) or the acceleration (2) at many times, as fast as it can be had."""
        return np.asarray(self.derivative(np.asarray(times, dtype=float), order))

    def displacement(self, time: ArrayLike) -> Floats:
        """Displacement (m) at times of any shape (s)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 0))

    def velocity(self, time: ArrayLike) -> Floats:
        """Velocity (m/s)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 1))

    def acceleration(self, time: ArrayLike) -> Floats:
        """Acceleration (m/s²)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 2))

    def acceleration_at(self, time: float) -> float:
        """The acceleration (m/s²) at one time (s)."""
        return float(self.derivative(time, 2))

    def velocity_at(self, time: float) -> float:
        """The velocity (m/s) at one time (s)."""
        return float(self.derivative(time, 1))


class PiecewiseMotion(PrescribedMotion):
    """A motion whose velocity and acceleration are polynomials piece by piece."""

    @abstractmethod
    def polynomials(self, order: int) -> Polynomials:
        """The velocity (order 1) or the acceleration (2)."""

    @cached_property
    def acceleration_at(self) -> Callable[[float], float]:
        """In plain floats, from the polynomials."""
        at = in_floats([self.polynomials(2)])
        return lambda time: at(time)[0]

    @cached_property
    def velocity_at(self) -> Callable[[float], float]:
        """In plain floats, from the polynomials."""
        at = in_floats([self.polynomials(1)])
        return lambda time: at(time)[0]

    def beside(self, times: Any, order: int) -> Floats:
        """From the polynomials."""
        return self.polynomials(order).beside(np.asarray(times, dtype=float))


class Course(NamedTuple):
    """A prescribed time history: a derivative of a function."""

    motion: PrescribedMotion
    order: int

    def of(self, time: Any) -> Any:
        """Its value at a time (s) of any type that takes plain arithmetic."""
        return self.motion.derivative(time, self.order)

    @property
    def at(self) -> Callable[[float], float]:
        """Its value at one time (s), as fast as it can be had."""
        if self.order == 2:
            return self.motion.acceleration_at
        return self.motion.velocity_at if self.order == 1 else lambda time: float(self.motion.derivative(time, 0))

    def beside(self, times: Any) -> Floats:
        """At many times (s)."""
        return self.motion.beside(times, self.order)

    @property
    def polynomials(self) -> Polynomials | None:
        """The value piece by piece; None if it is no polynomial."""
        return self.motion.polynomials(self.order) if self.order else None


class Sine(PrescribedMotion):
    """A sin(ω t + φ)."""

    units = MappingProxyType({"amplitude": 1.0, "frequency_hz": tau, "phase_deg": radians(1.0)})
    force = 0

    def __init__(self, motion: SineMotion | SineForce) -> None:
        self.amplitude, self.omega, self.phase = motion.amplitude, tau * motion.frequency_hz, radians(motion.phase_deg)
        self.shortest = 0.5 / motion.frequency_hz

    @property
    def constants(self) -> tuple[Any, Any, Any]:
        """Amplitude (m), angular frequency (rad/s) and phase (rad)."""
        return self.amplitude, self.omega, self.phase

    def with_constants(self, constants: Sequence[Any]) -> Sine:
        """A sine with these."""
        new_sine = copy(self)
        new_sine.amplitude, new_sine.omega, new_sine.phase = constants
        return new_sine

    def derivative(self, time: Any, order: int) -> Any:
        """A ωⁿ sin(ω t + φ + n π/2)."""
        angle = self.omega * time + self.phase
        return self.amplitude * self.omega**order * (np.sin(angle), np.cos(angle), -np.sin(angle))[order]

    def acceleration_at(self, time: float) -> float:
        """In plain floats."""
        return -self.amplitude * self.omega**2 * sin(self.omega * time + self.phase)

    def velocity_at(self, time: float) -> float:
        """In plain floats."""
        return self.amplitude * self.omega * cos(self.omega * time + self.phase)


class Constant(PrescribedMotion):
    """The same value at all times."""

    units = MappingProxyType({"amplitude": 1.0})
    force = 0

    def __init__(self, motion: ConstantForce) -> None:
        self.amplitude: Any = motion.amplitude

    @property
    def constants(self) -> tuple[Any]:
        """The value."""
        return (self.amplitude,)

    def with_constants(self, constants: Sequence[Any]) -> Constant:
        """Another value."""
        new_constant = copy(self)
        (new_constant.amplitude,) = constants
        return new_constant

    def derivative(self, time: Any, order: int) -> Any:
        """The value, and 0 for derivatives."""
        return self.amplitude + 0.0 * time if order == 0 else 0.0 * time

    def acceleration_at(self, time: float) -> float:
        """Nothing."""
        return 0.0


class SweptSine(PrescribedMotion):
    """A sin(ψ) with ψ'' constant within the duration, zero outside."""

    force = 0

    def __init__(self, motion: SweepMotion | SweepForce) -> None:
        self.amplitude, self.first, self.last = motion.amplitude, tau * motion.from_hz, tau * motion.to_hz
        self.duration = motion.duration
        self.breaks = (0.0, motion.duration)
        self.shortest = 0.5 / max(motion.from_hz, motion.to_hz)

    def acceleration_at(self, time: float) -> float:
        """In plain floats."""
        omega, phase, acceleration = self._turning(time)
        return self.amplitude * (acceleration * cos(phase) - omega * omega * sin(phase))

    def velocity_at(self, time: float) -> float:
        """In plain floats."""
        omega, phase, _ = self._turning(time)
        return self.amplitude * omega * cos(phase)

    def _turning(self, time: float) -> tuple[float, float, float]:
        """Angular frequency (rad/s), phase (rad) and the change of the former (rad/s²) at one time (s)."""
        if time < 0.0:
            return self.first, self.first * time, 0.0
        rate, within = (self.last - self.first) / self.duration, min(time, self.duration)
        omega = self.first + rate * within
        phase = (self.first + omega) / 2 * within + omega * (time - within)
        return omega, phase, rate if time <= self.duration else 0.0

    def derivative(self, time: Any, order: int) -> Any:
        """By the chain rule."""
        within = np.clip(time, 0.0, self.duration)
        rate = (self.last - self.first) / self.duration
        omega = self.first + rate * within
        phase = (self.first + omega) / 2 * within + np.where(within == time, 0.0, omega * (time - within))
        if order == 0:
            return self.amplitude * np.sin(phase)
        if order == 1:
            return self.amplitude * omega * np.cos(phase)
        sweep_rate = np.where(within == time, rate, 0.0)
        return self.amplitude * (sweep_rate * np.cos(phase) - omega**2 * np.sin(phase))


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
