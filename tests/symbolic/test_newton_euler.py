"""Newton's and Euler's balances of the parts: paper 000's own, and solved, those of two engines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scenes import decimal_scene, minimal, random_state

from modal import Bob, Cart, Pendulum, Rod, Scene, SceneError, load
from modal.scene import VanDerPol, free_bodies, scene_from
from modal.symbolic import vanishes
from modal.symbolic.newton_euler import NewtonEuler
from modal.symbolic.papers import cart_dae, residual
from nonlinear.dynamics import Maximal
from nonlinear.dynamics.forces import sizes_at
from nonlinear.system import system_of


def cart_of(n: int) -> Scene:
    rods = Pendulum(links=[Rod(mass=1.0, length=1.0, count=2)], count=n)
    return Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=[rods])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_they_are_the_10n_plus_3_of_paper_000(n: int) -> None:
    """Letter by letter the corrected equations of `cart_dae`, which were written from the paper."""
    system = NewtonEuler(free_bodies(cart_of(n), "paper"))
    assert len(system.equations) == len(system.unknowns) == 10 * n + 3
    assert set(system.unknowns) == set(cart_dae.unknowns(n))
    theirs = [residual(equation.corrected) for equation in cart_dae.equations(n)]
    positive = {name: sp.Symbol(name.name) for form in theirs for name in form.free_symbols}
    left = [form.subs(positive) for form in theirs]
    for form in map(residual, system.equations):
        match = next(k for k, other in enumerate(left) if vanishes(form - other) or vanishes(form + other))
        del left[match]
    assert left == []


def losing(seed: int) -> Scene:
    """A random scene of decimals with drag and a drive here and there."""
    scene, rng = decimal_scene(seed), np.random.default_rng(seed)
    more = [{}, {"drag": 0.3}, {"quadratic_drag": 0.2}, {"drive": VanDerPol(strength=0.4, angle_deg=30.0)}]
    pendula = [
        pendulum.replace(links=tuple(link.replace(**more[rng.integers(4)]) for link in pendulum.links))
        for pendulum in scene.pendulum
    ]
    return scene.replace(pendulum=tuple(pendula))


def values_of(scene: Scene, system: NewtonEuler) -> dict[sp.Symbol, float]:
    """The numbers of a scene by the names of their letters."""
    put = {sp.Symbol("g"): scene.gravity}
    if scene.cart is not None:
        cart = {"m_c": scene.cart.mass, "k_c": scene.cart.stiffness, "d_c": scene.cart.damping}
        put |= {sp.Symbol(name): value for name, value in cart.items()}
    for part in system.bodies.parts[1:]:
        link = part.link
        numbers = {"m": link.mass, "l": link.length, "c": link.centre, "I": link.inertia, "k": link.stiffness}
        numbers |= {"d": link.damping, "a": link.drag, "b": link.quadratic_drag}
        if link.drive:
            numbers |= {"e": link.drive.strength, "gamma": np.radians(link.drive.angle_deg)}
        put |= {sp.Symbol(part.with_index(letter)): value for letter, value in numbers.items()}
    return put


@pytest.mark.parametrize("seed", range(1, 8))
def test_solved_they_are_the_accelerations_and_forces_of_both_engines(seed: int) -> None:
    scene = losing(seed)
    system, numeric = NewtonEuler(free_bodies(scene)), system_of(scene)
    state, maximal = random_state(numeric, seed), Maximal(numeric)
    y = maximal.begin(state)
    size, first = maximal.pivots.size, maximal.pivots.first
    put = values_of(scene, system)
    names = [c for part in system.bodies.parts[1:] for c in system.motion(part)]
    if first:
        names = [*system.motion(system.bodies.support)[:2], *names]
    put |= {c.q: value for c, value in zip(names, y[:size], strict=True)}
    put |= {c.v: value for c, value in zip(names, y[size : 2 * size], strict=True)}
    for _, law in system.laws():
        put |= {law.lhs: law.rhs.subs(put)}
    A, F = (np.array(part.subs(put), dtype=float) for part in system.linear_system())
    u = np.linalg.solve(A, F).ravel()
    theirs = maximal.unknowns(0.0, y)
    np.testing.assert_allclose(u, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())
    equations = minimal(numeric)
    slopes = equations.derivative(0.0, equations.begin(state))[equations.layout.half : 2 * equations.layout.half]
    turning = [u[0], *u[first + 2 : size : 3]] if first else u[first + 2 : size : 3]
    np.testing.assert_allclose(turning, slopes, rtol=0, atol=1e-9 * np.abs(slopes).max())


FORCES = (
    {"on": "pendulum[0].links[0]", "kind": "constant", "amplitude": 3.0},
    {"on": "pendulum[0].links[1]@0.3", "direction": "vertical", "amplitude": 2.0, "frequency_hz": 0.7},
    {"on": "pendulum[0].links[1]", "direction": "torque", "amplitude": 0.4, "frequency_hz": 0.4},
    {"on": "pendulum[0].links[0]@0.2", "direction": "torque", "amplitude": 0.3, "frequency_hz": 0.5},
)
MOVED = {
    "kind": "moved",
    "motion": [
        {"kind": "sine", "direction": "horizontal", "amplitude": 0.1, "frequency_hz": 0.6},
        {"kind": "sine", "direction": "vertical", "amplitude": 0.2, "frequency_hz": 0.9},
    ],
}


@pytest.mark.parametrize("support", [{"kind": "cart", "mass": 2.0}, MOVED], ids=["cart", "moved"])
def test_forces_and_a_moved_support_are_those_of_the_engine(support: dict[str, Any]) -> None:
    """Joint forces at any instant; accelerations of the parts are the engine's and that of its frame."""
    time, links = (
        0.37,
        [{"kind": "rod", "mass": 1.0, "length": 1.0, "drag": 0.2}, {"kind": "bob", "mass": 0.5, "length": 0.8}],
    )
    more = [{"on": "cart", "amplitude": 1.5, "frequency_hz": 0.3}] if support["kind"] == "cart" else []
    forces = [{"kind": "sine"} | each for each in (*FORCES, *more)]
    scene = scene_from(
        {"gravity": 9.81, "support": support, "pendulum": [{"links": links, "count": 2}], "force": forces}
    )
    system, numeric = NewtonEuler(free_bodies(scene)), system_of(scene)
    state, maximal = random_state(numeric, 5), Maximal(numeric)
    y, put = maximal.begin(state), values_of(scene, system)
    put |= {sp.Symbol(f"F_{k}"): size for k, size in enumerate(sizes_at(numeric, time), 1)}
    put[sp.Symbol("s_2")] = 0.3
    frame = numeric.support
    (along, down), (vx, vz) = (frame.acceleration(time), frame.velocity(time)) if frame else ((0.0, 0.0), (0.0, 0.0))
    put |= {sp.Symbol("a_x"): along, sp.Symbol("a_z"): down}
    size, first = maximal.pivots.size, maximal.pivots.first
    names = [c for part in system.bodies.parts[1:] for c in system.motion(part)]
    names = [*system.motion(system.bodies.support)[:2], *names] if first else names
    rates = y[size : 2 * size].copy()
    maximal.pivots.parts(rates)[1][:, :2] += vx, vz
    put |= {c.q: value for c, value in zip(names, y[:size], strict=True)}
    put |= {c.v: value for c, value in zip(names, rates, strict=True)}
    put |= {law.lhs: law.rhs.subs(put) for _, law in system.laws()}
    u = np.linalg.solve(*(np.array(part.subs(put), dtype=float) for part in system.linear_system())).ravel()
    theirs = maximal.unknowns(time, y)
    maximal.pivots.parts(theirs[:size])[1][:, :2] += along, down
    np.testing.assert_allclose(u, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())


def test_action_and_reaction_are_opposite_and_cancel_over_all_parts() -> None:
    """Only weights, the rail's push and what holds the cart are left of all forces together."""
    for name, letters in (("paper-cart-2", "paper"), ("metronomes", "own"), ("chain-3", "own")):
        bodies = free_bodies(load(name), letters)
        sums: dict[str, int] = {}
        for effort in (effort for part in bodies.parts for effort in part.efforts):
            for letter in filter(None, (effort.along, effort.down, effort.turning)):
                sums[letter] = sums.get(letter, 0) + effort.sign
        assert {letter for letter, total in sums.items() if total and " g" not in letter} <= {"R", "N", "H"}


def test_what_cannot_be_taken_apart_is_refused() -> None:
    with pytest.raises(SceneError, match="is drawn for pendula on one cart"):
        free_bodies(load("two-swings"))
    bob = Pendulum(links=[Bob(mass=1.0, length=1.0)])
    with pytest.raises(SceneError, match="is drawn in the plane"):
        free_bodies(Scene(gravity=9.81, space="space", pendulum=[bob]))
    with pytest.raises(SceneError, match="must be one of own, paper"):
        free_bodies(load("chain-2"), "theirs")
