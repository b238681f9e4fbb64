"""Damped oscillators driven by a record, exactly: the record's acceleration is a polynomial between two of its knots.

For α' = λ α + a(t) and a with the derivatives a⁽ᵐ⁾ at the beginning of an interval h,

    α(t + h) = e^{λh} α(t) + Σ_m a⁽ᵐ⁾ h^{m+1} φ_{m+1}(λh),     φ_k(z) = ∫₀¹ e^{(1−θ)z} θ^{k−1}/(k−1)! dθ

(the exact solution of an exponential integrator; Hochbruck & Ostermann, Acta Numerica 19, 209 (2010), §2.1).
"""

from __future__ import annotations

from math import factorial

import numpy as np

from modal.errors import ComputationError
from modal.types import Complexes, Floats
from modal.vibration.prescribed import Record

PER_PERIOD, BETWEEN = 100, 4  # steps in a period, and at least between two samples of the record
MOST_STEPS = 1_000_000
SERIES, NEAR = 18, 1.0  # terms of the series of φ, and |z| up to which it is used


def fine_times(record: Record, period: float, until: float) -> tuple[Floats, Floats]:
    """Times (T,) from the record's beginning to `until` (s), and the derivatives of its acceleration after each (K, T).

    A step is at most one part in PER_PERIOD of `period` (s) and in BETWEEN of the interval between two knots.
    ComputationError where there would be too many.
    """
    knots, derivatives = record.pieces
    beyond = max(until - record.last, 0.0)
    widths = np.append(np.diff(knots), beyond) if beyond else np.diff(knots)
    if beyond:
        knots = np.append(knots, until)
        derivatives = np.hstack([derivatives, np.zeros((len(derivatives), 1))])
    counts = np.maximum(np.ceil(widths * PER_PERIOD / period), BETWEEN)
    if counts.sum() > MOST_STEPS:
        raise ComputationError(
            f"the record takes {counts.sum():.3g} steps of a hundredth of the fastest period, {period:.3g} s: at most "
            f"{MOST_STEPS} are followed"
        )
    number = counts.astype(np.int64)
    piece = np.repeat(np.arange(len(number)), number)
    passed = np.arange(len(piece)) - np.repeat(np.cumsum(number) - number, number)
    offset = passed * (widths / counts)[piece]
    moved = np.zeros((len(derivatives), len(piece)))
    for m in range(len(derivatives)):
        for k in range(m, len(derivatives)):
            moved[m] += derivatives[k, piece] * offset ** (k - m) / factorial(k - m)
    times = np.append(knots[piece] + offset, knots[-1])
    return times, np.hstack([moved, np.zeros((len(moved), 1))])


def phi(z: Complexes, most: int) -> list[Complexes]:
    """φ_1 … φ_most."""
    small = np.abs(z) < NEAR
    near = np.where(small, z, 0.0)
    series = [sum(near**j / factorial(j + k) for j in range(SERIES)) for k in range(1, most + 1)]
    far = np.where(small, 1.0, z)
    found, last = [], np.exp(far)
    for k in range(1, most + 1):
        last = (last - 1 / factorial(k - 1)) / far
        found.append(np.where(small, series[k - 1], last))
    return found


def driven(poles: Complexes, times: Floats, derivatives: Floats) -> Complexes:
    """α (R, T) of the poles λ (R,), zero at the first of the times (T,), with the acceleration's derivatives (K, T)."""
    steps = np.diff(times)
    z = np.multiply.outer(poles, steps)
    forced = np.zeros_like(z, dtype=np.complex128)
    for m, own in enumerate(phi(z, len(derivatives))):
        forced += derivatives[m, :-1] * steps ** (m + 1) * own
    grown, found = np.exp(z), np.zeros((len(poles), len(times)), dtype=np.complex128)
    alpha = found[:, 0]
    for at in range(len(steps)):
        alpha = grown[:, at] * alpha + forced[:, at]
        found[:, at + 1] = alpha
    return found


def response_spectrum(record: Record, frequencies: Floats, damping: float) -> Floats:
    """The largest displacement (m) relative to the support of oscillators of these frequencies (Hz), (F,).

    `damping` is the ratio ζ below 1 of all of them; each is followed for one period beyond the record.
    """
    found = []
    for frequency in np.asarray(frequencies, dtype=float).tolist():
        omega = 2 * np.pi * frequency
        pole = omega * complex(-damping, np.sqrt(1 - damping**2))
        times, derivatives = fine_times(record, 1 / frequency, record.last + 1 / frequency)
        alpha = driven(np.array([pole]), times, derivatives)[0]
        found.append(peak(times, -alpha.imag / pole.imag)[0])
    return np.array(found)


def peak(times: Floats, values: Floats) -> tuple[float, float]:
    """The largest |value| (T,) and its time (s), by a parabola through the three largest samples in a row."""
    at = int(np.argmax(np.abs(values)))
    size, time = abs(float(values[at])), float(times[at])
    if not 0 < at < len(values) - 1 or not size:
        return size, time
    t, y = times[at - 1 : at + 2] - times[at], np.abs(values[at - 1 : at + 2])
    left, right = (y[1] - y[0]) / (t[1] - t[0]), (y[2] - y[1]) / (t[2] - t[1])
    bent = (right - left) / (t[2] - t[0])
    if bent >= 0:
        return size, time
    slope = left - bent * t[0]
    shift = float(np.clip(-slope / (2 * bent), t[0], t[2]))
    return size + shift * (slope + bent * shift), time + shift
