"""Time against error of every route, one panel per problem."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from routes import ROUTES

from modal.plotting import in_both_themes, sheet
from modal.plotting.style import paper, rest

if TYPE_CHECKING:
    from simulation import Panel


def figure(panels: Sequence[Panel], path: Path) -> None:
    in_both_themes(lambda: _figure(panels), path)


def _figure(panels: Sequence[Panel]) -> Figure:
    made = sheet(12, 7.4)
    axes = made.subplots(2, 3)
    for axis, panel in zip(axes.flat, panels, strict=False):
        _curves(axis, panel)
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    handles = {line.get_label(): line for axis in axes.flat for line in axis.get_lines()}
    ordered = [handles[name] for name in ROUTES if name in handles]
    axes.flat[-1].legend(handles=ordered, loc="center")
    made.suptitle("Ten seconds at large angles: time against error")
    return made


def _curves(axis: Axes, panel: Panel) -> None:
    for name, rows in panel.routes.items():
        route = ROUTES[name]
        points = [(max(row.error, panel.floor), row.seconds) for row in rows]
        face, style = (route.hue(), "-") if route.ours else (paper(), "--")
        axis.loglog(*zip(*points, strict=True), style, marker=route.mark, color=route.hue(), mfc=face, label=name)
    low, high = axis.get_xlim()
    axis.axvspan(low / 10, panel.floor, color=rest(), alpha=0.4, lw=0)
    axis.set_xlim(min(low, panel.floor / 3), min(high, 10))
    axis.set(xlabel="largest error of an angle at the end (rad)", ylabel="time (s)", title=panel.problem.name)
