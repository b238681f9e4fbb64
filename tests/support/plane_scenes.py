"""Seeded plane scenes with everything that acts in them, and states of them far from rest."""

from __future__ import annotations

from math import sin

import numpy as np

from modal.scene import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene
from nonlinear.dynamics import Minimal, Recursion
from nonlinear.system import AppliedForces, Load, State, System

Generator = np.random.Generator


def random_link(rng: Generator, kind: str) -> Bob | Rod | Body:
    m, l, c, gyration = rng.uniform(0.3, 2.0, 4)
    joint = {"stiffness": rng.choice([0.0, 5.0]) * c, "damping": rng.choice([0.0, 0.5]) * c}
    if kind == "body":
        return Body(mass=m, length=l, centre=c * l, inertia=rng.choice([0.0, 1.0]) * m * (gyration * l) ** 2, **joint)
    return (Bob if kind == "bob" else Rod)(mass=m, length=l, **joint)


def random_pendulum(rng: Generator, top: str) -> Pendulum:
    kinds = [top, *rng.choice(["bob", "rod", "body"], rng.integers(0, 5))]
    ways = tuple(rng.choice(["down", "up"], len(kinds)).tolist())
    return Pendulum(
        links=tuple(random_link(rng, kind) for kind in kinds), equilibrium=ways, count=int(rng.integers(1, 3))
    )


def plane_scene(seed: int) -> Scene:
    """Fixed supports, carts heavy, light and massless; a rod on top keeps the massless cart's motion determined."""
    rng = np.random.default_rng(seed)
    tops = ["rod", *rng.choice(["bob", "rod", "body"], rng.integers(0, 4))]
    mass = [None, 0.0, 0.2, 3.0, 100.0][seed % 5]
    spring, damper = rng.choice([0.0, 4.0]), rng.choice([0.0, 0.7])
    support = Fixed() if mass is None else Cart(mass=mass, stiffness=spring, damping=damper)
    return Scene(gravity=9.81, support=support, pendulum=tuple(random_pendulum(rng, top) for top in tops))


def random_state(system: System, seed: int) -> State:
    rng = np.random.default_rng(seed)
    angles, rates = rng.uniform(-np.pi, np.pi, system.n_links), 2 * rng.normal(size=system.n_links)
    cart, cart_rate = rng.normal(size=2) if system.cart else (0.0, 0.0)
    return State(angles, rates, float(cart), float(cart_rate))


def minimal(system: System, load: Load | None = None) -> Minimal:
    return Minimal(system, tuple(Recursion(group) for group in system.groups), load)


def blowing(time: float, state: State) -> AppliedForces:
    """A load of time and of the state, on everything."""
    moments = 0.3 * np.cos(state.links + time) - 0.1 * state.link_rates
    return AppliedForces(sin(3 * time) - 0.2 * state.cart, moments)
