"""Bode plots with the modes marked, impulse responses, travels of a crane, and peaks before and after tuning.

Values come from the closed forms of `modal.statespace.response`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, floor
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, MultipleLocator

from modal.assembly import coordinate_labels, hoisting_of, rig_of
from modal.errors import ComputationError
from modal.modes import UNCERTAIN
from modal.plotting.curves import RANGE, draw_curves, pick
from modal.plotting.layout import SMALL, headline, key, legend, log_ticks, mark_modes, set_frame
from modal.plotting.style import (
    BAND_OPACITY,
    CURVE_POINTS,
    HUES,
    MARKED,
    MOST_CURVES,
    VISIBLE_SHARE,
    colour,
    ink,
    paper,
    secondary_colour,
    spots,
    stack,
    thickness,
)
from modal.scene import title_of
from modal.scene.signal_names import link_names, signal_words, unit_words
from modal.statespace import ModalForm, frequency_response, impulse_response, impulse_times
from modal.statespace.shapers import shaper_for
from modal.statespace.travels import ShapedTravel, shaped_travel
from modal.types import Complexes, Floats

if TYPE_CHECKING:
    from modal.statespace.hoisting import Along
    from modal.tuning import Curves, Tuned


def hoist_figure(hoisting: Along) -> Figure:
    """The changing lengths (m), the angular frequencies (rad/s) and the adiabatic swing of every mode against time (s).

    Only lengths where no mode oscillates.  Raise ComputationError for more modes or lengths than one picture holds.
    """
    n_curves = max(hoisting.omega.shape[1], hoisting.lengths.shape[1])
    if n_curves > MOST_CURVES:
        raise ComputationError(f"{n_curves} curves do not fit in a figure: at most {MOST_CURVES}")
    ropes = [f"link {i + 1} of pendulum {p + 1}" for p, i in hoisting.links]
    modes = [f"mode {name}" for name in hoisting.names]
    panels = [(hoisting.lengths, ropes, "length (m)")]
    if modes:
        panels += [
            (hoisting.omega, modes, "angular frequency ω (rad/s)"),
            (hoisting.swing, modes, "relative swing (–)"),
        ]
    figure, axes = stack(len(panels), 3, sharex=True)
    for axis, (values, names, words) in zip(axes, panels, strict=True):
        for k, name in enumerate(names):
            axis.plot(hoisting.times, values[:, k], color=colour(k), label=name, **spots(k, values[:, k]))
        set_frame(axis, "time (s)" if axis is axes[-1] else "", words)
        axis.set_xlim(hoisting.times[0], hoisting.times[-1])
        legend(axis)
    headline(figure, title_of(hoisting.scene), "along the hoist")
    return figure


ROWS = ("unshaped", "shaped")


def travel_figure(travel: ShapedTravel) -> Figure:
    """The place of a cart as it is and shaped, or a force and what it moves, and the angles (°) of the links for each.

    Of a travel in several pieces, as within limits, the speed too, and along a hoist the lengths.
    Dotted lines bound the residual swing from the time on at which the command is over.
    """
    force = f"torque ({travel.unit})" if travel.unit == "N m" else f"force ({travel.unit})"
    place = "angle (°)" if travel.unit == "N m" else "position (m)"
    motion = np.degrees(travel.moved) if travel.unit == "N m" else travel.moved
    panels = [(travel.command, force, "Force"), (motion, place, "Moved coordinate")]
    if travel.unit == "m":
        speeds = np.array([way(travel.times)[1] for way in travel.ways])
        panels = [(travel.command, place, "Cart, as prescribed"), (speeds, "speed (m/s)", "")]
        panels = panels[: 1 + (len(travel.ways[0].knots) > 2)]
    hoisting, labels = hoisting_of(travel.scene), link_names(coordinate_labels(rig_of(travel.scene)))
    figure, axes = stack(len(panels) + 2 + (hoisting is not None), sharex=True)
    axes[-1].sharey(axes[-2])
    if hoisting is not None:
        ropes = np.flatnonzero(hoisting.moving)
        lengths = hoisting.at(travel.times)[0][:, ropes].T
        draw_curves(axes[-3], [(travel.times, length) for length in lengths], names=[labels[k] for k in ropes])
        set_frame(axes[-3], "", "length (m)", "Hoist, as prescribed")
        legend(axes[-3])
    for axis, (rows, label, title) in zip(axes, panels, strict=False):
        draw_curves(axis, [(travel.times, values) for values in rows], names=ROWS, numbers=(4, 2), lw=1.8)
        for hue, over in zip((4, 2), travel.over.tolist(), strict=True):
            axis.axvline(over, color=colour(hue), ls=MARKED, lw=1.0, zorder=0)
        set_frame(axis, "", label, title)
        legend(axis)
    _swings(axes[-2:], [(travel, 0), (travel, 1)], ROWS)
    headline(figure, title_of(travel.scene), f"a travel of {travel.distance:g} m, unshaped and shaped")
    return figure


def tuned_travel_figure(tuning: Tuned) -> Figure:
    """The angles (°) of the links in the travel whose residual swing was tuned, before and after."""
    setting = tuning.objective.quantities.setting
    kind = setting.kind or "zv"
    travels = [
        shaped_travel(scene, shaper_for(scene, 1, kind), setting.travel or 0.0, setting.over)
        for scene in (tuning.given, tuning.scene)
    ]
    figure, axes = stack(2, sharex=True)
    axes[1].sharey(axes[0])
    _swings(axes, [(travel, int(setting.kind is not None)) for travel in travels], ("before", "after"))
    headline(figure, title_of(tuning.given), "before and after tuning")
    return figure


def _swings(axes: Sequence[Axes], ways: Sequence[tuple[ShapedTravel, int]], titles: Sequence[str]) -> None:
    """The angles of the links along rows of travels, one below the other, and what swing they leave."""
    degrees = [np.degrees(travel.angles[row]) for travel, row in ways]
    labels = link_names(coordinate_labels(rig_of(ways[0][0].scene)))
    numbers, names, _ = pick(np.concatenate(degrees).T, labels, HUES)
    largest = max(float(np.degrees(travel.residual[row])) for travel, row in ways)
    limit = 4 / 3 * max(*(float(np.abs(part).max()) for part in degrees), largest, 1e-9)
    for axis, (travel, row), angles, title in zip(axes, ways, degrees, titles, strict=True):
        draw_curves(axis, [(travel.times, angles[:, link]) for link in numbers], names=names, bands=True)
        axis.set(xlim=(travel.times[0], travel.times[-1]), ylim=(-limit, limit))
        set_frame(axis, "", "angle (°)", f"Swing, {title}")
        _residual(axis, travel, row)
    legend(axes[0], least_count=1)
    axes[-1].set_xlabel("time (s)")


def _residual(axis: Axes, travel: ShapedTravel, row: int) -> None:
    """Two dotted lines that bound the swing after the command, and how large it is."""
    angle, over = float(np.degrees(travel.residual[row])), float(travel.over[row])
    for sign in (-1, 1):
        axis.plot([over, travel.times[-1]], [sign * angle] * 2, color=secondary_colour(), ls=MARKED, lw=1.4)
    axis.axvline(over, color=secondary_colour(), ls=MARKED, lw=1.0, zorder=0)
    words = f"residual swing {angle:.3g}°" if angle >= 5e-4 else "no residual swing"
    look: dict[str, Any] = {
        "fontsize": SMALL,
        "color": ink(),
        "bbox": {"facecolor": paper(), "edgecolor": "none", "pad": 1},
    }
    axis.annotate(words, (over, angle), xytext=(5, 4), textcoords="offset points", va="bottom", **look)


Spread = Callable[[Floats], Floats]
DEPTH_DB = 240.0
"""Format: most decibels that a picture goes down from its top: below are roundings."""
PEAK_ROOM = 0.01
"""Format: distance from an undamped mode, over its frequency, up to which heights do not count."""
REFINED_POINTS = 12
"""Cost: points put to either side of a peak or trough in each round that looks for its height."""


def bode_figure(
    form: ModalForm,
    *,
    source: int = 0,
    outputs: Sequence[int] = (),
    band: tuple[float, float] | None = None,
    std: Spread | None = None,
) -> Figure:
    """Magnitude and phase of G(2πif) from input `source` to these outputs (indices; by default all), over f in Hz.

    `band` is in rad/s, by default from below the lowest mode to above the highest.

    Dotted lines with numbers mark the modes, the fixed-base ones where the cart's motion is prescribed. Every peak and
    trough of a damped mode has its own height, found between the points of the grid; peaks of undamped modes are
    infinite, and are cut, as zeros are, at levels given below the picture. `std` gives the standard deviations (p, m,
    W) of |G| at ω (W,): two of them to either side are shaded. Raise ComputationError for more curves than a picture
    holds.
    """
    numbers = _choose_outputs(form, outputs)
    low, high = band or _band(form)
    omega, G = _sample(form, numbers, source, low, high)
    size = np.abs(G)
    bottom, top, infinite = _limits(form, omega, size)
    figure, (upper, lower) = stack(2, 2 + len(numbers) / MOST_CURVES, sharex=True, height_ratios=(3, 2))
    curves = [_whole_curve(omega, response, bottom - 4, top + 4) for response in G]  # what is cut leaves the picture
    turn = 2 * np.pi
    heights, hertz = [(w / turn, y) for w, y in curves], omega / turn
    has_zeros = any(bool(np.any(y < bottom)) for _, y in heights)
    draw_curves(upper, heights, log="x")
    draw_curves(lower, [(hertz, _phase(response)) for response in G], log="x")
    upper.set(xscale="log", ylabel=f"magnitude\n(dB re 1 {_units(form, numbers, source)})", ylim=(bottom, top))
    if std is not None:
        _shade(upper, hertz, size, std(omega)[numbers, source])
    upper.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 4, 5, 10]))
    lower.set(ylabel="phase (°)", xlabel="frequency (Hz)", xlim=(low / turn, high / turn), ylim=(-195, 195))
    lower.yaxis.set_major_locator(MultipleLocator(90))
    log_ticks(lower.xaxis, high / low)
    inside = [(k, rate / turn) for k, rate in enumerate(form.modes.omega.tolist(), 1) if low <= rate <= high]
    mark_modes(upper, inside)
    mark_modes(lower, inside, has_numbers=False)
    held_note = ", with the fixed-base modes" if form.is_held else ""
    words = f"response to the {signal_words(form.model.inputs[source].name)}{held_note}"
    notes = [f"peaks of undamped modes are infinite and cut at {top:g} dB".replace("-", "−")] if infinite else []
    notes += [f"zeros cut at {bottom:g} dB".replace("-", "−")] if has_zeros else []
    _finish(figure, form, numbers, words + (", ± 2 standard deviations" if std else ""), "; ".join(notes))
    return figure


def _shade(axis: Axes, hertz: Floats, size: Floats, spread: Floats) -> None:
    """Two standard deviations to either side of every curve."""
    low, high = axis.get_ylim()
    smallest = 10 ** (low / 20)
    for k, (magnitude, std) in enumerate(zip(size, spread, strict=True)):
        with np.errstate(all="ignore"):
            below, above = (
                np.clip(_decibel(np.maximum(magnitude + sign * std, smallest)), low, high) for sign in (-2, 2)
            )
        axis.fill_between(hertz, below, above, color=colour(k), alpha=BAND_OPACITY, lw=0)


def impulse_figure(
    form: ModalForm, *, source: int = 0, outputs: Sequence[int] = (), duration: float | None = None
) -> Figure:
    """h(t) from input `source` to these outputs (indices; by default all), one panel for each unit.

    `duration` in s; by default four periods of the slowest oscillating mode. Raise ComputationError for more curves
    than one picture holds.
    """
    numbers = _choose_outputs(form, outputs)
    t = impulse_times(form, duration)
    h = impulse_response(form, t)[numbers, source]
    units = list(dict.fromkeys(form.model.outputs[output].unit for output in numbers))
    figure, panels = stack(len(units), sharex=True)
    bands = False
    for panel, unit in zip(panels, units, strict=True):
        outputs_of_unit = [k for k, output in enumerate(numbers) if form.model.outputs[output].unit == unit]
        bands |= draw_curves(panel, [(t, h[k]) for k in outputs_of_unit], numbers=outputs_of_unit, bands=True)
        panel.set_ylabel(f"response ({unit_words(f'{unit} per {form.model.inputs[source].unit} s')})")
        panel.axhline(0.0, color=secondary_colour(), lw=0.8, zorder=0)
    panels[-1].set(xlabel="time t (s)", xlim=(0.0, t[-1]))
    notes = f"bands: {RANGE} of what swings faster than lines can show" if bands else ""
    _finish(figure, form, numbers, f"impulse response to the {signal_words(form.model.inputs[source].name)}", notes)
    return figure


# ------------------------------------------------------------------------------------------------------- numbers


def _choose_outputs(form: ModalForm, outputs: Sequence[int]) -> list[int]:
    numbers = list(outputs) or list(range(len(form.model.outputs)))
    if len(numbers) > MOST_CURVES:
        raise ComputationError(
            f"{len(numbers)} outputs do not fit in a figure: choose at most {MOST_CURVES} outputs with `outputs`"
        )
    return numbers


def _moving(form: ModalForm) -> Floats:
    certain = (form.modes.omega > 0) & (form.modes.error < UNCERTAIN)
    omega: Floats = form.modes.omega[certain]
    return omega if omega.size else np.ones(1)


def _band(form: ModalForm) -> tuple[float, float]:
    """From a third of the lowest mode to three times the highest."""
    omega = _moving(form)
    return float(omega.min() / 3), float(omega.max() * 3)


def _sample(form: ModalForm, numbers: list[int], source: int, low: float, high: float) -> tuple[Floats, Complexes]:
    """Angular frequencies (W,) and G (k, W), with points in between added about every peak and trough."""

    def response_at(omega: Floats) -> Complexes:
        return frequency_response(form, omega, outputs=numbers, inputs=[source], tolerance=VISIBLE_SHARE)[:, 0]

    omega = _grid(form, low, high)
    G = response_at(omega)
    for _ in range(4):
        size = np.abs(G)
        with np.errstate(invalid="ignore"):
            rises = np.sign(np.diff(size, axis=1))
        turning = np.isfinite(size[:, :-2] + size[:, 1:-1] + size[:, 2:]) & (rises[:, 1:] * rises[:, :-1] < 0)
        places = np.flatnonzero(turning.any(axis=0))[: CURVE_POINTS // REFINED_POINTS]
        if not len(places):
            break
        part = np.linspace(0, 1, REFINED_POINTS + 2)[1:-1]
        inner = [omega[places + k, None] + part * (omega[places + k + 1] - omega[places + k])[:, None] for k in (0, 1)]
        inner_points = np.setdiff1d(np.concatenate(inner).ravel(), omega)
        all_points = np.concatenate((omega, inner_points))
        order = np.argsort(all_points, kind="stable")
        omega = all_points[order]
        G = np.concatenate((G, response_at(inner_points)), axis=1)[:, order]
    return omega, G


def _grid(form: ModalForm, low: float, high: float) -> Floats:
    """Points evenly spaced in log ω and closer near every mode, which is a point itself, within its width too."""
    moving = _moving(form)
    aside = np.geomspace(1e-5, 0.03, max(6, min(60, CURVE_POINTS // len(moving))))
    close_points = np.outer(moving, np.concatenate([1 - aside, [1.0], 1 + aside])).ravel()
    damped_eigenvalues = form.modes.eigenvalue[(form.modes.eigenvalue.real != 0) & (form.modes.eigenvalue.imag > 0)]
    widths = np.concatenate(([0.0], np.geomspace(0.05, 30, 24)))
    within = (
        np.outer(np.abs(damped_eigenvalues.real), np.concatenate((-widths, widths))) + damped_eigenvalues.imag[:, None]
    )
    close_points = np.concatenate((close_points, within.ravel()))
    return np.unique(
        np.concatenate(
            [np.geomspace(low, high, CURVE_POINTS), close_points[(close_points > low) & (close_points < high)]]
        )
    )


def _phase(G: Complexes) -> Floats:
    """Degrees in [−180, 180), interrupted where they wrap and where G vanishes."""
    phase = (np.degrees(np.angle(G)) + 180 + 1e-6) % 360 - 180 - 1e-6
    phase[1:][np.abs(np.diff(phase)) > 270] = np.nan
    phase[G == 0] = np.nan
    return np.asarray(phase, dtype=np.float64)


def _decibel(size: Floats) -> Floats:
    """20 log₁₀ of magnitudes, NaN for those that are 0 or infinite."""
    return np.asarray(20 * np.log10(np.where((size > 0) & np.isfinite(size), size, np.nan)))


def _whole_curve(omega: Floats, G: Complexes, floor: float, ceiling: float) -> tuple[Floats, Floats]:
    """ω and decibels of one curve from `floor` to `ceiling`, which peaks and zeros may reach; NaN if all are 0."""
    if not G.any():
        return omega, np.full(len(omega), np.nan)
    size = np.abs(G)
    with np.errstate(divide="ignore", invalid="ignore"):
        decibel = np.clip(20 * np.log10(size), floor, ceiling)
        real = np.abs(G.imag) <= np.sqrt(np.finfo(np.float64).eps) * np.abs(G.real)
        turns = (np.sign(G.real[1:]) != np.sign(G.real[:-1])) & real[1:] & real[:-1] & np.isfinite(size[1:] + size[:-1])
    at = np.flatnonzero(turns)
    return np.insert(omega, at + 1, (omega[at] + omega[at + 1]) / 2), np.insert(decibel, at + 1, floor)


def _limits(form: ModalForm, omega: Floats, size: Floats) -> tuple[float, float, bool]:
    """Multiples of 20 dB around all curves (k, W) and whether a peak is infinite.

    Above all heights but those within PEAK_ROOM of an undamped mode, above which there are 20 dB more; at most DEPTH_DB
    below the largest, and 20 dB below the lowest end of a curve.
    """
    undamped_omega = form.modes.omega[form.modes.eigenvalue.real == 0]
    infinite = bool(np.isinf(size).any())
    is_away = np.ones(len(omega), dtype=bool)
    for value in undamped_omega if infinite else ():
        is_away &= np.abs(omega - value) > PEAK_ROOM * value
    decibel = _decibel(size)
    heights = decibel[:, is_away] if is_away.any() else decibel
    if not np.isfinite(heights).any():
        return -20.0, 20.0, infinite
    top = 20 * ceil(float(np.nanmax(heights)) / 20) + 20 * infinite
    finite_curves = decibel[np.isfinite(decibel).any(axis=1)]
    ends = np.concatenate((finite_curves[:, 0], finite_curves[:, -1], np.nanmedian(finite_curves, axis=1)))
    lowest = max(float(np.nanmin(ends)), top - DEPTH_DB)
    troughs = float(np.nanmin(heights))
    return max(20 * floor(lowest / 20) - 20, min(20 * floor(troughs / 20), top - 40)), top, infinite


# ------------------------------------------------------------------------------------------------------- drawing


def _finish(figure: Figure, form: ModalForm, outputs: Sequence[int], title: str, notes: str = "") -> None:
    headline(figure, title_of(form.modes.scene), title)
    names = [signal_words(form.model.outputs[output].name) for output in outputs]
    handles = [Line2D([], [], color=colour(k), lw=thickness(k), **spots(k)) for k in range(len(names))]
    key(figure, handles, names, notes=notes)


def _units(form: ModalForm, numbers: list[int], source: int) -> str:
    units = list(dict.fromkeys(form.model.outputs[output].unit for output in numbers))
    several = " or ".join(units) if len(units) <= 2 else "each unit"
    return unit_words(f"{several} per {form.model.inputs[source].unit}")


TUNED_DB = 40.0
"""Format: most decibels below and above the highest tuned peak that a panel shows."""


def tuning_figure(tuning: Tuned) -> Figure:
    """|H| of every tuned peak before and after, with the equal peaks marked, or the swing of a tuned travel.

    Raise ComputationError if neither is tuned, or more peaks than a picture holds.
    """
    curves = tuning.curves()
    if not curves and any(aim.quantity.kind == "residual" for aim in tuning.objective.aims):
        return tuned_travel_figure(tuning)
    if not curves:
        raise ComputationError("no peak was tuned: there are no curves to draw")
    if len(curves) > HUES - 1:
        raise ComputationError(f"{len(curves)} responses do not fit in a figure: choose at most {HUES - 1}")
    figure, panels = stack(len(curves))
    for axis, response in zip(panels, curves, strict=True):
        _draw(axis, response)
    panels[-1].set_xlabel("frequency (Hz)")
    handles = [Line2D([], [], color=colour(k), lw=thickness(k)) for k in range(2)]
    handles.append(Line2D([], [], color=secondary_colour(), ls=MARKED, lw=1.0))
    headline(figure, title_of(tuning.given), "before and after tuning")
    key(figure, handles, ["before", "after", "highest peak after"])
    return figure


def _draw(axis: Axes, response: Curves) -> None:
    with np.errstate(divide="ignore"):
        before, after = (20 * np.log10(np.where(size > 0, size, np.nan)) for size in (response.before, response.after))
    top = float(np.nanmax(after))
    highest = max(min(float(np.nanmax(before)), top + TUNED_DB), top) + 4
    low = max(min(float(np.nanmin(before)), float(np.nanmin(after))), top - TUNED_DB)
    curves = [(response.frequency_hz, np.clip(decibels, low - 4, highest + 4)) for decibels in (before, after)]
    draw_curves(axis, curves, log="x")
    axis.axhline(top, color=secondary_colour(), ls=MARKED, lw=1.0, zorder=0)
    ends = float(response.frequency_hz[0]), float(response.frequency_hz[-1])
    words = " over ".join(map(signal_words, response.name.removeprefix("peak:").split("/")))
    label = f"{words}\n(dB re 1 {unit_words(response.unit)})"
    axis.set(xscale="log", xlim=ends, ylim=(low - 2, highest), ylabel=label)
    log_ticks(axis.xaxis, ends[1] / ends[0])
