"""The figure of the extremes: one panel per family, error against parameter, cut off at HIGHEST."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.plotting import in_both_themes, sheet
from modal.plotting.style import colour, paper, secondary_colour

PANELS = {
    "links of a chain": "links of a chain",
    "mass ratio": "lower over upper mass",
    "length ratio": "lower over upper length",
    "cart mass": "mass of the cart over that of its bob",
    "gravity": "gravity (m/s²)",
    "amplitude": "amplitude (°)",
    "below the top": "released so far below the top (°)",
    "detuning": "difference of two pendula's lengths",
    "damper": "damper (N m s/rad) of 1 kg at 1 m",
}
LOWEST, HIGHEST = 1e-13, 1e3
NO_ANSWER = 3e1  # height of its first cross
CURVES = (
    ("default_error", "textbook, SciPy's defaults", 4, "s", "--"),
    ("fine_error", "textbook, SciPy at 1e-9", 1, "^", "--"),
    ("error", "multipendula", 0, "o", "-"),
)


def figure(lines: Sequence[Any], path: Path) -> None:
    in_both_themes(lambda: _figure(lines), path)


def _figure(lines: Sequence[Any]) -> Figure:
    made = sheet(12, 10)
    axes = made.subplots(3, 3, sharey=True)
    for axis, (family, label) in zip(axes.flat, PANELS.items(), strict=True):
        _panel(axis, [line for line in lines if line.family == family], label)
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error of the angles (–)")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    cross = Line2D([], [], color=secondary_colour(), marker="x", ls="", ms=7)
    handles, labels = [*handles[::-1], cross], [*labels[::-1], "no answer"]
    made.legend(handles, labels, loc="outside lower center", ncols=4)
    made.suptitle("Large motion with every parameter taken to its ends")
    return made


def _panel(axis: Any, lines: Sequence[Any], label: str) -> None:
    axis.axhline(1.0, color=secondary_colour(), lw=1, ls=":")
    for at, (field, name, k, mark, style) in enumerate(CURVES):
        points = [(line.parameter, min(max(getattr(line, field), LOWEST), HIGHEST)) for line in lines]
        ours = field == "error"
        axis.loglog(
            *zip(*points, strict=True), style, color=colour(k), marker=mark, ms=5, mfc=colour(k) if ours else paper(),
            lw=2 if ours else 1.2, label=name,
        )  # fmt: skip
        failed = [line.parameter for line in lines if isnan(getattr(line, field))]
        axis.plot(failed, [NO_ANSWER / 10**at] * len(failed), "x", color=colour(k), ms=7)
    axis.set(xlabel=label, ylim=(LOWEST, 2 * HIGHEST))
