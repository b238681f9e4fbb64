"""Orbits of the swinging mode of two links of which one stands: against shooting with SciPy on Lagrange's equations."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
import scipy

from modal.errors import SceneError
from modal.scene import Bob, Pendulum, Scene
from modal.types import Floats
from nonlinear.orbits import mode_orbit, nonlinear_mode

G, MASSES, LENGTHS = 9.81, (1.0, 0.5), (1.0, 0.6)
Way = Literal["down", "up"]
SWINGING: dict[tuple[Way, Way], int] = {("down", "up"): 1, ("up", "down"): 2}


def scene(ways: tuple[Way, Way]) -> Scene:
    links = tuple(Bob(mass=m, length=l) for m, l in zip(MASSES, LENGTHS, strict=True))
    return Scene(gravity=G, pendulum=(Pendulum(links=links, equilibrium=list(ways)),))


def slope(_: float, y: Floats) -> Floats:
    (m, n), (l, k) = MASSES, LENGTHS
    cross, turn = n * l * k * np.cos(y[0] - y[1]), n * l * k * np.sin(y[0] - y[1])
    M = [[(m + n) * l * l, cross], [cross, n * k * k]]
    force = [-turn * y[3] ** 2 - (m + n) * G * l * np.sin(y[0]), turn * y[2] ** 2 - n * G * k * np.sin(y[1])]
    return np.concatenate((y[2:], np.linalg.solve(M, force)))


@pytest.mark.parametrize("ways", [*SWINGING])
def test_the_period_is_that_of_shooting(ways: tuple[Way, Way]) -> None:
    orbit = mode_orbit(scene(ways), SWINGING[ways], np.radians(40))
    rest = np.array([0.0 if way == "down" else np.pi for way in ways])
    released = orbit.y[:2] - rest

    def missing(unknown: Floats) -> Floats:
        start = rest + np.array([released[0], unknown[0]])
        run = scipy.integrate.solve_ivp(
            slope, (0, unknown[1] / 4), [*start, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13
        )
        return np.asarray(run.y[:2, -1] - rest)

    root = scipy.optimize.root(missing, [0.95 * released[1], 1.03 * orbit.period], tol=1e-12)
    assert root.success
    assert np.abs(released).max() == pytest.approx(np.radians(40), rel=1e-9)
    assert [released[1], orbit.period] == pytest.approx(root.x, rel=1e-8)
    assert not orbit.is_stable


@pytest.mark.parametrize("ways", [*SWINGING])
def test_a_mode_that_grows_has_no_orbits(ways: tuple[Way, Way]) -> None:
    with pytest.raises(SceneError, match="grows without oscillating"):
        nonlinear_mode(scene(ways), 3 - SWINGING[ways])
