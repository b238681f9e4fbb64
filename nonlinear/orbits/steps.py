"""The coefficients and the step control of DOP853, and what a flow returns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from modal.types import Floats

STAGES = DOP853.n_stages
SHARES = [np.ascontiguousarray(DOP853.A[stage, :stage]) for stage in range(STAGES)]
WEIGHTS = np.ascontiguousarray(DOP853.B)
ERRORS = np.array([DOP853.E5, DOP853.E3])
SAFETY, SHRINKS, GROWS, FIRST = 0.9, 0.2, 10.0, 1 / 24
LEAST = 1e-12  # shortest step over the whole time
MOST = 20_000  # steps
SHARP = 1e-12  # last step to the time of a kick over the whole one
TOGETHER = 1e-11  # rad by which a kick may come early to coincide with another


class Path(NamedTuple):
    """The ends of K steps: times (s), y and y' there, (K,) and (K, d); after a kick the same time once more."""

    times: Floats
    states: Floats
    rates: Floats


class Passed(NamedTuple):
    """The end of a flow: y (d,), V (d, m), the side of every escapement's next kick, and the path."""

    y: Floats
    V: Floats
    side: Floats
    path: Path
