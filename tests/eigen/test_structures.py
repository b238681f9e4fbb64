"""Frequencies and shapes of pendula on structures, against all masses in 150 digits and against dense matrices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from unittest.mock import patch

import mpmath as mp
import numpy as np
import pytest
import structures
from amounts import usually
from numpy.typing import NDArray
from scenes import structured_scene
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Bob, Cart, Pendulum, Scene, natural_frequencies, natural_modes
from modal.assembly import matrices, null_space, rig_of
from modal.eigen import find_spectrum, spectrum
from modal.eigen.component_matrices import ComponentMatrices, SquareSum
from modal.eigen.components import PartedRig, StillGroup
from modal.eigen.dense import square_root
from modal.eigen.product import product_modes
from modal.errors import ComputationError
from modal.scene import Rod, Spring
from modal.scene.supports import ModalSupport, Planar, Platform, Swing, Tilt
from modal.statespace import state_space, to_modal_form
from modal.types import Floats

DIGITS = 150
"""Decimals in which masses and springs of 24 orders each have their frequencies."""


def exact_squares(scene: Scene) -> list[mp.mpf]:
    """ω² of all modes, ascending."""
    with patch.object(structures, "DIGITS", DIGITS), mp.workdps(DIGITS):
        M, K, _ = Oracle(scene).matrices()
        scale = [1 / mp.sqrt(M[k, k]) for k in range(M.rows)]
        for i in range(M.rows):
            for j in range(M.rows):
                M[i, j] *= scale[i] * scale[j]
                K[i, j] *= scale[i] * scale[j]
        L = mp.cholesky(M) ** -1
        A = L * K * L.T
        return sorted(mp.eigsy((A + A.T) / 2, eigvals_only=True))


def errors(scene: Scene) -> Iterator[tuple[float, float]]:
    """The relative error of every frequency, and its bound; free motions must be exactly 0."""
    rig, units = rig_of(scene).natural()
    spectrum = find_spectrum(rig)
    omega = np.repeat(np.abs(spectrum.eigenvalue) * units.rate, spectrum.multiplicity)
    bounds = np.repeat(spectrum.error, spectrum.multiplicity)
    squares = exact_squares(scene)
    assert len(omega) == len(squares)
    for frequency, bound, square in zip(omega.tolist(), bounds.tolist(), squares, strict=True):
        if frequency == 0:
            assert abs(square) < mp.mpf(10) ** (-DIGITS // 2) * squares[-1]
        else:
            yield abs(float(frequency / mp.sqrt(abs(square)) - 1)), bound


@pytest.mark.parametrize("seed", usually(range(24), range(400)))
@pytest.mark.parametrize("spread", [1.0, 12.0])
def test_every_digit_is_right(seed: int, spread: float) -> None:
    for error, bound in errors(structured_scene(seed, spread)):
        assert error <= bound
        assert bound < 1e-12 or spread < 12 or bound < 1e-8


def test_carts_in_a_tree_are_counted_and_loops_take_factors() -> None:
    bob = [Pendulum(on=name, links=[Bob(mass=1.0, length=1.0)] * 2) for name in "abc"]
    carts = [Cart(name=name, mass=3.0 + k, position=(float(k), 0.0)) for k, name in enumerate("abc")]
    joined = [Spring(between=pair, stiffness=20.0 + k) for k, pair in enumerate((("a", "b"), ("b", "c"), ("a", "c")))]
    tree = Scene(gravity=9.81, support=carts, pendulum=bob, spring=joined[:2])
    loop = tree.replace(spring=joined)
    assert natural_modes(tree).route == "exact, effective mass"
    assert natural_modes(loop).route == "exact, product form"
    for scene in (tree, loop):
        assert natural_modes(scene).omega[0] == 0
        assert max(error for error, _ in errors(scene)) < 2e-15


def test_each_tree_without_a_ground_spring_has_one_motion_at_rest() -> None:
    names = "abcde"
    carts = [Cart(name=name, mass=1.0 + k, stiffness=5.0 * (name == "e")) for k, name in enumerate(names)]
    bobs = [Pendulum(on=name, links=[Bob(mass=0.5, length=1.0 + 0.1 * k)]) for k, name in enumerate(names)]
    springs = [Spring(between=pair, stiffness=7.0) for pair in (("a", "b"), ("c", "d"), ("d", "e"))]
    modes = natural_modes(Scene(gravity=9.81, support=carts, pendulum=bobs, spring=springs))
    assert modes.multiplicity[0] == 1
    assert (modes.omega[0], modes.error[0]) == (0.0, 0.0)
    free = natural_modes(modes.scene.replace(spring=springs[:2], support=[*carts[:4], carts[4].replace(stiffness=0.0)]))
    assert (free.omega[:3].tolist(), free.multiplicity[:3].tolist()) == ([0.0] * 3, [1] * 3)
    assert not free.indistinct[:3].any()
    shapes = free.matrix.shapes[:, :3]
    assert np.allclose(shapes.T @ free.matrices.M @ shapes, np.eye(3), atol=1e-15)


def _dragged(kind: str, seed: int = 0) -> Scene:
    """Supports that no spring holds and dampers drag, next to a cart on a spring with a bob."""
    rng = np.random.default_rng(seed)
    d, more, mass = rng.uniform(0.5, 9.0), rng.uniform(0.5, 9.0), rng.uniform(0.5, 5.0)
    lone = Cart(name="lone", mass=mass, damping=d if kind in {"lone", "chain"} else 0.0)
    held = Cart(name="held", position=(1.0, 0.0), mass=1.0, stiffness=30.0 * (kind != "chain"))
    supports = [Tilt(name="board", mass=mass, inertia=0.7, damping=d) if kind == "board" else lone, held]
    pairs = {"ground": [("lone", "ground")], "chain": [("lone", "held")], "joined": [("lone", "held")]}.get(kind, [])
    springs = [Spring(between=pair, damping=more) for pair in pairs]
    bob = Pendulum(on="held", links=[Bob(mass=1.0, length=rng.uniform(0.3, 2.0))])
    if kind == "joined":
        supports[1] = held.replace(stiffness=0.0)
    return Scene(gravity=9.81, support=supports, pendulum=[bob], spring=springs)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["lone", "board", "ground", "chain", "joined"])
def test_what_dampers_drag_and_nothing_holds_has_all_its_modes(kind: str, seed: int) -> None:
    """The roots are those of the state matrix, and the modes span its states."""
    scene = _dragged(kind, seed)
    modes, model = natural_modes(scene), state_space(scene, (), ("coordinates",))
    values = np.repeat(modes.eigenvalue, modes.multiplicity)
    coasts = kind == "joined"
    every = np.concatenate([values, values[values.imag > 0].conj(), [0.0] * coasts])
    mine, theirs = (np.poly(part) for part in (every, np.linalg.eigvals(model.A)))
    np.testing.assert_allclose(mine.real, theirs.real, rtol=1e-9, atol=1e-7 * np.abs(theirs).max())
    assert to_modal_form(modes, model).residual() < 1e-9


def test_a_mode_that_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = spectrum._moving
    monkeypatch.setattr(
        spectrum, "_moving", lambda source: replace(whole(source), along_count=whole(source).along_count - 1)
    )
    with pytest.raises(ComputationError, match="of the 6 states"):
        len(natural_modes(_dragged("lone")))


# ------------------------------------------------------------------------------------------- equal pendula by rank


def dense(scene: Scene) -> Floats:
    model = matrices(scene)
    L = np.linalg.cholesky(model.M)
    squares = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, model.K).T))
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def hull(depths: list[float], **link: float) -> Scene:
    """Equal double pendula at different depths on a platform."""
    links = [Bob(mass=0.5, length=0.8, **link), Rod(mass=0.3, length=0.6)]
    pendula = [Pendulum(position=(0.2 * k - 0.5, h), links=links) for k, h in enumerate(depths)]
    ways = Planar(sway=40.0, heave=500.0, roll=90.0)
    return Scene(
        gravity=9.81, support=Platform(mass=4.0, inertia=2.0, centre=(0.1, 0.2), stiffness=ways), pendulum=pendula
    )


def test_copies_leave_a_platform_still_but_for_the_rank_of_their_rows() -> None:
    scene = hull([0.3, 0.1, 0.25, 0.4, 0.15, 0.3, 0.2])
    modes = natural_modes(scene)
    still = modes.multiplicity[modes.multiplicity > 1]
    assert still.tolist() == [5, 5]  # 7 − rank of (1, h)
    assert np.allclose(np.repeat(modes.omega, modes.multiplicity), dense(scene), rtol=1e-12)
    shapes, M = modes.matrix.shapes, modes.matrices.M
    assert np.abs(shapes.T @ M @ shapes - np.eye(len(M))).max() < 1e-12
    assert (
        np.abs(shapes.T @ modes.matrices.K @ shapes - np.diag(np.repeat(modes.omega**2, modes.multiplicity))).max()
        < 1e-11
    )


def test_joint_springs_feel_the_roll_and_raise_the_rank() -> None:
    scene = hull([0.3, 0.1, 0.25, 0.4, 0.15], stiffness=2.0)
    assert natural_modes(scene).multiplicity.max() == 3  # (1, h) and the roll: h along, 1 by angle
    level = natural_modes(hull([0.0] * 5, stiffness=2.0))
    assert level.multiplicity.max() == 4  # sway and roll act through one combination alone
    assert np.allclose(np.repeat(level.omega, level.multiplicity), dense(level.scene), rtol=1e-12)


def test_a_board_whose_pivots_are_all_at_one_depth_moves_one_combination() -> None:
    bobs = [Pendulum(position=(s, 0.2), links=[Bob(mass=0.5, length=0.5)]) for s in (-0.6, -0.2, 0.2, 0.6)]
    scene = Scene(gravity=9.81, support=Tilt(mass=5.0, inertia=1.0, centre=(0.0, 0.1), stiffness=3.0), pendulum=bobs)
    modes = natural_modes(scene)
    assert modes.multiplicity.tolist() == [1, 3, 1]
    assert "effective mass" in modes.route
    assert np.allclose(np.repeat(modes.omega, modes.multiplicity), dense(scene), rtol=1e-13)


def test_pendula_that_pull_a_board_both_ways_push_its_axis() -> None:
    bobs = [Pendulum(position=(0.0, h), links=[Bob(mass=0.5, length=0.5)]) for h in (0.2, -0.2, 0.1)]
    scene = Scene(gravity=9.81, support=Tilt(mass=5.0, inertia=1.0, centre=(0.0, 0.5), stiffness=3.0), pendulum=bobs)
    modes = natural_modes(scene)
    p = matrices(scene).M @ np.array([0.0, 2.0, 2.0, 2.0])  # all bobs by 1 m; the board is on its axis
    p[0] = 5.0 * 0.5 + 0.5 * (0.2 - 0.2 + 0.1)
    whole = p @ np.linalg.solve(matrices(scene).M, p)
    assert modes.multiplicity.tolist() == [1, 2, 1]
    assert modes.effective_mass.sum() == pytest.approx(whole, rel=1e-12)


def test_ten_thousand_double_pendula_on_five_carts_are_fifteen_unknowns() -> None:
    links = [Bob(mass=0.3, length=0.8), Rod(mass=0.2, length=0.5)]
    carts = [Cart(name=f"c{k}", mass=800.0 + k, stiffness=9e3 * (k == 0), position=(float(k), 0.0)) for k in range(5)]
    springs = [Spring(between=(f"c{k}", f"c{k + 1}"), stiffness=8e3 + k) for k in range(4)]
    pendula = [Pendulum(on=f"c{k}", links=links, count=2000) for k in range(5)]
    modes = natural_modes(Scene(gravity=9.81, support=carts, pendulum=pendula, spring=springs))
    coupled = modes.spectrum.sources[-1]
    assert coupled.problem_size.unknowns == 15
    assert modes.multiplicity.sum() == 20_005
    assert sorted(modes.multiplicity.tolist())[-2:] == [9995, 9995]
    frequencies = natural_frequencies(Scene(gravity=9.81, pendulum=[Pendulum(links=links)]))
    assert modes.omega[modes.multiplicity > 1].tolist() == frequencies.tolist()


def test_combinations_are_orthonormal_and_leave_the_pivots() -> None:
    counts = np.array([1, 3, 2, 5, 1, 4])
    rows = np.sqrt(counts)[:, None] * np.random.default_rng(3).normal(size=(6, 2))
    U, _, _ = np.linalg.svd(rows, full_matrices=False)
    still = StillGroup.of(0, np.arange(6), counts, U)
    every = still.vectors(np.arange(still.number))
    assert (still.number, still.pushes) == (4, True)
    assert np.abs(every @ every.T - np.eye(4)).max() < 1e-15
    assert np.abs(every @ rows).max() < 1e-14
    assert np.abs(every[1:] @ np.sqrt(counts)).max() < 1e-14
    assert abs(every[0] @ np.sqrt(counts)) > 1


# ------------------------------------------------------------------------------------------------ dampers and bounds


def exact_values(scene: Scene) -> NDArray[np.complex128]:
    """λ of all modes."""
    with mp.workdps(50):
        M, K, D = Oracle(scene).matrices()
        n, inverse = M.rows, M**-1
        A = mp.zeros(2 * n)
        A[:n, n:], A[n:, :n], A[n:, n:] = mp.eye(n), -inverse * K, -inverse * D
        return np.array([complex(value) for value in mp.eig(A, left=False, right=False)])


@pytest.mark.parametrize("name", [*STRUCTURED, *usually([0, 4, 9], range(60))])
def test_damped_eigenvalues_are_within_their_bounds(name: str | int) -> None:
    scene = STRUCTURED[name] if isinstance(name, str) else structured_scene(100 + name, 0.5, damped=0.3)
    modes = natural_modes(scene.linearizable)
    exact = exact_values(scene)
    for value, bound in zip(modes.eigenvalue, modes.error, strict=True):
        if value != 0:
            assert np.abs(exact - value).min() <= max(bound, 1e-14) * abs(value)
    assert modes.residual.max() < 1e-9


def test_where_a_coordinate_falls_the_bound_says_so() -> None:
    bob = Pendulum(position=(0.0, -0.5), links=[Bob(mass=1.0, length=0.5)])
    held = 9.81 * (2.0 * 0.3 + 0.5)
    board = Tilt(mass=2.0, inertia=0.4, centre=(0.0, -0.3), stiffness=held * (1 + 1e-9))
    near = Scene(gravity=9.81, support=board, pendulum=[bob])
    (error, bound), *others = list(errors(near))
    assert error <= bound
    assert bound > 1e-8
    falling = natural_modes(near.replace(support=board.replace(stiffness=0.5 * held)))
    assert falling.growth_rate[0] > 0
    assert all(error <= bound for error, bound in errors(falling.scene))
    assert "unstable" in falling.family[0]
    assert others


def test_a_singular_inertia_and_too_many_coordinates_are_refused() -> None:
    rows, two = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[1.0, 1.0]])
    with pytest.raises(ComputationError, match="beyond double precision"):
        product_modes(SquareSum(rows, np.ones(2)), SquareSum(two, np.ones(1)))


# ------------------------------------------------------------------------------------------------ parts of the method


def test_what_no_row_stretches_is_found_by_elimination() -> None:
    rows = np.array([[1.0, -1.0, 0, 0, 0], [0, 1e9, -1e9, 0, 0], [3e-9, 0, -3e-9, 0, 0], [0, 0, 0, 2.0, -1.0]])
    basis = null_space(rows)
    assert basis.shape == (5, 2)
    assert np.abs(rows @ basis).max() == 0
    assert null_space(np.vstack((rows, [[1e-12, 0, 0, 0, 0]]))).shape == (5, 1)
    assert null_space(np.zeros((0, 3))).tolist() == np.eye(3).tolist()


@pytest.mark.parametrize("K", [[[50.0, -10.0], [-10.0, 80.0]], [[1.0, -1.0], [-1.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]])
def test_modal_supports_have_roots_of_either_sign(K: list[list[float]]) -> None:
    rows, signs = square_root(np.array(K))
    assert np.allclose((rows.T * signs) @ rows, K, atol=1e-14)


def test_a_modal_support_of_one_coordinate_is_a_cart() -> None:
    bobs = [Bob(mass=1.0, length=1.0), Bob(mass=0.4, length=0.6)]
    cart = Scene(gravity=9.81, support=Cart(mass=5.0, stiffness=30.0), pendulum=[Pendulum(links=bobs, count=3)])
    frame = ModalSupport(M=((5.0,),), K=((30.0,),), points=(((1.0,), (0.0,)),))
    modal = cart.replace(support=frame, pendulum=[Pendulum(on="modal[0]", links=bobs, count=3)])
    assert natural_frequencies(modal).tolist() == pytest.approx(natural_frequencies(cart).tolist(), rel=4e-16)


def test_a_swing_is_a_cart_held_by_its_weight() -> None:
    bobs = [Pendulum(links=[Bob(mass=0.3, length=0.1)], count=4)]
    swing = Scene(gravity=9.81, support=Swing(mass=2.0, length=0.25, stiffness=3.0), pendulum=bobs)
    cart = swing.replace(support=Cart(mass=2.0, stiffness=3.0 + (2.0 + 4 * 0.3) * 9.81 / 0.25))
    assert natural_frequencies(swing).tolist() == pytest.approx(natural_frequencies(cart).tolist(), rel=4e-16)


def test_pairs_that_springs_join_are_problems_of_their_own() -> None:
    bob = [Bob(mass=1.0, length=1.0)]
    pairs = [Pendulum(links=bob, count=40), Pendulum(links=bob, count=40, position=(0.7, 0.0))]
    spring = Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"), stiffness=5.0)
    modes = natural_modes(Scene(gravity=9.81, pendulum=pairs, spring=[spring]))
    assert modes.multiplicity.tolist() == [40, 40]
    assert modes.omega.tolist() == pytest.approx([3.1320919527, 3.5085609586], abs=5e-11)
    assert {source.problem_size.unknowns for source in modes.spectrum.sources} == {2}


def test_the_parts_of_a_rig_hold_all_of_it() -> None:
    carried = PartedRig(rig_of(STRUCTURED["mixed"]).natural()[0])
    components, balanced = carried.partition
    assert sorted(int(k) for component in components for k in component.eta) == [0, 1, 2]
    assert (
        sum(ComponentMatrices(carried, component).size for component in components) == 6
    )  # one bob, on the lift, swings for itself
    assert balanced == ()


def test_terms_are_the_sums_of_what_cancels() -> None:
    """Weights above the axis of a board take from its stiffness; the sum of terms keeps their sizes."""
    hung = Pendulum(links=[Bob(mass=2.0, length=1.5, stiffness=3.0)], position=(0.0, 0.25))
    board = Tilt(mass=4.0, inertia=1.0, stiffness=50.0, centre=(0.0, -0.5))
    carried = PartedRig(rig_of(Scene(gravity=10.0, support=board, pendulum=[hung])))
    reduced = ComponentMatrices(carried, carried.partition[0][0])
    sinking, rising, joint = 10 * 2 * 0.25, 10 * 4 * 0.5, 3.0
    assert np.diag(reduced.factors[1].matrix).tolist() == [50 - rising + sinking + joint, 10 * 2 * 1.5 + joint]
    assert reduced.terms.tolist() == [50 + rising + sinking + joint, 10 * 2 * 1.5 + joint]
