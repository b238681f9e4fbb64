"""A picture of branches of configurations: their amplitudes and frequencies, and where each is stable."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting import HUES, headline, key, save, scale
from modal.plotting.style import sheet_of_rows
from modal.scene import number_label, title_of
from modal.types import Floats
from nonlinear.plotting.stability import branch_keys, draw_branch, mark, stability_keys

if TYPE_CHECKING:
    from nonlinear.synchronization import Branches, EquilibriumBranch


def draw_branches(branches: Branches, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf: solid lines where a branch is stable, dash-dotted ones where it is not.

    Circles are critical values.  Raises ComputationError for no branch and for more than HUES.
    """
    save(branches_figure(branches), stream, form)


def branches_figure(branches: Branches) -> Figure:
    """The same as a figure."""
    if not 1 <= len(branches.branches) <= HUES:
        raise ComputationError(f"{len(branches.branches)} configurations do not fit in a figure: from 1 to {HUES}")
    figure = sheet_of_rows(2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    values = branches.variation.values
    for number, branch in enumerate(branches.branches):
        _curve(upper, branch, np.rad2deg(branch.angle), number)
        _curve(lower, branch, branch.omega, number)
    upper.set(ylabel="largest angle (°)", xlim=(values[0], values[-1]))
    upper.set_ylim(0, 1.05 * upper.get_ylim()[1])
    lower.set(xlabel=number_label(branches.scene, branches.variation.path), ylabel="angular frequency ω (rad/s)")
    scale(lower, "x", branches.variation)
    headline(figure, title_of(branches.scene), "steady oscillations")
    key(figure, _handles(branches), columns=2)
    return figure


def _curve(axis: Axes, branch: EquilibriumBranch, y: Floats, number: int) -> None:
    draw_branch(axis, branch.values, y, branch.is_stable, number)
    critical = [change.value for change in branch.changes]
    axis.plot(critical, np.interp(critical, branch.values, y), **mark())


def _handles(branches: Branches) -> list[Line2D]:
    lines = branch_keys([branch.words for branch in branches.branches])
    return [*lines, *stability_keys(), Line2D([], [], label="critical value", **mark())]
