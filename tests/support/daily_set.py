"""The tests of every day: how many cases of a function, and what each takes, from `tests/daily.txt`."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

TABLE = Path(__file__).resolve().parent.parent / "daily.txt"
QUICK = 0.1
"""Seconds of processor time; what takes less is run every day."""
WHOLE, MOST = 0.01, 4
"""And a function whose cases take so little runs all of them, others at most so many."""
HEAD = "# Seconds of processor time a case, cases run every day, function: by benchmarks/daily.py.  Others run all."


@dataclass(frozen=True)
class Function:
    """A row of the table."""

    name: str
    seconds: float
    cases: int


def by_function(cases: Iterable[T], name_of: Callable[[T], str]) -> dict[str, list[T]]:
    """The cases of each function."""
    functions = dict[str, list[T]]()
    for case in cases:
        functions.setdefault(name_of(case).partition("[")[0], []).append(case)
    return functions


def in_order(cases: Sequence[T]) -> list[T]:
    """At most MOST cases of a function in the order in which they are taken: first, last, two evenly between."""
    last = len(cases) - 1
    return [cases[place] for place in dict.fromkeys([0, last, round(last / 3), round(last * 2 / 3)])]


def read() -> dict[str, Function]:
    """The functions of the table, those that do not run whole, by their names."""
    rows = [line.split(maxsplit=2) for line in TABLE.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    return {name: Function(name, float(seconds), int(cases)) for seconds, cases, name in rows}


def write(functions: Iterable[Function]) -> None:
    """Put them into the table by their names."""
    rows = sorted((function.name, f"{function.seconds:.2g} {function.cases} {function.name}") for function in functions)
    TABLE.write_text("\n".join([HEAD, *(row for _, row in rows), ""]), encoding="utf-8")
