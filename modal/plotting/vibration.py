"""Random vibration as PSDs, thermal noise by places, and shock as histories with the combinations of their peaks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.errors import ComputationError, SceneError
from modal.plotting.curves import RANGE, draw_curves
from modal.plotting.layout import headline, legend, log_ticks, mark_modes, set_frame
from modal.plotting.response import PEAK_ROOM
from modal.plotting.style import (
    CURVE_POINTS,
    HUES,
    MARKED,
    MOST_CURVES,
    VISIBLE_SHARE,
    colour,
    ink,
    secondary_colour,
    spots,
    stack,
    thickness,
)
from modal.scene import number_words, title_of
from modal.scene.signal_names import signal_words, unit_words
from modal.statespace import Signal
from modal.types import Floats

if TYPE_CHECKING:
    from modal.modes import Modes
    from modal.vibration import RandomResponse, ShockResponse, ThermalNoise

QUANTITIES = {
    "m": "position",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "rad": "angle",
    "rad/s": "rate",
    "N": "force",
    "N m": "torque",
}
"""The quantity that a unit measures."""


def random_figure(response: RandomResponse) -> Figure:
    """The PSD of the support's acceleration or of a force, and below it those of the outputs, one panel for each unit.

    Raise ComputationError for more outputs than a picture holds.
    """
    from modal.vibration.report import named_modes, response_frequencies

    units = _units(response.outputs)
    f = response_frequencies(response)
    psd = response.psd(f)
    figure, panels = stack(len(units) + 1, sharex=True, height_ratios=(2, *[3] * len(units)))
    panels[0].plot(f, _positive_values(response.input_psd(f)), color=ink())
    source, sharp = response.source, _sharp_modes(response.modes)
    set_frame(panels[0], "", f"PSD ({_per_hertz(source.unit)})", f"driven by: {signal_words(source.name)}")
    for axis, unit in zip(panels[1:], units, strict=True):
        numbers = [k for k, signal in enumerate(response.outputs) if signal.unit == unit]
        for place, k in enumerate(numbers):
            words = f"{signal_words(response.outputs[k].name)}, RMS {_size(response.rms[k])} {unit_words(unit)}"
            curve = _positive_values(psd[k])
            axis.plot(f, curve, color=colour(place), lw=thickness(place), label=words, **spots(place, curve))
        are_cut = _limit(axis, f, psd[numbers], sharp)
        words = ", sharp peaks cut" if are_cut else ""
        set_frame(axis, "", f"PSD ({_per_hertz(unit)})", f"response: {QUANTITIES.get(unit, unit)}{words}")
        _logarithmic(axis)
        legend(axis, 2, least_count=1)
    _logarithmic(panels[0])
    _over_frequency(panels, f, named_modes(response.modes), panels[1:])
    headline(figure, title_of(response.modes.scene), "random vibration")
    return figure


def _sharp_modes(modes: Modes) -> Floats:
    """The frequencies (Hz) of modes whose peaks are narrower than a line of a picture."""
    damping_ratios = np.abs(modes.eigenvalue.real) / np.where(modes.omega > 0, modes.omega, np.inf)
    return np.asarray(modes.omega[damping_ratios < PEAK_ROOM / 10] / (2 * np.pi))


def _limit(axis: Axes, f: Floats, psd: Floats, sharp: Floats) -> bool:
    """Set the limits of spectra (K, W) on a logarithmic axis; whether that cuts the peaks of `sharp` modes (Hz).

    These end ten times in amplitude above all that is farther than PEAK_ROOM from them, or they alone would be seen.
    """
    is_beside = np.all(np.abs(f - sharp[:, None]) > PEAK_ROOM * sharp[:, None], axis=0)
    is_drawn = np.isfinite(psd) & (psd > 0)
    sizes, heights = psd[is_drawn], psd[is_drawn & is_beside]
    if not heights.size:
        return False
    top = min(float(sizes.max()), 100 * float(heights.max()))
    axis.set_ylim(max(sizes.min() / 2, VISIBLE_SHARE**3 * top), 2 * top)
    return bool(top < sizes.max())


def thermal_figure(noise: ThermalNoise, beside: RandomResponse | None = None, at: Sequence[float] = ()) -> Figure:
    """The amplitude spectral density of every output's thermal noise, one panel for each, with its budget by place.

    `beside` holds the effects of a PSD.  Raise ComputationError for more outputs than a picture holds.
    """
    from modal.vibration import thermal_frequencies
    from modal.vibration.report import named_modes

    if len(noise.outputs) > 4:
        raise ComputationError(f"{len(noise.outputs)} outputs do not fit in a figure: choose at most 4 with `outputs`")
    f = thermal_frequencies(noise, beside, at)
    parts = np.sqrt(noise.budget(f))
    figure, panels = stack(len(noise.outputs), sharex=True)
    driven = None if beside is None else np.sqrt(beside.psd(f))
    for k, (axis, signal) in enumerate(zip(panels, noise.outputs, strict=True)):
        total = np.sqrt((parts[:, k] ** 2).sum(0))
        axis.plot(f, _positive_values(total), color=ink(), lw=2.0, label="thermal noise")
        largest_shares = np.nan_to_num((parts[:, k] / np.where(total > 0, total, 1.0)).max(-1))
        loudest_places = np.argsort(-largest_shares)[:HUES]
        for place, j in enumerate(sorted(loudest_places.tolist())):
            line: dict[str, Any] = {"color": colour(place), "lw": 1.3}
            words = noise.places[j]
            with suppress(SceneError):  # of a number of the scene its name
                words = number_words(noise.scene, words)
            axis.plot(f, _positive_values(parts[j, k]), label=words, **line)
        if driven is not None and beside is not None:
            words = f"from the PSD of the {signal_words(beside.source.name)}"
            axis.plot(f, _positive_values(driven[k]), color=secondary_colour(), lw=1.6, label=words)
        axis.set_ylim(bottom=np.nanmin(_positive_values(total)) / 3)
        label = f"{QUANTITIES.get(signal.unit, '')} ({unit_words(signal.unit)}/√Hz)".strip()
        set_frame(axis, "", label, signal_words(signal.name))
        _logarithmic(axis)
        legend(axis, 2, least_count=1)
    _over_frequency(panels, f, named_modes(noise.modes), panels)
    headline(figure, title_of(noise.scene), f"thermal noise at {noise.temperature:g}\N{NO-BREAK SPACE}K")
    return figure


def _over_frequency(panels: Any, f: Floats, modes: Iterable[tuple[int, float]], marked: Iterable[Axes]) -> None:
    """The axis of frequencies (Hz) that all panels share, with the modes dotted in those that are `marked`."""
    panels[-1].set_xlabel("frequency (Hz)")
    panels[0].set(xscale="log", xlim=(f[0], f[-1]))
    log_ticks(panels[-1].xaxis, f[-1] / f[0])
    inside = [(number, rate) for number, rate in modes if f[0] <= rate <= f[-1]]
    for axis in marked:
        mark_modes(axis, inside, has_numbers=False)


def _positive_values(values: Floats) -> Floats:
    """The finite ones above 0."""
    return np.where((values > 0) & np.isfinite(values), values, np.nan)


def shock_figure(response: ShockResponse) -> Figure:
    """The support's acceleration, the histories of the outputs by unit, and SRSS and CQC over the exact peaks.

    Raise ComputationError for more outputs than a picture holds.
    """
    units = _units(response.outputs)
    combined_outputs = np.flatnonzero(~response.follows_support & (response.peaks[:, 0] > 0)).tolist()
    rows = slice(None, None, -(-len(response.times) // CURVE_POINTS))
    times = response.times[rows]
    figure, panels = stack(1 + len(units) + bool(combined_outputs))
    histories = panels[: 1 + len(units)]
    shaken = [(times, response.record.acceleration(times))]
    has_band = draw_curves(histories[0], shaken, bands=True, color=ink(), lw=1.0)
    set_frame(histories[0], "", "acceleration (m/s²)", "driven by: support acceleration" + f", {RANGE}" * has_band)
    for axis, unit in zip(histories[1:], units, strict=True):
        numbers = [k for k, signal in enumerate(response.outputs) if signal.unit == unit]
        names = [signal_words(response.outputs[k].name) for k in numbers]
        draw_curves(axis, [(times, response.history[k, rows]) for k in numbers], names=names, bands=True)
        set_frame(axis, "", f"{QUANTITIES.get(unit, '')} ({unit_words(unit)})".strip(), "response")
        legend(axis, least_count=1)
    for axis in histories:
        axis.set_xlim(times[0], times[-1])
        axis.axvline(response.record.last, color=secondary_colour(), ls=MARKED, lw=0.9)
    for axis in histories[:-1]:
        axis.tick_params(labelbottom=False)
    histories[-1].set_xlabel("time, with the end of the record dotted (s)")
    if combined_outputs:
        _combinations(panels[-1], response, combined_outputs)
    headline(figure, title_of(response.modes.scene), "response to a record")
    return figure


def _combinations(axis: Axes, response: ShockResponse, numbers: list[int]) -> None:
    """SRSS and CQC of the peaks of the modes over the peak of their exact sum."""
    places = np.arange(len(numbers))
    for k, (name, values) in enumerate((("SRSS", response.srss), ("CQC", response.cqc))):
        ratios = values[numbers] / response.peaks[numbers, 0]
        hatch = ("", "//")[k]
        axis.bar(places + (k - 0.5) / 3, ratios, 1 / 3, color=colour(k), hatch=hatch, label=name)
    axis.axhline(1.0, color=ink(), lw=1.0)
    slope: dict[str, Any] = {"rotation": 30, "ha": "right", "rotation_mode": "anchor"}
    names = [fill(signal_words(response.outputs[k].name), 16) for k in numbers]
    axis.set_xticks(places, names, **slope if len(numbers) > HUES else {})
    set_frame(axis, "", "over exact peak (–)", "peaks of modes, combined")
    legend(axis)


def _units(outputs: tuple[Signal, ...]) -> list[str]:
    if len(outputs) > MOST_CURVES:
        raise ComputationError(
            f"{len(outputs)} outputs do not fit in a figure: choose at most {MOST_CURVES} with `outputs`"
        )
    return list(dict.fromkeys(signal.unit for signal in outputs))


def _logarithmic(axis: Axes) -> None:
    axis.set_yscale("log")
    axis.yaxis.set_minor_formatter("")


def _per_hertz(unit: str) -> str:
    above, _, below = unit.partition("/")
    squared_unit = {"s": "s²", "s^2": "s⁴", "": ""}.get(below, f"({below})²")
    return f"{above}²/{squared_unit}/Hz" if squared_unit else f"{above}²/Hz"


def _size(value: float) -> str:
    return "∞" if np.isinf(value) else f"{value:.3g}"
