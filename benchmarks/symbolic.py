"""Symbolic M, K and characteristic polynomials compared with SymPy's mechanics: operations and time in one run.

    python benchmarks/symbolic.py [--quick] [--write]

One chain of n bobs, all masses and lengths different symbols, on a free cart.  The rival is
`sympy.physics.mechanics.models.n_link_pendulum_on_cart`, linearized about the hanging equilibrium: that model measures
angles from the upward vertical, so it hangs at π.  `--write` puts the tables into docs/.  Each route has a process of
its own and a time limit, and its frequencies at one set of numbers must agree with all others'.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from modal import pair
from modal.symbolic import symbolic

DOCS = Path(__file__).parent.parent / "docs"
S, X = sp.symbols("s x")


class Derived(NamedTuple):
    """Expressions, and a function from numbers in place of symbols to ω²."""

    expressions: Sequence[Any]
    squares: Callable[..., np.ndarray]


class Route(NamedTuple):
    """From the number of links to matrices, and from both to a characteristic polynomial."""

    heading: str
    matrices: Callable[[int], Derived]
    polynomial_heading: str
    polynomial: Callable[[int, Sequence[Any]], Derived]


class Cost(NamedTuple):
    """Operations after common subexpression elimination, and seconds from the start; None: not reached."""

    operations: int | None
    seconds: float | None


Costs = dict[tuple[str, int, str], Cost]


# -------------------------------------------------------------------------------------------------------- ours


def our_matrices(n: int) -> Derived:
    g, m_c = sp.symbols("g m_c", positive=True)
    m, l = ([sp.Symbol(f"{name}_{i}", positive=True) for i in range(1, n + 1)] for name in "ml")
    b, A = pair.first_moments(m, l, l), pair.inertia_matrix(m, l, l, [0] * n)
    M = sp.Matrix([[m_c + sum(m), *b], *([moment, *row] for moment, row in zip(b, A, strict=True))])
    K = sp.diag(0, *(g * moment for moment in b))
    return Derived((M, K), lambda M, K: np.linalg.eigvals(np.linalg.solve(M, K)))


def our_polynomial(n: int, _: Sequence[Any]) -> Derived:
    return Derived((symbolic(n, cart=True),), lambda p: np.roots(sp.Poly(p, X).all_coeffs()))


# ------------------------------------------------------------------------------------------------------- SymPy


def hanging(n: int) -> tuple[Any, dict[Any, Any]]:
    """The model and its hanging equilibrium."""
    from sympy.physics.mechanics.models import n_link_pendulum_on_cart

    kane = n_link_pendulum_on_cart(n, cart_force=False, joint_torques=False)
    x, *angles = kane.q
    rest = {x: 0, **dict.fromkeys(angles, sp.pi), **dict.fromkeys(kane.u, 0)}
    return kane, rest | {rate.diff(): 0 for rate in kane.u}


def their_pencil(n: int) -> Derived:
    """M and A of M y' = A y."""
    kane, rest = hanging(n)
    M, A, _ = kane.to_linearizer().linearize(op_point=rest)
    return Derived((M, A), lambda M, A: -(np.linalg.eigvals(np.linalg.solve(M, A)) ** 2))


def their_determinant(_: int, matrices: Sequence[Any]) -> Derived:
    from sympy.polys.matrices import DomainMatrix

    M, A = matrices
    pencil = DomainMatrix.from_Matrix(S * M - A)
    return _in_s(pencil.domain.to_sympy(pencil.det()))


def their_state_matrix(n: int, simplify: bool = False) -> Derived:
    """A of y' = A y."""
    kane, rest = hanging(n)
    A, *_ = kane.linearize(A_and_B=True, op_point=rest, simplify=simplify)
    return Derived((A,), lambda A: -(np.linalg.eigvals(A) ** 2))


def their_polynomial(_: int, matrices: Sequence[Any]) -> Derived:
    return _in_s(matrices[0].charpoly(S).as_expr())


def _in_s(p: Any) -> Derived:
    """A polynomial in s = iω with only even powers, read in s² so that the double root 0 stays exact."""
    return Derived((p,), lambda p: -np.roots(sp.Poly(p, S).all_coeffs()[::2]))


ROUTES = {
    "ours": Route("M, K (ours)", our_matrices, "ours", our_polynomial),
    "pencil": Route("`to_linearizer`: M, A", their_pencil, "det(sM − A)", their_determinant),
    "state": Route("`linearize`: A", their_state_matrix, "`A.charpoly()`", their_polynomial),
    "simplified": Route(
        "A, simplified", partial(their_state_matrix, simplify=True), "A simplified, `charpoly`", their_polynomial
    ),
}


# --------------------------------------------------------------------------------------------------- measuring


def work(name: str, n: int) -> None:
    """Print a line of JSON as soon as each figure is known; the clock is stopped while operations are counted."""
    route, start = ROUTES[name], time.perf_counter()
    derived = route.matrices(n)
    seconds = time.perf_counter() - start
    report("matrices", derived, seconds)
    start = time.perf_counter() - seconds
    derived = route.polynomial(n, derived.expressions)
    report("polynomial", derived, time.perf_counter() - start)


def report(stage: str, derived: Derived, seconds: float) -> None:
    for figure, value in (
        ("seconds", lambda: seconds),
        ("operations", lambda: operations(derived.expressions)),
        ("squares", lambda: moving(derived.squares(*map(with_numbers, derived.expressions)))),
    ):
        print(json.dumps([stage, figure, value()]), flush=True)


def operations(expressions: Sequence[Any]) -> int:
    named, rest = sp.cse(expressions)
    return int(sum(sp.count_ops(expression) for _, expression in named) + sum(map(sp.count_ops, rest)))


def with_numbers(expression: Any) -> Any:
    """Exact numbers for m_c or m0, the links' masses and lengths, and g, under either naming."""
    plain = expression.subs({symbol: _number(symbol.name) for symbol in expression.free_symbols - {S, X}})
    return np.array(plain, dtype=float) if isinstance(plain, sp.MatrixBase) else plain


def _number(name: str) -> sp.Rational:
    """In SymPy's model m0 is the cart, m1, m2, … are the links' masses, but l0, l1, … their lengths."""
    if name in {"g", "m_c", "m0"}:
        return sp.Integer(10 if name == "g" else 3)
    index = int(name.strip("lm_")) + (name[0] == "l" and "_" not in name)
    return 1 + sp.Rational(index, 7) if name[0] == "m" else 1 / sp.Integer(index + 1)


def moving(squares: np.ndarray) -> list[float]:
    """ω² > 0, each once, ascending: a state matrix has ±iω, and 0 twice."""
    ascending = np.sort(np.asarray(squares, dtype=complex).real)
    ascending = ascending[ascending > 1e-6 * ascending[-1]]
    return [float(x) for i, x in enumerate(ascending) if i == 0 or x - ascending[i - 1] > 1e-6 * x]


def measured(name: str, n: int, limit: float) -> dict[tuple[str, str], Any]:
    """(stage, figure): value of everything that a separate process reports within the limit."""
    command = [sys.executable, __file__, "--route", name, "--links", str(n)]
    try:
        text = subprocess.run(command, stdout=subprocess.PIPE, check=True, timeout=limit).stdout
    except subprocess.TimeoutExpired as stopped:
        text = stopped.stdout or b""
    return {(stage, figure): value for stage, figure, value in map(json.loads, text.decode().splitlines())}


def measured_all(lengths: Sequence[int], limit: float) -> Costs:
    """Every route; all ω² of one n must agree."""
    costs: Costs = {}
    for n in lengths:
        reference: list[float] = []
        for name in ROUTES:
            figures = measured(name, n, limit)
            reference = reference or figures["matrices", "squares"]
            for stage in ("matrices", "polynomial"):
                squares = figures.get((stage, "squares"), reference)
                np.testing.assert_allclose(squares, reference, rtol=1e-9, err_msg=f"{name}, {stage}, n = {n}")
                costs[name, n, stage] = Cost(figures.get((stage, "operations")), figures.get((stage, "seconds")))
    return costs


# -------------------------------------------------------------------------------------------------------- page


def table(stage: str, lengths: Sequence[int], costs: Costs, limit: float) -> str:
    from tabulate import tabulate

    names = [route.heading if stage == "matrices" else route.polynomial_heading for route in ROUTES.values()]
    headings = ["n", *(heading for name in names for heading in (name, "time"))]
    rows = [[str(n), *(cell for name in ROUTES for cell in _cells(costs[name, n, stage], limit))] for n in lengths]
    return tabulate(rows, headings, tablefmt="github", disable_numparse=True, stralign="right")


def _cells(cost: Cost, limit: float) -> tuple[str, str]:
    if cost.seconds is None:
        return "–", f"more than {limit:g} s"
    return "not counted" if cost.operations is None else f"{cost.operations:,}", f"{cost.seconds:.3f} s"


def page(lengths: Sequence[int], costs: Costs, limit: float) -> str:
    return f"""# Symbols compared with SymPy's mechanics

`python benchmarks/symbolic.py --write`, one run on {os.cpu_count()} cores; Python {platform.python_version()},
SymPy {sp.__version__}. The scene is one chain of n bobs on a free cart, with a different symbol for every mass and
length. The comparison is `sympy.physics.mechanics.models.n_link_pendulum_on_cart` about its hanging equilibrium (angles
of π there). Operations are `count_ops` after `cse`; times run from the end of the imports to the matrices, and on to
the polynomial. Each method has a separate process and {limit:g} s for everything, imports and counting included ("not
counted": derived, but the count did not finish). All methods that finish give the same frequencies for one set of
numbers, checked to 1e-9.

## Matrices

`to_linearizer` gives M y' = A y; `linearize` solves for y' = A y, with or without `simplify=True`.

{table("matrices", lengths, costs, limit)}

## Characteristic polynomials

Our polynomial is that of the n oscillating modes, in x = ω², with factored coefficients; SymPy's, in s = iω, also
contains s² for the translation.

{table("polynomial", lengths, costs, limit)}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one link, 6 s each")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/symbols.md")
    parser.add_argument("--route", choices=ROUTES, help=argparse.SUPPRESS)
    parser.add_argument("--links", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.route:
        work(options.route, options.links)
        return
    lengths, limit = ((1,), 6.0) if options.quick else ((1, 2, 3, 4, 5), 60.0)
    text = page(lengths, measured_all(lengths, limit), limit)
    print(text)
    if options.write:
        (DOCS / "benchmarks" / "symbols.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
