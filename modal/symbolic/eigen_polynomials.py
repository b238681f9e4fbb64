"""Which eigen-polynomials a system in symbols or numbers has: one for each set of modes that move together.

numbers             primitive integer factors in x = ω² (rad²/s²)
one m, l and g      the same of one chain in x = ω² l/g
symbols             by the recursion along each chain, in x = ω²
springs, dampers    det(K − x M) or det(s² M + s D + K)
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from modal.exact import Polynomial, equal_bobs, of_scene
from modal.scene import Scene
from modal.symbolic.roots import Kind, of_kinds
from modal.symbolic.system import Chain, SymbolicSystem

MOST_LINKS = 60
"""Links in numbers whose polynomial can still be read."""
MOST_SYMBOLIC_LINKS = 5
"""Links with masses or lengths of their own whose polynomial can still be read."""
MOST_IN_DETERMINANT = 12


class Eigen(NamedTuple):
    """A polynomial in x or s, how often it occurs and what it moves; exact integers or an expression in symbols."""

    label: str
    multiplicity: int
    polynomial: Polynomial | Any

    @property
    def is_damped(self) -> bool:
        """Whether it is a polynomial in s."""
        return not isinstance(self.polynomial, Polynomial) and bool(self.polynomial.has(sp.Symbol("s")))


@cache
def eigen_polynomials(system: SymbolicSystem, scene: Scene | None) -> list[Eigen] | str:
    """All of a system, `scene` being what it writes in numbers if anything; or in words why they are not written."""
    numbers = not _symbols(system)
    links = len(system.links)
    if n := _equal_bobs(system):
        return [Eigen("", 1 + system.spatial, equal_bobs(n, "x"))]
    if links > (MOST_LINKS if len(_own_symbols(system)) <= 2 else MOST_SYMBOLIC_LINKS):
        return f"{links} links: too long to write out (modal.polynomials has no such limit for numbers)"
    if scene is not None and numbers and not scene.has_damping:
        return [Eigen(factor.label, factor.multiplicity, factor.polynomial) for factor in of_scene(scene)]
    if not _is_plain(system):
        return _determinant(system)
    if (
        not system.cart
        and len(set(system.chains)) == 1
        and len(_symbols(system)) == 3
        and len(_own_symbols(system)) == 2
    ):
        return [_without_units(system)]
    return _of_recursion(system)


def _symbols(system: SymbolicSystem) -> set[Any]:
    values = [system.gravity, system.total_mass, *(v for chain in system.chains for row in chain.geometry for v in row)]
    return {name for value in values for name in sp.sympify(value).free_symbols}


def _own_symbols(system: SymbolicSystem) -> set[Any]:
    """The symbols of masses and lengths of links."""
    values = (v for chain in system.chains for v in (*chain.mass, *chain.length))
    return {name for value in values for name in value.free_symbols}


def _equal_bobs(system: SymbolicSystem) -> int:
    """How many equal bobs hang in the one chain of a system in symbols m, l and g; 0 for any other system."""
    if system.cart or len(system.chains) != 1 or not _is_plain(system) or len(_symbols(system)) != 3:
        return 0
    only: Chain = system.chains[0]
    same = len({*zip(only.mass, only.length, strict=True)}) == 1
    bobs = only.centre == only.length and not any(only.inertia) and min(only.sigma) > 0
    return len(only.mass) if same and bobs else 0


def _is_plain(system: SymbolicSystem) -> bool:
    """Whether there are no springs and dampers, so that the recursion along a chain holds."""
    extras = [value for chain in system.chains for value in (*chain.stiffness, *chain.damping)]
    extras += [system.cart.stiffness, system.cart.damping] if system.cart else []
    return not any(extras)


def _without_units(system: SymbolicSystem) -> Eigen:
    """Equal chains of one m and one l on a fixed support, in x = ω² l/g."""
    first = system.chains[0]
    units = dict.fromkeys(_symbols(system), 1)
    geometry = [[value.subs(units) for value in row] for row in first.geometry]
    formula = of_kinds([Kind(geometry, first.sigma, 1)], 1)
    coefficients = [int(c) for c in sp.Poly(formula, sp.Symbol("x")).all_coeffs()]
    copies = len(system.chains) * (1 + system.spatial)
    return Eigen("", copies, Polynomial(tuple(coefficients), "x", "g/l"))


def _of_recursion(system: SymbolicSystem) -> list[Eigen]:
    counts: dict[Chain, int] = {}
    for chain in system.chains:
        counts[chain] = counts.get(chain, 0) + 1
    kinds = [Kind(chain.geometry, chain.sigma, count) for chain, count in counts.items()]
    found = []
    if system.cart:
        found.append(Eigen("rigid translation", 1, Polynomial((1, 0))))
        found.append(Eigen("the cart moves", 1, of_kinds(kinds, system.gravity, cart=system.cart.mass)))
    for kind in kinds:
        copies = kind.count * (1 + system.spatial) - (1 if system.cart else 0)
        if copies:
            name = f"pendulum {system.chains.index(_chain_of(system, kind)) + 1}" if len(kinds) > 1 else ""
            where = "the cart stays still" if system.cart else ""
            label = ": ".join(word for word in (where, name) if word)
            found.append(Eigen(label, copies, of_kinds([kind], system.gravity)))
    return found


def _chain_of(system: SymbolicSystem, kind: Kind) -> Chain:
    return next(c for c in system.chains if c.geometry == kind.geometry and c.sigma == kind.sigma)


def _determinant(system: SymbolicSystem) -> list[Eigen] | str:
    """Of the motion along the rail; across it, of every pendulum on a fixed support."""
    if len(system.coordinates) > MOST_IN_DETERMINANT or (_symbols(system) and len(system.coordinates) > 5):
        return f"{len(system.coordinates)} coordinates with springs or dampers: too long to write out"
    found = [Eigen("along the rail" if system.spatial else "", 1, _expanded(system))]
    if system.spatial:
        for chain in dict.fromkeys(system.chains):
            alone = SymbolicSystem("", system.gravity, (chain,), None)
            found.append(Eigen("across the rail", system.chains.count(chain), _expanded(alone)))
    return found


def _expanded(system: SymbolicSystem) -> Any:
    M, K, D = system.matrices()
    s, x = sp.symbols("s x")
    matrix = M * s**2 + D * s + K if any(D) else K - x * M
    determinant = DomainMatrix.from_Matrix(matrix).charpoly()[-1] * (-1) ** matrix.rows
    field = DomainMatrix.from_Matrix(matrix).domain
    return sp.factor(field.to_sympy(determinant))
