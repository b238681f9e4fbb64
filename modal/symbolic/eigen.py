"""The eigen-polynomials and the modes of a system in print: closed forms where they exist, else proved digits.

There is one polynomial for each set of modes that move together:

    numbers             primitive integer factors in x = ω² (rad²/s²)
    one m, l and g      the same for one chain in x = ω² l/g
    symbols             by the recursion along each chain, in x = ω²
    springs, dampers    det(K − x M) or det(s² M + s D + K)

Characteristic polynomials may have symbols.  Of roots degrees 1 and 2 have radicals; an irreducible cubic with three
real roots has none without complex numbers (casus irreducibilis), but cosines: x_k = −c₁/(3 c₀) + 2 √(−p/3) cos(⅓
arccos(3q/(2p) √(−3/p)) − 2πk/3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, reduce
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
import sympy as sp
from sympy.polys.fields import FracField
from sympy.polys.matrices import DomainMatrix

from modal import pair
from modal.exact import Polynomial, Variable, eliminate_links, equal_bobs, isolate, multiple, of_scene, product, total
from modal.modes import natural_modes
from modal.scene import Scene
from modal.scene.points import CarrierEnd
from modal.symbolic.carriers import ORIGIN, STILL, Chain
from modal.symbolic.papers import equal
from modal.symbolic.structures import SymbolicStructure
from modal.symbolic.typesetting import Conjugates, Line, PlusMinus, Section, is_short
from modal.types import EPS

MOST_FACTORED = 12
"""Limit: degree of polynomials that are searched for rational factors, or come from a determinant; not beyond."""


@dataclass(frozen=True)
class Root:
    """low < root ≤ high, its multiplicity, and the root itself in closed form (None without one of degree ≤ 3)."""

    exact: sp.Expr | None
    low: Fraction
    high: Fraction
    multiplicity: int


def polynomial_roots(polynomial: Polynomial, width: Fraction | float = 1e-15) -> list[Root]:
    """Ascending roots, each in closed form if there is one and in any case in an interval.

    No interval is wider than `width` times its smaller end; the root 0 is exact.
    """
    roots = [root for factor, count in _factors(polynomial) for root in _of_factor(factor, count, Fraction(width))]
    return sorted(roots, key=lambda root: root.low + root.high)


def closed_forms(coefficients: Sequence[Any]) -> list[sp.Expr] | None:
    """Ascending roots of a real-rooted polynomial of degree 1 to 3 in closed form, highest power first, else None.

    The coefficients may be symbols.
    """
    c = [sp.sympify(value) for value in coefficients]
    if len(c) == 2:
        return [sp.factor(-c[1] / c[0])]
    if len(c) == 3:
        middle, offset = -c[1] / (2 * c[0]), sp.sqrt(sp.factor(c[1] ** 2 - 4 * c[0] * c[2])) / (2 * c[0])
        return [middle - offset, middle + offset]
    return _cosines(*c) if len(c) == 4 else None


def symbolic(
    n: int,
    kind: Literal["bob", "rod"] = "bob",
    *,
    cart: bool = False,
    count: Any = 1,
    variable: Variable = "x",
) -> sp.Expr:
    """The polynomial of n unequal bobs or rods in symbols m_i, l_i, g, powers collected and coefficients factored.

    On a free cart of mass m_c, for `count` equal pendula (a number or a symbol): the factor of the modes that move the
    cart.  In x = ω² (rad²/s²), or in λ = −g/ω² (m), where g cancels: det(A + λ diag b), with equal lengths
    (12) to (14) of paper 001.
    """
    m, l = ([sp.Symbol(f"{name}_{i + 1}", positive=True) for i in range(n)] for name in "ml")
    centre, inertia = zip(*map(pair.proportions, [kind] * n, m, l), strict=True)
    kind_of_chain = Kind((m, l, centre, inertia), (1,) * n, count)
    mass = sp.Symbol("m_c", positive=True) if cart else None
    return of_kinds([kind_of_chain], sp.Symbol("g", positive=True), cart=mass, variable=variable)


class Kind(NamedTuple):
    """`count` equal chains: masses, lengths, centres, moments of inertia, and σ = ±1 for a link down or up."""

    geometry: Sequence[Sequence[Any]]
    sigma: Sequence[int]
    count: Any


def of_kinds(kinds: Sequence[Kind], gravity: Any, *, cart: Any = None, variable: Variable = "x") -> sp.Expr:
    """The polynomial for chains in any symbols and exact numbers: of one alone, or of those that move a free cart.

    `cart` is its mass; None means the first kind on a fixed support.
    """
    g, m_c = sp.sympify(gravity), sp.sympify(cart or 0)
    values = [v for kind in kinds for row in (*kind.geometry, [kind.count]) for v in row]
    names = {name for value in (g, m_c, *map(sp.sympify, values)) for name in value.free_symbols}
    field = FracField(sorted(names, key=str) or [sp.Symbol("x")], sp.ZZ)
    chains = [(_recursion(kind, field, field.from_expr(g)), field.from_expr(sp.sympify(kind.count))) for kind in kinds]
    if cart is None:
        return _collect(chains[0][0][0], g, variable)
    d, N = [field.one], [field.zero]
    for (denominator, force), count in chains:
        d, N = product(d, denominator), total(product(N, denominator), multiple(count, product(d, force)))
    moving = total(multiple(field.from_expr(m_c), d), N)
    return _collect(moving, g, variable)


def _recursion(kind: Kind, field: FracField, gravity: Any) -> tuple[list[Any], list[Any]]:
    mass, length, centre, inertia = ([field.from_expr(sp.sympify(v)) for v in row] for row in kind.geometry)
    hanging = pair.constants(mass, length, centre, inertia, gravity)
    d, N = eliminate_links(pair.standing(hanging, kind.sigma), _clear)
    return [field(c) for c in d], [field(c) for c in N]


def _clear(values: list[Any]) -> list[Any]:
    """Rational functions times their least common denominator, divided by their common content."""
    unit = reduce(lambda a, b: a.lcm(b), (value.denom for value in values))
    return _primitive_parts([value.numer * unit.exquo(value.denom) for value in values])


def _primitive_parts(values: list[Any]) -> list[Any]:
    common_factor = reduce(lambda a, b: a.gcd(b), values)
    return [value.exquo(common_factor) for value in values]


def _collect(ascending: list[Any], g: sp.Expr, variable: Variable) -> sp.Expr:
    """Σ c_k x^k with every c_k factored, or with x = −g/λ, times λ^n/g^n: Σ (−1)^k g^{k−n} c_k λ^{n−k}."""
    n = len(ascending) - 1
    coefficients = [c.as_expr() for c in _clear(ascending)]
    if variable == "x":
        return sp.Add(*((-1) ** n * sp.factor(c) * sp.Symbol("x") ** k for k, c in enumerate(coefficients)))
    return sp.Add(
        *((-1) ** k * sp.factor(c * g ** (k - n)) * sp.Symbol("lambda") ** (n - k) for k, c in enumerate(coefficients))
    )


def _factors(polynomial: Polynomial) -> Iterator[tuple[list[int], int]]:
    """Irreducible factors over the rationals and their multiplicities, where the degree is modest."""
    c = list(polynomial.coefficients)
    if polynomial.degree > MOST_FACTORED:
        return iter([(c, 1)])
    _, factors = sp.Poly(c, sp.Symbol("x")).factor_list()
    return ((list(map(int, factor.all_coeffs())), int(count)) for factor, count in factors)


def _of_factor(coefficients: list[int], count: int, width: Fraction) -> Iterator[Root]:
    if coefficients == [1, 0]:
        yield Root(sp.S.Zero, Fraction(0), Fraction(0), count)
        return
    intervals = isolate(coefficients, width, relative=coefficients[-1] != 0)
    exact = closed_forms(coefficients) or [None] * len(intervals)
    for form, interval in zip(exact, intervals, strict=True):
        yield Root(form, interval.low, interval.high, count * interval.multiplicity)


def _cosines(a: sp.Expr, b: sp.Expr, c: sp.Expr, d: sp.Expr) -> list[sp.Expr]:
    """Three distinct real roots of a x³ + b x² + c x + d, ascending (Viète)."""
    p = (3 * a * c - b**2) / (3 * a**2)
    q = (2 * b**3 - 9 * a * b * c + 27 * a**2 * d) / (27 * a**3)
    third = sp.acos(3 * q / (2 * p) * sp.sqrt(-3 / p)) / 3
    return [-b / (3 * a) + 2 * sp.sqrt(-p / 3) * sp.cos(third - 2 * sp.pi * k / 3) for k in (2, 1, 0)]


MOST_READABLE = 60
"""Limit: links in numbers, or degree, of a polynomial that is written and whose roots are isolated; said beyond."""
MOST_IN_SYMBOLS = 5
"""Limit: links or coordinates with symbols of their own of which a polynomial is written; said beyond."""
WIDTH = Fraction(1, 10**21)
RECIPROCAL = "−1/ω²"


class EigenPolynomial(NamedTuple):
    """A polynomial in x or s, its multiplicity and what moves; exact integers or an expression in symbols."""

    label: str
    multiplicity: int
    polynomial: Polynomial | Any

    @property
    def is_damped(self) -> bool:
        """Whether it is a polynomial in s."""
        return not isinstance(self.polynomial, Polynomial) and bool(self.polynomial.has(sp.Symbol("s")))


@cache
def eigen_polynomials(system: SymbolicStructure, scene: Scene | None) -> list[EigenPolynomial] | str:
    """All polynomials of a system, `scene` its exact numbers if any; or the reason why they are omitted."""
    if not system.is_of_pair:
        return _determinant(system)
    on_cart = bool(system.carriers[0].coordinates)
    links = len(system.links)
    if n := _equal_bobs(system):
        return [EigenPolynomial("", 1 + system.spatial, equal_bobs(n, "x"))]
    if links > (MOST_READABLE if len(_own_symbols(system)) <= 2 else MOST_IN_SYMBOLS):
        return f"{links} links: too long to write out (modal.exact has no such limit for numbers)"
    if scene is not None and not system.symbols and not scene.has_damping:
        is_single = not on_cart and len(system.chains) == 1 and not system.spatial
        return [
            EigenPolynomial("" if is_single else factor.label, factor.multiplicity, factor.polynomial)
            for factor in of_scene(scene)
        ]
    if not _is_plain(system):
        return _determinant(system)
    if not on_cart and len(set(system.chains)) == 1 and len(system.symbols) == 3 and len(_own_symbols(system)) == 2:
        return [_without_units(system)]
    return _of_recursion(system)


def _own_symbols(system: SymbolicStructure) -> set[Any]:
    """The symbols of masses and lengths of links."""
    values = (v for chain in system.chains for v in (*chain.mass, *chain.length))
    return {name for value in values for name in value.free_symbols}


def _equal_bobs(system: SymbolicStructure) -> int:
    """The number of equal bobs in the only chain of a system in symbols m, l and g; 0 for any other system."""
    if system.carriers[0].coordinates or len(system.chains) != 1 or not _is_plain(system) or len(system.symbols) != 3:
        return 0
    chain: Chain = system.chains[0]
    is_uniform = len({*zip(chain.mass, chain.length, strict=True)}) == 1
    return len(chain.mass) if is_uniform and chain.is_of_bobs and min(chain.sigma) > 0 else 0


def _is_plain(system: SymbolicStructure) -> bool:
    """Whether there are no springs and dampers, so that the recursion along a chain holds."""
    support = system.carriers[0]
    return not (system.has_joint_forces or any(support.stiffness) or any(support.damping))


def _without_units(system: SymbolicStructure) -> EigenPolynomial:
    """Equal chains of one m and one l on a fixed support, in x = ω² l/g."""
    first = system.chains[0]
    units = dict.fromkeys(system.symbols, 1)
    geometry = [[value.subs(units) for value in row] for row in first.geometry]
    formula = of_kinds([Kind(geometry, first.sigma, 1)], 1)
    coefficients = [int(c) for c in sp.Poly(formula, sp.Symbol("x")).all_coeffs()]
    copies = len(system.chains) * (1 + system.spatial)
    return EigenPolynomial("", copies, Polynomial(tuple(coefficients), "x", "g/l"))


def _of_recursion(system: SymbolicStructure) -> list[EigenPolynomial]:
    counts: dict[Chain, int] = {}
    for chain in system.chains:
        counts[chain] = counts.get(chain, 0) + 1
    kinds = [Kind(chain.geometry, chain.sigma, count) for chain, count in counts.items()]
    polynomials, support = [], system.carriers[0]
    on_cart = len(support.coordinates)
    if on_cart:
        polynomials.append(EigenPolynomial("rigid translation", 1, Polynomial((1, 0))))
        polynomials.append(EigenPolynomial("the cart moves", 1, of_kinds(kinds, system.gravity, cart=support.mass)))
    for kind in kinds:
        copies = kind.count * (1 + system.spatial) - on_cart
        if copies:
            name = f"pendulum {system.chains.index(_chain_of(system, kind)) + 1}" if len(kinds) > 1 else ""
            where = "the cart stays still" if on_cart else ""
            label = ": ".join(word for word in (where, name) if word)
            polynomials.append(EigenPolynomial(label, copies, of_kinds([kind], system.gravity)))
    return polynomials


def _chain_of(system: SymbolicStructure, kind: Kind) -> Chain:
    return next(c for c in system.chains if c.geometry == kind.geometry and c.sigma == kind.sigma)


def _determinant(system: SymbolicStructure) -> list[EigenPolynomial] | str:
    """Polynomials of the motion along the rail; across it, of every pendulum on a fixed support."""
    size = len(system.coordinates)
    if size > MOST_FACTORED or (system.symbols and size > MOST_IN_SYMBOLS):
        of = "with springs or dampers" if system.is_of_pair else "of a structure"
        return f"{size} coordinates {of}: too long to write out"
    if not system.spatial:
        polynomial = _factored_determinant(system)
        return [EigenPolynomial("", 1, polynomial)] if system.is_of_pair else _eigen_factors(polynomial)
    polynomials = [EigenPolynomial("along the rail", 1, _factored_determinant(system))]
    for chain in dict.fromkeys(system.chains):
        single_chain = SymbolicStructure("", system.gravity, (STILL,), (chain,), (CarrierEnd(0, ORIGIN),))
        polynomials.append(
            EigenPolynomial("across the rail", system.chains.count(chain), _factored_determinant(single_chain))
        )
    return polynomials


def _eigen_factors(polynomial: Any) -> list[EigenPolynomial]:
    """The factors of a polynomial in x, in integers where there is no symbol."""
    x = sp.Symbol("x")
    if polynomial.free_symbols != {x}:
        return [EigenPolynomial("", 1, polynomial)]
    factors = sp.Poly(polynomial, x).factor_list()[1]
    integers = [(sp.Poly(factor, x).clear_denoms(convert=True)[1].primitive()[1], count) for factor, count in factors]
    eigen = [EigenPolynomial("", count, Polynomial(tuple(map(int, factor.all_coeffs())))) for factor, count in integers]
    return sorted(eigen, key=lambda factor_in_x: factor_in_x.polynomial.intervals()[0].low)


def _factored_determinant(system: SymbolicStructure, *, has_dampers: bool = True) -> Any:
    M, K, D = system.matrices()
    s, x = sp.symbols("s x")
    matrix = M * s**2 + D * s + K if any(D) and has_dampers else K - x * M
    determinant = DomainMatrix.from_Matrix(matrix).charpoly()[-1] * (-1) ** matrix.rows
    field = DomainMatrix.from_Matrix(matrix).domain
    return sp.factor(field.to_sympy(determinant))


def polynomial_section(system: SymbolicStructure, scene: Scene | None) -> Section:
    """The eigen-polynomials in their named conventions, factor by factor."""
    polynomials = eigen_polynomials(system, scene)
    if isinstance(polynomials, str):
        return Section("Eigen-polynomial", [Line(polynomials)])
    lines = [line for eigen in polynomials for line in _polynomial_lines(eigen)]
    if any(eigen.is_damped for eigen in polynomials) and not system.spatial:
        undamped = _without_content(_factored_determinant(system, has_dampers=False))
        lines.append(Line("without dampers, in $x = ω²$", equal(undamped, 0)))
    return Section("Eigen-polynomial", _with_place_along(system, lines))


def _with_place_along(system: SymbolicStructure, lines: list[Line]) -> list[Line]:
    """The lines in ω² itself where x is a place along the rail, without the reciprocal form."""
    if not any(str(c.q).partition("_")[0] == "x" for c in system.coordinates):
        return lines
    letters = {sp.Symbol("x"): sp.Symbol("omega") ** 2}
    new_lines = []
    for words, formula in lines:
        is_shape = formula is None or isinstance(formula.lhs, sp.Tuple)  # whose x is a place
        if RECIPROCAL not in words:
            new_lines.append(Line(words.replace("$x = ω²", "$ω²"), formula if is_shape else formula.xreplace(letters)))
    return new_lines


def _polynomial_lines(eigen: EigenPolynomial) -> Iterator[Line]:
    name = _heading_words(eigen)
    if not isinstance(eigen.polynomial, Polynomial):
        has_dampers = eigen.polynomial.has(sp.Symbol("s"))
        words = f"{name}$det(s² M + s D + K)$" if has_dampers else f"{name}in $x = ω²$"
        yield Line(words, equal(_without_content(eigen.polynomial), 0))
        if not has_dampers:
            yield Line(f"{name}in $λ = {RECIPROCAL}$", equal(_reciprocal_form(eigen.polynomial), 0))
        return
    unit = "l/g" if eigen.polynomial.unit == "g/l" else "(rad²/s²)"
    yield Line(f"{name}in $x = ω² {unit}$", equal(expression(eigen.polynomial), 0))
    if eigen.polynomial.coefficients[-1]:
        words = "in $λ = −g/(l ω²)$, as paper 001 has it" if unit == "l/g" else f"in $λ = {RECIPROCAL} (s²)$"
        yield Line(name + words, equal(expression(eigen.polynomial.in_lambda()), 0))


def _without_content(polynomial: Any) -> Any:
    """A factored polynomial in numbers with integer coefficients; one with symbols as it is."""
    if len(polynomial.free_symbols) > 1:
        return polynomial
    return sp.Mul(*(factor**count for factor, count in sp.factor_list(polynomial)[1]))


def _reciprocal_form(polynomial: Any) -> Any:
    """λ^n p(−1/λ) with a positive highest coefficient, every coefficient factored."""
    coefficients = sp.Poly(polynomial, sp.Symbol("x")).all_coeffs()
    n = len(coefficients) - 1
    terms = ((-1) ** k * sp.factor(c) * sp.Symbol("lambda") ** (n - k) for k, c in enumerate(reversed(coefficients)))
    return sp.Add(*((-1) ** n * term for term in terms))


def _heading_words(eigen: EigenPolynomial) -> str:
    times = f"{eigen.multiplicity} times" if eigen.multiplicity > 1 else ""
    words = ", ".join(word for word in (eigen.label, times) if word)
    return f"{words}; " if words else ""


def modes_section(system: SymbolicStructure, scene: Scene | None) -> Section:
    """Every mode in closed form if there is one, else to 20 proved digits; a damped one to 15."""
    polynomials = eigen_polynomials(system, scene)
    if isinstance(polynomials, str):
        return Section("Modes", [Line(f"{polynomials}; see the table, or prove digits with enclose")])
    all_modes = [mode for eigen in polynomials for mode in _modes_of(eigen, system)]
    computed_modes = [mode for mode in all_modes if isinstance(mode, ComputedMode)]
    are_computed = len(computed_modes) == len(all_modes)
    families = _certain_families(scene) if scene and are_computed else []
    lines = _number_modes(computed_modes, families) if are_computed else _name_modes(all_modes, system, scene)
    return Section("Modes", _with_place_along(system, [*lines, *_remarks(system, polynomials)]))


def _certain_families(scene: Scene) -> list[str]:
    """What the table calls each of its modes, empty where it has no certain digit: symbols and integers do."""
    modes = natural_modes(scene)
    return [
        family if np.isfinite(error) else ""
        for family, error in zip(modes.family.tolist(), modes.relative_error_bound.tolist(), strict=True)
    ]


class ComputedMode(NamedTuple):
    """A mode in numbers: the size of its eigenvalue, what moves, its rate in words, its root."""

    size: Any
    label: str
    words: str
    formula: Any
    grows: bool = False


def _number_modes(modes: list[ComputedMode], families: list[str]) -> Iterator[Line]:
    """The modes in the order of the table with its numbers and words: those of one frequency share one."""
    ordered, numbers = sorted(modes, key=lambda mode: (mode.size, mode.grows)), [1]
    for before, mode in pairwise(ordered):
        is_same = mode.grows == before.grows and mode.size - before.size <= 4 * EPS * mode.size
        numbers.append(numbers[-1] + (not is_same))
    has_families = len(families) == numbers[-1]
    for number, mode in zip(numbers, ordered, strict=True):
        name = (families[number - 1] if has_families else "") or mode.label.removesuffix("; ")
        rate = "" if mode.words == name else mode.words
        yield Line("; ".join(filter(None, (f"mode {number}", name, rate))), mode.formula)


def _name_modes(modes: list[ComputedMode | Line], system: SymbolicStructure, scene: Scene | None) -> Iterator[Line]:
    """The modes, those in symbols of a scene with the number and the words that the table has for its own numbers."""
    table = natural_modes(scene.conservative) if scene and system.values and "joint" not in scene.features else None
    for mode in modes:
        words, formula = mode if isinstance(mode, Line) else (mode.label + mode.words, mode.formula)
        if table and words.endswith("natural frequency"):
            square = float(formula.rhs.subs(system.values))
            number = int(np.abs(table.omega**2 - square).argmin())
            words = f"mode {number + 1}; {table.family[number]}; {words}"
        yield Line(words, formula)


def _modes_of(eigen: EigenPolynomial, system: SymbolicStructure) -> Iterator[ComputedMode | Line]:
    if isinstance(eigen.polynomial, Polynomial):
        if eigen.polynomial.degree > MOST_READABLE:
            yield Line(
                f"{_heading_words(eigen)}degree {eigen.polynomial.degree}: see the table, or prove digits with enclose"
            )
        else:
            yield from (_root(root, eigen) for root in polynomial_roots(eigen.polynomial, WIDTH))
    elif eigen.is_damped:
        yield from _damped_roots(eigen)
    else:
        yield from _in_symbols(eigen, system)


def _root(root: Root, eigen: EigenPolynomial) -> ComputedMode:
    square = root.exact if root.exact is not None else sp.Float(sp.Rational((root.low + root.high) / 2), 20)
    grows = root.high < 0
    unit = "√(g/l)" if eigen.polynomial.unit == "g/l" else "1/s" if grows else "rad/s"
    size = sp.sqrt(sp.Abs(square)).evalf(20)
    rate = f"{'growth rate $=' if grows else '$ω ='} {sp.N(size, 15)} {unit}$"
    letter = sp.Symbol("x") if eigen.polynomial.unit == "g/l" else sp.Symbol("omega") ** 2
    return ComputedMode(size, _heading_words(eigen), rate, equal(letter, square), grows)


def _in_symbols(eigen: EigenPolynomial, system: SymbolicStructure) -> Iterator[Line]:
    """Closed forms and shapes of each irreducible factor, where the degree allows."""
    x, omega = sp.Symbol("x"), sp.Symbol("omega")
    factors = [(sp.Poly(factor, x), count) for factor, count in sp.factor_list(eigen.polynomial, x)[1]]
    for polynomial, count in sorted(factors, key=lambda factor: _rank(factor[0])):
        times = f"{count} times; " if count > 1 else ""
        if polynomial.degree() >= 3:  # whose closed forms are unreadable
            yield Line(f"{_heading_words(eigen)}degree {polynomial.degree()}: no useful closed form; use numbers")
            continue
        if polynomial.degree() == 2:
            yield Line(
                f"{_heading_words(eigen)}{times}natural frequencies", equal(omega**2, _pair_of_roots(polynomial))
            )
            yield from _shape(system, polynomial)
            continue
        simple = _simple_root(polynomial)
        if simple.is_negative:
            yield Line(f"{_heading_words(eigen)}{times}growth rate $σ$", equal(sp.Symbol("sigma") ** 2, -simple))
        else:
            yield Line(f"{_heading_words(eigen)}{times}natural frequency", equal(omega**2, simple))
        yield from _shape(system, polynomial)


def _shape(system: SymbolicStructure, polynomial: Any) -> Iterator[Line]:
    """The shape of the modes of an irreducible factor, in ω² where it has two; its first angle that moves is 1.

    Of degree 2 it solves all rows of (K − x M) q = 0 but the last, which vanishes where the factor does.
    """
    x, has_one_root = sp.Symbol("x"), polynomial.degree() == 1
    M, K, _ = system.matrices()
    if system.spatial or not 2 <= M.rows <= (MOST_IN_SYMBOLS if has_one_root else 2):
        return  # of one coordinate it is no shape, and of many an unreadable formula
    rows = K - x * M
    solved = rows.subs(x, _simple_root(polynomial)).applyfunc(sp.cancel) if has_one_root else rows[:-1, :]
    shapes = solved.nullspace(simplify=sp.cancel)
    moving = [value for value in shapes[0][-len(system.angles) :] if value != 0] if shapes else []
    if not moving:
        return
    shape = (shapes[0] / moving[0]).applyfunc(sp.factor)
    left = sp.numer(sp.together((rows[-1, :] * shape)[0]))
    values = sp.Tuple(*shape.subs(x, sp.Symbol("omega") ** 2))
    if sp.rem(sp.Poly(left, x), polynomial).is_zero and is_short(sp.latex(values)):
        words = "shape" if len(shapes) == 1 else f"one of {len(shapes)} shapes"
        yield Line(words, equal(sp.Tuple(*(c.q for c in system.coordinates)), values))


def _simple_root(polynomial: Any) -> Any:
    """The root of degree 1 in its shortest form."""
    (square,) = sp.roots(polynomial)
    simple = min(sp.simplify(square), sp.factor_terms(square), key=sp.count_ops)
    return sp.expand(simple) if sp.factor_terms(sp.numer(simple)).is_Add else simple


def _rank(polynomial: Any) -> tuple[int, int]:
    """Ascending as far as symbols have an order: of sums of positive terms the shorter first, higher degrees last."""
    is_of_one = polynomial.degree() == 1
    return polynomial.degree(), len(sp.Add.make_args(_simple_root(polynomial))) if is_of_one else 0


def _pair_of_roots(polynomial: Any) -> Any:
    """Both roots of degree 2, with the discriminant as a product where that is shorter than the sum it expands to."""
    a, b, c = map(sp.factor, polynomial.all_coeffs())
    common_factor = sp.gcd(b**2, a * c)
    discriminant = sp.factor(sp.cancel(b**2 / common_factor)) - 4 * sp.factor(sp.cancel(a * c / common_factor))
    root = min(
        sp.sqrt(sp.factor(b**2 - 4 * a * c)),
        sp.sqrt(sp.factor(common_factor)) * sp.sqrt(discriminant),
        key=sp.count_ops,
    )
    outside, inside = root.as_independent(sp.Pow, as_Add=False) if root.is_Mul else (sp.S.One, root)
    middle, half = sp.factor(-b / (2 * a)), sp.factor(outside / (2 * a))
    return PlusMinus(middle, half * inside)


def _damped_roots(eigen: EigenPolynomial) -> Iterator[ComputedMode | Line]:
    """Roots s of a polynomial in numbers, one of each conjugate pair, from its simple factors."""
    s = sp.Symbol("s")
    if sp.sympify(eigen.polynomial).free_symbols != {s} or sp.degree(eigen.polynomial, s) > 2 * MOST_FACTORED:
        yield Line(f"{_heading_words(eigen)}damped, in symbols: no useful closed form; use numbers")
        return
    for factor, count in sp.factor_list(eigen.polynomial, s)[1]:
        for root in sp.Poly(factor, s).nroots(n=20, maxsteps=500):
            if sp.im(root) >= 0:
                words = _damped_words(root) + (f", {count} times" if count > 1 else "")
                yield ComputedMode(sp.Abs(root), _heading_words(eigen), words, equal(s, _in_digits(root)))


def _in_digits(root: Any) -> Any:
    """A root to 15 digits, with its conjugate if it has one."""
    real, imaginary = sp.N(sp.re(root), 15), sp.N(sp.im(root), 15)
    return Conjugates(real, imaginary) if imaginary else real


def _damped_words(root: Any) -> str:
    size = sp.Abs(root)
    if size == 0:
        return "rigid translation"
    if sp.im(root) == 0:
        return f"{'grows' if root > 0 else 'decays'} at ${sp.N(size, 15)} 1/s$"
    return f"$ω = {sp.N(size, 15)} rad/s$, $ζ = {sp.N(-sp.re(root) / size, 6)}$"


def _remarks(system: SymbolicStructure, polynomials: list[EigenPolynomial]) -> list[Line]:
    """The shapes and masses of equal bobs; the mode lost with a massless cart over bobs."""
    if not system.is_of_pair:
        return []
    first = polynomials[0].polynomial
    bobs = (
        len(polynomials) == 1
        and isinstance(first, Polynomial)
        and first.unit == "g/l"
        and all(chain.is_of_bobs and min(chain.sigma) > 0 for chain in system.chains)
    )
    lines = []
    if bobs:
        shape = sp.Function("L_j")(sp.Symbol("x_r"))
        words = "mode shape $r$: bob $j$ = 0, 1, … from the free end is displaced by Laguerre's polynomial"
        lines.append(Line(words, equal(sp.Symbol("y_j"), shape)))
        lines.append(Line("modal effective mass", equal(sp.Symbol("m_eff"), sp.Symbol("m") / sp.Symbol("x_r"))))
    degree = 0
    for _, count, polynomial in polynomials:
        is_exact = isinstance(polynomial, Polynomial)
        degree += count * (polynomial.degree if is_exact else sp.degree(polynomial, sp.Symbol("x")))
    has_dampers = any(eigen.is_damped for eigen in polynomials)
    if not has_dampers and degree < len(system.coordinates) + len(system.azimuths):
        lines.append(Line("$M$ is singular (a massless cart over bobs): one mode has no finite frequency"))
    return lines


def expression(polynomial: Polynomial) -> Any:
    """A polynomial in SymPy."""
    return sp.Poly(polynomial.coefficients, sp.Symbol(polynomial.variable)).as_expr()
