"""A picture of the symmetric motions of populations along a number: growth rates by sectors, and thresholds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key, set_frame, set_values
from modal.plotting.style import PREDICTED, colour, ink, narrowing, secondary_colour, stack
from modal.scene import title_of
from nonlinear.plotting.stability import mark

if TYPE_CHECKING:
    from nonlinear.synchronization import MotionBranch, PopulationDiagram

SECTORS = {"own": "within its symmetry", "other": "towards the other motion"}
"""The names of perturbations by which a motion loses stability."""


def populations_figure(diagram: PopulationDiagram) -> Figure:
    """Growth rates of every motion: solid by Floquet multipliers, dashed by the averaged equations.

    A thick line along 0 shows where the motion is stable; circles are thresholds, squares where it begins or ends.
    """
    branches = [branch for branch in diagram.branches if len(branch.values)]
    if not branches:
        raise ComputationError("no symmetric motion of the populations exists in this range")
    figure, axes = stack(len(branches), sharex=True)
    names = list(dict.fromkeys(name for branch in branches for name in branch.sectors))
    for axis, branch in zip(axes, branches, strict=True):
        _panel(axis, diagram, branch, names)
    set_values(axes[-1], diagram.scene, diagram.variation)
    headline(figure, title_of(diagram.scene), "motions of populations")
    key(figure, _handles(names, any(not threshold.sector for threshold in diagram.thresholds)), columns=3)
    return figure


def _panel(axis: Axes, diagram: PopulationDiagram, branch: MotionBranch, names: list[str]) -> None:
    axis.axhline(0.0, color=secondary_colour(), lw=0.8, zorder=1)
    for low, high in diagram.intervals(branch):
        axis.plot([low, high], [0.0, 0.0], color=secondary_colour(), lw=narrowing(0), solid_capstyle="butt", zorder=2)
    windows = [(branch.values >= low) & (branch.values <= high) for low, high in diagram.windows(branch)]
    for number, name in enumerate(names):
        look: dict[str, Any] = {"color": colour(number), "zorder": 4}
        exact, averaged_rates = branch.growth(name), branch.averaged_growth(name)
        for window in windows if name in branch.sectors else ():
            x = branch.values[window]
            axis.plot(x, exact[window], lw=narrowing(number), label=f"_{name}", **look)
            axis.plot(x, averaged_rates[window], ls=PREDICTED, lw=1.0, label=f"_{name} averaged", color=ink(), zorder=5)
    for begins, shape in ((False, "o"), (True, "s")):
        at = [
            threshold.value
            for threshold in diagram.thresholds
            if threshold.pattern == branch.name and begins == (not threshold.sector)
        ]
        axis.plot(at, np.zeros(len(at)), **mark(shape))
    set_frame(axis, "", "growth rate (1/s)", branch.name.capitalize())


def _handles(names: list[str], ends: bool) -> list[Line2D]:
    words = [SECTORS.get(name, name) for name in names]
    lines = [Line2D([], [], color=colour(k), lw=narrowing(k), label=word) for k, word in enumerate(words)]
    return [
        *lines,
        Line2D([], [], color=ink(), lw=1.0, ls=PREDICTED, label="averaged equations"),
        Line2D([], [], color=secondary_colour(), lw=narrowing(0), label="stable"),
        Line2D([], [], label="threshold", **mark()),
        *[Line2D([], [], label="the motion itself begins or ends", **mark("s"))] * ends,
    ]
