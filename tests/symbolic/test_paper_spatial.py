"""Paper 002: each misprint fails, each correction holds, against positions in space differentiated in time."""

from __future__ import annotations

import random
from typing import Any

import pytest
import sympy as sp
from amounts import usually
from sympy.polys.matrices import DomainMatrix
from test_paper_cart import at, rational_state

from modal.symbolic import lagrange_equations, time_derivative
from modal.symbolic.papers import Equation
from modal.symbolic.papers import spatial as paper

State = dict[Any, Any]
SEEDS = range(3)


def total_momentum(n: int) -> Any:
    """Σ_i ∂L/∂φ_i' = Σ A_ij (u_i × u_j')·e_z, which is conserved on a fixed support."""
    return sp.Add(*(paper.momentum(i, n).corrected.rhs for i in paper.upto(n)))


def vector_equation(i: int, n: int) -> Any:
    """u_i × (Σ_j A_ij u_j'' − g b_i e_z) (3, 1), which vanishes in motion and is regular at every angle."""
    moving, pull = paper.coordinates(n), sp.Matrix([0, 0, -paper.g * paper.inertia(i, i, n) / paper.length(i)])
    for j in paper.upto(n):
        pull += paper.inertia(i, j, n) * paper.direction(j).applyfunc(
            lambda part: time_derivative(time_derivative(part, moving), moving)
        )
    return paper.direction(i).cross(pull)


def state_of(n: int, seed: int) -> State:
    """Exact numbers for every sine, cosine and rate; φ itself only enters through sines and cosines."""
    constants = [paper.g, *(symbol(i) for i in paper.upto(n) for symbol in (paper.mass, paper.length))]
    return rational_state(paper.coordinates(n), random.Random(seed), constants)


def value(form: Any, state: State) -> Any:
    return at(sp.expand_trig(form), state)


def in_one_plane(state: State, n: int) -> State:
    """The same state with every azimuth, and its rate, that of link 1."""
    first, values = paper.phi(1), dict(state)
    for i in paper.upto(n):
        mine = paper.phi(i)
        values |= {f(mine.q): state[f(first.q)] for f in (sp.sin, sp.cos)} | {mine.v: state[first.v]}
    return values


def true_positions(n: int) -> list[list[Any]]:
    """(x, y, z) of every bob, z down."""
    at_joint, places = [sp.Integer(0)] * 3, []
    for i in paper.upto(n):
        theta, phi, l = paper.theta(i).q, paper.phi(i).q, paper.length(i)
        u = sp.sin(theta) * sp.cos(phi), sp.sin(theta) * sp.sin(phi), sp.cos(theta)
        at_joint = [old + l * part for old, part in zip(at_joint, u, strict=True)]
        places.append(at_joint)
    return places


def true_energies(n: int) -> tuple[Any, Any]:
    """T and V, zero where the chain hangs at rest."""
    T, V = sp.Integer(0), sp.Integer(0)
    for k, position in enumerate(true_positions(n), 1):
        T += paper.mass(k) * sum(time_derivative(part, paper.coordinates(n)) ** 2 for part in position) / 2
        V += paper.mass(k) * paper.g * (sum(paper.length(i) for i in paper.upto(k)) - position[2])
    return T, V


def moving_state(n: int, seed: int) -> State:
    """A random state with the accelerations of Lagrange's equations in it."""
    coordinates, state = paper.coordinates(n), state_of(n, seed)
    accelerations = [c.a for c in coordinates]
    for a in accelerations:
        del state[a]
    T, V = true_energies(n)
    rows = [row.xreplace(state) for row in lagrange_equations(T - V, coordinates)]
    parts = (DomainMatrix.from_Matrix(part).convert_to(sp.QQ) for part in sp.linear_eq_to_matrix(rows, accelerations))
    A, F = parts
    return state | dict(zip(accelerations, A.lu_solve(F).to_Matrix(), strict=True))


def assert_corrects(equation: Equation, true: Any, n: int) -> None:
    """The corrected right side is the truth and the printed one is not, exactly, at random states."""
    for seed in SEEDS:
        state = state_of(n, seed)
        assert value(equation.corrected.rhs - true, state) == 0
        assert value(equation.printed.rhs - true, state) != 0


@pytest.mark.parametrize("k", [1, 2, 3])
def test_velocities_are_right(k: int) -> None:
    for equation, part in zip(paper.velocity(k), true_positions(k)[-1], strict=True):
        assert equation.right
        assert sp.expand(equation.corrected.rhs - time_derivative(part, paper.coordinates(k))) == 0


def true_product(i: int, j: int) -> Any:
    rates = [[time_derivative(part, paper.coordinates(j)) for part in paper.direction(k)] for k in (i, j)]
    return sum(a * b for a, b in zip(*rates, strict=True))


def test_cross_terms() -> None:
    assert_corrects(paper.cross_term(1, 2), true_product(1, 2), 2)


def test_square_terms() -> None:
    """The first term lacks its dot; its truth is the cross term of a link with itself."""
    equation, state = paper.square_term(1), state_of(1, 0) | {paper.theta(1).q: sp.Rational(1, 3)}
    assert (
        at(equation.corrected.rhs - true_product(1, 1), state)
        == 0
        != at(equation.printed.rhs, state) - at(true_product(1, 1), state)
    )


def test_cross_terms_hold_in_one_plane() -> None:
    """Δ = 0 is enough, whatever the rates of the azimuths."""
    difference = sp.expand_trig(true_product(1, 2) - paper.printed_product(1, 2))
    for seed in SEEDS:
        state = state_of(2, seed)
        rates = {paper.phi(2).v: state[paper.phi(2).v] + 1}
        assert at(difference, in_one_plane(state, 2) | rates) == 0
        opposite = {f(paper.phi(2).q): -state[f(paper.phi(1).q)] for f in (sp.sin, sp.cos)}
        assert at(difference, state | opposite) != 0, "Δ = π is one plane, too, but only with θ signed"


def test_cross_terms_hold_nowhere_else() -> None:
    """The coefficients of the four products of rates vanish together for Δ = 0, or one link level, one vertical."""
    a, b, spin_a, spin_b = (angle.v for angle in (paper.theta(1), paper.theta(2), paper.phi(1), paper.phi(2)))
    d = sp.Symbol("d")
    error = sp.expand(sp.expand_trig(true_product(1, 2) - paper.printed_product(1, 2)))
    (s1, c1), (s2, c2) = paper.waves(1), paper.waves(2)
    expected = {
        (a, b): c1 * c2 * (sp.cos(d) - 1),
        (spin_a, spin_b): s1 * s2 * (sp.cos(d) - 1),
        (a, spin_b): c1 * s2 * sp.sin(d),
        (spin_a, b): -s1 * c2 * sp.sin(d),
    }
    for (first, second), form in expected.items():
        turned = sp.expand_trig(form.subs(d, paper.phi(1).q - paper.phi(2).q))
        assert [value(error.diff(first, second) - turned, state_of(2, seed)) for seed in SEEDS] == [0, 0, 0]
    level = {paper.theta(1).q: sp.pi / 2, paper.theta(2).q: 0, paper.phi(1).q: paper.phi(2).q + sp.pi}
    assert error.subs(level).expand(trig=True) == 0


def test_the_product_form_of_the_error() -> None:
    """In half angles; so at single states the error vanishes also where ρ_i ρ_j sin(ψ_j − ψ_i − Δ/2) does."""
    rng = random.Random(5)
    symbols = [s for i in (1, 2) for angle in (paper.theta(i), paper.phi(i)) for s in (angle.q, angle.v)]
    error = sp.lambdify(symbols, [paper.cross_error(1, 2), paper.product(1, 2) - paper.printed_product(1, 2)], "math")
    for _ in range(20):
        mine, true = error(*(rng.uniform(-3, 3) for _ in symbols))
        assert mine == pytest.approx(true, abs=1e-12)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_squared_speeds(k: int) -> None:
    true = sum(time_derivative(part, paper.coordinates(k)) ** 2 for part in true_positions(k)[-1])
    equation = paper.squared_speed(k)
    theta = {paper.theta(i).q: sp.Rational(i, 7) for i in paper.upto(k)}
    for seed in SEEDS:
        state = state_of(k, seed) | theta
        assert value(equation.corrected.rhs - true, state) == 0 != value(equation.printed.rhs - true, state)


def test_a_sum_over_unequal_pairs_counts_twice() -> None:
    """With every other fault repaired the printed 2 Σ_{i≠j} still fails, and Σ_{i≠j} holds."""
    true = sum(time_derivative(part, paper.coordinates(2)) ** 2 for part in true_positions(2)[-1])
    l = [paper.length(i) for i in (1, 2)]
    squares = sum(length**2 * paper.product(i, i) for i, length in enumerate(l, 1))
    cross = sum(l[i - 1] * l[j - 1] * paper.product(i, j) for i, j in paper.pairs(2))
    for seed in SEEDS:
        errors = [value(squares + factor * cross - true, state_of(2, seed)) for factor in (1, 2)]
        assert errors[0] == 0 != errors[1]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_kinetic_energy(n: int) -> None:
    assert_corrects(paper.kinetic_energy(n), true_energies(n)[0], n)


def test_sums_end_at_the_bob() -> None:
    """(5) and (6): link 2 moves and lifts bob 2 alone, as printed bob 1 as well."""
    for equation in (paper.kinetic_energy(2), paper.potential_energy(2)):
        pulls = [sp.expand(form.rhs.diff(paper.mass(1))) for form in (equation.printed, equation.corrected)]
        assert [pull.has(paper.length(2)) for pull in pulls] == [True, False]


def test_azimuth_rates_need_the_sine() -> None:
    """(5) for one link: φ' carries sin² θ."""
    equation, spin = paper.kinetic_energy(1), paper.phi(1).v
    at_rest = [
        sp.expand(form.rhs).coeff(spin, 2).subs(paper.theta(1).q, 0) for form in (equation.printed, equation.corrected)
    ]
    assert at_rest[0] != 0 == at_rest[1]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_potential_energy(n: int) -> None:
    assert_corrects(paper.potential_energy(n), true_energies(n)[1], n)
    assert [paper.potential_energy(n).printed.has(paper.g), paper.potential_energy(n).corrected.has(paper.g)] == [0, 1]
    if n > 1:
        with_g = paper.g * paper.potential_energy(n).printed.rhs
        assert value(with_g - true_energies(n)[1], state_of(n, 0)) != 0


@pytest.mark.parametrize("n", [2, 3])
def test_lagrangian(n: int) -> None:
    T, V = true_energies(n)
    assert_corrects(paper.lagrangian(n), T - V, n)


def test_lagrangian_of_one_link_is_right() -> None:
    T, V = true_energies(1)
    assert value(paper.lagrangian(1).printed.rhs - (T - V), state_of(1, 0)) == 0
    assert paper.lagrangian(1).holds_when == sp.true


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_number_of_kinetic_coefficients(n: int) -> None:
    A = {sp.expand(paper.inertia(i, j, n)) for i in paper.upto(n) for j in paper.upto(n)}
    assert len(A) == n * (n + 1) // 2


@pytest.mark.parametrize("i", usually([2], [1, 2, 3]))
def test_momenta_and_their_rates(i: int) -> None:
    """(8), (9) and (11) against the derivatives of the true L; the printed ones hold under their conditions."""
    T, V = true_energies(3)
    phi, moving = paper.phi(i), paper.coordinates(3)
    p = (T - V).diff(phi.v)
    assert_corrects(paper.momentum(i, 3), p, 3)
    assert_corrects(paper.momentum_rate(i, 3), time_derivative(p, moving), 3)
    assert_corrects(paper.conservation(i, 3), (T - V).diff(phi.q), 3)
    plane = in_one_plane(state_of(3, 7), 3)
    assert value(paper.momentum(i, 3).printed.rhs - p, plane) == 0
    assert value(paper.conservation(i, 3).corrected.rhs, plane) != 0, "one turning plane is not enough for (11)"
    waves = {j: [plane[f] for f in paper.waves(j)] for j in paper.upto(3)}
    growing = plane | {paper.theta(j).v: 3 * s / c for j, (s, c) in waves.items()}
    assert value(paper.conservation(i, 3).corrected.rhs, growing) == 0, "all sin θ grow at one rate"
    still = plane | {paper.phi(j).v: sp.Integer(0) for j in paper.upto(3)}
    assert value(paper.conservation(i, 3).corrected.rhs, still) == 0


def test_small_angles() -> None:
    """(10) is the leading order of dp/dt in one plane; the corrected one of dp/dt anywhere."""
    equation, e = paper.small_momentum_rate(1, 2), sp.Symbol("e")
    T, V = true_energies(2)
    rate = time_derivative((T - V).diff(paper.phi(1).v), paper.coordinates(2))
    thetas = [symbol for i in (1, 2) for symbol in paper.theta(i)]
    small = {symbol: sp.Rational(k + 2, 3 * k + 1) * e for k, symbol in enumerate(thetas)}
    leading = rate.subs(small, simultaneous=True).diff(e, 2).subs(e, 0) / 2
    forms = [form.rhs.subs(small, simultaneous=True).subs(e, 1) for form in (equation.printed, equation.corrected)]
    for seed in SEEDS:
        state = state_of(2, seed)
        assert value(forms[1] - leading, state) == 0 != value(forms[0] - leading, state)
        plane = in_one_plane(state, 2)
        assert value(forms[0] - leading, plane) == 0
    assert equation.holds_when.subs({paper.phi(2).q: paper.phi(1).q, paper.phi(2).v: paper.phi(1).v}) == sp.true


def test_a_single_link_conserves_its_momentum() -> None:
    assert paper.conservation(1, 1).corrected.rhs == 0
    assert paper.conservation(1, 2).corrected.rhs != 0
    for build in (paper.momentum, paper.momentum_rate, paper.small_momentum_rate):
        equation = build(1, 1)
        assert sp.expand(equation.printed.rhs - equation.corrected.rhs) == 0
        assert equation.holds_when == sp.true


@pytest.mark.parametrize("n", usually([2], [2, 3]))
def test_only_the_total_is_conserved(n: int) -> None:
    """Rates along the motion, with accelerations from the Cartesian Lagrangian."""
    moving = paper.coordinates(n)
    total = time_derivative(total_momentum(n), moving)
    singles = [time_derivative(paper.momentum(i, n).corrected.rhs, moving) for i in paper.upto(n)]
    for seed in SEEDS:
        state = moving_state(n, seed)
        assert value(total, state) == 0
        assert all(value(single, state) != 0 for single in singles)


def test_the_total_is_the_angular_momentum_about_the_vertical() -> None:
    moving = paper.coordinates(3)
    true = sum(
        paper.mass(k) * (x * time_derivative(y, moving) - y * time_derivative(x, moving))
        for k, (x, y, _) in enumerate(true_positions(3), 1)
    )
    for seed in SEEDS:
        assert value(total_momentum(3) - true, state_of(3, seed)) == 0


def small_moving_state(n: int, size: float) -> State:
    """Equal links a little off the vertical, as floats, with the accelerations of Lagrange's equations."""
    rng, coordinates = random.Random(n), paper.coordinates(n)
    state: State = dict.fromkeys([f(i) for i in paper.upto(n) for f in (paper.mass, paper.length)], 1)
    state |= {paper.g: 1} | {symbol: rng.uniform(0.5, 1.5) for c in coordinates for symbol in (c.q, c.v)}
    state |= {symbol: size * state[symbol] for i in paper.upto(n) for symbol in paper.theta(i)[:2]}
    T, V = true_energies(n)
    rows = [row.subs(state) for row in lagrange_equations(T - V, coordinates)]
    A, F = sp.linear_eq_to_matrix(rows, [c.a for c in coordinates])
    return state | dict(zip([c.a for c in coordinates], A.LUsolve(F), strict=True))


@pytest.mark.parametrize("n", usually([1, 2], [1, 2, 3]))
def test_azimuth_accelerations(n: int) -> None:
    """(12)-(15) miss the motion of a chain by a fifth and more even at small angles; the corrected form is it."""
    state = small_moving_state(n, 0.01)
    c = {sp.Symbol(f"c_{i}"): paper.momentum(i, n).corrected.rhs.subs(state) for i in paper.upto(n)}
    state |= c | dict.fromkeys(sp.symbols("l m"), 1)
    for i in paper.upto(n):
        true, corrected = state[paper.phi(i).a], paper.azimuth_acceleration(i, n).corrected.rhs
        assert float(corrected.subs(state) / true) == pytest.approx(1, rel=1e-9)
        for read in (False, True):
            off = abs(paper.azimuth_acceleration(i, n, has_dots=read).printed.rhs.subs(state) / true - 1)
            assert off < 1e-3 if n == 1 and read else off > 0.2


@pytest.mark.parametrize("i", [1, 2, 3, 4])
def test_what_the_printed_accelerations_mean(i: int) -> None:
    """Read with dots, they are the rate of φ' = (8) solved at small angles with every p_j constant, for equal links."""
    n, (l, m) = 4, sp.symbols("l m")
    theta = [paper.theta(j).q for j in paper.upto(n)]
    A = sp.Matrix(n, n, lambda a, b: m * l**2 * (n - max(a, b)))
    D = sp.diag(*(1 / angle for angle in theta))
    spin = D * A.inv() * D * l * sp.Matrix([sp.Symbol(f"c_{j}") for j in paper.upto(n)])
    rate = time_derivative(spin[i - 1], paper.coordinates(n))
    same = {sp.Symbol("l_1"): l, sp.Symbol("m_1"): m}
    assert sp.expand(paper.azimuth_acceleration(i, n, has_dots=True).printed.rhs.subs(same) - rate) == 0
    assert sp.expand(paper.azimuth_acceleration(i, n).printed.rhs.subs(same) - rate) != 0


def test_the_printed_accelerations_letter_by_letter() -> None:
    """(12) or (13), (14) and (15) of three links as the copy has them, exponents s, N and 5 as 3, 2 and 3."""
    t1, t2, t3, c1, c2, c3, l, m = sp.symbols("theta_1:4 c_1:4 l m")
    l1, m1 = sp.symbols("l_1 m_1")
    inner = (t2 / (t2**2 * t1) + t1 / (t2 * t1**2)) * c1, (t2 / (t2**2 * t3) + t3 / (t2 * t3**2)) * c3
    literal = [
        (-2 * c1 / t1**3 + c2 * (t1 / (t1**2 * t2) + t2 / (t1 * t2**2))) / (l1 * m1),
        (inner[0] - 4 * c2 / t2**3 + inner[1]) / (l * m),
        ((t2 / (t2**2 * t3**2) + t3 / (t2 * t3**2)) * c2 - 4 * c3 / t3**3) / (l * m),
    ]
    for i, form in enumerate(literal, 1):
        equation = paper.azimuth_acceleration(i, 3)
        assert sp.expand(equation.printed.rhs - form) == 0
        assert equation.number == ("12-13", "14", "15")[i - 1]


@pytest.mark.parametrize(("i", "factor"), [(1, 1), (2, 2), (3, 2)])
def test_what_the_printed_accelerations_are_for_one_link(i: int, factor: int) -> None:
    """With dots, (12) is φ'' = −2 c θ'/(l m θ³) of a single link; (14) and (15) are twice that, and say so."""
    theta, c = paper.theta(i), sp.Symbol(f"c_{i}")
    true = paper.azimuth_acceleration(1, 1, has_dots=True).corrected.rhs
    spin = c / (paper.mass(1) * paper.length(1) * paper.theta(1).q ** 2)
    alone = at_small_angles(true).subs(paper.phi(1).v, spin)
    same = dict(zip((*paper.theta(1), paper.mass(1), paper.length(1)), (*theta, *sp.symbols("m l")), strict=True))
    equation = paper.azimuth_acceleration(i, 3, has_dots=True)
    printed = equation.printed.rhs.subs({f"c_{j}": 0 for j in paper.others(i, 3)}).subs({"l_1": "l", "m_1": "m"})
    assert sp.cancel(printed / alone.subs(same)) == factor
    assert ("not for one link" in equation.condition) == (factor == 2)


def at_small_angles(form: Any) -> Any:
    """Its leading part, sin θ as θ and cos θ as 1."""
    waves = {paper.theta(j).q: wave for j in paper.upto(4) for wave in paper.waves(j)}
    return form.subs({sp.sin(q): q for q in waves} | {sp.cos(q): 1 for q in waves})


@pytest.mark.parametrize("i", usually([2], [1, 2, 3]))
def test_when_the_printed_accelerations_hold(i: int) -> None:
    """Equal links in one turning plane, all θ' = r θ: φ'' = −2 r φ' in both forms; for one different θ' in neither."""
    n, r, spin = 3, sp.Symbol("r"), sp.Symbol("w")
    (l, m), links, equation = sp.symbols("l m"), paper.upto(3), paper.azimuth_acceleration(i, 3, has_dots=True)
    together = {paper.phi(j).q: 0 for j in links} | {paper.phi(j).v: spin for j in links}
    together |= {symbol(j): same for j in links for symbol, same in ((paper.length, l), (paper.mass, m))}
    momenta = {f"c_{j}": at_small_angles(paper.momentum(j, n).corrected.rhs).subs(together) / l for j in links}
    growing = {paper.theta(j).v: r * paper.theta(j).q for j in links}
    turning = together | growing | {paper.phi(j).a: -2 * r * spin for j in links}
    printed = equation.printed.rhs.subs(momenta).subs({"l_1": l, "m_1": m})
    assert sp.cancel(printed.subs(growing)) == -2 * r * spin
    assert sp.cancel(at_small_angles(equation.corrected.rhs).subs(turning)) == -2 * r * spin
    off = growing | {paper.theta(2).v: 0}
    assert sp.cancel(printed.subs(off)) != sp.cancel(at_small_angles(equation.corrected.rhs).subs(turning | off))


def test_the_copy_s_exponents_are_told() -> None:
    for i, blurred in ((1, "s and N"), (2, "illegible"), (3, "exponent 5")):
        assert blurred in paper.azimuth_acceleration(i, 3).note


@pytest.mark.parametrize(("read", "power"), [(False, 1), (True, 2)])
def test_dimensions_of_the_printed_accelerations(read: bool, power: int) -> None:
    """Time twice as fast: φ'' must grow by 4, as printed it grows with c alone by 2."""
    rates = {paper.theta(i).v: 2 * paper.theta(i).v for i in (1, 2, 3)} | {
        sp.Symbol(f"c_{i}"): 2 * sp.Symbol(f"c_{i}") for i in (1, 2, 3)
    }
    for i in (1, 2, 3):
        form = paper.azimuth_acceleration(i, 3, has_dots=read).printed.rhs
        assert sp.expand(form.subs(rates, simultaneous=True) - 2**power * form) == 0


def test_one_link() -> None:
    """φ'' = −2 θ'φ' cot θ = −2 p θ' cos θ/(m l² sin³ θ), from T alone; the printed one only as θ → 0."""
    theta, phi = paper.theta(1), paper.phi(1)
    T, V = true_energies(1)
    row, equation = (
        lagrange_equations(T - V, paper.coordinates(1))[1],
        paper.azimuth_acceleration(1, 1, has_dots=True),
    )
    assert value(row.subs(phi.a, equation.corrected.rhs), state_of(1, 0)) == 0 != value(row, state_of(1, 0))
    m, l, c = paper.mass(1), paper.length(1), sp.Symbol("c_1")
    spin = {phi.v: c * l / (m * l**2 * sp.sin(theta.q) ** 2)}
    in_c = equation.corrected.rhs.subs(spin)
    known = -2 * c * l * theta.v * sp.cos(theta.q) / (m * l**2 * sp.sin(theta.q) ** 3)
    assert sp.powsimp(sp.expand(in_c - known)) == 0
    assert sp.limit(equation.printed.rhs / in_c, theta.q, 0) == 1
    assert abs((equation.printed.rhs / in_c).subs(theta.q, 1.0) - 1) > 0.05


def test_angles_are_singular_at_rest_and_unit_vectors_are_not() -> None:
    theta, state = paper.theta(1), {paper.theta(1).q: 0, paper.phi(1).q: 0}
    for form in ("printed", "corrected"):
        equation = getattr(paper.azimuth_acceleration(1, 1, has_dots=True), form)
        assert equation.rhs.subs(state).has(sp.zoo)
    assert list(vector_equation(1, 1).subs(state)) == [
        -2 * paper.length(1) ** 2 * paper.mass(1) * theta.v * paper.phi(1).v,
        paper.length(1) ** 2 * paper.mass(1) * theta.a,
        0,
    ]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_unit_vectors_move_as_the_angles_do(n: int) -> None:
    state = moving_state(n, 2)
    off = state | {paper.theta(1).a: state[paper.theta(1).a] + 1}
    for i in paper.upto(n):
        rows = list(vector_equation(i, n))
        assert [value(row, state) for row in rows] == [0, 0, 0]
        assert any(value(row, off) != 0 for row in rows)


def test_restored_dots_are_told() -> None:
    """The copy of (4) has θ_i θ_j and φ_i without dots in its cross terms; here they have them."""
    for equation in (paper.cross_term(1, 2), paper.squared_speed(2)):
        assert "without dots, restored" in equation.note
    assert paper.cross_term(1, 2).printed.rhs.has(paper.theta(1).v, paper.theta(2).v)
    assert paper.cross_term(1, 2).printed.rhs.has(paper.phi(1).v)
