"""Equations in floats and as matrices: DOP853's time for one derivative, its steps included, by size of the scene.

    OPENBLAS_NUM_THREADS=1 python benchmarks/forms.py [--quick]

Chains of bobs, and rods on a cart in pendula of two and of five.  From these times come FEWEST, CHAINS and PAIRS of
`nonlinear.integration.methods`.  The rival is the textbook's full matrix under SciPy's DOP853; `chosen` is what a run
takes, and `whole` its call of `simulate` with 1000 samples over that of `solve_ivp`.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from problems import Problem, bobs
from routes import SAMPLES, stepper_of, textbook
from scipy.integrate import solve_ivp

from modal import Cart, Pendulum, Rod, Scene
from nonlinear.dynamics import Banded, Dense, Generated, Minimal, Small
from nonlinear.integration import Choice, Request, equations_of
from nonlinear.system import Equations, System, system_of

TOLERANCE, DURATION, REPEATS = 1e-6, 1.0, 3
CHAINS, PAIRS, FIVES = (2, 8, 10, 12, 16, 20, 32, 60, 120), (8, 16, 20, 24, 32, 60, 120), (10, 15, 20, 60, 100)
QUICK = (10, 20)


def on_cart(links: int, longest: int) -> Scene:
    pendulum = Pendulum(links=[Rod(mass=1.0, length=1.0, count=longest)], count=links // longest)
    return Scene(gravity=9.81, support=Cart(mass=50.0 * links), pendulum=[pendulum])


def microseconds(run: Callable[[], int]) -> float:
    """Median time for one of the derivatives that a run counts."""
    run()
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        calls = run()
        times.append((time.process_time() - start) / calls)
    return 1e6 * statistics.median(times)


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


def row(name: str, scene: Scene) -> tuple[str, ...]:
    system, links = system_of(scene), scene.n_links
    problem = Problem(name, scene, np.deg2rad(np.linspace(90, 45, links)), DURATION)
    chosen = equations_of(system, Choice("minimal", "DOP853", False, ""))
    forms = [Generated(system), Small(system), bodies(system, Dense), bodies(system, Banded), chosen]
    times = [microseconds(lambda form=form: stepped(form, problem)) for form in forms]
    textbooks = microseconds(rival(problem))
    every = *times, textbooks, times[-1] / textbooks, whole(problem)
    return name, str(links), *(f"{number:.3g}" for number in every)


def main() -> None:
    from tabulate import tabulate

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ten and twenty links")
    quick = parser.parse_args().quick
    scenes = [("chain", bobs(n)) for n in (QUICK if quick else CHAINS)]
    scenes += [("pairs on a cart", on_cart(n, 2)) for n in (QUICK if quick else PAIRS)]
    scenes += [("fives on a cart", on_cart(n, 5)) for n in (QUICK if quick else FIVES)]
    forms = "floats (µs)", "one matrix", "dense", "banded", "chosen", "textbook"
    heads = "scene", "links", *forms, "chosen / textbook", "whole"
    print(tabulate([row(*each) for each in scenes], heads, tablefmt="github", disable_numparse=True))


if __name__ == "__main__":
    main()
