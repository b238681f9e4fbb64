"""Power spectra of evenly sampled signals."""

from __future__ import annotations

import numpy as np

from modal.types import Floats


def power_spectrum(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Angular frequencies (rad/s) and the power spectral density of values (unit² s), (F,) each.

    A linear trend is removed first, so that a rotating link shows the spectrum of its fluctuations; the Blackman-Harris
    window keeps the sidelobes of strong lines 92 dB down (Harris, Proc. IEEE 66, 51, 1978).
    """
    from scipy.signal import periodogram

    step = (times[-1] - times[0]) / (len(times) - 1)
    frequency, density = periodogram(values, fs=1 / step, window="blackmanharris", detrend="linear")
    return np.asarray(2 * np.pi * frequency), np.asarray(density)
