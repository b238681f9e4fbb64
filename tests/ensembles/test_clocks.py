"""Members with escapements side by side, against runs by themselves."""

from __future__ import annotations

import numpy as np

from modal import load
from modal.scene.parameters import vary
from nonlinear import ensemble, simulate

SCENE = load("huygens")
SIZE, SECONDS = 20, 10.0


def test_clocks_that_differ_in_impulse_and_angle_are_the_runs_of_their_scenes() -> None:
    rng = np.random.default_rng(8)
    values = {
        "pendulum[0].start.angles_deg[0]": rng.uniform(4, 12, SIZE),
        "pendulum[0].links[0].drive.impulse": rng.uniform(2e-5, 4e-5, SIZE),
        "pendulum[1].links[0].drive.angle_deg": rng.uniform(2, 3.5, SIZE),
    }
    found = ensemble(SCENE, SECONDS, vary=values, engine="numpy", workers=1, check=0, tolerance=1e-10)
    assert not found.failures
    assert found.energy_drift.max() < 1e-8
    for k in (0, 7, 19):
        own = vary(SCENE, {path: float(each[k]) for path, each in values.items()})
        run = simulate(own, SECONDS, tolerance=1e-11, output=2)
        assert np.abs(run.motion.links[-1] - found.final.links[k]).max() < 1e-8
