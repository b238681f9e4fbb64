"""Pairs of features against equations from the places of masses: a share of `benchmarks/feature_pairs.py`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import feature_pairs
import numpy as np
import pytest
from feature_pairs import LIMIT, drawn, judge, spread, three
from support.loops import interpreted
from support.places import Places, SwitchedPlaces

from modal.scene import scene_from
from nonlinear.system import initial_state

SMALL = {
    0: (("friction", "rail"), "numba"),
    6: (("friction", "hoists"), "numpy"),
    256: (("friction", "copies"), "numba"),
    505: (("friction", "rotors"), "numba"),
    136: (("rail", "drives"), "numpy"),
    224: (("drives", "structures"), "numba"),
    234: (("records", "moved"), "floats"),
    180: (("moved", "structures"), "numpy"),
    27: (("ratios", "drives"), "floats"),
    55: (("hoists", "rotors"), "numpy"),
    122: (("structures", "rotors"), "floats"),
}
"""Scenes of one or two links by number: their pair, and by which engine."""
SECONDS = 0.4


@pytest.mark.parametrize("number", SMALL)
def test_motions_are_those_of_the_places_of_all_masses(number: int) -> None:
    """Of one of each, and of three that switch at once."""
    pair, engine = SMALL[number]
    with interpreted():
        row = judge(number, (engine,), {"three": (engine,)}, duration=SECONDS, tolerance=1e-11)
    assert row["pair"] == pair
    assert not row["failures"] | row["refused"]
    assert list(row["differences"]) == [engine, f"{engine} three"]
    assert max(row["differences"].values()) < LIMIT


def test_mirror_images_on_a_cart_hold_it_still() -> None:
    """With friction at joints and on the rail, which sticks for good."""
    row = judge(0, (), {"mirrored": ("floats",)}, duration=SECONDS, tolerance=1e-11)
    assert row["differences"]["floats mirrored"] < LIMIT
    assert row["events"]


def test_the_comparison_bites(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gravity that is larger by one part in 1e8, and links in another order."""
    written = drawn(27)
    heavier: dict[str, Any] = {**written, "gravity": written["gravity"] * (1 + 1e-8)}
    monkeypatch.setattr(
        feature_pairs, "SwitchedPlaces", lambda scene, longest: SwitchedPlaces(scene_from(heavier), longest)
    )
    assert judge(27, ("floats",), duration=SECONDS)["differences"]["floats"] > LIMIT
    end = np.array([[0.1, *range(3)]])
    copies = {"pendulum": [{"links": [{}, {}]}, {"links": [{}]}]}
    assert spread(end, copies, 2)[0].tolist() == [0.1, 0.0, 1.0, 0.0, 1.0, 2.0, 2.0]


def test_friction_at_rest_and_the_push_of_the_rail() -> None:
    """A cart that sticks carries all weights; three times of everything has three times the push."""
    scene = drawn(0)
    pushes = []
    for each in (scene, three(scene)):
        built = scene_from(each)
        places = Places(built)
        state = initial_state(built)
        still = replace(state, links=0.0 * state.links, link_rates=0.0 * state.link_rates)
        pushes.append(places.unknowns(0.0, places.begin(still))[-1])
    masses = scene["support"]["mass"] + sum(link["mass"] for link in scene["pendulum"][0]["links"])
    assert pushes == pytest.approx([masses * scene["gravity"], 3 * masses * scene["gravity"]], rel=1e-12)
