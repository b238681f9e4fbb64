"""Fits of a scene's numbers to measured motions, with error bars, and an analysis of the residuals.

In: a scene and a `Recording`, read from files or arrays.  Out: a `Fit`: the scene with the fitted numbers, their
covariance, undetermined numbers, residuals.  Start with `fitting`; `flow` has the motions and their
derivatives.
"""

from modal.scene.tables import parse_where
from nonlinear.identification.comparison import LAWS, ComparedLaw, compare
from nonlinear.identification.diagnosis import diagnose, turning_points
from nonlinear.identification.fitting import LOSSES, fit
from nonlinear.identification.records import ANGLES, Recording, Segment, Sensor, read_recording
from nonlinear.identification.result import Fit, fit_json, fit_record, fit_text

__all__ = [
    "ANGLES",
    "LAWS",
    "LOSSES",
    "ComparedLaw",
    "Fit",
    "Recording",
    "Segment",
    "Sensor",
    "compare",
    "diagnose",
    "fit",
    "fit_json",
    "fit_record",
    "fit_text",
    "parse_where",
    "read_recording",
    "turning_points",
]
__dir__ = __all__.copy
