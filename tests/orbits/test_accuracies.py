"""The tolerances of periodic orbits have an effect: on equations with known solutions eight times as much fails."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modal import Bob, Pendulum, Scene
from modal.scene import SineForce
from modal.types import Floats
from nonlinear.orbits import cycles, growth
from nonlinear.orbits.continuation import CROSSING_SINGULAR_RATIO, OrbitPoint, correct, point
from nonlinear.orbits.cycles import is_same_orbit
from nonlinear.orbits.floquet import Floquet, Map, of_monodromy
from nonlinear.orbits.orbit import Orbit, largest
from nonlinear.orbits.special import bisect

ALONG = np.array([1.0, 0.0])


class Line:
    """The solutions u = (x, 0), whose orbits miss their start by `residual`."""

    def __init__(self, residual: float = 0.0, stiffness: float = 1.0) -> None:
        self.residual, self.stiffness = residual, stiffness

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        return self.stiffness * u[1:], np.array([[0.0, self.stiffness]])

    def orbit(self, u: Floats) -> Any:
        return SimpleNamespace(residual=self.residual, x=float(u[0]))


def test_an_orbit_that_misses_its_start_is_none() -> None:
    assert point(Line(3e-10), np.zeros(2), ALONG) is not None
    assert point(Line(3e-9), np.zeros(2), ALONG) is None


@pytest.mark.parametrize("at", [0.12345678987654321, 0.76543212345678])
def test_a_change_is_located_as_accurately_as_orbits_are_known(at: float) -> None:
    problem = Line()
    start, end = (OrbitPoint(np.array([x, 0.0]), ALONG, problem.orbit(np.array([x, 0.0]))) for x in (0.0, 1.0))
    changed = bisect(problem, start, end, lambda place: place.orbit.x > at)  # type: ignore[attr-defined]
    assert 0 <= changed.u[0] - at < 1e-10


def test_a_crossing_leaves_what_its_equations_do_not_tell() -> None:
    guess = np.array([0.0, 0.1])
    for stiffness, is_told in ((3e-5, True), (3e-6, False)):
        solution = correct(Line(stiffness=stiffness), guess, ALONG, CROSSING_SINGULAR_RATIO)
        assert solution is not None
        assert bool(abs(solution[0][1]) < 1e-9) is is_told


def cycle(multipliers: list[float], omega: float = 1.0) -> Any:
    return SimpleNamespace(
        omega=omega, period=2 * np.pi / omega, amplitude=0.5, floquet=SimpleNamespace(others=np.array(multipliers))
    )


def test_orbits_a_millionth_apart_are_two() -> None:
    assert is_same_orbit(cycle([0.5]), cycle([0.5], 1 + 5e-7))
    assert not is_same_orbit(cycle([0.5]), cycle([0.5], 1 + 5e-6))


@pytest.mark.parametrize(("aside", "is_left_out"), [(3e-3, True), (3e-2, False)])
def test_the_drift_of_a_cart_is_no_growth(monkeypatch: pytest.MonkeyPatch, aside: float, is_left_out: bool) -> None:
    monkeypatch.setattr(cycles, "_drifts", lambda orbit: [-1e-2])
    orbit = cycle([float(np.exp(-1e-2 * (1 + aside) * 2 * np.pi)), 0.1])
    assert (growth(orbit) < -0.1) is is_left_out


def test_multipliers_leave_the_circle_and_pairs_part_beyond_rounding() -> None:
    for growing, is_stable in ((3e-8, True), (3e-7, False)):
        size = 1 + growing + np.sqrt((1 + growing) ** 2 - 1)
        assert of_monodromy(np.diag([size, 1 / size]), [], [], conservative=True).is_stable is is_stable
    for split, is_stable in ((3e-7, True), (3e-6, False)):
        C = np.array([[0.3, -split], [split, 0.3]])
        half = Map(C, np.empty((0, 2)), np.empty((0, 2)), half=True, conservative=True)
        others = np.exp([1j, -1j])
        assert Floquet(2, others, half).is_stable is is_stable


def test_the_largest_angle_is_found_between_steps() -> None:
    times = np.array([0.0, 0.7, 1.3, 2.0, 2.8]) - 1.05
    x, v = np.cos(times)[:, None], -np.sin(times)[:, None]
    assert largest(times, x, v, -x)[0] == pytest.approx(1.0, abs=1e-6)


def read(quantity: str, **parts: Any) -> Any:
    """A quantity of an orbit of one link with these parts."""
    layout = SimpleNamespace(first=0)
    flow = SimpleNamespace(equations=SimpleNamespace(layout=layout), system=SimpleNamespace(rest=np.zeros(1)))
    return vars(Orbit)[quantity].func(SimpleNamespace(flow=flow, turns=(), period=1.0, **parts))


@pytest.mark.parametrize(("doubled", "is_symmetric"), [(3e-5, True), (3e-4, False)])
def test_a_motion_that_misses_its_mirror_image_is_not_symmetric(doubled: float, is_symmetric: bool) -> None:
    times = np.arange(128) / 128
    q = np.cos(2 * np.pi * times) + doubled * np.cos(4 * np.pi * times) / 2
    assert read("is_symmetric", _samples=(times, q[:, None], q[:, None])) is is_symmetric


@pytest.mark.parametrize(("part", "has_phase"), [(3e-2, True), (3e-3, False)])
def test_a_faint_fundamental_has_no_phase(part: float, has_phase: bool) -> None:
    push = SineForce(on="pendulum[0].links[0]", amplitude=1.0, frequency_hz=1.0)
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])], force=[push])
    times = np.arange(128) / 128
    q = part * np.cos(2 * np.pi * times) + np.cos(np.pi * 2 * 3 * times)
    phases = read("phases", scene=scene, _samples=(times, q[:, None], q[:, None]), amplitudes=np.array([1.0]))
    assert bool(np.isfinite(phases[0])) is has_phase
