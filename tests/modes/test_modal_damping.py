"""Damping given as a ratio: its eigenvalues, its matrix, its refusals, and what follows from it in every model."""

import numpy as np
import pytest
import scipy.linalg
from scenes import decimal_scene, mild_scene

from modal import load, natural_modes
from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.modes.solution_report import report_solution
from modal.scene import Bob, Cart, Pendulum, Scene, dumps, parse
from modal.scene.parameters import vary
from modal.statespace import shaper_for, state_space, swings_of, to_modal_form
from modal.statespace.reduction import minimal as smaller
from modal.statespace.reduction import truncate
from nonlinear.ensembles import ensemble
from nonlinear.reduction import superpose
from nonlinear.simulation import simulate
from nonlinear.system import State, system_of
from nonlinear.verification import check


def quadratic(scene: Scene) -> np.ndarray:
    """The eigenvalues with Im λ > 0 of λ²M + λD + K, by SciPy's general solver, sorted by Im λ."""
    model = matrices(scene)
    n, zero = len(model.M), np.zeros_like(model.M)
    companion = np.block([[zero, np.eye(n)], [-model.K, -model.D]])
    values = scipy.linalg.eigvals(companion, scipy.linalg.block_diag(np.eye(n), model.M))
    values = values[np.isfinite(values) & (values.imag > 1e-7)]
    return np.array(sorted(values, key=lambda value: value.imag))


def listed(scene: Scene) -> np.ndarray:
    """The same from the table, multiplicities included."""
    modes = natural_modes(scene)
    values = np.repeat(modes.eigenvalue, modes.multiplicity)
    return np.array(sorted(values[values.imag > 1e-7], key=lambda value: value.imag))


def caughey(scene: Scene) -> np.ndarray:
    """M Φ diag(2 ζ ω) Φᵀ M with the Φ of SciPy, one ratio for all modes."""
    model = matrices(scene.conservative)
    square, phi = scipy.linalg.eigh(model.K, model.M)
    omega = np.sqrt(np.where(square > 1e-9 * square[-1], square, 0.0))
    return model.M @ phi @ np.diag(2 * scene.damping_ratio * omega) @ phi.T @ model.M


@pytest.mark.parametrize("seed", range(12))
def test_eigenvalues_have_the_ratio_and_agree_with_the_quadratic_problem(seed: int) -> None:
    still = mild_scene(seed)
    scene = still.replace(damping_ratio=0.07)
    omega = np.repeat((modes := natural_modes(still)).omega, modes.multiplicity)
    omega = np.sort(omega[omega > 0])
    exact = omega * (-0.07 + 1j * np.sqrt(1 - 0.07**2))
    assert np.allclose(listed(scene), exact, rtol=1e-13, atol=0)
    assert np.allclose(quadratic(scene), exact, rtol=0, atol=1e-8 * omega[-1])


@pytest.mark.parametrize("seed", range(12))
def test_the_matrix_is_that_of_scipys_modes(seed: int) -> None:
    scene = mild_scene(seed).replace(damping_ratio=0.2)
    D = matrices(scene).D
    assert np.allclose(D, caughey(scene), rtol=0, atol=1e-10 * np.abs(D).max())


@pytest.mark.parametrize("seed", range(20))
def test_with_dampers_too_the_table_is_that_of_the_quadratic_problem(seed: int) -> None:
    scene = decimal_scene(seed, standing=False).replace(damping_ratio=0.03)
    if scene.has_dampers:
        eigenvalues, other = listed(scene), quadratic(scene)
        assert len(eigenvalues) == len(other)
        assert np.allclose(eigenvalues, other, rtol=1e-7, atol=1e-7 * np.abs(other).max(initial=0.0))


@pytest.mark.parametrize("name", ["paper-cart-3", "crane-hook", "chain-4", "huygens", "clocks-double"])
def test_ratios_by_number_belong_to_the_modes_of_the_table(name: str) -> None:
    still = load(name).conservative
    scene = still.replace(damping_ratio=(0.0, 0.02, 0.3))
    ratios = [mode.damping_ratio for mode in natural_modes(scene)]
    wanted = [0.0, 0.02, 0.3, *[0.0] * (len(ratios) - 3)]
    assert np.allclose(ratios, wanted, rtol=0, atol=1e-14)
    eigenvalues = quadratic(scene)
    fold = natural_modes(still).multiplicity
    omega = natural_modes(still).omega
    exact = np.repeat(omega * (-np.array(wanted) + 1j * np.sqrt(1 - np.array(wanted) ** 2)), fold)
    exact = np.array(sorted(exact[omega.repeat(fold) > 0], key=lambda value: value.imag))
    assert np.allclose(eigenvalues, exact, rtol=0, atol=1e-9)


def test_a_wrong_list_and_wrong_numbers_are_named() -> None:
    scene = load("chain-2")
    with pytest.raises(SceneError, match=r"damping_ratio: has 3 values for 2 modes"):
        natural_modes(scene.replace(damping_ratio=(0.1, 0.1, 0.1)))
    with pytest.raises(SceneError, match=r"damping_ratio: has 3 values for 2 modes"):
        matrices(scene.replace(damping_ratio=(0.1, 0.1, 0.1)))
    for bad, words in ((-0.1, "-0.1: must not be negative"), (1.0, "1.0: must be below 1"), ("a", "must be a number")):
        with pytest.raises(SceneError, match=rf"^damping_ratio = .*{words}"):
            scene.replace(damping_ratio=bad)
    with pytest.raises(SceneError, match=r"damping_ratio\[1\] = 2.0: must be below 1"):
        scene.replace(damping_ratio=[0.1, 2.0])


def test_it_is_written_and_varied_like_other_numbers() -> None:
    scene = load("chain-2").replace(damping_ratio=[0.01, 0.02])
    assert parse(dumps(scene).encode()) == scene
    assert "damping_ratio" not in dumps(load("chain-2"))
    assert vary(load("chain-2"), {"damping_ratio": 0.05}).damping_ratio == 0.05
    assert vary(scene, {"damping_ratio[1]": 0.05}).damping_ratio == (0.01, 0.05)
    assert scene.has_damping
    assert not scene.conservative.has_damping


def test_the_report_of_the_solution_says_why_there_is_no_damping_matrix() -> None:
    scene = load("crane-hook")
    words = report_solution(natural_modes(scene.replace(damping_ratio=0.02))).text()
    assert "no complex eigenproblem: the scene's damping_ratio" in words
    assert "nothing damps" not in words
    assert "nothing damps" in report_solution(natural_modes(scene)).text()


def test_a_growing_mode_has_none_and_the_table_says_so() -> None:
    scene = load("cart-upright")
    modes, still = natural_modes(scene.replace(damping_ratio=0.05)), natural_modes(scene)
    grows = still.eigenvalue.real > 0
    assert grows.any()
    assert np.array_equal(modes.eigenvalue[grows], still.eigenvalue[grows])
    assert any("damping_ratio" in note for note in modes.notes)
    assert not any("damping_ratio" in note for note in natural_modes(load("chain-2").replace(damping_ratio=0.1)).notes)


def test_thousand_pendula_cost_no_more_than_one_kind() -> None:
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=10.0),
        pendulum=(Pendulum(links=(Bob(mass=0.1, length=1.0),), count=1000),),
        damping_ratio=0.02,
    )
    damping = matrices(scene).D
    small = matrices(scene.replace(pendulum=(scene.pendulum[0].replace(count=3),), support=Cart(mass=0.03))).D
    assert np.allclose(damping[1:, 1:] @ np.ones(1000), damping[1:, 1:].sum(0), rtol=1e-12)
    assert small[1, 1] - small[1, 2] == pytest.approx(damping[1, 1] - damping[1, 2], rel=1e-12)
    assert [mode.damping_ratio for mode in natural_modes(scene)][1:] == pytest.approx([0.02, 0.02], rel=1e-12)


def test_a_long_rope_has_ratios_but_no_matrix() -> None:
    links = (Bob(mass=0.01, length=0.01, count=3000),)
    rope = Scene(gravity=9.81, pendulum=(Pendulum(links=links),), damping_ratio=0.02)
    assert natural_modes(rope, modes=slice(0, 2))[1].damping_ratio == pytest.approx(0.02, rel=1e-12)
    with pytest.raises(ComputationError, match="damping_ratio: the modal dampers of 3000 coordinates"):
        matrices(rope)


@pytest.mark.parametrize("name", ["paper-cart-2", "cart-upright", "huygens", "chain-3"])
def test_state_space_and_modal_form(name: str) -> None:
    scene = load(name).undriven.replace(damping_ratio=0.05)
    model, modes = state_space(scene), natural_modes(scene)
    assert to_modal_form(modes, model).residual() < 1e-13
    eigenvalues = np.linalg.eigvals(model.A)
    for value in modes.eigenvalue:
        # a free cart's double 0 splits by the square root of the rounding
        assert np.abs(eigenvalues - value).min() < (1e-12 if value else 1e-6) * np.abs(eigenvalues).max()


def test_a_prescribed_cart_excites_the_modes_of_a_fixed_support_with_their_ratio() -> None:
    scene = load("crane-hook").replace(damping_ratio=0.05)
    for drive in ("cart_acceleration", "cart_velocity"):
        form = to_modal_form(natural_modes(scene), state_space(scene, inputs=(drive,)))
        assert form.residual() < 1e-13
        oscillating = [block.eigenvalue for block in form.blocks if block.mode is not None]
        assert [-value.real / abs(value) for value in oscillating] == pytest.approx([0.05, 0.05], rel=1e-12)
    assert [swing.zeta for swing in swings_of(scene)] == pytest.approx([0.05, 0.05], rel=1e-12)
    K = np.exp(-0.05 * np.pi / np.sqrt(1 - 0.05**2))
    assert shaper_for(scene).amplitudes[1] == pytest.approx(K / (1 + K), rel=1e-12)
    with pytest.raises(SceneError, match="give one ratio for all modes"):
        shaper_for(scene.replace(damping_ratio=(0.0, 0.1)))


def test_merged_pendula_keep_the_ratio_of_each_mode() -> None:
    scene = load("paper-cart-3").replace(damping_ratio=(0.0, 0.01, 0.02, 0.03))
    whole, small = state_space(scene), smaller(scene)
    rows = [[signal.name for signal in whole.outputs].index(output.name) for output in small.outputs]

    def gain(model, s):
        return model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D

    assert len(small.A) < len(whole.A)
    for s in (0.5j, 3.0j, 0.1 + 7.0j):
        assert np.allclose(gain(whole, s)[rows], gain(small, s), rtol=1e-11, atol=0)
    kept = truncate(natural_modes(scene), whole, 6)
    assert np.allclose(gain(whole, 0.5j), gain(kept, 0.5j), rtol=1e-2)


SWUNG = ("paper-cart-2", "chain-3", "cart-upright", "huygens")


@pytest.mark.parametrize("name", SWUNG)
def test_all_forms_move_alike_and_close_the_energy_books(name: str) -> None:
    scene = load(name).undriven.replace(damping_ratio=0.05)
    start = State(np.linspace(0.2, 0.5, scene.n_links) + np.pi * scene.stands, np.zeros(scene.n_links))
    runs = [
        simulate(scene, 0.3, start=start, form=form, tolerance=1e-12, output=20)
        for form in ("minimal", "hamiltonian", "maximal")
    ]
    assert -runs[0].motion.work[-1] > 1e-4 * runs[0].energy_scale
    for run in runs:
        assert run.energy_drift() < 1e-9
        assert np.abs(run.motion.links - runs[0].motion.links).max() < 1e-9


def test_noted_are_the_closed_form_of_the_damped_modes() -> None:
    scene, omega, zeta = load("chain-1").replace(damping_ratio=0.1), natural_modes(load("chain-1")).omega[0], 0.1
    start = State(np.array([1e-5]), np.zeros(1))
    run = simulate(scene, 10.0, start=start, tolerance=1e-12, output=50)
    damped, t = omega * np.sqrt(1 - zeta**2), run.times
    exact = 1e-5 * np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    assert np.abs(run.motion.links[:, 0] - exact).max() < 1e-14
    closed = superpose(scene, start, corrected=False)(t)
    assert np.abs(closed.links[:, 0] - exact).max() < 1e-18


def test_large_angles_have_the_linear_law_in_the_angles() -> None:
    scene = load("chain-1").replace(damping_ratio=0.1)
    system, y = system_of(scene), np.array([2.5, 1.7, 0.0])
    run = simulate(scene, 0.1, start=State(y[:1], y[1:2]), output=2)
    link, g = scene.pendulum[0].links[0], scene.gravity
    damper = 2 * 0.1 * np.sqrt(g / link.length)
    exact = -g / link.length * np.sin(2.5) - damper * 1.7
    assert run.equations.derivative(0.0, y)[1] == pytest.approx(exact, rel=1e-14)
    assert system.modal_damping == pytest.approx(np.array([[damper * link.mass * link.length**2]]), rel=1e-14)


def test_what_knows_no_modal_damping_says_so() -> None:
    for refused in (check, lambda scene: simulate(scene, 1.0)):
        with pytest.raises(SceneError, match="damping_ratio"):
            refused(load("chain-spatial").replace(damping_ratio=0.01))


def test_members_of_an_ensemble_are_runs_by_themselves() -> None:
    scene = load("chain-2").replace(damping_ratio=0.05)
    starts = np.array([[0.3, 0.4], [0.1, -0.2]])
    runs = ensemble(scene, 0.5, starts=starts)
    for start, end in zip(starts, runs.final.links, strict=True):
        run = simulate(scene, 0.5, start=State(start, np.zeros(2)), output=2)
        assert np.abs(run.final.links - end).max() < 1e-8
