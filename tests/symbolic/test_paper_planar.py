"""Paper 001: every equation against Cartesian kinematics and the pair, and what it omits."""

from __future__ import annotations

import random
from typing import Any

import pytest
import sympy as sp
from test_paper_cart import at, rational, rational_state

from modal.pair import first_moments, inertia_matrix
from modal.symbolic import lagrange_equations, time_derivative
from modal.symbolic.papers import BEYOND, catalogue, planar, residual

LITERAL = {
    4: [[4, 3, 2, 1], [3, 3, 2, 1], [2, 2, 2, 1], [1, 1, 1, 1]],
    5: [[5, 4, 3, 2, 1], [4, 4, 3, 2, 1], [3, 3, 3, 2, 1], [2, 2, 2, 2, 1], [1, 1, 1, 1, 1]],
}
COEFFICIENTS = {1: [1, 1], 2: [2, 4, 1], 3: [6, 18, 9, 1], 4: [24, 96, 72, 16, 1], 5: [120, 600, 600, 200, 25, 1]}


def true_energies(n: int) -> tuple[Any, Any]:
    """T and V = −m g z of bobs, from their positions."""
    (m, lengths), theta = planar.masses_and_lengths(n), planar.angles(n)
    T, V, x, z = (sp.Integer(0) for _ in range(4))
    for mass, length, angle in zip(m, lengths, theta, strict=True):
        x, z = x + length * sp.sin(angle.q), z + length * sp.cos(angle.q)
        T += mass * (time_derivative(x, theta) ** 2 + time_derivative(z, theta) ** 2) / 2
        V -= mass * planar.g * z
    return T, V


def true_matrices(n: int) -> tuple[Any, Any]:
    """Hessians of T and V at rest."""
    (T, V), theta = true_energies(n), planar.angles(n)
    rest = dict.fromkeys([c.q for c in theta], 0)
    return sp.hessian(T, [c.v for c in theta]).subs(rest), sp.hessian(V, [c.q for c in theta]).subs(rest)


def state_of(n: int, seed: int) -> dict[Any, Any]:
    m, lengths = planar.masses_and_lengths(n)
    return rational_state(planar.angles(n), random.Random(seed), [*m, *lengths, planar.g])


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_energies(n: int) -> None:
    T, V = true_energies(n)
    m, lengths = planar.masses_and_lengths(n)
    L = sp.expand_trig(planar.lagrangian(n).corrected.rhs)
    datum = planar.g * sum(m) * sum(lengths)
    for seed in range(3):
        state = state_of(n, seed)
        assert at(planar.kinetic_energy(n).corrected.rhs - T, state) == 0
        assert at(planar.potential_energy(n).corrected.rhs - V - datum, state) == 0
        assert at(L - (T - V - datum), state) == 0 != at(L - T, state)


def test_three_is_the_papers_own_number() -> None:
    """(3) has 3 + 4·1 + ... products as printed: 2 + 6 + 12 terms, no pair gathered into a cosine."""
    T = sp.expand(planar.kinetic_energy().printed.rhs)
    assert len(T.args) == 2 + 6 + 12
    assert planar.kinetic_energy().right


@pytest.mark.parametrize("n", [2, 3])
def test_lagrange_equations_are_exact(n: int) -> None:
    T, V = true_energies(n)
    for i, true in enumerate(lagrange_equations(T - V, planar.angles(n)), 1):
        form = sp.expand_trig(residual(planar.lagrange_equation(i, n).corrected))
        assert [at(form - true, state_of(n, seed)) for seed in range(3)] == [0, 0, 0]


@pytest.mark.parametrize("i", [1, 2, 3])
def test_a_generalized_force_stands_on_the_right_of_the_first(i: int) -> None:
    """(1) with Φ_i, the power of the forces being dE/dt of the Cartesian energies."""
    equation, (T, V), theta = planar.forced_equation(i), true_energies(3), planar.angles(3)
    assert (equation.number, equation.right) == ("1", True)
    true = lagrange_equations(T - V, theta)[i - 1] - sp.Symbol(f"Phi_{i}")
    form = sp.expand_trig(residual(equation.printed))
    for seed in range(3):
        assert at(form - true, state_of(3, seed) | {sp.Symbol(f"Phi_{i}"): sp.Rational(7, 3)}) == 0
    shown = [section.title for section in catalogue.paper("001")[1]]
    assert shown[0].startswith("(1) d/dt")
    assert "(1) momentum" not in shown


def test_a_velocity_is_no_momentum() -> None:
    equation, (T, _) = planar.momentum(2), true_energies(3)
    true = sp.diff(T, planar.angles(3)[1].v)
    corrected = sp.expand_trig(equation.corrected.rhs)
    for seed in range(3):
        assert at(corrected - true, state_of(3, seed)) == 0 != at(equation.printed.rhs - true, state_of(3, seed))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_accelerations_of_unequal_links(n: int) -> None:
    """(6)-(8), and the same for any n, put into M θ'' + K θ = 0 of the energies."""
    (M, K), theta = true_matrices(n), planar.angles(n)
    second = sp.Matrix([equation.corrected.rhs for equation in planar.accelerations(n)])
    left = M * second + K * sp.Matrix([c.q for c in theta])
    for seed in range(3):
        state = state_of(n, seed) | {c.q: rational(random.Random(seed + i)) for i, c in enumerate(theta)}
        assert [at(row, state) for row in left] == [0] * n


def test_three_links_letter_by_letter_are_the_general_ones() -> None:
    general = [planar._acceleration(i, 3) for i in range(3)]
    for equation, row in zip(planar.accelerations(3), general, strict=True):
        assert sp.expand(sp.together(equation.printed.rhs - row).as_numer_denom()[0]) == 0
    assert [equation.number for equation in planar.accelerations(3)] == ["6", "7", "8"]


def test_equal_links_are_a_special_case() -> None:
    m, lengths = planar.masses_and_lengths(3)
    special = dict.fromkeys(m, 1) | dict.fromkeys(lengths, planar.l)
    for equation, general in zip(planar.equal_accelerations(), planar.accelerations(3), strict=True):
        assert sp.expand(equation.printed.rhs - general.printed.rhs.subs(special)) == 0


@pytest.mark.parametrize("n", [4, 5])
def test_four_and_five_equations(n: int) -> None:
    theta = planar.angles(n)
    equations = planar.equal_motion(n)
    A, F = sp.linear_eq_to_matrix([e.printed for e in equations], [c.a for c in theta])
    assert A.tolist() == LITERAL[n]
    assert list(F) == [-(n - i) * c.q * planar.g / planar.l for i, c in enumerate(theta)]
    assert {e.number for e in equations} == {str(n + 11)}


@pytest.mark.parametrize("n", range(1, 7))
def test_matrices_are_the_pair(n: int) -> None:
    """Symbols through `modal.pair`, the Hessians of the energies, and the paper's integers for equal links."""
    (m, lengths), (M, K) = planar.masses_and_lengths(n), true_matrices(n)
    A = sp.Matrix(inertia_matrix(m, lengths, lengths, [0] * n))
    b = first_moments(m, lengths, lengths)
    assert (A - M).applyfunc(sp.expand).is_zero_matrix
    assert (planar.g * sp.diag(*b) - K).applyfunc(sp.expand).is_zero_matrix
    equal = {**dict.fromkeys(m, 1), **dict.fromkeys(lengths, 1)}
    assert (A.subs(equal), sp.diag(*b).subs(equal)) == planar.equal_matrices(n)


@pytest.mark.parametrize("n", range(1, 8))
def test_polynomials(n: int) -> None:
    A, K = planar.equal_matrices(n)
    x = planar.lamda
    assert sp.expand((A + x * K).det(method="berkowitz") - planar.polynomial(n)) == 0
    assert sp.expand(x**n * sp.factorial(n) * sp.laguerre(n, -1 / x) - planar.polynomial(n)) == 0
    if n in COEFFICIENTS:
        equation = planar.eigen_equation(n)
        assert sp.Poly(residual(equation.corrected), x).all_coeffs() == COEFFICIENTS[n]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_lambda_is_minus_g_over_l_omega_squared(n: int) -> None:
    """det(K − ω² M) vanishes with p_n(−g/(l ω²)); with λ = −ω² l/g the printed polynomials fail for n > 1."""
    A, K = planar.equal_matrices(n)
    x = sp.Symbol("x")
    true = (K - x * A).det(method="berkowitz")
    p = residual(planar.eigen_equation(n).corrected)
    meant = planar.eigen_equation(n).holds_when.rhs.subs({planar.g: 1, planar.l: 1, planar.omega: sp.sqrt(x)})
    assert sp.expand((-x) ** n * p.subs(planar.lamda, meant) - true) == 0
    common = sp.rem(true, p.subs(planar.lamda, -x), x)
    assert (common == 0) == (n == 1)


@pytest.mark.parametrize("n", [3, 4, 5])
def test_only_bobs_feel_their_neighbours_alone(n: int) -> None:
    far = [(i, j) for i in range(n) for j in range(n) if abs(i - j) > 1]
    bobs, rods = planar.pull_matrix(n), planar.pull_matrix(n, "rod")
    assert all(bobs[at] == 0 for at in far)
    assert all(sp.expand(rods[at]) != 0 for at in far)
    assert all(bobs[i, i + 1] != 0 != bobs[i + 1, i] for i in range(n - 1))
    corrected = planar.nearest_neighbours(1, 3, n).corrected.rhs
    assert sp.expand(corrected + planar.g * rods[0, 2]) == 0 != corrected


def test_rods_from_cartesian_positions() -> None:
    """The pull of link 3 on link 1 of three rods, from the energy of rods rather than from the pair."""
    theta, x, z, T, V = planar.angles(3), *(sp.Integer(0) for _ in range(4))
    for c in theta:
        u = planar.l * sp.sin(c.q), planar.l * sp.cos(c.q)
        T += sum(time_derivative(s + part / 2, theta) ** 2 for s, part in zip((x, z), u, strict=True)) / 2
        T += planar.l**2 * c.v**2 / 24
        V -= planar.g * (z + u[1] / 2)
        x, z = x + u[0], z + u[1]
    rest = dict.fromkeys([c.q for c in theta], 0)
    M, K = sp.hessian(T, [c.v for c in theta]).subs(rest), sp.hessian(V, [c.q for c in theta]).subs(rest)
    true = -(M.inv() * K)[0, 2]
    equation = planar.nearest_neighbours(1, 3)
    assert sp.cancel(equation.corrected.rhs - true) == 0 != sp.cancel(equation.printed.rhs - true)


def test_at_finite_angles_even_bobs_feel_every_link() -> None:
    """Three bobs at rest: θ_1'' changes with θ_3."""
    T, V = true_energies(3)
    theta, (m, lengths) = planar.angles(3), planar.masses_and_lengths(3)
    units = dict.fromkeys([*m, *lengths, planar.g], 1) | dict.fromkeys([c.v for c in theta], 0)
    rows = [expression.subs(units) for expression in lagrange_equations(T - V, theta)]
    solutions = []
    for last in (0.2, 0.9):
        angle = dict(zip([c.q for c in theta], (0.5, 1.0, last), strict=True))
        solutions.append(sp.linsolve([row.subs(angle) for row in rows], [c.a for c in theta]).args[0][0])
    assert abs(solutions[0] - solutions[1]) > 1e-3


def test_where_the_paper_stops() -> None:
    """Three links, n = 1, 2, 3 and n = 4, 5 are printed; the rest carries the pattern on."""
    builders = {
        planar.kinetic_energy: {3},
        planar.lagrangian: {3},
        planar.eigen_equation: {1, 2, 3},
        lambda n: planar.accelerations(n)[0]: {3},
        lambda n: planar.equal_motion(n)[0]: {4, 5},
    }
    for build, right in builders.items():
        assert {n for n in range(1, 7) if build(n).right} == right
        assert {n for n in range(1, 7) if build(n).printed is None} == set(range(1, 7)) - right
    assert planar.eigen_equation(4).forms()[0][0] == BEYOND
