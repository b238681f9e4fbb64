"""Ensembles as pictures: maps of where starts end, Poincaré sections, bands of what tolerances do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from modal.plotting import HUES, colour, headline, key, legend, mixture, rest, scale, thickness
from modal.plotting.style import BAND_OPACITY, LOG_RATIO, dot_size, sheet_of_rows
from modal.scene import number_label, number_words, title_of
from modal.scene.signal_names import symbols_in
from modal.types import Floats, Ints
from nonlinear.plotting.sweeps import edges, label

if TYPE_CHECKING:
    from nonlinear.ensembles import Basins, PoincareSection
    from nonlinear.sweeps import Spread

TITLES = {
    "configuration": "which rhythm each start ends in",
    "first_turn_s": "when a link first turns over the top",
    "lyapunov_per_s": "how fast a small error grows",
    "attractor": "which attractor each start ends in",
}


def basins_figure(basins: Basins) -> Figure:
    """The measure over both numbers: a colour each for configurations, else shades; what never happens stays blank."""
    figure = sheet_of_rows(2)
    axis = figure.subplots()
    scene, (y, x) = basins.ensemble.question.scene, basins.axes
    axis.patch.set(edgecolor=rest(), hatch="" if basins.column == "first_turn_s" else "////", lw=0)
    (_kinds if basins.names else _shades)(figure, axis, basins)
    scale(axis, "x", x)
    scale(axis, "y", y)
    axis.set(xlabel=number_label(scene, x.path), ylabel=number_label(scene, y.path))
    axis.grid(visible=False)
    words = TITLES.get(basins.column, label(basins.column))
    headline(figure, title_of(scene), f"{words}, within {basins.ensemble.question.duration:.3g} s")
    return figure


def _kinds(figure: Figure, axis: Axes, basins: Basins) -> None:
    y, x = basins.axes
    kinds = len(basins.names)
    hues = [rest(), *(colour(k) for k in range(kinds - 1))]
    norm = BoundaryNorm(np.arange(kinds + 1) - 0.5, kinds)
    values = np.ma.masked_invalid(basins.values)
    axis.pcolormesh(
        edges(x), edges(y), values, cmap=ListedColormap([to_rgb(hue) for hue in hues]), norm=norm, rasterized=True
    )
    shares = basins.shares()
    handles = [
        Patch(color=hue, label=f"{name}: {100 * shares[name]:.3g} %")
        for hue, name in zip(hues, basins.names, strict=True)
    ]
    key(figure, handles, columns=min(3, kinds))


def _shades(figure: Figure, axis: Axes, basins: Basins) -> None:
    y, x = basins.axes
    values = np.ma.masked_invalid(basins.values)
    numbers = values.compressed()
    if not numbers.size:
        return
    low, high = float(numbers.min()), float(numbers.max())
    if basins.column == "first_turn_s":
        low = max(low, high / (2 * LOG_RATIO))  # some begin at the top, and would take all colours
    ratio = low > 0 and high > LOG_RATIO * low
    norm = (LogNorm if ratio else Normalize)(low, high)
    mesh = axis.pcolormesh(edges(x), edges(y), values, norm=norm, rasterized=True, lw=0)
    bar = figure.colorbar(mesh, ax=axis, pad=0.02)
    bar.set_label(label(basins.column))
    bar.outline.set_visible(False)
    if ratio:
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_formatter("{x:g}")


def section_figure(section: PoincareSection) -> Figure:
    """Every crossing as a dot, a shade for each motion, the darker the faster its first crossing; closed curves joined.

    A regular motion crosses on one closed curve, or on a ring of them.
    """
    figure = sheet_of_rows(2)
    axis = figure.subplots()
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

    Up to so many `islands` are looked for, and at most the `longest` part of each is drawn.  On one curve crossing n is
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
    """The deviation of every frequency with what explains it, and above it bands of the motion where there is one."""
    motion = spread.ensemble is not None
    figure = sheet_of_rows(1 + motion)
    panels = np.atleast_1d(figure.subplots(1 + motion, 1))
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
    legend(axis, 2)


def _parts(records: list[dict[str, dict[str, float]]], path: str) -> Floats:
    """Of each frequency's deviation, in proportion to the shares of its variance."""
    totals = [sum(record["shares"].values()) or 1.0 for record in records]
    return np.array([record["shares"][path] / total for record, total in zip(records, totals, strict=True)])
