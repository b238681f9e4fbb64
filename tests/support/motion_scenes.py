"""Seeded random scenes for the simulator, with starts, of ordinary proportions."""

from __future__ import annotations

import random

import numpy as np

from modal.scene import Bob, Body, Cart, Fixed, InitialCondition, Pendulum, Rod, Scene
from nonlinear.system import State, system_of


def motion_scene(
    seed: int, *, damped: bool = True, sprung: bool = True, standing: bool = True, longest: int = 4, most: int = 3
) -> Scene:
    """One to `most` pendula of one to `longest` links, on a cart or not, some joints with springs and dampers."""
    rng = random.Random(seed)

    def link() -> Bob | Rod | Body:
        given = {"mass": rng.uniform(0.2, 3), "length": rng.uniform(0.3, 2)}
        if damped and rng.random() < 0.3:
            given["damping"] = rng.uniform(0.01, 0.3) * given["mass"] * given["length"] ** 2
        if sprung and rng.random() < 0.3:
            given["stiffness"] = rng.uniform(0.1, 5) * given["mass"] * given["length"] ** 2
        kind = rng.choice([Bob, Rod, Body])
        if kind is Body:
            given |= {
                "centre": rng.uniform(0.4, 1.3) * given["length"],
                "inertia": rng.choice([0.0, rng.uniform(0, 1)]),
            }
        return kind(**given)

    def pendulum() -> Pendulum:
        n = rng.randint(1, longest)
        angles = tuple(rng.uniform(-170, 170) for _ in range(n))
        rates = tuple(rng.uniform(-85, 85) for _ in range(n))
        rest = tuple(rng.choice(["down", "up"]) for _ in range(n)) if standing and rng.random() < 0.2 else None
        start = InitialCondition(angles_deg=angles, rates_deg=rates)
        return Pendulum(links=tuple(link() for _ in range(n)), start=start, equilibrium=rest)

    support: Fixed | Cart = Fixed()
    if rng.random() < 0.7:
        spring, damper = (rng.choice([0.0, rng.uniform(0.1, 30)]) for _ in range(2))
        support = Cart(mass=rng.uniform(0.5, 20), stiffness=spring * sprung, damping=damper * damped)
    pendula = tuple(pendulum() for _ in range(rng.randint(1, most)))
    return Scene(gravity=rng.uniform(1, 15), support=support, pendulum=pendula)


def random_state(scene: Scene, seed: int) -> State:
    """Any state of a plane scene, links turning either way."""
    rng, size = np.random.default_rng(seed), system_of(scene).n_links
    cart, cart_rate = rng.normal(size=2) if scene.support.kind == "cart" else (0.0, 0.0)
    return State(rng.uniform(-4, 4, size), 2 * rng.normal(size=size), float(cart), float(cart_rate))
