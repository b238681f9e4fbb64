"""What `Modes` promises, each by a second route: dense matrices, sum rules, rescaling, symmetry."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from amounts import usually
from compare import assert_certified
from oracle import dense
from scenes import extreme_scene, mild_scene

from modal import (
    Bob,
    Body,
    Cart,
    ComputationError,
    Fixed,
    Pendulum,
    Rod,
    Scene,
    SceneError,
    load,
    matrices,
    natural_modes,
)
from modal.eigen.dense import Dampers, damped_modes
from modal.eigen.structured import OnStructure
from modal.modes import Modes
from modal.statespace import state_space
from nonlinear import simulate


def whole_basis(modes: Modes, normalise: str) -> np.ndarray:
    """Every basis vector of every mode as a column (cart first)."""
    columns = []
    for number, fold in enumerate(modes.multiplicity):
        for copy in range(fold):
            shape = modes.shape(number, copy, normalise)
            columns.append([*([shape.cart] if modes.rig.cart else []), *shape.angles])
    return np.array(columns).T


@pytest.mark.parametrize("seed", range(24))
def test_mass_normalised_shapes_diagonalise_M_and_K(seed: int) -> None:
    modes = natural_modes(mild_scene(seed))
    phi, model = whole_basis(modes, "mass"), matrices(modes.scene)
    omega = np.repeat(modes.omega, modes.multiplicity)
    np.testing.assert_allclose(phi.T @ model.M @ phi, np.eye(len(phi)), atol=1e-11)
    np.testing.assert_allclose(phi.T @ model.K @ phi, np.diag(omega**2), atol=1e-11 * omega.max() ** 2)


@pytest.mark.parametrize("seed", range(24))
def test_shapes_are_normalised_with_a_deterministic_sign(seed: int) -> None:
    modes = natural_modes(mild_scene(seed))
    for angles in whole_basis(modes, "angle").T[:, 1 if modes.rig.cart else 0 :]:
        if angles.any():
            leading = angles[np.argmax(np.abs(angles) >= np.abs(angles).max() * (1 - 1e-9))]
            assert leading == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(24))
def test_sum_rules(seed: int) -> None:
    """Σ effective masses = bᵀA⁻¹b (fixed) or the total mass (cart); participations sum to 1, energy shares too."""
    modes = natural_modes(mild_scene(seed))
    rows = list(modes)
    model = matrices(modes.scene)
    if modes.rig.cart:
        expected = model.M[0, 0]
        assert sum(row.cart_participation for row in rows) == pytest.approx(1, rel=1e-12)
    else:
        b = np.diag(model.K) / modes.scene.gravity
        expected = b @ np.linalg.solve(model.M, b)
    assert sum(row.effective_mass for row in rows) == pytest.approx(expected, rel=1e-12)
    for number, row in enumerate(rows):
        vectors = [modes.shape(number, copy) for copy in range(row.multiplicity)]
        assert sum(v.participation_factor**2 * v.modal_mass for v in vectors) == pytest.approx(
            row.effective_mass, rel=1e-12, abs=1e-14 * expected
        )
        shape = modes.shape(number, 0, "mass")
        assert shape.modal_mass == pytest.approx(1, rel=1e-14)
        cart = modes.rig.cart[0] * shape.cart**2 if modes.rig.cart else 0.0
        assert shape.kinetic_energy_share.sum() + cart == pytest.approx(1, rel=1e-12)
        assert row.residual < 1e-13


@pytest.mark.parametrize("stiffness", [0.0, 3.0])
def test_a_massless_cart_over_bobs_loses_one_mode_and_says_so(stiffness: float) -> None:
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=0.0, stiffness=stiffness),
        pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0), Rod(mass=2.0, length=0.5)), count=2)],
    )
    modes = natural_modes(scene)
    assert "singular" in modes.notes[0]
    assert modes.multiplicity.sum() == 4
    assert sum(row.cart_participation for row in modes) == pytest.approx(1, rel=1e-13)
    assert_certified(modes, 1e-14)


def test_a_massless_cart_over_bobs_with_joint_springs() -> None:
    """One bob on a spring, its pivot free: nothing but the translation has a finite frequency; two bobs: one more."""
    scenes = [
        Scene(
            gravity=9.81,
            support=Cart(mass=0.0),
            pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0, stiffness=2.0, count=n),))],
        )
        for n in (1, 2)
    ]
    assert natural_modes(scenes[0]).omega.tolist() == [0.0]
    modes = natural_modes(scenes[1])
    assert "singular" in modes.notes[0]
    exact = dense(scenes[1])
    assert [exact.below(mp.mpf(float(modes.omega[1])) ** 2 * (1 + s * mp.mpf("1e-13"))) for s in (-1, 1)] == [0, 1]


def test_a_massless_cart_over_rods_keeps_all_modes() -> None:
    scene = Scene(
        gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=(Rod(mass=1.0, length=1.0),), count=2)]
    )
    modes = natural_modes(scene)
    assert modes.notes == ()
    assert modes.multiplicity.sum() == 3


def test_one_bob_on_a_massless_free_cart_has_the_rigid_translation_alone() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0),))])
    assert natural_modes(scene).omega.tolist() == [0.0]


@pytest.mark.parametrize("seed", range(12))
def test_antiphase_leaves_the_cart_exactly_still(seed: int) -> None:
    modes = natural_modes(mild_scene(4 * seed + 1))
    still = [row for row in modes if row.family.startswith("cart still")]
    copies = sum(count - 1 for _, _, count in modes.rig.members)
    assert len(modes.rig.members) != modes.rig.n_kinds or sum(r.multiplicity for r in still) >= bool(copies)
    for row in still:
        for copy in range(row.multiplicity):
            assert modes.shape(row.number - 1, copy).cart == 0.0
        assert row.cart_participation == 0.0
        assert row.effective_mass == 0.0


def test_equal_pendula_written_apart_are_found() -> None:
    apart = natural_modes(load("paper-cart-3"))
    together = natural_modes(
        Scene(
            gravity=9.81,
            support=Cart(mass=100.0),
            pendulum=[Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),), count=3)],
        )
    )
    assert apart.omega.tolist() == together.omega.tolist()
    assert apart.multiplicity.tolist() == [1, 2, 1, 2, 1]


def test_space_is_two_plane_problems() -> None:
    chain = load("chain-spatial")
    modes, plane = natural_modes(chain), natural_modes(chain.in_plane)
    assert modes.omega.tolist() == plane.omega.tolist()
    assert modes.multiplicity.tolist() == [2, 2, 2]
    assert [modes.shape(0, copy).across for copy in range(2)] == [False, True]


def test_a_cart_in_space_is_a_fixed_support_across_the_rail() -> None:
    scene = mild_scene(5).model_copy(update={"space": "space"})
    modes = natural_modes(scene)
    along = natural_modes(scene.model_copy(update={"space": "plane"}))
    across = natural_modes(scene.model_copy(update={"space": "plane", "support": Fixed()}))
    expected = np.concatenate([np.repeat(m.omega, m.multiplicity) for m in (along, across)])
    assert np.repeat(modes.omega, modes.multiplicity).tolist() == sorted(expected.tolist())
    assert sum(row.effective_mass_across for row in modes) == pytest.approx(sum(r.effective_mass for r in across))


@pytest.mark.parametrize("seed", range(16))
def test_joint_springs_agree_with_the_many_digit_pencil(seed: int) -> None:
    modes = natural_modes(mild_scene(seed, stiffness=1.5))
    assert "mass and moment" in modes.route
    exact = dense(modes.scene)
    j = 0
    for omega, fold, error in zip(modes.omega, modes.multiplicity, modes.error, strict=True):
        if omega:
            tolerance = mp.mpf(max(float(error), 1e-15))
            low, high = ((mp.mpf(float(omega)) * (1 + sign * tolerance)) ** 2 for sign in (-1, 1))
            assert exact.below(low) <= j
            assert exact.below(high) >= j + fold
            j += fold


@pytest.mark.parametrize("seed", range(16))
def test_damped_modes_satisfy_the_quadratic_eigenproblem(seed: int) -> None:
    """Against the generalised companion pencil of the whole scene in SciPy."""
    scene = mild_scene(seed, damping=0.3)
    modes, model = natural_modes(scene), matrices(scene)
    n, eye, zero = len(model.M), np.eye(len(model.M)), np.zeros_like(model.M)
    values = scipy.linalg.eigvals(
        np.block([[zero, eye], [-model.K, -model.D]]), np.block([[eye, zero], [zero, model.M]])
    )
    for number, (value, fold) in enumerate(zip(modes.eigenvalue, modes.multiplicity, strict=True)):
        if value:
            assert np.sum(np.abs(values - value) < 1e-7 * (1 + abs(value))) >= fold
            assert modes[number].residual < 1e-11
    real, zeros = np.sum(modes.multiplicity[modes.eigenvalue.imag == 0]), np.sum(modes.omega == 0)
    assert 2 * modes.multiplicity.sum() - real + zeros == 2 * n


def test_the_period_of_a_damped_mode_is_that_of_its_oscillation() -> None:
    (mode,) = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0, damping=5.0),))]))
    assert mode.period == pytest.approx(2 * np.pi / abs(np.roots([1.0, 5.0, 9.81])[0].imag), rel=1e-13)


def test_opposed_joints_are_counted_even_where_products_of_angles_underflow() -> None:
    rows = natural_modes(load("rope"))[900:1000:33]
    opposed = [int(row.family.split(": ")[1].split()[0]) for row in rows]
    assert opposed[:3] == [row.number - 1 for row in rows[:3]]
    assert opposed[3] > 900


def test_overdamped_modes_are_told_apart() -> None:
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0, damping=10.0),))])
    slow, fast = natural_modes(scene)
    roots = np.sort(np.abs(np.roots([1.0, 10.0, 9.81])))
    assert [slow.omega, fast.omega] == pytest.approx(roots.tolist(), rel=1e-14)
    assert slow.family == fast.family == "fixed support: overdamped"
    assert slow.period is None
    assert slow.damping_ratio == 1.0


def test_a_damper_on_the_cart_leaves_antiphase_its_exact_route() -> None:
    """It drains only the modes that move the cart (Huygens); the others are those of the undamped scene."""
    links = (Rod(mass=1.0, length=1.0), Bob(mass=1.0, length=0.5))
    free, dragged = (
        natural_modes(Scene(gravity=9.81, support=Cart(mass=5.0, damping=c), pendulum=[Pendulum(links=links, count=3)]))
        for c in (0.0, 2.0)
    )
    still = [[row for row in modes if row.family.startswith("cart still")] for modes in (free, dragged)]
    assert [row.omega for row in still[0]] == [row.omega for row in still[1]]
    assert all(row.damping_ratio == 0 and np.isfinite(row.kappa) for row in still[1])
    assert all(row.damping_ratio > 0 for row in dragged if row not in still[1] and row.omega > 0)


def test_words_name_pendula_as_the_file_counts_them() -> None:
    pendula = [Pendulum(links=(Bob(mass=1.0, length=l, count=n),)) for l, n in ((1.0, 2), (5.0, 1), (9.0, 1))]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=1e9), pendulum=pendula))
    assert [row.family for row in modes[1:4]] == [
        f"cart moves: mostly pendulum {k}" + w for k, w in ((3, ""), (2, ""), (1, ", slow"))
    ]


def test_light_damping_hardly_moves_the_amplitude_coefficient() -> None:
    """κ differs from the undamped one by a term that shrinks with the damping; strong damping has none."""
    links = (Rod(mass=1.0, length=1.0), Rod(mass=2.0, length=0.7))
    undamped, light, lighter, strong = (
        list(natural_modes(Scene(gravity=9.81, support=Cart(mass=5.0, damping=c), pendulum=[Pendulum(links=links)])))
        for c in (0.0, 1e-2, 1e-3, 1e4)
    )
    errors = [
        [abs(a.kappa / b.kappa - 1) for a, b in zip(rows[-2:], undamped[-2:], strict=True)] for rows in (light, lighter)
    ]
    assert max(errors[0]) < 1e-3
    assert max(errors[1]) < 0.11 * max(errors[0])
    assert any(np.isnan(row.kappa) for row in strong)


def test_light_damping_of_one_pendulum() -> None:
    (mode,) = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=(Bob(mass=2.0, length=3.0, damping=0.7),))]))
    assert mode.omega == pytest.approx(np.sqrt(9.81 / 3), rel=1e-14)
    assert mode.damping_ratio == pytest.approx(0.7 / (2 * 2.0 * 9 * np.sqrt(9.81 / 3)), rel=1e-13)


def test_unstable_modes_are_recognised() -> None:
    """λ² + 0.2 λ − 1 = 0 grows, and decays a little faster; words for an oscillation that grows are there too."""
    from modal.modes.rows import FIXED, family

    dampers = Dampers(np.array([0.2]), np.array([-1]))
    spectrum = damped_modes(np.eye(1), -np.eye(1), np.ones(1), dampers)
    assert spectrum.eigenvalue == pytest.approx([np.sqrt(1.01) - 0.1, -np.sqrt(1.01) - 0.1], rel=1e-14)
    assert family(where=FIXED, folds={"": 1}, motion="", ratio=-0.1) == "fixed support: unstable"


def test_units_of_powers_of_two_change_nothing() -> None:
    for seed in range(40):
        scene = extreme_scene(seed)
        scaled = rescaled(scene, mass=2.0**70, length=2.0**-40)
        omega, expected = natural_modes(scaled).omega, natural_modes(scene).omega * 2.0**20
        np.testing.assert_allclose(omega, expected, rtol=4e-16)


def rescaled(scene: Scene, *, mass: float, length: float) -> Scene:
    def link(old: Bob | Rod | Body) -> Bob | Rod | Body:
        size = {"mass": old.mass * mass, "length": old.length * length}
        if isinstance(old, Body):
            size |= {"centre": old.centre * length, "inertia": old.inertia * mass * length**2}
        return old.model_copy(update=size)

    pendula = tuple(
        p.model_copy(update={"links": tuple(link(unscaled) for unscaled in p.links)}) for p in scene.pendulum
    )
    support = scene.support
    if isinstance(support, Cart):
        support = support.model_copy(
            update={"mass": support.mass * mass, "stiffness": support.stiffness * mass / length}
        )
    return scene.model_copy(update={"pendulum": pendula, "support": support})


def test_nearly_equal_pendula_are_flagged() -> None:
    pendula = [Pendulum(links=(Bob(mass=1.0, length=l),)) for l in (1.0, float(np.nextafter(1.0, 2.0)), 1.5)]
    rows = list(natural_modes(Scene(gravity=9.81, pendulum=pendula)))
    assert [row.indistinct for row in rows] == [False, True, True]


def test_equal_frequencies_of_different_pendula_are_one_row() -> None:
    pendula = [Pendulum(links=(Bob(mass=m, length=1.0),)) for m in (1.0, 2.0)]
    modes = natural_modes(Scene(gravity=9.81, pendulum=pendula))
    assert modes.multiplicity.tolist() == [2]
    assert modes[0].effective_mass == pytest.approx(3.0, rel=1e-14)
    np.testing.assert_array_equal(np.abs(whole_basis(modes, "angle")), np.eye(2))


@pytest.mark.parametrize("seed", usually(range(5000, 5060), range(5000, 5200)))
def test_sum_rules_at_the_extremes(seed: int) -> None:
    """Also where a mode that moves the cart has, to the last bit, the frequency of one that does not."""
    scene = extreme_scene(seed, copies=True)
    modes = natural_modes(scene.model_copy(update={"space": "space"}) if seed % 3 == 0 else scene)
    rows = list(modes)
    assert all(row.residual < 2e-15 for row in rows)
    if modes.rig.cart:
        assert sum(row.cart_participation for row in rows) == pytest.approx(1, rel=1e-9)
        assert sum(row.effective_mass_share for row in rows) == pytest.approx(1, rel=1e-9)


def test_resonances_are_named() -> None:
    pendula = [Pendulum(links=(Bob(mass=1.0, length=l),)) for l in (1.0, 1.0 / 9.0)]
    coupled = natural_modes(Scene(gravity=9.81, support=Cart(mass=1e4), pendulum=pendula))
    assert [row.resonances for row in coupled] == [(), ("1:3 with mode 3",), ("3:1 with mode 2",)]
    uncoupled = natural_modes(Scene(gravity=9.81, pendulum=pendula))
    assert [row.resonances for row in uncoupled] == [(), ()]


def test_modes_of_equal_frequency_are_in_resonance_where_something_couples_them() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=3)
    on_cart = natural_modes(Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[pendulum]))
    assert on_cart[1].resonances == ("1:1 among its own 2 shapes",)
    apart = natural_modes(Scene(gravity=9.81, pendulum=[pendulum]))
    assert apart[0].resonances == ()
    in_space = natural_modes(Scene(gravity=9.81, space="space", pendulum=[pendulum]))
    assert in_space[0].resonances == ("1:1 among its own 2 shapes",)


def test_a_long_list_of_resonances_says_how_many_are_left_out() -> None:
    row = natural_modes(load("thousand-pendula"))[500]
    named = [int(words.split()[-1]) - 1 for words in row.resonances if "with mode" in words]
    more = [int(words.split()[2]) for words in row.resonances if words.endswith("more")]
    omega = natural_modes(load("thousand-pendula")).omega
    expected = sum(np.sum(np.abs(omega / (row.omega * f) - 1) < 0.02) for f in (1, 3, 1 / 3)) - 1
    assert len(named) + sum(more) == pytest.approx(expected, abs=1)


def test_limits_of_the_dense_route_are_told() -> None:
    links = tuple(Bob(mass=1.0, length=1.0 + 0.001 * k, damping=0.1) for k in range(501))
    with pytest.raises(ComputationError, match="dampers need the dense route: 501 coordinates, at most 500"):
        natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=links)]))
    massless = Scene(
        gravity=9.81, support=Cart(mass=0.0, damping=1.0), pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0),))]
    )
    with pytest.raises(ComputationError, match="mass matrix is singular"):
        natural_modes(massless)


def test_a_thousand_equal_damped_pendula_cost_one() -> None:
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=10.0, damping=1.0),
        pendulum=[Pendulum(links=(Rod(mass=1.0, length=1.0, damping=0.1),), count=1000)],
    )
    modes = natural_modes(scene)
    assert [source.matrices.size for source in modes.spectrum.sources if isinstance(source, OnStructure)] == [1, 2]
    assert modes.multiplicity.max() == 999


def test_items_slices_and_iteration_agree() -> None:
    modes = natural_modes(load("paper-cart-3"))
    rows = list(modes)
    assert len(rows) == len(modes) == 5
    assert modes[-1] == rows[-1]
    assert modes[1:3] == rows[1:3]
    with pytest.raises(IndexError):
        modes[5]
    with pytest.raises(IndexError):
        modes.shape(1, 2)


def state_eigenvalues(scene: Scene) -> list[complex]:
    """All eigenvalues of the whole scene's state matrix, in 60 digits."""
    with mp.workdps(60):
        M, K, D = (mp.matrix(a.tolist()) for a in (getattr(matrices(scene), name) for name in "MKD"))
        n, inverse = M.rows, M**-1
        state = mp.zeros(2 * n, 2 * n)
        state[:n, n:] = mp.eye(n)
        state[n:, :n], state[n:, n:] = -inverse * K, -inverse * D
        return [complex(value) for value in mp.eig(state)[0]]


@pytest.mark.parametrize("seed", usually(range(0, 24, 3), range(24)))
def test_damped_error_bounds_hold(seed: int) -> None:
    """Dampers over eight decades, on joints and, every other time, on the cart."""
    scene = mild_scene(seed, damping=float(10 ** np.random.default_rng(seed).uniform(-4, 4)))
    scene = scene.model_copy(update={"pendulum": tuple(p.model_copy(update={"count": 1}) for p in scene.pendulum)})
    if seed % 2 and isinstance(scene.support, Cart):
        scene = scene.model_copy(update={"support": scene.support.model_copy(update={"damping": 1.5})})
    modes, exact = natural_modes(scene), np.array(state_eigenvalues(scene))
    for value, error in zip(modes.eigenvalue, modes.error, strict=True):
        if value:
            assert np.abs(exact - value).min() <= (error + 4e-16) * abs(value)


def test_the_rigid_translation_is_normalised_by_the_cart() -> None:
    modes = natural_modes(load("paper-cart-2"))
    assert (modes.shape(0).cart, modes.shape(0).modal_mass) == (1.0, pytest.approx(104.0))
    assert modes.shape(0, 0, "mass").cart == pytest.approx(104.0**-0.5)
    assert modes.shape(0).participation_factor == pytest.approx(1.0)


def test_an_unknown_normalisation_is_refused() -> None:
    with pytest.raises(ValueError, match='must be "angle" or "mass"'):
        natural_modes(load("chain-2")).shape(0, normalise="unit")


@pytest.mark.parametrize("seed", range(16))
def test_damped_participations_are_the_response_to_a_push(seed: int) -> None:
    """Against the left and right eigenvectors of the state matrix: x'(0+) after a unit push on the cart."""
    scene = mild_scene(seed, damping=0.0 if seed % 3 == 0 else 2.0)
    if not isinstance(scene.support, Cart):
        scene = scene.model_copy(update={"support": Cart(mass=1.5, stiffness=1.0)})
    scene = scene.model_copy(update={"support": scene.support.model_copy(update={"damping": 0.7 * (seed % 2)})})
    rows, model = list(natural_modes(scene)), matrices(scene)
    assert sum(row.cart_participation for row in rows) == pytest.approx(1, rel=1e-9)
    n = len(model.M)
    inverse = np.linalg.inv(model.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ model.K, -inverse @ model.D]])
    values, left, right = scipy.linalg.eig(state, left=True)
    push = np.concatenate([np.zeros(n), inverse[:, 0]])
    shares = (left.conj().T @ push) * right[n] / np.einsum("ij,ij->j", left.conj(), right) / inverse[0, 0]
    for row, value in zip(rows, natural_modes(scene).eigenvalue, strict=True):
        near = np.abs(values - value) < 1e-6 * (1 + abs(value))
        if near.sum() == 1 and row.multiplicity == 1 and row.omega > 0:
            expected = shares[near][0] + (0 if value.imag == 0 else shares[near][0].conj())
            assert row.cart_participation == pytest.approx(expected.real, abs=1e-8)


def test_modes_far_out_of_phase_have_no_amplitude_coefficient() -> None:
    """Two nearly equal pendula, one damped: light damping ratios, but parts that are a quarter period apart."""
    pendula = [Pendulum(links=(Bob(mass=1.0, length=l, damping=c),)) for l, c in ((1.0, 0.02), (1.00001, 0.0))]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=400.0), pendulum=pendula))
    assert modes[2].damping_ratio < 0.1
    assert np.abs(modes.shape(2).angles.imag).max() > 0.1
    assert np.isnan(modes[2].kappa)


def scaled_family(seed: int, spread: float = 0.3) -> Scene:
    """Different pendula of equal frequencies: chains with their masses scaled, next to different ones."""
    rng = np.random.default_rng(seed)
    pendula = []
    for n in rng.integers(1, 4, size=rng.integers(1, 3)):
        numbers = 10 ** rng.uniform(-spread, spread, (n, 4))
        for factor in 10 ** rng.uniform(-2 * spread, 2 * spread, rng.integers(2, 5)):
            links = [Body(mass=m * factor, length=l, centre=c * l, inertia=i * factor) for m, l, c, i in numbers]
            pendula.append(Pendulum(links=links, count=int(rng.integers(1, 3))))
    rng.shuffle(pendula)
    cart = Cart(mass=float(10 ** (rng.uniform(-6, 6) * spread)), stiffness=float(rng.choice([0.0, 3.0])))
    return Scene(gravity=9.81, support=cart, pendulum=pendula)


@pytest.mark.parametrize("seed", range(30))
def test_equal_frequencies_at_the_extremes(seed: int) -> None:
    assert_certified(natural_modes(scaled_family(seed, spread=1.0 + seed % 3)), 1e-14)


def test_an_immense_cart_leaves_equal_pendula_equal() -> None:
    """The mode that moves the cart by 1e-30 has equal angles, to the last digit, as orthogonality wants."""
    pendula = [Pendulum(links=(Bob(mass=m, length=1.0),)) for m in (1.0, 2.0)]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=1e30, stiffness=1.0), pendulum=pendula))
    assert modes.multiplicity.tolist() == [1, 2]
    together, against = (modes.shape(1, copy) for copy in (1, 0))
    assert together.angles == pytest.approx([1, 1], rel=1e-14)
    assert against.angles == pytest.approx([1, -0.5], rel=1e-14)


@pytest.mark.parametrize("seed", range(24))
def test_different_pendula_of_equal_frequency_keep_a_whole_basis(seed: int) -> None:
    """All vectors of all rows diagonalise M and K, and all but one of each set leave the cart exactly still."""
    scene = scaled_family(seed)
    modes, model = natural_modes(scene), matrices(scene)
    assert_certified(modes, 1e-14)
    phi, omega = whole_basis(modes, "mass"), np.repeat(modes.omega, modes.multiplicity)
    np.testing.assert_allclose(phi.T @ model.M @ phi, np.eye(len(phi)), atol=1e-11)
    np.testing.assert_allclose(phi.T @ model.K @ phi, np.diag(omega**2), atol=1e-11 * omega.max() ** 2)
    free = scene.support.stiffness == 0
    kinds = {p.model_copy(update={"count": 1}) for p in scene.pendulum}
    depths = [len(p.links) for p in kinds]
    moving = sum(len({p.links[0].length for p in kinds if len(p.links) == d}) * d for d in set(depths)) + 1
    assert np.sum(phi[0] != 0) == moving
    assert sum(row.multiplicity for row in modes if row.family.startswith("cart still")) == len(phi) - moving
    assert modes[0].omega == 0 if free else modes[0].omega > 0


def test_equal_pendula_on_a_dragged_cart_leave_it_still() -> None:
    pendula = [Pendulum(links=(Bob(mass=m, length=1.0),)) for m in (1.0, 1.1, 1.2)]
    rows = list(natural_modes(Scene(gravity=9.81, support=Cart(mass=3.0, damping=2.0), pendulum=pendula)))
    still = [row for row in rows if row.family == "cart still: antiphase"]
    assert [row.cart_participation for row in still] == [0.0, 0.0]
    assert [row.damping_ratio for row in still] == pytest.approx([0.0, 0.0], abs=1e-14)
    assert rows[0].cart_participation == 0.0
    assert rows[0].effective_mass == pytest.approx(6.3)  # the drift of a free cart has all of it


def ill_scaled(seed: int, *, damped: bool) -> Scene:
    """Joint springs or dampers over many decades, light and heavy carts."""
    rng = np.random.default_rng(seed)

    def decades(spread: float) -> float:
        return float(10 ** rng.uniform(-spread, spread))

    links = []
    for _ in range(rng.integers(1, 4)):
        extra = {"damping" if damped else "stiffness": float(rng.choice([0.0, decades(6)]))}
        size = {"mass": decades(2), "length": decades(1)} | extra
        links.append(Bob(**size) if rng.random() < 0.5 else Rod(**size))
    cart = Cart(mass=decades(6), stiffness=float(rng.choice([0.0, decades(6)])), damping=decades(6) if damped else 0.0)
    return Scene(gravity=9.81, support=cart if rng.random() < 0.7 else Fixed(), pendulum=[Pendulum(links=links)])


@pytest.mark.parametrize("seed", usually(range(50), range(150)))
def test_bounds_of_the_dense_pencil_hold(seed: int) -> None:
    scene = ill_scaled(seed, damped=False)
    try:
        modes = natural_modes(scene)
    except ComputationError:
        return
    exact, place = dense(scene), 0
    for omega, error in zip(modes.omega, modes.error, strict=True):
        if omega:
            tolerance = mp.mpf(max(float(error), 1e-15))
            low, high = ((mp.mpf(float(omega)) * max(1 + sign * tolerance, 0)) ** 2 for sign in (-1, 1))
            assert exact.below(low) <= place < exact.below(high)
            place += 1


@pytest.mark.parametrize("seed", usually(range(40), range(150)))
def test_bounds_of_the_state_matrix_hold(seed: int) -> None:
    """Against the eigenvalues of the many-digit state matrix."""
    scene = ill_scaled(seed, damped=True)
    try:
        modes = natural_modes(scene)
    except ComputationError:
        return
    exact, D = dense(scene), mp.matrix(matrices(scene).D.tolist())
    mp.mp.dps = 60
    M, K, n = mp.matrix(exact.M), mp.matrix(exact.K), exact.size
    inverse = M**-1
    state = mp.zeros(2 * n)
    state[:n, n:] = mp.eye(n)
    state[n:, :n], state[n:, n:] = -inverse * K, -inverse * D
    truth = mp.eig(state, left=False, right=False)
    for value, error in zip(modes.eigenvalue, modes.error, strict=True):
        if value:
            nearest = min(abs(mp.mpc(complex(value)) - t) for t in truth)
            assert nearest <= max(float(error), 1e-15) * abs(value), (value, error, float(nearest / abs(value)))


@pytest.mark.parametrize("mass", [1.0, 1.2903392993031357])
def test_a_massless_cart_over_damped_bobs_is_refused_by_name(mass: float) -> None:
    bob = Bob(mass=mass, length=0.5372195859131478, damping=0.1)
    with pytest.raises(ComputationError, match="mass matrix is singular"):
        natural_modes(Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=(bob,))]))


@pytest.mark.parametrize("stiffness", [0.0, 50.0])
def test_participations_of_a_massless_cart_with_joint_springs_sum_to_one(stiffness: float) -> None:
    links = (Bob(mass=1.0, length=1.0), Bob(mass=2.0, length=0.7, stiffness=5.0))
    scene = Scene(gravity=9.81, support=Cart(mass=0.0, stiffness=stiffness), pendulum=[Pendulum(links=links)])
    assert sum(row.cart_participation for row in natural_modes(scene)) == pytest.approx(1, rel=1e-12)


def test_words_say_which_pendula_move() -> None:
    bob, rods = Pendulum(links=(Bob(mass=1.0, length=1.0),)), Pendulum(links=(Rod(mass=1.0, length=2.0),), count=2)
    fixed = natural_modes(Scene(gravity=9.81, pendulum=[bob, rods]))
    assert [row.family for row in fixed] == [
        "fixed support (2 degenerate modes): the 2 equal to pendulum 2",
        "fixed support: pendulum 1",
    ]
    moving = natural_modes(Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=[bob, rods]))
    assert "cart still: antiphase, the 2 equal to pendulum 2" in [row.family for row in moving]


def test_an_immense_cart_and_joint_springs_are_not_called_antiphase() -> None:
    bobs = (Bob(mass=1.0, length=1.0, stiffness=1.0), Bob(mass=1.0, length=2.0))
    pendula = [Pendulum(links=(bob,)) for bob in bobs]
    rows = natural_modes(Scene(gravity=9.81, support=Cart(mass=1e20), pendulum=pendula))
    assert [row.family for row in rows][1:] == ["cart moves: mostly pendulum 2", "cart moves: mostly pendulum 1"]
    five = Pendulum(links=bobs[1:], count=5)
    equal = natural_modes(Scene(gravity=9.81, support=Cart(mass=1e20), pendulum=[five]))
    assert equal[1].family == "cart moves (5 degenerate modes): antiphase 4, in phase"


def test_an_overdamped_mode_is_nobodys_resonance() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=2)
    rows = list(natural_modes(Scene(gravity=9.81, support=Cart(mass=1.0, damping=6.26), pendulum=[pendulum])))
    still = next(row for row in rows if row.family.startswith("cart still"))
    assert rows[1].damping_ratio == 1.0
    assert still.resonances == ()


def test_what_is_no_scene_is_told_what_was_meant() -> None:
    for question in (natural_modes, matrices, state_space, lambda name: simulate(name, 1.0)):
        with pytest.raises(SceneError, match=r'not str: load\("paper-cart-2"\) gives one'):
            question("paper-cart-2")
    with pytest.raises(SceneError, match="a Scene is required, not Modes"):
        natural_modes(natural_modes(load("chain-1")))
    with pytest.raises(SceneError, match=r"inputs 'cart_force': must be a list: \['cart_force'\]"):
        state_space(load("paper-cart-2"), "cart_force")


def test_an_index_that_is_not_there_says_which_are() -> None:
    modes = natural_modes(load("paper-cart-2"))
    with pytest.raises(IndexError, match=r"^there is no mode of index 9: 5 modes have indices 0 to 4$"):
        modes[9]
    with pytest.raises(IndexError, match=r"mode 5 of the table is modes\[4\]"):
        modes[5]
    with pytest.raises(TypeError, match=r"columns are attributes, such as modes\.omega"):
        modes["omega"]  # type: ignore[call-overload]
    assert modes[-1].number == len(modes[:]) == 5


@pytest.mark.parametrize("name", ["paper-cart-3", "huygens", "chain-spatial"])
def test_what_is_at_hand_for_all_modes_is_read_only(name: str) -> None:
    modes = natural_modes(load(name))
    for values in (modes.omega, modes.eigenvalue, modes.error, modes.multiplicity):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1
