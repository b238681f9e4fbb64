"""Paper 000, section IV: every acceleration and every pivot force of n double pendula on a cart as an unknown.

    A u = F:  6n + 2 balances of momentum and 4n + 1 constraints for u = (6n + 2 accelerations, 4n + 1 forces)

Link 1 hangs from the cart by the pivot force R_B, link 2 from link 1 by R_P; R is the ground's push on the cart.
The balances are right; the constraints swap x and y and omit the cart.  The system is of index 1: it determines the
accelerations, so positions drift off the constraints when it is integrated, unless the drift is controlled.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.symbolic import Coordinate
from modal.symbolic.papers import Equation, correct, equal, residual
from modal.symbolic.papers.cart import PAPER, X, Y, double_pendulum, g, links, m_c, minimal_coordinates

R = sp.Symbol("R")


def unknowns(n: int) -> list[Any]:
    """The paper's column u of 10n + 3: accelerations of the cart, then of each link, R, then all R_B and all R_P."""
    accelerations = [a for link in links(n) for a in (link.x.a, link.y.a, link.theta.a)]
    forces = [force for link in (*links(n)[::2], *links(n)[1::2]) for force in (link.Rx, link.Ry)]
    return [X.a, Y.a, *accelerations, R, *forces]


def state_counts(n: int) -> tuple[int, int]:
    """2n + 1 coordinates of the Lagrangian method and 10n + 3 unknowns of this one, counted: both right."""
    return len(minimal_coordinates(n)), len(unknowns(n))


def equations(n: int) -> list[Equation]:
    """All 10n + 3 equations, balances first."""
    pendula = range(1, n + 1)
    return [*cart_balances(n), *(row for p in pendula for row in link_balances(p)), *constraints(n)]


def linear_system(n: int, form: str = "corrected") -> tuple[Any, Any]:
    """A (10n + 3, 10n + 3) and F (10n + 3, 1) of A u = F, from the `printed` or the `corrected` equations."""
    rows = [residual(getattr(equation, form)) for equation in equations(n)]
    A, F = sp.linear_eq_to_matrix(rows, unknowns(n))
    return A, F


def solution(n: int) -> Equation:
    r"""The paper writes u = F\A, which for a column F is a least-squares row; A u = F is solved by u = A\F."""
    size = state_counts(n)[1]
    u, A, F = (sp.MatrixSymbol(name, size, columns) for name, columns in (("u", 1), ("A", size), ("F", 1)))
    printed_form, corrected_form = equal(u, (F.T * F).inverse() * F.T * A), equal(u, A.inverse() * F)
    return Equation(
        PAPER, "IV.B", "solving A u = F", printed_form, corrected_form, "never", sp.false, "the paper's L code has A\\F"
    )


def cart_balances(n: int) -> list[Equation]:
    """Linear momentum of the cart along î and ĵ."""
    tops = links(n)[::2]
    vertical = equal(m_c * g - R - sum(link.Ry for link in tops), m_c * Y.a)
    horizontal = equal(-sum(link.Rx for link in tops), m_c * X.a)
    forms = (("î", vertical), ("ĵ", horizontal))
    return [correct(PAPER, "IV.A", f"momentum of the cart along {axis}", form) for axis, form in forms]


def link_balances(p: int) -> list[Equation]:
    """Linear momentum along î and ĵ and moments about the centre, of both links of pendulum p.

    The paper prints ẍ and ÿ without the link's indices, and the inertia as ⅓ m (l/2)².
    """
    a, b = double_pendulum(p)
    (s1, c1), (s2, c2) = ((link.l / 2 * sp.sin(link.theta.q), link.l / 2 * sp.cos(link.theta.q)) for link in (a, b))
    first = (
        equal(b.Ry + a.Ry + a.m * g, a.m * a.y.a),
        equal(a.Rx + b.Rx, a.m * a.x.a),
        equal(-c1 * a.Rx + s1 * a.Ry - s1 * b.Ry + c1 * b.Rx, a.inertia * a.theta.a),
    )
    second = (
        equal(-b.Ry + b.m * g, b.m * b.y.a),
        equal(-b.Rx, b.m * b.x.a),
        equal(-s2 * b.Ry + c2 * b.Rx, b.inertia * b.theta.a),
    )
    kinds = ("momentum of link {} of pendulum {} along î", "momentum of link {} of pendulum {} along ĵ")
    titles = (*kinds, "moments about the centre of link {} of pendulum {}")
    return [
        correct(PAPER, "IV.A", title.format(j, p), form)
        for j, forms in ((1, first), (2, second))
        for title, form in zip(titles, forms, strict=True)
    ]


def constraints(n: int) -> list[Equation]:
    """The 4n + 1 accelerations that ground and pivots allow: the paper swaps x and y, and omits the cart."""
    equations = [correct(PAPER, "IV.B", "cart constraint", equal(Y.a, 0))]
    for p in range(1, n + 1):
        joint_z, joint_x = sp.Integer(0), sp.Integer(0)
        for j, link in enumerate(double_pendulum(p), 1):
            sink, swing = _accelerations_along(link.theta, link.l)
            title = f"constraint of link {j} of pendulum {p}"
            equations.append(_constraint(f"{title} along ĵ", (link.y, link.x), joint_x + swing / 2, X.a))
            equations.append(_constraint(f"{title} along î", (link.x, link.y), joint_z + sink / 2, sp.Integer(0)))
            joint_z, joint_x = joint_z + sink, joint_x + swing
    return equations


def _accelerations_along(theta: Coordinate, l: Any) -> tuple[Any, Any]:
    """(î, ĵ) acceleration of a point at l along a link about its upper pivot."""
    sin, cos = sp.sin(theta.q), sp.cos(theta.q)
    return -l * (theta.a * sin + theta.v**2 * cos), l * (theta.a * cos - theta.v**2 * sin)


def momentum(n: int) -> Equation:
    """Momentum along the rail, which the motion of the cart balances: its rate is the sum of the balances along ĵ."""
    total = m_c * X.v + sum(link.m * link.x.v for link in links(n))
    words = "from rest; the paper has the cart balance the energy, which needs no balance"
    return correct(PAPER, "V", "momentum along the rail", equal(total, 0), words, is_continuation=True)


def _constraint(title: str, names: tuple[Coordinate, Coordinate], relative: Any, cart: Any) -> Equation:
    printed_name, corrected_name = names
    index = "; the length before the squared rate is printed without the pendulum's index" if "link 2" in title else ""
    return Equation(
        PAPER,
        "IV.B",
        title,
        equal(printed_name.a, relative),
        equal(corrected_name.a, cart + relative),
        "on a fixed support, and with x and y read the other way round than in the balances",
        sp.Eq(printed_name.a, corrected_name.a - cart),
        "ĵ carries x in the balances; without the cart's acceleration the pivots stay at rest and nothing is coupled"
        f"{index}",
    )
