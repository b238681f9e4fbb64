"""Figures of periodic orbits: what they draw, and that everything is legible in both themes."""

from __future__ import annotations

import io
from math import radians

import numpy as np
import pytest
from matplotlib.figure import Figure

from modal import load, natural_modes
from modal.errors import ComputationError
from modal.plotting import save
from modal.scene.parameters import parse_variations
from nonlinear.orbits import follow_cycles, follow_forced_orbits, nonlinear_mode
from nonlinear.plotting import orbits_figure
from nonlinear.plotting.branches import draw_branch

PAIR = load("chain-2")


def test_a_backbone_has_the_orbits_the_linear_frequency_and_the_kappa_curve() -> None:
    mode, branch = natural_modes(PAIR)[1], nonlinear_mode(PAIR, 2, radians(70), longest=0.2)
    figure = orbits_figure(PAIR, (branch,), mode)
    (axis,) = figure.axes
    curves = [np.array(line.get_xydata()) for line in axis.lines]
    drawn = np.vstack([curve for curve in curves if len(curve) > 1])
    for omega, angle in zip(branch.omega, np.rad2deg(branch.amplitude), strict=True):
        assert np.abs(drawn - [omega, angle]).sum(axis=1).min() < 1e-9
    assert any(np.allclose(curve[:, 0], mode.omega) for curve in curves)
    special = branch.special[0].orbit
    assert any(np.allclose(curve, [special.omega, np.rad2deg(special.amplitude)]) for curve in curves)
    styles = {line.get_linestyle() for line in axis.lines}
    assert {"-", "--"} <= styles
    low, high = axis.get_xlim()
    assert low < branch.omega.min() < mode.omega < high


def test_limit_cycles_are_drawn_along_their_number_and_written() -> None:
    scene = load("metronomes")
    branches = follow_cycles(scene, parse_variations(["support.mass=0.5:1:2log"])[0])
    figure = orbits_figure(scene, branches)
    upper, lower, rates = figure.axes
    assert lower.get_xscale() == "log"
    assert upper.get_xlim() == pytest.approx((0.5, 1.0))
    assert [axis.get_ylabel() for axis in figure.axes][2] == "growth rate (1/s)"
    for number, branch in enumerate(branches):
        (curve,) = [line for line in rates.lines if line.get_label() == f"_{number}"]
        x, y = curve.get_data()
        assert len(x) > 10 * len(branch.orbits)
        at = np.searchsorted(x, branch.value[1:-1] - 1e-9)
        decays = [np.log(np.abs(orbit.floquet.others)) / orbit.period for orbit in branch.orbits[1:-1]]
        # The slowest decay is that of the cart, which its damper brings to rest.
        expected = [np.sort(rates)[-1 if rates.max() > 0 else -2] for rates in decays]
        assert y[at] == pytest.approx(expected, rel=1e-6)
    stream = io.BytesIO()
    save(orbits_figure(scene, branches), stream, "svg")
    assert b"support.mass" in stream.getvalue() or len(stream.getvalue()) > 10_000


def test_the_line_changes_its_style_at_the_torus() -> None:
    """Huygens' clocks in phase beat on a beam lighter than 5.3505 kg; the orbits computed there are far from it."""
    scene = load("huygens")
    branches = follow_cycles(scene, parse_variations(["support.mass=5.2:6:3"])[0])
    number, (torus,) = next(
        (k, points) for k, branch in enumerate(branches) if (points := [s for s in branch.special if s.kind == "torus"])
    )
    places = np.rad2deg(torus.orbit.amplitude), torus.orbit.omega
    for axis, place in zip(orbits_figure(scene, branches).axes[:2], places, strict=True):
        parts = {line.get_ls(): np.array(line.get_xydata()) for line in axis.lines if line.get_label() == f"_{number}"}
        assert parts.keys() == {"-", "-."}
        meeting = [part[part[:, 0].argsort()[at]] for part, at in ((parts["-"], 0), (parts["-."], -1))]
        assert np.allclose(meeting, [torus.orbit.value, place], rtol=1e-12)


def test_a_resonance_is_drawn_beside_its_linear_response_and_backbone() -> None:
    scene = load("shaken-pendulum")
    branches = follow_forced_orbits(scene, parse_variations(["support.motion.frequency_hz=0.52:0.55:2"])[0])
    upper, lower = orbits_figure(scene, branches).axes
    assert lower.get_xlabel() == "frequency of the drive (Hz)"
    curves = {str(line.get_label()): np.array(line.get_xydata()) for line in upper.lines}
    linear = curves["linear response"]
    rate = 2 * np.pi * linear[:, 0]
    told = 0.02 * rate**2 / np.abs(9.81 - rate**2 + 0.05j * rate)
    assert np.radians(linear[:, 1]) == pytest.approx(told, rel=2e-3)
    hertz, angle = curves["backbone"][0]
    assert hertz == pytest.approx(np.sqrt(9.81) / (2 * np.pi) * (1 - np.radians(angle) ** 2 / 16), rel=1e-6)
    assert upper.get_ylabel() == "largest angle (°)"
    phases = np.concatenate([np.ravel(line.get_ydata()) for line in lower.lines])
    assert np.all((phases > -180) & (phases < -160))


def test_too_many_branches_are_refused() -> None:
    with pytest.raises(ComputationError, match="do not fit"):
        orbits_figure(PAIR, ())


def test_a_smooth_curve_goes_through_its_points_and_no_farther() -> None:
    """A fold of nine points on a circle: between them within 7e-3 of it, where straight lines are 0.02 off."""
    angle = np.linspace(-1.6, 1.6, 9)
    figure = Figure()
    axis = figure.add_subplot()
    draw_branch(axis, np.cos(angle), np.sin(angle), [True] * 9, 0)
    x, y = axis.lines[0].get_data()
    assert np.hypot(x, y) == pytest.approx(np.ones(len(x)), abs=7e-3)
    assert np.abs(y).max() <= np.sin(1.6)
    assert np.abs(np.hypot(x[::12], y[::12]) - 1).max() < 1e-12
    draw_branch(axis, np.array([0.0, 30.0, 30.0, 31.0]), np.array([0.0, 1.0, 1.0, 0.0]), [True] * 4, 1)  # a point twice
    assert np.isfinite(axis.lines[1].get_ydata()).all()
