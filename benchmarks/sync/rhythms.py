"""The map of rhythms, start by start and border by border, compared with equations written here.

    python benchmarks/sync/rhythms.py [--quick]

Metronomes on a base of mass M: with J and b the moment of inertia and the first moment of each about its joint,

    J θ_i'' + b cos θ_i x'' + g b sin θ_i = (e (1 − θ_i²/γ₀²) − d) θ_i',    (M + N m) x'' + c x' + b Σ (sin θ_i)'' = 0.

The starts of the map are integrated by the classical Runge–Kutta method, sixty steps a small period.  Each is judged
in windows of 64 small periods by the largest difference of angles, and by the phases of θ_i − iθ_i'/ω from that of the
first.  It ends in phase where the difference falls below 1e-4 rad.  Where the largest difference of a window comes back
six times, it ends in antiphase if the phases stay at π, in a beat if they swing but stay within a turn, else drifting.

Huygens' clocks are released 1e-4 rad apart from their motion in phase.  That is stable where their difference has
decayed after 1280 s.  Where it begins or ceases to be stable the map has a birth or a death between the same values.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from itertools import pairwise
from math import pi, radians
from operator import eq
from time import perf_counter

import numpy as np
from clockwork import Clocks, kicked, stepped
from numba import njit, prange

from modal import load
from modal.scene.parameters import parse_variations
from nonlinear.ensembles import find_rhythms, workers_at
from nonlinear.ensembles.endings import rhythm_starts
from nonlinear.ensembles.rhythms import ValueRhythms

MASSES, BESIDE_THE_BORDER = (0.05, 0.06, 0.08, 0.12, 0.2), (0.065, 0.07)  # kg; where the beat dies
BEAMS = (4.5, 5.0, 5.34, 5.36, 6.0, 10.0, 14.0, 18.0, 22.0, 26.0, 26.66, 26.7)  # kg
LEAST_SHARE = 0.99

STEPS, PERIODS, WINDOWS = 60, 64, 64  # steps in a small period, small periods in a window, windows at most
IN_PHASE, ANTIPHASE, BEAT, DRIFTING, UNDECIDED = range(5)
NAMES = ("in phase", "antiphase", "beat", "drifting", "undecided")


def metronomes(base: float) -> Clocks:
    """The shipped ones on a base of this mass (kg)."""
    numbers = 0.025, 0.025 * 0.02, 1e-5 + 0.025 * 0.02**2, 1e-6, 2e-5, radians(26), 0.0
    return Clocks(*(np.full(2, number) for number in numbers), base, 0.01, 0.0)


def huygens(beam: float) -> Clocks:
    """The shipped ones on a beam of this mass (kg)."""
    numbers = 0.082, 0.082 * 0.14, 0.082 * 0.14**2, 1.35e-4, 0.0, radians(3), 2.9e-5
    return Clocks(*(np.full(2, number) for number in numbers), beam, 4.0, 0.0)


@njit
def window(p, y, h, turned, ranges):
    """The state after the next window, the largest |θ_i − θ_1| in it, and the range (N, 2) of each unwrapped phase."""
    n, largest = len(p.mass), 0.0
    omega = 2 * pi / (STEPS * h)
    ranges[:, 0], ranges[:, 1] = np.inf, -np.inf
    for step in range(PERIODS * STEPS):
        y = stepped(p, y, h)
        if step % 6:
            continue
        first = np.arctan2(-y[n] / omega, y[0])
        for i in range(1, n):
            largest = max(largest, abs(y[i] - y[0]))
            phase = np.arctan2(-y[n + i] / omega, y[i]) - first
            turned[i] = phase + 2 * pi * np.round((turned[i] - phase) / (2 * pi))
            ranges[i, 0], ranges[i, 1] = min(ranges[i, 0], turned[i]), max(ranges[i, 1], turned[i])
    return y, largest


@njit
def ending(p, h, y):
    """What a start ends in."""
    n = len(p.mass)
    turned, ranges = np.zeros(n), np.zeros((n, 2))
    before, steady = np.inf, 0
    for _ in range(WINDOWS):
        y, largest = window(p, y, h, turned, ranges)
        if largest < 1e-4:
            return IN_PHASE
        steady = steady + 1 if abs(largest / before - 1) < 3e-3 else 0
        before = largest
        if steady == 6:
            widths, middles = ranges[1:, 1] - ranges[1:, 0], (ranges[1:, 1] + ranges[1:, 0]) / 2
            if np.any(widths > 2 * pi):
                return DRIFTING
            if np.all(np.abs(np.cos(middles / 2)) < 0.1) and np.all(widths < 0.6):
                return ANTIPHASE
            return BEAT if np.any(widths > 0.6) else UNDECIDED
    return UNDECIDED


@njit(parallel=True)
def endings(p, h, starts):
    """What every start (S, 2N + 2) ends in."""
    ends = np.zeros(len(starts), dtype=np.int64)
    for member in prange(len(starts)):
        ends[member] = ending(p, h, starts[member])
    return ends


@njit
def spreads(p, h, y, sides):
    """The largest |θ_2 − θ_1| of two clocks in each of some parts of a run, each longer than they beat."""
    largest = np.zeros(8)
    for part in range(len(largest)):
        for _ in range(int(160 / h)):
            y = kicked(p, y, h, sides)
            largest[part] = max(largest[part], abs(y[1] - y[0]))
    return y, largest


def is_stable_in_phase(beam: float) -> bool:
    """Whether a small difference between two of Huygens' clocks in phase on a beam (kg) decays, and they swing on."""
    p, sides = huygens(beam), -np.ones(2)
    y, _ = spreads(p, p.period / STEPS, np.array([0.1, 0.1, 0.0, 0.0, 0.0, 0.0]), sides)
    amplitudes = np.hypot(y[:2], y[2:4] * p.period / (2 * pi))
    if amplitudes.max() < p.limit[0]:
        return False
    y[1], y[3] = y[0] + 1e-4, y[2]
    _, largest = spreads(p, p.period / STEPS, y, sides)
    return bool(largest[-1] < largest[1] and largest.max() < 1e-2)


def names_of(at: ValueRhythms) -> list[str]:
    """The name of the rhythm that each start of a map ends in at a value."""
    names = {rhythm.branch: rhythm.name for rhythm in at.rhythms if rhythm.branch is not None}
    others = [rhythm.name for rhythm in at.rhythms if rhythm.branch is None and rhythm.count]
    names |= dict(zip(sorted(set(at.of_start) - names.keys() - {-1}), others, strict=True))
    return [names.get(end, "undecided").split(",")[0] for end in at.of_start]


def compare(count: int, masses: tuple[float, ...]) -> float:
    """The least share of starts that end in the same rhythm; counts at every mass of the base (kg), map, then here."""
    scene = load("metronomes")
    variation = replace(parse_variations(["support.mass=0.05:0.2:2"])[0], values=masses)
    begun = perf_counter()
    with workers_at(None, None) as crew:
        rhythms = find_rhythms(scene, variation, members=count, crew=crew)
    mapped = perf_counter() - begun
    motion = rhythm_starts(scene, count, rhythms.largest_deg)
    starts = np.ascontiguousarray(np.column_stack((motion.links, motion.link_rates, np.zeros((count, 2)))))
    endings(metronomes(1.0), 1.0, starts[:0])  # compiles
    mine, begun = [], perf_counter()
    for mass in masses:
        p = metronomes(mass)
        mine.append([NAMES[end] for end in endings(p, p.period / STEPS, starts)])
    solved = perf_counter() - begun
    theirs = [names_of(at) for at in rhythms.values]
    shares = [sum(map(eq, *pair)) / count for pair in zip(mine, theirs, strict=True)]
    shown = [name for name in NAMES if any(name in ends for ends in (*mine, *theirs))]
    print(f"| base (kg) | {' | '.join(shown)} | in the same rhythm |\n|---:|{'---:|' * (len(shown) + 1)}")
    for mass, here, there, share in zip(masses, mine, theirs, shares, strict=True):
        cells = " | ".join(f"{there.count(name)}, {here.count(name)}" for name in shown)
        print(f"| {mass:g} | {cells} | {100 * share:.4g} % |")
    print(f"{count} starts a value: by the map in {mapped:.1f} s, by these equations in {solved:.1f} s", flush=True)
    return min(shares)


def borders() -> bool:
    """Whether the map bounds the motion in phase of Huygens' clocks where these equations do, to a step."""
    begun = perf_counter()
    variation = replace(parse_variations(["support.mass=5:27:2"])[0], values=BEAMS)
    with workers_at(None, None) as crew:
        rhythms = find_rhythms(load("huygens"), variation, members=24, largest_deg=14.0, crew=crew)
    events = [event.value for event in rhythms.births if event.name == "in phase" and event.kind != "undecided"]
    stable = [is_stable_in_phase(beam) for beam in BEAMS]
    counts = [names_of(at).count("in phase") for at in rhythms.values]
    print("\nHuygens' clocks in phase\n| beam (kg) | " + " | ".join(f"{beam:g}" for beam in BEAMS) + " |")
    print("| these equations | " + " | ".join("stable" if here else "–" for here in stable) + " |")
    print("| starts of the map | " + " | ".join(map(str, counts)) + " |")
    steps = [step for step, (here, there) in zip(pairwise(BEAMS), pairwise(stable), strict=True) if here != there]
    places = ", ".join(f"{event:.4f}" for event in events)
    print(f"changes between {steps} kg; events of the map: {places} kg; {perf_counter() - begun:.1f} s")
    return len(steps) == len(events) and all(low < v < high for (low, high), v in zip(steps, events, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="40 starts at two values, and no borders")
    quick = parser.parse_args().quick
    if quick:
        sys.exit(compare(40, (0.06, 0.12)) < LEAST_SHARE)
    least = min(compare(1000, MASSES), compare(40, BESIDE_THE_BORDER))
    sys.exit(not borders() or least < LEAST_SHARE)


if __name__ == "__main__":
    main()
