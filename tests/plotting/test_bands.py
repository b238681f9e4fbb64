"""Bands in the place of curves that would be blobs, and what moves as prescribed next to a run."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from seen import flaws

import modal
from modal.plotting import sheet
from modal.plotting.curves import draw_curves, envelope
from modal.plotting.layout import legend
from modal.plotting.style import theme
from nonlinear.integration import Trajectory
from nonlinear.plotting.run import run_figure
from nonlinear.simulation import simulate

T = np.linspace(0.0, 1000.0, 40_000)


def test_a_band_holds_every_sample_and_follows_the_decay() -> None:
    """e^{−t/τ} cos ωt lies between ∓e^{−t/τ}, which a column of several periods reaches to within its width over τ."""
    rng = np.random.default_rng(7)
    y = np.exp(-T / 500) * np.cos(4.0 * T) + 1e-3 * rng.normal(size=T.size)
    edges, low, high = envelope(T, y, 300)
    assert np.all(np.interp(T, edges, high) >= y)
    assert np.all(np.interp(T, edges, low) <= y)
    assert len(edges) == 301
    assert high == pytest.approx(np.exp(-edges / 500), abs=0.02)
    assert low == pytest.approx(-np.exp(-edges / 500), abs=0.02)


def test_a_gap_and_few_samples_are_no_obstacle() -> None:
    y = np.where(np.abs(T - 500) < 100, np.nan, np.cos(4.0 * T))
    edges, low, high = envelope(T, y, 300)
    known = np.isfinite(y)
    assert np.isfinite([low, high]).all()
    assert np.all(np.interp(T[known], edges, high) >= y[known])
    assert len(envelope(T[:20], y[:20], 300)[0]) == 3


@pytest.mark.parametrize(("rate", "is_band"), [(0.1, False), (4.0, True)])
def test_what_swings_faster_than_lines_show_is_a_band_that_says_so(rate: float, is_band: bool) -> None:
    with theme("light"):
        figure = sheet(8.0, 3.0)
        axis = figure.subplots()
        curves = [(T, np.cos(rate * T)), (T, T / 500 - 1)]
        assert draw_curves(axis, curves, names=["fast", "slow"], bands=True) == is_band
        axis.set(xlabel="time (s)", ylabel="angle (°)")
        legend(axis)
    bands = [part for part in axis.collections if isinstance(part, PolyCollection)]
    assert len(bands) == is_band
    assert axis.get_legend_handles_labels()[1] == ["fast: least to most" if is_band else "fast", "slow"]
    assert flaws(figure) == []


def test_rounding_upon_a_smooth_curve_is_no_band() -> None:
    rng = np.random.default_rng(3)
    with theme("light"):
        axis = sheet(8.0, 3.0).subplots()
        assert not draw_curves(axis, [(T, T + 1e-9 * rng.normal(size=T.size))], bands=True)


def titled(trajectory: Trajectory) -> dict[str, tuple[str, np.ndarray, list[np.ndarray]]]:
    """Label, times and curves of the panels of what is prescribed."""
    with theme("light"):
        figure = run_figure(trajectory)
    assert flaws(figure) == []
    panels = {axis.get_title("left"): axis for axis in figure.axes}
    return {
        title: (axis.get_ylabel(), axis.lines[0].get_xdata(), [line.get_ydata() for line in axis.lines])
        for title, axis in panels.items()
        if title.endswith("as prescribed")
    }


def test_a_run_shows_how_its_support_moves() -> None:
    panels = titled(simulate(modal.load("shaken-pendulum"), 3.0))
    label, times, (shown,) = panels["Support, as prescribed"]
    assert label == "displacement (m)"
    assert shown == pytest.approx(0.02 * np.sin(2 * np.pi * 0.475 * times), abs=1e-12)


def test_a_run_shows_its_hoist() -> None:
    scene = modal.load("hoisting-crane")
    panels = titled(simulate(scene, 10.0))
    label, times, (shown,) = panels["Hoist, as prescribed"]
    assert label == "length (m)"
    s = np.clip(times / 8.0, 0.0, 1.0)
    assert shown == pytest.approx(12.0 - 6.0 * (10 * s**3 - 15 * s**4 + 6 * s**5), abs=1e-9)


def test_a_run_shows_the_ground_under_a_structure_across_and_up() -> None:
    scene = modal.load("two-bobs")
    motion = [
        modal.scene.SineMotion(amplitude=0.01, frequency_hz=0.5),
        modal.scene.SineMotion(amplitude=0.02, frequency_hz=0.3, direction="vertical"),
    ]
    panels = titled(simulate(scene.replace(ground=modal.scene.Ground(motion=motion)), 3.0))
    label, times, (across, up) = panels["Ground, as prescribed"]
    assert label == "displacement (m)"
    assert across == pytest.approx(0.01 * np.sin(np.pi * times), abs=1e-12)
    assert up == pytest.approx(0.02 * np.sin(0.6 * np.pi * times), abs=1e-12)
