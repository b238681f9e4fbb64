"""Lagrange's equations with plain symbols: a coordinate q and its rates q', q'' are three of them.

Time derivatives follow the chain rule,

    df/dt = Σ (∂f/∂q) q' + (∂f/∂q') q'',      Lagrange: d/dt ∂L/∂q' − ∂L/∂q + ∂R/∂q' = 0,

with the dissipation function R.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import sympy as sp


class Coordinate(NamedTuple):
    """A coordinate q with its velocity v = q' and acceleration a = q'', as independent symbols."""

    q: Any
    v: Any
    a: Any


def coordinate(name: str, *index: int | str) -> Coordinate:
    r"""Symbols such as theta_1_2, thetadot_1_2 and thetaddot_1_2, which LaTeX shows with dots.

    >>> coordinate("theta", 1, 2).v, sp.latex(coordinate("phi", 3).a)
    (thetadot_1_2, '\\ddot{\\phi}_{3}')
    """
    tail = "".join(f"_{i}" for i in index)
    return Coordinate(*(sp.Symbol(f"{name}{dots}{tail}") for dots in ("", "dot", "ddot")))


def time_derivative(f: Any, coordinates: Iterable[Coordinate]) -> Any:
    """df/dt = Σ (∂f/∂q) q' + (∂f/∂q') q''."""
    return sp.Add(*(sp.diff(f, c.q) * c.v + sp.diff(f, c.v) * c.a for c in coordinates))


def lagrange_equations(L: Any, coordinates: Sequence[Coordinate], R: Any = 0) -> list[Any]:
    """d/dt ∂L/∂q' − ∂L/∂q + ∂R/∂q' of every coordinate: linear in the accelerations, zero in motion."""
    return [time_derivative(sp.diff(L, c.v), coordinates) - sp.diff(L, c.q) + sp.diff(R, c.v) for c in coordinates]
