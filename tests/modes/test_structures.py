"""The table of modes of structures: published and closed-form numbers, columns, words and shares."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Bob, Cart, Fixed, Pendulum, Scene, load, natural_frequencies, natural_modes
from modal.assembly import matrices
from modal.modes import all_shapes, table
from modal.modes.numbering import fixed_base_masses
from modal.modes.solution_report import report_solution
from modal.scene import Spring
from modal.scene.supports import Heave, Planar, Platform, Tilt
from nonlinear.orbits import nonlinear_mode, orbit_where_off

G = 9.81
BOB = Bob(mass=1.0, length=1.0)


def carts(**scene: object) -> Scene:
    """Two carts of 5 kg with three bobs each, between the ground and each other."""
    return Scene(
        gravity=G,
        support=[Cart(name=name, mass=5.0, stiffness=30.0) for name in ("left", "right")],
        pendulum=[Pendulum(on=name, links=[BOB], count=3) for name in ("left", "right")],
        spring=[Spring(between=("left", "right"), stiffness=20.0)],
        **scene,
    )


def same(scene: Scene, numbers: list[float], digits: float) -> None:
    """By the structured route, by dense matrices and by all masses in 50 digits."""
    frequencies, M = natural_frequencies(scene), matrices(scene)
    squares = np.linalg.eigvals(np.linalg.solve(M.M, M.K))
    assert frequencies.tolist() == pytest.approx(numbers, abs=digits)
    assert np.allclose(np.sqrt(np.abs(np.sort(squares.real))), frequencies, rtol=1e-9, atol=1e-7)
    assert frequencies.tolist() == pytest.approx([float(omega) for omega in Oracle(scene).frequencies()], rel=4e-15)


def test_two_bobs_and_a_spring() -> None:
    pendula = [Pendulum(links=[BOB], position=(s, 0.0)) for s in (0.0, 0.8)]
    spring = Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"), stiffness=5.0)
    scene = Scene(gravity=G, pendulum=pendula, spring=[spring])
    same(scene, [3.1320919527, 3.5085609586], 5e-11)  # √(g/l), √(g/l + 2κs²/(m l²))
    same(scene.replace(support=Fixed(position=(0.3, 0.1))), [3.1320919527, 3.5085609586], 5e-11)
    modes = natural_modes(scene)
    assert modes.family.tolist() == ["fixed support: in phase", "fixed support: antiphase"]
    assert modes.effective_mass.tolist() == pytest.approx([2.0, 0.0], abs=1e-15)
    cubic = G / 6 + 2.5 * 4 / 6  # of g sin θ + ½ 2.5 sin 2θ, by which each of them swings in antiphase
    kappa = [-1 / 16, -3 / 8 * cubic / (G + 2.5)]
    assert natural_modes(load("two-bobs")).kappa.tolist() == pytest.approx(kappa, rel=1e-7)


@pytest.mark.parametrize("N", [2, 5])
def test_a_chain_of_torsion(N: int) -> None:
    kappa = 0.7
    springs = [
        Spring(kind="torsion", between=(f"pendulum[{k}].links[0]", f"pendulum[{k + 1}].links[0]"), stiffness=kappa)
        for k in range(N - 1)
    ]
    scene = Scene(gravity=G, pendulum=[Pendulum(links=[BOB])] * N, spring=springs)
    same(scene, np.sqrt(G + 4 * kappa * np.sin(np.arange(N) * np.pi / (2 * N)) ** 2).tolist(), 1e-14)


def test_two_carts_with_three_bobs_each() -> None:
    same(carts(), [1.78287370, 2.39391159, *[3.13209195] * 4, 4.30318038, 4.89542514], 5e-9)
    modes = natural_modes(carts())
    assert modes.multiplicity.tolist() == [1, 1, 4, 1, 1]
    assert modes.family.tolist() == [
        "two carts in phase: pendula in phase with the support",
        "two carts in antiphase: pendula in phase with the support",
        "supports at rest (4 degenerate modes): antiphase",
        "two carts in phase: pendula in antiphase with the support",
        "two carts in antiphase: pendula in antiphase with the support",
    ]
    assert modes.effective_mass.sum() == pytest.approx(16.0, rel=1e-14)
    assert modes.effective_mass[1] == 0
    assert modes.route == "effective mass"


def board(joint: float) -> Scene:
    bobs = [
        Pendulum(position=(s, 0.3), links=[Bob(mass=m, length=0.5, stiffness=joint)])
        for s, m in ((-0.4, 1.0), (0.2, 2.0))
    ]
    axis = Tilt(name="board", mass=6.0, inertia=1.5, centre=(0.0, 0.4), stiffness=2.0)
    return Scene(gravity=G, support=axis, pendulum=bobs)


def test_a_board_is_a_cart_where_nothing_turns_against_it() -> None:
    h, scene = 0.3, board(0.0)
    inertia = 1.5 + 6.0 * 0.4**2 + 1.0 * 0.4**2 + 2.0 * 0.2**2
    held = 2.0 + 6.0 * G * 0.4 + G * (1.0 + 2.0) * h
    pendula = [Pendulum(links=pendulum.links) for pendulum in scene.pendulum]
    cart = Scene(gravity=G, support=Cart(mass=inertia / h**2, stiffness=held / h**2), pendulum=pendula)
    same(scene, natural_frequencies(cart).tolist(), 1e-13)
    assert np.abs(natural_frequencies(board(1.0)) / natural_frequencies(cart) - 1).max() > 1e-3


def test_the_beam_with_springs_at_its_joints() -> None:
    beam = load("beam")
    pendula = [
        pendulum.replace(position=(pendulum.position[0], 0.6), links=[pendulum.links[0].replace(stiffness=1.0)])
        for pendulum in beam.pendulum
    ]
    same(beam.replace(pendulum=pendula).conservative, [5.92062, 6.87314, 13.97826], 5e-6)


# ------------------------------------------------------------------------------------------------------------ columns


def test_every_coordinate_has_a_column() -> None:
    modes = natural_modes(carts())
    columns = modes.to_dict()
    assert "cart_participation" not in columns
    shape = modes.shape(1)
    assert np.abs(shape.angles).max() == pytest.approx(1.0, rel=1e-15)
    assert [columns["left_m"][1], columns["right_m"][1]] == pytest.approx(shape.supports.tolist(), abs=1e-15)
    assert "left (m)" in modes.table()
    chosen = csv.DictReader(table(modes, modes.every, "csv", chosen="left_m_participation").splitlines())
    assert sum(float(row["left_m_participation"]) for row in chosen) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("name", STRUCTURED)
def test_shapes_are_orthogonal_and_expand_all_pendula(name: str) -> None:
    scene = STRUCTURED[name].conservative
    modes = natural_modes(scene)
    M, K, shapes = modes.matrices.M, modes.matrices.K, modes.matrix.shapes
    each = np.repeat(modes.eigenvalue, modes.multiplicity)
    assert np.abs(shapes.T @ M @ shapes - np.eye(len(M))).max() < 1e-10
    assert np.abs(shapes.T @ K @ shapes + np.diag((each**2).real)).max() < 1e-9 * np.abs(each).max() ** 2
    for row in all_shapes(modes):
        for shape in row:
            assert shape.supports.size == len(M) - shape.angles.size
            carried = 1 - shape.kinetic_energy_share.sum()
            eta = shape.supports
            alone = natural_modes(scene).rig.structure
            assert alone is not None
            assert -1e-12 < carried <= 1 + 1e-12
            assert (eta.any() or abs(carried) < 1e-12) or not eta.size


def test_energy_shares_count_what_moves_down() -> None:
    hull = Platform(name="hull", mass=4.0, inertia=2.0, stiffness=Planar(sway=40.0, heave=500.0, roll=90.0))
    pendula = [Pendulum(position=(0.6, 0.2), links=[BOB])]
    modes = natural_modes(Scene(gravity=G, support=hull, pendulum=pendula))
    for number in range(len(modes)):
        shape = modes.shape(number, normalise="mass")
        x, z, turn = shape.supports
        bob = (x + 0.2 * turn + shape.angles[0]) ** 2 + (-z - 0.6 * turn) ** 2
        assert shape.kinetic_energy_share[0] == pytest.approx(bob, rel=1e-11)
        assert bob + 4.0 * (x**2 + z**2) + 2.0 * turn**2 == pytest.approx(1.0, rel=1e-11)


def test_a_support_that_heaves_alone_swings_no_link() -> None:
    modes = natural_modes(
        Scene(gravity=G, support=Heave(name="lift", mass=3.0, stiffness=200.0), pendulum=[Pendulum(links=[BOB])])
    )
    assert modes.omega.tolist() == pytest.approx([np.sqrt(G), np.sqrt(200.0 / 4.0)], rel=4e-16)
    assert modes.family.tolist() == ["supports at rest", "lift heaves"]
    shape = modes.shape(1)
    assert (shape.supports.tolist(), shape.angles.tolist()) == ([1.0], [0.0])
    assert modes.effective_mass.tolist() == pytest.approx([1.0, 0.0], abs=1e-15)


def test_a_free_row_of_carts_has_all_of_the_mass_in_its_translation() -> None:
    row = carts().replace(support=[Cart(name=name, mass=5.0) for name in ("left", "right")])
    modes = natural_modes(row)
    assert (modes.omega[0], modes.effective_mass[0]) == (0.0, pytest.approx(16.0, rel=1e-15))
    assert modes.effective_mass[1:].tolist() == pytest.approx([0.0] * 4, abs=1e-14)
    assert modes.family[0] == "two carts in phase: free"
    assert np.isnan(fixed_base_masses(modes)).all()


# ------------------------------------------------------------------------------------------------------------ damping


def eigenvalues(scene: Scene) -> np.ndarray:
    model = matrices(scene)
    n = len(model.M)
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n], A[n:, n:] = -np.linalg.solve(model.M, model.K), -np.linalg.solve(model.M, model.D)
    return np.linalg.eigvals(A)


@pytest.mark.parametrize("ratio", [0.03, (0.01, 0.02, 0.03)])
@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_damping_ratios(ratio: float | tuple[float, ...], damping: float) -> None:
    scene = carts(damping_ratio=ratio)
    left, right = scene.supports
    scene = scene.replace(support=[left.replace(damping=damping), right])
    modes = natural_modes(scene)
    every = eigenvalues(scene)
    for value in modes.eigenvalue:
        assert np.abs(every - value).min() < 1e-9
    if not damping:
        wanted = [0.03] * 5 if isinstance(ratio, float) else [*ratio, 0.0, 0.0]
        assert modes.damping_ratio.tolist() == pytest.approx(wanted, abs=1e-15)


def test_more_ratios_than_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="has 6 values for 5 modes"):
        natural_modes(carts(damping_ratio=(0.01,) * 6))


# ------------------------------------------------------------------------------------------------------------ the rest


def test_the_record_of_the_computation_knows_the_structure() -> None:
    report = report_solution(natural_modes(carts()))
    assert (report.coordinates, report.unknowns) == (8, 6)
    assert not report.matrices
    assert "cart coordinate" not in report.text()


def test_numbers_of_supports_and_springs_are_varied() -> None:
    frequencies = natural_frequencies(carts(), vary={"spring[0].stiffness": [20.0, 40.0]})
    assert frequencies[0].tolist() == natural_frequencies(carts()).tolist()
    stiffer = carts().replace(spring=[Spring(between=("left", "right"), stiffness=40.0)])
    assert frequencies[1].tolist() == natural_frequencies(stiffer).tolist()


# ------------------------------------------------------------------------------------ second order of supports


def heaving(stiffness: float, *bobs: float) -> Scene:
    pendula = tuple(Pendulum(links=[Bob(mass=mass, length=1.0)]) for mass in bobs)
    return Scene(gravity=9.81, support=Heave(mass=1.0, stiffness=stiffness), pendulum=pendula)


@pytest.mark.parametrize(("mass", "stiffness"), [(0.2, 400.0), (0.1, 90.0), (0.3, 20.0), (0.2, 47.0)])
def test_a_support_that_heaves_at_twice_the_frequency_shifts_it(mass: float, stiffness: float) -> None:
    """Periodic orbits of the full equations: κ where they begin, and the angle at which they are 1 % off."""
    scene = heaving(stiffness, mass)
    number = 1 if natural_modes(scene)[0].family.startswith("support heaves") else 0
    mode = natural_modes(scene)[number]
    orbits = nonlinear_mode(scene, mode.number, 0.02, locate=False)
    shift = orbits.omega[0] / mode.omega - 1
    if abs(mode.kappa) < 10:  # nearer to 2:1 even the smallest orbit is beyond the second order
        assert shift == pytest.approx(mode.kappa * orbits.amplitude[0] ** 2, rel=3e-2)
    far = orbit_where_off(scene, mode.number)
    assert far is not None
    near = 0.15 if mode.resonances else 0.03
    assert np.degrees(far.amplitude) == pytest.approx(mode.linear_to_1_percent_deg, rel=near)
    assert bool(mode.resonances) is (stiffness == 20.0)


def test_what_pivots_at_rest_say_of_amplitudes_stays() -> None:
    """A pivot above the axis of a board does not sink: κ of a fixed support, no star; equal pendula share a heave."""
    board = Tilt(mass=2.0, inertia=1.0, stiffness=30.0)
    still = Scene(gravity=9.81, support=board, pendulum=[Pendulum(links=[Bob(mass=0.3, length=0.7)], count=2)])
    for mode in natural_modes(still):
        if mode.kappa == mode.kappa:
            assert (mode.kappa, mode.resonances) == (pytest.approx(-1 / 16), ())
    shared = natural_modes(heaving(50.0, 0.1, 0.1))[0]
    assert shared.resonances == ("1:1 among its own 2 shapes",)
