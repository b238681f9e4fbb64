"""Symbols against numbers, the pair against the Cartesian Lagrangian, space against the plane."""

from __future__ import annotations

import random

import numpy as np
import pytest
import scipy.linalg
import sympy as sp
from amounts import usually
from positions import Positions
from scenes import decimal_scene

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, matrices, natural_modes
from modal.exact import of_scene
from modal.symbolic import SymbolicStructure, chain, coordinate, derive, derive_lagrangian, symbolic_structure, vanishes
from modal.symbolic import symbolic as symbolic_polynomial
from modal.symbolic.derivation import cart
from modal.symbolic.eigen import modes_section
from modal.symbolic.hamiltonian import equations, vector_equations


@pytest.mark.parametrize("seed", usually(range(60), range(200)))
def test_symbolic_matrices_are_the_numeric_ones(seed: int) -> None:
    scene = decimal_scene(seed)
    expected = matrices(scene)
    for matrix, exact in zip(symbolic_structure(scene).matrices(), (expected.M, expected.K, expected.D), strict=True):
        np.testing.assert_allclose(np.array(matrix.tolist(), dtype=float), exact, rtol=1e-14, atol=1e-14)


SYSTEMS = [
    *(chain(n, kind, ("masses", "lengths")) for n in (1, 2, 3) for kind in ("bob", "rod")),
    cart(2, 2, "rod", ("masses",)),
    cart(3, 1, "bob", ("masses", "lengths"), (-1, 1, -1)),
    *(symbolic_structure(decimal_scene(seed)) for seed in (3, 5, 8, 13)),
]


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: system.title)
def test_the_pair_gives_the_lagrange_equations_of_the_cartesian_positions(system: SymbolicStructure) -> None:
    derived, written = Positions(system).equations, equations(system)
    for other in (written, derive_lagrangian(system).equations, system.equations()):
        assert all(vanishes(a - b) for a, b in zip(derived, other, strict=True))
    assert not vanishes(derived[-1] - 2 * written[-1])


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: system.title)
def test_linearizing_the_lagrangian_gives_M_K_and_D_at_any_rest(system: SymbolicStructure) -> None:
    for derived, matrix in zip(Positions(system).linearized(), system.matrices(), strict=True):
        assert sp.simplify(derived - matrix) == sp.zeros(*matrix.shape)


@pytest.mark.parametrize("seed", usually(range(1), range(4)))
def test_unit_vectors_and_spherical_angles_are_one_motion(seed: int) -> None:
    """∂u_i/∂θ_i·F_i and ∂u_i/∂φ_i·F_i are Lagrange's equations of θ_i and φ_i, at random states in 30 digits."""
    links = (Bob(mass=1.5, length=0.7), Body(mass=0.4, length=1.2, centre=0.5, inertia=0.3), Rod(mass=2.0, length=0.9))
    links = links[: usually(2, 3)]
    support = Cart(mass=3.0, stiffness=2.0) if seed % 2 else Fixed()
    system = symbolic_structure(Scene(gravity=9.81, space="space", support=support, pendulum=[Pendulum(links=links)]))
    spherical = derive_lagrangian(system)
    rng = random.Random(seed)
    state = {part: sp.Rational(rng.randint(-900, 900), 700) for c in spherical.coordinates for part in c}
    lagranges = dict(zip([c.q.name for c in spherical.coordinates], spherical.equations, strict=True))
    forces = vector_equations(system)
    u = [sp.Matrix([sp.sin(t) * sp.cos(f), sp.sin(t) * sp.sin(f), sp.cos(t)]) for t, f in symbols_of(system)]
    second = [accelerated(vector, spherical.coordinates) for vector in u]
    if isinstance(support, Cart):
        _, F = forces.pop(0)
        along = F.coeff(sp.Symbol("e_x")) + sum(F.coeff(coordinate("u", j + 1).a) * second[j][0] for j in range(len(u)))
        assert abs(sp.N((along - lagranges["x"]).subs(state), 30)) < 1e-25
    for i, (_, F) in enumerate(forces):
        weights = {coordinate("u", j + 1).a: second[j] for j in range(len(u))}
        vector = sum((F.coeff(name) * value for name, value in weights.items()), sp.zeros(3, 1))
        vector += sp.Matrix([F.coeff(sp.Symbol("e_x")), 0, F.coeff(sp.Symbol("e_z"))])
        for name in (f"theta_{i + 1}", f"phi_{i + 1}"):
            virtual = u[i].diff(sp.Symbol(name)).dot(vector)
            assert abs(sp.N((virtual - lagranges[name]).subs(state), 30)) < 1e-25


def symbols_of(system: SymbolicStructure) -> list[tuple[sp.Symbol, sp.Symbol]]:
    return [(angle.q, sp.Symbol(angle.q.name.replace("theta", "phi"))) for angle in system.angles]


def accelerated(vector: sp.Matrix, coordinates: tuple) -> sp.Matrix:
    """u'' by the chain rule."""
    from modal.symbolic import time_derivative

    rate = vector.applyfunc(lambda f: time_derivative(f, coordinates))
    return rate.applyfunc(lambda f: time_derivative(f, coordinates))


@pytest.mark.parametrize("seed", range(60))
def test_modes_about_any_rest(seed: int) -> None:
    """Against the generalised companion pencil in SciPy: growth rates, decays and frequencies alike."""
    scene = decimal_scene(seed, joints=seed % 2 == 0)
    modes, model = natural_modes(scene), matrices(scene)
    eye, zero = np.eye(len(model.M)), np.zeros_like(model.M)
    values = scipy.linalg.eigvals(
        np.block([[zero, eye], [-model.K, -model.D]]), np.block([[eye, zero], [zero, model.M]])
    )
    for value, fold in zip(modes.eigenvalue, modes.multiplicity, strict=True):
        assert np.sum(np.abs(values - value) < 1e-6 * (1 + abs(value))) >= fold or value == 0
    assert np.all(modes.eigenvalue.imag >= 0)
    growing = np.sum(modes.multiplicity[modes.eigenvalue.real > 1e-9])
    assert growing == np.sum(np.linalg.eigvalsh(model.K) < -1e-12)
    assert all(row.residual < 1e-11 for row in modes)


def test_an_upright_rod_on_a_cart_grows_at_the_textbook_rate() -> None:
    """σ² = (g/l)·6(m + m_c)/(m + 4 m_c) for a uniform rod of mass m standing on a free cart of mass m_c."""
    m, m_c, l = 0.3, 1.7, 0.8
    pendulum = Pendulum(links=(Rod(mass=m, length=l),), equilibrium=("up",))
    rows = list(natural_modes(Scene(gravity=9.81, support=Cart(mass=m_c), pendulum=[pendulum])))
    assert rows[1].growth_rate == pytest.approx(np.sqrt(9.81 / l * 6 * (m + m_c) / (m + 4 * m_c)), rel=1e-14)
    assert rows[1].family == "cart moves: unstable"
    assert (rows[1].frequency, rows[1].period) == (None, None)
    assert rows[0].growth_rate is None
    assert sum(row.cart_participation for row in rows) == pytest.approx(1, rel=1e-13)


def test_hanging_written_out_is_hanging() -> None:
    links = (Rod(mass=1.0, length=1.0), Bob(mass=2.0, length=0.5))
    plain, written = (
        natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=links, equilibrium=ways)]))
        for ways in (None, ("down", "down"))
    )
    assert plain.omega.tolist() == written.omega.tolist()
    assert "dense" not in written.route


def test_kappa_of_a_stable_mode_beside_a_standing_link() -> None:
    """Two equal pendula far apart in mass on a heavy cart: κ of the hanging one is that of a simple pendulum."""
    hanging = Pendulum(links=(Bob(mass=1.0, length=1.0),))
    standing = Pendulum(links=(Bob(mass=1.0, length=1.0),), equilibrium=("up",))
    rows = list(natural_modes(Scene(gravity=9.81, support=Cart(mass=1e9), pendulum=[hanging, standing])))
    assert sorted(row.kappa for row in rows[1:] if np.isfinite(row.kappa)) == pytest.approx([-1 / 16], rel=1e-6)


@pytest.mark.parametrize("n", range(1, 6))
def test_from_the_lagrangian_to_the_printed_polynomial(n: int) -> None:
    printed = {1: [1, 1], 2: [2, 4, 1], 3: [6, 18, 9, 1], 4: [24, 96, 72, 16, 1], 5: [120, 600, 600, 200, 25, 1]}
    system = chain(n)
    M, K, _ = Positions(system).linearized()
    m, l, g = sp.symbols("m l g", positive=True)
    lam = sp.Symbol("lambda")
    determinant = (M + lam * K * l / g).det(method="berkowitz") / (m * l**2) ** n
    assert sp.Poly(sp.expand(determinant), lam).all_coeffs() == printed[n]
    lines = [line for section in derive(system, ("polynomial",)) for line in section.lines]
    assert sp.Poly(lines[1].formula.lhs, lam).all_coeffs() == printed[n]


@pytest.mark.parametrize("n", usually([2], [2, 3]))
def test_the_recursion_in_symbols_is_the_determinant(n: int) -> None:
    """Also of partly equal symbols and on a cart."""
    x = sp.Symbol("x")
    for system, on_cart in ((chain(n, "rod", ("masses", "lengths")), False), (cart(n, 1, "rod", ("lengths",)), True)):
        M, K, _ = Positions(system).linearized()
        determinant = (K - x * M).det(method="berkowitz")
        section = next(iter(derive(system, ("polynomial",))))
        letter = sp.Symbol("omega") ** 2 if on_cart else x
        in_square = [line for line in section.lines if "ω²$" in line.words and "rigid" not in line.words]
        formula = in_square[0].formula.subs(letter, x)
        ratio = sp.cancel(determinant / formula.lhs)
        assert ratio.free_symbols & {x} == ({x} if on_cart else set())
        assert sp.cancel(ratio / (x if on_cart else 1)).free_symbols & {x} == set()
    assert symbolic_polynomial(n, "rod").has(x)


@pytest.mark.parametrize("seed", range(40))
def test_exact_polynomials_about_any_rest(seed: int) -> None:
    """Their roots are the squares −λ² of the modes, negative where something grows."""
    scene = decimal_scene(seed, joints=False)
    if isinstance(scene.support, Cart):
        scene = scene.model_copy(update={"support": scene.support.model_copy(update={"damping": 0.0})})
    squares = sorted(
        (float(interval.low + interval.high) / 2, factor.multiplicity * interval.multiplicity)
        for factor in of_scene(scene)
        for interval in factor.polynomial.intervals()
    )
    modes = natural_modes(scene)
    expected = np.sort(np.repeat(-(modes.eigenvalue**2).real, modes.multiplicity))
    np.testing.assert_allclose(np.repeat(*zip(*squares, strict=True)), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=1.0)])
def test_no_digit_of_a_neutral_rest_is_shown(support: Fixed | Cart) -> None:
    """A spring that just holds a standing bob: ω = 0 up to rounding, and not another rigid translation."""
    bob = Pendulum(links=(Bob(mass=0.5, length=0.4, stiffness=2.0),), equilibrium=("up",))
    rows = list(natural_modes(Scene(gravity=10.0, support=support, pendulum=[bob])))
    assert [row.is_uncertain for row in rows] == [False, True][-len(rows) :]
    assert rows[-1].family == "beyond double precision"
    assert all(row.multiplicity == 1 for row in rows)


def test_an_exact_zero_is_not_beyond_double_precision() -> None:
    """Of the same bob: the frequency in integers is 0 exactly, where the table has no digit."""
    bob = Pendulum(links=(Bob(mass=0.5, length=0.4, stiffness=2.0),), equilibrium=("up",))
    scene = Scene(gravity=10.0, pendulum=[bob])
    assert natural_modes(scene).family.tolist() == ["beyond double precision"]
    lines = [line.words for line in modes_section(symbolic_structure(scene), scene).lines]
    assert lines == ["mode 1; $ω = 0 rad/s$"]
