"""Members a core-second of ensembles, against heyoka's bare batches, numba's Runge–Kutta and `simulate` in a loop.

    OPENBLAS_NUM_THREADS=1 python benchmarks/ensembles.py [--quick] [--write] [--map]

Every rate is of one thread and ten seconds of motion, every error the median and the 95 % quantile of the largest
angle's at the end, against lanes at 1e-13.  `--map` adds a map of first turns of 512 × 512 starts to 20 s on all cores,
and the rate and the memory of a million members; `--write` puts the page into docs/.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import statistics
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from multiprocessing import active_children
from pathlib import Path
from typing import NamedTuple

import numpy as np
from modes import markdown

from modal import load
from modal.scene import Bob, Cart, Pendulum, Rod, Scene
from nonlinear import State, ensemble, simulate
from nonlinear.dynamics import forms as equations

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks" / "ensembles.md"
DURATION, TOLERANCE, STEP = 10.0, 1e-9, 0.01
SCENES = {
    "bobs": Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)])]),
    "cart": Scene(
        gravity=9.81,
        support=Cart(mass=100.0),
        pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=2)], count=2)],
    ),
}
SWITCHING = {
    "clocks": load("huygens"),
    "rubbing": Scene(
        gravity=9.81,
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, friction=0.3), Bob(mass=0.7, length=1.0, friction=0.2)])],
    ),
}
NAMES = {
    "clocks": "two clocks on a beam, escapements",
    "rubbing": "double pendulum, dry friction at both joints",
    "bobs": "double pendulum of bobs",
    "cart": "cart with two doubles",
}
Route = Callable[[np.ndarray], np.ndarray]


class Row(NamedTuple):
    """A route: members a second, and two quantiles of the error (rad)."""

    name: str
    rate: float
    median: float
    most: float


def ours(scene: Scene, engine: str, tolerance: float = TOLERANCE, **more: object) -> Route:
    """The ends (S, L) of members, with all their certificates."""

    def run(starts: np.ndarray) -> np.ndarray:
        members = ensemble(
            scene, DURATION, starts=starts, engine=engine, tolerance=tolerance, workers=1, check=0, **more
        )
        return np.asarray(members.final.links)

    return run


def by_recursion(scene: Scene, engine: str) -> Route:
    """The same without the closed formulas of short chains."""

    def run(starts: np.ndarray) -> np.ndarray:
        longest, equations.MATRIX_LINKS_MAX = equations.MATRIX_LINKS_MAX, 0
        try:
            return ours(scene, engine)(starts)
        finally:
            equations.MATRIX_LINKS_MAX = longest

    return run


def one_by_one(scene: Scene) -> Route:
    def run(starts: np.ndarray) -> np.ndarray:
        runs = (
            simulate(scene, DURATION, start=State(angles, 0 * angles), tolerance=TOLERANCE, output=2, method="DOP853")
            for angles in starts
        )
        return np.array([run.final.links for run in runs])

    return run


def rival(name: str, kind: str) -> Route:
    import rival_ensembles as rivals

    first = int(name == "cart")
    kernel = rivals.runge_kutta(getattr(rivals, name)) if kind == "numba" else rivals.batches(name, TOLERANCE)

    def run(starts: np.ndarray) -> np.ndarray:
        half = first + starts.shape[1]
        y = np.zeros((len(starts), 2 * half))
        y[:, first:half] = starts
        if kind == "numba":
            kernel(y, DURATION, STEP)
        else:
            y = kernel(y, DURATION)
        return y[:, first:half]

    return run


def measured(name: str, route: Route, starts: np.ndarray, reference: np.ndarray, repeats: int) -> Row:
    """The median rate of some runs, after one of few members that compiles."""
    ends, times = route(starts[:16]), []
    for _ in range(repeats):
        begun = time.process_time()
        ends = route(starts)
        times.append(time.process_time() - begun)
    error = np.abs(ends - reference[: len(ends)]).max(1)
    median, most = np.quantile(error, [0.5, 0.95])
    return Row(name, len(starts) / statistics.median(times), median, most)


def rows_of(name: str, quick: bool) -> list[Row]:
    scene, repeats = SCENES[name], 1 if quick else 3
    size = 64 if quick else 8192
    starts = np.random.default_rng(1).uniform(-1, 1, (size, scene.n_links))
    reference = ours(scene, "numpy", 1e-13)(starts)
    routes: dict[str, tuple[Route, int]] = {}
    if find_spec("heyoka"):
        routes["heyoka's bare batches"] = rival(name, "heyoka"), size
    if find_spec("numba"):
        routes[f"Runge–Kutta by numba, h = {STEP:g} s"] = rival(name, "numba"), size
    routes["ours, NumPy (default)"] = ours(scene, "numpy"), size
    routes["ours, NumPy, recursion"] = by_recursion(scene, "numpy"), size
    if find_spec("numba"):
        routes["ours, numba"] = ours(scene, "numba"), size
        routes["ours, numba, recursion"] = by_recursion(scene, "numba"), size
    routes["`simulate` in a loop"] = one_by_one(scene), 8 if quick else 64
    return [measured(kind, route, starts[:count], reference, repeats) for kind, (route, count) in routes.items()]


def table(rows: list[Row]) -> str:
    lines = [
        (
            row.name,
            f"{row.rate:,.0f}",
            f"{row.median:.0e}",
            f"{row.most:.0e}",
            _ratio(row, rows, "heyoka's"),
            _ratio(row, rows, "Runge"),
        )
        for row in rows
    ]
    heads = ("route", "members/s", "error, median (rad)", "error, 95 % (rad)", "of bare heyoka", "of Runge–Kutta")
    return markdown(heads, lines)


def switching(name: str, quick: bool) -> str:
    """Members with switches, each of which ends a step."""
    scene, size = SWITCHING[name], 64 if quick else 1024
    starts = np.random.default_rng(1).uniform(-1, 1, (size, scene.n_links)) * (0.2 if name == "clocks" else 1.0)
    reference = ours(scene, "numpy", 1e-13)(starts)
    routes = {"`simulate` in a loop": (one_by_one(scene), 8 if quick else 64), "NumPy": (ours(scene, "numpy"), size)}
    if find_spec("numba") and not quick:
        routes["numba"] = ours(scene, "numba"), size
    rows = [measured(kind, route, starts[:count], reference, 3) for kind, (route, count) in routes.items()]
    lines = [
        (row.name, f"{row.rate:,.0f}", f"{row.median:.0e}", f"{row.most:.0e}", _ratio(row, rows, "`simulate`"))
        for row in rows
    ]
    return markdown(("route", "members/s", "error, median (rad)", "error, 95 % (rad)", "of the loop"), lines)


def _ratio(row: Row, rows: list[Row], name: str) -> str:
    known = [other.rate for other in rows if other.name.startswith(name)]
    return f"{row.rate / known[0]:.2g}" if known else "-"


def turns(size: int, duration: float) -> str:
    """A map of first turns on all cores: its time and rate."""
    places = [f"pendulum[0].start.angles_deg[{k}]=-180:180:{size}" for k in range(2)]
    from nonlinear.ensembles import find_basins

    begun = time.perf_counter()
    basins = find_basins(load("chain-2"), duration, vary=places)
    seconds = time.perf_counter() - begun
    return (
        f"A map of first turns, {size} × {size} starts to {duration:g} s by {basins.ensemble.engine} "
        f"on {os.cpu_count()} cores: {seconds:.0f} s, {basins.ensemble.size / seconds:,.0f} members a second; "
        f"{np.count_nonzero(basins.ensemble.beyond):,} of them end beyond their horizon."
    )


def resident(process: str) -> int:
    """The memory (MB) in which a process lives."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * resource.getpagesize() // 1_000_000


def million(size: int, cores: int = 2) -> str:
    """So many members for ten seconds of motion on some cores: their rate, and memory during the run."""
    starts = np.random.default_rng(0).uniform(-3, 3, (size, 2))
    lived: list[tuple[float, int, int]] = []

    def report(done: float) -> None:
        workers = (resident(str(process.pid)) for process in active_children())
        lived.append((done / size, resident("self"), max(workers, default=0)))

    used = sum(os.times()[:4])
    members = ensemble(
        load("chain-2"), DURATION, starts=starts, measures=["first_turn"], engine="numba", workers=cores, report=report
    )
    seconds = sum(os.times()[:4]) - used
    middle = [min(lived, key=lambda row: abs(row[0] - part)) for part in (0.25, 0.5, 0.75, 0.99)]
    kept = " ".join(f"{100 * part:.0f} %: {parent} and {worker};" for part, parent, worker in middle)
    return (
        f"{members.size:,} members to {DURATION:g} s by {members.engine} in {cores} processes, their first turns kept: "
        f"{size / seconds:,.0f} members a core-second. MB of memory of this process and of the largest worker after "
        f"{kept[:-1]}."
    )


def versions() -> str:
    others = [f"{name} {version(name)}" for name in ("scipy", "numba", "heyoka") if find_spec(name)]
    return f"Python {platform.python_version()}, NumPy {np.__version__}, {', '.join(others)}"


HEAD = """# Benchmarks of ensembles

`OPENBLAS_NUM_THREADS=1 python benchmarks/ensembles.py --map --write`, one run;
{versions}.

Members start at rest from random angles within ±1 rad and run for {duration:g} s. Rates are members per second of
processor time on one thread, which other work on the machine disturbs least. Errors are those of the largest angle at
the end. Our methods use a tolerance of {tolerance:g} and report the energy drift, an error estimate and the
predictability horizon of every member. The other programs use closed formulas for these two scenes with fixed numbers
and report no errors; our methods take any plane scene, with its parameters as arguments. "recursion" omits the
closed formulas of chains of up to six links.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="few members, one scene each, switches without compiling")
    for option in ("--write", "--map"):
        parser.add_argument(option, action="store_true")
    options = parser.parse_args()
    parts = [HEAD.format(versions=versions(), duration=DURATION, tolerance=TOLERANCE)]
    for name in [*SCENES][: 1 if options.quick else None]:
        parts += [f"## {NAMES[name].capitalize()}", table(rows_of(name, options.quick))]
    for name in [*SWITCHING][: 1 if options.quick else None]:
        parts += [f"## {NAMES[name].capitalize()}", switching(name, options.quick)]
    if options.map:
        parts += ["## Many", turns(512, 20.0), million(1_000_000)]
    page = "\n\n".join(part.strip() for part in parts) + "\n"
    print(page)
    print("peak", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, "MB", file=sys.stderr)
    if options.write:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
