"""Measures of a run of the nonlinear simulator over so many seconds from the scene's own start."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from modal.scene import Scene
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import extremes
from nonlinear.simulation import simulate
from nonlinear.sweeps.measure import Measure


@lru_cache(maxsize=1)
def run_of(scene: Scene, seconds: float) -> Trajectory:
    """The run, kept for the next measure of the same scene; KeyboardInterrupt where Ctrl-C cut it short."""
    trajectory = simulate(scene, seconds)
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    return trajectory


def energy_drift(scene: Scene, seconds: float) -> dict[str, float]:
    """The energy certificate of the run, relative."""
    return {"energy_drift": run_of(scene, seconds).energy_drift()}


def amplitude(scene: Scene, seconds: float) -> dict[str, float]:
    """The largest angle of any link from hanging and how far the cart goes from one side to the other.

    Both are read at the turning points between the samples.
    """
    run = run_of(scene, seconds)
    times, motion = run.times, run.motion
    if run.system.spatial:
        height, _ = extremes(times, motion.links[..., 2], motion.link_rates[..., 2])
        largest = np.arccos(np.clip(height, -1.0, 1.0)).max()
    else:
        largest = np.abs(extremes(times, motion.links, motion.link_rates)).max()
    left, right = extremes(times, motion.cart, motion.cart_rate)
    return {"largest_angle_deg": float(np.degrees(largest)), "cart_travel_m": float(right - left)}


RUNS = (
    Measure("energy_drift", energy_drift, 10.0, "the relative drift of energy in N seconds", whole=False, most=1e6),
    Measure("amplitude", amplitude, 10.0, "the largest angle and travel in N seconds", whole=False, most=1e6),
)
