"""Pictures of checks: shifts of frequency with amplitude, spectra of modal coordinates, time against accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import degrees, isfinite, pi
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import SMALL, decade_limits, headline, key, log_ticks, mark_modes
from modal.plotting.style import (
    HUES,
    MARKED,
    PREDICTED,
    QUIET,
    colour,
    dashes_of_prediction,
    ink,
    paper,
    rest,
    secondary_colour,
    stack,
)
from modal.scene import title_of
from modal.types import Floats
from nonlinear.plotting.run import SPECTRUM_DEPTH
from nonlinear.postprocessing import ORDER
from nonlinear.reduction import CORRECTED, LINEAR
from nonlinear.verification import ONE_PERCENT, Check, Comparison, ModeCheck, ModeInMotion

if TYPE_CHECKING:
    from nonlinear.accuracy import FrequencyTradeoff, WorkPrecision, WorkPrecisionRow

SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
MARKERS, SIZES = ("o", "s", "D"), (9.5, 5.5)
MOST_CURVES = HUES * len(MARKERS)
METHODS = dict(zip(("RK45", "taylor", "LSODA", "Radau", "DOP853", "RK23"), range(HUES), strict=True))
MARKERS_OF_FORMS = {"minimal": "o", "spatial": "o", "compiled": "D", "maximal": "s"}
MODAL = {LINEAR: "P", CORRECTED: "*"}


def check_figure(check: Check) -> Figure:
    """|ω(a)/ω − 1| against the largest angle on logarithmic axes: marks are runs, dashed lines κa², wide ones orbits.

    The level of 1 % is marked, with the angle measured for it; hollow marks are frequencies that rise with amplitude.
    Irregular runs are omitted. Raise ComputationError if there is nothing to draw or too much.
    """
    rows = [
        row
        for row in check.rows
        if any(not measurement.irregular and measurement.shift for measurement in row.measurements)
    ]
    if not rows:
        raise ComputationError("no mode was measured: there is nothing to draw")
    if len(rows) > MOST_CURVES:
        raise ComputationError(f"{len(rows)} modes do not fit in a figure: choose at most {MOST_CURVES} with `modes`")
    figure, (axis,) = stack(1)
    angles = [degrees(measurement.effective) for row in rows for measurement in row.measurements]
    high = min(2 * max(angles), 180.0)
    low = min(min(angles) / 2, high / 12)  # more than a decade, so that several ticks have numbers
    for k, row in enumerate(rows):
        _shifts(axis, row, low, high, k)
    sizes = [abs(measurement.shift) for row in rows for measurement in row.measurements if not measurement.irregular]
    bottom, top = min(min(sizes) / 2, ONE_PERCENT / 20), min(2 * max(*sizes, 2 * ONE_PERCENT), 1.0)
    axis.axhline(ONE_PERCENT, color=secondary_colour(), lw=0.9, ls=MARKED, zorder=0)
    box = {"facecolor": paper(), "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    style: dict[str, Any] = {"fontsize": SMALL, "bbox": box, "zorder": 5}
    axis.annotate("1 %", (0.004, ONE_PERCENT), (0, 4), axis.get_yaxis_transform(), "offset points", **style)
    axis.set(xscale="log", yscale="log", xlim=(low, high), ylim=(bottom, top))
    axis.set(xlabel="largest angle a (°)", ylabel="shift of frequency |ω(a)/ω − 1| (–)")
    log_ticks(axis.xaxis, high / low)
    headline(figure, title_of(check.scene), "frequency against amplitude")
    handles = []
    for k, row in enumerate(rows):
        name = f"mode {row.mode.number}: {row.mode.omega:.5g} rad/s, κ = {row.mode.kappa:.4g}".replace("-", "−")
        handles.append(Line2D([], [], color=colour(k), ls="", marker=_marker(k), ms=_size(k), mec=paper(), label=name))
    key(figure, [*handles, *_style_keys(rows)], columns=2)
    return figure


def _style_keys(rows: Sequence[ModeCheck]) -> list[Line2D]:
    """The legend's explanations of the marks and lines that a check has."""
    grey, steady = secondary_colour(), [m for row in rows for m in row.measurements if not m.irregular]
    keys: list[tuple[bool, str, dict[str, Any]]] = [
        (True, "predicted shift κa²", {"ls": PREDICTED, "lw": 1.3}),
        (any(row.backbone for row in rows), "periodic orbits", {"lw": 2.4, "alpha": 0.35}),
        (any(m.shift <= 0 for m in steady), "measured, frequency falls", {"ls": "", "marker": "o"}),
        (any(m.shift > 0 for m in steady), "measured, frequency rises", {"ls": "", "marker": "o", "mfc": paper()}),
        (
            any(np.isfinite(row.one_percent_deg) for row in rows),
            "amplitude of a 1 % shift, measured",
            {"ls": "", "marker": "|", "ms": 9, "mew": 1.8},
        ),
    ]
    return [Line2D([], [], color=grey, label=name, **look) for is_drawn, name, look in keys if is_drawn]


def _shifts(axis: Axes, row: ModeCheck, low: float, high: float, k: int) -> None:
    """One mode: κa² dashed, periodic orbits as a wide one, runs as marks, the measured 1 % as a tick."""
    a = np.array([low, high])  # between which a power is a straight line
    shift = np.abs(row.mode.kappa) * np.radians(a) ** 2
    axis.plot(a, shift, color=colour(k), ls=dashes_of_prediction(k), lw=1.3, zorder=2)
    if row.backbone and row.backbone.linear:
        size, shift = np.rad2deg(row.backbone.amplitude), np.abs(row.backbone.omega / row.backbone.linear - 1)
        axis.plot(size, shift, color=colour(k), lw=2.4, alpha=0.35, gid=QUIET, zorder=1.5)
    steady = [measurement for measurement in row.measurements if not measurement.irregular]
    x = np.degrees([measurement.effective for measurement in steady])
    y = np.array([measurement.shift for measurement in steady])
    for falls in (True, False):
        is_branch = (y < 0) == falls
        face, edge = (colour(k), paper()) if falls else (paper(), colour(k))
        axis.plot(x[is_branch], np.abs(y[is_branch]), _marker(k), ms=_size(k), mfc=face, mec=edge, mew=1.0, zorder=4)
    if np.isfinite(row.one_percent_deg):
        axis.plot(row.one_percent_deg, ONE_PERCENT, "|", ms=15, mew=1.8, color=colour(k), zorder=3)


def spectrum_figure(comparison: Comparison) -> Figure:
    """Amplitude spectra of the modal coordinates that move, the strongest of a mode's copies, on a logarithmic scale.

    Dotted lines with numbers mark the table's frequencies.  Raise ComputationError if nothing oscillates.
    """
    rows = _strongest(comparison)
    figure, (axis,) = stack(1)
    omega, sizes = _spectra(comparison, rows)
    top = float(sizes.max())
    for k, size in enumerate(sizes):
        axis.plot(omega, size, color=colour(k), lw=1.3, zorder=3)
    low, high = comparison.swinging.min() / 2, min(float(omega[-1]), 1.6 * float(comparison.swinging.max()))
    axis.set(xlim=(low, high), yscale="log", ylim=(top * SPECTRUM_DEPTH**0.5, top * 3))
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="amplitude of the modal coordinate (°)")
    inside = enumerate(np.abs(comparison.modes.eigenvalue.imag).tolist(), 1)
    mark_modes(axis, [(number, omega) for number, omega in inside if low < omega < high])
    handles = [Line2D([], [], color=colour(k)) for k in range(len(rows))]
    names = [f"mode {row.mode.number}: {row.mode.omega:.5g} rad/s" for row in rows]
    headline(figure, title_of(comparison.modes.scene), "spectra of the modal coordinates")
    power = str(ORDER).translate(SUPERSCRIPTS)
    notes = f"window (1 + cos πs){power}, s from −1 to 1 over the motion, with zeros to 4 times its length"
    key(figure, handles, names, notes=notes)
    return figure


def _strongest(comparison: Comparison) -> list[ModeInMotion]:
    """The strongest copy of every oscillating mode, limited to the largest of these."""
    best: dict[int, ModeInMotion] = {}
    for row in comparison.rows:
        if row.mode.oscillates and row.largest > best.get(row.mode.number, row).largest * (row.mode.number in best):
            best[row.mode.number] = row
    strongest = sorted(best.values(), key=lambda row: -row.largest)[:HUES]
    if not strongest:
        raise ComputationError("no mode oscillates: there is no spectrum to draw")
    return sorted(strongest, key=lambda row: row.mode.number)


def _spectra(comparison: Comparison, rows: Sequence[ModeInMotion]) -> tuple[Floats, Floats]:
    """ω (W,) and amplitudes (rows, W) in degrees, in the window of `nonlinear.postprocessing.frequencies`."""
    count = len(comparison.times)
    places = list(zip(comparison.motion.number.tolist(), comparison.motion.copy.tolist(), strict=True))
    chosen = comparison.motion.coordinate[:, [places.index((row.mode.number - 1, row.copy)) for row in rows]]
    window = (1 + np.cos(pi * np.linspace(-1, 1, count))) ** ORDER
    sizes = np.abs(np.fft.rfft((window / window.sum())[:, None] * chosen, 4 * count, axis=0)).T
    omega = 2 * pi * np.fft.rfftfreq(4 * count, float(comparison.times[1] - comparison.times[0]))
    return np.asarray(omega, dtype=np.float64), np.degrees(2 * sizes)


# ------------------------------------------------------------------------------------------------------- style


def _marker(k: int) -> str:
    return MARKERS[k // HUES]


def _size(k: int) -> float:
    """Alternating large and small sizes: the small ones stay visible on top."""
    return SIZES[k % 2]


def tradeoff_figure(work_precision: WorkPrecision) -> Figure:
    """The largest error (rad) of every candidate against its time (s) on logarithmic axes, one line per family.

    The broad line is the Pareto front; in the shaded part the reference cannot resolve errors, and candidates that
    reach it are drawn on its edge. Raise ComputationError if no candidate was measured.
    """
    rows = [row for row in work_precision.rows if row.candidate != work_precision.reference.candidate]
    if not rows:
        raise ComputationError("no candidate was measured: there is nothing to draw")
    figure, (axis,) = stack(1, 2)
    _bounds(axis, work_precision, rows)
    _front(axis, work_precision)
    for _, members in groupby(rows, key=lambda row: row.candidate.family):
        _family(axis, work_precision, list(members))
    _decorate(figure, axis, work_precision)
    return figure


def _bounds(axis: Axes, work_precision: WorkPrecision, rows: list[WorkPrecisionRow]) -> None:
    times, errors = [row.seconds for row in rows], [work_precision.measurable_error(row) for row in rows]
    bottom, floor = min(errors) / 4, work_precision.reference.floor
    axis.set(xscale="log", yscale="log", xlim=(min(times) / 2, max(times) * 2))
    axis.set(ylim=(bottom, max(errors) * 2))
    if floor > bottom:
        axis.axhspan(bottom, floor, color=rest(), alpha=0.45, lw=0, zorder=0)
        style: dict[str, Any] = {"ha": "left", "va": "center", "fontsize": SMALL}
        place = 0.01, (bottom * floor) ** 0.5
        axis.text(*place, "below the resolution of the reference", transform=axis.get_yaxis_transform(), **style)


def _front(axis: Axes, work_precision: WorkPrecision) -> None:
    points = [(row.seconds, work_precision.measurable_error(row)) for row in work_precision.pareto]
    look: dict[str, Any] = {"color": rest(), "lw": 8, "drawstyle": "steps-post", "gid": QUIET}
    axis.plot(*zip(*points, strict=True), zorder=1, label="Pareto front", **look)


def _family(axis: Axes, work_precision: WorkPrecision, rows: list[WorkPrecisionRow]) -> None:
    candidate = rows[0].candidate
    points = [row.seconds for row in rows], [work_precision.measurable_error(row) for row in rows]
    if candidate.modal:
        axis.plot(*points, MODAL[candidate.kind], color=ink(), ms=11, mec=paper(), label=candidate.kind, zorder=5)
        return
    marker = MARKERS_OF_FORMS["compiled" if candidate.compiled else candidate.kind]
    hue = colour(METHODS[candidate.method])
    look: dict[str, Any] = {"color": hue, "mfc": paper() if candidate.compiled else hue, "ms": 6, "lw": 1.4}
    axis.plot(*points, marker=marker, label=candidate.family.replace("taylor", "Taylor"), zorder=4, **look)


def _decorate(figure: Figure, axis: Axes, work_precision: WorkPrecision) -> None:
    horizon = work_precision.reference.horizon
    tolerances = [row.candidate.tolerance for row in work_precision.rows[1:] if not row.candidate.modal]
    axis.set(xlabel="time of a run, once prepared (s)", ylabel=f"largest error of an angle in {horizon:.4g} s (rad)")
    if tolerances:
        words = f"along each line: tolerances from {max(tolerances):g} to at most {min(tolerances):g}"
        axis.set_title(words, loc="right")
    headline(figure, title_of(work_precision.scene), "time against accuracy")
    key(figure, *axis.get_legend_handles_labels())


def frequencies_figure(result: FrequencyTradeoff) -> Figure:
    """The largest relative error of all frequencies against the time (s) of every way, on logarithmic axes.

    A way that gives up is omitted; an error below the spacing of numbers is drawn there.
    """
    rows = [row for row in result.rows if isfinite(row.error)]
    figure, (axis,) = stack(1, 2)
    spacing = float(np.finfo(np.float64).epsneg)
    for index, row in enumerate(rows):
        marker, hue = [*MARKERS_OF_FORMS.values()][index % len(MARKERS_OF_FORMS)], colour(index % HUES)
        axis.plot(row.seconds, max(row.error, spacing), marker, color=hue, ms=9, label=row.way)
    axis.set(xscale="log", yscale="log", xlabel="time of the processor (s)", ylabel="largest relative error of ω (–)")
    axis.margins(0.2)
    axis.set(xlim=decade_limits(*axis.get_xlim()), ylim=decade_limits(*axis.get_ylim()))
    headline(figure, title_of(result.scene), "time against accuracy of frequencies")
    key(figure, *axis.get_legend_handles_labels())
    return figure
