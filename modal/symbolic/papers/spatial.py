"""Paper 002, "Spatial Motion of Multi-Pendula Systems", section 2: bobs in space, their azimuths, what is conserved.

With θ from the vertical, φ the azimuth, Δ = φ_i − φ_j and u_i = (sin θ_i cos φ_i, sin θ_i sin φ_i, cos θ_i), z down,

    r_k'² = Σ_{i,j≤k} l_i l_j u_i'·u_j',      T = ½ Σ A_ij u_i'·u_j',      V = Σ_k m_k g Σ_{i≤k} l_i (1 − cos θ_i)
    u_i'·u_j' = θ_i'θ_j' (cos θ_i cos θ_j cos Δ + sin θ_i sin θ_j) + φ_i'φ_j' sin θ_i sin θ_j cos Δ
                + (θ_i'φ_j' cos θ_i sin θ_j − φ_i'θ_j' sin θ_i cos θ_j) sin Δ.

The paper has θ_i'θ_j' cos(θ_i − θ_j) + φ_i'φ_j' sin θ_i sin θ_j instead, which differs by `cross_error`: the two agree
for all rates where Δ = 0, that is when the links share one vertical plane (measured by one azimuth, so θ is signed).
Where the copy of the paper drops dots, they are restored from (5), except in the first term of (4); notes say so.

Equations (8)-(15) are those of the azimuths.  With p_i = ∂L/∂φ_i' and Δ = φ_i − φ_j, Lagrange's equation p_i' =
∂L/∂φ_i of bobs on massless links reads

    Σ_j A_ij [(sin θ_j φ_j'' + 2 cos θ_j θ_j'φ_j') cos Δ − (cos θ_j θ_j'' − sin θ_j (θ_j'² + φ_j'²)) sin Δ] = 0.

The paper's L lost Δ, so (11) has every p_i conserved, and (12)-(15) integrate that.  Only their sum is conserved, the
angular momentum about the vertical Σ A_ij (u_i × u_j')·e_z: neighbours exchange it.  Since these angles are
singular at the hanging equilibrium, use unit vectors for a chain: u_i × (Σ_j A_ij u_j'' − g b_i e_z) = 0.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.pair import inertia_matrix
from modal.symbolic import Coordinate, coordinate, time_derivative
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


def others(i: int, n: int) -> list[int]:
    """1 ... n without i; the paper's sums over j are read this way, as in its (7)."""
    return [j for j in upto(n) if j != i]


def difference(i: int, j: int) -> Any:
    """Δ = φ_i − φ_j."""
    return phi(i).q - phi(j).q


def momentum(i: int, n: int) -> Equation:
    """(8) p_i = ∂L/∂φ_i'."""
    si = waves(i)[0]
    printed_form = sp.Add(*(inertia(i, j, n) * phi(j).v * si * waves(j)[0] for j in upto(n)))
    corrected_form = sp.Integer(0)
    for j in upto(n):
        (sj, cj), delta = waves(j), difference(i, j)
        corrected_form += inertia(i, j, n) * si * (phi(j).v * sj * sp.cos(delta) - theta(j).v * cj * sp.sin(delta))
    name, words, holds = sp.Symbol(f"p_{i}"), "where all azimuths are equal", _one_plane(n)
    return Equation(
        PAPER, "8", "azimuth momentum", equal(name, printed_form), equal(name, corrected_form), words, holds
    )


def _one_plane(n: int, *, staying: bool = False) -> Any:
    """φ_1 = ... = φ_n, and the same of the rates where `staying`."""
    planes = [sp.Eq(phi(j).q, phi(1).q) for j in upto(n)[1:]]
    turns = [sp.Eq(phi(j).v, phi(1).v) for j in upto(n)[1:]] if staying else []
    return sp.And(*planes, *turns)


def momentum_rate(i: int, n: int) -> Equation:
    """(9) dp_i/dt; the printed sums run from k = 1, those of (8) and (10) from k = i and k = max(i, j)."""
    moving = coordinates(n)
    total = sp.Add(*(mass(k) for k in upto(n)))
    single_term = length(i) ** 2 * time_derivative(phi(i).v * waves(i)[0] ** 2, moving)
    cross = [length(j) * time_derivative(phi(j).v * waves(i)[0] * waves(j)[0], moving) for j in others(i, n)]
    printed_form = total * (single_term + length(i) * sp.Add(*cross))
    corrected_form = time_derivative(momentum(i, n).corrected.rhs, moving)
    name, words = sp.Symbol(f"pdot_{i}"), "for one link"
    form = equal(name, printed_form), equal(name, corrected_form)
    return Equation(
        PAPER, "9", "rate of the azimuth momentum", *form, words, sp.Eq(n, 1), "reads φ'' where φ is printed"
    )


def small_momentum_rate(i: int, n: int) -> Equation:
    """(10) dp_i/dt at small zenith angles."""
    moving = coordinates(n)
    printed_form, corrected_form = sp.Integer(0), sp.Integer(0)
    for j in upto(n):
        (ti, tj), delta = (theta(i).q, theta(j).q), difference(i, j)
        printed_form += inertia(i, j, n) * phi(j).v * ti * tj
        corrected_form += inertia(i, j, n) * ti * (phi(j).v * tj * sp.cos(delta) - theta(j).v * sp.sin(delta))
    name = sp.Symbol(f"pdot_{i}")
    rates = equal(name, time_derivative(printed_form, moving)), equal(name, time_derivative(corrected_form, moving))
    words, holds = "while all azimuths are and stay equal, at small zenith angles", _one_plane(n, staying=True)
    return Equation(PAPER, "10", "rate at small angles", *rates, words, holds)


def conservation(i: int, n: int) -> Equation:
    """(11) ∂L/∂φ_i: zero for a single link, and for a chain only when summed over i."""
    torque = sp.Integer(0)
    for j in others(i, n):
        (si, ci), (sj, cj), delta = waves(i), waves(j), difference(i, j)
        a, b, spin_a, spin_b = theta(i).v, theta(j).v, phi(i).v, phi(j).v
        cross_rate = sp.cos(delta) * (a * spin_b * ci * sj - spin_a * b * si * cj)
        torque += inertia(i, j, n) * (cross_rate - sp.sin(delta) * (a * b * ci * cj + spin_a * spin_b * si * sj))
    name = sp.Derivative(sp.Symbol("L"), phi(i).q)
    words = "for one link; for links in one vertical plane while it does not turn, or sin θ_i/sin θ_j is constant"
    forms = equal(name, sp.Integer(0)), equal(name, torque)
    note = "the sum over i vanishes; with a cart not even that, for the rail breaks the symmetry"
    title = "conservation of each azimuth momentum"
    return Equation(PAPER, "11", title, *forms, words, sp.Eq(torque, 0), note)


def azimuth_acceleration(i: int, n: int, *, has_dots: bool = False) -> Equation:
    """(12)-(15) φ_i'': the first, an inner and the last link.

    The copy drops dots and blurs exponents; `has_dots` restores them as they make sense.  With c_j = p_j/l_j for equal
    links it is then the rate of the φ' that (8) gives at small angles and constant p_j.
    """
    s, c = waves(i)
    push = sp.Add(*(inertia(i, j, n) * _swing(i, j) for j in others(i, n)))
    corrected_form = -2 * theta(i).v * phi(i).v * c / s - push / (inertia(i, i, n) * s)
    number, single, copy = _PRINTED["first" if i == 1 else "last" if i == n else "inner"]
    ends = sp.Symbol("l_1") * sp.Symbol("m_1") if i == 1 else sp.Symbol("l") * sp.Symbol("m")
    return Equation(
        PAPER,
        number,
        f"azimuth of link {i} of {n}",
        equal(phi(i).a, _constant_momenta(i, n, has_dots=has_dots) / ends),
        equal(phi(i).a, corrected_form),
        f"never with the letters as they are; with θ' read into the numerators, {single} for equal links while all "
        "azimuths are equal, their rates are equal, and so are all θ_i'/θ_i, in the limit of small angles",
        sp.false,
        f"{copy}; dimensionally wrong without its dots; both forms are singular at θ = 0, the rest itself: use unit "
        "vectors",
    )


_ONE_LINK = "not for one link (−4 c θ'/θ³ for −2 c θ'/θ³), but"
_PRINTED = {
    "first": ("12-13", "for one link, and", "the copy's exponents s and N are read as 3 and 2, its e_1 as c_1"),
    "inner": ("14", _ONE_LINK, "the copy's exponent of θ_i under −4 c_i is illegible and read as 3"),
    "last": (
        "15",
        f"and θ_n for θ_n² in its first term, {_ONE_LINK}",
        "the copy's exponent 5 of θ_n is read as 3",
    ),
}
"""The number of (12)-(15) by the place of the link, how it does for one link, and what the copy blurs."""


def _swing(i: int, j: int) -> Any:
    """u_j''·e_φi, the acceleration of one direction along another's azimuth."""
    (s, c), delta, turn, spin = waves(j), difference(i, j), theta(j), phi(j)
    transverse, outward = s * spin.a + 2 * c * turn.v * spin.v, c * turn.a - s * (turn.v**2 + spin.v**2)
    return transverse * sp.cos(delta) - outward * sp.sin(delta)


def _constant_momenta(i: int, n: int, *, has_dots: bool) -> Any:
    """The braces of (12)-(15), with the exponents s, N and 5 of the copy as 3, 2 and 3."""
    ti, c = theta(i).q, [sp.Symbol(f"c_{j}") for j in range(n + 1)]
    single_term = -(2 if i == 1 else 4) * c[i] * (theta(i).v if has_dots else 1) / ti**3
    power = 2 if i == n and not has_dots else 1  # (15) has θ_n² where (14) has θ_n
    pairs = []
    for j in {i - 1, i + 1} & set(upto(n)):
        tj, (rate_i, rate_j) = theta(j).q, ((theta(k).v if has_dots else theta(k).q) for k in (i, j))
        pairs.append(c[j] * (rate_j / (tj**2 * ti**power) + rate_i / (tj * ti**2)))
    return sp.Add(single_term, *pairs)
