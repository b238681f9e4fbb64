"""What is asked for to an accuracy, and a way to it that was tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, pi

import numpy as np

from modal.types import Floats
from nonlinear.integration import Request, SimulationError, Trajectory, estimate_timescales

AIM = 35.0  # accuracy wished for over the error that is aimed at
SOME, A_PERIOD = 3.0, 0.15  # of C over the motion's size: always, and for every period of the fastest swing
PER_PERIOD, FEWEST, MOST = 12, 200, 4000  # instants at which errors are looked for


@dataclass(frozen=True)
class Attempt:
    """A way that was tried: its tolerance (NaN for a closed form), what it cost (s; derivatives), its error (rad).

    The error is an upper estimate, inf where nothing is known of it.
    """

    way: str
    tolerance: float
    seconds: float
    calls: int
    error: float


@dataclass(frozen=True, eq=False)
class Found:
    """A trajectory, what its angles may be off by until every of its times (T,) in rad, and what it cost.

    `again` goes the same way from another start; `gave_up` is the reason of an integrator that did,
    of whose run nothing is known.
    """

    trajectory: Trajectory
    errors: Floats
    attempt: Attempt
    again: Callable[[Request], Trajectory]
    gave_up: SimulationError | None = None


@dataclass(frozen=True, eq=False)
class Goal:
    """A motion that is asked for to an accuracy (rad)."""

    request: Request
    accuracy: float

    @property
    def periods(self) -> float:
        """Of the fastest swing in all that time."""
        return self.request.duration * estimate_timescales(self.request.scene).swing / (2 * pi)

    @cached_property
    def looked_at(self) -> Request:
        """The request at the times when errors are looked for: the kept ones, and as often as the scene swings."""
        times, count = self.request.times, min(max(ceil(self.periods * PER_PERIOD), FEWEST), MOST)
        return replace(self.request, times=np.union1d(times, np.linspace(times[0], times[-1], count + 1)))

    @property
    def constant(self) -> float:
        """A guess at C (rad)."""
        return self.request.size * (SOME + (A_PERIOD + self.request.size**2) * self.periods)

    @property
    def tolerance(self) -> float:
        """Of an integrator, that should meet the accuracy."""
        return self.accuracy / (AIM * self.constant)

    @property
    def free(self) -> bool:
        """Whether anything may stand in for the integration of the whole scene."""
        asked = self.request
        return asked.method == asked.form == "auto" and not (asked.load or asked.events or asked.system.excites)
