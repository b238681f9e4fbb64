"""Many phases of sticking: a block on a spring under a periodic force, which sticks and slips again and again.

    python benchmarks/stick_slip.py [--periods 25000]

m = k = 1, the force cos(1.5 t) and the friction 0.8 make two phases of sticking a period, four changes of state: 25,000
periods have a hundred thousand changes.  Printed are the changes, the seconds, and what shows that nothing drifts: the
motion of the last period against an early one, the energy's drift, and the spread of the phases' lengths.
"""

from __future__ import annotations

import argparse
from math import cos, pi
from time import perf_counter

import numpy as np

from modal.scene import Bob, Cart, Pendulum, Scene
from nonlinear import simulate
from nonlinear.system import AppliedForces, State

RATE, FRICTION, SAMPLES, SETTLED = 1.5, 0.8, 20, 50


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--periods", type=int, default=25_000)
    periods = parser.parse_args().periods
    light = Pendulum(links=[Bob(mass=1e-12, length=1e3)])
    scene = Scene(gravity=9.81, support=Cart(mass=1.0, stiffness=1.0, friction=FRICTION), pendulum=[light])
    times = np.linspace(0.0, 2 * pi / RATE * periods, SAMPLES * periods + 1)
    begun = perf_counter()
    run = simulate(
        scene,
        times[-1],
        start=State(np.zeros(1), np.zeros(1)),
        load=lambda time, state: AppliedForces(cos(RATE * time)),
        output=times,
        tolerance=1e-8,
    )
    spent = perf_counter() - begun
    cart = run.motion.cart[:-1].reshape(periods, SAMPLES)
    lengths = (run.friction.end - run.friction.begin)[2 * SETTLED : -2]
    changes = 2 * len(run.friction.link)
    print(f"{changes} changes of state in {spent:.0f} s, {1e3 * spent / changes:.2f} ms each, {run.run.steps} steps")
    apart = float(np.abs(cart[-1] - cart[SETTLED]).max())
    print(f"last period against period {SETTLED}: {apart:.1e} m of {np.ptp(cart[-1]):.3g} m")
    print(f"energy: drift {run.energy_drift():.1e}; phases: {lengths.mean():.9f} s, spread {np.ptp(lengths):.1e} s")


if __name__ == "__main__":
    main()
