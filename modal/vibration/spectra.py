"""One-sided power spectral densities (PSDs) given at points, per hertz.

Between two points a PSD is a straight line over logarithmic axes, S = S₁ (f/f₁)^p, as test specifications draw it, and
a straight line over linear axes where an end or its frequency is zero; outside its points it is zero.
"""

from __future__ import annotations

from math import tau

import numpy as np

from modal.assembly import on_lines
from modal.scene.records import Spectrum
from modal.types import Floats

POWERS = {"acceleration": 0, "velocity": 2, "displacement": 4}
"""Powers of ω that make the PSD of an acceleration of each quantity's."""


def psd_at(frequencies: Floats, psd: Floats, f: Floats) -> Floats:
    """The PSD given at ascending `frequencies` (Hz), at the frequencies `f`."""
    inside = (f >= frequencies[0]) & (f <= frequencies[-1])
    return np.where(inside, on_lines(frequencies, psd, f), 0.0)


def acceleration_psd(spectrum: Spectrum, f: Floats) -> Floats:
    """The PSD of the acceleration, in (m/s²)²/Hz, at the frequencies `f` (Hz)."""
    psd = psd_at(np.array(spectrum.frequency_hz), np.array(spectrum.psd), f)
    return np.asarray(psd * (tau * f) ** POWERS[spectrum.of])
