"""A picture of branches of configurations: their amplitudes and frequencies, and where each is stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key
from modal.plotting.style import HUES, ink
from modal.scene import title_of
from nonlinear.plotting.stability import LABELS, DrawnBranch, branch_keys, figure_along, mark, stability_keys

if TYPE_CHECKING:
    from nonlinear.synchronization import Branches, EquilibriumBranch


def branches_figure(branches: Branches) -> Figure:
    """Solid lines where a branch is stable, dash-dotted ones where it is not; dots are computed, circles critical.

    Raise ComputationError for no branch and for more than HUES.
    """
    if not 1 <= len(branches.branches) <= HUES:
        raise ComputationError(f"{len(branches.branches)} configurations do not fit in a figure: from 1 to {HUES}")
    lines = [_drawn(branch) for branch in branches.branches]
    figure = figure_along(branches.scene, branches.variation, LABELS, lines)
    for line in lines:
        for axis, curve in zip(figure.axes, line.curves, strict=True):
            axis.plot(line.values, curve, ".", color=ink(), ms=5, zorder=4, label="_computed")
    headline(figure, title_of(branches.scene), "steady oscillations by averaged equations")
    key(figure, _handles(branches), columns=2)
    return figure


def _drawn(branch: EquilibriumBranch) -> DrawnBranch:
    growth = np.array([state.growth for state in branch.states])
    curves = [np.rad2deg(branch.angle), branch.omega, growth]
    critical = [change.value for change in branch.changes]
    points = [("o", value, [float(np.interp(value, branch.values, curve)) for curve in curves]) for value in critical]
    return DrawnBranch(branch.values, branch.is_stable, curves, points)


def _handles(branches: Branches) -> list[Line2D]:
    lines = branch_keys([branch.words for branch in branches.branches])
    computed = Line2D([], [], ls="", marker=".", ms=5, color=ink(), label="computed value")
    return [*lines, *stability_keys(), computed, Line2D([], [], label="critical value", **mark())]
