"""Fresh members with clocks and dry friction, all at once, against the maximal form piece by piece."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.amounts import usually
from support.pieces import Pieces

from modal.scene import Scene, scene_from
from nonlinear import State, ensemble

MEMBERS = 3


def fresh(rng: np.random.Generator) -> Scene:
    """One or two links with escapements and friction, half of them on a cart that rubs, some by a coefficient."""

    def link() -> dict[str, Any]:
        drawn: dict[str, Any] = {"kind": str(rng.choice(["bob", "rod"])), "mass": rng.uniform(0.3, 2)}
        drawn |= {"length": rng.uniform(0.4, 1.2), "damping": rng.uniform(0, 0.05)}
        if rng.random() < 0.6:
            drawn["friction"] = rng.uniform(0.02, 0.4)
        if rng.random() < 0.4:
            drive = {"impulse": rng.uniform(0.02, 0.2), "angle_deg": rng.uniform(1, 6)}
            drawn["drive"] = {"kind": "escapement", **drive}
        return drawn

    links = [link() for _ in range(int(rng.integers(1, 3)))]
    if not any({"friction", "drive"} & link.keys() for link in links):
        links[0]["friction"] = 0.2
    rubs = {"friction": rng.uniform(0.1, 1)}
    if rng.random() < 0.5 and not any("drive" in link for link in links):
        rubs = {"friction_coefficient": rng.uniform(0.01, 0.1)}
    cart = {"kind": "cart", "mass": rng.uniform(0.5, 4), "stiffness": 3.0, **rubs}
    support = cart if rng.random() < 0.5 else {"kind": "fixed"}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links}]})


@pytest.mark.parametrize("seed", usually([1], range(100)))
def test_fresh_members_are_pieces_of_the_maximal_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = fresh(rng)
    starts = rng.uniform(-0.8, 0.8, (MEMBERS, scene.n_links))
    runs = ensemble(scene, 2.0, starts=starts, engine="numpy", workers=1, check=0, tolerance=1e-12)
    assert not runs.failures
    events = 0
    for start, end in zip(starts, runs.final.links, strict=True):
        pieces = Pieces(scene)
        assert np.abs(pieces.end(State(start, 0 * start), 2.0).links - end).max() < 1e-8
        events += pieces.events
    assert events > 0
