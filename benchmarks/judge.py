"""Whether `auto` chooses well: whole calls of `simulate` compared with forced methods, each in a process of its own.

    python benchmarks/judge.py RUN WAY

prints the seconds of one of them and its method; `benchmarks/simulation.py` makes a table of all.
"""

from __future__ import annotations

import subprocess
import sys
import time
from importlib.util import find_spec

from problems import chain, on_cart
from routes import forget

from modal import Scene
from nonlinear import simulate
from nonlinear.integration import Choice, Request
from nonlinear.integration.taylor import LONGEST_CHAIN, SERIES_LINKS_MAX

FORCED = {
    "default": ("DOP853", False, "numpy"),
    "numba": ("DOP853", True, "numba"),
    "Taylor": ("taylor", False, "heyoka"),
}
JUDGED = {
    "2 on a cart, 10 s at 1e-6": (on_cart(2, 10.0), 1e-6),
    "2 on a cart, 100 s at 1e-9": (on_cart(2, 100.0), 1e-9),
    "100 on a cart, 10 s at 1e-9": (on_cart(100, 10.0), 1e-9),
    "chain of 20, 60 s at 1e-12": (chain(20, 60.0), 1e-12),
    "chain of 100, 10 s at 1e-6": (chain(100, 10.0), 1e-6),
}
QUICK_JUDGED = ("2 on a cart, 10 s at 1e-6",)


def report(key: str, way: str) -> None:
    """Print the seconds of `simulate`, including imports and compilation, and the choice."""
    problem, tolerance = JUDGED[key]
    forget()
    if way != "auto":
        method, compiled, _ = FORCED[way]
        Request.choice = lambda _, tolerance: Choice("minimal", method, compiled, "", tolerance)  # type: ignore[method-assign]
    start = time.process_time()
    run = simulate(problem.scene, problem.duration, tolerance=tolerance, start=problem.start).run
    seconds = time.process_time() - start
    body = "Taylor" if run.method == "taylor" else "numba" if "compiled" in run.reason else "default"
    print(seconds, body if run.method in {"taylor", "DOP853"} else run.method)


def fresh(key: str, way: str, runs: int) -> tuple[float, str]:
    """Seconds (the best of some, the first of which may fill the compiler's cache) in processes of their own."""
    command = [sys.executable, __file__, key, way]
    answers = [subprocess.run(command, capture_output=True, text=True, check=True).stdout.split() for _ in range(runs)]
    return min(float(answer[0]) for answer in answers), answers[0][1]


def judged(key: str, *, runs: int = 2) -> tuple[str, ...]:
    scene = JUDGED[key][0].scene
    ways = [way for way, (_, _, package) in FORCED.items() if find_spec(package)]
    forced = {way: fresh(key, way, runs)[0] for way in ways if way != "Taylor" or takes_series(scene)}
    seconds, chosen = fresh(key, "auto", runs)
    times = [f"{forced[way]:.2f} s" if way in forced else "-" for way in FORCED]
    return key, chosen, f"{seconds:.2f} s", *times, f"{seconds / min(forced.values()):.2f}"


def takes_series(scene: Scene) -> bool:
    return (
        bool(find_spec("heyoka")) and scene.pendulum[0].n_links <= LONGEST_CHAIN and scene.n_links <= SERIES_LINKS_MAX
    )


if __name__ == "__main__":
    report(*sys.argv[1:])
