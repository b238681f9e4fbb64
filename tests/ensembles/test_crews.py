"""What is shared one by one: results and their order are the same for any crew, and what is lost is done again."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modal import load
from modal.errors import ComputationError
from modal.scene.parameters import parse_variations
from nonlinear.chaos import lyapunov, lyapunov_exponent, study
from nonlinear.chaos import measure as measure_study
from nonlinear.ensembles import Workers, workers_at
from nonlinear.ensembles.executors import processes
from nonlinear.orbits import Branch, follow_cycles
from nonlinear.synchronization import Branches, follow_branches

METRONOMES = load("metronomes")
LIGHT_BASES = "support.mass=2:5:2log"


def _dies_once(folder: str, number: int) -> int:
    """The number; the process that is the first to be given 3 ends."""
    mark = Path(folder) / "died"
    if number == 3 and not mark.exists():
        mark.touch()
        os._exit(1)
    return number


def _fails_at(bad: int, number: int) -> int:
    if number == bad:
        raise ComputationError(f"{number} is bad")
    return number


class LosingExecutor(Executor):
    """Takes and gives what processes could, and loses two calls, in words of its own."""

    def __init__(self) -> None:
        self.given = 0

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        self.given += 1
        future: Future[Any] = Future()
        if self.given in {2, 5}:
            future.set_exception(OSError("node 7 went away"))
        else:
            call, sent = pickle.loads(pickle.dumps((function, arguments)))
            future.set_result(pickle.loads(pickle.dumps(call(*sent))))
        return future


def test_what_a_dead_process_had_is_done_again_and_everything_comes_in_order(tmp_path: Path) -> None:
    crew = Workers(crew=partial(processes, 2))
    assert [*crew.map(partial(_dies_once, str(tmp_path)), range(8))] == [*range(8)]
    assert (tmp_path / "died").exists()


def _process_of(folder: str, number: int) -> int:
    """The process that computes it, or that computes it again."""
    _dies_once(folder, number)
    return os.getpid()


def test_processes_are_started_once_and_again_where_one_died(tmp_path: Path) -> None:
    whose = partial(_process_of, str(tmp_path))
    with workers_at(None, 2) as crew:
        before = {*crew.map(whose, [0, 1]), *crew.map(whose, range(3))}
        assert os.getpid() not in before
        assert len(before) <= 2
        assert len([*crew.map(whose, [2, 3])]) == 2
        assert before.isdisjoint(crew.map(whose, range(3)))


def test_what_is_small_is_done_before_processes_are_started() -> None:
    assert {*Workers(2).map(_process_of, [""] * 3, range(3))} == {os.getpid()}


def test_what_an_executor_lost_is_done_again() -> None:
    assert [*Workers(crew=LosingExecutor()).map(abs, range(-9, 0))] == [*range(9, 0, -1)]


@pytest.mark.parametrize("crew", [Workers(1), Workers(), Workers(crew=LosingExecutor())], ids=["one", "own", "losing"])
def test_an_error_comes_in_its_place(crew: Workers) -> None:
    results = crew.map(partial(_fails_at, 2), range(4))
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ComputationError, match="2 is bad"):
        next(results)


def test_alone_nothing_is_asked_for_before_it_is_due() -> None:
    """So what an earlier result makes needless is not computed."""
    seen: list[int] = []

    def numbers() -> Iterator[int]:
        for number in range(3):
            seen.append(number)
            yield number

    results = Workers(1).map(abs, numbers())
    assert (next(results), seen) == (0, [0])


def orbits_of(branches: tuple[Branch, ...]) -> list[Any]:
    """Every bit of the orbits and their special points."""
    return [
        [(orbit.value, orbit.period, orbit.y.tobytes()) for orbit in branch.orbits]
        + [(special.kind, special.orbit.value) for special in branch.special]
        for branch in branches
    ]


def test_cycles_are_the_same_whoever_follows_them() -> None:
    (variation,) = parse_variations([LIGHT_BASES])
    alone = follow_cycles(METRONOMES, variation)
    assert orbits_of(follow_cycles(METRONOMES, variation, crew=Workers(crew=LosingExecutor()))) == orbits_of(alone)


def configurations_of(diagram: Branches) -> list[Any]:
    """Every bit of the configurations, and the located critical values."""
    branches = [
        (branch.values.tobytes(), [state.z.tobytes() for state in branch.states]) for branch in diagram.branches
    ]
    return [*branches, diagram.changes, [special and special.orbit.value for special in diagram.special_points]]


def test_oscillations_are_the_same_whoever_follows_them() -> None:
    huygens = load("huygens")
    (variation,) = parse_variations(["support.mass=3:30:3log"])
    alone = follow_branches(huygens, variation)
    assert len(alone.changes) > 0
    together = follow_branches(huygens, variation, crew=Workers(crew=LosingExecutor()))
    assert configurations_of(together) == configurations_of(alone)


def test_exponents_of_starts_are_the_same_whoever_computes_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lyapunov, "STARTS_TOGETHER", 3)
    alone = lyapunov_exponent(load("chain-2"), 8.0, members=8)
    with ThreadPoolExecutor(2) as executor:
        shared = lyapunov_exponent(load("chain-2"), 8.0, members=8, crew=executor)
    assert np.array_equal(shared.growth, alone.growth)
    assert np.array_equal(shared.times, alone.times)
    assert shared.energy_drift == alone.energy_drift


def test_cases_of_a_study_are_the_same_whoever_computes_them() -> None:
    quick = study("001", quick=True)
    brief = type(quick)(quick.paper, quick.claim, quick.cases[:2], 7.0, 3)
    alone = measure_study(brief)
    with ThreadPoolExecutor(2) as executor:
        shared = measure_study(brief, crew=executor)
    assert [each.members.tobytes() for each in shared.exponents] == [each.members.tobytes() for each in alone.exponents]
