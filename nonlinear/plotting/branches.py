"""A picture of branches of configurations: their amplitudes and frequencies, and where each is stable."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting import HUES, WIDTH, axis_words, headline, key, save, scale, sheet
from modal.scene import title_of
from modal.types import Floats
from nonlinear.plotting.stability import branch_keys, draw_branch, mark, stability_keys

if TYPE_CHECKING:
    from nonlinear.synchronization import Branches, EquilibriumBranch

MOST_CURVES = HUES


def draw_branches(found: Branches, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf: solid lines where a branch is stable, broken ones where it is not.

    Circles are critical values.  Raises ComputationError for no branch and for more than MOST_CURVES.
    """
    save(branches_figure(found), stream, form)


def branches_figure(found: Branches) -> Figure:
    """The same as a figure."""
    if not 1 <= len(found.branches) <= MOST_CURVES:
        raise ComputationError(f"{len(found.branches)} configurations do not fit in a figure: from 1 to {MOST_CURVES}")
    figure = sheet(WIDTH, 7.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    values = found.variation.values
    for number, one in enumerate(found.branches):
        _curve(upper, one, np.rad2deg(one.angle), number)
        _curve(lower, one, one.omega, number)
    upper.set(ylabel="largest angle (°)", xlim=(values[0], values[-1]))
    upper.set_ylim(0, 1.05 * upper.get_ylim()[1])
    lower.set(xlabel=axis_words(found.variation), ylabel="angular frequency ω (rad/s)")
    scale(lower, "x", found.variation)
    headline(figure, title_of(found.scene), "steady oscillations")
    key(figure, _handles(found), columns=2)
    return figure


def _curve(axis: Axes, one: EquilibriumBranch, y: Floats, number: int) -> None:
    draw_branch(axis, one.values, y, one.is_stable, number)
    critical = [change.value for change in one.changes]
    axis.plot(critical, np.interp(critical, one.values, y), **mark())


def _handles(found: Branches) -> list[Line2D]:
    lines = branch_keys([one.words for one in found.branches])
    return [*lines, *stability_keys(), Line2D([], [], label="critical value", **mark())]
