"""Natural frequencies beside `scipy.linalg.eigh(K, M)`: time, memory and error in one run.

    python benchmarks/modes.py [--quick] [--write]

`--write` puts the tables and the figure into docs/.  Errors are bounds from the count of frequencies below ω, taken in
many digits: a mode is within τ of the truth if the count steps between ω(1 − τ) and ω(1 + τ).
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import mpmath as mp
import numpy as np
import scipy
from scipy.linalg import LinAlgError, eigh

from modal import Bob, Cart, Pendulum, Rod, Scene, load, matrices, natural_modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOCS = Path(__file__).parent.parent / "docs"
LENGTHS = (2, 5, 10, 20, 50, 100, 200, 500, 1000)
RATIOS = tuple(10.0**k for k in (0, 2, 4, 6, 8, 10, 12, 16))
SAMPLED = 6


class Solved(NamedTuple):
    """One solver on one scene: seconds, peak MB of arrays, ω, and worst relative error of ω."""

    seconds: float
    megabytes: float
    omega: np.ndarray
    error: float


class Row(NamedTuple):
    """Both solvers at one setting."""

    setting: float
    ours: Solved
    theirs: Solved


# ------------------------------------------------------------------------------------------------------ errors


def count_below(scene: Scene, omega: mp.mpf) -> int:
    """Frequencies of one chain below ω, by the effective mass in many digits."""
    links = [link for link in scene.pendulum[0].links for _ in range(link.count)]
    x, mu, below, hanging = omega**2, mp.mpf(0), 0, mp.mpf(0)
    for link in reversed(links):
        m, l = mp.mpf(link.mass), mp.mpf(link.length)
        s, J = (mp.mpf(1), mp.mpf(0)) if isinstance(link, Bob) else (mp.mpf(1) / 2, m / 12)
        t = x * l / (mp.mpf(scene.gravity) * (m * s + hanging))
        D = 1 - t * (m * s**2 + J + mu)
        mu = ((1 - t * (m * (1 - s) ** 2 + J)) * mu + m * (1 - t * J)) / D
        below, hanging = below + (D < 0), hanging + m
    return below


def worst_error(scene: Scene, omega: np.ndarray) -> float:
    """Smallest τ = 1e-16 · 2^k that holds for each of a sample of modes, the largest of them."""
    chosen = np.unique(np.linspace(0, len(omega) - 1, SAMPLED).astype(int))
    return max(error_of(scene, int(j), float(omega[j])) for j in chosen)


def error_of(scene: Scene, j: int, omega: float) -> float:
    if not omega > 0:
        return 1.0
    tau = 1e-16
    while tau < 1:
        low, high = (mp.mpf(omega) * (1 + sign * mp.mpf(tau)) for sign in (-1, 1))
        if count_below(scene, low) <= j < count_below(scene, high):
            return tau
        tau *= 2
    return 1.0


# ----------------------------------------------------------------------------------------------------- solvers


def measured(solve: Callable[[], np.ndarray], scene: Scene, repeats: int) -> Solved:
    tracemalloc.start()
    omega = solve()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        solve()
        times.append(time.perf_counter() - start)
    return Solved(statistics.median(times), peak, omega, worst_error(scene, omega))


def dense_omega(scene: Scene) -> np.ndarray:
    found = matrices(scene)
    try:
        square = eigh(found.K, found.M, eigvals_only=True)
    except LinAlgError:
        return np.full(len(found.K), np.nan)
    return np.sqrt(np.where(square > 0, square, np.nan))


def compared(setting: float, scene: Scene) -> Row:
    repeats = 3 if scene.n_links <= 200 else 1
    ours = measured(lambda: natural_modes(scene).omega, scene, repeats)
    return Row(setting, ours, measured(lambda: dense_omega(scene), scene, repeats))


def by_length(lengths: Sequence[int]) -> list[Row]:
    mp.mp.dps = 50
    return [
        compared(n, Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=n)])]))
        for n in lengths
    ]


def by_ratio() -> list[Row]:
    mp.mp.dps = 250
    chains = {ratio: [Bob(mass=ratio ** (-(k % 2)), length=1.0) for k in range(10)] for ratio in RATIOS}
    return [compared(r, Scene(gravity=9.81, pendulum=[Pendulum(links=links)])) for r, links in chains.items()]


# ------------------------------------------------------------------------------------------------------- costs


def on_cart(pendula: Sequence[Pendulum]) -> Scene:
    return Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=pendula)


def different(number: int) -> Scene:
    lengths = np.random.default_rng(1).uniform(0.9, 1.1, number)
    return on_cart([Pendulum(links=(Bob(mass=1.0, length=float(l)),)) for l in lengths])


COSTS: dict[str, tuple[Callable[[], Scene], float]] = {
    "1,000 rods in one chain": (lambda: load("rope"), 1.0),
    "100,000 identical double pendula": (
        lambda: on_cart([Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),), count=100_000)]),
        0.05,
    ),
    "1,000 different pendula": (lambda: load("thousand-pendula"), 0.1),
    "100,000 different pendula": (lambda: different(100_000), 20.0),
}


def cost(name: str) -> tuple[str, str, str, str]:
    """Name, time, peak memory of the whole process and the promised time, measured in a fresh process."""
    command = [sys.executable, __file__, "--cost", name]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return name, f"{float(text[0]):.3f} s", f"{float(text[1]):.0f} MB", f"{COSTS[name][1]:g} s"


def report(name: str) -> None:
    """Print seconds for all frequencies and the resident memory they added, in MB."""
    import resource

    scene = COSTS[name][0]()
    unit = 1024 if sys.platform != "darwin" else 1024**2
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    natural_modes(scene).omega.sum()
    seconds = time.perf_counter() - start
    print(seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / unit)


def start_ratio() -> float:
    """Median time of `multipendula table chain-3` over that of `python -c "import numpy"`, in pairs."""

    def timed(*words: str) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, *words], capture_output=True, check=True)
        return time.perf_counter() - start

    pairs = [(timed("-m", "multipendula", "table", "chain-3"), timed("-c", "import numpy")) for _ in range(9)]
    return statistics.median(a / b for a, b in pairs)


# -------------------------------------------------------------------------------------------------------- page


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    from tabulate import tabulate

    return tabulate(rows, headings, tablefmt="github", disable_numparse=True, stralign="right")


def comparison(name: str, rows: Sequence[Row]) -> str:
    headings = (name, "time", "eigh", "ratio", "memory", "eigh", "error", "eigh")
    return markdown(headings, [_line(row) for row in rows])


def _line(row: Row) -> tuple[str, ...]:
    a, b = row.ours, row.theirs
    lost = int(np.sum(~(b.omega > 0)))
    return (
        f"{row.setting:g}",
        *(f"{s.seconds * 1e3:.2f} ms" for s in (a, b)),
        f"{a.seconds / b.seconds:.2g}",
        *(f"{s.megabytes:.2f} MB" for s in (a, b)),
        f"{a.error:.0e}",
        f"{b.error:.0e}" + (f" ({lost} of {len(b.omega)} with ω² ≤ 0)" if lost else ""),
    )


def page(lengths: Sequence[Row], ratios: Sequence[Row], costs: Sequence[Sequence[str]], ratio: float) -> str:
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}"
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    return f"""# Benchmarks

`OPENBLAS_NUM_THREADS=1 python benchmarks/modes.py --write`, one run on {os.cpu_count()} cores; {versions};
OPENBLAS_NUM_THREADS {threads}. The rival is `scipy.linalg.eigh(K, M)`, faster on one thread at all these sizes; its
time includes building K and M, ours the same scene. Memory is the peak of arrays during the call. Errors are upper
bounds for the worst of {SAMPLED} modes, by counts in many digits.

## A chain of n equal rods

{comparison("n", lengths)}

## Ten bobs of alternating masses 1 and 1/ratio

{comparison("ratio", ratios)}

## What the project promises

All frequencies, each scene in a process of its own; memory is what the computation added to it.

{markdown(("on one cart, or alone", "time", "memory", "at most"), costs)}

`multipendula table chain-3` takes {ratio:.2f} times as long as `python -c "import numpy"` (promised: under 3).
"""


def figure(lengths: Sequence[Row], ratios: Sequence[Row], path: Path) -> None:
    from modal.plotting import Picture, in_both_themes, sheet

    def draw() -> Picture:
        made = sheet(12, 3.9)
        _panels(made.subplots(1, 3), lengths, ratios)
        made.suptitle("Effective mass beside a dense eigensolver")
        return made

    in_both_themes(draw, path)


def _panels(axes: Sequence[Axes], lengths: Sequence[Row], ratios: Sequence[Row]) -> None:
    _curves(axes[0], lengths, "seconds", "links in a chain of rods (–)", "time for all frequencies (s)")
    _curves(axes[1], lengths, "error", "links in a chain of rods (–)", "worst relative error of ω (–)")
    _curves(axes[2], ratios, "error", "mass ratio in a chain of ten bobs (–)", "worst relative error of ω (–)")
    axes[0].legend()


def _curves(axis: Axes, rows: Sequence[Row], what: str, across: str, up: str) -> None:
    from modal.plotting import colour

    for name, solver, k, mark in (
        ("multipendula", "ours", 0, "o"),
        ("scipy.linalg.eigh(K, M)", "theirs", 1, "s"),
    ):
        values = [getattr(getattr(row, solver), what) for row in rows]
        axis.loglog([row.setting for row in rows], values, mark + "-", color=colour(k), label=name)
    axis.set(xlabel=across, ylabel=up)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 100 links, without the longest cost")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/modes.md and the figure")
    parser.add_argument("--cost", choices=COSTS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.cost:
        report(options.cost)
        return
    lengths = by_length([n for n in LENGTHS if n <= 100 or not options.quick])
    ratios = by_ratio()
    costs = [cost(name) for name in COSTS if not (options.quick and name == "100,000 different pendula")]
    text = page(lengths, ratios, costs, start_ratio())
    print(text)
    if options.write:
        (DOCS / "benchmarks" / "modes.md").write_text(text, encoding="utf-8")
        figure(lengths, ratios, DOCS / "pictures" / "benchmark.png")


if __name__ == "__main__":
    main()
