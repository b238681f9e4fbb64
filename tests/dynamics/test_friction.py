"""The complementarity problem of contacts at rest, against all its states, and the law on the rail."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

from modal.scene import scene_from
from nonlinear.dynamics import Contacts, contacts_of, form_of
from nonlinear.dynamics.complementarity import consistent, on_rail
from nonlinear.dynamics.forms import switching_of, with_contacts
from nonlinear.integration import Choice, equations_of
from nonlinear.integration.switches import Switched, switches_of
from nonlinear.system import System, system_of


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


def test_a_rail_that_jams_has_no_state() -> None:
    assert not on_rail([1.0], [1.0], [2.0], [1.0], [1.0, -1.0], 1)[0]


# ---------------------------------------------------------------------------------------- many that push one another


def rubbing(pendula: int, links: int, **cart: float) -> System:
    rows = [{"kind": "rod", "mass": 0.5 + 0.3 * k, "length": 0.4, "friction": 0.1 * (k != 1)} for k in range(links)]
    rail = {"kind": "cart", "mass": 1.0, **cart}
    return system_of(scene_from({"gravity": 9.81, "support": rail, "pendulum": [{"links": rows}] * pendula}))


@pytest.mark.parametrize(("pendula", "links"), [(2, 3), (6, 1), (1, 7)])
def test_what_holds_joints_solves_the_matrix_of_responses(pendula: int, links: int) -> None:
    switches = switches_of(rubbing(pendula, links, friction=0.2))
    at, contacts, rng = switches.places, contacts_of(switches.form.system), np.random.default_rng(links)
    for _ in range(8):
        y, sticks, slides = rng.normal(size=at.size).tolist(), rng.random(at.J) < 0.6, rng.normal(size=at.J)
        u = [*np.where(sticks, 0.0, slides), *sticks.astype(float)]
        answer = np.array(switches.function("responses")(y, u, ()))
        columns = answer[at.size :].reshape(at.half, at.J)
        G, a = contacts.relative(columns.T).T, contacts.relative(answer[at.half : 2 * at.half])
        tau = np.zeros(at.J)
        tau[sticks] = np.linalg.solve(G[np.ix_(sticks, sticks)], -a[sticks])
        assert switches.function("friction")(y, u, ()) == pytest.approx(tau, rel=1e-12, abs=1e-12)
        expected = answer[at.half : 2 * at.half] + columns @ tau
        rates = switches.function("sticking")(y, u, ())[at.half : 2 * at.half]
        assert rates == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_texts_grow_with_the_number_of_contacts() -> None:
    few, many = (switching_of(with_contacts(form_of(rubbing(pendula, 2, friction=0.2)))) for pendula in (3, 6))
    for name in ("sticking", "friction", "values"):
        assert many.python(name).count(" * ") < 2.1 * few.python(name).count(" * ")


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
    "chain": {"links": [*LINKS, {**LINKS[0], "friction": 0.0}, LINKS[1]], "support": CART},
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
    J, stuck = contacts.relative(np.eye(half)).T.copy(), sign == 0
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
        if not places.presses or friction(y.tolist(), equations.inputs_at(time, y), ())[-1] * side >= 0:
            return


@pytest.mark.parametrize("name", BESIDE)
def test_every_set_of_sticking_contacts_obeys_newton(name: str) -> None:
    numbers = dict(BESIDE[name])
    system = system_of(scene_from({"gravity": 9.81, "pendulum": [{"links": numbers.pop("links")}], **numbers}))
    contacts, equations = contacts_of(system), equations_of(system, Choice("minimal", "DOP853", False, ""))
    assert isinstance(equations, Switched)
    rng, half = np.random.default_rng(4), equations.layout.half
    for sign in product((-1.0, 0.0, 1.0), repeat=len(contacts.pairs)):
        s = np.array(sign)
        y = np.append(rng.normal(size=2 * half), 0.0)
        slides = np.abs(rng.normal(size=len(s))) * s
        for (below, above), gamma in zip(contacts.pairs, slides, strict=True):
            y[half + below] = gamma + (y[half + above] if above >= 0 else 0.0)
        in_phase(equations, s, 0.7, y)
        rate, expected = equations.derivative(0.7, y), newton(system, 0.7, y, s, contacts)
        assert rate[half : 2 * half] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        assert not contacts.relative(rate[: 2 * half].reshape(2, half))[:, s == 0].any()
        both = equations.derivative(0.7, np.stack((y, y), axis=1))
        assert both == pytest.approx(np.stack((rate, rate), axis=1), rel=1e-12, abs=1e-12)
