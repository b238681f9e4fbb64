"""A quick share of `benchmarks/hostile.py`: nothing hostile leaves more than one clear message."""

from __future__ import annotations

import random
import signal
import sys
from pathlib import Path

import pytest
from amounts import usually
from hostility import damage, interruptions, judge, options, scene_files

MANY, CALLS, STOPPED = usually(25, 40), usually(8, 30), 6


@pytest.mark.parametrize("block", usually(range(1), range(5)))
def test_scene_files(block: int, tmp_path: Path) -> None:
    for number in range(100_000 + block * MANY, 100_000 + (block + 1) * MANY):
        folder = tmp_path / str(number)
        folder.mkdir()
        ended = scene_files.case(number, folder)
        assert (ended.words, ended.faults) == (ended.words, ())


@pytest.mark.parametrize("block", usually(range(2), range(8)))
def test_options(block: int, tmp_path: Path) -> None:
    for place, call in enumerate(random.Random(block).sample(options.calls(), CALLS)):
        folder = tmp_path / str(place)
        folder.mkdir()
        ended = options.case(call, folder)
        assert (call, ended.faults) == (call, ())


def test_every_command_is_tried() -> None:
    assert options.BASES.keys() == options.commands().keys()


@pytest.mark.parametrize("name", damage.kinds())
def test_damaged_files(name: str) -> None:
    cases = [damage.case(name, number) for number in range(100_000, 100_000 + MANY)]
    assert [fault for _, fault in cases if fault] == []
    assert damage.REFUSED in {became for became, _ in cases}


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked for in /proc")
@pytest.mark.parametrize("number", usually([100_001], range(100_000, 100_000 + STOPPED)))
def test_interruptions(number: int, tmp_path: Path) -> None:
    done, faults = interruptions.case(number, tmp_path)
    assert (done, faults) == (done, [])


# ---------------------------------------------------------------------------------------------------- the judge bites


def _judged(monkeypatch: pytest.MonkeyPatch, folder: Path, command: object) -> tuple[str, ...]:
    monkeypatch.setattr(judge, "main", command)
    return judge.run(["table"], folder, patience=0.2).faults


def test_a_traceback_is_a_fault(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (fault,) = _judged(monkeypatch, tmp_path, lambda words: 1 // len(words[1:]))
    assert fault.startswith("ZeroDivisionError")


@pytest.mark.parametrize(
    ("said", "code", "fault"),
    [
        ("multipendula: no\n", 3, "exit code 3"),
        ("", 2, "exit code 2 without a word"),
        ("multipendula: \x1b[31m\n", 2, "U+001B raw on standard error"),
        ("multipendula: \u202e\u009b\n", 2, "U+009B, U+202E raw on standard error"),
        ("x.py:1: RuntimeWarning: overflow\n", 0, "a warning of Python's: x.py:1: RuntimeWarning: overflow"),
        ("no\n" * 200, 2, "200 lines of complaint"),
    ],
)
def test_what_is_said_is_judged(
    said: str, code: int, fault: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def command(words: list[str]) -> int:
        sys.stderr.write(said)
        return code

    assert _judged(monkeypatch, tmp_path, command) == (fault,)


def test_what_is_left_is_judged(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def command(words: list[str]) -> int:
        Path(".multipendula-x").touch()
        Path("half.csv").touch()
        sys.stderr.write("multipendula: no\n")
        return 2

    assert sorted(_judged(monkeypatch, tmp_path, command)) == [
        "left .multipendula-x",
        "refused, and yet wrote half.csv",
    ]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no such alarm")
def test_nobody_waits_for_ever(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def command(words: list[str]) -> int:
        while True:
            sum(range(1000))

    monkeypatch.setattr(judge, "main", command)
    ended = judge.run(["table"], tmp_path, patience=0.05)
    assert (ended.code, ended.faults) == (None, ())


def test_other_numbers_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = damage.Kind(b"numbers 1 2 3\n", lambda content: content)
    monkeypatch.setattr(damage, "kinds", lambda: {"file": kind})
    assert damage.case("file", 0)[1] == "file 0: read with other numbers"
