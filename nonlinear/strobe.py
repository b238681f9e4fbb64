"""A long run as a short film: lit once in a while, so that fast swings seem slow and slow changes show."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from nonlinear.phases import Phases

FPS = {"gif": 20.0, "mp4": 30.0, "html": 20.0}
SECONDS = 20.0
APART = 24  # frames that a swing seems to take


def strobed(phases: Phases, form: str) -> dict[str, Any]:
    """The arguments of `animate` for a film of SECONDS in which every frame is some whole swings and 1/APART later.

    Runs that need no such trick are shown at their own speed, or faster where they are longer than the film.
    """
    period = float(2 * pi / np.median(phases.omega[:, phases.leading]))
    fps, run = FPS[form], float(phases.times[-1] - phases.times[0])
    swings = round(run / (SECONDS * fps) / period)
    step = max((swings + 1 / APART) * period if swings else 0.0, 1 / fps)
    return {"fps": fps, "speed": step * fps, "seconds": SECONDS}
