"""Two metronomes on a free base: where antiphase is stable, derived and found in the full simulator.

    python benchmarks/sync/pantaleone.py [--quick]

The pendulum with van der Pol torque on a light base is Pantaleone's (Am. J. Phys. 70, 992 (2002)).  The averaging is
ours.  With τ = ω t, S = sin θ₁ + sin θ₂, coupling β = m c b/((M + 2m)(I + m c²)) of first moment b = m c, strength
μ = e/((I + m c²) ω), limit γ₀, and η = c_c/((M + 2m) ω) of a base with a damper,

    θ_j'' + sin θ_j = μ (1 − θ_j²/γ₀²) θ_j' + cos θ_j · β S''/(1 − iη)        (the last factor at frequency 1).

θ_j = Re z_j exp(iτ), averaged to first order in β, μ and γ₀²:

    z_j' = (μ/2)(1 − |z_j|²/4γ₀²) z_j − (i/16)|z_j|² z_j + (iε − κ)(z₁ + z₂),   ε = β/2(1 + η²),   κ = η ε.

Disturbances of antiphase, |z| = 2γ₀, in the difference of amplitudes and in phase have the determinant
4(ε² + κ² + κμ/2 − ε γ₀²/4) and a negative trace, those of the phase alike without a damper 4ε(ε + γ₀²/4):

    antiphase is stable where γ₀² < 2 (β + μ η);        without a damper in phase is always stable.

The smaller β and μ together, the nearer the simulator comes (−4 % at 0.01 and 0.02, −0.7 % at 0.002 and 0.004).

In the simulator the largest multiplier over one period of the antiphase cycle is computed from small disturbances that
move the base, and γ₀ is bisected until it is 1.
"""

from __future__ import annotations

import argparse
import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from modal import Body, Cart, InitialCondition, Pendulum, Scene
from modal.scene import VanDerPol
from modal.types import Floats
from nonlinear.simulation import simulate
from nonlinear.system import State, level_crossing, system_of

G, MASS, CENTRE, INERTIA = 9.81, 0.022, 0.012, 4.5e-6
MOMENT = INERTIA + MASS * CENTRE**2
OMEGA = math.sqrt(MASS * G * CENTRE / MOMENT)
SMALL = 1e-5  # perturbation (rad)


class Base(NamedTuple):
    """Dimensionless coupling β, drive μ and damping η."""

    coupling: float
    drive: float = 0.02
    damping: float = 0.0

    @property
    def limit_deg(self) -> float:
        """γ₀ (deg) up to which antiphase is stable, as derived."""
        return math.degrees(math.sqrt(2 * (self.coupling + self.drive * self.damping)))

    def scene(self, limit_deg: float, start: tuple[float, float] = (10.0, -10.0)) -> Scene:
        """Two metronomes with this γ₀."""
        total = (MASS * CENTRE) ** 2 / (MOMENT * self.coupling)
        drive = VanDerPol(strength=self.drive * MOMENT * OMEGA, angle_deg=limit_deg)
        link = Body(mass=MASS, length=0.1, centre=CENTRE, inertia=INERTIA, drive=drive)
        cart = Cart(mass=total - 2 * MASS, damping=self.damping * total * OMEGA)
        pendula = tuple(Pendulum(links=(link,), start=InitialCondition(angles_deg=(angle,))) for angle in start)
        return Scene(gravity=G, support=cart, pendulum=pendula)


def cycle(scene: Scene) -> tuple[float, float]:
    """Speed (rad/s) of one metronome as it passes the vertical on a still base, and its period (s)."""
    alone = Scene(gravity=G, pendulum=scene.pendulum[:1])
    drive = scene.pendulum[0].links[0].drive
    assert isinstance(drive, VanDerPol)
    seconds = 20 * MOMENT / drive.strength
    start = State(np.array([0.0]), np.array([2 * math.radians(drive.angle_deg) * OMEGA]))
    passing = level_crossing(system_of(alone), "theta[1,1]", direction=1)
    run = simulate(alone, seconds, method="DOP853", tolerance=1e-11, start=start, events=[passing], output=2)
    (_, before, _), (_, last, state) = run.happenings[-2:]
    return float(state.link_rates[0]), last - before


def multiplier(base: Base, limit_deg: float) -> float:
    """The largest multiplier over one period of antiphase, for perturbations in which the metronomes move alike."""
    scene = base.scene(limit_deg)
    speed, period = cycle(scene)
    units = np.array([1.0, OMEGA, CENTRE * OMEGA])[: 3 if base.damping else 2]
    columns = [_moved(scene, period, speed, step) for step in np.diag(units * SMALL)]
    return float(np.abs(np.linalg.eigvals(np.array(columns).T / SMALL / units[:, None])).max())


def _moved(scene: Scene, period: float, speed: float, step: Floats) -> Floats:
    """Half the difference after one period between two starts perturbed either way."""
    ends = []
    for sign in (1, -1):
        angle, rate, cart_rate = sign * np.pad(step, (0, 3 - len(step)))
        if len(step) == 2:  # a free base keeps its momentum, here zero
            cart_rate = -MASS * CENTRE * 2 * rate / (scene.support.mass + 2 * MASS)
        start = State(np.array([angle, angle]), np.array([speed + rate, -speed + rate]), 0.0, cart_rate)
        run = simulate(scene, period, method="DOP853", tolerance=1e-12, start=start, output=2)
        end = run.final
        ends.append(np.array([end.links.mean(), end.link_rates.mean(), end.cart_rate]))
    return ((ends[0] - ends[1]) / 2)[: len(step)]


def threshold(base: Base) -> float:
    """γ₀ (deg) at which antiphase loses its stability in the simulator."""
    guess = base.limit_deg
    return float(brentq(lambda limit: multiplier(base, limit) - 1, 0.85 * guess, 1.15 * guess, xtol=2e-3 * guess))


def settled(base: Base, limit_deg: float, start: tuple[float, float], seconds: float) -> float:
    """Correlation of both angles over the last tenth of a run: 1 in phase, −1 in antiphase."""
    times = np.linspace(0.9 * seconds, seconds, 2001)
    run = simulate(base.scene(limit_deg, start), seconds, tolerance=1e-8, output=times)
    return float(np.corrcoef(run.motion.links[1:].T)[0, 1])


ALL = (
    Base(0.01),
    Base(0.01, damping=0.4),
    Base(0.002, 0.004),
    Base(0.002),
    Base(0.005),
    Base(0.02),
    Base(0.04),
    Base(0.01, 0.005),
    Base(0.01, 0.04),
    Base(0.01, damping=1),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one base only")
    quick = parser.parse_args().quick
    print("    β      μ     η   γ₀ derived (°)   γ₀ simulated (°)   difference")
    for base in ALL[: 1 if quick else None]:
        simulated, derived = threshold(base), base.limit_deg
        words = f"{base.coupling:6.3f} {base.drive:6.3f} {base.damping:5.2f} {derived:12.3f} {simulated:18.3f}"
        print(f"{words} {100 * (simulated / derived - 1):13.1f} %")
    print("\nStart 10° and −9° on β = 0.01, η = 0: correlation of both angles when settled")
    for limit in (0.7, 1.4):
        degrees = limit * ALL[0].limit_deg
        print(f"γ₀ = {degrees:.2f}°: {settled(ALL[0], degrees, (10, -9), 400):+.3f}")


if __name__ == "__main__":
    main()
