"""Modal gains against M⁻¹-orthogonal shapes, residues of eigenvectors, ranks, and the two loads of a crane."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from control_scenes import DRIVES, SCENES, crane, mixed, rank

from modal import Bob, Cart, Pendulum, Scene, load, matrices, natural_modes
from modal.statespace import Signal, modal_gains, state_space, unreached, unseen
from modal.statespace.modal_form import RELATIVE_GAIN_MIN, Side


def test_two_loads_are_reached_and_two_equal_ones_are_not() -> None:
    """The rank is 6 of 6, and 4 of 6 for equal lengths; the gain says which mode."""
    for l2, states, missed in ((10.0, 6, ()), (20.0, 4, (1,))):
        scene = crane(20.0, l2)
        model = state_space(scene)
        gains = modal_gains(natural_modes(scene), model)
        assert rank(model) == states == 2 * int(gains.inputs.copies.sum())
        assert unreached(gains) == missed
    assert gains.inputs.gain[1, 0] == 0.0
    assert gains.inputs.words == [["controllable"], ["not controllable"], ["controllable"]]
    assert gains.outputs.words[1] == ["not observable", "observable", "observable"]


def test_nearly_equal_loads_are_barely_reached() -> None:
    """20 m against 19.99 m: full rank, and a gain of 2e-5; the same from SciPy's pencil."""
    scene = crane(20.0, 19.99)
    gains = modal_gains(natural_modes(scene), state_space(scene))
    model = matrices(scene)
    _, phi = scipy.linalg.eigh(model.K, model.M)
    assert gains.inputs.gain[1, 0] == pytest.approx(1.77e-5, rel=2e-3)
    assert gains.inputs.gain[1:, 0] == pytest.approx(np.abs(phi[0, 1:]), rel=1e-9)
    assert gains.inputs.relative[1, 0] < RELATIVE_GAIN_MIN
    assert gains.inputs.words[1] == ["barely (gain 2e-05)"]
    assert gains.inputs.copies.tolist() == [1, 1, 1]
    assert unreached(gains) == (1,)
    assert unreached(gains, 1e-4) == ()


@pytest.mark.parametrize("name", ["crane", "undamped copies", "equal loads"])
def test_undamped_gains_are_the_pencils(name: str) -> None:
    """Over each eigenspace of SciPy's pencil, whatever basis it comes with."""
    scene = SCENES[name]
    model = state_space(scene, ("cart_force", "joint_torques"), ("cart_position", "angles", "rates"))
    gains = modal_gains(natural_modes(scene), model)
    system = matrices(scene)
    x, phi = scipy.linalg.eigh(system.K, system.M)
    size = len(x)
    F = system.M @ model.B[size:]
    for number, omega in enumerate(gains.modes.omega):
        shapes = phi[:, np.abs(x - omega**2) < 1e-8 * x.max()]
        assert shapes.shape[1] == gains.modes.multiplicity[number]
        assert gains.inputs.gain[number] == pytest.approx(np.linalg.norm(shapes.T @ F, axis=0), rel=1e-7, abs=1e-10)
        seen = np.linalg.norm((model.C[:, :size] + 1j * omega * model.C[:, size:]) @ shapes, axis=1)
        if omega:
            assert gains.outputs.gain[number] == pytest.approx(seen, rel=1e-7, abs=1e-10)


def test_the_rigid_mode_takes_the_force_by_the_total_mass() -> None:
    gains = modal_gains(natural_modes(crane()), state_space(crane(), (), ("cart_position", "cart_velocity")))
    assert gains.inputs.gain[0, 0] == pytest.approx(1 / np.sqrt(1200.0), rel=1e-14)
    assert gains.outputs.gain[0] == pytest.approx([1 / np.sqrt(1200.0), 0.0], rel=1e-14)
    rates = modal_gains(natural_modes(crane()), state_space(crane(), (), ("cart_velocity",)))
    assert rates.outputs.gain[0, 0] == pytest.approx(1 / np.sqrt(1200.0), rel=1e-14)


def test_damped_gains_multiply_to_the_residue() -> None:
    """C v wᵀB of NumPy's eigenvectors of A, times λ − λ̄, for modes that swing alone."""
    scene = mixed(joint=0.3, spring=20.0, copies=1)
    model = state_space(scene)
    gains = modal_gains(natural_modes(scene), model)
    values, v = np.linalg.eig(model.A)
    w = np.linalg.inv(v)
    for number, value in enumerate(gains.modes.eigenvalue):
        k = int(np.argmin(np.abs(values - value)))
        residue = np.outer(model.C @ v[:, k], w[k] @ model.B) * 2j * value.imag
        product = np.outer(gains.outputs.gain[number], gains.inputs.gain[number])
        assert np.abs(residue) == pytest.approx(product, rel=1e-9)


def test_light_damping_changes_little() -> None:
    still, light = (modal_gains(natural_modes(s), state_space(s)) for s in (crane(), crane(damping=1e-3)))
    assert light.inputs.gain == pytest.approx(still.inputs.gain, rel=1e-6)
    assert light.outputs.gain == pytest.approx(still.outputs.gain, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", ["crane", "equal loads", "undamped copies"])
def test_copies_reached_are_the_rank(name: str, drive: str) -> None:
    """A prescribed cart has states of its own, one for a velocity, two for an acceleration."""
    scene = SCENES[name]
    model = state_space(scene, (drive,))
    gains = modal_gains(natural_modes(scene), model)
    added = {"cart_force": 0, "cart_acceleration": 2, "cart_velocity": 1}[drive]
    assert rank(model) == added + 2 * int(gains.inputs.copies.sum())


def test_many_equal_pendula_need_as_many_sensors() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=4.0), pendulum=[Pendulum(links=[Bob(mass=1, length=1)], count=5)])
    modes = natural_modes(scene)
    gains = modal_gains(modes, state_space(scene, ("cart_force", "joint_torques"), ("cart_position", "angles")))
    assert modes.multiplicity.tolist() == [1, 4, 1]
    assert gains.inputs.copies.tolist() == gains.outputs.copies.tolist() == [1, 4, 1]
    assert unseen(gains) == ()
    blind = modal_gains(modes, state_space(scene, ("cart_force",), ("cart_position",)))
    assert blind.outputs.copies.tolist() == [1, 0, 1]
    assert unseen(blind) == unreached(blind) == (1,)


def test_inputs_that_do_the_same_reach_one_copy() -> None:
    """Two inputs of one direction in a two-fold mode, whatever rounding adds."""
    part = np.outer([0.1, 0.7], [0.3, 0.9]) + np.diag([0.0, 4e-16]) + 0j
    side = Side((Signal("a", "N", ""), Signal("b", "N", "")), "controllable", (part, np.ones((1, 2)) + 0j))
    assert np.linalg.svd(part, compute_uv=False)[1] > 0
    assert side.copies.tolist() == [1, 1]
    assert side.missed() == (0,)


def test_text_and_records_name_every_mode_and_signal() -> None:
    scene = load("crane-two-loads")
    gains = modal_gains(natural_modes(scene), state_space(scene))
    records = list(gains.records())
    assert len(records) == 3 * (1 + 3)
    assert {record["signal"] for record in records} == {"cart_force", "x", "theta_1_1", "theta_2_1"}
    assert all(record["word"] in {"controllable", "observable", "not observable"} for record in records)
    lines = gains.text().splitlines()
    assert lines[0].split()[-2:] == ["the", "cart"]
    assert lines[2].split()[-2:] == ["1", "1"]
    assert len(lines) == 13
