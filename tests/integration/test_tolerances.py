"""What is rounding and what is not: cases on either side of the tolerances by which integration distinguishes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modal import Bob, Fixed, Pendulum, Scene
from nonlinear import simulate
from nonlinear.integration.steppers import tolerance_factor
from nonlinear.integration.watches import Level, starts_of
from nonlinear.integration.within import crossing
from nonlinear.system import Layout, State, system_of

ONE = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])


@pytest.mark.parametrize(("ulps", "on"), [(3, True), (10, False)])
def test_a_start_is_on_a_level_to_a_few_units_in_the_last_place(ulps: int, on: bool) -> None:
    y = np.array([[0.3 + ulps * np.spacing(0.3)], [1.0]])
    layout = Layout.of(system_of(ONE), works=False)
    assert starts_of(Level(0, 0.3, turns=True), layout, y, np.zeros((2, 1))).on.item() == on


@pytest.mark.parametrize(("acceleration", "way"), [(3e-13, 1.0), (3e-14, 0.0)])
def test_an_acceleration_that_is_rounding_tells_no_way(acceleration: float, way: float) -> None:
    two = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)])])
    layout = Layout.of(system_of(two), works=False)
    slope = np.array([[0.0], [0.0], [acceleration], [-1.0]])
    starts = starts_of(Level(0, 0.3, turns=True), layout, np.array([[0.3], [0.0], [0.0], [0.0]]), slope)
    assert starts.way.item() == way


def test_few_components_at_rest_hide_no_error_and_many_do() -> None:
    alone = np.eye(1, 32)[0]
    assert tolerance_factor(alone, np.ones(32)) == 1.0
    alone = np.eye(1, 40)[0]
    assert tolerance_factor(alone, np.ones(40)) < 0.95


def test_what_passes_within_a_step_is_found_to_its_last_digits() -> None:
    """Of a component that rises throughout and bends as one does in a step."""
    places = np.linspace(0.05, 0.95, 19)
    parts = crossing(lambda part: np.sin(1.4 * part) - np.sin(1.4 * places), np.zeros(19), np.ones(19))
    assert parts == pytest.approx(places, abs=1e-14)


@pytest.mark.parametrize(("apart", "times"), [(3e-13, 1), (3e-12, 2)])
def test_kicks_that_rounding_parts_are_one(apart: float, times: int) -> None:
    drive: Any = {"kind": "escapement", "angle_deg": 3.0, "impulse": 1e-3}
    clock = Pendulum(links=[Bob(mass=1.0, length=1.0, drive=drive)], count=2)
    scene = Scene(gravity=9.81, support=Fixed(), pendulum=[clock])
    start = State(np.array([0.0, apart]), np.array([0.5, 0.5]))
    kicks = simulate(scene, 0.3, start=start).kicks
    assert len(kicks.time) == 2
    assert len(set(kicks.time.tolist())) == times
