"""Verbs that go through the modes of scenes on structures: each against matrices, covariances or closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy
from structured_scenes import STRUCTURED
from test_structural import OMEGA, TOWER, solved, wanted

from modal import Scene, SceneError, load, natural_modes
from modal.assembly import matrices
from modal.errors import ComputationError
from modal.identification import compare_modes, estimate_of, fit_modes
from modal.identification.estimate import response_slopes
from modal.identification.measured import read_modes
from modal.loci import follow_loci
from modal.modes import sensitivities
from modal.modes.sensitivity import of_mode
from modal.scene import RecordMotion, scene_from
from modal.scene.parameters import find_places, number_at, parse_variations, unit_at, vary
from modal.scene.records import Spectrum
from modal.statespace import (
    drives_of,
    frequency_response,
    impulse_response,
    minimal,
    modal_gains,
    residual_vibration,
    shaper_for,
    state_space,
    swings_of,
    to_modal_form,
    truncate,
    usual_drive,
)
from modal.statespace.response import terms
from modal.statespace.transfer import transfer_functions
from modal.vibration import random_response, shock_response

STIFF = TOWER.replace(damping_ratio=0.02).replace(
    spring=tuple(spring.replace(damping=0.0) for spring in TOWER.spring),
    pendulum=[
        pendulum.replace(links=[link.replace(damping=0.0) for link in pendulum.links]) for pendulum in TOWER.pendulum
    ],
)
FREE = TOWER.replace(spring=TOWER.spring[1:])
SCENES = {name: scene.undriven for name, scene in STRUCTURED.items()} | {"ratio": STIFF, "free": FREE}


# --------------------------------------------------------------------------------------------- responses and gains


@pytest.mark.parametrize("undamped", [False, True])
@pytest.mark.parametrize("name", SCENES)
def test_modes_add_up_to_the_response(name: str, undamped: bool) -> None:
    scene = SCENES[name].conservative if undamped else SCENES[name]
    for inputs in (("joint_torques", "force:pendulum[0].links[0]@0.1"), ("support_acceleration",)):
        if inputs[0] == "support_acceleration" and name == "frame":
            continue
        modes = natural_modes(scene)
        model = state_space(scene, inputs, wanted(scene, ("coordinates", "angles", "tip_positions")))
        form = to_modal_form(modes, model)
        assert form.residual() < 1e-12
        exact = solved(model, OMEGA)
        parts = (term.at(1j * OMEGA) for term in terms(form))
        summed = sum(above / below for above, below in parts) + model.D[..., None]
        for computed in (frequency_response(form, OMEGA), summed):
            assert computed == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
        later = impulse_response(form, [0.4])[..., 0]
        assert later == pytest.approx(
            model.C @ scipy.linalg.expm(0.4 * model.A) @ model.B, abs=1e-9 * np.abs(later).max()
        )


def test_gains_are_the_shapes_of_the_tower() -> None:
    scene = TOWER.conservative
    modes = natural_modes(scene)
    gains = modal_gains(modes, state_space(scene))
    model = matrices(scene)
    square, shapes = scipy.linalg.eigh(model.K, model.M)
    assert modes.omega == pytest.approx(np.sqrt(square), rel=1e-11)
    assert gains.inputs.gain == pytest.approx(np.abs(shapes[:2].T), rel=1e-8)
    assert gains.outputs.gain == pytest.approx(np.abs(shapes.T), rel=1e-8)


def test_zeros_of_a_force_on_its_own_floor_are_the_modes_with_that_floor_held() -> None:
    scene = TOWER.conservative
    form = to_modal_form(natural_modes(scene), state_space(scene, ("upper_force",), ("upper_m",)))
    function = transfer_functions(form)[0][0]
    full = matrices(scene)
    keep = np.ix_([0, 2], [0, 2])
    held = np.sqrt(scipy.linalg.eigh(full.K[keep], full.M[keep], eigvals_only=True))
    assert np.unique(np.abs(function.zeros.imag).round(9)) == pytest.approx(held, rel=1e-8)


def test_reduced_models_have_the_same_response() -> None:
    swings = load("two-swings").undriven
    outputs = ("coordinates", "spring_forces")
    whole, small = (make(swings, ("left_force",), outputs) for make in (state_space, minimal))
    assert (len(whole.A), len(small.A)) == (64, 8)
    assert solved(small, OMEGA) == pytest.approx(solved(whole, OMEGA), rel=1e-9)
    names = [signal.name for signal in minimal(swings, ("left_force",), ("angles", "pivot_forces")).outputs]
    assert names == ["theta_1_1", "theta_16_1", "pivot_force_1", "pivot_force_16"]
    tower = state_space(TOWER, ("upper_force",))
    few = truncate(natural_modes(TOWER), tower, 2)
    still = np.array([0.0])
    assert solved(few, still) == pytest.approx(solved(tower, still), rel=1e-9)
    joined = STRUCTURED["springs"].undriven
    assert len(minimal(joined, ("joint_torques",)).A) == 2 * joined.n_links


def test_damping_ratios_are_those_of_the_modes() -> None:
    for scene in (STIFF, STIFF.replace(damping_ratio=(0.01, 0.0, 0.05))):
        ratios = np.broadcast_to(scene.damping_ratio, 3)
        assert natural_modes(scene).damping_ratio == pytest.approx(ratios, abs=1e-12)
        A = state_space(scene).A
        values = np.linalg.eigvals(A)
        values = values[values.imag > 0][np.argsort(np.abs(values[values.imag > 0]))]
        assert -values.real / np.abs(values) == pytest.approx(ratios, abs=1e-12)


# --------------------------------------------------------------------------------------------------------- shapers


def test_a_shaped_force_leaves_nothing_in_the_modes_of_a_tower() -> None:
    assert drives_of(TOWER) == ("lower_force", "upper_force")
    assert usual_drive(TOWER) == "lower_force"
    shaper = shaper_for(TOWER, 3, "zv", "upper_force")
    for swing in swings_of(TOWER, "upper_force"):
        assert residual_vibration(shaper, *swing) < 1e-12
    with pytest.raises(SceneError, match="must be one of lower_force, upper_force"):
        shaper_for(TOWER)
    with pytest.raises(SceneError, match="needs kind"):
        shaper_for(STRUCTURED["springs"].undriven)


def test_a_force_shapes_only_what_it_moves() -> None:
    """On a beam that tilts about its middle a torque does not excite the mode that holds the beam still."""
    beam = load("beam").undriven
    omega = [swing.omega for swing in swings_of(beam, "tilt_torque")]
    assert omega == pytest.approx(natural_modes(beam).omega[[0, 2]].tolist(), rel=1e-12)


def test_a_held_cart_under_springs_has_its_fixed_base_modes() -> None:
    scene = scene_from(
        {
            "gravity": 9.81,
            "support": {"kind": "cart", "mass": 3.0},
            "pendulum": [
                {"position": [0.4 * k, 0.0], "links": [{"kind": "bob", "mass": 1.0, "length": length}]}
                for k, length in enumerate((1.0, 0.7))
            ],
            "spring": [
                {"between": ["pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"], "stiffness": 5.0},
                {"between": ["cart@1.0,0.5", "pendulum[1].links[0]@0.5"], "stiffness": 2.0},
            ],
        }
    )
    full = matrices(scene)
    held = np.sqrt(scipy.linalg.eigh(full.K[1:, 1:], full.M[1:, 1:], eigvals_only=True))
    for drive in ("cart_acceleration", "cart_velocity"):
        assert [swing.omega for swing in swings_of(scene, drive)] == pytest.approx(held.tolist(), rel=1e-12)
        model = state_space(scene, (drive,), ("angles", "spring_forces"))
        form = to_modal_form(natural_modes(scene), model)
        assert form.residual() < 1e-12
        assert frequency_response(form, OMEGA) == pytest.approx(solved(model, OMEGA), abs=1e-10)
    free = [swing.omega for swing in swings_of(scene, "cart_force")]
    assert free == pytest.approx(natural_modes(scene).omega[1:].tolist())


# ------------------------------------------------------------------------------------------------------- vibration


@pytest.mark.parametrize("source", ["support_acceleration", "upper_force", "force:pendulum[0].links[0]@0.4"])
def test_white_noise_has_the_covariance_of_lyapunov(source: str) -> None:
    """A P + P Aᵀ + B S/2 Bᵀ = 0 for a one-sided S, against the integral over a band far wider than the modes."""
    outputs = ("coordinates", "angles")
    response = random_response(TOWER, Spectrum((0.0, 3e4), (0.7, 0.7), "acceleration"), outputs, source)
    model = state_space(TOWER, (source,), outputs)
    if source == "support_acceleration":  # without the ground's own drift, which these outputs do not see
        keep = [k for k, signal in enumerate(model.states) if not signal.name.startswith("support")]
        A, B, C = model.A[np.ix_(keep, keep)], model.B[keep], model.C[:, keep]
    else:
        A, B, C = model.A, model.B, model.C
    P = scipy.linalg.solve_continuous_lyapunov(A, -0.35 * B @ B.T)
    assert response.rms == pytest.approx(np.sqrt(np.diag(C @ P @ C.T)), rel=1e-6)


def test_a_shock_is_what_its_equations_integrate() -> None:
    times = np.linspace(0.0, 2.0, 101)
    push = np.sin(3 * times) * np.exp(-times) * times
    motion = RecordMotion(time_s=times.tolist(), acceleration_m_per_s2=push.tolist())
    outputs = ("coordinates", "spring_forces", "coordinate_accelerations")
    response = shock_response(TOWER, motion, outputs)
    model = state_space(TOWER, ("support_acceleration",), outputs)
    fine = np.linspace(0.0, 2.0, 4001)
    pushed = np.interp(fine, response.times, response.grid.derivatives[0])
    _, y, _ = scipy.signal.lsim((model.A, model.B, model.C, model.D), pushed, fine)
    at = response.times < 1.99
    for k, values in enumerate(y.T):
        exact = np.interp(response.times[at], fine, values)
        assert response.history[k, at] == pytest.approx(exact, abs=2e-4 * np.abs(exact).max())
    assert response.mass_shares.sum() == pytest.approx(1.0)


def test_a_growing_board_has_no_random_vibration() -> None:
    wrong = scene_from(
        {
            "gravity": 9.81,
            "support": {"name": "board", "kind": "tilt", "mass": 1.0, "inertia": 0.1, "stiffness": 1.0},
            "pendulum": [{"position": [0.0, -2.0], "links": [{"kind": "bob", "mass": 5.0, "length": 0.5}]}],
        }
    )
    with pytest.raises(ComputationError, match="grows without being driven"):
        random_response(wrong, Spectrum((0.1, 1.0), (1.0, 1.0), "acceleration"), ("angles",))
    with pytest.raises(SceneError, match="must be support_acceleration, board_torque, or force:POINT"):
        random_response(wrong, Spectrum((0.1, 1.0), (1.0, 1.0), "acceleration"), ("angles",), "rod_force")


# --------------------------------------------------------------------------------- sensitivities, loci, measurements


@pytest.mark.parametrize("name", ["tower", "swings", "ship", "board", "mixed", "springs"])
def test_sensitivities_are_differences_of_frequencies(name: str) -> None:
    scene = TOWER if name == "tower" else STRUCTURED[name].undriven
    modes = natural_modes(scene)
    row = modes[1]
    by_place = of_mode(modes, row)
    assert "gravity" in by_place
    for place, sensitivity in by_place.items():
        step = 1e-4 * abs(sensitivity.number)
        try:
            ends = [natural_modes(vary(scene, {place: sensitivity.number + sign * step})).omega[1] for sign in (1, -1)]
        except SceneError:
            continue
        slope = (ends[0] - ends[1]) / (2 * step)
        assert sensitivity.derivative == pytest.approx(slope, rel=1e-4, abs=1e-7 * row.omega / abs(sensitivity.number))


DIMENSIONS = {
    **dict.fromkeys(("kg", "N/m", "N s/m"), (1, 0)),
    **dict.fromkeys(("kg m²", "N m/rad", "N m s/rad"), (1, 2)),
    **dict.fromkeys(("m", "m/s²"), (0, 1)),
}
"""Powers of mass and length in a unit."""


@pytest.mark.parametrize("name", ["tower", "beam", "ship-crane"])
def test_sensitivities_obey_the_units(name: str) -> None:
    """All that has a mass in its unit times a, or all that has a length times b and gravity with it: ω stays."""
    scene = load(name).undriven.replace(force=())
    modes = natural_modes(scene)
    for row in modes:
        each = of_mode(modes, row)
        assert any(place.startswith("support") for place in each)
        powers = {place: DIMENSIONS[unit_at(scene, find_places(scene, place)[0])] for place in each}
        for which in (0, 1):
            total = sum(powers[place][which] * (sensitivity.relative or 0.0) for place, sensitivity in each.items())
            assert total == pytest.approx(0.0, abs=1e-10)
    with pytest.raises(SceneError, match="by places of the scene"):
        sensitivities(modes, 0)


@pytest.mark.parametrize(
    ("scene", "places", "drive", "read"),
    [
        (TOWER, ("spring[1].stiffness", "support[1].mass", "support[1].position[1]"), "upper_force", "spring_forces"),
        (
            STRUCTURED["ship"].undriven,
            ("pendulum[0].position[1]", "support.stiffness.roll", "pendulum[0].links[0].length"),
            "force:ship@1.0,0.5",
            "ship_roll_rad",
        ),
    ],
    ids=["tower", "ship"],
)
def test_responses_have_the_derivatives_of_their_differences(
    scene: Scene, places: tuple[str, ...], drive: str, read: str
) -> None:
    values = [number_at(scene, find_places(scene, path)[0]) for path in places]
    numbers = [{"place": p, "value": v, "std": 1e-3 * abs(v)} for p, v in zip(places, values, strict=True)]
    covariance = np.diag([number["std"] ** 2 for number in numbers]).tolist()
    estimate = estimate_of(scene, {"parameters": numbers, "covariance": covariance})
    G, slopes = response_slopes(state_space(scene, (drive,), (read,)), estimate, OMEGA)
    assert pytest.approx(solved(state_space(scene, (drive,), (read,)), OMEGA), rel=1e-9) == G
    for k, (path, value) in enumerate(zip(places, values, strict=True)):
        step = 1e-4 * value
        ends = [
            solved(state_space(vary(scene, {path: value + sign * step}), (drive,), (read,)), OMEGA) for sign in (1, -1)
        ]
        exact = (ends[0] - ends[1]) / (2 * step)
        assert slopes[..., k] == pytest.approx(exact, abs=1e-5 * np.abs(exact).max())


def test_loci_of_two_bobs_follow_their_closed_form() -> None:
    """In phase g/l whatever the spring, in antiphase g/l + 2 κ a²/(m l²), with a soft one first."""
    bobs = load("two-bobs").conservative
    loci = follow_loci(bobs, parse_variations(["spring[0].stiffness=1:9:5"])[0])
    stiffness = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
    antiphase = np.sqrt(9.81 + 2 * stiffness * 0.25)
    assert np.sort(loci.omega, axis=1) == pytest.approx(
        np.stack([np.full(5, np.sqrt(9.81)), antiphase], axis=1), rel=1e-12
    )
    crossing = follow_loci(TOWER.conservative, parse_variations(["pendulum[0].links[0].length=0.05:2.0:6"])[0])
    assert [encounter.kind for encounter in crossing.encounters].count("veering") >= 1


def test_modes_give_back_numbers_of_a_beam(tmp_path: Path) -> None:
    """A depth of a pivot, which may lie above the axis, and a spring, from the frequencies that they give."""
    beam, path = load("beam").undriven.conservative, tmp_path / "modes.csv"
    true = {"pendulum[0].position[1]": -0.55, "pendulum[1].position[1]": -0.62, "support.stiffness": 320.0}
    modes = natural_modes(vary(beam, true))
    rows = [f"{row.number},{row.frequency!r},1e-6" for row in modes]
    path.write_text("\n".join(["mode,frequency_hz,std_hz", *rows]))
    free = ["pendulum[0].position[1]", "support.stiffness"]
    held = vary(beam, {"pendulum[1].position[1]": true["pendulum[1].position[1]"]})
    fitted = fit_modes(held, read_modes(held, path), free)
    assert fitted.values == pytest.approx([true[place] for place in free], rel=1e-5)


def test_measured_shapes_have_columns_of_coordinates(tmp_path: Path) -> None:
    modes, path = natural_modes(TOWER.conservative), tmp_path / "modes.csv"
    lines = ["mode,frequency_hz,std_hz,lower_m,upper_m,theta_1_1"]
    for row in modes:
        shape = modes.column(modes.shape(row.number - 1)).tolist()
        lines.append(f"{row.number},{row.frequency!r},0.01,{','.join(map(repr, shape))}")
    path.write_text("\n".join(lines))
    measured = read_modes(TOWER, path)
    assert measured.labels == ["lower_m", "upper_m", "theta_1_1"]
    assert np.diag(compare_modes(modes, measured).mac) == pytest.approx(np.ones(3))
    path.write_text("mode,frequency_hz,std_hz,cart,theta_1_1\n1,0.3,0.1,1,1\n")
    with pytest.raises(SceneError, match="its coordinates are lower_m, upper_m"):
        read_modes(TOWER, path)
