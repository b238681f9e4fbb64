"""One motion, four sets of equations: a hundred random scenes away from chaos, ten seconds, nine digits."""

from __future__ import annotations

import random

import numpy as np
import pytest
from motion_scenes import motion_scene

from modal import Scene
from nonlinear.integration import Trajectory
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

TIMES = np.linspace(0, 10, 21)


def angles(run: Trajectory) -> np.ndarray:
    links = run.motion.links
    return np.unwrap(np.arctan2(links[..., 0], links[..., 2]), axis=0) if run.system.spatial else links


@pytest.mark.parametrize("seed", range(100))
def test_minimal_maximal_and_spatial_trajectories_agree(seed: int) -> None:
    scene = motion_scene(seed + 1000, longest=2, most=2, standing=False)
    rng = random.Random(seed)
    start = [rng.uniform(-15, 15) for _ in range(scene.n_links)]
    twin: Scene = scene.model_copy(update={"space": "space"})
    kinds = [(scene, "minimal"), (scene, "maximal"), (twin, "spatial")]
    runs = [
        simulate(s, 10, form=form, method="DOP853", tolerance=1e-12, start=state_at_rest(s, start), output=TIMES)
        for s, form in kinds
    ]
    moved = abs(angles(runs[0])).max()
    assert moved > 0.01
    for other in runs[1:]:
        assert abs(angles(other) - angles(runs[0])).max() < 1e-9
        assert abs(other.motion.cart - runs[0].motion.cart).max() < 1e-9
    assert all(run.energy_drift() < 1e-9 for run in runs)
    assert runs[1].constraint_drift() < 1e-9
    assert runs[2].constraint_drift() < 1e-9
