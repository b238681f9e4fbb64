"""The laws of joints in symbols: their energy, and the function whose slopes by the rate are the rest of the torque.

τ(γ, γ') = −∂V/∂γ − ∂R/∂γ',    V = −∫ τ(γ, 0) dγ,    R = −∫ [τ(γ, γ') − τ(γ, 0)] dγ'
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from modal.errors import SceneError
from modal.exact import exact
from modal.extend.registry import call
from modal.scene.laws import JointPart

ANGLE, RATE = sp.symbols("gamma gammadot", real=True)


def potential_of(part: JointPart, angle: Any) -> Any:
    """The energy V of a law at an angle, as it says itself or from its torque at rest.

    >>> from modal.extend.laws import SpringLaw
    >>> from modal.scene.laws import part_of
    >>> potential_of(part_of(SpringLaw)(stiffness=3.0), sp.Symbol("theta"))
    3*theta**2/2
    """
    law, numbers = part.law, _numbers(part)
    if law.has_potential:
        return sp.sympify(call(law, "potential", ANGLE, numbers)).subs(ANGLE, angle)
    return -_integral(part, call(law, "torque", ANGLE, sp.S.Zero, numbers), ANGLE).subs(ANGLE, angle)


def dissipation_of(part: JointPart, angle: Any, rate: Any) -> Any:
    """The function R of a law at an angle and a rate.

    >>> from modal.extend.laws import DamperLaw
    >>> from modal.scene.laws import part_of
    >>> dissipation_of(part_of(DamperLaw)(damping=3.0), sp.S.Zero, sp.Symbol("omega"))
    3*omega**2/2
    """
    torque = (call(part.law, "torque", ANGLE, speed, _numbers(part)) for speed in (RATE, sp.S.Zero))
    total, elastic = torque
    return -_integral(part, sp.expand(total - elastic), RATE).subs({ANGLE: angle, RATE: rate}, simultaneous=True)


def _numbers(part: JointPart) -> dict[str, Any]:
    return {name: sp.Rational(exact(value)) for name, value in part.numbers.items()}


def _integral(part: JointPart, torque: Any, by: Any) -> Any:
    """The integral from 0; SceneError where SymPy finds none."""
    integral = sp.integrate(sp.sympify(torque), by)
    if integral.has(sp.Integral):
        raise SceneError([f"law {part.law.name}: SymPy finds no integral of its torque: give it a potential"])
    return integral - integral.subs(by, 0)
