"""Time against error of every route, one panel a problem."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from routes import ROUTES

from modal.palette import GRID, REST

if TYPE_CHECKING:
    from simulation import Panel


def figure(panels: Sequence[Panel], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    made, axes = plt.subplots(2, 3, figsize=(12, 7.4), dpi=120, layout="constrained")
    for axis, one in zip(axes.flat, panels, strict=False):
        _curves(axis, one)
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    handles = {line.get_label(): line for axis in axes.flat for line in axis.get_lines()}
    ordered = [handles[name] for name in ROUTES if name in handles]
    axes.flat[-1].legend(handles=ordered, loc="center", frameon=False, fontsize=11)
    made.suptitle("Ten seconds at large angles: time against error", fontweight="bold")
    made.savefig(path)


def _curves(axis: object, one: Panel) -> None:
    for name, rows in one.routes.items():
        route = ROUTES[name]
        points = [(max(row.error, one.floor), row.seconds) for row in rows]
        face, style = (route.colour, "-") if route.ours else ("white", "--")
        axis.loglog(*zip(*points, strict=True), style, marker=route.mark, color=route.colour, mfc=face, label=name)
    low, high = axis.get_xlim()
    axis.axvspan(low / 10, one.floor, color=REST, alpha=0.4, lw=0)
    axis.set_xlim(min(low, one.floor / 3), min(high, 10))
    axis.set(xlabel="largest error of an angle at the end (rad)", ylabel="time (s)", title=one.problem.name)
    axis.grid(color=GRID)
    axis.spines[["top", "right"]].set_visible(False)
