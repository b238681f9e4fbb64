"""The page of scenes with dry friction, forces and all that moves a support in time, in Node against Python."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from live import NEEDS_NODE, said_by_node

from modal.errors import SceneError
from modal.scene import parse, scene_from
from multipendula.page import LARGEST_OF_STRUCTURES, joined, page, scene_data
from multipendula.page.document import PHYSICS
from multipendula.page.scalars import HELPERS, functions_of
from nonlinear import simulate
from nonlinear.dynamics import complementarity
from nonlinear.integration import switching_source
from nonlinear.system import initial_state

SECONDS, SAMPLES, CLOSE = 3.0, 7, 1e-9
SMALL = ("forces", "both ways")


def bob(mass: float = 1.0, length: float = 1.0, **more: Any) -> dict[str, Any]:
    return {"kind": "bob", "mass": mass, "length": length, **more}


def hung(*links: dict[str, Any], angles: list[float], **more: Any) -> dict[str, Any]:
    return {"links": list(links), "start": {"angles_deg": angles}, **more}


ESCAPEMENT = {"kind": "escapement", "impulse": 1e-3, "angle_deg": 5.0}
SCENES: dict[str, dict[str, Any]] = {
    "joints": {"pendulum": [hung(bob(friction=0.3), bob(0.5, 0.7, friction=0.1, damping=0.01), angles=[40.0, -30.0])]},
    "rail": {
        "support": {"kind": "cart", "mass": 2.0, "friction": 0.6},
        "pendulum": [hung(bob(), angles=[30.0], count=2)],
    },
    "coefficient": {
        "support": {"kind": "cart", "mass": 2.0, "friction_coefficient": 0.05},
        "pendulum": [hung(bob(friction=0.1), bob(0.5, 0.7), angles=[30.0, 10.0])],
    },
    "moved": {
        "support": {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.05, "frequency_hz": 0.7}},
        "pendulum": [hung(bob(friction=0.3), bob(0.5, 0.7, friction=0.05, drag=0.05), angles=[20.0, -10.0])],
    },
    "clocks": {
        "support": {"kind": "cart", "mass": 2.0, "friction": 0.02},
        "pendulum": [hung(bob(0.1, 0.2, damping=1e-4, drive=ESCAPEMENT), angles=[12.0], count=2)],
    },
    "forces": {
        "support": {"kind": "cart", "mass": 2.0, "stiffness": 3.0},
        "force": [
            {"on": "cart", "kind": "sine", "amplitude": 3.0, "frequency_hz": 0.5, "phase_deg": 30.0},
            {"on": "pendulum[0].links[1]", "kind": "sine", "amplitude": 1.0, "frequency_hz": 0.8},
        ],
        "pendulum": [hung(bob(), bob(0.5, 0.7), angles=[20.0, -10.0])],
    },
    "both ways": {
        "support": {
            "kind": "moved",
            "motion": [
                {"kind": "sine", "amplitude": 0.05, "frequency_hz": 0.7},
                {"kind": "sine", "amplitude": 0.03, "frequency_hz": 1.1, "phase_deg": 20.0, "direction": "vertical"},
            ],
        },
        "pendulum": [hung(bob(), bob(0.5, 0.7), angles=[20.0, -10.0])],
    },
}
TIMES = [0.1 * k for k in range(41)]
RECORD = {"kind": "record", "time_s": TIMES, "acceleration_m_per_s2": [float(np.sin(5.0 * t)) for t in TIMES]}
SWEEP = {"kind": "sweep", "amplitude": 0.05, "from_hz": 0.3, "to_hz": 2.0, "duration": 3.0}
NOISE = {"kind": "random", "psd": [0.05, 0.05], "frequency_hz": [0.3, 5.0], "seed": 3, "duration": 20.0}
TWO = [hung(bob(), bob(0.5, 0.7), angles=[20.0, -10.0])]
PRESCRIBED: dict[str, dict[str, Any]] = {
    "record": {"support": {"kind": "moved", "motion": RECORD}, "pendulum": TWO},
    "record, friction": {
        "support": {"kind": "moved", "motion": [RECORD, {**SWEEP, "direction": "vertical"}]},
        "pendulum": [hung(bob(friction=0.1), bob(0.5, 0.7, drag=0.05), angles=[20.0, -10.0])],
    },
    "sweep": {"support": {"kind": "moved", "motion": SWEEP}, "pendulum": TWO},
    "noise": {"support": {"kind": "cart", "mass": 2.0}, "force": [{"on": "cart", **NOISE}], "pendulum": TWO},
    "ground": {
        "ground": {"motion": RECORD},
        "support": {"kind": "swing", "length": 1.0, "mass": 2.0},
        "force": [{"on": "pendulum[0].links[0]", **SWEEP}],
        "pendulum": [hung(bob(drag=0.1), angles=[20.0])],
    },
}
CHANGES: dict[str, list[tuple[list[Any], float]]] = {
    "joints": [
        (["pendulum", 0, "links", 0, "friction"], 0.5),
        (["pendulum", 0, "links", 1, "mass"], 0.8),
        (["pendulum", 0, "links", 0, "drag"], 0.1),
        (["pendulum", 0, "links", 1, "quadratic_drag"], 0.2),
    ],
    "rail": [(["support", "friction"], 1.1), (["support", "mass"], 3.0), (["gravity"], 5.0)],
    "coefficient": [(["support", "friction_coefficient"], 0.1), (["pendulum", 0, "links", 1, "damping"], 0.05)],
    "moved": [(["support", "motion", "amplitude"], 0.1)],
    "clocks": [(["pendulum", 0, "links", 0, "length"], 0.25)],
    "forces": [(["force", 1, "amplitude"], 2.0), (["force", 0, "frequency_hz"], 0.4)],
    "both ways": [(["support", "motion", 1, "frequency_hz"], 1.4)],
    "sweep": [(["support", "motion", "amplitude"], 0.1), (["support", "motion", "to_hz"], 1.5)],
    "record, friction": [(["pendulum", 0, "links", 0, "friction"], 0.2)],
}
SCENES |= PRESCRIBED
QUESTION = """
const whole = %(scene)s, changed = %(changed)s;
const run = (scene, options) => {
  const system = $system.systemOf(scene);
  const exact = { tolerance: 1e-12, linear: false, ...options };
  const motion = new $motion.Motion(system, $system.startOf(scene, system), exact);
  const rows = %(times)s.map((time) => (motion.advance(time), [...motion.y]));
  return { rows, worst: motion.worst, stuck: motion.full.stuck ?? null };
};
const quiet = structuredClone(whole);
for (const part of [quiet.support.motion ?? [], quiet.force ?? []].flat()) part.amplitude *= 1e-6;
for (const { start } of quiet.pendulum) start.angles_deg = start.angles_deg.map((angle) => 1e-6 * angle);
const small = %(small)s && (() => {
  const system = $system.systemOf(quiet);
  const motion = new $motion.Motion(system, $system.startOf(quiet, system), { tolerance: 1e-12 });
  motion.advance(1);
  return [[...motion.y], [...motion.predicted]];
})();
const { packed, unpacked, sceneFile } = $scene_file;
const linked = (scene) => unpacked(packed({ scene }), whole) !== null;
const [first, once] = [$system.systemOf(whole), run(whole)];
return {
  run: once,
  changed: run(changed),
  small,
  file: sceneFile(whole),
  held: sceneFile(whole, first, once.rows.at(-1)),
  links: [whole, changed, { ...whole, gravity: -1 }, { ...whole, pendulum: [] }].map(linked),
};
"""


def changed(name: str) -> dict[str, Any]:
    data = deepcopy(scene_data(scene_from({"gravity": 9.81, **SCENES[name]})))
    for place, value in CHANGES.get(name, []):
        part: Any = data
        for key in place[:-1]:
            part = part[key]
        part[place[-1]] = value
    return data


@pytest.fixture(scope="module")
def answers() -> dict[str, Any]:
    """What the pages say, all asked at once."""
    scripts = []
    for name, data in SCENES.items():
        scene = scene_from({"gravity": 9.81, **data})
        times = np.linspace(0, SECONDS, SAMPLES)[1:].tolist()
        asked_with = {"scene": scene_data(scene), "changed": changed(name), "times": times}
        asked_with["small"] = name in SMALL
        question = QUESTION % {key: json.dumps(value) for key, value in asked_with.items()}
        scripts.append(f"{json.dumps(name)}: (() => {{ {joined(PHYSICS, scene)}\n{question} }})()")
    return said_by_node(f"process.stdout.write(JSON.stringify({{ {', '.join(scripts)} }}));")


@NEEDS_NODE
@pytest.mark.parametrize("name", SCENES)
def test_motions_are_pythons_also_after_changes(answers: dict[str, Any], name: str) -> None:
    for which_, data in (("run", {"gravity": 9.81, **SCENES[name]}), ("changed", changed(name))):
        scene, answer = scene_from(data), answers[name][which_]
        run = simulate(scene, SECONDS, output=SAMPLES, tolerance=1e-12)
        rows, n = np.array(answer["rows"]), scene.n_links
        lead = rows.shape[1] // 2 - n
        assert np.abs(rows[:, lead : lead + n] - run.motion.links[1:]).max() < CLOSE
        assert np.abs(rows[:, lead + n + lead : -1] - run.motion.link_rates[1:]).max() < 10 * CLOSE
        assert np.abs(rows[:, -1] - run.motion.work[1:]).max() < CLOSE
        assert answer["worst"] < 1e-9


@NEEDS_NODE
def test_the_page_says_what_friction_holds(answers: dict[str, Any]) -> None:
    assert answers["forces"]["run"]["stuck"] is None
    scene = scene_from({"gravity": 9.81, **SCENES["joints"]})
    friction = simulate(scene, SECONDS, tolerance=1e-12).friction
    held = [int(link) for link, end in zip(friction.link, friction.end, strict=True) if end >= SECONDS]
    assert answers["joints"]["run"]["stuck"] == sorted(held)


@NEEDS_NODE
@pytest.mark.parametrize("name", SMALL)
def test_small_motions_are_the_linear_ones(answers: dict[str, Any], name: str) -> None:
    full, linear = (np.array(motion)[:-1] for motion in answers[name]["small"])
    assert np.abs(full - linear[: len(full)]).max() < 1e-5 * np.abs(full).max()


@NEEDS_NODE
@pytest.mark.parametrize("name", SCENES)
def test_files_read_back_and_links_hold_other_numbers(answers: dict[str, Any], name: str) -> None:
    scene = scene_from({"gravity": 9.81, **SCENES[name]})
    assert scene_data(parse(answers[name]["file"].encode())) == scene_data(scene)
    assert answers[name]["links"] == [True, True, False, False]
    if not answers[name]["held"].startswith("#"):
        state, row = initial_state(parse(answers[name]["held"].encode())), answers[name]["run"]["rows"][-1]
        lead = len(row) // 2 - scene.n_links
        assert state.links == pytest.approx(row[lead : lead + scene.n_links], rel=1e-12)


def test_pages_keep_their_size_and_long_ones_are_refused() -> None:
    links = [bob(friction=0.1) for _ in range(4)]
    scene = {"gravity": 9.81, "support": {"kind": "cart", "mass": 3.0, "friction_coefficient": 0.1}}
    scene |= {"pendulum": [{"links": links, "count": 3}]}
    assert len(page(scene_data(scene_from(scene))).encode()) < LARGEST_OF_STRUCTURES
    with pytest.raises(SceneError, match="cannot show dry friction on more than 12 links"):
        scene_data(scene_from({**scene, "pendulum": [{"links": links, "count": 4}]}))


@NEEDS_NODE
def test_scalar_functions_compute_what_python_does() -> None:
    """The complementarity problem of random contacts, by the same text in both."""
    rng, cases = np.random.default_rng(3), []
    for n in (1, 2, 4):
        for _ in range(5):
            B = rng.normal(size=(n, n))
            G = (B @ B.T + 0.1 * np.eye(n)).ravel().tolist()
            sign = rng.choice([-1.0, 0.0, 1.0], n).tolist()
            cases.append([(5 * rng.normal(size=n)).tolist(), G, rng.uniform(0.1, 2, n).tolist(), sign, n])
    text = f"const [EXCESS, UNBOUNDED] = [{complementarity.EXCESS}, {complementarity.UNBOUNDED}];"
    source = switching_source().partition("def on_rail")[0]
    text += HELPERS + functions_of(source)
    mine = said_by_node(
        f"{text}\nprocess.stdout.write(JSON.stringify({json.dumps(cases)}.map((one) => consistent(...one))));"
    )
    assert mine == [list(complementarity.consistent(*case)) for case in cases]


@pytest.mark.parametrize("line", ["while True: pass", "x = {}", "x = yes.no(1)"])
def test_what_is_no_scalar_function_is_refused(line: str) -> None:
    with pytest.raises(TypeError, match="in scalar functions"):
        functions_of(f"def f(yes):\n    {line}\n")
