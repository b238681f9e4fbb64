"""Two self-excited double pendula on one beam: which of the four oscillatory modes are limit cycles that attract.

    python benchmarks/sync/koluda.py [--quick]

After Koluda, Perlikowski, Czolczynski & Kapitaniak (2014, arXiv 1402.1375), who found four synchronous configurations:
both pendula slow or fast, in antiphase with the beam still or in phase with the beam moving.  These are the four
oscillatory modes of the pendula; the numbers are those of the shipped scene `clocks-double` and ours.  A run begins in
the shape of one mode and a little of all others.  With

    E_r = ((φ_rᵀM q')² + ω_r² (φ_rᵀM q)²)/2,        φ_rᵀMφ_s = δ_rs,

that mode persists if its share of the energy is larger at the end than at the start.  Every run is listed with the
prediction of the averaged equations for the configuration: stable, unstable, or none.
"""

from __future__ import annotations

import argparse
import math
from functools import cache

import numpy as np
from scipy.linalg import eigh

from modal import Cart, Scene, load, matrices
from modal.scene.parameters import parse_variations
from modal.types import Floats
from nonlinear.averaging import average, relative_equilibria
from nonlinear.simulation import simulate
from nonlinear.synchronization import branches_text, follow_branches
from nonlinear.system import State

NAMES = ("slow, beam still", "slow, beam moves", "fast, beam still", "fast, beam moves")
SECONDS, LATE, TOP_DEG, ASIDE = 400.0, 20.0, 8.0, 0.05
WINNER, PURE = 0.9, 0.99  # least share of the mode that takes over, and of that of a configuration
MASSES = (1.0, 2.0, 4.0, 5.5, 7.0, 8.5, 10.0, 20.0, 50.0)
LOWER = (0.1, 0.2, 0.5, 1.0)
RANGE = "support.mass=1:50:6log"


def varied(beam: float, lower: float) -> Scene:
    """The shipped scene with other masses (kg) of the beam and of both lower bobs."""
    scene = load("clocks-double")
    assert isinstance(scene.support, Cart)
    top, low = scene.pendulum[0].links
    links = (top, low.replace(mass=lower))
    pendula = tuple(pendulum.replace(links=links) for pendulum in scene.pendulum)
    return scene.replace(support=scene.support.replace(mass=beam), pendulum=pendula)


def modes(scene: Scene) -> tuple[Floats, Floats, Floats]:
    """ω (4,), shapes (5, 4) and M of the modes in which pendula swing, in the order of NAMES."""
    linear = matrices(scene)
    squared, shapes = eigh(linear.K, linear.M)
    oppositely = np.sum(shapes[1:3] * shapes[3:5], axis=0) < 0
    order = [*np.flatnonzero(oppositely), *np.flatnonzero(~oppositely)[1:]]  # the lowest in phase is the beam's own
    chosen = [order[0], order[2], order[1], order[3]]
    return np.sqrt(squared[chosen]), shapes[:, chosen], linear.M


@cache
def shares(scene: Scene, start: int, seconds: float = SECONDS) -> Floats:
    """Energy shares of the four modes at the start and at the end of a run that begins in one of them, (2, 4)."""
    omega, shapes, M = modes(scene)
    size = math.radians(TOP_DEG) / np.abs(shapes[[1, 3]]).max(axis=0) * np.where(np.arange(4) == start, 1.0, ASIDE)
    q = shapes @ size
    begin = State(q[1:], np.zeros(4), float(q[0]), 0.0)
    times = np.linspace(seconds - LATE, seconds, 1001)
    motion = simulate(scene, seconds, tolerance=1e-7, start=begin, output=times).motion.at(slice(1, None))
    place = np.column_stack((motion.cart, motion.links)) @ M @ shapes
    speed = np.column_stack((motion.cart_rate, motion.link_rates)) @ M @ shapes
    energy = np.array([(omega * size) ** 2, np.mean(speed**2 + (omega * place) ** 2, axis=0)])
    return np.asarray(energy / energy.sum(axis=1, keepdims=True))


def attracts(scene: Scene, start: int, seconds: float = SECONDS) -> str:
    """`stays` where all other modes decay, else the number of the one that takes over, or `mixed`."""
    begun, ended = shares(scene, start, seconds)
    winner = int(np.argmax(ended))
    if winner == start:
        return "stays" if ended[start] > begun[start] else "mixed"
    return f"to {winner + 1}" if ended[winner] > WINNER else "mixed"


def averages(scene: Scene) -> tuple[str, ...]:
    """The prediction of the averaged equations for each mode, in the order of NAMES: stable, unstable, or none."""
    fates = {
        equilibrium.row: equilibrium.is_stable
        for equilibrium in relative_equilibria(average(scene))
        if equilibrium.share.max() > PURE
    }
    rows = 1 + np.argsort(np.argsort(modes(scene)[0]))  # row 0 of the table is the beam's own
    return tuple("none" if row not in fates else "stable" if fates[row] else "unstable" for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one beam only, and no ranges")
    quick = parser.parse_args().quick
    grid = [(5.5, 0.5)] if quick else [*((beam, 0.5) for beam in MASSES), *((10.0, low) for low in LOWER)]
    alike = 0
    print("beam (kg)  lower bob (kg)" + "".join(f"{f'{k + 1} {name}':>20}" for k, name in enumerate(NAMES)))
    for beam, lower in grid:
        scene = varied(beam, lower)
        runs = [attracts(scene, start, 150.0 if quick else SECONDS) for start in range(4)]
        said = averages(scene)
        alike += sum((run == "stays") == (fate == "stable") for run, fate in zip(runs, said, strict=True))
        cells = "".join(f"{f'{run}, {fate}':>20}" for run, fate in zip(runs, said, strict=True))
        print(f"{beam:9g}  {lower:14g}{cells}", flush=True)
    print(f"simulated, averaged: {alike} of {4 * len(grid)} agree")
    if not quick:
        print("\n" + branches_text(follow_branches(load("clocks-double"), parse_variations([RANGE])[0])), end="")


if __name__ == "__main__":
    main()
