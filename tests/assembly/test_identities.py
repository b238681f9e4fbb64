"""Identities of mechanics: two routes to each matrix, on seeded random scenes."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from inspect import unwrap
from types import FrameType
from typing import Any

import numpy as np
import pytest
import sympy
from oracle import dense
from scenes import extreme_scene

from modal import Cart, Pendulum, Rod, Scene, load, matrices, natural_modes, pair
from modal.assembly import rig_of
from modal.scene import Body
from nonlinear import simulate, system_of
from nonlinear.averaging import average, relative_equilibria
from nonlinear.integration import choose
from nonlinear.orbits import cycle_of
from nonlinear.synchronization import study_synchronization

SEEDS = range(60)


def kinetic_energy(scene: Scene, q: np.ndarray, rate: np.ndarray) -> complex:
    """½ Σ (m v² + I θ'²) from positions differentiated by a complex step: exact Cartesian kinematics."""
    step = 1e-30
    moved, total = centres(scene, q + 1j * step * rate), 0.0
    for m, inertia, z, theta in moved:
        total += 0.5 * m * float(np.sum((z.imag / step) ** 2)) + 0.5 * inertia * (theta.imag / step) ** 2
    return total


def potential_energy(scene: Scene, q: np.ndarray) -> complex:
    """Gravity and springs."""
    energy = sum(-scene.gravity * m * z[1] for m, _, z, _ in centres(scene, q))
    cart = isinstance(scene.support, Cart)
    at = int(cart)
    if isinstance(scene.support, Cart):
        energy += 0.5 * scene.support.stiffness * q[0] ** 2
    for links in chains(scene):
        above = 0.0
        for link in links:
            energy += 0.5 * link.stiffness * (q[at] - above) ** 2
            above, at = q[at], at + 1
    return energy


def chains(scene: Scene) -> list[list]:
    return [
        [link for link in pendulum.links for _ in range(link.count)]
        for pendulum in scene.pendulum
        for _ in range(pendulum.count)
    ]


def centres(scene: Scene, q: np.ndarray) -> list[tuple]:
    """(m, I, position (x, down), angle) of every link and of the cart."""
    cart = isinstance(scene.support, Cart)
    base = np.array([q[0] if cart else 0.0, 0.0], dtype=complex)
    bodies = [(scene.support.mass, 0.0, base, 0j)] if isinstance(scene.support, Cart) else []
    at = int(cart)
    for links in chains(scene):
        joint = base.copy()
        for link in links:
            along = np.array([np.sin(q[at]), np.cos(q[at])])
            bodies.append((link.mass, link.inertia, joint + link.centre * along, q[at] + 0j))
            joint, at = joint + link.length * along, at + 1
    return bodies


def springy(seed: int) -> Scene:
    """A mild random scene with joint springs and, on a cart, a spring."""
    rng = np.random.default_rng(seed)
    scene = extreme_scene(seed * 8 + 1)
    pendula = tuple(
        Pendulum(links=tuple(Body(mass=m, length=l, centre=c * l, inertia=i, stiffness=k) for m, l, c, i, k in table))
        for table in (rng.uniform(0.1, 2.0, (rng.integers(1, 4), 5)) for _ in scene.pendulum)
    )
    support = Cart(mass=rng.uniform(0, 3), stiffness=rng.uniform(0, 5)) if seed % 3 else scene.support
    return Scene(gravity=9.81, support=support, pendulum=pendula)


@pytest.mark.parametrize("seed", SEEDS)
def test_M_is_the_kinetic_energy_of_the_hanging_rest(seed: int) -> None:
    scene = springy(seed)
    M = matrices(scene).M
    rate = np.random.default_rng(seed).normal(size=len(M))
    assert 0.5 * rate @ M @ rate == pytest.approx(kinetic_energy(scene, np.zeros(len(M)), rate), rel=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_K_is_the_hessian_of_the_potential_energy(seed: int) -> None:
    scene = springy(seed)
    K = matrices(scene).K
    direction = np.random.default_rng(seed).normal(size=len(K))
    step = 1e-4
    around = [potential_energy(scene, s * step * direction).real for s in (-2, -1, 0, 1, 2)]
    second = np.dot([-1, 16, -30, 16, -1], around) / (12 * step**2)
    assert direction @ K @ direction == pytest.approx(second, rel=1e-6, abs=1e-6 * np.abs(K).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_M_and_K_equal_the_many_digit_ones(seed: int) -> None:
    scene = extreme_scene(seed, copies=seed % 2 == 0)
    model, exact = matrices(scene), dense(scene)
    for mine, theirs in ((model.M, exact.M), (model.K, exact.K)):
        np.testing.assert_allclose(mine, np.array(theirs, dtype=float), rtol=1e-14, atol=0)


def test_the_pair_runs_on_fractions_and_symbols_alike() -> None:
    numbers = [(Fraction(3), Fraction(1, 2)), (Fraction(2), Fraction(7, 5)), (Fraction(1, 3), Fraction(4))]
    m, l = zip(*numbers, strict=True)
    c, inertia = [x / 2 for x in l], [x * y * y / 12 for x, y in numbers]
    exact = pair.inertia_matrix(m, l, c, inertia)
    floats = pair.inertia_matrix(*([float(x) for x in values] for values in (m, l, c, inertia)))
    np.testing.assert_allclose(floats, np.array(exact, dtype=float), rtol=1e-15)
    M, L = sympy.symbols("m1:4"), sympy.symbols("l1:4")
    symbolic = pair.inertia_matrix(M, L, [x / 2 for x in L], [x * y**2 / 12 for x, y in zip(M, L, strict=True)])
    values = dict(zip(M + L, m + l, strict=True))
    assert all(
        sympy.Rational(symbolic[i][j].subs(values)) == sympy.Rational(exact[i][j].numerator, exact[i][j].denominator)
        for i in range(3)
        for j in range(3)
    )


def test_equal_pendula_are_one_kind_wherever_they_stand() -> None:
    single, two = (Pendulum(links=(Rod(mass=m, length=1.0),), count=c) for m, c in ((1.0, 2), (2.0, 1)))
    rig = rig_of(Scene(gravity=1.0, pendulum=(single, two, single)))
    assert rig.n_kinds == 2
    assert rig.members == ((0, 0, 2), (0, 1, 1), (0, 0, 2))
    assert rig.blocks[0].count.tolist() == [4, 1]


def test_a_body_that_equals_a_bob_is_one() -> None:
    bob = {"kind": "bob", "mass": 1.5, "length": 0.3}
    body = {"kind": "body", "mass": 1.5, "length": 0.3, "centre": 0.3, "inertia": 0.0}
    assert rig_of(Scene(gravity=1.0, pendulum=[{"links": [bob]}, {"links": [body]}])).n_kinds == 1


def calls(job: Callable[[], object], *functions: Any) -> Counter[str]:
    """How often a job calls these functions."""
    names, counts = {unwrap(function).__code__: function.__name__ for function in functions}, Counter[str]()

    def see(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code in names:
            counts[names[frame.f_code]] += 1

    sys.setprofile(see)
    try:
        job()
    finally:
        sys.setprofile(None)
    return counts


def test_arrays_and_modes_are_handed_on() -> None:
    """Each is built once for the motion and once for the modes of a scene; one more pair is of its undamped modes.

    Each of the two orbits that decide whether the prediction is certain has its own equations. The method is chosen
    once.
    """
    counted = rig_of, system_of, natural_modes, choose
    double = load("paper-cart-2").replace(title="a scene of which nothing is kept")
    counts = calls(lambda: simulate(double, 1.0), *counted)
    assert counts == {"system_of": 1, "rig_of": 2, "natural_modes": 1, "choose": 1}
    clocks = load("metronomes").replace(title="clocks of which nothing is kept")
    counts = calls(lambda: study_synchronization(clocks, 2.0), *counted)
    assert counts == {"system_of": 4, "rig_of": 6, "natural_modes": 2, "choose": 1}


def test_a_limit_cycle_beside_a_prediction_has_one_set_of_equations() -> None:
    (settled,) = relative_equilibria(average(load("huygens")))
    assert calls(lambda: cycle_of(load("huygens"), settled), system_of)["system_of"] == 1
