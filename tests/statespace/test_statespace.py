"""State-space models against transfer functions, exact kinematics and Newton's law for the cart."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scenes import decimal_scene

from modal import Bob, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, SceneError, load, matrices, natural_modes
from modal.statespace import StateSpace, state_space
from modal.statespace.geometry import geometry_of
from modal.statespace.signals import INPUTS, OUTPUTS

SHIPPED = ["crane-hook", "crane-two-loads", "paper-cart-2", "metronomes", "cart-upright", "chain-3", "chain-spatial"]


def transfer(model: StateSpace, s: complex) -> np.ndarray:
    return model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D


def on_a_cart(seed: int) -> Scene:
    scene = decimal_scene(seed)
    cart = Cart(mass=1.5 + seed % 3, damping=0.3 * (seed % 2), stiffness=2.0 * (seed % 3 == 0))
    return scene.model_copy(update={"support": cart})


@pytest.mark.parametrize("name", SHIPPED)
def test_poles_are_the_table_s(name: str) -> None:
    modes, model = natural_modes(load(name)), state_space(load(name))
    omega = np.sort(np.abs(np.linalg.eigvals(model.A)))
    expected = np.sort(np.abs(modes.eigenvalue).repeat(modes.multiplicity))
    along = [value for value in expected if value > 0]
    for value in along:
        assert np.min(np.abs(omega - value)) <= 1e-12 * max(value, 1.0)


@pytest.mark.parametrize("seed", range(30))
def test_transfer_functions_of_forces_and_torques(seed: int) -> None:
    """Y0 (s²M + sD + K)⁻¹ F, its s- and s²-fold, from matrices and rows alone."""
    scene = on_a_cart(seed) if seed % 3 else decimal_scene(seed).model_copy(update={"support": Fixed()})
    system, geometry, s = matrices(scene), geometry_of(scene), 0.7 + 2.3j
    inputs = (*(["cart_force"] if geometry.on_cart else []), "joint_torques", "link_forces")
    outputs = tuple(name for name in OUTPUTS if geometry.on_cart or not name.startswith("cart"))
    model = state_space(scene, inputs, outputs)
    unit = np.eye(geometry.size)
    F = np.hstack([*([unit[:, :1]] if geometry.on_cart else []), geometry.relative.T, geometry.centres.T])
    q = np.linalg.solve(s**2 * system.M + s * system.D + system.K, F)
    members = geometry.pendulum == np.unique(geometry.pendulum)[:, None]
    pushes = np.hstack([np.zeros((len(members), F.shape[1] - len(geometry.mass))), members.astype(float)])
    rows = {
        "cart_position": unit[:1] @ q,
        "cart_velocity": s * unit[:1] @ q,
        "angles": geometry.angles @ q,
        "rates": s * geometry.angles @ q,
        "relative_angles": geometry.relative @ q,
        "relative_rates": s * geometry.relative @ q,
        "joint_positions": geometry.joints @ q,
        "tip_positions": geometry.joints[geometry.tips] @ q,
        "tip_accelerations": s**2 * geometry.joints[geometry.tips] @ q,
        "pivot_forces": pushes - s**2 * (members * geometry.mass) @ geometry.centres @ q,
    }
    np.testing.assert_allclose(transfer(model, s), np.vstack([rows[name] for name in outputs]), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(("drive", "power"), [("cart_acceleration", 2), ("cart_velocity", 1)])
def test_a_prescribed_motion_is_the_ratio_of_two_responses_to_a_force(seed: int, drive: str, power: int) -> None:
    """θ(s)/(s^k X(s)) is the same whatever force moves the cart; torques act on the rest with the cart held."""
    scene, s = on_a_cart(seed), -0.4 + 1.9j
    outputs = ("cart_position", "angles", "rates", "tip_positions")
    forced = transfer(state_space(scene, ("cart_force",), outputs), s)
    driven = state_space(scene, (drive, "joint_torques"), outputs)
    np.testing.assert_allclose(transfer(driven, s)[:, :1], forced / (s**power * forced[0]), rtol=1e-8, atol=1e-10)
    held = state_space(scene.model_copy(update={"support": Fixed()}), ("joint_torques",), outputs[1:])
    np.testing.assert_allclose(transfer(driven, s)[1:, 1:], transfer(held, s), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_pivot_forces_move_the_cart(seed: int) -> None:
    """m_c x'' + c x' + k x = force on the cart + Σ forces on the pivots, where joints pass on no torque to the cart."""
    scene, s = on_a_cart(seed), 0.2 + 1.1j
    outputs = ("cart_position", "pivot_forces")
    G = transfer(state_space(scene, ("cart_force", "link_forces"), outputs), s)
    cart = scene.support
    felt = (cart.mass * s**2 + cart.damping * s + cart.stiffness) * G[0]
    direct = np.zeros(G.shape[1])
    direct[0] = 1.0
    np.testing.assert_allclose(felt, direct + G[1:].sum(0), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("seed", range(12))
def test_rows_are_the_derivatives_of_exact_positions(seed: int) -> None:
    scene = decimal_scene(seed)
    geometry = geometry_of(scene)
    rng, h = np.random.default_rng(seed), 1e-6
    q = rng.normal(size=geometry.size)
    for rows, part in ((geometry.joints, "length"), (geometry.centres, "centre")):
        ahead, behind = (positions(scene, geometry.on_cart, sign * h * q, part) for sign in (1, -1))
        np.testing.assert_allclose(rows @ q, (ahead - behind) / (2 * h), rtol=1e-7, atol=1e-8)


def positions(scene: Scene, on_cart: bool, q: np.ndarray, part: str) -> np.ndarray:
    """Horizontal positions of lower joints or centres, with sines of whole angles."""
    points, at = [], int(on_cart)
    for pendulum in scene.pendulum:
        for _ in range(pendulum.count):
            x = q[0] if on_cart else 0.0
            links = (link for link in pendulum.links for _ in range(link.count))
            for link, way in zip(links, pendulum.ways, strict=True):
                lean = np.sin(q[at] + (0.0 if way == "down" else np.pi))
                points.append(x + getattr(link, part) * lean)
                x, at = x + link.length * lean, at + 1
    return np.array(points)


@pytest.mark.parametrize("name", SHIPPED)
def test_names_are_unique_identifiers(name: str) -> None:
    scene = load(name)
    on_cart = isinstance(scene.support, Cart)
    inputs = ("cart_force", "joint_torques", "link_forces") if on_cart else ("joint_torques", "link_forces")
    model = state_space(scene, inputs, tuple(o for o in OUTPUTS if on_cart or not o.startswith("cart")))
    for signals in (model.states, model.inputs, model.outputs):
        names = [signal.name for signal in signals]
        assert len(set(names)) == len(names)
        assert all(n.isidentifier() and n.isascii() for n in names)
        assert all(signal.unit and signal.meaning for signal in signals)
    assert model.A.shape == (len(model.states),) * 2
    assert model.D.shape == (len(model.outputs), len(model.inputs))


def test_the_operating_point_says_which_links_stand() -> None:
    assert dict(state_space(load("cart-upright")).operating_point) == {
        "theta_1_1": np.pi,
        "theta_1_2": np.pi,
        "theta_2_1": 0.0,
    }


def test_an_upright_rod_on_an_accelerated_cart() -> None:
    """θ'' = (3/2l)(g θ + a) for deviations from upright: θ turns the top against the rail's direction."""
    rod = Pendulum(links=(Rod(mass=0.4, length=0.8),), equilibrium=("up",))
    model = state_space(Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[rod]), ("cart_acceleration",))
    assert model.A[3, 1] == pytest.approx(1.5 * 9.81 / 0.8)
    assert model.B[:, 0] == pytest.approx([0, 0, 1, 1.5 / 0.8])


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"),
    [
        (("wind",), (), "input wind: must be one of"),
        (("cart_force",), ("colour",), "output colour: must be one of"),
        (("cart_force", "cart_velocity"), (), "only one of"),
        (("cart_velocity",), ("pivot_forces",), "has impulses there"),
        (("joint_torques", "joint_torques"), (), "named twice"),
    ],
)
def test_refusals(inputs: tuple[str, ...], outputs: tuple[str, ...], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        state_space(load("crane-hook"), inputs, outputs)


def test_what_needs_a_cart_or_an_inertia() -> None:
    for name in ("cart_force", "cart_velocity", "cart_acceleration"):
        with pytest.raises(SceneError, match="the support is fixed"):
            state_space(load("chain-2"), (name,))
    massless = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0),))])
    with pytest.raises(ComputationError, match="mass matrix is singular"):
        state_space(massless)
    assert state_space(massless, ("cart_acceleration",)).A[3, 1] == pytest.approx(-9.81)
    with pytest.raises(ComputationError, match="at most 4000"):
        state_space(load("paper-cart-2").model_copy(update={"pendulum": load("rope").pendulum * 3}))
    moved = {f"{what}_{kind}" for what, kind in product(("cart", "support"), ("acceleration", "velocity"))}
    assert set(INPUTS) == {"cart_force", "joint_torques", "link_forces", "support_displacement"} | moved
