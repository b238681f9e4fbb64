"""Sampled signals: means over the last part of a run, moving averages, power spectra."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.types import Floats, Ints


def last(times: Floats, part: float) -> slice:
    """The samples in the last `part` of times (T,) in s, ascending; at least two where there are two."""
    begin = int(np.searchsorted(times, times[-1] - part * (times[-1] - times[0])))
    return slice(max(0, min(begin, len(times) - 2)), None)


def smooth(times: Floats, values: Floats, span: float) -> Floats:
    """Means of values (T, ...) over t ± span/2 (s), interpolated linearly between samples, within the run.

    Nothing is subtracted: values that decay by many orders of magnitude keep their digits.
    """
    if len(times) < 2:
        return values
    low, high = np.maximum(times - span / 2, times[0]), np.minimum(times + span / 2, times[-1])
    (first, begin), (final, end) = (_interpolate(times, values, at) for at in (low, high))
    inner = _sums(_segment_integrals(times[:-1], times[1:], values[:-1], values[1:]), first + 1, final)
    head = _segment_integrals(low, times[first + 1], begin, values[first + 1])
    right = _segment_integrals(times[final], high, values[final], end)
    within = _as_column(first == final, values)
    integral = np.where(within, _segment_integrals(low, high, begin, end), head + inner + right)
    return np.asarray(integral / _as_column(high - low, values))


def _as_column(column: Any, values: Floats) -> Any:
    return column.reshape(-1, *[1] * (values.ndim - 1))


def _segment_integrals(start: Floats, stop: Floats, low: Floats, high: Floats) -> Floats:
    """Integrals of linear segments."""
    return np.asarray(_as_column(stop - start, low) * (low + high) / 2)


def _interpolate(times: Floats, values: Floats, at: Floats) -> tuple[Ints, Floats]:
    """The samples before given times, and the values at these times."""
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    part = _as_column((at - times[k]) / (times[k + 1] - times[k]), values)
    return k, np.asarray((1 - part) * values[k] + part * values[k + 1])


def _sums(pieces: Floats, begin: Ints, end: Ints) -> Floats:
    """Σ pieces[begin:end] for each pair, from sums of 1, 2, 4, … neighbours; 0 where end ≤ begin."""
    sums, at, remaining = np.zeros((len(begin), *pieces.shape[1:])), begin.copy(), np.maximum(end - begin, 0)
    size = 1
    while remaining.any():
        rows = np.flatnonzero(remaining & size)
        sums[rows] += pieces[at[rows]]
        at[rows] += size
        remaining[rows] -= size
        pieces, size = pieces[:-size] + pieces[size:], 2 * size
    return sums


WINDOW, WINDOW_NAME = (0.35875, -0.48829, 0.14128, -0.01168), "Blackman–Harris"
"""Amplitudes of the cosines that add up to the window, of four terms that with the least sidelobes [Harris1978]."""
SPECTRUM_PADDING = 8
"""Format: length of the transform over that of the signal: zeros in between draw each peak with its own shape."""
BANDWIDTH = 2.72
"""Format: width of the window's main lobe 6 dB down, in 2π/T [Harris1978, Table I]."""


def power_spectrum(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Angular frequencies (rad/s) and the power spectral density of values (unit² s), (F,) each.

    A linear trend is removed first, so that a rotating link shows the spectrum of its fluctuations; the four-term
    Blackman-Harris window keeps the sidelobes of strong lines 92 dB down [Harris1978].  Zeros after the signal
    interpolate the spectrum at SPECTRUM_PADDING times as many frequencies; lines closer than `resolution` merge
    nevertheless.
    """
    step = (times[-1] - times[0]) / (len(times) - 1)
    count, turn = SPECTRUM_PADDING * len(times), 2 * np.pi * np.arange(len(times)) / len(times)
    line = np.vander(np.linspace(-1.0, 1.0, len(times)), 2)
    level = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    window = sum(share * np.cos(k * turn) for k, share in enumerate(WINDOW))
    density = step / np.sum(window**2) * np.abs(np.fft.rfft(window * level, count)) ** 2
    density[1:-1] *= 2
    return 2 * np.pi * np.fft.rfftfreq(count, step), density


def resolution(times: Floats) -> float:
    """Distance (rad/s) from which `power_spectrum` separates two equally strong lines."""
    return float(BANDWIDTH * 2 * np.pi / (times[-1] - times[0]))
