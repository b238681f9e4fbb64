"""Time of a branch of 100 periodic orbits with their multipliers: three different double pendula on a cart.

Then that of two folded resonances, of one link on a shaken support and of such pendula on a cart that is pushed,
with the flows of one period that an orbit of them takes.

    python benchmarks/orbits.py

Times are processor seconds of one core.  The rival is
SciPy's DOP853 with y and the variational equations as one vector, from the same derivatives at the same tolerance.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from math import degrees
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from modal import Bob, Cart, Pendulum, Rod, Scene
from modal.scene import Moved, SineForce, SineMotion
from modal.scene.parameters import parse_variations
from modal.types import Floats
from nonlinear.orbits import Branch, Flow, follow_forced_orbits, nonlinear_mode

LENGTHS = ((1.0, 1.0), (1.05, 0.97), (0.9, 1.1))
SCENE = Scene(
    gravity=9.81,
    support=Cart(mass=20.0),
    pendulum=[Pendulum(links=[Rod(mass=1.0, length=a), Rod(mass=1.0, length=b)]) for a, b in LENGTHS],
)
ORBITS, FEW, STEP = 100, 10, 0.02


def branch(number: int, orbits: int) -> Branch:
    """The first orbits of a mode, at most a hundredth of a turn apart."""
    return nonlinear_mode(SCENE, number, 2.5, max_orbits=orbits, longest=STEP)


def by_scipy(followed: Branch) -> float:
    """Seconds of one flow over a quarter of a period with its derivative."""
    orbit = followed.orbits[-1]
    equations, size = orbit.flow.equations, len(orbit.y)

    def rate(_: float, both: Floats) -> Floats:
        f, J = equations.linearize(both[:size])
        return np.concatenate((f, (J @ both[size:].reshape(size, size)).ravel()))

    begun = process_time()
    start = np.concatenate((orbit.y, np.eye(size).ravel()))
    solve_ivp(rate, (0, orbit.period / 4), start, "DOP853", rtol=1e-12, atol=1e-12)
    return process_time() - begun


LINK = Bob(mass=1.0, length=1.0, damping=0.05)
ONE = Scene(
    gravity=9.81,
    support=Moved(motion=SineMotion(amplitude=0.02, frequency_hz=0.5)),
    pendulum=[Pendulum(links=[LINK])],
)
PAIRS = [Pendulum(links=[LINK.replace(length=1 + k / 50, damping=0.03)] * 2) for k in range(3)]
PUSHED = Scene(
    gravity=9.81,
    support=Cart(mass=5.0, damping=0.5),
    pendulum=PAIRS,
    force=[SineForce(on="cart", amplitude=1.0, frequency_hz=0.5)],
)
RESONANCES = {
    "one link": (ONE, "support.motion.frequency_hz=0.40:0.55:2"),
    "three double pendula": (PUSHED, "force[0].frequency_hz=0.30:0.50:2"),
}


def resonance(name: str) -> tuple[float, int, int, int]:
    """Seconds, orbits, flows and folds of one of the resonances."""
    flows, plain = [0], Flow.__call__

    def counted(self: Flow, *words: Any, **more: Any) -> Any:
        flows[0] += 1
        return plain(self, *words, **more)

    scene, words = RESONANCES[name]
    Flow.__call__ = counted  # type: ignore[method-assign]
    begun = process_time()
    branches = follow_forced_orbits(scene, parse_variations([words])[0])
    spent, Flow.__call__ = process_time() - begun, plain  # type: ignore[method-assign]
    return (
        spent,
        sum(len(followed.orbits) for followed in branches),
        flows[0],
        sum(len(followed.special) for followed in branches),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="one mode, few orbits, the resonance of one link")
    quick = parser.parse_args().quick
    many = FEW if quick else ORBITS
    nonlinear_mode(SCENE, 2, 0.05)
    print(f"{'mode':>4} {'orbits':>7} {'s':>7} {'orbits/s':>9} {'to (deg)':>9} {'closes to':>10}")
    for number in (4,) if quick else (2, 4, 5):
        begun = process_time()
        followed = branch(number, many)
        spent, count = process_time() - begun, len(followed.orbits)
        worst = max(orbit.residual for orbit in followed.orbits)
        widest = degrees(followed.amplitude[-1])
        print(f"{number:4} {count:7} {spent:7.2f} {count / spent:9.0f} {widest:9.1f} {worst:10.0e}")
    followed = branch(4, many)
    begun = process_time()
    orbit = followed.orbits[-1]
    orbit.flow(orbit.y, np.eye(len(orbit.y)), orbit.period / 4)
    ours = process_time() - begun
    rival = by_scipy(followed)
    print(f"a quarter period with its derivative: {ours:.3f} s; by SciPy {rival / ours:.1f} times")
    for name in [*RESONANCES][: 1 if quick else None]:
        spent, orbits, flows, folds = resonance(name)
        told = f"{orbits} orbits, {flows / orbits:.1f} flows of a period each, {folds} folds"
        print(f"resonance of {name}: {spent:.1f} s, {told}")


if __name__ == "__main__":
    main()
