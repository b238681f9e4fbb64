"""Quantities computed from a trajectory: resampling, spectra, frequencies, reaction forces, a summary.

In: a `Trajectory`.  Out: signals at other times, line frequencies far finer than 2π/T, pivot forces, text.
Start with `summary`.
"""

from nonlinear.postprocessing.frequencies import LEAST_PERIODS, ORDER, SpectralLine, attention, line, lines
from nonlinear.postprocessing.reaction_forces import (
    PushingLink,
    pushing_links,
    reaction_forces_of,
    slack_words,
    words_of,
)
from nonlinear.postprocessing.resampling import (
    Extent,
    angles_of,
    extent_of,
    extremes,
    largest_angle,
    pick_links,
    places_of,
    resample,
)
from nonlinear.postprocessing.series import WINDOW_NAME, last, power_spectrum, resolution, smooth
from nonlinear.postprocessing.summary import run_inventory

__all__ = [
    "LEAST_PERIODS",
    "ORDER",
    "WINDOW_NAME",
    "Extent",
    "PushingLink",
    "SpectralLine",
    "angles_of",
    "attention",
    "extent_of",
    "extremes",
    "largest_angle",
    "last",
    "line",
    "lines",
    "pick_links",
    "places_of",
    "power_spectrum",
    "pushing_links",
    "reaction_forces_of",
    "resample",
    "resolution",
    "run_inventory",
    "slack_words",
    "smooth",
    "words_of",
]
__dir__ = __all__.copy
