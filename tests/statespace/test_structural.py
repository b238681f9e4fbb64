"""Linear models of scenes on structures: against positions of all masses, matrices by hand, and laws of mechanics."""

from __future__ import annotations

from functools import cache

import mpmath as mp
import numpy as np
import pytest
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Scene, SceneError
from modal.exports import FORMATS
from modal.exports.data import read_json
from modal.scene import Ground, Pendulum, SineForce, SineMotion, scene_from
from modal.statespace import StateSpace, state_space
from modal.statespace.geometry import geometry_of
from modal.statespace.response import ExactResponse
from modal.statespace.sampling import sample
from modal.statespace.signals import own_signals

OMEGA = np.array([0.3, 1.1, 2.7, 8.0, 30.0])
EVERY = (
    *("coordinates", "coordinate_rates", "coordinate_accelerations", "angles", "rates", "relative_angles"),
    *("joint_positions", "tip_positions", "tip_accelerations", "pivot_forces", "spring_forces", "spring_extensions"),
)
BOB = {"kind": "bob", "mass": 1.0, "length": 0.8, "damping": 0.3}
TOWER = scene_from(
    {
        "gravity": 9.81,
        "support": [
            {"name": "lower", "kind": "cart", "mass": 40.0},
            {"name": "upper", "kind": "cart", "mass": 30.0, "position": [0.0, -3.0]},
        ],
        "spring": [
            {"between": ["ground", "lower"], "stiffness": 6000.0, "damping": 20.0},
            {"between": ["lower@-1.5,-0.5", "upper@1.5,-0.5"], "stiffness": 8000.0, "damping": 10.0},
        ],
        "pendulum": [{"on": "upper", "links": [BOB]}],
    }
)
SHARE = 0.5
"""The square of how far along the rail a brace of the tower leans: 3 m along, 3 m up."""


def wanted(scene: Scene, names: tuple[str, ...] = EVERY) -> tuple[str, ...]:
    """Those of these outputs that the scene has."""
    coordinates, springs = any(support.kind != "fixed" for support in scene.supports), bool(scene.spring)
    return tuple(
        name
        for name in names
        if (coordinates or not name.startswith("coordinate")) and (springs or not name.startswith("spring"))
    )


def solved(model: StateSpace, omega: np.ndarray) -> np.ndarray:
    """C (iω − A)⁻¹ B + D, (p, m, W)."""
    eye = np.eye(len(model.A))
    return np.stack([model.C @ np.linalg.solve(1j * w * eye - model.A, model.B) + model.D for w in omega], axis=-1)


def rows(model: StateSpace) -> dict[str, int]:
    return {signal.name: k for k, signal in enumerate(model.outputs)}


@cache
def matrices_of(name: str) -> tuple[mp.matrix, mp.matrix, mp.matrix]:
    return Oracle(STRUCTURED[name]).matrices()


def floats(matrix: mp.matrix) -> np.ndarray:
    return np.array(matrix.tolist(), dtype=float)


# ------------------------------------------------------------------------------------------- positions of all masses


@pytest.mark.parametrize("name", STRUCTURED)
def test_states_follow_the_matrices_of_all_masses(name: str) -> None:
    scene = STRUCTURED[name].undriven
    model, (M, K, D) = state_space(scene), map(floats, matrices_of(name))
    n = len(M)
    assert model.A[n:] == pytest.approx(-np.linalg.solve(M, np.hstack([K, D])), rel=1e-9, abs=1e-9)
    names = [signal.name for signal in model.states]
    assert names[: n - scene.n_links] == Oracle(scene).names
    if n > scene.n_links:
        forces = state_space(scene, ("coordinate_forces",)).B[n:]
        assert forces == pytest.approx(np.linalg.inv(M)[:, : n - scene.n_links], rel=1e-9, abs=1e-12)


def forced(scene: Scene, on: str, direction: str) -> np.ndarray:
    """q'' that a force of 1 N or a torque of 1 N m there adds at rest."""
    force = SineForce(on=on, direction=direction, amplitude=1.0, frequency_hz=1.0, phase_deg=90.0)
    oracles = [Oracle(scene.replace(force=forces)) for forces in ((force,), ())]
    with_it, without = (oracle.accelerations(oracle.rest, [0.0] * oracle.size) for oracle in oracles)
    return np.array([float(a - b) for a, b in zip(with_it, without, strict=True)])


POINTS = {
    "ship": ("force:ship@1.0,0.5", "lift:ship@1.0,0.5", "torque:ship", "lift:pendulum[0].links[1]@0.2"),
    "board": (
        "force:board@0.4,0.1",
        "lift:board@0.4,0.1",
        "torque:pendulum[0].links[0]",
        "torque:pendulum[1].links[0]",
    ),
    "swings": ("force:left@0.1,0.0", "lift:left", "force:pendulum[1].links[0]"),
    "frame": ("force:frame[0]", "lift:frame[1]", "lift:pendulum[1].links[0]@0.3"),
    "mixed": (
        "lift:lift",
        "force:truck",
        "torque:beam",
        "lift:pendulum[1].links[0]",
        "torque:pendulum[2].links[0]@0.1",
    ),
    "springs": ("force:pendulum[0].copies[1].links[1]", "torque:pendulum[1].links[1]"),
}


@pytest.mark.parametrize(("name", "point"), [(name, point) for name, points in POINTS.items() for point in points])
def test_forces_at_points_act_as_on_all_masses(name: str, point: str) -> None:
    scene = STRUCTURED[name].undriven
    kind, _, on = point.partition(":")
    exact = forced(scene, on, {"force": "horizontal", "lift": "vertical", "torque": "torque"}[kind])
    model = state_space(scene, (point,))
    assert model.B[len(exact) :, 0] == pytest.approx(exact, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", ["swings", "ship", "carts", "mixed", "springs"])
def test_a_ground_that_moves_drives_all_masses(name: str) -> None:
    still = STRUCTURED[name].undriven.conservative
    motion = SineMotion(amplitude=0.5, frequency_hz=1 / np.pi, phase_deg=90.0)  # s'' = −2 m/s², s' = 0 at t = 0
    shaken = Oracle(still.replace(ground=Ground(motion=motion)))
    exact = np.array([float(a) for a in shaken.accelerations(shaken.rest, [0.0] * shaken.size)])
    model = state_space(still, ("support_acceleration",))
    assert -2.0 * model.B[-shaken.size :, 0] == pytest.approx(exact, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", STRUCTURED)
def test_elimination_and_the_model_give_one_response(name: str) -> None:
    scene = STRUCTURED[name].undriven
    drives = [("joint_torques", "link_forces", "force:pendulum[0].links[0]")]
    if name != "frame":  # a modal support does not say how the ground drives it
        drives += [("support_acceleration",)]
    for inputs in drives:
        model = state_space(scene, inputs, wanted(scene))
        exact = solved(model, OMEGA)
        computed = ExactResponse(scene, model.inputs, model.outputs).response_at(OMEGA)
        assert computed == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("name", ["swings", "ship", "board", "carts", "mixed", "springs", "frame"])
def test_no_digit_is_lost_far_from_the_modes(name: str) -> None:
    """Every entry against positions of all masses in 50 digits, from 1e-3 to 1e3 times the frequencies of scenes."""
    scene = STRUCTURED[name].undriven
    model = state_space(
        scene, wanted(scene, ("coordinate_forces", "joint_torques")), wanted(scene, ("coordinates", "angles"))
    )
    omega = np.array([2e-3, 0.4, 40.0, 4e3])
    computed = ExactResponse(scene, model.inputs, model.outputs).response_at(omega)
    first = Oracle(scene).size - scene.n_links
    torques = state_space(scene, ("joint_torques",), ("relative_angles",))
    turns = torques.C[:, : Oracle(scene).size]
    with mp.workdps(60):
        M, K, D = matrices_of(name)
        F = mp.zeros(len(M), len(model.inputs))
        for k in range(first):
            F[k, k] = 1
        for i, j in zip(*np.nonzero(turns), strict=True):
            F[int(j), first + int(i)] = mp.mpf(turns[i, j])
        for k, w in enumerate(map(mp.mpf, omega.tolist())):
            S = K + 1j * w * D - w * w * M
            exact = np.array((S**-1 * F).tolist(), dtype=complex)
            assert computed[..., k] == pytest.approx(exact, rel=1e-11, abs=1e-40)


@pytest.mark.parametrize("name", ["swings", "carts"])
def test_three_motions_of_the_ground_are_one(name: str) -> None:
    scene = STRUCTURED[name].undriven
    outputs = wanted(scene, ("coordinates", "angles", "tip_positions", "spring_extensions"))
    each = []
    for order, drive in enumerate(("support_displacement", "support_velocity", "support_acceleration")):
        model = state_space(scene, (drive,), outputs)
        each += [solved(model, OMEGA) * (1j * OMEGA) ** order]
        each += [ExactResponse(scene, model.inputs, model.outputs).response_at(OMEGA) * (1j * OMEGA) ** order]
    for other in each[1:]:
        assert other == pytest.approx(each[0], abs=1e-10 * np.abs(each[0]).max())


# ------------------------------------------------------------------------------------------------- matrices by hand


def by_hand(omega: float) -> np.ndarray:
    """K + iωD − ω²M of the tower over (lower, upper, θ), from its numbers."""
    m, l = 1.0, 0.8
    M = np.array([[40.0, 0, 0], [0, 30.0 + m, m * l], [0, m * l, m * l * l]])
    K, D = (
        np.array([[a + SHARE * b, -SHARE * b, 0], [-SHARE * b, SHARE * b, 0], [0, 0, last]])
        for a, b, last in ((6000.0, 8000.0, m * 9.81 * l), (20.0, 10.0, 0.3))
    )
    return K + 1j * omega * D - omega**2 * M


def test_a_tower_with_its_damper_by_hand() -> None:
    forces = state_space(TOWER, ("coordinate_forces", "joint_torques"))
    assert [signal.name for signal in forces.inputs] == ["lower_force", "upper_force", "torque_1_1"]
    assert [signal.name for signal in forces.outputs] == ["lower_m", "upper_m", "theta_1_1"]
    exact = np.stack([np.linalg.inv(by_hand(w)) for w in OMEGA], axis=-1)
    assert solved(forces, OMEGA) == pytest.approx(exact, rel=1e-10, abs=1e-15)
    assert ExactResponse(TOWER, forces.inputs, forces.outputs).response_at(OMEGA) == pytest.approx(exact, rel=1e-12)


def test_a_tower_on_a_ground_that_moves_by_hand() -> None:
    """In the laboratory only the spring and damper to the ground pull."""
    model = state_space(TOWER, ("support_displacement",), ("coordinates", "angles", "tip_positions"))
    pull = [np.array([6000.0 + 20j * w, 0, 0]) for w in OMEGA]
    X = np.stack([np.linalg.solve(by_hand(w), force) for w, force in zip(OMEGA, pull, strict=True)], axis=-1)
    exact = np.stack([X[0] - 1, X[1] - 1, X[2], X[1] + 0.8 * X[2]])
    assert solved(model, OMEGA)[:, 0] == pytest.approx(exact, rel=1e-10)
    felt = state_space(TOWER, ("support_acceleration",), ("coordinate_accelerations", "lower_m"))
    assert [signal.name for signal in felt.outputs] == ["lower_ddot_m_per_s2", "upper_ddot_m_per_s2", "lower_m"]
    exact = np.stack([X[0], X[1], (X[0] - 1) / -(OMEGA**2)])
    assert solved(felt, OMEGA)[:, 0] == pytest.approx(exact, rel=1e-9)


def test_a_vibration_absorber_has_the_formula_of_den_hartog() -> None:
    """x₁/x_st of the main mass, Mechanical Vibrations, 4th ed., eq. 3.24: μ mass ratio, f = ω_a/Ω_n, g = ω/Ω_n, ζ."""
    M, K, mu, f, zeta = 10.0, 1000.0, 0.05, 1 / 1.05, 0.127
    m, n = mu * M, np.sqrt(K / M)
    scene = scene_from(
        {
            "gravity": 9.81,
            "support": [
                {"name": "wall", "kind": "fixed"},
                {"name": "main", "kind": "cart", "mass": M, "stiffness": K},
                {"name": "absorber", "kind": "cart", "mass": m, "position": [1.0, 0.0]},
            ],
            "spring": [{"between": ["main", "absorber"], "stiffness": m * (f * n) ** 2, "damping": 2 * m * n * zeta}],
            "pendulum": [{"on": "wall", "links": [BOB]}],
        }
    )
    g = np.linspace(0.5, 1.5, 7)
    above = (2 * zeta * g) ** 2 + (g * g - f * f) ** 2
    below = (2 * zeta * g) ** 2 * (g * g - 1 + mu * g * g) ** 2 + (
        mu * f * f * g * g - (g * g - 1) * (g * g - f * f)
    ) ** 2
    model = state_space(scene, ("main_force",), ("main_m", "spring_force_1"))
    computed = ExactResponse(scene, model.inputs, model.outputs).response_at(g * n)
    assert np.abs(computed[0, 0]) * K == pytest.approx(np.sqrt(above / below), rel=1e-11)
    assert solved(model, g * n) == pytest.approx(computed, rel=1e-9)


# ------------------------------------------------------------------------------------------------ laws of mechanics


def test_every_floor_obeys_newton() -> None:
    """m a of a floor is what its springs, its pendulum and the force on it give."""
    for drive in ("upper_force", "support_acceleration", "torque_1_1"):
        group = "joint_torques" if drive.startswith("torque") else drive
        model = state_space(TOWER, (group,), EVERY)
        G, at = solved(model, OMEGA)[:, 0], rows(model)
        along = np.sqrt(SHARE)
        pushed = 1.0 if drive == "upper_force" else 0.0
        lower = -G[at["spring_force_1"]] + along * G[at["spring_force_2"]]
        upper = -along * G[at["spring_force_2"]] + G[at["pivot_force_1"]] + pushed
        assert 40.0 * G[at["lower_ddot_m_per_s2"]] == pytest.approx(lower, rel=1e-9)
        assert 30.0 * G[at["upper_ddot_m_per_s2"]] == pytest.approx(upper, rel=1e-9)


def test_springs_between_links_pull_at_pivots() -> None:
    """The pivot of a bob carries what its weight's return m g θ and its own tension do not: the sum of all is m a."""
    pair = scene_from(
        {
            "gravity": 9.81,
            "pendulum": [{"position": [0.4 * k, 0.0], "links": [BOB | {"damping": 0.0}]} for k in (0, 1)],
            "spring": [{"between": ["pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"], "stiffness": 5.0}],
        }
    )
    outputs = ("pivot_forces", "tip_accelerations", "spring_forces", "spring_extensions", "angles")
    model = state_space(pair, ("force:pendulum[0].links[0]@0.8",), outputs)
    G, at = solved(model, OMEGA)[:, 0], rows(model)
    pull = G[at["spring_force_1"]]
    assert pull == pytest.approx(5.0 * 0.5 * (G[at["theta_2_1"]] - G[at["theta_1_1"]]), rel=1e-10)
    assert G[at["tip_ddot_1"]] == pytest.approx(1.0 + pull - G[at["pivot_force_1"]], rel=1e-10)
    assert G[at["tip_ddot_2"]] == pytest.approx(-pull - G[at["pivot_force_2"]], rel=1e-10)


@pytest.mark.parametrize("name", ["ship", "carts", "mixed"])
def test_forces_and_motions_at_two_points_are_reciprocal(name: str) -> None:
    scene = STRUCTURED[name].undriven
    last = len(scene.pendulum[0].links) - 1
    tip = f"force:pendulum[0].copies[0].links[{last}]@{scene.pendulum[0].links[last].length}"
    model = state_space(scene, ("coordinate_forces", tip), ("coordinates", "tip_positions"))
    G, at = solved(model, OMEGA), rows(model)
    size = sum(signal.name in Oracle(scene).names for signal in model.outputs)
    assert G[:size, :size] == pytest.approx(G[:size, :size].swapaxes(0, 1), rel=1e-8, abs=1e-12)
    assert G[at["tip_1"], :size] == pytest.approx(G[:size, size], rel=1e-8, abs=1e-12)


def test_at_rest_a_constant_force_stretches_the_springs() -> None:
    model = state_space(
        TOWER, ("upper_force",), ("coordinates", "angles", "spring_forces", "pivot_forces", "lower_dot_m_per_s")
    )
    computed = ExactResponse(TOWER, model.inputs, model.outputs).response_at(np.array([0.0]))[:, 0, 0]
    exact = [1 / 6000.0, 1 / 6000.0 + 1 / (SHARE * 8000.0), 0.0, 1.0, 1 / np.sqrt(SHARE), 0.0, 0.0]
    assert computed == pytest.approx(exact, rel=1e-12, abs=1e-15)


def test_a_free_structure_does_not_feel_the_ground() -> None:
    """Carts without springs to the ground stay where they are."""
    free = TOWER.replace(spring=TOWER.spring[1:])
    model = state_space(free, ("support_displacement",), ("angles", "spring_extensions", "tip_positions"))
    assert np.abs(solved(model, OMEGA)).max() < 1e-13
    computed = ExactResponse(free, model.inputs, model.outputs).response_at(OMEGA)
    assert np.abs(computed).max() < 1e-12


def test_one_cart_under_springs_keeps_its_names() -> None:
    links = [BOB | {"damping": 0.0}]
    scene = scene_from(
        {
            "gravity": 9.81,
            "support": {"kind": "cart", "mass": 3.0},
            "pendulum": [{"links": links}, {"links": links}],
            "spring": [{"between": ["pendulum[0].links[0]", "pendulum[1].links[0]"], "stiffness": 5.0}],
        }
    )
    model = state_space(scene)
    assert [signal.name for signal in model.states[:1] + model.inputs] == ["x", "cart_force"]
    held = state_space(scene, ("cart_acceleration",), ("cart_position", "angles", "spring_forces"))
    exact = solved(held, OMEGA)
    assert exact[0, 0] == pytest.approx(-1 / OMEGA**2)
    assert exact[1, 0] == pytest.approx(-1 / (9.81 - 0.8 * OMEGA**2))  # both alike: the spring stays as it is
    assert ExactResponse(scene, held.inputs, held.outputs).response_at(OMEGA) == pytest.approx(exact, abs=1e-11)
    free = scene.replace(spring=())
    response, other = (
        solved(state_space(example, ("support_displacement",), ("cart_position",)), OMEGA) for example in (scene, free)
    )
    assert response == pytest.approx(other, abs=1e-13)


# --------------------------------------------------------------------------------------------------------- messages


def test_what_a_structure_has_not_is_told() -> None:
    with pytest.raises(SceneError, match="there is no cart alone: name one of lower_force, upper_force"):
        state_space(TOWER, ("cart_force",))
    with pytest.raises(SceneError, match=r"did you mean lower_force\?"):
        state_space(TOWER, ("lowr_force",))
    with pytest.raises(SceneError, match="the scene has no springs between points"):
        state_space(TOWER.replace(spring=()), outputs=("spring_forces",))
    plain = Scene(gravity=9.81, pendulum=[Pendulum(links=TOWER.pendulum[0].links)])
    with pytest.raises(SceneError, match="the scene has no structure"):
        state_space(plain, outputs=("coordinates",))
    with pytest.raises(SceneError, match="does not say how the ground's motion drives"):
        state_space(STRUCTURED["frame"], ("support_acceleration",))
    with pytest.raises(SceneError, match="the ground cannot be moved"):
        state_space(TOWER, ("force:ground@1,1",))
    with pytest.raises(SceneError, match='there is no support "roof"'):
        state_space(TOWER, ("force:roof",))


def test_every_format_has_the_names_of_a_structure() -> None:
    model = state_space(TOWER, ("coordinate_forces", "force:upper@0.5,-1.0"), EVERY)
    for name, form in FORMATS.items():
        if name in {"fmu", "tf"}:
            continue
        written = form.write(sample(model, 0.01) if name == "c" else model)
        if name not in {"npz", "mat"}:
            assert b"lower_force" in written.replace(b"LOWER_FORCE", b"lower_force")
            assert b"upper_dot_m_per_s" in written.replace(b"UPPER_DOT_M_PER_S", b"upper_dot_m_per_s")
    back = read_json(FORMATS["json"].write(model))
    assert np.array_equal(back.A, model.A)
    assert back.outputs == model.outputs


def test_the_states_of_coordinates_bear_names_of_their_own() -> None:
    states = {signal.name for signal in state_space(TOWER, ("support_displacement",)).states}
    assert states & own_signals(geometry_of(TOWER)) == {
        *("lower_m_free", "upper_m_free", "lower_dot_free_m_per_s", "upper_dot_free_m_per_s"),
    }
