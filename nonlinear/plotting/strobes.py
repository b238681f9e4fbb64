"""Pictures of stroboscopic sections and bifurcation diagrams of driven scenes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.plotting.layout import headline, set_values
from modal.plotting.style import colour, dot_size, stack
from modal.scene import title_of
from modal.scene.signal_names import symbols_in
from nonlinear.ensembles import BifurcationDiagram, StroboscopicSection


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
