"""The coupling through a structure in one picture: what a push along each of its own modes feels, and all levels."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D

from modal.coupling import StructureCoupling, family_name
from modal.plotting.layout import SMALL, headline, key, shortened
from modal.plotting.style import MARKED, QUIET, WIDE, colour, ink, mixed, paper, sheet
from modal.scene import title_of
from modal.types import Floats

MOST_PANELS, POINTS, LETTERS = 4, 900, 46
TOP = 2.2
"""Range of the mass axis over the mass of a slow push."""
LOGARITHMIC = 30.0
"""Ratio of frequencies from which their axis is logarithmic."""
LEAST = 1e-6
"""Smallest share of kinetic energy that makes a mode of the scene one of a panel."""
APART = 0.075
"""Least distance of words at levels, over the height of their axis."""


def structure_figure(coupling: StructureCoupling) -> Figure:
    """The coupling through a structure; of many modes of the structure it shows the lowest."""
    panels = min(coupling.reduced.d, MOST_PANELS)
    lines = -(-panels // 2)
    figure = sheet(WIDE, 3.0 * lines + 4.0)
    columns = 2 if panels > 1 else 1
    rows = GridSpec(lines + 1, columns, figure, height_ratios=(*[3.0] * lines, 3.6))
    low, high, wide = _span(coupling)
    for s in range(panels):
        last = s == panels - 1 and panels % 2 == 1
        place = rows[s // columns, :] if last else rows[s // columns, s % columns]
        _felt(figure.add_subplot(place), coupling, s, (low, high, wide))
    _levels(figure.add_subplot(rows[lines, :]), coupling, wide)
    shown = f", the lowest {panels} of {coupling.reduced.d}" if coupling.reduced.d > panels else ""
    what = f"mass felt by a push along the structure's own modes{shown}, and all levels"
    headline(figure, title_of(coupling.scene), what if panels else "levels of pendula alone and together")
    entries = {
        "mass that a push feels": Line2D([], [], color=colour(2)),
        "pendula alone, all else held": Line2D([], [], color=colour(0), ls=MARKED, lw=1.4),
        "modes of the scene": Line2D([], [], color=colour(4), marker="o", mec=paper()),
        "the structure alone, pendula stiff": Line2D([], [], color=colour(1), ls=MARKED, lw=1.4),
    }
    chosen = entries if panels else {name: entries[name] for name in list(entries)[1:3]}
    key(figure, list(chosen.values()), list(chosen))
    return figure


def _span(coupling: StructureCoupling) -> tuple[float, float, bool]:
    """Both ends of the frequency axis, and whether it is logarithmic."""
    every = np.concatenate(
        [coupling.omega, [family.omega for family in coupling.families], [mode.omega for mode in coupling.modes]]
    )
    every = every[every > 0]
    low, high = float(every.min()), float(every.max())
    if high > LOGARITHMIC * low:
        return low / 2, high * 2, True
    room = max(0.15 * (high - low), 0.1 * high)
    return max(0.0, low - 2 * room), high + room, False


def _felt(axis: Axes, coupling: StructureCoupling, s: int, span: tuple[float, float, bool]) -> None:
    """The mass that a push along own mode s feels over ω, its zeros at modes of the scene."""
    low, high, wide = span
    mode = coupling.modes[s]
    zeros = np.array([omega for omega, share in _shares(coupling, s) if share > LEAST and omega > 0])
    marked = np.concatenate([zeros, [family.omega for family in coupling.families]])
    aside = np.geomspace(1e-6, 0.03, 60)
    near = np.outer(marked, np.concatenate([1 - aside, 1 + aside])).ravel()
    even = np.geomspace(low, high, POINTS) if wide else np.linspace(max(low, high / POINTS), high, POINTS)
    omega = np.unique(np.concatenate([even, near[(near > even[0]) & (near < high)]]))
    with np.errstate(all="ignore"):
        felt = coupling.felt(omega)[:, s]
    leaps = np.abs(np.diff(np.sign(felt))) * (np.abs(felt[1:]) + np.abs(felt[:-1])) > 2 * TOP * mode.mass
    felt[:-1][leaps] = np.nan
    axis.plot(omega, np.clip(felt, -20 * mode.mass, 20 * mode.mass), color=colour(2), zorder=3)
    axis.axhline(0.0, color=ink(), lw=0.8)
    for r, family in enumerate(coupling.families):
        axis.axvline(family.omega, color=colour(0), ls=MARKED, lw=1.4, zorder=1)
        if r < 6:
            axis.annotate(
                rf"ω$_\mathrm{{{family_name(r)}}}$",
                (family.omega, 1.0),
                (0, 2),
                axis.get_xaxis_transform(),
                textcoords="offset points",
                ha="center",
                fontsize=SMALL,
                color=colour(0),
            ).set_annotation_clip(False)
    if mode.omega:
        axis.axvline(mode.omega, color=colour(1), ls=MARKED, lw=1.4, zorder=1)
    axis.plot(zeros, 0 * zeros, "o", color=colour(4), ms=6, mec=paper(), mew=0.8, zorder=4)
    axis.set(xlim=(low, high), ylim=(-1.2 * mode.mass, TOP * mode.mass), xscale="log" if wide else "linear")
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="mass felt (kg)")
    axis.yaxis.set_major_formatter("{x:g}")
    words = shortened(coupling.words(mode.shape), LETTERS)
    axis.set_title(f"s{s + 1}: {words}", loc="left", pad=15, parse_math=False)


def _shares(coupling: StructureCoupling, s: int) -> list[tuple[float, float]]:
    """ω of the scene's moving modes, and the share of own mode s of the structure in their kinetic energy."""
    branches = [(branch.omega, branch.motion) for family in coupling.families for branch in family.branches]
    return [
        (omega, float(coupling.modes[s].mass * motion[s] ** 2))
        for omega, motion in (*branches, *coupling.structure_modes)
    ]


def _levels(axis: Axes, coupling: StructureCoupling, wide: bool) -> None:
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


def _matched(coupling: StructureCoupling) -> list[int]:
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
