"""The complementarity problem of contacts at rest, against all its states, and the law on the rail."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from modal.errors import ComputationError
from modal.scene import scene_from
from nonlinear.dynamics import Frictional, Mechanics, Minimal, Recursion, Small, WrittenFrictional, contacts_of
from nonlinear.dynamics.friction import Contacts, _on_rail, hold
from nonlinear.integration import Choice, equations_of
from nonlinear.system import AppliedForces, State, system_of


def every_state(a: np.ndarray, G: np.ndarray, limit: np.ndarray) -> list[np.ndarray]:
    """All τ that satisfy Coulomb's law, found by trying every set of sticking and sliding contacts."""
    found = []
    for sign in product((-1.0, 0.0, 1.0), repeat=len(a)):
        s = np.array(sign)
        stuck, tau = s == 0, -s * limit
        if stuck.any():
            tau[stuck] = np.linalg.solve(G[np.ix_(stuck, stuck)], -(a + G @ tau)[stuck])
        if np.all(np.abs(tau) <= limit) and np.all((a + G @ tau) * s >= 0):
            found.append(tau)
    return found


@pytest.mark.parametrize("seed", range(40))
def test_it_is_the_one_state_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 1 + seed % 5
    root = rng.normal(size=(count, count + 1)) * 10 ** rng.uniform(-2, 2, (count, 1))
    a, G, limit = rng.normal(size=count), root @ root.T, rng.uniform(0, 2, count) / np.diag(root @ root.T)
    expected = every_state(a, G, limit)
    assert len(expected) == 1
    tau, sign = hold(a, G, limit)
    assert tau == pytest.approx(expected[0], rel=1e-9, abs=1e-12)
    assert np.all((np.abs(tau) < limit) == (sign == 0))


def scene(coefficient: float, **angles: float) -> Frictional:
    links = [
        {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.2},
        {"kind": "rod", "mass": 2.0, "length": 0.7, "friction": 0.1, "quadratic_drag": 0.1},
    ]
    support = {"kind": "cart", "mass": 0.5, "friction_coefficient": coefficient}
    found = scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]})
    equations = equations_of(system_of(found), Choice("minimal", "DOP853", False, ""))
    assert isinstance(equations, Frictional)
    return equations


@pytest.mark.parametrize("seed", range(12))
def test_the_reaction_of_the_rail_carries_what_newton_says(seed: int) -> None:
    """N = Σ m (g − z'') with the accelerations under friction, and τ = −μ|N| sign x'."""
    rng = np.random.default_rng(seed)
    equations = scene(0.3)
    system = equations.system
    state = State(rng.normal(size=2), 6 * rng.normal(size=2), 0.0, float(rng.normal()))
    y = equations.begin(state)
    equations.release(0.0, y)
    rate = equations.derivative(0.0, y)
    half, step = equations.layout.half, 1e-5
    speeds = [Mechanics(system, equations.read((y + way * step * rate)[None])).speeds[0, :, 1] for way in (-1.0, 1.0)]
    drag = np.zeros(2)
    from nonlinear.dynamics.drag import forces_of

    drag = forces_of(system, Mechanics(system, equations.read(y[None])).speeds)[0, :, 1]
    falling = (speeds[1] - speeds[0]) / (2 * step)
    normal = 0.5 * 9.81 + float(np.sum(system.mass * (9.81 - falling) + drag))
    friction = equations.settled(0.0, y, np.sign(equations.sliding(y)))
    assert friction.tau[0] == pytest.approx(-0.3 * abs(normal) * np.sign(state.cart_rate), rel=1e-6)
    assert half == 3


def test_a_rail_that_jams_says_so() -> None:
    contacts = Contacts(np.array([0]), np.array([-1]), np.zeros(1), True, 2.0)
    with pytest.raises(ComputationError, match="coefficient is too large"):
        _on_rail(np.array([1.0]), np.eye(1), contacts, np.ones(1), (1.0, np.array([-1.0])), deciding=False)


def test_written_out_and_by_the_recursion_it_is_the_same() -> None:
    links = [{"kind": "rod", "mass": 1.0, "length": 0.5, "friction": 0.1, "count": 5}]
    found = system_of(scene_from({"gravity": 9.81, "pendulum": [{"links": links}]}))
    long = Frictional(Minimal(found, tuple(Recursion(group) for group in found.groups)), contacts_of(found))
    rng = np.random.default_rng(3)
    y = long.begin(State(rng.normal(size=5), rng.normal(size=5)))
    long.release(0.0, y)
    written = equations_of(found, Choice("minimal", "DOP853", False, ""))
    assert isinstance(written, WrittenFrictional)
    written.release(0.0, y)
    assert written.derivative(0.0, y) == pytest.approx(long.derivative(0.0, y), rel=1e-9, abs=1e-9)


def test_a_load_acts_alike_written_out_and_by_a_matrix() -> None:
    links = [{"kind": "rod", "mass": 1.0, "length": 0.5, "friction": 0.1, "count": 3}]
    support = {"kind": "cart", "mass": 1.0, "friction": 0.2}
    system = system_of(scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]}))

    def load(time: float, state: State) -> AppliedForces:
        return AppliedForces(0.3 + state.cart, np.array([0.1, -0.2, 0.3]) * time)

    apart = equations_of(system, Choice("minimal", "DOP853", False, ""), load)
    within = Frictional(Small(system, load=load), contacts_of(system))
    assert isinstance(apart, WrittenFrictional)
    rng = np.random.default_rng(8)
    y = within.begin(State(rng.normal(size=3), rng.normal(size=3), 0.4, -0.3))
    for equations in (apart, within):
        equations.release(2.0, y)
    assert apart.derivative(2.0, y) == pytest.approx(within.derivative(2.0, y), rel=1e-9)
