"""Periodic orbits on structures: they close in the simulator, and what they do not follow is refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from modal import Bob, Pendulum, Scene, load, natural_modes
from modal.scene import Spring
from modal.scene.supports import Cart, Swing
from nonlinear.orbits import mode_orbit
from nonlinear.simulation import simulate
from nonlinear.system import apart

SWING_AND_CART = Scene(
    gravity=9.81,
    support=[
        Swing(name="left", mass=2.0, length=0.5),
        Cart(name="right", mass=3.0, position=(1.0, 0.0), stiffness=5.0),
    ],
    pendulum=[
        Pendulum(on="left", links=[Bob(mass=1.0, length=0.6)]),
        Pendulum(on="right", links=[Bob(mass=0.5, length=0.4)]),
    ],
)


@pytest.mark.parametrize("mode", [2, 3])
def test_orbits_of_a_mode_close_in_the_simulator(mode: int) -> None:
    orbit = mode_orbit(SWING_AND_CART, mode, np.radians(20.0))
    assert orbit.amplitude == pytest.approx(np.radians(20.0))
    linear = natural_modes(SWING_AND_CART).omega[mode - 1]
    assert 0 < abs(orbit.omega / linear - 1) < 0.02
    run = simulate(SWING_AND_CART, orbit.period, start=orbit.state, output=2, tolerance=1e-11)
    assert apart(run.motion.at(slice(0, 1)), run.motion.at(slice(1, 2)))[0] < 1e-7
    assert run.motion.supports[1] == pytest.approx(run.motion.supports[0], abs=1e-7)
    assert orbit.floquet.is_stable
    assert len(orbit.floquet.all) == 8


CARTS = [Cart(name=name, mass=1.0, position=(place, 0.0)) for name, place in (("a", 0.0), ("b", 1.0))]
FREE = Scene(
    gravity=9.81,
    support=CARTS,
    spring=[Spring(between=("a", "b"), stiffness=5.0)],
    pendulum=[Pendulum(on="a", links=[Bob(mass=0.2, length=0.5)])],
)


@pytest.mark.parametrize(("scene", "mode"), [(load("beam").conservative, 1), (FREE, 2)], ids=["board", "free carts"])
def test_orbits_of_what_has_no_mirror_image_or_moves_freely_close(scene: Scene, mode: int) -> None:
    orbit = mode_orbit(scene, mode, 0.1)
    run = simulate(scene, orbit.period, start=orbit.state, output=2, tolerance=1e-11)
    assert apart(run.motion.at(slice(0, 1)), run.motion.at(slice(1, 2)))[0] < 1e-7
    assert orbit.omega == pytest.approx(natural_modes(scene).omega[mode - 1], rel=2e-2)
