"""Floquet multipliers against a perturbed long run, and their identities."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from modal import Body, Cart, Pendulum, Scene, load, natural_modes
from modal.types import Complexes, Floats
from nonlinear.orbits import Orbit, nonlinear_mode
from nonlinear.simulation import simulate
from nonlinear.system import State

NEAR = 1e-6


def random_scene(seed: int) -> Scene:
    """A chain of two bodies, or two pendula of one or two on a free or a held cart."""
    rng = np.random.default_rng(seed)

    def hung(n: int) -> Pendulum:
        numbers = rng.uniform(0.3, 2, (n, 4)) * [1, 1, 0.5, 0.3]
        return Pendulum(links=[Body(mass=m, length=l, centre=c * l, inertia=i) for m, l, c, i in numbers])

    if seed % 3 == 0:
        return Scene(gravity=9.81, pendulum=(hung(2),))
    cart = Cart(mass=float(rng.uniform(0.5, 5)), stiffness=float(seed % 3 - 1) * 3)
    return Scene(gravity=9.81, support=cart, pendulum=(hung(1), hung(1 + seed % 2)))


def orbit_of(seed: int) -> Orbit:
    """An orbit of 20 to 50 deg of a mode that swings."""
    scene, rng = random_scene(seed), np.random.default_rng(seed)
    modes = natural_modes(scene)
    number = int(rng.choice([mode.number for mode in modes if mode.omega > 0]))
    return nonlinear_mode(scene, number, radians(rng.uniform(20, 50)), longest=0.3, locate=False).orbits[-1]


def perturbed(orbit: Orbit) -> Floats:
    """The monodromy matrix from runs of the simulator a little beside, by central differences."""
    size, scale = len(orbit.y), orbit.flow.scale
    layout, ends = orbit.flow.equations.layout, []
    for sign in (1, -1):
        for i in range(size):
            y = orbit.y + sign * NEAR * scale[i] * np.eye(size)[i]
            end = simulate(
                orbit.scene, orbit.period, start=layout.state(y), output=[0.0, orbit.period], tolerance=1e-13
            )
            ends.append(begin(end.motion[-1], orbit))
    ahead, behind = np.array(ends[:size]), np.array(ends[size:])
    return ((ahead - behind) / (2 * NEAR) / scale[:, None]).T


def begin(state: State, orbit: Orbit) -> Floats:
    return np.asarray(orbit.flow.equations.layout.begin(state))


def characteristic(multipliers: Complexes) -> Floats:
    """The coefficients of the polynomial with these zeros: a comparison that nearly equal ones do not spoil."""
    return np.real(np.poly(multipliers))


@pytest.mark.parametrize("seed", range(30))
def test_multipliers_are_those_of_a_perturbed_run(seed: int) -> None:
    orbit = orbit_of(seed)
    brute = np.linalg.eigvals(perturbed(orbit))
    found, expected = characteristic(orbit.floquet.all), characteristic(brute)
    assert found == pytest.approx(expected, abs=2e-7 * np.abs(expected).max())
    for own in orbit.floquet.others:
        near = np.abs(brute - own).min()
        assert near < 2e-5 * max(1.0, abs(own))


@pytest.mark.parametrize("seed", range(30))
def test_multipliers_of_conservative_scenes_are_symplectic_pairs(seed: int) -> None:
    """Those of the whole monodromy matrix, which no symmetry was used for."""
    orbit = orbit_of(seed)
    passed = orbit.flow(orbit.y, np.eye(len(orbit.y)), orbit.period)
    polynomial = np.poly(passed.V)
    assert polynomial == pytest.approx(polynomial[::-1], abs=1e-8 * np.abs(polynomial).max())
    assert characteristic(orbit.floquet.all) == pytest.approx(polynomial, abs=1e-8 * np.abs(polynomial).max())
    assert np.linalg.det(passed.V) == pytest.approx(1.0, abs=1e-8)
    assert orbit.floquet.neutral == (4 if isinstance(orbit.scene.support, Cart) and seed % 3 == 1 else 2)


def test_an_orbit_that_loses_its_stability_is_left_by_a_run_beside_it() -> None:
    """At 100 deg the second mode of two equal rods has lost its stability; the first at 30 deg has not."""
    for number, to, stable in ((1, 30, True), (2, 100, False)):
        orbit = nonlinear_mode(load("chain-2"), number, radians(to), longest=0.2, locate=False).orbits[-1]
        assert orbit.is_stable is stable
        periods = 12
        start = State(orbit.state.links + np.array([1e-7, -2e-7]), orbit.state.link_rates + 1e-7)
        times = np.arange(periods + 1) * orbit.period
        run = simulate(orbit.scene, float(times[-1]), start=start, output=times, tolerance=1e-13)
        left = np.abs(run.motion.links - orbit.state.links).max(axis=1)
        assert bool(left[-1] > 1e-4) is not stable
