"""Equations in floats and as matrices: DOP853's time for one derivative, its steps included, by size of the scene.

    OPENBLAS_NUM_THREADS=1 python benchmarks/forms.py [--quick]

Chains of bobs, and rods on a cart in pendula of two and of five.  From these times come FLOATS and `body_of` of
`nonlinear.integration.methods`.  The rival is the textbook's full matrix under SciPy's DOP853; `chosen` is what a run
takes, and `whole` its call of `simulate` with 1000 samples over that of `solve_ivp`.  Rows are printed as they are
measured; what takes longer than LONG is measured once.

A second table compares Lagrange's, Hamilton's and the maximal form, as paper 002 asks at its end, in the plane and in
space: all by NumPy passes, then what a run chooses.  Of each the time of a derivative over that of Lagrange's passes,
the derivatives of a run at tolerance 1e-9 over Lagrange's, the energy drift and the largest error (rad) against a run
at 1e-13.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from problems import Problem, bobs
from routes import SAMPLES, stepper_of, textbook
from scipy.integrate import solve_ivp

from modal import Cart, InitialCondition, Pendulum, Rod, Scene, load
from nonlinear.dynamics import (
    Banded,
    Generated,
    Hamiltonian,
    Maximal,
    Minimal,
    Recursion,
    Spatial,
    SpatialRecursion,
)
from nonlinear.integration import Choice, Request, equations_of
from nonlinear.simulation import simulate
from nonlinear.system import Equations, State, System, apart, initial_state, system_of

TOLERANCE, DURATION, REPEATS = 1e-6, 1.0, 3
LONG = 1.5  # s of processor time
CHAINS, PAIRS, FIVES = (2, 10, 20, 50, 100, 200), (8, 20, 60, 120, 200), (10, 20, 60, 100, 200)
QUICK = (10, 20)
SECONDS = 5.0  # of motion in every form


def on_cart(links: int, longest: int) -> Scene:
    pendulum = Pendulum(links=[Rod(mass=1.0, length=1.0, count=longest)], count=links // longest)
    return Scene(gravity=9.81, support=Cart(mass=50.0 * links), pendulum=[pendulum])


def microseconds(run: Callable[[], int]) -> float:
    """Median time for one of the derivatives that a run counts, but for that of the first run if another is short."""
    times, spent = list[float](), 0.0
    while len(times) <= REPEATS and spent <= LONG:
        start = time.process_time()
        calls = run()
        spent = time.process_time() - start
        times.append(spent / calls)
    return 1e6 * statistics.median(times[1:] or times)


def stepped(equations: Equations, problem: Problem) -> int:
    stepper = stepper_of(equations, problem.start, DURATION, TOLERANCE)
    while stepper.time < DURATION:
        stepper.sweep(np.array([DURATION]), False) if hasattr(stepper, "sweep") else stepper.step()
    return stepper.calls


def whole(problem: Problem) -> float:
    """The time of `simulate` over that of the textbook, both with samples."""
    choice = Choice("minimal", "DOP853", False, "", TOLERANCE)
    request = Request(problem.scene, system_of(problem.scene), problem.start, np.linspace(0.0, DURATION, SAMPLES))
    ours = microseconds(lambda: bool(request.run(choice)))
    return ours / microseconds(lambda: bool(rival(problem, request.times)()))


def rival(problem: Problem, times: np.ndarray | None = None) -> Callable[[], int]:
    f, on = textbook(problem.scene), int(system_of(problem.scene).cart is not None)
    y = np.concatenate((np.zeros(on), problem.angles, np.zeros(on + len(problem.angles))))
    return lambda: solve_ivp(f, (0.0, DURATION), y, "DOP853", rtol=TOLERANCE, atol=TOLERANCE, t_eval=times).nfev


def bodies(system: System, body: type) -> Equations:
    return Minimal(system, tuple(map(body, system.groups)))


def printed(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table row by row."""
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|", flush=True)
    for each in rows:
        print("| " + " | ".join(each) + " |", flush=True)


def row(name: str, scene: Scene) -> tuple[str, ...]:
    system, links = system_of(scene), scene.n_links
    problem = Problem(name, scene, np.deg2rad(np.linspace(90, 45, links)), DURATION)
    chosen = equations_of(system, Choice("minimal", "DOP853", False, ""))
    forms = [Generated(system), bodies(system, Recursion), bodies(system, Banded), chosen]
    times = [microseconds(lambda form=form: stepped(form, problem)) for form in forms]
    textbooks = microseconds(rival(problem))
    every = *times, textbooks, times[-1] / textbooks, whole(problem)
    return name, str(links), *(f"{number:.3g}" for number in every)


def in_forms(name: str, scene: Scene, seconds: float) -> list[tuple[str, ...]]:
    """A row for every form of a scene; Lagrange's passes are the rival."""
    system, start = system_of(scene), initial_state(scene)
    times = np.linspace(0.0, seconds, 101)
    forms: list[tuple[str, Equations, str]]
    if system.spatial:
        lagrange = Spatial(system, tuple(map(SpatialRecursion, system.groups)))
        forms = [
            ("Lagrange, unit vectors", lagrange, "spatial"),
            ("Hamilton", Hamiltonian(system), "hamiltonian"),
        ]
    else:
        forms = [
            ("Lagrange, angles", Generated(system), "minimal"),
            ("Hamilton", Hamiltonian(system), "hamiltonian"),
        ]
        forms.append(("maximal", Maximal(system), "maximal"))
    forms.append(("chosen", equations_of(system, Choice(forms[0][2], "DOP853", False, "")), forms[0][2]))
    sure = simulate(scene, seconds, output=times, start=start, tolerance=1e-13)
    rows: list[tuple[float, ...]] = []
    for _, equations, form in forms:
        run = simulate(scene, seconds, output=times, start=start, form=form, method="DOP853", tolerance=1e-9)
        error = float(apart(run.motion, sure.motion).max())
        rows.append((derivative_time(equations, start), float(run.run.calls), run.energy_drift(), error))
    first = rows[0]
    return [
        (
            name,
            title,
            f"{time:.3g}",
            f"{time / first[0]:.2f}",
            f"{calls / first[1]:.2f}",
            f"{drift:.1e}",
            f"{error:.1e}",
        )
        for (title, _, _), (time, calls, drift, error) in zip(forms, rows, strict=True)
    ]


def derivative_time(equations: Equations, start: State) -> float:
    """Microseconds of one derivative alone."""
    y, count = equations.begin(start), 200

    def run() -> int:
        for _ in range(count):
            equations.derivative(0.0, y)
        return count

    return microseconds(run)


def started(scene: Scene, angles: Sequence[float], azimuths: Sequence[float] | None = None) -> Scene:
    start = InitialCondition(angles_deg=tuple(angles), azimuths_deg=None if azimuths is None else tuple(azimuths))
    return scene.replace(pendulum=tuple(pendulum.replace(start=start) for pendulum in scene.pendulum))


def chain_in_space(links: int) -> Scene:
    whole = bobs(links).replace(space="space")
    return started(whole, np.linspace(40, 20, links), np.linspace(0, 90, links))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ten and twenty links")
    quick = parser.parse_args().quick
    scenes = [("chain", bobs(n)) for n in (QUICK if quick else CHAINS)]
    scenes += [("pairs on a cart", on_cart(n, 2)) for n in (QUICK if quick else PAIRS)]
    scenes += [("fives on a cart", on_cart(n, 5)) for n in (QUICK if quick else FIVES)]
    forms = "floats (µs)", "recursion", "banded", "chosen", "textbook"
    heads = "scene", "links", *forms, "chosen / textbook", "whole"
    printed(heads, (row(*each) for each in scenes))
    compared = [(f"{n} bobs", started(bobs(n), np.linspace(40, 20, n))) for n in ((2,) if quick else (2, 5, 10))]
    compared += [(f"{n} bobs in space", chain_in_space(n)) for n in ((2,) if quick else (2, 5, 10))]
    if not quick:
        compared.append(("paper's cart, two double rods", load("paper-cart-2")))
    rows = (line for name, scene in compared for line in in_forms(name, scene, 0.5 if quick else SECONDS))
    heads = (
        "scene",
        "form",
        "derivative (µs)",
        "over Lagrange",
        "derivatives over Lagrange's",
        "energy drift",
        "error (rad)",
    )
    print()
    printed(heads, rows)


if __name__ == "__main__":
    main()
