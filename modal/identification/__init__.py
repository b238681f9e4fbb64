"""System identification: parameters of a scene from measurements, and how well they are determined.

In: derivatives of readings by a scene's numbers, measured modes, records.  Out: parameters with standard deviations,
the combinations that the data determine, and in words those that they do not; poles and shapes of records; what the
covariance of a fit makes of modes, responses and shaped commands.  Start with `parameters`; `mode_fitting` fits to
measured modes, `poles` needs no scene, `measured` compares both, `estimate` starts from a fit.
"""

from modal.identification.decays import autocorrelation, covariance, influence, resampled
from modal.identification.estimate import Estimate, estimate_of, magnitude_std, mode_stds, read_estimate, shaped_modes
from modal.identification.identifiability import (
    Combination,
    Determined,
    Undetermined,
    find_combinations,
    find_determined,
)
from modal.identification.measured import (
    Assurance,
    MeasuredMode,
    MeasuredModes,
    assurance_table,
    compare_modes,
    has_modes,
    parse_modes,
    read_modes,
)
from modal.identification.mode_fitting import ModeFit, Solution, fit_modes, mode_fit_json, mode_fit_text
from modal.identification.parameters import (
    FittedNumbers,
    Parameter,
    find_parameters,
    means_of,
    numbers_at,
    scene_with,
    starts_of,
)
from modal.identification.poles import EXCITATIONS, METHODS, Identified, IdentifiedMode, identify, poles_table

__all__ = [
    "EXCITATIONS",
    "METHODS",
    "Assurance",
    "Combination",
    "Determined",
    "Estimate",
    "FittedNumbers",
    "Identified",
    "IdentifiedMode",
    "MeasuredMode",
    "MeasuredModes",
    "ModeFit",
    "Parameter",
    "Solution",
    "Undetermined",
    "assurance_table",
    "autocorrelation",
    "compare_modes",
    "covariance",
    "estimate_of",
    "find_combinations",
    "find_determined",
    "find_parameters",
    "fit_modes",
    "has_modes",
    "identify",
    "influence",
    "magnitude_std",
    "means_of",
    "mode_fit_json",
    "mode_fit_text",
    "mode_stds",
    "numbers_at",
    "parse_modes",
    "poles_table",
    "read_estimate",
    "read_modes",
    "resampled",
    "scene_with",
    "shaped_modes",
    "starts_of",
]
__dir__ = __all__.copy
