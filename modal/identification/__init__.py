"""From measurements to numbers of a scene: which of them are determined, and how well.

In: derivatives of readings by a scene's numbers, measured modes.  Out: parameters with standard deviations, the
combinations that the data determine, and in words those that they do not.  Start with `parameters`.
"""

from modal.identification.covariance import autocorrelation, covariance, influence, resampled
from modal.identification.identifiability import (
    Combination,
    Determined,
    Undetermined,
    find_combinations,
    find_determined,
)
from modal.identification.parameters import Parameter, find_parameters, numbers_at, scene_with, starts_of

__all__ = [
    "Combination",
    "Determined",
    "Parameter",
    "Undetermined",
    "autocorrelation",
    "covariance",
    "find_combinations",
    "find_determined",
    "find_parameters",
    "influence",
    "numbers_at",
    "resampled",
    "scene_with",
    "starts_of",
]
