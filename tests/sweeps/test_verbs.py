"""Every verb by every measure: it works, with the same numbers as the others, or it says why it does not."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from modal import load
from modal.errors import SceneError
from modal.extend import registered
from modal.extend.measures import VERBS, columns_of, measure_for, parse_request, taken_by
from modal.scene import InitialCondition, Scene
from modal.scene.parameters import vary
from nonlinear import simulate
from nonlinear.ensembles import ensemble, find_basins, run_together
from nonlinear.sweeps import find_spread, parse_measures

SECONDS = 6.5
WIDE = InitialCondition(angles_deg=(100.0, -60.0))
HUYGENS = load("huygens")


@cache
def chain() -> Scene:
    scene = load("chain-2")
    return scene.replace(pendulum=[scene.pendulum[0].replace(start=WIDE)])


def swept(scene: Scene, text: str) -> dict[str, float]:
    (request,) = parse_measures([text])
    return request.of(scene)


def mapped(scene: Scene, text: str) -> dict[str, float]:
    angles = [pendulum.start.angles_deg for pendulum in scene.pendulum if pendulum.start]
    places = [f"pendulum[{p}].start.angles_deg[{k}]" for p, links in enumerate(angles) for k in range(len(links))]
    axes = [f"{place}={angle!r}" for place, angle in zip(places, np.concatenate(angles).tolist(), strict=True)]
    basins = find_basins(scene, vary=axes[:2], measure=text, tolerance=1e-7, check=0, workers=1, engine="numpy")
    return {basins.column: float(basins.values.ravel()[0])}


def spread(scene: Scene, text: str) -> dict[str, float]:
    spreads = find_spread(scene, ["gravity=0.01"], members=3, measures=[text])
    return {name: nominal for name, (nominal, _) in spreads.measured.items()}


def member(scene: Scene, text: str) -> dict[str, float]:
    name, _, seconds = text.partition(":")
    same = {"gravity": [scene.gravity]}
    members = ensemble(scene, float(seconds), vary=same, measures=[name], engine="numpy", check=0, tolerance=1e-7)
    return {column: float(members.column(column)[0]) for column in columns_of(name, members.columns)}


MEASURES = registered("measure", discover=False)
ROUTES = {"sweep": swept, "basins": mapped, "spread": spread, "ensemble": member}


def test_the_list_is_what_is_computed() -> None:
    assert {*taken_by("sweep")} >= {*taken_by("spread")}
    for name in taken_by("ensemble"):
        assert MEASURES[name].has("of_members") or MEASURES[name].has("of_motion")
    assert {*taken_by("basins")} == {*taken_by("ensemble")} - {"pendulum_energy", "section"} | {"attractor"}


@pytest.mark.parametrize("name", MEASURES)
def test_a_verb_takes_a_measure_or_says_why_not(name: str) -> None:
    """Refused by the same sentence everywhere, before anything is computed."""
    for verb in VERBS:
        if name in taken_by(verb):
            assert type(measure_for(verb, name)) is MEASURES[name]
        else:
            why = MEASURES[name].refused[verb]
            doors = {
                "sweep": partial(parse_measures, [name]),
                "basins": partial(find_basins, chain(), 1.0, measure=name),
                "spread": partial(find_spread, chain(), ["gravity=0.1"], members=3, measures=[name]),
                "ensemble": partial(ensemble, chain(), 1.0, vary={"gravity": [9.8]}, measures=[name]),
            }
            with pytest.raises(SceneError) as refused:
                doors[verb]()
            assert refused.value.problems == (f"measure {name}: {verb} does not take {name}: {why}",)


@pytest.mark.parametrize(
    "name",
    ["largest_angle", "order", "first_turn", "lyapunov"],
)
def test_all_verbs_have_the_same_numbers(name: str) -> None:
    """By runs one by one, by lanes over a grid of starts, by drawn scenes, by members."""
    numbers = {verb: ROUTES[verb](chain(), f"{name}:{SECONDS:g}") for verb in VERBS if verb in ROUTES}
    first = numbers["sweep"]
    assert {*first} == {*columns_of(name, list(first))}
    for verb, value in numbers.items():
        expected = {"first_turn_s": min(first.values())} if (verb, name) == ("basins", "first_turn") else first
        assert value == {column: pytest.approx(number, rel=2e-4, abs=2e-4) for column, number in expected.items()}, verb


def test_what_belongs_to_a_scene_is_the_same_for_a_sweep_and_a_spread() -> None:
    for text in ("frequencies:2", "damping:1", "beat", "splitting", "energy_drift:1", "pendulum_energy:1"):
        assert spread(chain(), text) == swept(chain(), text)


def test_what_is_drawn_is_measured_as_a_sweep_measures_it() -> None:
    """Member by member, and a number explains its share of the variance."""
    drawn = find_spread(chain(), ["gravity=5%", "pendulum[0].links[0].mass=1%"], members=8, measures=["beat:1"])
    (column, (_, beats)), gravity = next(iter(drawn.measured.items())), drawn.values["gravity"]
    masses = drawn.values["pendulum[0].links[0].mass"]
    for beat, g, mass in zip(beats, gravity, masses, strict=True):
        scene = vary(chain(), {"gravity": g, "pendulum[0].links[0].mass": mass})
        assert swept(scene, "beat:1")[column] == pytest.approx(beat, rel=1e-12)
    assert drawn.quantities[0]["matters_most"] == "gravity"
    assert drawn.to_dict()[column] is beats


def test_the_number_of_a_map_is_its_duration() -> None:
    axes = ["pendulum[0].start.angles_deg[0]=100", "pendulum[0].start.angles_deg[1]=-60"]
    options = {"vary": axes, "engine": "numpy", "check": 0, "workers": 1}
    longer = find_basins(chain(), measure="largest_angle:3", **options)
    assert longer.ensemble.question.duration == 3.0
    assert longer.values == find_basins(chain(), 3.0, measure="largest_angle", **options).values
    with pytest.raises(SceneError, match="largest_angle:3: has its own `duration`"):
        find_basins(chain(), 3.0, measure="largest_angle:3", **options)
    with pytest.raises(SceneError, match="is now largest_angle"):
        parse_request("sweep", "amplitude:3")


def test_runs_with_kicks_go_alone() -> None:
    """Side by side they would swing without their escapements."""
    scenes = [HUYGENS.replace(gravity=g) for g in (9.7, 9.8, 9.9, 10.0)]
    assert run_together(scenes, 1.0) == {}
    fed = simulate(scenes[0], 6.0)
    expected = np.degrees(np.abs(fed.motion.links).max())
    assert len(fed.kicks.time)
    assert swept(scenes[0], "largest_angle:6")["largest_angle_deg"] == pytest.approx(expected, rel=1e-2)
