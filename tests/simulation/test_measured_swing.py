"""A measured swing (dynamicslab/MultiArm-Pendulum) and the example that was fitted to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modal.scene import load
from nonlinear import simulate

ROOT = Path(__file__).parents[2]
COUNT = 2 * np.pi / 40_000


def test_the_example_follows_the_arm_and_stops_when_it_did() -> None:
    times, measured = np.loadtxt(ROOT / "notebooks/data/single_pendulum_free_swing.csv", delimiter=",", skiprows=1).T
    run = simulate(load("measured-swing"), 14.0, output=times, tolerance=1e-8)
    off = run.motion.links[:, 1] - measured
    assert np.sqrt(np.mean(off**2)) < 4e-4
    stopped = times[np.flatnonzero(np.abs(measured - measured[-1]) > 3 * COUNT)[-1]]
    lasting = run.friction.begin[run.friction.end == run.times[-1]]
    assert lasting == pytest.approx([stopped], abs=0.2)
    assert run.energy_drift() < 1e-6
