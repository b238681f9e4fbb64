"""Smaller models against the whole ones, by python-control."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.linalg
from control_scenes import DRIVES, SCENES, at, crane, hanging, mixed, of_control, rank

from modal import Bob, Cart, ComputationError, Pendulum, Rod, Scene, SceneError, load, natural_modes
from modal.statespace import StateSpace, minimal, state_space, truncate
from modal.statespace.reduction import balance, fold_equals

OMEGA = np.array([0.05, 0.31, 0.9, 1.7, 3.3, 8.0, 25.0])


def gap(model: StateSpace, whole: StateSpace, omega: np.ndarray = OMEGA) -> float:
    """The largest relative difference of outputs with the same name."""
    names = [signal.name for signal in whole.outputs]
    expected = at(whole, omega)[[names.index(signal.name) for signal in model.outputs]]
    return float(np.abs(at(model, omega) - expected).max() / np.abs(expected).max())


def thousand() -> Scene:
    return Scene(
        gravity=9.81,
        support=Cart(mass=500.0),
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0), Rod(mass=0.5, length=0.3)], count=1000)],
    )


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", SCENES)
def test_the_minimal_model_answers_as_the_whole_one(name: str, drive: str) -> None:
    outputs = ("cart_position", "angles", "rates", *(() if drive == "cart_velocity" else ("pivot_forces",)))
    small, whole = (make(SCENES[name], (drive,), outputs) for make in (minimal, state_space))
    assert gap(small, whole) < 1e-10
    assert len(small.A) <= len(whole.A)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", ["crane", "equal loads", "undamped copies", "dragged cart"])
def test_the_minimal_model_is_minimal(name: str, drive: str) -> None:
    """As many states as the whole model's controllability matrix has rank."""
    scene = SCENES[name]
    assert len(minimal(scene, (drive,)).A) == rank(state_space(scene, (drive,))) == rank(minimal(scene, (drive,)))


def test_a_thousand_equal_pendula_are_six_states() -> None:
    model = minimal(thousand())
    assert model.A.shape == (6, 6)
    assert [signal.name for signal in model.outputs] == ["x", "theta_1_1", "theta_1_2"]
    modes = natural_modes(thousand())
    poles = np.sort(np.linalg.eigvals(model.A).imag)
    assert poles[-2:] == pytest.approx([modes.omega[2], modes.omega[4]], rel=1e-12)


def test_kinds_keep_the_names_of_their_first() -> None:
    a, b = (Pendulum(links=[Bob(mass=1.0, length=l)]) for l in (1.0, 2.0))
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[a, a, b, a, b])
    fold = fold_equals(scene)
    assert fold.first == (1, 3)
    assert fold.copies == (3, 2)
    model = minimal(scene)
    assert [s.name for s in model.states] == ["x", "theta_1_1", "theta_3_1", "x_dot", "theta_dot_1_1", "theta_dot_3_1"]
    assert [name for name, _ in model.operating_point] == ["theta_1_1", "theta_3_1"]
    assert gap(model, state_space(scene)) < 1e-13


def test_different_pendula_of_one_frequency_lose_a_mode() -> None:
    """A bob and a heavier bob on equal cables."""
    pendula = [Pendulum(links=[Bob(mass=m, length=2.0)]) for m in (1.0, 3.0)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=pendula)
    for drive, states in (("cart_force", 4), ("cart_acceleration", 4), ("cart_velocity", 3)):
        model = minimal(scene, (drive,))
        assert len(model.A) == states
        assert gap(model, state_space(scene, (drive,))) < 1e-13


def test_forces_inside_equal_pendula_are_refused() -> None:
    with pytest.raises(SceneError, match="input torque_1_1: "):
        minimal(mixed(), ("joint_torques",))
    scene = mixed(copies=1)
    assert gap(minimal(scene, ("joint_torques",)), state_space(scene, ("joint_torques",))) < 1e-10


@pytest.mark.parametrize("by", ["contribution", "lowest"])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", ["undamped copies", "damped copies", "overdamped copies", "held cart"])
def test_truncation_keeps_the_static_gain(name: str, drive: str, by: str) -> None:
    """What G_K lacks of G vanishes with ω, at least in proportion; where all of D is missing it need not."""
    scene = SCENES[name]
    model = state_space(scene, (drive,), ("cart_position", "angles"))
    small = truncate(natural_modes(scene), model, 1, by)
    assert len(small.A) < len(model.A)
    assert small.inputs == model.inputs
    assert small.outputs == model.outputs
    slow = np.array([1e-2, 2e-2])
    expected = at(model, slow)
    lacking = np.abs(at(small, slow) - expected)[1:].max((0, 1))
    assert lacking[1] > 1.9 * lacking[0]
    bare = np.abs(at(replace(small, D=model.D), slow) - expected)[1:].max((0, 1))
    if drive == "cart_acceleration":
        assert bare[0] > 10 * lacking[0]
        assert bare[1] == pytest.approx(bare[0], rel=1e-2)


def test_all_modes_are_the_whole_model_and_none_the_static_one() -> None:
    model = state_space(hanging())
    modes = natural_modes(hanging())
    assert gap(truncate(modes, model, 3), model) < 1e-12
    none = truncate(modes, model, 0)
    assert none.A.shape == (0, 0)
    assert np.allclose(none.D, control.dcgain(of_control(model)), rtol=1e-10)
    with pytest.raises(ValueError, match="count = -1"):
        truncate(modes, model, -1)


def test_the_rigid_mode_and_growing_ones_stay() -> None:
    free = truncate(natural_modes(crane()), state_space(crane()), 0)
    assert [signal.name for signal in free.states] == ["eta_1", "eta_dot_1"]
    upright = load("cart-upright")
    kept = truncate(natural_modes(upright), state_space(upright), 0)
    growing = np.linalg.eigvals(state_space(upright).A).real.max()
    assert np.linalg.eigvals(kept.A).real.max() == pytest.approx(growing, rel=1e-10)


def test_contribution_finds_the_mode_that_answers() -> None:
    """A light bob tuned far above the load answers least to the trolley."""
    pendula = [Pendulum(links=[Bob(mass=m, length=l)]) for m, l in ((0.01, 4.0), (100.0, 1.0))]
    scene = Scene(gravity=9.81, support=Cart(mass=50.0), pendulum=pendula)
    model = state_space(scene, (), ("cart_position",))
    kept = truncate(natural_modes(scene), model, 1)
    assert [s.name for s in kept.states] == ["eta_1", "eta_dot_1", "eta_3", "eta_dot_3"]
    lowest = truncate(natural_modes(scene), model, 1, "lowest")
    assert [s.name for s in lowest.states][2:] == ["eta_2", "eta_dot_2"]


def test_hankel_values_are_those_of_scipys_gramians() -> None:
    model = state_space(hanging())
    P = scipy.linalg.solve_continuous_lyapunov(model.A, -model.B @ model.B.T)
    Q = control.lyap(model.A.T, model.C.T @ model.C, method="scipy")
    expected = np.sqrt(np.sort(np.linalg.eigvals(P @ Q).real)[::-1])
    balanced = balance(model, 4)
    assert balanced.hankel == pytest.approx(expected, rel=1e-8)
    small = balanced.model
    for A, B in ((small.A, small.B), (small.A.T, small.C.T)):
        assert scipy.linalg.solve_continuous_lyapunov(A, -B @ B.T) == pytest.approx(
            np.diag(expected[:4]), rel=1e-7, abs=1e-7
        )


@pytest.mark.parametrize("count", [2, 4, 6])
def test_the_error_bound_holds_and_is_not_idle(count: int) -> None:
    model = state_space(hanging(2.0))
    balanced = balance(model, count)
    omega = np.geomspace(1e-2, 1e3, 2000)
    error = np.linalg.svd((at(balanced.model, omega) - at(model, omega)).transpose(2, 0, 1), compute_uv=False).max()
    assert error <= balanced.error_bound + 1e-9
    assert error >= 0.05 * balanced.error_bound
    assert np.linalg.eigvals(balanced.model.A).real.max() < 0


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (crane(), "a mode is a rigid translation"),
        (hanging(0.0), "a mode has ζ = 0"),
        (mixed(cart=1.0, spring=5.0), "has ζ = 0"),
        (load("cart-upright"), "needs a stable, damped model"),
    ],
)
def test_balancing_refuses_what_has_no_gramians(scene: Scene, why: str) -> None:
    with pytest.raises(ComputationError, match=why):
        balance(state_space(scene), 2)


def test_balancing_refuses_states_that_are_not_reached() -> None:
    """Equal damped pendula on a sprung cart: the antiphase ones are not."""
    scene = mixed(joint=0.3, cart=1.0, spring=20.0)
    model = state_space(scene)
    small = minimal(scene)
    with pytest.raises(ComputationError, match=f"only {len(small.A)} states"):
        balance(model, len(small.A) + 1)
    assert gap(balance(model, len(small.A)).model, model) < 1e-7
    with pytest.raises(ValueError, match="count = 0"):
        balance(model, 0)
