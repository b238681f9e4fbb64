"""Fresh members with clocks and dry friction side by side, against runs whose changes are sought on interpolants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.amounts import usually

from modal.scene import Scene, scene_from
from nonlinear import State, ensemble, simulate
from nonlinear.integration import methods

MEMBERS = 3


def fresh(rng: np.random.Generator) -> Scene:
    """One or two links with escapements and friction, half of them on a cart that rubs."""

    def link() -> dict[str, Any]:
        own: dict[str, Any] = {"kind": str(rng.choice(["bob", "rod"])), "mass": rng.uniform(0.3, 2)}
        own |= {"length": rng.uniform(0.4, 1.2), "damping": rng.uniform(0, 0.05)}
        if rng.random() < 0.6:
            own["friction"] = rng.uniform(0.02, 0.4)
        if rng.random() < 0.4:
            drive = {"impulse": rng.uniform(0.02, 0.2), "angle_deg": rng.uniform(1, 6)}
            own["drive"] = {"kind": "escapement", **drive}
        return own

    links = [link() for _ in range(int(rng.integers(1, 3)))]
    if not any({"friction", "drive"} & own.keys() for own in links):
        links[0]["friction"] = 0.2
    cart = {"kind": "cart", "mass": rng.uniform(0.5, 4), "stiffness": 3.0, "friction": rng.uniform(0.1, 1)}
    support = cart if rng.random() < 0.5 else {"kind": "fixed"}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]})


@pytest.mark.parametrize("seed", range(usually(4, 100)))
def test_fresh_members_are_runs_by_another_route(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    scene = fresh(rng)
    starts = rng.uniform(-0.8, 0.8, (MEMBERS, scene.n_links))
    ends = ensemble(scene, 3.0, starts=starts, engine="numpy", workers=1, check=0, tolerance=1e-12).final.links
    monkeypatch.setattr(methods, "RUBBED", -1)
    for start, end in zip(starts, ends, strict=True):
        run = simulate(scene, 3.0, start=State(start, 0 * start), tolerance=1e-12, output=2)
        assert np.abs(run.motion.links[-1] - end).max() < 1e-8
