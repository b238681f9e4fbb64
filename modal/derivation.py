"""A derivation on paper: from the Lagrangian of a system to its eigen-polynomial and modes, section by section.

Each section is a title and lines of (what it is, formula); `modal.typeset` prints them.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import sympy as sp

from modal.errors import SceneError
from modal.lagrangian import lagrangian, vanishes
from modal.papers import equal
from modal.polynomial_roots import Root, of_chain, roots
from modal.polynomials import Factor, Polynomial, equal_bobs, of_scene
from modal.scene import Scene
from modal.symbolic import Chain, System

SECTIONS = ("lagrangian", "equations", "matrices", "polynomial", "modes")
CHECKED_UP_TO = 6
MOST_WRITTEN = 40
MOST_EXPANDED = 5
MOST_SYMBOLS = 12
MOST_ISOLATED = 60
WIDTH = Fraction(1, 10**24)


class Line(NamedTuple):
    """What a formula is, and the formula; a remark has no formula."""

    words: str
    formula: Any = None


class Section(NamedTuple):
    """A title and its lines."""

    title: str
    lines: list[Line]


def derivation(system: System, show: tuple[str, ...] = SECTIONS, scene: Scene | None = None) -> Iterator[Section]:
    """The sections of SECTIONS that `show` names, in their order.

    `scene` is the one that `system` writes in numbers, if any: its polynomial is then exact and integer.  Raises
    SceneError for more links than equations can be read of.
    """
    if len(system.links) > MOST_WRITTEN and set(show) & {"lagrangian", "equations", "matrices"}:
        shorter = "choose --show polynomial,modes"
        raise SceneError([f"{len(system.links)} links: written out for at most {MOST_WRITTEN}; {shorter}"])
    makers = {
        "lagrangian": lambda: _lagrangian(system),
        "equations": lambda: _equations(system),
        "matrices": lambda: _matrices(system),
        "polynomial": lambda: _polynomial(system, scene),
        "modes": lambda: _modes(system, scene),
    }
    return (makers[name]() for name in SECTIONS if name in show)


def _lagrangian(system: System) -> Section:
    found = lagrangian(system)
    lines = [Line("kinetic energy", equal(sp.Symbol("T"), _kinetic(system)))] if not system.spatial else []
    lines += [Line("kinetic energy in θ and φ", equal(sp.Symbol("T"), found.T))] if system.spatial else []
    lines.append(Line("potential energy", equal(sp.Symbol("V"), sp.expand(found.V))))
    if found.R != 0:
        lines.append(Line("dissipation function", equal(sp.Symbol("R"), found.R)))
    lines.append(Line("Lagrangian", equal(sp.Symbol("L"), sp.Symbol("T") - sp.Symbol("V"))))
    if not system.spatial and len(system.links) <= CHECKED_UP_TO:
        _insist(vanishes(found.T - _kinetic(system)))
        lines.append(Line("T is that of the Cartesian velocities of all masses: checked term by term"))
    return Section("Lagrangian", lines)


def _kinetic(system: System) -> Any:
    """½ M x'² + x' Σ b_i cos θ_i θ_i' + ½ Σ A_ij cos(θ_i − θ_j) θ_i' θ_j'."""
    angles, A = system.angles, system.A
    T = sum(A[i, i] * one.v**2 / 2 for i, one in enumerate(angles))
    for i, one in enumerate(angles):
        for j, other in enumerate(angles[:i]):
            T += A[i, j] * sp.cos(other.q - one.q) * one.v * other.v
    if system.cart:
        v = system.coordinates[0].v
        T += system.total_mass * v**2 / 2
        T += v * sum(b * sp.cos(one.q) * one.v for b, one in zip(system.b, angles, strict=True))
    return T


def _equations(system: System) -> Section:
    title = "Equations of motion"
    if system.spatial:
        lines = [Line(f"{u} × F = 0 with", equal(sp.Symbol("F"), F)) for u, F in system.vector_equations()]
        return Section(
            title, [*lines, Line("u_i points along link i and e_z down: no angle, nothing singular at rest")]
        )
    found = system.equations()
    lines = [Line(f"of {c.q}", equal(form, 0)) for c, form in zip(system.coordinates, found, strict=True)]
    if len(system.links) <= CHECKED_UP_TO:
        derived = lagrangian(system).equations
        _insist(all(vanishes(a - b) for a, b in zip(derived, found, strict=True)))
        lines.append(Line("these are Lagrange's equations of the Cartesian L: checked term by term"))
    return Section(title, lines)


def _matrices(system: System) -> Section:
    M, K, D = system.matrices()
    q = sp.Matrix([c.q for c in system.coordinates])
    standing = any(sign < 0 for sign in system.sigma)
    lines = [
        Line("deviations from the rest with " + _ways(system) if standing else "small deviations from the rest", q),
        Line("mass matrix", equal(sp.Symbol("M"), M)),
        Line("stiffness matrix", equal(sp.Symbol("K"), K)),
    ]
    lines += [Line("damping matrix", equal(sp.Symbol("D"), D))] if any(D) else []
    if system.spatial:
        lines.append(Line("along the rail; across it the same without x"))
    return Section("Linearized: M q'' + K q = 0" if not any(D) else "Linearized: M q'' + D q' + K q = 0", lines)


def _ways(system: System) -> str:
    return ", ".join(
        f"{angle.q} {'up' if sign < 0 else 'down'}" for angle, sign in zip(system.angles, system.sigma, strict=True)
    )


def _polynomial(system: System, scene: Scene | None) -> Section:
    lines = []
    if n := _equal_bobs(system):
        in_lambda = equal_bobs(n)
        lines.append(Line("in λ = −g/(l ω²), as paper 001 has it", equal(expression(in_lambda), 0)))
        lines.append(Line("in x = ω² l/g", equal(expression(in_lambda.in_x()), 0)))
    elif factors := _factors(system, scene):
        for factor in factors:
            times = f", {factor.multiplicity} times" if factor.multiplicity > 1 else ""
            lines.append(Line(f"{factor.label}{times}", equal(expression(factor.polynomial), 0)))
        lines.append(Line("x = ω² (rad²/s²)"))
    else:
        lines += _symbolic_polynomials(system)
    return Section("Eigen-polynomial det(K − x M)", lines)


def _factors(system: System, scene: Scene | None) -> list[Factor]:
    """The exact factors of a scene in numbers, at its hanging rest and without dampers; none for anything else."""
    numbers = not any(value.free_symbols for value in (*system.A, system.gravity, system.total_mass))
    return of_scene(scene) if scene and numbers and not scene.has_damping and not scene.stands else []


def _symbolic_polynomials(system: System) -> list[Line]:
    """Of equal chains: the part that moves the cart and, for several, the part that does not."""
    first, count = system.chains[0], len(system.chains)
    symbols = {name for value in (*first.mass, *first.length) for name in value.free_symbols}
    if len(symbols) > MOST_SYMBOLS:
        return [Line(f"in {len(symbols)} different masses and lengths: too long to write out")]
    if not _is_plain(system) or any(chain != first for chain in system.chains):
        return [_determinant(system)]
    lines = []
    if system.cart:
        moving = of_chain(first.geometry, system.gravity, cart=system.cart.mass, count=count)
        lines = [Line("ω = 0: rigid translation"), Line("the cart moves", equal(moving, 0))]
    if not system.cart or count > 1:
        alone = of_chain(first.geometry, system.gravity)
        words = f"the cart stays still, {count - 1} times" if system.cart else "in x = ω²"
        lines.append(Line(words, equal(alone, 0)))
        if not system.cart:
            lines.append(Line("in λ = −g/ω²", equal(of_chain(first.geometry, system.gravity, variable="lambda"), 0)))
    return lines


def _is_plain(system: System) -> bool:
    """Whether everything hangs, without springs and dampers, so that the recursion along a chain holds."""
    extras = [value for chain in system.chains for value in (*chain.stiffness, *chain.damping)]
    extras += [system.cart.stiffness, system.cart.damping] if system.cart else []
    return all(sign > 0 for sign in system.sigma) and not any(extras)


def _determinant(system: System) -> Line:
    if len(system.coordinates) > MOST_EXPANDED:
        return Line(f"of {len(system.coordinates)} different coordinates in symbols: too long to write out")
    M, K, D = system.matrices()
    s, x = sp.symbols("s x")
    if any(D):
        return Line("det(s² M + s D + K)", equal(sp.factor((M * s**2 + D * s + K).det(method="berkowitz")), 0))
    return Line("det(K − x M)", equal(sp.factor((K - x * M).det(method="berkowitz")), 0))


def _modes(system: System, scene: Scene | None) -> Section:
    if len(system.links) > MOST_ISOLATED:
        return Section("Modes", [Line(f"{len(system.links)} links: see the table, or prove digits with enclose")])
    if n := _equal_bobs(system):
        lines = [_root("x", root, unit="g/l") for root in roots(equal_bobs(n, "x"), WIDTH)]
        shape = sp.Function("L")(sp.Symbol("j"), sp.Symbol("x_r"))
        lines.append(
            Line(
                "mode shape: bob j from the free end swings aside by the Laguerre polynomial",
                equal(sp.Symbol("y_j"), shape),
            )
        )
        lines.append(Line("modal effective mass", equal(sp.Symbol("m_eff"), sp.Symbol("m") / sp.Symbol("x_r"))))
        return Section("Modes: ω_r² = x_r g/l", lines)
    if factors := _factors(system, scene):
        lines = [
            _root(
                "x", root, label=f"{factor.label}{f', {factor.multiplicity}-fold' if factor.multiplicity > 1 else ''}: "
            )
            for factor in factors
            for root in roots(factor.polynomial, WIDTH)
        ]
        return Section("Modes: x = ω² (rad²/s²)", lines)
    return Section("Modes", _symbolic_modes(system))


def _symbolic_modes(system: System) -> list[Line]:
    """Closed forms of the symbolic polynomial where its degree allows."""
    x, lines = sp.Symbol("x"), []
    for words, formula in _symbolic_polynomials(system):
        if formula is None or not formula.has(x):
            continue
        polynomial = sp.Poly(formula.lhs, x)
        if polynomial.degree() > 2:
            lines.append(Line(f"{words}: degree {polynomial.degree()}, no closed form that helps; give numbers"))
            continue
        found = sp.roots(polynomial)
        lines += [Line(words, equal(sp.Symbol("omega") ** 2, sp.simplify(root))) for root in sorted(found, key=str)]
    return lines


def _root(name: str, root: Root, unit: str = "rad^2/s^2", label: str = "") -> Line:
    value = sp.Float(sp.Rational((root.low + root.high) / 2), 20)
    omega = sp.sqrt(value if root.exact is None else root.exact).evalf(15)
    words = f"{label}ω = {omega}" + (" rad/s" if unit == "rad^2/s^2" else " √(g/l)")
    formula = root.exact if root.exact is not None else value
    return Line(words, equal(sp.Symbol(name), formula))


def expression(polynomial: Polynomial) -> Any:
    """A polynomial in SymPy, terms from the highest power down."""
    symbol = sp.Symbol(polynomial.variable)
    return sp.Poly(polynomial.coefficients, symbol).as_expr()


def _equal_bobs(system: System) -> int:
    """How many equal bobs hang in the one chain of a system in symbols; 0 for any other system."""
    if system.cart or system.spatial or len(system.chains) != 1:
        return 0
    only: Chain = system.chains[0]
    same = len({*zip(only.mass, only.length, strict=True)}) == 1 and system.gravity.free_symbols
    bob = only.centre == only.length and not any(only.inertia) and not any(only.stiffness) and not any(only.damping)
    return len(only.mass) if same and bob and all(sign > 0 for sign in only.sigma) else 0


def _insist(holds: bool) -> None:
    if not holds:
        raise SceneError(["the Cartesian derivation and the pair disagree: please report this scene"])
