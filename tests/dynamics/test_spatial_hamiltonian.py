"""Hamilton's equations in space: Lagrange's accelerations mapped to momenta, Dirac's brackets of H, and 50 digits."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scenes import spatial_scene
from test_space import acted_on, any_state, central, flat_state, spatial_of, unwound

from modal.errors import SceneError
from modal.scene import Bob, Cart, Pendulum, Rod, Scene
from nonlinear.dynamics import Hamiltonian
from nonlinear.simulation import simulate
from nonlinear.system import State, of_plane, system_of
from nonlinear.system.state import unit_vectors, velocities

SEEDS = range(30)
EZ = np.array([0.0, 0.0, 1.0])


def dense(equations: Hamiltonian, rates: np.ndarray) -> np.ndarray:
    """(p_x, P) from M, b and A of the pair as full matrices."""
    system, first = equations.system, equations.layout.first
    A, b = np.zeros((system.n_links, system.n_links)), np.zeros(system.n_links)
    for group in system.groups:
        for column in range(group.index.shape[1]):
            index = group.index[:, column]
            length, moments = group.block.length[:, column], group.block.b[:, column]
            for i, row in enumerate(index):
                b[row] = moments[i]
                A[row, row] = group.block.diagonal[i, column]
                for j in range(i):
                    A[row, index[j]] = A[index[j], row] = length[j] * moments[i]
    w, cart = rates[first:].reshape(-1, 3), rates[0] if first else 0.0
    P = A @ w + np.outer(b, [cart, 0.0, 0.0])
    total = float(system.mass.sum()) + (system.cart.mass if system.cart else 0.0)
    return np.concatenate(([total * cart + b @ w[:, 0]] if first else [], P.ravel()))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_derivative_is_lagranges_mapped_to_momenta(seed: int) -> None:
    """π = P − (u·P) u, so π' follows from u'' by the chain rule, with springs, dampers, drag, loads, moved supports."""
    scene, push = acted_on(seed)
    equations, lagrangian = Hamiltonian(system_of(scene), push), spatial_of(scene, push)
    state = any_state(lagrangian, np.random.default_rng(seed))
    theirs = lagrangian.derivative(0.3, lagrangian.begin(state))
    half, first = equations.layout.half, equations.layout.first
    v = theirs[:half]
    P, turning = dense(equations, v), dense(equations, theirs[half : 2 * half])
    u, w = (part[first:].reshape(-1, 3) for part in (lagrangian.begin(state)[:half], v))
    p, slope = (part[first:].reshape(-1, 3) for part in (P, turning))
    along = np.sum(u * p, axis=1, keepdims=True)
    gone = np.sum(w * p + u * slope, axis=1, keepdims=True)
    expected = np.concatenate((v, turning[:first], (slope - gone * u - along * w).ravel(), theirs[2 * half :]))
    y = equations.begin(state)
    np.testing.assert_allclose(y[half + first : 2 * half], (p - along * u).ravel(), atol=1e-12 * np.abs(p).max())
    scale = np.abs(expected).max()
    np.testing.assert_allclose(equations.derivative(0.3, y), expected, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("seed", [1, 4, 7, 11])
def test_the_motion_is_that_of_H_by_diracs_brackets(seed: int) -> None:
    """u' = (1 − u uᵀ) ∂H/∂π and π' = −(1 − u uᵀ) ∂H/∂u + (π uᵀ − u πᵀ) ∂H/∂π, by differences of H."""
    scene = undamped(spatial_scene(seed))
    equations = Hamiltonian(system_of(scene))
    y = equations.begin(any_state(spatial_of(scene), np.random.default_rng(seed)))
    half, first = equations.layout.half, equations.layout.first

    def H(at: np.ndarray) -> Any:
        q, p = at[:half].copy(), at[half : 2 * half].copy()
        for k in range(first, half, 3):
            q[k : k + 3] /= np.linalg.norm(q[k : k + 3])
            p[k : k + 3] -= (q[k : k + 3] @ p[k : k + 3]) * q[k : k + 3]
        return equations.hamiltonian(q, p)

    slopes = np.array([central(H, y, unit) for unit in np.eye(2 * half)])
    by_q, by_p = slopes[:half], slopes[half:]
    expected = np.concatenate((by_p, -by_q))
    for k in range(first, half, 3):
        u, pi, here = y[k : k + 3], y[half + k : half + k + 3], slice(k, k + 3)
        across = np.eye(3) - np.outer(u, u)
        expected[here] = across @ by_p[here]
        expected[half + k : half + k + 3] = -across @ by_q[here] + (np.outer(pi, u) - np.outer(u, pi)) @ by_p[here]
    scale = np.abs(expected).max()
    np.testing.assert_allclose(equations.derivative(0.0, y), expected, rtol=0, atol=1e-9 * scale)


def undamped(scene: Scene) -> Scene:
    links = [[link.replace(damping=0.0) for link in pendulum.links] for pendulum in scene.pendulum]
    pendula = [pendulum.replace(links=tuple(chain)) for pendulum, chain in zip(scene.pendulum, links, strict=True)]
    support = scene.support.replace(damping=0.0) if isinstance(scene.support, Cart) else scene.support
    return scene.replace(pendulum=tuple(pendula), support=support)


def test_fifty_digits_agree() -> None:
    """A bob below a rod on a cart: H from T of the Cartesian velocities, its brackets by differences of 50 digits."""
    links = (Rod(mass=1.5, length=0.75), Bob(mass=0.5, length=1.25))
    scene = Scene(gravity=9.75, space="space", support=Cart(mass=2.0), pendulum=(Pendulum(links=links),))
    equations = Hamiltonian(system_of(scene))
    state = any_state(spatial_of(scene), np.random.default_rng(3))
    y = equations.begin(state)
    with mp.workdps(50):
        exact = [mp.mpf(value) for value in y]
        H = _in_digits(9.75, 2.0, (1.5, 0.75, 0.375, 1.5 * 0.75**2 / 12), (0.5, 1.25, 1.25, 0.0))
        step = mp.mpf(10) ** -15
        slopes = []
        for k in range(14):
            values = [H([x + (m * step if j == k else 0) for j, x in enumerate(exact)]) for m in (2, 1, -1, -2)]
            slopes.append((8 * (values[1] - values[2]) - values[0] + values[3]) / (12 * step))
        by_q, by_p = slopes[:7], slopes[7:]
        expected = [by_p[0], *[0] * 6, -by_q[0], *[0] * 6]
        for k in (1, 4):
            u, pi = exact[k : k + 3], exact[7 + k : 10 + k]
            a, b = by_q[k : k + 3], by_p[k : k + 3]
            ua, ub, pb = mp.fdot(u, a), mp.fdot(u, b), mp.fdot(pi, b)
            for j in range(3):
                expected[k + j] = b[j] - ub * u[j]
                expected[7 + k + j] = -(a[j] - ua * u[j]) + pi[j] * ub - u[j] * pb
    theirs = np.array(expected, dtype=float)
    np.testing.assert_allclose(equations.derivative(0.0, y), theirs, rtol=0, atol=2e-14 * np.abs(theirs).max())


def _in_digits(g: float, cart: float, upper: tuple[float, ...], lower: tuple[float, ...]) -> Any:
    """H(x, u, p_x, π) with rates from a dense system in bases across the links."""

    def bases(u: Any) -> Any:
        axis = mp.matrix([0, 1, 0])
        e = axis - u * (u.T * axis)[0]
        e = e / mp.norm(e)
        return e, mp.matrix([u[1] * e[2] - u[2] * e[1], u[2] * e[0] - u[0] * e[2], u[0] * e[1] - u[1] * e[0]])

    def H(y: list[Any]) -> Any:
        u1, u2, pi1, pi2 = (mp.matrix(y[k : k + 3]) for k in (1, 4, 8, 11))
        u1, u2 = u1 / mp.norm(u1), u2 / mp.norm(u2)
        (m1, l1, c1, I1), (m2, _, c2, I2) = (tuple(map(mp.mpf, each)) for each in (upper, lower))
        e1, e2 = bases(u1), bases(u2)
        x = mp.matrix([1, 0, 0])
        zero = mp.zeros(3, 1)
        first = [x, c1 * e1[0], c1 * e1[1], zero, zero]
        second = [x, l1 * e1[0], l1 * e1[1], c2 * e2[0], c2 * e2[1]]
        turns = [(zero, zero), (e1[0], zero), (e1[1], zero), (zero, e2[0]), (zero, e2[1])]
        M = mp.matrix(5, 5)
        for i in range(5):
            for j in range(5):
                M[i, j] = m1 * mp.fdot(first[i], first[j]) + m2 * mp.fdot(second[i], second[j])
                M[i, j] += I1 * mp.fdot(turns[i][0], turns[j][0]) + I2 * mp.fdot(turns[i][1], turns[j][1])
        M[0, 0] += cart
        p = mp.matrix([y[7], mp.fdot(e1[0], pi1), mp.fdot(e1[1], pi1), mp.fdot(e2[0], pi2), mp.fdot(e2[1], pi2)])
        V = -g * (m1 * c1 * u1[2] + m2 * (l1 * u1[2] + c2 * u2[2]))
        return mp.fdot(p, mp.lu_solve(M, p)) / 2 + V

    return H


@pytest.mark.parametrize("seed", range(8))
def test_in_the_plane_of_the_rail_they_are_those_of_the_plane(seed: int) -> None:
    scene = spatial_scene(seed)
    equations, flat = Hamiltonian(system_of(scene)), Hamiltonian(system_of(scene.in_plane))
    state = flat_state(equations, np.random.default_rng(seed))
    cart = (state.cart, state.cart_rate) if equations.system.cart else (0.0, 0.0)
    state = State(unwound(spatial_of(scene), state.links), state.link_rates, *cart)
    theirs, y = flat.derivative(0.0, flat.begin(state)), flat.begin(state)
    half, first = flat.layout.half, flat.layout.first
    u, n = unit_vectors(state.links, 0.0), velocities(state.links, 0.0, 1.0)
    p, slope = y[half + first : 2 * half, None], theirs[half + first : 2 * half, None]
    momenta = slope * n - p * state.link_rates[:, None] * u
    mine = equations.derivative(0.0, equations.begin(of_plane(state)))
    wide = equations.layout.half
    expected = np.concatenate((theirs[half : half + first], momenta.ravel()))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(mine[wide : 2 * wide], expected, rtol=0, atol=1e-12 * scale)


def still(state: State) -> State:
    """The same on a support without a cart."""
    return State(state.links, state.link_rates)


def test_states_come_back_and_stay_on_their_spheres() -> None:
    scene = spatial_scene(3)
    equations, rng = Hamiltonian(system_of(scene)), np.random.default_rng(5)
    states = [any_state(spatial_of(scene), rng) for _ in range(4)]
    rows = np.array([equations.begin(state) for state in states])
    motion = equations.read(rows)
    for at, state in enumerate(states):
        np.testing.assert_allclose(motion[at].link_rates, state.link_rates, rtol=0, atol=1e-11)
        assert motion[at].cart_rate == pytest.approx(state.cart_rate, abs=1e-11)
    kept, none = equations.project(rows)
    assert none < 1e-15
    half, first = equations.layout.half, equations.layout.first
    u, pi = (rows[:, at:to].reshape(4, -1, 3) for at, to in ((first, half), (half + first, 2 * half)))
    torn = rows.copy()
    torn[:, first:half] *= 1.0 + 1e-6
    torn[:, half + first : 2 * half] = (pi + 1e-6 * np.abs(pi).max() * u).reshape(4, -1)
    back, removed = equations.project(torn)
    np.testing.assert_allclose(back, kept, rtol=0, atol=1e-12 * np.abs(kept).max())
    assert 1e-7 < removed < 1e-4
    slopes = equations.derivative(0.0, rows.T)  # at once as one by one
    alone = np.array([equations.derivative(0.0, row) for row in rows])
    np.testing.assert_allclose(slopes.T[:, : 2 * half], alone[:, : 2 * half], rtol=0, atol=1e-12 * np.abs(alone).max())


def test_a_run_is_that_of_unit_vectors_and_keeps_energy_and_spin() -> None:
    links = (Bob(mass=1.0, length=1.0), Rod(mass=2.0, length=0.5))
    scene = Scene(gravity=9.81, space="space", pendulum=(Pendulum(links=links),))
    start = still(any_state(spatial_of(scene), np.random.default_rng(2)))
    mine, theirs = (
        simulate(scene, 2.0, start=start, form=form, output=21, tolerance=1e-12) for form in ("hamiltonian", "spatial")
    )
    np.testing.assert_allclose(mine.motion.links, theirs.motion.links, rtol=0, atol=1e-8)
    assert mine.run.form == "hamiltonian"
    assert mine.energy_drift() < 1e-11
    assert mine.momentum_drift() < 1e-11
    assert mine.constraint_drift() < 1e-11


def test_nothing_changes_the_momentum_of_a_free_cart() -> None:
    scene = spatial_scene(3).replace(support=Cart(mass=1.0))
    equations = Hamiltonian(system_of(scene))
    y = equations.begin(any_state(spatial_of(scene), np.random.default_rng(1)))
    assert y[equations.layout.half] != 0.0
    assert equations.derivative(0.0, y)[equations.layout.half] == 0.0


def test_a_scene_that_the_form_does_not_take_in_space_is_refused() -> None:
    scene = spatial_scene(1).replace(damping_ratio=0.01)
    with pytest.raises(SceneError, match="motion in space has no damping ratios"):
        simulate(scene, 1.0, form="hamiltonian")
