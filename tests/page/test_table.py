"""The page's table in Node against Python's: one numbering, |λ| and ζ, words, stars, and beats of one family."""

from __future__ import annotations

import json
import subprocess
from itertools import pairwise
from shutil import which
from typing import Any

import numpy as np
import pytest
from live import assert_rows
from scenes import mild_scene, motion_scene

from modal import natural_modes
from modal.coupling import explain
from modal.errors import SceneError
from modal.scene import Scene, example_names, load, scene_from
from multipendula.page import joined, scene_data
from multipendula.page.document import MODAL

NODE = which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="no Node is installed here")


def bob(mass: float = 1.0, length: float = 1.0, **more: float) -> dict[str, Any]:
    return {"kind": "bob", "mass": mass, "length": length, **more}


def hung(*links: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"links": list(links), **more}


CART = {"kind": "cart", "mass": 3.0}
PLAIN: dict[str, dict[str, Any]] = {
    "one frequency, fixed": {"pendulum": [hung(bob()), hung(bob(2.0)), hung(bob(length=2.0), count=3)]},
    "one frequency, cart": {"support": CART, "pendulum": [hung(bob(), count=2), hung(bob(2.0), count=2)]},
    "cart on a spring": {"support": {**CART, "stiffness": 25.0, "damping": 1.0}, "pendulum": [hung(bob(), bob())]},
    "free cart, damped": {"support": {**CART, "damping": 2.0}, "pendulum": [hung(bob()), hung(bob(2.0, 1.3))]},
    "overdamped": {"pendulum": [hung(bob(damping=10.0)), hung(bob(damping=1.0), bob(0.5, 0.7, damping=3.0))]},
    "critical": {"pendulum": [hung(bob(damping=2 * 9.81**0.5 * (1 + 1e-6)))]},
    "strong dampers": {"support": {**CART, "damping": 1e3}, "pendulum": [hung(bob(damping=300.0), bob(0.5, 0.7))]},
    "drag": {"support": CART, "pendulum": [hung(bob(drag=0.3), bob(0.5, 0.7, quadratic_drag=0.1), count=2)]},
    "standing, damped": {"pendulum": [hung(bob(damping=0.1), bob(0.5, 0.7), equilibrium=["down", "up"])]},
    "friction": {"support": {**CART, "friction": 0.1}, "pendulum": [hung(bob(friction=0.1), bob())]},
    "detuned": {"support": {**CART, "mass": 30.0}, "pendulum": [hung(bob()), hung(bob(length=1.01))]},
    "far detuned": {"support": {**CART, "mass": 30.0}, "pendulum": [hung(bob()), hung(bob(length=1.1))]},
    "heave": {"support": {"kind": "heave", "mass": 1.0, "stiffness": 47.0}, "pendulum": [hung(bob(0.2))]},
    "light cart": {"support": {**CART, "mass": 0.1}, "pendulum": [hung(bob(), bob(), count=2)]},
}
QUESTION = """
const rows = $modes.modesOf($system.systemOf(%s));
return rows.map(({ omega, ratio, turn, multiplicity, words, kappa, onePercent, resonant, beat }) =>
  ({ omega, ratio, turn, multiplicity, words, kappa, onePercent, resonant, beat }));
"""


def shown(scene: Scene) -> bool:
    """Whether it has a page."""
    try:
        scene_data(scene)
    except SceneError:
        return False
    return True


def every() -> dict[str, Scene]:
    """Scenes of all kinds by their names; of random ones mild and wild."""
    scenes = {name: scene for name in example_names() if shown(scene := load(name))}
    scenes |= {name: scene_from({"gravity": 9.81, **data}) for name, data in PLAIN.items()}
    return scenes | {f"{make.__name__} {k}": make(k) for make in (motion_scene, mild_scene) for k in range(1, 14, 3)}


@pytest.fixture(scope="module")
def answers() -> dict[str, list[dict[str, Any]]]:
    """The rows of all scenes, all asked at once; scenes without a text of their own share the modules."""
    scripts = [f"const answers = {{}};\n{joined(MODAL)}"]
    for name, scene in every().items():
        needs_text = scene.is_structured or scene.has_friction
        modules = joined(MODAL, scene) if needs_text else ""
        question = QUESTION % json.dumps(scene_data(scene))
        scripts.append(f"answers[{json.dumps(name)}] = (() => {{ {modules}\n{question} }})();")
    script = "\n".join((*scripts, "process.stdout.write(JSON.stringify(answers));"))
    assert NODE is not None
    done = subprocess.run([NODE, "-"], input=script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    rows: dict[str, list[dict[str, Any]]] = json.loads(done.stdout)
    return rows


def test_rows_are_those_of_the_table(answers: dict[str, Any]) -> None:
    for name, scene in every().items():
        close = 1e-5 if name == "critical" else 1e-9  # there it splits by the square root of rounding
        assert_rows(answers[name], natural_modes(scene), close)


def test_a_wrong_number_is_seen(answers: dict[str, Any]) -> None:
    modes = natural_modes(load("huygens"))
    for key, change in (("omega", 1e-8), ("ratio", 1e-8), ("words", "!"), ("multiplicity", 1)):
        rows = [dict(row) for row in answers["huygens"]]
        rows[-1][key] += change
        with pytest.raises(AssertionError):
            assert_rows(rows, modes)


BEATING = ("detuned",)
"""Scenes whose pendula of different families exchange more than half of their energy."""


def test_neighbours_beat_where_explain_has_a_beat(answers: dict[str, Any]) -> None:
    """Of all shipped scenes, of those of `PLAIN` and of random ones with dampers, springs and structures."""
    for name, scene in every().items():
        assert_beats(name, answers[name], scene)


def assert_beats(name: str, rows: list[dict[str, Any]], scene: Scene) -> None:
    """The beats of a page are those of the explanation."""
    try:
        coupling = explain(scene)
    except SceneError:  # links that stand
        assert all(row["beat"] is None for row in rows)
        return
    numbers = [
        {coupling.number(branch.omega) for branch in family.branches if branch.is_finite}
        | ({coupling.number(family.omega)} if family.still else set())
        for family in coupling.families
    ]
    for number, (row, after) in enumerate(pairwise(rows), 1):
        swings = min(row["turn"], after["turn"]) > 0
        gap = abs(after["turn"] - row["turn"])
        akin = any(
            {number, number + 1} <= modes and any(abs(beat * gap / (2 * np.pi) - 1) < 0.02 for beat in family.beats)
            for modes, family in zip(numbers, coupling.families, strict=True)
        )
        assert (row["beat"] is not None) == (akin or (name in BEATING and swings)), (name, number, row)
        if row["beat"] is not None:
            assert row["beat"] == pytest.approx(2 * np.pi / (after["turn"] - row["turn"]), rel=1e-9)
    assert rows[-1]["beat"] is None
