"""Times of four fits, against SciPy's `least_squares` with differences and `solve_ivp`, from the same start.

    python benchmarks/fits.py [CASE …] [--no-rival]

`torques`: two dampers of an arm that two records of 500 samples a second turn, from 0.6 s in 30 rows; `dry`: the same
with dry friction, which has no rival, because `solve_ivp` does not end its steps where a joint sticks; `longer`: the
first from 1.5 s in 75 rows; `swing`: two lengths and two dampers of a free double pendulum from 1,437 rows.  All
records are synthetic, with noise.  The rival has the toolkit's equations in floats, and the same unknowns: numbers,
offsets, a delay and the initial state.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from modal.identification import find_parameters
from modal.scene import Scene, scene_from
from modal.types import Floats
from nonlinear.dynamics import Generated
from nonlinear.identification import Fit, Recording, Segment, Sensor, fit
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.starting import initial_states
from nonlinear.system import system_of

SEED, NOISE, TOLERANCE, DIFFERENCE = 3, 1e-3, 1e-8, 1e-5
SENSORS = Sensor(1, 1), Sensor(1, 2)
DAMPING, LENGTH = "pendulum[0].links[*].damping", "pendulum[0].links[*].length"
CASES: dict[str, tuple[float, int, float]] = {
    "torques": (0.6, 30, 0.0),
    "dry": (0.6, 30, 0.02),
    "longer": (1.5, 75, 0.0),
    "swing": (14.36, 1437, 0.0),
}
"""Duration (s), rows and dry friction (N m)."""


def arm(dampers: Sequence[float], friction: float, records: Sequence[Floats]) -> Scene:
    """Two links that records of torques turn; rows of the latter are times, then the torque at each joint."""
    times, *torques = (record.tolist() for record in records)
    parts = zip(((0.25, 0.3, 0.006), (0.17, 0.2, 0.004)), dampers, strict=True)
    links = [
        {"kind": "body", "mass": 0.6, "centre": centre, "length": length, "inertia": inertia, "damping": damping}
        | {"friction": friction}
        for (centre, length, inertia), damping in parts
    ]
    forces = [
        {"on": f"pendulum[0].links[{k}]", "direction": "torque", "kind": "record", "time_s": times, "moment_nm": torque}
        for k, torque in enumerate(torques)
    ]
    return scene_from({"gravity": 9.81, "pendulum": [{"links": links}], "force": forces})


def torques_for(duration: float, rng: np.random.Generator) -> list[Floats]:
    """Times, 500 a second, and two torques of four sines each with noise."""
    times = np.arange(-0.05, duration + 0.2, 0.002)
    records = [times]
    for size in (1.5, 0.5):
        frequencies, phases, sizes = rng.uniform(0.4, 2.0, 4), rng.uniform(0, 6.28, 4), rng.uniform(0.3, 1.0, 4)
        sines = sizes[:, None] * np.sin(2 * np.pi * frequencies[:, None] * times + phases[:, None])
        records.append(size * sines.sum(0) + rng.normal(0, 0.02, len(times)))
    return records


def double_pendulum(lengths: Sequence[float], dampers: Sequence[float]) -> Scene:
    """Two rods."""
    links = [
        {"kind": "rod", "mass": mass, "length": length, "damping": damping}
        for mass, length, damping in zip((1.0, 0.5), lengths, dampers, strict=True)
    ]
    return scene_from({"gravity": 9.81, "pendulum": [{"links": links}]})


def record(scene: Scene, duration: float, rows: int, state: Sequence[float], rng: np.random.Generator) -> Recording:
    """The motion of a scene from this state with noise."""
    times = np.linspace(0, duration, rows)
    blank = Segment("synthetic", "1", times, np.zeros((rows, 2)))
    problem = FitProblem(scene, (), Recording(SENSORS, (blank,)), np.ones(2), tolerance=1e-10)
    u = np.zeros(problem.layout.size)
    u[problem.layout.state(0)] = state
    (values,) = problem.readings(u)
    return Recording(SENSORS, (Segment("synthetic", "1", times, values + rng.normal(0, NOISE, values.shape)),))


def prepare(case: str) -> tuple[Scene, Recording, list[str]]:
    """The scene to begin with, the recording and what is free."""
    duration, rows, friction = CASES[case]
    rng = np.random.default_rng(SEED)
    if case == "swing":
        true, start = double_pendulum((0.5, 0.4), (0.01, 0.005)), double_pendulum((0.53, 0.38), (0.013, 0.004))
        return start, record(true, duration, rows, (1.0, -0.5, 0.0, 0.0), rng), [LENGTH, DAMPING]
    torques = torques_for(duration, rng)
    true, start = arm((0.02, 0.01), friction, torques), arm((0.03, 0.006), friction, torques)
    return start, record(true, duration, rows, (0.3, -0.2, 0.0, 0.0), rng), [DAMPING]


def by_differences(scene: Scene, recording: Recording, free: Sequence[str]) -> Floats:
    """The numbers that SciPy finds."""
    problem = FitProblem(scene, find_parameters(scene, free), recording, np.full(2, NOISE))
    layout, (segment,) = problem.layout, problem.recording.segments
    columns = np.flatnonzero(problem.free)
    u = np.zeros(layout.size)
    u[: layout.numbers] = [parameter.start for parameter in problem.parameters]
    u[layout.state(0)] = initial_states(problem)[0]
    begin = segment.times[0] - problem.late

    def residuals(x: Floats) -> Floats:
        v = u.copy()
        v[columns] = x
        equations = Generated(system_of(problem.scene_at(v)), counts_work=False)
        rate, inputs = equations.rate, equations.inputs_at
        end = segment.times[-1] + problem.late
        run: Any = solve_ivp(
            lambda t, y: rate(y.tolist(), inputs(t, y) if inputs else ()),
            (begin, end),
            v[layout.state(0)],
            "DOP853",
            dense_output=True,
            rtol=TOLERANCE,
            atol=TOLERANCE,
        )
        read = [run.sol(segment.times - v[layout.delays][c])[c] + v[layout.offsets][c] for c in range(2)]
        return np.asarray(np.concatenate([(read[c] - segment.values[:, c]) / NOISE for c in range(2)]))

    bounds = tuple(limits[columns] for limits in problem.bounds)
    solution = least_squares(residuals, u[columns], bounds=bounds, x_scale="jac", diff_step=DIFFERENCE, max_nfev=50)
    return np.array([parameter.at(float(z)) for parameter, z in zip(problem.parameters, solution.x, strict=False)])


def main() -> None:
    """Print times and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=[*CASES], metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--no-rival", action="store_true")
    options = parser.parse_args()
    for case in options.cases:
        scene, recording, free = prepare(case)
        begun = process_time()
        fitted: Fit = fit(scene, recording, free)
        spent = process_time() - begun
        print(f"{case}: {spent:.2f} s, {fitted.evaluations} motions, {fitted.values}")
        if options.no_rival or CASES[case][2]:
            continue
        begun = process_time()
        numbers = by_differences(scene, recording, free)
        other = process_time() - begun
        apart = float(np.abs((numbers - fitted.values) / fitted.stds).max())
        print(f"  SciPy {other / spent:.1f} times as long, {apart:.2f} standard deviations off")


if __name__ == "__main__":
    main()
