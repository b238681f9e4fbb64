"""Nonlinear normal modes against closed forms, the simulator, the table's κ and published turning points."""

from __future__ import annotations

from functools import lru_cache
from math import pi, radians, sqrt

import numpy as np
import pytest
from amounts import usually
from scipy.optimize import brentq
from scipy.special import ellipk

from modal import Bob, Pendulum, Rod, Scene, load, natural_modes
from modal.errors import ComputationError, SceneError
from modal.scene.parameters import parse_variations
from nonlinear.dynamics import Mechanics
from nonlinear.integration import modes_of
from nonlinear.orbits import Branch, mode_along, nonlinear_mode
from nonlinear.orbits.continuation import locate
from nonlinear.orbits.symmetric import quarter_of
from nonlinear.simulation import simulate

G = 9.81
TUNED = ((0.596761, 28.65, -0.884, 31.07), (0.623386, 28.70, -0.997, 28.76))
TUNED += ((0.674588, 28.81, -1.147, 26.40), (0.737636, 28.91, -1.199, 26.79))


def rods(lower: float) -> Scene:
    return Scene(gravity=G, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0), Rod(mass=1.0, length=lower))),))


def with_ratio(ratio: float) -> Scene:
    """Two rods whose frequencies have this ratio."""

    def off(lower: float) -> float:
        slow, fast = natural_modes(rods(lower)).omega
        return float(fast / slow - ratio)

    return rods(float(brentq(off, 0.45, 0.72)))


@lru_cache
def backbone(name: str, number: int, to: float) -> Branch:
    return nonlinear_mode(load(name), number, radians(to))


def test_a_simple_pendulum_to_179_degrees_has_the_period_of_the_elliptic_integral() -> None:
    scene = Scene(gravity=G, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),))
    branch = nonlinear_mode(scene, 1, radians(179), tolerance=1e-14, longest=0.4)
    exact = 2 * pi / (4 * ellipk(np.sin(branch.amplitude / 2) ** 2) / sqrt(G))
    assert branch.complete
    assert branch.amplitude[-1] == pytest.approx(radians(179), abs=1e-9)
    assert np.abs(branch.omega / exact - 1).max() < 1e-11
    assert branch.energy == pytest.approx(G * (1 - np.cos(branch.amplitude)), rel=1e-11)
    assert branch.special == ()
    assert all(branch.is_stable)


@pytest.mark.parametrize(("lower", "printed", "shift", "truth"), TUNED)
def test_near_one_to_three_shifts_and_the_angle_of_1_percent(
    lower: float, printed: float, shift: float, truth: float
) -> None:
    scene = rods(lower)
    linear = natural_modes(scene).omega[0]
    branch = nonlinear_mode(scene, 1, radians(printed), longest=0.2, locate=False)
    assert 100 * (branch.omega[-1] / linear - 1) == pytest.approx(shift, abs=0.01)
    further = nonlinear_mode(scene, 1, radians(32), longest=0.2, locate=False)
    off = further.omega / linear - 0.99
    at = int(np.flatnonzero(off < 0)[0])
    point = locate(quarter_of(scene, 1e-12), *further.points[at - 1 : at + 1], lambda p: p.orbit.omega / linear - 0.99)
    assert np.rad2deg(point.orbit.amplitude) == pytest.approx(truth, abs=0.01)


@pytest.mark.parametrize(
    ("ratio", "angle"), usually([(3.069, 68)], [(3.005, 23), (3.0125, 34), (3.036, 52), (3.069, 68)])
)
def test_mode_1_turns_in_frequency_just_above_one_to_three(ratio: float, angle: float) -> None:
    branch = nonlinear_mode(with_ratio(ratio), 1, radians(72), longest=0.25)
    turns = [special.orbit for special in branch.special if special.kind == "fold" and special.of == "omega"]
    assert branch.complete
    assert len(turns) == 2
    assert np.rad2deg(turns[0].amplitude) == pytest.approx(angle, abs=1.0)
    assert turns[1].amplitude < turns[0].amplitude / 2


@pytest.mark.parametrize("ratio", [2.85, 2.93, 2.998])
def test_mode_1_does_not_turn_below_one_to_three(ratio: float) -> None:
    branch = nonlinear_mode(with_ratio(ratio), 1, radians(60), longest=0.2)
    assert branch.complete
    assert not [special for special in branch.special if special.of == "omega"]


BACKBONES = [("chain-2", number, 60.0 / number) for number in (1, 2)]
BACKBONES += [("paper-cart-2", number, 60.0 if number < 4 else 25.0) for number in usually((3,), (2, 3, 4, 5))]


@pytest.mark.parametrize(("name", "number", "to"), BACKBONES)
def test_orbits_of_a_backbone_close_keep_their_energy_and_have_the_frequency_of_a_run(
    name: str, number: int, to: float
) -> None:
    branch = backbone(name, number, to)
    assert branch.complete
    assert max(orbit.residual for orbit in branch.orbits) < 1e-10
    orbit = branch.orbits[-1]
    states = np.vstack((orbit.y, orbit.path.states))
    energy = Mechanics(orbit.flow.system, orbit.motion(states)).energy
    assert np.ptp(energy) < 1e-10 * energy[0]
    times = np.linspace(0, 5 * orbit.period, 6)
    run = simulate(load(name).conservative, float(times[-1]), start=orbit.state, output=times, tolerance=1e-12)
    assert np.abs(run.motion.links - orbit.state.links).max() < 1e-8
    assert np.abs(run.motion.link_rates).max() < 1e-8 * orbit.omega * 5
    assert np.abs(run.motion.cart - orbit.state.cart).max() < 1e-8


@pytest.mark.parametrize(("name", "number", "to"), BACKBONES)
def test_kappa_is_the_slope_of_a_backbone_at_rest(name: str, number: int, to: float) -> None:
    """(ω(a)/ω − 1)/q² with q = max |φ η|, the angle of the linear part at release, extrapolated to 0."""
    mode, a = modes_of(load(name))[number - 1], 0.02
    shape = np.real(modes_of(load(name)).shape(number - 1).angles)
    leader = int(np.abs(shape).argmax())
    branch = nonlinear_mode(load(name), number, a, first=a / 2, tolerance=1e-14, longest=a / 2, locate=False)
    slopes, squares = [], []
    for orbit in (branch.orbits[0], branch.orbits[-1]):
        size = (orbit.state.links[leader] / shape[leader]) ** 2
        slopes.append((orbit.omega / mode.omega - 1) / size)
        squares.append(size)
    slope = slopes[0] - squares[0] * (slopes[1] - slopes[0]) / (squares[1] - squares[0])
    assert slope == pytest.approx(mode.kappa, rel=1e-5)


def test_orbits_of_one_amplitude_turn_where_the_lower_rod_tunes_the_modes_to_one_to_three() -> None:
    (variation,) = parse_variations(["pendulum[0].links[1].length=0.5:0.6:2"])
    branch = mode_along(rods(0.55), 1, variation, radians(30))
    folds = [special for special in branch.special if special.of == variation.path]
    assert branch.value[0] == branch.value[-1] == pytest.approx(0.5)
    assert len(folds) == 1
    assert np.rad2deg(branch.amplitude) == pytest.approx(30.0, abs=1e-6)
    middle = branch.orbits[2]
    assert middle.value is not None
    alone = nonlinear_mode(rods(middle.value), 1, radians(30), longest=0.2, locate=False).orbits[-1]
    assert middle.omega == pytest.approx(alone.omega, rel=1e-9)


def test_an_orbit_of_given_energy_has_it() -> None:
    orbit = nonlinear_mode(load("paper-cart-2"), 3, energy=4.0, longest=0.3, locate=False).orbits[-1]
    heights = Mechanics(orbit.flow.system, orbit.motion(orbit.y[None])).potential.sum()
    assert orbit.energy == pytest.approx(4.0, rel=1e-9)
    assert heights == pytest.approx(4.0, rel=1e-9)


def test_what_is_no_mode_is_refused() -> None:
    scene = load("paper-cart-2")
    with pytest.raises(SceneError, match="modes 1 to 5"):
        nonlinear_mode(scene, 6)
    with pytest.raises(SceneError, match="translation"):
        nonlinear_mode(scene, 1)
    with pytest.raises(SceneError, match="plane"):
        nonlinear_mode(load("chain-spatial"), 1)


def test_a_branch_that_cannot_begin_says_so() -> None:
    scene = load("chain-2")
    with pytest.raises(ComputationError, match="no periodic orbit"):
        nonlinear_mode(scene, 2, 3.0, first=1.5)
