"""Floquet multipliers against a perturbed long run, their identities, and stability that changes within a step."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import radians

import numpy as np
import pytest
from amounts import usually

from modal import Bob, Body, Cart, Pendulum, Scene, load, natural_modes
from modal.types import Complexes, Floats
from nonlinear.orbits import Branch, Orbit, nonlinear_mode
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
    """The monodromy matrix from perturbed runs of the simulator, by central differences."""
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


@pytest.mark.parametrize("seed", usually(range(0, 30, 2), range(30)))
def test_multipliers_are_those_of_a_perturbed_run(seed: int) -> None:
    orbit = orbit_of(seed)
    brute = np.linalg.eigvals(perturbed(orbit))
    coefficients, expected = characteristic(orbit.floquet.all), characteristic(brute)
    assert coefficients == pytest.approx(expected, abs=2e-7 * np.abs(expected).max())
    for multiplier in orbit.floquet.others:
        near = np.abs(brute - multiplier).min()
        assert near < 2e-5 * max(1.0, abs(multiplier))


@pytest.mark.parametrize("seed", usually(range(1, 30, 2), range(30)))
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


UPPER = (Bob(mass=0.2345, length=1.466), Bob(mass=1.377, length=0.636847))
LOWER = (
    Body(mass=2.5794, length=0.3696, centre=0.0851, inertia=0.05237),
    Body(mass=2.9729, length=0.9236, centre=0.5361, inertia=0.03901),
)
SCENE = Scene(gravity=6.491, support=Cart(mass=5.379), pendulum=(Pendulum(links=UPPER), Pendulum(links=LOWER)))
EDGES = (17.767, 17.809, 22.451, 22.682)


@cache
def branch(to: float) -> Branch:
    return nonlinear_mode(SCENE, 4, radians(to), longest=0.16)


@pytest.mark.parametrize("to", [24.0, 29.0])
def test_bubbles_of_instability_do_not_depend_on_where_the_branch_ends(to: float) -> None:
    special = branch(to).special
    assert [special_point.kind for special_point in special] == ["collision"] * 4
    assert np.degrees([special_point.orbit.amplitude for special_point in special]) == pytest.approx(EDGES, abs=2e-3)
    before = [branch(to).is_stable[special_point.after] for special_point in special]
    assert before == [True, False, True, False]
    assert sum(not stable for stable in branch(to).is_stable) == 2


def test_the_simulator_leaves_the_orbits_of_a_bubble_and_stays_beside_those_around_it() -> None:
    points = branch(29.0).orbits
    bubbles = [at for at, orbit in enumerate(points) if not orbit.is_stable]
    for at, growth in zip(bubbles, (1.0025, 1.0142), strict=True):
        inside, outside = (np.abs(np.linalg.eigvals(perturbed(points[k]))).max() for k in (at, at - 1))
        assert inside == pytest.approx(growth, abs=1e-3)
        assert inside == pytest.approx(np.abs(points[at].floquet.others).max(), abs=2e-4)
        assert outside < 1 + (growth - 1) / 2


def test_equal_pendula_that_lose_stability_together_do_so_at_a_branch_point() -> None:
    links = (Bob(mass=1.0, length=1.0),)
    scene = Scene(gravity=9.81, support=Cart(mass=10.0), pendulum=(Pendulum(links=links, count=3),))
    mode = nonlinear_mode(scene, 2, radians(40), longest=0.3)
    stable = mode.is_stable
    changes = sum(before is not other for before, other in pairwise(stable))
    assert changes == len({special_point.after for special_point in mode.special})
