"""Maximal coordinates: the minimal ones' accelerations, paper 000's forces, Newton's law, and drift kept in hand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import sympy as sp
from scenes import blowing, minimal, plane_scene, random_state
from scipy.integrate import solve_ivp
from test_identities import centres

from modal.errors import ComputationError
from modal.scene import Bob, Cart, Pendulum, Rod, Scene
from modal.symbolic.papers import cart_dae as dae
from modal.symbolic.papers.cart import Y, g, links, m_c
from nonlinear.dynamics import Maximal, maximal
from nonlinear.system import Equations, State, System, system_of

SEEDS = range(60)


def double_rods(n: int, seed: int) -> Scene:
    """n double pendula of rods, all different, on a cart."""
    table = np.random.default_rng(seed).uniform(0.3, 2.0, (n, 2, 2))
    pendula = tuple(Pendulum(links=tuple(Rod(mass=m, length=l) for m, l in pair)) for pair in table)
    return Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=pendula)


@pytest.mark.parametrize("load", [None, blowing])
@pytest.mark.parametrize("seed", SEEDS)
def test_accelerations_are_those_of_minimal_coordinates(seed: int, load: object) -> None:
    system = system_of(plane_scene(seed))
    state, few, many = random_state(system, seed), minimal(system, load), Maximal(system, load)
    y = many.begin(state)
    theirs = few.read(few.derivative(0.7, few.begin(state))[None])
    mine = many.read(many.derivative(0.7, y)[None])
    scale = np.abs(theirs.link_rates).max()
    np.testing.assert_allclose(mine.link_rates, theirs.link_rates, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(mine.cart_rate, theirs.cart_rate, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(mine.links, state.link_rates[None], rtol=0, atol=0)
    np.testing.assert_allclose(mine.work, theirs.work, rtol=1e-12, atol=1e-12)
    assert max(many.drift(y)) < 1e-14


def paper_values(scene: Scene, state: State) -> dict[sp.Symbol, float]:
    values = {g: scene.gravity, m_c: scene.support.mass}
    rods = [rod for pendulum in scene.pendulum for rod in pendulum.links]
    for k, (mine, rod) in enumerate(zip(links(scene.n_pendula), rods, strict=True)):
        values |= {mine.m: rod.mass, mine.l: rod.length}
        values |= {mine.theta.q: state.links[k], mine.theta.v: state.link_rates[k]}
    return values


@pytest.mark.parametrize("n", [1, 2])
def test_the_unknowns_are_the_corrected_papers(n: int) -> None:
    A, F = dae.linear_system(n)
    for seed in range(3):
        scene = double_rods(n, seed)
        system = system_of(scene)
        state, equations = random_state(system, seed), Maximal(system)
        values = paper_values(scene, state)
        theirs = np.linalg.solve(*(np.array(part.xreplace(values).evalf(), dtype=float) for part in (A, F)))[:, 0]
        y = equations.begin(state)
        mine, forces = equations.unknowns(0.0, y), equations.reactions(equations.read(y[None]))
        assert len(mine) == len(theirs) == 10 * n + 3 == equations.pivots.saddle.size
        assert mine[dae.unknowns(n).index(Y.a)] == pytest.approx(0.0, abs=1e-13)
        ordered = [mine[: 6 * n + 2], forces.normal, forces.R_B.ravel(), forces.R_P.ravel()]
        np.testing.assert_allclose(np.concatenate(ordered), theirs, rtol=0, atol=1e-11 * np.abs(theirs).max())


def test_a_fixed_support_has_five_unknowns_a_link() -> None:
    system = system_of(plane_scene(0))
    equations = Maximal(system)
    assert system.cart is None
    assert len(equations.unknowns(0.0, equations.begin(random_state(system, 0)))) == 5 * system.n_links
    reactions = equations.reactions(minimal(system).read(minimal(system).begin(random_state(system, 0))[None]))
    assert reactions.normal == pytest.approx(-reactions.R_B[:, :, 1].sum(1))


def test_at_rest_the_ground_carries_all_and_every_pivot_what_hangs_below() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=double_rods(3, 5).pendulum)
    system = system_of(scene)
    equations = Maximal(system)
    reactions = equations.reactions(equations.read(equations.begin(State(np.zeros(6), np.zeros(6)))[None]))
    masses = np.array([[rod.mass for rod in pendulum.links] for pendulum in scene.pendulum])
    np.testing.assert_allclose(reactions.normal, [9.81 * (2.0 + masses.sum())], rtol=1e-14)
    np.testing.assert_allclose(
        reactions.R_B[0], np.stack((np.zeros(3), -9.81 * masses.sum(1)), 1), rtol=1e-14, atol=1e-13
    )
    np.testing.assert_allclose(
        reactions.R_P[0], np.stack((np.zeros(3), 9.81 * masses[:, 1]), 1), rtol=1e-14, atol=1e-13
    )


def momentum_rates(scene: Scene, state: State) -> np.ndarray:
    """d(m v)/dt of the cart and of every centre as minimal coordinates move: two differentiations of positions."""
    system, cart, step = system_of(scene), isinstance(scene.support, Cart), 1e-4
    equations = minimal(system)
    y = equations.begin(state)
    half = equations.layout.half
    q, v, a = y[:half], y[half : 2 * half], equations.derivative(0.0, y)[half : 2 * half]
    path = [q + s * step * v + (s * step) ** 2 / 2 * a for s in (-2, -1, 0, 1, 2)]
    positions = np.array([[z.real for _, _, z, _ in centres(scene, at)] for at in path])
    masses = np.array([m for m, *_ in centres(scene, q)])[:, None]
    rates = masses * np.tensordot([-1, 16, -30, 16, -1], positions, 1) / (12 * step**2)
    return rates if cart else np.vstack((np.zeros(2), rates))


@pytest.mark.parametrize("seed", SEEDS)
def test_forces_are_the_changes_of_momentum(seed: int) -> None:
    """Newton's law of the cart and of every link, with accelerations that know nothing of forces."""
    scene = plane_scene(seed)
    system = system_of(scene)
    state, equations = random_state(system, seed), minimal(system)
    forces = Maximal(system).reactions(equations.read(equations.begin(state)[None]))
    rates, weight = momentum_rates(scene, state), system.gravity * np.array([0.0, 1.0])
    above, below = Maximal(system).pivots.above, np.zeros((system.n_links, 2))
    np.add.at(below, above[above >= 0], forces.pivots[0][above >= 0])
    mine = forces.pivots[0] - below + system.mass[:, None] * weight
    tolerance = 1e-5 * np.abs(rates).max()
    np.testing.assert_allclose(mine, rates[1:], rtol=0, atol=tolerance)
    if system.cart:
        outside = -system.cart.stiffness * state.cart - system.cart.damping * state.cart_rate, -forces.normal[0]
        total = outside - forces.R_B[0].sum(0) + system.cart.mass * weight
        np.testing.assert_allclose(total, rates[0], rtol=0, atol=tolerance)


def test_sparse_is_dense(monkeypatch: pytest.MonkeyPatch) -> None:
    system = system_of(plane_scene(23))
    state = random_state(system, 1)
    equations = Maximal(system)
    y = equations.begin(state)
    unknowns = []
    for limit in (0, 10_000):
        monkeypatch.setattr(maximal, "DENSE_UNKNOWNS_MAX", limit)
        unknowns.append(equations.unknowns(0.0, y))
    assert not np.array_equal(*unknowns)
    np.testing.assert_allclose(*unknowns, rtol=0, atol=1e-12 * np.abs(unknowns[0]).max())


Piece = tuple[np.ndarray, float]


def run(equations: Equations, state: State, rtol: float, end: float = 3.0, pieces: int = 60) -> Iterator[Piece]:
    """y after every short piece, projected, and what was mended."""
    y, mended = equations.begin(state), 0.0
    for start in np.linspace(0, end, pieces, endpoint=False):
        options = {"method": "DOP853", "rtol": rtol, "atol": rtol / 10}
        y = solve_ivp(equations.derivative, (start, start + end / pieces), y, **options).y[:, -1]
        y, mended = equations.project(y)
        yield y, mended


def final(equations: Equations, state: State, **options: float) -> State:
    *_, (y, _) = run(equations, state, 1e-12, **options)
    return equations.read(y[None])[0]


@pytest.mark.parametrize("limit", [0, 10_000])
def test_a_cart_that_nothing_holds_back_is_refused(limit: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maximal, "DENSE_UNKNOWNS_MAX", limit)
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),))
    equations = Maximal(system_of(scene))
    equations.unknowns(0.0, equations.begin(State(np.ones(1), np.ones(1))))
    with pytest.raises(ComputationError, match="massless cart"):
        equations.unknowns(0.0, equations.begin(State(np.zeros(1), np.ones(1))))


@pytest.fixture(name="system")
def paper_cart() -> System:
    rods = Pendulum(links=(Rod(mass=1.0, length=1.0, damping=0.05), Rod(mass=1.0, length=1.0)), count=2)
    return system_of(Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=(rods,)))


START = State(np.array([0.9, 0.6, -0.5, -0.4]), np.zeros(4), 0.1, 0.2)


def test_motion_is_that_of_minimal_coordinates(system: System) -> None:
    few, many = (final(equations, START) for equations in (minimal(system, blowing), Maximal(system, blowing)))
    np.testing.assert_allclose(many.links, few.links, rtol=0, atol=1e-9)
    np.testing.assert_allclose(many.link_rates, few.link_rates, rtol=0, atol=1e-9)
    assert many.cart == pytest.approx(few.cart, abs=1e-9)
    assert many.cart_rate == pytest.approx(few.cart_rate, abs=1e-9)


def test_drift_grows_unless_it_is_controlled(system: System) -> None:
    loose = 1e-7
    free, held = Maximal(system, corrects_drift=False), Maximal(system)
    drifts = [free.drift(y) for y, _ in run(free, START, loose)]
    reported = [mended for _, mended in run(free, START, loose)]
    early, late = (np.mean([drift.position for drift in part]) for part in (drifts[:15], drifts[-15:]))
    assert late > 5 * early > 0
    assert late > 1e-9
    assert reported == [max(drift) for drift in drifts]
    kept = list(run(held, START, loose))
    assert max(max(held.drift(y)) for y, _ in kept) < 1e-14
    assert all(1e-14 < mended < 1e-5 for _, mended in kept)


def test_drift_is_measured_in_lengths_of_the_longest_pendulum(system: System) -> None:
    equations = Maximal(system, corrects_drift=False)
    y, size = equations.begin(START), equations.pivots.size
    y[1] += 0.004
    y[size + 1] += 0.003
    assert equations.drift(y) == pytest.approx((0.002, 0.003 / np.sqrt(9.81 * 2.0)), rel=1e-12)
    assert equations.project(y)[0] is y


def test_pivots_torn_wide_open_are_refused(system: System) -> None:
    equations = Maximal(system)
    y = equations.begin(START)
    y[: equations.pivots.size] += 30 * np.random.default_rng(0).normal(size=equations.pivots.size)
    with pytest.raises(ComputationError, match="m apart after 6 corrections"):
        equations.project(y)


@pytest.mark.parametrize("seed", SEEDS)
def test_projection_is_the_least_change_and_moves_no_centre_of_mass(seed: int) -> None:
    """Velocities change M-orthogonally to every motion that the pivots allow; nothing pushes the whole along."""
    system = system_of(plane_scene(seed))
    equations = Maximal(system)
    size, M = equations.pivots.size, equations.pivots.saddle.masses
    y, rng = equations.begin(random_state(system, seed)), np.random.default_rng(seed)
    off = y.copy()
    off[: 2 * size] += 1e-3 * rng.normal(size=2 * size)
    mended, violation = equations.project(off)
    assert max(equations.drift(mended)) < 1e-14 < violation == max(equations.drift(off))
    np.testing.assert_allclose(mended, y, rtol=0, atol=0.1)
    again, nothing = equations.project(mended)
    assert nothing < 1e-14
    np.testing.assert_allclose(again, mended, rtol=0, atol=1e-13)
    closed, moved = mended.copy(), mended[size : 2 * size] + 0.1 * rng.normal(size=size)
    closed[size : 2 * size] = moved
    change = equations.project(closed)[0][size : 2 * size] - moved
    state = equations.read(mended[None])[0]
    other = random_state(system, seed + 1)
    allowed = equations.pivots.place(State(state.links, other.link_rates, state.cart, other.cart_rate))[1]
    assert change @ (M * allowed) == pytest.approx(0.0, abs=1e-12 * np.abs(change * M * allowed).sum())
    assert np.abs(change).max() > 1e-4
    if system.cart:
        rail = np.zeros(size)
        rail[[0, *range(2, size, 3)]] = 1.0
        for part in (slice(0, size), slice(size, 2 * size)):
            assert (rail * M) @ (mended - off)[part] == pytest.approx(0.0, abs=1e-13 * M.sum())
