"""Pictures of the small-angle check: shifts of frequency with amplitude, and spectra of modal coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, pi
from typing import IO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from modal.errors import ComputationError
from modal.palette import COLOURS, GRID, INK, MARK, STYLES
from modal.pictures import entitle, save, sheet
from modal.rig import Floats
from modal.scene import Scene
from nonlinear.check import ONE_PERCENT, Check, ModeCheck
from nonlinear.compare import Comparison, ModeInMotion
from nonlinear.lines import ORDER

MARKERS, SIZES = ("o", "s", "D"), (9.5, 5.5)
MOST_CURVES, POINTS = len(COLOURS) * len(MARKERS), 200
BEYOND = 1.5  # how far the axes go on beside the outermost run
DEEPEST = 1e-5  # of the strongest line, the least that a spectrum shows
CLOSEST = 0.025  # share of the axis that the number of a mode needs
PADDING = 4


def draw_check(found: Check, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf."""
    save(check_figure(found), stream, form)


def check_figure(found: Check) -> Figure:
    """|ω(a)/ω − 1| against the largest angle on logarithmic axes, measured (marks) and predicted (lines: κa²).

    The level of 1 % is marked, and on it the angle that was measured; hollow marks rise with the amplitude.  Irregular
    runs are left out.  Raises ComputationError where nothing is left to draw or does not fit.
    """
    rows = [row for row in found.rows if any(not run.irregular and run.shift for run in row.measurements)]
    if not rows:
        raise ComputationError("no mode was measured: there is nothing to draw")
    if len(rows) > MOST_CURVES:
        raise ComputationError(f"{len(rows)} modes do not fit a picture: choose at most {MOST_CURVES}")
    figure = sheet(8.0, 5.4)
    axis = figure.subplots()
    angles = [degrees(run.effective) for row in rows for run in row.measurements]
    low, high = min(angles) / BEYOND, min(max(angles) * BEYOND, 180.0)
    for k, row in enumerate(rows):
        _shifts(axis, row, low, high, k)
    sizes = [abs(run.shift) for row in rows for run in row.measurements if not run.irregular]
    bottom, top = min(sizes) / BEYOND**2, min(2 * max(*sizes, 2 * ONE_PERCENT), 1.0)
    axis.axhline(ONE_PERCENT, color=MARK, lw=0.9, ls=":", zorder=0)
    axis.annotate(
        "1 %", (0.004, ONE_PERCENT), (0, 3), axis.get_yaxis_transform(), "offset points", fontsize=9, color=INK
    )
    axis.set(xscale="log", yscale="log", xlim=(low, high), ylim=(bottom, top))
    axis.set(xlabel="largest angle a (°)", ylabel="shift of frequency |ω(a)/ω − 1|")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    handles = [_handle(k) for k in range(len(rows))]
    _finish(figure, found.scene, "frequency against amplitude", handles, [_named(row) for row in rows], 2)
    return figure


def _shifts(axis: Axes, row: ModeCheck, low: float, high: float, k: int) -> None:
    """One mode: κa² as a line, runs as marks, the measured 1 % as a tick."""
    a = np.geomspace(low, high, POINTS)
    axis.plot(a, np.abs(row.mode.kappa) * np.radians(a) ** 2, color=_colour(k), ls=STYLES[k % 2], lw=1.3, zorder=2)
    steady = [run for run in row.measurements if not run.irregular]
    for falls in (True, False):
        x, y = (np.array(v) for v in ([degrees(run.effective) for run in steady], [run.shift for run in steady]))
        kept = (y < 0) == falls
        face = _colour(k) if falls else "white"
        edge = "white" if falls else _colour(k)
        axis.plot(x[kept], np.abs(y[kept]), _marker(k), ms=_size(k), mfc=face, mec=edge, mew=1.0, zorder=4)
    if np.isfinite(row.one_percent_deg):
        axis.plot(row.one_percent_deg, ONE_PERCENT, "|", ms=15, mew=1.8, color=_colour(k), zorder=3)


def draw_spectrum(found: Comparison, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf."""
    save(spectrum_figure(found), stream, form)


def spectrum_figure(found: Comparison) -> Figure:
    """Amplitude spectra of the modal coordinates that move, the strongest of a mode's copies, on a logarithmic scale.

    Dotted lines with numbers mark the table's frequencies.  Raises ComputationError where nothing swings.
    """
    rows = _strongest(found)
    figure = sheet(8.0, 5.4)
    axis = figure.subplots()
    omega, sizes = _spectra(found, rows)
    top = float(sizes.max())
    for k, size in enumerate(sizes):
        axis.plot(omega, size, color=_colour(k), ls=STYLES[k // len(COLOURS)], lw=1.3, zorder=3)
    low, high = found.swinging.min() / 2, min(float(omega[-1]), 1.6 * float(found.swinging.max()))
    axis.set(xlim=(low, high), yscale="log", ylim=(top * DEEPEST, top * 3))
    axis.set(xlabel="angular frequency (rad/s)", ylabel="amplitude of the modal coordinate (°)")
    _mark(axis, found, low, high)
    handles = [Line2D([], [], color=_colour(k), ls=STYLES[k // len(COLOURS)]) for k in range(len(rows))]
    names = [f"mode {row.mode.number}: {row.mode.omega:.5g} rad/s" for row in rows]
    _finish(figure, found.modes.scene, "spectra of the modal coordinates", handles, names, 4 if len(names) <= 4 else 3)
    return figure


def _strongest(found: Comparison) -> list[ModeInMotion]:
    """Of every mode that swings the copy that swings most, of these the largest."""
    best: dict[int, ModeInMotion] = {}
    for row in found.rows:
        if row.mode.oscillates and row.largest > best.get(row.mode.number, row).largest * (row.mode.number in best):
            best[row.mode.number] = row
    kept = sorted(best.values(), key=lambda row: -row.largest)[: len(COLOURS)]
    if not kept:
        raise ComputationError("no mode swings: there is no spectrum to draw")
    return sorted(kept, key=lambda row: row.mode.number)


def _spectra(found: Comparison, rows: Sequence[ModeInMotion]) -> tuple[Floats, Floats]:
    """ω (W,) and amplitudes (rows, W) in degrees, in the window of `nonlinear.lines`."""
    count = len(found.times)
    places = list(zip(found.motion.number.tolist(), found.motion.copy.tolist(), strict=True))
    chosen = found.motion.coordinate[:, [places.index((row.mode.number - 1, row.copy)) for row in rows]]
    window = (1 + np.cos(pi * np.linspace(-1, 1, count))) ** ORDER
    sizes = np.abs(np.fft.rfft((window / window.sum())[:, None] * chosen, PADDING * count, axis=0)).T
    omega = 2 * pi * np.fft.rfftfreq(PADDING * count, float(found.times[1] - found.times[0]))
    return np.asarray(omega, dtype=np.float64), np.degrees(2 * sizes)


def _mark(axis: Axes, found: Comparison, low: float, high: float) -> None:
    """The table's frequencies; the numbers of neighbours too close to print apart are joined."""
    omega = np.abs(found.modes.eigenvalue.imag)
    groups: list[list[int]] = []
    for number in np.flatnonzero((omega > low) & (omega < high)).tolist():
        axis.axvline(omega[number], color=MARK, ls=":", lw=0.9, zorder=0)
        near = groups and omega[number] - omega[groups[-1][-1]] < CLOSEST * (high - low)
        groups = [*groups[:-1], [*groups[-1], number]] if near else [*groups, [number]]
    for group in groups:
        words = f"{group[0] + 1}" if len(group) == 1 else f"{group[0] + 1}–{group[-1] + 1}"
        place = (float(omega[group].mean()), 1.0)
        style = {"ha": "center", "fontsize": 8, "color": INK}
        axis.annotate(words, place, (0, 3), axis.get_xaxis_transform(), "offset points", **style)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------- dress


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def _marker(k: int) -> str:
    return MARKERS[k // len(COLOURS)]


def _handle(k: int) -> Line2D:
    return Line2D([], [], color=_colour(k), ls=STYLES[k % 2], marker=_marker(k), ms=_size(k), lw=1.6, mec="white")


def _size(k: int) -> float:
    """Neighbours in turn large and small: the small ones stay visible on top."""
    return SIZES[k % 2]


def _named(row: ModeCheck) -> str:
    return f"mode {row.mode.number}: {row.mode.omega:.5g} rad/s, κ = {row.mode.kappa:.4g}"


def _finish(
    figure: Figure, scene: Scene, title: str, handles: Sequence[Line2D], names: Sequence[str], columns: int
) -> None:
    for axis in figure.axes:
        axis.grid(color=GRID, lw=0.6)
        axis.set_axisbelow(True)
        axis.tick_params(which="both", labelsize=9, colors=INK)
        axis.spines[["top", "right"]].set_visible(False)
    whole = f"{scene.title}: {title}" if scene.title else title.capitalize()
    entitle(figure, whole)
    figure.legend(handles, names, loc="outside lower center", ncols=columns, fontsize=9, frameon=False)
