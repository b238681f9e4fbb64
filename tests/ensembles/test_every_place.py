"""Every number of every kind of scene, varied in every engine, against the runs of scenes of their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.amounts import usually
from support.loops import interpreted
from support.uncompiled import uncompiled

from modal import example_names, load
from modal.errors import MultipendulaError, SceneError
from modal.scene import InitialCondition, Scene, refusals
from modal.scene.parameters import find_places, number_at, number_paths, vary
from nonlinear import simulate
from nonlinear.ensembles import ENGINES, ensemble
from nonlinear.integration import ASKED, Choice
from nonlinear.simulation import request_of
from nonlinear.system import Motion, State, apart, motion_of

ROOT = Path(__file__).parents[2]
FILES = (ROOT / "tests" / "combinations" / "scenes").glob("*.toml")
SCENES = {**{name: name for name in example_names()}, **{path.stem: str(path) for path in sorted(FILES)}}
LONG = {"count_100", "rope", "thousand-pendula", "two-swings"}
"""Scenes of many links, each of whose numbers others have."""
TOLERANCE, NEAR = 1e-10, 1e-8


def started(scene: Scene) -> Scene:
    """With a start of every pendulum in which all links move."""
    pendula = []
    for pendulum in scene.pendulum:
        links = sum(link.count for link in pendulum.links)
        start = {"angles_deg": np.linspace(12, 20, links).tolist(), "rates_deg": np.linspace(5, -5, links).tolist()}
        more = {"azimuths_deg": [30.0] * links} if scene.space == "space" else {}
        pendula.append(pendulum.replace(start=pendulum.start or InitialCondition(**start, **more)))
    return scene.replace(pendulum=pendula)


def variations(scene: Scene) -> Iterator[tuple[str, list[float]]]:
    """Every place with the scene's own number, another and 0, of which the scene can have two at least."""
    for path in number_paths(scene):
        value = number_at(scene, find_places(scene, path)[0])
        values = []
        for number in dict.fromkeys((value, 1.05 * value or 0.02, 2.0 * value, 0.0)):
            try:
                assert not refusals(vary(scene, {path: number}), "an ensemble")
                values.append(number)
            except (SceneError, AssertionError):
                continue
        if len(values) > 1 and not path.endswith("count"):
            yield path, values


def away(first: Any, second: Motion) -> float:
    """How far states are from each other, carts and structures included (rad, m)."""
    moved = [np.subtract(getattr(first, name), getattr(second, name)) for name in ("cart", "supports")]
    return max(apart(first, second).max(), *(np.abs(part).max(initial=0.0) for part in moved))


def by_others(scene: Scene, seconds: float) -> Iterator[State]:
    """The ends of runs by other equations and integrators."""
    if not refusals(scene, "form maximal"):
        yield simulate(scene, seconds, form="maximal", tolerance=TOLERANCE, output=2).final
    if not refusals(scene, "compiled equations"):
        request = request_of(scene, seconds, TOLERANCE, None, 2, None, 0.0, {})
        with uncompiled():
            yield request.run(Choice("minimal", "DOP853", True, ASKED, TOLERANCE)).final


@pytest.mark.parametrize("name", usually(["springs"], sorted({*SCENES} - LONG)))
def test_every_number_is_that_of_its_member_in_every_engine(name: str) -> None:
    scene = started(load(SCENES[name]))
    if refusals(scene, "an ensemble"):
        return
    seconds = 0.6 if "escapement" in scene.features else 0.1
    options: dict[str, Any] = {"tolerance": TOLERANCE, "workers": 1, "check": 0}
    tried, moved = 0, 0
    for path, values in [*variations(scene)][:: usually(7, 1)]:
        try:
            runs = [simulate(vary(scene, {path: value}), seconds, tolerance=TOLERANCE, output=2) for value in values]
        except MultipendulaError:  # a massless cart whose effective mass vanishes, a ratio in space
            continue
        expected = motion_of([run.final for run in runs])
        moved += away(expected.at([1]), expected.at([0])) > NEAR
        for engine in ENGINES:
            try:
                with interpreted() if engine == "numba" else nullcontext():
                    members = ensemble(scene, seconds, vary={path: values}, engine=engine, **options)
            except SceneError as error:
                assert "does not support" in str(error) or "one by one" in str(error), (path, engine)  # noqa: PT017
                assert len(error.problems) == 1, (path, engine)  # noqa: PT017
                continue
            assert not members.failures, (path, engine)
            assert away(members.final, expected) < NEAR, (path, engine)
            tried += 1
        for end in by_others(vary(scene, {path: values[1]}), seconds):
            assert away(motion_of([end]), expected.at([1])) < NEAR, path
    assert min(tried, moved) > usually(0, 3) or "massless_cart" in scene.features
