"""The damping ratio of dry friction and quadratic drag at an amplitude, and when friction stops a mode."""

from __future__ import annotations

import csv
import io
from math import pi, sqrt

import numpy as np
import pytest

from modal.modes import natural_modes
from modal.modes.dissipation import damping_ratios, sliding_modes, stop_of, stop_words
from modal.modes.tables import table
from modal.scene import Scene, scene_from
from nonlinear import simulate
from nonlinear.system import State

G = 9.81


def bob(**more: float) -> dict[str, object]:
    return {"kind": "bob", "mass": 1.0, "length": 1.0, **more}


def single(**more: float) -> Scene:
    return scene_from({"gravity": G, "pendulum": [{"links": [bob(**more)]}]})


def test_one_joint_by_hand() -> None:
    mode = sliding_modes(single(friction=0.05))[0]
    assert mode.stuck == pytest.approx(0.05 / G)
    assert mode.damping_ratio(0.1) == pytest.approx(4 * 0.05 * 0.1 / (4 * pi * G * 0.1**2 / 2))


def test_energy_lost_in_a_cycle_of_a_run() -> None:
    """4πζ(a) times the modal energy is what a simulated small cycle of two links loses, whatever takes it."""
    links = [bob(friction=2e-9, quadratic_drag=0.3), bob(friction=1e-9, mass=0.7)]
    cart = {"kind": "cart", "mass": 2.0, "friction": 3e-9, "stiffness": 20.0}
    scene = scene_from({"gravity": G, "support": cart, "pendulum": [{"links": links}]})
    modes = natural_modes(scene.conservative)
    for sliding in sliding_modes(scene):
        shape, a = modes.shape(sliding.mode - 1), 1e-4
        start = State(a * shape.angles.real, np.zeros(2), a * float(np.real(shape.cart)), 0.0)
        run = simulate(scene, 2 * pi / sliding.omega, start=start, tolerance=1e-13)
        energy = sliding.omega**2 * a**2 * shape.modal_mass / 2
        assert -run.motion.work[-1] == pytest.approx(4 * pi * sliding.damping_ratio(a) * energy, rel=2e-3)


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_when_it_stops(damping: float) -> None:
    scene, degrees = single(friction=0.01, damping=damping), 3.0
    stop = stop_of(sliding_modes(scene)[0], float(np.radians(degrees)))
    run = simulate(scene, 60.0, start=State(np.radians([degrees]), np.zeros(1)))
    assert run.friction.rest == pytest.approx(stop.time, rel=2e-4)
    assert abs(run.final.links[0]) <= stop.within * 1.001
    assert f"after {stop.time:.4g} s ({stop.half_swings} half swings) from 3 deg" in stop_words(scene, degrees)[0]


def test_without_friction_nothing_stops() -> None:
    assert stop_words(single(damping=0.1), 5.0) == []
    assert stop_of(sliding_modes(single())[0], 0.1).time == np.inf


def test_a_coefficient_on_the_rail_counts_the_weight() -> None:
    cart = {"kind": "cart", "mass": 2.0, "friction_coefficient": 0.01, "stiffness": 30.0}
    scene = scene_from({"gravity": G, "support": cart, "pendulum": [{"links": [bob()]}]})
    force = scene.replace(support=scene.support.replace(friction_coefficient=0.0, friction=0.01 * 3.0 * G))
    for mode, other in zip(sliding_modes(scene), sliding_modes(force), strict=True):
        assert mode.stuck == pytest.approx(other.stuck)


def test_the_column_of_the_table() -> None:
    scene = single(friction=0.05, damping=0.1)
    modes = natural_modes(scene)
    rows = list(csv.DictReader(io.StringIO(table(modes, list(modes), "csv", amplitude_deg=5.0))))
    expected = 0.1 / (2 * sqrt(G)) + 2 * 0.05 / (pi * G * np.radians(5.0))
    assert float(rows[0]["damping_ratio_at_5_deg"]) == pytest.approx(expected)
    assert damping_ratios(modes, np.radians(5.0))[1] == pytest.approx(expected)
    assert "ζ(5°)" in table(modes, list(modes), "text", amplitude_deg=5.0)
    assert "ζ(" not in table(modes, list(modes), "text")
    assert "at_5_deg" not in table(modes, list(modes), "csv")


def test_friction_on_the_rail_stops_the_cart_and_the_load_swings_on() -> None:
    hook, load = bob(mass=650.0, length=12.5), bob(mass=21e3, length=4.5)
    scene = scene_from(
        {
            "gravity": G,
            "support": {"kind": "cart", "mass": 8400.0, "friction": 1500.0},
            "pendulum": [{"links": [hook, load]}],
        }
    )
    (words, *_), slow = stop_words(scene, 5.0), sliding_modes(scene)[0]
    assert "stops the cart" in words
    assert "swings on" in natural_modes(scene).notes[0]
    angles = np.real(natural_modes(scene.frictionless).shape(slow.mode - 1).angles)
    run = simulate(scene, 60.0, start=State(np.radians(5.0) * angles, np.zeros(2)))
    assert run.friction.begin[0] == pytest.approx(stop_of(slow, np.radians(5.0)).time, rel=0.1)
    late = run.times > 40.0
    assert np.ptp(run.motion.cart[late]) < 1e-3
    assert np.degrees(np.ptp(run.motion.links[late, 0])) > 0.3


def test_friction_at_a_joint_too_stops_the_swing() -> None:
    rail = {"kind": "cart", "mass": 2.0, "friction": 0.5}
    scene = scene_from({"gravity": G, "support": rail, "pendulum": [{"links": [bob(friction=0.01)]}]})
    assert "stops it" in stop_words(scene, 5.0)[0]
    assert "stops a swing" in natural_modes(scene).notes[0]
