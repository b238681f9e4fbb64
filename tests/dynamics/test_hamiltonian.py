"""Hamilton's equations: momenta by recursion are M q', forces the slopes of H, and the motion Lagrange's."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from scenes import blowing, minimal, plane_scene, random_state
from structured_scenes import MOVED, STRUCTURED
from test_identities import centres
from test_maximal import final

from modal.scene import Cart, Scene
from nonlinear.dynamics import Generated, Hamiltonian
from nonlinear.system import State, System, system_of

SEEDS = range(60)
EVERY = {name: scene for name, scene in {**STRUCTURED, **MOVED}.items() if "hoist" not in scene.features}
STEP = 1e-30


def dense_M(scene: Scene, q: np.ndarray) -> np.ndarray:
    """Σ m JᵀJ + I, with J from the positions of the centres by complex steps."""
    moved = [centres(scene, q + 1j * STEP * unit) for unit in np.eye(len(q))]
    masses, inertias = (np.array([centre[part] for centre in moved[0]]) for part in (0, 1))
    J = np.array([[z.imag / STEP for _, _, z, _ in rows] for rows in moved])
    turns = np.array([[theta.imag / STEP for *_, theta in rows] for rows in moved])
    return np.einsum("k,iks,jks->ij", masses, J, J) + (inertias * turns) @ turns.T


def potential(scene: Scene, q: np.ndarray) -> float:
    """Gravity and springs, each relaxed where its links rest."""
    total = -sum(scene.gravity * m * z[1].real for m, _, z, _ in centres(scene, q))
    at = 0
    if isinstance(scene.support, Cart):
        total, at = total + scene.support.stiffness * q[0] ** 2 / 2, 1
    for pendulum in (entry for entry in scene.pendulum for _ in range(entry.count)):
        above = 0.0
        for link, way in zip(pendulum.links, pendulum.ways, strict=True):
            lean = q[at] - (np.pi if way == "up" else 0.0)
            total, above, at = total + link.stiffness * (lean - above) ** 2 / 2, lean, at + 1
    return total


def vectors(system: System, state: State) -> tuple[np.ndarray, np.ndarray]:
    y = minimal(system).begin(state)
    half = minimal(system).layout.half
    return y[:half], y[half : 2 * half]


@pytest.mark.parametrize("seed", SEEDS)
def test_momenta_are_M_times_velocities_and_back(seed: int) -> None:
    scene = plane_scene(seed)
    system = system_of(scene)
    state = random_state(system, seed)
    q, v = vectors(system, state)
    equations, theirs = Hamiltonian(system), dense_M(scene, q) @ v
    p = equations.momenta(q[:, None], v[:, None])
    np.testing.assert_allclose(p[:, 0], theirs, rtol=0, atol=1e-13 * np.abs(theirs).max())
    back = equations.velocities(q[:, None], p)[:, 0]
    np.testing.assert_allclose(back, v, rtol=0, atol=1e-11 * np.abs(v).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_H_is_the_energy(seed: int) -> None:
    scene = plane_scene(seed)
    system = system_of(scene)
    state = random_state(system, seed)
    q, v = vectors(system, state)
    kinetic, equations = v @ dense_M(scene, q) @ v / 2, Hamiltonian(system)
    stored = potential(scene, q) - potential(scene, np.append([0.0] * system.first, system.rest))
    (energy,) = equations.hamiltonian(q[:, None], equations.momenta(q[:, None], v[:, None]))
    assert energy == pytest.approx(kinetic + stored, rel=1e-11, abs=1e-12 * kinetic)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_slopes_of_H_are_the_motion(seed: int) -> None:
    """q' = ∂H/∂p and p' = −∂H/∂q by complex steps; dampers add minus what they resist."""
    system = system_of(plane_scene(seed))
    state = random_state(system, seed)
    q, v = vectors(system, state)
    equations, half = Hamiltonian(system), len(q)
    p = equations.momenta(q[:, None], v[:, None])[:, 0]
    moved = np.concatenate((q, p))[:, None] + 1j * STEP * np.eye(2 * half)
    slopes = equations.hamiltonian(moved[:half], moved[half:]).imag / STEP
    rates = equations.derivative(0.0, equations.begin(state))
    scale = np.abs(slopes).max()
    np.testing.assert_allclose(rates[:half], slopes[half:], rtol=0, atol=1e-11 * scale)
    lost = rates[half : 2 * half] + slopes[:half]
    np.testing.assert_allclose(lost, dampers(system, state), rtol=0, atol=1e-11 * scale)
    assert equations.layout.works == bool(dampers(system, state).any())
    if equations.layout.works:
        assert rates[-1] == pytest.approx(dampers(system, state) @ v, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", EVERY)
def test_on_structures_the_slopes_are_lagranges_mapped_to_momenta(name: str) -> None:
    """p' = M q'' + (M' q') q' with the accelerations of Lagrange's form, by a complex step along the motion."""
    system = system_of(EVERY[name])
    equations, lagrangian = Hamiltonian(system), Generated(system)
    half, y = equations.layout.half, np.random.default_rng(3).uniform(-0.7, 0.7, equations.layout.size)
    theirs = lagrangian.derivative(0.3, y)
    moved = (y + 1j * STEP * theirs)[:, None]
    turning = equations.momenta(moved[:half], moved[half : 2 * half])[:, 0].imag / STEP
    q, v = y[:half], y[half : 2 * half].copy()
    y[half : 2 * half] = equations.momenta(q[:, None], v[:, None])[:, 0]
    mine = equations.derivative(0.3, y)
    np.testing.assert_allclose(mine[:half], v, rtol=0, atol=1e-13)
    np.testing.assert_allclose(mine[half : 2 * half], turning, rtol=0, atol=1e-13 * np.abs(turning).max())
    np.testing.assert_allclose(mine[2 * half :], theirs[2 * half :], rtol=1e-12, atol=1e-12)


def dampers(system: System, state: State) -> np.ndarray:
    """Minus the slope in the velocities of half the power lost: link by link."""
    torques, damping = np.zeros(system.n_links), system.by_link("damping")
    for group in system.groups:
        for column in group.index.T:
            for above, link in zip([None, *column[:-1]], column, strict=True):
                turn = state.link_rates[link] - (0.0 if above is None else state.link_rates[above])
                torques[link] -= damping[link] * turn
                if above is not None:
                    torques[above] += damping[link] * turn
    return np.concatenate(([-system.cart.damping * state.cart_rate], torques)) if system.cart else torques


@pytest.mark.parametrize("seed", usually([3], [3, 9, 10]))
def test_motion_is_lagranges(seed: int) -> None:
    system = system_of(plane_scene(seed))
    state = random_state(system, seed)
    start = State(0.3 * state.links, 0.3 * state.link_rates, state.cart, state.cart_rate)
    options = {"end": usually(0.2, 0.5), "pieces": 2}
    systems = Hamiltonian(system, blowing), minimal(system, blowing)
    mine, theirs = (final(equations, start, **options) for equations in systems)
    np.testing.assert_allclose(mine.links, theirs.links, rtol=0, atol=1e-9)
    np.testing.assert_allclose(mine.link_rates, theirs.link_rates, rtol=0, atol=1e-8)
    assert mine.cart == pytest.approx(theirs.cart, abs=1e-9)


def test_a_state_comes_back_and_many_read_as_one() -> None:
    system = system_of(plane_scene(8))
    equations, states = Hamiltonian(system, blowing), [random_state(system, seed) for seed in range(5)]
    motion = equations.read(np.array([equations.begin(state) for state in states]))
    for at, state in enumerate(states):
        np.testing.assert_array_equal(motion[at].links, state.links)
        np.testing.assert_allclose(motion[at].link_rates, state.link_rates, rtol=0, atol=1e-11)
        assert motion[at].cart_rate == pytest.approx(state.cart_rate, abs=1e-11)


def test_nothing_changes_the_momentum_of_a_free_cart() -> None:
    scene = plane_scene(4).model_copy(update={"support": Cart(mass=1.0)})
    system = system_of(scene)
    equations = Hamiltonian(system)
    y = equations.begin(random_state(system, 1))
    assert y[equations.layout.half] != 0.0
    assert equations.derivative(0.0, y)[equations.layout.half] == 0.0
