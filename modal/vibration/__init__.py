"""Moving supports: prescribed motion, random vibration, shock and parametric excitation; thermal noise.  Needs SciPy.

In: a scene, and the motion of its support: prescribed, recorded, or random with a power spectral density, or a
temperature.  Out: the motion as functions of time; PSD and RMS of every output and mode; exact histories, peaks and
their combination by SRSS and CQC; thermal noise with its budget; Floquet multipliers under vertical motion, and the
boundaries of growth.

Start with `prescribed`; `random`, which has thermal motion too, `shock`, `hill` (growth under vertical motion) and
`boundaries` (of that) each answer one question.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.vibration.boundaries import Boundary, Tongues, tongues
    from modal.vibration.hill import KINDS, ParametricStability, parametric_stability, stabilities, vertical_sine
    from modal.vibration.prescribed import (
        Course,
        Polynomials,
        PrescribedMotion,
        RandomProcess,
        Record,
        SweptSine,
        prescribed_motion,
    )
    from modal.vibration.random import BOLTZMANN, RandomResponse, ThermalNoise, random_response, thermal_noise
    from modal.vibration.report import random_report, shock_report, thermal_frequencies, thermal_report
    from modal.vibration.shock import ShockResponse, correlation, cqc, response_spectrum, shock_response, srss

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

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
