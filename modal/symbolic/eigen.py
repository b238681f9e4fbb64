"""The eigen-polynomials and the modes of a system in print: closed forms where there are any, else proved digits."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import sympy as sp

from modal.exact import Polynomial
from modal.scene import Scene
from modal.symbolic.eigen_polynomials import Eigen, eigen_polynomials
from modal.symbolic.papers import equal
from modal.symbolic.roots import Root, polynomial_roots
from modal.symbolic.sections import Line, Section
from modal.symbolic.system import SymbolicSystem

MOST_ISOLATED = 60
MOST_SOLVED = 24
WIDTH = Fraction(1, 10**21)
CLOSED = 3
"""The highest degree in symbols whose roots are written in closed form."""


def polynomial_section(system: SymbolicSystem, scene: Scene | None) -> Section:
    """The eigen-polynomials in their named conventions, factor by factor."""
    found = eigen_polynomials(system, scene)
    if isinstance(found, str):
        return Section("Eigen-polynomial", [Line(found)])
    return Section("Eigen-polynomial", [line for eigen in found for line in _polynomial_lines(eigen)])


def _polynomial_lines(eigen: Eigen) -> Iterator[Line]:
    name = _named(eigen)
    if not isinstance(eigen.polynomial, Polynomial):
        damped = eigen.polynomial.has(sp.Symbol("s"))
        yield Line(f"{name}det(s² M + s D + K)" if damped else f"{name}in x = ω²", equal(eigen.polynomial, 0))
        if not damped:
            yield Line(f"{name}in λ = −1/ω²", equal(_turned(eigen.polynomial), 0))
        return
    unit = "l/g" if eigen.polynomial.unit == "g/l" else "(rad²/s²)"
    yield Line(f"{name}in x = ω² {unit}", equal(expression(eigen.polynomial), 0))
    if eigen.polynomial.coefficients[-1]:
        words = "in λ = −g/(l ω²), as paper 001 has it" if unit == "l/g" else "in λ = −1/ω² (s²)"
        yield Line(name + words, equal(expression(eigen.polynomial.in_lambda()), 0))


def _turned(polynomial: Any) -> Any:
    """λ^n p(−1/λ), its highest coefficient without a sign, every coefficient factored."""
    coefficients = sp.Poly(polynomial, sp.Symbol("x")).all_coeffs()
    n = len(coefficients) - 1
    turned = ((-1) ** k * sp.factor(c) * sp.Symbol("lambda") ** (n - k) for k, c in enumerate(reversed(coefficients)))
    return sp.Add(*((-1) ** n * term for term in turned))


def _named(eigen: Eigen) -> str:
    times = f"{eigen.multiplicity} times" if eigen.multiplicity > 1 else ""
    words = ", ".join(word for word in (eigen.label, times) if word)
    return f"{words}; " if words else ""


def modes_section(system: SymbolicSystem, scene: Scene | None) -> Section:
    """Every mode in closed form where there is one, else to 20 proved digits; a damped one to 15."""
    found = eigen_polynomials(system, scene)
    if isinstance(found, str):
        return Section("Modes", [Line(f"{found}; see the table, or prove digits with enclose")])
    return Section("Modes", [line for eigen in found for line in _mode_lines(eigen)] + _remarks(system, found))


def _mode_lines(eigen: Eigen) -> Iterator[Line]:
    if isinstance(eigen.polynomial, Polynomial):
        if eigen.polynomial.degree > MOST_ISOLATED:
            yield Line(f"{_named(eigen)}degree {eigen.polynomial.degree}: see the table, or prove digits with enclose")
        else:
            yield from (_root(root, eigen) for root in polynomial_roots(eigen.polynomial, WIDTH))
    elif eigen.is_damped:
        yield from _damped(eigen)
    else:
        yield from _in_symbols(eigen)


def _root(root: Root, eigen: Eigen) -> Line:
    square = root.exact if root.exact is not None else sp.Float(sp.Rational((root.low + root.high) / 2), 20)
    grows = root.high < 0
    unit = "√(g/l)" if eigen.polynomial.unit == "g/l" else "1/s" if grows else "rad/s"
    rate = f"{'growth rate' if grows else 'ω'} = {sp.sqrt(sp.Abs(square)).evalf(15)} {unit}"
    return Line(_named(eigen) + rate, equal(sp.Symbol("x"), square))


def _in_symbols(eigen: Eigen) -> Iterator[Line]:
    """Closed forms, irreducible factor by factor, where the degree allows."""
    x, omega = sp.Symbol("x"), sp.Symbol("omega")
    for factor, count in sp.factor_list(eigen.polynomial, x)[1]:
        polynomial = sp.Poly(factor, x)
        times = f"{count} times; " if count > 1 else ""
        if polynomial.degree() >= CLOSED:
            yield Line(f"{_named(eigen)}degree {polynomial.degree()}: no closed form that helps, give numbers")
            continue
        for square in sp.roots(polynomial):
            simple = sp.simplify(square)
            if simple.is_negative:
                yield Line(f"{_named(eigen)}{times}growth rate σ", equal(sp.Symbol("sigma") ** 2, -simple))
            else:
                yield Line(f"{_named(eigen)}{times}natural frequency", equal(omega**2, simple))


def _damped(eigen: Eigen) -> Iterator[Line]:
    """Roots s of a polynomial in numbers, one of each conjugate pair, by its simple factors."""
    s = sp.Symbol("s")
    if sp.sympify(eigen.polynomial).free_symbols != {s} or sp.degree(eigen.polynomial, s) > MOST_SOLVED:
        yield Line(f"{_named(eigen)}damped, in symbols: no closed form that helps, give numbers")
        return
    for factor, count in sp.factor_list(eigen.polynomial, s)[1]:
        for root in sp.Poly(factor, s).nroots(n=20, maxsteps=500):
            if sp.im(root) >= 0:
                words = _damped_words(root) + (f", {count} times" if count > 1 else "")
                yield Line(_named(eigen) + words, equal(s, sp.N(root, 15)))


def _damped_words(root: Any) -> str:
    size = sp.Abs(root)
    if size == 0:
        return "rigid translation"
    if sp.im(root) == 0:
        return f"{'grows' if root > 0 else 'decays'} at {sp.N(size, 15)} 1/s"
    return f"ω = {sp.N(size, 15)} rad/s, ζ = {sp.N(-sp.re(root) / size, 6)}"


def _remarks(system: SymbolicSystem, found: list[Eigen]) -> list[Line]:
    """The shapes and masses of equal bobs; the mode that a massless cart over bobs has lost."""
    first = found[0].polynomial
    bobs = len(found) == 1 and isinstance(first, Polynomial) and first.unit == "g/l" and _all_bobs(system)
    lines = []
    if bobs:
        shape = sp.Function("L_j")(sp.Symbol("x_r"))
        words = "mode shape r: bob j = 0, 1, … from the free end swings aside by Laguerre's polynomial"
        lines.append(Line(words, equal(sp.Symbol("y_j"), shape)))
        lines.append(Line("modal effective mass", equal(sp.Symbol("m_eff"), sp.Symbol("m") / sp.Symbol("x_r"))))
    degree = sum(sp.degree(*_with_symbol(eigen)) * eigen.multiplicity for eigen in found)
    damped = any(eigen.is_damped for eigen in found)
    if system.cart and not damped and degree < len(system.coordinates) + system.spatial * len(system.links):
        lines.append(Line("M is singular (a massless cart over bobs): one mode has no finite frequency"))
    return lines


def _all_bobs(system: SymbolicSystem) -> bool:
    return all(c.centre == c.length and not any(c.inertia) and min(c.sigma) > 0 for c in system.chains)


def _with_symbol(eigen: Eigen) -> tuple[Any, Any]:
    x = sp.Symbol("x")
    return (expression(eigen.polynomial) if isinstance(eigen.polynomial, Polynomial) else eigen.polynomial), x


def expression(polynomial: Polynomial) -> Any:
    """A polynomial in SymPy."""
    return sp.Poly(polynomial.coefficients, sp.Symbol(polynomial.variable)).as_expr()
