"""Pictures of ensembles: basins of attraction, sections, bifurcation diagrams, maps of rhythms, uncertainty bands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from modal.plotting.layout import headline, key, legend, set_values
from modal.plotting.style import (
    BAND_OPACITY,
    HUES,
    LOG_RATIO,
    colour,
    dot_size,
    ink,
    mixture,
    paper,
    rest,
    secondary_colour,
    stack,
    thickness,
)
from modal.scene import number_words, title_of
from modal.scene.signal_names import symbols_in
from modal.types import Floats, Ints
from nonlinear.ensembles import BifurcationDiagram, StroboscopicSection
from nonlinear.plotting.sweeps import colours_of, draw_map, draw_shades, edges, label, outline

if TYPE_CHECKING:
    from nonlinear.ensembles import Basins, PoincareSection, RhythmGrid, RhythmMap
    from nonlinear.sweeps import Spread

TITLES = {
    "first_turn_s": "when a link first turns over the top",
    "lyapunov_per_s": "how fast a small error grows",
    "attractor": "which attractor each start ends in",
}


def basins_figure(basins: Basins) -> Figure:
    """The measure over both numbers: a colour each for attractors, else shades; others stay blank."""
    figure, (axis,) = stack(1, 2)
    scene = basins.ensemble.question.scene
    (_kinds if basins.names else _shades)(figure, axis, basins)
    words = TITLES.get(basins.column, label(basins.column))
    headline(figure, title_of(scene), f"{words}, within {basins.duration:.4g} s")
    return figure


def _kinds(figure: Figure, axis: Axes, basins: Basins) -> None:
    hues, shares = [rest(), *(colour(k) for k in range(len(basins.names) - 1))], basins.shares()
    draw_map(axis, basins.ensemble.question.scene, basins.axes, basins.values, **colours_of(hues))
    handles = [
        Patch(color=hue, label=f"{name}: {100 * shares[name]:.3g} %")
        for hue, name in zip(hues, basins.names, strict=True)
    ]
    key(figure, handles, columns=min(3, len(hues)))


def _shades(_: Figure, axis: Axes, basins: Basins) -> None:
    is_turn = basins.column == "first_turn_s"
    # some begin at the top, and would take all colours
    lowest = np.nanmax(basins.values, initial=0.0) / (2 * LOG_RATIO) if is_turn else -np.inf
    scene = basins.ensemble.question.scene
    draw_shades(axis, scene, basins.axes, basins.values, label(basins.column), lowest=lowest)
    if is_turn:
        axis.patch.set_hatch("")


def section_figure(section: PoincareSection) -> Figure:
    """Every crossing as a dot, a shade for each motion, the darker the faster its first crossing; closed curves joined.

    A regular motion crosses on one closed curve, or on a ring of them.
    """
    figure, (axis,) = stack(1, 2)
    angle, rate = section.points()
    orbits = [section.orbit == number for number in range(section.ensemble.size)]
    places = np.column_stack((angle, rate))
    extent = np.maximum(np.ptp(places, axis=0), np.finfo(float).tiny) if len(places) else np.ones(2)
    first_rates = np.array([rate[crosses][0] if crosses.any() else 0.0 for crosses in orbits])
    ranks = first_rates.argsort().argsort()
    for rank, crosses in zip(ranks.tolist(), orbits, strict=True):
        hue = mixture(colour(0), 0.25 + 0.75 * (rank + 1) / len(orbits))
        axis.plot(*places[crosses].T, ".", ms=dot_size(len(places)), mew=0, color=hue)
        for loop in closed_curves(places[crosses] / extent):
            axis.plot(*(loop * extent).T, color=hue, lw=0.8)
    name = symbols_in(section.shown)
    unit = ("m", "m/s") if section.shown == "x" else ("°", "°/s")
    axis.set(xlabel=f"{name} ({unit[0]})", ylabel=f"rate of {name} ({unit[1]})")
    words = f"Poincaré section at {_crossing(section.coordinate)}, energy {section.energy:.4g} J"
    headline(figure, title_of(section.ensemble.question.scene), words)
    return figure


def closed_curves(crossings: Floats, *, islands: int = 12, longest: int = 200) -> list[Floats]:
    """The closed curves (K + 1, 2) on which successive crossings (C, 2) lie in turn; none of an irregular motion.

    Up to `islands` islands are looked for, and at most the `longest` part of each is drawn.  On one curve crossing n is
    at the phase nρ, by which they are in order; on two every other one, and so on.
    """
    for count in range(1, islands + 1):
        curves = []
        for start in range(count):
            order = _order_along(crossings[start::count][:longest])
            if order is None:
                break
            curves.append(crossings[start::count][[*order, order[0]]])
        if len(curves) == count:
            return curves
    return []


def _order_along(places: Floats, *, fewest: int = 16, largest_step: float = 0.3) -> Ints | None:
    """The order of places (K, 2) along the closed curve that they follow with one rotation number; None without one.

    Neighbours are nearer than the largest step, over the diagonal of all; of places without an order some are not.
    """
    count = len(places)
    if count < fewest or not np.ptp(places, axis=0).any():
        return None
    offsets = places - places.mean(0)
    size = np.abs(np.fft.fft(np.hanning(count) * (offsets[:, 0] + 1j * offsets[:, 1]), 8 * count))
    peaks = np.flatnonzero((size > np.roll(size, 1)) & (size >= np.roll(size, -1)))
    strongest = peaks[np.argsort(-size[peaks])[:4]] if len(peaks) else np.zeros(1, dtype=np.int64)
    rotations = (strongest[:, None] + np.linspace(-1.0, 1.0, 2 * count + 1)).ravel() / (8 * count)
    orders = np.argsort(np.arange(count) * rotations[:, None] % 1.0, axis=1)
    along = places[orders]
    steps = np.linalg.norm(along - np.roll(along, 1, axis=1), axis=2)
    best = int(steps.sum(1).argmin())
    diagonal = float(np.linalg.norm(np.ptp(places, axis=0)))
    return orders[best] if steps[best].max() <= largest_step * diagonal else None


def _crossing(text: str) -> str:
    name, sign, value = next(text.partition(mark) for mark in "<>=" if mark in text)
    way = {">": " upwards", "<": " downwards"}.get(sign, "")
    symbol = symbols_in(name.strip())
    return f"{symbol} = {value.strip()}{' m' if symbol == 'x' else '°'}{way}"


def spread_figure(spread: Spread) -> Figure:
    """The deviation of every frequency with its cause, and above it bands of the motion if there is one."""
    motion = spread.ensemble is not None
    figure, panels = stack(1 + motion)
    if motion:
        _bands(panels[0], spread)
    _deviations(panels[-1], spread)
    headline(figure, title_of(spread.scene), f"spread of {spread.size} members")
    return figure


def _bands(axis: Axes, spread: Spread) -> None:
    for link in range(min(spread.scene.n_links, HUES)):
        low, middle, high = spread.bands[..., link]
        axis.fill_between(spread.times, low, high, color=colour(link), alpha=BAND_OPACITY, lw=0)
        words = f"link {link + 1}: median, 5 to 95 %"
        axis.plot(spread.times, middle, color=colour(link), lw=thickness(link), label=words)
    axis.set(xlabel="time (s)", ylabel="angle (°)", xlim=(0, spread.times[-1]))
    legend(axis, 2)


def _deviations(axis: Axes, spread: Spread) -> None:
    records = spread.frequencies[:HUES]
    at, bottom = np.arange(len(records)), np.zeros(len(records))
    deviation = np.array([record["standard_deviation_rad_per_s"] / record["omega_rad_per_s"] for record in records])
    for k, path in enumerate(spread.values):
        part = deviation * _parts(records, path)
        axis.bar(at, part, bottom=bottom, width=0.6, color=colour(k), label=number_words(spread.scene, path))
        bottom = bottom + part
    axis.set_xticks(at, [f"mode {record['mode']}\n{record['omega_rad_per_s']:.4g} rad/s" for record in records])
    axis.set(
        ylabel="relative standard deviation of ω (–)", ylim=(0, 1.3 * max(float(deviation.max(initial=0.0)), 1e-12))
    )
    axis.grid(visible=False, axis="x")
    legend(axis, 2, least_count=1)


def _parts(records: list[dict[str, dict[str, float]]], path: str) -> Floats:
    """The parts of each frequency's deviation, in proportion to the shares of its variance."""
    totals = [sum(record["shares"].values()) or 1.0 for record in records]
    return np.array([record["shares"][path] / total for record, total in zip(records, totals, strict=True)])


def strobes_figure(section: StroboscopicSection) -> Figure:
    """The rate of every named link over its angle, once a period, a colour for each motion."""
    figure, axes = stack(len(section.shown), 2 * len(section.shown))
    for axis, link in zip(axes, section.shown, strict=True):
        angles, rates = section.points(link)
        size = dot_size(angles.size)
        for number, (angle, rate) in enumerate(zip(angles, rates, strict=True)):
            axis.plot(angle, rate, ".", ms=size, mew=0, color=colour(number), rasterized=True)
        name = link_name(section, link)
        axis.set(xlabel=f"{name} (°)", ylabel=f"rate of {name} (°/s)")
        _turn(axis, "x", angles)
    words = f"stroboscopic section, once in {section.period:.4g} s at {section.phase_deg:g}° of the drives"
    headline(figure, title_of(section.ensemble.question.scene), words)
    return figure


def bifurcation_figure(diagram: BifurcationDiagram) -> Figure:
    """Draw the last stroboscopic angles of every named link over the varied parameter."""
    figure, axes = stack(len(diagram.shown), 1.5 * len(diagram.shown), sharex=True)
    for axis, link in zip(axes, diagram.shown, strict=True):
        values, angles = diagram.points(link)
        axis.plot(values, angles, ".", ms=dot_size(angles.size), mew=0, color=colour(0), rasterized=True)
        axis.set(ylabel=f"{link_name(diagram, link)} at {diagram.phase_deg:g}° of the drives (°)")
        _turn(axis, "y", angles)
    set_values(axes[-1], diagram.scene, diagram.variation, has_limits=False)
    headline(
        figure, title_of(diagram.scene), f"bifurcation diagram: the last {diagram.times.shape[1]} strobes of each value"
    )
    return figure


def link_name(strobes: StroboscopicSection | BifurcationDiagram, link: int) -> str:
    """Return the label of a link in figures: θ with its pendulum and number."""
    return symbols_in(strobes.system.labels[strobes.system.first + link])


def _turn(axis: Axes, which: str, angles: np.ndarray) -> None:
    """A whole turn where angles take more than three quarters of it, marked at quarters."""
    numbers = angles[np.isfinite(angles)]
    if numbers.size and np.ptp(numbers) > 3 * 90:
        axis.set(**{f"{which}lim": (-180, 180), f"{which}ticks": range(-180, 181, 90)})


def rhythm_figure(rhythms: RhythmMap) -> Figure:
    """The share of each rhythm along the number with its 95 % interval.

    Computed borders are vertical lines, thresholds of averaged equations dashed ones.
    """
    figure, (axis,) = stack(1, 2)
    values, names = np.array(rhythms.variation.values), rhythms.names
    for number, name in enumerate(names):
        shares = 100 * np.array(rhythms.shares(name))
        is_there = np.array([any(r.name == name for r in value.rhythms) for value in rhythms.values])
        ends = rhythms.intervals(name)
        axis.plot(
            values, np.where(is_there, shares, np.nan), "o-", ms=3, color=colour(number % HUES), clip_on=False, zorder=3
        )
        low, high = 100 * np.array(ends).T
        axis.fill_between(values, low, high, where=is_there, color=colour(number % HUES), alpha=0.2, lw=0)
        axis.vlines(values[is_there], low[is_there], high[is_there], color=colour(number % HUES), alpha=0.5, lw=1)
    undecided = 100 * np.array([value.undecided / rhythms.members for value in rhythms.values])
    handles = [Line2D([], [], marker="o", ms=3, color=colour(k % HUES), label=name) for k, name in enumerate(names)]
    if undecided.any():
        axis.plot(values, undecided, color=rest())
        handles.append(Line2D([], [], color=rest(), label="undecided"))
    axis.set(ylabel="starts (%)", ylim=(-3, 103), yticks=range(0, 101, 20))
    set_values(axis, rhythms.scene, rhythms.variation)
    marks = [
        (each.value, border_words([rhythms], each.name, each.kind, each.is_birth), "-")
        for each in rhythms.births
        if each.kind != "undecided"
    ]
    dashed = [(each.value, f"averaged: {each.words}", "--") for each in rhythms.averaged]
    _mark(axis, [*marks, *dashed])
    headline(figure, title_of(rhythms.scene), f"what {rhythms.members} starts at each value end in")
    key(figure, handles, columns=min(3, len(handles)))
    return figure


def border_words(maps: Sequence[RhythmMap], name: str, kind: str, is_birth: bool) -> str:
    """What happens to a rhythm at a border as the number grows: orbits may live on unstable, beats end."""
    if kind == "enclosed":
        return f"{name} {'begins' if is_birth else 'ends'} here (between two computed values)"
    row = next((row for row in maps if row.has_orbit(name)), maps[0])
    return f"{name} {row.change_words(name, kind, is_birth=is_birth)} ({kind})"


def _mark(axis: Axes, marks: Sequence[tuple[float, str, str]]) -> None:
    """Vertical lines with words above the axes, in the lowest row where they cover no others."""
    rows: list[list[tuple[float, float]]] = []
    for value, words, dashes in sorted(marks):
        axis.axvline(value, color=ink() if dashes == "-" else secondary_colour(), lw=0.9, ls=dashes)
        side = "right" if axis.transLimits.transform((value, 0))[0] > 0.5 else "left"
        text = axis.text(
            value,
            1,
            f" {value:.6g}: {words} ",
            transform=axis.get_xaxis_transform(),
            fontsize="small",
            ha=side,
            va="bottom",
        )
        low, high = text.get_window_extent().intervalx
        free = (row for row, spans in enumerate(rows) if all(low > end or high < begin for begin, end in spans))
        row = next(free, len(rows))
        if row == len(rows):
            rows.append([])
        rows[row].append((low, high))
        text.set_y(1.01 + 0.045 * row)


def grid_figure(grid: RhythmGrid) -> Figure:
    """A cell for each pair of numbers, divided from below by the shares of starts that end in each rhythm.

    The computed borders along each row are joined from row to row, in the colours of their rhythms.
    """
    figure, (axis,) = stack(1, 2)
    names = [*grid.names, "undecided"]
    hues = [*(colour(k % HUES) for k in range(len(grid.names))), rest()]
    first, second = grid.axes
    x, y = (np.clip(edges(each), min(each.values), max(each.values)) for each in (first, second))
    counts = [[[at.counts()[name] for name in names] for at in row.values] for row in grid.maps]
    shares = np.array(counts) / grid.maps[0].members
    for row, low, high in zip(shares, y[:-1], y[1:], strict=True):
        parts = np.pad(row.cumsum(axis=1), ((0, 0), (1, 0))).T
        heights = low * (high / low) ** parts if second.log else low + (high - low) * parts
        for bottom, top, hue in zip(heights[:-1], heights[1:], hues, strict=True):
            axis.bar(x[:-1], top - bottom, np.diff(x), bottom, align="edge", color=mixture(hue, 0.6), lw=0)
    axis.hlines(y[1:-1], x[0], x[-1], color=paper(), lw=2)
    axis.vlines(x[1:-1], y[0], y[-1], color=paper(), lw=2)
    set_values(axis, grid.scene, first)
    set_values(axis, grid.scene, second, "y")
    axis.grid(visible=False)
    handles: list[Patch | Line2D] = [
        Patch(color=mixture(hues[k], 0.6), label=names[k]) for k in np.flatnonzero(shares.any(axis=(0, 1))).tolist()
    ]
    for (name, kind, is_birth), chains in grid.borders().items():
        look: dict[str, Any] = {
            "color": hues[names.index(name)],
            "path_effects": outline(2.8),
            "marker": "o",
            "ms": 3.5,
        }
        for chain in chains:
            axis.plot(*np.array(chain).T, **look, clip_on=False, zorder=4)
        handles.append(Line2D([], [], **look, label=border_words(grid.maps, name, kind, is_birth)))
    headline(figure, title_of(grid.scene), f"what {grid.maps[0].members} starts at each point end in")
    notes = "each cell is divided by the shares of the starts; lines are computed along each row"
    key(figure, handles, columns=2, notes=notes.partition(";")[0] if not grid.borders() else notes)
    return figure
