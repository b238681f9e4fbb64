"""Drag of links: against joint dampers, other forms of the equations, closed forms, and its own power."""

from __future__ import annotations

from math import cos, exp, sin
from typing import Any

import numpy as np
import pytest
from amounts import usually
from dense_form import DenseForm
from scipy.optimize import brentq

from modal.assembly import matrices, rig_of
from modal.coupling import damped_modes, negative_damping
from modal.modes import natural_modes
from modal.scene import Scene, scene_from
from modal.statespace import state_space
from nonlinear import simulate
from nonlinear.dynamics import Generated, Maximal, Minimal, Recursion, Spatial, SpatialRecursion
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.reduction import residual_forces
from nonlinear.system import State, of_plane, system_of

G = 9.81


def bob(**more: Any) -> dict[str, Any]:
    return {"kind": "bob", "mass": 1.0, "length": 1.0, **more}


def scene_of(*pendula: dict[str, Any], **more: Any) -> Scene:
    return scene_from({"gravity": G, "pendulum": list(pendula), **more})


CART = {"kind": "cart", "mass": 3.0, "damping": 0.2, "stiffness": 5.0}
MIXED = scene_of(
    {
        "count": 2,
        "links": [
            {"kind": "rod", "mass": 1.2, "length": 0.8, "drag": 0.3, "quadratic_drag": 0.2},
            {"kind": "body", "mass": 0.7, "length": 0.5, "centre": 0.6, "inertia": 0.03, "drag": 0.1, "damping": 0.02},
        ],
        "start": {"angles_deg": [50.0, -80.0]},
    },
    {"links": [bob(quadratic_drag=0.15)], "start": {"angles_deg": [-30.0]}},
    support=CART,
)


def some_state(scene: Scene, seed: int = 5) -> State:
    rng = np.random.default_rng(seed)
    links, rates = rng.normal(size=(2, scene.n_links))
    return State(links, 2 * rates, 0.3, -0.7)


def test_every_form_of_the_equations_agrees() -> None:
    system, state = system_of(MIXED), some_state(MIXED)
    recursion = tuple(Recursion(group) for group in system.groups)
    plain = Minimal(system, recursion)
    expected = plain.derivative(0.0, plain.begin(state))
    half = plain.layout.half
    for other in (Generated(system), DenseForm(system)):
        assert other.derivative(0.0, other.begin(state)) == pytest.approx(expected, rel=1e-10, abs=1e-10)
    maximal = Maximal(system)
    rates = maximal.derivative(0.0, maximal.begin(state))
    assert rates[-1] == pytest.approx(expected[-1])
    solid = Spatial(system_of(MIXED.replace(space="space")), tuple(SpatialRecursion(g) for g in system.groups))
    turned = of_plane(state)
    rate = solid.derivative(0.0, solid.begin(turned))
    assert rate[solid.layout.half] == pytest.approx(expected[half])
    assert rate[-1] == pytest.approx(expected[-1])


@pytest.mark.parametrize("form", ["maximal", "hamiltonian"])
def test_runs_in_other_forms_agree(form: str) -> None:
    trajectory, other = (
        simulate(MIXED, usually(0.8, 1.5), form=name, tolerance=1e-11, output=16) for name in ("minimal", form)
    )
    assert other.motion.links == pytest.approx(trajectory.motion.links, abs=1e-8)
    for run in (trajectory, other):
        assert run.energy_drift() < 1e-9
        assert run.motion.work[-1] < -0.1


def test_runs_in_space_keep_the_books_and_the_plane() -> None:
    flat = simulate(MIXED, 1.5, tolerance=1e-11, output=16)
    solid = simulate(MIXED.replace(space="space"), 1.5, tolerance=1e-11, output=16)
    assert solid.motion.cart == pytest.approx(flat.motion.cart, abs=1e-8)
    assert solid.energy_drift() < 1e-9


def test_linear_drag_of_a_bob_is_a_damper() -> None:
    """On a fixed support −c l θ' at the end of l is the torque −c l² θ', at any angle."""
    dragged, damped = (
        simulate(
            scene_of({"links": [bob(length=0.7, **resistance)], "start": {"angles_deg": [140.0]}}),
            10.0,
            tolerance=1e-11,
        )
        for resistance in ({"drag": 0.3}, {"damping": 0.3 * 0.7**2})
    )
    assert dragged.motion.links == pytest.approx(damped.motion.links, abs=1e-8)
    assert dragged.run.method == damped.run.method


def test_quadratic_drag_between_two_turning_points() -> None:
    """d(ω²)/dθ = −2 (g/l) sin θ + 2 κ ω² while θ falls, κ = c l/m, has a closed form (Bernoulli's equation)."""
    kappa, a = 0.4, 1.2
    scene = scene_of({"links": [bob(quadratic_drag=kappa)], "start": {"angles_deg": [float(np.degrees(a))]}})

    def squared(theta: float) -> float:
        """ω² e^{−2κθ} has the derivative −2 g sin θ e^{−2κθ}."""

        def part(t: float) -> float:
            return 2 * G * exp(-2 * kappa * t) * (2 * kappa * sin(t) + cos(t)) / (1 + 4 * kappa**2)

        return exp(2 * kappa * theta) * (part(theta) - part(a))

    turned = float(brentq(squared, -a, -0.1))
    run = simulate(scene, 2.0, tolerance=1e-12, output=4001)
    assert run.motion.links.min() == pytest.approx(turned, abs=1e-6)
    assert run.motion.link_rates[300, 0] ** 2 == pytest.approx(squared(float(run.motion.links[300, 0])), rel=1e-9)


def test_forces_of_the_pivots_balance_weight_and_drag() -> None:
    """m a of a bob = tension + weight + drag, the tension along the rod."""
    scene = scene_of({"links": [bob(drag=0.5, quadratic_drag=0.2)], "start": {"angles_deg": [60.0]}})
    run = simulate(scene, 2.0, output=21, tolerance=1e-11)
    force, theta = reaction_forces_of(run).pivots[:, 0], run.motion.links[:, 0]
    assert force[:, 0] * np.cos(theta) - force[:, 1] * np.sin(theta) == pytest.approx(0.0, abs=1e-8)
    tension = -(force[:, 0] * np.sin(theta) + force[:, 1] * np.cos(theta))
    assert tension == pytest.approx(G * np.cos(theta) + run.motion.link_rates[:, 0] ** 2, rel=1e-8)


# -------------------------------------------------------------------------------------------------------- linear

LINEAR = scene_of(
    {
        "count": 2,
        "links": [
            {"kind": "rod", "mass": 1.2, "length": 0.8, "drag": 0.3},
            {"kind": "body", "mass": 0.7, "length": 0.5, "centre": 0.6, "inertia": 0.03, "drag": 0.1, "damping": 0.02},
        ],
        "start": {"angles_deg": [5.0, 3.0]},
    },
    {"links": [bob(drag=0.4)], "equilibrium": ["down"], "start": {"angles_deg": [2.0]}},
    support=CART,
)
STANDING = scene_of(
    {"links": [bob(drag=0.3), bob(drag=0.2, stiffness=90.0)], "equilibrium": ["down", "up"]}, support=CART
)


@pytest.mark.parametrize("scene", [LINEAR, STANDING], ids=["hanging", "standing"])
def test_the_damping_matrix_is_that_of_the_full_equations(scene: Scene) -> None:
    system, model = system_of(scene), matrices(scene)
    equations = DenseForm(system)
    half, size = equations.layout.half, 1e-6

    def accelerations(v: np.ndarray) -> np.ndarray:
        y = np.zeros(equations.layout.size)
        y[1:half], y[half : 2 * half] = system.rest, v
        return np.asarray(equations.derivative(0.0, y)[half : 2 * half])

    slope = np.array([(accelerations(size * e) - accelerations(-size * e)) / (2 * size) for e in np.eye(half)]).T
    assert -model.M @ slope == pytest.approx(model.D, abs=1e-7)
    assert pytest.approx(model.D.T) == model.D


@pytest.mark.parametrize("free", [False, True])
def test_damped_modes_are_eigenvalues_of_the_matrices(free: bool) -> None:
    scene = LINEAR.replace(support=LINEAR.support.replace(stiffness=0.0, damping=0.0)) if free else LINEAR
    model, n = matrices(scene), scene.n_links + 1
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(model.M, np.hstack([model.K, model.D]))]])
    expected = np.linalg.eigvals(state)
    expected = np.sort_complex(expected[(expected.imag >= 0) & (abs(expected) > 1e-9)])
    values = natural_modes(scene).eigenvalue
    values = np.repeat(values, natural_modes(scene).multiplicity)
    assert np.sort_complex(values[abs(values) > 1e-9]) == pytest.approx(expected, abs=1e-9)


def test_modes_in_space_are_those_along_and_across() -> None:
    scene = scene_of({"links": [bob(drag=0.4), bob(drag=0.1)]}, space="space", support={"kind": "cart", "mass": 2.0})
    across = natural_modes(scene_of({"links": [bob(drag=0.4), bob(drag=0.1)]})).eigenvalue
    along = natural_modes(scene.in_plane).eigenvalue
    assert np.sort_complex(natural_modes(scene).eigenvalue) == pytest.approx(
        np.sort_complex(np.concatenate((along, across)))
    )


def test_first_order_rates_approach_those_of_the_damped_modes() -> None:
    light = scene_from({**LINEAR.model_dump(), "support": {"kind": "cart", "mass": 3.0, "stiffness": 5.0}})
    for pendulum in light.pendulum:
        assert pendulum.links
    scaled = light.replace(
        pendulum=tuple(
            pendulum.replace(links=tuple(link.replace(drag=link.drag * 1e-3, damping=0.0) for link in pendulum.links))
            for pendulum in light.pendulum
        )
    )
    rig = rig_of(scaled)
    rates = damped_modes(rig, negative_damping(scaled, rig))
    assert all(mode.exact is not None and mode.decay == pytest.approx(mode.rate, rel=1e-5) for mode in rates)
    assert all(mode.from_drag > 0 for mode in rates)


def test_a_prescribed_cart_drags_its_pendula() -> None:
    """Under a constant velocity V of the cart a bob hangs back: m g θ = −c V, whichever input moves the cart."""
    scene = scene_of({"links": [bob(drag=0.4)]}, support={"kind": "cart", "mass": 2.0})
    model = state_space(scene, ("cart_velocity",), ("angles",))
    assert model.C[0, 1:] @ np.linalg.solve(model.A[1:, 1:], -model.B[1:, 0]) == pytest.approx(-0.4 / G)
    other = state_space(scene, ("cart_acceleration",), ("angles",))
    at = [signal.name for signal in other.states].index("x_dot")
    rows = [k for k, signal in enumerate(other.states) if signal.name.startswith("theta")]
    resting = np.linalg.solve(other.A[np.ix_(rows, rows)], -other.A[rows, at])
    assert resting[0] == pytest.approx(-0.4 / G)


def test_residual_forces_of_a_solution_vanish() -> None:
    scene = MIXED
    run = simulate(scene, 1.0, tolerance=1e-12, output=11)
    system, motion = run.system, run.motion
    equations = DenseForm(system)
    rows = np.array([equations.derivative(0.0, equations.begin(motion[k])) for k in range(11)]).T
    half = equations.layout.half
    q = np.vstack((motion.cart, motion.links.T - system.rest[:, None]))
    v = np.vstack((motion.cart_rate, motion.link_rates.T))
    left = residual_forces(system, [np.array([q, v, rows[half : 2 * half]])])
    assert left[0] == pytest.approx(0.0, abs=1e-9)
