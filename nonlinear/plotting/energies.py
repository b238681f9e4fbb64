"""Pictures of measures against energy: the median and band of random starts, and the chaotic fraction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.plotting.layout import legend, set_values
from modal.plotting.style import BAND_OPACITY, MARKED, colour, rest, stack
from nonlinear.chaos import regular_exponent, usual_duration
from nonlinear.plotting.sweeps import label
from nonlinear.sweeps import CHAOTIC, LYAPUNOV

if TYPE_CHECKING:
    from nonlinear.sweeps import Sweep

MEDIAN = "_median"


def energies_figure(sweep: Sweep) -> Figure:
    """A panel for every quantity: the median over the energy, from 5 to 95 % of the starts; and the chaotic share."""
    study = sweep.study
    (variation,) = study.variations
    medians = [name for name in sweep.columns if MEDIAN in name]
    shares = [name for name in sweep.columns if name == CHAOTIC]
    figure, axes = stack(len(medians) + len(shares), sharex=True)
    for axis, name in zip(axes, medians, strict=False):
        low, middle, high = (sweep.values(name.replace(MEDIAN, part)) for part in ("_q05", MEDIAN, "_q95"))
        axis.fill_between(
            variation.values, low, high, color=colour(0), alpha=BAND_OPACITY, lw=0, label="5 to 95 % of starts"
        )
        axis.plot(variation.values, middle, ".-", color=colour(0), label="median")
        if name.startswith(LYAPUNOV):
            _limit(axis, sweep)
        axis.set_ylabel(label(name.replace(MEDIAN, "")))
        legend(axis, 3)
    for axis, name in zip(axes[len(medians) :], shares, strict=True):
        axis.plot(variation.values, 100 * sweep.values(name), ".-", color=colour(1))
        axis.set(ylabel="chaotic starts (%)", ylim=(-3, 103))
    set_values(axes[-1], study.scene, variation, words="energy above rest (J)")
    return figure


def _limit(axis: Axes, sweep: Sweep) -> None:
    """Above which an exponent is too large for regular motion in this many seconds."""
    scene = sweep.study.scene
    (seconds,) = (request.number for request in sweep.study.measures if request.name == LYAPUNOV)
    limit = regular_exponent(scene, seconds or usual_duration(scene))
    axis.axhline(limit, color=rest(), lw=1.0, ls=MARKED, label="limit of regular motion")
