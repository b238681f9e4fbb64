"""Whether the predicted survivor survives, and when: a held-out set of driven scenes, simulated.

    OPENBLAS_NUM_THREADS=1 python benchmarks/sync/survivors.py [--quick] [--csv FILE]

Random scenes of two to six equal pendula of one or two links on one cart, light to heavy, with and without damper and
spring, sustained by van der Pol torques or escapements, released at random angles; no constant of the code was fitted
to them.  Each is predicted by the averaged equations and then simulated in full at a tolerance of 1e-8, for one and
a half times the predicted locking time and 50 periods.  The survivor and its time are determined from the run by
`nonlinear.synchronization.modal_energy`.  A scene that would take more than LONGEST periods is predicted but not
judged.
"""

from __future__ import annotations

import argparse
import csv
import random
import sys
from dataclasses import asdict, dataclass
from math import degrees, isfinite, nan, pi, radians, sqrt
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.scene import Scene, scene_from
from nonlinear.averaging import Prediction, predict
from nonlinear.simulation import simulate
from nonlinear.synchronization import Survival, find_survival

SCENES, QUICK, FIRST = 150, 2, 900_000
TOLERANCE, LONGER, MORE, LONGEST, SAMPLES = 1e-8, 1.5, 50, 1200, 12  # the last three in periods, samples per period
CLOSE, BRAKED = 0.2, 0.3  # relative tolerance of a time; largest damping rate of a cart over the frequency
GRAVITY = 9.81


@dataclass(frozen=True)
class Case:
    """One scene: the prediction, rows from 1, and the result of the run, times in s; NaN where there is none."""

    seed: int
    pendula: int
    links: int
    drive: str
    row: int
    locking_s: float
    doubts: str
    timing_doubts: str
    predict_s: float
    run_row: int = 0
    run_share: float = nan
    run_locking_s: float = nan
    simulate_s: float = nan

    @property
    def certain(self) -> bool:
        """Whether the survivor is claimed."""
        return not self.doubts

    @property
    def timed(self) -> bool:
        """Whether its locking time is claimed."""
        return not self.timing_doubts

    @property
    def judged(self) -> bool:
        """Whether a run shows who survives."""
        return self.run_row > 0

    @property
    def right(self) -> bool:
        """Whether the survivor is the predicted one."""
        return self.row == self.run_row

    @property
    def ratio(self) -> float:
        """Predicted over simulated locking time."""
        return self.locking_s / self.run_locking_s if self.run_locking_s > 0 else nan

    @property
    def close(self) -> bool:
        """Whether the times agree within CLOSE."""
        return abs(self.ratio - 1) <= CLOSE


def held(seed: int) -> Scene:
    """A scene with its start."""
    rng = random.Random(seed)
    count, links = rng.randint(2, 6), 1 + (rng.random() < 0.3)
    mass, length = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-0.7, 0.3)
    whole, omega = mass * links, sqrt(GRAVITY / (length * links))
    moment = whole * (length * links) ** 2 / 2
    rate = omega * 10 ** rng.uniform(-2.9, -2.1)
    chain = [_link(rng, mass, length, 2 * moment * rate * 10 ** rng.uniform(-1.3, -0.3)) for _ in range(links)]
    driven = links - 1 if rng.random() < 0.3 else 0
    chain[driven]["drive"] = _drive(rng, 2 * moment * rate, chain[driven]["damping"])
    support = _cart(rng, count * whole, omega, rate)
    pendula = [{"links": chain, "start": {"angles_deg": [rng.uniform(-12, 12)] * links}} for _ in range(count)]
    return scene_from({"gravity": GRAVITY, "support": support, "pendulum": pendula})


def _link(rng: random.Random, mass: float, length: float, damping: float) -> dict[str, Any]:
    kind = rng.choice(("bob", "rod", "body"))
    more = {"centre": length * rng.uniform(0.3, 0.9), "inertia": 0.1 * mass * length**2} if kind == "body" else {}
    return {"kind": kind, "mass": mass, "length": length, "damping": damping, **more}


def _drive(rng: random.Random, strength: float, damping: float) -> dict[str, Any]:
    """A torque or kicks that sustain one pendulum at some degrees with this damper."""
    if rng.random() < 0.6:
        return {"kind": "van-der-pol", "strength": damping + strength, "angle_deg": rng.uniform(2, 8)}
    size, share = radians(rng.uniform(3, 11)), rng.uniform(0, 0.5)
    impulse = pi / 2 * damping * size / sqrt(1 - share**2)
    return {"kind": "escapement", "impulse": impulse, "angle_deg": degrees(share * size)}


def _cart(rng: random.Random, hung: float, omega: float, rate: float) -> dict[str, Any]:
    """Light to heavy; its damper acts on pendula in phase at a rate similar to that of the drives."""
    mass = hung * 10 ** rng.uniform(-0.3, 2.3)
    taken = rate * 10 ** rng.uniform(-1, 0.5) * (rng.random() < 0.75)
    stiffness = (mass + hung) * (omega * rng.uniform(0.2, 3)) ** 2 * (rng.random() < 0.25)
    damping = min(2 * taken * (mass + hung) / hung, BRAKED * omega) * (mass + hung)
    return {"kind": "cart", "mass": mass, "damping": damping, "stiffness": stiffness}


def judged(seed: int) -> Case:
    """One scene of the set."""
    scene, begun = held(seed), perf_counter()
    said = predict(scene)
    drive = next(link.drive.kind for link in scene.pendulum[0].links if link.drive)
    about = (seed, len(scene.pendulum), scene.pendulum[0].n_links, drive, said.row + 1)
    doubts = ("; ".join(said.doubts), "; ".join(said.timing_doubts))
    claim = (*about, _time(said.locking_time()), *doubts, perf_counter() - begun)
    duration, period = _duration(said)
    if duration > LONGEST * period:
        return Case(*claim)
    begun = perf_counter()
    try:
        run = _run(said, duration)
        return Case(*claim, run.survivor, run.survivor_share, _time(run.locking_time()), perf_counter() - begun)
    except ComputationError:
        return Case(*claim)


def _duration(said: Prediction) -> tuple[float, float]:
    """The simulated duration (s) of a scene, and its slowest period."""
    period = 2 * pi / float(said.averaged.omega.min())
    ends = said.locking_time()
    return LONGER * (float(said.motion.times[-1]) if ends is None else ends) + MORE * period, period


def _time(value: float | None) -> float:
    return nan if value is None else value


def _run(said: Prediction, duration: float) -> Survival:
    output = int(SAMPLES * duration * said.averaged.omega.max() / (2 * pi)) + 2
    return find_survival(simulate(said.averaged.scene, duration, start=said.start, tolerance=TOLERANCE, output=output))


HEAD = "|   scene | N×n | drive       | row | certain | t lock (s) | run | share | t lock (s) | ratio | doubts"


def line(case: Case) -> str:
    """One scene in a row of the table."""
    claim = "row, time" if case.timed else "row" if case.certain else "–"
    run = f"{case.run_row:3d} | {case.run_share:5.3f} | {_number(case.run_locking_s, 10)} | {_number(case.ratio, 5)}"
    return (
        f"| {case.seed:7d} | {case.pendula}×{case.links} | {case.drive:11s} | {case.row:3d} | {claim:9s} | "
        f"{_number(case.locking_s, 10)} | {run if case.judged else ' not run ':32s} | {case.timing_doubts}"
    )


def _number(value: float, width: int) -> str:
    return f"{value:{width}.4g}" if isfinite(value) else f"{'–':>{width}s}"


def report(cases: list[Case]) -> str:
    """The totals."""
    seen = [case for case in cases if case.judged]
    sure, timed = [case for case in seen if case.certain], [case for case in seen if case.timed]
    other = [case for case in seen if not case.certain]
    ratios = np.array([case.ratio for case in timed])
    rows = [
        ("scenes; of them simulated", f"{len(cases)}; {len(seen)}"),
        ("survivor claimed; right", f"{len(sure)}; {sum(case.right for case in sure)}"),
        ("survivor not claimed; right all the same", f"{len(other)}; {sum(case.right for case in other)}"),
        (f"locking time claimed; within {100 * CLOSE:.0f} %", f"{len(timed)}; {sum(case.close for case in timed)}"),
        ("predicted over simulated time: least, median, most", ", ".join(f"{q:.3f}" for q in _spread(ratios))),
        ("s to predict: median, 95 %, most", _seconds([case.predict_s for case in cases])),
        ("s to simulate: median, 95 %, most", _seconds([case.simulate_s for case in seen])),
    ]
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)])


def _spread(values: np.ndarray) -> list[float]:
    return [float(q) for q in np.quantile(values, (0, 0.5, 1))] if len(values) else []


def _seconds(values: list[float]) -> str:
    return ", ".join(f"{q:.2f}" for q in np.quantile(values, (0.5, 0.95, 1)))


def progress(done: int, whole: int) -> None:
    """A progress bar on a terminal."""
    if sys.stderr.isatty():
        bar = "#" * (30 * done // whole)
        print(f"\r[{bar:30s}] {done}/{whole}", end="\n" if done == whole else "", file=sys.stderr, flush=True)


def main() -> None:
    """Run the set and print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--first", type=int, default=FIRST)
    parser.add_argument("--quick", action="store_true", help=f"only the first {QUICK}")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="keep every scene")
    options = parser.parse_args()
    scenes = QUICK if options.quick else options.scenes
    cases: list[Case] = []
    print(HEAD)
    for seed in range(options.first, options.first + scenes):
        cases.append(judged(seed))
        print(line(cases[-1]), flush=True)
        progress(len(cases), scenes)
    print(report(cases))
    if options.csv:
        with options.csv.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, asdict(cases[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(map(asdict, cases))


if __name__ == "__main__":
    main()
