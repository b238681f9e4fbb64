"""The page of a structure in Node against Python: rates, energies, modes, motions, the drawing, files and the hand."""

from __future__ import annotations

import json
from base64 import b64encode
from copy import deepcopy
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import NEEDS_NODE, assert_rows, said_by_node
from support.magnets import lawful_scene

from modal import natural_modes
from modal.assembly import matrices
from modal.errors import SceneError
from modal.scene import Scene, load, parse, scene_from
from modal.structure import Scaffold, structure_of
from multipendula.page import LARGEST_OF_STRUCTURES, joined, page, recording_of, scene_data
from multipendula.page.document import PHYSICS
from nonlinear import simulate
from nonlinear.dynamics import Mechanics, Minimal, Recursion
from nonlinear.system import Layout, initial_state, system_of

pytestmark = NEEDS_NODE

SHIPPED = ("two-bobs", "two-swings", "tower", "beam", "ship-crane")
ZOO: dict[str, Any] = {
    "gravity": 9.81,
    "support": [
        {"name": "lift", "kind": "heave", "mass": 4.0, "stiffness": 900.0, "start": {"displacement": 0.02}},
        {"name": "rocker", "kind": "tilt", "position": [2.0, 0.5], "mass": 3.0, "inertia": 0.8, "centre": [0.1, -0.2]}
        | {"stiffness": 200.0, "damping": 0.4, "start": {"angle_deg": 3.0, "rate_deg": -5.0}},
        {"name": "frame", "kind": "modal", "position": [4.0, 0.0], "M": [[3.0, 0.2], [0.2, 2.0]]}
        | {"K": [[700.0, -50.0], [-50.0, 400.0]], "D": [[0.5, 0.0], [0.0, 0.3]], "points": [[[0.6, 0.9], [0.1, -0.4]]]},
    ],
    "spring": [
        {"between": ["pendulum[0].links[0]@0.3", "pendulum[1].links[0]"], "stiffness": 6.0, "damping": 0.2},
        {"between": ["lift@0.3,0.1", "ground@0.3,1.0"], "stiffness": 40.0},
        {"between": ["ground", "pendulum[2].copies[1].links[0]@0.2"], "stiffness": 3.0, "damping": 0.1},
        {"kind": "torsion", "between": ["pendulum[1].links[0]", "rocker"], "stiffness": 2.0, "damping": 0.05},
    ],
    "force": [
        {"on": "rocker@0.2,0.1", "direction": "vertical", "kind": "sine", "amplitude": 0.7, "frequency_hz": 0.6},
    ],
    "pendulum": [
        {
            "on": "lift",
            "links": [
                {"kind": "rod", "mass": 1.0, "length": 0.6, "rotor_inertia": 2e-4},
                {"kind": "bob", "mass": 0.5, "length": 0.4, "rotor_inertia": 3e-5, "gear_ratio": 30.0},
            ],
        }
        | {"start": {"angles_deg": [20.0, -30.0], "rates_deg": [0.0, 50.0]}},
        {"on": "rocker", "position": [0.2, 0.1], "start": {"angles_deg": [-25.0]}}
        | {
            "links": [
                {"kind": "bob", "mass": 0.8, "length": 0.7, "stiffness": 0.3, "damping": 0.02, "drag": 0.05}
                | {"rotor_inertia": 0.01, "gear_ratio": 2.5}
                | {"law": [{"kind": "magnet", "strength": 0.4}, {"kind": "grease", "strength": 0.1, "pull": 0.2}]}
            ]
        },
        {"on": "frame[0]", "count": 2, "start": {"angles_deg": [15.0]}}
        | {
            "links": [
                {"kind": "body", "mass": 0.6, "length": 0.5, "centre": 0.3, "inertia": 0.02, "quadratic_drag": 0.1}
            ]
        },
    ],
}
"""Everything that a page takes, together, but for a ground that moves, under which no modal support stands."""
SHAKEN: dict[str, Any] = {
    **ZOO,
    "support": ZOO["support"][:2],
    "ground": {"motion": {"kind": "sine", "amplitude": 0.03, "frequency_hz": 1.1, "phase_deg": 20.0}},
    "spring": [ZOO["spring"][k] for k in (0, 1, 3)],
    "pendulum": ZOO["pendulum"][:2],
}
NAMES = (*SHIPPED, "zoo", "shaken", "lawful")
CHANGES: dict[str, list[tuple[list[Any], float]]] = {
    "two-bobs": [(["pendulum", 1, "links", 0, "mass"], 1.7), (["spring", 0, "stiffness"], 9.0)],
    "tower": [(["support", 0, "mass"], 3.0e5), (["pendulum", 0, "links", 0, "length"], 2.4), (["gravity"], 9.0)],
    "beam": [(["support", "stiffness"], 411.0), (["support", "damping"], 3.0)],
    "ship-crane": [(["support", "stiffness", "heave"], 4.0e6), (["pendulum", 0, "links", 0, "mass"], 6.0e4)],
    "zoo": [
        (["support", 1, "inertia"], 1.1),
        (["spring", 3, "stiffness"], 2.6),
        (["pendulum", 1, "links", 0, "law", 0, "strength"], 0.9),
        (["pendulum", 0, "links", 0, "length"], 0.7),
        (["pendulum", 1, "links", 0, "gear_ratio"], 3.5),
    ],
}
SECONDS = 1.5
QUESTION = """
const scene = %(scene)s, system = $system.systemOf(scene), drawn = new $view.View(system);
const listed = (shapes) => shapes?.map((x) => [...x]) ?? null;
const plain = (row) => ({ ...row, shapes: listed(row.shapes), twists: listed(row.twists) });
const ofModes = (own) => $modes.modesOf(own).map(plain);
const states = %(states)s.map(([time, ...y]) => [time, Float64Array.from(y)]);
const rate = $equations.equationsOf(system);
const rates = states.map(([time, y]) => {
  const out = new Float64Array(y.length);
  rate(time, y, out);
  return [...out];
});
const pieces = states.map(([, y]) => drawn.pieces(y, [0, 0]).map(({ role, points }) => [role, points]));
const [y0, rest] = [$system.startOf(scene, system), $system.atRest(system)];
const motion = new $motion.Motion(system, y0, { tolerance: 1e-12, linear: false });
motion.advance(%(seconds)s);
const shaken = structuredClone(scene);
for (const part of [shaken.ground?.motion, ...(shaken.force ?? [])]) if (part) part.amplitude *= 1e-6;
const begun = rest.map((value, i) => value + 1e-6 * (y0[i] - value));
const small = new $motion.Motion($system.systemOf(shaken), begun, { tolerance: 1e-12 });
small.advance(%(seconds)s);
const changed = structuredClone(scene);
for (const [place, value] of %(changes)s) {
  place.slice(0, -1).reduce((part, key) => part[key], changed)[place.at(-1)] = value;
}
const { packed, unpacked, sceneFile } = $scene_file;
const linked = (own) => unpacked(packed({ scene: own, y: [...motion.y.slice(0, -1)] }), scene);
return {
  rates, pieces,
  y: [...motion.y],
  worst: motion.worst,
  energies: states.map(([, y]) => $equations.energiesOf(system, y)),
  modes: ofModes(system),
  changed: ofModes($system.systemOf(changed)),
  small: [[...small.y], [...small.predicted]],
  files: [sceneFile(scene), sceneFile(scene, system, motion.y)],
  link: linked(changed) !== null,
  wrong: [{ gravity: -1 }, { pendulum: [] }, { support: [] }].map((part) => linked({ ...scene, ...part })),
};
"""


@cache
def scene_of(name: str) -> Scene:
    if name == "lawful":
        return scene_from(scene_data(lawful_scene()))
    return load(name) if name in SHIPPED else scene_from({"zoo": ZOO, "shaken": SHAKEN}[name])


def states_of(name: str) -> np.ndarray:
    """A time and a state with large angles, row by row."""
    system = system_of(scene_of(name))
    half, rng = system.first + system.n_links, np.random.default_rng(5)
    units = np.ones(half)
    units[: system.first] = 0.05
    parts = rng.normal(size=(3, 2, half)) * units
    return np.concatenate([rng.uniform(0, 3, (3, 1)), parts.reshape(3, -1), np.zeros((3, 1))], axis=1)


@pytest.fixture(scope="module")
def answers() -> dict[str, Any]:
    """What the pages say, all asked at once."""
    scripts = []
    for name in NAMES:
        scene = scene_of(name)
        asked_with = {
            "scene": scene_data(scene),
            "states": states_of(name).tolist(),
            "changes": CHANGES.get(name, []),
            "seconds": SECONDS,
        }
        question = QUESTION % {key: json.dumps(value) for key, value in asked_with.items()}
        modules = joined((*PHYSICS, "view"), scene)
        scripts.append(f"{json.dumps(name)}: (() => {{ {modules}\n{question} }})()")
    return said_by_node(f"process.stdout.write(JSON.stringify({{ {', '.join(scripts)} }}));")


EVERY = pytest.mark.parametrize("name", NAMES)


@EVERY
def test_rates_are_those_of_the_recursion(answers: dict[str, Any], name: str) -> None:
    """Not of a text: link by link in NumPy."""
    system = system_of(scene_of(name))
    equations = Minimal(system, tuple(Recursion(group) for group in system.groups))
    for (time, *y), mine in zip(states_of(name).tolist(), answers[name]["rates"], strict=True):
        state = np.array(y[: equations.layout.size])
        expected = equations.derivative(time, state)
        assert np.array(mine[: len(expected)]) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@EVERY
def test_energies_are_those_of_the_mechanics(answers: dict[str, Any], name: str) -> None:
    system = system_of(scene_of(name))
    y = states_of(name)[:, 1:]
    motion = Layout(system.n_links, 1, system.first, True, system.is_structured).read(y)
    theirs = Mechanics(system, motion).energies
    for energies, kinetic, potential in zip(answers[name]["energies"], *theirs, strict=True):
        size = kinetic + abs(potential)
        assert energies["kinetic"] == pytest.approx(kinetic, rel=1e-9)
        assert energies["potential"] == pytest.approx(potential, rel=1e-9, abs=1e-11 * size)


def changed(name: str) -> Scene:
    data = deepcopy(scene_data(scene_of(name)))
    for place, value in CHANGES.get(name, []):
        part: Any = data
        for key in place[:-1]:
            part = part[key]
        part[place[-1]] = value
    return scene_from(data)


@EVERY
def test_modes_are_those_of_the_table_also_after_changes(answers: dict[str, Any], name: str) -> None:
    for rows, scene in ((answers[name]["modes"], scene_of(name)), (answers[name]["changed"], changed(name))):
        assert_rows(rows, natural_modes(scene))
        parts = matrices(scene)
        for row in rows:
            value = row["rate"] + 1j * row["turn"]
            twists = row["twists"] or [np.zeros(len(parts.M))] * row["multiplicity"]
            for shape in np.array(row["shapes"]) + 1j * np.array(twists):
                left = value**2 * (parts.M @ shape) + value * (parts.D @ shape) + parts.K @ shape
                assert np.abs(left).max() < 1e-9 * np.abs(parts.K @ shape).max()


@EVERY
def test_motions_are_pythons(answers: dict[str, Any], name: str) -> None:
    run = simulate(scene_of(name), SECONDS, tolerance=1e-12)
    layout = Layout(run.system.n_links, 1, run.system.first, False, run.system.is_structured)
    expected = layout.begin(run.final)
    mine = np.array(answers[name]["y"])
    assert mine[:-1] == pytest.approx(expected, abs=1e-9)
    assert mine[-1] == pytest.approx(run.motion.work[-1], rel=1e-8, abs=1e-9)
    assert answers[name]["worst"] < 1e-8


@pytest.mark.parametrize("name", ["two-bobs", "tower", "ship-crane", "zoo", "shaken"])
def test_small_motions_are_the_linear_ones(answers: dict[str, Any], name: str) -> None:
    """Of scenes without drives: start, forces and the motion of the ground are a millionth."""
    full, linear = (np.array(motion[: len(answers[name]["y"]) - 1]) for motion in answers[name]["small"])
    assert np.abs(full - linear).max() < 1e-5 * np.abs(full).max()
    assert np.abs(full).max() > 1e-8


@EVERY
def test_the_drawing_is_that_of_the_figures(answers: dict[str, Any], name: str) -> None:
    scene = scene_of(name)
    system, structure = system_of(scene), structure_of(scene)
    sizes = [len(scene.pendulum[p].links) for p in range(len(scene.pendulum)) for _ in range(scene.pendulum[p].count)]
    first = np.concatenate(([0], np.cumsum(sizes)))
    lengths = system.by_link("length")
    reach = np.maximum(lengths, system.by_link("centre"))
    unit = max(reach[a:b].sum() for a, b in pairwise(first))
    scaffold = Scaffold(structure, np.arange(len(sizes)), first, float(unit))
    for row, pieces in zip(states_of(name)[:, 1:], answers[name]["pieces"], strict=True):
        eta, angles = row[None, : system.first], row[system.first : system.first + system.n_links]
        steps = lengths[:, None] * np.stack((np.sin(angles), -np.cos(angles)), axis=1)
        pivots = scaffold.pivots(eta)[0]
        joints = {
            p: (pivots[p] + np.concatenate(([[0.0, 0.0]], np.cumsum(steps[a:b], axis=0))))[None]
            for p, (a, b) in enumerate(pairwise(first))
        }
        drawn = scaffold.pieces(eta, joints)
        assert [piece.role for piece in drawn] == [role for role, _ in pieces]
        for piece, (_, points) in zip(drawn, pieces, strict=True):
            if name not in SHIPPED and piece.role in {"ground", "spring"}:
                continue  # what holds a link to the ground stands where that link hangs, not where it is now
            assert np.array(points) * [1, -1] == pytest.approx(piece.points[0], abs=2e-9)


@EVERY
def test_a_scene_file_of_the_page_reads_back_with_its_state(answers: dict[str, Any], name: str) -> None:
    scene = scene_of(name)
    assert scene_data(parse(answers[name]["files"][0].encode())) == scene_data(scene)
    text, mine = answers[name]["files"][1], np.array(answers[name]["y"])
    if name == "zoo":  # its copies are named by a spring
        assert text.startswith("# Springs or forces name pendula")
        return
    again = parse(text.encode())
    system = system_of(again)
    expected = Layout(system.n_links, 1, system.first, False, again.is_structured).begin(initial_state(again))
    assert expected == pytest.approx(mine[:-1], rel=1e-13, abs=1e-15)


def test_a_link_holds_the_pages_own_scene_with_other_numbers(answers: dict[str, Any]) -> None:
    for name in NAMES:
        assert answers[name]["link"]
        assert answers[name]["wrong"] == [None] * 3


def test_pages_keep_their_size_and_recordings_their_rows() -> None:
    scene = load("two-swings")
    run = simulate(scene, 0.5, output=11)
    recording = recording_of(run)
    assert recording["width"] == 2 * (scene.n_links + 2) + 1
    assert len(page(scene_data(scene), recording).encode()) < LARGEST_OF_STRUCTURES


def test_what_the_page_of_a_structure_does_not_treat_is_named() -> None:
    def refused(words: str, **more: Any) -> None:
        with pytest.raises(SceneError, match=words):
            scene_data(scene_from({**deepcopy(ZOO), **more}))

    refused(
        "45 coordinates",
        pendulum=[{"on": "lift", "count": 41, "links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}],
        spring=[],
    )
    run = {"kind": "bob", "mass": 1.0, "length": 1.0, "count": 2}
    named = {"between": ["pendulum[0].links[0]", "ground"], "stiffness": 1.0}
    refused("acts on all links", pendulum=[{"on": "lift", "links": [run]}], spring=[named])
    link = {"kind": "bob", "mass": 1.0, "length": 1.0}
    scene = scene_from(
        {
            **ZOO,
            "pendulum": [{"on": "lift", "links": [run, link]}],
            "spring": [{**named, "between": ["pendulum[0].links[1]@0.5", "ground"]}],
        }
    )
    assert scene_data(scene)["spring"][0]["between"] == ["pendulum[0].links[2]@0.5", "ground"]


HAND = """(() => {
  const canvas = element("scene");
  pass(3);
  const stroke = (name) => canvas.ink.drawn.filter(([, colour]) => colour === name).length;
  const found = { title: element("title").textContent, bodies: stroke("--cart"), springs: stroke("--muted") };
  found.rows = element("rows").children.map((line) => line.children.map((cell) => cell.textContent).slice(1));
  const numbers = element("of-cart").children.filter(({ type }) => type === "number");
  found.parts = element("of-cart").beside?.[0].children[1].children.map((option) => option.textContent) ?? [];
  found.sliders = numbers.map((one) => one.attributes["aria-label"]);
  element("rows").children[0].click();
  pass(12);
  found.energy = element("energy").textContent;
  found.drift = element("drift").textContent;
  element("play").click();
  element("hang").click();
  pass(2);
  element("kick").click();
  pass(4);
  element("hang").click();
  element("drive").fire("change", { target: { checked: true } });
  pass(4);
  found.time = element("time").textContent;
  element("drive").fire("change", { target: { checked: false } });
  element("hang").click();
  pass(1);
  %s
  return found;
})()
"""
DRAG = """
  const rest = canvas.ink.drawn.filter(([kind, colour]) => kind === "fill" && colour === "--cart").at(-1)[2];
  const middle = [0, 1].map((k) => rest.reduce((total, place) => total + place[k], 0) / rest.length);
  const event = ([x, y]) => ({ clientX: x, clientY: y, pointerId: 1 });
  canvas.fire("pointerdown", event(middle));
  canvas.fire("pointermove", event([middle[0] + 15, middle[1] + 8]));
  pass(1);
  const held = canvas.ink.drawn.filter(([kind, colour]) => kind === "fill" && colour === "--cart").at(-1)[2];
  found.moved = held.map((place, k) => [place[0] - rest[k][0], place[1] - rest[k][1]]);
  canvas.fire("pointerup", event(middle));
  pass(3);
  found.released = element("play").textContent;
  element("hang").click();
  const number = element("of-cart").children.find(({ type }) => type === "number");
  const before = element("rows").children[0].children[1].textContent;
  Object.assign(number, { value: String(2 * Number(number.value)) }).fire("change");
  found.changed = [before, element("rows").children[0].children[1].textContent];
"""


@pytest.fixture(scope="module")
def pages() -> dict[str, Any]:
    """What is seen on the pages and what the hand does there, in as much of a browser as they need.

    That of the two bobs has a saved run, that of the beam an address with other numbers.
    """
    browser = Path(__file__).with_name("browserless.js").read_text(encoding="utf-8")
    scripts = []
    for name in NAMES:
        scene = scene_of(name)
        recording = recording_of(simulate(scene, 0.5, output=11)) if name == "two-bobs" else None
        link = json.dumps({"scene": scene_data(changed(name))}) if name == "beam" else ""
        place = f"#{b64encode(link.encode()).decode()}" if link else ""
        page_data = {"data": {"scene": scene_data(scene), "recording": recording, "notes": []}, "hash": place}
        hand = HAND % ("" if name == "two-bobs" else DRAG)
        scripts.append(
            f"answers[{json.dumps(name)}] = (() => {{ const given = {json.dumps(page_data)};\n{browser}\n"
            f"{joined(scene=scene_of(name))}\nreturn {hand}; }})();"
        )
    return said_by_node(f"const answers = {{}};\n{' '.join(scripts)}\nprocess.stdout.write(JSON.stringify(answers));")


@EVERY
def test_the_page_shows_what_there_is(pages: dict[str, Any], name: str) -> None:
    seen, scene = pages[name], changed(name) if name == "beam" else scene_of(name)
    assert seen["title"] == (scene.title or "")
    modes = natural_modes(scene)
    assert [row[0] for row in seen["rows"]] == [f"{omega / (2 * np.pi):.5g}" for omega in modes.omega]
    assert seen["springs"] >= len(scene.spring) * (name != "tower")  # which has columns
    bodies = [carrier for carrier in structure_of(scene).carriers if carrier.size and carrier.points is None]
    assert seen["bodies"] >= len(bodies)
    assert seen["energy"].endswith("J")
    assert seen["energy"] != "0 J"
    assert float(seen["drift"].partition("·")[0]) >= 0
    assert seen["time"] != "0.00 s"


def test_supports_and_springs_have_sliders(pages: dict[str, Any]) -> None:
    assert pages["tower"]["parts"] == ["floor1", "floor2", "Spring 1", "Spring 2"]
    assert pages["tower"]["sliders"] == ["Mass, kg", "Damping, N s/m"]
    assert pages["beam"]["parts"] == []
    assert pages["beam"]["sliders"] == [
        f"Support {number}" for number in ("mass, kg", "inertia, kg m²", "stiffness, N m/rad", "damping, N m s/rad")
    ]
    assert pages["ship-crane"]["sliders"][2:5] == [
        f"Ship stiffness in {way}" for way in ("sway, N/m", "heave, N/m", "roll, N m/rad")
    ]
    for name in ("two-swings", "tower", "beam", "ship-crane"):
        before, after = pages[name]["changed"]
        assert before != after


@pytest.mark.parametrize("name", ["two-swings", "tower", "beam", "ship-crane", "zoo", "shaken"])
def test_a_carrier_goes_with_the_hand(pages: dict[str, Any], name: str) -> None:
    """The corner that is held, as far as the support's coordinates allow."""
    moved = np.array(pages[name]["moved"])
    nearest = np.abs(moved - [15.0, 8.0]).sum(axis=1).min()
    along = {"two-swings": 1.0, "tower": 0.01, "ship-crane": 0.01}.get(name)
    if name in {"two-swings", "tower"}:
        assert np.abs(moved[:, 0] - 15.0).max() < 2.0  # a swing rises as it goes
    elif along is not None:
        assert nearest < along
    else:
        assert np.abs(moved).max() > 2.0
    assert pages[name]["released"] == "Pause"
