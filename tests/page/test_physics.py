"""The page's modes and motions in Chromium against Python's, on random scenes."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import usually
from chromium import Chromium
from live import BROWSER, asked, assert_rows, physics
from scenes import mild_scene, motion_scene
from scipy.integrate._ivp import dop853_coefficients as coefficients

from modal import natural_modes
from modal.modes import Modes
from modal.scene import (
    Fixed,
    InitialCondition,
    Moved,
    Scene,
    SineMotion,
    describe,
    example_names,
    load,
    parse,
    refusals,
    scene_from,
)
from multipendula.page import MOST_LINKS, scene_data
from nonlinear import simulate
from nonlinear.dynamics import Generated
from nonlinear.integration import Trajectory
from nonlinear.system import AppliedForces, initial_state, system_of

pytestmark = BROWSER

FREQUENCY, DAMPED, SHAPE, MOTION = 1e-12, 1e-9, 1e-9, 1e-6
APART = 1e-10
"""rad by which a twin is started; within the horizon it stays within a thousand times that."""
SECONDS = 10.0

MODES = """(scenes) => scenes.map((scene) => {
  const system = $system.systemOf(scene);
  const plain = (shapes) => shapes?.map((shape) => [...shape]) ?? null;
  return $modes.modesOf(system).map((row) => {
    const shapes = { shapes: plain(row.shapes), twists: plain(row.twists) };
    return { ...row, ...shapes, swing: null, parts: null };
  });
})"""
RUNS = """({ scenes, times }) => scenes.map((scene) => {
  const system = $system.systemOf(scene);
  const motion = new $motion.Motion(system, $system.startOf(scene, system), { tolerance: 1e-12, linear: false });
  const rows = times.map((time) => (motion.advance(time), [...motion.y]));
  return { rows, worst: motion.worst };
})"""


@pytest.fixture(autouse=True, scope="module")
def _modules(browser: Chromium, tmp_path_factory: pytest.TempPathFactory) -> None:
    physics(browser, tmp_path_factory.mktemp("physics"))


def two_hundred() -> list[Scene]:
    every = [scene for seed in range(100) for scene in (motion_scene(seed), mild_scene(seed))]
    return usually(every[::12], every)


def strangers(row: dict[str, Any], modes: Modes, number: int) -> list[float]:
    """How far each shape of a row is from the span of the table's shapes there."""
    matrix = modes.matrix
    basis = np.linalg.qr(np.linalg.cholesky(matrix.M).T @ matrix.shapes[:, matrix.row == number])[0]
    far = []
    for values, twist in zip(row["shapes"], row["twists"] or [None] * row["multiplicity"], strict=True):
        shape = np.array(values) + 1j * np.array(twist or 0.0)
        scaled = np.linalg.cholesky(matrix.M).T @ (shape if modes.on_cart else shape[1:])
        left = scaled - basis @ (basis.conj().T @ scaled)
        far.append(float(np.linalg.norm(left) / np.linalg.norm(scaled)))
    return far


def assert_modes(rows: list[dict[str, Any]], scene: Scene) -> None:
    modes = natural_modes(scene)
    assert_rows(rows, modes, words=scene.n_links < MOST_LINKS)
    for number, row in enumerate(rows):
        assert row["omega"] == pytest.approx(modes.omega[number], rel=DAMPED if scene.has_damping else FREQUENCY)
        assert max(strangers(row, modes, number)) <= SHAPE
        assert row["growing"] == (modes[number].growth_rate is not None)


def test_modes_are_those_of_the_table(browser: Chromium) -> None:
    scenes = two_hundred()
    for rows, scene in zip(asked(browser, MODES, [scene_data(each) for each in scenes]), scenes, strict=True):
        assert_modes(rows, scene)


def test_modes_of_shipped_scenes_and_of_a_long_chain(browser: Chromium) -> None:
    scenes = [each for each in map(load, example_names()) if each.n_links <= MOST_LINKS and each.space == "plane"]
    scenes = [each for each in scenes if not refusals(each, "the live page") and not each.is_structured]
    link = load("chain-5").pendulum[0].links[0].replace(count=MOST_LINKS)
    scenes.append(Scene(gravity=9.81, pendulum=[load("chain-5").pendulum[0].replace(links=(link,), start=None)]))
    assert len(scenes) == 21
    for rows, scene in zip(asked(browser, MODES, [scene_data(each) for each in scenes]), scenes, strict=True):
        assert_modes(rows, scene)


def test_a_wrong_shape_or_frequency_is_seen(browser: Chromium) -> None:
    scene = motion_scene(3)
    (rows,) = asked(browser, MODES, [scene_data(scene)])
    for place, factor in ((0, 1 + 1e-8), (-1, 1 - 1e-8)):
        changed = [dict(row) for row in rows]
        changed[place]["omega"] *= factor
        with pytest.raises(AssertionError):
            assert_modes(changed, scene)
    changed = [dict(row) for row in rows]
    changed[-1]["shapes"] = [[value + 1e-7 * i for i, value in enumerate(changed[-1]["shapes"][0])]]
    with pytest.raises(AssertionError):
        assert_modes(changed, scene)


def within(run: Trajectory, scene: Scene) -> np.ndarray:
    """Which samples (T,) are within the horizon: a twin started APART stays near."""
    start = initial_state(scene)
    twin = type(start)(start.links + APART, start.link_rates)
    other = simulate(scene, SECONDS, start=twin, output=run.times, tolerance=1e-12)
    away = np.abs(other.motion.links - run.motion.links).max(axis=1)
    return np.logical_and.accumulate(away < 1000 * APART)


def apart(rows: list[list[float]], run: Trajectory) -> np.ndarray:
    """The largest angle (rad) and distance of the cart (m) between a page's run and Python's, (T,)."""
    mine, n = np.array(rows), run.system.n_links
    cart = np.abs(mine[:, 0] - run.motion.cart)
    return np.maximum(np.abs(mine[:, 1 : 1 + n] - run.motion.links).max(axis=1), cart)


def test_motions_are_pythons_within_the_horizon(browser: Chromium) -> None:
    seeds = usually(range(5), range(200))
    scenes = [motion_scene(seed) for seed in seeds]
    times = np.linspace(0, SECONDS, 41)
    question = {"scenes": [scene_data(each) for each in scenes], "times": times.tolist()}
    compared = 0
    for answer, scene in zip(asked(browser, RUNS, question), scenes, strict=True):
        run = simulate(scene, SECONDS, output=times, tolerance=1e-12)
        inside = within(run, scene)
        assert apart(answer["rows"], run)[inside].max() < MOTION
        assert answer["worst"] < 1e-8
        compared += int(inside.sum())
        if scene.has_damping:
            works = np.array(answer["rows"])[inside, -1]
            assert np.abs(works - run.motion.work[inside]).max() < 1e-5 * max(1.0, np.abs(run.motion.work).max())
    assert compared > 10 * len(scenes)


def aired(scene: Scene, **numbers: float) -> Scene:
    """The scene with the same numbers given to every link."""
    pendula = (
        pendulum.replace(links=tuple(link.replace(**numbers) for link in pendulum.links)) for pendulum in scene.pendulum
    )
    return scene.replace(pendulum=tuple(pendula))


SHAKEN = {"amplitude": 0.1, "frequency_hz": 1.7, "phase_deg": 25.0}
AIR = {"drag": 0.1, "quadratic_drag": 0.3}
ACTED = {
    "linear drag": lambda scene: aired(scene, drag=0.2),
    "quadratic drag": lambda scene: aired(scene, **AIR),
    "shaken": lambda scene: scene.replace(support=Moved(motion=SineMotion(**SHAKEN))),
    "heaved": lambda scene: scene.replace(support=Moved(motion=SineMotion(direction="vertical", **SHAKEN))),
}


@pytest.mark.parametrize("name", ACTED)
def test_drag_and_moved_supports_act_as_in_python(browser: Chromium, name: str) -> None:
    times = np.linspace(0, SECONDS, 41)
    scenes = [ACTED[name](motion_scene(seed)) for seed in usually((2, 5), range(40))]
    question = {"scenes": [scene_data(each) for each in scenes], "times": times.tolist()}
    for answer, scene in zip(asked(browser, RUNS, question), scenes, strict=True):
        run = simulate(scene, SECONDS, output=times, tolerance=1e-12)
        inside = within(run, scene)
        assert inside.sum() > 10
        assert apart(answer["rows"], run)[inside].max() < MOTION
        works, most = np.array(answer["rows"])[inside, -1], np.abs(run.motion.work).max()
        assert most > 0.1
        assert np.abs(works - run.motion.work[inside]).max() < 1e-5 * max(1.0, most)
        assert answer["worst"] < 1e-8


@pytest.mark.parametrize("direction", ["horizontal", "vertical"])
def test_a_support_that_moves_through_the_air_is_pythons(browser: Chromium, direction: str) -> None:
    """Rates at random states: scenes refuse drag on a moved support, the equations do not."""
    question = """({ scene, support, states }) => {
      const system = $system.systemOf({ ...scene, support });
      const rates = $equations.equationsOf(system);
      return states.map(([time, ...y]) => {
        const out = new Float64Array(y.length);
        rates(time, Float64Array.from(y), out);
        return [...out];
      });
    }"""
    rng = np.random.default_rng(0)
    support = Moved(motion=SineMotion(direction=direction, **SHAKEN))
    scene = aired(motion_scene(4).replace(support=Fixed()), **AIR)
    system = replace(system_of(scene), support=system_of(motion_scene(4).replace(support=support)).support)
    equations, half = Generated(system), system.n_links
    states = rng.normal(size=(20, 2 * half + 2))
    rows = [[time, 0.0, *y[:half], 0.0, *y[half:]] for time, *y in states.tolist()]
    mine = asked(browser, question, {"scene": scene_data(scene), "support": describe(support), "states": rows})
    for (time, *y), rates in zip(states.tolist(), mine, strict=True):
        expected = equations.derivative(time, np.array(y))
        assert np.delete(rates, (0, 1 + half)) == pytest.approx(expected, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("name", ACTED)
def test_the_linear_motion_is_that_of_small_angles(browser: Chromium, name: str) -> None:
    """Half the angles leave an eighth of the difference, with quadratic drag a quarter."""
    question = """(scenes) => scenes.map((scene) => {
      const system = $system.systemOf(scene);
      const motion = new $motion.Motion(system, $system.startOf(scene, system), { tolerance: 1e-12 });
      motion.advance(4);
      return [[...motion.y], [...motion.predicted]].map((y) => y.slice(0, -1));
    })"""
    scene = ACTED[name](load("chain-2"))
    scenes = []
    for size in (1e-3, 5e-4):
        start = InitialCondition(angles_deg=(200 * size, -300 * size), rates_deg=(0.0, 100 * size))
        swung = scene.replace(pendulum=(scene.pendulum[0].replace(start=start),))
        if name in {"shaken", "heaved"}:
            amplitude = size / 10 if name == "shaken" else 0.01
            motion = swung.support.motion.replace(amplitude=amplitude)
            swung = swung.replace(support=swung.support.replace(motion=motion))
        scenes.append(swung)
    (large, small) = (np.array(pair) for pair in asked(browser, question, [scene_data(swung) for swung in scenes]))
    ends = [np.abs(full).max() for full, _ in (large, small)]
    left = [np.abs(full - linear).max() for full, linear in (large, small)]
    assert ends[0] / ends[1] == pytest.approx(2, rel=0.02)
    assert left[0] < 0.02 * ends[0]
    assert left[0] / left[1] > (3.5 if name == "quadratic drag" else 7)


@pytest.mark.parametrize("name", ["huygens", "metronomes", "clocks-double"])
def test_clocks_tick_as_pythons(browser: Chromium, name: str) -> None:
    scene, times = load(name), np.linspace(0, SECONDS, 21)
    (answer,) = asked(browser, RUNS, {"scenes": [scene_data(scene)], "times": times.tolist()})
    run = simulate(scene, SECONDS, output=times, tolerance=1e-12)
    assert apart(answer["rows"], run).max() < MOTION
    assert np.array(answer["rows"])[-1, -1] == pytest.approx(run.motion.work[-1], rel=1e-6)
    assert answer["worst"] < 1e-8


@pytest.mark.parametrize(("angle", "start"), [(10.0, 10.001), (0.0, 5.0), (10.0, 9.99)])
def test_a_kick_is_not_missed_between_steps(browser: Chromium, angle: float, start: float) -> None:
    """Some 9 ms beyond the angle; a kick at the lowest point; a swing that never gets there."""
    drive = {"kind": "escapement", "impulse": 1e-3, "angle_deg": angle}
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": drive}
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [link], "start": {"angles_deg": [-start]}}]})
    (answer,) = asked(browser, RUNS, {"scenes": [scene_data(scene)], "times": [0.25 * k for k in range(1, 21)]})
    run = simulate(scene, 5.0, tolerance=1e-12)
    assert answer["rows"][-1][1] == pytest.approx(run.final.links[0], abs=MOTION)
    assert (len(run.kicks.time) > 0) == (start != 9.99)
    assert answer["rows"][-1][-1] == pytest.approx(run.motion.work[-1], abs=1e-8)


@pytest.mark.parametrize("name", ["paper-cart-2", "chain-2"])
def test_a_push_is_pythons_load_and_the_linear_motion_is_the_superposition(browser: Chromium, name: str) -> None:
    scene, amount, omega = load(name), 0.5, 2.5
    small = scene.replace(
        pendulum=tuple(
            pendulum.replace(
                start=pendulum.start.replace(angles_deg=tuple(a / 2000 for a in pendulum.start.angles_deg))
            )
            for pendulum in scene.pendulum
            if pendulum.start
        )
    )
    question = """({ scene, amount, omega }) => {
      const system = $system.systemOf(scene);
      const push = (time) => amount * Math.cos(omega * time);
      const motion = new $motion.Motion(system, $system.startOf(scene, system), { tolerance: 1e-12, push });
      motion.advance(5);
      return { y: [...motion.y], predicted: [...motion.predicted] };
    }"""
    on_cart = scene.support.kind == "cart"

    def load_of(time: float, state: object) -> AppliedForces:
        push = driven["amount"] * np.cos(omega * time)
        if on_cart:
            return AppliedForces(push)
        return AppliedForces(moments=np.array([push, 0.0]))

    driven = {"scene": scene_data(scene), "amount": amount, "omega": omega}
    answer = asked(browser, question, driven)
    run = simulate(scene, 5.0, load=load_of, tolerance=1e-12)
    assert np.abs(np.array(answer["y"])[1 : 1 + scene.n_links] - run.final.links).max() < MOTION
    driven = {"scene": scene_data(small), "amount": 1e-3, "omega": omega}
    answer = asked(browser, question, driven)
    size = max(map(abs, answer["y"]))
    assert answer["predicted"][:-1] == pytest.approx(answer["y"][:-1], abs=1e-5 * size)
    assert size > 1e-4


def test_five_double_pendula_cost_little(browser: Chromium) -> None:
    """Counts, not times: 25 passes along the chains a frame, each of some 4 µs (`benchmarks/page.py`)."""
    pair = load("paper-cart-2")
    scene = pair.replace(pendulum=(pair.pendulum[0].replace(count=5),))
    question = """(scene) => {
      const system = $system.systemOf(scene);
      const motion = new $motion.Motion(system, $system.startOf(scene, system));
      for (let frame = 1; frame <= 600; frame++) motion.advance(frame / 60);
      return [motion.full.calls / 600, motion.linear.calls / 600, motion.worst];
    }"""
    full, linear, drift = asked(browser, question, scene_data(scene))
    assert 12 <= full < 25
    assert 12 <= linear < 25
    assert drift < 1e-8


def test_a_scene_file_of_the_page_reads_back(browser: Chromium) -> None:
    scenes = [load(name) for name in ("huygens", "cart-upright", "metronomes", "rope")][:3]
    scenes += [motion_scene(seed) for seed in range(5)] + [mild_scene(seed) for seed in range(5)]
    scenes += [acted(motion_scene(5)) for acted in ACTED.values()]
    scenes.append(scenes[0].replace(title='A "quoted" \\ <b>title</b> \x7fü 😀'.replace("\x7f", "")))
    for text, scene in zip(
        asked(browser, "(all) => all.map((one) => $scene_file.sceneFile(one))", [scene_data(each) for each in scenes]),
        scenes,
        strict=True,
    ):
        assert scene_data(parse(text.encode())) == scene_data(scene)


def test_the_state_in_a_scene_file_is_the_start_of_a_simulation(browser: Chromium) -> None:
    scene = mild_scene(2)
    question = """(scene) => {
      const system = $system.systemOf(scene);
      const y = $system.atRest(system).map((value, i) => value + 0.1 * Math.sin(i));
      return { y: [...y], text: $scene_file.sceneFile(scene, system, y) };
    }"""
    answer = asked(browser, question, scene_data(scene))
    back, n = parse(answer["text"].encode()), scene.n_links
    start = initial_state(back)
    assert back.n_pendula == scene.n_pendula
    assert start.links == pytest.approx(answer["y"][1 : 1 + n], rel=1e-14)
    assert start.link_rates == pytest.approx(answer["y"][n + 2 : 2 * n + 2], rel=1e-14)


def test_the_coefficients_are_scipys(browser: Chromium) -> None:
    mine = json.loads(browser.run("JSON.stringify($tableau.DOP853)"))
    assert [*map(len, mine["A"])] == list(range(12))
    for row, values in enumerate(mine["A"]):
        assert values == coefficients.A[row, :row].tolist()
    for name, size in (("B", 12), ("C", 12), ("E3", 12), ("E5", 12)):
        assert mine[name] == getattr(coefficients, name)[:size].tolist()


def test_a_link_is_checked_before_it_is_believed(browser: Chromium) -> None:
    scene = scene_data(load("chain-2"))
    wrong = [
        {"scene": scene | {"gravity": -1}},
        {"scene": scene | {"title": 5}},
        {"scene": scene | {"support": {"kind": "cart", "mass": 0}}},
        {"scene": scene | {"pendulum": []}},
        {
            "scene": scene
            | {"support": {"kind": "moved", "motion": {"kind": "random", "amplitude": 1, "frequency_hz": 1}}}
        },
        {
            "scene": scene
            | {"support": {"kind": "moved", "motion": {"kind": "sine", "amplitude": 1, "frequency_hz": 0}}}
        },
        {"scene": scene | {"pendulum": [{"links": [{"kind": "bob", "mass": 1, "length": 1, "drag": -1}]}]}},
        {"scene": scene | {"pendulum": [{"links": [{"kind": "bob", "mass": "1", "length": 1}]}]}},
        {"scene": scene | {"pendulum": [scene["pendulum"][0] | {"count": 1e6}]}},
        {"scene": scene, "y": [0, 0]},
        {"scene": scene, "selected": 2},
        {"scene": scene, "drive": {"amount": -1, "frequency": 1}},
        {},
        None,
        [],
    ]
    question = "([own, all]) => all.map((one) => $scene_file.unpacked($scene_file.packed(one), own))"
    assert asked(browser, question, [scene, wrong]) == [None] * len(wrong)
    scene = scene | {"title": "Ω <b>"}
    right = {"scene": scene | {"gravity": 1.62}, "y": [0, 1, 2, 0, 0, 0], "selected": 1}
    assert asked(browser, question, [scene, [right]]) == [right]
    assert (
        asked(
            browser,
            "([own, all]) => all.map((one) => $scene_file.unpacked(one, own))",
            [scene, ["", "%%%", "e30", "bnVsbA"]],
        )
        == [None] * 4
    )
