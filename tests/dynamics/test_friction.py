"""The complementarity problem of contacts at rest, against all its states, and the law on the rail."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from dense_form import DenseForm

from modal.scene import scene_from
from nonlinear.dynamics import (
    Contacts,
    Frictional,
    Mechanics,
    Minimal,
    Recursion,
    contacts_of,
)
from nonlinear.dynamics.complementarity import consistent, on_rail
from nonlinear.integration import Choice, equations_of
from nonlinear.integration.switched import Switched
from nonlinear.system import AppliedForces, State, System, system_of


def every_state(a: np.ndarray, G: np.ndarray, limit: np.ndarray) -> list[np.ndarray]:
    """All τ that satisfy Coulomb's law, found by trying every set of sticking and sliding contacts."""
    torques = []
    for sign in product((-1.0, 0.0, 1.0), repeat=len(a)):
        s = np.array(sign)
        stuck, tau = s == 0, -s * limit
        if stuck.any():
            tau[stuck] = np.linalg.solve(G[np.ix_(stuck, stuck)], -(a + G @ tau)[stuck])
        if np.all(np.abs(tau) <= limit) and np.all((a + G @ tau) * s >= 0):
            torques.append(tau)
    return torques


@pytest.mark.parametrize("seed", range(40))
def test_it_is_the_one_state_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 1 + seed % 5
    root = rng.normal(size=(count, count + 1)) * 10 ** rng.uniform(-2, 2, (count, 1))
    a, G, limit = rng.normal(size=count), root @ root.T, rng.uniform(0, 2, count) / np.diag(root @ root.T)
    expected = every_state(a, G, limit)
    assert len(expected) == 1
    tau, sign = map(np.array, consistent(a.tolist(), G.ravel().tolist(), limit.tolist(), [0.0] * count, count))
    assert tau == pytest.approx(expected[0], rel=1e-9, abs=1e-12)
    assert np.all((np.abs(tau) < limit) == (sign == 0))


def scene(coefficient: float, **angles: float) -> Frictional:
    links = [
        {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.2},
        {"kind": "rod", "mass": 2.0, "length": 0.7, "friction": 0.1, "quadratic_drag": 0.1},
    ]
    support = {"kind": "cart", "mass": 0.5, "friction_coefficient": coefficient}
    scene = scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]})
    equations = equations_of(system_of(scene), Choice("minimal", "RK45", False, ""))
    assert isinstance(equations, Frictional)
    return equations


@pytest.mark.parametrize("seed", range(12))
def test_the_reaction_of_the_rail_carries_what_newton_says(seed: int) -> None:
    """N = Σ m (g − z'') with the accelerations under friction, and τ = −μ|N| sign x'."""
    rng = np.random.default_rng(seed)
    equations = scene(0.3)
    system = equations.system
    state = State(rng.normal(size=2), 6 * rng.normal(size=2), 0.0, float(rng.normal()))
    y = equations.begin(state)
    equations.release(0.0, y)
    rate = equations.derivative(0.0, y)
    half, step = equations.layout.half, 1e-5
    speeds = [Mechanics(system, equations.read((y + way * step * rate)[None])).speeds[0, :, 1] for way in (-1.0, 1.0)]
    drag = np.zeros(2)
    from nonlinear.dynamics.external import forces_of

    drag = forces_of(system, Mechanics(system, equations.read(y[None])).speeds)[0, :, 1]
    falling = (speeds[1] - speeds[0]) / (2 * step)
    normal = 0.5 * 9.81 + float(np.sum(system.mass * (9.81 - falling) + drag))
    friction = equations.settled(0.0, y, np.sign(equations.sliding(y)))
    assert friction.tau[0] == pytest.approx(-0.3 * abs(normal) * np.sign(state.cart_rate), rel=1e-6)
    assert half == 3


def test_a_rail_that_jams_has_no_state() -> None:
    assert not on_rail([1.0], [1.0], [2.0], [1.0], [1.0, -1.0], 1)[0]


def test_written_out_and_by_the_recursion_it_is_the_same() -> None:
    links = [{"kind": "rod", "mass": 1.0, "length": 0.5, "friction": 0.1, "count": 5}]
    system = system_of(scene_from({"gravity": 9.81, "pendulum": [{"links": links}]}))
    long = Frictional(Minimal(system, tuple(Recursion(group) for group in system.groups)), contacts_of(system))
    rng = np.random.default_rng(3)
    y = long.begin(State(rng.normal(size=5), rng.normal(size=5)))
    long.release(0.0, y)
    written = equations_of(system, Choice("minimal", "DOP853", False, ""))
    assert isinstance(written, Switched)
    written.release(0.0, y)
    assert written.derivative(0.0, y) == pytest.approx(long.derivative(0.0, y), rel=1e-9, abs=1e-9)


def test_a_load_acts_alike_written_out_and_by_a_matrix() -> None:
    links = [{"kind": "rod", "mass": 1.0, "length": 0.5, "friction": 0.1, "count": 3}]
    support = {"kind": "cart", "mass": 1.0, "friction": 0.2}
    system = system_of(scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]}))

    def load(time: float, state: State) -> AppliedForces:
        return AppliedForces(0.3 + state.cart, np.array([0.1, -0.2, 0.3]) * time)

    apart = equations_of(system, Choice("minimal", "DOP853", False, ""), load)
    within = Frictional(DenseForm(system, load=load), contacts_of(system))
    assert isinstance(apart, Switched)
    rng = np.random.default_rng(8)
    y = within.begin(State(rng.normal(size=3), rng.normal(size=3), 0.4, -0.3))
    apart.release(2.0, y)
    within.release(2.0, y)
    assert apart.derivative(2.0, y) == pytest.approx(within.derivative(2.0, y), rel=1e-9)


# -------------------------------------------------------------------------------- with everything else that acts

LINKS = [{"kind": "bob", "mass": m, "length": l, "friction": f} for m, l, f in [(2.0, 1.0, 0.4), (0.7, 0.8, 0.3)]]
ROPE = {**LINKS[0], "hoist": {"to": 0.4, "duration": 2.0}}
CART = {"kind": "cart", "mass": 1.5, "friction": 0.6}
BESIDE: dict[str, dict[str, Any]] = {
    "plain": {"links": LINKS, "support": CART},
    "hoist": {"links": [ROPE, LINKS[1]], "support": {"kind": "fixed"}},
    "hoist and rail": {"links": [ROPE, LINKS[1]], "support": CART},
    "hoist and coefficient": {
        "links": [ROPE, LINKS[1]],
        "support": {**CART, "friction": 0.0, "friction_coefficient": 0.2},
    },
    "coefficient": {"links": LINKS, "support": {**CART, "friction": 0.0, "friction_coefficient": 0.2}},
    "drag": {"links": [{**link, "drag": 0.3} for link in LINKS], "support": CART},
    "damping ratio": {"links": LINKS, "support": CART, "damping_ratio": 0.05},
    "moved": {
        "links": LINKS,
        "support": {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 2.0}},
    },
}


def newton(system: System, time: float, y: np.ndarray, sign: np.ndarray, contacts: Contacts) -> np.ndarray:
    """q'' of bobs by Newton's law, Σ m J_kᵀ (r_k'' − g) = Q + Jᵀτ, with γ'' = 0 at contacts that stick, as one matrix.

    The unknowns are q'', the friction of those that stick, and with a coefficient N = m_c g + Σ m (g − z'').
    """
    first, n = system.first, system.n_links
    half = first + n
    theta, v = y[first:half], y[half : 2 * half]
    w = v[first:]
    l, l1, l2 = (
        (row[0] for row in system.hoisting.at(np.array([time])))
        if system.hoisting
        else (system.by_link("length"), np.zeros(n), np.zeros(n))
    )
    u, across = np.array([np.sin(theta), np.cos(theta)]), np.array([np.cos(theta), -np.sin(theta)])
    M, right, lift = np.zeros((half, half)), np.zeros(half), np.zeros(half)
    weight = 0.0
    if system.cart:
        M[0, 0], weight = system.cart.mass, system.cart.mass * system.gravity
    start = system.support.accelerations(np.array([time]), 2)[0] if system.support else np.zeros(2)
    bias, speed, Jk = start.copy(), np.array([v[0] if first else 0.0, 0.0]), np.zeros((2, half))
    if first:
        Jk[0, 0] = 1.0
    for k in range(n):
        bias = bias + l2[k] * u[:, k] + 2 * l1[k] * w[k] * across[:, k] - l[k] * w[k] ** 2 * u[:, k]
        speed = speed + l1[k] * u[:, k] + l[k] * w[k] * across[:, k]
        Jk[:, first + k] = l[k] * across[:, k]
        m = float(system.mass[k])
        M += m * Jk.T @ Jk
        right -= m * Jk.T @ (bias - [0.0, system.gravity]) + float(system.by_link("drag")[k]) * Jk.T @ speed
        weight += m * (system.gravity - bias[1])
        lift -= m * Jk[1]
    if system.modal_damping is not None:
        right -= system.modal_damping @ v
    J, stuck = contacts.jacobian(half), sign == 0
    right = right - J.T @ (sign * contacts.limit)
    size = half + int(stuck.sum())
    K, r = np.zeros((size + 1, size + 1)), np.append(right, np.zeros(size + 1 - half))
    K[:half, :half], K[:half, half:size], K[half:size, :half] = M, -J[stuck].T, J[stuck]
    K[size, size], K[size, :half], r[size] = 1.0, -lift, weight
    if contacts.coefficient:
        K[:half, size] = sign[0] * contacts.coefficient * J[0]
    solution = np.linalg.solve(K, r)
    assert not contacts.coefficient or solution[-1] > 0
    return solution[:half]


def in_phase(equations: Switched, sign: np.ndarray, time: float, y: np.ndarray) -> None:
    """Let contacts slide or stick like this, N on a rail with a coefficient having the sign that it then has."""
    equations.release(time, y)
    places, friction = equations.switches.places, equations.switches.function("friction")
    for side in (1.0, -1.0):
        equations.state[places.K : places.e] = sign.tolist()
        if places.presses:
            equations.state[places.e] = side
        equations._hold()
        if not places.presses or friction(y.tolist(), equations.listed(time, y), ())[-1] * side >= 0:
            return


@pytest.mark.parametrize("name", BESIDE)
@pytest.mark.parametrize("written", [True, False])
def test_every_set_of_sticking_contacts_obeys_newton(name: str, written: bool) -> None:
    numbers = dict(BESIDE[name])
    system = system_of(scene_from({"gravity": 9.81, "pendulum": [{"links": numbers.pop("links")}], **numbers}))
    contacts, free = contacts_of(system), Minimal(system, tuple(map(Recursion, system.groups)))
    if system.hoisting:
        free = Minimal(system, (None,))
    equations = Frictional(free, contacts)
    if written:
        equations = equations_of(system, Choice("minimal", "DOP853", False, ""))  # type: ignore[assignment]
        assert isinstance(equations, Switched)
    rng, half = np.random.default_rng(4), equations.layout.half
    for sign in product((-1.0, 0.0, 1.0), repeat=len(contacts.pairs)):
        s = np.array(sign)
        y = np.append(rng.normal(size=2 * half), 0.0)
        slides = np.abs(rng.normal(size=len(s))) * s
        for (below, above), gamma in zip(contacts.pairs, slides, strict=True):
            y[half + below] = gamma + (y[half + above] if above >= 0 else 0.0)
        if isinstance(equations, Switched):
            in_phase(equations, s, 0.7, y)
        else:
            equations.set_sign(s)
        rate, expected = equations.derivative(0.7, y), newton(system, 0.7, y, s, contacts)
        assert rate[half : 2 * half] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        assert not contacts.relative(rate[: 2 * half].reshape(2, half))[:, s == 0].any()
        if written:
            both = equations.derivative(0.7, np.stack((y, y), axis=1))
            assert both == pytest.approx(np.stack((rate, rate), axis=1), rel=1e-12, abs=1e-12)
