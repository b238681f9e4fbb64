"""Motion at numerical extremes: every parameter of a scene taken to its limits, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/extremes/simulation.py [--quick] [--write]

`--write` puts every case into docs/benchmarks/extremes-simulation.csv and the figure into docs/pictures/.  An error is
the largest of all angles at five times over the largest angle; the references are those of families.py.  Rivals are the
dense textbook equations under `solve_ivp`, with its defaults and at rtol = atol = 1e-9.
"""

from __future__ import annotations

import argparse
import csv
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import families
import numpy as np
import panels
import rival
import units

from modal.errors import ComputationError
from nonlinear import simulate
from nonlinear.integration import Trajectory
from nonlinear.simulation import SimulationError

DOCS = Path(__file__).parent.parent.parent / "docs"
PATIENCE, QUICK_PATIENCE = 4.0, 0.2  # time limits (s) of a rival
OURS = 60.0  # our time limit (s)
FINE = {"rtol": 1e-9, "atol": 1e-9}


class Line(NamedTuple):
    """One case: our method, error, energy drift and seconds; the rival's, twice; and the messages."""

    family: str
    parameter: float
    did: str
    error: float
    drift: float
    seconds: float
    default_error: float
    default_seconds: float
    fine_error: float
    fine_seconds: float
    outcome: str
    rival_outcome: str


def measured(tried: families.Case, patience: float) -> Line:
    right = tried.reference()
    trajectory, words, seconds = ours(tried)
    rivals = [rival.run(tried.scene, tried.start, tried.times, patience, **kind) for kind in ({}, FINE)]
    (coarse, first), (fine, second) = ((_error(run.angles, right), run.seconds) for run in rivals)
    return Line(
        tried.family,
        tried.parameter,
        _way(trajectory),
        _error(trajectory.motion.links[1:], right) if trajectory else float("nan"),
        trajectory.energy_drift() if trajectory else float("nan"),
        seconds,
        coarse,
        first,
        fine,
        second,
        words,
        "; ".join(dict.fromkeys(run.words for run in rivals if run.words)),
    )


def _way(trajectory: Trajectory | None) -> str:
    if trajectory is None:
        return "none"
    return f"{trajectory.run.form}/{trajectory.run.method}" + (
        ", compiled" if "compiled" in trajectory.run.reason else ""
    )


def ours(tried: families.Case) -> tuple[Trajectory | None, str, float]:
    """The trajectory, the program's message, and seconds; a traceback of any other kind is a defect and is named."""
    begun = time.perf_counter()

    def report(_: float) -> None:
        if time.perf_counter() - begun > OURS:
            raise ComputationError(f"given up by the benchmark after {OURS:g} s")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            trajectory = simulate(
                tried.scene,
                float(tried.times[-1]),
                start=tried.start,
                output=tried.times,
                report=report,
                **tried.options,
            )
            said = []
        except SimulationError as error:
            trajectory, said = error.trajectory, [f"SimulationError: {error}"]
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            trajectory, said = None, [f"TRACEBACK {type(error).__name__}: {error}"]
    said += [f"{warning.category.__name__}: {warning.message}" for warning in caught]
    return trajectory, "; ".join(dict.fromkeys(said)) or "ran", time.perf_counter() - begun


def _error(angles: np.ndarray | None, right: np.ndarray) -> float:
    if angles is None or angles.shape != right.shape:
        return float("nan")
    return float(np.max(np.abs(angles - right)) / np.max(np.abs(right)))


HEAD = f"{'family':28} {'parameter':>9} {'ours':>8} {'drift':>8} {'s':>6} {'SciPy':>8} {'1e-9':>8}  outcome"


def told(line: Line) -> str:
    return (
        f"{line.family:28} {line.parameter:9.3g} {line.error:8.1e} {line.drift:8.1e} {line.seconds:6.2f} "
        f"{line.default_error:8.1e} {line.fine_error:8.1e}  {line.did}: {line.outcome} | {line.rival_outcome}"
    )


def write(lines: Sequence[Line], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Line._fields)
        writer.writerows([f"{cell:.4g}" if isinstance(cell, float) else cell for cell in line] for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three values of a parameter and short runs")
    parser.add_argument("--write", action="store_true", help="write the cases and the figure into docs/")
    options = parser.parse_args()
    for warm in (*families.hours(quick=True), *families.pendula(quick=True)):
        ours(warm)
    patience = QUICK_PATIENCE if options.quick else PATIENCE
    lines = []
    print(HEAD)
    for tried in families.cases(options.quick):
        lines.append(measured(tried, patience))
        print(told(lines[-1]), flush=True)
    print(units.report())
    if options.write:
        write(lines, DOCS / "benchmarks" / "extremes-simulation.csv")
        panels.figure(lines, DOCS / "pictures" / "extremes-simulation.png")


if __name__ == "__main__":
    main()
