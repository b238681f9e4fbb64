"""Natural frequencies compared with the best that NumPy and SciPy can do: time, memory and error in one run.

The rival fills A and b by arrays, eliminates the free cart, scales by gravity and calls `scipy.linalg.eigh` for
eigenvalues alone: its time is that from numbers to frequencies, ours that from a `Scene` to `Modes`.

    python benchmarks/modes.py [--quick] [--write]

`--write` puts the tables and the figure into docs/.  Errors are bounds from the count of frequencies below ω, computed
in many digits: a mode is within τ of the true value if the count steps between ω(1 − τ) and ω(1 + τ).
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
from scipy.linalg import eigh

from modal import Bob, Cart, Pendulum, Rod, Scene, load, matrices, natural_frequencies, natural_modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOCS = Path(__file__).parent.parent / "docs"
LENGTHS = (2, 5, 10, 20, 50, 100, 200, 500, 1000)
RIVAL = "eigh"
ROUNDS, SCENES = 5, 2000
RATIOS = tuple(10.0**k for k in (0, 2, 4, 6, 8, 10, 12, 16))
SAMPLED = 6


class Solved(NamedTuple):
    """One solver on one scene: CPU seconds, ratio to the rival's, peak MB of arrays, ω, its worst relative error."""

    seconds: float
    ratio: float
    megabytes: float
    omega: np.ndarray
    error: float


class Row(NamedTuple):
    """All solvers at one setting, by name."""

    setting: float
    solved: dict[str, Solved]


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
    return below + (scene.support.mass + mu > 0) - 1 if isinstance(scene.support, Cart) else below


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


def numbers_of(scene: Scene) -> tuple[np.ndarray, ...]:
    """Mass, length, centre and inertia (n,) of the scene's one chain."""
    links = [link for link in scene.pendulum[0].links for _ in range(link.count)]
    return tuple(np.array([getattr(link, name) for link in links]) for name in ("mass", "length", "centre", "inertia"))


def by_eigh(numbers: tuple[np.ndarray, ...], cart: float | None, gravity: float) -> np.ndarray:
    """ω of one chain, on a cart of this mass or a fixed support."""
    m, l, c, inertia = numbers
    below = np.concatenate([np.cumsum(m[:0:-1])[::-1], [0.0]])
    b = m * c + l * below
    A = np.outer(b, l)
    np.fill_diagonal(A, inertia + m * c * c + l * l * below)
    if cart is not None:
        A -= np.outer(b, b) / (cart + m.sum())
    scale = 1 / np.sqrt(b)
    A *= scale
    A *= scale[:, None]
    inverse = eigh(A, eigvals_only=True, lower=True, overwrite_a=True, check_finite=False)
    return np.sqrt(gravity / np.where(inverse > 0, inverse, np.nan))[::-1]


def solvers(scene: Scene) -> dict[str, Callable[[], np.ndarray]]:
    numbers, cart = numbers_of(scene), scene.support.mass if isinstance(scene.support, Cart) else None
    return {
        RIVAL: lambda: by_eigh(numbers, cart, scene.gravity),
        "all digits": lambda: natural_modes(scene).omega,
        "to 1e-8": lambda: natural_modes(scene, accuracy=1e-8).omega,
    }


def timed(each: dict[str, Callable[[], np.ndarray]]) -> dict[str, tuple[float, float]]:
    """Median CPU seconds of a call, and their ratio to the rival's, in rounds in which each has its turn."""
    counts = {}
    for name, solve in each.items():
        solve()
        start = time.process_time()
        solve()
        counts[name] = max(1, int(0.02 / max(time.process_time() - start, 1e-6)))
    rounds = []
    for _ in range(ROUNDS):
        taken = {}
        for name, solve in each.items():
            start = time.process_time()
            for _ in range(counts[name]):
                solve()
            taken[name] = (time.process_time() - start) / counts[name]
        rounds.append(taken)
    return {
        name: (
            statistics.median(taken[name] for taken in rounds),
            statistics.median(taken[name] / taken[RIVAL] for taken in rounds),
        )
        for name in each
    }


def peak(solve: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    tracemalloc.start()
    omega = solve()
    megabytes = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return omega, megabytes


def solved(scene: Scene) -> dict[str, Solved]:
    """By all solvers; oscillatory modes alone."""
    solutions = {}
    each = solvers(scene)
    for name, (seconds, ratio) in timed(each).items():
        omega, megabytes = peak(each[name])
        omega = omega[omega != 0]
        solutions[name] = Solved(seconds, ratio, megabytes, omega, worst_error(scene, omega))
    return solutions


def rows_of(scenes: dict[float, Scene]) -> list[Row]:
    return [Row(setting, solved(scene)) for setting, scene in scenes.items()]


def chain(n: int) -> Scene:
    rods = Pendulum(links=[Rod(mass=1.0, length=1.0, count=n)])
    return Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=[rods])


def uneven(ratio: float) -> Scene:
    return Scene(
        gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=ratio ** (-(k % 2)), length=1.0) for k in range(10)])]
    )


def small() -> list[tuple[str, ...]]:
    """One scene of few links: ours from a `Scene`, the rival's from K and M that are there already."""
    rows = []
    for n in (2, 10):
        scene = chain(n)
        M, K = matrices(scene).M, matrices(scene).K
        each: dict[str, Callable[[], np.ndarray]] = {
            RIVAL: lambda M=M, K=K: eigh(K, M, eigvals_only=True),
            "natural_frequencies": lambda scene=scene: natural_frequencies(scene),
            "natural_modes": lambda scene=scene: natural_modes(scene).omega,
        }
        spent = timed(each)
        times = (f"{1e6 * spent[name][0]:.0f} µs" for name in each)
        rows.append((str(n), *times, *(f"{spent[name][1]:.1f}" for name in list(each)[1:])))
    return rows


def few() -> tuple[str, ...]:
    """The first three modes of a thousand rods, and all of them."""
    scene = chain(1000)
    times = timed(
        {RIVAL: lambda: natural_modes(scene).omega, "few": lambda: natural_modes(scene, modes=slice(3)).omega}
    )
    return f"{1e3 * times['few'][0]:.1f} ms", f"{1e3 * times[RIVAL][0]:.0f} ms"


def stack_of(arrays: Sequence[tuple[np.ndarray, ...]], cart: float) -> np.ndarray:
    """K^−½ M K^−½ (S, n, n) of chains on a cart, its momentum taken out, with g = 1."""
    made = []
    for m, l, c, inertia in arrays:
        below = np.concatenate([np.cumsum(m[:0:-1])[::-1], [0.0]])
        b = m * c + l * below
        A = np.outer(b, l)
        np.fill_diagonal(A, inertia + m * c * c + l * l * below)
        A -= np.outer(b, b) / (cart + m.sum())
        made.append(A / np.sqrt(b) / np.sqrt(b)[:, None])
    return np.array(made)


def many(n: int) -> tuple[str, ...]:
    """Scenes of n different rods on a cart: arrays of numbers against NumPy's stack of matrices, already built.

    Lists of scenes against the loop over `eigh` that makes its matrices.
    """
    numbers = np.random.default_rng(1).uniform(0.5, 2.0, (SCENES, n, 2))
    scenes = [on_cart([Pendulum(links=[Rod(mass=float(m), length=float(l)) for m, l in pairs])]) for pairs in numbers]
    places = {
        f"pendulum[0].links[{k}].{name}": np.ascontiguousarray(numbers[:, k, column])
        for k in range(n)
        for column, name in enumerate(("mass", "length"))
    }
    arrays = [numbers_of(scene) for scene in scenes]
    stack = stack_of(arrays, 100.0)
    by_stack = timed(
        {
            RIVAL: lambda: np.linalg.eigvalsh(stack),
            "all": lambda: natural_frequencies(scenes[0], vary=places),
            "rough": lambda: natural_frequencies(scenes[0], 1e-8, vary=places),
        }
    )
    by_loop = timed(
        {
            RIVAL: lambda: np.array([by_eigh(pairs, 100.0, 9.81) for pairs in arrays]),
            "list": lambda: natural_frequencies(scenes),
        }
    )
    exact = natural_frequencies(scenes[0], vary=places)[:, 1:]
    error = np.abs(np.sqrt(9.81 / np.linalg.eigvalsh(stack)[:, ::-1]) / exact - 1).max()
    return (
        str(n),
        f"{1e3 * by_stack[RIVAL][0]:.2f} ms",
        *(f"{1e3 * by_stack[name][0]:.2f} ms ({by_stack[name][1]:.2f})" for name in ("all", "rough")),
        f"{1e3 * by_loop['list'][0]:.0f} ms ({by_loop['list'][1]:.2f})",
        f"{error:.0e}",
    )


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


def alone(words: Sequence[str]) -> list[str]:
    """The output of a fresh process of this file."""
    command = [sys.executable, __file__, *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip().split("\t")


def cost(name: str) -> tuple[str, str, str, str]:
    """Name, time, peak memory of the whole process and the promised time, measured in a fresh process."""
    text = alone(["--cost", name])
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
    print(seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / unit, sep="\t")


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
    names = [RIVAL, *(each for each in rows[0].solved if each != RIVAL)]
    headings = (
        name,
        *names,
        *(f"{each} / eigh" for each in names[1:]),
        "MB",
        "MB eigh",
        *(f"error {each}" for each in names),
    )
    return markdown(headings, [_line(row, names) for row in rows])


def _line(row: Row, names: Sequence[str]) -> tuple[str, ...]:
    solutions = [row.solved[name] for name in names]
    lost = int(np.sum(~(solutions[0].omega > 0)))
    errors = [f"{solution.error:.0e}" for solution in solutions]
    errors[0] += f" ({lost} of {len(solutions[0].omega)} with ω² ≤ 0)" if lost else ""
    return (
        f"{row.setting:g}",
        *(f"{solution.seconds * 1e3:.3g} ms" for solution in solutions),
        *(f"{solution.ratio:.2g}" for solution in solutions[1:]),
        f"{solutions[1].megabytes:.2f}",
        f"{solutions[0].megabytes:.2f}",
        *errors,
    )


def page(
    lengths: Sequence[Row],
    ratios: Sequence[Row],
    together: Sequence[Sequence[str]],
    alone_rows: Sequence[Sequence[str]],
    some: Sequence[str],
    costs: Sequence[Sequence[str]],
    ratio: float,
) -> str:
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}"
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    return f"""# Benchmarks

`OPENBLAS_NUM_THREADS=1 python benchmarks/modes.py --write`, one run on {os.cpu_count()} cores; {versions};
OPENBLAS_NUM_THREADS {threads}. CPU time of whole calls, from a scene to its frequencies: with every digit and to a
relative error of 1e-8. The comparison, "eigh", is the best that NumPy and SciPy offer: A and b as scaled arrays, the
free cart eliminated, and `scipy.linalg.eigh` for the eigenvalues alone; its time starts from arrays of numbers. Ratios
are medians over {ROUNDS} rounds in which the methods alternate. MB is the peak memory of arrays during the call. Errors
are upper bounds for the worst of {SAMPLED} modes, by multiprecision eigenvalue counts.

## A chain of n equal rods on a cart of 100 kg

{comparison("n", lengths)}

## Ten bobs of alternating masses 1 and 1/ratio

{comparison("ratio", ratios)}

## One scene of few rods on a cart

`scipy.linalg.eigh(K, M)` is given the matrices; our functions start from a `Scene`. In brackets: the ratio to eigh.

{markdown(("n", "eigh", "natural_frequencies", "natural_modes", "(frequencies)", "(modes)"), alone_rows)}

The first three modes of a thousand rods take {some[0]}, all of them {some[1]}.

## {SCENES:,} scenes of n different rods on a cart

`natural_frequencies(scene, vary={{…}})` compared with `np.linalg.eigvalsh` for an existing stack of matrices, and a
list of scenes compared with a loop over `eigh`; in brackets the ratio of the times.

{markdown(("n", "eigvalsh of the stack", "every digit", "to 1e-8", "list, every digit", "error of eigvalsh"), together)}

## Limits on computing time

All frequencies, each scene in a separate process; memory is the increase due to the computation.

{markdown(("on one cart, or alone", "time", "memory", "at most"), costs)}

`multipendula table chain-3` takes {ratio:.2f} times as long as `python -c "import numpy"` (promised: at most 2.3).
"""


def figure(lengths: Sequence[Row], ratios: Sequence[Row], path: Path) -> None:
    from modal.plotting import Picture, in_both_themes, sheet

    def draw() -> Picture:
        made = sheet(12, 3.9)
        _panels(made.subplots(1, 3), lengths, ratios)
        made.suptitle("Effective mass compared with a dense eigensolver")
        return made

    in_both_themes(draw, path)


def _panels(axes: Sequence[Axes], lengths: Sequence[Row], ratios: Sequence[Row]) -> None:
    _curves(axes[0], lengths, "seconds", "links in a chain of rods (–)", "CPU time for all frequencies (s)")
    _curves(axes[1], lengths, "error", "links in a chain of rods (–)", "worst relative error of ω (–)")
    _curves(axes[2], ratios, "error", "mass ratio in a chain of ten bobs (–)", "worst relative error of ω (–)")
    axes[0].legend()


def _curves(axis: Axes, rows: Sequence[Row], what: str, across: str, up: str) -> None:
    from modal.plotting.style import colour

    for k, (name, mark) in enumerate(zip(rows[0].solved, "so^v", strict=False)):
        values = [getattr(row.solved[name], what) for row in rows]
        label = "scipy.linalg.eigh" if name == RIVAL else f"multipendula, {name}"
        axis.loglog([row.setting for row in rows], values, mark + "-", color=colour(k), label=label)
    axis.set(xlabel=across, ylabel=up)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 20 links, few ratios and costs")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/modes.md and the figure")
    parser.add_argument("--many", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--cost", choices=COSTS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.cost:
        report(options.cost)
        return
    if options.many:
        print(*many(options.many), sep="\t")
        return
    alone_rows, some = small(), few()
    mp.mp.dps = 50
    lengths = rows_of({n: chain(n) for n in LENGTHS if n <= 20 or not options.quick})
    mp.mp.dps = 250
    ratios = rows_of({ratio: uneven(ratio) for ratio in RATIOS[:: 3 if options.quick else 1]})
    together = [alone(["--many", str(n)]) for n in (2, 10) if not options.quick]
    costs = [cost(name) for name in [*COSTS][: 1 if options.quick else None]]
    text = page(lengths, ratios, together, alone_rows, some, costs, start_ratio())
    print(text)
    if options.write:
        (DOCS / "benchmarks" / "modes.md").write_text(text, encoding="utf-8")
        figure(lengths, ratios, DOCS / "pictures" / "benchmark.png")


if __name__ == "__main__":
    main()
