"""Pictures of branches along a number: of configurations, and of the symmetric motions of populations.

Branches are solid where they are stable, else dash-dotted, with special points marked; those of populations show the
growth rates by sectors.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key, set_frame, set_values
from modal.plotting.style import (
    COMPUTED,
    HUES,
    PREDICTED,
    UNSTABLE,
    colour,
    ink,
    narrowing,
    paper,
    secondary_colour,
    stack,
)
from modal.scene import Scene, title_of
from modal.scene.parameters import Variation
from modal.types import EPS, Floats
from nonlinear.synchronization.continuation import value_of

if TYPE_CHECKING:
    from nonlinear.orbits import Orbit
    from nonlinear.synchronization import Branches, MotionBranch, PopulationDiagram

LABELS = ("largest angle (°)", "angular frequency ω (rad/s)", "growth rate (1/s)")
"""Of the panels of branches along a number."""
SECTORS = {"own": "within its symmetry", "other": "towards the other motion"}
"""The names of perturbations by which a motion loses stability."""
LINES: dict[bool, Any] = {True: COMPUTED, False: UNSTABLE}
"""Of stable and of unstable parts."""


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
    key(figure, _branch_handles(branches), columns=2)
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


def _branch_handles(branches: Branches) -> list[Line2D]:
    lines = branch_keys([branch.words for branch in branches.branches])
    computed = Line2D([], [], ls="", marker=".", ms=5, color=ink(), label="computed value")
    averaged = Line2D([], [], ls=PREDICTED, lw=1.3, color=secondary_colour(), label="averaged equations")
    handles = [*lines, *stability_keys(), computed, averaged]
    if any(branch.points for branch in branches.exact):
        handles.append(Line2D([], [], label="critical value", **mark()))
    if branches.changes:
        handles.append(Line2D([], [], label="averaged critical value", **mark("x")))
    return handles


class SpecialMark(NamedTuple):
    """A special point next after the orbit of a number: the shape of its mark, its value, its place in every panel."""

    shape: str
    orbit: Orbit
    value: float
    places: Sequence[float]
    after: int


class DrawnBranch(NamedTuple):
    """A branch at K values of a number: where it is stable, a curve (K,) for each panel, and its special points."""

    values: Floats
    is_stable: Sequence[bool]
    curves: Sequence[Floats]
    points: Sequence[SpecialMark]

    def draw(self, axes: Sequence[Axes], number: int) -> None:
        """Draw the branch by its number, through its special points, where its style changes."""
        places = [point.after + 1 for point in self.points]
        values = np.insert(self.values, places, [point.value for point in self.points])
        is_stable = np.insert(self.is_stable, places, [self._is_stable_before(k) for k in range(len(places))])
        for k, (axis, curve) in enumerate(zip(axes, self.curves, strict=True)):
            heights = np.insert(curve, places, [point.places[k] for point in self.points])
            draw_branch(axis, values, heights, is_stable.tolist(), number)
            for point in self.points:
                axis.plot([point.value], [point.places[k]], **mark(point.shape))

    def _is_stable_before(self, number: int) -> bool:
        """Whether the branch is stable up to one of its points.

        Of several between two orbits, it changes at that whose largest multiplier is nearest to 1.
        """
        after = self.points[number].after
        between = [k for k, point in enumerate(self.points) if point.after == after]
        change = min(between, key=lambda k: abs(np.abs(self.points[k].orbit.floquet.others).max(initial=0.0) - 1))
        return self.is_stable[max(0, min(after + (number > change), len(self.is_stable) - 1))]


def figure_along(scene: Scene, variation: Variation, labels: Sequence[str], branches: Sequence[DrawnBranch]) -> Figure:
    """A panel for each of the `labels`, the first from 0 on, with all branches along a number of the scene."""
    figure, axes = stack(len(labels), sharex=True)
    for number, branch in enumerate(branches):
        branch.draw(axes, number)
    for axis, label in zip(axes, labels, strict=True):
        axis.set_ylabel(label)
        if label.startswith("growth"):
            axis.axhline(0.0, color=secondary_colour(), lw=0.8, zorder=1)
    axes[0].set_ylim(0, 1.05 * axes[0].get_ylim()[1])
    set_values(axes[-1], scene, variation)
    return figure


def heights_of(orbit: Orbit | None) -> tuple[float, float, float]:
    """Largest angle (°), frequency (rad/s) and growth rate (1/s; NaN if nothing can grow or decay); NaN of no orbit."""
    from nonlinear.orbits import growth

    if orbit is None:
        return np.nan, np.nan, np.nan
    rate = growth(orbit)
    return float(np.rad2deg(orbit.amplitude)), orbit.omega, rate if np.isfinite(rate) else np.nan


def draw_branch(axis: Axes, x: Floats, y: Floats, is_stable: Sequence[bool], number: int, *, steps: int = 12) -> None:
    """One branch, in smooth pieces of equal stability that meet; unstable ones are half as wide, and above.

    There are so many `steps` of a smooth curve for each that was computed.
    """
    fates = np.array(is_stable)
    breaks = [0, *(np.flatnonzero(np.diff(fates)) + 1), len(fates)]
    fine_x, fine_y = smooth_curve(x, y, steps)
    for start, stop in pairwise(breaks):
        piece = slice(steps * max(start - 1, 0), steps * (stop - 1) + 1)
        fate = bool(fates[start])
        look = {"color": colour(number), "ls": LINES[fate], "lw": narrowing(number) * (1.0 if fate else 0.5)}
        axis.plot(fine_x[piece], fine_y[piece], **look, zorder=3 if fate else 3.5, label=f"_{number}")


def smooth_curve(x: Floats, y: Floats, count: int = 12) -> tuple[Floats, Floats]:
    """Both with points between along the curve, by cubics that turn only where the curve does [Fritsch1984]."""
    extents = [float(np.ptp(part[np.isfinite(part)])) if np.isfinite(part).any() else 0.0 for part in (x, y)]
    steps = np.nan_to_num(
        np.hypot(*(np.diff(part) / (extent or 1.0) for part, extent in zip((x, y), extents, strict=True)))
    )
    way = np.append(0.0, np.cumsum(np.maximum(steps, EPS**0.5)))
    between = np.arange(count * (len(x) - 1) + 1) / count
    fine = np.interp(between, np.arange(len(x)), way)
    if len(x) < 3 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        return np.interp(fine, way, x), np.interp(fine, way, y)
    x_of, y_of = (scipy.interpolate.PchipInterpolator(way, part) for part in (x, y))
    return x_of(fine), y_of(fine)


def mark(shape: str = "o") -> dict[str, Any]:
    """The style of a special point."""
    return {"ls": "", "marker": shape, "mfc": paper(), "mec": ink(), "ms": 6.0, "mew": 1.2, "zorder": 5}


def branch_keys(names: Sequence[str]) -> list[Line2D]:
    """The legend's line of each branch, with its number."""
    return [
        Line2D([], [], color=colour(number), lw=narrowing(number), label=f"{number + 1}: {name}")
        for number, name in enumerate(names)
    ]


def stability_keys(fates: Container[bool] = (True, False)) -> list[Line2D]:
    """The legend's lines of stable and unstable pieces, of those there are."""
    return [
        Line2D([], [], color=ink(), ls=style, label="stable" if fate else "unstable")
        for fate, style in LINES.items()
        if fate in fates
    ]


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
