"""Power spectra of evenly sampled signals."""

from __future__ import annotations

import numpy as np

from modal.types import Floats

WINDOW, WINDOW_NAME = "blackmanharris", "Blackman–Harris"
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
    from scipy.signal import periodogram

    step = (times[-1] - times[0]) / (len(times) - 1)
    count = PADDING * len(times)
    frequency, density = periodogram(values, fs=1 / step, window=WINDOW, detrend="linear", nfft=count)
    return np.asarray(2 * np.pi * frequency), np.asarray(density)


def resolution(times: Floats) -> float:
    """Distance (rad/s) from which `power_spectrum` separates two equally strong lines."""
    return float(BANDWIDTH * 2 * np.pi / (times[-1] - times[0]))
