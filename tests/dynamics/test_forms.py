"""One motion, three sets of equations: random scenes away from chaos, nine digits.

Five of twenty scenes move for five seconds, the others for two; with MULTIPENDULA_SCENES=all, a hundred for ten.
"""

from __future__ import annotations

import random

import numpy as np
import pytest
from amounts import usually
from scenes import motion_scene

from modal import Cart, Scene
from nonlinear.dynamics.text import function_in, with_branches
from nonlinear.integration import Trajectory
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

SEEDS = usually(range(0, 100, 5), range(100))
LONG = usually(range(0, 100, 20), range(100))


def moving(seed: int) -> Scene:
    return motion_scene(seed + 1000, longest=2, most=2, standing=False)


def angles(run: Trajectory) -> np.ndarray:
    links = run.motion.links
    return np.unwrap(np.arctan2(links[..., 0], links[..., 2]), axis=0) if run.system.spatial else links


@pytest.mark.parametrize("seeds", [SEEDS, LONG])
def test_the_sample_holds_every_kind(seeds: range) -> None:
    scenes = [moving(seed) for seed in seeds]
    assert {(scene.support.kind, len(scene.pendulum)) for scene in scenes} >= {("cart", 1), ("cart", 2), ("fixed", 2)}
    assert any(isinstance(s.support, Cart) and s.support.stiffness and s.support.damping for s in scenes)
    links = [link for scene in scenes for pendulum in scene.pendulum for link in pendulum.links]
    assert {link.kind for link in links} == {"bob", "rod", "body"}
    assert {(link.stiffness > 0, link.damping > 0) for link in links} == {(a, b) for a in (0, 1) for b in (0, 1)}
    assert {len(pendulum.links) for scene in scenes for pendulum in scene.pendulum} == {1, 2}


@pytest.mark.parametrize("seed", SEEDS)
def test_minimal_maximal_and_spatial_trajectories_agree(seed: int) -> None:
    duration = usually(3, 10) if seed in LONG else 2
    times = np.linspace(0, duration, 2 * duration + 1)
    scene = moving(seed)
    rng = random.Random(seed)
    start = [rng.uniform(-15, 15) for _ in range(scene.n_links)]
    twin: Scene = scene.model_copy(update={"space": "space"})
    kinds = [(scene, "minimal"), (scene, "maximal"), (twin, "spatial")]
    runs = [
        simulate(s, duration, form=form, method="DOP853", tolerance=1e-12, start=state_at_rest(s, start), output=times)
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


def test_only_one_branch_of_a_condition_is_computed_in_floats() -> None:
    text = "def f(a, b, c):\n return [where(a, where((b - 1.0), (c / a), sin(c)), where(b, (1.0 / b), 2.0))]"
    written = with_branches(text)
    assert "where" not in written
    f = function_in(written, "f")
    eager = function_in(text, "f")
    for a, b, c in ((0.5, 2.0, 3.0), (0.5, 0.5, 3.0), (-0.5, 2.0, 3.0)):
        assert f(a, b, c) == eager(a, b, c)
    assert f(-1.0, 0.0, 1.0) == [2.0]  # where 1/b has no value
