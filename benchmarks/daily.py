"""Which cases of which tests run every day: those that reach most lines in the seconds that they may take.

    MULTIPENDULA_SCENES=each python benchmarks/mutants.py FOLDER --sample 0   (a map of lines to tests)
    python benchmarks/daily.py FOLDER [--seconds N]                           (writes tests/daily.txt)

A line counts less each time that another case reaches it; the case that adds most a second comes next, until the
time is spent.  Quick tests run always, the quickest with all their cases, each of which is mostly a message of its own;
and so do those that reach no line of the packages, the rules of the house among them.  The table has the functions that
do not run whole.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping
from heapq import heapify, heappop, heappush
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

from daily_set import MOST, QUICK, TABLE, WHOLE, Function, by_function, in_order, write

SHARES = (1.0, 0.5, 0.25, 0.12, 0.06)
"""The weight of a line when a first, second, third ... case reaches it."""
OVERHEAD = 0.003
"""Seconds that pytest takes for a case."""


def lines_of(folder: Path) -> dict[str, set[int]]:
    """The lines that each case reaches, as numbers."""
    from coverage import CoverageData

    data = CoverageData(str(folder / "lines"))
    data.read()
    reached = defaultdict[str, set[int]](set)
    for place, file in enumerate(sorted(data.measured_files())):
        for line, cases in data.contexts_by_lineno(file).items():
            for case in filter(None, cases):
                reached[case].add(place * 100_000 + line)
    return reached


def mean_of(cases: Collection[str], times: Mapping[str, float]) -> float:
    """Seconds of a case."""
    return sum(map(times.__getitem__, cases)) / len(cases)


def choose(times: Mapping[str, float], lines: Mapping[str, set[int]], seconds: float) -> Counter[str]:
    """How many cases of each function run every day."""
    functions = by_function(times, str)
    waiting = {name: in_order(cases) for name, cases in functions.items()}
    counts, chosen = Counter[int](), Counter[str]()

    def take(name: str) -> float:
        case = waiting[name].pop(0)
        counts.update(lines.get(case, ()))
        chosen[name] += 1
        return times[case] + OVERHEAD

    def worth(name: str) -> float:
        case = waiting[name][0]
        gain = sum(SHARES[counts[line]] for line in lines[case] if counts[line] < len(SHARES))
        return gain / (times[case] + OVERHEAD)

    for name, cases in functions.items():
        if mean_of(cases, times) < QUICK or not any(lines.get(case) for case in cases):
            while waiting[name]:
                seconds -= take(name)
    heap = [(-worth(name), name) for name in waiting if waiting[name] and waiting[name][0] in lines]
    heapify(heap)
    while heap and seconds > 0:
        _, name = heappop(heap)
        now = -worth(name)
        if now == 0:
            continue
        if heap and now > heap[0][0]:
            heappush(heap, (now, name))
            continue
        seconds -= take(name)
        if waiting[name] and waiting[name][0] in lines:
            heappush(heap, (-worth(name), name))
    return chosen


def summary(times: Mapping[str, float], lines: Mapping[str, set[int]], cases: Iterable[str]) -> str:
    """What the chosen cases reach of what all cases reach."""
    cases = list(cases)
    every = Counter(line for name in times for line in lines.get(name, ()))
    some = Counter(line for name in cases for line in lines.get(name, ()))
    once = sum(some[line] > 0 for line in every) / len(every)
    twice = sum(some[line] >= min(2, every[line]) for line in every) / len(every)
    return (
        f"{len(cases)} of {len(times)} cases in {sum(map(times.__getitem__, cases)):.0f} of {sum(times.values()):.0f} s"
        f" reach {once:.1%} of {len(every)} lines, {twice:.1%} twice or as often as all do"
    )


def main() -> None:
    """Write the table, and say what it reaches."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=200.0)
    options = parser.parse_args()
    times: dict[str, float] = json.loads((options.folder / "times.json").read_text(encoding="utf-8"))
    lines = lines_of(options.folder)
    chosen = choose(times, lines, options.seconds)
    functions = by_function(times, str)
    rows = [Function(name, mean_of(cases, times), chosen[name]) for name, cases in functions.items()]
    write(row for row in rows if row.seconds >= (WHOLE if len(functions[row.name]) == MOST else QUICK))
    daily = [case for name, cases in functions.items() for case in in_order(cases)[: chosen[name]]]
    print(summary(times, lines, daily))
    print(f"written: {TABLE}")


if __name__ == "__main__":
    main()
