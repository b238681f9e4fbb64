"""Pictures of ensembles: basins of attraction, Poincaré sections, uncertainty bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from modal.plotting.layout import headline, key, legend
from modal.plotting.style import (
    BAND_OPACITY,
    HUES,
    LOG_RATIO,
    colour,
    dot_size,
    mixture,
    rest,
    stack,
    thickness,
)
from modal.scene import number_words, title_of
from modal.scene.signal_names import symbols_in
from modal.types import Floats, Ints
from nonlinear.plotting.sweeps import colours_of, draw_map, draw_shades, label

if TYPE_CHECKING:
    from nonlinear.ensembles import Basins, PoincareSection
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
