"""Pictures of chaos: the convergence of a Lyapunov exponent, and exponents against links or cart mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from modal.plotting.layout import headline, legend
from modal.plotting.style import (
    BAND_OPACITY,
    MARKED,
    MOST_CURVES,
    PREDICTED,
    QUIET,
    WIDE,
    colour,
    secondary_colour,
    sheet_of_rows,
    stack,
)
from modal.scene import title_of

if TYPE_CHECKING:
    from nonlinear.chaos import Case, Exponent, Finding

    Rows = Sequence[tuple[Case, Exponent]]

MARKERS = ("o", "s", "D", "^")
CART_OFFSET_RATIO = 1.06
"""Format: factor by which series of carts are offset, to separate their error bars."""


def exponent_figure(exponent: Exponent) -> Figure:
    """λ against averaging time: each start, their mean with its interval, and the limit for regular motion."""
    figure, (axis,) = stack(1)
    times, running = exponent.running()
    since, mean = times - exponent.transient, running.mean(1)
    if exponent.ensemble > 1:
        axis.plot(since, running[:, :MOST_CURVES], color=colour(0), lw=0.6, alpha=0.4, gid=QUIET)
    axis.plot([], [], color=colour(0), lw=0.8, label="single starts")
    half, words = exponent.half_width, "95 % interval of the mean"
    axis.axhspan(exponent.value - half, exponent.value + half, color=colour(1), alpha=BAND_OPACITY, lw=0, label=words)
    axis.plot(since, mean, color=colour(1), lw=2.2, label=f"mean of {exponent.ensemble}: {exponent.equation}")
    axis.plot(
        since, exponent.regular(since), ls=PREDICTED, color=secondary_colour(), lw=1.4, label="limit for regular motion"
    )
    late = running[since > since[-1] / 10]
    low, high = float(min(late.min(), 0.0)), float(max(late.max(), 2 * exponent.floor))
    axis.set(xlim=(0, since[-1]), ylim=(low - 0.05 * (high - low), high * 1.08))
    axis.set(xlabel="averaging time T (s)", ylabel="growth of a small error, λ(T) (1/s)")
    legend(axis, columns=2)
    headline(figure, title_of(exponent.scene), "the largest Lyapunov exponent")
    return figure


def finding_figure(finding: Finding) -> Figure:
    """λ with its 95 % interval for every case; a hollow triangle is an upper bound."""
    return _DRAWN[finding.study.paper](finding)


def _chains(finding: Finding) -> Figure:
    figure = sheet_of_rows(1, WIDE)
    left, right = figure.subplots(1, 2)
    for k, (name, rows) in enumerate(finding.series().items()):
        links = [float(exponent.scene.n_links) for _, exponent in rows]
        rates = [(case.scene.gravity / case.scene.pendulum[0].links[0].length) ** 0.5 for case, _ in rows]  # sqrt(g/l)
        _points(left, links, rows, rates, k, name)
        _points(right, links, rows, [rate / n**0.5 for rate, n in zip(rates, links, strict=True)], k, name)
    left.set(title="links of one length l", ylabel="exponent λ √(l/g) (–)")
    right.set(title="one total length L, cut into more links", ylabel="exponent λ √(L/g) (–)")
    for axis in (left, right):
        axis.set(xlabel="number of links (–)", ylim=(-0.04 * axis.get_ylim()[1], None))
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.legend(loc="upper left")
    headline(figure, "Paper 001", f"{finding.study.claim}?")
    return figure


def _carts(finding: Finding) -> Figure:
    figure, (axis,) = stack(1)
    for k, (name, rows) in enumerate(finding.series().items()):
        fixed_support = next(exponent for case, exponent in rows if case.at is None)
        low, high = (fixed_support.value + sign * fixed_support.half_width for sign in (-1, 1))
        axis.axhspan(low, high, color=colour(k), alpha=BAND_OPACITY / 2, lw=0)
        axis.axhline(fixed_support.value, color=colour(k), ls=MARKED, lw=1.4)
        carts = [(case, exponent) for case, exponent in rows if case.at is not None]
        masses = [(case.at or 0.0) * CART_OFFSET_RATIO ** (k - 1) for case, _ in carts]
        _points(axis, masses, carts, [1.0] * len(carts), k, name)
    axis.plot([], [], ls=MARKED, color=secondary_colour(), lw=1.4, label="the same on a fixed support")
    axis.set(xscale="log", xlabel="cart mass (kg)", ylabel="exponent λ (1/s)", ylim=(0, None))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.legend(loc="lower right")
    headline(figure, "Paper 000", f"{finding.study.claim}?")
    return figure


_DRAWN = {"000": _carts, "001": _chains}


def _points(axis: Axes, at: Sequence[float], rows: Rows, units: Sequence[float], k: int, name: str) -> None:
    hue, marker = colour(k), MARKERS[k]
    triples = list(zip(at, (exponent for _, exponent in rows), units, strict=True))
    points = np.array([(x, e.value / unit, e.half_width / unit) for x, e, unit in triples if e.is_positive])
    bounds = np.array([(x, e.bound / unit) for x, e, unit in triples if not e.is_positive])
    if points.size:
        axis.errorbar(*points.T, color=hue, marker=marker, ms=5.5, lw=1.4, label=name)
    if bounds.size:
        axis.plot(*bounds.T, "v", color="none", mec=hue, mew=1.4, ms=7.0)
