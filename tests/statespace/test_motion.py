"""Linear models at a state and along a run: complex steps, the model at rest, points by finite steps, and motions."""

from dataclasses import replace
from io import BytesIO
from math import atan, degrees

import numpy as np
import pytest
from scipy.io import loadmat

from modal import SceneError, load
from modal.exports import find_format
from modal.statespace import state_space
from modal.types import IMAGINARY_STEP, Floats
from nonlinear import State, simulate, state_at_rest
from nonlinear.dynamics.minimal import Minimal, Recursion
from nonlinear.postprocessing.models import model_at, models_along
from nonlinear.system import AppliedForces, system_of

CART = "paper-cart-2"


def leaning(scene_name: str) -> State:
    scene = load(scene_name)
    rng = np.random.default_rng(3)
    links, rates = rng.uniform(-1.0, 1.0, (2, scene.n_links))
    return State(links, rates, *((0.3, 0.2) if system_of(scene).first else ()))


def with_step(scene_name: str, F: Floats) -> Minimal:
    """The recursion under generalized forces on (x, θ), of which it knows nothing of tapes."""
    first = system_of(load(scene_name)).first
    acting = AppliedForces(cart=F[0] if first else 0.0, moments=F[first:])
    return replace(recursion(scene_name), load=lambda time, state: acting)


def recursion(scene_name: str) -> Minimal:
    """The equations by the recursion."""
    system = system_of(load(scene_name))
    return Minimal(system, tuple(map(Recursion, system.groups)), counts_work=False)


@pytest.mark.parametrize("scene_name", [CART, "chain-2", "crane-hook"])
def test_a_and_b_are_complex_steps_of_the_recursion(scene_name: str) -> None:
    scene, state = load(scene_name), leaning(scene_name)
    inputs = ("cart_force",) * bool(system_of(scene).first) + ("joint_torques",)
    model = model_at(scene, state, inputs)
    plain = recursion(scene_name)
    y = plain.begin(state).astype(complex)
    steps = [y + 1j * IMAGINARY_STEP * row for row in np.eye(len(y))]
    A = np.array([plain.derivative(0.0, step).imag for step in steps]).T / IMAGINARY_STEP
    np.testing.assert_allclose(model.A, A, rtol=1e-12, atol=1e-12 * np.abs(A).max())
    resting = state_space(scene, inputs)
    M_inverse_F = resting.B[len(y) // 2 :]
    assert model.B.shape[1] == M_inverse_F.shape[1]
    for column, F in zip(model.B.T, generalized(scene_name, inputs).T, strict=True):
        moved, still = with_step(scene_name, F), with_step(scene_name, 0 * F)
        difference = moved.derivative(0.0, y.real) - still.derivative(0.0, y.real)
        np.testing.assert_allclose(column, difference, rtol=1e-10, atol=1e-12 * np.abs(model.B).max())


def generalized(scene_name: str, inputs: tuple[str, ...]) -> Floats:
    """A force on the cart, then torques of joints: each on the link below and against the one above."""
    system = system_of(load(scene_name))
    half, first = system.n_links + system.first, system.first
    torques = np.zeros((half, system.n_links))
    for link in range(system.n_links):
        torques[first + link, link] = 1.0
        if link and system.pendulum[link] == system.pendulum[link - 1]:
            torques[first + link - 1, link] = -1.0
    return np.hstack([np.eye(half)[:, :first], torques])


@pytest.mark.parametrize("drive", ["cart_force", "cart_acceleration"])
def test_at_rest_it_is_the_model_at_equilibrium(drive: str) -> None:
    scene = load("crane-hook")
    outputs = ("cart_position", "angles", "joint_positions", "tip_accelerations", "pivot_forces")
    inputs = (drive, "force:pendulum[0].links[1]@0.5", "link_forces")
    known, model = state_space(scene, inputs, outputs), model_at(scene, state_at_rest(scene, [0, 0]), inputs, outputs)
    for name in "ABCD":
        values = getattr(known, name)
        np.testing.assert_allclose(getattr(model, name), values, rtol=1e-12, atol=1e-12 * np.abs(values).max())
    assert [value for _, value in model.operating_point] == [0.0, 0.0, 0.0]


def test_deviations_from_a_run_follow_its_table_to_second_order() -> None:
    scene, start = load(CART), leaning(CART)
    run = simulate(scene, 1.0, start=start, output=401, tolerance=1e-12)
    table = models_along(run, (), ("cart_position", "angles", "joint_positions"))
    direction = np.random.default_rng(4).normal(size=table.A.shape[1])
    errors = []
    for size in (1e-3, 5e-4):
        z = size * direction
        moved = State(start.links + z[1:half(table)], start.link_rates + z[half(table) + 1 :],
                      start.cart + z[0], start.cart_rate + z[half(table)])  # fmt: skip
        other = simulate(scene, 1.0, start=moved, output=401, tolerance=1e-12)
        for k in range(0, 400, 2):  # Runge-Kutta of fourth order over two samples, with A at its middle
            h = table.times[k + 2] - table.times[k]
            a = table.A[k] @ z
            b = table.A[k + 1] @ (z + h / 2 * a)
            c = table.A[k + 1] @ (z + h / 2 * b)
            z = z + h / 6 * (a + 2 * b + 2 * c + table.A[k + 2] @ (z + h * c))
        deviation = np.concatenate(
            ([other.motion.cart[-1] - run.motion.cart[-1]], other.motion.links[-1] - run.motion.links[-1])
        )
        errors.append(np.abs((table.C[-1] @ z)[: len(deviation)] - deviation).max())
    assert errors[0] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def half(table: object) -> int:
    return len(table.states) // 2  # type: ignore[attr-defined]


def test_accelerations_of_tips_deviate_as_points_of_the_motion_do() -> None:
    """Rods, whose centres are not their ends: by differences of the acceleration of the end itself."""
    scene, state = load("crane-hook"), leaning("crane-hook")
    model = model_at(scene, state, ("cart_force",), ("tip_positions", "tip_accelerations"))
    plain = recursion("crane-hook")
    y, lengths, n = plain.begin(state), system_of(scene).by_link("length"), scene.n_links

    def tip(y: Floats) -> Floats:
        q, v, a = y[: n + 1], y[n + 1 :], plain.derivative(0.0, y)[n + 1 :]
        sine, cosine = np.sin(q[1:]), np.cos(q[1:])
        return np.array([q[0] + lengths @ sine, a[0] + lengths @ (cosine * a[1:] - sine * v[1:] ** 2)])

    steps = [tip(y + 1j * IMAGINARY_STEP * row).imag / IMAGINARY_STEP for row in np.eye(len(y))]
    np.testing.assert_allclose(model.C, np.array(steps).T, rtol=1e-11, atol=1e-11)


def test_a_steady_state_on_a_support_that_accelerates_stays() -> None:
    """Tilted by atan(a/g) it hangs still, in the gravity of its frame, sqrt(g² + a²)."""
    still = load("chain-1")
    record = {"kind": "record", "time_s": [0.0, 1.0, 2.0, 3.0], "acceleration_m_per_s2": [1.0] * 4}
    scene = still.replace(support={"kind": "moved", "motion": record})
    tilt = -degrees(atan(1.0 / still.gravity))
    model = model_at(scene, state_at_rest(scene, [tilt]))
    ratio = model.A[1, 0] / state_space(still).A[1, 0]
    assert ratio == pytest.approx(np.hypot(1.0, still.gravity) / still.gravity, rel=1e-12)
    assert [name for name, _ in model.operating_point] == ["theta_1_1"]
    assert len(model_at(scene, state_at_rest(scene, [0.0])).operating_point) == 3


def test_tables_along_a_run_read_back() -> None:
    table = models_along(simulate(load("chain-1"), 1.0, start=state_at_rest(load("chain-1"), [50.0]), output=4))
    space: dict[str, object] = {}
    exec(find_format("control").write_varying(table), space)
    read = {
        "npz": np.load(BytesIO(find_format("npz").write_varying(table))),
        "mat": loadmat(BytesIO(find_format("mat").write_varying(table))),
        "control": space,
    }
    for content in read.values():
        assert np.array_equal(content["A"], table.A)
        assert np.array_equal(content["B"], table.B)
    assert np.array_equal(read["npz"]["operating_values"], [values for _, values in table.operating_point])
    assert np.array_equal(read["mat"]["operating_point"][0, 0]["values"], read["npz"]["operating_values"])
    assert np.array_equal(space["systems"][3].A, table.A[3])  # type: ignore[index]


def test_what_has_no_model_in_motion_is_refused() -> None:
    scene = load(CART)
    state = leaning(CART)
    with pytest.raises(SceneError, match="input cart_velocity: in motion only its acceleration"):
        model_at(scene, state, ("cart_velocity",))
    with pytest.raises(SceneError, match="a model along a motion"):
        model_at(load("hoisting-crane"), state)
