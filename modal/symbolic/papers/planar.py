"""Paper 001, "Equations of Motion for Multiple-Pendula System": bobs on massless links in a vertical plane.

Its equations (1)-(16) are right; what it does not specify is given here, for any number n of links:

    θ_i'' = (g/l_i) [μ_{i−1} θ_{i−1}/m_{i−1} − (1/m_{i−1} + 1/m_i) μ_i θ_i + μ_{i+1} θ_{i+1}/m_i],  μ_i = Σ_{k≥i} m_k
    p_n(λ) = det(A + λ K̂) = Σ_k C(n, k) (n!/k!) λ^{n−k},   A_ij = n + 1 − max(i, j),   K̂ = diag(n, ..., 1)

with **λ = −g/(l ω²)**, which the paper does not say: p_n is the reversed Laguerre polynomial, and the zeros of L_n are
ω² l/g.  (6)-(16) are the equations of small angles.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.pair import first_moments, inertia_matrix, proportions
from modal.symbolic import Coordinate, coordinate, lagrange_equations
from modal.symbolic.papers import Equation, correct, equal

PAPER = "001"
SMALL = "at small angles"
g, l, omega, lamda = sp.symbols("g l omega lambda")
LAMBDA = equal(lamda, -g / (l * omega**2))


def angles(n: int) -> list[Coordinate]:
    """θ_1 ... θ_n with their rates, from the vertical."""
    return [coordinate("theta", i) for i in range(1, n + 1)]


def masses_and_lengths(n: int) -> tuple[list[Any], list[Any]]:
    """m_1 ... m_n and l_1 ... l_n."""
    return [sp.Symbol(f"m_{i}") for i in range(1, n + 1)], [sp.Symbol(f"l_{i}") for i in range(1, n + 1)]


def kinetic_energy(n: int = 3) -> Equation:
    """(3) T with every square and product of the Cartesian velocities, expanded as in the paper."""
    m, _ = masses_and_lengths(n)
    T = sp.Add(*(m[k] * (_square(k + 1, sp.sin) + _square(k + 1, sp.cos)) / 2 for k in range(n)))
    return correct(PAPER, "3", "kinetic energy", equal(sp.Symbol("T"), T), is_continuation=n != 3)


def _square(k: int, f: Any) -> Any:
    """(Σ_{i≤k} l_i θ_i' f(θ_i))², multiplied out."""
    terms = [length * theta.v * f(theta.q) for length, theta in zip(masses_and_lengths(k)[1], angles(k), strict=True)]
    return sp.Add(*(term**2 for term in terms), *(2 * a * b for i, a in enumerate(terms) for b in terms[i + 1 :]))


def potential_energy(n: int = 3) -> Equation:
    """(4) V = Σ_k m_k g {Σ_i l_i − Σ_{i≤k} l_i cos θ_i}, from the lowest point of the whole chain."""
    m, lengths = masses_and_lengths(n)
    fall = [length * sp.cos(theta.q) for length, theta in zip(lengths, angles(n), strict=True)]
    V = sp.Add(*(m[k] * g * (sum(lengths) - sum(fall[: k + 1])) for k in range(n)))
    return correct(PAPER, "4", "potential energy", equal(sp.Symbol("V"), V), is_continuation=n != 3)


def lagrangian(n: int = 3) -> Equation:
    """(5) L = T − V with cos(θ_i − θ_j) for the two products of every pair."""
    (m, lengths), theta = masses_and_lengths(n), angles(n)
    speeds = [length * angle.v for length, angle in zip(lengths, theta, strict=True)]
    T = sp.Integer(0)
    for k in range(n):
        pairs = [(i, j) for j in range(k + 1) for i in range(j)]
        cross = sum(2 * speeds[i] * speeds[j] * sp.cos(theta[i].q - theta[j].q) for i, j in pairs)
        T += m[k] * (sum(speed**2 for speed in speeds[: k + 1]) + cross) / 2
    L = equal(sp.Symbol("L"), T - potential_energy(n).corrected.rhs)
    return correct(PAPER, "5", "Lagrangian", L, is_continuation=n != 3)


def forced_equation(i: int, n: int = 3) -> Equation:
    """(1) d/dt (∂L/∂q_i') − ∂L/∂q_i = Φ_i, a generalized force, written out for θ_i."""
    form = lagrange_equations(lagrangian(n).corrected.rhs, angles(n))[i - 1]
    title = f"d/dt (∂L/∂q') − ∂L/∂q = Φ, for q = theta_{i}"
    return correct(PAPER, "1", title, equal(form, sp.Symbol(f"Phi_{i}")))


def lagrange_equation(i: int, n: int = 3) -> Equation:
    """(2) The same without a force, exact at any angle."""
    form = lagrange_equations(lagrangian(n).corrected.rhs, angles(n))[i - 1]
    return correct(PAPER, "2", f"Lagrange's equation of theta_{i}", equal(form, 0))


def momentum(i: int, n: int = 3) -> Equation:
    """The words below (1) call q_i' the momentum: it is the velocity, the momentum is ∂L/∂q_i'."""
    p, theta = sp.Symbol(f"p_{i}"), angles(n)[i - 1]
    derivative = sp.diff(lagrangian(n).corrected.rhs, theta.v)
    words = "for q' a momentum only where ∂L/∂q' = q'"
    return Equation(
        PAPER, "words below 1", "momentum", equal(p, theta.v), equal(p, derivative), words, sp.Eq(derivative, theta.v)
    )


def accelerations(n: int = 3) -> list[Equation]:
    """(6)-(8) of three unequal links, and the same for any n: each bob is coupled only to its neighbours."""
    rows, theta, is_in_paper = (_three() if n == 3 else [_acceleration(i, n) for i in range(n)]), angles(n), n == 3
    numbers = ["6", "7", "8"] if is_in_paper else [f"6-8, n = {n}"] * n
    return [
        correct(
            PAPER, number, f"acceleration of theta_{i}", equal(angle.a, row), SMALL, is_continuation=not is_in_paper
        )
        for i, (number, angle, row) in enumerate(zip(numbers, theta, rows, strict=True), 1)
    ]


def _three() -> list[Any]:
    """Right sides of (6), (7) and (8), as printed."""
    (m1, m2, m3), (l1, l2, l3) = masses_and_lengths(3)
    t1, t2, t3 = (theta.q for theta in angles(3))
    middle = m2 / m1 * (m1 + m2 + m3) * t1 - (m1 + m2) * (m2 + m3) / m1 * t2 + m3 * t3
    return [
        1 / (m1 * l1) * ((m2 + m3) * t2 - (m1 + m2 + m3) * t1) * g,
        1 / (m2 * l2) * middle * g,
        1 / (m2 * l3) * ((m2 + m3) * (t2 - t3)) * g,
    ]


def _acceleration(i: int, n: int) -> Any:
    """θ_i'' (i from 0): the pull along the link above through 1/m_{i−1}, along its own and the next through 1/m_i."""
    (m, lengths), theta = masses_and_lengths(n), [angle.q for angle in angles(n)]
    pull = [sum(m[k:]) * theta[k] for k in range(n)]
    upper_pull = (pull[i - 1] - pull[i]) / m[i - 1] if i else 0
    beneath = (pull[i + 1] - pull[i] if i + 1 < n else -pull[i]) / m[i]
    return g / lengths[i] * (upper_pull + beneath)


def equal_accelerations() -> list[Equation]:
    """(9)-(11): three equal masses and lengths."""
    theta = angles(3)
    t1, t2, t3 = (angle.q for angle in theta)
    rows = [(2 * t2 - 3 * t1) * g / l, (3 * t1 - 4 * t2 + t3) * g / l, 2 * (t2 - t3) * g / l]
    return [
        correct(PAPER, str(9 + i), f"theta_{i + 1}, equal links", equal(theta[i].a, row), SMALL)
        for i, row in enumerate(rows)
    ]


def equal_matrices(n: int) -> tuple[Any, Any]:
    """A_ij = n + 1 − max(i, j) and K̂ = diag(n, ..., 1): A θ'' = −(g/l) K̂ θ; (15) is n = 4, (16) is n = 5."""
    return sp.Matrix(n, n, lambda i, j: n - max(i, j)), sp.diag(*range(n, 0, -1))


def equal_motion(n: int) -> list[Equation]:
    """(15) and (16): the n equations of n equal masses and lengths before they are solved for θ''."""
    A, K = equal_matrices(n)
    theta = angles(n)
    number = {4: "15", 5: "16"}.get(n, f"15-16, n = {n}")
    inertial, elastic = A * sp.Matrix([angle.a for angle in theta]), K * sp.Matrix([angle.q for angle in theta])
    rows = [equal(a, -b * g / l) for a, b in zip(inertial, elastic, strict=True)]
    return [
        correct(PAPER, number, f"row {i}", row, SMALL, is_continuation=n not in (4, 5)) for i, row in enumerate(rows, 1)
    ]


def polynomial(n: int) -> Any:
    """p_n(λ) = Σ_k C(n, k) (n!/k!) λ^{n−k} for n equal links.

    >>> polynomial(4)
    24*lambda**4 + 96*lambda**3 + 72*lambda**2 + 16*lambda + 1
    """
    return sp.Add(*(sp.binomial(n, k) * sp.ff(n, n - k) * lamda ** (n - k) for k in range(n + 1)))


def eigen_equation(n: int) -> Equation:
    """(12)-(14) for n = 1, 2, 3, and p_n = 0 beyond: right for λ = −g/(l ω²), which the paper does not specify."""
    printed_forms = {1: lamda + 1, 2: 2 * lamda**2 + 4 * lamda + 1, 3: 6 * lamda**3 + 18 * lamda**2 + 9 * lamda + 1}
    number, words = {1: "12", 2: "13", 3: "14"}.get(n, f"12-14, n = {n}"), "for λ = −g/(l ω²), not for λ = −ω² l/g"
    form, title = equal(printed_forms.get(n, polynomial(n)), 0), f"eigenvalues of {n} equal links"
    return correct(PAPER, number, title, form, words, is_continuation=n not in printed_forms, holds_when=LAMBDA)


def pull_matrix(n: int, kind: str = "bob") -> Any:
    """A⁻¹ diag(b) of n equal links, θ'' = −g A⁻¹ diag(b) θ: tridiagonal for a `bob`, full for a `rod`."""
    centre, inertia = proportions(kind, sp.Integer(1), l)
    geometry = [sp.Integer(1)] * n, [l] * n, [centre] * n
    A = sp.Matrix(inertia_matrix(*geometry, [inertia] * n))
    return A.inv() * sp.diag(*first_moments(*geometry))


def nearest_neighbours(i: int, j: int, n: int = 3) -> Equation:
    """The "only the nearest neighbours" of the discussion: ∂θ_i''/∂θ_j = 0 beyond, true of bobs, false of rods."""
    pull = sp.Derivative(angles(n)[i - 1].a, angles(n)[j - 1].q)
    return Equation(
        PAPER,
        "discussion",
        f"the pull of link {j} on link {i} of {n}",
        equal(pull, sp.Integer(0)),
        equal(pull, -g * pull_matrix(n, "rod")[i - 1, j - 1]),
        "for bobs on massless links, at small angles; corrected for equal uniform rods",
        sp.false,
        "at finite angles the accelerations of bobs depend on every link, too",
    )
