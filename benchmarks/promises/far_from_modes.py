"""Magnitudes of all frequency responses of random scenes, 1e-6 to 1e6 times the modes, right to 1e-10.

The truth is computed in 90 digits from Cartesian rows and whole matrices (`tests/support/response_oracle.py`), which
share no line with the package.  Every case is a fresh scene, plain, with springs, dampers, drag or damping ratios, with
up to eight stages, and three frequencies; every input and output that it has counts, also near zeros, where 1e-10 is
more than one ulp in each number of the scene would allow.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from promise import Trial, attack

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, natural_modes
from modal.statespace import frequency_response, state_space, to_modal_form

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from response_oracle import Oracle

PROMISED = 1e-10
NOTHING = 1e-60
"""Magnitude that the oracle's digits leave of a zero."""
FREQUENCIES = 3
KINDS = ("plain", "plain", "sprung", "damped", "dragged", "ratio", "ratios and dampers")


def random_scene(rng: random.Random) -> tuple[Scene, str]:
    """A scene and what acts in it."""
    kind = rng.choice(KINDS)

    def link() -> Bob | Rod | Body:
        m, l = (10 ** rng.uniform(-1, 1) for _ in range(2))
        more = {}
        if kind in ("sprung", "damped", "dragged", "ratios and dampers") and rng.random() < 0.6:
            more["stiffness"] = m * l * 10 ** rng.uniform(-2, 2)
        if kind in ("damped", "ratios and dampers") and rng.random() < 0.6:
            more["damping"] = m * l * 10 ** rng.uniform(-3, 0)
        if kind == "dragged" and rng.random() < 0.6:
            more["drag"] = m * 10 ** rng.uniform(-3, 0)
        c, gyration = l * rng.uniform(0.2, 1.2), m * l * l * rng.uniform(0, 0.3)
        body = Body(mass=m, length=l, centre=c, inertia=gyration, **more)
        return rng.choice([Bob(mass=m, length=l, **more), Rod(mass=m, length=l, **more), body])

    number = rng.choice([1, 1, 2, 3])
    pendula = [
        Pendulum(
            links=tuple(link() for _ in range(rng.randint(1, 8 if number == 1 else 3))), count=rng.choice([1, 1, 2])
        )
        for _ in range(number)
    ]
    held = {"stiffness": rng.choice([0.0, 3.7]), "damping": 0.6 if "damp" in kind else 0.0}
    support = rng.choice([Fixed(), Cart(mass=10 ** rng.uniform(-1, 2)), Cart(mass=10 ** rng.uniform(-1, 2), **held)])
    ratio = 10 ** rng.uniform(-4, -1) if "ratio" in kind else 0.0
    return Scene(gravity=9.81, support=support, pendulum=tuple(pendula), damping_ratio=ratio), kind


def signals(rng: random.Random, *, cart: bool, drag: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """One prescribed motion or none, with all forces, and all outputs that are finite then."""
    drives = ["", *(["cart_velocity"] if cart else []), *(["cart_acceleration"] if cart and not drag else [])]
    drives += [] if drag else ["support_displacement", "support_velocity", "support_acceleration"]
    drive = rng.choice(drives)
    inputs = ("joint_torques", "link_forces", *([drive] if drive else []))
    if cart and not drive.startswith("cart"):
        inputs = ("cart_force", *inputs)
    outputs = ("angles", "relative_angles", "joint_positions", "tip_positions", *(["cart_position"] if cart else []))
    if drive != "support_displacement":
        outputs += ("rates", "relative_rates", *(["cart_velocity"] if cart else []))
        if drive not in ("cart_velocity", "support_velocity"):
            outputs += ("tip_accelerations", "pivot_forces")
    return inputs, outputs


def trials(seed: int) -> Iterator[Trial]:
    """The worst magnitude of all at each of three frequencies."""
    rng = random.Random(seed)
    scene, kind = random_scene(rng)
    modes = natural_modes(scene)
    inputs, outputs = signals(rng, cart=isinstance(scene.support, Cart), drag=kind == "dragged")
    form, oracle = to_modal_form(modes, state_space(scene, inputs, outputs)), Oracle(scene)
    sources, read = ([signal.name for signal in every] for every in (form.model.inputs, form.model.outputs))
    swings = modes.omega[modes.omega > 0]
    for _ in range(FREQUENCIES):
        omega = float(np.exp(rng.uniform(np.log(1e-6 * swings.min()), np.log(1e6 * swings.max()))))
        response, true = frequency_response(form, omega)[..., 0], oracle.response(sources, read, omega)
        worst, where = -1.0, ""
        for row, output in enumerate(read):
            for column, source in enumerate(sources):
                size = abs(true[row, column])
                off = abs(complex(response[row, column]) - true[row, column])
                error = float(off / size) if size > NOTHING else float(off > NOTHING)
                if not error <= worst:
                    worst, where = error, f"{output} for {source}"
        yield Trial(f"{kind}, ω = {omega:.3g} rad/s, {where}", worst, PROMISED)


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=100, quick=6)
