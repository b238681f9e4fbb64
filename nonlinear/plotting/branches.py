"""A picture of branches of configurations: their amplitudes and frequencies, and where each is stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key
from modal.plotting.style import HUES
from modal.scene import title_of
from nonlinear.plotting.stability import LABELS, DrawnBranch, branch_keys, figure_along, mark, stability_keys

if TYPE_CHECKING:
    from nonlinear.synchronization import Branches, EquilibriumBranch


def branches_figure(branches: Branches) -> Figure:
    """Solid lines where a branch is stable, dash-dotted ones where it is not; circles are critical values.

    Raise ComputationError for no branch and for more than HUES.
    """
    if not 1 <= len(branches.branches) <= HUES:
        raise ComputationError(f"{len(branches.branches)} configurations do not fit in a figure: from 1 to {HUES}")
    figure = figure_along(branches.scene, branches.variation, LABELS, [_drawn(branch) for branch in branches.branches])
    headline(figure, title_of(branches.scene), "steady oscillations")
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
    return [*lines, *stability_keys(), Line2D([], [], label="critical value", **mark())]
