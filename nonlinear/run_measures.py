"""Measures of a run of the nonlinear simulator over so many seconds from the scene's own start."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from modal.scene import Scene
from nonlinear.measure import Measure
from nonlinear.simulation import simulate
from nonlinear.trajectory import Trajectory


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
    """The largest angle of any link from hanging and how far the cart goes from one side to the other."""
    run = run_of(scene, seconds)
    links = run.motion.links
    angles = np.arccos(np.clip(links[..., 2], -1.0, 1.0)) if run.plant.spatial else np.abs(links)
    return {
        "largest_angle_deg": float(np.degrees(angles.max())),
        "cart_travel_m": float(np.ptp(run.motion.cart)),
    }


RUNS = (
    Measure("energy_drift", energy_drift, 10.0, "the relative drift of energy in N seconds", whole=False, most=1e6),
    Measure("amplitude", amplitude, 10.0, "the largest angle and travel in N seconds", whole=False, most=1e6),
)
