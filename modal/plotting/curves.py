"""Curves of one panel, drawn so that each is visible.

Those that coincide are named together or are stripes of both colours; one that swings faster than a line can show is
the band between its least and its largest values.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba

from modal.plotting.layout import even_choice
from modal.plotting.style import BAND_OPACITY, colour, spots, thickness
from modal.types import Booleans, Floats, Ints

CURVE_GAP_MAX = 0.004
"""Format: largest distance of curves that coincide over the range of all: less than the width of a line."""
STRIPE = 3.5
"""Format: length of a stripe in points."""
SLOTS = {1: (1, 2), 2: (0, 4), 3: (1, 4), 4: (2, 8), 5: (3, 8)}
"""By how many curves lie below: the place of a stripe and the length of the pattern, in stripes; no pattern hides all
of another."""
GROUP_LETTERS = 30
"""Format: most letters of the names of curves that coincide, before "… (7 more) coincide"."""
NUMBERS = re.compile(r"\d+|[₀-₉]+(?=,)|(?<=,)[₀-₉]+|[₀-₉]")
PLAIN_DIGITS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
BAND_HEIGHT_MIN = 0.04
"""Format: least height of a band over the panel's; a curve within less is a broad line and no blob."""
COLUMN_SAMPLES = 8
"""Format: samples in each column of a band on an average; with fewer its ends would be a matter of chance."""
RANGE = "least to most"
"""The legend's entry for a band."""


def coinciding(curves: Floats, limit: float = inf) -> list[list[int]]:
    """Curves (K, T) in groups of those that coincide with the first of their group, in the order of the first.

    The search ends where there are more groups than `limit`.
    """
    samples = np.asarray(curves, dtype=np.float64)
    finite_values = samples[np.isfinite(samples)]
    room = CURVE_GAP_MAX * float(np.ptp(finite_values)) if finite_values.size else 0.0
    samples, remainder = np.nan_to_num(samples, nan=np.inf), np.arange(len(samples))
    groups: list[list[int]] = []
    while len(remainder) and len(groups) <= limit:
        with np.errstate(invalid="ignore"):
            distances = np.where(
                samples[remainder] == samples[remainder[0]], 0.0, np.abs(samples[remainder] - samples[remainder[0]])
            )
        alike = distances.max(axis=1, initial=0.0) <= room
        groups.append(remainder[alike].tolist())
        remainder = remainder[~alike]
    return groups


def common_name(names: Sequence[str]) -> str:
    """One name for curves that coincide: "pendula 1–3, 7 coincide"."""
    if len(names) < 2:
        return names[0]
    runs = _runs(names)
    text = runs[0].replace("pendulum ", "pendula ")
    for k, word in enumerate(runs[1:], 1):
        if len(text) + len(word) > GROUP_LETTERS:
            return f"{text}, … ({len(runs) - k} more) coincide"
        text += f", {word}"
    return f"{text} coincide"


def _runs(names: Sequence[str]) -> list[str]:
    """Names that differ in one number as ranges of it, with the common prefix once."""
    parts = [
        (NUMBERS.split(name), [int(number.translate(PLAIN_DIGITS)) for number in NUMBERS.findall(name)])
        for name in names
    ]
    numbers = {len(labels) for _, labels in parts}
    if len({tuple(words) for words, _ in parts}) > 1 or numbers == {0}:
        return list(names)
    table = np.array([labels for _, labels in parts])
    columns = np.flatnonzero(np.ptp(table, axis=0) > 0)
    if len(columns) != 1:
        return list(names)
    breaks = np.flatnonzero(np.diff(table[:, columns[0]]) != 1) + 1
    place = [labels.span() for labels in NUMBERS.finditer(names[0])][columns[0]]
    head = names[0][: place[0]]
    prefix = head if head.endswith(" ") else ""
    labels = []
    for members in np.split(np.arange(len(names)), breaks):
        ends = [names[members[0]], names[members[-1]]][: len(members)]
        labels.append("–".join(end.removeprefix(prefix) for end in ends))
    return [prefix + labels[0], *labels[1:]]


def pick(curves: Floats, names: Sequence[str], limit: int) -> tuple[Ints, list[str], int]:
    """Which of the curves (K, T) to draw, their names, and how many curves these stand for.

    One of each group that coincides, where there are at most `limit` groups, else `limit` curves evenly spaced.
    """
    groups = coinciding(curves, limit)
    if len(groups) > limit:
        indices = even_choice(len(curves), limit)
        groups = [[int(indices[k]) for k in group] for group in coinciding(curves[indices])]
    labels = [common_name([names[k] for k in group]) for group in groups]
    return np.array([group[0] for group in groups], dtype=np.int64), labels, sum(map(len, groups))


def draw_curves(
    axis: Axes,
    curves: Sequence[tuple[Floats, Floats]],
    *,
    names: Sequence[str] = (),
    numbers: Sequence[int] = (),
    first: float = 2.3,
    log: str = "",
    bands: bool = False,
    **style: Any,
) -> bool:
    """Curves (x, y) in the colours of their numbers, as stripes where they are upon those drawn before.

    Up to six curves on the same place all show; a legend shows each as a solid line.  `log` names the axes to be read
    as logarithmic, "x" or "y" or "xy"; `style` goes to `Axes.plot`.  With `bands`, curves that would be blobs over
    ascending x are bands, as their names say.  Returns whether there is a band.
    """
    size = _size(axis)
    scaled_curves = [(_scaled_values(x, log="x" in log), _scaled_values(y, log="y" in log)) for x, y in curves]
    ends = [(np.nanmin(y), np.nanmax(y)) for _, y in scaled_curves if np.isfinite(y).any()] if bands else []
    extent = max((high for _, high in ends), default=0.0) - min((low for low, _ in ends), default=0.0)
    extent = max(extent, float(np.ptp(axis.get_ylim()))) if axis.has_data() and "y" not in log else extent
    numbers = numbers or range(len(curves))
    widths = [float(style.get("lw", thickness(number, first))) for number in numbers]
    dense = [bands and is_blob(y, size[0] / width, extent) for (_, y), width in zip(scaled_curves, widths, strict=True)]
    places_of_lines = iter(
        _places([curve for curve, is_dense in zip(scaled_curves, dense, strict=True) if not is_dense], size)
    )
    places = [np.zeros((2, 0)) if is_dense else next(places_of_lines) for is_dense in dense]
    cells = [_cells(place, size) for place in places]
    for k, (x, y) in enumerate(curves):
        number = numbers[k]
        if dense[k]:
            edges, low, high = envelope(x, scaled_curves[k][1], size[0])
            bounds = (np.exp(low), np.exp(high)) if "y" in log else (low, high)
            hue, label = (
                style.get("color", colour(number)),
                f"{names[k]}: {RANGE}" if names and names[k] else f"_{RANGE}",
            )
            face = to_rgba(hue, BAND_OPACITY)
            axis.fill_between(edges, *bounds, facecolor=face, edgecolor=hue, lw=0.7, label=label)
            continue
        upon = _upon(places[k], cells[:k], size)
        shared_cells = _cell_numbers(places[k][:, upon], size)
        n_below = (
            sum(2 * int(np.isin(shared_cells, other_cells).sum()) >= len(shared_cells) for other_cells in cells[:k])
            if upon.any()
            else 0
        )
        width = thickness(number, first)
        unit, (slot, period) = STRIPE / width, SLOTS.get(n_below, (0, 1))
        broken = ((period - slot) * unit, (unit, (period - 1) * unit))
        marks = {"ms": style["ms"] / 2**n_below} if "ms" in style else {}
        look: dict[str, Any] = {"color": colour(number), "lw": width, **style, **marks}
        label = names[k] if names else f"_{k}"
        if period == 1 or not upon.any():
            axis.plot(x, y, label=label, **look, **spots(number, places[k].sum(0)))
            continue
        free = _widen(~upon)
        axis.plot(x, np.where(free, y, np.nan), label=label, **look, **spots(number, places[k][:, free].sum(0)))
        dashes = {"ls": broken, "dash_capstyle": "butt", **spots(number, places[k][:, upon].sum(0))}
        axis.plot(x, np.where(upon, y, np.nan), label=f"_{label}", **look, **dashes)
    return any(dense)


def _size(axis: Axes) -> tuple[int, int]:
    """The width and the height of an axis in points, nearly: it has its place before the figure is laid out."""
    inches = np.array(axis.get_window_extent().size) / axis.figure.dpi
    width, height = np.maximum(np.rint(72 * inches), 2).astype(int)
    return int(width), int(height)


def is_blob(y: Floats, columns: float, extent: float) -> bool:
    """Whether a curve turns more than twice in each of this many columns, and not only by a trifle.

    `extent` is the height of the panel in the units of the curve.
    """
    finite_values = np.asarray(y, dtype=np.float64)[np.isfinite(y)]
    way = np.sign(np.diff(finite_values))
    way = way[way != 0]
    if np.count_nonzero(way[1:] != way[:-1]) <= 2 * columns:
        return False
    _, low, high = envelope(np.arange(len(finite_values), dtype=np.float64), finite_values, int(columns))
    return bool(np.median(high - low) > BAND_HEIGHT_MIN * extent)


def envelope(x: Floats, y: Floats, columns: int) -> tuple[Floats, Floats, Floats]:
    """The edges (C + 1,) of at most this many columns of ascending x, and below and above all samples there.

    Straight lines between the edges have every sample between them.
    """
    is_finite = np.isfinite(x) & np.isfinite(y)
    x, y = np.asarray(x)[is_finite], np.asarray(y)[is_finite]
    count = max(1, min(columns, len(x) // COLUMN_SAMPLES))
    edges = np.linspace(x[0], x[-1], count + 1)
    column = np.clip(np.searchsorted(edges, x, "right") - 1, 0, count - 1)
    bounds = []
    for extremum in (np.minimum, np.maximum):
        ends = np.full(count, np.nan)
        ends[column] = y
        extremum.at(ends, column, y)
        filled_columns = np.flatnonzero(np.isfinite(ends))
        ends = np.interp(np.arange(count), filled_columns, ends[filled_columns])
        bounds.append(extremum(np.append(ends[:1], ends), np.append(ends, ends[-1:])))
    return edges, bounds[0], bounds[1]


def _scaled_values(values: Floats, *, log: bool) -> Floats:
    finite_values = np.where(np.isfinite(values), values, np.nan)
    return np.log(np.where(finite_values > 0, finite_values, np.nan)) if log else finite_values


def _places(curves: Sequence[tuple[Floats, Floats]], size: tuple[int, int]) -> list[Floats]:
    """The points of curves in cells of their panel, (2, T) each."""
    points = [np.stack(np.broadcast_arrays(*curve)) for curve in curves]
    finite_points = [curve[:, np.isfinite(curve).all(0)] for curve in points]
    all_points = np.concatenate(finite_points, axis=1) if finite_points else np.zeros((2, 0))
    if not all_points.size:
        return points
    low, extent = all_points.min(1, keepdims=True), np.maximum(np.ptp(all_points, axis=1, keepdims=True), 1e-300)
    return [(curve - low) / extent * (np.array([size]).T - 1) for curve in points]


def _cell_numbers(place: Floats, size: tuple[int, int]) -> Ints:
    """The number of the cell of each point; −1 where it is not finite."""
    is_finite = np.isfinite(place).all(axis=0)
    x, y = np.round(np.where(is_finite, place, 0.0)).astype(np.int64)
    return np.where(is_finite, x * size[1] + y, -1)


def _cells(place: Floats, size: tuple[int, int]) -> Ints:
    """The cells through which a curve goes."""
    points = place[:, np.isfinite(place).all(axis=0)]
    if not points.size:
        return np.zeros(0, dtype=np.int64)
    path = _path_lengths(points)
    fine = np.linspace(0.0, path[-1], int(min(2 * path[-1], size[0] * size[1])) + 2)
    return np.unique(_cell_numbers(np.stack([np.interp(fine, path, row) for row in points]), size))


def _path_lengths(points: Floats) -> Floats:
    """The way along a curve to each of its points, in cells."""
    steps = np.nan_to_num(np.linalg.norm(np.diff(points, axis=1), axis=0))
    return np.concatenate(([0.0], np.cumsum(steps)))


def _upon(place: Floats, others: Sequence[Ints], size: tuple[int, int]) -> Booleans:
    """Where a curve is upon others for a while, which excludes crossings."""
    if not others or not place.shape[1]:
        return np.zeros(place.shape[1], dtype=bool)
    upon = np.isin(_cell_numbers(place, size), np.concatenate(others))
    path = _path_lengths(place)
    # A gap shorter than a stripe is none, and what is shorter than a whole pattern of stripes is a crossing.
    for kind, awhile in ((False, STRIPE), (True, 4 * STRIPE)):
        breaks = np.flatnonzero(np.diff(upon)) + 1
        for members in np.split(np.arange(len(upon)), breaks):
            extent = path[min(members[-1] + 1, len(path) - 1)] - path[max(members[0] - 1, 0)]
            if upon[members[0]] == kind and extent < awhile and len(members) < len(upon):
                upon[members] = not kind
    return upon


def _widen(where: Booleans) -> Booleans:
    """The same and the points next to, so that pieces of a curve meet."""
    wider = where.copy()
    wider[1:] |= where[:-1]
    wider[:-1] |= where[1:]
    return wider
