"""One-sided power spectral densities (PSDs) given at points, per hertz.

Between two points a PSD is a straight line over logarithmic axes, S = S₁ (f/f₁)^p, as test specifications draw it, and a
straight line over linear axes where an end or its frequency is zero; outside its points it is zero.
"""

from __future__ import annotations

from math import tau

import numpy as np

from modal.scene.motion import Quantity
from modal.types import Floats

BEND = 0.02
"""Largest relative deviation of a straight line over linear axes from one over logarithmic axes (`finely`)."""
POWERS: dict[Quantity, int] = {"acceleration": 0, "velocity": 2, "displacement": 4}


def psd_at(frequencies: Floats, psd: Floats, f: Floats) -> Floats:
    """The PSD given at ascending `frequencies` (Hz), at the frequencies `f`."""
    at = np.clip(np.searchsorted(frequencies, f, side="right") - 1, 0, len(frequencies) - 2)
    low, high, left, right = frequencies[at], frequencies[at + 1], psd[at], psd[at + 1]
    straight = left + (right - left) * (f - low) / (high - low)
    positive = (left > 0) & (right > 0) & (low > 0) & (f > 0)
    with np.errstate(all="ignore"):
        power = np.log(right / left) / np.log(high / low)
        curved = left * (f / low) ** power
    inside = (f >= frequencies[0]) & (f <= frequencies[-1])
    return np.where(inside, np.where(positive, curved, straight), 0.0)
