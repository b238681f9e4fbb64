"""The eigen-polynomial and the modes of a system, exactly: closed forms where there are any, else intervals."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any

import sympy as sp

from modal.papers import equal
from modal.polynomial_roots import Root, of_chain, roots
from modal.polynomials import Factor, Polynomial, equal_bobs, of_scene
from modal.scene import Scene
from modal.sections import Line, Section
from modal.symbolic import Chain, System

MOST_EXPANDED = 5
MOST_SYMBOLS = 12
MOST_ISOLATED = 60
WIDTH = Fraction(1, 10**24)


def polynomial_section(system: System, scene: Scene | None) -> Section:
    """The eigen-polynomial in its named conventions, factor by factor."""
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
    """The exact factors of a scene in numbers and without dampers; none for anything else."""
    numbers = not any(value.free_symbols for value in (*system.A, system.gravity, system.total_mass))
    sprung = scene is not None and any(link.stiffness for link in scene.links())
    return of_scene(scene) if scene and numbers and not scene.has_damping and not (sprung and scene.stands) else []


@cache
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


def modes_section(system: System, scene: Scene | None) -> Section:
    """Every mode in closed form where there is one, else to 20 digits from a proved interval."""
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
    return lines or [Line("no closed form that helps: see the table")]


def _root(name: str, root: Root, unit: str = "rad^2/s^2", label: str = "") -> Line:
    value = sp.Float(sp.Rational((root.low + root.high) / 2), 20)
    square = value if root.exact is None else root.exact
    grows = bool(square < 0)
    name_of_rate = "growth rate" if grows else "ω"
    units = "√(g/l)" if unit != "rad^2/s^2" else "1/s" if grows else "rad/s"
    words = f"{label}{name_of_rate} = {sp.sqrt(abs(square)).evalf(15)} {units}"
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
