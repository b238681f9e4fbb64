"""A picture of synchronization: oscillations, order, modes, energies and phases."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from modal.errors import ComputationError
from modal.modes import Mode, table_numbers
from modal.plotting.curves import CURVE_GAP_MAX, draw_curves
from modal.plotting.layout import SMALL, headline, key, legend, set_frame
from modal.plotting.style import (
    CURVE_POINTS,
    HUES,
    QUIET,
    WIDE,
    colour,
    ink,
    narrowing,
    paper,
    rest,
    secondary_colour,
    sheet_of_rows,
    thickness,
)
from modal.report import counted
from modal.scene import title_of
from modal.scene.doors import require_type
from modal.types import EPS, Floats, Ints
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import pick_links, resample, smooth
from nonlinear.synchronization import Phases, Survival, find_survival, population_phases


def sync_figure(trajectory: Trajectory, phases: Phases) -> Figure:
    """Draw how pendula synchronize; raise ComputationError for a run of a single instant.

    Of many pendula only some are drawn, and their energies as a band; where the energy cannot be divided among modes
    the picture gives the reason.
    """
    require_type("trajectory", trajectory, "Trajectory")
    if len(trajectory.times) < 2:
        raise ComputationError("a run with a single sample cannot be drawn")
    figure = sheet_of_rows(3.5, WIDE)
    grid = figure.add_gridspec(3, 2)
    total = trajectory.system.n_pendula
    pendula = np.unique(np.linspace(0, total - 1, min(total, HUES)).round().astype(np.int64))
    begin = figure.add_subplot(grid[0, 0])
    _swings(begin, figure.add_subplot(grid[0, 1], sharey=begin), trajectory, _period(phases), pendula)
    order = figure.add_subplot(grid[1, 0])
    _order(order, phases)
    _shares(figure.add_subplot(grid[1, 1]), trajectory)
    _energies(figure.add_subplot(grid[2, 0], sharex=order), phases, pendula)
    _circle(figure.add_subplot(grid[2, 1], projection="polar"), phases, pendula)
    _finish(figure, trajectory, pendula)
    return figure


def _period(phases: Phases) -> float:
    """A typical period of the pendula in the leading fixed-base mode (s)."""
    return float(2 * pi / np.median(phases.omega[:, phases.leading]))


# -------------------------------------------------------------------------------------------------- oscillations


def _swings(begin: Axes, end: Axes, trajectory: Trajectory, period: float, pendula: Ints) -> None:
    """Angles of top links in the first and the last four periods, at most half of the run each."""
    times = trajectory.times
    width = min(4 * period, float(times[-1] - times[0]) / 2)
    tops = np.searchsorted(trajectory.system.pendulum, pendula)
    for axis, start, words in ((begin, times[0], "at first"), (end, times[-1] - width, "at the end")):
        x, angles = _window(trajectory, tops, float(start), width)
        draw_curves(axis, [(x, np.rad2deg(angle)) for angle in angles.T])
        axis.set_xlim(x[0], x[-1])
        set_frame(axis, "time (s)", "angle (°)", f"Top links {words}")
    end.set_ylabel("")
    end.tick_params(labelleft=False)


def _window(trajectory: Trajectory, links: Ints, start: float, width: float) -> tuple[Floats, Floats]:
    """Times and angles (rad) of these links over a window, interpolated between the samples where possible."""
    motion, fine = pick_links(trajectory.motion, links), np.linspace(start, start + width, CURVE_POINTS)
    try:
        return fine, resample(trajectory.times, motion, fine).links
    except ComputationError:
        within = (trajectory.times >= start) & (trajectory.times <= start + width)
        return trajectory.times[within], motion.links[within]


# --------------------------------------------------------------------------------------------- order and modes


def _order(axis: Axes, phases: Phases) -> None:
    """The order parameter of all pendula, and on a structure that of every population."""
    axis.plot(phases.times, phases.order[:, phases.leading], color=ink(), lw=1.4, label="all")
    populations = population_phases(phases)
    if populations is not None and 1 < len(populations.populations) < HUES:
        names = [f"population {k + 1}, {population.name}" for k, population in enumerate(populations.populations)]
        draw_curves(axis, [(phases.times, order) for order in populations.order.T], names=names)
        legend(axis, 3)
    axis.set(xlim=(phases.times[0], phases.times[-1]), ylim=(-0.03, 1.03))
    which = f" (fixed-base mode {phases.leading + 1})" if phases.omega.shape[1] > 1 else ""
    set_frame(axis, "time (s)", "order parameter R (–)", f"Agreement of phases{which}: 1 in phase, 0 balanced")


def _shares(axis: Axes, trajectory: Trajectory) -> None:
    set_frame(axis, "time (s)", "share of the energy (–)", "Modes that hold the energy")
    axis.set(xlim=(trajectory.times[0], trajectory.times[-1]), ylim=(-0.03, 1.03))
    try:
        survival = find_survival(trajectory)
    except ComputationError as error:
        style: dict[str, Any] = {"ha": "center", "fontsize": SMALL, "color": secondary_colour(), "wrap": True}
        axis.text(0.5, 0.5, str(error), transform=axis.transAxes, **style)
        return
    rows, rest = _largest(survival)
    curves = [(survival.times, survival.share[:, row]) for row in rows]
    draw_curves(axis, curves, names=_names(survival, rows))
    if rest.size:
        others = int(survival.modes.multiplicity[survival.row[rest] - 1].sum())
        words = counted(others, "other mode", "other modes")
        axis.plot(survival.times, survival.share[:, rest].sum(1), color=secondary_colour(), lw=1.2, label=words)
    axis.set_yticks(np.linspace(0, 1, 6))
    legend(axis, 2)


def _largest(survival: Survival) -> tuple[list[int], Ints]:
    """The rows drawn separately, in the table's order, and the others."""
    peaks = np.nan_to_num(survival.share).max(axis=0)
    strongest = np.argsort(-peaks, kind="stable")[: HUES - 1]
    rows = sorted(int(row) for row in strongest if peaks[row] >= CURVE_GAP_MAX)
    return rows, np.setdiff1d(np.arange(peaks.size), rows)


def _names(survival: Survival, rows: Sequence[int]) -> list[str]:
    """Each row in words, or by its number in the table where the words are the same for two."""
    at = [int(survival.row[row]) - 1 for row in rows]
    modes = list(survival.modes.rows(at))
    names = [mode_words(mode) for mode in modes]
    if len(set(names)) == len(names):
        return names
    numbers = table_numbers(survival.scene, survival.modes)[at]
    return [f"mode {number}, {_frequency(mode)}" for number, mode in zip(numbers, modes, strict=True)]


def mode_words(mode: Mode) -> str:
    """A short description of a row: cart still 2.680 rad/s."""
    support = mode.family.partition(":")[0].partition(",")[0]
    return f"{support} {_frequency(mode)}"


def _frequency(mode: Mode) -> str:
    return f"{mode.omega:#.4g}".rstrip(".") + " rad/s"


# -------------------------------------------------------------------------------------------- energies, phases


def _energies(axis: Axes, phases: Phases, pendula: Ints) -> None:
    """Means over a period: of each pendulum, or the range with the median."""
    times, energy = phases.times, smooth(phases.times, phases.energy, _period(phases))
    if len(pendula) == energy.shape[1]:
        draw_curves(axis, [(times, mean) for mean in energy.T])
    else:
        axis.fill_between(times, energy.min(1), energy.max(1), color=rest(), lw=0, label="least to most")
        axis.plot(times, np.median(energy, axis=1), color=ink(), lw=1.4, label="median")
        legend(axis, 2)
    axis.set_ylim(min(0.0, axis.get_ylim()[0]), None)
    power = int(np.clip(np.floor(np.log10(max(float(energy.max()), EPS)) / 3), -3, 0))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 1000.0**power:g}"))
    unit = ("J", "mJ", "µJ", "nJ")[-power]
    set_frame(axis, "time (s)", f"energy ({unit})", "Energy of each pendulum, mean over a period")


def _circle(axis: Axes, phases: Phases, pendula: Ints) -> None:
    """Every pendulum at the end, with its phase relative to that of the first and its amplitude as the radius.

    Marks become smaller from pendulum to pendulum, so that those of one phase and amplitude are rings in each other.
    """
    z = phases.z[-1, :, phases.leading]
    angle, size = np.angle(z) - np.angle(z[0]), np.rad2deg(np.abs(z))
    axis.scatter(angle, size, s=14, color=secondary_colour(), alpha=0.5, lw=0, gid=QUIET)
    for k, pendulum in enumerate(pendula):
        look: dict[str, Any] = {"color": colour(k), "label": f"_pendulum {pendulum + 1}"}
        axis.plot([0, angle[pendulum]], [0, size[pendulum]], **look, lw=narrowing(k), zorder=2 + k / HUES)
        diameter = min(5.0, 18.0 / len(pendula)) * (len(pendula) - k)
        axis.plot(angle[pendulum], size[pendulum], "o", **look, ms=diameter, mec=paper(), mew=0.6, zorder=4 + k)
    axis.set_ylim(0, 1.15 * float(size.max()) or 1.0)
    axis.yaxis.set_major_locator(MaxNLocator(4))
    axis.set_title("Phases at the end, from pendulum 1's;\nradius: amplitude (°)")


def _finish(figure: Figure, trajectory: Trajectory, pendula: Ints) -> None:
    headline(figure, title_of(trajectory.scene), "synchronization")
    lines = [Line2D([], [], color=colour(k), lw=thickness(k)) for k in range(len(pendula))]
    names = [f"pendulum {number + 1}" for number in pendula]
    count, notes = trajectory.system.n_pendula, ""
    if len(pendula) < count:
        notes = f"{len(pendula)} of {count} pendula drawn; grey dots: the phases of all"
    key(figure, lines, names, columns=HUES, notes=notes)
