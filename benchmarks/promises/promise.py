"""A promise tried on fresh random cases: how many were tried, how many broken, and how near the nearest came.

Each script next to this module has a function from a seed to `Trial`s and hands it to `attack`.  A trial holds the true
error, by an independent route, and the error that was promised; the promise is broken where the first exceeds the
second or is no number.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from typing import NamedTuple

from tqdm import tqdm


class Trial(NamedTuple):
    """One promise: what it was about, its true error and the promised one (same unit)."""

    about: str
    error: float
    promised: float

    @property
    def broken(self) -> bool:
        """Whether the true error is larger than the promised one, or is no number."""
        return not self.error <= self.promised

    @property
    def share(self) -> float:
        """True error over promised error."""
        return self.error / self.promised if self.promised else float("inf") if self.broken else 0.0


Tried = list[tuple[int, Trial]]


def attack(
    description: str,
    trials: Callable[[int], Iterable[Trial]],
    *,
    cases: int,
    quick: int,
    summary: Callable[[Tried], str] | None = None,
) -> None:
    """Try `cases` seeds (`quick` with --quick), print broken promises and the counts; status 1 if any is broken.

    With --record FILE each seed's trials are a line there, and seeds that have one are not tried again.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"{quick} cases instead of {cases}")
    parser.add_argument("--cases", type=int, help="number of seeds")
    parser.add_argument("--seed", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--record", type=Path, help="a file of lines, in which a run that was cut short goes on")
    arguments = parser.parse_args()
    count = arguments.cases or (quick if arguments.quick else cases)
    record, tried = _recorded(arguments.record), Tried()
    for seed in tqdm(range(arguments.seed, arguments.seed + count), disable=not sys.stderr.isatty(), leave=False):
        if seed not in record:
            record[seed] = list(trials(seed))
            if arguments.record:
                with arguments.record.open("a") as file:
                    file.write(json.dumps({"seed": seed, "trials": record[seed]}) + "\n")
        for trial in record[seed]:
            tried.append((seed, trial))
            if trial.broken:
                print(f"broken, seed {seed}: {trial.about}: {trial.error:.3g} where {trial.promised:.3g} was promised")
    broken = sum(trial.broken for _, trial in tried)
    print(f"{description.splitlines()[0]}\n{count} cases, {len(tried)} promises, {broken} broken")
    if tried:
        seed, nearest = max(tried, key=lambda pair: pair[1].share)
        print(f"nearest: {nearest.share:.2g} of what was promised (seed {seed}: {nearest.about})")
        print(f"median: {median(trial.share for _, trial in tried):.2g} of what was promised")
    if summary:
        print(summary(tried))
    sys.exit(1 if broken else 0)


def _recorded(file: Path | None) -> dict[int, list[Trial]]:
    """The trials of the seeds that have a line in a file."""
    lines = file.read_text().splitlines() if file and file.exists() else []
    entries = map(json.loads, lines)
    return {entry["seed"]: [Trial(*trial) for trial in entry["trials"]] for entry in entries}
