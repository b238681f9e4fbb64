"""The tests of every day: the table names what there is, and the choice is that of most lines a second."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from daily import choose
from daily_set import in_order, read

ROOT = Path(__file__).parents[2]


def test_the_table_names_functions_that_there_are() -> None:
    """In the file, or among those that a class of it has from `modal.testing`."""
    inherited = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "modal" / "testing").glob("*.py"))
    for name in read():
        file, _, function = name.partition("::")
        path, last = ROOT / file, re.split(r"::|\.", function)[-1]
        text = path.read_text(encoding="utf-8") + inherited * ("::Test" in name)
        assert last in {path.stem, path.parent.name} or f" {last}" in text, name


@pytest.mark.parametrize(
    ("number", "places"), [(1, [0]), (2, [0, 1]), (3, [0, 2, 1]), (4, [0, 3, 1, 2]), (10, [0, 9, 3, 6])]
)
def test_first_and_last_case_come_before_those_between(number: int, places: list[int]) -> None:
    assert in_order(range(number)) == places


def test_cases_that_reach_most_lines_a_second_are_chosen() -> None:
    lines = {"a[1]": {1, 2, 3}, "a[2]": {1, 2, 3}, "b": {1, 2, 3}, "c": {4}}
    times = {"a[1]": 0.1, "a[2]": 0.1, "b": 5.0, "c": 0.05, "rules": 1.0}
    assert choose(times, lines, 1.13) == {"a": 1, "c": 1, "rules": 1}
    assert choose(times, lines, 1.25) == {"a": 2, "c": 1, "rules": 1}
    assert choose(times, lines, 100.0) == {"a": 2, "b": 1, "c": 1, "rules": 1}
