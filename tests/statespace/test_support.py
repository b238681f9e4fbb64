"""The motion of the support as an input: three inputs, one response; transmissibility to many digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from control_scenes import model_at
from scenes import mild_scene

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, SceneError, Spring, load, matrices, natural_modes
from modal.scene import ConstantForce, Hoist, Moved, SineMotion
from modal.statespace import StateSpace, frequency_response, modal_gains, state_space, to_modal_form
from modal.statespace.response import terms
from nonlinear import State, simulate

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


# ------------------------------------------------------------------------------------------------------------ drag


def in_air(support: Fixed | Cart = HELD, **more: float) -> Scene:
    links = (Rod(mass=1.3, length=0.8, damping=0.1, drag=0.2), Bob(mass=0.4, length=0.5, drag=0.3))
    pendula = (Pendulum(links=links), Pendulum(links=(Bob(mass=0.7, length=1.3, drag=0.1),), count=2))
    return Scene(gravity=9.81, support=support, pendulum=pendula, **more)


@pytest.mark.parametrize("kind", ["plain", "whole", "leaning"])
def test_drag_on_a_moved_support_is_that_below_a_cart_which_is_pushed(kind: str) -> None:
    """A force moves the cart by x in still air: outputs over x are those of a moved support, whatever its mass."""
    wind = (ConstantForce(on="pendulum[0].links[1]", amplitude=2.0),) if kind == "leaning" else ()
    scene, cart = in_air().replace(force=wind), in_air(Cart(mass=1e3, stiffness=1e4)).replace(force=wind)
    pushed = state_space(cart, ("cart_force",), ("angles", "pivot_forces", "cart_position"))
    exact = np.array([_gain(pushed, omega)[:, 0] for omega in OMEGA]).T
    angles, forces = np.split(exact[:-1] / exact[-1], [scene.n_links])
    if kind == "whole":
        pendula = [p.replace(on=on) for p, on in zip(scene.pendulum, "ab", strict=True)]
        scene = scene.replace(support=(Fixed(name="a"), Fixed(name="b")), pendulum=pendula)
    for response in responses(scene, ("angles",)):
        assert response == pytest.approx(angles, rel=1e-11)
    model = state_space(scene, ("support_acceleration",), ("pivot_forces",))
    of_model = np.array([_gain(model, omega)[:, 0] for omega in OMEGA]).T
    for response in (of_model, frequency_response(to_modal_form(natural_modes(scene), model), OMEGA)[:, 0]):
        assert response * (1j * OMEGA) ** 2 == pytest.approx(forces, rel=1e-11)


def _gain(model: StateSpace, omega: float) -> np.ndarray:
    return model.C @ np.linalg.solve(1j * omega * np.eye(len(model.A)) - model.A, model.B) + model.D


@pytest.mark.parametrize(
    "support", [Fixed(), Cart(mass=2.0), Cart(mass=2.0, damping=0.7), Cart(mass=2.0, stiffness=30.0, damping=1.0)]
)
def test_modes_carried_through_the_air_add_up_to_the_response(support: Fixed | Cart) -> None:
    """Free carts stay where they are; with a damper to the moved ground they drift, and everything leans."""
    scene = in_air(support)
    drives = ("support_acceleration", *(["cart_acceleration"] if isinstance(support, Cart) else []))
    for drive in drives:
        model = state_space(scene, (drive,), ("tip_positions", "pivot_forces"))
        form = to_modal_form(natural_modes(scene), model)
        assert form.residual() < 1e-12
        exact = np.array([_gain(model, omega)[:, 0] for omega in OMEGA]).T
        parts = [term.at(1j * OMEGA) for term in terms(form)]
        summed = sum(above[:, 0] / below for above, below in parts) + model.D
        for computed in (summed, frequency_response(form, OMEGA)[:, 0]):
            assert computed == pytest.approx(exact, abs=1e-11)


def test_a_moved_support_in_air_is_that_of_the_simulator() -> None:
    """10 µm at 0.45 Hz for 30 s, against a start in steady motion."""
    omega, size = 2 * np.pi * 0.45, 1e-5
    scene = in_air()
    model = state_space(scene, ("support_displacement",), ("angles",))
    response = frequency_response(to_modal_form(natural_modes(scene), model), [omega])[:, 0, 0]
    moved = scene.replace(support=Moved(motion=SineMotion(amplitude=size, frequency_hz=0.45)))
    times = np.linspace(0.0, 30.0, 61)
    steady = size * response  # s = size · Im exp(iωt)
    run = simulate(moved, 30.0, start=State(steady.imag, (1j * omega * steady).imag), output=times, tolerance=1e-11)
    expected = (steady * np.exp(1j * omega * times[:, None])).imag
    assert np.abs(run.motion.links - expected).max() < 1e-7 * np.abs(steady).max()


def test_a_hoist_on_a_moved_support_in_air_is_that_below_a_held_cart() -> None:
    bob = Bob(mass=20.0, length=4.0, drag=5.0, quadratic_drag=2.0, hoist=Hoist(to=2.0, begin=0.0, duration=3.0))
    fixed, cart = (
        Scene(gravity=9.81, support=support, pendulum=(Pendulum(links=(bob,)),)) for support in (HELD, Cart(mass=9.0))
    )
    for time in (0.5, 1.5, 2.2):
        moved = model_at(fixed, time, ("support_acceleration",), ("angles", "pivot_forces"))
        held = model_at(cart, time, ("cart_acceleration",), ("angles", "pivot_forces"))
        assert all(np.allclose(*parts, rtol=1e-13) for parts in ((getattr(moved, n), getattr(held, n)) for n in "ABCD"))


@pytest.mark.parametrize(("drive", "order"), [("cart_acceleration", 2), ("cart_velocity", 1)])
def test_springs_between_pendula_and_the_ground_pull_as_the_cart_moves(drive: str, order: int) -> None:
    """M, K and D below a cart at x = exp(iωt), its own row omitted."""
    springs = [Spring(between=("pendulum[0].links[1]", "ground@0.5,-1"), stiffness=7.0, damping=0.3)]
    scene = in_air(Cart(mass=2.0)).replace(spring=springs)
    linear = matrices(scene)
    form = to_modal_form(natural_modes(scene), state_space(scene, (drive,), ("angles",)))
    assert form.residual() < 1e-12
    summed = sum(above[:, 0] / below for above, below in (term.at(1j * OMEGA) for term in terms(form)))
    responses_by = frequency_response(form, OMEGA)[:, 0], summed + form.model.D
    for k, omega in enumerate(OMEGA.tolist()):
        Z = linear.K + 1j * omega * linear.D - omega**2 * linear.M
        exact = -np.linalg.solve(Z[1:, 1:], Z[1:, 0]) / (1j * omega) ** order
        for response in (*(part[:, k] for part in responses_by), _gain(form.model, omega)[:, 0]):
            assert response == pytest.approx(exact, rel=1e-11)
