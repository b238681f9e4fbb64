"""The prescribed length of a hoisted rope: a law of time made of polynomials.

    smooth        l = l₀ + Δ (10 s³ − 15 s⁴ + 6 s⁵),  s = (t − begin)/duration: speed and acceleration end at 0
    trapezoidal   the speed rises linearly for a fraction of the duration, is constant, and falls equally long
    a record      the cubic spline through its points with speed 0 at both ends; where that would leave the range of
                  its samples, cubics that do not

Before a law begins and after its end the length is constant. A travel is such a law too: within limits of speed,
acceleration and jerk, or the sum of several delayed ones.

A spline through a step, a corner or a gap overshoots. An interval in which it leaves the range of the four samples
around is joined without it, and the splines on either side are recomputed, until none overshoots; a spline needs at
least six samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate
from math import ceil, comb, inf, sqrt
from typing import Any

import numpy as np

from modal.report import Displayed
from modal.types import NOISE_OF_SUM, NOISE_OF_TERMS, Booleans, Floats


@dataclass(frozen=True, eq=False, repr=False)
class LengthLaw(Displayed):
    """A length (m) in K pieces: Σ c_k (t − t_i)^k between the `knots` t (K + 1,) in s, with `coefficients` (K, d).

    `words` say where a record is not joined by a spline.
    """

    what = "Length as a function of time"
    shows = "words: given as; knots: knots, s"

    knots: Floats
    coefficients: Floats
    words: str = ""

    def __call__(self, times: Any) -> tuple[Floats, Floats, Floats]:
        """Length (m), its speed (m/s) and its acceleration (m/s²) at times (s) of any shape."""
        t = np.asarray(times, dtype=np.float64)
        first, last = self.knots[0], self.knots[-1]
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.coefficients) - 1)
        s, moving = np.clip(t, first, last) - self.knots[piece], (t >= first) & (t < last)
        length, speed, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for coefficient in self.coefficients.T[::-1]:
            acceleration = acceleration * s + 2 * speed
            speed = speed * s + length
            length = length * s + coefficient[piece]
        return length, np.where(moving, speed, 0.0), np.where(moving, acceleration, 0.0)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The times (s) at which a derivative may jump."""
        return tuple(self.knots.tolist())

    @property
    def end(self) -> float:
        """The length (m) to which the last piece leads."""
        span = self.knots[-1] - self.knots[-2]
        return float(self.coefficients[-1] @ span ** np.arange(self.coefficients.shape[1]))

    @property
    def greatest(self) -> float:
        """A bound of all lengths, speeds and accelerations (SI); inf or NaN if double precision has none."""
        sizes, bounds = np.abs(self.coefficients), []
        powers = np.diff(self.knots)[:, None] ** np.arange(sizes.shape[1])
        for _ in range(3):
            bounds.append(np.max(np.sum(sizes * powers[:, : sizes.shape[1]], axis=1)))
            sizes = sizes[:, 1:] * np.arange(1.0, sizes.shape[1])
        return float(np.max(bounds))

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """The shortest and the longest length (m)."""
        lengths, spans, pieces = [*self(self.knots)[0].tolist()], np.diff(self.knots), self.coefficients
        reach = np.sum(np.abs(pieces[:, 1:]) * spans[:, None] ** np.arange(1, pieces.shape[1]), axis=1)
        may_exceed = (pieces[:, 0] - reach < min(lengths)) | (pieces[:, 0] + reach > max(lengths))
        for span, piece in zip(spans[may_exceed], pieces[may_exceed], strict=True):
            slope = np.polynomial.Polynomial(piece).deriv()
            roots = slope.roots() if np.any(slope.coef[1:]) else np.empty(0)
            # complex roots do no harm: they only add further lengths to examine
            inside = roots.real[(roots.real > 0) & (roots.real < span)]
            lengths += [float(np.polynomial.Polynomial(piece)(root)) for root in inside]
        return min(lengths), max(lengths)


@lru_cache(maxsize=256)
def profile_law(length: float, to: float, begin: float, span: float, share: float | None) -> LengthLaw:
    """Return a law from a `length` (m) `to` another over `span` (s): smooth, or with a trapezoidal speed."""
    change = to - length
    if share is None:
        powers = span ** -np.arange(6.0) * np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * change
        powers[0] = length
        return LengthLaw(np.array([begin, begin + span]), powers[None])
    ramp = span * share
    speed = change / (span - ramp)
    knots = begin + np.array([0.0, ramp, span - ramp, span])
    rising, cruising = [length, 0.0, speed / (2 * ramp)], [length + speed * ramp / 2, speed, 0.0]
    falling = [to - speed * ramp / 2, speed, -speed / (2 * ramp)]
    segments = [0, 1, 2] if span > 2 * ramp else [0, 2]
    return LengthLaw(knots[[*segments, 3]], np.array([rising, cruising, falling])[segments])


def limited_law(
    distance: float, begin: float, speed: float, acceleration: float, jerk: float = inf, step: float = 0.0
) -> LengthLaw:
    """Return the fastest travel over a `distance` (m), at rest before `begin` (s) and afterwards, within limits (SI).

    The acceleration rises at the limit of the jerk, is constant, and falls, the speed is constant, and all of it is
    mirrored; phases for which the distance is too short are omitted. Without a limit of the jerk the speed is
    trapezoidal. With a `step` (s) every phase lasts a multiple of it, a little longer and with lower peaks.

    >>> limited_law(6.0, 0.0, 2.0, 1.0).knots.tolist(), limited_law(1.0, 0.0, 2.0, 1.0).knots.tolist()
    ([0.0, 2.0, 3.0, 5.0], [0.0, 1.0, 2.0])
    """
    full = acceleration / jerk
    peak = min(speed, 2 * distance / (full + sqrt(full**2 + 4 * distance / acceleration)))
    if peak >= acceleration * full:
        rise, constant = full, peak / acceleration - full
    else:
        peak = min(speed, (distance**2 * jerk / 4) ** (1 / 3))
        rise, constant = sqrt(peak / jerk), 0.0
    cruise = max(distance / peak - 2 * rise - constant, 0.0)
    if step:
        rise, constant, cruise = (step * ceil(phase / step * (1 - NOISE_OF_SUM)) for phase in (rise, constant, cruise))
    ramp = distance / (2 * rise + constant + cruise) / (rise + constant)
    slope = ramp / rise if rise else 0.0
    knots = begin + np.array([*accumulate((0.0, rise, constant, rise, cruise, rise, constant, rise))])
    has_length = np.diff(knots) > NOISE_OF_TERMS * (knots[-1] - begin)
    bends = np.array([0.0, ramp, ramp, 0.0, 0.0, -ramp, -ramp])[has_length]
    return integrated_law(
        np.append(knots[:-1][has_length], knots[-1]), bends, slope * np.array([1, 0, -1, 0, -1, 0, 1])[has_length]
    )


def integrated_law(knots: Floats, acceleration: Floats, jerk: Floats) -> LengthLaw:
    """Return the travel from rest with an `acceleration` (m/s²) at the start and a constant `jerk` in each of K pieces.

    >>> integrated_law(np.array([0.0, 2.0]), np.array([3.0]), np.array([0.0])).end
    6.0
    """
    h = np.diff(knots)
    speed = np.concatenate(([0.0], np.cumsum(h * (acceleration + h * jerk / 2))[:-1]))
    way = np.concatenate(([0.0], np.cumsum(h * (speed + h * (acceleration / 2 + h * jerk / 6)))[:-1]))
    return LengthLaw(knots, np.stack((way, speed, acceleration / 2, jerk / 6), axis=1))


def superposed(law: LengthLaw, delays: Floats, amplitudes: Floats) -> LengthLaw:
    """Σ A_i l(t − t_i), whose knots are those of all parts.

    >>> superposed(limited_law(6.0, 0.0, 2.0, 1.0), np.array([0.0, 9.0]), np.array([0.5, 0.5])).end
    6.0
    """
    knots = np.unique(np.add.outer(delays, law.knots))
    knots = knots[np.append(True, np.diff(knots) > NOISE_OF_TERMS * np.abs(knots).max())]
    middles = (knots[1:] + knots[:-1]) / 2
    pieces, degree = law.coefficients, law.coefficients.shape[1]
    coefficients = np.zeros((len(middles), degree))
    for delay, amplitude in zip(delays.tolist(), amplitudes.tolist(), strict=True):
        before, after = middles - delay < law.knots[0], middles - delay >= law.knots[-1]
        coefficients[:, 0] += amplitude * (before * pieces[0, 0] + after * law.end)
        within = ~(before | after)
        piece = np.searchsorted(law.knots, middles[within] - delay, side="right") - 1
        shift = knots[:-1][within] - delay - law.knots[piece]
        for k in range(degree):
            for power in range(k + 1):
                terms = amplitude * comb(k, power) * pieces[piece, k] * shift ** (k - power)
                coefficients[within, power] += terms
    return LengthLaw(knots, coefficients)


@lru_cache(maxsize=64)
def recorded_law(times: tuple[float, ...], lengths: tuple[float, ...], interpolation: str = "auto") -> LengthLaw:
    """Return the law of a record."""
    return spline(np.array(times), np.array(lengths), interpolation)


def spline(times: Floats, lengths: Floats, interpolation: str = "auto") -> LengthLaw:
    """Return the law through lengths (m) at ascending times (s), both (T,), with speed 0 at both ends."""
    resting = monotone_slopes(times, lengths)
    resting[[0, -1]] = 0.0

    def between(first: int, last: int) -> LengthLaw:
        part = slice(first, last + 1)
        return _cubics(times[part], lengths[part], _speeds(times[part], lengths[part], resting[[first, last]]))

    is_straight = unsplined_intervals(
        times, lengths, lambda first, last: lambda at: between(first, last)(at)[0], interpolation
    )
    speed = resting.copy()
    for first, last in splined_stretches(is_straight):
        speed[first : last + 1] = _speeds(times[first : last + 1], lengths[first : last + 1], resting[[first, last]])
    words = unsplined_words(times, is_straight, "cubics")
    return replace(_cubics(times, lengths, speed), words=words)


def _cubics(times: Floats, lengths: Floats, speed: Floats) -> LengthLaw:
    """Cubics between samples with these speeds at them."""
    h = np.diff(times)
    slope = np.diff(lengths) / h
    bend = (speed[:-1] + speed[1:] - 2 * slope) / h
    return LengthLaw(times, np.stack((lengths[:-1], speed[:-1], (slope - speed[:-1]) / h - bend, bend / h), axis=1))


def _speeds(times: Floats, lengths: Floats, ends: Floats) -> Floats:
    """The speeds (T,) of the cubic spline through samples with those (2,) at both `ends`.

    ([DeBoor1978, ch. IV]: the speeds at the knots from one tridiagonal system.)
    """
    h = np.diff(times)
    slope = np.diff(lengths) / h
    speed = np.zeros(len(times))
    speed[0], speed[-1] = ends
    if len(times) == 2:
        return speed
    right = 3 * (h[:-1] * slope[1:] + h[1:] * slope[:-1])
    right[0] -= h[1] * speed[0]
    diagonal = 2 * (h[:-1] + h[1:])
    for i in range(1, len(right)):
        share = h[i + 1] / diagonal[i - 1]
        diagonal[i] -= share * h[i - 1]
        right[i] -= share * right[i - 1]
    for i in reversed(range(len(right))):
        speed[i + 1] = (right[i] - h[i] * speed[i + 2]) / diagonal[i]
    return speed


SPLINE_SAMPLES_MIN = 6
"""Format: samples of a spline of degree 5."""
SPLINE_EXCESS_OF_RECORD = 0.02
"""Tolerance: distance of a spline from the samples, over the range of the record: that of noise."""
SPLINE_EXCESS_OF_SAMPLES = 0.45
"""Tolerance: and over the range of these samples: a sine of 2.8 samples a period, of which a spline still is within a
percent, is 0.42 of it above them at its top."""
SPLINE_PLACES = np.arange(1, 8) / 8
"""Tolerance: places within an interval at which a spline is examined."""
Spline = Callable[[int, int], Callable[[Floats], Floats]]
"""The spline through the samples from one to another, both included."""


def unsplined_intervals(times: Floats, values: Floats, spline: Spline, interpolation: str = "auto") -> Booleans:
    """The intervals (T - 1,) between samples at `times`, both (T,), that are joined without a spline."""
    if interpolation != "auto":
        return np.full(len(times) - 1, interpolation == "linear")
    before, after = np.append(values[0], values[:-2]), np.append(values[2:], values[-1])
    neighbours = np.array([before, values[:-1], values[1:], after])
    low, high = neighbours.min(0), neighbours.max(0)
    room = SPLINE_EXCESS_OF_RECORD * np.ptp(values) + SPLINE_EXCESS_OF_SAMPLES * (high - low)
    straight, tried_stretches = np.zeros(len(times) - 1, dtype=bool), set[tuple[int, int]]()
    while new := [ends for ends in splined_stretches(straight) if ends not in tried_stretches]:
        for first, last in new:
            tried_stretches.add((first, last))
            if straight.any() and last - first + 1 < SPLINE_SAMPLES_MIN:
                straight[first:last] = True
                continue
            inner = times[first:last, None] + np.diff(times)[first:last, None] * SPLINE_PLACES
            curve, stretch = spline(first, last)(inner), slice(first, last)
            is_below, is_above = curve < (low - room)[stretch, None], curve > (high + room)[stretch, None]
            straight[stretch] = (is_below | is_above | np.isnan(curve)).any(axis=1)
    return straight


def splined_stretches(straight: Booleans) -> list[tuple[int, int]]:
    """The first and the last sample of each stretch of intervals that are joined by a spline."""
    edges = np.flatnonzero(np.diff(np.concatenate(([True], straight, [True])).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def unsplined_words(times: Floats, is_straight: Booleans, joined_by: str) -> str:
    """Return a line on where a record is joined without a spline; "" if nowhere."""
    at = np.flatnonzero(is_straight)
    if not at.size:
        return ""
    where = "all intervals" if is_straight.all() else f"{at.size} of {is_straight.size} intervals"
    ends = f"from {times[at[0]]:.5g} to {times[at[-1] + 1]:.5g} s"
    return f"{joined_by} join the samples of {where}, {ends}, where a spline would leave their range"


def monotone_slopes(times: Floats, values: Floats) -> Floats:
    """Slopes (T,) with which cubics between samples stay within the range of both.

    [Fritsch1984, equation (7)]
    """
    h = np.diff(times)
    slope = np.diff(values) / h
    slopes = np.concatenate((slope[:1], np.zeros(len(times) - 2), slope[-1:]))
    alike = np.flatnonzero(slope[:-1] * slope[1:] > 0)
    left, right, share = slope[alike], slope[alike + 1], (h[alike] + 2 * h[alike + 1]) / (3 * (h[alike] + h[alike + 1]))
    slopes[alike + 1] = left * right / (share * right + (1 - share) * left)
    return slopes
