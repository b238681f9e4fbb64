"""Eigenvalues and mode shapes of a rig, by the cheapest route that keeps every digit.

In: a `Rig`.  Out: a `ModalSpectrum`, the eigenvalues in ascending order, each with the source that describes its shape.

    K φ = ω² M φ,    with dampers  (λ² M + λ D + K) φ = 0

A chain uses the effective-mass recursion and bisection (`chains`, in floats `short`), many different pendula on one
cart the secular equation (`coupled`).  All else is a structure (`structured`), a cart one of one coordinate, a chain on
a support at rest one of none: counts go on through trees of springs (`trees`), with joint springs or inverted links by
`sprung_chains`; loops and springs between links take the factors of K and M (`product`), dampers the quadratic problem
(`quadratic`).  Start with `spectrum`, which chooses.

`elimination` is the recursion at any complex frequency, with loads, in the floats or decimals of `arithmetic`.
"""

from modal.eigen.amplitude import ModeSwing, distortion, one_percent_amplitude
from modal.eigen.arithmetic import REPLICAS, Arithmetic, Digits, Rounded, evaluated
from modal.eigen.bisection import smallest_where
from modal.eigen.chains import EVERYTHING, Limits, squares_of
from modal.eigen.counts import counted
from modal.eigen.coupled import LIGHTEST
from modal.eigen.degenerate import TOLERANCE, degenerate_modes
from modal.eigen.dense import is_singular
from modal.eigen.elimination import FORCE, TORQUE, TURN, Hung, Load, cart_of, hung
from modal.eigen.recursion import at_infinity
from modal.eigen.secular import Poles, solve
from modal.eigen.short import short_squares
from modal.eigen.sources import Details, Rigid, largest_angle, structured_error
from modal.eigen.spectrum import CLOSE, UNCERTAIN, ModalSpectrum, SpectrumPart, find_spectrum, notes
from modal.eigen.structured import LIGHT
from modal.eigen.sturm import Suspension

__all__ = [
    "CLOSE",
    "EVERYTHING",
    "FORCE",
    "LIGHT",
    "LIGHTEST",
    "REPLICAS",
    "TOLERANCE",
    "TORQUE",
    "TURN",
    "UNCERTAIN",
    "Arithmetic",
    "Details",
    "Digits",
    "Hung",
    "Limits",
    "Load",
    "ModalSpectrum",
    "ModeSwing",
    "Poles",
    "Rigid",
    "Rounded",
    "SpectrumPart",
    "Suspension",
    "at_infinity",
    "cart_of",
    "counted",
    "degenerate_modes",
    "distortion",
    "evaluated",
    "find_spectrum",
    "hung",
    "is_singular",
    "largest_angle",
    "notes",
    "one_percent_amplitude",
    "short_squares",
    "smallest_where",
    "solve",
    "squares_of",
    "structured_error",
]
