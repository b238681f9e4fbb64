"""Faults put into the packages one at a time, and whether the tests find them.

The list is fixed by its seed and spread over subpackages by lines: 50 numbers of modules, each × 8 and ÷ 8, 100
operators and comparisons, 100 statements that are deleted.  A map of lines to tests, made once by a run of the
tests under coverage, says which tests reach a fault; the quickest go first, for at most 60 s of processor time, and the
first failure ends it.

    python benchmarks/mutants.py FOLDER [--sample N] [--rooms ROOM ...] [--seed N] [--all] [--like FILE]
    python benchmarks/mutants.py FOLDER --against FORMER   (two folders of results, by subpackage)

FOLDER holds copies of the tree, the map and `results.jsonl`; a second run resumes where the first ended.  `--all` takes
every case of the tests, as `.ci/all` does.  Needs the package coverage.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING

import pytest
from faults import PACKAGES, Fault, Site, faults, site_of, sources, with_fault

if TYPE_CHECKING:
    from coverage import CoverageData

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 60.0
"""Seconds of processor time for one fault."""
FIRST = 24
"""Tests that are tried before the rest is collected."""
SLOWER = 5.0
"""A test that takes so many times its usual time, and ten seconds, hangs."""


# ------------------------------------------------------------------------------- a plugin of pytest: the map, the order


class Mapping:
    """Lines and processor time of each test, in files of this process."""

    def __init__(self, folder: Path, tree: Path) -> None:
        from coverage import Coverage

        self.coverage = Coverage(
            data_file=str(folder / f"lines.{os.getpid()}"),
            source=[str(tree / package) for package in PACKAGES],
            config_file=False,
            messages=False,
        )
        self.times, self.rows = folder / f"times.{os.getpid()}", list[str]()
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """The lines of one test under its name."""
        self.coverage.switch_context(item.nodeid)
        begun = time.process_time()
        result = yield
        self.rows.append(f"{time.process_time() - begun:.4f}\t{item.nodeid}")
        self.coverage.switch_context("")
        return result

    def pytest_sessionfinish(self) -> None:
        """Everything into the files."""
        self.times.write_text("\n".join(self.rows), encoding="utf-8")
        self.coverage.stop()
        self.coverage.save()


class Order:
    """The tests of a list alone, in its order; what begins and what failed is written down at once."""

    def __init__(self, file: Path) -> None:
        self.wanted = {name: place for place, name in enumerate(file.read_text(encoding="utf-8").splitlines())}
        self.log = file.with_suffix(".log")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Those of the list."""
        items[:] = sorted(
            (item for item in items if item.nodeid in self.wanted), key=lambda item: self.wanted[item.nodeid]
        )

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """The test that runs now, and the processor time before it."""
        self.log.write_text(f"{time.process_time()}\t{nodeid}", encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """As the environment asks: a map is made, or a list is followed."""
    if folder := os.environ.get("MUTANTS_MAP"):
        if hasattr(config, "workerinput"):
            config.pluginmanager.register(Mapping(Path(folder), Path(config.rootpath)))
    elif file := os.environ.get("MUTANTS_TESTS"):
        config.pluginmanager.register(Order(Path(file)))


def _environment(tree: Path, **more: str) -> dict[str, str]:
    path = os.pathsep.join([str(tree), str(Path(__file__).parent)])
    return os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": "0"} | more


def make_map(folder: Path, tree: Path, every: bool) -> None:
    """Run all tests once, with two workers, and keep what each reaches and how long it takes."""
    there = folder / "map"
    shutil.rmtree(there, ignore_errors=True)
    there.mkdir()
    more = {"MUTANTS_MAP": str(there)} | ({"MULTIPENDULA_SCENES": "all"} if every else {})
    with open(folder / "map.log", "w", encoding="utf-8") as log:
        subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "mutants", "-n", "2", "-q", "-p", "no:cacheprovider"],
            cwd=tree,
            env=_environment(tree, **more),
            stdout=log,
            stderr=log,
            check=False,
        )
    from coverage import CoverageData

    data = CoverageData(str(folder / "lines"))
    data.erase()
    for part in sorted(there.glob("lines.*")):
        read = CoverageData(str(part))
        read.read()
        data.update(read)
    data.write()
    failed = set(
        re.findall(r"^(?:FAILED|ERROR) (\S+?)(?: - .*)?$", (folder / "map.log").read_text(), flags=re.MULTILINE)
    )
    times = dict[str, float]()
    for part in sorted(there.glob("times.*")):
        for line in part.read_text(encoding="utf-8").splitlines():
            seconds, name = line.split("\t", 1)
            if name not in failed:
                times[name] = float(seconds)
    (folder / "times.json").write_text(json.dumps(times, indent=0), encoding="utf-8")


# ------------------------------------------------------------------------------------------ which tests reach a fault


class Reach:
    """Tests that reach a fault, the quickest first."""

    def __init__(self, folder: Path, tree: Path) -> None:
        from coverage import CoverageData

        self.data: CoverageData = CoverageData(str(folder / "lines"))
        self.data.read()
        self.times: dict[str, float] = json.loads((folder / "times.json").read_text(encoding="utf-8"))
        self.tree, self.lines = tree, dict[str, dict[int, list[str]]]()
        self.trees = {file: ast.parse((tree / file).read_text(encoding="utf-8")) for file in sources(tree)}

    def _by_line(self, file: str) -> dict[int, list[str]]:
        if file not in self.lines:
            measured = next((name for name in self.data.measured_files() if name.endswith(f"/{file}")), "")
            self.lines[file] = self.data.contexts_by_lineno(measured) if measured else {}
        return self.lines[file]

    def _tests(self, file: str, lines: Iterable[int]) -> set[str]:
        reached = self._by_line(file)
        return {name for line in lines for name in reached.get(line, ()) if name in self.times}

    def _bodies(self, file: str, name: str = "") -> Iterator[range]:
        """The lines of the functions of a file, of those alone that read a name if one is given."""
        for node in ast.walk(self.trees[file]):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and (
                not name or any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node))
            ):
                yield range(node.body[0].lineno, (node.body[-1].end_lineno or 0) + 1)

    def _readers(self, fault: Fault) -> Iterator[tuple[str, str]]:
        yield fault.file, fault.name
        module = ".".join(Path(fault.file).with_suffix("").parts).removesuffix(".__init__")
        for file, tree in self.trees.items():
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom) and node.module == module:
                    yield from ((file, alias.asname or alias.name) for alias in node.names if alias.name == fault.name)

    def __call__(self, site: Site) -> list[str]:
        """The names of the tests."""
        fault = site.fault
        if fault.kind == "number":
            names = set[str]()
            for file, name in self._readers(fault):
                names |= {test for body in self._bodies(file, name) for test in self._tests(file, body)}
        else:
            names = self._tests(fault.file, range(site.first[0], site.last[0] + 1))
        if not names:
            names = {test for body in self._bodies(fault.file) for test in self._tests(fault.file, body)}
        return sorted(names, key=lambda name: (self.times[name], name))


# ----------------------------------------------------------------------------------------------------- a fault is tried


@dataclass(frozen=True)
class Result:
    """What became of a fault: killed by a test, alive after so many tests and seconds, hung in a test, or gone."""

    fault: Fault
    state: str
    test: str
    tests: int
    seconds: float

    def to_json(self) -> str:
        """A line of the file of results."""
        return json.dumps(asdict(self), ensure_ascii=False)


def _run(tree: Path, names: Sequence[str], seconds: float, every: bool) -> tuple[int, float, str]:
    """Pytest's status (or −1 out of time), processor time, and the failed or last test with its time."""
    wanted = tree.parent / f"{tree.name}.tests"
    wanted.write_text("\n".join(names), encoding="utf-8")
    wanted.with_suffix(".log").unlink(missing_ok=True)
    files = list(dict.fromkeys(name.partition("::")[0] for name in names))
    more = {"MUTANTS_TESTS": str(wanted)} | ({"MULTIPENDULA_SCENES": "all"} if every else {})
    with open(wanted.with_suffix(".out"), "w", encoding="utf-8") as out:
        process = subprocess.Popen(
            [
                *("bash", "-c", f'ulimit -t {int(seconds) + 1}; exec "$@"', "-", sys.executable),
                *("-m", "pytest", "-p", "mutants", "-n", "0", "-x", "-q", "-p", "no:cacheprovider", *files),
            ],
            cwd=tree,
            env=_environment(tree, **more),
            stdout=out,
            stderr=out,
            start_new_session=True,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = status
    spent = usage.ru_utime + usage.ru_stime
    said = wanted.with_suffix(".out").read_text(encoding="utf-8", errors="replace")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", said, flags=re.MULTILINE)
    if os.WIFSIGNALED(status):
        return -1, spent, _last(wanted)
    return os.WEXITSTATUS(status), spent, failed[1] if failed else _last(wanted)


def _last(wanted: Path) -> str:
    log = wanted.with_suffix(".log")
    return log.read_text(encoding="utf-8") if log.exists() else ""


def _forget_compiled(tree: Path, file: str) -> None:
    """Bytecode of the file, and what numba keeps where the file is compiled: its callers hold its code."""
    path = tree / file
    for kept in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
        kept.unlink()
    if "nonlinear.dynamics.compiling" in path.read_text(encoding="utf-8") or path.parts[-2] in {
        "integration",
        "ensembles",
    }:
        for kept in tree.rglob("*.nb[ic]"):
            kept.unlink()


def attempt(tree: Path, fault: Fault, reach: Reach, every: bool) -> Result:
    """Put a fault into a copy, run the tests that reach it, and take it out again."""
    site = site_of(reach.tree, fault)
    if site is None:
        return Result(fault, "gone", "", 0, 0.0)
    names, path = reach(site), tree / fault.file
    before, spent, tried = path.read_bytes(), 0.0, 0
    changed = with_fault(before.decode(), site)
    ast.parse(changed)
    path.write_text(changed, encoding="utf-8")
    _forget_compiled(tree, fault.file)
    try:
        for part in (names[:FIRST], names[FIRST:]):
            budget, chosen = LIMIT - spent, list[str]()
            for name in part:
                if sum(reach.times[test] for test in chosen) > budget:
                    break
                chosen.append(name)
            if not chosen or budget <= 0.0:
                continue
            status, seconds, last = _run(tree, chosen, budget, every)
            spent += seconds
            tried += len(chosen)
            if status == -1:
                begun, _, name = last.partition("\t")
                usual = reach.times.get(name, 0.0)
                hung = begun and seconds - float(begun) > SLOWER * usual + 10.0
                return Result(fault, "hung" if hung else "alive", name, tried, spent)
            if status not in {0, 5}:
                return Result(fault, "killed", last, tried, spent)
        return Result(fault, "alive", "", tried, spent)
    finally:
        path.write_bytes(before)
        _forget_compiled(tree, fault.file)


# ------------------------------------------------------------------------------------------------------------- the run


def read_results(file: Path) -> dict[Fault, Result]:
    """What was found so far; the last line of a fault counts."""
    results = dict[Fault, Result]()
    if file.exists():
        for line in file.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            fault = Fault(**row.pop("fault"))
            results[fault] = Result(fault, **row)
    return results


def copy_of_tree(source: Path, target: Path) -> Path:
    """The files of a checkout that git knows, as they stand."""
    if not target.exists():
        names = subprocess.run(["git", "ls-files", "-z"], cwd=source, capture_output=True, check=True).stdout
        for name in names.decode().split("\0"):
            if name and (source / name).exists():
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source / name, target / name)
        subprocess.run(["git", "init", "-q"], cwd=target, check=True)
    return target


def measure(options: argparse.Namespace) -> None:
    """Try the faults that have no result yet, two at a time."""
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    tree = copy_of_tree(options.tree.resolve(), folder / "tree")
    if not (folder / "times.json").exists():
        make_map(folder, tree, options.all)
    if options.like:
        wanted = list(read_results(options.like))
    else:
        wanted = faults(tree, options.seed)
        wanted = [fault for fault in wanted if not options.rooms or fault.room in options.rooms]
        if options.sample is not None:
            wanted = random.Random(options.seed).sample(wanted, min(options.sample, len(wanted)))
    results = folder / "results.jsonl"
    reach = Reach(folder, tree)
    copies: SimpleQueue[Path] = SimpleQueue()
    for number in range(options.processes):
        copy = folder / f"copy{number}"
        if not copy.exists():
            shutil.copytree(tree, copy)
        copies.put(copy)

    def result_of(fault: Fault) -> Result:
        copy = copies.get()
        try:
            return attempt(copy, fault, reach, options.all)
        finally:
            copies.put(copy)

    done = read_results(results)
    left = [fault for fault in wanted if fault not in done]
    with ThreadPoolExecutor(options.processes) as pool, open(results, "a", encoding="utf-8") as stream:
        for number, result in enumerate(pool.map(result_of, left), start=1 + len(wanted) - len(left)):
            stream.write(result.to_json() + "\n")
            stream.flush()
            print(f"{number}/{len(wanted)} {result.state} {result.seconds:.0f} s {result.fault}", flush=True)
    print(table([read_results(results)], ["here"]))


def table(runs: Sequence[dict[Fault, Result]], heads: Sequence[str]) -> str:
    """Faults found of all, by subpackage, each run a column."""
    rooms = defaultdict[str, list[Fault]](list)
    for fault in runs[0]:
        rooms[fault.room].append(fault)
    rows = [(room, rooms[room]) for room in sorted(rooms)] + [("all", list(runs[0]))]
    lines = [f"| room | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    for room, those in rows:
        cells = []
        for run in runs:
            states = Counter(run[fault].state for fault in those if fault in run)
            count = sum(states.values()) - states["gone"]
            noticed = states["killed"] + states["hung"]
            cells.append(f"{noticed} of {count}" + (f" ({noticed / count:.1%})" if count and room == "all" else ""))
        lines.append(f"| {room} | {' | '.join(cells)} |")
    return "\n".join(lines)


def compare(folder: Path, former: Path) -> str:
    """Two runs by subpackage, and the faults that live in both or in one."""
    runs = [read_results(there / "results.jsonl") for there in (former, folder)]
    lines = [table(runs, ["before", "after"]), ""]
    for fault in runs[0]:
        states = [run[fault].state if fault in run else "not tried" for run in runs]
        if "alive" in states:
            lines.append(f"- {', '.join(states)}: {fault}")
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for copies of the tree, the map and the results")
    parser.add_argument("--tree", type=Path, default=ROOT, help="the checkout that is copied")
    parser.add_argument("--sample", type=int, help="as many faults of the list")
    parser.add_argument("--rooms", nargs="+", default=[], help="as modal.eigen")
    parser.add_argument("--seed", type=int, default=0, help="of the list and of the sample")
    parser.add_argument("--like", type=Path, help="the faults of this results.jsonl")
    parser.add_argument("--all", action="store_true", help="every case of the tests")
    parser.add_argument("--processes", type=int, default=2, help="faults tried at once")
    parser.add_argument("--against", type=Path, help="the folder of a former run")
    options = parser.parse_args(argv)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it for background jobs; tests send it
    if options.against:
        print(compare(options.folder, options.against))
    elif find_spec("coverage"):
        measure(options)
    else:
        parser.error("the map of lines to tests needs the package coverage: pip install coverage")


if __name__ == "__main__":
    main()
