"""Numbers of modules: each says its kind and its reason, and none has two values."""

from __future__ import annotations

from collections import defaultdict

from constants import KINDS, all_numbers, numbers_of

NUMBERS_MAX = 750
UNDECLARED_MAX = 0
NAMES_TWICE_MAX = 5


def test_every_number_says_its_kind_and_its_reason() -> None:
    numbers = all_numbers()
    assert 200 < len(numbers) <= NUMBERS_MAX
    undeclared = [f"{number.module}.{number.name}" for number in numbers if not number.reason]
    assert len(undeclared) <= UNDECLARED_MAX, undeclared


def test_the_same_name_has_the_same_value() -> None:
    values = defaultdict[str, set[str]](set)
    for number in all_numbers():
        values[number.name].add(number.value)
    assert len([name for name in values if len(values[name]) > 1]) <= NAMES_TWICE_MAX


def test_a_number_is_read_with_what_stands_below_it() -> None:
    source = 'A = 1\n"""Cost: three\nruns."""\nB, C = -2.0, 3 * EPS\nD: int = 4\n"""Guess: x."""\n'
    source += 'E = "5"\nf = 6\nG = float(x)'
    assert [number[1:] for number in numbers_of("m", source)] == [
        ("A", "1", "Cost", "three runs."),
        ("B", "-2.0", "", ""),
        ("C", "3 * EPS", "", ""),
        ("D", "4", "", ""),
        ("G", "float(x)", "", ""),
    ]
    assert list(KINDS) == ["Physics", "Format", "Tolerance", "Cost", "Limit"]
