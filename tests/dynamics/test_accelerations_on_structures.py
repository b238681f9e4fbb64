"""The motion on structures against places of all masses in 50 digits, at large angles and speeds."""

from __future__ import annotations

from collections.abc import Iterator

import mpmath as mp
import numpy as np
import pytest
from structured_scenes import MOVED, STRUCTURED
from structures import Oracle

from modal import Bob, Cart, Pendulum, Scene
from modal.assembly import matrices
from modal.scene import Spring
from modal.types import Floats
from nonlinear import State
from nonlinear.dynamics import Arranged, Generated, Mechanics, Minimal, Recursion
from nonlinear.system import system_of

TIME = 0.9  # s
SCENES = {**STRUCTURED, **MOVED}


def routes(scene: Scene) -> Iterator[Arranged]:
    """The equations as they are written out, and by one pass up and one down each chain."""
    system = system_of(scene)
    yield Generated(system)
    winding = [bool(system.hoisting and system.hoisting.moving[group.index].any()) for group in system.groups]
    solvers = (None if winds else Recursion(group) for group, winds in zip(system.groups, winding, strict=True))
    yield Minimal(system, tuple(solvers))


def drawn_at_random(oracle: Oracle, seed: int) -> tuple[Floats, Floats, State]:
    rng, d = np.random.default_rng(seed), oracle.carried
    q, v = rng.uniform(-2.5, 2.5, oracle.size), rng.uniform(-4, 4, oracle.size)
    return q, v, State(q[d:], v[d:], supports=q[:d], support_rates=v[:d])


@pytest.mark.parametrize("name", SCENES)
def test_accelerations_are_those_of_all_masses(name: str) -> None:
    oracle, equations = Oracle(SCENES[name]), list(routes(SCENES[name]))
    for seed in range(3):
        q, v, state = drawn_at_random(oracle, seed)
        exact = np.array(oracle.accelerations(q, v, TIME), dtype=float)
        for each in equations:
            rates = each.read(np.array([each.derivative(TIME, each.begin(state))]))
            np.testing.assert_array_equal(rates.links[0], v[oracle.carried :])
            accelerations = np.concatenate([rates.support_rates[0], rates.link_rates[0]])
            assert np.abs(accelerations - exact).max() < 1e-13 * np.abs(exact).max()


@pytest.mark.parametrize("name", [name for name in SCENES if not SCENES[name].is_moved and not SCENES[name].is_hoisted])
def test_the_work_of_all_forces_is_what_the_energy_of_all_masses_gains(name: str) -> None:
    oracle = Oracle(SCENES[name])
    equations = Generated(system_of(SCENES[name]))
    q, v, state = drawn_at_random(oracle, 7)
    with mp.workdps(50):
        a, h = oracle.accelerations(q, v, TIME), mp.mpf("1e-20")
        after = [[x + h * rate for x, rate in zip(*pair, strict=True)] for pair in ((q, v), (v, a))]
        power = (oracle.energy(*after) - oracle.energy(q, v)) / h
    work = equations.read(np.array([equations.derivative(TIME, equations.begin(state))])).work[0]
    assert work == pytest.approx(float(power), rel=1e-13)


@pytest.mark.parametrize("name", STRUCTURED)
def test_the_energy_is_that_of_all_masses(name: str) -> None:
    oracle, equations = Oracle(STRUCTURED[name]), Generated(system_of(STRUCTURED[name]))
    rows, exact = [], []
    for seed in range(2):
        q, v, state = drawn_at_random(oracle, seed)
        rows.append(equations.begin(state))
        exact.append(float(oracle.energy(q, v) - oracle.energy(oracle.rest, [0] * oracle.size)))
    energies = Mechanics(equations.system, equations.read(np.array(rows))).energy
    np.testing.assert_allclose(energies, exact, rtol=1e-13)


def test_ends_that_meet_but_for_rounding_are_drawn_together() -> None:
    """0.1 + 0.2 is not 0.3 in floats: such a spring has no direction, and pulls and damps both ways from the start."""
    bobs = [[Bob(mass=1.0, length=length) for length in lengths] for lengths in ((0.1, 0.2), (0.3,))]
    spring = Spring(between=("pendulum[0].links[1]", "pendulum[1].links[0]"), stiffness=5.0, damping=0.3)
    cart = Cart(mass=2.0, stiffness=1.0)
    scene = Scene(gravity=9.81, support=cart, pendulum=[Pendulum(links=links) for links in bobs], spring=[spring])
    assert system_of(scene).slack == (True,)
    linear, v = matrices(scene), np.array([0.1, 0.2, -0.3, 0.4])
    for each in routes(scene):
        start = each.begin(State(np.zeros(3), v[1:], supports=np.zeros(1), support_rates=v[:1]))
        rates = each.read(np.array([each.derivative(TIME, start)]))
        accelerations = np.concatenate([rates.support_rates[0], rates.link_rates[0]])
        np.testing.assert_allclose(accelerations, -np.linalg.solve(linear.M, linear.D @ v), atol=1e-15)
