"""Paper 000: each misprint fails, each correction holds, against Cartesian kinematics and a balance of forces."""

from __future__ import annotations

import random
from typing import Any

import pytest
import sympy as sp
from sympy.calculus.euler import euler_equations
from sympy.polys.matrices import DomainMatrix

from modal.symbolic import Coordinate, coordinate, lagrange_equations, time_derivative
from modal.symbolic.papers import Equation, residual
from modal.symbolic.papers import cart as paper
from modal.symbolic.papers import cart_dae as dae

State = dict[Any, Any]
SEEDS = range(4)


def rational(rng: random.Random) -> Any:
    """Odd over even: never 0 or 1, where a fault could hide."""
    return sp.Rational(rng.choice([-1, 1]) * (2 * rng.randint(0, 30) + 1), 2 * rng.randint(1, 20))


def rational_state(coordinates: list[Coordinate], rng: random.Random, constants: list[Any]) -> State:
    """Positive constants, rational rates, and angles whose sine and cosine are rational."""
    state: State = {symbol: abs(rational(rng)) for symbol in constants}
    for c in coordinates:
        t = rational(rng)
        state |= {sp.sin(c.q): 2 * t / (1 + t**2), sp.cos(c.q): (1 - t**2) / (1 + t**2)}
        state |= {c.v: rational(rng), c.a: rational(rng)}
    return state


def constants(n: int) -> list[Any]:
    return [paper.g, paper.m_c, *(symbol for link in paper.links(n) for symbol in (link.m, link.l))]


def state_of(n: int, seed: int) -> State:
    return rational_state(paper.minimal_coordinates(n), random.Random(seed), constants(n))


def at(form: Any, state: State) -> Any:
    """An exact rational: the state must have covered every symbol."""
    value = sp.sympify(form).xreplace(state)
    assert value.is_Rational, value
    return value


def centre(p: int, j: int) -> tuple[Any, Any]:
    """(down, across) of a rod's centre, written here from the picture."""
    x, (a, b) = paper.X.q, paper.double_pendulum(p)
    u1, u2 = ((sp.cos(link.theta.q), sp.sin(link.theta.q)) for link in (a, b))
    if j == 1:
        return a.l * u1[0] / 2, x + a.l * u1[1] / 2
    return a.l * u1[0] + b.l * u2[0] / 2, x + a.l * u1[1] + b.l * u2[1] / 2


def true_energies(n: int) -> tuple[Any, Any]:
    """T with the rods' rotation and V, from the positions alone."""
    coordinates = paper.minimal_coordinates(n)
    T, V = paper.m_c * paper.X.v**2 / 2, sp.Integer(0)
    for p in range(1, n + 1):
        for j, link in enumerate(paper.double_pendulum(p), 1):
            down, across = centre(p, j)
            velocity = [time_derivative(part, coordinates) for part in (down, across)]
            T += link.m * (velocity[0] ** 2 + velocity[1] ** 2) / 2 + link.m * link.l**2 * link.theta.v**2 / 24
            V -= link.m * paper.g * down
    return T, V


def test_derivatives_agree_with_functions_of_time() -> None:
    c = [coordinate("u"), coordinate("w")]
    L = sp.sin(c[0].q - c[1].q) * c[0].v * c[1].v + c[0].v ** 2 * c[1].q - sp.cos(c[0].q)
    t = sp.Symbol("t")
    f = [sp.Function(str(k.q))(t) for k in c]
    timed = {s: d for k, q in zip(c, f, strict=True) for s, d in ((k.q, q), (k.v, q.diff(t)), (k.a, q.diff(t, 2)))}
    for mine, theirs in zip(lagrange_equations(L, c), euler_equations(L.xreplace(timed), f, t), strict=True):
        assert sp.expand(mine.xreplace(timed) + residual(theirs)) == 0


@pytest.mark.parametrize("j", [1, 2])
def test_positions_are_right(j: int) -> None:
    (equation,) = (e for e in paper.positions(1) if str(e.printed.lhs) == f"r_1_{j}")
    assert equation.right
    assert tuple(equation.printed.rhs) == centre(1, j)


@pytest.mark.parametrize("j", [1, 2])
def test_squared_speeds(j: int) -> None:
    equation, coordinates = paper.squared_speeds(1)[j - 1], paper.minimal_coordinates(1)
    true = sum(time_derivative(part, coordinates) ** 2 for part in centre(1, j))
    assert sp.expand(true - equation.corrected.rhs) != sp.expand(true - equation.printed.rhs)
    for seed in SEEDS:
        state = state_of(1, seed)
        assert at(equation.corrected.rhs - true, state) == 0
        assert at(equation.printed.rhs - true, state) != 0


def test_the_second_speed_is_a_square() -> None:
    equation, v = paper.squared_speeds(1)[1], paper.double_pendulum(1)[1].v
    assert (equation.printed.lhs, equation.corrected.lhs) == (v, v**2)


def test_printed_speeds_hold_under_their_conditions() -> None:
    first, second = paper.squared_speeds(1)
    state = {paper.double_pendulum(1)[0].theta.v: 0}
    for equation in (first, second):
        assert equation.holds_when.subs(state) == sp.true
        assert sp.expand((equation.printed.rhs - equation.corrected.rhs).subs(state)) == 0


def lowest_omega_squared(turning: bool) -> Any:
    """ω² l/g of one rod on a fixed pivot: link 1 alone, from the paper's E_k with and without the correction."""
    E_k = paper.kinetic_energy(1)
    L = (E_k.corrected if turning else E_k.printed).rhs - paper.potential_energy(1).corrected.rhs
    a, b = paper.double_pendulum(1)
    L = L.xreplace({a.v**2: paper.squared_speeds(1)[0].corrected.rhs}).subs({b.m: 0, paper.X.v: 0})
    inertia, stiffness = L.diff(a.theta.v, 2), -L.diff(a.theta.q, 2)
    return sp.simplify((stiffness / inertia).subs(a.theta.q, 0) * a.l / paper.g)


def test_rods_turn() -> None:
    assert lowest_omega_squared(turning=True) == sp.Rational(3, 2)
    assert lowest_omega_squared(turning=False) == 2


@pytest.mark.parametrize("n", [1, 2])
def test_energies_and_lagrangian(n: int) -> None:
    T, V = true_energies(n)
    L, E_p = paper.lagrangian(n), paper.potential_energy(n)
    for seed in SEEDS:
        state = state_of(n, seed)
        assert at(E_p.corrected.rhs - V, state) == 0 != at(E_p.printed.rhs - V, state)
        assert at(L.corrected.rhs - (T - V), state) == 0 != at(L.printed.rhs - (T - V), state)


def test_the_printed_potential_holds_without_gravity_and_with_level_links() -> None:
    E_p, (a, b) = paper.potential_energy(1), (link.theta.q for link in paper.links(1))
    level, down = {a: sp.pi / 2, b: -sp.pi / 2}, {a: sp.S.Zero, b: sp.S.Zero}
    for angles, g, holds in ((level, 9, True), (down, 0, True), (down, 9, False)):
        here = {**dict.fromkeys(constants(1), sp.S.One), **angles, paper.g: sp.Integer(g)}
        assert (E_p.holds_when.subs(here) == sp.true) is holds
        assert (E_p.printed.rhs.subs(here) == E_p.corrected.rhs.subs(here)) is holds
    m, y = [link.m for link in paper.links(1)], [r.printed.rhs[0] for r in paper.positions(1)]
    told = 2 * m[0] * y[0] + (m[0] + m[1]) * y[1]
    assert sp.expand(E_p.printed.rhs - E_p.corrected.rhs - paper.g * told) == 0
    assert "m_1 y_1" in E_p.condition


def test_hanging_is_the_lowest_point() -> None:
    E_p, angles = paper.potential_energy(1), [link.theta.q for link in paper.links(1)]
    down = {angles[0]: 0, angles[1]: 0, **dict.fromkeys(constants(1), 1)}
    for form, sign in ((E_p.corrected, 1), (E_p.printed, -1)):
        hessian = sp.hessian(form.rhs, angles).subs(down)
        assert (sign * hessian).is_positive_definite


def test_the_second_link_has_its_own_weight() -> None:
    E_p, m = paper.potential_energy(1), paper.double_pendulum(1)[1].m
    assert not E_p.printed.rhs.has(m)
    assert E_p.corrected.rhs.has(m)


@pytest.mark.parametrize("coordinate_at", [0, 1, 2])
def test_lagrange_needs_the_total_derivative(coordinate_at: int) -> None:
    equation, coordinates = paper.lagrange_equation(1, coordinate_at), paper.minimal_coordinates(1)
    T, V = true_energies(1)
    true = lagrange_equations(T - V, coordinates)[coordinate_at]
    for seed in SEEDS:
        assert at(residual(equation.corrected) - true, state_of(1, seed)) == 0
        assert at(residual(equation.printed) - true, state_of(1, seed)) != 0
    assert not residual(equation.printed).has(*(c.a for c in coordinates))


def solved(A: Any, F: Any, state: State, n: int) -> State:
    """The unknowns, exactly, at a state without accelerations."""
    left, right = (DomainMatrix.from_Matrix(part.xreplace(state)).convert_to(sp.QQ) for part in (A, F))
    return dict(zip(dae.unknowns(n), left.lu_solve(right).to_Matrix(), strict=True))


def misses(n: int, seed: int, A: Any, F: Any) -> list[Any]:
    """Lagrange's equations of the true energies, at the accelerations that the equations of forces give."""
    coordinates, state = paper.minimal_coordinates(n), state_of(n, seed)
    for c in coordinates:
        del state[c.a]
    accelerations = solved(A, F, state, n)
    T, V = true_energies(n)
    return [at(expression, state | accelerations) for expression in lagrange_equations(T - V, coordinates)]


@pytest.mark.parametrize("n", [1, 2])
def test_forces_give_lagranges_accelerations(n: int) -> None:
    right, wrong = dae.linear_system(n), dae.linear_system(n, "printed")
    for seed in range(2):
        assert misses(n, seed, *right) == [0] * (2 * n + 1)
        assert any(miss != 0 for miss in misses(n, seed, *wrong))


def test_the_ground_carries_the_weight_and_the_centre_of_mass() -> None:
    """R = M g − Σ m y'' and 0 = m_c x'' + Σ m x'': Newton's law of the whole, from positions alone."""
    coordinates, state = paper.minimal_coordinates(2), state_of(2, 3)
    state = {symbol: number for symbol, number in state.items() if "ddot" not in str(symbol)}
    state |= solved(*dae.linear_system(2), state, 2)
    down, across = -paper.m_c * paper.g, paper.m_c * paper.X.a
    for p in (1, 2):
        for j, link in enumerate(paper.double_pendulum(p), 1):
            y, x = (time_derivative(time_derivative(part, coordinates), coordinates) for part in centre(p, j))
            down, across = down + link.m * (y - paper.g), across + link.m * x
    assert at(down + dae.R, state) == 0 == at(across, state)


def system_with(change: Any) -> tuple[Any, Any]:
    """The corrected system of one pendulum with one fault put back into its pendulum constraints."""
    rows = [residual(e.corrected if e.right else change(e)) for e in dae.equations(1)]
    A, F = sp.linear_eq_to_matrix(rows, dae.unknowns(1))
    return A, F


def without_cart(equation: Equation) -> Any:
    return equation.corrected.subs(paper.X.a, 0)


def with_swap(equation: Equation) -> Any:
    swap = {s: t for k in paper.links(1) for s, t in ((k.x.a, k.y.a), (k.y.a, k.x.a))}
    return equation.corrected.xreplace(swap)


@pytest.mark.parametrize("fault", [without_cart, with_swap])
def test_each_fault_of_the_constraints_is_one(fault: Any) -> None:
    assert any(miss != 0 for miss in misses(1, 0, *system_with(fault)))
    assert misses(1, 0, *system_with(lambda equation: equation.corrected)) == [0] * 3
    both = [with_swap(e).subs(paper.X.a, 0) for e in dae.equations(1) if not e.right]
    assert both == [e.printed for e in dae.equations(1) if not e.right]


def test_without_the_cart_the_pivots_stay_at_rest() -> None:
    """Positions differentiated twice: what is left over is the cart's acceleration, along ĵ alone."""
    coordinates = paper.minimal_coordinates(1)
    for j, link in enumerate(paper.double_pendulum(1), 1):
        for axis, (mine, left) in enumerate(((link.y, 0), (link.x, paper.X.a))):
            twice = time_derivative(time_derivative(centre(1, j)[axis], coordinates), coordinates)
            (row,) = (e for e in dae.constraints(1)[1:] if e.corrected.lhs == mine.a)
            assert sp.expand(row.corrected.rhs - twice) == 0
            assert sp.expand(twice - without_cart(row).rhs) == left


def cart_acceleration(n: int, state: State) -> Any:
    """x'' of the cart with equal pendula."""
    state = {symbol: number for symbol, number in state.items() if "ddot" not in str(symbol)}
    for p in range(1, n + 1):
        for mine, first in zip(paper.double_pendulum(p), paper.double_pendulum(1), strict=True):
            state |= {mine.m: state[first.m], mine.l: state[first.l]}
    return solved(*dae.linear_system(n), state, n)[paper.X.a]


def test_a_mirrored_start_never_moves_the_cart() -> None:
    """The paper's n = 2 start is one; x'' vanishes at every mirrored state, so the mirror is kept for ever."""
    state, mirrored = state_of(2, 0), {}
    for mine, other in zip(*(paper.double_pendulum(p) for p in (1, 2)), strict=True):
        a, b = mine.theta, other.theta
        mirrored |= {sp.sin(b.q): -state[sp.sin(a.q)], sp.cos(b.q): state[sp.cos(a.q)], b.v: -state[a.v]}
    assert cart_acceleration(2, state | mirrored) == 0 != cart_acceleration(2, state)
    assert cart_acceleration(1, state_of(1, 0)) != 0


def test_moment_balances_and_inertia_are_right() -> None:
    """J is the integral of s² along the rod; moments are r × R about the centre."""
    s = sp.Symbol("s")
    a, b = paper.double_pendulum(1)
    for link, ends in ((a, [(-1, a.Ry, a.Rx), (1, b.Ry, b.Rx)]), (b, [(-1, -b.Ry, -b.Rx)])):
        assert sp.integrate(link.m / link.l * s**2, (s, -link.l / 2, link.l / 2)) == link.inertia
        arm = [link.l / 2 * f(link.theta.q) for f in (sp.cos, sp.sin)]
        moment = sum(end * (arm[0] * force_x - arm[1] * force_y) for end, force_y, force_x in ends)
        (row,) = (e for e in dae.link_balances(1) if e.printed.rhs == link.inertia * link.theta.a)
        assert row.right
        assert sp.expand(row.printed.lhs - moment) == 0


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_counts(n: int) -> None:
    assert dae.state_counts(n) == (2 * n + 1, 10 * n + 3)
    assert len(dae.equations(n)) == 10 * n + 3 == len(set(dae.unknowns(n)))
    assert len(dae.equations(n)) - len(dae.constraints(n)) == 6 * n + 2


def test_the_solution_divides_by_a() -> None:
    equation = dae.solution(1)
    assert equation.corrected.rhs.shape == equation.corrected.lhs.shape
    assert equation.printed.rhs.shape == (1, 13) != equation.printed.lhs.shape


def test_the_cart_balances_momentum() -> None:
    """Its rate is the sum of the balances along ĵ, in which every inner force cancels; of energies it says nothing."""
    total = dae.momentum(2).corrected.lhs
    rows = [*dae.cart_balances(2), *(row for p in (1, 2) for row in dae.link_balances(p))]
    along = [row.corrected for row in rows if row.title.endswith("along ĵ")]
    assert sum(form.lhs for form in along) == 0
    assert sum(form.rhs for form in along) == total.subs(pairs(2))
    assert sp.degree(total, paper.X.v) == 1


def pairs(n: int) -> list[tuple[Any, Any]]:
    """Velocities along the rail with their accelerations."""
    return [(at.v, at.a) for at in (paper.X, *(link.x for link in paper.links(n)))]


def test_index_faults_are_told() -> None:
    assert "parentheses" in paper.kinetic_energy(1).note
    second = [row for row in dae.constraints(1) if "link 2" in row.title]
    assert len(second) == 2
    assert all("without the pendulum's index" in row.note for row in second)
