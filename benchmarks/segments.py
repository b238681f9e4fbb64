"""Derivatives for a fit of 8 and of 200 segments, against SciPy's DOP853 and differences, one motion at a time.

    python benchmarks/segments.py [--segments 8 200]

Both have the same residuals, unknowns (numbers, and the initial state of every segment) and tolerance.  The rival is
what is written by hand: `solve_ivp` for every motion and for every forward difference of it, as
`scipy.optimize.least_squares` takes them.  A difference by a state moves only its own segment, so that one segment
needs 1 + numbers + states motions.  It has the toolkit's own equations in floats; with dry friction it has no rival,
because `solve_ivp` does not end its steps where a joint sticks.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from modal.identification import find_parameters
from modal.scene import Scene, scene_from
from modal.types import Floats
from nonlinear.dynamics import Generated
from nonlinear.identification import Recording, Segment, Sensor
from nonlinear.identification.problem import FitProblem
from nonlinear.system import system_of

TOLERANCE, ROUNDS, DIFFERENCE, SEED = 1e-9, 5, 1e-6, 1
TIMES = np.arange(0, 3, 0.02)
LINKS = [
    {"kind": "bob", "mass": 1.0, "length": 0.5, "damping": 0.01},
    {"kind": "rod", "mass": 0.5, "length": 0.4, "damping": 0.02},
]
FREE = ("length", "damping")


def problem_of(links: list[dict[str, Any]], free: tuple[str, ...], segments: int) -> tuple[FitProblem, Floats]:
    """A problem of so many segments, and unknowns."""
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": links}]})
    blank = [Segment("synthetic", str(s), TIMES, np.zeros((len(TIMES), 2))) for s in range(segments)]
    recording = Recording((Sensor(1, 1), Sensor(1, 2)), tuple(blank))
    parameters = find_parameters(scene, [f"pendulum[0].links[*].{name}" for name in free])
    problem = FitProblem(scene, parameters, recording, np.ones(2), tolerance=TOLERANCE)
    u, rng = np.zeros(problem.layout.size), np.random.default_rng(SEED)
    u[: problem.layout.numbers] = [parameter.start for parameter in parameters]
    for s in range(segments):
        u[problem.layout.state(s)] = np.concatenate((rng.normal(0, 0.4, 2), np.zeros(2)))
    return problem, u


def by_differences(problem: FitProblem, u: Floats) -> list[Floats]:
    """The derivatives of every segment by the numbers and by its own state, (1 + k, C, K)."""
    slopes, numbers = [], problem.layout.numbers
    for s in range(len(problem.recording.segments)):
        unknowns = np.concatenate((u[:numbers], u[problem.layout.state(s)]))
        motions = [_motion(problem, unknowns)]
        for k in range(len(unknowns)):
            beside = unknowns.copy()
            beside[k] += DIFFERENCE
            motions.append((_motion(problem, beside) - motions[0]) / DIFFERENCE)
        slopes.append(np.array(motions))
    return slopes


def _motion(problem: FitProblem, unknowns: Floats) -> Floats:
    scene: Scene = problem.scene_at(unknowns)
    rate = Generated(system_of(scene), counts_work=False).rate
    times = TIMES + problem.late
    begun = unknowns[problem.layout.numbers :]
    run = solve_ivp(
        lambda t, y: rate(y.tolist()), (0, times[-1]), begun, "DOP853", times, rtol=TOLERANCE, atol=TOLERANCE
    )
    return np.asarray(run.y[:2])


def seconds(work: Callable[[], object]) -> float:
    """The median of the processor's time (s)."""
    spent = []
    for _ in range(ROUNDS):
        begun = process_time()
        work()
        spent.append(process_time() - begun)
    return median(spent)


def main() -> None:
    """Print seconds and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--segments", type=int, nargs="+", default=[8, 200])
    rubbing = [{**link, "friction": 0.02} for link in LINKS]
    for segments in parser.parse_args().segments:
        problem, u = problem_of(LINKS, FREE, segments)
        told = _fresh(problem, u)
        begun = process_time()
        rival = by_differences(problem, u)
        other = process_time() - begun
        values = told.reshape(segments, len(TIMES), 2, -1)[..., : problem.layout.numbers]
        apart = max(
            float(np.abs(values[s].transpose(2, 1, 0) - slopes[1 : 1 + problem.layout.numbers]).max())
            for s, slopes in enumerate(rival)
        )
        spent = seconds(lambda problem=problem, u=u: _fresh(problem, u))
        dry, v = problem_of(rubbing, ("friction", "damping"), segments)
        rubbed = seconds(lambda problem=dry, u=v: _fresh(problem, u))
        print(f"{segments} segments: {spent:.3f} s")
        print(f"  SciPy {other / spent:.0f} times as long, its differences off by {apart:.1e}")
        print(f"  with dry friction {rubbed:.3f} s, {rubbed / spent:.1f} times those without")


def _fresh(problem: FitProblem, u: Floats) -> Floats:
    """The Jacobian, computed anew."""
    problem.evaluations.clear()
    return problem.jacobian(u)


if __name__ == "__main__":
    main()
