"""The levels of pendula alone, of the scene, and of the structure alone, joined where one becomes another."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from modal.coupling import Coupling, family_name
from modal.plotting.layout import SMALL
from modal.plotting.style import QUIET, colour, mixed, paper
from modal.types import Floats

APART = 0.075
"""Least distance of words at levels, over the height of their axis."""


def draw_levels(axis: Axes, coupling: Coupling, wide: bool) -> None:
    """Frequencies of pendula alone, of the scene, and of the structure alone, joined where one becomes another."""
    left, right = (0.0, 0.9), (3.1, 4.0)
    middle = (1.6, 2.4)
    told: dict[str, list[tuple[float, str]]] = {"left": [], "middle": [], "right": []}
    for r, family in enumerate(coupling.families):
        axis.plot(left, [family.omega] * 2, color=colour(0), lw=1.8)
        told["left"].append((family.omega, rf"ω$_\mathrm{{{family_name(r)}}}$ {family.omega:.5g}"))
        if family.still:
            _level(axis, middle, family.omega, left[1], family.omega, colour(0))
            words = f"{family.omega:.5g}" + (f" × {family.still}" if family.still > 1 else "") + ", nothing else moves"
            told["middle"].append((family.omega, words))
        for branch in family.branches:
            _level(axis, middle, branch.omega, left[1], family.omega, colour(0))
            told["middle"].append((branch.omega, f"{branch.omega:.5g}"))
    matched = zip(coupling.structure_modes, _matched(coupling), strict=True)
    for (omega, _), s in matched:
        _level(axis, middle, omega, right[0], coupling.modes[s].omega, colour(1))
        told["middle"].append((omega, f"{omega:.5g}"))
    for s, mode in enumerate(coupling.modes):
        axis.plot(right, [mode.omega] * 2, color=colour(1), lw=1.8)
        told["right"].append((mode.omega, f"s{s + 1} {mode.omega:.5g}"))
    axis.set(
        xlim=(-0.75, 4.75 if coupling.modes else 3.2),
        ylabel="angular frequency ω (rad/s)",
        yscale="log" if wide else "linear",
    )
    axis.margins(y=0.08)
    places = {"left": (left[0] - 0.05, "right"), "middle": (2.45, "left"), "right": (right[1] + 0.05, "left")}
    for column, (x, ha) in places.items():
        _words(axis, told[column], x, ha)
    axis.set_xticks([0.45, 2.0, 3.55][: 3 if coupling.modes else 2])
    axis.set_xticklabels(["pendula alone", "the scene", "the structure alone"][: 3 if coupling.modes else 2])
    axis.grid(visible=False)
    axis.set_title("levels", loc="left")


def _level(axis: Axes, middle: tuple[float, float], omega: float, side: float, before: float, hue: str) -> None:
    """A level of the scene, and the line to what it comes from."""
    axis.plot(middle, [omega] * 2, color=colour(4), lw=1.8, zorder=3)
    end = middle[0] if side < middle[0] else middle[1]
    axis.plot([side, end], [before, omega], color=mixed(hue, 0.55), lw=0.9, gid=QUIET, zorder=1)


def _matched(coupling: Coupling) -> list[int]:
    """The structure's own mode that each mode of the scene that belongs to it is mostly of, none twice."""
    left, matches = set(range(len(coupling.modes))), list[int]()
    for _, motion in coupling.structure_modes:
        energy: Floats = np.array([mode.mass for mode in coupling.modes]) * motion**2
        best = max(left, key=lambda s, energy=energy: float(energy[s]))  # type: ignore[misc]
        left.remove(best)
        matches.append(best)
    return matches


def _words(axis: Axes, told: list[tuple[float, str]], x: float, ha: str) -> None:
    """Words beside levels, pushed apart where they would touch; a drift stands at the lower end."""
    axis.set_ylim(axis.get_ylim())
    transform, linear = axis.transScale + axis.transLimits, axis.get_yscale() == "linear"
    told = sorted(told)
    places = [float(transform.transform((x, omega))[1]) if omega or linear else 0.0 for omega, _ in told]
    for k in range(1, len(places)):
        places[k] = max(places[k], places[k - 1] + APART)
    highest = 1.0
    for k in reversed(range(len(places))):
        places[k] = min(places[k], highest)
        highest = places[k] - APART
    box = {"facecolor": paper(), "edgecolor": "none", "pad": 0.8}
    for place, (_, words) in zip(places, told, strict=True):
        look: dict[str, Any] = {"ha": ha, "va": "center", "fontsize": SMALL, "bbox": box, "zorder": 4}
        axis.text(x, place, words, transform=axis.get_xaxis_transform(), **look)
