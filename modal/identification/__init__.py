"""From measurements to numbers of a scene: which of them are determined, and how well.

In: derivatives of readings by a scene's numbers, measured modes.  Out: parameters with standard deviations, the
combinations that the data determine, and in words those that they do not.  Start with `parameters`.
"""

from modal.identification.covariance import autocorrelation, covariance, influence
from modal.identification.estimate import Estimate, estimate_of, read_estimate
from modal.identification.identifiability import (
    Combination,
    Determined,
    Undetermined,
    find_combinations,
    find_determined,
)
from modal.identification.parameters import Parameter, find_parameters, numbers_at, scene_with, starts_of
from modal.identification.propagation import magnitude_std, mode_stds, shaped_modes

__all__ = [
    "Combination",
    "Determined",
    "Estimate",
    "Parameter",
    "Undetermined",
    "autocorrelation",
    "covariance",
    "estimate_of",
    "find_combinations",
    "find_determined",
    "find_parameters",
    "influence",
    "magnitude_std",
    "mode_stds",
    "numbers_at",
    "read_estimate",
    "scene_with",
    "shaped_modes",
    "starts_of",
]
