"""Hamilton's equations of a system in symbols, paper 002's closing question: n masses, in the plane and in space.

    H(q, p) = ½ pᵀ M(q)⁻¹ p + V(q)        q' = ∂H/∂p        p' = −∂H/∂q − ∂R/∂q'

M(q) changes with the motion and its inverse is full.  Only the numbers M, b, A of the pair are constant.  With
v_i = θ_i' n_i the rate of the direction u_i (v_0 = x' e_x), let P_i = Σ_j N_ij v_j, N = [[M, bᵀ], [b, A]]: along n_i it
has the momentum p_i, along u_i some s_i, which follows from u_i·v_i = 0.  With the constant W = N⁻¹

    H = ½ Σ W_ij P_i·P_j + V        v_i = Σ_j W_ij P_j        0 = u_i·Σ_j W_ij P_j        P_i = p_i n_i + s_i u_i
    p_i' = −s_i θ_i' − g b_i sin θ_i + joints                                    (in the plane: 001's "neighbours")
    π_i' = (1 − u_i u_iᵀ) g b_i e_z − s_i u_i' − (u_i'·π_i) u_i                  (in space: P_i = π_i + s_i u_i)

For bobs W joins a link to its neighbours alone: with m_0 the cart's mass (without end on a fixed support)

    W_00 = 1/m_0    W_ii = (1/m_{i−1} + 1/m_i)/l_i²    W_{i,i+1} = −1/(m_i l_i l_{i+1})    W_{0,1} = −1/(m_0 l_1)

and first links of several pendula on one cart 1/(m_0 l l').  So in one chain each of Hamilton's equations has three
terms for any n.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy as sp
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from modal.errors import SceneError
from modal.symbolic.carriers import Chain, Coordinate, coordinate, time_derivative
from modal.symbolic.lagrangian import (
    NOT_IN_SPACE,
    cart_forces,
    derive_lagrangian,
    gather_cosines,
    in_angles,
    joint_moments,
    rail,
    vanishes,
)
from modal.symbolic.papers import equal
from modal.symbolic.structures import SymbolicStructure, indices
from modal.symbolic.typesetting import Line, Section

TITLE = "Hamilton's equations"
WITH_ROTORS = "M^-1 is not written out: beside rotors M is no sum of constants times cosines of differences of angles"
WITHOUT_INVERSE = "a massless cart above bobs: M, b, A have no inverse, and momenta do not determine velocities at rest"


def momentum(c: Coordinate) -> Coordinate:
    """The momentum of a coordinate, with its rate: p_x of x, p_1 of θ_1, p_phi_1 of φ_1."""
    letter, *index = c.q.name.split("_")
    return coordinate("p", *([] if letter == "theta" else [letter]), *index)


def hamiltonian(system: SymbolicStructure) -> Section:
    """H and Hamilton's equations of pendula on a support or a cart; raise SceneError if two routes disagree.

    >>> from modal.symbolic import chain, plain
    >>> print(plain(hamiltonian(chain(1)).lines[-2].formula))
    p' = -m g l sin(θ) - s θ'
    """
    return Section(TITLE, list(_in_space(system) if system.spatial else _in_plane(system)))


# --------------------------------------------------------------------------------------------------- the constant W


def numbers(system: SymbolicStructure) -> Any:
    """N = [[M, bᵀ], [b, A]], the cart first if there is one."""
    return _border(system, system.b, system.A)


def _border(system: SymbolicStructure, b: Any, A: Any) -> Any:
    """[[M, bᵀ], [b, A]] on a cart, A on a fixed support."""
    if not rail(system):
        return A
    return sp.Matrix(sp.BlockMatrix([[sp.Matrix([[system.total_mass]]), sp.Matrix(b).T], [sp.Matrix(b), A]]))


def inverse(system: SymbolicStructure) -> Any | None:
    """W = N⁻¹; None where N is singular, or too large with symbols to be written."""
    if system.rotor_energy != 0:
        return None
    if all(map(_of_bobs, system.chains)):
        return _by_neighbours(system)
    N = numbers(system)
    if len(N.free_symbols) > 3 and len(system.links) > 4:
        return None
    try:
        return DomainMatrix.from_Matrix(N).to_field().inv().to_Matrix().applyfunc(sp.factor)
    except DMNonInvertibleMatrixError:
        return None


def _of_bobs(chain: Chain) -> bool:
    return chain.centre == chain.length and not any(chain.inertia)


def _by_neighbours(system: SymbolicStructure) -> Any | None:
    """W of bobs: velocities of masses are sums of l_i v_i from the top, so W = B diag(1/m) Bᵀ, B of two diagonals."""
    first = len(rail(system))
    size = first + len(system.links)
    if first and system.carriers[0].mass == 0:
        return None
    B, inverses = sp.zeros(size, size), [1 / system.carriers[0].mass] if first else []
    if first:
        B[0, 0] = 1
    at = first
    for chain in system.chains:
        for i, (m, l) in enumerate(zip(chain.mass, chain.length, strict=True)):
            B[at, at] = 1 / l
            if i or first:
                B[at, at - 1 if i else 0] = -1 / l
            inverses.append(1 / m)
            at += 1
    return (B * sp.diag(*inverses) * B.T).applyfunc(sp.factor)


# ------------------------------------------------------------------------------------------------------ in the plane


def _in_plane(system: SymbolicStructure) -> Iterator[Line]:
    p = [momentum(c) for c in system.coordinates]
    M, V = mass_matrix(system), derive_lagrangian(system).V
    yield Line("coordinates", sp.Matrix([c.q for c in system.coordinates]))
    yield Line("momenta p = M q'", sp.Matrix([c.q for c in p]))
    yield Line("H, the energy in q and p", whole_energy())
    yield Line("with the mass matrix", equal(sp.Symbol("M"), M))
    yield Line("and the potential energy", equal(sp.Symbol("V"), gather_cosines(V)))
    if len(p) <= 2:
        yield from _written_out(M, p)
    W = inverse(system)
    if W is None:
        yield Line(_no_inverse(system))
        return
    yield from _constants(system, W)
    s = lengthwise_symbols(system)
    yield Line("the momenta s along the links follow from the constant lengths: one linear equation a link")
    for name, form in zip(s, along_equations(system, W, p, s), strict=True):
        yield Line(f"for {name}", equal(form, 0))
    yield from _rates(system, W, p, s)
    yield from _forces(system, p, s)
    if len(system.links) <= 3:
        _require(system.without_laws, W, p, s)
        yield Line(
            "with p = M q' these are Lagrange's equations of the Cartesian L, and H is T + V: checked term by term"
        )


def whole_energy() -> Any:
    """H = ½ pᵀ M⁻¹ p + V, of symbols that keep their order."""
    row, inverse, column = (sp.Symbol(name, commutative=False) for name in ("p^T", "M^-1", "p"))
    return equal(sp.Symbol("H"), row * inverse * column / 2 + sp.Symbol("V"))


def mass_matrix(system: SymbolicStructure) -> Any:
    """M(q) of a system in the plane: A_ij cos(θ_i − θ_j), b_i cos θ_i and the total mass."""
    angles = [angle.q for angle in system.angles]
    n = len(angles)
    M = sp.Matrix(n, n, lambda i, j: system.A[i, j] * sp.cos(angles[min(i, j)] - angles[max(i, j)]))
    M += sp.hessian(system.rotor_energy, [angle.v for angle in system.angles])
    return _border(system, [b * sp.cos(angle) for b, angle in zip(system.b, angles, strict=True)], M)


def _written_out(M: Any, p: list[Coordinate]) -> Iterator[Line]:
    """H of one or two coordinates as one formula."""
    determinant = sp.factor(sp.expand(M.det()).subs(_squares(M)))
    column = sp.Matrix([c.q for c in p])
    kinetic = (column.T * M.adjugate() * column)[0] if M.rows > 1 else column[0] ** 2
    yield Line("written out", equal(sp.Symbol("H"), sp.expand(kinetic) / (2 * determinant) + sp.Symbol("V")))


def _squares(M: Any) -> dict[Any, Any]:
    return {cos**2: 1 - sp.sin(cos.args[0]) ** 2 for cos in M.atoms(sp.cos)}


def _no_inverse(system: SymbolicStructure) -> str:
    if rail(system) and system.carriers[0].mass == 0:
        return WITHOUT_INVERSE
    if system.rotor_energy != 0:
        return WITH_ROTORS
    return "W, the inverse of M, b, A, is written for at most 4 links with a symbol each, and for bobs"


def _constants(system: SymbolicStructure, W: Any) -> Iterator[Line]:
    order = "of the cart and the links" if rail(system) else "of the links"
    yield Line(f"the inverse of the constant M, b, A {order}{_pattern(W)}", equal(sp.Symbol("W"), W))


def _pattern(W: Any) -> str:
    """The meaning of the zeros of W."""
    if not any(entry == 0 for entry in W):
        return ""
    distant_entries = [W[i, j] for i in range(W.rows) for j in range(W.rows) if abs(i - j) > 1]
    return "; it joins neighbours alone" if not any(distant_entries) else "; it is 0 for links that are not joined"


def lengthwise_symbols(system: SymbolicStructure) -> list[Any]:
    """The symbols s of momenta along the links, s_z of the cart's down."""
    link_symbols = [sp.Symbol("_".join(("s", *indices(angle)))) for angle in system.angles]
    return [*(sp.Symbol("s_z") for _ in rail(system)), *link_symbols]


def _angles(system: SymbolicStructure) -> list[Any]:
    """The angles of all rows, 0 of the cart: n = e_x and u = e_z."""
    return [*(sp.S.Zero for _ in rail(system)), *(angle.q for angle in system.angles)]


def along_equations(system: SymbolicStructure, W: Any, p: list[Coordinate], s: list[Any]) -> list[Any]:
    """u_i·Σ_j W_ij P_j, which vanish."""
    angle = _angles(system)
    return [
        sp.Add(*(w * (s[j] * sp.cos(angle[i] - angle[j]) + p[j].q * sp.sin(angle[i] - angle[j])) for j, w in row))
        for i, row in _rows(W)
    ]


def _rows(W: Any) -> Iterator[tuple[int, list[tuple[int, Any]]]]:
    """Of every row the entries that are not 0."""
    for i in range(W.rows):
        yield i, [(j, W[i, j]) for j in range(W.rows) if W[i, j] != 0]


def _rates(system: SymbolicStructure, W: Any, p: list[Coordinate], s: list[Any]) -> Iterator[Line]:
    yield Line("rates of the coordinates, the derivatives of H by the momenta")
    for c, form in zip(system.coordinates, velocities(system, W, p, s), strict=True):
        yield Line(f"for {c.q}", equal(c.v, form))


def velocities(system: SymbolicStructure, W: Any, p: list[Coordinate], s: list[Any]) -> list[Any]:
    """Q' = ∂H/∂p: n_i·Σ_j W_ij P_j."""
    angle = _angles(system)
    return [
        sp.Add(*(w * (p[j].q * sp.cos(angle[i] - angle[j]) - s[j] * sp.sin(angle[i] - angle[j])) for j, w in row))
        for i, row in _rows(W)
    ]


def _forces(system: SymbolicStructure, p: list[Coordinate], s: list[Any]) -> Iterator[Line]:
    damper_words = " less the dampers" if derive_lagrangian(system).R != 0 else ""
    yield Line(f"rates of the momenta, minus the derivatives of H by the coordinates{damper_words}")
    for rate, form in zip(p, momentum_rates(system, s), strict=True):
        yield Line(f"for {rate.q}", equal(rate.v, form))


def momentum_rates(system: SymbolicStructure, s: list[Any]) -> list[Any]:
    """P' in the rates q': −s_i θ_i' − g b_i sin θ_i less joints, −k_c x − c_c x' of the cart."""
    first, joints = len(rail(system)), joint_moments(system)
    rates = [
        -s[first + i] * angle.v - system.gravity * b * sp.sin(angle.q) - joints[i]
        for i, (angle, b) in enumerate(zip(system.angles, system.b, strict=True))
    ]
    return [*(-force for force in cart_forces(system)), *rates]


def _require(system: SymbolicStructure, W: Any, p: list[Coordinate], s: list[Any]) -> None:
    """Put p = M q' and s = u·P into all of it: rates come back, and p' is Lagrange's."""
    lagrangian, v = derive_lagrangian(system), [c.v for c in system.coordinates]
    angle, N = _angles(system), numbers(system)
    momenta = mass_matrix(system) * sp.Matrix(v)
    substitutions = {c.q: value for c, value in zip(p, momenta, strict=True)}
    lengthwise = [sp.Add(*(N[i, j] * sp.sin(angle[i] - angle[j]) * v[j] for j in range(N.rows))) for i in range(N.rows)]
    substitutions |= dict(zip(s, lengthwise, strict=True))
    common = sp.lcm_list([sp.fraction(sp.together(entry))[1] for entry in W])
    cleared_inverse = (common * W).applyfunc(sp.cancel)
    forms = [form.subs(substitutions) for form in along_equations(system, cleared_inverse, p, s)]
    forms += [
        form.subs(substitutions) - common * rate
        for form, rate in zip(velocities(system, cleared_inverse, p, s), v, strict=True)
    ]
    lagranges = [
        time_derivative(value, system.coordinates) - form.subs(substitutions)
        for value, form in zip(momenta, momentum_rates(system, s), strict=True)
    ]
    forms += [mine - theirs for mine, theirs in zip(lagranges, lagrangian.equations, strict=True)]
    forms.append((momenta.T * sp.Matrix(v))[0] / 2 - lagrangian.T)
    if not all(map(vanishes, forms)):
        raise SceneError(["Hamilton's equations and Lagrange's disagree: please report this scene"])


# --------------------------------------------------------------------------------------------------------- in space


def _in_space(system: SymbolicStructure) -> Iterator[Line]:
    if system.has_joint_forces:
        yield Line(NOT_IN_SPACE)
        return
    W, cart = inverse(system), rail(system)
    if W is None:
        yield Line(_no_inverse(system))
        return
    tails = [indices(angle) for angle in system.angles]
    u, pi, P, s = ([coordinate(letter, *tail) for tail in tails] for letter in ("u", "pi", "P", "s"))
    yield Line("u_i points along link i and e_z down; a product of two vectors is their dot product")
    rows = [total.q for total in P]
    if cart:
        rows.insert(0, sp.Symbol("P_x"))
        e_x, e_y, e_z = sp.symbols("e_x e_y e_z")
        momentum = sp.Symbol("p_x") * e_x + sp.Symbol("s_y") * e_y + sp.Symbol("s_z") * e_z
        yield Line("momentum of the cart", equal(rows[0], momentum))
    for total, transverse, lengthwise, direction in zip(P, pi, s, u, strict=True):
        yield Line(
            f"momentum {transverse.q} across and {lengthwise.q} along {direction.q}",
            equal(total.q, transverse.q + lengthwise.q * direction.q),
        )
    yield from _constants(system, W)
    potential = [-system.gravity * b * direction.q * sp.Symbol("e_z") for b, direction in zip(system.b, u, strict=True)]
    potential += system.carrier_energies
    kinetic = [w * rows[i] * rows[j] / (2 if i == j else 1) for i, row in _rows(W) for j, w in row if j <= i]
    yield Line("H", equal(sp.Symbol("H"), sp.Add(*kinetic, *potential)))
    forms = [sp.Add(*(w * rows[j] for j, w in row)) for _, row in _rows(W)]
    for x, force in zip(cart, cart_forces(system), strict=True):
        yield Line("of x, along e_x", equal(x.v * sp.Symbol("e_x"), forms[0]))
        yield Line("of p_x", equal(sp.Symbol("pdot_x"), -force))
    on_rail = ", and x' e_x has no part along e_y and e_z" if cart else ""
    yield Line(f"u_i u_i' = 0{on_rail}: linear equations of the s")
    for direction, form in zip(u, forms[len(cart) :], strict=True):
        yield Line(f"for {direction.q}", equal(direction.v, form))
    for direction, transverse, lengthwise, b in zip(u, pi, s, system.b, strict=True):
        rate = f"its rate is F - (u F) u - s u' - (u' {transverse.q}) u with u = {direction.q}, s = {lengthwise.q} and"
        yield Line(f"for {transverse.q}: {rate}", equal(sp.Symbol("F"), system.gravity * b * sp.Symbol("e_z")))
    if len(system.links) == 1 and not cart:
        yield from _of_one_link(system)


def _of_one_link(system: SymbolicStructure) -> Iterator[Line]:
    """H of one link in θ and φ, singular where it hangs: what the azimuth of paper 002 is in this form."""
    theta, phi = system.angles[0], system.azimuths[0]
    J, b = system.A[0, 0], system.b[0]
    T = in_angles(system)
    p_theta, p_phi = (sp.Symbol(f"p_{c.q.name}") for c in (theta, phi))
    substitutions = {p_theta: sp.diff(T, theta.v), p_phi: sp.diff(T, phi.v)}
    V = -system.gravity * b * sp.cos(theta.q)
    H = (p_theta**2 + p_phi**2 / sp.sin(theta.q) ** 2) / (2 * J) + V
    if not vanishes(sp.expand((H - V).subs(substitutions) - T)):
        raise SceneError(["H in θ and φ and the kinetic energy disagree: please report this scene"])
    yield Line("for comparison in θ and φ", equal(sp.Symbol("H"), H))
    yield Line("the momentum of φ is constant: the azimuth turns by", equal(phi.v, sp.diff(H, p_phi)))
