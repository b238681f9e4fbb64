"""Lengths and frequencies along a hoist as a picture."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

from matplotlib.figure import Figure

from modal.errors import ComputationError
from modal.plotting.layout import framed, headline, legend
from modal.plotting.style import MOST_CURVES, WIDTH, colour, save, sheet, spots
from modal.scene import title_of

if TYPE_CHECKING:
    from modal.statespace.hoisting import Along


def draw_hoist(along: Along, stream: IO[bytes], form: str = "png") -> None:
    """Write the picture as png, svg or pdf."""
    save(hoist_figure(along), stream, form)


def hoist_figure(along: Along) -> Figure:
    """The changing lengths (m), the angular frequencies (rad/s) and the adiabatic swing of every mode against time (s).

    Only lengths where no mode oscillates.  Raises ComputationError for more modes or lengths than one picture holds.
    """
    most = max(along.omega.shape[1], along.lengths.shape[1])
    if most > MOST_CURVES:
        raise ComputationError(f"{most} curves do not fit in a figure: at most {MOST_CURVES}")
    figure = sheet(WIDTH, 8.0)
    ropes = [f"pendulum {p + 1}, link {i + 1}" for p, i in along.links]
    modes = [f"mode {name}" for name in along.names]
    panels = [(along.lengths, ropes, "length (m)")]
    if modes:
        panels += [(along.omega, modes, "angular frequency ω (rad/s)"), (along.swing, modes, "relative swing (–)")]
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (values, names, words) in zip(axes, panels, strict=True):
        for k, name in enumerate(names):
            axis.plot(along.times, values[:, k], color=colour(k), label=name, **spots(k, values[:, k]))
        framed(axis, "time (s)" if axis is axes[-1] else "", words)
        axis.set_xlim(along.times[0], along.times[-1])
        legend(axis)
    headline(figure, title_of(along.scene), "along the hoist")
    return figure
