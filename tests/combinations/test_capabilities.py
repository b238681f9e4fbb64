"""What a scene has and what takes it: every entry of the table is there, every answer is the one declared."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from amounts import usually
from pairs import attempt, declared, pairs

from modal.scene import CAPABILITIES, FEATURES


@pytest.mark.parametrize("name", CAPABILITIES)
def test_every_capability_has_one_entry_for_every_feature(name: str) -> None:
    for feature in FEATURES:
        entries = CAPABILITIES[name].entries(feature)
        assert len(entries) == 1, f"{name}: {feature}: {entries}"
        kind, words = entries[0]
        assert bool(words) == (kind != "takes")


def test_no_entry_is_of_a_feature_that_does_not_exist() -> None:
    for one in CAPABILITIES.values():
        named = {*one.takes, *one.leaves, *one.refuses, *one.singly, *one.unless, *one.beside}
        named |= {name for pair in one.apart for name in pair} | {name for wanted in one.needs for name in wanted}
        assert named <= FEATURES.keys()


# --------------------------------------------------------------------------------------------------- every pair

PAIRS = pairs()
SAMPLE = usually(random.Random(0).sample(PAIRS, 60), PAIRS)


@pytest.mark.parametrize(("kind", "capability"), SAMPLE, ids=lambda name: name.replace(" ", "-"))
def test_the_answer_is_the_one_declared(kind: str, capability: str, tmp_path: Path) -> None:
    outcome, (status, words) = attempt(kind, capability, tmp_path), declared(kind, capability)
    assert outcome.status == status or (status == "unless" and outcome.status in {"works", "refused"}), outcome
    if outcome.status == "refused":
        assert all(said in outcome.words for said in words)
