"""Huygens' two clocks on a beam: on which beams antiphase survives, and where a clock stops.

    python benchmarks/sync/huygens.py [--quick]

After Bennett, Schatz, Rockwood & Wiesenfeld, Proc. R. Soc. A 458, 563 (2002), who found antiphase on heavy beams and
`beating death' on light ones: the energy that the clocks exchange reduces the amplitude of one below that needed by its
escapement, and it stops.  The numbers are those of the shipped scene `huygens` and ours; the mass of the beam is
varied, and with it the ratio m/(M + 2m).  A clock alone needs

    π d ω a² = 2 P ω √(a² − γ₀²)      (loss and supply per period, small angles)

and so has two amplitudes a: the larger is its steady one, below the smaller it dies out.  Both meet at a = √2 γ₀, so
that a damper above P/πγ₀ stops it.  In phase the damper c of the beam adds to that of each clock

    d_in − d = 2 c (m l/(M + 2m))²/(1 + η²),      η = c/((M + 2m) ω),

so that both clocks stop on beams lighter than where d_in = P/πγ₀ (our derivation, small angles, ω of a clock alone;
kicks that come before the extreme speed a clock up a little, which is neglected).  There both clocks stop; one alone
stops here on heavy beams, in beats from starts between the two phases.
"""

from __future__ import annotations

import argparse
import math
from typing import Literal

import numpy as np

from modal import Cart, Scene, load
from modal.scene import Escapement
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

Outcome = Literal["antiphase", "in phase", "one stops", "both stop", "unsettled"]
SECONDS, LATE = 300.0, 30.0
SETTLED = 0.98
MASSES = (0.1, 0.3, 1.0, 3.0, 6.0, 10.0, 20.0)
STARTS = ((7.0, -6.0), (7.0, -4.0), (7.0, 4.0), (7.0, 6.0))


def on(mass: float) -> Scene:
    """The shipped clocks on a beam of another mass (kg) with the same damper."""
    scene = load("huygens")
    assert isinstance(scene.support, Cart)
    return scene.replace(support=scene.support.replace(mass=mass))


def amplitudes_deg(scene: Scene) -> tuple[float, float]:
    """The smallest and the steady amplitude of a clock alone, from the balance of energy."""
    link = scene.pendulum[0].links[0]
    assert isinstance(link.drive, Escapement)
    angle, K = math.radians(link.drive.angle_deg), 2 * link.drive.impulse / (math.pi * link.damping)
    root = math.sqrt(K**4 - 4 * K**2 * angle**2)
    return math.degrees(math.sqrt((K**2 - root) / 2)), math.degrees(math.sqrt((K**2 + root) / 2))


def lightest(scene: Scene) -> float:
    """Mass (kg) of the beam below which clocks in phase stop, as derived."""
    link, cart = scene.pendulum[0].links[0], scene.support
    assert isinstance(link.drive, Escapement)
    assert isinstance(cart, Cart)
    spare = link.drive.impulse / (math.pi * math.radians(link.drive.angle_deg)) - link.damping
    slow = cart.damping / math.sqrt(scene.gravity / link.length)
    total = math.sqrt(2 * cart.damping * (link.mass * link.length) ** 2 / spare - slow**2)
    return total - 2 * link.mass


def lightest_simulated(relative: float = 0.01, seconds: float = 300.0) -> float:
    """The same by bisection of runs that begin in phase."""
    low, high = (lightest(load("huygens")) * factor for factor in (0.7, 1.4))
    while high - low > relative * high:
        middle = (low + high) / 2
        stop = outcome(on(middle), (7.0, 7.0), seconds) == "both stop"
        low, high = (middle, high) if stop else (low, middle)
    return (low + high) / 2


def outcome(scene: Scene, start: tuple[float, float], seconds: float = SECONDS) -> Outcome:
    """The outcome for two clocks released at these angles (deg)."""
    times = np.linspace(seconds - LATE, seconds, 3001)
    run = simulate(scene, seconds, tolerance=1e-7, start=state_at_rest(scene, start), output=times)
    going = np.unique(run.kicks.link[run.kicks.time > seconds - LATE])
    if len(going) < 2:
        return ("both stop", "one stops")[len(going)]
    alike = float(np.corrcoef(run.motion.links[1:].T)[0, 1])
    return "in phase" if alike > SETTLED else "antiphase" if alike < -SETTLED else "unsettled"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="two beams and two starts only")
    quick = parser.parse_args().quick
    masses, starts = ((0.1, 10.0), STARTS[1:3]) if quick else (MASSES, STARTS)
    scene = load("huygens")
    m = scene.pendulum[0].links[0].mass
    print("a clock alone needs {:.2f}° and swings {:.2f}°".format(*amplitudes_deg(scene)))
    simulated = lightest_simulated(0.1 if quick else 0.01)
    print(f"in phase they stop below M = {lightest(scene):.2f} kg, as derived, and {simulated:.2f} kg in the simulator")
    print("M (kg)  m/(M+2m)" + "".join(f"{f'{a:g}°, {b:g}°':>12}" for a, b in starts))
    for mass in masses:
        cells = "".join(f"{outcome(on(mass), start, 200.0 if quick else SECONDS):>12}" for start in starts)
        print(f"{mass:6g} {m / (mass + 2 * m):9.4f}{cells}")


if __name__ == "__main__":
    main()
