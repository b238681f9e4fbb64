"""Motion at large angles by many routes: time against error, cost per link, and the choices of `auto`, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/simulation.py [--quick] [--write]

`--write` puts the tables and the figure into docs/.  An error is the largest of the angles at the end (rad) with
respect to a reference; where two reference routes differ by more, that difference is given instead.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from judge import FORCED, JUDGED, QUICK_JUDGED, judged, takes_series
from modes import markdown
from problems import CART_A_PENDULUM, Problem, chain, on_cart
from rhs import chain as rods
from rhs import microseconds
from routes import DEFAULT, ROUTES, Maker, by_steps, default, forget, numba_body, stepper_of, taylor
from simulation_figure import figure

from nonlinear.dynamics.compiled import Compiled
from nonlinear.integration import Choice, equations_of
from nonlinear.system import system_of

DOCS = Path(__file__).parent.parent / "docs"
REPEATS, LONG, TOO_LONG = 3, 0.7, 1.5  # runs; seconds above which one run suffices; above which no finer one follows
SLACK = 2.0  # factor beyond the errors of a curve up to which its end is used
PEER = 1e-6  # error (rad) at which the first table compares


class Row(NamedTuple):
    """A route at one setting: seconds to prepare at first, median seconds of the run, error (rad)."""

    setting: float
    prepared: float
    seconds: float
    error: float


class Panel(NamedTuple):
    """One problem: the difference of two reference routes (rad), and every route's rows."""

    problem: Problem
    floor: float
    routes: dict[str, list[Row]]


def problems(quick: bool) -> list[Problem]:
    if quick:
        return [on_cart(2, 2.0)]
    return [*(on_cart(n, 10.0) for n in (2, 10, 100)), chain(20, 10.0), chain(100, 10.0)]


# --------------------------------------------------------------------------------------------------- time and error


def differ(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of angles (rad), modulo whole turns."""
    return float(np.max(np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)))


def references(problem: Problem, quick: bool) -> tuple[np.ndarray, np.ndarray]:
    """The finest run available and one to check it, with another body or another integrator."""
    check = default(problem, 1e-13)()
    if takes_series(problem.scene) and not quick:
        return taylor(problem, 1e-15)(), check
    return (numba_body if find_spec("numba") else default)(problem, 3e-14)(), check


def measured(make: Maker, problem: Problem, setting: float, reference: np.ndarray, repeats: int) -> Row:
    prepared, times = [], []
    while len(times) < repeats and not (times and times[0] > LONG):
        start = time.process_time()
        task = make(problem, setting)
        ready = time.process_time()
        angles = task()
        prepared.append(ready - start)
        times.append(time.process_time() - ready)
    return Row(setting, prepared[0], statistics.median(times), differ(angles, reference))


def swept(name: str, problem: Problem, reference: np.ndarray, quick: bool) -> list[Row]:
    rows: list[Row] = []
    for setting in ROUTES[name].settings[:: 2 if quick else 1]:
        if rows and rows[-1].seconds > TOO_LONG:
            break
        rows.append(measured(ROUTES[name].make, problem, setting, reference, 1 if quick else REPEATS))
    return rows


def fits(name: str, problem: Problem) -> bool:
    package = ROUTES[name].package
    if not find_spec(package) or (package == "heyoka" and not takes_series(problem.scene)):
        return False
    return name != "ours, in space" or problem.name == "2 on a cart"


def panel(problem: Problem, quick: bool) -> Panel:
    warm = problem._replace(duration=0.1)
    reference, check = references(problem, quick)
    names = [name for name in ROUTES if fits(name, problem) and not (quick and ROUTES[name].package == "heyoka")]
    for name in names:
        if ROUTES[name].package != "heyoka":
            ROUTES[name].make(warm, ROUTES[name].settings[0])()
    return Panel(problem, differ(reference, check), {name: swept(name, problem, reference, quick) for name in names})


def time_at(rows: Sequence[Row], error: float, floor: float) -> float:
    """Seconds at one error, interpolated linearly on logarithmic axes; NaN outside the range."""
    known = sorted((np.log(row.error), np.log(row.seconds)) for row in rows if row.error > floor)
    if not known or not known[0][0] - np.log(SLACK) <= np.log(error) <= known[-1][0] + np.log(SLACK):
        return float("nan")
    return float(np.exp(np.interp(np.log(error), *zip(*known, strict=True))))


# ------------------------------------------------------------------------------------------------------------ costs


def cost(problem: Problem) -> tuple[str, ...]:
    """Nanoseconds per link of one derivative, microseconds per link of one second, and the number of derivatives."""
    system, calls = system_of(problem.scene), 0
    systems = [equations_of(system, Choice("minimal", "DOP853", False, ""))]
    systems += [Compiled(system)] if find_spec("numba") else []
    each, whole, y = ["-", "-"], ["-", "-"], systems[0].begin(problem.start)
    for at, equations in enumerate(systems):
        each[at] = f"{_three(1e3 * microseconds(partial(equations.derivative, 0.0, y)) / system.n_links)} ns"
        by_steps(equations, problem.start, problem, 1e-6)
        start = time.process_time()
        by_steps(equations, problem.start, problem, 1e-6)
        whole[at] = f"{_three(1e6 * (time.process_time() - start) / system.n_links)} µs"
        stepper = stepper_of(equations, problem.start, problem.duration, 1e-6)
        while stepper.time < problem.duration:
            stepper.step()
        calls = stepper.calls
    return problem.name, *each, *whole, str(calls)


def costs(quick: bool) -> list[tuple[str, ...]]:
    lengths, numbers = ((10,), (10, 100)) if quick else ((10, 100, 1000), (10, 1000, 10_000))
    return [cost(chain(n, 1.0, rods(n))) for n in lengths] + [cost(on_cart(n, 1.0)) for n in numbers]


# ------------------------------------------------------------------------------------------------------------- page


def comparison(panel: Panel) -> str:
    """Every row of one problem, with the time over that of the default at the same error."""
    default, lines = panel.routes[DEFAULT], []
    for name, rows in panel.routes.items():
        for row in rows:
            ratio = row.seconds / time_at(default, max(row.error, panel.floor), panel.floor)
            error = f"{row.error:.0e}" if row.error > panel.floor else f"below {panel.floor:.0e}"
            lines.append((name, f"{row.setting:g}", _time(row.seconds), error, _number(ratio)))
    return markdown(("route", "tolerance or step (s)", "time", "error (rad)", "ratio"), lines)


def overview(panels: Sequence[Panel]) -> str:
    """Milliseconds of every route at the error PEER."""
    lines = []
    for name in ROUTES:
        times = [time_at(panel.routes.get(name, ()), PEER, panel.floor) for panel in panels]
        lines.append((name, *(_time(seconds) for seconds in times)))
    return markdown((f"error {PEER:g} rad", *(panel.problem.name for panel in panels)), lines)


def preparing(panels: Sequence[Panel]) -> str:
    """Seconds of compiling a series, the longest of its settings."""
    series = [(panel.problem.name, panel.routes.get("ours, Taylor")) for panel in panels]
    told = [f"{name} {max(row.prepared for row in rows):.1f} s" for name, rows in series if rows]
    return f"Compiling a Taylor series takes (once a process): {', '.join(told)}." if told else "No Taylor series here."


def _time(seconds: float) -> str:
    return f"{_three(1e3 * seconds)} ms" if np.isfinite(seconds) else "-"


def _three(number: float) -> str:
    """Three digits, thousands without an exponent."""
    return f"{float(f'{number:.3g}'):g}"


def _number(ratio: float) -> str:
    return f"{ratio:.2g}" if np.isfinite(ratio) else "-"


def versions() -> str:
    packages = ("numba", "heyoka", "mujoco", "pin")
    others = [f"{name} {version(name)}" for name in packages if find_spec({"pin": "pinocchio"}.get(name, name))]
    ours = f"Python {platform.python_version()}", f"NumPy {np.__version__}", f"SciPy {scipy.__version__}"
    return ", ".join((*ours, *others))


def page(panels: Sequence[Panel], each: Sequence[Sequence[str]], choices: Sequence[Sequence[str]]) -> str:
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not set")
    scenes = "\n\n".join(
        f"### {panel.problem.name}, {panel.problem.duration:g} s\n\n"
        f"Two reference methods differ by {panel.floor:.0e} rad; no error below that is claimed.\n\n{comparison(panel)}"
        for panel in panels
    )
    return f"""# Benchmarks of the simulator

`OPENBLAS_NUM_THREADS=1 python benchmarks/simulation.py --write`, one run on {os.cpu_count()} cores;
{versions()};
OPENBLAS_NUM_THREADS {threads}. Without this setting the dense methods start threads for matrices that are too small to
benefit, and the times scatter.

![Time against error for five scenes](../pictures/simulation-benchmark.png)

Double rods of 1 m and 1 kg on a cart of {CART_A_PENDULUM:g} kg per pendulum, released straight from angles between 90°
and 45°, alternately to the left and right (two from ±90°, the start of the paper); chains of bobs of 1 kg every 1 m,
released in an arc from 90° at the pivot to 45° at the tip. The error is the largest error of any angle at the end.
Times are processor times, which other work on the machine disturbs least: medians of {REPEATS} runs (one where it takes
over {LONG:g} s), without preparation (building models and compiling). No finer setting is run after one that takes
{TOO_LONG:g} s.

"dense" is the textbook method: SciPy with the full mass matrix, solved by `numpy.linalg.solve` at every call. MuJoCo
uses its own RK4; Pinocchio's `aba` is integrated by the classical Runge–Kutta method written in Python. "heyoka alone"
uses our expressions and goes to the end on its own; "numba alone" is the textbook method with the classical Runge–Kutta
method, all compiled.

## At matched accuracy

Times are interpolated linearly between the settings on logarithmic axes; "-" if a method does not reach this error or
does not apply.

{overview(panels)}

{preparing(panels)}

## Every setting

The ratio is the time over that of "{DEFAULT}" (what a bare install takes) at the same error.

{scenes}

## Cost per link

Chains of rods and double pendula on a cart; DOP853 at 1e-6 for one second.

{markdown(("scene", "derivative", "compiled", "one second", "compiled", "derivatives"), each)}

## What `auto` chooses

Complete calls of `simulate` in separate processes, including the import of compilers and compiling; numba's disk cache
is filled, because it serves every scene, and heyoka's is off, because it serves only the same scene again. The ratio is
the time of `auto` over that of the best of the three.

{markdown(("run", "auto takes", "time", *FORCED, "ratio"), choices)}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one small problem and one choice")
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/simulation.md and the figure")
    options = parser.parse_args()
    forget()
    panels = [panel(problem, options.quick) for problem in problems(options.quick)]
    choices = [judged(key, runs=1) for key in QUICK_JUDGED] if options.quick else [judged(key) for key in JUDGED]
    text = page(panels, costs(options.quick), choices)
    print(text)
    for name, route in ROUTES.items():
        if not find_spec(route.package):
            print(f"{name}: `{route.package}` is not installed.")
    if options.write:
        (DOCS / "benchmarks" / "simulation.md").write_text(text, encoding="utf-8")
        figure(panels, DOCS / "pictures" / "simulation-benchmark.png")


if __name__ == "__main__":
    main()
