"""Whether `simulate --accuracy` keeps its promises: accuracy met, at what cost against the cheapest, on a held-out set.

    OPENBLAS_NUM_THREADS=1 python benchmarks/advice.py [--scenes 300] [--promises] [--journal FILE] [--write]

Random scenes of one to nine links, in the plane and in space, on a cart or not, with springs and dampers or without,
some of them driven (van der Pol), with stiff joints or with light links above heavy ones, from 0.01 to 170 degrees,
over 1 to 15 s and for 1e-8 to 1e-2 rad; no constant of the code was fitted to them.  The reference is DOP853 at a
tolerance of 1e-4 times the accuracy, or times the stated error where that is smaller, checked against one ten times
looser, or else the finest candidates available; where those differ by more than a twentieth of the accuracy there is no
verdict, and the advice should say so.  The cheapest candidate is found by trying every integrator from loose tolerances
on, half a decade at a time.  A cost is the time from scene to motion in a process of its own: compilers and the loading
of numba and heyoka, which is measured once, are counted.

With --promises no cheapest candidate is sought, and only promises are checked.  With a journal finished cases are kept,
and not repeated.
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene
from modal.scene import VanDerPol
from nonlinear.accuracy import Advice, Candidate
from nonlinear.accuracy.references import Question, choose_references
from nonlinear.integration import SMALLEST, estimate_timescales, extent, sample_times
from nonlinear.reduction import CORRECTED, LINEAR
from nonlinear.simulation import advise
from nonlinear.system import Motion, State, apart, system_of

DOCS = Path(__file__).parent.parent / "docs"
FINER, SHARE = 1e-4, 0.05  # over the accuracy: the reference's tolerance, and its largest difference from a looser one
LOOSE, HALF_DECADES = 30.0, 24  # the first tolerance over accuracy and size, and the number that follow
LIMIT = 3.0
STIFF, HEAVY = 10.0, 10.0  # spring over m l² (1/s²) of a stiff joint, mass below a light link over its own


@dataclass(frozen=True)
class Case:
    """One scene: the request, the result, and the cheapest candidate that would have sufficed (inf s: none)."""

    seed: int
    links: int
    space: str
    kind: str
    duration_s: float
    accuracy_rad: float
    met: bool
    judged: bool
    error_rad: float
    stated_rad: float
    way: str
    seconds: float
    final_seconds: float
    cheapest: str
    cheapest_seconds: float


def held(seed: int) -> tuple[Scene, State, float, float]:
    """A scene, its start, a duration (s) and an accuracy (rad)."""
    rng = random.Random(seed)
    damped, sprung, stiff, topheavy = (rng.random() < share for share in (0.25, 0.15, 0.2, 0.2))
    driven, spatial = rng.random() < 0.3, rng.random() < 0.15
    spatial = spatial and not driven

    def link(above: float = inf) -> Bob | Rod | Body:
        mass, length = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-0.5, 0.5)
        if topheavy and above < inf:
            mass = above * 10 ** rng.uniform(1, 3)
        numbers_of_link: dict[str, Any] = {"mass": mass, "length": length}
        scale = mass * length**2
        numbers_of_link["damping"] = scale * rng.uniform(0.0, 0.3) * (damped and rng.random() < 0.5)
        numbers_of_link["stiffness"] = scale * rng.uniform(0.0, 5.0) * (sprung and rng.random() < 0.5)
        if stiff and rng.random() < 0.5:
            numbers_of_link["stiffness"] = scale * 10 ** rng.uniform(1, 3)
        if driven and rng.random() < 0.5:
            numbers_of_link["drive"] = VanDerPol(
                strength=scale * 10 ** rng.uniform(-2, 0.5), angle_deg=rng.uniform(2.0, 30.0)
            )
        return (
            Body(**numbers_of_link, centre=0.6 * length, inertia=0.1 * scale)
            if rng.random() < 0.2
            else rng.choice((Bob, Rod))(**numbers_of_link)
        )

    def chain() -> Pendulum:
        links = [link()]
        for _ in range(rng.randint(0, 2)):
            links.append(link(links[-1].mass))
        return Pendulum(links=links)

    support = (
        Cart(mass=10 ** rng.uniform(-1, 2), damping=rng.uniform(0.0, 1.0) * damped) if rng.random() < 0.7 else Fixed()
    )
    pendula = [chain() for _ in range(rng.randint(1, 3))]
    scene = Scene(gravity=9.81, space="space" if spatial else "plane", support=support, pendulum=pendula)
    numbers, size = np.random.default_rng(seed), 10 ** rng.uniform(-3.75, 0.47)
    links = system_of(scene).n_links
    if not spatial:
        angles, rates = size * numbers.uniform(-1, 1, (2, links))
        start = State(angles, rates)
    else:
        tilt, azimuth = size * numbers.uniform(0, 1, links), numbers.uniform(-np.pi, np.pi, links)
        u = np.stack((np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)), axis=1)
        start = State(u, np.cross(size * numbers.uniform(-1, 1, (links, 3)), u))
    return scene, start, 10 ** rng.uniform(0, 1.18), 10 ** rng.uniform(-8, -2)


def kind(scene: Scene) -> str:
    """The difficulties of a scene, in words."""
    chains = [[link for link in pendulum.links for _ in range(link.count)] for pendulum in scene.pendulum]
    features = {
        "driven": scene.is_driven,
        "stiff": any(link.stiffness > STIFF * link.mass * link.length**2 for link in scene.links()),
        "light over heavy": any(low.mass >= HEAVY * up.mass for chain in chains for up, low in pairwise(chain)),
    }
    return ", ".join(name for name, holds in features.items() if holds) or "plain"


@cache
def loading(way: str) -> float:
    """Seconds to load what a method needs besides NumPy and SciPy, in a new process."""
    module = "nonlinear.dynamics.compiled" if "compiled" in way else "heyoka" if "taylor" in way else ""
    if not module:
        return 0.0
    code = f"import time, nonlinear; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


def judged(seed: int, costs: bool = True) -> Case:
    """One scene of the set, with the cheapest sufficient candidate if `costs`."""
    scene, start, duration, accuracy = held(seed)
    estimate_timescales.cache_clear()
    begun = perf_counter()
    advice = advise(scene, duration, accuracy, start=start)
    seconds = perf_counter() - begun
    seconds += sum(map(loading, {attempt.way for attempt in advice.attempts})) if costs else 0.0
    question = Question(scene, start, sample_times(scene, duration, 0.0, None))
    plane = scene.space == "plane"
    form, compiled = "minimal" if plane else "spatial", plane and find_spec("numba") is not None
    fine = FINER * min(accuracy, advice.attempts[-1].error)
    looser = (Candidate(form, "DOP853", max(fine * share, SMALLEST), compiled) for share in (1.0, 10.0))
    known, error = False, inf
    for candidates in (looser, choose_references(scene)) if advice.is_met or costs else ():
        finest, other = (candidate.prepare(question)().motion for candidate in candidates)
        known, error = float(apart(finest, other).max()) < SHARE * accuracy, _error(advice, finest)
        if known:
            break
    best, best_seconds = "", inf
    if known and costs:
        for candidate, spent in _enough(question, finest, accuracy):
            if spent + loading(candidate.name) < best_seconds:
                best, best_seconds = candidate.name, spent + loading(candidate.name)
    last = advice.attempts[-1]
    return Case(
        seed,
        scene.n_links,
        scene.space,
        kind(scene),
        duration,
        accuracy,
        advice.is_met,
        known,
        error,
        last.error,
        last.way,
        seconds,
        last.seconds + (loading(last.way) if costs else 0.0),
        best,
        best_seconds,
    )


def _error(advice: Advice, finest: Motion) -> float:
    """The largest error (rad) over the advised motion."""
    return float(apart(advice.trajectory.motion, finest).max())


def _enough(question: Question, finest: object, accuracy: float) -> Iterator[tuple[Candidate, float]]:
    """For every family the loosest candidate that meets the accuracy, and its time (s)."""
    plane = question.scene.space == "plane"
    families = [[Candidate(LINEAR)], [Candidate(CORRECTED)]]
    methods = [("DOP853", False), ("RK45", False), *([("LSODA", False)] if plane else [])]
    methods += [("DOP853", True)] if plane and find_spec("numba") else []
    methods += [("taylor", False)] if plane and find_spec("heyoka") else []
    kind = "minimal" if plane else "spatial"
    size = extent(question.start, system_of(question.scene))
    tolerances = min(LOOSE * accuracy / size, 1e-2) / 10 ** (np.arange(HALF_DECADES) / 2)
    families += [[Candidate(kind, method, t, compiled) for t in tolerances] for method, compiled in methods]
    fastest = inf
    for family in families:
        for candidate in family if loading(family[0].name) < fastest else ():
            estimate_timescales.cache_clear()
            begun = perf_counter()
            estimate_timescales(question.scene)
            try:
                trajectory = candidate.prepare(replace(question, patience=fastest))()
            except ComputationError:
                break
            spent = perf_counter() - begun
            if float(apart(trajectory.motion, finest).max()) <= accuracy:
                fastest = min(fastest, spent)
                yield candidate, spent
                break


def report(cases: list[Case]) -> str:
    """The figures in plain words."""
    known = [case for case in cases if case.judged]
    met = [case for case in known if case.met]
    kept = [case for case in met if case.error_rad <= case.accuracy_rad]
    stated = [case for case in met if case.error_rad <= case.stated_rad]
    beyond = [case for case in cases if not case.judged]
    kinds = sorted({word for case in cases for word in case.kind.split(", ")})
    counts = ", ".join(f"{word} {sum(word in case.kind.split(', ') for case in cases)}" for word in kinds)
    lines = [
        f"| scenes; of them within double precision | {len(cases)}; {len(known)} |",
        f"| among them | {counts}, in space {sum(case.space == 'space' for case in cases)} |",
        f"| accuracy promised; kept | {len(met)}; {len(kept)} ({100 * len(kept) / max(len(met), 1):.1f} %) |",
        f"| of those promised, off by no more than was stated | {len(stated)} |",
        f"| of the scenes beyond it, said to be beyond it | {sum(not case.met for case in beyond)} of {len(beyond)} |",
    ]
    if any(case.cheapest_seconds < inf for case in kept):
        lines += _costs([case for case in kept if case.cheapest_seconds < inf])
    return "\n".join(["| | |", "|---|---|", *lines]) + "\n"


def _costs(kept: list[Case]) -> list[str]:
    ratios = np.array([case.seconds / case.cheapest_seconds for case in kept])
    final = np.array([case.final_seconds / case.cheapest_seconds for case in kept])
    total = sum(case.seconds for case in kept) / sum(min(case.cheapest_seconds, case.seconds) for case in kept)
    return [
        f"| all that was tried, over the cheapest candidate: median, 90 %, 95 % | "
        f"{np.median(ratios):.2f}, {np.quantile(ratios, 0.9):.2f}, {np.quantile(ratios, 0.95):.2f} |",
        f"| of that at most {LIMIT:g} | {100 * np.mean(ratios <= LIMIT):.1f} % |",
        f"| all scenes together, over their cheapest candidates | {total:.2f} |",
        f"| the run that is returned alone, over the cheapest candidate: median; at most {LIMIT:g} | "
        f"{np.median(final):.2f}; {100 * np.mean(final <= LIMIT):.1f} % |",
    ]


def main() -> None:
    """Run the set and print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--first", type=int, default=910_000)
    parser.add_argument("--promises", action="store_true", help="leave out what the cheapest candidate would have cost")
    parser.add_argument("--journal", type=Path, help="keep every scene here as it is done, and go on from there")
    parser.add_argument("--write", action="store_true", help="keep every scene in docs/benchmarks/advice.csv")
    options = parser.parse_args()
    lines = options.journal.read_text().splitlines() if options.journal and options.journal.exists() else []
    done = {case.seed: case for case in (Case(**json.loads(line)) for line in lines)}
    if not done:
        judged(options.first - 1, not options.promises)
    cases = []
    for seed in range(options.first, options.first + options.scenes):
        cases.append(done[seed] if seed in done else judged(seed, not options.promises))
        print(json.dumps(asdict(cases[-1])), flush=True)
        if options.journal and seed not in done:
            with options.journal.open("a") as stream:
                stream.write(json.dumps(asdict(cases[-1])) + "\n")
    print(report(cases))
    if options.write:
        with open(DOCS / "benchmarks" / "advice.csv", "w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, asdict(cases[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(map(asdict, cases))


if __name__ == "__main__":
    main()
