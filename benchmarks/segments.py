"""Least squares over 8 and 200 segments: the problem of a fit against SciPy's differences, one motion at a time.

    python benchmarks/segments.py [--segments 8 200]

Both have the same unknowns (numbers and initial states) and tolerance.  The rival is what is written without the
toolkit: `least_squares` by differences (2-point) with `solve_ivp` (DOP853) for every motion; its seconds for one
Jacobian are those of a motion times their number, since a difference by a state moves one segment alone.
"""

from __future__ import annotations

import argparse
from statistics import median
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

from modal.identification import find_parameters
from modal.scene import scene_from
from nonlinear.dynamics import Generated
from nonlinear.identification import Recording, Segment, Sensor
from nonlinear.identification.problem import Problem
from nonlinear.system import system_of

TOLERANCE, ROUNDS = 1e-9, 5
TIMES = np.arange(0, 3, 0.02)
LINKS = [
    {"kind": "bob", "mass": 1.0, "length": 0.5, "damping": 0.01},
    {"kind": "rod", "mass": 0.5, "length": 0.4, "damping": 0.02},
]
FREE = ["pendulum[0].links[*].length", "pendulum[0].links[*].damping"]
