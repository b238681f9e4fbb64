"""Perturbed runs ("twins"): the same scene from a slightly different start, which breaks any symmetry.

Equal pendula with equal starts pull the cart alike forever, in numbers as in theory, and so do mirror images; where
such motion is unstable real pendula part, and two runs that share the symmetry agree for longer than they are right. A
twin does not share it. Of pendula that move as one only the first is perturbed: how fast it departs from the others
does not depend on their number, and the twin needs at most two pendula of each kind.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from sys import float_info
from typing import Any, NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.scene.doors import require_type
from nonlinear.dynamics import exactly_symmetric, is_unstable_equilibrium, symmetrize, synchronous
from nonlinear.integration.arguments import extent
from nonlinear.integration.run import Request, SimulationError
from nonlinear.integration.trajectory import Trajectory
from nonlinear.system import Event, State, System, apart

TWIN_DISTANCE = 1e-9
"""Tolerance: of the motion's size, the perturbation of a twin's start, and the tolerance at which it is followed."""
TWIN_DISTANCE_MIN = 1e-12
"""Tolerance: the least perturbation (rad) of a twin's start, far above rounding."""
DEPARTURE_DISTANCE = 1e-4
"""Limit: distance (rad) at which a twin has departed and is followed no further."""
TWIN_STEPS_MAX = 3000
"""Limit: steps for which a twin is followed, and for which its statement holds."""


class Departure(NamedTuple):
    """The largest `factor` by which the distance of a twin from a symmetric run grew within `seconds`."""

    factor: float
    seconds: float

    @property
    def words(self) -> str:
        """The result as a clause."""
        return f"a small perturbation of it would grow {self.factor:.2g}-fold in {self.seconds:.3g} s"


def aside(system: System, start: State, by: Any) -> State:
    """A start with the angles of every pendulum (of identical ones the first) perturbed by up to `by` (rad).

    In space every component of the unit vectors is perturbed.  `by` is a number or fits `start.links`.
    """
    shift = by * np.random.default_rng(0).uniform(0.5, 1.0, start.links.shape)
    if symmetry := synchronous(system, start):
        number = np.arange(float(system.n_links))
        shift[~np.isin(number, symmetry.restrict(State(number, number)).links)] = 0.0
    links = start.links + shift
    if links.ndim == 2:
        links /= np.linalg.norm(links, axis=1, keepdims=True)
    return replace(start, links=links)


def slightly(system: System, start: State) -> float:
    """The perturbation (rad) of a twin that shows how a difference grows."""
    return max(TWIN_DISTANCE * extent(start, system), TWIN_DISTANCE_MIN)


def perturb_last_digits(request: Request) -> Request | None:
    """The request with a start perturbed in its last digits; None if the start has no exact symmetry to break.

    Without a symmetry or an unstable equilibrium that rounding preserves, runs at two tolerances are as informative.
    """
    system, start = request.system, request.start
    if not (exactly_symmetric(system, start) or is_unstable_equilibrium(system, start)):
        return None
    by = np.maximum(4 * float_info.epsilon * request.size, 4 * np.spacing(np.abs(start.links)))
    return replace(request, start=aside(system, start, by))


def departure(trajectory: Trajectory) -> Departure | None:
    """How fast a twin departs from a run that integrates fewer pendula than there are, or a spatial scene in a plane.

    None for any other run.  The twin is followed until its distance is DEPARTURE_DISTANCE, for at most TWIN_STEPS_MAX.
    """
    require_type("trajectory", trajectory, "Trajectory")
    start, times = trajectory.motion[0], trajectory.times
    request = Request(trajectory.scene, trajectory.system, start, np.linspace(0.0, float(times[-1] - times[0]), 200))
    if not (trajectory.run.reduced and request.duration and any(smaller.ties for smaller in request.smaller)):
        return None
    steps = count(1)

    def distance(state: State) -> float:
        return float(apart(*symmetrize(request.smaller, state))[0])

    def patient(time: float) -> None:
        if next(steps) > TWIN_STEPS_MAX:
            raise ComputationError("the twin is followed no further")

    perturbed_start = aside(request.system, start, slightly(request.system, start))
    leaving = Event("a twin has left", lambda state: distance(state) - DEPARTURE_DISTANCE, stop=True)
    twin = replace(request, start=perturbed_start, events=(leaving,), report=patient)
    try:
        path = twin.run(twin.choice(TWIN_DISTANCE))
    except SimulationError as error:
        path = error.trajectory
    largest = max(distance(path.motion[at]) for at in range(len(path.times)))
    return Departure(largest / distance(perturbed_start), float(path.times[-1]))
