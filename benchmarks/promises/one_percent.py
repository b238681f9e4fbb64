"""The angle of 1 % of a row without a star is within 3 % of that of the mode's periodic orbits."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, inf, isfinite

import numpy as np
from promise import Trial, attack

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, natural_modes
from modal.errors import ComputationError
from nonlinear.orbits import orbit_where_off

PROMISED, FARTHEST = 0.03, 90.0


def link(rng: np.random.Generator) -> Bob | Rod | Body:
    """A bob, a rod or a body, one in four with a spring at its joint."""
    mass, length = float(rng.uniform(0.2, 3)), float(rng.uniform(0.3, 2))
    spring = {"stiffness": float(rng.uniform(0.1, 5))} if rng.random() < 0.25 else {}
    kind = rng.integers(3)
    if kind == 2:
        size = {
            "centre": float(rng.uniform(0.2, 0.9)) * length,
            "inertia": mass * (float(rng.uniform(0.1, 0.5)) * length) ** 2,
        }
        return Body(mass=mass, length=length, **size, **spring)
    return (Bob, Rod)[kind](mass=mass, length=length, **spring)


def scene_of(seed: int) -> Scene:
    """One or two pendula of one to three links, on a fixed support, a free or a held cart."""
    rng = np.random.default_rng(seed)
    pendula = [Pendulum(links=[link(rng) for _ in range(rng.integers(1, 4))]) for _ in range(rng.integers(1, 3))]
    cart = Cart(mass=float(rng.uniform(0.3, 8)), stiffness=float(rng.uniform(5, 100)) if rng.random() < 0.5 else 0.0)
    support = Fixed() if rng.random() < 0.25 else cart
    return Scene(gravity=float(rng.uniform(3, 17)), support=support, pendulum=pendula)


def trials(seed: int) -> Iterator[Trial]:
    """Every row without a star whose angle is printed, against the orbit that is 1 % off."""
    scene = scene_of(seed)
    for mode in natural_modes(scene):
        angle = mode.linear_to_1_percent_deg
        if mode.omega == 0 or mode.resonances or not isfinite(angle) or angle > FARTHEST:
            continue
        try:
            orbit = orbit_where_off(scene, mode.number)
        except ComputationError:
            continue
        true = degrees(orbit.amplitude) if orbit else inf
        yield Trial(f"mode {mode.number}, {angle:.4g} deg, orbit {true:.4g} deg", abs(angle / true - 1), PROMISED)


if __name__ == "__main__":
    attack(str(__doc__), trials, cases=60, quick=3)
