"""Extremes between the samples, against a spherical pendulum by its conserved energy and spin, and dense samples."""

from __future__ import annotations

import numpy as np
import pytest

from modal import load
from modal.scene import Bob, Pendulum, Scene
from nonlinear import State, simulate
from nonlinear.ensembles import ensemble
from nonlinear.postprocessing import extent_of, largest_angle, places_of
from nonlinear.postprocessing.summary import text
from nonlinear.sweeps import parse_measures

SPHERICAL = Scene(gravity=9.81, space="space", pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])


@pytest.mark.parametrize("across", [0.004, 0.3])
def test_a_spherical_pendulum_reaches_the_roots_of_its_cubic(across: float) -> None:
    """With u = cos θ, E = ½ v² − g u and the spin h: 2 (E + g u)(1 − u²) = h²; the least angle is passed as |t| is."""
    n, v = np.array([0.0, np.sin(2.0), np.cos(2.0)]), np.array([across, 0.0, 0.0])
    run = simulate(SPHERICAL, 4.0, start=State(n[None], v[None]), output=121, tolerance=1e-10)
    energy, spin = v @ v / 2 - 9.81 * n[2], np.cross(n, v)[2]
    roots = np.roots([-2 * 9.81, -2 * energy, 2 * 9.81, 2 * energy - spin**2])
    expected = np.sort(np.arccos(roots[np.abs(roots) <= 1]))
    extent = extent_of(run)
    assert extent.between
    np.testing.assert_allclose(extent[:2], expected, atol=1e-6)
    assert largest_angle(run) == extent.high


def test_extremes_in_the_plane_and_of_the_cart_are_those_of_dense_samples() -> None:
    scene = load("paper-cart-1")
    run, dense = simulate(scene, 10.0, output=301), simulate(scene, 10.0, output=200_001)
    for extent, values in ((extent_of(run), dense.motion.links), (extent_of(run, places_of), dense.motion.cart)):
        assert extent.between
        np.testing.assert_allclose(extent[:2], (values.min(), values.max()), atol=1e-7)


def test_extremes_of_the_samples_are_told_as_such() -> None:
    """Where these are too far apart."""
    run = simulate(load("chain-2"), 10.0, start=State(np.array([2.0, 1.0]), np.zeros(2)), output=11)
    assert extent_of(run) == (run.motion.links.min(), run.motion.links.max(), False)
    assert "deg, in the samples" in text(run)


def test_every_measure_of_the_largest_angle_in_space_says_the_same() -> None:
    scene, start = SPHERICAL, State(np.array([[0.0, np.sin(2.9), np.cos(2.9)]]), np.array([[0.1, 3.0, 0.0]]))
    expected = np.degrees(extent_of(simulate(scene, 3.0, start=start, output=2001)).high)
    runs = ensemble(scene, 3.0, starts=[start], measures=["largest_angle"], workers=1)
    assert runs.column("largest_angle_deg")[0] == pytest.approx(expected, abs=1e-4)
    started = load("chain-2").replace(space="space")
    swept = parse_measures(["largest_angle:1"])[0].of(started)["largest_angle_deg"]
    assert swept == pytest.approx(np.degrees(largest_angle(simulate(started, 1.0))), abs=1e-6)
