"""Motion in space against the plane, Lagrange's equations with multipliers, finite differences and exact solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scenes import spatial_scene
from scipy.integrate import solve_ivp

from modal import pair
from modal.scene import (
    Bob,
    Body,
    Cart,
    InitialCondition,
    Moved,
    Pendulum,
    RandomMotion,
    Rod,
    Scene,
    SineMotion,
    SupportMotion,
    SweepMotion,
)
from nonlinear.dynamics import Generated, Minimal, Spatial, forces, jacobian_of, minimal, spatial
from nonlinear.dynamics.spatial import damper_power, facing, generalized_forces, joint_energy, joint_moments
from nonlinear.integration import methods
from nonlinear.simulation import simulate
from nonlinear.system import (
    AppliedForces,
    Event,
    Load,
    State,
    constants_of,
    entries_of,
    of_plane,
    system_of,
)
from nonlinear.system.state import angles_of, unit_vectors, velocities

EZ = np.array([0.0, 0.0, 1.0])


def spatial_of(scene: Scene, load: Load | None = None, tail: int = 0) -> Spatial:
    system = system_of(scene)
    return Spatial(system, tuple(spatial.SpatialRecursion(group, tail) for group in system.groups), load)


def flat_of(scene: Scene, load: Load | None = None) -> Minimal:
    system = replace(system_of(scene), spatial=False)
    return Minimal(system, tuple(minimal.Recursion(group) for group in system.groups), load)


def single(link: Bob | Rod | Body, **kinds: Any) -> Scene:
    return Scene(gravity=9.81, space="space", pendulum=(Pendulum(links=(link,)),), **kinds)


def flat_state(equations: Spatial, rng: np.random.Generator) -> State:
    size = equations.system.n_links
    return State(rng.uniform(-4, 4, size), 2 * rng.normal(size=size), *rng.normal(size=2))


def any_state(equations: Spatial, rng: np.random.Generator) -> State:
    u, w = rng.normal(size=(2, equations.system.n_links, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    w -= np.sum(u * w, axis=1, keepdims=True) * u
    return State(u, 2 * w, *rng.normal(size=2))


def parts(equations: Spatial, rates: np.ndarray) -> tuple[float, np.ndarray]:
    """x'' and u'' (L, 3) in a derivative."""
    half, first = equations.layout.half, equations.layout.first
    return float(rates[half]) if first else 0.0, rates[half + first : 2 * half].reshape(-1, 3)


def central(f: Callable[[np.ndarray], Any], at: np.ndarray, along: np.ndarray, step: float = 1e-4) -> Any:
    """The derivative of f along a direction, to the fourth order."""
    near, far = (f(at + k * step * along) - f(at - k * step * along) for k in (1, 2))
    return (8 * near - far) / (12 * step)


# the plane


@pytest.mark.parametrize("seed", range(50))
def test_in_the_plane_of_the_rail_space_is_the_plane(seed: int) -> None:
    scene, rng = spatial_scene(seed, odd=True), np.random.default_rng(seed)
    equations, flat = spatial_of(scene, pushed_in_space), flat_of(scene, pushed)
    state = flat_state(equations, rng)
    state = State(unwound(equations, state.links), state.link_rates, state.cart, state.cart_rate)
    rates, expected = (
        equations.derivative(0.3, equations.begin(of_plane(state))),
        flat.derivative(0.3, flat.begin(state)),
    )
    half, first = flat.layout.half, flat.layout.first
    turning = expected[half + first : 2 * half, None] * velocities(state.links, 0.0, 1.0)
    turning -= (state.link_rates**2)[:, None] * unit_vectors(state.links, 0.0)
    cart, links = parts(equations, rates)
    scale = np.abs(turning).max()
    np.testing.assert_allclose(links, turning, rtol=0, atol=1e-12 * scale)
    assert cart == pytest.approx(expected[half] if first else 0.0, abs=1e-12 * scale)
    assert rates[-1] == pytest.approx(expected[-1], rel=1e-12)


def pushed(time: float, state: State) -> AppliedForces:
    return AppliedForces(0.4 + time, 0.1 * np.arange(1, len(state.links) + 1))


def pushed_in_space(time: float, state: State) -> AppliedForces:
    push = pushed(time, state)
    assert push.moments is not None
    return AppliedForces(push.cart, push.moments[:, None] * np.array([0.0, 1.0, 0.0]))


def unwound(equations: Spatial, angles: np.ndarray) -> np.ndarray:
    """The same directions, each joint bent by less than half a turn, as every joint in space is."""
    continued = angles.copy()
    for group in equations.system.groups:
        above = 0.0
        for index, bent in zip(group.index, group.joint_rest, strict=True):
            bend = continued[index] - above - bent
            continued[index] = above + bent + (bend + np.pi) % (2 * np.pi) - np.pi
            above = continued[index]
    return continued


def test_extreme_masses_lose_nothing_in_the_plane_of_the_rail() -> None:
    """A light hook above a load 1e10 times as heavy: the mirror does not mix the plane with what is across it."""
    hook = Pendulum(links=(Bob(mass=1e-5, length=0.3), Rod(mass=1e5, length=2.0), Bob(mass=1.0, length=0.1)))
    scene = Scene(gravity=9.81, space="space", support=Cart(mass=10.0), pendulum=(hook,))
    equations, flat = spatial_of(scene), flat_of(scene)
    state = State(np.array([0.4, -0.3, 1.0]), np.array([0.5, 1.0, -2.0]), 0.0, 0.3)
    rates, expected = equations.derivative(0, equations.begin(of_plane(state))), flat.derivative(0, flat.begin(state))
    across = np.sum(parts(equations, rates)[1] * velocities(state.links, 0.0, 1.0), axis=1)
    np.testing.assert_allclose(across, expected[5:], rtol=1e-12)


# Lagrange's equations with multipliers


def oracle(equations: Spatial, state: State, push: AppliedForces) -> np.ndarray:
    """(x'', u'') from one dense system in x'', every component of u'' and the forces that keep every |u| = 1."""
    system, L = equations.system, equations.system.n_links
    u, w = state.links, state.link_rates
    A, b = np.zeros((L, L)), np.zeros(L)
    for group in system.groups:
        for column in range(group.index.shape[1]):
            at, numbers = group.index[:, column], [getattr(group.block, n)[:, column] for n in NUMBERS]
            A[np.ix_(at, at)], b[at] = pair.inertia_matrix(*numbers), pair.first_moments(*numbers[:3])
    size = 1 + 4 * L
    K, side = np.zeros((size, size)), np.zeros(size)
    K[0, 0] = 1.0
    if system.cart:
        K[0, 0], K[0, 1 : 3 * L : 3] = system.cart.mass + system.mass.sum(), b
        K[1 : 3 * L : 3, 0] = b
        side[0] = push.cart - system.cart.damping * state.cart_rate - system.cart.stiffness * state.cart
    K[1 : 1 + 3 * L, 1 : 1 + 3 * L] = np.kron(A, np.eye(3))
    for i in range(L):
        K[1 + 3 * i : 4 + 3 * i, 1 + 3 * L + i] = K[1 + 3 * L + i, 1 + 3 * i : 4 + 3 * i] = u[i]
        side[1 + 3 * L + i] = -w[i] @ w[i]
    forces = system.gravity * b[:, None] * EZ + joint_forces(equations, u, w) + np.cross(push.moments, u)
    side[1 : 1 + 3 * L] = forces.ravel()
    return np.linalg.solve(K, side)[: 1 + 3 * L]


NUMBERS = ("mass", "length", "centre", "inertia")


def joint_forces(equations: Spatial, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """−∂V/∂u − ∂R/∂w one component at a time, by complex steps."""
    forces, h = np.empty(u.shape), 1e-30
    for at in np.ndindex(u.shape):
        du, dw = u.astype(complex), w.astype(complex)
        du[at] += 1j * h
        dw[at] += 1j * h
        forces[at] = -(springs(equations, du) + rayleigh(equations, u, dw)).imag / h
    return forces


def joints_of(equations: Spatial) -> list[tuple[int, int | None, float, float, float, float]]:
    """(link, link above, its σ, that of the one above, damper, spring), one joint after the other."""
    joints = []
    for group in equations.system.groups:
        sigma, d, k = group.block.sigma, group.block.damping, group.block.stiffness
        for i, p in np.ndindex(group.index.shape):
            above = int(group.index[i - 1, p]) if i else None
            joints.append((int(group.index[i, p]), above, sigma[i, p], sigma[i - 1, p] if i else 1.0, d[i, p], k[i, p]))
    return joints


def springs(equations: Spatial, u: np.ndarray) -> Any:
    bends = (
        (k, np.arccos(sign * upper * u[i] @ (EZ if above is None else u[above])))
        for i, above, sign, upper, _, k in joints_of(equations)
    )
    return sum(k * bend**2 / 2 for k, bend in bends)


def rayleigh(equations: Spatial, u: np.ndarray, w: np.ndarray) -> Any:
    spin = np.cross(u, w)
    apart = ((d, spin[i] - (0.0 if above is None else spin[above])) for i, above, _, _, d, _ in joints_of(equations))
    return sum(d * (turn @ turn) / 2 for d, turn in apart)


def moments_for(equations: Spatial, rng: np.random.Generator) -> AppliedForces:
    return AppliedForces(rng.normal(), rng.normal(size=(equations.system.n_links, 3)))


@pytest.mark.parametrize("seed", range(40))
def test_accelerations_are_those_of_lagrange_with_multipliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = spatial_of(spatial_scene(seed))
    push = moments_for(plain, rng)
    equations = spatial_of(spatial_scene(seed), lambda time, state: push)
    state = any_state(equations, rng)
    x2, u2 = parts(equations, equations.derivative(0.0, equations.begin(state)))
    expected = oracle(equations, state, push)
    np.testing.assert_allclose(np.array([x2, *u2.ravel()]), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_a_load_reaches_the_links() -> None:
    """The comparison with Lagrange would fail if a moment were omitted."""
    scene, rng = spatial_scene(1), np.random.default_rng(1)
    equations = spatial_of(scene, lambda time, state: AppliedForces(0.0, np.ones_like(state.links)))
    y = equations.begin(any_state(equations, rng))
    assert np.abs(equations.derivative(0, y)[: equations.layout.half * 2] - free(scene, y)).max() > 1e-3


def free(scene: Scene, y: np.ndarray) -> np.ndarray:
    equations = spatial_of(scene)
    return equations.derivative(0, y[: equations.layout.size])[: equations.layout.half * 2]


# symmetry and power


@pytest.mark.parametrize("seed", range(10))
def test_on_a_fixed_support_no_azimuth_is_special(seed: int) -> None:
    equations, rng = spatial_of(spatial_scene(seed, still=True)), np.random.default_rng(seed)
    state, phi = any_state(equations, rng), rng.uniform(0, 6)
    R = np.array([[np.cos(phi), -np.sin(phi), 0], [np.sin(phi), np.cos(phi), 0], [0, 0, 1]])
    _, still = parts(equations, equations.derivative(0, equations.begin(state)))
    turned = State(state.links @ R.T, state.link_rates @ R.T)
    _, accelerations = parts(equations, equations.derivative(0, equations.begin(turned)))
    np.testing.assert_allclose(accelerations, still @ R.T, rtol=0, atol=1e-12 * np.abs(still).max())


def energy(equations: Spatial, y: np.ndarray) -> Any:
    """T + V from the pair and the springs' angles; complex numbers pass."""
    system, layout = equations.system, equations.layout
    first, half = layout.first, layout.half
    x, v = (y[0], y[half]) if first else (0.0, 0.0)
    u, w = y[first:half].reshape(-1, 3), y[half + first : 2 * half].reshape(-1, 3)
    cart = system.cart
    total = springs(equations, u) + (
        ((cart.mass + system.mass.sum()) * v**2 + cart.stiffness * x**2) / 2 if cart else 0
    )
    for group in system.groups:
        A = np.array(pair.inertia_matrix(*(getattr(group.block, name) for name in NUMBERS)))
        directions, speed = u[group.index], w[group.index]
        total += np.einsum("ijp,ipk,jpk->", A, speed, speed) / 2 + v * np.sum(group.block.b * speed[..., 0])
        total -= system.gravity * np.sum(group.block.b * directions[..., 2])
    return total


@pytest.mark.parametrize("seed", range(15))
def test_the_work_counted_is_what_the_energy_gains(seed: int) -> None:
    rng = np.random.default_rng(seed)
    push = moments_for(spatial_of(spatial_scene(seed)), rng)
    equations = spatial_of(spatial_scene(seed), lambda time, state: push)
    y = equations.begin(any_state(equations, rng))
    rates, h = equations.derivative(0, y), 1e-30
    gained = energy(equations, y + 1j * h * rates).imag / h
    scale = np.abs(rates).max()
    assert gained == pytest.approx(rates[-1], abs=1e-12 * scale * np.sqrt(y.size))
    if any(group.has_dampers for group in equations.system.groups):
        undamped = push.cart * parts_of_cart(equations, y) + np.sum(push.moments * spins(equations, y))
        assert rates[-1] < undamped


def parts_of_cart(equations: Spatial, y: np.ndarray) -> float:
    return float(y[equations.layout.half]) if equations.layout.first else 0.0


def spins(equations: Spatial, y: np.ndarray) -> np.ndarray:
    state = equations.layout.state(y)
    return np.cross(state.links, state.link_rates)


# shapes of numbers


@pytest.mark.parametrize("seed", [0, 3, 7])
def test_trajectories_side_by_side_are_those_one_by_one(seed: int) -> None:
    equations, rng = spatial_of(spatial_scene(seed)), np.random.default_rng(seed)
    Y = np.stack([equations.begin(any_state(equations, rng)) for _ in range(4)], axis=1)
    rates = spatial_of(spatial_scene(seed), tail=1).derivative(0, Y)
    one_by_one = np.stack([equations.derivative(0, y) for y in Y.T], axis=1)
    np.testing.assert_allclose(rates, one_by_one, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_complex_steps_are_tangents(seed: int) -> None:
    equations, rng = spatial_of(spatial_scene(seed)), np.random.default_rng(seed)
    y, along = equations.begin(any_state(equations, rng)), rng.normal(size=equations.layout.size)
    exact = equations.derivative(0, y + 1e-30j * along).imag / 1e-30
    scale = np.abs(exact).max()
    np.testing.assert_allclose(
        central(lambda z: equations.derivative(0, z), y, along), exact, atol=1e-6 * scale, rtol=0
    )


def test_the_sign_of_the_mirror_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    equations, rng = spatial_of(spatial_scene(5)), np.random.default_rng(5)
    y = equations.begin(any_state(equations, rng))
    before = equations.derivative(0, y)
    monkeypatch.setattr(spatial, "facing", lambda u: -facing(u))
    after = equations.derivative(0, y)
    assert not np.array_equal(before, after)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-11 * np.abs(before).max())


@pytest.mark.parametrize("seed", [1, 5, 8])
def test_nor_does_it_where_a_stage_of_a_step_has_left_the_sphere(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    equations, rng = spatial_of(spatial_scene(seed)), np.random.default_rng(seed)
    y = equations.begin(any_state(equations, rng))
    y[: equations.layout.half] *= 1.01
    before = equations.derivative(0, y)
    monkeypatch.setattr(spatial, "facing", lambda u: -facing(u))
    np.testing.assert_allclose(equations.derivative(0, y), before, rtol=0, atol=1e-11 * np.abs(before).max())


def test_links_that_pass_level_cost_no_accuracy() -> None:
    """Three sprung links on a cart, the last of which passes level, against Lagrange's equations with multipliers."""
    links = (Rod(mass=1, length=0.7, stiffness=4), Bob(mass=0.5, length=0.5, stiffness=2))
    tip, start = (
        Bob(mass=0.4, length=0.4, stiffness=1),
        InitialCondition(angles_deg=(70, 20, -60), azimuths_deg=(10, 80, 150)),
    )
    pendulum = Pendulum(links=(*links, tip), start=start)
    scene = Scene(gravity=9.81, space="space", support=Cart(mass=2), pendulum=(pendulum,))
    run = simulate(scene, 0.4, tolerance=1e-10, output=17)
    equations, still = spatial_of(scene), AppliedForces(0.0, np.zeros((3, 3)))

    def lagrange(time: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate((y[10:], oracle(equations, equations.layout.state(y), still)))

    exact = solve_ivp(lagrange, (0, 0.4), equations.begin(run.motion[0]), "DOP853", run.times, rtol=1e-11, atol=1e-12)
    expected = equations.read(exact.y.T).links
    assert np.ptp(np.sign(run.motion.links[..., 2]), axis=0).max() == 2
    assert np.abs(run.motion.links - expected).max() < 2e-10
    assert run.run.drift < 3e-11


# what is written out


MOVED: tuple[SupportMotion, ...] = (
    SineMotion(direction="horizontal", amplitude=0.3, frequency_hz=0.9, phase_deg=20.0),
    SineMotion(direction="vertical", amplitude=0.2, frequency_hz=1.3),
    SweepMotion(direction="horizontal", amplitude=0.05, from_hz=0.2, to_hz=3.0, duration=2.5),
    RandomMotion(direction="vertical", psd=(1.0, 1.0), frequency_hz=(0.1, 5.0), seed=3, duration=20.0),
)


def acted_on(seed: int) -> tuple[Scene, Load | None]:
    """A random scene with springs and dampers, in turn with drag, on a moved support, under a load."""
    rng, scene = np.random.default_rng(seed), spatial_scene(seed)
    if seed % 3 == 1:
        scene = scene.replace(support=Moved(motion=MOVED[seed % 4]))
    elif seed % 2:
        drags: list[dict[str, float]] = [{"drag": 0.3}, {"quadratic_drag": 0.2}, {"drag": 0.1, "quadratic_drag": 0.4}]
        pendula = [
            pendulum.replace(links=tuple(link.replace(**drags[rng.integers(3)]) for link in pendulum.links))
            for pendulum in scene.pendulum
        ]
        scene = scene.replace(pendulum=tuple(pendula))
    return scene, partial(blown, isinstance(scene.support, Cart)) if seed % 4 > 1 else None


def blown(on_cart: bool, time: float, state: State) -> AppliedForces:
    moments = 0.2 * np.cos(time + state.links) + 0.1 * state.link_rates
    return AppliedForces(0.4 + time if on_cart else 0.0, None if time > 1 else moments)


def near(values: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(values - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("seed", range(24))
def test_what_is_written_out_is_the_recursion(seed: int) -> None:
    scene, push = acted_on(seed)
    equations, rng = spatial_of(scene, push), np.random.default_rng(seed)
    written = Generated(equations.system, push)
    assert written.layout == equations.layout
    y = equations.begin(any_state(equations, rng))
    off = 1.01 * y
    for time in (0.3, 1.7):
        for each in (y, off):
            assert near(written.derivative(time, each), equations.derivative(time, each)) < 1e-13
    many = np.stack((y, off, 0.99 * y), axis=1)
    rates = written.derivative(0.3, many)
    assert near(rates, np.stack([written.derivative(0.3, column) for column in many.T], axis=1)) < 1e-13


@pytest.mark.parametrize("seed", usually([4, 6], range(9)))
def test_derivatives_of_what_is_written_are_complex_steps(seed: int) -> None:
    """Of all components by all, through square roots, arctangents and choices: on the tape, and in complex numbers."""
    scene, _ = acted_on(seed)
    equations = spatial_of(scene)
    y = equations.begin(any_state(equations, np.random.default_rng(seed)))
    steps = [equations.derivative(0.3, y + 1e-30j * unit).imag / 1e-30 for unit in np.eye(y.size)]
    exact = np.stack(steps, axis=1)
    written = Generated(equations.system)
    module, rows, columns = jacobian_of(written.form)
    numbers = written.form.numbers(entries_of(equations.system), constants_of(equations.system))
    u = written.inputs_at(0.3, y.tolist()) if written.inputs_at else ()
    values = module.function("jacobian", module.constants(numbers))(y.tolist(), u)
    J = np.zeros_like(exact)
    J[rows, columns] = values[y.size :]
    assert near(J, exact) < 1e-11
    along = np.random.default_rng(seed + 1).normal(size=y.size)
    assert near(written.derivative(0.3, (y + 1e-30j * along)[:, None]).imag[:, 0] / 1e-30, exact @ along) < 1e-12


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_is_written_has_derivatives_where_a_joint_is_straight(side: float) -> None:
    """At rest hanging, k and g make the stiffness; bent right back a spring pulls no way."""
    scene = single(Bob(mass=2.0, length=0.5, stiffness=0.3))
    written = Generated(system_of(scene))
    y = [0.0, 0.0, side, 0.0, 0.0, 0.0]
    assert written.rate(y) == pytest.approx([0.0] * 6)
    module, rows, columns = jacobian_of(written.form)
    values = module.function(
        "jacobian", module.constants(written.form.numbers(entries_of(written.system), constants_of(written.system)))
    )(y)
    J = np.zeros((6, 6))
    J[rows, columns] = values[6:]
    assert np.isfinite(J).all()
    if side > 0:
        expected = -9.81 / 0.5 - 0.3 / (2.0 * 0.25)
        assert J[3:5, :2] == pytest.approx(expected * np.eye(2), rel=1e-14)


@pytest.mark.parametrize("seed", usually([1, 3], [1, 3, 7, 9]))
def test_a_run_in_floats_is_the_run_in_numpy(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, push = acted_on(seed)
    state = any_state(spatial_of(scene), np.random.default_rng(seed))
    start = replace(state, cart=0.0, cart_rate=0.0)
    how: dict[str, Any] = {"start": start, "load": push, "tolerance": 1e-8, "output": 23}
    how |= {"breaks": [1.0]} if push else {}
    written, watched = simulate(scene, 1.1, **how), simulate(scene, 1.1, events=[NEVER], **how)
    monkeypatch.setattr(methods, "FLOATS", 0)
    numbers = simulate(scene, 1.1, **how)
    assert [type(run.equations) for run in (written, watched, numbers)] == [Generated, Generated, Spatial]
    same = numbers.times < 1.0 if push else slice(None)  # floats keep the length of their steps over a break
    for run in (written, watched):
        if not push:
            assert (run.run.steps, run.run.drift) == (numbers.run.steps, pytest.approx(numbers.run.drift, rel=1e-3))
        for part in ("links", "link_rates", "cart", "work"):
            floats, other = getattr(run.motion, part), getattr(numbers.motion, part)
            assert np.abs(floats - other)[same].max() < 1e-10 * max(1.0, np.abs(other).max())
            assert np.abs(floats - other).max() < 1e-7 * max(1.0, np.abs(other).max())
        assert np.abs(np.linalg.norm(run.motion.links, axis=-1) - 1).max() < 1e-15
        assert run.energy_drift() < 1.01 * numbers.energy_drift() + 1e-13
    assert 0 < written.run.drift < 1e-8
    assert written.run.calls <= watched.run.calls


NEVER = Event("never", lambda state: 1.0)


# one pendulum


def run(equations: Spatial, state: State, until: float, **how: Any) -> State:
    y = equations.begin(state)
    solution = solve_ivp(equations.derivative, (0, until), y, "DOP853", rtol=1e-12, atol=1e-12, **how)
    return equations.read(solution.y.T)[-1]


@pytest.mark.parametrize("link", [Bob(mass=2, length=0.7), Rod(mass=2, length=0.7)])
def test_a_conical_pendulum_goes_round_at_its_exact_rate(link: Bob | Rod) -> None:
    """Ω² = g b/(A cos θ), g/(l cos θ) for a bob."""
    theta, until = 1.1, 1.0
    ratio = link.mass * link.centre / (link.inertia + link.mass * link.centre**2)
    omega = np.sqrt(9.81 * ratio / np.cos(theta))
    start = State(unit_vectors([theta], [0.0]), omega * np.sin(theta) * np.array([[0.0, 1.0, 0.0]]))
    end = run(spatial_of(single(link)), start, until)
    np.testing.assert_allclose(end.links, unit_vectors([theta], [omega * until]), atol=1e-9)
    if isinstance(link, Bob):
        assert omega == pytest.approx(np.sqrt(9.81 / (0.7 * np.cos(theta))))


def test_a_spherical_pendulum_keeps_energy_and_angular_momentum() -> None:
    equations = spatial_of(single(Body(mass=1.5, length=1.0, centre=0.4, inertia=0.1)))
    start = any_state(equations, np.random.default_rng(2))
    end = run(equations, start, 2.0)
    before, after = (energy(equations, equations.begin(state)) for state in (start, end))
    assert after == pytest.approx(before, rel=1e-8)
    z = [np.cross(state.links, state.link_rates)[0, 2] for state in (start, end)]
    assert z[1] == pytest.approx(z[0], rel=1e-8)
    assert np.abs(end.links - start.links).max() > 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_neither_rest_is_singular(side: float) -> None:
    equations, w = spatial_of(single(Bob(mass=1, length=0.5, damping=0.2, stiffness=0.3))), np.array([[0.6, -2.0, 0.0]])
    state = State(side * EZ[None], w)
    _, accelerations = parts(equations, equations.derivative(0, equations.begin(state)))
    np.testing.assert_allclose(accelerations, -(w**2).sum() * side * EZ[None] - 0.2 / 0.25 * w, rtol=1e-14)


def test_over_the_top_and_through_the_bottom_in_an_oblique_plane() -> None:
    scene, azimuth, until = single(Rod(mass=1, length=0.8)), 0.7, 1.5
    equations, flat = spatial_of(scene), flat_of(scene)
    angle, rate = np.array([0.0]), np.array([9.0])
    path = solve_ivp(flat.derivative, (0, until), flat.begin(State(angle, rate)), "DOP853", rtol=1e-12, atol=1e-12)
    end = run(equations, State(unit_vectors(angle, azimuth), velocities(angle, azimuth, rate)), until)
    assert path.y[0, -1] > 2 * np.pi
    np.testing.assert_allclose(end.links, unit_vectors(path.y[:1, -1], azimuth), atol=1e-8)


# constraints


def test_project_mends_what_is_violated_and_says_how_much() -> None:
    equations, rng = spatial_of(spatial_scene(3)), np.random.default_rng(3)
    state = any_state(equations, rng)
    y, half = equations.begin(state), equations.layout.half
    assert equations.project(y)[1] < 1e-15
    bad = y.copy()
    bad[equations.layout.first :][:3] *= 1.001
    mended, violation = equations.project(bad)
    assert violation == pytest.approx(1e-3)
    np.testing.assert_allclose(mended, y, atol=1e-15)
    bad = y.copy()
    bad[half + equations.layout.first :][:3] += 0.01 * state.links[0]
    mended, violation = equations.project(bad)
    speed = np.linalg.norm(state.link_rates[0]) + np.sqrt(
        equations.system.gravity / equations.system.by_link("length")[0]
    )
    assert violation == pytest.approx(0.01 / speed, rel=1e-3)
    np.testing.assert_allclose(mended, y, atol=1e-14)


def test_projection_keeps_a_run_on_its_constraints() -> None:
    equations, rng = spatial_of(spatial_scene(4)), np.random.default_rng(4)
    begun = equations.begin(any_state(equations, rng))
    drifts = []
    for mend in (lambda y: equations.project(y)[0], lambda y: y):
        y = begun
        for _ in range(60):
            y = mend(stepped(equations, y, 0.005))
        drifts.append(np.abs(np.linalg.norm(equations.layout.state(y).links, axis=1) - 1).max())
    assert drifts[0] < 1e-15 < 1e-10 < drifts[1]


def stepped(equations: Spatial, y: np.ndarray, h: float) -> np.ndarray:
    """One classical Runge–Kutta step."""
    k1 = equations.derivative(0, y)
    k2 = equations.derivative(0, y + h / 2 * k1)
    k3 = equations.derivative(0, y + h / 2 * k2)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + equations.derivative(0, y + h * k3))


# joints


def gathered(values: np.ndarray, index: np.ndarray) -> np.ndarray:
    return np.moveaxis(values[index], -1, 0)


@pytest.mark.parametrize("seed", range(8))
def test_joint_forces_are_minus_the_gradients(seed: int) -> None:
    """Of the energy by central differences along random turns, of the Rayleigh function by its power."""
    equations, rng = spatial_of(spatial_scene(seed)), np.random.default_rng(seed)
    state = any_state(equations, rng)
    for group in equations.system.groups:
        u, w = gathered(state.links, group.index), gathered(state.link_rates, group.index)
        still, spin = np.zeros_like(w), rng.normal(size=u.shape)
        along = np.cross(spin, u, axis=0)
        force = generalized_forces(joint_moments(group, u, still), u)
        rise = central(lambda v: joint_energy(group, v / np.linalg.norm(v, axis=0)).sum(), u, along)  # noqa: B023
        assert np.sum(force * along) == pytest.approx(-rise, rel=1e-7, abs=1e-9)
        drag = generalized_forces(joint_moments(group, u, w) - joint_moments(group, u, still), u)
        assert np.sum(drag * w) == pytest.approx(damper_power(group, u, w), rel=1e-12, abs=1e-12)
    total = sum(joint_energy(g, gathered(state.links, g.index)).sum() for g in equations.system.groups)
    assert total == pytest.approx(springs(equations, state.links), rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_joints_in_the_plane_are_those_of_the_plane(seed: int) -> None:
    equations, rng = spatial_of(spatial_scene(seed)), np.random.default_rng(seed)
    drawn = flat_state(equations, rng)
    flat = State(unwound(equations, drawn.links), drawn.link_rates)
    state = of_plane(flat)
    for group in equations.system.groups:
        u, w = gathered(state.links, group.index), gathered(state.link_rates, group.index)
        theta, rate = flat.links[group.index], flat.link_rates[group.index]
        moments, (expected, power) = joint_moments(group, u, w), forces.joint_torques(group, theta, rate)
        np.testing.assert_allclose(moments[1], expected, rtol=1e-11, atol=1e-12)
        assert not moments[[0, 2]].any()
        np.testing.assert_allclose(joint_energy(group, u), forces.spring_energy(group, theta), rtol=1e-11, atol=1e-13)
        assert damper_power(group, u, w) == pytest.approx(power, rel=1e-12)


@pytest.mark.parametrize(("angle", "expected"), [(0.0, 0.0), (1e-9, -2e-9), (np.pi - 1e-6, -2 * (np.pi - 1e-6))])
def test_a_spring_straight_slightly_and_almost_fully_bent(angle: float, expected: float) -> None:
    group = system_of(single(Bob(mass=1, length=1, stiffness=2.0))).groups[0]
    u = unit_vectors(np.array([[angle]]), 0.0)
    moments = joint_moments(group, gathered(u[0], np.array([[0]])), np.zeros((3, 1, 1)))
    assert moments[1, 0, 0] == pytest.approx(expected, rel=1e-9, abs=0)


def test_a_spring_bent_right_back_pulls_no_way() -> None:
    group = system_of(single(Bob(mass=1, length=1, stiffness=2.0))).groups[0]
    u = -EZ.reshape(3, 1, 1)
    assert not joint_moments(group, u, 0 * u).any()
    assert joint_energy(group, u) == pytest.approx(np.pi**2)


def test_complex_steps_pass_a_straight_spring() -> None:
    """The stiffness of a straight joint is its spring's own."""
    group = system_of(single(Bob(mass=1, length=1, stiffness=2.0))).groups[0]
    u = EZ.reshape(3, 1, 1) + 1e-30j * np.array([1.0, 0.0, 0.0]).reshape(3, 1, 1)
    force = generalized_forces(joint_moments(group, u, 0 * u), u)
    assert force[0, 0, 0].imag / 1e-30 == pytest.approx(-2.0)


# angles and directions


def test_directions_and_angles_are_inverse() -> None:
    rng = np.random.default_rng(0)
    theta, phi = rng.uniform(0, np.pi, 20), rng.uniform(-np.pi, np.pi, 20)
    u = unit_vectors(theta, phi)
    np.testing.assert_allclose(np.linalg.norm(u, axis=-1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(angles_of(3 * u), (theta, phi), rtol=1e-13)
    assert angles_of(EZ) == (0.0, 0.0)


def test_velocities_are_the_rate_of_directions_at_fixed_azimuth() -> None:
    rng = np.random.default_rng(1)
    theta, phi, rate = rng.normal(size=(3, 20))
    exact = unit_vectors(theta + 1e-30j * rate, phi).imag / 1e-30
    np.testing.assert_allclose(velocities(theta, phi, rate), exact, rtol=1e-13, atol=1e-15)


def test_a_plane_state_moves_along_the_rail_and_down() -> None:
    state = of_plane(State(np.array([0.5, -1.0]), np.array([2.0, 3.0]), 0.1, 0.2))
    assert not state.links[:, 1].any()
    np.testing.assert_allclose(state.links[:, 0], np.sin([0.5, -1.0]))
    assert (state.cart, state.cart_rate) == (0.1, 0.2)
