"""Exact derivatives of M, K, D, and of other arrays of a scene, by any of its numbers.

These are polynomials of degree 2 at most in each number, so that a difference quotient with a large step

    ∂f/∂p = (f(p + h) − f(p − h))/2h,     at p = 0 (4 f(h) − f(2h) − 3 f(0))/2h

is their derivative but for rounding.  Lengths and positions of a structure turn its springs and bend the paths of its
carriers: there the quotient of eight values p ± h, …, p ± 4h has an error of h⁸ f⁽⁹⁾/630, below rounding for h = p/128.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from modal.errors import SceneError
from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.parameters import Place, Variable, number_at, with_numbers

STEPS = (2.0**-2, 2.0**-6, 2.0**-12)
"""Relative steps, the first that the scene's own bounds allow."""
FINE = 2.0**-7
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Relative step and weights of the quotient of eight values (Fornberg, Math. Comp. 51, 699 (1988), table 1)."""
BENDING = frozenset({"length", "position"})
"""Keys of numbers in which the matrices of a structure are no polynomials."""
Arrays = tuple[NDArray[Any], ...]


def differences(scene: Scene, place: Place, unit: float, arrays_of: Callable[[Scene], Arrays]) -> Arrays:
    """Derivatives by the number at a place of arrays that are polynomials of degree 2 at most in it.

    On a structure they may be any smooth functions of lengths and positions.  `unit` is the size of a step from 0.
    SceneError where the scene allows no step to either side.
    """
    require_type("scene", scene, "Scene")
    path, value = with_numbers(place), number_at(scene, place)
    variable = Variable(scene, [path])

    def at(number: float) -> Arrays:
        return arrays_of(variable.at({path: number}))

    if scene.is_structured and not BENDING.isdisjoint(place):
        step = FINE * (abs(value) or unit)
        pairs = [(at(value + k * step), at(value - k * step)) for k in range(1, len(WEIGHTS) + 1)]
        parts = zip(*(zip(*pair, strict=True) for pair in pairs), strict=True)
        return tuple(
            sum(weight * (b - a) for weight, (b, a) in zip(WEIGHTS, part, strict=True)) / step for part in parts
        )
    if value == 0:
        none, once, twice = at(0.0), at(unit), at(2 * unit)
        return tuple((4 * b - c - 3 * a) / (2 * unit) for a, b, c in zip(none, once, twice, strict=True))
    for step in STEPS:
        low, high = value * (1 - step), value * (1 + step)
        try:
            return tuple((b - a) / (high - low) for a, b in zip(at(low), at(high), strict=True))
        except SceneError:
            continue
    raise SceneError([f"{path} = {value:g}: is at a bound, and has no derivative there"])
