"""Power spectra of evenly sampled signals."""

from __future__ import annotations

import numpy as np

from modal.types import Floats

WINDOW, WINDOW_NAME = (0.35875, -0.48829, 0.14128, -0.01168), "Blackman–Harris"
"""Amplitudes of the cosines that add up to the window, of four terms that with the least sidelobes (Harris 1978)."""
PADDING = 8
"""Length of the transform over that of the signal: zeros in between draw each peak with its own shape."""
BANDWIDTH = 2.72
"""Width of the window's main lobe 6 dB down, in 2π/T (Harris, Proc. IEEE 66, 51, 1978, Table I)."""


def power_spectrum(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Angular frequencies (rad/s) and the power spectral density of values (unit² s), (F,) each.

    A linear trend is removed first, so that a rotating link shows the spectrum of its fluctuations; the four-term
    Blackman-Harris window keeps the sidelobes of strong lines 92 dB down (Harris, Proc. IEEE 66, 51, 1978).  Zeros
    after the signal interpolate the spectrum at PADDING times as many frequencies; lines closer than `resolution`
    merge nevertheless.
    """
    step = (times[-1] - times[0]) / (len(times) - 1)
    count, turn = PADDING * len(times), 2 * np.pi * np.arange(len(times)) / len(times)
    line = np.vander(np.linspace(-1.0, 1.0, len(times)), 2)
    level = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    window = sum(share * np.cos(k * turn) for k, share in enumerate(WINDOW))
    density = step / np.sum(window**2) * np.abs(np.fft.rfft(window * level, count)) ** 2
    density[1:-1] *= 2
    return 2 * np.pi * np.fft.rfftfreq(count, step), density


def resolution(times: Floats) -> float:
    """Distance (rad/s) from which `power_spectrum` separates two equally strong lines."""
    return float(BANDWIDTH * 2 * np.pi / (times[-1] - times[0]))
