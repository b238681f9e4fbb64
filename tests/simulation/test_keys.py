"""Every number of a scene is read: another one gives another start or other equations, or is refused."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from modal.errors import SceneError
from modal.scene import Bob, Cart, InitialCondition, Pendulum, Scene, load, refusals
from modal.scene.parameters import find_places, number_at, number_paths, vary
from modal.scene.supports import Displaced
from nonlinear import initial_state, simulate
from nonlinear.dynamics import Generated
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.system import has_start, system_of

KINDS = sorted(
    path for path in (Path(__file__).parents[1] / "combinations" / "scenes").glob("*.toml") if path.stem != "count_100"
)
DRAWN = ("position[0]", "position[1]")
"""Where what is drawn stands; on structures of several supports it is read, and compared there."""


def answer(scene: Scene) -> np.ndarray:
    """The start, the switches, and the rates of a state drawn at random at two times."""
    start = np.concatenate([np.ravel(part) for part in astuple(initial_state(scene))]) if has_start(scene) else []
    system = system_of(scene)
    equations = Generated(system)
    y = np.random.default_rng(3).uniform(0.3, 0.8, equations.layout.size)
    rates = [np.ravel(equations.derivative(time, y)) for time in (0.37, 1.1)]
    return np.concatenate((start, switching_of(system), *rates))


@pytest.mark.parametrize("path", KINDS, ids=lambda path: path.stem)
def test_every_number_of_a_scene_is_read(path: Path) -> None:
    scene = load(path)
    before = answer(scene)
    unread = []
    for place in number_paths(scene):
        value = number_at(scene, find_places(scene, place)[0])
        try:
            other = vary(scene, {place: value + 1 if place.endswith("count") else 1.25 * value or 0.125})
        except SceneError:
            continue
        is_read = refusals(other, "form minimal") or answer(other).tolist() != before.tolist()
        unread += [] if is_read or place.endswith(DRAWN) else [place]
    assert unread == (["pendulum[0].links[1].length"] if path.stem == "body" else [])  # below which nothing hangs


@pytest.mark.parametrize("space", ["plane", "space"])
def test_a_cart_begins_where_its_start_says(space: str) -> None:
    support = Cart(mass=3.0, stiffness=10.0, start=Displaced(displacement=0.2, rate=0.5))
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), start=InitialCondition(angles_deg=(10.0,)))
    run = simulate(Scene(gravity=9.81, space=space, support=support, pendulum=(pendulum,)), 1.0, output=3)
    assert (run.motion.cart[0], run.motion.cart_rate[0]) == (0.2, 0.5)
    assert run.motion.cart[-1] == pytest.approx(0.32975262, abs=1e-8)
