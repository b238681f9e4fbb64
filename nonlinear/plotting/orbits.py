"""Pictures of branches of periodic orbits: backbones of modes and bifurcation diagrams along a number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import IO, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.modes import Mode
from modal.plotting import HUES, WIDTH, axis_words, headline, key, muted, save, scale, sheet
from modal.scene import Scene, title_of
from modal.types import Floats
from nonlinear.plotting.stability import branch_keys, draw_branch, mark, stability_keys

if TYPE_CHECKING:
    from nonlinear.orbits import Branch, Special

MARKS = {"fold": "o", "branch point": "D", "period doubling": "s", "torus": "^", "collision": "v"}
NARROW = 0.05  # least width of the axis of frequencies over the linear frequency


def draw_orbits(
    scene: Scene, branches: Sequence[Branch], stream: IO[bytes], form: str = "png", mode: Mode | None = None
) -> None:
    """Write the picture as png, svg or pdf."""
    save(orbits_figure(scene, branches, mode), stream, form)


def orbits_figure(scene: Scene, branches: Sequence[Branch], mode: Mode | None = None) -> Figure:
    """Backbones of a `mode` with its linear and its κ curve, or branches along a number; solid where stable.

    Raises ComputationError for more branches than a figure holds.
    """
    if not 1 <= len(branches) <= HUES:
        raise ComputationError(f"{len(branches)} branches do not fit in a figure: from 1 to {HUES}")
    figure = _backbones(branches, mode) if mode else _along(branches)
    headline(figure, title_of(scene), "periodic orbits")
    key(figure, [*branch_keys([f"from {branch.origin}" for branch in branches]), *_drawn(branches, mode)], columns=2)
    return figure


def _backbones(branches: Sequence[Branch], mode: Mode) -> Figure:
    figure = sheet(WIDTH, 5.8)
    axis = figure.subplots()
    for number, branch in enumerate(branches):
        _curve(axis, branch, branch.omega, np.rad2deg(branch.amplitude), number)
    widest = float(max(branch.amplitude.max() for branch in branches))
    a = np.linspace(0, widest, 200)
    slow, fast = axis.get_xlim()
    fast = max(fast, mode.omega + 0.1 * (mode.omega - slow), slow + NARROW * mode.omega)
    slow = min(slow, mode.omega - 0.1 * (fast - mode.omega))
    axis.axvline(mode.omega, color=muted(), lw=1.1, ls=":", zorder=1)
    axis.plot(mode.omega * (1 + mode.kappa * a**2), np.rad2deg(a), color=muted(), lw=1.3, ls="--", zorder=2)
    axis.set(xlim=(slow, fast), ylim=(0, 1.05 * np.rad2deg(widest)))
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="largest angle of any link (°)")
    return figure


def _along(branches: Sequence[Branch]) -> Figure:
    figure = sheet(WIDTH, 7.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    variation = branches[0].variation
    assert variation is not None
    for number, branch in enumerate(branches):
        _curve(upper, branch, branch.value, np.rad2deg(branch.amplitude), number)
        _curve(lower, branch, branch.value, branch.omega, number)
    upper.set(ylabel="largest angle (°)", xlim=(variation.values[0], variation.values[-1]))
    upper.set_ylim(0, 1.05 * upper.get_ylim()[1])
    lower.set(xlabel=axis_words(variation), ylabel="angular frequency ω (rad/s)")
    scale(lower, "x", variation)
    return figure


def _curve(axis: Axes, branch: Branch, x: Floats, y: Floats, number: int) -> None:
    """One branch, with its special points."""
    draw_branch(axis, x, y, branch.is_stable, number)
    for special in branch.special:
        place = [_read(special, branch, x), _read(special, branch, y)]
        axis.plot(place[:1], place[1:], **mark(MARKS[special.kind]))


def _read(special: Special, branch: Branch, values: Floats) -> float:
    """The coordinate of a special point on the axis of these values."""
    orbit = special.orbit
    if values is branch.omega:
        return orbit.omega
    return float(np.rad2deg(orbit.amplitude)) if values is not branch.value else float(orbit.value or 0.0)


def _drawn(branches: Sequence[Branch], mode: Mode | None) -> list[Line2D]:
    styles = stability_keys({fate for branch in branches for fate in branch.is_stable})
    if mode:
        styles.append(Line2D([], [], color=muted(), ls=":", label=f"linear, {mode.omega:.5g} rad/s"))
        styles.append(Line2D([], [], color=muted(), ls="--", label=f"κ = {mode.kappa:.4g}".replace("-", "−")))
    kinds = dict.fromkeys(special.kind for branch in branches for special in branch.special)
    return [*styles, *(Line2D([], [], label=kind, **mark(MARKS[kind])) for kind in kinds)]
