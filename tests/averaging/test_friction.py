"""Dry friction and linear drag in averaged equations: closed forms, quadrature, and the full simulation."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest

from modal.scene import Scene, scene_from
from nonlinear import simulate
from nonlinear.averaging import average, predict
from nonlinear.averaging.describing import rubbing_torques
from nonlinear.system import State

G = 9.81


def clock(**more: Any) -> Scene:
    drive = {"kind": "escapement", "impulse": 1e-2, "angle_deg": 0.0}
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": drive, "damping": 0.05, **more}
    return scene_from({"gravity": G, "pendulum": [{"links": [link], "start": {"angles_deg": [4.0]}}]})


def test_a_swing_loses_a_constant_rate() -> None:
    """Energy 4 M A a cycle: A' = −2 M ω/(π m g l), whatever A."""
    scene = scene_from(
        {"gravity": G, "pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 1e-3}]}]}
    )
    averaged = average(scene)
    for angle in (1e-3, 3e-2):
        z = averaged.amplitudes(State(np.array([angle]), np.zeros(1)))[:, None]
        rate = averaged.forcing(z, averaged.turning(z))
        shrinking = float(np.real(rate[0, 0] * z[0, 0].conj()) / np.abs(z[0, 0]))
        scale = abs(float(averaged.link_shapes[0, 0]))
        assert shrinking * scale == pytest.approx(-2 * 1e-3 * np.sqrt(G) / (pi * G), rel=2e-3)


def test_two_frequencies_at_once_by_quadrature() -> None:
    """−M sign of a sum of two oscillations, averaged over both phases on a fine grid."""
    swing, turning, limit = np.array([[[0.3 + 0.1j]], [[0.02 - 0.05j]]]), np.array([[2.0], [5.0]]), np.array([0.7])
    count = 400
    grid = 2 * pi * (np.arange(count) + 0.5) / count
    slow, fast = (phase.ravel() for phase in np.meshgrid(grid, grid, indexing="ij"))
    phases = np.exp(1j * np.array([slow, fast]))
    velocity = np.real(1j * turning * swing[:, 0] * phases).sum(0)
    torque = -limit[0] * np.sign(velocity)
    first, third = rubbing_torques(limit, swing, turning, phases[:, ::7])
    for band in range(2):
        assert first[band, 0, 0] == pytest.approx(2 * np.mean(torque * phases[band].conj()), abs=2e-3)
    assert third[0, 0, 0] == pytest.approx(2 * np.mean(torque * phases[0].conj() ** 3), abs=2e-3)


def test_the_amplitude_of_a_clock_with_friction() -> None:
    """2 P ω A = 4 M A + π d ω A² with kicks at the bottom, by hand and by the full simulation."""
    friction = 1e-3
    scene = clock(friction=friction)
    ending = predict(scene).ending
    assert ending is not None
    omega = np.sqrt(G)
    expected = (2 * 1e-2 * omega - 4 * friction) / (pi * 0.05 * omega)
    averaged = average(scene)
    angle = averaged.largest(ending.z[:, None])
    assert angle == pytest.approx(expected, rel=0.02)
    run = simulate(scene, 60.0, start=State(np.array([angle]), np.zeros(1)), output=3001, tolerance=1e-7)
    late = run.motion.links[run.times > 55.0]
    assert np.abs(late).max() == pytest.approx(angle, rel=0.02)


def test_linear_drag_damps_as_a_damper_does() -> None:
    rates = []
    for law in ({"drag": 0.02}, {"damping": 0.02}):
        link = {"kind": "bob", "mass": 1.0, "length": 1.0, **law}
        averaged = average(scene_from({"gravity": G, "pendulum": [{"links": [link]}]}))
        z = averaged.amplitudes(State(np.array([0.1]), np.zeros(1)))[:, None]
        rates.append(averaged.forcing(z, averaged.turning(z))[0, 0])
    assert rates[0] == pytest.approx(rates[1], rel=1e-12)
    assert rates[0].real / np.abs(z[0, 0]) == pytest.approx(-0.01, rel=1e-2)
