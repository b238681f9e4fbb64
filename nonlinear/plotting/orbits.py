"""Pictures of branches of periodic orbits: backbones of modes and bifurcation diagrams along a number."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError, SceneError
from modal.modes import Mode, natural_modes
from modal.plotting.layout import headline, key, set_values
from modal.plotting.style import HUES, MARKED, PREDICTED, SOLVED_POINTS, secondary_colour, stack
from modal.scene import Scene, title_of
from modal.scene.parameters import Variation, vary
from modal.types import Floats
from nonlinear.plotting.branches import (
    LABELS,
    DrawnBranch,
    SpecialMark,
    branch_keys,
    figure_along,
    heights_of,
    mark,
    stability_keys,
)

if TYPE_CHECKING:
    from nonlinear.orbits import Branch, Orbit

MARKS = {"fold": "o", "branch point": "D", "period doubling": "s", "torus": "^", "collision": "v"}
BACKBONE_DEG = 170.0
"""Format: largest angle of a backbone next to a resonance: short of the top, where its period has no limit."""


def orbits_figure(scene: Scene, branches: Sequence[Branch], mode: Mode | None = None) -> Figure:
    """Backbones of a `mode` with its linear and its κ curve, or branches along a number; solid where stable.

    Raise ComputationError for more branches than a figure holds.
    """
    if not 1 <= len(branches) <= HUES:
        raise ComputationError(f"{len(branches)} branches do not fit in a figure: from 1 to {HUES}")
    is_forced = branches[0].is_forced
    figure = (
        _backbones(branches, mode) if mode else _resonance(scene, branches) if is_forced else _along(scene, branches)
    )
    headline(figure, title_of(scene), "periodic motions under drives" if is_forced else "periodic orbits")
    references = (
        [line for line in figure.axes[0].lines if not str(line.get_label()).startswith("_")] if is_forced else []
    )
    lines = [
        Line2D([], [], color=line.get_color(), ls=line.get_linestyle(), label=line.get_label()) for line in references
    ]
    names = branch_keys([f"from {branch.origin}" for branch in branches])
    key(figure, [*names, *_style_keys(branches, mode), *lines], columns=2)
    return figure


def _backbones(branches: Sequence[Branch], mode: Mode) -> Figure:
    figure, (axis,) = stack(1, 2)
    for number, branch in enumerate(branches):
        _drawn(branch, branch.omega, lambda orbit: orbit.omega, lambda orbit: [np.rad2deg(orbit.amplitude)]).draw(
            [axis], number
        )
    widest = float(max(branch.amplitude.max() for branch in branches))
    a = np.linspace(0, widest, SOLVED_POINTS)
    slow, fast = axis.get_xlim()
    fast = max(fast, mode.omega + 0.1 * (mode.omega - slow), (1 + rcParams["axes.xmargin"]) * slow)
    slow = min(slow, mode.omega - 0.1 * (fast - mode.omega))
    axis.axvline(mode.omega, color=secondary_colour(), lw=1.1, ls=MARKED, zorder=1)
    axis.plot(
        mode.omega * (1 + mode.kappa * a**2), np.rad2deg(a), color=secondary_colour(), lw=1.3, ls=PREDICTED, zorder=2
    )
    axis.set(xlim=(slow, fast), ylim=(0, 1.05 * np.rad2deg(widest)))
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="largest angle of any link (°)")
    return figure


def _along(scene: Scene, branches: Sequence[Branch]) -> Figure:
    """Angle, frequency and growth rate along a number."""
    assert branches[0].variation is not None
    drawn_branches = [_drawn(branch, branch.value, _value, heights_of) for branch in branches]
    return figure_along(scene, branches[0].variation, LABELS, drawn_branches)


def _value(orbit: Orbit) -> float:
    return float(orbit.value or 0.0)


def _drawn(
    branch: Branch, places: Floats, place: Callable[[Orbit], float], heights: Callable[[Orbit], Sequence[float]]
) -> DrawnBranch:
    """A branch over the `places` of its orbits, with a curve for each of the `heights`."""
    points = [
        SpecialMark(MARKS[each.kind], each.orbit, place(each.orbit), heights(each.orbit), each.after)
        for each in branch.special
    ]
    curves = np.array([heights(orbit) for orbit in branch.orbits]).T
    return DrawnBranch(places, branch.is_stable, list(curves), points)


def _resonance(scene: Scene, branches: Sequence[Branch]) -> Figure:
    """The largest angle and its phase along a number, with the linear response and the backbones of modes next to."""
    figure, (upper, lower) = stack(2, sharex=True, height_ratios=(3, 2))
    variation = branches[0].variation
    assert variation is not None
    for number, branch in enumerate(branches):
        phase = np.array([orbit.phase for orbit in branch.orbits])
        swings = np.isfinite(phase)
        phase[swings] = np.unwrap(phase[swings])
        phase -= 2 * np.pi * np.round(np.mean(phase[swings]) / (2 * np.pi)) if swings.any() else 0.0
        points = []
        for special in branch.special:
            phase_before, orbit = phase[special.after], special.orbit
            phase_at = phase_before + np.angle(np.exp(1j * (orbit.phase - phase_before)))
            heights = np.rad2deg([orbit.amplitude, phase_at]).tolist()
            points.append(SpecialMark(MARKS[special.kind], orbit, _value(orbit), heights, special.after))
        curves = [np.rad2deg(branch.amplitude), np.rad2deg(phase)]
        DrawnBranch(branch.value, branch.is_stable, curves, points).draw([upper, lower], number)
    widest = max(float(np.rad2deg(branch.amplitude.max())) for branch in branches)
    clock = getattr(branches[0].problem, "clock", None)
    is_frequency = clock is not None and clock.value is not None
    values, linear = _linear(scene, variation)
    upper.plot(values, linear, color=secondary_colour(), lw=1.3, ls=PREDICTED, zorder=1, label="linear response")
    for k, (hertz, angles) in enumerate(_backbones_of(scene, variation, widest) if is_frequency else ()):
        upper.plot(hertz, angles, color=secondary_colour(), lw=1.0, zorder=2, label="_" if k else "backbone")
    upper.set(ylabel="largest angle (°)", ylim=(0, 1.08 * widest or 1))
    lower.set_ylabel("phase against\nthe drive (°)")
    set_values(lower, scene, variation, words="frequency of the drive (Hz)" if is_frequency else "")
    return figure


def _linear(scene: Scene, variation: Variation) -> tuple[Floats, Floats]:
    """The largest angle (deg) of the linear response at this many values of a number; NaN if it has none."""
    from nonlinear.orbits import linear_response

    space = np.geomspace if variation.log else np.linspace
    values, angles = space(variation.values[0], variation.values[-1], SOLVED_POINTS), np.full(SOLVED_POINTS, np.nan)
    for k, value in enumerate(values.tolist()):
        with suppress(ComputationError, SceneError):
            angles[k] = np.rad2deg(linear_response(vary(scene, {variation.path: value})).amplitude)
    return values, angles


def _backbones_of(scene: Scene, variation: Variation, widest: float) -> Iterator[tuple[Floats, Floats]]:
    """Frequency (Hz) and largest angle (deg) of the modes that swing near the range, without drives and losses."""
    from nonlinear.orbits import nonlinear_mode

    free = scene.still.replace(force=())
    low, high = variation.values[0], variation.values[-1]
    for number, omega in enumerate(natural_modes(free).omega, start=1):
        if not low - (high - low) < omega / (2 * np.pi) < high + (high - low):
            continue
        with suppress(ComputationError, SceneError):
            branch = nonlinear_mode(free, number, np.deg2rad(min(widest, BACKBONE_DEG)), locate=False)
            yield branch.omega / (2 * np.pi), np.rad2deg(branch.amplitude)


def _style_keys(branches: Sequence[Branch], mode: Mode | None) -> list[Line2D]:
    styles = stability_keys({fate for branch in branches for fate in branch.is_stable})
    if mode:
        styles.append(Line2D([], [], color=secondary_colour(), ls=MARKED, label=f"linear, {mode.omega:.5g} rad/s"))
        styles.append(
            Line2D([], [], color=secondary_colour(), ls=PREDICTED, label=f"κ = {mode.kappa:.4g}".replace("-", "−"))
        )
    kinds = dict.fromkeys(special.kind for branch in branches for special in branch.special)
    return [*styles, *(Line2D([], [], label=kind, **mark(MARKS[kind])) for kind in kinds)]
