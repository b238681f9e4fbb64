"""A picture of branches of configurations by averaged equations, and of the periodic orbits next to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key
from modal.plotting.style import HUES, PREDICTED, colour, ink, secondary_colour
from modal.scene import title_of
from nonlinear.plotting.stability import (
    LABELS,
    DrawnBranch,
    SpecialMark,
    branch_keys,
    figure_along,
    heights_of,
    mark,
    smooth_curve,
    stability_keys,
)
from nonlinear.synchronization.continuation import value_of

if TYPE_CHECKING:
    from nonlinear.synchronization import Branches


def branches_figure(branches: Branches) -> Figure:
    """Orbits solid where stable, else dash-dotted, with their special points; averaged motions dashed, with crosses.

    Raise ComputationError for no branch and for more than HUES.
    """
    if not 1 <= len(branches.branches) <= HUES:
        raise ComputationError(f"{len(branches.branches)} configurations do not fit in a figure: from 1 to {HUES}")
    lines = [_exact(branches, number) for number in range(len(branches.branches))]
    figure = figure_along(branches.scene, branches.variation, LABELS, lines)
    highest = max(float(np.rad2deg(branch.angle.max())) for branch in branches.branches)
    figure.axes[0].set_ylim(top=max(figure.axes[0].get_ylim()[1], 1.05 * highest))
    for number, (branch, line) in enumerate(zip(branches.branches, lines, strict=True)):
        hue = secondary_colour() if any(branch.orbits) else colour(number)
        averaged = [np.rad2deg(branch.angle), branch.omega, np.array([state.growth for state in branch.states])]
        critical = [change.value for change in branch.changes]
        for axis, exact, curve in zip(figure.axes, line.curves, averaged, strict=True):
            axis.plot(line.values, exact, ".", color=ink(), ms=5, zorder=4, label="_computed")
            axis.plot(*smooth_curve(branch.values, curve), color=hue, ls=PREDICTED, lw=1.3, zorder=2)
            axis.plot(critical, np.interp(critical, branch.values, curve), **mark("x"))
    headline(figure, title_of(branches.scene), "steady oscillations by full and by averaged equations")
    key(figure, _handles(branches), columns=2)
    return figure


def _exact(branches: Branches, number: int) -> DrawnBranch:
    """The orbits next to a branch, from the first to the last; NaN where there is none."""
    branch, points = branches.branches[number], branches.exact[number].points
    places = np.flatnonzero([orbit is not None for orbit in branch.orbits])
    part = slice(places[0], places[-1] + 1) if len(places) else slice(None)
    values, orbits = branch.values[part], branch.orbits[part]
    after = np.searchsorted(values, [value_of(point) for point in points]) - 1
    marks = [
        SpecialMark("o", point.orbit, value_of(point), heights_of(point.orbit), int(at))
        for point, at in zip(points, after, strict=True)
    ]
    is_stable = [bool(orbit and orbit.is_stable) for orbit in orbits]
    return DrawnBranch(values, is_stable, list(np.array([heights_of(orbit) for orbit in orbits]).T), marks)


def _handles(branches: Branches) -> list[Line2D]:
    lines = branch_keys([branch.words for branch in branches.branches])
    computed = Line2D([], [], ls="", marker=".", ms=5, color=ink(), label="computed value")
    averaged = Line2D([], [], ls=PREDICTED, lw=1.3, color=secondary_colour(), label="averaged equations")
    handles = [*lines, *stability_keys(), computed, averaged]
    if any(branch.points for branch in branches.exact):
        handles.append(Line2D([], [], label="critical value", **mark()))
    if branches.changes:
        handles.append(Line2D([], [], label="averaged critical value", **mark("x")))
    return handles
