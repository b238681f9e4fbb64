"""The coupling in one picture: dynamic mass with poles and zeros, each family enlarged, and the effect of cart mass."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D

from modal.coupling import Coupling, Family, family_name
from modal.plotting.layout import SMALL, drop_overlapping, em_of, headline, key, log_ticks, shorten
from modal.plotting.style import (
    BAND_OPACITY,
    CURVE_POINTS,
    LOG_RATIO,
    MARKED,
    QUIET,
    SOLVED_POINTS,
    VISIBLE_SHARE,
    WIDE,
    colour,
    ink,
    mixture,
    paper,
    secondary_colour,
    sheet_of_rows,
)
from modal.scene import title_of
from modal.types import Floats

MODE_PANELS = 4
"""Format: most own modes of a structure that have a panel each, two in a row."""
POLE_ROOM = 0.02
"""Format: part of an axis between the line of a pole and its neighbours."""
FELT = r"dynamic mass $m_\mathrm{dyn}$ (kg)"
CART_MASS = r"mass of the cart $m_c$ (kg)"
WIDE_POLES_MAX = 8
"""Format: poles whose lines have their full width; of more they are thinner, and a linear axis may part them."""


def coupling_figure(coupling: Coupling) -> Figure:
    """The coupling in one picture; of many poles and lines, or modes of a structure, it shows some and says so."""
    if coupling.scene.is_structured:
        figure = _of_structure(coupling)
    else:
        families = close_families(coupling)
        figure = sheet_of_rows(4 if families else 3, WIDE)
        heights = (3, 2, 3) if families else (1, 1)
        rows = GridSpec(len(heights), max(1, len(families)), figure, height_ratios=heights)
        draw_mass(figure.add_subplot(rows[0, :]), coupling)
        for column, number in enumerate(families):
            draw_close(figure.add_subplot(rows[1, column]), coupling, number)
        draw_limits(figure.add_subplot(rows[-1, :]), coupling)
    _finish(figure, coupling)
    return figure


def _of_structure(coupling: Coupling) -> Figure:
    """A panel for each of the lowest own modes, and all frequencies."""
    panels = min(coupling.reduced.d, MODE_PANELS)
    lines, columns = -(-panels // 2), 2 if panels > 1 else 1
    figure = sheet_of_rows(lines + 2, WIDE)
    rows = GridSpec(lines + 1, columns, figure)
    for s in range(panels):
        last = s == panels - 1 and panels % 2 == 1
        place = rows[s // columns, :] if last else rows[s // columns, s % columns]
        draw_mass(figure.add_subplot(place), coupling, s)
    draw_levels(figure.add_subplot(rows[lines, :]), coupling, span(_marks(coupling, 0), _poles(coupling))[2])
    return figure


def _finish(figure: Figure, coupling: Coupling) -> None:
    entries = {
        "dynamic mass": Line2D([], [], color=curve()),
        "poles (antiresonances of the cart)": Line2D([], [], color=pole(), ls=MARKED, lw=1.4),
        "zeros: the cart moves": Line2D([], [], color=zero(), marker="o", mec=paper()),
        "mass at high frequency": Line2D([], [], color=secondary_colour(), ls=MARKED, lw=0.9),
    }
    what = "dynamic mass for a force on the cart" if coupling.on_cart else "dynamic mass for a cart here"
    if coupling.scene.is_structured:
        d, words = coupling.reduced.d, ("dynamic mass", "pendula alone, all else held", "modes of the scene")
        entries = {
            **dict(zip(words, entries.values(), strict=False)),
            "the structure alone, pendula stiff": Line2D([], [], color=colour(1), ls=MARKED, lw=1.4),
        }
        limit_note = f", the lowest {MODE_PANELS} of {d}" if d > MODE_PANELS else ""
        what = f"dynamic mass along the structure's own modes{limit_note}, and all frequencies"
        if not d:
            hues = dict(zip(words[1:], (pole(), zero()), strict=True))
            what = "frequencies of the pendula alone and together"
            entries = {name: Line2D([], [], color=hue, lw=1.8) for name, hue in hues.items()}
    elif not coupling.on_cart:
        entries = dict(list(entries.items())[:3])
    headline(figure, title_of(coupling.scene), what)
    key(figure, list(entries.values()), list(entries))


def pole() -> str:
    """The colour of a mode in which the cart is at rest."""
    return colour(0)


def curve() -> str:
    """The colour of the dynamic mass."""
    return colour(2)


def zero() -> str:
    """The colour of a mode that moves the cart."""
    return colour(4)


def plain() -> dict[str, Any]:
    """Background-coloured boxes behind words."""
    return {"facecolor": paper(), "edgecolor": "none", "pad": 1.5, "alpha": 0.85}


def name(index: int) -> str:
    """ω with the letter of a family, by its index from 0."""
    return rf"ω$_\mathrm{{{family_name(index)}}}$"


def _letter(coupling: Coupling, omega: float) -> str:
    """The name of the first family at a pole."""
    return name(int(np.abs(np.array([family.omega for family in coupling.families]) - omega).argmin()))


def _marks(coupling: Coupling, s: int) -> Floats:
    """All frequencies that an axis has to show."""
    poles = _poles(coupling)
    if not coupling.scene.is_structured:
        return np.concatenate([poles, _zeros(coupling, s)])
    frequencies = np.concatenate([coupling.omega, poles, [mode.omega for mode in coupling.modes]])
    return frequencies[frequencies > 0]


def _poles(coupling: Coupling) -> Floats:
    """The antiresonance frequencies of the supports."""
    return np.array([family.omega for family in coupling.families])


def _zeros(coupling: Coupling, s: int) -> Floats:
    """The frequencies of modes that move own mode s of the supports of the pendula, of several by a visible share."""
    branches = [(branch.omega, branch.motion) for family in coupling.families for branch in family.branches]
    moving_modes = [(w, motion) for w, motion in (*branches, *coupling.structure_modes) if 0 < w < inf]
    if len(coupling.modes) > 1:
        mass = coupling.modes[s].mass
        moving_modes = [(w, motion) for w, motion in moving_modes if mass * motion[s] ** 2 > VISIBLE_SHARE]
    return np.sort([w for w, _ in moving_modes])


def is_crowded(coupling: Coupling) -> bool:
    """Whether more than four poles are too close to be drawn one by one: a band too narrow for their lines."""
    poles = _poles(coupling)
    low, high, is_logarithmic = span(_marks(coupling, 0), poles)
    share = np.ptp(np.log(poles)) / np.log(high / low) if is_logarithmic else np.ptp(poles) / (high - low)
    return len(poles) > 4 and bool(share < POLE_ROOM * len(poles))


def draw_mass(axis: Axes, coupling: Coupling, s: int = 0) -> None:
    """m_dyn over ω, its poles above and its zeros on the line m_dyn = 0; of a structure that along its own mode s."""
    is_structured, poles, zeros = coupling.scene.is_structured, np.unique(_poles(coupling)), _zeros(coupling, s)
    mass_at_rest = coupling.modes[s].mass if is_structured else coupling.dynamic.at_rest
    low, high, is_logarithmic = span(_marks(coupling, s), poles)
    top = 2 * mass_at_rest
    if not (is_logarithmic or is_structured) and coupling.dynamic(low)[0] > top:
        low, high = 0.0, 1.5 * high
    axis.set(xlim=(low, high), ylim=(-mass_at_rest, top), xscale="log" if is_logarithmic else "linear")
    axis.set(xlabel="angular frequency ω (rad/s)", ylabel="dynamic mass (kg)" if is_structured else FELT)
    axis.yaxis.set_major_formatter("{x:g}" if top < 1e6 else "{x:.3g}")  # not 800000 beside 1e+06
    axis.axhline(0.0, color=ink(), lw=0.8)
    if coupling.on_cart:
        axis.axhline(coupling.dynamic.at_infinity, color=secondary_colour(), lw=0.9, ls=MARKED)
    crowd = not is_structured and is_crowded(coupling)
    omega = _grid(poles, zeros, low, high, is_logarithmic)
    omega = omega[(omega <= poles[0]) | (omega >= poles[-1])] if crowd else omega
    with np.errstate(all="ignore"):
        mass = coupling.felt_masses(omega)[:, s] if is_structured else coupling.dynamic(omega)
    mass[np.isin(omega, poles)] = np.nan
    if is_structured:
        # From below the axis to above it, or back: a pole lies between, and no line joins its two sides.
        leaps = np.abs(np.diff(np.sign(mass))) * (np.abs(mass[1:]) + np.abs(mass[:-1])) > 2 * top
        mass[:-1][leaps] = np.nan
    thin = _thinner(len(poles))
    axis.plot(omega, np.clip(mass, -2 * top, 2 * top), color=curve(), lw=1.6 * thin, zorder=3)
    if crowd:
        axis.axvspan(poles[0], poles[-1], color=pole(), alpha=BAND_OPACITY, lw=0)
        middle = float(np.sqrt(poles[0] * poles[-1]))
        axis.text(middle, top, f"{len(poles)} poles", color=pole(), fontsize=SMALL, ha="center", va="bottom")
        zeros = zeros[(zeros < poles[0]) | (zeros > poles[-1])]
    else:
        for value in poles:
            axis.axvline(value, color=pole(), ls=MARKED, lw=1.4 * thin)
        names = [_letter(coupling, value) for value in poles.tolist()]
        values = [f" {value:.5g}" * (not is_structured) for value in poles]
        _labels(axis, poles, [f"{a}{b}" for a, b in zip(names, values, strict=True)], pole(), is_above=True)
    axis.plot(zeros, 0 * zeros, "o", color=zero(), ms=6 * thin, zorder=4, mec=paper(), mew=0.8 * thin)
    if is_structured:
        mode = coupling.modes[s]
        words = shorten(coupling.words(mode.shape))
        axis.axvline(mode.omega or np.nan, color=colour(1), ls=MARKED, lw=1.4, zorder=1)
        axis.set_title(f"s{s + 1}: {words}", loc="left", pad=15, parse_math=False)
    else:
        _labels(axis, zeros, [f"{value:.5g}" for value in zeros], zero(), is_above=False)


def _fits_linear(poles: Floats) -> bool:
    """Whether the closest of many poles are further apart on a linear axis than on a logarithmic one."""
    distinct_poles = np.unique(poles)
    if len(distinct_poles) <= WIDE_POLES_MAX:
        return False
    gaps = [float(np.diff(scale).min() / np.ptp(scale)) for scale in (distinct_poles, np.log(distinct_poles))]
    return gaps[0] > gaps[1]


def _thinner(count: int) -> float:
    """The width of each of so many lines over that of a few."""
    return float(np.clip(WIDE_POLES_MAX / max(count, 1), 0.5, 1.0))


def span(omega: Floats, poles: Floats) -> tuple[float, float, bool]:
    """Both ends of the frequency axis and whether it is logarithmic."""
    smallest, largest = float(omega.min()), float(omega.max())
    if largest > LOG_RATIO * smallest and not _fits_linear(poles):
        return smallest / 3, largest * 3, True
    extent = largest - smallest
    return max(0.0, smallest - max(1.5 * extent, smallest / 5)), largest + max(extent / 4, largest / 12), False


def _grid(poles: Floats, zeros: Floats, low: float, high: float, is_logarithmic: bool) -> Floats:
    """Points evenly spaced along the axis and closer near poles and zeros."""
    axis_points = np.geomspace(low, high, CURVE_POINTS) if is_logarithmic else np.linspace(low, high, CURVE_POINTS)
    aside = np.geomspace(1e-7, 0.05, 120)
    close_points = np.outer(np.concatenate([poles, zeros]), np.concatenate([1 - aside, 1 + aside])).ravel()
    inside = close_points[(close_points > low) & (close_points < high)]
    return np.unique(np.concatenate([axis_points[axis_points > 0], inside, poles]))


def _labels(axis: Axes, places: Floats, words: Sequence[str], hue: str, *, is_above: bool) -> None:
    """Words above the axis or next to the points on its zero line, omitting any that would touch a previous one."""
    height, offset, side = (1.0, (0, 4), "center") if is_above else (0.0, (6, -11), "left")
    coordinates = axis.get_xaxis_transform() if is_above else axis.transData
    marks = [(place, height, word) for place, word in zip(places.tolist(), words, strict=True)]
    _annotate(axis, marks, hue, offset, coordinates, ha=side, annotation_clip=False)


def _annotate(
    axis: Axes, marks: list[tuple[float, float, str]], hue: str, offset: tuple[int, int], coordinates: Any, **look: Any
) -> None:
    """Labels at positions, omitting any that would touch a previous one."""
    look |= {"fontsize": SMALL, "color": hue, "zorder": 5, "bbox": plain() | {"pad": 0.5}}
    offsets = "offset points"
    drop_overlapping([axis.annotate(word, (x, y), offset, coordinates, offsets, **look) for x, y, word in marks])


def close_families(coupling: Coupling) -> list[int]:
    """The families shown enlarged, ascending: the most strongly coupled ones that are isolated."""
    families = () if is_crowded(coupling) else coupling.families
    numbers = [number for number, family in enumerate(families) if _is_close(coupling, family)]
    return sorted(sorted(numbers, key=lambda number: -abs(families[number].strength))[:3])


def _window(family: Family) -> tuple[float, float]:
    """The range of an enlargement below and above the pole (rad/s)."""
    split = family.splitting or 0.0
    return (-0.8 * split, 2.6 * split) if split > 0 else (2.6 * split, -0.8 * split)


def _is_close(coupling: Coupling, family: Family) -> bool:
    """Whether the zero is so close to the pole that both are seen better enlarged, and no other pole lies next to."""
    if not family.splitting or abs(family.strength) > 0.5:  # of a stronger one the zero is seen without enlargement
        return False
    distances = coupling.dynamic.omega - family.omega
    low, high = _window(family)
    return not np.any((distances != 0) & (distances > low) & (distances < high))


def draw_close(axis: Axes, coupling: Coupling, number: int) -> None:
    """m_dyn about one pole and its zero, over the distance from the pole."""
    family = coupling.families[number]
    split = family.splitting or 0.0
    scale = max(abs(family.rest), coupling.dynamic.at_rest / 10)
    for share in (np.linspace(-0.8, -1e-3, 200), np.geomspace(1e-3, 2.6, 300)):
        mass = mass_near_pole(coupling, number, share * split)
        axis.plot(share * split, np.where(np.abs(mass) < 30 * scale, mass, np.nan), color=curve())
    axis.axhline(0.0, color=ink(), lw=0.8)
    axis.axvline(0.0, color=pole(), ls=MARKED, lw=1.4)
    axis.plot([split], [0.0], "o", color=zero(), ms=6, mec=paper(), mew=0.8, zorder=4)
    arrow = {"arrowstyle": "<->", "color": ink(), "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    axis.annotate("", (split, -2.2 * scale), (0.0, -2.2 * scale), arrowprops=arrow)
    words = f"Δω = {split:.4g} rad/s".replace("-", "−") + (f"\nbeat {family.beat:.5g} s" if family.beat else "")
    side = "left" if split > 0 else "right"
    axis.text(1.1 * split, -2.2 * scale, words, fontsize=SMALL, va="center", ha=side, bbox=plain())
    axis.set(xlim=_window(family), ylim=(-3.2 * scale, 3.2 * scale), xlabel=f"ω − {name(number)} (rad/s)", ylabel=FELT)
    axis.set_title(f"close to {name(number)}: coupling ε = {family.strength:.3g}".replace("-", "−"))
    axis.locator_params(axis="x", nbins=4)
    axis.yaxis.set_major_formatter("{x:g}" if 3.2 * scale < 1e6 else "{x:.3g}")


def mass_near_pole(coupling: Coupling, number: int, distances: Floats) -> Floats:
    """m_dyn at these distances from the pole of a family."""
    family, dynamic = coupling.families[number], coupling.dynamic
    pole_part = family.mass * (family.omega / distances) * (family.omega / (2 * family.omega + distances))
    pole_mask = np.tile(np.arange(len(dynamic.omega)) == number, (len(distances), 1))
    return np.asarray(dynamic(family.omega + distances, left_out=pole_mask) - pole_part)


def draw_limits(axis: Axes, coupling: Coupling) -> None:
    """Frequencies of the modes that move the cart, as its mass goes from 0 to ∞; of a crowd the band that holds them.

    Between two neighbouring poles there is one of them whatever the cart's mass, so that a band of poles holds all but
    those beyond its ends, which are drawn.
    """
    poles, cart_mass = coupling.dynamic.omega, coupling.dynamic.cart if coupling.on_cart else np.inf
    low, high = _masses(coupling, cart_mass)
    masses = np.geomspace(low, high, SOLVED_POINTS)
    omega = coupling.omega_of_carts(masses)
    light = np.array([mode.light for mode in coupling.cart_modes])
    now = np.array([mode.omega for mode in coupling.cart_modes]) if coupling.on_cart else poles
    spot, crowd = float(np.clip(cart_mass, low, high)), is_crowded(coupling)
    bottom, top, is_logarithmic = _reach(poles, now, omega, light)
    right = 1.5 * high  # the dots of a fixed support are within
    axis.set(xscale="log", xlim=(low, right), yscale="log" if is_logarithmic else "linear", ylim=(bottom, top))
    axis.set(xlabel=CART_MASS, ylabel="angular frequency ω (rad/s)")
    if is_logarithmic:
        log_ticks(axis.yaxis, top / bottom)
    chosen = np.arange(omega.shape[1])
    if crowd:
        chosen = np.flatnonzero(((omega > poles[-1]) | (omega < poles[0])).any(axis=0))
        axis.axhspan(poles[0], poles[-1], color=pole(), alpha=BAND_OPACITY, lw=0)
        n_between = omega.shape[1] - len(chosen)
        words = f"band: {len(poles)} poles" + (
            f", with {n_between} modes that move the cart between them" if n_between else ""
        )
        axis.text(0.98, 0.92, words, transform=axis.transAxes, ha="right", va="top", fontsize=SMALL, bbox=plain())
    else:
        axis.hlines(poles, low, right, color=pole(), ls=MARKED, lw=1.2 * _thinner(len(poles)))
    axis.plot(masses, omega[:, chosen], color=zero(), lw=1.6 * _thinner(len(chosen)))
    _mark_scene(axis, cart_mass, spot, now[chosen[chosen < len(now)]])
    if not crowd:
        limits = [(low, value, f"{value:.5g}") for value in light[np.isfinite(light)].tolist()]
        _annotate(axis, limits, zero(), (4, 4), "data")
        letters = [(right, value, _letter(coupling, value)) for value in poles.tolist()]
        _annotate(axis, letters, pole(), (5, -3), "data")
    axis.set_title("massless cart  ←  modes that move the cart, as its mass changes  →  fixed support")


def _reach(poles: Floats, now: Floats, omega: Floats, light: Floats) -> tuple[float, float, bool]:
    """Both ends of the frequency axis of the limits and whether it is logarithmic.

    They hold all poles, the scene's own modes and the finite limits of a light cart; where a mode of a light cart has
    no limit, the axis goes as far as it rises, up to three times the highest of these.
    """
    bottom, top, is_logarithmic = span(np.concatenate([poles, now, light[np.isfinite(light)]]), poles)
    frequencies = np.concatenate((poles, now))
    lowest = float(min(frequencies.min(), omega.min()))
    if omega.max() > top:
        top = min(float(omega.max()) * 1.05, 3 * float(frequencies.max()))
    is_logarithmic = is_logarithmic or (top > LOG_RATIO * lowest and not _fits_linear(poles))
    room = 0.12 * (top - lowest)
    return (lowest / 1.5 if is_logarithmic else max(0.0, bottom, lowest - room)), top, is_logarithmic


def _masses(coupling: Coupling, cart_mass: float) -> tuple[float, float]:
    """Cart masses (kg) from far below to far above that of the pendula, the scene's own included."""
    hanging = coupling.dynamic.with_cart(0.0).at_rest
    low, high = hanging * 1e-3, hanging * 1e3
    return (min(low, cart_mass / 10), max(high, cart_mass * 10)) if 0 < cart_mass < np.inf else (low, high)


def _mark_scene(axis: Axes, cart_mass: float, spot: float, now: Floats) -> None:
    """The scene's own cart, and its frequencies as dots."""
    where = "a massless cart" if cart_mass == 0 else "a fixed support" if np.isinf(cart_mass) else f"{cart_mass:.6g} kg"
    late = spot > np.sqrt(np.prod(axis.get_xlim()))
    axis.axvline(spot, color=ink(), lw=1.2, ls=MARKED)
    if now.size:
        spots = np.full(len(now), spot)
        axis.plot(spots, now, "o", color=zero(), mec=paper(), mew=0.8, zorder=4)
    look: dict[str, Any] = {"ha": "right" if late else "left", "fontsize": SMALL, "bbox": plain()}
    offset, coordinates = (-5 if late else 5, 6), axis.get_xaxis_transform()
    axis.annotate(f"this scene: {where}", (spot, 0.0), offset, coordinates, "offset points", **look)


def draw_levels(axis: Axes, coupling: Coupling, is_logarithmic: bool) -> None:
    """Frequencies of pendula alone, of the scene, and of the structure alone, joined where one becomes another."""
    left, right = (0.0, 0.9), (3.1, 4.0)
    middle = (1.6, 2.4)
    labels: dict[str, list[tuple[float, str]]] = {"left": [], "middle": [], "right": []}
    for r, family in enumerate(coupling.families):
        axis.plot(left, [family.omega] * 2, color=colour(0), lw=1.8)
        labels["left"].append((family.omega, rf"ω$_\mathrm{{{family_name(r)}}}$ {family.omega:.5g}"))
        if family.still:
            _level(axis, middle, family.omega, left[1], family.omega, colour(0))
            words = f"{family.omega:.5g}" + (f" × {family.still}" if family.still > 1 else "") + ", nothing else moves"
            labels["middle"].append((family.omega, words))
        for branch in family.branches:
            _level(axis, middle, branch.omega, left[1], family.omega, colour(0))
            labels["middle"].append((branch.omega, f"{branch.omega:.5g}"))
    structure_pairs = zip(coupling.structure_modes, _structure_matches(coupling), strict=True)
    for (omega, _), s in structure_pairs:
        _level(axis, middle, omega, right[0], coupling.modes[s].omega, colour(1))
        labels["middle"].append((omega, f"{omega:.5g}"))
    for s, mode in enumerate(coupling.modes):
        axis.plot(right, [mode.omega] * 2, color=colour(1), lw=1.8)
        labels["right"].append((mode.omega, f"s{s + 1} {mode.omega:.5g}"))
    axis.set(
        xlim=(-0.75, 4.75 if coupling.modes else 3.2),
        ylabel="angular frequency ω (rad/s)",
        yscale="log" if is_logarithmic else "linear",
    )
    axis.margins(y=0.08)
    places = {"left": (left[0] - 0.05, "right"), "middle": (2.45, "left"), "right": (right[1] + 0.05, "left")}
    for column, (x, ha) in places.items():
        _words(axis, labels[column], x, ha)
    axis.set_xticks([0.45, 2.0, 3.55][: 3 if coupling.modes else 2])
    axis.set_xticklabels(["pendula alone", "the scene", "the structure alone"][: 3 if coupling.modes else 2])
    axis.grid(visible=False)
    if coupling.modes:
        axis.set_title("frequencies", loc="left")


def _level(axis: Axes, middle: tuple[float, float], omega: float, side: float, start: float, hue: str) -> None:
    """A level of the scene, and the line to its origin."""
    axis.plot(middle, [omega] * 2, color=colour(4), lw=1.8, zorder=3)
    end = middle[0] if side < middle[0] else middle[1]
    axis.plot([side, end], [start, omega], color=mixture(hue, 0.55), lw=0.9, gid=QUIET, zorder=1)


def _structure_matches(coupling: Coupling) -> list[int]:
    """The structure's own mode that each mode of the scene that belongs to it is mostly of, none twice."""
    candidates, matches = set(range(len(coupling.modes))), list[int]()
    for _, motion in coupling.structure_modes:
        energy: Floats = np.array([mode.mass for mode in coupling.modes]) * motion**2
        best = max(candidates, key=lambda s, energy=energy: float(energy[s]))  # type: ignore[misc]
        candidates.remove(best)
        matches.append(best)
    return matches


def _words(axis: Axes, labels: list[tuple[float, str]], x: float, ha: str) -> None:
    """Words next to levels, pushed apart where they would touch; a drift stands at the lower end."""
    axis.set_ylim(axis.get_ylim())
    transform, linear = axis.transScale + axis.transLimits, axis.get_yscale() == "linear"
    labels = sorted(labels)
    places = [float(transform.transform((x, omega))[1]) if omega or linear else 0.0 for omega, _ in labels]
    room, highest = 3 / 2 * float(em_of(axis)[1]), 1.0  # of a line of words
    for k in range(1, len(places)):
        places[k] = max(places[k], places[k - 1] + room)
    for k in reversed(range(len(places))):
        places[k] = min(places[k], highest)
        highest = places[k] - room
    box = {"facecolor": paper(), "edgecolor": "none", "pad": 0.8}
    for place, (_, words) in zip(places, labels, strict=True):
        look: dict[str, Any] = {"ha": ha, "va": "center", "fontsize": SMALL, "bbox": box, "zorder": 4}
        axis.text(x, place, words, transform=axis.get_xaxis_transform(), **look)
