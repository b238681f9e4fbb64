"""Hostile input to the command line, and whether any of it leaves more than one clear message.

    python benchmarks/hostile.py [--scenes 10000] [--options 1] [--flips 500] [--interruptions 200]
                                 [--endless 300] [--numbers 2000] [--names 500] [--calls 5000] [--kept 300]

Scene files from wild but valid to random bytes, given to the commands that read scenes; every option of every command
with values of every wrong type; files that are read back, with bytes changed; commands stopped by Ctrl-C, SIGTERM and
SIGKILL; devices, pipes and folders in place of files of data; numbers at the ends of double precision in them; names of
columns and files that control a terminal; nonsense given to public functions; records, chunks and compiled code changed
behind the back of who keeps them.

Counted as faults: tracebacks, exit codes other than 0, 1, 2 and 130, messages that control a terminal, Python
warnings, files that are half-written or left behind, processes that outlive their command, and numbers that differ
without notice.  A command that is given up after 20 s is counted separately.  Exit code 1 where there are faults.
`--options 0.1` takes a tenth of the calls; `--from N` begins at case N of every kind, so that other cases are tried.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hostility import calls, damage, interruptions, kept, measurements, options, scene_files
from hostility.judge import Ended, warm_up
from tabulate import tabulate
from tqdm import tqdm

MEMORY = 6 * 2**30  # memory limit of a command (bytes)
CHUNK = 20

Verdict = tuple[str, list[str]]
"""The outcome of a case, and its faults."""


def scene_case(number: int) -> Verdict:
    with TemporaryDirectory() as folder:
        return _verdict(f"scene file {number}", scene_files.case(number, Path(folder)))


def option_case(call: tuple[str, ...]) -> Verdict:
    with TemporaryDirectory() as folder:
        return _verdict("", options.case(call, Path(folder)))


def flip_case(name: str, number: int) -> Verdict:
    became, fault = damage.case(name, number)
    return became, [fault] if fault else []


def interruption_case(number: int) -> Verdict:
    with TemporaryDirectory() as folder:
        done, faults = interruptions.case(number, Path(folder))
    return "stopped", [f"interruption {number}: {done}: {fault}" for fault in faults]


def file_case(kind: str, number: int) -> Verdict:
    with TemporaryDirectory() as folder:
        return _verdict(f"{kind} {number}", getattr(measurements, kind)(number, Path(folder)))


def _verdict(name: str, ended: Ended) -> Verdict:
    became = "given up" if ended.code is None and not ended.faults else f"exit {ended.code}"
    return became, [f"{name}: {' '.join(ended.words)[:200]!r}: {fault}" for fault in ended.faults]


def parts(asked: argparse.Namespace) -> Iterator[tuple[str, Callable[..., Verdict], list[Any]]]:
    """The kinds of cases, their functions, and their arguments."""
    first = asked.first
    every = options.calls()
    chosen = random.Random(first).sample(every, round(asked.options * len(every)))
    yield "scene files", scene_case, list(range(first, first + asked.scenes))
    yield "options", option_case, chosen
    for name in damage.kinds() if asked.flips else ():
        yield f"flips of {name}", partial(flip_case, name), list(range(first, first + asked.flips))
    for kind in ("endless", "numbers", "names"):
        yield f"files of data: {kind}", partial(file_case, kind), list(range(first, first + getattr(asked, kind)))
    yield "public functions", calls.case, list(range(first, first + asked.calls))
    yield "records, chunks, kernels", kept.case, list(range(first, first + asked.kept))
    yield "interruptions", interruption_case, list(range(first, first + asked.interruptions))


def judged(do: Callable[..., Verdict], cases: list[Any], workers: int) -> Iterable[Verdict]:
    """The verdicts as they come; a worker that dies is a fault of its cases."""
    pool = ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_ready, initargs=(do is not interruption_case,)
    )
    with pool:
        yield from pool.map(do, cases, chunksize=CHUNK if len(cases) > 50 * CHUNK else 1)


def _ready(here: bool) -> None:
    """A worker, in which commands run or which only monitors their processes."""
    if here:
        warm_up()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--scenes", type=int, default=10_000)
    parser.add_argument("--options", type=float, default=1.0, help="share of all calls")
    parser.add_argument("--flips", type=int, default=500, help="of each kind of file")
    parser.add_argument("--interruptions", type=int, default=200)
    parser.add_argument("--endless", type=int, default=300, help="devices, pipes and folders as files of data")
    parser.add_argument("--numbers", type=int, default=2000, help="files of data with extreme numbers")
    parser.add_argument("--names", type=int, default=500, help="files of data with names that control a terminal")
    parser.add_argument("--calls", type=int, default=5000, help="of public functions")
    parser.add_argument("--kept", type=int, default=300, help="of what is kept between commands and processes")
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    rows, wrong = [], 0
    for name, do, cases in parts(asked):
        became, faults = Counter[str](), 0
        for outcome, told_faults in tqdm(judged(do, cases, asked.workers), total=len(cases), desc=name, disable=None):
            became[outcome] += 1
            faults += bool(told_faults)
            for fault in told_faults:
                print(ascii(fault), flush=True)
        told = ", ".join(f"{outcome}: {count}" for outcome, count in sorted(became.items()))
        rows.append((name, len(cases), told, faults))
        wrong += faults
    print(tabulate(rows, headers=["what", "tried", "what became of them", "bad"]))
    print(f"tried {sum(row[1] for row in rows)}, bad {wrong or 'none'}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
