"""Supported combinations: every entry of the table is there, every answer is the one declared."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from amounts import usually
from pairs import OFF, attempt, declared, entry, guarded, kinds, pairs

from modal.scene import CAPABILITIES, FEATURES, dump, load
from multipendula.cli import main


@pytest.mark.parametrize("name", CAPABILITIES)
def test_every_capability_has_one_entry_for_every_feature(name: str) -> None:
    for feature in FEATURES:
        entries = CAPABILITIES[name].entries(feature)
        assert len(entries) == 1, f"{name}: {feature}: {entries}"
        kind, words = entries[0]
        assert bool(words) == (kind != "takes")


def test_no_entry_is_of_a_feature_that_does_not_exist() -> None:
    for capability in CAPABILITIES.values():
        named = {
            *capability.takes,
            *capability.leaves,
            *capability.refuses,
            *capability.singly,
            *capability.unless,
            *capability.beside,
        }
        named |= {name for pair in capability.conflicts for name in pair} | {
            name for wanted in capability.needs for name in wanted
        }
        assert named <= FEATURES.keys()


# --------------------------------------------------------------------------------------------------- every pair

PAIRS = pairs()


def flat(text: str) -> str:
    """A text without the breaks and names at the beginning of lines."""
    return " ".join(text.replace("multipendula: ", "").split())


SAMPLE = usually(random.Random(0).sample(PAIRS, 60), PAIRS)


@pytest.mark.parametrize(("kind", "capability"), SAMPLE, ids=lambda name: name.replace(" ", "-"))
def test_the_answer_is_the_one_declared(kind: str, capability: str, tmp_path: Path) -> None:
    outcome, (status, words) = attempt(kind, capability, tmp_path), declared(kind, capability)
    if outcome.status == "absent":
        pytest.skip(outcome.words)
    assert outcome.status == status or (status == "unless" and outcome.status in {"works", "refused"}), outcome
    if outcome.status == "refused":
        answer = flat(outcome.words)
        assert [said for said in words if flat(said).partition(": take")[0] not in answer] == []


# --------------------------------------------------------------------------------------------------- nothing in silence

GUARDED = guarded()
EQUAL = {
    ("damping_ratio", "gains"): "inputs reach modes whatever damps these",
    ("damping_ratio", "spread"): "a damping ratio leaves |λ| as it is",
    **dict.fromkeys((("loss", "sweep"), ("loss", "spread")), "loss angles leave frequencies as they are"),
    ("van_der_Pol", "chaos"): "so short a run tells a bound alone",
    **dict.fromkeys(
        (("escapement", "derive freebody"), ("van_der_Pol", "derive freebody")),
        "a drive's torque is part of the joint's moment, which the damper has drawn already",
    ),
}
"""Pairs whose answer does not depend on a feature that is taken, and why."""


@pytest.mark.parametrize(
    ("kind", "capability"),
    usually(random.Random(2).sample(GUARDED, 20), GUARDED),
    ids=lambda name: name.replace(" ", "-"),
)
def test_a_feature_changes_the_answer_or_is_said_to_be_left_out(kind: str, capability: str, tmp_path: Path) -> None:
    plain = tmp_path / f"{kind}.toml"
    dump(OFF[kind][1](load(kinds()[kind])), plain)
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    outcome = attempt(kind, capability, tmp_path / "with")
    if outcome.status == "absent":
        pytest.skip(outcome.words)
    answer = outcome.words
    without = attempt(plain, capability, tmp_path / "without").words
    if entry(kind, capability) == "leaves":
        assert [words for words in declared(kind, capability)[1] if flat(words) not in flat(answer)] == []
    elif (kind, capability) not in EQUAL:
        assert answer.replace(str(kinds()[kind]), "") != without.replace(str(plain), "")


def test_a_hoist_has_a_constant_model_at_one_time(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    crane, there = load("hoisting-crane"), tmp_path / "there.toml"
    dump(crane.at(3.0), there)
    answers = []
    for words in (["hoisting-crane", "--when", "3"], [str(there)]):
        assert main(["response", *words, "--at", "0.1,0.5", "--format", "csv", "-q"]) == 0
        answers.append(capsys.readouterr().out)
    assert answers[0] == answers[1]
    assert main(["response", "hoisting-crane", "--at", "0.1"]) == 2
    assert "--when SECONDS" in capsys.readouterr().err
    assert main(["response", str(there), "--at", "0.1", "--when", "3"]) == 2
