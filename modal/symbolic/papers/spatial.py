"""Paper 002, "Spatial Motion of Multi-Pendula Systems", section 2: positions and energies of bobs in space.

With θ from the vertical, φ the azimuth, Δ = φ_i − φ_j and u_i = (sin θ_i cos φ_i, sin θ_i sin φ_i, cos θ_i), z down,

    r_k'² = Σ_{i,j≤k} l_i l_j u_i'·u_j',      T = ½ Σ A_ij u_i'·u_j',      V = Σ_k m_k g Σ_{i≤k} l_i (1 − cos θ_i)
    u_i'·u_j' = θ_i'θ_j' (cos θ_i cos θ_j cos Δ + sin θ_i sin θ_j) + φ_i'φ_j' sin θ_i sin θ_j cos Δ
                + (θ_i'φ_j' cos θ_i sin θ_j − φ_i'θ_j' sin θ_i cos θ_j) sin Δ.

The paper has θ_i'θ_j' cos(θ_i − θ_j) + φ_i'φ_j' sin θ_i sin θ_j instead, which differs by `cross_error`: the two agree
for all rates where Δ = 0, that is when the links share one vertical plane (measured by one azimuth, so θ is signed).
Where the copy of the paper drops dots, they are restored from (5), except in the first term of (4); notes say so.
The azimuth equations (8)-(15) are `modal.symbolic.papers.spatial_azimuth`.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.pair import inertia_matrix
from modal.symbolic import Coordinate, coordinate
from modal.symbolic.papers import Equation, correct, equal

PAPER = "002"
g = sp.Symbol("g")
NEVER = "never as a whole", sp.false
DOTS = "the copy has θ_i θ_j and φ_i in the cross terms without dots, restored here as in (5)"


def theta(i: int) -> Coordinate:
    """θ_i from the downward vertical."""
    return coordinate("theta", i)


def phi(i: int) -> Coordinate:
    """φ_i about the vertical."""
    return coordinate("phi", i)


def mass(k: int) -> Any:
    """m_k."""
    return sp.Symbol(f"m_{k}")


def length(i: int) -> Any:
    """l_i."""
    return sp.Symbol(f"l_{i}")


def coordinates(n: int) -> list[Coordinate]:
    """θ_1 ... θ_n, then φ_1 ... φ_n."""
    return [angle(i) for angle in (theta, phi) for i in upto(n)]


def upto(n: int) -> range:
    """1 ... n."""
    return range(1, n + 1)


def inertia(i: int, j: int, n: int) -> Any:
    """A_ij = l_i l_j Σ_{k≥max(i,j)} m_k; n (n + 1)/2 of them are distinct, as the paper says."""
    lengths = [length(k) for k in upto(n)]
    return inertia_matrix([mass(k) for k in upto(n)], lengths, lengths, [0] * n)[i - 1][j - 1]


def waves(i: int) -> tuple[Any, Any]:
    """The pair sin θ_i, cos θ_i."""
    return sp.sin(theta(i).q), sp.cos(theta(i).q)


def direction(i: int) -> Any:
    """u_i (3, 1), the unit vector down link i, with z down."""
    (s, c), at = waves(i), phi(i).q
    return sp.Matrix([s * sp.cos(at), s * sp.sin(at), c])


def velocity(k: int) -> list[Equation]:
    """(1)-(3) x_k', y_k' and z_k' of bob k: correct."""
    parts = [[sp.Integer(0)] for _ in range(3)]
    for i in upto(k):
        (s, c), turn, spin, at = waves(i), theta(i).v, phi(i).v, phi(i).q
        parts[0].append(length(i) * (turn * c * sp.cos(at) - spin * s * sp.sin(at)))
        parts[1].append(length(i) * (turn * c * sp.sin(at) + spin * s * sp.cos(at)))
        parts[2].append(-length(i) * turn * s)
    axes = zip("123", "xyz", parts, strict=True)
    return [
        correct(PAPER, number, f"{axis} velocity of bob {k}", equal(coordinate(axis, k).v, sp.Add(*part)))
        for number, axis, part in axes
    ]


def printed_product(i: int, j: int) -> Any:
    """The paper's u_i'·u_j' = θ_i'θ_j' cos(θ_i − θ_j) + φ_i'φ_j' sin θ_i sin θ_j."""
    plane = theta(i).v * theta(j).v * sp.cos(theta(i).q - theta(j).q)
    return plane + phi(i).v * phi(j).v * waves(i)[0] * waves(j)[0]


def product(i: int, j: int) -> Any:
    """u_i'·u_j', exactly."""
    (si, ci), (sj, cj) = waves(i), waves(j)
    delta = phi(i).q - phi(j).q
    a, b, spin_a, spin_b = theta(i).v, theta(j).v, phi(i).v, phi(j).v
    aligned_part = a * b * (ci * cj * sp.cos(delta) + si * sj) + spin_a * spin_b * si * sj * sp.cos(delta)
    return aligned_part + (a * spin_b * ci * sj - spin_a * b * si * cj) * sp.sin(delta)


def cross_error(i: int, j: int) -> Any:
    """Exact minus printed u_i'·u_j' = 2 sin ½Δ [cos ½Δ (a_i b_j − b_i a_j) − sin ½Δ (a_i a_j + b_i b_j)].

    a = θ' cos θ and b = φ' sin θ are the horizontal velocity along and across the link's own vertical plane.
    """
    half = (phi(i).q - phi(j).q) / 2
    (ai, bi), (aj, bj) = ((theta(k).v * waves(k)[1], phi(k).v * waves(k)[0]) for k in (i, j))
    bracket = sp.cos(half) * (ai * bj - bi * aj) - sp.sin(half) * (ai * aj + bi * bj)
    return 2 * sp.sin(half) * bracket


def cross_term(i: int, j: int) -> Equation:
    """(4) The product of two links' directions, as printed for every azimuth and corrected."""
    return Equation(
        PAPER,
        "4",
        f"cross term of links {i} and {j}",
        equal(sp.Symbol(f"c_{i}_{j}"), printed_product(i, j)),
        equal(sp.Symbol(f"c_{i}_{j}"), product(i, j)),
        "for all rates where phi_i = phi_j (mod 2π); at one state, where `cross_error` vanishes",
        sp.Eq(cross_error(i, j), 0),
        f"{DOTS}; the one other place: one link level, the other vertical, Δ = π, its azimuth arbitrary anyway",
    )


def square_term(i: int) -> Equation:
    """(4) The square of one direction's rate: a dot is missing."""
    s, name = waves(i)[0], sp.Symbol(f"c_{i}_{i}")
    printed_form, corrected_form = (first**2 + phi(i).v ** 2 * s**2 for first in (theta(i).q, theta(i).v))
    words = "where θ'² = θ² in the units used"
    holds = sp.Eq(theta(i).q ** 2, theta(i).v ** 2)
    return Equation(
        PAPER, "4", f"square term of link {i}", equal(name, printed_form), equal(name, corrected_form), words, holds
    )


def pairs(k: int) -> list[tuple[int, int]]:
    """All ordered pairs i ≠ j up to k: a sum over them counts every product twice."""
    return [(i, j) for i in upto(k) for j in upto(k) if i != j]


def squared_speed(k: int) -> Equation:
    """(4) r_k'², where 2 Σ_{i≠j} counts every product of two links twice."""
    name = coordinate("r", k).v ** 2
    terms = [square_term(i) for i in upto(k)]
    squares = sp.Add(*(length(i) ** 2 * term.printed.rhs for i, term in enumerate(terms, 1)))
    exact = sp.Add(*(length(i) ** 2 * term.corrected.rhs for i, term in enumerate(terms, 1)))
    printed_form = squares + 2 * sp.Add(*(length(i) * length(j) * printed_product(i, j) for i, j in pairs(k)))
    corrected_form = exact + sp.Add(*(length(i) * length(j) * product(i, j) for i, j in pairs(k)))
    note = f"the cross terms, a missing dot, a sum to e for k, and a double sum without ½; {DOTS}"
    return Equation(
        PAPER, "4", f"squared speed of bob {k}", equal(name, printed_form), equal(name, corrected_form), *NEVER, note
    )


def kinetic_energy(n: int) -> Equation:
    """(5) T; the printed one moves every bob with every link, turns with φ'² alone and counts products twice."""
    square = sp.Add(*(length(i) ** 2 * (theta(i).v ** 2 + phi(i).v ** 2) / 2 for i in upto(n)))
    cross = sp.Add(*(length(i) * length(j) * printed_product(i, j) for i, j in pairs(n)))
    printed_form = sp.Add(*(mass(k) * (square + cross) for k in upto(n)))
    corrected_form = sp.Add(*(mass(k) * squared_speed(k).corrected.rhs / 2 for k in upto(n)))
    name, note = sp.Symbol("T"), "inner sums end at k; φ'² lacks sin² θ; a sum over i ≠ j needs ½"
    return Equation(PAPER, "5", "kinetic energy", equal(name, printed_form), equal(name, corrected_form), *NEVER, note)


def potential_energy(n: int) -> Equation:
    """(6) V; the printed one lacks g and hangs every bob from every link."""
    rise = [length(i) * (1 - sp.cos(theta(i).q)) for i in upto(n)]
    printed_form = sp.Add(*(mass(k) * sum(rise) for k in upto(n)))
    corrected_form = sp.Add(*(mass(k) * g * sum(rise[:k]) for k in upto(n)))
    name, words, holds = sp.Symbol("V"), "for one link, in units where g = 1", sp.And(sp.Eq(n, 1), sp.Eq(g, 1))
    return Equation(
        PAPER, "6", "potential energy", equal(name, printed_form), equal(name, corrected_form), words, holds
    )


def lagrangian(n: int) -> Equation:
    """(7) L, where k runs from f(i, j) = max(i, j), g is back and sin² θ is back: the cross terms remain wrong."""
    squares = sp.Add(*(inertia(i, i, n) * product(i, i) / 2 for i in upto(n)))
    printed_form = squares + sp.Add(*(inertia(i, j, n) * printed_product(i, j) for i, j in pairs(n)))
    corrected_form = kinetic_energy(n).corrected.rhs - potential_energy(n).corrected.rhs
    return Equation(
        PAPER,
        "7",
        "Lagrangian",
        equal(sp.Symbol("L"), printed_form - g * potential_energy(n).printed.rhs),
        equal(sp.Symbol("L"), corrected_form),
        "for one link",
        sp.Eq(n, 1),
        "l_i²/2 is illegible in the copy; the double sum needs ½ and the last sum ends at k",
    )
