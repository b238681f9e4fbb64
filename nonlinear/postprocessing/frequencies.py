"""Frequencies of the lines in an evenly sampled real signal, far beyond the resolution 2π/T of its spectrum.

With the window's own time s = (t − middle)/(T/2) and x = ωT/2, amplitudes and frequencies of the lines

    f(s) ≈ m + Σ_j [ a_j cos(x_j s) + b_j sin(x_j s) ]

are those whose residual r is orthogonal to any small change of them,

    ⟨r, 1⟩ = ⟨r, cos x_j s⟩ = ⟨r, sin x_j s⟩ = ⟨r, s (b_j cos x_j s − a_j sin x_j s)⟩ = 0,    ⟨f, g⟩ = Σ χ f g,

with the window χ = (1 + cos πs)^p.  For one line this is the maximum of |⟨f, e^{ixs}⟩| [Laskar1990],
[Laskar1993]; solved for all lines at once it needs no Gram–Schmidt step and no correction for the
lines' images at −ω.  An omitted line shifts the others by its amplitude over the (2p + 1)-th power of its distance.  χ
and its derivatives vanish at both ends, which makes the sum over the samples as accurate as the integral.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, inf, pi
from sys import float_info
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.errors import ComputationError
from modal.types import Floats

ORDER = 3
"""Format: the power p of the window."""
OTHER_ORDERS = (2, 4)
LEAST_PERIODS = 4.0
"""Limit: periods of a line in a signal."""
PEAK_TO_NOISE_MIN = 30.0
"""Tolerance: of a line over the median of the spectrum, above any peak of noise."""
GAUSS_NEWTON_STEPS = 60
"""Limit: steps to a frequency, beyond which it does not converge."""


@dataclass(frozen=True)
class SpectralLine:
    """A cos(ωt + φ): `omega` (rad/s) to within `error`, `amplitude` in the signal's unit, `phase` φ at t = 0 (rad)."""

    omega: float
    amplitude: float
    phase: float
    error: float

    @property
    def relative_error(self) -> float:
        """The relative error of the frequency."""
        return self.error / self.omega


class _Waves(NamedTuple):
    """The mean and, line by line, x, a and b (K,)."""

    mean: float
    x: Floats
    a: Floats
    b: Floats

    @property
    def amplitude(self) -> Floats:
        return np.hypot(self.a, self.b)


@dataclass(frozen=True, eq=False)
class _Signal:
    """Values f (N,) at s (N,) from −1 to 1 and their window χ (N,)."""

    s: Floats
    f: Floats
    window: Floats

    @classmethod
    def of(cls, values: Floats, order: int = ORDER) -> _Signal:
        s = np.linspace(-1.0, 1.0, len(values))
        window = (1 + np.cos(pi * s)) ** order
        return cls(s, values, window / window.mean())

    def residual(self, waves: _Waves) -> Floats:
        """The residual (N,) after the lines."""
        angle = np.outer(self.s, waves.x)
        return np.asarray(self.f - waves.mean - np.cos(angle) @ waves.a - np.sin(angle) @ waves.b)

    def spectrum(self, waves: _Waves) -> tuple[Floats, Floats]:
        """The x and amplitudes of the residual's spectrum, as if each were a single line."""
        size = np.abs(np.fft.rfft((self.window * self.residual(waves))[:-1], 4 * (len(self.f) - 1)))
        return np.asarray(pi / 4 * np.arange(len(size)), dtype=np.float64), np.asarray(2 * size / len(self.f))

    def coefficients(self, *columns: Floats) -> list[Floats]:
        """Least-squares coefficients (1,) and (K,) ... of 1 and these columns (N, K) ... in f."""
        root, sizes = np.sqrt(self.window)[:, None], np.cumsum([1, *(part.shape[1] for part in columns)])
        matrix = np.hstack((np.ones((len(self.s), 1)), *columns)) * root
        return np.split(np.linalg.lstsq(matrix, self.f * root[:, 0], rcond=None)[0], sizes[:-1])

    @property
    def rounding(self) -> float:
        """The rounding error of a sum of all samples, relative."""
        return len(self.s) * float_info.epsilon

    def waves_at(self, x: Floats) -> _Waves:
        """Lines at x (K,) with the best-fitting amplitudes and phases."""
        angle = np.outer(self.s, x)
        mean, a, b = self.coefficients(np.cos(angle), np.sin(angle))
        return _Waves(float(mean[0]), x, a, b)

    def fit(self, x: Floats) -> _Waves:
        """Lines from x (K,) moved until the residual is orthogonal to their variations (Gauss–Newton)."""
        waves = self.waves_at(x)
        for _ in range(GAUSS_NEWTON_STEPS):
            waves, is_rounding = self._step(waves)
            if is_rounding:
                return waves
        raise ComputationError("the signal has no steady spectral line: its frequency does not converge")

    def _step(self, waves: _Waves) -> tuple[_Waves, bool]:
        """One Gauss–Newton step, and whether the remainder is rounding."""
        angle, size = np.outer(self.s, waves.x), np.maximum(waves.amplitude, float_info.min)
        c, d = np.cos(angle), np.sin(angle)
        mean, a, b, shift = self.coefficients(c, d, self.s[:, None] * (c * waves.b - d * waves.a) / size)
        move = np.clip(shift / size, -pi / 4, pi / 4)
        unclear = self.rounding * waves.x + 4 * float_info.epsilon * np.abs(self.f).max() / size
        return _Waves(float(mean[0]), waves.x + move, a, b), bool(np.all(np.abs(move) <= unclear))

    def noise(self, waves: _Waves) -> Floats:
        """How far (K,) in x the residual, at its strength next to each line, may have moved it."""
        rest = self.window * self.residual(waves) * self.s
        offsets = pi * np.concatenate((-(aside := np.arange(ORDER + 1, ORDER + 9)), aside))
        level = [np.sqrt(np.mean(np.abs(np.exp(-1j * np.outer(x + offsets, self.s)) @ rest) ** 2)) for x in waves.x]
        return np.asarray(np.sqrt(2) * np.array(level) / (waves.amplitude * np.sum(self.window * self.s**2)))


def line(times: ArrayLike, values: ArrayLike, near: float | None = None) -> SpectralLine:
    """The strongest line, or the strongest within a quarter of `near` (rad/s), with companion lines removed.

    `times` (N,) in s, evenly spaced; `values` (N,). `error` bounds the error of `omega` in practice: it sums the
    differences found with other windows (of order 2 and 4, the first and the last three quarters of the signal) and the
    effect of the residual near the line. Raise ComputationError if the signal is too short for the line (less than 4
    periods), has none, or its frequency does not converge.
    """
    return _strongest_lines(times, values, 1, near)[0]


def lines(times: ArrayLike, values: ArrayLike, count: int) -> tuple[SpectralLine, ...]:
    """At most `count` lines, the strongest first, only those that stand out.  Arguments and errors as for `line`."""
    strongest = _strongest_lines(times, values, count, None)
    return tuple(sorted(strongest, key=lambda line: -line.amplitude)[:count])


def attention(count: int) -> Floats:
    """The weights (count,), of sum 1, of the instantaneous frequency at each sample where it changes slowly.

    For a phase φ(s) with ⟨…⟩ as above the maximum lies at ω = ⟨s φ⟩/⟨s²⟩, by parts ∫ φ'(s) ∫_s^1 χ(σ) σ dσ ds / ⟨s²⟩.
    """
    signal = _Signal.of(np.zeros(count))
    moment = signal.window * signal.s
    weight = np.cumsum(moment[::-1])[::-1] - moment / 2
    return np.asarray(weight / weight.sum())


def _strongest_lines(times: ArrayLike, values: ArrayLike, count: int, near: float | None) -> list[SpectralLine]:
    t, f = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    half = _half_length(t, f)
    band = (0.0, np.inf) if near is None else tuple(near * half * side for side in (1 - 1 / 4, 1 + 1 / 4))
    signal = _Signal.of(f)
    waves = _add_lines(signal, _first(signal, band), count + 4)  # with companions, which would shift them
    error = signal.noise(waves) * 4 + _spread(signal, waves) + 8 * float_info.epsilon * waves.x
    middle = float(t[0] + half)
    return [
        SpectralLine(x / half, hypot(a, b), _principal_angle(atan2(-b, a) - x / half * middle), e / half)
        for x, a, b, e in zip(*(part.tolist() for part in (*waves[1:], error)), strict=True)
    ]


def _half_length(t: Floats, f: Floats) -> float:
    if t.ndim != 1 or t.shape != f.shape or len(t) < 4 * LEAST_PERIODS:
        raise ComputationError(f"a signal of {f.size} values: needs at least {4 * LEAST_PERIODS:g}, one for each time")
    step = np.diff(t)
    if not np.all(np.isfinite(f)) or np.ptp(step) > 1e-6 * step.mean() or step.mean() <= 0:
        raise ComputationError("the values of a signal must be finite and its times evenly spaced")
    return float(t[-1] - t[0]) / 2


def _first(signal: _Signal, band: Sequence[float]) -> _Waves:
    x, size = signal.spectrum(signal.waves_at(np.zeros(0)))
    size = np.where((x >= band[0]) & (x <= band[1]), size, 0.0)
    at = int(np.argmax(size))
    if size[at] <= float_info.epsilon * np.abs(signal.f).max():
        raise ComputationError("the signal has no line")
    if x[at] < LEAST_PERIODS * pi:
        raise ComputationError(f"the signal holds only {x[at] / pi:.3g} periods: at least {LEAST_PERIODS:g} are needed")
    return signal.fit(x[at : at + 1])


def _add_lines(signal: _Signal, waves: _Waves, count: int) -> _Waves:
    """Further lines that stand out of the residual, the strongest one at a time, all fitted together."""
    while len(waves.x) < count:
        x, size = signal.spectrum(waves)
        is_separate = np.abs(x[:, None] - waves.x).min(1) >= pi * (ORDER + 1)
        size = np.where(is_separate & (x >= LEAST_PERIODS * pi), size, 0.0)
        at, strongest = int(np.argmax(size)), waves.amplitude.max()
        if size[at] < max(PEAK_TO_NOISE_MIN * float(np.median(size)), signal.rounding * strongest):
            break
        try:
            extension = signal.fit(np.append(waves.x, x[at]))
        except ComputationError:
            break
        are_close = np.any(np.diff(np.sort(extension.x)) < pi * ORDER) or extension.x.min() < pi
        if are_close or np.any(np.abs(extension.x[:-1] - waves.x) > pi):
            break
        waves = extension
    return waves


def _spread(signal: _Signal, waves: _Waves) -> Floats:
    """The largest differences (K,) in x between windows."""
    length = round(3 / 4 * (len(signal.f) - 1)) + 1
    full, early, late = slice(None), slice(length), slice(-length, None)
    windows = [(full, order) for order in OTHER_ORDERS] + [(early, ORDER), (late, ORDER)]
    positions = np.array([_refit(signal, waves, *window) for window in windows])
    return np.asarray(np.max(np.abs(positions - waves.x), axis=0))


def _refit(signal: _Signal, waves: _Waves, piece: slice, order: int) -> Floats:
    """The x (K,) of the same lines in another window: fitted together, or one by one if that does not converge."""
    part = (len(signal.f[piece]) - 1) / (len(signal.f) - 1)
    try:
        return _Signal.of(signal.f[piece], order).fit(waves.x * part).x / part
    except ComputationError:
        return np.array([_fit_single(signal, waves, at, piece, order) / part for at in range(len(waves.x))])


def _fit_single(signal: _Signal, waves: _Waves, at: int, piece: slice, order: int) -> float:
    """The x of one line in another window, the others subtracted; far off where it does not converge."""
    others = _Waves(waves.mean, *(np.delete(part, at) for part in waves[1:]))
    single = _Signal.of(signal.residual(others)[piece], order)
    try:
        return float(single.fit(waves.x[[at]] * (len(single.f) - 1) / (len(signal.f) - 1)).x[0])
    except ComputationError:
        return inf


def _principal_angle(angle: float) -> float:
    """The same angle in (−π, π]."""
    return atan2(np.sin(angle), np.cos(angle))
