"""Paper 000, "Spontaneous-Synchronized Compound Pendulums": n double pendula of compound rods on a cart.

î points down, ĵ along the rail, k̂ = î × ĵ.  With J = m l²/12 for each rod the corrected equations are

    L = ½ m_c x'² + Σ ½ m v² + ½ J θ'² + m g (height of the centre below the rail)                      (III)

whose Lagrange equations are the motion.  The paper numbers nothing, so equations carry its section (III.A ... III.D);
section IV, with every acceleration and pivot force an unknown, is `modal.symbolic.papers.cart_dae`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import sympy as sp

from modal.symbolic import Coordinate, coordinate, lagrange_equations
from modal.symbolic.papers import Equation, correct, equal

PAPER = "000"
g, m_c = sp.symbols("g m_c")
X, Y = coordinate("x"), coordinate("y")


class PaperLink(NamedTuple):
    """The symbols of one rod: x of its centre along ĵ, y along î, and the force (Rx, Ry) at its upper pivot."""

    m: Any
    l: Any
    theta: Coordinate
    x: Coordinate
    y: Coordinate
    v: Any
    Rx: Any
    Ry: Any

    @property
    def inertia(self) -> Any:
        """⅓ m (l/2)² = m l²/12, as correctly used in the moment balances."""
        return self.m * (self.l / 2) ** 2 / 3


def double_pendulum(p: int) -> tuple[PaperLink, PaperLink]:
    """The two links of pendulum p (counted from 1)."""
    first, second = (
        PaperLink(
            *sp.symbols(f"m_{p}_{j} l_{p}_{j}"),
            *(coordinate(name, p, j) for name in ("theta", "x", "y")),
            *sp.symbols(f"v_{p}_{j} R_{pivot}x_{p} R_{pivot}y_{p}"),
        )
        for j, pivot in ((1, "B"), (2, "P"))
    )
    return first, second


def links(n: int) -> list[PaperLink]:
    """All 2n links, pendulum by pendulum."""
    return [link for p in range(1, n + 1) for link in double_pendulum(p)]


def minimal_coordinates(n: int) -> list[Coordinate]:
    """The 2n + 1 coordinates of the Lagrangian method: x, then the angles."""
    return [X, *(link.theta for link in links(n))]


def positions(p: int) -> list[Equation]:
    """Centres of the two links as (î, ĵ) components: correct, and the reference for everything else."""
    a, b = double_pendulum(p)
    (s1, c1), (s2, c2) = ((sp.sin(link.theta.q), sp.cos(link.theta.q)) for link in (a, b))
    first = sp.Tuple(a.l / 2 * c1, a.l / 2 * s1 + X.q)
    second = sp.Tuple(a.l * c1 + b.l / 2 * c2, a.l * s1 + b.l / 2 * s2 + X.q)
    return [
        correct(PAPER, "III.B", f"centre of link {j} of pendulum {p}", equal(sp.Symbol(f"r_{p}_{j}"), r))
        for j, r in ((1, first), (2, second))
    ]


def squared_speeds(p: int) -> list[Equation]:
    """v² of the two centres: link 1 squares the vertical part twice, link 2 omits the first link's."""
    a, b = double_pendulum(p)
    (s1, c1), (s2, c2) = ((sp.sin(link.theta.q), sp.cos(link.theta.q)) for link in (a, b))
    w1, w2 = a.theta.v, b.theta.v
    across1, twice = (X.v + a.l / 2 * w1 * c1) ** 2, (a.l**2 * w1**2 * s1**2 / 4) ** 2
    across2, half = (X.v + a.l * w1 * c1 + b.l * w2 * c2 / 2) ** 2, b.l * w2 * s2 / 2
    first = equal(a.v**2, across1 + twice), equal(a.v**2, across1 + (a.l / 2 * w1 * s1) ** 2)
    second = equal(b.v, across2 + half**2), equal(b.v**2, across2 + (a.l * w1 * s1 + half) ** 2)
    return [
        Equation(
            PAPER,
            "III.B",
            f"squared speed of link 1 of pendulum {p}",
            *first,
            "where sin θ_1 θ_1' = 0 or l_1² θ_1'² sin² θ_1 = 4 in the units used",
            sp.Eq(twice, (a.l / 2 * w1 * s1) ** 2),
            "the vertical part is squared twice: m⁴/s⁴ added to m²/s²",
        ),
        Equation(
            PAPER,
            "III.B",
            f"squared speed of link 2 of pendulum {p}",
            *second,
            "where θ_1' sin θ_1 = 0 or l_1 θ_1' sin θ_1 = −l_2 θ_2' sin θ_2, and the left side is read as v²",
            sp.Eq(half**2, (a.l * w1 * s1 + half) ** 2),
            "the first link's vertical velocity is missing, and the left side is a square",
        ),
    ]


def kinetic_energy(n: int) -> Equation:
    """E_k in terms of the speeds: the paper's has no rotation, as if the rods were point masses at mid-link."""
    point = m_c * X.v**2 / 2 + sum(link.m * link.v**2 / 2 for link in links(n))
    turning = sum(link.inertia * link.theta.v**2 / 2 for link in links(n))
    return Equation(
        PAPER,
        "III.B",
        "kinetic energy",
        equal(sp.Symbol("E_k"), point),
        equal(sp.Symbol("E_k"), point + turning),
        "while no link turns, or for point masses at mid-link",
        sp.Eq(turning, 0),
        "the DAE section of the same paper has rods, with m l²/12; the sum lacks parentheses about its two terms, "
        "which III.D has, and n is its index and its end",
    )


def potential_energy(n: int) -> Equation:
    """E_p: as printed hanging is the highest point, since î points down, and m_{n,1} is printed for m_{n,2}."""
    printed_form, corrected_form = sp.Integer(0), sp.Integer(0)
    for p in range(1, n + 1):
        (a, b), (r1, r2) = double_pendulum(p), (equation.printed.rhs for equation in positions(p))
        printed_form += a.m * g * r1[0] + a.m * g * r2[0]
        corrected_form -= a.m * g * r1[0] + b.m * g * r2[0]
    return Equation(
        PAPER,
        "III.C",
        "potential energy",
        equal(sp.Symbol("E_p"), printed_form),
        equal(sp.Symbol("E_p"), corrected_form),
        "without gravity, and where 2 m_1 y_1 + (m_1 + m_2) y_2 = 0, as with both links level",
        sp.Eq(printed_form - corrected_form, 0),
        "the index alone is harmless for the paper's equal masses; the sign is not",
    )


def lagrangian(n: int) -> Equation:
    """L = E_k − E_p with the speeds written out."""
    forms = _lagrangian(n, "printed"), _lagrangian(n, "corrected")
    note = "every fault of E_k and E_p together"
    return Equation(PAPER, "III.D", "Lagrangian", *forms, "never as a whole", sp.false, note)


def _lagrangian(n: int, form: str) -> Any:
    speeds = [getattr(e, form).rhs for p in range(1, n + 1) for e in squared_speeds(p)]
    square = {link.v**2: speed for link, speed in zip(links(n), speeds, strict=True)}
    E_k, E_p = (getattr(energy(n), form).rhs for energy in (kinetic_energy, potential_energy))
    return equal(sp.Symbol("L"), E_k.xreplace(square) - E_p)


def lagrange_equation(n: int, at: int = 1) -> Equation:
    """Lagrange's equation of coordinate `at` (0 is x): the paper prints ∂/∂t for d/dt, and ∂/∂t (∂L/∂q') is zero."""
    L, coordinates = lagrangian(n).corrected.rhs, minimal_coordinates(n)
    total = lagrange_equations(L, coordinates)[at]
    return Equation(
        PAPER,
        "III.A",
        f"Lagrange's equation of {coordinates[at].q}",
        equal(-sp.diff(L, coordinates[at].q), 0),
        equal(total, 0),
        "at instants when ∂L/∂q' does not change",
        sp.Eq(total + sp.diff(L, coordinates[at].q), 0),
        "L does not contain t, so the partial derivative of ∂L/∂q' at fixed q and q' vanishes",
    )
