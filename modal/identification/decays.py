"""Poles of free decays by realization and least squares, and by the logarithmic decrement of a single mode.

With every reading a sum of decaying oscillations about an offset,

    y(t) = b + Σ_r Re(a_r e^{λ_r t}) + noise,

the amplitudes a_r and the offset b are linear and projected out [Golub1973],
and the poles λ_r are fitted to all series together.  Their covariance allows for correlated residuals.

The rate of a swing that is not small follows its amplitude, λ_r + i β_r e^{−2σ_r t} with σ_r = −Re λ_r, for the change
goes with the square of the amplitude, Re β_r that of the frequency and Im β_r that of the damping [Nayfeh1979, §2.3].
Its exponent is

    λ_r t + i β_r g_r(t),        g_r(t) = (1 − e^{−2σ_r t})/(2σ_r)

which, expanded in β_r, is a row of poles λ_r, λ_r − 2σ_r, … of one shape: linear poles alone take it for several modes.
So poles of one shape are one mode with a β_r where that fits the record as well.

The poles to begin with are those of the eigensystem realization algorithm (ERA): from samples y_k (C,) of free
responses, as columns, the block Hankel matrices

    H₀ = [y_{i+j}],   H₁ = [y_{i+j+1}],     H₀ = U S Vᵀ,    A = S^{-1/2} Uᵀ H₁ V S^{-1/2}

give the poles λ = ln μ / Δt of order n by the eigenvalues μ of A (n, n), and shapes by the first block of U S^{1/2}.
[Juang1985]  Correlations of the responses to random excitation are free
responses themselves: [James1995].

Covariances account for correlated residuals.  With the influence G = J (JᵀJ)⁻¹ of the readings on the estimates, an
estimate is off by Gᵀ e, so that

    cov = Gᵀ Γ G,        Γ_kl = σ² ρ_|k−l|

within each series of readings, ρ being the autocorrelation of the residuals ([Ljung1999, §9.4]; [Newey1987], for the
weights that keep it positive).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.types import Booleans, Complexes, Floats, Ints

NOISE_AT_FIRST = 0.02
"""Tolerance: of the size of readings or shapes, their noise until residuals give it: that of ordinary sensors."""
NOISE_MIN = 1e-9
"""Tolerance: of the size of readings or shapes, the least noise: residuals of exact data are rounding."""
CHANCE_MAX = 0.01
"""Tolerance: probability of chance below which residuals are remarked on; a report has some ten sentences."""


def autocorrelation(series: Sequence[Floats]) -> Floats:
    """ρ at lags 0, 1, … of series with one autocorrelation, up to the first that is not significant.

    (1,), a single one, where they are white.
    """
    length = min((len(values) for values in series), default=0)
    total = float(sum(values @ values for values in series))
    lags, count = max(1, length // 4), sum(map(len, series))  # of longer lags too few products are averaged
    coefficients = [1.0]
    for lag in range(1, lags):
        rho = sum(float(values[lag:] @ values[:-lag]) for values in series) / total if total else 0.0
        if abs(rho) < 3 / np.sqrt(count):  # three standard errors of an autocorrelation of white noise
            break
        coefficients.append(rho)
    return np.array(coefficients)


def influence(J: Floats) -> Floats:
    """G = J (JᵀJ)⁻¹, (N, p), of a J of full rank."""
    Q, R = np.linalg.qr(J)
    G: Floats = np.linalg.solve(R, Q.T).T
    return G


def covariance(G: Floats, blocks: Sequence[tuple[slice, float, Floats]]) -> Floats:
    """Gᵀ Γ G, (p, p); `blocks` are the rows of each series with their variance and autocorrelation."""
    total = np.zeros((G.shape[1], G.shape[1]))
    for rows, variance, rho in blocks:
        part = G[rows]
        weights = rho * (1 - np.arange(len(rho)) / len(rho))
        weights[0] = 1.0
        two_sided = np.concatenate((weights[:0:-1], weights))
        smoothed_part = (
            part if len(rho) == 1 else scipy.signal.fftconvolve(part, two_sided[:, None], mode="same", axes=0)
        )
        total += variance * part.T @ smoothed_part
    return (total + total.T) / 2


def resampled(series: Sequence[Floats], blocks: int, rng: np.random.Generator) -> list[Floats]:
    """Series like these, each put together from that many blocks of itself [Kunsch1989]."""
    samples = []
    for values in series:
        length = max(1, -(-len(values) // blocks))
        begins = rng.integers(0, len(values) - length + 1, -(-len(values) // length))
        samples.append(np.concatenate([values[at : at + length] for at in begins])[: len(values)])
    return samples


SINGULAR_VALUE_MIN = 1e-4
"""Tolerance: of the largest singular value: below it are harmonics of swings that are not small."""
NOISE_THRESHOLD = 2.858
"""Physics: singular values below this many medians are noise [Gavish2014]."""
HANKEL_ROWS = 240
"""Cost: most rows of a Hankel matrix; the time goes with their square."""
HANKEL_COLUMNS = 4000
"""Cost: most columns of a Hankel matrix; the time goes with their number."""


@dataclass(frozen=True, eq=False)
class Realization:
    """The singular vectors of H₀ with H₁ between them, for C sensors sampled every `step` (s)."""

    U: Floats
    singular: Floats
    between: Floats
    sensors: int
    step: float

    @cached_property
    def rank(self) -> int:
        """The number of singular values that stand out of noise and are not faint."""
        floor = max(SINGULAR_VALUE_MIN * self.singular[0], NOISE_THRESHOLD * float(np.median(self.singular)))
        return int(np.count_nonzero(self.singular > floor))

    def poles(self, order: int) -> tuple[Complexes, Complexes]:
        """Oscillating poles λ (R,) with Im λ > 0 (1/s) and their shapes (C, R), by a model of this order."""
        order = min(order, len(self.singular))
        root = np.sqrt(self.singular[:order])
        A = self.between[:order, :order] / root[:, None] / root
        values, vectors = np.linalg.eig(A)
        with np.errstate(all="ignore"):
            poles = np.asarray(np.log(values + 0j) / self.step)
        shapes = (self.U[: self.sensors, :order] * root) @ vectors
        rows = np.flatnonzero((poles.imag > 0) & (poles.imag < 0.98 * np.pi / self.step) & np.isfinite(poles))
        rows = rows[np.argsort(np.abs(poles[rows]))]
        return np.asarray(poles[rows]), np.asarray(shapes[:, rows], dtype=np.complex128)


def realize(responses: Sequence[Floats], step: float, stride: int = 1) -> Realization:
    """The realization of free responses (K, C) sampled every `step` (s), each from a state of its own.

    Rows of the Hankel matrix are `stride` samples apart.
    """
    sensors = responses[0].shape[1]
    shortest = min(len(response) for response in responses)
    blocks = max(2, min(HANKEL_ROWS // sensors, shortest // (2 * stride)))
    columns = max(1, HANKEL_COLUMNS // len(responses))
    first, second = [], []
    for response in responses:
        count = min(len(response) - blocks * stride, columns)
        starts = np.linspace(0, len(response) - blocks * stride - 1, count).astype(np.int64)
        samples = response[starts[:, None] + stride * np.arange(blocks + 1)]
        first.append(samples[:, :-1].reshape(count, -1).T)
        second.append(samples[:, 1:].reshape(count, -1).T)
    H0, H1 = np.hstack(first), np.hstack(second)
    U, singular, V = np.linalg.svd(H0, full_matrices=False)
    return Realization(U, singular, U.T @ H1 @ V.T, sensors, stride * step)


def modal_assurance(shapes: Complexes, other: Complexes) -> Floats:
    """MAC (R, S) between columns of (C, R) and (C, S): |φᴴψ|²/((φᴴφ)(ψᴴψ)), 0 for a column of zeros.

    [Allemang1982]
    """
    inner = np.abs(shapes.conj().T @ other) ** 2
    sizes = np.outer(np.sum(np.abs(shapes) ** 2, axis=0), np.sum(np.abs(other) ** 2, axis=0))
    return np.asarray(np.divide(inner, sizes, out=np.zeros_like(inner), where=sizes > 0))


EVALUATIONS_MAX = 60
"""Cost: evaluations of a fit; a fit that has not converged by then fails."""
TURNING_POINTS_MIN = 6
"""Limit: turning points of a decrement, or of a loss of amplitude: "… turning points are too few"."""
DECREMENT_STD_MAX = 0.3
"""Limit: standard deviation of the whole loss in ln a, or of a turning point in half periods: "… on one curve"."""
AMPLITUDE_SIGNIFICANCE = 6.0
"""Tolerance: standard deviations of an amplitude below which a pole is none: some are the largest of many of noise."""
FREQUENCY_STD_MAX = 0.1
"""Tolerance: relative standard deviation of a frequency above which a pole is none: noise has no frequency."""
POLE_DISTANCE_MAX = 0.05
"""Tolerance: relative distance of two poles that may be one mode, whose frequency falls by θ²/16: of 0.9 rad."""
DECAY_MAC_MIN = 0.95
"""Tolerance: MAC of shapes of one mode: noise leaves more, different modes on several sensors less."""
RESIDUAL_RATIO = 1.5
"""Tolerance: ratio of residuals of which the smaller are better: those of as good a model differ by noise alone."""
BEATLESS_RESIDUAL_RATIO = 30.0
"""Tolerance: the same of one mode over two poles that never beat, of which the second absorbs the nonlinear part."""
COMBINATION_AMPLITUDE = 0.1
"""Physics: share of stronger amplitudes a that a combination of three has at most, a²/6 at 0.8 rad, if no angle is."""
FOURTH_POWERS = 0.02
"""Physics: relative effect of fourth powers of angles to a change of frequency: θ²/192 of ω (1 − θ²/16 + θ⁴/3072)."""
OTHER_MODES = 0.3
"""Physics: relative effect of another mode of the same amplitude to a change of frequency."""


@dataclass(frozen=True, eq=False)
class Series:
    """One sensor's values (K,) at times (K,) in s, in one of the segments; both from 0."""

    sensor: int
    segment: int
    times: Floats
    values: Floats


@dataclass(frozen=True, eq=False)
class DecayModel:
    """Poles λ (R,), and the changes β (B,) of the rates of those modes that have one, `bent` (B,); all in 1/s.

    `squares` (series, R) are the squares of amplitudes, 1 in the strongest segment, with which β acts in each series.
    """

    poles: Complexes
    bent: Ints
    shifts: Complexes
    squares: Floats

    def exponents(self, times: Floats, k: int) -> tuple[Complexes, Complexes, Complexes]:
        """Exponents (K, R) of series k at times (K,) and their derivatives by Re λ (K, R) and by Re β (K, B)."""
        exponents = np.outer(times, self.poles)
        by_real = np.repeat(times[:, None] + 0j, len(self.poles), axis=1)
        g, by_rate = _accumulate(times, -self.poles.real[self.bent])
        by_shift = 1j * g * self.squares[k, self.bent]
        exponents[:, self.bent] += by_shift * self.shifts
        by_real[:, self.bent] -= 1j * by_rate * self.squares[k, self.bent] * self.shifts
        return exponents, by_real, by_shift


def _accumulate(times: Floats, rates: Floats) -> tuple[Floats, Floats]:
    """The integral of e^{−2σt}, (1 − e^{−2σt})/(2σ), (K, B), of rates σ (B,), and its derivative by σ."""
    t = times[:, None]
    x = 2 * t * rates
    small = np.abs(x) < 1e-2
    y = np.where(small, 1.0, x)
    g = np.where(small, 1 - x / 2 + x**2 / 6 - x**3 / 24 + x**4 / 120, -np.expm1(-y) / y)
    closed = (np.exp(-y) * (1 + y) - 1) / y**2
    slope = np.where(small, -0.5 + x / 3 - x**2 / 8 + x**3 / 30 - x**4 / 144, closed)
    return t * g, 2 * t**2 * slope


@dataclass(frozen=True, eq=False)
class Decays:
    """A fitted `model` with the covariance (2R, 2R) of all real and then all imaginary parts of its poles.

    `amplitudes` (series, R) are the a_r, `amplitude_stds` (series, R) the standard deviations of their parts; `rms` is
    the root mean square of the residuals of each series.
    """

    model: DecayModel
    cov: Floats
    amplitudes: Complexes
    amplitude_stds: Floats
    rms: Floats
    white: bool

    @property
    def poles(self) -> Complexes:
        """The poles λ (R,), by |λ|."""
        return self.model.poles

    def shift(self, r: int) -> float | None:
        """The change of frequency β/2π (Hz) at the strongest start of mode r, None if it has none."""
        shifts = self.model.shifts[self.model.bent == r]
        return float(shifts[0].real) / (2 * np.pi) if len(shifts) else None


def shape_of(decays: Decays, r: int, sensors: int) -> Complexes:
    """The direction (C,) that the amplitudes of mode r have in common in all segments."""
    return np.asarray(np.linalg.svd(decays.amplitudes[:, r].reshape(-1, sensors), full_matrices=False)[2][0])


def fit_decays(series: Sequence[Series], poles: Complexes, faint: float = 0.0) -> Decays:
    """Poles fitted to these series, from given ones on; those without significance are omitted one by one.

    So are those whose amplitudes are less than `faint` of the strongest one's in every series.

    Raise ComputationError if none is left.
    """
    bent, shifts = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.complex128)
    return _significant(series, DecayModel(poles, bent, shifts, np.ones((len(series), len(poles)))), faint)


def one_mode(series: Sequence[Series], decays: Decays, faint: float = 0.0, *, resolved: bool = False) -> Decays | None:
    """Decays with one mode fewer: two poles of one shape are one whose frequency changes with amplitude.

    None if no two poles are. They are if the one mode fits the series as well; if they never beat, and no `resolved`
    modes are requested, also if it fits them somewhat worse.
    """
    weights, beatless = _weights(series, decays), suspects(series, decays)
    distances = np.abs(decays.poles[:, None] / decays.poles - 1)
    for r, s in sorted(np.argwhere(_alike(series, decays)).tolist(), key=lambda pair: float(distances[*pair])):
        merged_decays = _fit_model(series, _merge(series, decays, r, s), weights, digits=0.25)
        largest = BEATLESS_RESIDUAL_RATIO if (r, s) in beatless and not resolved else RESIDUAL_RATIO
        if np.sqrt(np.mean((merged_decays.rms * weights) ** 2)) < largest:
            return _significant(series, merged_decays.model, faint)
    return None


@dataclass(frozen=True)
class LargeSwings:
    """Artefacts of large swings: `repetitions`, poles that are a stronger one at another amplitude, {r: of}.

    `tones` are poles at the places of sums Σ n_i ω_i of one or two stronger modes, {r: {i: n_i}}.
    """

    repetitions: dict[int, int]
    tones: dict[int, dict[int, int]]


def large_swings(series: Sequence[Series], decays: Decays, angle: float) -> LargeSwings:
    """Return poles that are artefacts of swings up to an `angle` (rad), 0 if no sensor reads an angle.

    Cubic forces change a frequency by a²/6 at most, and make tones of such a share; being odd in the angles, they and
    their repetition have three and five terms.  One sensor tells one shape only from poles that never beat.  Once there
    are as many modes as sensors, which are all that the links have, sums go with frequencies at other amplitudes.
    """
    strengths, rates = _strengths(series, decays), decays.poles.imag
    sensors = 1 + max(record.sensor for record in series)
    share, orders = (angle**2 / 6, (3, 5)) if angle else (COMBINATION_AMPLITUDE, (2, 3))
    is_alike = _alike(series, decays, np.inf)
    if sensors == 1:
        is_alike[:] = False
        is_alike[tuple(np.array(suspects(series, decays, np.inf), dtype=np.int64).reshape(-1, 2).T)] = True
    widths, spreads = np.abs(decays.poles.real), np.zeros(len(rates))
    widths[decays.model.bent] += np.abs(decays.model.shifts.real)
    modes, swings = list[int](), LargeSwings({}, {})
    for r in np.argsort(-strengths).tolist():
        reaches = widths + spreads if len(modes) >= sensors > 1 else widths
        sums = _sums([i for i in modes if strengths[r] < share * strengths[i]], orders)
        turns = next((sum_ for sum_ in sums if _is_tone(rates[r], rates, reaches, sum_)), None)
        distances = np.abs(rates[r] - rates)
        near = [s for s in modes if distances[s] < rates[s] * angle**2 / 6 + widths[r]]
        leader = next((s for s in near if is_alike[min(r, s), max(r, s)]), None)
        if leader is not None:
            swings.repetitions[r] = leader
            spreads[leader] = max(spreads[leader], distances[leader])
        elif turns is not None:
            swings.tones[r] = turns
        else:
            modes.append(r)
    # with a weaker mode in it, a tone dies away sooner than that mode
    for r in [r for r in modes[1:] if strengths[r] < share * strengths[modes[0]]]:
        slower = [i for i in modes if i not in swings.tones and decays.poles[i].real > decays.poles[r].real]
        sums = (sum_ for sum_ in _sums(slower, orders) if modes[0] in sum_)
        turns = next((sum_ for sum_ in sums if _is_tone(rates[r], rates, widths, sum_)), None)
        if turns is not None:
            swings.tones[r] = turns
    return swings


def _is_tone(rate: float, rates: Floats, reaches: Floats, turns: dict[int, int]) -> bool:
    off = abs(sum(n * rates[i] for i, n in turns.items())) - rate
    return bool(abs(off) < sum(abs(n) * reaches[i] for i, n in turns.items()))


def _sums(places: Sequence[int], orders: Sequence[int]) -> Iterator[dict[int, int]]:
    """The multiples of one or two of these places whose sizes add up to these orders: {place: multiple}."""
    for order in orders:
        yield from ({i: order} for i in places)
        for i, j in combinations(places, 2):
            yield from ({i: n, j: sign * (order - n)} for n in range(1, order) for sign in (1, -1))


def _strengths(series: Sequence[Series], decays: Decays) -> Floats:
    """The root mean square of each mode (R,) where it is the largest: some begin large and cancel each other."""
    ends = np.array([record.times[-1] for record in series])
    squares = _accumulate(ends, -decays.poles.real)[0] / ends[:, None]
    return np.asarray(np.max(np.abs(decays.amplitudes) * np.sqrt(squares), axis=0))


def bent(series: Sequence[Series], decays: Decays, faint: float = 0.0) -> Decays | None:
    """Decays in which one more mode's frequency changes with amplitude: the one that betters the fit most.

    None if none betters it much, or the residuals are white, or rounding.
    """
    rounding = np.sqrt(np.finfo(float).eps) * np.array([np.std(record.values) for record in series])
    if decays.white or np.all(decays.rms < rounding):
        return None
    weights, trials = _weights(series, decays), []
    for r in np.setdiff1d(np.arange(len(decays.poles)), decays.model.bent):
        model = replace(decays.model, bent=np.append(decays.model.bent, r), shifts=np.append(decays.model.shifts, 0j))
        trial_decays = _fit_model(series, model, weights, digits=0.25)
        trials.append((float(np.sqrt(np.mean((trial_decays.rms * weights) ** 2))), trial_decays))
    smallest, best = min(trials, key=lambda trial: trial[0], default=(1.0, decays))
    return _significant(series, best.model, faint) if smallest * RESIDUAL_RATIO < 1 else None


def suspects(series: Sequence[Series], decays: Decays, distance: float = POLE_DISTANCE_MAX) -> list[tuple[int, int]]:
    """Pairs of poles of one shape that never beat: their phases part by less than a turn before one has died away."""
    longest = max(float(record.times[-1]) for record in series)
    lasting = np.minimum(longest, 3 / np.maximum(-decays.poles.real, 1e-300))  # until 5 % is left
    return [
        (r, s)
        for r, s in np.argwhere(_alike(series, decays, distance)).tolist()
        if abs(decays.poles[r].imag - decays.poles[s].imag) * min(lasting[r], lasting[s]) < 2 * np.pi
    ]


def _alike(series: Sequence[Series], decays: Decays, distance: float = POLE_DISTANCE_MAX) -> Booleans:
    """Pairs (R, R), above the diagonal, of poles within a relative distance and with one shape."""
    sensors = 1 + max(record.sensor for record in series)
    shapes = np.stack([shape_of(decays, r, sensors) for r in range(len(decays.poles))], axis=1)
    is_near = np.abs(decays.poles[:, None] / decays.poles - 1) < distance
    return np.asarray(np.triu(is_near & (modal_assurance(shapes, shapes) > DECAY_MAC_MIN), 1))


def _merge(series: Sequence[Series], decays: Decays, r: int, s: int) -> DecayModel:
    """The model with a bent mode in the place of the poles r and s: theirs is the rate where their sum has halved."""
    k = int(np.argmax(np.abs(decays.amplitudes[:, [r, s]]).sum(axis=1)))
    times, pair = series[k].times, decays.poles[[r, s]]
    waves = decays.amplitudes[k, [r, s]] * np.exp(decays.model.exponents(times, k)[0][:, [r, s]])
    total = waves.sum(axis=1)
    is_halved = np.abs(total) < np.abs(total[0]) / 2
    at = int(np.argmax(is_halved)) if is_halved.any() else len(total) // 2
    rate = complex(waves[at] @ pair / total[at])
    is_plausible = abs(rate / pair[0] - 1) < POLE_DISTANCE_MAX and rate.real < 0
    pole = rate if is_plausible else pair[int(np.argmin(np.abs(pair.real)))]
    others = np.delete(np.arange(len(decays.poles)), [r, s])
    shifts = dict(zip(decays.model.bent.tolist(), decays.model.shifts.tolist(), strict=True))
    bent = [j for j, old in enumerate(others.tolist()) if old in shifts]
    squares = _squares(series, decays.amplitudes[:, [r, s]].sum(axis=1)[:, None])
    return DecayModel(
        np.append(decays.poles[others], pole),
        np.array([*bent, len(others)], dtype=np.int64),
        np.array([*(shifts[int(others[j])] for j in bent), shifts.get(r, shifts.get(s, 0j))]),
        np.hstack((decays.model.squares[:, others], squares)),
    )


def _significant(series: Sequence[Series], model: DecayModel, faint: float) -> Decays:
    """The fit of this model without the poles that are faint or vague, which are omitted one by one."""
    weights = np.array([1 / (float(np.std(record.values)) or 1.0) for record in series])
    while True:
        if not len(model.poles):
            raise ComputationError("no oscillation stands out of the noise of these records")
        decays = _fit_model(series, model, weights, digits=0.25)
        for _ in range(2):
            weights = _weights(series, decays)
            decays = _fit_model(series, decays.model, weights, digits=0.25)
        R = len(decays.poles)
        significance = np.max(np.abs(decays.amplitudes) / np.maximum(decays.amplitude_stds, 1e-300), axis=0)
        relative_std = np.sqrt(np.diag(decays.cov)[R:]) / np.abs(decays.poles)
        share = np.abs(decays.amplitudes) / np.max(np.abs(decays.amplitudes), axis=1, keepdims=True)
        significance[(relative_std > FREQUENCY_STD_MAX) | (share.max(axis=0) < faint)] = 0.0
        worst = int(np.argmin(significance))
        if significance[worst] > AMPLITUDE_SIGNIFICANCE:
            return _fit_model(series, decays.model, weights)
        model = _choose(decays.model, np.delete(np.arange(R), worst))


def _choose(model: DecayModel, order: Ints) -> DecayModel:
    """The model of these modes, in this order."""
    at = {int(old): new for new, old in enumerate(order)}
    rows = [k for k, r in enumerate(model.bent.tolist()) if r in at]
    bent = np.array([at[int(model.bent[k])] for k in rows], dtype=np.int64)
    return DecayModel(model.poles[order], bent, model.shifts[rows], model.squares[:, order])


def _weights(series: Sequence[Series], decays: Decays) -> Floats:
    """One over the noise of each sensor."""
    sensors = np.array([record.sensor for record in series])
    counts = np.array([len(record.values) for record in series])
    weights = np.ones(len(series))
    for sensor in np.unique(sensors):
        members = sensors == sensor
        noise = np.sqrt(np.sum(counts[members] * decays.rms[members] ** 2) / counts[members].sum())
        size = max(float(np.std(series[int(k)].values)) for k in np.flatnonzero(members))
        weights[members] = 1 / max(float(noise), 1e-12 * size, 1e-300)
    return weights


def _project(record: Series, model: DecayModel, k: int) -> tuple[Floats, Complexes, Floats, Floats]:
    """Residuals (K,), amplitudes (R,), projected derivatives (K, 2R + 2B), variances of amplitudes per noise."""
    R = len(model.poles)
    exponents, by_real, by_shift = model.exponents(record.times, k)
    peaks = np.maximum(exponents.real.max(axis=0), 0.0)  # of waves that grow: they may exceed double precision
    waves = np.exp(exponents - peaks)
    basis = np.hstack((waves.real, -waves.imag, np.ones((len(record.times), 1))))
    size = np.linalg.norm(basis, axis=0)
    Q, triangle = tall_qr(basis / size)
    right = Q.T @ record.values
    inverse = np.linalg.pinv(triangle, rcond=1e-14)
    linear = inverse @ right / size
    amplitudes = linear[:R] + 1j * linear[R : 2 * R]
    waves, amplitudes = amplitudes * waves, amplitudes * np.exp(-peaks)
    by_imag, by_shift = 1j * waves * record.times[:, None], waves[:, model.bent] * by_shift
    slopes = np.hstack(((waves * by_real).real, by_imag.real, by_shift.real, -by_shift.imag))
    slopes = slopes - Q @ (Q.T @ slopes)
    variance = np.sum(inverse**2, axis=1) / size**2
    return record.values - Q @ right, amplitudes, slopes, (variance[:R] + variance[R : 2 * R]) / 2 * np.exp(-2 * peaks)


def tall_qr(matrix: Floats, rows: int = 256) -> tuple[Floats, Floats]:
    """Q and R of a matrix (K, n), of blocks of this many rows and of their triangles [Demmel2012].

    LAPACK takes the rows at once, with threads that wait for each other at every column.
    """
    n = matrix.shape[1]
    count = -(-len(matrix) // max(rows, 4 * n))
    if count == 1:
        return np.linalg.qr(matrix)
    blocks = np.zeros((count * max(rows, 4 * n), n))
    blocks[: len(matrix)] = matrix
    Q, triangles = np.linalg.qr(blocks.reshape(count, -1, n))
    inner_Q, R = tall_qr(triangles.reshape(-1, n), rows)
    return np.asarray((Q @ inner_Q.reshape(count, n, n)).reshape(-1, n)[: len(matrix)]), R


def _fit_model(series: Sequence[Series], model: DecayModel, weights: Floats, *, digits: float = 1.0) -> Decays:
    """The model fitted from these poles on, to a share of all digits, with its covariance."""
    poles, R, B = model.poles, len(model.poles), len(model.bent)
    scale = _scale(model)

    def model_of(x: Floats) -> DecayModel:
        y = x * scale
        rates = np.asarray(y[:R] + 1j * y[R : 2 * R])
        return DecayModel(rates, model.bent, np.asarray(y[2 * R : 2 * R + B] + 1j * y[2 * R + B :]), model.squares)

    def project(x: Floats) -> tuple[Floats, Floats]:
        """Residuals and their derivatives, turned by one rotation to as many rows as there are numbers, and one."""
        if x.tobytes() not in latest:
            trial = model_of(x)
            parts = [(w, _project(record, trial, k)) for k, (w, record) in enumerate(weights_of_series)]
            misses = np.concatenate([w * part[0] for w, part in parts])
            slopes = np.vstack([-w * part[2] for w, part in parts]) * scale
            turned = tall_qr(np.column_stack((slopes, misses)))[1]
            latest.clear()
            latest[x.tobytes()] = turned[:, -1], turned[:, :-1]
        return latest[x.tobytes()]

    latest: dict[bytes, tuple[Floats, Floats]] = {}
    weights_of_series = list(zip(weights, series, strict=True))
    longest = max(float(record.times[-1]) for record in series)
    start = np.concatenate((poles.real, poles.imag, model.shifts.real, model.shifts.imag)) / scale
    low, high = start - 0.5, start + 0.5
    high[:R] = np.minimum(high[:R], np.maximum(start[:R] + 1e-9, 3 / longest / scale[:R]))
    tolerances = dict.fromkeys(("ftol", "xtol", "gtol"), (64 * np.finfo(float).eps) ** digits)
    misses, slopes = (lambda x: project(x)[0]), (lambda x: project(x)[1])
    solution: Any = scipy.optimize.least_squares(
        misses, start, slopes, bounds=(low, high), max_nfev=EVALUATIONS_MAX, **tolerances
    )
    return _with_covariance(series, model_of(solution.x), weights)


def _scale(model: DecayModel) -> Floats:
    size = np.abs(model.poles)
    return np.concatenate((size, size, size[model.bent], size[model.bent]))


def _with_covariance(series: Sequence[Series], model: DecayModel, weights: Floats) -> Decays:
    """The model with its residuals: noise, amplitudes, and the covariance of its poles."""
    model, R = _choose(model, np.argsort(np.abs(model.poles))), len(model.poles)
    parts = [_project(record, model, k) for k, record in enumerate(series)]
    scale = _scale(model)
    J = np.vstack([w * part[2] * scale for w, part in zip(weights, parts, strict=True)])
    G = influence(J) if np.linalg.matrix_rank(J) == len(scale) else np.linalg.pinv(J).T
    blocks, white = [], True
    starts = np.concatenate(([0], np.cumsum([len(part[0]) for part in parts])))
    noise = np.zeros(len(series))
    for sensor in sorted({record.sensor for record in series}):
        members = [k for k, record in enumerate(series) if record.sensor == sensor]
        rho = autocorrelation([parts[k][0] for k in members])
        white = white and len(rho) == 1
        count = sum(len(parts[k][0]) for k in members)
        free = max(1, count - len(members) * (2 * R + 1))
        noise[members] = np.sqrt(sum(float(parts[k][0] @ parts[k][0]) for k in members) / free)
        for k in members:
            blocks.append((slice(int(starts[k]), int(starts[k + 1])), float((weights[k] * noise[k]) ** 2), rho))
    cov = (covariance(G, blocks) * np.outer(scale, scale))[: 2 * R, : 2 * R]
    amplitudes = np.array([part[1] for part in parts])
    stds = noise[:, None] * np.sqrt([part[3] for part in parts])
    # the model of a bent mode holds to second order in its own amplitude alone: the rest is a doubt of its frequency
    strength = np.sum(np.abs(amplitudes) ** 2, axis=0)
    others = np.minimum(1.0, strength.sum() / np.maximum(strength[model.bent], 1e-300) - 1)
    cov[R + model.bent, R + model.bent] += ((FOURTH_POWERS + OTHER_MODES * others) * np.abs(model.shifts)) ** 2
    model = DecayModel(model.poles, model.bent, model.shifts, _squares(series, amplitudes))
    rms = np.array([float(np.sqrt(np.mean(part[0] ** 2))) for part in parts])
    return Decays(model, cov, amplitudes, stds, rms, white)


def _squares(series: Sequence[Series], amplitudes: Complexes) -> Floats:
    """Σ|a_r|² over the sensors of each segment, (series, R), over that of the strongest segment."""
    segments = np.array([number.segment for number in series])
    squares = np.array([np.sum(np.abs(amplitudes[segments == number]) ** 2, axis=0) for number in segments])
    return np.asarray(squares / np.maximum(squares.max(axis=0), 1e-300))


@dataclass(frozen=True)
class Decrement:
    """A single pole by its turning points: λ (1/s) with standard deviations of its parts, and their number.

    `loss` is by how much each is smaller than the last, None if they shrink by a factor.
    """

    pole: complex
    real_std: float
    imag_std: float
    peaks: int
    loss: float | None


def log_decrement(times: Floats, values: Floats) -> Decrement:
    """The pole of a decay (K,) in which one mode swings, from its turning points.

    Extremes lie on b ± a e^{−σt}, so that ln of the differences of successive ones falls by σ times half a period
    [Ewins2000, §4.2.1]; their times are half a period π/Im λ apart. Raise ComputationError if there are too few of
    them.
    """
    middle = values - np.median(values)
    high = 0.02 * float(np.abs(middle).max())
    step = float(np.median(np.diff(times)))
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)), 8 * len(values)))
    rate = float(np.fft.rfftfreq(8 * len(values), step)[int(np.argmax(spectrum))])
    distance = max(1, int(0.7 / max(rate, 1e-300) / step))
    tops, bottoms = (scipy.signal.find_peaks(sign * middle, height=high, distance=distance)[0] for sign in (1, -1))
    peaks = np.sort(np.concatenate((tops, bottoms)))
    peaks = peaks[(peaks > 0) & (peaks < len(values) - 1)]
    vertices = [_vertex(times, values, int(k), max(1, int(0.08 / rate / step))) for k in peaks]
    if len(vertices) < TURNING_POINTS_MIN:
        raise ComputationError(
            f"{len(vertices)} turning points are too few for a decrement: at least {TURNING_POINTS_MIN}"
        )
    at, heights = (np.array(part) for part in zip(*vertices, strict=True))
    signs = np.sign(np.diff(heights))
    if np.any(signs[1:] == signs[:-1]):
        raise ComputationError(
            "turning points do not alternate: more than one mode swings, which needs the realization"
        )
    ranges, middles = np.abs(np.diff(heights)), (at[1:] + at[:-1]) / 2
    slope, slope_std = _line(middles, np.log(ranges))
    half, half_std = _line(np.arange(len(at), dtype=float), at)
    if slope_std * np.ptp(at) > DECREMENT_STD_MAX or half_std * len(at) > DECREMENT_STD_MAX * half:
        raise ComputationError("turning points do not fall on one curve: more than one mode swings, or there is noise")
    imag = np.pi / half
    straight = np.polynomial.Polynomial.fit(middles, ranges, 1)
    curved = np.polynomial.Polynomial.fit(middles, np.log(ranges), 1)
    misses = np.linalg.norm(ranges - straight(middles)), np.linalg.norm(ranges - np.exp(curved(middles)))
    loss = -float(straight.convert().coef[1]) * half / 2 if misses[0] * RESIDUAL_RATIO < misses[1] else None
    return Decrement(complex(slope, imag), slope_std, imag * half_std / half, len(at), loss)


def _vertex(times: Floats, values: Floats, k: int, reach: int) -> tuple[float, float]:
    """Time and value of the extreme of a parabola through the samples around one."""
    samples = slice(max(0, k - reach), k + reach + 1)
    curve = np.polynomial.Polynomial.fit(times[samples], values[samples], 2)
    root = curve.deriv().roots()
    is_inside = len(root) > 0 and times[samples][0] <= root[0].real <= times[samples][-1]
    at = float(root[0].real) if is_inside else float(times[k])
    return at, float(curve(at))


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """The slope of a straight line and its standard deviation."""
    dx = x - x.mean()
    slope = float(dx @ y / (dx @ dx))
    miss = y - y.mean() - slope * dx
    return slope, float(np.sqrt(miss @ miss / max(1, len(x) - 2) / (dx @ dx)))
