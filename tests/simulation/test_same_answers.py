"""Twenty questions are answered alike first, last, in a process of their own and in another order."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import questions
from amounts import usually
from questions import QUESTIONS, answered

from modal.types import Floats
from nonlinear.dynamics.compiling import available

WITHIN = 1e-7
"""Of answers at a tolerance of 1e-9, by whatever engine."""
SHUFFLED = (13, 4, 18, 0, 9, 16, 2, 11, 7, 19, 5, 14, 1, 10, 3, 17, 8, 12, 6, 15)
Answers = dict[int, list[Floats]]


def elsewhere(folder: Path, *words: object) -> Answers:
    """The answers of a process of its own."""
    file = folder / "answers"
    subprocess.run([sys.executable, questions.__file__, file, *map(str, words)], check=True)
    answers: Answers = pickle.loads(file.read_bytes())
    return answers


def unlike(answers: Answers, others: Answers, within: float = 0.0) -> list[int]:
    """The numbers of questions whose answers differ."""
    return [
        number
        for number, answer in others.items()
        if len(answer) != len(answers[number])
        or not all(
            part.shape == other.shape and np.allclose(part, other, 0.0, within, equal_nan=True)
            for part, other in zip(answer, answers[number], strict=True)
        )
    ]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Answers:
    """Those of a process that has done nothing before."""
    return elsewhere(tmp_path_factory.mktemp("first"))


def test_what_ran_before_changes_no_bit(first: Answers) -> None:
    """Here whatever the tests of this process did ran before, and the questions in another order."""
    assert unlike(first, answered(SHUFFLED)) == []


def test_no_bit_differs_in_a_process_of_its_own_nor_after_all_others(first: Answers, tmp_path: Path) -> None:
    for number in usually([3], [*range(len(QUESTIONS))]):
        assert unlike(first, elsewhere(tmp_path, number)) == []
    assert unlike(first, elsewhere(tmp_path, *SHUFFLED)) == []


@pytest.mark.skipif(not available(), reason="numba is not installed")
def test_compiled_or_not_answers_are_those_of_the_tolerance(first: Answers, tmp_path: Path) -> None:
    free, bought = elsewhere(tmp_path, "free"), elsewhere(tmp_path, "bought")
    assert unlike(first, free, WITHIN) == unlike(first, bought, WITHIN) == []
    assert unlike(first, bought) != []
    again = elsewhere(tmp_path, "bought", *SHUFFLED)
    assert unlike(bought, again, WITHIN) == []
