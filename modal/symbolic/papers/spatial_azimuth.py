"""Paper 002, equations (8)-(15): the azimuths, and what is conserved.

With p_i = ∂L/∂φ_i' and Δ = φ_i − φ_j, Lagrange's equation p_i' = ∂L/∂φ_i of bobs on massless links reads

    Σ_j A_ij [(sin θ_j φ_j'' + 2 cos θ_j θ_j'φ_j') cos Δ − (cos θ_j θ_j'' − sin θ_j (θ_j'² + φ_j'²)) sin Δ] = 0.

The paper's L lost Δ, so (11) has every p_i conserved, and (12)-(15) integrate that.  Only their sum is conserved, the
angular momentum about the vertical Σ A_ij (u_i × u_j')·e_z: neighbours exchange it.  Since these angles are
singular at the hanging equilibrium, use unit vectors for a chain: u_i × (Σ_j A_ij u_j'' − g b_i e_z) = 0.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.symbolic import time_derivative
from modal.symbolic.papers import Equation, equal
from modal.symbolic.papers.spatial import (
    PAPER,
    coordinates,
    direction,
    g,
    inertia,
    length,
    mass,
    phi,
    theta,
    upto,
    waves,
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
    return Equation(
        PAPER,
        "11",
        "conservation of each azimuth momentum",
        equal(name, sp.Integer(0)),
        equal(name, torque),
        words,
        sp.Eq(torque, 0),
        "the sum over i vanishes; with a cart not even that, for the rail breaks the symmetry",
    )


def total_momentum(n: int) -> Any:
    """Σ_i ∂L/∂φ_i' = Σ A_ij (u_i × u_j')·e_z, which is conserved on a fixed support."""
    return sp.Add(*(momentum(i, n).corrected.rhs for i in upto(n)))


def vector_equation(i: int, n: int) -> Any:
    """u_i × (Σ_j A_ij u_j'' − g b_i e_z) (3, 1), which vanishes in motion and is regular at every angle."""
    moving, pull = coordinates(n), sp.Matrix([0, 0, -g * inertia(i, i, n) / length(i)])
    for j in upto(n):
        pull += inertia(i, j, n) * direction(j).applyfunc(
            lambda part: time_derivative(time_derivative(part, moving), moving)
        )
    return direction(i).cross(pull)


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
