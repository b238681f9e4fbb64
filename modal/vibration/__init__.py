"""Supports that move: their motion, random vibration, shock, and parametric excitation; thermal noise.  Needs SciPy.

In: a scene, and the motion of its support: prescribed, recorded, or random with a power spectral density, or a
temperature.  Out: the motion as functions of time; PSD and RMS of every output and mode; exact histories, peaks and
their combination by SRSS and CQC; thermal noise with its budget; Floquet multipliers under vertical motion, and the
boundaries of growth.

Start with `prescribed`; `random`, `thermal`, `shock`, `parametric` and `boundaries` (of growth) each answer one
question.
"""

from modal.vibration.boundaries import Boundary, Tongues, tongues
from modal.vibration.combination import correlation, cqc, srss
from modal.vibration.hill import vertical_sine
from modal.vibration.oscillators import response_spectrum
from modal.vibration.parametric import KINDS, ParametricStability, parametric_stability, stabilities
from modal.vibration.prescribed import (
    Course,
    Polynomials,
    PrescribedMotion,
    RandomProcess,
    Record,
    SweptSine,
    prescribed_motion,
)
from modal.vibration.random import RandomResponse, random_response
from modal.vibration.report import random_report, shock_report
from modal.vibration.shock import ShockResponse, shock_response
from modal.vibration.thermal import BOLTZMANN, ThermalNoise, thermal_noise
from modal.vibration.thermal_report import thermal_frequencies, thermal_report

__all__ = [
    "BOLTZMANN",
    "KINDS",
    "Boundary",
    "Course",
    "ParametricStability",
    "Polynomials",
    "PrescribedMotion",
    "RandomProcess",
    "RandomResponse",
    "Record",
    "ShockResponse",
    "SweptSine",
    "ThermalNoise",
    "Tongues",
    "correlation",
    "cqc",
    "parametric_stability",
    "prescribed_motion",
    "random_report",
    "random_response",
    "response_spectrum",
    "shock_report",
    "shock_response",
    "srss",
    "stabilities",
    "thermal_frequencies",
    "thermal_noise",
    "thermal_report",
    "tongues",
    "vertical_sine",
]
