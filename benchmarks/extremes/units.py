"""The same scene in other units: masses × a, lengths × b, gravity × c, and time × √(b/c).

With powers of two and the same second every number of a run is the other's times a power of two, except where a dense
solve rounds differently because lengths change the order of its pivots.  Where the second changes, so does SciPy's
first step: its rule, (0.01/max(|f|, |f'|))^(1/9), has no unit of time; the two runs then differ within the tolerance.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from modal import Bob, Cart, Pendulum, Rod, Scene
from nonlinear import simulate
from nonlinear.system import State

FACTORS = {
    "masses by 2^40": (2.0**40, 1.0, 1.0),
    "the same second": (2.0**40, 2.0**20, 2.0**20),
    "another second": (2.0**40, 2.0**21, 2.0**-9),
    "g, mm, ms": (1e3, 1e3, 1e-3),
    "t, km, s": (1e-3, 1e-3, 1e-3),
}
WAYS = (
    ("minimal", "DOP853"), ("minimal", "Radau"), ("hamiltonian", "DOP853"), ("maximal", "DOP853"), ("minimal", "taylor")
)  # fmt: skip
DURATION = 3.0


class Compared(NamedTuple):
    """Whether all steps are the same, whether all angles are identical, and their largest difference (rad)."""

    factors: str
    way: str
    steps: tuple[int, int]
    identical: bool
    apart: float


def scene(a: float = 1.0, b: float = 1.0, c: float = 1.0) -> Scene:
    """A cart with a spring and a damper, a double rod and a bob with springs and dampers, in scaled units."""
    moment, second = a * b * b, sqrt(b / c)
    joint = {"damping": 0.1 * moment / second, "stiffness": 2.0 * a * b * c}
    chains = [Rod(mass=a, length=b), Rod(mass=0.5 * a, length=0.7 * b, **joint)], [Bob(mass=a, length=1.3 * b, **joint)]
    cart = Cart(mass=3.0 * a, damping=0.2 * a / second, stiffness=5.0 * a * c / b)
    return Scene(gravity=9.81 * c, support=cart, pendulum=[Pendulum(links=links) for links in chains])


def compared(name: str, form: str, method: str) -> Compared:
    a, b, c = FACTORS[name]
    start = State(np.array([1.0, 0.5, -0.8]), np.zeros(3))
    plain, scaled = (
        simulate(each, duration, start=start, form=form, method=method, output=50)
        for each, duration in ((scene(), DURATION), (scene(a, b, c), DURATION * sqrt(b / c)))
    )
    apart = np.abs(plain.motion.links - scaled.motion.links).max()
    return Compared(name, f"{form}/{method}", (plain.run.steps, scaled.run.steps), bool(apart == 0), float(apart))


def report() -> str:
    pairs = [compared(name, *way) for name in FACTORS for way in WAYS]
    return "\n".join(
        f"{pair.factors:22} {pair.way:20} steps {pair.steps[0]:4} {pair.steps[1]:4}  "
        + ("identical to the last bit" if pair.identical else f"apart by {pair.apart:.1e} rad")
        for pair in pairs
    )
