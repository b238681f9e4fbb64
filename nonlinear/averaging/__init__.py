"""Averaged equations of self-excited scenes: slow flow, relative equilibria, prediction.

In: a scene with drives.  Out: the mode that survives, the locking time, and stability.

    z_r' = (i/Ω_b) ⟨φ_rᵀ ρ(q, v, a) e^{−iχ_b}⟩,    q = Re Σ φ_r z_r e^{iχ_b}

(Krylov and Bogoliubov; [Sanders2007, ch. 2]).  Start with `equations`; `equilibria` finds the
configurations, `slow_flow` integrates the amplitudes in time, `prediction` gives the outcome of a start.
"""

from nonlinear.averaging.equations import AveragedEquations, average
from nonlinear.averaging.equilibria import (
    RelativeEquilibrium,
    is_same_motion,
    likeness,
    relative_equilibria,
    relative_equilibrium,
    swinging,
)
from nonlinear.averaging.populations import (
    ANTIPHASE,
    COMMON,
    IN_PHASE,
    OTHER,
    OWN,
    WITHIN,
    AveragedPattern,
    Pattern,
    Sector,
    averaged_pattern,
    patterns_of,
    rest_growth,
)
from nonlinear.averaging.prediction import ASIDE, Prediction, predict
from nonlinear.averaging.slow_flow import LOCKED, below_for_good, settle

__all__ = [
    "ANTIPHASE",
    "ASIDE",
    "COMMON",
    "IN_PHASE",
    "LOCKED",
    "OTHER",
    "OWN",
    "WITHIN",
    "AveragedEquations",
    "AveragedPattern",
    "Pattern",
    "Prediction",
    "RelativeEquilibrium",
    "Sector",
    "average",
    "averaged_pattern",
    "below_for_good",
    "is_same_motion",
    "likeness",
    "patterns_of",
    "predict",
    "relative_equilibria",
    "relative_equilibrium",
    "rest_growth",
    "settle",
    "swinging",
]
__dir__ = __all__.copy
