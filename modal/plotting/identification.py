"""Experimental modal analysis as pictures: stabilization, MAC matrix with frequency pairs, fitted modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from modal.plotting.layout import SMALL, TICKS_MAX, colour_bar, even_choice, headline, legend
from modal.plotting.style import (
    HUES,
    MARKED,
    WIDE,
    WIDTH,
    colour,
    ink,
    paper,
    rest,
    secondary_colour,
    sheet_of_rows,
    stack,
)
from modal.scene import title_of
from modal.types import Floats

if TYPE_CHECKING:
    from modal.identification import Assurance, Identified, ModeFit


def poles_figure(identification: Identified, title: str = "") -> Figure:
    """Poles over the order of the model, the stable ones filled, above the damping ratios with error bars."""
    figure, (top, bottom) = stack(2, sharex=True, height_ratios=(3, 2))
    for stable, face, words in ((False, "none", "new at this order"), (True, colour(0), "stable")):
        poles = [(pole.frequency, pole.order) for pole in identification.stabilization if pole.stable == stable]
        edge = colour(0) if stable else secondary_colour()
        top.plot(*np.reshape(poles, (-1, 2)).T, "o", ms=4.5, mfc=face, mec=edge, label=words)
    for mode in identification.modes:
        for axis in (top, bottom):
            axis.axvline(mode.frequency, color=colour(1), lw=1.0, zorder=0)
    names = ("frequency", "damping_ratio", "damping_ratio_std", "frequency_std")
    frequency, ratio, ratio_std, std = np.array(
        [[getattr(mode, name) for name in names] for mode in identification.modes]
    ).T
    look: dict[str, Any] = {"fmt": "o", "color": colour(1), "capsize": 3, "label": "mode ± 2 standard deviations"}
    bottom.errorbar(frequency, ratio, 2 * ratio_std, 2 * std, **look)
    top.set(ylabel="order of the model (–)", xlim=(0, 1.25 * max(frequency)))
    top.yaxis.set_major_locator(MaxNLocator(8, integer=True))
    low, high = bottom.get_ylim()
    bottom.set(xlabel="frequency (Hz)", ylabel="damping ratio (–)")
    legend(top, 2)
    bottom.set_ylim(min(0.0, low), high)
    legend(bottom, least_count=1)
    headline(figure, title, f"poles of {'free decays' if identification.excitation == 'free' else 'random responses'}")
    return figure


def assurance_figure(assurance: Assurance) -> Figure:
    """The MAC matrix in shades, where there are shapes, next to measured over computed frequencies."""
    has_shapes = bool(np.isfinite(assurance.mac).any())
    figure = sheet_of_rows(1, WIDE if has_shapes else WIDTH)
    panels = figure.subplots(1, 1 + has_shapes, squeeze=False)[0]
    if has_shapes:
        _matrix(panels[0], assurance)
    axis = panels[-1]
    computed_hertz = np.array([pair.frequency for pair in assurance.pairs])
    measured_hertz = np.array([pair.measured.frequency for pair in assurance.pairs])
    std = np.array([pair.measured.std for pair in assurance.pairs])
    limit = 1.1 * float(max(computed_hertz.max(), measured_hertz.max()))
    axis.plot([0, limit], [0, limit], color=secondary_colour(), ls=MARKED, label="equal")
    axis.errorbar(computed_hertz, measured_hertz, 2 * std, fmt="o", color=colour(0), capsize=3, label="pair ± 2 std")
    for pair in assurance.pairs:
        words = f"{100 * pair.error:+.2g} %"
        at = (pair.frequency, pair.measured.frequency)
        label_place = (
            {"ha": "right", "xytext": (-8, 4)} if pair.frequency > limit / 2 else {"ha": "left", "xytext": (8, -11)}
        )
        axis.annotate(words, at, textcoords="offset points", fontsize=SMALL, color=ink(), **label_place)
    axis.set(xlabel="computed frequency (Hz)", ylabel="measured frequency (Hz)", xlim=(0, limit), ylim=(0, limit))
    axis.legend(loc="upper left")
    headline(figure, title_of(assurance.modes.scene), "measured and computed modes")
    return figure


def _matrix(axis: Axes, assurance: Assurance) -> None:
    known_values: Floats = np.ma.masked_invalid(assurance.mac)
    mesh = axis.imshow(known_values, cmap="cividis", vmin=0, vmax=1, aspect="auto")
    columns, rows = ([str(mode.number) for mode in modes] for modes in (assurance.rows, assurance.measured.modes))
    axis.set_xticks(*_thin_ticks(columns))
    axis.set_yticks(*_thin_ticks(rows))
    axis.set(xlabel="computed mode (–)", ylabel="measured mode (–)")
    if max(assurance.mac.shape) <= TICKS_MAX:
        for r, row in enumerate(assurance.mac):
            for s, value in enumerate(row):
                if np.isfinite(value):
                    patch = {"facecolor": paper(), "edgecolor": "none", "pad": 1.5}
                    axis.text(s, r, f"{value:.2f}", ha="center", va="center", fontsize=SMALL, bbox=patch)
    colour_bar(axis, mesh, "MAC (–)")


def _thin_ticks(words: list[str], limit: int = TICKS_MAX) -> tuple[list[int], list[str]]:
    """Places and words of at most this many ticks."""
    places = even_choice(len(words), limit).tolist()
    return places, [words[k] for k in places]


def mode_fit_figure(fit: ModeFit) -> Figure:
    """Deviations of fitted from measured frequencies, and damping ratios, in standard deviations."""
    figure, (axis,) = stack(1)
    at = np.arange(len(fit.modes))
    axis.axhspan(-2, 2, color=rest(), alpha=0.5, lw=0)
    axis.axhline(0.0, color=secondary_colour(), lw=0.8)
    axis.plot(at, [mode.deviation for mode in fit.modes], "o", ms=8, color=colour(0), label="frequency")
    damped_modes = [(k, mode) for k, mode in enumerate(fit.modes) if mode.damping_ratio_std]
    if damped_modes:
        differences = [mode.damping_ratio - (mode.measured.damping_ratio or 0.0) for _, mode in damped_modes]
        ratios = np.array(differences) / [mode.damping_ratio_std or 1.0 for _, mode in damped_modes]
        places = [k for k, _ in damped_modes]
        axis.plot(places, ratios, "s", ms=6, mfc=paper(), mec=colour(1), mew=2, label="damping ratio")
    limit = max(3.0, 1.2 * max(abs(mode.deviation) for mode in fit.modes))
    names = [f"mode {mode.measured.number}\n{mode.measured.frequency:.4g} Hz" for mode in fit.modes]
    axis.set_xticks(*_thin_ticks(names, HUES))
    axis.set(ylabel="fitted − measured (standard deviations)", ylim=(-limit, limit), xlim=(-0.5, len(at) - 0.5))
    axis.legend(loc="upper right", ncols=2)
    words = f"fit to measured modes, chi-square {fit.chi_square:.3g} with {fit.freedom} degrees of freedom"
    headline(figure, title_of(fit.given), words)
    return figure
