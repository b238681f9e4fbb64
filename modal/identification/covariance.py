"""Covariances of fitted parameters that account for correlated residuals.

With the influence G = J (JᵀJ)⁻¹ of the readings on the estimates, an estimate is off by Gᵀ e, so that

    cov = Gᵀ Γ G,        Γ_kl = σ² ρ_|k−l|

within each series of readings, ρ being the autocorrelation of the residuals ([Ljung1999, §9.4]; [Newey1987], for the
weights that keep it positive).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from modal.types import Floats

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
