"""The right half of a film: how much energy every pendulum and the cart have, and how the whole goes through time."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from modal.plotting import SMALL, ink, shade
from modal.types import Floats
from nonlinear.plotting.scene import Energies

KINETIC, POTENTIAL = 0.8, 0.52  # how much of ink is in them
FEWEST, LETTERS = 6, 34
"""Bars that there is room for; letters that fit side by side under them."""


class Gauges:
    """Bars of kinetic under potential energy on one axis, the same of everything against time (s) on the other."""

    def __init__(self, bars: Axes, line: Axes, energies: Energies, times: Floats) -> None:
        self.energies, self.times = energies, times
        self.bars = _bars(bars, energies)
        self.lines, self.dot = _lines(line, energies, times)

    def show(self, frame: int) -> None:
        """Move everything to what it is in a frame."""
        kinetic, potential = self.energies.kinetic[frame], self.energies.potential[frame]
        for lower, upper, t, v in zip(*self.bars, kinetic, potential, strict=True):
            lower.set_height(t)
            upper.set(y=t, height=v)
        whole = self.energies.whole
        for drawn, values in zip(self.lines, (*whole, whole[0] + whole[1]), strict=True):
            drawn.set_data(self.times[: frame + 1], values[: frame + 1])
        self.dot.set_data(self.times[frame : frame + 1], [whole[0][frame] + whole[1][frame]])


def _dress(axis: Axes, title: str, pad: float) -> None:
    axis.grid(visible=False, axis="x")
    axis.tick_params(labelsize=SMALL, length=0)
    axis.yaxis.set_major_locator(MaxNLocator(4))
    axis.yaxis.set_major_formatter("{x:.4g}")
    axis.set_title(title, loc="left", pad=pad)


def _top(values: Floats) -> float:
    return 1.06 * float(values.max()) or 1.0


def _bars(axis: Axes, energies: Energies) -> tuple[list[Rectangle], list[Rectangle]]:
    kinetic, potential = energies.kinetic, energies.potential
    count = kinetic.shape[1]
    _dress(axis, "energy of each (J)", 5)
    lower = axis.bar(range(count), kinetic[0], 0.62, color=shade(KINETIC), label="kinetic")
    upper = axis.bar(range(count), potential[0], 0.62, bottom=kinetic[0], color=shade(POTENTIAL), label="potential")
    spare = max(FEWEST - count, 0) / 2
    axis.set(xlim=(-0.6 - spare, count - 0.4 + spare), ylim=(0, _top(kinetic + potential)))
    letters = sum(len(name) + 1 for name in energies.names)
    axis.set_xticks(range(count), energies.names)
    for label in axis.get_xticklabels():
        label.set_fontsize(float(label.get_fontsize()) * min(1.0, LETTERS / letters))
    return list(lower), list(upper)


def _lines(axis: Axes, energies: Energies, times: Floats) -> tuple[list[Line2D], Line2D]:
    kinetic, potential = energies.whole
    _dress(axis, "energy of all (J)", 17)
    looks = (("kinetic", KINETIC, "--"), ("potential", POTENTIAL, "-"), ("total", 1.0, "-"))
    drawn = [axis.plot([], [], dash, color=shade(part), label=name)[0] for name, part, dash in looks]
    dot = axis.plot([], [], "o", ms=4.5, color=ink())[0]
    span = max(float(times[-1] - times[0]), 1e-300)
    axis.set(xlim=(times[0], times[-1] + 0.03 * span), ylim=(0, 1.08 * _top(kinetic + potential)))
    axis.set_xlabel("time (s)", fontsize=SMALL, labelpad=1)
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.xaxis.set_major_formatter("{x:.4g}")
    axis.legend(
        fontsize=SMALL,
        ncols=3,
        loc="lower left",
        bbox_to_anchor=(-0.02, 0.985),
        borderpad=0.1,
        handlelength=1.2,
        columnspacing=1.0,
    )
    return drawn, dot
