"""The motion of the support as an input: three inputs, one response; transmissibility to many digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scenes import mild_scene

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, SceneError, load, matrices, natural_modes
from modal.statespace import frequency_response, modal_gains, state_space, to_modal_form

MOVES = ("support_displacement", "support_velocity", "support_acceleration")
WHERE = ("joint_positions", "angles", "tip_positions")
HELD = Fixed()
OMEGA = np.array([0.7, 2.0, 7.7, 30.0])


def chain(support: Fixed | Cart = HELD) -> Scene:
    links = (
        Rod(mass=1.3, length=0.8, damping=0.1),
        Bob(mass=0.4, length=0.5),
        Body(mass=0.7, length=0.3, centre=0.2, inertia=0.01, damping=0.03),
    )
    return Scene(gravity=9.81, support=support, pendulum=(Pendulum(links=links),))


def responses(scene: Scene, outputs: tuple[str, ...], omega: np.ndarray = OMEGA) -> list[np.ndarray]:
    """For a displacement of 1 m, by each of the three inputs."""
    modes = natural_modes(scene)
    forms = [to_modal_form(modes, state_space(scene, (name,), outputs)) for name in MOVES]
    assert max(form.residual() for form in forms) < 1e-11
    return [frequency_response(form, omega)[:, 0] * (1j * omega) ** k for k, form in enumerate(forms)]


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0), Cart(mass=2.0, stiffness=30.0, damping=1.0)])
def test_three_inputs_are_one_motion(support: Fixed | Cart) -> None:
    outputs = (*WHERE, *(["cart_position"] if support.kind == "cart" else []))
    first, *others = responses(chain(support), outputs)
    for other in others:
        assert other == pytest.approx(first, abs=1e-11)


def test_a_moved_support_is_a_cart_whose_motion_is_prescribed() -> None:
    first = responses(chain(), (*WHERE, "relative_angles"))[0]
    cart = chain(Cart(mass=5.0))
    form = to_modal_form(natural_modes(cart), state_space(cart, ("cart_acceleration",), (*WHERE, "relative_angles")))
    assert frequency_response(form, OMEGA)[:, 0] * (1j * OMEGA) ** 2 == pytest.approx(first, abs=1e-11)
    pivots = [
        to_modal_form(natural_modes(example), state_space(example, (name,), ("pivot_forces", "tip_accelerations")))
        for example, name in ((chain(), "support_acceleration"), (cart, "cart_acceleration"))
    ]
    assert frequency_response(pivots[0], OMEGA) == pytest.approx(frequency_response(pivots[1], OMEGA), rel=1e-9)


def test_under_a_cart_the_ground_pulls_its_spring_and_damper() -> None:
    """M q'' + D q' + K q = e_x (k s + c s') with the cart's position in the laboratory."""
    scene = chain(Cart(mass=2.0, stiffness=30.0, damping=1.0))
    model = matrices(scene)
    pull = np.zeros(len(model.M), dtype=complex)
    first = responses(scene, ("cart_position", "angles"))[0]
    for k, omega in enumerate(OMEGA):
        pull[0] = 30.0 + 1j * omega
        q = np.linalg.solve(model.K + 1j * omega * model.D - omega**2 * model.M, pull)
        assert first[:, k] == pytest.approx(q, abs=1e-12)


def test_a_free_cart_does_not_feel_the_ground() -> None:
    scene = chain(Cart(mass=2.0))
    assert np.abs(responses(scene, ("cart_position", "angles"))[0]).max() < 1e-13
    gains = modal_gains(natural_modes(scene), state_space(scene, ("support_displacement",), ("angles",)))
    assert not gains.inputs.gain.any()


@pytest.mark.parametrize("seed", range(6))
def test_transmissibility_to_many_digits(seed: int) -> None:
    """Against the same matrices solved with fifty digits, up to three times the fastest mode."""
    scene = mild_scene(seed, damping=0.02).replace(support=Fixed(), space="plane")
    system, modes = matrices(scene), natural_modes(scene)
    model = state_space(scene, ("support_displacement",), ("joint_positions",))
    omega = np.geomspace(0.1 * modes.omega[0], 3 * modes.omega[-1], 9)
    H = frequency_response(to_modal_form(modes, model), omega)[:, 0]
    rows = state_space(scene, ("joint_torques",), ("joint_positions",)).C[:, : len(system.M)]
    with mp.workdps(50):
        M, K, D, p, C = (mp.matrix(part.tolist()) for part in (system.M, system.K, system.D, _momentum(scene), rows))
        for k, w in enumerate(map(mp.mpf, omega.tolist())):
            q = mp.lu_solve(K + 1j * w * D - w * w * M, w * w * p)
            exact = np.array([complex(1 + y) for y in C * q])
            assert np.abs(H[:, k] - exact).max() <= 1e-10 * max(1.0, np.abs(exact).max())


def _momentum(scene: Scene) -> np.ndarray:
    """σ_i b_i from the column of a cart that carries the scene."""
    return matrices(scene.replace(support=Cart(mass=1.0))).M[1:, :1]


def test_bobs_isolate_by_two_powers_a_stage() -> None:
    """Far above its modes an undamped chain of n bobs passes (ω_1 … ω_n)²/ω²ⁿ of the support's motion."""
    scene = load("chain-3")
    modes = natural_modes(scene)
    form = to_modal_form(modes, state_space(scene, ("support_displacement",), ("tip_positions",)))
    omega = np.array([30.0, 60.0]) * modes.omega[-1]
    size = np.abs(frequency_response(form, omega)[0, 0])
    assert size == pytest.approx(np.prod(modes.omega**2) / omega**6, rel=0.01)


def test_outputs_with_impulses_are_refused() -> None:
    for drive, output, said in (
        ("support_displacement", "rates", "give its velocity"),
        ("support_displacement", "pivot_forces", "give its acceleration"),
        ("support_velocity", "pivot_forces", "give its acceleration"),
        ("support_velocity", "tip_accelerations", "give its acceleration"),
    ):
        with pytest.raises(SceneError, match=said):
            state_space(chain(), (drive,), (output,))
    with pytest.raises(SceneError, match="choose only one of cart_velocity and support_velocity"):
        state_space(chain(Cart(mass=1.0)), ("support_velocity", "cart_velocity"))
    with pytest.raises(SceneError, match="choose only one of support_velocity and support_acceleration"):
        state_space(chain(), ("support_velocity", "support_acceleration"))


def test_a_force_beside_the_support() -> None:
    model = state_space(chain(), ("support_acceleration", "link_forces"), WHERE)
    assert [signal.name for signal in model.inputs][:2] == ["support_acceleration", "force_1_1"]
    alone = state_space(chain(), ("link_forces",), WHERE)
    s = 2.0j

    def gain(model: object) -> np.ndarray:
        return model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D  # type: ignore[attr-defined]

    assert gain(model)[:, 1:] == pytest.approx(gain(alone), abs=1e-12)
