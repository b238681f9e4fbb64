"""Linear equations along a hoist on structures, against all masses in 50 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from structures import Oracle

from modal import Bob, Cart, Pendulum, Scene, SceneError
from modal.assembly import matrices_along, matrices_at
from modal.scene import Hoist, Rod, Spring
from modal.scene.supports import Heave, Planar, Platform, Swing
from modal.types import Floats

STEP = mp.mpf(10) ** -20
ROPE = Bob(mass=2.0, length=1.5, drag=0.2, damping=0.03, hoist=Hoist(to=0.8, begin=0.5, duration=3.0))


def crane() -> Scene:
    """A cart and a swing with loads on ropes that are hoisted, joined by a spring."""
    return Scene(
        gravity=9.81,
        support=[
            Cart(name="truck", mass=3.0, stiffness=6.0, damping=0.4),
            Swing(name="stage", mass=2.0, length=0.7, position=(2.0, 0.1)),
        ],
        pendulum=[
            Pendulum(on="truck", links=[ROPE, Rod(mass=0.4, length=0.5, stiffness=0.3)], count=2),
            Pendulum(on="stage", links=[Bob(mass=0.5, length=0.6, quadratic_drag=0.2), ROPE]),
        ],
        spring=[Spring(between=("truck", "stage"), stiffness=20.0, damping=0.3)],
    )


def slopes(scene: Scene, time: float) -> tuple[Floats, Floats]:
    """−∂q''/∂q and −∂q''/∂q' at rest."""
    oracle = Oracle(scene)
    n = len(oracle.rest)
    jacobians = []
    for which in (0, 1):
        columns = []
        for k in range(n):
            ends = []
            for sign in (1, -1):
                state = [list(oracle.rest), [mp.mpf(0)] * n]
                state[which][k] += sign * STEP
                ends.append(oracle.accelerations(*state, time))
            columns.append([float((b - a) / (2 * STEP)) for a, b in zip(*ends, strict=True)])
        jacobians.append(np.array(columns).T)
    return jacobians[0], jacobians[1]


@pytest.mark.parametrize("time", [0.0, 1.3, 2.9, 4.0])
def test_the_equations_along_a_hoist_are_those_of_all_masses(time: float) -> None:
    scene, M = crane(), matrices_at(crane(), time)
    for matrix, exact in zip((M.K, M.D), slopes(scene, time), strict=True):
        scaled = np.linalg.solve(M.M, matrix)
        assert np.abs(scaled - exact).max() < 1e-12 * np.abs(exact).max()


def test_what_moves_up_and_down_carries_the_changing_weight() -> None:
    ways = Planar(sway=5.0, heave=300.0, roll=400.0)
    ship = Platform(name="ship", mass=20.0, inertia=15.0, centre=(0.2, 0.1), stiffness=ways)
    scene = Scene(gravity=9.81, support=ship, pendulum=[Pendulum(position=(2.0, -1.0), links=[ROPE])])
    along = matrices_along(scene)
    rest, moving = along(0.0), along(1.3)
    assert np.abs(rest.M - inertia_of(scene.at(0.0))).max() < 1e-13
    speed, acceleration = (float(part) for part in ROPE.hoist.law(1.5)(1.3)[1:])  # type: ignore[union-attr]
    pull = 2.0 * (9.81 - acceleration) - 0.2 * speed
    roll = 400.0 + 9.81 * 20.0 * 0.1
    assert moving.K[2, 2] == pytest.approx(roll - 1.0 * pull, rel=1e-14)
    assert rest.K[2, 2] == pytest.approx(roll - 1.0 * 2.0 * 9.81, rel=1e-14)
    lift = Heave(name="lift", mass=3.0, stiffness=200.0)
    heave = matrices_at(Scene(gravity=9.81, support=lift, pendulum=[Pendulum(links=[ROPE])]), 1.3)
    assert (heave.M[0, 0], heave.K[0, 0], heave.D[0, 0]) == (5.0, 200.0, 0.2)


def inertia_of(scene: Scene) -> Floats:
    M = Oracle(scene).matrices()[0]
    return np.array(M.tolist(), dtype=float)


def test_a_spring_at_a_rope_that_is_hoisted_is_refused() -> None:
    scene = crane()
    spring = Spring(between=("pendulum[1].links[1]", "ground@2.0,3.0"), stiffness=4.0)
    with pytest.raises(SceneError, match=r"spring\[1\]"):
        matrices_along(scene.replace(spring=(*scene.spring, spring)))
