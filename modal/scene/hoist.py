"""The prescribed length of a rope that is hoisted or lowered: a law of time, made of polynomials.

    smooth        l = l₀ + Δ (10 s³ − 15 s⁴ + 6 s⁵),  s = (t − begin)/duration: speed and acceleration end at 0
    trapezoidal   the speed rises linearly for a share of the duration, is constant, and falls as long
    a record      the cubic spline through its points with speed 0 at both ends

Before a law begins and after its end the length is constant.
"""

from __future__ import annotations

import csv
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed
from modal.scene.validation import POSITIVE, REAL, Part, field, number, one_of, optional
from modal.types import Floats

COLUMNS = ["time_s", "length_m"]
SAME = 1e-9
"""Relative difference up to which a record begins at the length of its link."""
RAMP = 0.25
Profile = Literal["smooth", "trapezoidal"]


class Hoist(Part):
    """A new length `to` (m), from `begin` (s) over `duration` (s), or a record `file` with `time_s,length_m`.

    `ramp` is the share of the duration for which a trapezoidal speed rises, and falls.
    """

    to: float | None = field(optional(POSITIVE), default=None)
    begin: float = field(REAL, default=0.0)
    duration: float | None = field(optional(POSITIVE), default=None)
    profile: Profile = field(one_of("smooth", "trapezoidal"), default="smooth")
    ramp: float | None = field(optional(number(ge=1e-3, le=0.5)), default=None)
    file: str | None = field(optional({"type": "str", "min_length": 1}), default=None)

    def problems(self) -> Iterator[str]:
        """Neither a length nor a record, both, and a ramp of another profile."""
        given = [name for name in ("to", "duration") if getattr(self, name) is not None]
        if self.file is None:
            yield from (f".{name}: is required" for name in ("to", "duration") if name not in given)
        else:
            other = [*given, *["begin"] * (self.begin != 0), *["profile"] * (self.profile != "smooth")]
            yield from (f".{name}: does not belong to a record" for name in other)
        if self.ramp is not None and self.profile == "smooth":
            yield f'.ramp = {self.ramp}: needs profile = "trapezoidal"'

    def law(self, length: float) -> LengthLaw:
        """The length as a function of time, from `length` (m) on; SceneError for a record that cannot be used."""
        return _recorded(self.file, length) if self.file is not None else _law(self, length)


@dataclass(frozen=True, eq=False, repr=False)
class LengthLaw(Displayed):
    """A length (m) in K pieces: Σ c_k (t − t_i)^k between the `knots` t (K + 1,) in s, with `coefficients` (K, d)."""

    knots: Floats
    coefficients: Floats

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

    @cached_property
    def at(self) -> Callable[[float], tuple[float, float, float]]:
        """The same at one time, in plain floats, for up to the fifth power."""
        knots = self.knots.tolist()
        pieces = np.pad(self.coefficients, ((0, 0), (0, 6 - self.coefficients.shape[1]))).tolist()
        first, last = knots[0], knots[-1]
        before, after = ((float(self(time)[0]), 0.0, 0.0) for time in (first, last))

        def at(time: float) -> tuple[float, float, float]:
            if time < first:
                return before
            if time >= last:
                return after
            piece = bisect_right(knots, time) - 1
            a, b, c, d, e, f = pieces[piece]
            s = time - knots[piece]
            length = ((((f * s + e) * s + d) * s + c) * s + b) * s + a
            speed = (((5 * f * s + 4 * e) * s + 3 * d) * s + 2 * c) * s + b
            return length, speed, ((20 * f * s + 12 * e) * s + 6 * d) * s + 2 * c

        return at

    @property
    def breaks(self) -> tuple[float, ...]:
        """The times (s) at which a derivative may jump."""
        return tuple(self.knots.tolist())

    @property
    def extremes(self) -> tuple[float, float]:
        """The shortest and the longest length (m)."""
        found, spans, pieces = [*self(self.knots)[0].tolist()], np.diff(self.knots), self.coefficients
        reach = np.sum(np.abs(pieces[:, 1:]) * spans[:, None] ** np.arange(1, pieces.shape[1]), axis=1)
        beyond = (pieces[:, 0] - reach < min(found)) | (pieces[:, 0] + reach > max(found))
        for span, own in zip(spans[beyond], pieces[beyond], strict=True):
            slope = np.polynomial.Polynomial(own).deriv()
            roots = slope.roots() if np.any(slope.coef[1:]) else np.empty(0)
            inside = roots.real[(abs(roots.imag) < SAME) & (roots.real > 0) & (roots.real < span)]
            found += [float(np.polynomial.Polynomial(own)(root)) for root in inside]
        return min(found), max(found)


@lru_cache(maxsize=256)
def _law(hoist: Hoist, length: float) -> LengthLaw:
    assert hoist.to is not None
    assert hoist.duration is not None
    begin, span, change = hoist.begin, hoist.duration, hoist.to - length
    if hoist.profile == "smooth":
        powers = span ** -np.arange(6.0) * np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * change
        powers[0] = length
        return LengthLaw(np.array([begin, begin + span]), powers[None])
    ramp = span * (RAMP if hoist.ramp is None else hoist.ramp)
    speed = change / (span - ramp)
    knots = begin + np.array([0.0, ramp, span - ramp, span])
    rising, even = [length, 0.0, speed / (2 * ramp)], [length + speed * ramp / 2, speed, 0.0]
    falling = [hoist.to - speed * ramp / 2, speed, -speed / (2 * ramp)]
    kept = [0, 1, 2] if span > 2 * ramp else [0, 2]
    return LengthLaw(knots[[*kept, 3]], np.array([rising, even, falling])[kept])


def _recorded(name: str, length: float) -> LengthLaw:
    """The law of a record, which begins at `length`, as the file is now."""
    try:
        return _law_of(name, Path(name).read_bytes(), length)
    except OSError as error:
        raise SceneError([f"hoist.file {name}: cannot be read: {error.strerror or error}"]) from None


@lru_cache(maxsize=64)
def _law_of(name: str, content: bytes, length: float) -> LengthLaw:
    times, lengths = _read(name, content)
    problems = []
    if len(times) < 2 or not np.all(np.isfinite((times, lengths))) or np.any(np.diff(times) <= 0):
        problems.append("needs at least two finite rows with ascending times")
    elif abs(lengths[0] - length) > SAME * length:
        problems.append(f"begins at {lengths[0]:g} m, and its link has length = {length:g}")
    elif (law := spline(times, lengths)).extremes[0] <= 0:
        problems.append(f"the spline through it reaches a length of {law.extremes[0]:g} m: must be positive")
    if problems:
        raise SceneError([f"hoist.file {name}: {problem}" for problem in problems])
    return law


def _read(name: str, content: bytes) -> tuple[Floats, Floats]:
    try:
        rows = [row for row in csv.reader(StringIO(content.decode("utf-8-sig"), newline="")) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise SceneError([f"hoist.file {name}: cannot be read: {error}"]) from None
    rows = [row for row in rows if not row[0].startswith("#")]
    if not rows or [word.strip() for word in rows[0]] != COLUMNS:
        raise SceneError([f"hoist.file {name}: the first row must be {','.join(COLUMNS)}"])
    try:
        table = np.array([[float(word) for word in row] for row in rows[1:]]).reshape(-1, 2)
    except ValueError:
        raise SceneError([f"hoist.file {name}: every row must have two numbers"]) from None
    return table[:, 0], table[:, 1]


def spline(times: Floats, lengths: Floats) -> LengthLaw:
    """The cubic spline through lengths (m) at ascending times (s), both (T,), with speed 0 at both ends.

    (de Boor, A Practical Guide to Splines, 1978, ch. IV: the speeds at the knots from one tridiagonal system.)
    """
    h = np.diff(times)
    slope = np.diff(lengths) / h
    speed = np.zeros(len(times))
    right = 3 * (h[:-1] * slope[1:] + h[1:] * slope[:-1])
    diagonal = 2 * (h[:-1] + h[1:])
    for i in range(1, len(right)):
        share = h[i + 1] / diagonal[i - 1]
        diagonal[i] -= share * h[i - 1]
        right[i] -= share * right[i - 1]
    for i in reversed(range(len(right))):
        speed[i + 1] = (right[i] - h[i] * speed[i + 2]) / diagonal[i]
    bend = (speed[:-1] + speed[1:] - 2 * slope) / h
    return LengthLaw(times, np.stack((lengths[:-1], speed[:-1], (slope - speed[:-1]) / h - bend, bend / h), axis=1))
