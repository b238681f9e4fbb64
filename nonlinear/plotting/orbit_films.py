"""Films of a periodic orbit next to the linear mode with which it begins."""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, TYPE_CHECKING

import numpy as np

from modal.modes import Modes
from modal.plotting.style import SOLVED_POINTS
from modal.report import silent
from modal.types import Floats
from nonlinear.integration import CLOSED, SolverInfo, Trajectory
from nonlinear.plotting.animation import Shown, animate
from nonlinear.reduction import start_in_mode, superpose
from nonlinear.system import Motion

if TYPE_CHECKING:
    from nonlinear.orbits import Orbit


def film_orbit(
    orbit: Orbit,
    stream: IO[bytes],
    form: str,
    *,
    modes: Modes | None = None,
    row: int = 0,
    report: Callable[[float], object] = silent,
) -> Shown:
    """Write a film of four periods of an orbit, next to the mode of index `row` at the same largest angle."""
    phase = np.linspace(0, 1, SOLVED_POINTS, endpoint=False)
    rows = np.tile(orbit.states_at(phase * orbit.period), (4, 1))
    times = (np.arange(4)[:, None] + phase).ravel() * orbit.period
    trajectory = _trajectory(orbit, times, orbit.motion(rows), "the periodic orbit")
    linear_motion = _linear(orbit, times, modes, row) if modes else None
    return animate(trajectory, stream, form, second=linear_motion, report=report)


def _linear(orbit: Orbit, times: Floats, modes: Modes, row: int) -> Trajectory:
    """The linear mode with the same largest angle, its leading link on the same side."""
    start = start_in_mode(orbit.scene, modes, row, 0, orbit.amplitude)
    deflections, angles = orbit.state.links - orbit.flow.system.rest, start.links - orbit.flow.system.rest
    if angles @ deflections < 0:
        start = start_in_mode(orbit.scene, modes, row, 0, -orbit.amplitude)
    motion = superpose(orbit.scene, start, corrected=False)(times)
    return _trajectory(orbit, times, motion, "the linear mode")


def _trajectory(orbit: Orbit, times: Floats, motion: Motion, words: str) -> Trajectory:
    return Trajectory(orbit.scene, orbit.flow.system, times, motion, SolverInfo(words, CLOSED, "", 0.0))
