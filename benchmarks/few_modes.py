"""Whether the error stated for a few modes is at least the true one, on chains in and out of resonance.

    OPENBLAS_NUM_THREADS=1 python benchmarks/few_modes.py [--chains 40] [--first 710000]

Random chains of four to twenty bobs or rods, on a cart or not, oscillate in one of their three lowest modes at 2 to 45
degrees for 10 to 30 s and are simulated in the modes up to that one.  In two of three a length is changed until an
omitted mode is within 3 % of twice or three times its frequency.  The reference is the whole scene, integrated at a
tolerance of 1e-12; where two such runs differ by more than a hundredth of the error there is no verdict.
"""

from __future__ import annotations

import argparse
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import radians

import numpy as np
from scipy.optimize import brentq

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene, natural_modes
from nonlinear.reduction import simulate_truncated, start_in_mode
from nonlinear.simulation import simulate
from nonlinear.system import State

TUNED = (None, 2.0, 3.0)  # frequency ratio of an omitted mode and the oscillating one
BESIDE = 0.03  # largest relative deviation from that ratio
SAMPLES = 401
SURE = 0.01  # largest difference of two references over an error


@dataclass(frozen=True)
class Case:
    """A chain in `mode` (from 0) at `degrees` for `duration` seconds; `ratio` of the nearest tuned mode."""

    scene: Scene
    mode: int
    degrees: float
    duration: float
    ratio: float

    @property
    def start(self) -> State:
        """At rest in the shape of the mode."""
        return start_in_mode(self.scene, natural_modes(self.scene), self.mode, 0, radians(self.degrees))


@dataclass(frozen=True)
class Judged:
    """The errors (rad) stated and true at the end, their smallest ratio so far, and whether that is certain."""

    stated: float
    true: float
    least: float
    certain: bool


def held(seed: int) -> Case:
    """One chain of the set."""
    rng = random.Random(seed)
    kind, count = rng.choice((Bob, Rod)), rng.randint(4, 20)
    masses, lengths = ([rng.uniform(0.3, 1.5) for _ in range(count)] for _ in range(2))
    support = rng.choice((Fixed(), Fixed(), Cart(mass=rng.uniform(1.0, 10.0), stiffness=rng.uniform(1.0, 20.0))))
    mode, wished, beside = rng.randrange(3), TUNED[seed % 3], rng.uniform(-BESIDE, BESIDE)
    amplitude, duration = 2 * 22.5 ** rng.random(), 10 * 3 ** rng.random()

    def chain(last: float) -> Scene:
        links = [kind(mass=m, length=l) for m, l in zip(masses, (*lengths[:-1], last), strict=True)]
        return Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links)])

    scene = chain(lengths[-1]) if wished is None else _tuned(chain, mode, wished * (1 + beside))
    omega = natural_modes(scene).omega
    ratios = omega[mode + 1 :] / omega[mode]
    nearest = min(ratios, key=lambda ratio: min(abs(ratio / r - 1) for r in (2.0, 3.0)))
    return Case(scene, mode, amplitude, duration, float(nearest))


def _tuned(chain: Callable[[float], Scene], mode: int, ratio: float) -> Scene:
    """The chain with the last length at which a mode has this ratio to `mode`; the nearest one if there is none."""
    lengths = np.geomspace(0.1, 3.0, 60)
    table = np.array([natural_modes(chain(last)).omega for last in lengths])
    off = table[:, mode + 1 :] / table[:, [mode]] - ratio
    rows, columns = np.nonzero(off[1:] * off[:-1] < 0)
    if not rows.size:
        return chain(float(lengths[np.abs(off).min(axis=1).argmin()]))
    at, other = int(rows[0]), mode + 1 + int(columns[0])

    def miss(last: float) -> float:
        omega = natural_modes(chain(last)).omega
        return float(omega[other] / omega[mode] - ratio)

    return chain(float(brentq(miss, lengths[at], lengths[at + 1])))


def judged(case: Case) -> Judged:
    """A case with its true error."""
    start = case.start
    reduced = simulate_truncated(case.scene, case.duration, case.mode + 1, start=start, output=SAMPLES)
    sure, other = (
        simulate(case.scene, case.duration, start=start, output=SAMPLES, tolerance=t).motion.links
        for t in (1e-12, 1e-11)
    )
    true = np.maximum.accumulate(np.abs(reduced.trajectory.motion.links - sure).max(axis=1))
    doubt = np.maximum.accumulate(np.abs(other - sure).max(axis=1))
    known = (doubt < SURE * true) & (true > 0)
    least = float((reduced.errors[known] / true[known]).min(initial=np.inf))
    return Judged(reduced.error, float(true[-1]), least, bool(known[-1]))


def report(cases: Iterable[Judged]) -> str:
    """The figures in plain words."""
    every = list(cases)
    ratios = np.array([verdict.stated / verdict.true for verdict in every if verdict.certain])
    below = sum(verdict.least < 1 for verdict in every)
    return (
        f"| chains; judged to their end | {len(every)}; {len(ratios)} |\n|---|---|\n"
        f"| stated below the true error, at the end or before | {below} |\n"
        f"| stated over true: least, median, 90 % | "
        f"{ratios.min():.2f}, {np.median(ratios):.2f}, {np.quantile(ratios, 0.9):.2f} |\n"
    )


def main() -> None:
    """Run the set and print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chains", type=int, default=40)
    parser.add_argument("--first", type=int, default=710_000)
    options = parser.parse_args()
    verdicts = []
    for seed in range(options.first, options.first + options.chains):
        case = held(seed)
        verdicts.append(judged(case))
        what = f"{case.scene.n_links} links, mode {case.mode + 1} at {case.degrees:.1f} deg, {case.duration:.0f} s"
        errors = f"stated {verdicts[-1].stated:.2e}, true {verdicts[-1].true:.2e}, least ratio {verdicts[-1].least:.2f}"
        doubt = "" if verdicts[-1].certain else " (uncertain)"
        print(f"{seed} {what}, nearest {case.ratio:.3f}: {errors}{doubt}", flush=True)
    print(report(verdicts))


if __name__ == "__main__":
    main()
