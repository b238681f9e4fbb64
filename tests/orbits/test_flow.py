"""The flow and its derivative: against complex steps, SciPy, differences, linear modes, and by identities."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from support.scenes import complex_step, motion_scene, plane_scene, random_state

from modal import Bob, Cart, Pendulum, Rod, Scene, load
from modal.assembly import matrices
from modal.scene import Moved, SineMotion, scene_from
from modal.scene.parameters import parse_variations
from modal.types import Floats
from nonlinear.dynamics.variational import Variational
from nonlinear.orbits import Flow, periodic_orbit
from nonlinear.orbits.shooting import shooting
from nonlinear.system import State, system_of

RESISTED = Scene(
    gravity=9.81,
    support=Cart(mass=2.0, damping=0.2, stiffness=30.0),
    damping_ratio=0.02,
    pendulum=[Pendulum(links=[Rod(mass=1.0, length=0.7, drag=0.3), Bob(mass=0.5, length=0.4, drag=0.1, damping=0.02)])],
)


@pytest.mark.parametrize("seed", range(20))
def test_the_jacobian_agrees_with_complex_steps_through_the_recursion(seed: int) -> None:
    system = system_of(plane_scene(seed))
    equations = Variational(system)
    y = equations.begin(random_state(system, seed))
    rate, slope = equations.linearize(y)
    size = len(y)
    plain, stepped = complex_step(system, np.repeat(y[:, None], size, axis=1), np.eye(size))
    assert rate == pytest.approx(plain[:, 0], rel=1e-11, abs=1e-11 * np.abs(rate).max())
    assert slope == pytest.approx(stepped, rel=1e-10, abs=1e-11 * np.abs(slope).max())


@pytest.mark.parametrize("seed", usually(range(4), range(8)))
def test_the_flows_derivative_has_the_determinant_of_the_divergence(seed: int) -> None:
    """d(log det V)/dt = tr J (Liouville), with the integral by Gauss's rule on the steps of the flow."""
    system = system_of(motion_scene(seed, longest=2, most=2))
    flow = Flow(system, 1e-12)
    y = flow.equations.begin(random_state(system, seed))
    x, w = np.polynomial.legendre.leggauss(12)
    passed = flow(y, np.eye(len(y)), 0.25)
    total, here = 0.0, y
    for begin, end in zip(passed.path.times[:-1], passed.path.times[1:], strict=True):
        at, now = begin, here
        for node, weight in zip(x, w, strict=True):
            time = (begin + end) / 2 + (end - begin) / 2 * node
            now, at = flow(now, np.zeros((len(y), 0)), time - at).y, time
            total += weight * (end - begin) / 2 * np.trace(flow.equations.linearize(now)[1])
        here = flow(now, np.zeros((len(y), 0)), end - at).y
    assert np.log(np.linalg.det(passed.V)) == pytest.approx(total, abs=1e-8 * max(1.0, abs(total)))


@pytest.mark.parametrize("seed", range(8))
def test_gradients_of_energy_and_momentum_are_carried_by_the_flow(seed: int) -> None:
    """Left vectors of the flow's derivative: ∇E(φ(y)) V = ∇E(y) where nothing drains energy, momentum likewise."""
    system = system_of(motion_scene(seed, damped=False, longest=2, most=2))
    flow = Flow(system, 1e-12)
    y = flow.equations.begin(random_state(system, seed))
    passed = flow(y, np.eye(len(y)), 0.4)
    gradients = [flow.equations.energy_slope]
    if system.cart and not system.cart.stiffness:
        gradients.append(flow.equations.momentum_slope)
    for gradient in gradients:
        before = gradient(y)
        assert gradient(passed.y) @ passed.V == pytest.approx(before, abs=1e-9 * np.abs(before).max())


@pytest.mark.parametrize(
    "scene", [motion_scene(3, longest=2), plane_scene(8), RESISTED], ids=("damped", "plane", "air")
)
def test_the_flow_is_that_of_scipy_with_derivatives_by_complex_steps(scene: Scene) -> None:
    system = system_of(scene)
    flow = Flow(system, 1e-12)
    y = flow.equations.begin(random_state(system, 1))
    flown, size = flow(y, np.eye(len(y)), 0.15), len(y)

    def rate(_: float, both: Floats) -> Floats:
        z, V = both[:size], both[size:].reshape(size, size)
        f, change = complex_step(system, np.repeat(z[:, None], size, axis=1), V)
        return np.concatenate((f[:, 0], change.ravel()))

    end = solve_ivp(rate, (0, 0.15), np.concatenate((y, np.eye(size).ravel())), "DOP853", rtol=1e-12, atol=1e-12).y[
        :, -1
    ]
    assert flown.y == pytest.approx(end[:size], rel=1e-9, abs=1e-9)
    V = end[size:].reshape(size, size)
    assert pytest.approx(flown.V, rel=1e-8, abs=1e-9 * np.abs(V).max()) == V


def test_derivatives_of_kicked_flows_are_those_of_differences() -> None:
    flow, y = Flow(system_of(load("huygens")), 1e-12), np.array([0.0, 0.11, -0.1, 0.0, 0.0, 0.0])
    passed, none = flow(y, np.eye(6), 1.3), np.zeros((6, 0))
    assert np.sum(np.diff(passed.path.times) == 0) >= 2
    for k, step in enumerate(1e-6 * np.diag(flow.scale)):
        slope = (flow(y + step, none, 1.3).y - flow(y - step, none, 1.3).y) / (2 * step[k])
        assert passed.V[:, k] == pytest.approx(slope, rel=1e-6, abs=1e-6 * np.abs(passed.V[:, k]).max())


def test_both_ways_to_the_jacobian_agree_at_one_state_and_at_many() -> None:
    system = system_of(RESISTED)
    sparse, directed = Variational(system), Variational(system)
    y = np.random.default_rng(2).standard_normal((sparse.size, 3))
    rates, slopes = sparse.linearize(y)
    other = directed._by_directions(y, ())
    assert rates == pytest.approx(other[0], rel=1e-12)
    assert slopes == pytest.approx(other[1], rel=1e-11, abs=1e-11)
    for k in range(3):
        rate, slope = sparse.linearize(y[:, k])
        assert rate == pytest.approx(rates[:, k], rel=1e-13)
        assert slope == pytest.approx(slopes[k], rel=1e-12, abs=1e-12)


def test_small_orbits_under_drag_and_damping_ratios_lose_what_the_modes_lose() -> None:
    """Floquet exponents of an orbit under a small force are the eigenvalues of its matrices, whatever the force."""
    start = State(np.zeros(2), np.zeros(2))
    orbit = periodic_orbit(
        RESISTED, start, 2.0, force=lambda time: np.array([0.0, 1e-4 * np.cos(np.pi * time), 0.0]), tolerance=1e-15
    )
    model = matrices(RESISTED)
    M, K, C = model.M, model.K, model.D
    none, identity = np.zeros((3, 3)), np.eye(3)
    s = np.linalg.eigvals(np.block([[none, identity], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    assert np.poly(orbit.floquet.others) == pytest.approx(np.poly(np.exp(2.0 * s)).real, abs=1e-8)


def test_what_resists_a_free_cart_leaves_an_impulse_that_is_conserved() -> None:
    """p_x and the impulse of dampers, drag and damping ratios, all linear in the rates, at large angles."""
    scene = RESISTED.model_copy(update={"support": Cart(mass=2.0, damping=0.2)})
    system = system_of(scene)
    flow = Flow(system, 1e-12)
    y = flow.equations.begin(random_state(system, 4))
    passed = flow(y, np.eye(len(y)), 0.7)
    before = flow.equations.momentum_slope(y)
    assert before[0] > 0.2
    assert flow.equations.momentum_slope(passed.y) @ passed.V == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, np.pi], ids=("hanging", "upright"))
def test_the_derivative_is_exact_where_the_motion_stands_still(angle: float) -> None:
    """At an equilibrium V = exp(J T), and y, which does not move, allows steps of any length."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.5), Bob(mass=0.4, length=0.3)])])
    flow = Flow(system_of(scene), 1e-12)
    y = np.array([angle, angle, 0.0, 0.0])
    passed = flow(y, np.eye(4), 1.5)
    known = expm(1.5 * flow.equations.linearize(y)[1])
    assert pytest.approx(passed.V, rel=1e-8, abs=1e-9 * np.abs(known).max()) == known
    assert len(passed.path.times) < 10


@pytest.mark.parametrize("rate", [25.0, 12.0], ids=("held up", "falling"))
def test_multipliers_of_an_upright_pendulum_on_a_shaken_support_are_those_of_hill(rate: float) -> None:
    """θ'' = (g + z'')/l θ about the upright position, by SciPy; θ stands still, so its own error allows any step."""
    support = Moved(motion=SineMotion(direction="vertical", amplitude=0.1, frequency_hz=rate / (2 * np.pi)))
    scene = Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.5)])])
    system = system_of(scene)
    assert system.support
    flow, moved = Flow(system, 1e-12), system.support.motions[0][1]
    period = 2 * np.pi / rate
    M = flow(np.array([np.pi, 0.0]), np.eye(2), period).V

    def hill(time: float, z: Floats) -> Floats:
        pull = (9.81 + moved.acceleration_at(time)) / 0.5
        return np.array([z[2], z[3], pull * z[0], pull * z[1]])

    end = solve_ivp(hill, (0, period), [1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    assert pytest.approx(M, abs=1e-9) == end.reshape(2, 2)
    assert np.linalg.det(M) == pytest.approx(1, abs=1e-9)
    assert (abs(np.trace(M)) < 2) == (rate > np.sqrt(2 * 9.81 * 0.5) / 0.1)


NUMBERS = ("gravity", "pendulum[0].links[0].length", "support.mass", "pendulum[0].links[1].drag")


@pytest.mark.parametrize("path", NUMBERS)
def test_derivatives_by_a_number_of_the_scene_are_those_of_differences(path: str) -> None:
    (variation,) = parse_variations([f"{path}=0.2:2:3"])
    value, none = 0.8, np.zeros((6, 0))
    problem = shooting(RESISTED, variation=variation)
    flow, y = problem.flow_at(value), np.array([0.1, 0.9, -0.5, 0.2, 0.4, 1.0])
    assert flow.change is not None
    slopes = flow(y, np.eye(6), 1.1).V
    before, other = (problem.flow_at(value + step)(y, none, 1.1).y for step in (-1e-5, 1e-5))
    slope = (other - before) / 2e-5
    assert slopes[:, -1] == pytest.approx(slope, rel=1e-7, abs=1e-8 * np.abs(slope).max())
    plain = Flow(flow.system, flow.tolerance)(y, np.eye(6), 1.1).V
    assert slopes[:, :-1] == pytest.approx(plain, rel=1e-12, abs=1e-12)


KICKED = {
    "gravity": 9.81,
    "support": {"kind": "cart", "mass": 2.0, "damping": 0.3, "stiffness": 9.0, "friction": 1.2},
    "pendulum": [
        {
            "links": [
                {
                    **{"kind": "rod", "mass": mass, "length": length, "damping": 0.02, "friction": 0.03},
                    "drive": {"kind": "escapement", "impulse": 0.05, "angle_deg": angle},
                }
            ]
        }
        for mass, length, angle in ((1.0, 0.5, 6.0), (0.6, 0.7, 4.0))
    ],
}
SWITCHING = {
    "pendulum[0].links[0].drive.impulse": 0.05,
    "pendulum[0].links[0].drive.angle_deg": 6.0,
    "pendulum[1].links[0].friction": 0.03,
    "support.friction": 1.2,
    "support.mass": 2.0,
    "pendulum[1].links[0].length": 0.7,
}


@pytest.mark.parametrize("path", SWITCHING)
def test_derivatives_by_a_number_go_through_kicks_and_contacts(path: str) -> None:
    value, none = SWITCHING[path], np.zeros((6, 0))
    (variation,) = parse_variations([f"{path}={value / 2}:{2 * value}:3"])
    problem = shooting(scene_from(KICKED), variation=variation, tolerance=1e-13)
    flow, y = problem.flow_at(value), np.array([0.05, 0.3, -0.25, 0.1, -0.4, 0.5])
    assert flow.change is not None
    flown = flow(y, np.eye(6), 2.5)
    assert flow.switched_equations is not None
    kinds = {int(happening[1]) for happening in flow.switched_equations.switches.events}
    assert kinds & {0, 1}
    assert kinds - {0, 1}
    step = 1e-5 * value
    ends = {k: problem.flow_at(value + k * step)(y, none, 2.5).y for k in (-2, -1, 1, 2)}
    slope = (8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * step)
    assert flown.V[:, -1] == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("spacing", ["", "log"])
def test_the_equations_of_orbits_know_their_slope_by_the_place_of_a_number(spacing: str) -> None:
    (variation,) = parse_variations([f"pendulum[0].links[0].length=0.2:2:3{spacing}"])
    problem = shooting(RESISTED, variation=variation, segments=1)
    u = problem.unknown(np.array([[0.1, 0.9, -0.5, 0.2, 0.4, 1.0]]), 1.1, 0.8)
    step = np.append(np.zeros(len(u) - 1), 1e-5)
    slope = (problem.equations(u + step)[0] - problem.equations(u - step)[0]) / 2e-5
    assert problem.equations(u)[1][:, -1] == pytest.approx(slope, rel=1e-7, abs=1e-8 * np.abs(slope).max())
