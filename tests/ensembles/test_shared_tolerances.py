"""Tolerances that several places share, against the frequencies of single pendula: ω = √(g/l)."""

from __future__ import annotations

import numpy as np
import pytest

from modal.errors import SceneError
from modal.scene import Bob, Pendulum, Scene
from nonlinear import State
from nonlinear.sweeps.spread import find_spread

LENGTHS = np.array([0.5, 0.8, 1.3])
SCENE = Scene(gravity=9.81, pendulum=tuple(Pendulum(links=(Bob(mass=1.0, length=l),)) for l in LENGTHS.tolist()))
SHIFT = "shift:pendulum[*].links[0].length"


def test_all_lengths_are_off_by_the_same() -> None:
    spread = find_spread(SCENE, [f"{SHIFT}=0.01", "gravity=9.8:9.83"], members=20)
    offset, gravity = spread.values[SHIFT], spread.values["gravity"]
    expected = np.sqrt(gravity[:, None] / (LENGTHS[::-1] + offset[:, None]))
    assert spread.omega == pytest.approx(expected, rel=1e-12)
    assert "shift of the length of link 1 of pendula 1–3 = 0 ± 0.01 m" in spread.words
    assert next(spread.records())[SHIFT] == offset[0]


def test_a_motion_of_members_has_the_shift() -> None:
    spread = find_spread(
        SCENE, [f"{SHIFT}=0.1:0.2"], 0.5, members=4, start=State(np.radians([10.0, 0.0, 0.0]), np.zeros(3))
    )
    assert spread.ensemble is not None
    lists = spread.ensemble.question.members.lists
    assert lists is not None
    assert lists["pendulum[1].links[0].length"] == pytest.approx(0.8 + spread.values[SHIFT])


def test_one_number_for_all_places() -> None:
    spread = find_spread(SCENE, ["same:pendulum[0].links[0].mass+pendulum[2].links[0].mass=5%"], members=5)
    (drawn,) = spread.values.values()
    assert 0 < drawn.std() < 0.2


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ([f"{SHIFT}=2%"], "a shift has no size to take a percentage of: give m"),
        (["same:pendulum[*].links[0].length=1%"], "give each its own tolerance, or all one shift:PLACE"),
        ([f"{SHIFT}=0.1", "pendulum[1].links[0].length=0.1"], "pendulum[1].links[0].length: has two tolerances"),
        (["shift:gravity=0.1"], "means the one number gravity"),
        (["shift:pendulum[*].links[0].count=0.1"], "a count has no tolerance"),
    ],
)
def test_tolerances_that_cannot_be_shared(texts: list[str], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        find_spread(SCENE, texts, members=3)
    assert words in str(caught.value)
