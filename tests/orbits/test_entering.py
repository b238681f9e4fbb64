"""Branches that leave nonlinear modes: links that no longer rest together, then twice the period."""

from __future__ import annotations

from functools import cache
from math import radians

import numpy as np
import pytest

from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import ComputationError
from nonlinear.orbits import Branch, Orbit, leaving_branch, nonlinear_mode
from nonlinear.simulation import simulate


@cache
def backbone() -> Branch:
    return nonlinear_mode(load("chain-2"), 1, radians(123), longest=0.2)


@cache
def uneven(most: int) -> Branch:
    return leaving_branch(backbone(), backbone().special[0], max_orbits=most, step=0.2)


def returns(orbit: Orbit) -> float:
    """How far (rad) the simulator is from the start after one period."""
    run = simulate(orbit.scene, orbit.period, start=orbit.state, output=[0.0, orbit.period], tolerance=1e-13)
    return float(np.abs(run.motion.links[-1] - orbit.state.links).max())


def rests(orbit: Orbit) -> float:
    """The smallest rate (rad/s) of the faster link over a period: 0 where both turn back together."""
    rows = orbit.states_at(np.linspace(0, orbit.period, 120))
    return float(np.abs(rows[:, 2:]).max(axis=1).min())


def test_on_the_branch_that_leaves_the_links_no_longer_turn_back_together() -> None:
    orbit, even = uneven(10).orbits[8], backbone().orbits[-1]
    assert returns(orbit) < 1e-7
    assert rests(even) < 1e-6
    assert rests(orbit) > 0.1


def test_at_a_period_doubling_a_branch_of_twice_the_period_leaves() -> None:
    first = next(special_point for special_point in uneven(45).special if special_point.kind == "branch point")
    second = leaving_branch(uneven(45), first, max_orbits=40, step=0.15)
    doubling = next(special_point for special_point in second.special if special_point.kind == "period doubling")
    assert np.abs(doubling.orbit.floquet.others + 1).min() < 1e-3
    leaving = leaving_branch(second, doubling, max_orbits=4)
    orbit = leaving.orbits[-1]
    assert orbit.period == pytest.approx(2 * doubling.orbit.period, rel=0.05)
    assert returns(orbit) < 1e-6
    once = orbit.flow(orbit.y, np.eye(4)[:, :0], orbit.period / 2).y
    assert np.abs(once - orbit.y).max() > 1e-3


def test_a_branch_leaves_on_a_free_cart_too() -> None:
    pendula = [Pendulum(links=(Bob(mass=1.0, length=length),)) for length in (1.0, 0.7)]
    scene = Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=pendula)
    branch = nonlinear_mode(scene, 3, radians(95), longest=0.3)
    point = next(special_point for special_point in branch.special if special_point.kind == "branch point")
    orbit = leaving_branch(branch, point, max_orbits=4).orbits[-1]
    assert orbit.residual < 1e-10
    assert returns(orbit) < 1e-6


def test_nothing_leaves_at_a_fold() -> None:
    fold = backbone().special[0].__class__("fold", backbone().orbits[0], 0, backbone().points[0], "energy")
    with pytest.raises(ComputationError, match="no other branch leaves"):
        leaving_branch(backbone(), fold)
