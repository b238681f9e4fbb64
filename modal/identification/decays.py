"""Poles of free decays by least squares, and by the logarithmic decrement of a single mode.

With every reading a sum of decaying oscillations about an offset,

    y(t) = b + Σ_r Re(a_r e^{λ_r t}) + noise,

the amplitudes a_r and the offset b are linear and projected out (Golub & Pereyra, SIAM J. Numer. Anal. 10, 413 (1973)),
and the poles λ_r are fitted to all series together.  Their covariance allows for correlated residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from modal.errors import ComputationError
from modal.identification.covariance import autocorrelation, covariance, influence
from modal.types import Complexes, Floats

LEAST_PEAKS = 6  # turning points of a logarithmic decrement
ROUGH = 0.3  # standard deviation of the whole loss in ln a, or of all turning points in half periods
CLOSE = 1e-14
SIGNIFICANT = 6.0  # standard deviations of an amplitude below which a pole is none
VAGUE = 0.1  # relative standard deviation of a frequency above which a pole is none


@dataclass(frozen=True, eq=False)
class Series:
    """One sensor's values (K,) at times (K,) in s, in one of the segments; both from 0."""

    sensor: int
    segment: int
    times: Floats
    values: Floats


@dataclass(frozen=True, eq=False)
class Decays:
    """Fitted poles λ (R,) with the covariance (2R, 2R) of all real and then all imaginary parts.

    `amplitudes` (series, R) are the a_r, `amplitude_stds` (series, R) the standard deviations of their parts; `rms` is
    the root mean square of the residuals of each series.
    """

    poles: Complexes
    cov: Floats
    amplitudes: Complexes
    amplitude_stds: Floats
    rms: Floats
    white: bool


def fit_decays(series: Sequence[Series], poles: Complexes, faint: float = 0.0) -> Decays:
    """Poles fitted to these series, from given ones on; those without significance are left out one by one.

    So are those whose amplitudes are less than `faint` of the strongest one's in every series.

    Raises ComputationError where none is left.
    """
    weights = np.array([1 / (float(np.std(own.values)) or 1.0) for own in series])
    while True:
        if not len(poles):
            raise ComputationError("no oscillation stands out of the noise of these records")
        found = _fitted(series, poles, weights)
        for _ in range(2):
            weights = _weights(series, found)
            found = _fitted(series, found.poles, weights)
        strength = np.abs(found.amplitudes) / np.maximum(found.amplitude_stds, 1e-300)
        size = np.max(strength, axis=0)
        half = len(found.poles)
        vague = np.sqrt(np.diag(found.cov)[half:]) / np.abs(found.poles)
        score = np.where(vague > VAGUE, 0.0, size)
        share = np.abs(found.amplitudes) / np.max(np.abs(found.amplitudes), axis=1, keepdims=True)
        score = np.where(share.max(axis=0) < faint, 0.0, score)
        worst = int(np.argmin(score))
        if score[worst] > SIGNIFICANT:
            return found
        poles = np.delete(found.poles, worst)


def _weights(series: Sequence[Series], found: Decays) -> Floats:
    """One over the noise of each sensor."""
    sensors = np.array([own.sensor for own in series])
    counts = np.array([len(own.values) for own in series])
    weights = np.ones(len(series))
    for sensor in np.unique(sensors):
        own = sensors == sensor
        noise = np.sqrt(np.sum(counts[own] * found.rms[own] ** 2) / counts[own].sum())
        size = max(float(np.std(series[int(k)].values)) for k in np.flatnonzero(own))
        weights[own] = 1 / max(float(noise), 1e-12 * size, 1e-300)
    return weights


def _basis(times: Floats, poles: Complexes) -> Floats:
    waves = np.exp(np.outer(times, poles))
    return np.hstack((waves.real, -waves.imag, np.ones((len(times), 1))))


def _projected(own: Series, poles: Complexes) -> tuple[Floats, Complexes, Floats, Floats]:
    """Residuals (K,), amplitudes (R,), projected derivatives (K, 2R), variances of amplitudes per noise."""
    R = len(poles)
    basis = _basis(own.times, poles)
    size = np.linalg.norm(basis, axis=0)
    Q, triangle = np.linalg.qr(basis / size)
    right = Q.T @ own.values
    inverse = np.linalg.pinv(triangle, rcond=1e-14)
    linear = inverse @ right / size
    amplitudes = linear[:R] + 1j * linear[R : 2 * R]
    waves = amplitudes * np.exp(np.outer(own.times, poles)) * own.times[:, None]
    slopes = np.hstack((waves.real, -waves.imag))
    slopes = slopes - Q @ (Q.T @ slopes)
    variance = np.sum(inverse**2, axis=1) / size**2
    return own.values - Q @ right, amplitudes, slopes, (variance[:R] + variance[R : 2 * R]) / 2


def _fitted(series: Sequence[Series], poles: Complexes, weights: Floats) -> Decays:
    R = len(poles)
    scale = np.tile(np.abs(poles), 2)

    def poles_of(x: Floats) -> Complexes:
        return np.asarray(x[:R] * scale[:R] + 1j * x[R:] * scale[R:])

    def residuals(x: Floats) -> Floats:
        own = poles_of(x)
        return np.concatenate([w * _projected(one, own)[0] for w, one in zip(weights, series, strict=True)])

    def jacobian(x: Floats) -> Floats:
        own = poles_of(x)
        return np.vstack([-w * _projected(one, own)[2] * scale for w, one in zip(weights, series, strict=True)])

    longest = max(float(own.times[-1]) for own in series)
    start = np.concatenate((poles.real, poles.imag)) / scale
    low, high = start - 0.5, start + 0.5
    high[:R] = np.minimum(high[:R], np.maximum(start[:R] + 1e-9, 3 / longest / scale[:R]))
    solution: Any = least_squares(
        residuals, start, jacobian, bounds=(low, high), ftol=CLOSE, xtol=CLOSE, gtol=CLOSE, max_nfev=60
    )
    return _described(series, poles_of(solution.x), weights)


def _described(series: Sequence[Series], poles: Complexes, weights: Floats) -> Decays:
    order = np.argsort(np.abs(poles))
    poles, R = poles[order], len(poles)
    parts = [_projected(own, poles) for own in series]
    scale = np.tile(np.abs(poles), 2)
    J = np.vstack([w * part[2] * scale for w, part in zip(weights, parts, strict=True)])
    G = influence(J) if np.linalg.matrix_rank(J) == 2 * R else np.linalg.pinv(J).T
    blocks, at, white = [], 0, True
    rms = [float(np.sqrt(np.mean(part[0] ** 2))) for part in parts]
    for sensor in sorted({own.sensor for own in series}):
        chosen = [k for k, own in enumerate(series) if own.sensor == sensor]
        rho = autocorrelation([parts[k][0] for k in chosen])
        white = white and len(rho) == 1
        count = sum(len(parts[k][0]) for k in chosen)
        free = max(1, count - len(chosen) * (2 * R + 1))
        noise = sum(float(parts[k][0] @ parts[k][0]) for k in chosen) / free
        starts = np.concatenate(([0], np.cumsum([len(part[0]) for part in parts])))
        for k in chosen:
            rows = slice(int(starts[k]), int(starts[k + 1]))
            blocks.append((rows, float(weights[k] ** 2 * noise), rho))
    cov = covariance(G, blocks) * np.outer(scale, scale)
    variances = {rows.start: variance for rows, variance, _ in blocks}
    stds = []
    for k, part in enumerate(parts):
        noise = np.sqrt(variances[at]) / weights[k]
        stds.append(noise * np.sqrt(part[3]))
        at += len(part[0])
    return Decays(poles, cov, np.array([part[1] for part in parts]), np.array(stds), np.array(rms), white)


@dataclass(frozen=True)
class Decrement:
    """A single pole by its turning points: λ (1/s) with standard deviations of its parts, and their number."""

    pole: complex
    real_std: float
    imag_std: float
    peaks: int


def log_decrement(times: Floats, values: Floats) -> Decrement:
    """The pole of a decay (K,) in which one mode swings, from its turning points.

    Extremes lie on b ± a e^{−σt}, so that ln of the differences of successive ones falls by σ times half a period
    (Ewins, Modal Testing, 2nd ed. 2000, §4.2.1); their times are half a period π/Im λ apart.  Raises ComputationError
    where there are too few of them.
    """
    middle = values - np.median(values)
    high = 0.02 * float(np.abs(middle).max())
    step = float(np.median(np.diff(times)))
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)), 8 * len(values)))
    rate = float(np.fft.rfftfreq(8 * len(values), step)[int(np.argmax(spectrum))])
    apart = max(1, int(0.7 / max(rate, 1e-300) / step))
    tops, bottoms = (find_peaks(sign * middle, height=high, distance=apart)[0] for sign in (1, -1))
    peaks = np.sort(np.concatenate((tops, bottoms)))
    peaks = peaks[(peaks > 0) & (peaks < len(values) - 1)]
    found = [_vertex(times, values, int(k), max(1, int(0.08 / rate / step))) for k in peaks]
    if len(found) < LEAST_PEAKS:
        raise ComputationError(f"{len(found)} turning points are too few for a decrement: at least {LEAST_PEAKS}")
    at, heights = (np.array(part) for part in zip(*found, strict=True))
    signs = np.sign(np.diff(heights))
    if np.any(signs[1:] == signs[:-1]):
        raise ComputationError(
            "turning points do not alternate: more than one mode swings, which needs the realization"
        )
    ranges = np.abs(np.diff(heights))
    slope, slope_std = _line((at[1:] + at[:-1]) / 2, np.log(ranges))
    half, half_std = _line(np.arange(len(at), dtype=float), at)
    if slope_std * np.ptp(at) > ROUGH or half_std * len(at) > ROUGH * half:
        raise ComputationError("turning points do not fall on one curve: more than one mode swings, or there is noise")
    imag = np.pi / half
    return Decrement(complex(slope, imag), slope_std, imag * half_std / half, len(at))


def _vertex(times: Floats, values: Floats, k: int, around: int) -> tuple[float, float]:
    """Time and value of the extreme of a parabola through the samples around one."""
    own = slice(max(0, k - around), k + around + 1)
    curve = np.polynomial.Polynomial.fit(times[own], values[own], 2)
    root = curve.deriv().roots()
    at = float(root[0].real) if len(root) and times[own][0] <= root[0].real <= times[own][-1] else float(times[k])
    return at, float(curve(at))


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """The slope of a straight line and its standard deviation."""
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    miss = y - y.mean() - slope * centred
    return slope, float(np.sqrt(miss @ miss / max(1, len(x) - 2) / (centred @ centred)))
