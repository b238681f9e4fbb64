"""Two self-excited double pendula on one beam: which of the four oscillatory modes are limit cycles that attract.

    python benchmarks/sync/koluda.py [--quick]

After Koluda, Perlikowski, Czolczynski & Kapitaniak (2014, arXiv 1402.1375), who found four synchronous configurations:
both pendula slow or fast, in antiphase with the beam still or in phase with the beam moving.  These are the four
oscillatory modes of the pendula; the numbers are those of the shipped scene `clocks-double` and ours.  A run begins in
the shape of one mode and a little of all others, and ends in the mode that holds most of the energy

    E_r = ((φ_rᵀM q')² + ω_r² (φ_rᵀM q)²)/2,        φ_rᵀMφ_s = δ_rs.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from scipy.linalg import eigh

from modal import Cart, Scene, load, matrices
from modal.rig import Floats
from nonlinear.simulation import simulate
from nonlinear.state import State

NAMES = ("slow, beam still", "slow, beam moves", "fast, beam still", "fast, beam moves")
SECONDS, LATE, TOP_DEG, ASIDE = 400.0, 20.0, 8.0, 0.05
MASSES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
LOWER = (0.1, 0.2, 0.5, 1.0)


def varied(beam: float, lower: float) -> Scene:
    """The shipped scene with other masses (kg) of the beam and of both lower bobs."""
    scene = load("clocks-double")
    assert isinstance(scene.support, Cart)
    top, low = scene.pendulum[0].links
    links = (top, low.model_copy(update={"mass": lower}))
    pendula = tuple(pendulum.model_copy(update={"links": links}) for pendulum in scene.pendulum)
    return scene.model_copy(update={"support": scene.support.model_copy(update={"mass": beam}), "pendulum": pendula})


def modes(scene: Scene) -> tuple[Floats, Floats, Floats]:
    """ω (4,), shapes (5, 4) and M of the modes in which pendula swing, in the order of NAMES."""
    found = matrices(scene)
    squared, shapes = eigh(found.K, found.M)
    oppositely = np.sum(shapes[1:3] * shapes[3:5], axis=0) < 0
    order = [*np.flatnonzero(oppositely), *np.flatnonzero(~oppositely)[1:]]  # the lowest in phase is the beam's own
    chosen = [order[0], order[2], order[1], order[3]]
    return np.sqrt(squared[chosen]), shapes[:, chosen], found.M


def shares(scene: Scene, start: int, seconds: float = SECONDS) -> Floats:
    """Of the energy of the four modes at the end of a run that begins in one of them, (4,)."""
    omega, shapes, M = modes(scene)
    scale = math.radians(TOP_DEG) / np.abs(shapes[[1, 3]]).max(axis=0)
    q = shapes @ (scale * np.where(np.arange(4) == start, 1.0, ASIDE))
    begin = State(q[1:], np.zeros(4), float(q[0]), 0.0)
    times = np.linspace(seconds - LATE, seconds, 1001)
    motion = simulate(scene, seconds, tolerance=1e-7, start=begin, output=times).motion.at(slice(1, None))
    place = np.column_stack((motion.cart, motion.links)) @ M @ shapes
    speed = np.column_stack((motion.cart_rate, motion.link_rates)) @ M @ shapes
    energy = np.mean(speed**2 + (omega * place) ** 2, axis=0)
    return np.asarray(energy / energy.sum())


def attracts(scene: Scene, start: int, seconds: float = SECONDS) -> str:
    """`stays` where a mode keeps nine tenths of the energy, else the number of the mode that takes over, or `mixed`."""
    found = shares(scene, start, seconds)
    winner = int(np.argmax(found))
    return "mixed" if found[winner] < 0.9 else "stays" if winner == start else f"to {winner + 1}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="two beams only")
    quick = parser.parse_args().quick
    grid = [(2.0, 0.5), (20.0, 0.5)] if quick else [*((beam, 0.5) for beam in MASSES), *((10.0, low) for low in LOWER)]
    print("beam (kg)  lower bob (kg)" + "".join(f"{f'{k + 1} {name}':>20}" for k, name in enumerate(NAMES)))
    for beam, lower in grid:
        scene = varied(beam, lower)
        cells = "".join(f"{attracts(scene, start, 150.0 if quick else SECONDS):>20}" for start in range(4))
        print(f"{beam:9g}  {lower:14g}{cells}")


if __name__ == "__main__":
    main()
