"""Drag where the air's velocity has further parts: with hoists, and on supports that move."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, sin

import numpy as np
import pytest
from dense_form import DenseForm
from scipy.integrate import solve_ivp

from modal import Bob, InitialCondition, Pendulum, Rod, Scene
from modal.scene import Cart, Fixed, Hoist, Moved, RandomMotion, RecordMotion, SineMotion, SweepMotion
from modal.vibration import parametric_stability
from nonlinear import simulate
from nonlinear.dynamics import (
    Generated,
    Hamiltonian,
    Maximal,
    Minimal,
    Recursion,
    Spatial,
    SpatialRecursion,
)
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.system import State, of_plane, system_of

G = 9.81
LAWS = [(0.4, 0.0), (0.0, 0.3), (0.2, 0.5)]
TIMES = tuple((np.arange(30) * 0.1).tolist())
MOTIONS = [
    SineMotion(amplitude=0.3, frequency_hz=0.9, phase_deg=20.0),
    SineMotion(direction="vertical", amplitude=0.05, frequency_hz=6.0),
    SweepMotion(amplitude=0.05, from_hz=0.2, to_hz=3.0, duration=2.5),
    RecordMotion(direction="vertical", time_s=TIMES, acceleration_m_per_s2=tuple(np.sin(4 * np.array(TIMES)).tolist())),
    RandomMotion(psd=(1.0, 1.0), frequency_hz=(0.1, 5.0), seed=3, duration=20.0),
]


def hoisting(linear: float, quadratic: float, support: Fixed | Cart) -> Scene:
    """Ropes that change their length at three places, with drag everywhere."""
    air = {"drag": linear, "quadratic_drag": quadratic}
    links = (
        Bob(mass=2.0, length=1.0, damping=0.1, hoist=Hoist(to=0.5, duration=2.0), **air),
        Rod(mass=1.0, length=0.7, stiffness=3.0, **air),
        Bob(mass=0.3, length=0.5, hoist=Hoist(to=1.5, begin=0.5, duration=1.0, profile="trapezoidal"), **air),
    )
    pendula = (Pendulum(count=2, links=links), Pendulum(links=(Bob(mass=1.0, length=1.0, **air),)))
    return Scene(gravity=G, support=support, pendulum=pendula)


def moved(motion: object, linear: float, quadratic: float, space: str = "plane") -> Scene:
    air = {"drag": linear, "quadratic_drag": quadratic}
    links = (Bob(mass=1.3, length=1.1, **air), Rod(mass=0.7, length=0.6, damping=0.02, **air))
    start = InitialCondition(angles_deg=(30.0, -50.0), rates_deg=(10.0, 5.0))
    return Scene(gravity=G, space=space, support=Moved(motion=motion), pendulum=(Pendulum(links=links, start=start),))


def swinging(scene: Scene) -> State:
    cart = {"cart": 0.3, "cart_rate": -0.7} if scene.support.kind == "cart" else {}
    return State(np.linspace(-0.8, 1.0, scene.n_links), np.linspace(1.0, -0.5, scene.n_links), **cart)


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
@pytest.mark.parametrize("support", [Fixed(), Cart(mass=3.0, damping=0.2, stiffness=5.0)], ids=["fixed", "cart"])
@pytest.mark.parametrize("time", [0.3, 0.9, 1.7])
def test_accelerations_and_power_beside_a_hoist_are_those_of_free_bodies(
    linear: float, quadratic: float, support: Fixed | Cart, time: float
) -> None:
    """In maximal coordinates drag acts on the velocities of centres, of which ropes that wind are a part."""
    scene = hoisting(linear, quadratic, support)
    system, state = system_of(scene), swinging(scene)
    written, free, on_cart = Generated(system), Maximal(system), scene.support.kind == "cart"
    rates = written.derivative(time, written.begin(state))
    other = free.derivative(time, free.begin_at(state, time))
    size = free.pivots.size
    turned = other[size : 2 * size][2 * on_cart :].reshape(-1, 3)[:, 2]
    assert rates[-1 - scene.n_links : -1] == pytest.approx(turned, rel=1e-10, abs=1e-10)
    assert rates[-1] == pytest.approx(other[-1], rel=1e-10)
    if on_cart:
        assert rates[written.layout.half] == pytest.approx(other[size], rel=1e-10)


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
def test_a_bob_on_a_rope_that_is_hauled_in_the_air(linear: float, quadratic: float) -> None:
    """m (l θ'' + 2 l' θ') = −m g sin θ − (d + q |v|) l θ' with v = (l', l θ'): Newton's law across the rope."""
    mass, hoist = 0.8, Hoist(to=0.4, begin=0.2, duration=1.5)
    bob = Bob(mass=mass, length=1.2, drag=linear, quadratic_drag=quadratic, hoist=hoist)
    scene = Scene(gravity=G, pendulum=(Pendulum(links=(bob,), start=InitialCondition(angles_deg=(50.0,))),))
    law = hoist.law(1.2)

    def rate(t: float, y: np.ndarray) -> list[float]:
        length, speed, _ = map(float, law(t))
        resisted = (linear + quadratic * hypot(speed, length * y[1])) * y[1] / mass
        return [y[1], -G * sin(y[0]) / length - 2 * speed * y[1] / length - resisted]

    parts, y = [0.0, 0.2, 1.7, 3.0], [np.radians(50.0), 0.0]
    for begin, end in pairwise(parts):
        y = solve_ivp(rate, (begin, end), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    run = simulate(scene, 3.0, tolerance=1e-12)
    assert run.motion.links[-1, 0] == pytest.approx(y[0], abs=1e-9)
    assert abs(run.energy_drift()) < 1e-9
    start = scene.pendulum[0].start
    without = simulate(Scene(gravity=G, pendulum=(Pendulum(links=(bob.replace(hoist=None),), start=start),)), 3.0)
    assert abs(run.motion.links[-1, 0] - without.motion.links[-1, 0]) > 1e-2


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: f"{motion.kind} {motion.direction}")
def test_drag_on_a_moved_support_by_every_form(motion: object, linear: float, quadratic: float) -> None:
    scene = moved(motion, linear, quadratic)
    system, state = system_of(scene), swinging(scene)
    recursion = Minimal(system, tuple(Recursion(group) for group in system.groups))
    forms = [Generated(system), recursion, DenseForm(system)]
    rates, *others = (form.derivative(0.7, form.begin(state)) for form in forms)
    for other in others:
        assert other == pytest.approx(rates, rel=1e-11, abs=1e-12)
    free, canonical = Maximal(system), Hamiltonian(system)
    maximal = free.derivative(0.7, free.begin(state))
    assert maximal[free.pivots.size : 2 * free.pivots.size].reshape(-1, 3)[:, 2] == pytest.approx(rates[2:4], rel=1e-10)
    assert maximal[-1] == pytest.approx(rates[-1], rel=1e-10)
    assert canonical.derivative(0.7, canonical.begin(state))[-1] == pytest.approx(rates[-1], rel=1e-10)


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
@pytest.mark.parametrize("motion", MOTIONS[:2], ids=["along", "vertical"])
def test_a_bob_in_still_air_under_a_shaken_pivot(motion: SineMotion, linear: float, quadratic: float) -> None:
    """m l θ'' = n·(m g e_z − m a − (d + q |v|) v), v = v_0(t) + l θ' n, n across the rod: Newton's law."""
    mass, length, seconds = 0.8, 0.9, 4.0
    links = (Bob(mass=mass, length=length, drag=linear, quadratic_drag=quadratic),)
    start = InitialCondition(angles_deg=(20.0,))
    scene = Scene(gravity=G, support=Moved(motion=motion), pendulum=(Pendulum(links=links, start=start),))
    amplitude, omega = motion.amplitude, 2 * np.pi * motion.frequency_hz
    way = np.array([0.0, -1.0] if motion.direction == "vertical" else [1.0, 0.0])

    def rate(t: float, y: np.ndarray) -> list[float]:
        phase, across = omega * t + np.radians(motion.phase_deg), np.array([cos(y[0]), -sin(y[0])])
        v = amplitude * omega * cos(phase) * way + length * y[1] * across
        force = mass * (np.array([0.0, G]) + amplitude * omega**2 * sin(phase) * way)
        force = force - (linear + quadratic * hypot(*v)) * v
        return [y[1], float(across @ force) / (mass * length)]

    y = solve_ivp(rate, (0.0, seconds), [np.radians(20.0), 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    run = simulate(scene, seconds, tolerance=1e-12)
    assert run.motion.links[-1, 0] == pytest.approx(y[0], abs=1e-9)
    assert abs(run.energy_drift()) < 1e-9


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
@pytest.mark.parametrize("motion", MOTIONS[:2], ids=["along", "vertical"])
def test_in_the_plane_of_the_rail_space_is_the_plane(motion: SineMotion, linear: float, quadratic: float) -> None:
    flat, solid = (system_of(moved(motion, linear, quadratic, kind)) for kind in ("plane", "space"))
    plane = Generated(flat)
    space = Spatial(solid, tuple(SpatialRecursion(group) for group in solid.groups))
    state = State(np.array([0.5, -0.9]), np.array([1.0, -2.0]))
    rates, other = plane.derivative(0.7, plane.begin(state)), space.derivative(0.7, space.begin(of_plane(state)))
    sin, cosine = np.sin(state.links), np.cos(state.links)
    u = other[6:12].reshape(2, 3)
    assert u[:, 0] * cosine - u[:, 2] * sin == pytest.approx(rates[2:4], rel=1e-10)
    assert other[-1] == pytest.approx(rates[-1], rel=1e-10)


@pytest.mark.parametrize(("linear", "quadratic"), LAWS)
@pytest.mark.parametrize("ways", [("down", "down"), ("down", "up")], ids=["hanging", "standing"])
def test_multipliers_are_those_of_the_full_equations(linear: float, quadratic: float, ways: tuple[str, str]) -> None:
    """The slopes, by complex steps, of the states after one period as functions of those before."""
    scene = moved(MOTIONS[1], linear, quadratic)
    scene = scene.replace(pendulum=(scene.pendulum[0].replace(equilibrium=ways, start=None),))
    system, period = system_of(scene), 1 / MOTIONS[1].frequency_hz
    equations = Generated(system, counts_work=False)
    step, rest = 1e-30, np.concatenate((system.rest, np.zeros(2)))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        each = y.reshape(4, 4)
        rates = equations.derivative(t, rest[:, None] + 1j * step * each)
        return np.ravel(rates.imag) / step

    end = solve_ivp(rate, (0.0, period), np.eye(4).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    expected = np.linalg.eigvals(end.reshape(4, 4))
    multipliers = parametric_stability(scene).multipliers
    assert np.sort_complex(multipliers) == pytest.approx(np.sort_complex(expected), abs=1e-8)


@pytest.mark.parametrize("motion", MOTIONS[:2], ids=["along", "vertical"])
def test_reactions_in_the_wind_are_those_of_the_maximal_form(motion: SineMotion) -> None:
    run = simulate(moved(motion, 0.4, 0.3), 1.0, output=11)
    expected = Maximal(run.system).reactions(run.motion, run.times)
    forces = reaction_forces_of(run)
    assert forces.pivots == pytest.approx(expected.pivots, rel=1e-9, abs=1e-9)
    assert forces.normal == pytest.approx(expected.normal, rel=1e-9, abs=1e-9)
