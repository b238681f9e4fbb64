"""Chains with joint springs or standing links, against two oracles in many digits: however extreme, every digit."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import test_extremes_modes
from compare import assert_certified, assert_shapes
from many_digits import squares
from scenes import sprung_scene
from scipy.linalg import eigh
from test_modes import whole_basis

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene, matrices, natural_modes
from modal.assembly import assemble_pendula, rig_of
from modal.eigen import structured
from modal.eigen.component_matrices import ComponentMatrices
from modal.eigen.components import PartedRig
from modal.eigen.recursion import Suspension
from modal.eigen.recursion import count_and_mass as unsprung
from modal.eigen.trees import sprung_count_and_mass as count_and_mass
from modal.modes import Modes
from modal.modes.solution_report import report_solution

EVERY_DIGIT = 1e-15
EXTREMES = (0.3, 3.0, 12.0)
"""Decades either way of masses, lengths, springs and carts."""


def signed(modes: Modes) -> tuple[np.ndarray, np.ndarray]:
    """±ω for ω² of either sign as often as its multiplicity, ascending, with bounds; no rigid translation."""
    value, error = (np.repeat(part, modes.multiplicity) for part in (modes.eigenvalue, modes.error))
    omega = np.where(value.real > 0, -1, 1) * np.abs(value)
    order = np.argsort(omega)
    order = order[omega[order] != 0]
    return omega[order], error[order]


def assert_every_digit(scene: Scene) -> Modes:
    """Each ±ω is right to EVERY_DIGIT over what gravity and springs cancel, and its bound holds and is not far."""
    modes = natural_modes(scene)
    assert "dense" not in modes.route
    frequencies, bound = signed(modes)
    exact = squares(scene, 300)
    assert len(frequencies) == len(exact)
    for omega, error, square in zip(frequencies.tolist(), bound.tolist(), exact, strict=True):
        off = abs(mp.sign(omega) * mp.mpf(omega) ** 2 / square - 1) / 2
        assert off <= error, (omega, float(off), error)
        assert off <= EVERY_DIGIT * max(1, error / 1e-14)
    return modes


@pytest.mark.parametrize("spread", EXTREMES)
@pytest.mark.parametrize("seed", range(6))
def test_joint_springs_keep_every_digit(seed: int, spread: float) -> None:
    modes = assert_every_digit(sprung_scene(seed, spread))
    assert modes.error.max() < 1e-13
    assert_shapes(modes, assert_certified(modes, EVERY_DIGIT), relative=1e-9, floor=1e-12)
    if modes.rig.cart:
        assert sum(row.cart_participation for row in modes) == pytest.approx(1, rel=1e-9)
        assert sum(row.effective_mass_share for row in modes) == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("spread", EXTREMES)
@pytest.mark.parametrize("seed", range(6))
def test_standing_links_keep_every_digit(seed: int, spread: float) -> None:
    """Frequencies and growth rates, with what gravity and springs cancel in the bound."""
    modes = assert_every_digit(sprung_scene(seed, spread, standing=True))
    assert max(row.residual for row in modes) < 1e-12


@pytest.mark.parametrize("stiffness", [1e-12, 1e-3, 1e3, 1e12])
@pytest.mark.parametrize("support", [Fixed(), Cart(mass=1e-3), Cart(mass=5.0, stiffness=2.0)])
def test_bounds_are_close_whatever_the_spring(stiffness: float, support: Fixed | Cart) -> None:
    links = [
        Rod(mass=1.0, length=1.0, stiffness=stiffness),
        Bob(mass=2.0, length=0.5, stiffness=1.0),
        Rod(mass=1.0, length=1.0),
    ]
    modes = assert_every_digit(Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links, count=2)]))
    assert modes.error.max() < 3e-14


@pytest.mark.parametrize("above", [1e-3, 1e-6, 1e-9, -1e-3, -1e-6])
def test_near_buckling_the_bound_follows_what_is_cancelled(above: float) -> None:
    scene = test_extremes_modes.near_buckling(above)
    frequencies, error = signed(assert_every_digit(scene))
    assert (frequencies[0] < 0) == (above < 0)
    assert 1e-16 < error[0] * abs(above) < 1e-13
    assert error[1:].max() < 1e-12


@pytest.mark.parametrize("x", [0.1, 1.0, 7.0, 1e3, 1e8])
def test_without_springs_it_is_the_effective_mass(x: float) -> None:
    block = rig_of(sprung_scene(3, 0.3)).natural()[0].blocks[-1]
    still = block.take(np.arange(block.size))
    object.__setattr__(still, "stiffness", np.zeros_like(still.stiffness))
    below, mass = count_and_mass(still, np.array([x]))
    expected, felt = unsprung(Suspension.on_fixed_support(still).chains[0], np.full((1, still.size), x))
    np.testing.assert_array_equal(below[:, 0], expected[0, 0])
    np.testing.assert_allclose(mass[:, 0], felt[0, 0], rtol=1e-12)


@pytest.mark.parametrize("n", [12, 60])
def test_long_chains_are_those_of_a_dense_solver(n: int) -> None:
    """A hanging rope with bending stiffness, against `eigh` as far as that goes."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1 / n, length=1 / n, stiffness=0.1 * n, count=n)])])
    modes, model = natural_modes(scene), matrices(scene)
    dense = np.sqrt(eigh(model.K, model.M, eigvals_only=True))
    np.testing.assert_allclose(modes.omega, dense, rtol=1e-16 * (dense[-1] / dense[0]) ** 2)
    phi = whole_basis(modes, "mass")
    np.testing.assert_allclose(phi.T @ model.M @ phi, np.eye(n), atol=1e-9)
    assert modes.route == "mass and moment"


def test_different_pendula_of_equal_frequency_split_into_orthogonal_shapes() -> None:
    """Springs in the ratio of the masses: all three combinations that leave the cart still share one ω."""
    bobs = [Pendulum(links=[Bob(mass=m, length=1.0, stiffness=2.0 * m)]) for m in (1.0, 2.0, 4.0, 3.0)]
    for delta in (0.0, 1e-12):
        first = Bob(mass=1.0, length=1.0, stiffness=2.0 * (1 + delta))
        pendula = [Pendulum(links=[first]), *bobs[1:]]
        modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=pendula))
        assert modes.multiplicity.sum() == 5
        model, phi = matrices(modes.scene), whole_basis(modes, "mass")
        np.testing.assert_allclose(phi.T @ model.M @ phi, np.eye(5), atol=1e-14)
        omega = np.repeat(modes.omega, modes.multiplicity)
        np.testing.assert_allclose(phi.T @ model.K @ phi, np.diag(omega**2), atol=1e-12)
    assert modes.route == "exact, mass and moment"


def test_equal_pendula_stay_one_problem() -> None:
    links = [Rod(mass=1.0, length=1.0, stiffness=3.0), Bob(mass=0.5, length=0.7)]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[Pendulum(links=links, count=50)]))
    assert modes.multiplicity.tolist() == [1, 49, 1, 49, 1]
    told = report_solution(modes)
    assert [(part.route, part.unknowns, part.modes) for part in told.parts] == [
        ("mass and moment", 2, 98),
        ("exact", 0, 1),
        ("mass and moment", 3, 2),
    ]
    assert told.matrices == ()


def test_a_wrong_spring_is_seen() -> None:
    """The comparison bites: one part in 1e11 of a spring that carries the mode."""
    scene, exact = (hung(stiffness) for stiffness in (3.0 * (1 + 1e-11), 3.0))
    frequencies, _ = signed(natural_modes(scene))
    wrong = [abs(mp.mpf(o) ** 2 / x - 1) for o, x in zip(frequencies.tolist(), squares(exact, 300), strict=True)]
    assert max(wrong) > 100 * EVERY_DIGIT


def hung(stiffness: float, cart: float = 1.0) -> Scene:
    """Two pendula of two links on a cart."""
    springs = (stiffness, 1.0)
    pendula = [Pendulum(links=[Bob(mass=1.0, length=l, stiffness=s) for s in springs]) for l in (1.0, 1.3)]
    return Scene(gravity=9.81, support=Cart(mass=cart), pendulum=pendula)


def test_what_is_too_much_takes_the_dense_route_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """A massless cart over bobs, whose mass matrix is singular, and more links than are searched together."""
    assert natural_modes(hung(1.0)).route == "exact, mass and moment"
    assert natural_modes(hung(1.0, 0.0)).route == "exact, dense"
    monkeypatch.setattr(structured, "MOST_LINKS_TOGETHER", 3)
    assert natural_modes(hung(1.0)).route == "exact, dense"


def test_the_count_is_that_of_the_matrices() -> None:
    """At trial values of either sign, by Sylvester's law on K − xM."""
    for seed in range(6):
        scene = sprung_scene(seed, 0.3, standing=True)
        rig, _ = rig_of(scene).natural()
        heavy = tuple(block.heavier(block.count) for block in rig.blocks)
        if not rig.cart:
            continue
        carried = PartedRig(rig)
        tree = ComponentMatrices(carried, carried.all_pendula).tree
        assert tree is not None
        K, M = (part for part in _assembled(heavy, rig.cart))
        free = rig.cart.stiffness == 0
        for x in (-10.0, -1.0, -0.1, 0.1, 1.0, 10.0, 100.0):
            below = int(np.sum(np.linalg.eigvalsh(K - x * M) < 0)) - (free and x > 0)
            assert tree.count(np.array([[x]]))[0, 0] == below


def _assembled(blocks: tuple, cart: object) -> tuple[np.ndarray, np.ndarray]:
    M, K = assemble_pendula([(block, p) for block in blocks for p in range(block.size)], cart, 1.0)
    return K, M
