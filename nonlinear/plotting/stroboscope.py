"""A long run as a short film: lit once in a while, so that fast swings seem slow and slow changes show."""

from __future__ import annotations

from math import ceil, pi
from typing import Any

import numpy as np

from nonlinear.synchronization import Phases

FPS = {"gif": 20.0, "mp4": 30.0, "html": 20.0}
SECONDS = 20.0
APART = 24  # frames that a swing seems to take


def strobe(phases: Phases, form: str) -> dict[str, Any]:
    """The arguments of `animate` for a film of at most SECONDS, every frame some whole swings and 1/APART later.

    Runs that are no longer than the film are shown at their own speed.
    """
    period = float(2 * pi / np.median(phases.omega[:, phases.leading]))
    fps, run = FPS[form], float(phases.times[-1] - phases.times[0])
    swings = ceil(run / (SECONDS * fps * period) - 1 / APART)
    speed = (swings + 1 / APART) * period * fps if run > SECONDS else 1.0
    return {"fps": fps, "speed": speed, "seconds": SECONDS}
