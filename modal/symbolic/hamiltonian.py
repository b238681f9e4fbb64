"""Lagrange's and Hamilton's equations of a system in symbols: n masses, in the plane and in space.

Hamilton's answer paper 002's closing question:

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

Lagrange's come in two ways, from the reduced inertia matrices A and b, and from all positions.  Of pendula on one
support, fixed or on a rail, in the plane:

    T = ½ M x'² + x' Σ b_i u_i'·e_x + ½ Σ_ij A_ij u_i'·u_j',    u_i'·u_j' = cos(θ_i − θ_j) θ_i'θ_j'
    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i cos θ_i x'' + g b_i sin θ_i + joints = 0
    M x'' + Σ b_i (cos θ_i θ_i'' − sin θ_i θ_i'²) + c_c x' + k_c x = 0

and in space, with the unit vectors u_i and with Δ = φ_i − φ_j, singular at θ = 0,

    u_i × [Σ_j A_ij u_j'' + b_i x'' e_x − g b_i e_z] = 0,    M x'' + e_x·Σ b_i u_i'' + c_c x' + k_c x = 0
    u_i'·u_j' = θ_i'θ_j'(cosθ_i cosθ_j cosΔ + sinθ_i sinθ_j) + φ_i'φ_j' sinθ_i sinθ_j cosΔ
                + (θ_i'φ_j' cosθ_i sinθ_j − φ_i'θ_j' sinθ_i cosθ_j) sinΔ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from modal.errors import SceneError
from modal.scene.doors import require_type
from modal.symbolic.carriers import Coordinate, coordinate, lagrange_equations, time_derivative
from modal.symbolic.papers import equal
from modal.symbolic.structures import SymbolicStructure, indices
from modal.symbolic.typesetting import Line, Section

NOT_IN_SPACE = "joint springs and dampers in space: only the linearized equations are derived"


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """Energies over `coordinates`, and the dissipation function R."""

    coordinates: tuple[Coordinate, ...]
    T: Any
    V: Any
    R: Any

    @property
    def L(self) -> Any:
        """T − V."""
        return self.T - self.V

    @cached_property
    def equations(self) -> list[Any]:
        """Lagrange's equations: expressions that vanish in motion."""
        return lagrange_equations(self.L, self.coordinates, self.R)


def derive_lagrangian(system: SymbolicStructure) -> Lagrangian:
    """The Lagrangian from the positions of all masses, in space in the angles θ and φ of every link.

    Raise SceneError for joint springs and dampers in space, which θ and φ do not describe.
    """
    require_type("system", system, "SymbolicStructure")
    if system.spatial and system.has_joint_forces:
        raise SceneError(["joint springs and dampers: not implemented in the angles θ and φ of a scene in space"])
    V, R = map(system.written_out, (system.potential, system.dissipation))
    return Lagrangian((*system.coordinates, *system.azimuths), system.cartesian(), V, R)


# ----------------------------------------------------------------------------------------------------- from the pair


def rail(system: SymbolicStructure) -> list[Coordinate]:
    """The coordinate of a cart; none of a fixed support."""
    return list(system.carriers[0].coordinates)


def in_plane(system: SymbolicStructure) -> Any:
    """T in the angles of a plane system."""
    angles = system.angles
    rail_rates = [sp.cos(chain.q) * chain.v for chain in angles]
    return _sum_energy(system, rail_rates, lambda i, j: sp.cos(angles[j].q - angles[i].q) * angles[i].v * angles[j].v)


def in_vectors(system: SymbolicStructure) -> Any:
    """T in unit vectors; a product of two is their dot product."""
    u = [coordinate("u", *indices(angle)).v for angle in system.angles]
    rail_rates = [chain * sp.Symbol("e_x") for chain in u]
    return _sum_energy(system, rail_rates, lambda i, j: u[i] * u[j])


def in_angles(system: SymbolicStructure) -> Any:
    """T in the zenith angles θ and azimuths φ of a system in space."""
    pairs = list(zip(system.angles, system.azimuths, strict=True))
    rail_rates = [t.v * sp.cos(t.q) * sp.cos(f.q) - f.v * sp.sin(t.q) * sp.sin(f.q) for t, f in pairs]
    return _sum_energy(system, rail_rates, lambda i, j: _product(*pairs[j], *pairs[i]))


def cart_forces(system: SymbolicStructure) -> list[Any]:
    """c_c x' + k_c x of a cart."""
    support = system.carriers[0]
    return [support.damping[0] * x.v + support.stiffness[0] * x.q for x in rail(system)]


def joint_moments(system: SymbolicStructure) -> list[Any]:
    """Minus the generalized forces (N m) of the springs and dampers of joints on each angle."""
    plain, chains = system.without_laws, range(len(system.chains))
    (V, R), (V_laws, R_laws) = (
        (sp.Add(*map(part.joint_energy, chains)), sp.Add(*map(part.joint_dissipation, chains)))
        for part in (plain, system)
    )
    V_laws, R_laws = V_laws - V, R_laws - R
    return [
        sp.expand(sp.diff(V, angle.q) + sp.diff(R, angle.v)) + sp.diff(V_laws, angle.q) + sp.diff(R_laws, angle.v)
        for angle in system.angles
    ]


def equations(system: SymbolicStructure) -> list[Any]:
    """Expressions that vanish in a plane motion, one for each coordinate."""
    angles, rotors = system.angles, system.rotor_energy
    joints = [
        moment + time_derivative(sp.expand(sp.diff(rotors, angle.v)), angles)
        for angle, moment in zip(angles, joint_moments(system), strict=True)
    ]
    forms = [
        sum(
            A * (sp.cos(theta.q - other_angle.q) * other_angle.a + sp.sin(theta.q - other_angle.q) * other_angle.v**2)
            for A, other_angle in zip(system.A.row(i), angles, strict=True)
        )
        + sum(b * sp.cos(theta.q) * x.a for x in rail(system))
        + system.gravity * b * sp.sin(theta.q)
        + joints[i]
        for i, (theta, b) in enumerate(zip(angles, system.b, strict=True))
    ]
    pulls = zip(system.b, angles, strict=True)
    inertial = sum(b * (sp.cos(theta.q) * theta.a - sp.sin(theta.q) * theta.v**2) for b, theta in pulls)
    cart_equations = [
        system.total_mass * x.a + inertial + force for x, force in zip(rail(system), cart_forces(system), strict=True)
    ]
    return [*cart_equations, *forms]


def vector_equations(system: SymbolicStructure) -> list[tuple[Any, Any]]:
    """(u_i, F_i) of a spatial motion, u_i × F_i = 0; on a cart (e_x, F) comes first, e_x·F = 0.

    Raise SceneError for joint springs and dampers, which are not implemented in unit vectors.
    """
    if system.has_joint_forces:
        raise SceneError(["joint springs and dampers in space: not implemented in unit vectors"])
    e_x, e_z = sp.symbols("e_x e_z")
    u = [coordinate("u", *indices(angle)) for angle in system.angles]
    inertial_force = sum(b * direction.a for b, direction in zip(system.b, u, strict=True))
    forms = [
        (e_x, e_x * (system.total_mass * x.a + force) + inertial_force)
        for x, force in zip(rail(system), cart_forces(system), strict=True)
    ]
    for i, (direction, b) in enumerate(zip(u, system.b, strict=True)):
        F = (
            sum(A * other_direction.a for A, other_direction in zip(system.A.row(i), u, strict=True))
            - system.gravity * b * e_z
        )
        forms.append((direction.q, F + sum(b * x.a * e_x for x in rail(system))))
    return forms


def _sum_energy(system: SymbolicStructure, rail_rates: list[Any], product: Callable[[int, int], Any]) -> Any:
    n, A = len(rail_rates), system.A
    T = sum((A[i, i] * product(i, i) / 2 for i in range(n)), start=sp.S.Zero)
    T += sum(A[i, j] * product(i, j) for i in range(n) for j in range(i)) + system.rotor_energy
    for x in rail(system):
        T += system.total_mass * x.v**2 / 2 + x.v * sum(b * rate for b, rate in zip(system.b, rail_rates, strict=True))
    return T


def _product(t1: Coordinate, f1: Coordinate, t2: Coordinate, f2: Coordinate) -> Any:
    if t1 == t2:
        return t1.v**2 + f1.v**2 * sp.sin(t1.q) ** 2
    (s1, c1), (s2, c2), gap = (sp.sin(t1.q), sp.cos(t1.q)), (sp.sin(t2.q), sp.cos(t2.q)), f1.q - f2.q
    zenith = t1.v * t2.v * (c1 * c2 * sp.cos(gap) + s1 * s2)
    return zenith + f1.v * f2.v * s1 * s2 * sp.cos(gap) + (t1.v * f2.v * c1 * s2 - f1.v * t2.v * s1 * c2) * sp.sin(gap)


# ------------------------------------------------------------------------------------------------------- readable


def vanishes(expression: Any) -> bool:
    """Whether a polynomial in sines, cosines and symbols is zero, by expansion and sin² = 1 − cos²."""
    spread = sp.expand(sp.expand_trig(expression))
    squares = {sp.sin(a.args[0]) ** 2: 1 - sp.cos(a.args[0]) ** 2 for a in spread.atoms(sp.sin)}
    return bool(sp.expand(spread.subs(squares)) == 0)


def gather_cosines(V: Any) -> Any:
    """A potential energy with one term for each cosine, its coefficient factored."""
    expansion = sp.expand(V)
    return sp.collect(expansion, sorted(expansion.atoms(sp.cos), key=str), sp.factor)


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
    if all(chain.is_of_bobs for chain in system.chains):
        return _by_neighbours(system)
    N = numbers(system)
    if len(N.free_symbols) > 3 and len(system.links) > 4:
        return None
    try:
        return DomainMatrix.from_Matrix(N).to_field().inv().to_Matrix().applyfunc(sp.factor)
    except DMNonInvertibleMatrixError:
        return None


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
    yield from momentum_lines(system, p, M)
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


def momentum_lines(system: SymbolicStructure, p: list[Coordinate], M: Any, words: str = "") -> Iterator[Line]:
    """Coordinates, momenta, and H = ½ pᵀ M⁻¹ p + V of symbols that keep their order, with `words` on V."""
    row, inverse, column = (sp.Symbol(name, commutative=False) for name in ("p^T", "M^-1", "p"))
    energy = equal(sp.Symbol("H"), row * inverse * column / 2 + sp.Symbol("V"))
    yield Line("coordinates", sp.Matrix([c.q for c in system.coordinates]))
    yield Line("momenta p = M q'", sp.Matrix([c.q for c in p]))
    yield Line(f"H, the energy in q and p{words}", energy)
    yield Line("with the mass matrix", equal(sp.Symbol("M"), M))


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
