"""The error of closed-form motions from what they leave of the equations, against simulation and formulas."""

from __future__ import annotations

from math import inf

import mpmath
import numpy as np
import pytest
from scenes import minimal, motion_scene
from scipy.signal import cont2discrete

from modal import Bob, Cart, Pendulum, Rod, Scene, load, matrices, natural_modes
from nonlinear.accuracy.references import apart
from nonlinear.dynamics import Mechanics
from nonlinear.reduction import defect_error, residual_forces, rest_angles, start_in_mode, superpose
from nonlinear.reduction.defect import DEFECT_SAFETY, SAMPLES_PER_PERIOD, StepResponse, running
from nonlinear.reduction.modal_coordinates import factors, join, split
from nonlinear.simulation import simulate
from nonlinear.system import Motion, State, of_plane, system_of
from nonlinear.system.state import unit_vectors

SIMPLE = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=0.7),)),))
PAPER = load("paper-cart-2")
STANDING = Scene(
    gravity=9.81,
    support=Cart(mass=3.0, stiffness=2.0),
    pendulum=(
        Pendulum(links=(Rod(mass=1, length=1, stiffness=40), Rod(mass=0.7, length=0.6)), equilibrium=("up", "down")),
        Pendulum(links=(Bob(mass=1, length=0.8),)),
    ),
)


def aside(scene: Scene, size: float, seed: int) -> State:
    rng = np.random.default_rng(seed)
    return State(rest_angles(scene) + size * rng.uniform(-1, 1, scene.n_links), size * rng.normal(size=scene.n_links))


def in_space(scene: Scene) -> Scene:
    return scene.model_copy(update={"space": "space"})


def spatial(scene: Scene, size: float, seed: int) -> State:
    along, across = aside(scene, size, seed), aside(scene, size, seed + 1)
    return join(scene, *(motion(part.links[None], part.link_rates[None]) for part in (along, across)))[0]


def motion(links: np.ndarray, rates: np.ndarray, *cart: np.ndarray) -> Motion:
    none = np.zeros(len(links))
    return Motion(links, rates, *(cart or (none, none)), none)


def against_simulation(scene: Scene, start: State, duration: float) -> None:
    """Both estimates against the true errors, to which no other estimate fits."""
    run = simulate(scene, duration, start=start, tolerance=1e-12, output=600)
    closed = superpose(scene, start, corrected=True)
    for form in (closed, closed.linear):
        estimate, true = defect_error(form, duration), apart(form(run.times), run.motion).max()
        assert estimate is not None
        assert estimate.trustworthy
        assert true < estimate.bounds[-1] == DEFECT_SAFETY * estimate.error
        assert true / estimate.error == pytest.approx(1.0, abs=0.15)
        assert true / estimate.bounds[-1] != pytest.approx(1.0, abs=0.15)


def test_a_simple_pendulum_is_late_as_the_series_says() -> None:
    """By hand: e = a³/16 ωt sin ωt + a³/192 (cos ωt − cos 3ωt) to third order in a."""
    a, omega = 0.02, np.sqrt(9.81 / 0.7)
    defect = defect_error(superpose(SIMPLE, State(np.array([a]), np.zeros(1)), corrected=False), 30.0)
    phase = omega * defect.times
    series = a**3 * (phase * np.sin(phase) / 16 + (np.cos(phase) - np.cos(3 * phase)) / 192)
    assert defect.at == pytest.approx(np.maximum.accumulate(np.abs(series)), rel=5e-3, abs=1e-2 * a**3)
    assert defect.error == pytest.approx(np.abs(series).max(), rel=2e-3)
    assert defect.trustworthy


def test_small_motions_are_linear() -> None:
    """The error is of the third order, down to where rounding takes over."""
    start = aside(PAPER, 1.0, 3)
    small, twice, least = (
        defect_error(superpose(PAPER, State(a * start.links, a * start.link_rates), corrected=False), 20.0).error
        for a in (1e-4, 2e-4, 1e-9)
    )
    assert twice / small == pytest.approx(8.0, rel=1e-3)
    assert 1e-16 < least / 1e-9 < 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_the_estimate_is_the_error_in_the_plane(seed: int) -> None:
    scene = motion_scene(seed, standing=False, longest=5)
    against_simulation(scene, aside(scene, 0.01, seed), 8.0)


@pytest.mark.parametrize("scene", [STANDING, load("chain-spatial"), load("crane-hook")], ids=["up", "chain", "hook"])
def test_the_estimate_is_the_error_in_space(scene: Scene) -> None:
    scene = in_space(scene)
    against_simulation(scene, spatial(scene, 0.05, 4), 2.0)


def test_what_is_too_large_is_not_trusted() -> None:
    defect = defect_error(superpose(PAPER, State(np.full(4, 1.2), np.zeros(4)), corrected=False), 60.0)
    assert not defect.trustworthy
    assert defect.bounds[-1] == inf
    assert defect.error > 0.1


@pytest.mark.parametrize("shape", ["plane", "space"])
def test_the_residual_does_the_work_that_the_energy_gains(shape: str) -> None:
    """dE/dt = ρ·q' of an arbitrary motion without dampers, by differences of the energy."""
    scene = STANDING.model_copy(update={"space": shape})
    rng, n, h = np.random.default_rng(7), scene.n_links, 1e-4
    t = np.array([-h, 0.0, h])
    planes = []
    for size in (n + 1, n)[: 1 + (shape == "space")]:
        c = 0.6 * rng.normal(size=(4, size, 1))
        planes.append(np.array([np.polynomial.polynomial.polyval(t, d)[:, 0] for d in derivatives(c)]))
    flat = [plane[:2].transpose(0, 2, 1) for plane in planes]
    rest = rest_angles(scene)
    (q, v), cart = flat[0], (flat[0][0, :, 0], flat[0][1, :, 0])
    moved = motion(q[:, 1:] + rest, v[:, 1:], *cart)
    if shape == "space":
        moved = join(scene, moved, motion(flat[1][0] + rest, flat[1][1]))
    energy = Mechanics(system_of(scene), moved).energy
    forces = residual_forces(system_of(scene), planes)
    power = sum(float(force[:, 1] @ plane[1, :, 1]) for force, plane in zip(forces, planes, strict=True))
    assert (energy[2] - energy[0]) / (2 * h) == pytest.approx(power, rel=1e-6)
    assert abs(power) > 1.0


def derivatives(c: np.ndarray) -> list[np.ndarray]:
    """Polynomial coefficients (4, n, 1) of a motion and its two rates."""
    return [c, *(np.polynomial.polynomial.polyder(c, order) for order in (1, 2))]


@pytest.mark.parametrize("seed", range(6))
def test_the_true_motion_leaves_nothing(seed: int) -> None:
    scene = motion_scene(seed)
    system, rng, on = system_of(scene), np.random.default_rng(seed), scene.support.kind == "cart"
    n = system.n_links + on
    equations = minimal(system)
    y = np.zeros(equations.layout.size)
    y[: 2 * n] = rng.normal(size=2 * n)
    rest = np.concatenate(([0.0] * on, rest_angles(scene)))
    rate = equations.derivative(0.0, y)
    plane = np.array([y[:n] - rest, y[n : 2 * n], rate[n : 2 * n]])[..., None]
    size = matrices(scene).M.max() * np.abs(plane).max() ** 2
    assert np.abs(residual_forces(system, [plane])[0]).max() < 1e-13 * size
    assert np.abs(residual_forces(system, [1.001 * plane])[0]).max() > 1e-6 * size


def test_the_running_sum_is_the_recursion() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 7, 64, 101):
        E, g = 0.3 * rng.normal(size=(4, 4)), rng.normal(size=(count, 4))
        expected = [g[0]]
        for row in g[1:]:
            expected.append(E @ expected[-1] + row)
        assert np.allclose(running(E, g), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 4, 5])
def test_a_step_is_that_of_a_first_order_hold(seed: int) -> None:
    scene, step = motion_scene(seed, standing=False), 0.2
    model = matrices(scene)
    n, inverse = len(model.M), np.linalg.inv(model.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ model.K, -inverse @ model.D]])
    B, identity = np.vstack((np.zeros((n, n)), inverse)), np.eye(2 * n)
    E, hold, *_ = cont2discrete((A, B, identity, np.zeros((2 * n, n))), step, "zoh")
    _, mixed, _, ramp, _ = cont2discrete((A, B, identity, np.zeros((2 * n, n))), step, "foh")
    ours = StepResponse.of(model, step)
    assert np.allclose(ours.E, E, rtol=1e-10, atol=1e-12)
    assert np.allclose(ours.hold, hold, rtol=1e-10, atol=1e-12)
    assert np.allclose(ours.ramp, ramp, rtol=1e-10, atol=1e-12)
    assert np.allclose(E @ ours.ramp + ours.hold - ours.ramp, mixed, rtol=1e-10, atol=1e-12)


def test_where_nothing_can_be_said_cheaply() -> None:
    bob = Pendulum(links=(Bob(mass=1.0, length=1.0),))
    massless = Scene(gravity=9.81, support=Cart(mass=0.0, stiffness=5.0), pendulum=(bob,))
    many = Scene(gravity=9.81, pendulum=(bob.model_copy(update={"count": 101}),))
    swinging = start_in_mode(massless, natural_modes(massless), 0)
    for scene, start in ((massless, swinging), (many, aside(many, 0.1, 0))):
        assert defect_error(superpose(scene, start, corrected=False), 5.0) is None
    simple = superpose(SIMPLE, aside(SIMPLE, 0.1, 0), corrected=False)
    assert defect_error(simple, 1e5) is None
    assert defect_error(simple, 1e3) is not None


def test_the_linear_motion_shares_its_modes() -> None:
    start, times = aside(PAPER, 0.2, 2), np.linspace(0.0, 9.0, 50)
    corrected, linear = (superpose(PAPER, start, corrected=corrected) for corrected in (True, False))
    assert np.array_equal(corrected.linear(times).links, linear(times).links)
    assert np.abs(corrected(times).links - linear(times).links).max() > 1e-3


def test_a_standing_link_turns_to_the_same_side_in_space() -> None:
    start, times = aside(STANDING, 0.1, 5), np.linspace(0.0, 3.0, 40)
    plane = superpose(STANDING, start, corrected=False)(times)
    space = superpose(in_space(STANDING), of_plane(start), corrected=False)(times)
    assert np.abs(unit_vectors(plane.links, 0.0) - space.links).max() < 1e-12
    assert np.abs(plane.cart - space.cart).max() < 1e-12
    along, _ = split(in_space(STANDING), of_plane(start))
    assert np.allclose([along.links, along.link_rates], [start.links, start.link_rates], atol=1e-14)


def test_the_bound_of_a_closed_form_is_above_its_error_and_near_it() -> None:
    start = State(np.radians([8.0, 5.0]), np.zeros(2))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, count=2),)),))
    motion = superpose(scene, start, corrected=True)
    estimate = defect_error(motion, 5.0)
    assert estimate is not None
    run = simulate(scene, 5.0, start=start, tolerance=1e-12)
    error = np.abs(motion(run.times).links - run.motion.links).max()
    assert 1.0 < estimate.bounds[-1] / error < 4.0


def test_quotients_of_small_angles_keep_their_digits() -> None:
    """Against mpmath, on either side of where series replace them."""
    angles = np.geomspace(1e-4, 0.5, 200)
    with mpmath.workdps(40):
        exact = [(x * mpmath.cos(x) - mpmath.sin(x)) / x**3 for x in map(mpmath.mpf, angles.tolist())]
        off = [abs(float(r / value - 1)) for r, value in zip(factors(angles)[1], exact, strict=True)]
    assert max(off) < 4e-12


@pytest.mark.parametrize(("share", "is_sampled"), [(3e-4, False), (3e-3, True)])
def test_oscillations_of_a_thousandth_of_the_acceleration_are_sampled_in_each_of_their_periods(
    share: float, is_sampled: bool
) -> None:
    scene = load("chain-2")
    modes, duration = natural_modes(scene), 400.0
    slow, fast = (modes.shape(number).angles for number in (0, 1))
    inertia = [angles @ matrices(scene).M @ angles for angles in (slow, fast)]
    ratio = share * (modes.omega[0] / modes.omega[1]) ** 2 * np.sqrt(inertia[0] / inertia[1])
    start = State(1e-3 * (slow + ratio * fast), np.zeros(2))
    estimate = defect_error(superpose(scene, start, corrected=False), duration)
    per_period = len(estimate.times) / (duration * modes.omega / (2 * np.pi))
    assert (per_period[1] >= SAMPLES_PER_PERIOD) == is_sampled
    assert per_period[0] >= SAMPLES_PER_PERIOD
