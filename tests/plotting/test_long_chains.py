"""Mode shapes of long chains: scaled to one width, thin, and no more panels than are read; couplings of many poles."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from amounts import usually
from scipy.linalg import eigh
from seen import flaws

from modal import Bob, Cart, Pendulum, Scene, matrices, natural_modes
from modal.coupling import explain
from modal.plotting import USUAL_PANELS, coupling_figure, shapes_figure
from modal.plotting.shapes import AMPLITUDE_DEG, FEW_LINKS, SIDEWAYS
from modal.plotting.style import colour, theme


def chain(count: int, **support: object) -> Scene:
    links = [Bob(mass=1.0, length=1.0 / count, count=count)]
    return Scene(gravity=9.81, pendulum=[Pendulum(links=links)], **support)


@pytest.mark.parametrize("count", usually([10], [10, 21]))
def test_every_mode_of_a_long_chain_is_as_wide_and_is_the_shape_of_the_matrices(count: int) -> None:
    scene = chain(count)
    dense = matrices(scene)
    vectors = eigh(dense.K, dense.M)[1]
    with theme("light"):
        figure = shapes_figure(natural_modes(scene))
    drawn = figure.axes[: min(count, USUAL_PANELS)]
    assert len(figure.axes) == len(drawn)
    for k, axis in enumerate(drawn):
        (line,) = [line for line in axis.lines if line.get_color() == colour_of(0) and len(line.get_xydata()) > count]
        x, y = line.get_data()
        assert np.abs(x).max() == pytest.approx(SIDEWAYS)
        assert line.get_linewidth() <= 1.0
        assert y == pytest.approx(-np.arange(count + 1) / count)
        expected = np.cumsum(vectors[:, k]) / count
        expected *= SIDEWAYS / np.abs(expected).max()
        assert x[1:] == pytest.approx(expected * np.sign(expected @ x[1:]), abs=1e-9)
    assert count > 10 or flaws(figure) == []


@cache
def colour_of(k: int) -> str:
    with theme("light"):
        return colour(k)


def test_the_amplitude_scales_displacements_and_a_short_chain_is_drawn_by_its_angles() -> None:
    with theme("light"):
        small = shapes_figure(natural_modes(chain(FEW_LINKS + 1)), [0], amplitude_deg=AMPLITUDE_DEG / 5).axes[0]
        short = shapes_figure(natural_modes(chain(FEW_LINKS)), [0]).axes[0]
    widest = max(np.abs(line.get_xdata()).max() for line in small.lines if line.get_color() == colour_of(0))
    assert widest == pytest.approx(SIDEWAYS / 5)
    (line,) = [line for line in short.lines if line.get_color() == colour_of(0) and len(line.get_xydata()) > FEW_LINKS]
    steps = np.diff(line.get_xydata(), axis=0)
    assert np.hypot(*steps.T) == pytest.approx(1 / FEW_LINKS)
    assert np.degrees(np.abs(np.arctan(steps[:, 0] / steps[:, 1]))).max() == pytest.approx(AMPLITUDE_DEG)


def test_unasked_a_dozen_modes_are_drawn_and_the_figure_says_so() -> None:
    modes = natural_modes(chain(14))
    with theme("light"):
        unasked, asked = shapes_figure(modes), shapes_figure(modes, range(1, 14))
    assert len(unasked.axes) == USUAL_PANELS
    assert unasked.get_supxlabel().startswith("the first 12 of 14 modes; ")
    assert len(asked.axes) == 13
    assert "the first" not in asked.get_supxlabel()


def test_many_poles_have_thin_lines_on_an_axis_that_holds_them_apart() -> None:
    with theme("light"):
        many, few = (coupling_figure(explain(chain(count, support=Cart(mass=1.0)))) for count in (21, 3))
    for place in (0, -1):
        axis = many.axes[place]
        scale = axis.xaxis if place == 0 else axis.yaxis
        assert scale.get_scale() == "linear"
        curves = [line for line in axis.lines if len(line.get_xydata()) > 50]
        room = axis.get_window_extent().height / many.dpi * 72
        assert sum(line.get_linewidth() for line in curves) < 0.12 * room
    assert max(line.get_linewidth() for line in few.axes[0].lines) == 1.6


@pytest.mark.parametrize(("stiffness", "panels"), [(0.1, 2), (20.0, 2), (2000.0, 3)])
def test_only_a_zero_beside_its_pole_is_enlarged(stiffness: float, panels: int) -> None:
    """A cart of 1 kg with a bob of 1 kg: on a soft spring pole and zero are as far apart as the frequencies."""
    pendulum = Pendulum(links=[Bob(mass=1.0, length=1.0)])
    scene = Scene(gravity=9.81, support=Cart(mass=1.0, stiffness=stiffness), pendulum=[pendulum])
    with theme("light"):
        figure = coupling_figure(explain(scene))
    assert len(figure.axes) == panels
    for axis in figure.axes[:-1]:
        (low, high), (bottom, top) = axis.get_xlim(), axis.get_ylim()
        points = np.concatenate([line.get_xydata() for line in axis.lines if len(line.get_xydata()) > 50])
        seen = points[(points[:, 0] > low) & (points[:, 0] < high) & (points[:, 1] > bottom) & (points[:, 1] < top)]
        assert np.ptp(seen[:, 1]) > 0.6 * (top - bottom)
