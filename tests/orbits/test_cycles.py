"""Limit cycles: against the benchmark's own equations, perturbed runs, closed forms and simulation."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import exp, pi, sqrt

import floquet
import numpy as np
import pytest
from amounts import usually

from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import ComputationError, SceneError
from modal.scene import Escapement, scene_from
from modal.scene.parameters import Variation, parse_variations, vary
from nonlinear.averaging import average, relative_equilibria
from nonlinear.orbits import (
    Branch,
    Orbit,
    Special,
    cycle_of,
    follow_cycles,
    leaving_branch,
    limit_cycles,
    periodic_orbit,
)
from nonlinear.orbits.report import special_words
from nonlinear.simulation import simulate
from nonlinear.synchronization import agreement
from nonlinear.system import AppliedForces, State

DETUNED = "pendulum[1].links[0].inertia"


@cache
def cycle(pair: floquet.Pair, words: str) -> tuple[Orbit, floquet.Orbit]:
    state = next(
        equilibrium for equilibrium in relative_equilibria(average(pair.scene)) if agreement(equilibrium) == words
    )
    return cycle_of(pair.scene, state), floquet.near(pair, state)


RATES = [(6.0, -0.01932), (8.0, -0.00461), (9.0, 0.00396), (11.0, 0.02321)]


@pytest.mark.parametrize(("angle", "told"), usually(RATES[1:3], RATES))
def test_antiphase_of_metronomes_grows_at_the_published_rate(angle: float, told: float) -> None:
    orbit, other = cycle(floquet.metronomes(angle), "antiphase")
    rates = np.log(np.abs(orbit.floquet.others)) / orbit.period
    drift = np.abs(rates + other.pair.drift).argmin()
    assert np.delete(rates, drift).max() == pytest.approx(told, abs=1e-5)
    assert orbit.is_stable is (told < 0)
    assert orbit.floquet.neutral == 2


PAIRS = [(floquet.metronomes(10.0, 3.0, 6e-5), "in phase"), (floquet.huygens(10.0), "antiphase")]
PAIRS += [(floquet.huygens(10.0), "in phase"), (floquet.huygens(40.0), "in phase")]
PAIRS += [(floquet.huygens(10.0, 10.0), "in phase")]


@pytest.mark.parametrize(("pair", "words"), PAIRS)
def test_cycles_and_multipliers_are_those_of_other_equations_kicks_included(pair: floquet.Pair, words: str) -> None:
    orbit, other = cycle(pair, words)
    assert orbit.period == pytest.approx(other.period, rel=1e-10)
    exponents = np.log(orbit.floquet.others) / orbit.period
    for exponent in other.exponents:
        at = np.abs(exponents - exponent).argmin()
        assert exponents[at] == pytest.approx(exponent, abs=1e-7)
        exponents = np.delete(exponents, at)
    assert exponents == pytest.approx([-pair.drift], rel=1e-3)


def test_multipliers_of_kicked_clocks_are_those_of_a_perturbed_run() -> None:
    """Central differences of runs of the simulator over one period, projected on the phase's complement."""
    scene = floquet.Pair(0.082, 0.14, 0.14, 0.0, 1.35e-4, 10.0, 4.0, floquet.huygens(1).drive, extra=2e-6).scene
    orbit = next(cycle for cycle in limit_cycles(scene) if cycle.is_stable)
    layout, size, scale = orbit.flow.equations.layout, len(orbit.y), orbit.flow.scale
    ends = []
    for sign in (1, -1):
        for i in range(size):
            start = layout.state(orbit.y + sign * 1e-6 * scale[i] * np.eye(size)[i])
            run = simulate(scene, orbit.period, start=start, output=[0.0, orbit.period], tolerance=1e-12)
            ends.append(layout.begin(run.motion[-1])[:size])
    brute = np.linalg.eigvals((np.array(ends[:size]) - ends[size:]).T / (2e-6 * scale))
    expected = np.poly(orbit.floquet.all)
    assert np.poly(brute) == pytest.approx(expected.real, abs=1e-5 * np.abs(expected).max())


def divergence(orbit: Orbit) -> float:
    """The integral of the trace of the Jacobian over a period, by Gauss's rule on its steps."""
    x, w = np.polynomial.legendre.leggauss(10)
    total, times = 0.0, np.unique(orbit.path.times)
    for begin, end in pairwise(times):
        nodes = (begin + end) / 2 + (end - begin) / 2 * x
        rows = orbit.states_at(nodes)
        total += sum(
            weight * (end - begin) / 2 * np.trace(orbit.flow.equations.linearize(row)[1])
            for weight, row in zip(w, rows, strict=True)
        )
    return float(total)


def test_the_product_of_multipliers_is_the_exponential_of_the_divergence() -> None:
    orbit, _ = cycle(floquet.metronomes(9.0), "antiphase")
    assert np.prod(orbit.floquet.all).real == pytest.approx(exp(divergence(orbit)), rel=1e-8)


DRIVEN = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.2)])])


def test_under_a_periodic_force_the_orbit_is_where_a_long_run_ends() -> None:
    rate = 2.5
    start = State(np.array([0.3]), np.zeros(1))
    orbit = periodic_orbit(DRIVEN, start, 2 * pi / rate, force=lambda time: np.array([0.8 * np.cos(rate * time)]))
    assert orbit.is_stable
    assert orbit.floquet.neutral == 0
    assert np.prod(orbit.floquet.all).real == pytest.approx(exp(-0.2 * orbit.period), rel=1e-9)

    def push(time: float, state: State) -> AppliedForces:
        return AppliedForces(moments=np.array([0.8 * np.cos(rate * time)]))

    times = np.array([0.0, 80 * orbit.period])
    run = simulate(DRIVEN, float(times[-1]), start=start, load=push, output=times, tolerance=1e-11)
    assert run.motion.links[-1] == pytest.approx(orbit.state.links, abs=1e-7)
    small = periodic_orbit(DRIVEN, start, 2 * pi / rate, force=lambda time: np.array([1e-4 * np.cos(rate * time)]))
    assert small.amplitude == pytest.approx(1e-4 / sqrt((9.81 - rate**2) ** 2 + (0.2 * rate) ** 2), rel=1e-6)


@cache
def detuned() -> tuple[floquet.Pair, tuple[Branch, ...]]:
    pair = floquet.metronomes(10.0, 3.0, 6e-5)
    return pair, follow_cycles(pair.scene, parse_variations([f"{DETUNED}=1e-5:1.01e-5:2"])[0])


def detuned_fold() -> tuple[Branch, Special]:
    branch = detuned()[1][0]
    return branch, next(special for special in branch.special if special.kind == "fold")


def slipped(scene: Scene, start: State, omega: float, duration: float) -> float:
    """The largest change of the phase between two pendula (rad) in a run."""
    run = simulate(scene, duration, start=start, output=int(20 * duration) + 1, tolerance=1e-9)
    psi = np.unwrap(np.arctan2(-run.motion.link_rates / omega, run.motion.links), axis=0)
    between = psi[:, 1] - psi[:, 0]
    return float(np.abs(between - between[0]).max())


def test_the_critical_detuning_is_a_fold() -> None:
    branch, fold = detuned_fold()
    critical = fold.orbit.value
    assert critical is not None
    assert fold.of == DETUNED
    assert np.abs(fold.orbit.floquet.others - 1).min() < 1e-5
    stable, after = branch.is_stable, fold.after
    assert len(set(stable[: after + 1])) == len(set(stable[after + 1 :])) == 1
    assert stable[0] is not stable[-1]


def test_simulation_confirms_the_critical_detuning_from_both_sides() -> None:
    (pair, _), (_, fold) = detuned(), detuned_fold()
    critical = fold.orbit.value
    assert critical is not None
    for beyond, locks in ((-0.05, True), (0.05, False)):
        value = 1e-5 + (critical - 1e-5) * (1 + beyond)
        slip = slipped(vary(pair.scene, {DETUNED: value}), fold.orbit.state, fold.orbit.omega, 1800.0)
        assert bool(slip < pi / 2) is locks


def test_branches_leave_at_a_branch_point_where_two_clocks_in_phase_lose_their_stability() -> None:
    (variation,) = parse_variations(["support.mass=26.5:27:4"])
    branches = follow_cycles(load("huygens"), variation, longest=1.0)
    branch, special = next((branch, special) for branch in branches for special in branch.special)
    assert special.kind == "branch point"
    assert special.orbit.value == pytest.approx(26.68, abs=0.01)
    below, above = (
        neighbour.is_stable for neighbour in (branch.orbits[special.after], branch.orbits[special.after + 1])
    )
    assert below is not above
    assert "where it becomes stable" in special_words(branch, special)
    leaving = leaving_branch(branch, special, max_orbits=2)
    orbit = leaving.orbits[-1]
    angles = orbit.amplitudes
    assert abs(angles[0] - angles[1]) > 1e-4
    assert orbit.residual < 1e-10
    run = simulate(orbit.scene, orbit.period, start=orbit.state, output=[0.0, orbit.period], tolerance=1e-12)
    assert run.motion.links[-1] == pytest.approx(orbit.state.links, abs=1e-9)


def test_what_has_no_limit_cycles_is_refused() -> None:
    (variation,) = parse_variations(["support.mass=1:10:3"])
    with pytest.raises(SceneError, match="nothing drives"):
        follow_cycles(load("paper-cart-2"), variation)
    with pytest.raises(SceneError, match="two or more values"):
        follow_cycles(load("huygens"), parse_variations(["support.mass=3"])[0])
    still = Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=DRIVEN.pendulum)
    with pytest.raises(ComputationError, match="no periodic orbit"):
        periodic_orbit(still, State(np.array([1.2]), np.zeros(1)), 1.7)


def test_rest_is_no_limit_cycle() -> None:
    bob = {"kind": "bob", "mass": 1.0, "length": 1.0, "damping": 0.02}
    drive = {"kind": "van-der-pol", "strength": 0.1, "angle_deg": 8.0}
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [{**bob, "drive": drive}]}]})
    still = State(np.array([1e-12]), np.zeros(1))
    with pytest.raises(ComputationError, match="no limit cycle was found"):
        follow_cycles(scene, Variation("gravity", (9.0, 10.0)), start=(still, 2.0))


def test_newton_does_not_begin_at_the_kick_of_another_clock() -> None:
    """Three clocks in splay, from a state of the orbit: its period is that of benchmarks/sync/births.py."""
    numbers = ((0.2521, 0.00296), (0.2511, 0.00289), (0.2522, 0.0032))
    drives = [Escapement(impulse=impulse, angle_deg=2.0165) for _, impulse in numbers]
    pairs = zip(numbers, drives, strict=True)
    links = [Bob(mass=1.0, length=length, damping=0.0206, drive=drive) for (length, _), drive in pairs]
    cart = Cart(mass=4.55, damping=8.18, stiffness=27.4)
    scene = Scene(gravity=9.81, support=cart, pendulum=[Pendulum(links=[link]) for link in links])
    angles, rates = np.array([0.0, -0.072727, 0.070602]), np.array([0.494355, -0.174864, -0.357078])
    orbit = periodic_orbit(scene, State(angles, rates, 6.406e-05, 0.001128), 1.02022)
    assert orbit.period == pytest.approx(1.020219311, rel=1e-7)
    assert np.abs(orbit.floquet.others).max() == pytest.approx(0.9415, abs=1e-4)
