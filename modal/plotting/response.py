"""Bode plots with the modes marked, and impulse responses, from the closed forms of `modal.statespace.response`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, floor
from typing import IO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, MultipleLocator

from modal.errors import ComputationError
from modal.modes import UNCERTAIN
from modal.plotting.layout import headline, key, log_ticks, mark_modes
from modal.plotting.style import MOST_CURVES, WIDTH, colour, dash, muted, save, sheet
from modal.statespace import ModalForm, Signal, frequency_response, impulse_response
from modal.types import Complexes, Floats

POINTS, LONGEST = 2000, 20_000
Spread = Callable[[Floats], Floats]
FAR = 70.0
"""Decibels from the median of all curves that a picture goes up and down."""


def draw_bode(
    form: ModalForm,
    stream: IO[bytes],
    *,
    source: int = 0,
    outputs: Sequence[int] = (),
    band: tuple[float, float] | None = None,
    kind: str = "png",
    std: Spread | None = None,
) -> None:
    """Write the picture of `bode_figure` as png, svg or pdf."""
    save(bode_figure(form, source=source, outputs=outputs, band=band, std=std), stream, kind)


def bode_figure(
    form: ModalForm,
    *,
    source: int = 0,
    outputs: Sequence[int] = (),
    band: tuple[float, float] | None = None,
    std: Spread | None = None,
) -> Figure:
    """Magnitude and phase of G(iω) from input `source` to these outputs (indices; by default all) over a band (rad/s).

    Dotted lines with numbers mark the modes, the fixed-base ones where the cart's motion is prescribed; an undamped
    peak, which is infinite, is cut off.  `std` gives the standard deviations (p, m, W) of |G| at ω (W,): two of them to
    either side are shaded.  Raises ComputationError for more curves than a picture holds.
    """
    shown = _shown(form, outputs)
    low, high = band or _band(form)
    omega = _grid(form, low, high)
    G = frequency_response(form, omega)[shown, source]
    figure = sheet(WIDTH, 6.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for k, response in enumerate(G):
        size = np.abs(response)
        _draw(top, omega, _decibel(size), k)
        _draw(bottom, omega, _phase(response), k)
    spread = None if std is None else std(omega)[shown, source]
    top.set(xscale="log", ylabel=f"magnitude (dB, {_units(form, shown, source)})", ylim=_limits(_decibel(np.abs(G))))
    if spread is not None:
        _shade(top, omega, np.abs(G), spread)
    top.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 4, 5, 10]))
    bottom.set(ylabel="phase (°)", xlabel="angular frequency ω (rad/s)", xlim=(low, high), ylim=(-195, 195))
    bottom.yaxis.set_major_locator(MultipleLocator(90))
    log_ticks(bottom.xaxis, high / low)
    inside = [(k, omega) for k, omega in enumerate(form.modes.omega.tolist(), 1) if low <= omega <= high]
    mark_modes(top, inside)
    mark_modes(bottom, inside, numbered=False)
    held = ", with the fixed-base modes" if any(block.mode is None for block in form.blocks) else ""
    words = f"response to {_named(form.model.inputs[source])}{held}"
    _finish(figure, form, shown, words + (", ± 2 standard deviations" if std else ""))
    return figure


def _shade(axis: Axes, omega: Floats, size: Floats, spread: Floats) -> None:
    """Two standard deviations to either side of every curve."""
    low, high = axis.get_ylim()
    least = 10 ** (low / 20)
    for k, (own, std) in enumerate(zip(size, spread, strict=True)):
        with np.errstate(all="ignore"):
            below, above = (np.clip(_decibel(np.maximum(own + sign * std, least)), low, high) for sign in (-2, 2))
        axis.fill_between(omega, below, above, color=colour(k), alpha=0.22, lw=0)


def draw_impulse(
    form: ModalForm,
    stream: IO[bytes],
    *,
    source: int = 0,
    outputs: Sequence[int] = (),
    duration: float | None = None,
    kind: str = "png",
) -> None:
    """Write the picture of `impulse_figure` as png, svg or pdf."""
    save(impulse_figure(form, source=source, outputs=outputs, duration=duration), stream, kind)


def impulse_figure(
    form: ModalForm, *, source: int = 0, outputs: Sequence[int] = (), duration: float | None = None
) -> Figure:
    """h(t) from input `source` to these outputs (indices; by default all), one panel for each unit.

    `duration` in s; by default four periods of the slowest oscillating mode.  Raises ComputationError for more curves
    than one picture holds.
    """
    shown = _shown(form, outputs)
    swinging = [value.imag for value in form.modes.eigenvalue.tolist() if value.imag > 0] or [1.0]
    end = duration or 8 * np.pi / min(swinging)
    points = int(np.clip(40 * end * max(swinging) / (2 * np.pi), POINTS, LONGEST))
    t = np.linspace(0.0, end, points)
    h = impulse_response(form, t)[shown, source]
    units = list(dict.fromkeys(form.model.outputs[output].unit for output in shown))
    figure = sheet(WIDTH, 1.4 + 2.2 * len(units))
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for k, output in enumerate(shown):
        _draw(panels[units.index(form.model.outputs[output].unit)], t, h[k], k)
    for panel, unit in zip(panels, units, strict=True):
        panel.set_ylabel(f"response ({unit} per {form.model.inputs[source].unit} s)")
        panel.axhline(0.0, color=muted(), lw=0.8, zorder=0)
    panels[-1].set(xlabel="time t (s)", xlim=(0.0, end))
    _finish(figure, form, shown, f"impulse response to {_named(form.model.inputs[source])}")
    return figure


# ------------------------------------------------------------------------------------------------------- numbers


def _shown(form: ModalForm, outputs: Sequence[int]) -> list[int]:
    shown = list(outputs) or list(range(len(form.model.outputs)))
    if len(shown) > MOST_CURVES:
        raise ComputationError(f"{len(shown)} outputs do not fit in a figure: choose at most {MOST_CURVES} outputs")
    return shown


def _moving(form: ModalForm) -> Floats:
    certain = (form.modes.omega > 0) & (form.modes.error < UNCERTAIN)
    omega: Floats = form.modes.omega[certain]
    return omega if omega.size else np.ones(1)


def _band(form: ModalForm) -> tuple[float, float]:
    """From a third of the lowest mode to three times the highest."""
    omega = _moving(form)
    return float(omega.min() / 3), float(omega.max() * 3)


def _grid(form: ModalForm, low: float, high: float) -> Floats:
    """Points evenly spaced in log ω, and closer near every mode."""
    aside = np.geomspace(1e-5, 0.03, 60)
    near = np.outer(_moving(form), np.concatenate([1 - aside, 1 + aside])).ravel()
    return np.unique(np.concatenate([np.geomspace(low, high, POINTS), near[(near > low) & (near < high)]]))


def _phase(G: Complexes) -> Floats:
    """Degrees in [−180, 180), interrupted where they wrap and where G vanishes."""
    phase = (np.degrees(np.angle(G)) + 180 + 1e-6) % 360 - 180 - 1e-6
    phase[1:][np.abs(np.diff(phase)) > 270] = np.nan
    phase[G == 0] = np.nan
    return np.asarray(phase, dtype=np.float64)


def _decibel(size: Floats) -> Floats:
    """20 log₁₀ of magnitudes, NaN for those that are 0 or infinite."""
    return np.asarray(20 * np.log10(np.where((size > 0) & np.isfinite(size), size, np.nan)))


def _limits(decibel: Floats) -> tuple[float, float]:
    """Multiples of 20 dB around all curves, up to FAR from their median: an undamped peak has no height."""
    seen = decibel[np.isfinite(decibel)]
    if not seen.size:
        return -20.0, 20.0
    middle = float(np.median(seen))
    low, high = max(float(seen.min()), middle - FAR), min(float(seen.max()), middle + FAR)
    return 20 * floor(low / 20), 20 * ceil(high / 20)


# ------------------------------------------------------------------------------------------------------- drawing


def _draw(axis: Axes, x: Floats, y: Floats, k: int) -> None:
    axis.plot(x, y, color=colour(k), ls=dash(k))


def _finish(figure: Figure, form: ModalForm, shown: list[int], title: str) -> None:
    headline(figure, form.model.title, title)
    handles = [Line2D([], [], color=colour(k), ls=dash(k)) for k in range(len(shown))]
    key(figure, handles, [_named(form.model.outputs[output]) for output in shown])


def _named(signal: Signal) -> str:
    return f"{signal.name} ({signal.unit})"


def _units(form: ModalForm, shown: list[int], source: int) -> str:
    units = list(dict.fromkeys(form.model.outputs[output].unit for output in shown))
    return f"{units[0] if len(units) == 1 else 'each unit'} per {form.model.inputs[source].unit}"
