"""Time of a branch of 100 periodic orbits with their multipliers: three different double pendula on a cart.

    python benchmarks/orbits.py

Times are processor seconds of one core.  The rival is
SciPy's DOP853 with y and the variational equations as one vector, from the same derivatives at the same tolerance.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from math import degrees
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

from modal import Cart, Pendulum, Rod, Scene
from modal.types import Floats
from nonlinear.orbits import Branch, nonlinear_mode

LENGTHS = ((1.0, 1.0), (1.05, 0.97), (0.9, 1.1))
SCENE = Scene(
    gravity=9.81,
    support=Cart(mass=20.0),
    pendulum=[Pendulum(links=[Rod(mass=1.0, length=a), Rod(mass=1.0, length=b)]) for a, b in LENGTHS],
)
ORBITS, STEP = 100, 0.02


def branch(number: int) -> Branch:
    """The first orbits of a mode, at most a hundredth of a turn apart."""
    return nonlinear_mode(SCENE, number, 2.5, most=ORBITS, longest=STEP)


def by_scipy(found: Branch) -> float:
    """Seconds of one flow over a quarter of a period with its derivative."""
    orbit = found.orbits[-1]
    equations, size = orbit.flow.equations, len(orbit.y)

    def rate(_: float, both: Floats) -> Floats:
        f, J = equations.linearized(both[:size])
        return np.concatenate((f, (J @ both[size:].reshape(size, size)).ravel()))

    begun = process_time()
    start = np.concatenate((orbit.y, np.eye(size).ravel()))
    solve_ivp(rate, (0, orbit.period / 4), start, "DOP853", rtol=1e-12, atol=1e-12)
    return process_time() - begun


def main() -> None:
    nonlinear_mode(SCENE, 2, 0.05)
    print(f"{'mode':>4} {'orbits':>7} {'s':>7} {'orbits/s':>9} {'to (deg)':>9} {'closes to':>10}")
    for number in (2, 4, 5):
        begun = process_time()
        found = branch(number)
        spent, count = process_time() - begun, len(found.orbits)
        worst = max(orbit.residual for orbit in found.orbits)
        widest = degrees(found.amplitude[-1])
        print(f"{number:4} {count:7} {spent:7.2f} {count / spent:9.0f} {widest:9.1f} {worst:10.0e}")
    found = branch(4)
    begun = process_time()
    orbit = found.orbits[-1]
    orbit.flow(orbit.y, np.eye(len(orbit.y)), orbit.period / 4)
    own = process_time() - begun
    rival = by_scipy(found)
    print(f"a quarter period with its derivative: {own:.3f} s; by SciPy {rival / own:.1f} times")


if __name__ == "__main__":
    main()
