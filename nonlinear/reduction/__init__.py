"""Motion in modal coordinates: projection, superposition, truncation, and their errors.

In: a scene, its modes and a start.  Out: a motion in closed form or in a few modes, with a stated error.

    q(t) = Σ_r φ_r η_r(t),    M e'' + D e' + K e = ρ(t)

where ρ is the residual of the motion in the full equations (`residual`) and e its error (`defect`).  Start with
`modal_coordinates`.
"""

from nonlinear.reduction.defect import LARGEST, defect_error
from nonlinear.reduction.modal_coordinates import (
    USUAL_DEG,
    ModalMotion,
    along_rail,
    copy_along,
    deflection,
    first_that_swings,
    modal_motion,
    rest_angles,
    start_in_mode,
    usual_start,
)
from nonlinear.reduction.residual import SAMPLES_PER_PERIOD, residual_forces
from nonlinear.reduction.superposition import CORRECTED, LINEAR, Superposition, superpose
from nonlinear.reduction.truncation import in_modes, simulate_truncated, survey_modes

__all__ = [
    "CORRECTED",
    "LARGEST",
    "LINEAR",
    "SAMPLES_PER_PERIOD",
    "USUAL_DEG",
    "ModalMotion",
    "Superposition",
    "along_rail",
    "copy_along",
    "defect_error",
    "deflection",
    "first_that_swings",
    "in_modes",
    "modal_motion",
    "residual_forces",
    "rest_angles",
    "simulate_truncated",
    "start_in_mode",
    "superpose",
    "survey_modes",
    "usual_start",
]
__dir__ = __all__.copy
