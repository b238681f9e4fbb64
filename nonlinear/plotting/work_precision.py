"""Time against accuracy in one picture."""

from __future__ import annotations

from itertools import groupby
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.errors import ComputationError
from modal.plotting.layout import SMALL, decade_limits, headline, key
from modal.plotting.style import HUES, QUIET, colour, ink, paper, rest, stack
from modal.scene import title_of
from nonlinear.reduction import CORRECTED, LINEAR

if TYPE_CHECKING:
    from nonlinear.accuracy import Candidate, FrequencyTradeoff, WorkPrecision, WorkPrecisionRow

METHODS = dict(zip(("RK45", "taylor", "LSODA", "Radau", "DOP853", "RK23"), range(HUES), strict=True))
MARKERS = {"minimal": "o", "spatial": "o", "compiled": "D", "maximal": "s"}
MODAL = {LINEAR: "P", CORRECTED: "*"}


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
    marker = MARKERS["compiled" if candidate.compiled else candidate.kind]
    hue = colour(METHODS[candidate.method])
    look: dict[str, Any] = {"color": hue, "mfc": paper() if candidate.compiled else hue, "ms": 6, "lw": 1.4}
    axis.plot(*points, marker=marker, label=_label(candidate), zorder=4, **look)


def _label(candidate: Candidate) -> str:
    return candidate.family.replace("taylor", "Taylor")


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
        marker, hue = [*MARKERS.values()][index % len(MARKERS)], colour(index % HUES)
        axis.plot(row.seconds, max(row.error, spacing), marker, color=hue, ms=9, label=row.way)
    axis.set(xscale="log", yscale="log", xlabel="time of the processor (s)", ylabel="largest relative error of ω (–)")
    axis.margins(0.2)
    axis.set(xlim=decade_limits(*axis.get_xlim()), ylim=decade_limits(*axis.get_ylim()))
    headline(figure, title_of(result.scene), "time against accuracy of frequencies")
    key(figure, *axis.get_legend_handles_labels())
    return figure
