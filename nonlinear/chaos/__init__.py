"""Chaos: tangent dynamics, Lyapunov exponents, and tests of the papers' claims about them.

In: a scene in the plane and a start, or an energy.  Out: an `Exponent`, λ with its error, studies over scenes.

    λ = lim (1/t) ln |v(t)|,    v' = J(y) v

Start with `lyapunov`.
"""

from nonlinear.chaos.claims import study, text
from nonlinear.chaos.lyapunov import (
    TOLERANCE,
    TRANSIENT,
    Exponent,
    lyapunov_exponent,
    regular_exponent,
    usual_duration,
    validate_duration,
)
from nonlinear.chaos.studies import Case, Finding, measure

__all__ = [
    "TOLERANCE",
    "TRANSIENT",
    "Case",
    "Exponent",
    "Finding",
    "lyapunov_exponent",
    "measure",
    "regular_exponent",
    "study",
    "text",
    "usual_duration",
    "validate_duration",
]
__dir__ = __all__.copy
