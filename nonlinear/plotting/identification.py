"""Pictures of fits: the record with the fitted motion, and the residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

from modal.plotting.layout import headline, legend
from modal.plotting.style import HUES, MARKED, colour, ink, rest, stack
from modal.scene import title_of

if TYPE_CHECKING:
    from nonlinear.identification import Fit

FACTORS = {"rad": 180 / np.pi, "m": 1e3, "1": 1.0, "rad_per_s": 180 / np.pi, "m_per_s2": 1.0}
SHOWN = {"rad": "°", "m": "mm", "1": "1", "rad_per_s": "°/s", "m_per_s2": "m/s²"}
MISSED = {"rad": "mrad", "m": "mm", "1": "10⁻³", "rad_per_s": "mrad/s", "m_per_s2": "mm/s²"}
"""How readings of these units are shown, and their residuals."""


def fit_figure(fit: Fit) -> Figure:
    """A panel for each sensor with the record (dots) and the fitted motion (line), and below all residuals.

    Of many segments the first ones are drawn, next to each other.
    """
    from nonlinear.identification.result import UNIT_WORDS

    recording = fit.recording
    sensors, segments = recording.sensors[:HUES], recording.segments[:4]
    figure, axes = stack(len(sensors) + 1, (len(sensors) + 1) / 2, sharex=True)
    gap = rcParams["axes.xmargin"] * max(segment.times[-1] - segment.times[0] for segment in segments)
    at = 0.0
    for s, segment in enumerate(segments):
        times = at + segment.times - segment.times[0]
        at = times[-1] + gap
        for c, sensor in enumerate(sensors):
            factor = FACTORS[sensor.unit]
            names = ("measured", "fitted") if s == c == 0 else ("_", "_")
            measured_values, fitted_values = segment.values[:, c], fit.readings[s][:, c]
            axes[c].plot(times, factor * measured_values, ".", ms=2.5, color=ink(), label=names[0])
            axes[c].plot(times, factor * fitted_values, color=colour(c), lw=1.1, label=names[1])
            miss = 1e3 * (measured_values - fitted_values)
            axes[-1].plot(times, miss, color=colour(c), lw=0.8, label="_" if s else sensor.words)
        if s:
            for axis in axes:
                axis.axvline(times[0] - gap / 2, color=rest(), lw=0.6, ls=MARKED)
    for axis, sensor in zip(axes, sensors, strict=False):
        axis.set_ylabel(f"{sensor.words} ({SHOWN[sensor.unit]})")
    legend(axes[0], 2)
    units = {MISSED[sensor.unit] for sensor in sensors}
    axes[-1].set_ylabel(f"residual ({', '.join(sorted(units))})")
    legend(axes[-1], 3)
    has_more = len(recording.segments) > len(segments)
    axes[-1].set_xlabel("time since the first sample (s)" + (", segments side by side" if len(segments) > 1 else ""))
    words = f"fit to measured motions, rms residual {fit.rms_all:.3g} {UNIT_WORDS.get(fit.rms_unit, fit.rms_unit)}"
    headline(
        figure,
        title_of(fit.given),
        words + (f" (first {len(segments)} segments of {len(recording.segments)})" if has_more else ""),
    )
    return figure
